//! What the test programmes share: problems written as plain formulas, checks of derivatives, dense linear algebra.

#![allow(dead_code, reason = "no test file needs all of it")]

pub(crate) mod check;
pub(crate) mod dense;
pub(crate) mod jets;
pub(crate) mod transcribed;

use nalgebra::{SMatrix, SVector};
use stagewise::{Outcome, Program, Settings, Solution, minimise};
use std::ops::ControlFlow;

/// Never interrupts.
pub(crate) fn go_on() -> ControlFlow<()> {
    ControlFlow::Continue(())
}

pub(crate) const SETTINGS: Settings = Settings {
    tolerance: 1e-9,
    iterations: 300,
    barrier: 0.1,
    longest_step: f64::INFINITY,
};

/// The minimum from a start, which must be found.
#[track_caller]
pub(crate) fn solved<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
    start: P::Point,
) -> Solution<P::Point> {
    let solution = minimise(program, &SETTINGS, start, &mut go_on);
    assert_eq!(
        solution.outcome,
        Outcome::Converged,
        "after {} iterations: {:?}",
        solution.iterations,
        solution.residuals
    );
    assert!(solution.is_minimum(), "{:?}", solution.inertia);
    solution
}

/// Newton's method on a few equations, with derivatives by differences; `None` where it finds no root.
pub(crate) fn root<const R: usize>(
    start: [f64; R],
    equations: impl Fn(&SVector<f64, R>) -> SVector<f64, R>,
) -> Option<SVector<f64, R>> {
    let mut at = SVector::from(start);
    for _ in 0..60 {
        let value = equations(&at);
        let mut by = SMatrix::<f64, R, R>::zeros();
        for i in 0..R {
            let h = 1e-6 * at[i].abs().max(1.0);
            let moved = |h: f64| {
                let mut moved = at;
                moved[i] += h;
                equations(&moved)
            };
            by.set_column(i, &((moved(h) - moved(-h)) / (2.0 * h)));
        }
        let inverse = by.try_inverse()?;
        let step = inverse * value;
        let mut length = 1.0;
        while length > 1e-4 && equations(&(at - length * step)).norm() > value.norm() {
            length *= 0.5;
        }
        at -= length * step;
        if step.norm() < 1e-11 * at.norm().max(1.0) {
            break;
        }
    }
    (equations(&at).norm() < 1e-9).then_some(at)
}
