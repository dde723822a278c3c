//! The equilibrium of a problem: its search and its data.

mod accuracy;
mod active_set;
mod buckled;
mod flat;
pub(crate) mod guess;
mod intrinsic;
mod judged;
mod lifted;
pub(crate) mod model;
mod refinement;
mod search;
pub(crate) mod shell;
mod side;
mod sliding;
mod spans;
mod stability;
mod warnings;
mod winding;

use crate::names::named;
pub use accuracy::MeshError;
pub use stability::Stability;
pub(crate) use stability::left_free;

use crate::geometry::{Pose, Wrench};
use crate::problem::program::{BeltPoint, BeltProgram};
use crate::problem::{Mesh, Problem};
use crate::scenario::{SAME_PLACE, Scenario};
use crate::strip::developable::DevelopableEnergy;
use crate::strip::shell::{FIELDS, Shell};
use crate::strip::spine::Spine;
use crate::surface::{HighestPoint, highest_point};
use accuracy::Estimate;
use guess::{folded_band, guess, waved};
use model::StripModel;
use nalgebra::{Vector2, Vector3};
use stagewise::{Inertia, Multipliers, Residuals, Stationary, Values};
use std::ops::ControlFlow;
use std::sync::OnceLock;
use thiserror::Error;

pub(crate) use intrinsic::of_solution;
pub(crate) use lifted::Flat;
pub(crate) use refinement::largest_change;

named! {
    /// How a solve ended.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Status {
        /// All residuals are within the tolerance.
        Converged = "converged",
        /// No shape of the belt can meet the supports.
        Infeasible = "infeasible",
        /// The search ended without meeting the tolerance.
        NotConverged = "not_converged",
    }
}

/// The reaction of a support on the belt.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct Reaction {
    /// Arc length of the support from the start.
    pub at: f64,
    /// Force and moment on the belt about the support point: the gradient of the least energy by the support's
    /// translation and left, world-axes rotation. A component is NaN where the shape does not determine it.
    pub wrench: Wrench,
}

/// The force of a link on the belt.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct LinkForce {
    /// Force on the belt at the link's point `to`, world axes; at `from` acts the opposite. A component is NaN where the
    /// shape does not determine it.
    pub force: Vector3<f64>,
}

/// The outcome of a solve, in the units of its scenario.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct Equilibrium {
    /// The solved problem.
    pub(crate) problem: Problem,
    /// How the solve ended.
    pub status: Status,
    /// One line for people: how the solve ended, and what to try.
    pub message: String,
    /// Warnings of the solve itself, one line each.
    pub(crate) warnings: Vec<String>,
    /// Total potential, loads included.
    pub energy: f64,
    /// Elastic energy alone.
    pub elastic_energy: f64,
    /// The shape.
    pub spine: Spine,
    /// Torsion ω_η at every node.
    pub torsion: Vec<f64>,
    /// Internal force and moment at every node, of the belt beyond on the part before; a component is NaN where the shape does
    /// not determine it. Empty where the method has no forces.
    pub internal: Vec<Wrench>,
    /// Reaction of each support, in the order of the scenario; empty where the method has no forces.
    pub reactions: Vec<Reaction>,
    /// Force of each link, in the order of the scenario.
    pub links: Vec<LinkForce>,
    /// Signed half turns of the closed belt found; `None` of an open belt.
    pub half_turns: Option<i32>,
    /// Stability by the second variation, where it is decided.
    pub stability: Option<Stability>,
    /// Largest residual of the shape's discrete equations, lengths in U and energy in mean R_f/U.
    pub residuals: Residuals,
    /// Iterations, over all attempts.
    pub iterations: usize,
    /// The error by the mesh, once it has been estimated.
    #[cfg_attr(feature = "io", serde(with = "crate::serial::once"))]
    pub(crate) error: OnceLock<Option<MeshError>>,
    /// The solved programme; `None` where the method has no multipliers.
    pub(crate) solved: Option<AnySolved>,
}

/// The reason why a result has no modes, no derivatives and no continuation.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Uncertified {
    /// The method of the solve has no first-order conditions that its result meets.
    #[error(
        "the source's method knows no multipliers, so that its result is no equilibrium: use solver.method = \"intrinsic\""
    )]
    NoMultipliers,
    /// The solve has not converged.
    #[error(
        "the solve has not converged and leaves nothing to follow or to differentiate: {message}"
    )]
    NotConverged {
        /// How the solve ended.
        message: String,
    },
}

named!(impl Uncertified {
    NoMultipliers = "no_multipliers",
    NotConverged = "not_converged",
});

/// The solved programme of a belt.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum AnySolved {
    /// Of a developable belt.
    Developable(Box<Solved>),
    /// Of a strip of finite thickness.
    Shell(Box<Solved<Shell, FIELDS, 12>>),
}

/// A programme and its solution.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Solved<D = DevelopableEnergy, const F: usize = 2, const N: usize = 8> {
    pub(crate) program: BeltProgram<D, F, N>,
    pub(crate) at: Stationary<BeltPoint<F>>,
    pub(crate) values: Values,
    pub(crate) inertia: Option<Inertia>,
    /// The supports and links whose constraints are redundant, by name.
    pub(crate) redundant: Option<String>,
    /// Whether a part of the belt has stayed flat under load.
    pub(crate) is_flat: bool,
    /// Whether this is an equilibrium of its mesh, and of the belt perhaps on a finer one: elements turn too far.
    pub(crate) is_of_mesh_alone: bool,
}

impl Equilibrium {
    /// The solved problem.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// The input, normalised.
    pub fn scenario(&self) -> &Scenario {
        self.problem.scenario()
    }

    /// The point of the spine farthest along `solver.bulge`.
    pub fn highest_point(&self) -> HighestPoint {
        highest_point(&self.spine, &self.problem.bulge())
    }

    /// The estimated error by the mesh, found by the equilibrium of the mesh of elements half as long; `None` of a solve that
    /// has not converged by a method with multipliers, and where that mesh has no equilibrium next to this one.
    pub fn error(&self) -> Option<MeshError> {
        self.error_while(&mut || ControlFlow::Continue(()))
    }

    /// As [`Self::error`]; `proceed` is asked once an iteration whether to go on, and `Break` leaves the error unknown.
    pub fn error_while(&self, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> Option<MeshError> {
        if let Some(known) = self.error.get() {
            return *known;
        }
        let mut stopped = false;
        let estimate = self.estimated_error(&mut || {
            let answer = proceed();
            stopped |= answer.is_break();
            answer
        });
        match stopped {
            true => None,
            false => *self.error.get_or_init(|| estimate),
        }
    }

    fn estimated_error(&self, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> Option<MeshError> {
        let solved = match self.certified_any().ok()? {
            AnySolved::Developable(solved) => solved,
            AnySolved::Shell(solved) => return shell::error(&self.problem, solved, proceed),
        };
        let estimate = Estimate::new(
            &self.problem,
            &solved.program,
            &solved.at,
            solved.values.objective,
            true,
            proceed,
        );
        Some(estimate?.error)
    }

    /// The programme and its solution, from which every other computation starts, if the solve has converged by a method
    /// with multipliers.
    ///
    /// # Errors
    ///
    /// [`Uncertified`] otherwise.
    pub(crate) fn certified_any(&self) -> Result<&AnySolved, Uncertified> {
        let solved = self.solved.as_ref().ok_or(Uncertified::NoMultipliers)?;
        match self.status {
            Status::Converged => Ok(solved),
            Status::Infeasible | Status::NotConverged => Err(self.not_converged()),
        }
    }

    /// As [`Self::certified_any`], of a model of the strip.
    pub(crate) fn certified<D: StripModel<F, N>, const F: usize, const N: usize>(
        &self,
    ) -> Result<&Solved<D, F, N>, Uncertified> {
        D::solved(self.certified_any()?).ok_or_else(|| self.not_converged())
    }

    fn not_converged(&self) -> Uncertified {
        Uncertified::NotConverged {
            message: self.message.clone(),
        }
    }

    /// The programme of a developable belt and its solution, converged or not.
    pub(crate) fn developable(&self) -> Option<&Solved> {
        DevelopableEnergy::solved(self.solved.as_ref()?)
    }

    /// Whether this is an equilibrium of its mesh, be it one of the belt or not.
    pub(crate) fn is_of_its_mesh(&self) -> bool {
        self.solved_on_mesh::<DevelopableEnergy, 2, 8>().is_some()
    }

    /// The programme and its solution, if this is an equilibrium of its mesh, be it one of the belt or not.
    pub(crate) fn solved_on_mesh<D: StripModel<F, N>, const F: usize, const N: usize>(
        &self,
    ) -> Option<&Solved<D, F, N>> {
        let is_converged = self.status == Status::Converged;
        let solved = D::solved(self.solved.as_ref()?);
        solved.filter(|solved| is_converged || solved.is_of_mesh_alone)
    }

    /// Whether the solve has converged, to a minimum as far as is known.
    fn is_minimum(&self) -> bool {
        self.status == Status::Converged && self.stability.is_none_or(|s| s.negative_modes == 0)
    }

    /// The largest displacement in U of a node to the same place of the same belt in another shape.
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

    /// The same minimum on a mesh that follows the error, for a problem that asks for this; `None` where this leads to no
    /// minimum, and of a saddle.
    pub(crate) fn refined_for(
        &self,
        problem: &Problem,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Self> {
        let solved = self.developable()?;
        let is_minimum = self.stability.is_none_or(|s| s.negative_modes == 0);
        if problem.has_fixed_mesh() || !is_minimum {
            return None;
        }
        let mesh = Mesh::of(&self.problem, &solved.program);
        let found = intrinsic::solve(problem, Start::Minimum(&mesh, &solved.at.point), proceed);
        (found.status == Status::Converged).then_some(found)
    }

    /// The same minimum on a mesh for shapes to which a path may lead: its own mesh is fine where the ribs of its own shape
    /// turn. `None` where the scenario fixes the mesh, of a saddle, of a belt so slender that such a mesh has too many
    /// elements, and where no minimum is found next to this one.
    pub(crate) fn for_paths(&self, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> Option<Self> {
        let solved = self.developable()?;
        if self.problem.has_fixed_mesh() || !self.is_minimum() {
            return None;
        }
        let mesh = refinement::mesh_for_ribs_anywhere(&self.problem, &solved.program)?;
        let found = self.minimum_on(&mesh, proceed)?;
        (self.displacement(&found) <= NEXT).then_some(found)
    }

    /// The minimum to which this one leads on the mesh of another.
    pub(crate) fn on_mesh_of(
        &self,
        other: &Self,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Self> {
        let mesh = Mesh::of(&self.problem, &other.developable()?.program);
        self.minimum_on(&mesh, proceed)
    }

    /// The minimum to which this one leads on another mesh; `None` if it leads to none.
    fn minimum_on(
        &self,
        mesh: &Mesh,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Self> {
        let solved = self.developable()?;
        let program = self.problem.program_on(mesh)?;
        let shape = search::prolong(&solved.program, &solved.at.point, &program);
        let found = DevelopableEnergy::minimum_next_to(&self.problem, mesh, &shape, proceed);
        found.is_minimum().then_some(found)
    }

    /// The same equilibrium, minimum or not, on a mesh of another number of elements; `None` if no equilibrium is found next
    /// to it, or if a scenario may not have so many elements.
    ///
    /// `proceed` is asked once an iteration whether to go on.
    pub fn refined(
        &self,
        elements: usize,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Self> {
        /// Displacement of nodes up to which the refined shape is the same equilibrium, in U.
        const NEAR: f64 = 0.05;
        let problem = self.problem.with_elements(elements).ok()?;
        let found = match problem.is_of_shell() {
            true => from_guess(&problem, proceed),
            false => self.led_to(&problem, proceed)?,
        };
        let is_same = found.status == Status::Converged && self.displacement(&found) <= NEAR;
        is_same.then_some(found)
    }

    /// The equilibrium, minimum or not, to which this one leads on the uniform mesh of another problem of the same belt, be it
    /// one of that mesh alone; `None` if it leads to none.
    pub(crate) fn led_to(
        &self,
        problem: &Problem,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Self> {
        let solved = self.developable()?;
        let program = problem.program(problem.elements());
        let shape = search::prolong(&solved.program, &solved.at.point, &program);
        if self.stability.is_none_or(|s| s.negative_modes == 0) {
            return self.minimum_led_to(problem, &shape, proceed);
        }
        let (from, multipliers) = (&solved.program, &solved.at.multipliers);
        let at = Stationary {
            point: shape,
            multipliers: Multipliers {
                equalities: multipliers.equalities.clone(),
                inequalities: search::prolong_inequalities(
                    from,
                    &multipliers.inequalities,
                    &program,
                ),
            },
        };
        let solution = stagewise::settle(&program, problem.tolerance(), at)?;
        let is_like = solution.inertia == solved.inertia;
        is_like.then(|| of_solution(problem, program, solution))
    }

    /// The minimum to which this one, prolonged to a shape on the uniform mesh of another problem, leads: of two searches
    /// from there, where the first leaves it, the nearer minimum.
    ///
    /// A search with a low barrier stays near, unless the shape on the other mesh is so rough that it goes astray.
    fn minimum_led_to(
        &self,
        problem: &Problem,
        shape: &BeltPoint,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Self> {
        let mesh = Mesh::uniform(problem, problem.elements());
        let mut from = |start| {
            let found = intrinsic::solve(problem, start, proceed);
            let displacement = self.displacement(&found);
            found.is_of_its_mesh().then_some((displacement, found))
        };
        let close = from(Start::Close(&mesh, shape));
        let nearest = match close {
            Some((displacement, _)) if displacement <= NEXT => close,
            _ => {
                let both = [close, from(Start::Near(&mesh, shape))];
                let found = both.into_iter().flatten();
                found.min_by(|a, b| a.0.total_cmp(&b.0))
            }
        };
        nearest.map(|(_, found)| found)
    }
}

/// Displacement of nodes up to which a minimum on another mesh is surely the same, in U.
const NEXT: f64 = 1e-3;

/// The start of a search.
#[derive(Clone, Copy)]
enum Start<'a> {
    /// At the guess.
    Guess,
    /// On a mesh, at a shape near to a minimum; at the guess if this leads to no minimum.
    Near(&'a Mesh, &'a BeltPoint),
    /// On meshes that follow the error, the first of which is given, at a minimum, and nowhere else.
    Minimum(&'a Mesh, &'a BeltPoint),
    /// At a shape of another programme, widened where the mesh follows the error of a slender belt, and nowhere else.
    Widened(&'a BeltProgram, &'a BeltPoint),
    /// At a shape that need not be near to a minimum, and nowhere else.
    Shape(&'a BeltPoint),
    /// On a mesh, at a shape very near to a minimum, and nowhere else.
    Close(&'a Mesh, &'a BeltPoint),
    /// On a mesh, at a shape from which to go downhill to the nearest minimum, and nowhere else.
    Downhill(&'a Mesh, &'a BeltPoint),
}

/// The equilibrium of a problem: of a strip of finite thickness next to that of the developable one; of a developable one
/// found from the guess, followed from a quarter turn where supports are turned by more than
/// half a turn, or brought back from a larger lift where supports hold a board nearly in its flat shape.
///
/// `proceed` is asked once an iteration whether to go on.
pub(crate) fn from_guess(
    problem: &Problem,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    if problem.is_of_shell() {
        return shell::solve(problem, proceed);
    }
    match winding::wound(problem, proceed) {
        Some(found) => found,
        None => lifted::brought_back(problem, proceed)
            .unwrap_or_else(|| beside_the_guess(problem, proceed)),
    }
}

/// A closed belt with the half turns that it was given: if it lost them as it was twisted up, the minimum that a search from a
/// folded band finds; without such a minimum the belt as it was found.
fn with_half_turns(
    found: Equilibrium,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    let problem = &found.problem;
    let given = problem.scenario().belt.half_turns.unwrap_or(0);
    if found.half_turns.is_none_or(|made| made == given) {
        return found;
    }
    let program = problem.program(problem.elements());
    let band = folded_band(&program, given, &problem.bulge());
    let mut other = minimum_from(problem, &band, proceed);
    let iterations = found.iterations + other.iterations;
    if other.is_minimum() && other.half_turns == Some(given) {
        other.iterations = iterations;
        return other;
    }
    Equilibrium {
        iterations,
        ..found
    }
}

/// The equilibrium that is found from the guess, with its half turns and on the side of the bulge where there is one.
fn beside_the_guess(
    problem: &Problem,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    let found = intrinsic::solve(problem, Start::Guess, proceed);
    let found = buckled::out_of_flat(found, proceed);
    side::on_side_of_bulge(with_half_turns(found, proceed), proceed)
}

/// The minimum that is found from bend and rib slope at equal steps of the arc length, and from nowhere else.
pub(crate) fn from_fields(
    problem: &Problem,
    bend: &[f64],
    rib_slope: &[f64],
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    if problem.is_of_shell() {
        let developable = shell::as_developable(problem);
        let found = from_fields(&developable, bend, rib_slope, proceed);
        return shell::next_to(problem, found, proceed);
    }
    let program = problem.program(problem.elements());
    let guess = guess(&program, &problem.bulge());
    let length = problem.units().length;
    let shape = waved(&program, &guess, 0.0, &|u| {
        let at = |values: &[f64]| {
            let place = u * (values.len() - 1) as f64;
            let before = (place as usize).min(values.len() - 2);
            let share = place - before as f64;
            values[before] + share * (values[before + 1] - values[before])
        };
        Vector2::new(at(bend) * length, at(rib_slope))
    });
    minimum_from(problem, &shape, proceed)
}

/// Whether a problem is that of a slender belt on a mesh that follows the error.
pub(crate) fn is_slender_on_graded_mesh(problem: &Problem) -> bool {
    !problem.has_fixed_mesh() && refinement::is_slender(problem)
}

/// The minimum that a search finds from a shape of a slender belt's programme, and nowhere else, on a mesh graded anew for this
/// shape and its error; `None` of a programme of another belt.
pub(crate) fn slender_minimum_near(
    problem: &Problem,
    program: &BeltProgram,
    shape: &BeltPoint,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Equilibrium> {
    let mesh = refinement::mesh_about_ribs(problem, program, shape);
    let graded = problem.program_on(&mesh)?;
    let shape = search::prolong(program, shape, &graded);
    Some(intrinsic::solve(
        problem,
        Start::Minimum(&mesh, &shape),
        proceed,
    ))
}

/// The minimum that a search finds from a shape on the uniform mesh of the problem's number of elements, and from nowhere
/// else.
pub(crate) fn minimum_from(
    problem: &Problem,
    shape: &BeltPoint,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    intrinsic::solve(problem, Start::Shape(shape), proceed)
}

/// A shape near to the minimum that a search finds from a shape on the uniform mesh of the problem's number of elements;
/// `None` if it finds none. `passed` gets the shapes on the way, each with its barrier in mean R_f/U, and ends the search
/// by `Break`.
pub(crate) fn near_minimum_from(
    problem: &Problem,
    shape: &BeltPoint,
    passed: &mut dyn FnMut(f64, &BeltPoint) -> ControlFlow<()>,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<BeltPoint> {
    let program = problem.program(problem.elements());
    let found = search::Search::of(problem).explore(&program, shape.clone(), passed, proceed);
    (found.outcome == stagewise::Outcome::Converged).then_some(found.at.point)
}

/// The minimum next to a shape on the uniform mesh of the problem's number of elements.
pub(crate) fn minimum_next_to(
    problem: &Problem,
    shape: &BeltPoint,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    let mesh = Mesh::uniform(problem, problem.elements());
    DevelopableEnergy::minimum_next_to(problem, &mesh, shape, proceed)
}
