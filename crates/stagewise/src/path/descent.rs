//! The way downhill from a lost minimum, to the nearest one.

use crate::interior_point::{Settings, Solution, minimise};
use crate::program::Program;
use std::ops::ControlFlow;

impl Settings {
    /// Settings of a descent to the nearest minimum downhill, with the unit of distance of its programme.
    ///
    /// Short steps under drag are those of the implicit Euler method for an overdamped motion, and end where that ends.
    /// Newton's long steps and a high barrier may pass a shallow minimum.
    pub fn downhill(tolerance: f64, unit: f64) -> Self {
        /// First barrier parameter, so low that the descent begins near its start; objective per unit weight.
        const FIRST_BARRIER: f64 = 1e-5;
        /// Largest count of iterations; a number.
        const ITERATIONS: usize = 300;
        /// Longest step in the metric, in the unit of distance.
        const LONGEST_STEP: f64 = 1e-3;
        Self {
            tolerance,
            iterations: ITERATIONS,
            barrier: FIRST_BARRIER,
            longest_step: LONGEST_STEP * unit,
        }
    }
}

/// The nearest minimum downhill from a point.
pub(super) fn descend<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
    tolerance: f64,
    from: P::Point,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Solution<P::Point> {
    let settings = Settings::downhill(tolerance, program.scales().distance);
    minimise(program, &settings, from, proceed)
}
