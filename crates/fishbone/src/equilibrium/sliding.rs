//! The search for a minimum of a closed belt that slides along itself: with its seam where a rib is square.
//!
//! On a mesh the energy of such a belt changes a little as the belt slides along itself, to and fro from node to node: a
//! search would follow that for hundreds of iterations.

use crate::equilibrium::guess::inside;
use crate::equilibrium::search::{Search, fields_at};
use crate::problem::program::{BeltPoint, BeltProgram};
use nalgebra::Vector2;
use stagewise::{Outcome, Solution};
use std::ops::ControlFlow;

impl Search {
    /// Searches from a shape of the same mesh with a square rib at the seam; `None` of a belt that does not slide along
    /// itself, or of which no rib need be square. Converged where the equations of the belt itself hold, too.
    pub(super) fn with_square_seam(
        &self,
        program: &BeltProgram,
        start: &BeltPoint,
        barrier: f64,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Solution<BeltPoint>> {
        let held = program.with_square_seam()?;
        let start = inside(&held, slid_to_square_rib(program, start));
        let settings = self.interior_point(barrier);
        let found = stagewise::minimise(&held, &settings, start, proceed);
        Some(match found.outcome {
            Outcome::Converged => {
                stagewise::assess(program, self.tolerance, &found.at).after(found.iterations)
            }
            _ => found,
        })
    }
}

/// The shape slid along itself until the square rib with the least bend is at the seam, unless a square rib is there already.
fn slid_to_square_rib(program: &BeltProgram, point: &BeltPoint) -> BeltPoint {
    let nodes = program.nodes();
    let is_there = point.fields[0][1] == 0.0;
    let Some(seam) = square_rib(&nodes, point).filter(|_| !is_there) else {
        return point.clone();
    };
    let slid = |u: f64| -> Vector2<f64> {
        let at = |u: f64| fields_at(program, &nodes, point, u, false);
        match u + seam > 1.0 {
            true => -at(u + seam - 1.0),
            false => at(u + seam),
        }
    };
    BeltPoint {
        fields: nodes.iter().map(|u| slid(*u)).collect(),
        poses: point.poses.clone(),
    }
}

/// Arc length in U at which the slope of the ribs changes its sign, of several the one with the least bend.
fn square_rib(nodes: &[f64], point: &BeltPoint) -> Option<f64> {
    let pairs = nodes.windows(2).zip(point.fields.windows(2));
    let crossings = pairs.filter_map(|(u, fields)| {
        let [before, after] = [fields[0][1], fields[1][1]];
        let crosses = before == 0.0 || before * after < 0.0;
        crosses.then(|| {
            let share = before / (before - after);
            let share = if before == 0.0 { 0.0 } else { share };
            let bend = fields[0].lerp(&fields[1], share)[0].abs();
            (bend, u[0] + share * (u[1] - u[0]))
        })
    });
    let least = crossings.min_by(|a, b| a.0.total_cmp(&b.0));
    least.map(|(_, u)| u)
}
