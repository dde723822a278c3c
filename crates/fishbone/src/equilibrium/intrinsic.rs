//! The intrinsic method: the interior-point search in the two fields bend and rib slope.

use super::accuracy::MeshError;
use super::active_set::settle;
use super::judged::Judged;
use super::refinement::{Begin, Level, ROUNDING, refine};
use super::search::{MinimumSettings, Search, is_flat_under_load, prolong};
use super::stability;
use super::{AnySolved, Equilibrium, Start, Status};
use crate::equilibrium::guess::{disturb, guess};
use crate::problem::Problem;
use crate::problem::program::{self, BeltPoint, BeltProgram, ROWS};
use crate::strip::density::Density;
use stagewise::{Outcome, Program, Settings, Solution, redundant_equalities};
use std::ops::ControlFlow;
use std::sync::OnceLock;

/// Residual of the constraints above which they are missed beyond rounding, lengths in U and angles in rad.
const CLEARLY_MISSED: f64 = 1e-6;
/// Message of a search that cannot begin, for people.
const CROSSING: &str = "no ribs found that do not cross: the bends, arcs and square ribs of the board are too close together \
                        for its width; make it narrower or the segments longer";

/// Finds a minimum of the energy in the two fields.
pub(super) fn solve(
    problem: &Problem,
    from: Start,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    if let Some(too_far) = problem.unreachable_supports() {
        let message = too_far.to_string();
        return equilibrium(problem, start(problem), Status::Infeasible, message, None);
    }
    let (found, fault) = find(problem, from, proceed);
    judged(problem, found, fault)
}

/// The equilibrium of a solution of a problem's programme that was found by other means; it has converged only if the
/// programme's active sets are right for it, and no element turns too far for a belt.
pub(crate) fn of_solution(
    problem: &Problem,
    program: BeltProgram,
    solution: Solution<BeltPoint>,
) -> Equilibrium {
    let misfit = problem.active_set_fault(&program, &solution.at.point);
    let level = Level::new(program, solution, misfit);
    let (found, fault) = Found::checked(problem, level, &mut || ControlFlow::Continue(()));
    judged(problem, found, fault)
}

/// The equilibrium of a mesh, be it one of the belt or not: as [`of_solution`], however far elements turn.
pub(crate) fn of_solution_on_mesh(
    problem: &Problem,
    program: BeltProgram,
    solution: Solution<BeltPoint>,
) -> Equilibrium {
    let misfit = problem.active_set_fault(&program, &solution.at.point);
    judged(problem, Found::unestimated(program, solution), misfit)
}

/// The equilibrium at which a search ended, or its fault.
fn judged(problem: &Problem, found: Found, fault: Option<String>) -> Equilibrium {
    let redundant = redundant(problem, &found.program);
    let (status, message) = judge(
        problem,
        &found.program,
        &found.solution,
        fault,
        redundant.as_deref(),
    );
    equilibrium(problem, found, status, message, redundant)
}

/// The equilibrium at which a search ended, with all its data.
fn equilibrium(
    problem: &Problem,
    Found {
        program,
        solution,
        is_of_mesh_alone,
        error,
    }: Found,
    status: Status,
    message: String,
    redundant: Option<String>,
) -> Equilibrium {
    let solution = stability::with_square_ribs(problem, &program, solution);
    let internal = program.internal(&solution.at.point, &solution.at.multipliers.equalities);
    let stability = match status {
        Status::Converged => stability::decide(problem, &program, &solution, &internal),
        Status::Infeasible | Status::NotConverged => None,
    };
    let judged = Judged {
        is_flat: is_flat_under_load(&program, &solution.at.point),
        program,
        solution,
        status,
        message,
        redundant,
        stability,
        is_of_mesh_alone,
        error,
    };
    judged.equilibrium(problem, |solved| AnySolved::Developable(Box::new(solved)))
}

/// The end of a search: the programme and its solution.
struct Found {
    program: BeltProgram,
    solution: Solution<BeltPoint>,
    /// Whether this is an equilibrium, but not of the belt, because elements turn too far.
    is_of_mesh_alone: bool,
    /// The error by the mesh, where it has been estimated.
    error: OnceLock<Option<MeshError>>,
}

impl Found {
    /// The end of a search on a mesh, with the fault that keeps its result from being relied on.
    fn of(problem: &Problem, level: Level) -> (Self, Option<String>) {
        let fault = level.fault(problem);
        let is_of_mesh_alone = level.has_converged() && fault.is_some();
        let error = level.estimate.map(|estimate| Some(estimate.error));
        let found = Self {
            program: level.program,
            solution: level.solution,
            is_of_mesh_alone,
            error: error.map_or_else(OnceLock::new, OnceLock::from),
        };
        (found, fault)
    }

    /// As [`Self::of`], of a mesh that follows no error: a finer one may confirm elements that turn far.
    fn checked(
        problem: &Problem,
        mut level: Level,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> (Self, Option<String>) {
        if level.turns_too_far() {
            level.estimate(problem, true, proceed);
        }
        Self::of(problem, level)
    }

    /// A solution of a programme whose error has not been estimated.
    fn unestimated(program: BeltProgram, solution: Solution<BeltPoint>) -> Self {
        Self {
            program,
            solution,
            is_of_mesh_alone: false,
            error: OnceLock::new(),
        }
    }
}

impl Search {
    pub(super) fn of(problem: &Problem) -> Self {
        Self {
            bulge: problem.bulge(),
            tolerance: problem.tolerance(),
            settings: MinimumSettings::default(),
        }
    }
}

/// The start of a search that is known to find nothing.
fn start(problem: &Problem) -> Found {
    let program = problem.program(problem.elements());
    let solution = Search::of(problem).start(&program);
    Found::unestimated(program, solution)
}

/// The end of a search, with the fault of the active sets of the shape found, if there is one.
fn find(
    problem: &Problem,
    from: Start,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> (Found, Option<String>) {
    let mut search = Search::of(problem);
    let uniform = || problem.program(problem.elements());
    let mut program = match from {
        Start::Near(mesh, _)
        | Start::Minimum(mesh, _)
        | Start::Close(mesh, _)
        | Start::Downhill(mesh, _) => problem.program_on(mesh).unwrap_or_else(uniform),
        _ => uniform(),
    };
    if let Start::Minimum(_, shape) = from {
        search.settings = search.settings.beside(program.size(shape));
    }
    let MinimumSettings {
        cold_barrier,
        close_barrier,
        ..
    } = search.settings;
    if !problem.has_fixed_mesh() {
        let start = match from {
            Start::Guess => Some(Begin::Guess),
            Start::Widened(program, shape) => Some(Begin::Widened(program, shape)),
            Start::Shape(shape) => Some(Begin::Shape(&program, shape, cold_barrier)),
            Start::Minimum(_, shape) => Some(Begin::Shape(&program, shape, close_barrier)),
            Start::Near(..) | Start::Close(..) | Start::Downhill(..) => None,
        };
        if let Some(start) = start {
            return Found::of(problem, refine(problem, &search, start, proceed));
        }
    }
    let solution = match from {
        Start::Near(_, shape) => search.from(&program, shape.clone(), proceed),
        Start::Widened(known, shape) => {
            let shape = prolong(known, shape, &program);
            search.only_from(&program, shape, cold_barrier, proceed)
        }
        Start::Shape(shape) => search.only_from(&program, shape.clone(), cold_barrier, proceed),
        Start::Close(_, shape) | Start::Minimum(_, shape) => {
            // Other active sets do not lead away either.
            search.settings.warm_barrier = close_barrier;
            search.only_from(&program, shape.clone(), close_barrier, proceed)
        }
        Start::Downhill(_, shape) => {
            let downhill = Settings::downhill(search.tolerance, 1.0);
            search.settings.warm_barrier = downhill.barrier;
            search.settings.iterations = downhill.iterations;
            search.settings.longest_step = downhill.longest_step;
            search.only_from(&program, shape.clone(), downhill.barrier, proceed)
        }
        Start::Guess => {
            let default = problem.scenario().default_elements();
            let coarse = (problem.elements() > default).then(|| problem.program(default));
            search.run(&program, coarse.as_ref(), proceed)
        }
    };
    let (solution, fault) = settle(problem, &search, &mut program, solution, proceed);
    Found::checked(problem, Level::new(program, solution, fault), proceed)
}

/// The supports and links whose constraints are redundant, by name; `None` where all are independent.
///
/// Two supports, one at either end of a belt that bends, always are.
pub(super) fn redundant(problem: &Problem, program: &BeltProgram) -> Option<String> {
    let scenario = problem.scenario();
    let rigid = program
        .pieces
        .iter()
        .any(|piece| matches!(piece, program::Piece::Rigid { .. }));
    let (supports, links) = (scenario.supports.len(), scenario.links.len());
    if supports <= 2 && links == 0 && !rigid {
        return None;
    }
    // The shape is in general position: some constraints depend on each other on the straight belt and nowhere else.
    let general = disturb(program, &guess(program, &problem.bulge()), 0.3);
    let name = |i: usize| match i.checked_sub(program.supports.len()) {
        None if i < supports => Some(format!("supports[{i}]")),
        Some(link) if link < links => Some(format!("links[{link}]")),
        _ => None,
    };
    let redundant = redundant_equalities(program, &general);
    let mut places: Vec<_> = redundant.into_iter().map(|row| row / ROWS).collect();
    places.dedup();
    let names: Vec<_> = places.into_iter().filter_map(name).collect();
    (!names.is_empty()).then(|| names.join(" and "))
}

/// Status and message of a search that was not infeasible from the outset.
pub(super) fn judge<D: Density<F>, const F: usize, const N: usize>(
    problem: &Problem,
    program: &BeltProgram<D, F, N>,
    solution: &Solution<BeltPoint<F>>,
    fault: Option<String>,
    redundant: Option<&str>,
) -> (Status, String) {
    // An elastic energy has a least value, and dead forces lead a belt that is held at a point no farther than its length: a
    // search that finds none has gone astray.
    let supports = &problem.scenario().supports;
    let is_held = supports.iter().any(|support| support.point().is_some());
    let is_turned = supports.iter().any(|support| support.moment.is_some());
    let is_bounded = !program.is_loaded() || (is_held && !is_turned);
    let outcome = match solution.outcome {
        Outcome::Unbounded if is_bounded => Outcome::Stalled,
        outcome => outcome,
    };
    /// Load from which another unit is more likely than another bulge to help, in mean R_f/U².
    const HEAVY: f64 = 1e8;
    let tolerance = problem.tolerance();
    let largest = solution.residuals.largest();
    let (iterations, violation) = (solution.iterations, solution.residuals.constraint);
    /// Thickness below which a sheet is all but one of no thickness, in V.
    const THIN: f64 = 5e-4;
    // A search of a thick strip may fail where that of its thin limit does not.
    let belt = &problem.scenario().belt;
    let is_thin = belt
        .thickness_value()
        .is_some_and(|h| h < THIN * belt.width);
    let or_energy = match (problem.is_of_shell(), is_thin) {
        (true, true) => ", energy = \"wunderlich\", the limit of sheets thinner than V/2000,",
        (true, false) => ", energy = \"wunderlich\"",
        (false, _) => "",
    };
    match outcome {
        Outcome::Converged if let Some(fault) = fault => (Status::NotConverged, fault),
        Outcome::Converged => (
            Status::Converged,
            format!("converged in {iterations} iterations, largest residual {largest:.1e}"),
        ),
        Outcome::LocallyInfeasible | Outcome::IterationLimit | Outcome::Stalled
            if let Some(names) =
                redundant.filter(|_| violation > tolerance.max(CLEARLY_MISSED)) =>
        {
            (
                Status::NotConverged,
                format!(
                    "{names} are missed by {violation:.1e} (lengths in U, angles in rad): what is held there is held \
                     already, by the rest or by a stiffener, and perhaps not alike; leave one out"
                ),
            )
        }
        Outcome::IterationLimit | Outcome::Stalled if largest <= ROUNDING => (
            Status::NotConverged,
            format!(
                "solver.tolerance, {tolerance:.1e}, is below what rounding leaves, {largest:.1e}: the shape is as near to an \
                 equilibrium as numbers of 64 bits allow; give a tolerance of {ROUNDING:.0e} or more"
            ),
        ),
        Outcome::IterationLimit => (
            Status::NotConverged,
            format!(
                "largest residual {largest:.1e} after {iterations} iterations, more than the tolerance {tolerance:.1e}; \
                 try another solver.bulge{or_energy} or more solver.elements"
            ),
        ),
        Outcome::LocallyInfeasible => (
            Status::NotConverged,
            format!(
                "no shape found that meets the supports, the nearest misses them by {violation:.1e} (lengths in U, \
                 angles in rad); move the supports closer, try another solver.bulge{or_energy} or more solver.elements"
            ),
        ),
        Outcome::Stalled if program.total_load() > HEAVY => (
            Status::NotConverged,
            format!(
                "no step improves the shape any more, largest residual {largest:.1e} after {iterations} iterations: the loads \
                 are {:.0e} R_f/U\u{b2} together; check their units, and those of the belt",
                program.total_load()
            ),
        ),
        Outcome::Stalled => {
            let advice = match largest <= CLEARLY_MISSED {
                true => "a tolerance above it",
                false => "another solver.bulge",
            };
            (
                Status::NotConverged,
                format!(
                    "no step improves the shape any more, largest residual {largest:.1e} after {iterations} iterations; try \
                     {advice}{or_energy} or another solver.elements"
                ),
            )
        }
        Outcome::Unbounded => (
            Status::NotConverged,
            format!(
                "the energy has no least value after {iterations} iterations, largest residual {largest:.1e}; hold the belt \
                 where it may slide or fall, or try another solver.bulge"
            ),
        ),
        Outcome::Inadmissible => (Status::NotConverged, CROSSING.to_owned()),
        Outcome::Interrupted => (
            Status::NotConverged,
            format!("interrupted after {iterations} iterations, largest residual {largest:.1e}"),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::{Axis, BeltSpec, Component, Place, Scenario, SegmentSpec, SupportSpec};

    /// The message of a search that ends without a least energy.
    fn message_without_a_least_energy(scenario: Scenario) -> String {
        let problem = Problem::new(scenario).unwrap();
        let mut found = start(&problem);
        found.solution.outcome = Outcome::Unbounded;
        let (status, message) = judge(&problem, &found.program, &found.solution, None, None);
        assert_eq!(status, Status::NotConverged);
        message
    }

    #[test]
    fn test_only_a_loaded_belt_has_no_least_energy() {
        let mut scenario = Scenario::new(BeltSpec::new(0.1, 1.0, vec![SegmentSpec::straight(1.0)]));
        let clamp = |at, y: f64| SupportSpec {
            position: Some([0.0, y, 0.0].map(Component::Held)),
            rotation: Some([0.0; 3]),
            ..SupportSpec::new(at)
        };
        scenario.supports = vec![clamp(Place::Start, 0.0), clamp(Place::End, 0.6)];
        let unloaded = message_without_a_least_energy(scenario.clone());
        assert!(unloaded.starts_with("no step improves the shape any more"));
        scenario.supports[1].hinge = Some(Axis::Zeta);
        scenario.supports[1].moment = Some(1.0);
        let loaded = message_without_a_least_energy(scenario);
        assert!(loaded.starts_with("the energy has no least value"));
    }
}
