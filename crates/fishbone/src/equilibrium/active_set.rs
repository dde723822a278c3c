//! The search for a minimum of which the active sets are right.

use super::search::Search;
use crate::problem::Problem;
use crate::problem::program::{BeltPoint, BeltProgram};
use stagewise::{Outcome, Solution};
use std::ops::ControlFlow;

/// Choices of the active sets, the largest number.
const ROUNDS: usize = 20;

/// Goes on from a minimum to one for which the active sets of the programme are right, and gives the programme those; with
/// the fault of the last sets where they are not.
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
