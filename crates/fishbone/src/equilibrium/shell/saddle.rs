//! Minima into which a strip of finite thickness falls from an equilibrium that is none.
//!
//! A developable belt may be stable where the sheet, which twists more easily, is not. The search that starts from its shape
//! ends at a saddle then, where the shape is symmetric.

use super::{BARRIERS, Proceed, ShellProgram, ShellSolution, minimise, settings, stability};
use crate::equilibrium::Status;
use crate::problem::Problem;
use stagewise::{Outcome, lowest_modes};

/// The minimum into which a strip falls along the lowest mode of a solution that is none; `None` where none is found, and of
/// a minimum.
pub(super) fn fallen(
    problem: &Problem,
    program: &ShellProgram,
    solution: &ShellSolution,
    proceed: &mut Proceed,
) -> Option<ShellSolution> {
    /// Displacements along the mode, root mean square over the board, in U.
    const OFF: [f64; 4] = [0.05, -0.05, 0.2, -0.2];
    if solution.outcome != Outcome::Converged || solution.is_minimum() {
        return None;
    }
    let is_stable = |solution: &ShellSolution| {
        stability(problem, program, solution, Status::Converged)?.is_stable()
    };
    if is_stable(solution) != Some(false) {
        return None;
    }
    let modes = lowest_modes(program, &mut solution.at.clone(), 1).ok()?;
    let mode = modes.first()?;
    let mut iterations = solution.iterations;
    for off in OFF {
        let start = stagewise::moved(program, &solution.at.point, mode, off);
        let found = minimise(program, &settings(problem, BARRIERS[0]), start, proceed);
        iterations += found.iterations;
        if found.outcome == Outcome::Interrupted {
            return None;
        }
        let is_lower = found.outcome == Outcome::Converged
            && found.values.objective < solution.values.objective;
        if is_lower && is_stable(&found) == Some(true) {
            return Some(ShellSolution {
                iterations,
                ..found
            });
        }
    }
    None
}
