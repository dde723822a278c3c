//! The mesh that follows the error: short elements where the fields change fast, long ones where nothing happens.

mod slender;

use super::accuracy::{Estimate, largest_error_by_a_step};
use super::active_set::settle;
use super::search::{Search, prolong, prolonged};
use crate::problem::program::{BeltPoint, BeltProgram};
use crate::problem::{Mesh, Problem};
use crate::scenario::SAME_PLACE;
use crate::strip::density::Density;
use crate::strip::element::Element;
use nalgebra::Vector2;
use slender::narrowed;
pub(super) use slender::{
    PER_WIDTH, is_slender, mesh_about_ribs, mesh_for_ribs_anywhere, ribs_turn, widened,
};
use stagewise::{Distance, Outcome, Solution, Stationary};
use std::ops::ControlFlow;

/// Elements of the first mesh, a number.
const FIRST: usize = 40;
/// Length of the longest elements of a mesh that is fine enough, in U: so short that it also suits shapes nearby.
const LONGEST: f64 = 0.0125;
/// Greatest number of elements of a mesh.
const MOST: usize = 20_000;
/// Greatest number of meshes.
const MESHES: usize = 12;
/// Greatest number of meshes that carry no equilibrium.
const FAILURES: usize = 3;
/// Turn of an element that is aimed at, in rad.
const TURN: f64 = 0.3;
/// Turn of an element beyond which its equations are no longer those of a belt unless a finer mesh has much the same
/// solution, in rad.
const MOST_TURN: f64 = 0.5;
/// Turn of an element beyond which no finer mesh confirms it, in rad.
const MOST_CONFIRMED_TURN: f64 = 1.5;
/// Error beyond which an estimate tells no more than that the error is large, dimensionless.
const LARGE: f64 = 0.05;

/// Residual that rounding may leave on some mesh, lengths in U and energy in mean R_f/U.
pub(super) const ROUNDING: f64 = 1e-10;

/// A solution on a mesh.
pub(super) struct Level {
    pub(super) program: BeltProgram,
    pub(super) solution: Solution<BeltPoint>,
    /// The fault of its active sets.
    misfit: Option<String>,
    /// `None` of a solution that is not sound, or has no solution of a finer mesh next to it.
    pub(super) estimate: Option<Estimate>,
}

/// The start of a search on meshes that follow the error.
pub(super) enum Begin<'a> {
    /// At the guess.
    Guess,
    /// At a shape of a programme, of the widened belt if the belt is slender.
    Widened(&'a BeltProgram, &'a BeltPoint),
    /// At a shape of a programme, on its mesh, with a first barrier.
    Shape(&'a BeltProgram, &'a BeltPoint, f64),
}

/// Finds a minimum on meshes graded to the estimated error, until the error is as small as the problem asks. If no mesh carries
/// the accuracy, the best result of all.
pub(super) fn refine(
    problem: &Problem,
    search: &Search,
    from: Begin,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Level {
    let (mut best, mut mesh) = match from {
        Begin::Guess => first_level(problem, search, None, proceed),
        Begin::Widened(program, shape) => {
            first_level(problem, search, Some((program, shape)), proceed)
        }
        Begin::Shape(program, ..) => (None, Mesh::of(problem, program)),
    };
    let start = match from {
        Begin::Shape(program, shape, barrier) => Some((program, shape, barrier)),
        Begin::Guess | Begin::Widened(..) => None,
    };
    let above_rounding = Search {
        tolerance: search.tolerance.max(ROUNDING),
        ..*search
    };
    let mut iterations = best.as_ref().map_or(0, |level| level.solution.iterations);
    let mut failures = 0;
    for _ in 0..MESHES {
        let Some(program) = problem.program_on(&mesh) else {
            break;
        };
        let sound = best.as_ref().filter(|best| best.is_sound());
        let mut level = match sound {
            Some(best) => best.on_finer(problem, &above_rounding, program, proceed),
            None => {
                let barrier = search.settings.cold_barrier;
                let barrier = start.map_or(barrier, |(_, _, barrier)| barrier);
                let near = start.map(|(program, shape, _)| (program, shape));
                let search = if near.is_none() {
                    rough(search)
                } else {
                    above_rounding
                };
                Level::on(problem, &search, program, near, barrier, proceed)
            }
        };
        // A long step tells where the mesh has to be finer, and no more is asked here.
        level.estimate(problem, false, proceed);
        iterations += level.solution.iterations;
        level.solution.iterations = iterations;
        let is_done =
            level.is_accurate(problem.accuracy()) && level.is_precise(above_rounding.tolerance);
        let is_precise = level.is_precise(search.tolerance);
        if level.solution.outcome == Outcome::Interrupted || (is_done && is_precise) {
            return level;
        }
        if is_done {
            best = Some(level);
            break;
        }
        failures += usize::from(!level.is_sound());
        let in_vain = best
            .as_ref()
            .is_some_and(|best| level.is_in_vain_after(best));
        mesh = level.better_mesh(problem, problem.accuracy());
        best = match best {
            Some(best) if best.estimate.is_some() && !level.is_better_than(&best) => Some(best),
            _ => Some(level),
        };
        if in_vain || failures > FAILURES || mesh.elements() > MOST {
            break;
        }
    }
    let mut best = best.expect("the first mesh has a programme");
    best.solution.iterations = iterations;
    if !best.is_precise(search.tolerance) {
        best = best.again(problem, search, proceed);
    }
    best.estimate(problem, true, proceed);
    best
}

/// A search for a minimum that is only a start.
fn rough(search: &Search) -> Search {
    /// Residual of such a minimum, lengths in U and energy in mean R_f/U.
    const ROUGH: f64 = 1e-5;
    Search {
        tolerance: search.tolerance.max(ROUGH),
        ..*search
    }
}

/// The minimum of an easier problem, near to a shape if one is given, and the mesh for the problem itself; without an easier one,
/// its first mesh alone.
fn first_level(
    problem: &Problem,
    search: &Search,
    near: Option<(&BeltProgram, &BeltPoint)>,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> (Option<Level>, Mesh) {
    let rough = rough(search);
    let mesh = first_mesh(problem);
    if near.is_none()
        && let Some(level) = loaded(problem, &rough, &mesh, proceed)
    {
        return (Some(level), mesh);
    }
    match narrowed(problem, &rough, &mesh, near, proceed) {
        Some(level) => {
            let mesh = Mesh::of(problem, &level.program);
            (Some(level), mesh)
        }
        None => (None, mesh),
    }
}

/// The minimum under loads raised step by step, up to little less than all; `None` of loads that a belt stands at once, or
/// where this leads nowhere.
///
/// Under loads far beyond its stiffness a belt may crumple anywhere. The shape that it takes as loads are raised is smooth.
fn loaded(
    problem: &Problem,
    search: &Search,
    mesh: &Mesh,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Level> {
    /// Sum of loads that a belt stands at once, in mean R_f/U².
    const LIGHT: f64 = 1e5;
    /// Factor by which the loads are raised, dimensionless.
    const HEAVIER: f64 = 4.0;
    let program = problem.program_on(mesh)?;
    let mut share = LIGHT / program.total_load();
    let mut best: Option<Level> = None;
    while share < 1.0 {
        let eased = program.clone().under_share_of_loads(share);
        let level = Level::after(best, problem, search, eased, proceed)?;
        share *= HEAVIER;
        best = Some(level);
    }
    best
}

/// Elements of equal length, but shorter beside supports, links and loads: a tension T bends a belt there within √(R_f/T).
fn first_mesh(problem: &Problem) -> Mesh {
    /// Length of an element in such a layer over the length √(R_f/T), with the sum of all loads for the tension.
    const SHARE: f64 = 0.5;
    let program = problem.program(FIRST);
    let tension = program.total_load();
    let layer = SHARE / tension.sqrt();
    let places = problem.break_points().into_iter().map(|at| [at, layer]);
    let lengths: Vec<f64> = program.elements().map(|(_, e)| e.length).collect();
    let places: Vec<_> = places.collect();
    Mesh::uniform(problem, FIRST).graded(problem, &lengths, &places)
}

/// Whether a mesh that follows the error carries a stationary point of a problem's programme well enough to be followed on it, by
/// the estimate of one Newton step on the mesh of elements half as long; a mesh that the scenario fixes carries all.
///
/// Every mesh is another discrete belt: the fewer the changes, the smoother the path.
pub(crate) fn carries(
    problem: &Problem,
    program: &BeltProgram,
    at: &Stationary<BeltPoint>,
    objective: f64,
) -> bool {
    /// Error from which a belt goes on on another mesh, over the accuracy, dimensionless; and where its ribs may turn anywhere.
    const TOO_LARGE: [f64; 2] = [10.0, 50.0];
    let most = || TOO_LARGE[usize::from(may_turn_anywhere(program, &at.point))];
    has_no_better_mesh(problem)
        || largest_error_by_a_step(problem, program, at, objective) <= most() * problem.accuracy()
}

/// A mesh that should carry a stationary point of a problem's programme; `None` where there is none, or none of few elements.
pub(crate) fn mesh_that_carries(
    problem: &Problem,
    program: &BeltProgram,
    at: &Stationary<BeltPoint>,
) -> Option<Mesh> {
    /// Greatest number of elements of a mesh on which a belt is followed.
    const MOST: usize = 3000;
    /// Error that is aimed at, over the accuracy, dimensionless; and where ribs may turn anywhere.
    const AIM: [f64; 2] = [1.0, 10.0];
    if has_no_better_mesh(problem) {
        return None;
    }
    let solution = stagewise::assess(program, problem.tolerance(), at);
    let mut level = Level::new(program.clone(), solution, None);
    level.estimate(problem, false, &mut || ControlFlow::Continue(()));
    let aim = AIM[usize::from(may_turn_anywhere(program, &at.point))];
    let mesh = level.better_mesh(problem, aim * problem.accuracy());
    (mesh.elements() <= MOST).then_some(mesh)
}

/// Whether an element of a shape turns so far that its equations are no longer those of a belt.
pub(crate) fn turns_too_far<D: Density<F>, const F: usize, const N: usize>(
    program: &BeltProgram<D, F, N>,
    shape: &BeltPoint<F>,
) -> bool {
    largest_turn(program, shape) > MOST_TURN
}

/// Largest angle by which an element of a shape turns.
fn largest_turn<D: Density<F>, const F: usize, const N: usize>(
    program: &BeltProgram<D, F, N>,
    shape: &BeltPoint<F>,
) -> f64 {
    let turns = program.elements();
    let turns = turns.map(|element| turn_of(program, shape, element));
    turns.fold(0.0, f64::max)
}

/// Angle by which an element of a shape turns if it turns as fast all along as at its tighter end.
fn turn_of<D: Density<F>, const F: usize, const N: usize>(
    program: &BeltProgram<D, F, N>,
    shape: &BeltPoint<F>,
    (k, element): (usize, &Element),
) -> f64 {
    let rate = |node: usize| {
        let [bend, torsion] = rates(program, shape, node);
        bend.hypot(torsion).hypot(element.geodesic)
    };
    element.length * rate(k).max(rate(k + 1))
}

/// Largest difference between the angles by which an element of a shape would turn if it turned all along as at either end, in
/// rad: the error of a mesh grows with it.
pub(crate) fn largest_change<D: Density<F>, const F: usize, const N: usize>(
    program: &BeltProgram<D, F, N>,
    shape: &BeltPoint<F>,
) -> f64 {
    let change = |(k, element): (usize, &Element)| {
        let [own, next] = [k, k + 1].map(|node| Vector2::from(rates(program, shape, node)));
        element.length * (next - own).norm()
    };
    program.elements().map(change).fold(0.0, f64::max)
}

/// Bend and torsion at a node.
fn rates<D: Density<F>, const F: usize, const N: usize>(
    program: &BeltProgram<D, F, N>,
    shape: &BeltPoint<F>,
    node: usize,
) -> [f64; 2] {
    let fields: &[f64; F] = &shape.fields[node].data.0[0];
    let [torsion, bend] = program.model.torsion_and_bend(fields);
    [bend, torsion]
}

/// Whether ribs turn with a density that does not know the width: they turn from element to element as the belt is led, the more
/// often the finer these are.
fn may_turn_anywhere(program: &BeltProgram, at: &BeltPoint) -> bool {
    let mut elements = program.elements();
    !program.model.knows_width() && elements.any(|element| ribs_turn(at, element))
}

/// Whether the mesh is fixed, by the scenario or because a belt that slides along itself has no place on a graded one.
fn has_no_better_mesh(problem: &Problem) -> bool {
    problem.has_fixed_mesh() || problem.is_left_alone()
}

impl Level {
    /// The same minimum on a finer mesh: if the search leaves it, again from the same shape with a lower barrier.
    fn on_finer(
        &self,
        problem: &Problem,
        search: &Search,
        program: BeltProgram,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Self {
        /// Displacement of a node beyond which a minimum is another one, in U.
        const ANOTHER: f64 = 0.05;
        let own = (&self.program, &self.solution.at.point);
        let with = |barrier, proceed: &mut dyn FnMut() -> ControlFlow<()>| {
            Self::on(
                problem,
                search,
                program.clone(),
                Some(own),
                barrier,
                proceed,
            )
        };
        let level = with(search.settings.warm_barrier, proceed);
        let here = prolonged(own.0, own.1, &level.program);
        if level.solution.at.point.distance(&here) <= ANOTHER {
            return level;
        }
        let mut again = with(search.settings.close_barrier, proceed);
        again.solution.iterations += level.solution.iterations;
        if again.has_converged() { again } else { level }
    }

    /// The same minimum on its own mesh, to the tolerance of a search; where that does not converge, a minimum from the guess.
    fn again(
        self,
        problem: &Problem,
        search: &Search,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Self {
        let barrier = search.settings.close_barrier;
        let own = (&self.program, &self.solution.at.point);
        let program = self.program.clone();
        let mut level = Self::on(problem, search, program, Some(own), barrier, proceed);
        level.solution.iterations += self.solution.iterations;
        if level.has_converged() || level.solution.residuals.largest() <= ROUNDING {
            return level;
        }
        let barrier = search.settings.cold_barrier;
        let mut afresh = Self::on(problem, search, self.program, None, barrier, proceed);
        afresh.solution.iterations += level.solution.iterations;
        afresh
    }

    /// Whether a solution that has converged has done so to a tolerance.
    fn is_precise(&self, tolerance: f64) -> bool {
        !self.has_converged() || self.solution.residuals.largest() <= tolerance
    }

    /// The minimum on a mesh, from a shape of another programme with a first barrier, or from the guess; without an
    /// estimate.
    fn on(
        problem: &Problem,
        search: &Search,
        mut program: BeltProgram,
        near: Option<(&BeltProgram, &BeltPoint)>,
        barrier: f64,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Self {
        if let Some((known, shape)) = near {
            let shape = prolong(known, shape, &program);
            return Self::near(problem, search, program, shape, barrier, proceed);
        }
        let solution = search.run(&program, None, proceed);
        let (solution, misfit) = settle(problem, search, &mut program, solution, proceed);
        Self::new(program, solution, misfit)
    }

    /// The minimum that a search from a shape of a programme finds, with a first barrier; without an estimate.
    fn near(
        problem: &Problem,
        search: &Search,
        mut program: BeltProgram,
        shape: BeltPoint,
        barrier: f64,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Self {
        let solution = search.only_from(&program, shape, barrier, proceed);
        let (solution, misfit) = settle(problem, search, &mut program, solution, proceed);
        Self::new(program, solution, misfit)
    }

    /// The minimum that goes on from another level's, with the iterations of both; `None` if it is not sound.
    fn after(
        before: Option<Self>,
        problem: &Problem,
        search: &Search,
        program: BeltProgram,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Self> {
        let near = before.as_ref();
        let near = near.map(|level| (&level.program, &level.solution.at.point));
        let barrier = search.settings.warm_barrier;
        let mut level = Self::on(problem, search, program, near, barrier, proceed);
        level.solution.iterations += before.map_or(0, |level| level.solution.iterations);
        level.is_sound().then_some(level)
    }

    /// A solution of a programme, with the fault of its active sets, if they have one.
    pub(super) fn new(
        program: BeltProgram,
        solution: Solution<BeltPoint>,
        misfit: Option<String>,
    ) -> Self {
        Self {
            estimate: None,
            program,
            solution,
            misfit,
        }
    }

    /// Estimates the error of a solution that has converged: by a Newton step on a finer mesh, or where that is small, and for
    /// the last estimate, by the equilibrium of that mesh.
    pub(super) fn estimate(
        &mut self,
        problem: &Problem,
        is_last: bool,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) {
        if self.has_converged() {
            let (at, objective) = (&self.solution.at, self.solution.values.objective);
            self.estimate = Estimate::new(problem, &self.program, at, objective, is_last, proceed);
        }
    }

    /// Why the solution cannot be relied on, though it has converged; `None` where it can.
    pub(super) fn fault(&self, problem: &Problem) -> Option<String> {
        let mesh = match problem.has_fixed_mesh() {
            true => "leave out solver.elements, ",
            false => "",
        };
        let turned = (self.turns_too_far() && !self.is_confirmed()).then(|| {
            format!(
                "elements turn by up to {:.1} rad, too far for the equations of a belt, and no finer mesh confirms the shape; \
                 {mesh}move the supports apart, or lower the loads",
                self.turn()
            )
        });
        self.misfit.clone().or(turned)
    }

    /// Whether the solution is an equilibrium of its mesh, with the right active sets.
    pub(super) fn has_converged(&self) -> bool {
        self.solution.outcome == Outcome::Converged && self.misfit.is_none()
    }

    /// Whether an element turns so far that its equations are no longer those of a belt.
    pub(super) fn turns_too_far(&self) -> bool {
        turns_too_far(&self.program, &self.solution.at.point)
    }

    /// Whether a finer mesh has much the same solution, without elements that turn too far for any comparison.
    fn is_confirmed(&self) -> bool {
        let estimate = self.estimate.as_ref();
        let turn = self.turn();
        estimate.is_some_and(|e| e.error.largest() <= LARGE && turn <= MOST_CONFIRMED_TURN)
    }

    /// Whether the solution is an equilibrium of a belt.
    fn is_sound(&self) -> bool {
        self.has_converged() && (!self.turns_too_far() || self.is_confirmed())
    }

    fn is_accurate(&self, accuracy: f64) -> bool {
        let estimate = self.estimate.as_ref();
        let lengths = self.program.elements().map(|(_, element)| element.length);
        let longest = lengths.fold(0.0, f64::max);
        !self.turns_too_far()
            && longest <= LONGEST + SAME_PLACE
            && estimate.is_some_and(|e| e.error.largest() <= accuracy)
    }

    /// Whether the level tells more of the belt than another.
    fn is_better_than(&self, other: &Self) -> bool {
        let rank = |level: &Self| match level.solution.outcome {
            Outcome::Converged if level.is_sound() => 2,
            Outcome::Converged => 1,
            _ => 0,
        };
        (rank(self), -self.largest_error()) >= (rank(other), -other.largest_error())
    }

    /// Whether the mesh is much finer than another level's, and yet the error no smaller: as where a density that does not
    /// know the width folds the belt into facets, finer ones on a finer mesh, or where every mesh has a minimum of its own.
    fn is_in_vain_after(&self, other: &Self) -> bool {
        /// Number of elements up to which further ones may still pay.
        const FEW: f64 = 1000.0;
        /// Number of elements over the other's that should have made a difference, dimensionless.
        const FINER: f64 = 2.0;
        /// Error over the other's that is much the same, dimensionless.
        const SAME: f64 = 0.7;
        let elements = |level: &Self| level.program.elements().count() as f64;
        let is_finer = elements(self) >= FEW.max(FINER * elements(other));
        let [own, others] = [self, other].map(Self::largest_error);
        is_finer && own >= SAME * others
    }

    /// The largest estimated error; infinite where none is known.
    fn largest_error(&self) -> f64 {
        let estimate = self.estimate.as_ref();
        estimate.map_or(f64::INFINITY, |estimate| estimate.error.largest())
    }

    /// The largest angle by which an element turns.
    fn turn(&self) -> f64 {
        largest_turn(&self.program, &self.solution.at.point)
    }

    fn turn_of(&self, element: (usize, &Element)) -> f64 {
        turn_of(&self.program, &self.solution.at.point, element)
    }

    /// A mesh on which the error should be within the accuracy. A belt that may slide along itself has no place on a graded
    /// mesh: there the elements are halved.
    fn better_mesh(&self, problem: &Problem, accuracy: f64) -> Mesh {
        let mesh = Mesh::of(problem, &self.program);
        match &self.estimate {
            Some(estimate) if self.is_sound() && !problem.is_left_alone() => {
                mesh.graded(problem, &self.lengths(estimate, accuracy), &[])
            }
            _ => mesh.halved(),
        }
    }

    /// Lengths of elements for an accuracy, one an element.
    fn lengths(&self, estimate: &Estimate, accuracy: f64) -> Vec<f64> {
        /// Power of an element's length with which its gain falls, a number.
        const POWER: f64 = 3.0;
        /// Bounds of the change of a length from one mesh to the next, dimensionless.
        const CHANGE: [f64; 2] = [0.03, 2.0];
        /// Share of the accuracy that is aimed at, dimensionless.
        const AIM: f64 = 0.5;
        /// Share of the largest curvature from which an element may have the tightest bend, dimensionless.
        const TIGHT: f64 = 0.95;
        if estimate.error.largest() <= accuracy {
            let elements = self.program.elements();
            return elements.map(|(_, e)| e.length.min(LONGEST)).collect();
        }
        let total: f64 = estimate.gains.iter().sum();
        let roots = estimate.gains.iter().map(|gain| gain.powf(1.0 / POWER));
        let error = estimate.error.of_the_whole().clamp(accuracy, LARGE);
        let goal = AIM * total * accuracy / error;
        let each = (goal / roots.sum::<f64>()).powf(POWER / (POWER - 1.0));
        let curvatures = estimate.curvatures.iter();
        let tightest = curvatures.map(|[most, _]| *most).fold(0.0, f64::max);
        let elements = self.program.elements().zip(&estimate.gains);
        let lengths = elements.zip(&estimate.curvatures);
        let lengths: Vec<f64> = lengths
            .map(|(((k, element), gain), [curvature, change])| {
                let by_gain = (each / gain).powf(1.0 / POWER);
                let by_turn = TURN / self.turn_of((k, element));
                let by_radius = match *curvature > TIGHT * tightest {
                    true => (AIM * accuracy * tightest / change).sqrt(),
                    false => f64::INFINITY,
                };
                let by_ribs = match ribs_turn(&self.solution.at.point, (k, element)) {
                    true => 2.0 * element.half_width / (PER_WIDTH * element.length),
                    false => f64::INFINITY,
                };
                let factor = by_gain.min(by_turn).min(by_radius).min(by_ribs);
                (element.length * factor.clamp(CHANGE[0], CHANGE[1])).min(LONGEST)
            })
            .collect();
        self.not_too_many(lengths)
    }

    /// Lengths made so much longer that a mesh of them has no more than some times as many elements as this one.
    fn not_too_many(&self, mut lengths: Vec<f64>) -> Vec<f64> {
        /// Greatest number of elements over the number of the mesh before, dimensionless.
        const MORE: f64 = 4.0;
        let elements = self.program.elements().map(|(_, element)| element.length);
        let count: f64 = elements.zip(&lengths).map(|(own, new)| own / new).sum();
        let excess = count / (MORE * lengths.len() as f64);
        if excess > 1.0 {
            for length in &mut lengths {
                *length *= excess;
            }
        }
        lengths
    }
}
