//! Feasibility restoration: the problem of the shortest step toward the equalities, under the barrier.

use super::primal_dual::PrimalDual;
use super::violation;
use crate::layout::Layout;
use crate::linear::Kkt;
use crate::linear::chain::NodeVector;
use crate::program::Program;

/// The system of the restoration.
pub(super) struct Restoration<const X: usize, const U: usize, const N: usize> {
    kkt: Kkt<X, U, N>,
    gradient: Vec<NodeVector<N>>,
    rates: Vec<f64>,
}

impl<const X: usize, const U: usize, const N: usize> Restoration<X, U, N> {
    pub(super) fn new(layout: &Layout) -> Self {
        Self {
            kkt: Kkt::new(layout.clone()),
            gradient: vec![NodeVector::zeros(); layout.nodes()],
            rates: vec![0.0; layout.inequalities()],
        }
    }

    /// Moves a point by one step of least length toward the equalities, shortened until their violation decreases; false
    /// where no length decreases the violation.
    pub(super) fn step<P: Program<X, U, N>>(
        &mut self,
        iterate: &mut PrimalDual<P, X, U, N>,
    ) -> bool {
        /// Dampings that are tried in turn, over that of the barrier: a step in directions that hardly change the equalities
        /// may be so long that nothing along it is linear.
        const DAMPINGS: [f64; 3] = [1.0, 1e2, 1e4];
        self.kkt
            .linearise(&iterate.program, &iterate.point, &iterate.multipliers);
        self.kkt.linear.forget_second_derivatives();
        let damping = iterate.barrier.parameter.sqrt();
        DAMPINGS
            .into_iter()
            .any(|more| self.damped_step(iterate, more * damping))
    }

    /// A step with a damping, at the linearisation of the point; false where no length decreases the violation.
    fn damped_step<P: Program<X, U, N>>(
        &mut self,
        iterate: &mut PrimalDual<P, X, U, N>,
        damping: f64,
    ) -> bool {
        /// Length of the shortest trial step, as a share of the restoration step; dimensionless.
        const SHORTEST_STEP: f64 = 1e-8;
        /// Ratio of the decrease of the violation to its linear prediction that is sufficient (Armijo); dimensionless.
        const SUFFICIENT: f64 = 1e-4;
        self.kkt
            .assemble(&iterate.values, &iterate.multipliers.inequalities);
        if self.kkt.factorise_damped(damping).is_err() {
            return false;
        }
        self.gradient.fill(NodeVector::zeros());
        let (barrier, slacks) = (&iterate.barrier, &iterate.values.slacks);
        let force = |row: usize| -barrier.target(row) / slacks[row];
        self.kkt
            .linear
            .add_slack_gradients(force, &mut self.gradient);
        self.kkt
            .find_step(&self.gradient, &iterate.values.equalities);
        let before = violation(self.kkt.layout(), &iterate.values);
        let mut length = self.longest(iterate);
        while length > SHORTEST_STEP {
            if iterate.try_along(&self.kkt.step, length)
                && violation(self.kkt.layout(), &iterate.trial_values)
                    <= (1.0 - SUFFICIENT * length) * before
            {
                iterate.take_trial();
                return true;
            }
            length *= 0.5;
        }
        false
    }

    /// The largest step length that keeps the slacks positive.
    fn longest<P: Program<X, U, N>>(&mut self, iterate: &PrimalDual<P, X, U, N>) -> f64 {
        self.kkt.slack_rates(&mut self.rates);
        let mut steps = vec![0.0; self.rates.len()];
        let lengths = iterate.barrier.find_step(
            &iterate.values.slacks,
            &iterate.multipliers.inequalities,
            &self.rates,
            &self.kkt.stiffness,
            &mut steps,
        );
        lengths.primal
    }
}
