//! The search for a minimum whose active sets are right.

use super::search::Search;
use crate::problem::Problem;
use crate::problem::program::{BeltPoint, BeltProgram};
use stagewise::{Outcome, Solution};
use std::ops::ControlFlow;

/// Greatest count of choices of the active sets, a number.
const ROUNDS: usize = 20;

/// Goes on from a minimum to a minimum for which the programme's active sets are right, and leaves these in the programme;
/// with the fault of the last active sets if they are not.
pub(super) fn settle(
    problem: &Problem,
    search: &Search,
    program: &mut BeltProgram,
    mut solution: Solution<BeltPoint>,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> (Solution<BeltPoint>, Option<String>) {
    for _ in 0..ROUNDS {
        let point = &solution.at.point;
        if solution.outcome != Outcome::Converged
            || problem.active_set_fault(program, point).is_none()
        {
            return (solution, None);
        }
        problem.choose_active_sets(program, point);
        solution = search.again(program, solution, proceed);
    }
    let fault = problem.active_set_fault(program, &solution.at.point);
    (solution, fault)
}
