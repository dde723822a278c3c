//! From a scenario to an equilibrium.

mod apart;
mod assembly;
mod intrinsic;
mod ritz;
mod search;

use crate::belt::Belt;
use crate::guess::{guess, waved};
use crate::lie::Pose;
use crate::names::named;
use crate::program::{BeltPoint, BeltProgram, Piece};
use crate::scenario::{BeltSpec, LinkSpec, Method, SAME_PLACE, Scenario, SupportSpec};
use crate::solver::{self, Inertia, Residuals, Solution, Stationary};
use crate::spine::Spine;
use crate::stability::Stability;
use crate::strip::{Edge, FURTHER};
use nalgebra::{Vector2, Vector3};
use serde::Serialize;
use std::ops::ControlFlow;

named! {
    /// How a solve ended.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
    pub enum Status {
        /// All residuals are within the tolerance.
        Converged = "converged",
        /// No shape of the belt can meet the supports.
        Infeasible = "infeasible",
        /// The search ended without meeting the tolerance.
        NotConverged = "not_converged",
    }
}

/// A force and a moment about the point where they act, world axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wrench {
    /// Force.
    pub force: Vector3<f64>,
    /// Moment.
    pub moment: Vector3<f64>,
}

/// What a support does to the belt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reaction {
    /// Arc length of the support from the start.
    pub at: f64,
    /// Force and moment on the belt about the support point: the gradient of the least energy by the support's
    /// translation and left, world-axes rotation.
    pub wrench: Wrench,
}

/// What a link does to the belt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkForce {
    /// Force on the belt at the link's point `to`, world axes; at `from` acts the opposite.
    pub force: Vector3<f64>,
}

/// The outcome of a solve, in the units of the scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Equilibrium {
    /// The input, normalised.
    pub scenario: Scenario,
    /// How the solve ended.
    pub status: Status,
    /// One line for people: how it ended, and what to try.
    pub message: String,
    /// What should be known before the result is relied on, one line each.
    pub warnings: Vec<String>,
    /// Total potential, loads included.
    pub energy: f64,
    /// Elastic energy alone.
    pub elastic_energy: f64,
    /// The shape.
    pub spine: Spine,
    /// Torsion ω_η at every node.
    pub torsion: Vec<f64>,
    /// What the belt beyond every node does to the part before it; empty where the method knows no forces.
    pub internal: Vec<Wrench>,
    /// What each support does to the belt, in the order of the scenario; empty where the method knows no forces.
    pub reactions: Vec<Reaction>,
    /// What each link does to the belt, in the order of the scenario.
    pub links: Vec<LinkForce>,
    /// Signed half turns of a closed belt as it ended, `None` of an open one.
    pub half_turns: Option<i32>,
    /// The second variation, where it can be decided.
    pub stability: Option<Stability>,
    /// How far the shape is from a solution of its discrete equations, lengths in U and energy in mean R_f/U.
    pub residuals: Residuals,
    /// Iterations, over all attempts.
    pub iterations: usize,
    /// The programme that was solved; `None` where the method knows no multipliers.
    pub(crate) solved: Option<Solved>,
}

/// A programme and its solution.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Solved {
    pub(crate) program: BeltProgram,
    pub(crate) at: Stationary<BeltPoint>,
    pub(crate) inertia: Option<Inertia>,
    pub(crate) units: Units,
    /// Where the programme has its origin.
    pub(crate) origin: Vector3<f64>,
    /// The supports and links that hold the same twice over, by name.
    pub(crate) said_twice: Option<String>,
    /// Whether a part of the belt has stayed flat under load.
    pub(crate) is_flat: bool,
}

/// Units of length and energy of a programme in which lengths are in U and energy in mean R_f/U.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Units {
    pub(crate) length: f64,
    pub(crate) energy: f64,
}

impl Units {
    fn of(belt: &Belt) -> Self {
        Self {
            length: belt.length(),
            energy: belt.mean_rigidity() / belt.length(),
        }
    }

    /// The unit of force.
    pub(crate) fn force(&self) -> f64 {
        self.energy / self.length
    }
}

impl Equilibrium {
    /// The longest way in U from a node to the same place of the same belt in another shape.
    pub(crate) fn displacement(&self, other: &Self) -> f64 {
        let length = self.spine.length();
        let u = &other.spine.u;
        let way = |(at, pose): (&f64, &Pose)| {
            let next = u.partition_point(|u| *u < at - SAME_PLACE * length);
            let next = next.clamp(1, u.len() - 1);
            let share = ((at - u[next - 1]) / (u[next] - u[next - 1])).clamp(0.0, 1.0);
            let [a, b] = [next - 1, next].map(|k| other.spine.pose[k].position);
            (a.lerp(&b, share) - pose.position).norm() / length
        };
        let places = self.spine.u.iter().zip(&self.spine.pose);
        places.map(way).fold(0.0, f64::max)
    }

    /// The same equilibrium, minimum or not, on a mesh of another number of elements; `None` where none is found next to it.
    ///
    /// `proceed` is asked once an iteration whether to go on.
    pub fn refined(
        &self,
        elements: usize,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Self> {
        /// Farther off, in U, it is another one.
        const NEAR: f64 = 0.1;
        let solved = self.solved.as_ref()?;
        let mut scenario = self.scenario.clone();
        scenario.solver.elements = Some(elements);
        let program = program_of(&scenario, elements);
        let shape = search::prolong(&solved.program, &solved.at.point, &program);
        if self.stability.is_none_or(|s| s.negative_modes == 0) {
            let found = minimum_next_to(&scenario, &shape, proceed);
            let is_near = self.displacement(&found) <= NEAR;
            return (found.status == Status::Converged && is_near).then_some(found);
        }
        let (from, bounds) = (&solved.program, &solved.at.bound_multipliers);
        let at = Stationary {
            point: shape,
            multipliers: solved.at.multipliers.clone(),
            bound_multipliers: search::prolong_bounds(from, bounds, &program),
        };
        let solution = solver::settle(&program, scenario.solver.tolerance, at)?;
        let is_like = solution.inertia == solved.inertia;
        is_like.then(|| of_solution(&scenario, program, solution))
    }
}

/// Where a search begins.
#[derive(Clone, Copy)]
enum Start<'a> {
    /// At the guess.
    Guess,
    /// At a shape near to a minimum; anew where that leads to none.
    Near(&'a BeltPoint),
    /// At a shape that need not be near to any, and nowhere else.
    Shape(&'a BeltPoint),
    /// At a shape very near to a minimum, and nowhere else.
    Close(&'a BeltPoint),
}

/// Finds an equilibrium of a scenario that [`Scenario::validate`] passes.
///
/// `proceed` is asked once an iteration whether to go on; `Break` ends the solve as not converged.
///
/// Source: Sec. II-D, in the two fields bend and rib slope; Sec. III where the scenario asks for the source's method.
///
/// # Panics
///
/// If the scenario asks for what [`Scenario::validate`] refuses.
pub fn solve(scenario: &Scenario, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> Equilibrium {
    let belt = Belt::new(&scenario.belt).expect("a validated scenario");
    match scenario.solver.method {
        Method::Intrinsic => intrinsic::solve(scenario, &belt, Start::Guess, proceed),
        Method::Ritz => ritz::solve(scenario, &belt, proceed),
    }
}

/// The same from a shape in place of the guess, and from nowhere else: bend and rib slope at equal steps of the arc length
/// from start to end. Where it has no first-order conditions, the source's method takes no heed of it.
///
/// # Panics
///
/// If the scenario asks for what [`Scenario::validate`] refuses, or there are not as many slopes as bends, or fewer than two.
pub fn solve_from(
    scenario: &Scenario,
    bend: &[f64],
    rib_slope: &[f64],
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    assert!(bend.len() == rib_slope.len() && bend.len() > 1);
    let belt = Belt::new(&scenario.belt).expect("a validated scenario");
    match scenario.solver.method {
        Method::Intrinsic => {
            let program = program_of(scenario, scenario.elements());
            let guess = guess(&program, &Vector3::from(scenario.solver.bulge));
            let shape = waved(&program, &guess, 0.0, &|u| {
                let at = |values: &[f64]| {
                    let place = u * (values.len() - 1) as f64;
                    let before = (place as usize).min(values.len() - 2);
                    let share = place - before as f64;
                    values[before] + share * (values[before + 1] - values[before])
                };
                Vector2::new(at(bend) * belt.length(), at(rib_slope))
            });
            intrinsic::solve(scenario, &belt, Start::Shape(&shape), proceed)
        }
        Method::Ritz => ritz::solve(scenario, &belt, proceed),
    }
}

/// The same from a shape on the scenario's mesh that is near to a minimum; anew where it leads to none.
pub(crate) fn solve_near(
    scenario: &Scenario,
    shape: &BeltPoint,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    let belt = Belt::new(&scenario.belt).expect("a validated scenario");
    intrinsic::solve(scenario, &belt, Start::Near(shape), proceed)
}

/// The minimum that a search finds from a shape on the scenario's mesh, and from nowhere else.
pub(crate) fn minimum_from(
    scenario: &Scenario,
    shape: &BeltPoint,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    let belt = Belt::new(&scenario.belt).expect("a validated scenario");
    intrinsic::solve(scenario, &belt, Start::Shape(shape), proceed)
}

/// The minimum next to a shape on the scenario's mesh.
pub(crate) fn minimum_next_to(
    scenario: &Scenario,
    shape: &BeltPoint,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    let belt = Belt::new(&scenario.belt).expect("a validated scenario");
    intrinsic::solve(scenario, &belt, Start::Close(shape), proceed)
}

/// The equilibrium of a solution that was found by other means.
pub(crate) fn of_solution(
    scenario: &Scenario,
    program: BeltProgram,
    solution: Solution<BeltPoint>,
) -> Equilibrium {
    let belt = Belt::new(&scenario.belt).expect("a validated scenario");
    intrinsic::of_solution(scenario, &belt, program, solution)
}

/// The programme of a scenario on a mesh of so many elements, no rib held by edges beyond its own stretch.
pub(crate) fn program_of(scenario: &Scenario, elements: usize) -> BeltProgram {
    let belt = Belt::new(&scenario.belt).expect("a validated scenario");
    assembly::Assembly::new(scenario, &belt).program(elements)
}

/// The mesh of an equilibrium, and the edges that hold its ribs: what stays the same while it is followed.
#[derive(Debug, Clone)]
pub(crate) struct Mesh {
    shares: Vec<usize>,
    further: Vec<Option<[Option<Edge>; FURTHER]>>,
}

impl Mesh {
    /// That of a programme of a scenario.
    pub(crate) fn of(scenario: &Scenario, program: &BeltProgram) -> Self {
        let belt = Belt::new(&scenario.belt).expect("a validated scenario");
        let further = |piece: &Piece| match piece {
            Piece::Strip(element) => Some(element.further),
            Piece::Rigid { .. } | Piece::Joint { .. } => None,
        };
        Self {
            shares: assembly::Assembly::new(scenario, &belt).shares(scenario.elements()),
            further: program.pieces.iter().map(further).collect(),
        }
    }

    /// The programme of a scenario on it; `None` where its stretches are others.
    pub(crate) fn program(&self, scenario: &Scenario) -> Option<BeltProgram> {
        let belt = Belt::new(&scenario.belt).expect("a validated scenario");
        let assembly = assembly::Assembly::new(scenario, &belt);
        let mut program = assembly.program_shared(&self.shares)?;
        if program.pieces.len() != self.further.len() {
            return None;
        }
        for (piece, held) in program.pieces.iter_mut().zip(&self.further) {
            match (piece, held) {
                (Piece::Strip(element), Some(held)) => element.further = *held,
                (Piece::Rigid { .. } | Piece::Joint { .. }, None) => (),
                _ => return None,
            }
        }
        Some(program)
    }
}

/// Whether the ribs of a shape are apart on the whole board.
pub(crate) fn is_settled(scenario: &Scenario, program: &BeltProgram, point: &BeltPoint) -> bool {
    let belt = Belt::new(&scenario.belt).expect("a validated scenario");
    intrinsic::is_settled(scenario, &belt, program, point)
}

/// Two points of the belt that are held at a distance from each other.
struct Span {
    /// Who holds them, and where.
    held: String,
    distance: f64,
    /// The belt between them.
    belt: f64,
    /// What rounding may do to the distance.
    rounding: f64,
}

impl Span {
    /// Supports that follow each other, all round a closed belt, and the ends of links.
    fn all(scenario: &Scenario) -> impl Iterator<Item = Self> {
        let (belt, supports) = (&scenario.belt, &scenario.supports);
        let count = supports.len();
        let pairs = match belt.closed {
            true => count,
            false => count.saturating_sub(1),
        };
        let pairs = (0..pairs).map(move |i| [i, (i + 1) % count]);
        let links = scenario.links.iter().enumerate();
        pairs
            .map(|pair| Self::between(pair, supports, belt))
            .chain(links.map(|(i, link)| Self::of_link(i, link, belt)))
    }

    /// Between two supports, along the axes that both hold.
    fn between([i, j]: [usize; 2], supports: &[SupportSpec], belt: &BeltSpec) -> Self {
        let length = belt.length();
        let [x, x_next] = [i, j].map(|k| supports[k].components());
        let held = (0..3).filter_map(|k| x[k].zip(x_next[k]));
        let (square, size) = held.fold((0.0, 0.0), |(square, size), (a, b)| {
            (
                square + (b - a) * (b - a),
                f64::max(size, a.abs().max(b.abs())),
            )
        });
        let u = [i, j].map(|k| supports[k].at.arc_length(length));
        let [at, at_next] = u.map(number);
        Self {
            held: format!("supports[{i}] and supports[{j}], at u = {at} and u = {at_next},"),
            distance: f64::sqrt(square),
            belt: belt_between(u, belt),
            rounding: 1e-12 * length + 4.0 * f64::EPSILON * size,
        }
    }

    fn of_link(i: usize, link: &LinkSpec, belt: &BeltSpec) -> Self {
        let u = [link.from, link.to].map(|place| place.arc_length(belt.length()));
        let [from, to] = u.map(number);
        Self {
            held: format!("the ends of links[{i}], at u = {from} and u = {to},"),
            distance: Vector3::from(link.offset).norm(),
            belt: belt_between(u, belt),
            rounding: 1e-12 * belt.length(),
        }
    }

    /// By how much the distance exceeds the belt in between.
    fn excess(&self) -> f64 {
        self.distance - self.belt
    }
}

/// Length of belt between two points, of a closed one the shorter way round.
fn belt_between(u: [f64; 2], belt: &BeltSpec) -> f64 {
    let way = (u[1] - u[0]).abs();
    match belt.closed {
        true => way.min(belt.length() - way),
        false => way,
    }
}

/// Says by how much two points are held too far apart for the belt between them, where they are.
pub(crate) fn excess_distance(scenario: &Scenario) -> Option<String> {
    let too_long = Span::all(scenario).find(|span| span.excess() > span.rounding)?;
    Some(format!(
        "{} are {} apart, {} more than the belt between them ({}); move them closer",
        too_long.held,
        number(too_long.distance),
        number(too_long.excess()),
        number(too_long.belt)
    ))
}

/// Whether two points are held so far apart that the belt between them has no slack to determine its reactions.
fn is_taut(scenario: &Scenario) -> bool {
    const SLACK: f64 = 1e-6;
    Span::all(scenario).any(|span| span.belt > 0.0 && span.excess() > -SLACK * span.belt)
}

/// A number for people, six decimals or the exponent that it needs.
fn number(value: f64) -> String {
    if value == 0.0 || (1e-3..1e6).contains(&value.abs()) {
        let text = format!("{value:.6}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{value:.6e}")
    }
}
