//! Unconstrained minimisation by Newton's method with Levenberg damping.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::ops::ControlFlow;

/// An objective function.
pub(super) trait Objective {
    /// Value at x; not finite where undefined.
    fn value(&self, x: &DVector<f64>) -> f64;

    /// Gradient and Hessian at x.
    fn derivatives(&self, x: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>);
}

/// The end of a minimisation.
pub(super) struct Minimum {
    /// The point.
    pub(super) x: DVector<f64>,
    /// Max-norm of the gradient there.
    pub(super) gradient: f64,
    /// Iterations made.
    pub(super) iterations: usize,
    /// Whether the gradient met the tolerance.
    pub(super) stationary: bool,
    /// Whether the caller broke it off.
    pub(super) interrupted: bool,
}

impl Minimum {
    /// Adds the iterations of the minimisation before this one.
    pub(super) fn after(self, earlier: Self) -> Self {
        Self {
            iterations: earlier.iterations + self.iterations,
            ..self
        }
    }
}

/// Actual decrease below which a step is refused, as a share of the predicted decrease.
const ACCEPTANCE: f64 = 1e-4;

/// Difference of values below which it is rounding, as a share of the value.
const ROUNDING: f64 = 1e-12;

/// Minimises from `x` until the max-norm of the gradient is at most `tolerance`.
pub(super) fn minimise(
    objective: &impl Objective,
    x: DVector<f64>,
    tolerance: f64,
    limit: usize,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Minimum {
    let mut state = State::new(objective, x);
    let mut interrupted = false;
    while !state.stationary(tolerance) && state.iterations < limit {
        interrupted = proceed().is_break();
        if interrupted || !state.advance(objective) {
            break;
        }
    }
    Minimum {
        stationary: state.stationary(tolerance),
        gradient: state.gradient.amax(),
        x: state.x,
        iterations: state.iterations,
        interrupted,
    }
}

/// The iterate with its value and derivatives.
struct State {
    x: DVector<f64>,
    value: f64,
    gradient: DVector<f64>,
    hessian: DMatrix<f64>,
    damping: f64,
    iterations: usize,
}

impl State {
    fn new(objective: &impl Objective, x: DVector<f64>) -> Self {
        let (gradient, hessian) = objective.derivatives(&x);
        Self {
            value: objective.value(&x),
            x,
            gradient,
            hessian,
            damping: 1.0,
            iterations: 0,
        }
    }

    fn stationary(&self, tolerance: f64) -> bool {
        self.value.is_finite() && self.gradient.amax() <= tolerance
    }

    /// Tries one step; false if every step left is lost in rounding.
    fn advance(&mut self, objective: &impl Objective) -> bool {
        let Some(step) = self.step() else {
            return false;
        };
        self.iterations += 1;
        let candidate = &self.x + &step;
        let predicted = -self.gradient.dot(&step) - 0.5 * step.dot(&(&self.hessian * &step));
        if predicted <= ROUNDING * (1.0 + self.value.abs()) {
            return self.polish(objective, candidate);
        }
        let value = objective.value(&candidate);
        // A value that is not a number compares false and is refused.
        let accepted = self.value - value >= ACCEPTANCE * predicted;
        self.adapt((self.value - value) / predicted, accepted);
        if accepted {
            let derivatives = objective.derivatives(&candidate);
            self.move_to(candidate, value, derivatives);
        }
        true
    }

    /// Accepts or refuses a step by the gradient, where values are too coarse to judge it.
    fn polish(&mut self, objective: &impl Objective, candidate: DVector<f64>) -> bool {
        let derivatives = objective.derivatives(&candidate);
        let better = derivatives.0.amax() < self.gradient.amax();
        if better {
            self.adapt(1.0, true);
            let value = objective.value(&candidate);
            self.move_to(candidate, value, derivatives);
        }
        better
    }

    fn move_to(&mut self, x: DVector<f64>, value: f64, derivatives: (DVector<f64>, DMatrix<f64>)) {
        (self.gradient, self.hessian) = derivatives;
        (self.x, self.value) = (x, value);
    }

    /// Less damping where the quadratic model predicts well, more where it does not.
    fn adapt(&mut self, ratio: f64, accepted: bool) {
        self.damping *= match ratio {
            _ if !accepted => 4.0,
            r if r > 0.75 => 0.2,
            r if r < 0.25 => 2.0,
            _ => 1.0,
        };
        self.damping = self.damping.max(1e-12);
    }

    /// The damped Newton step, with the damping raised until the matrix is positive definite; none where the
    /// objective is undefined.
    fn step(&mut self) -> Option<DVector<f64>> {
        while self.value.is_finite() && self.damping.is_finite() {
            if let Some(factor) = self.factor() {
                return Some(-factor.solve(&self.gradient));
            }
            self.damping *= 4.0;
        }
        None
    }

    fn factor(&self) -> Option<Cholesky<f64, Dyn>> {
        let size = self.x.len();
        let damping = DMatrix::from_diagonal_element(size, size, self.damping);
        Cholesky::new(&self.hessian + damping)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Rosenbrock's function; undefined where x < −2.
    struct Valley;

    impl Objective for Valley {
        fn value(&self, x: &DVector<f64>) -> f64 {
            let (bend, along) = (x[1] - x[0] * x[0], 1.0 - x[0]);
            if x[0] < -2.0 {
                f64::NAN
            } else {
                100.0 * bend * bend + along * along
            }
        }

        fn derivatives(&self, x: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
            let (x, y) = (x[0], x[1]);
            let bend = y - x * x;
            let gradient = [-400.0 * x * bend - 2.0 * (1.0 - x), 200.0 * bend];
            let mixed = -400.0 * x;
            let hessian = [-400.0 * (bend - 2.0 * x * x) + 2.0, mixed, mixed, 200.0];
            (
                DVector::from_row_slice(&gradient),
                DMatrix::from_row_slice(2, 2, &hessian),
            )
        }
    }

    fn from(x: f64, y: f64, limit: usize) -> Minimum {
        let mut go = || ControlFlow::Continue(());
        minimise(
            &Valley,
            DVector::from_row_slice(&[x, y]),
            1e-10,
            limit,
            &mut go,
        )
    }

    #[test]
    fn curved_valleys_are_followed_to_their_end() {
        for (x, y) in [(-1.2, 1.0), (0.0, 5.0), (3.0, -3.0)] {
            let minimum = from(x, y, 200);
            assert!(minimum.stationary);
            assert_relative_eq!(minimum.x, DVector::repeat(2, 1.0), epsilon = 1e-9);
        }
    }

    #[test]
    fn undefined_starts_are_not_called_stationary() {
        let minimum = from(-3.0, 0.0, 200);
        assert!(!minimum.stationary);
        assert_eq!(minimum.iterations, 0);
    }

    #[test]
    fn iterations_stop_at_their_limit() {
        let minimum = from(-1.2, 1.0, 3);
        assert!(!minimum.stationary && !minimum.interrupted);
        assert_eq!(minimum.iterations, 3);
    }
}
