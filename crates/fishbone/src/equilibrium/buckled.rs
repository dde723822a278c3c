//! Belts that loads buckle out of their flat shape along slanted ribs.
//!
//! In the flat shape every slope of the ribs costs the same, and the slopes along which the belt buckles are known only once
//! they have proved that the flat shape is not stable.

use super::{Equilibrium, Start, flat, intrinsic};
use crate::problem::Mesh;
use stagewise::lowest_modes;
use std::ops::ControlFlow;

/// The minimum into which a belt falls from a flat shape that is not stable; without one the belt as it was found.
pub(super) fn out_of_flat(
    found: Equilibrium,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    /// Displacements along the mode from which the belt falls, root mean square over the board, in U.
    const OFF: [f64; 4] = [0.05, -0.05, 0.2, -0.2];
    let is_unstable = found.stable() == Some(false);
    let Some(solved) = found.developable().filter(|s| s.is_flat && is_unstable) else {
        return found;
    };
    let (problem, program) = (&found.problem, &solved.program);
    let slanted = flat::unstable_slopes(program, problem.tolerance(), &solved.at);
    let Some(mut slanted) = slanted else {
        return found;
    };
    let modes = lowest_modes(program, &mut slanted, 1).unwrap_or_default();
    let mesh = Mesh::of(problem, program);
    let mut iterations = found.iterations;
    for (mode, off) in modes.iter().flat_map(|mode| OFF.map(|off| (mode, off))) {
        let start = stagewise::moved(program, &slanted.point, mode, off);
        let start = Start::Downhill(&mesh, &start);
        let fallen = intrinsic::solve(problem, start, proceed);
        iterations += fallen.iterations;
        if !fallen.is_minimum() || fallen.energy >= found.energy {
            continue;
        }
        let mut fallen = match fallen.refined_for(problem, proceed) {
            Some(refined) if refined.energy < found.energy => {
                iterations += refined.iterations;
                refined
            }
            _ => fallen,
        };
        fallen.iterations = iterations;
        return fallen;
    }
    Equilibrium {
        iterations,
        ..found
    }
}
