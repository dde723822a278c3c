//! The line search: the longest share of a step that the filter accepts, with second-order corrections.

use super::barrier::Lengths;
use super::{InteriorPoint, Measure, violation};
use crate::layout::Layout;
use crate::linear::chain::NodeVector;
use crate::program::Program;

/// Work arrays of second-order corrections.
pub(super) struct SecondOrderCorrection<const N: usize> {
    targets: Vec<f64>,
    plain_step: Vec<NodeVector<N>>,
    plain_multiplier_step: Vec<f64>,
}

impl<const N: usize> SecondOrderCorrection<N> {
    pub(super) fn new(layout: &Layout) -> Self {
        Self {
            targets: vec![0.0; layout.equalities()],
            plain_step: vec![NodeVector::zeros(); layout.nodes()],
            plain_multiplier_step: vec![0.0; layout.equalities()],
        }
    }
}

impl<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>
    InteriorPoint<'_, P, X, U, N>
{
    /// Shortens the step until the filter accepts the trial point; false where no length is accepted.
    pub(super) fn search(&mut self) -> bool {
        /// Length of the shortest trial step, as a share of the Newton step; dimensionless.
        const SHORTEST_STEP: f64 = 1e-10;
        let longest = self.iterate.find_inequality_step();
        let (now, slope) = (self.measure(&self.iterate.values), self.slope());
        let mut length = longest.primal;
        while length > SHORTEST_STEP {
            if self.iterate.try_step(length) {
                let trial = self.measure(&self.iterate.trial_values);
                let taken = self.filter.takes(now, trial, length, slope)
                    || (length == longest.primal
                        && trial.violation >= now.violation
                        && self.correct(now, length, slope));
                if taken {
                    self.iterate.accept(Lengths {
                        primal: length,
                        dual: longest.dual,
                    });
                    return true;
                }
            }
            length *= 0.5;
        }
        false
    }

    /// Derivative of the barrier function along the step.
    fn slope(&mut self) -> f64 {
        let iterate = &mut self.iterate;
        let nodes = iterate.gradient.iter().zip(&iterate.kkt.step);
        let along: f64 = nodes.map(|(gradient, step)| gradient.dot(step)).sum();
        along - iterate.kkt.equality_work(&iterate.multipliers.equalities)
    }

    /// Second-order corrections: correct the full step for the equalities at its end until the filter accepts the corrected
    /// step; false where no correction is accepted.
    fn correct(&mut self, now: Measure, length: f64, slope: f64) -> bool {
        /// Largest count of second-order corrections in one line search; a number.
        const CORRECTIONS: usize = 4;
        /// Ratio of successive violations above which corrections end; dimensionless.
        const CONTRACTION: f64 = 0.99;
        let Self {
            correction,
            iterate,
            filter,
            layout,
            ..
        } = self;
        correction.plain_step.copy_from_slice(&iterate.kkt.step);
        correction
            .plain_multiplier_step
            .copy_from_slice(&iterate.kkt.multiplier_step);
        correction
            .targets
            .copy_from_slice(&iterate.values.equalities);
        let mut scale = length;
        let mut before = violation(layout, &iterate.trial_values);
        let mut taken = false;
        for _ in 0..CORRECTIONS {
            let values = iterate.trial_values.equalities.iter();
            for (target, value) in correction.targets.iter_mut().zip(values) {
                *target = *target * scale + value;
            }
            iterate
                .kkt
                .find_step(&iterate.gradient, &correction.targets);
            scale = iterate.find_inequality_step().primal;
            if !iterate.try_step(scale) {
                break;
            }
            let trial = Measure {
                violation: violation(layout, &iterate.trial_values),
                merit: iterate.barrier.merit(&iterate.trial_values),
            };
            taken = filter.takes(now, trial, length, slope);
            if taken || trial.violation > CONTRACTION * before {
                break;
            }
            before = trial.violation;
        }
        iterate.kkt.step.copy_from_slice(&correction.plain_step);
        iterate
            .kkt
            .multiplier_step
            .copy_from_slice(&correction.plain_multiplier_step);
        iterate.find_inequality_step();
        taken
    }
}
