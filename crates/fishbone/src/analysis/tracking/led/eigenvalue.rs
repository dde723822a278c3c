//! The lowest eigenvalue of the second variation, and its gradient by the motion of a support.

use super::Led;
use crate::analysis::modes::NoModes;
use crate::analysis::tracking::LowestEigenvalue;
use crate::equilibrium::model::StripModel;
use crate::geometry::{Pose, exp};
use crate::problem::program::BeltProgram;
use nalgebra::{Vector3, Vector6};
use stagewise::{Follower, Singular};
use std::ops::ControlFlow;

impl<D: StripModel<F, N>, const F: usize, const N: usize> Led<D, F, N> {
    /// As [`Tracker::lowest_eigenvalue`](super::super::Tracker::lowest_eigenvalue).
    pub(in super::super) fn lowest_eigenvalue(
        &self,
        support: usize,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<LowestEigenvalue, NoModes> {
        /// Step of the support, in U and rad.
        const STEP: f64 = 1e-5;
        let value = lowest(&self.follower, proceed)?;
        let units = self.units();
        let scale = units.energy / units.length.powi(2);
        let gradient = Vector6::from_fn(|column, _| {
            let sides =
                [STEP, -STEP].map(|step| self.lowest_beside(support, column, step, proceed));
            let derivative = match sides {
                [Some(ahead), Some(behind)] => (ahead - behind) / (2.0 * STEP),
                [Some(ahead), None] => (ahead - value) / STEP,
                [None, Some(behind)] => (value - behind) / STEP,
                [None, None] => f64::NAN,
            };
            match column {
                0..3 => derivative * scale / units.length,
                _ => derivative * scale,
            }
        });
        Ok(LowestEigenvalue {
            value: value * scale,
            gradient,
        })
    }

    /// The lowest eigenvalue where one of the six motions of a support has led the belt by a step; `None` where this is no minimum
    /// that follows from the present one.
    fn lowest_beside(
        &self,
        support: usize,
        column: usize,
        step: f64,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<f64> {
        let place = self.moving.iter().position(|moving| *moving == support)?;
        let from = self.poses[place];
        let mut change = |program: &mut BeltProgram<D, F, N>, share: f64| {
            let mut by = [0.0; 6];
            by[column] = share * step;
            let [x, y, z, turn @ ..] = by;
            let pose = Pose {
                position: from.position + Vector3::new(x, y, z),
                frame: exp(&Vector3::from(turn)) * from.frame,
            };
            program.move_support(support, &pose);
        };
        let mut beside = self.follower.clone();
        let followed = beside.follow(step.abs(), &mut change, proceed);
        // Once more, without a motion, is one more step of Newton's method: what the tolerance leaves would show over the step.
        let settled = beside.follow(step.abs(), &mut |_, _| (), proceed);
        let is_there = followed.arrived && settled.arrived;
        lowest(&beside, proceed).ok().filter(|_| is_there)
    }
}

/// The lowest eigenvalue at the minimum of a follower, in the units of its programme.
fn lowest<D: StripModel<F, N>, const F: usize, const N: usize>(
    follower: &Follower<BeltProgram<D, F, N>, 6, F, N>,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<f64, NoModes> {
    let mut at = follower.minimum().clone();
    let modes = stagewise::lowest_modes_while(follower.program(), &mut at, 1, proceed);
    let modes = modes.map_err(|Singular| NoModes::Singular)?;
    modes
        .first()
        .map(|mode| mode.eigenvalue)
        .ok_or(NoModes::Singular)
}
