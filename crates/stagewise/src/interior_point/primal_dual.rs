//! A point with its multipliers under a barrier, and the Newton step from it.

use super::barrier::{Barrier, Lengths};
use super::{Residuals, UNBOUNDED};
use crate::linear::chain::NodeVector;
use crate::linear::{Inertia, Kkt};
use crate::program::{Multipliers, Program, Scales, Values};
use crate::{larger, largest};

/// A point with its multipliers, the derivatives and the Newton step at the point, and the trial point.
#[derive(Clone)]
pub(crate) struct PrimalDual<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize> {
    pub(crate) program: P,
    pub(crate) point: P::Point,
    pub(crate) values: Values,
    pub(crate) multipliers: Multipliers,
    pub(crate) barrier: Barrier,
    pub(crate) kkt: Kkt<X, U, N>,
    /// Gradient of the barrier problem's Lagrangian at the point.
    pub(crate) gradient: Vec<NodeVector<N>>,
    pub(crate) trial_values: Values,
    trial: P::Point,
    /// Step of the inequalities' multipliers.
    inequality_step: Vec<f64>,
    rates: Vec<f64>,
    scales: Scales,
}

impl<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize> PrimalDual<P, X, U, N> {
    /// The iterate at a point, with the inequalities' multipliers on the central path, and whether the point is admissible.
    pub(crate) fn new(program: P, barrier: f64, mut point: P::Point) -> (Self, bool) {
        let kkt = Kkt::new(program.layout());
        let mut values = Values::default();
        let admissible = program.evaluate(&mut point, &mut values);
        let layout = kkt.layout();
        let rows = layout.inequalities();
        let mut iterate = Self {
            scales: program.scales(),
            program,
            trial: point.clone(),
            trial_values: values.clone(),
            point,
            values,
            multipliers: Multipliers::zero(layout),
            barrier: Barrier::new(barrier, layout),
            gradient: kkt.linear.gradient.clone(),
            inequality_step: vec![0.0; rows],
            rates: vec![0.0; rows],
            kkt,
        };
        iterate.centre();
        iterate.linearise();
        (iterate, admissible)
    }

    /// Puts the inequalities' multipliers on the central path.
    pub(crate) fn centre(&mut self) {
        let multipliers = self.multipliers.inequalities.iter_mut();
        for (row, (multiplier, slack)) in multipliers.zip(&self.values.slacks).enumerate() {
            *multiplier = self.barrier.target(row) / slack;
        }
    }

    /// Evaluates the derivatives at the point.
    pub(crate) fn linearise(&mut self) {
        self.kkt
            .linearise(&self.program, &self.point, &self.multipliers);
    }

    /// Assembles the system from the derivatives.
    pub(crate) fn assemble(&mut self) {
        self.kkt
            .assemble(&self.values, &self.multipliers.inequalities);
    }

    /// Residuals of the first-order conditions without a barrier.
    pub(crate) fn residuals(&mut self) -> Residuals {
        self.gradient.copy_from_slice(&self.kkt.linear.gradient);
        let residuals = Residuals {
            stationarity: self.stationarity(),
            constraint: largest(self.values.equalities.iter()),
            complementarity: self.complementarity(0.0),
        };
        self.program.judged(residuals, &self.multipliers)
    }

    /// Stationarity residual with the equalities' multipliers at zero.
    pub(crate) fn stationarity_without_equalities(&mut self) -> f64 {
        self.gradient.copy_from_slice(&self.kkt.linear.gradient);
        self.kkt
            .take_off_pulls(&self.multipliers.equalities, &mut self.gradient);
        self.stationarity()
    }

    /// Largest entry of the gradient less the inequalities' multipliers times their gradients, beyond rounding of the controls.
    fn stationarity(&mut self) -> f64 {
        let multipliers = &self.multipliers.inequalities;
        let linear = &self.kkt.linear;
        linear.add_slack_gradients(|row| -multipliers[row], &mut self.gradient);
        linear.gather_gradient(&mut self.gradient);
        let rounding = |node: usize| self.program.rounding(&self.point, node);
        let mut most = 0.0;
        for (node, gradient) in self.gradient.iter().enumerate() {
            // Rounding makes entries smaller: those that are too small anyway need no look at it.
            if largest(gradient.iter()) <= most {
                continue;
            }
            let mut beyond = *gradient;
            let by_controls = linear.gradient_change(node, rounding);
            for (entry, rounded) in beyond.iter_mut().skip(X).zip(&by_controls) {
                *entry = beyond_rounding(*entry, *rounded);
            }
            most = larger(most, largest(beyond.iter()));
        }
        most
    }

    fn complementarity(&self, parameter: f64) -> f64 {
        let multipliers = &self.multipliers.inequalities;
        self.barrier
            .complementarity(parameter, &self.values.slacks, multipliers)
    }

    /// Lowers the barrier parameter while the barrier problem is solved; gives whether the parameter was lowered. `residuals`
    /// are those without a barrier.
    pub(crate) fn lower_barrier(&mut self, residuals: &Residuals, tolerance: f64) -> bool {
        /// Ratio of residual to barrier parameter at which a barrier problem counts as solved; dimensionless.
        const SOLVED: f64 = 10.0;
        let heaviest = self.barrier.heaviest();
        let least = self.least_barrier(tolerance);
        let mut lowered = false;
        loop {
            let parameter = self.barrier.parameter;
            let left = Residuals {
                complementarity: self.complementarity(parameter),
                ..*residuals
            };
            if parameter <= least || left.largest() > SOLVED * parameter * heaviest {
                return lowered;
            }
            self.barrier.lower(least);
            lowered = true;
        }
    }

    /// Sets the barrier parameter to the one at which a point of a residual counts as converged.
    pub(crate) fn set_barrier(&mut self, tolerance: f64) {
        self.barrier.parameter = self.least_barrier(tolerance);
    }

    /// Whether the barrier parameter is as low as it gets for a tolerance.
    pub(crate) fn is_barrier_least(&self, tolerance: f64) -> bool {
        self.barrier.parameter <= self.least_barrier(tolerance)
    }

    fn least_barrier(&self, tolerance: f64) -> f64 {
        self.barrier.least(tolerance)
    }

    /// Inertia of the second variation. Overwrites the derivatives.
    pub(crate) fn inertia(&mut self) -> Option<Inertia> {
        let metric = self.program.metric(&self.point);
        let symmetries = self.program.symmetries(&self.point);
        let multipliers = &self.multipliers.inequalities;
        self.kkt.inertia(
            &self.values,
            multipliers,
            &metric,
            &symmetries,
            &self.scales,
        )
    }

    /// Newton step of the barrier problem.
    pub(crate) fn find_step(&mut self) {
        self.find_barrier_gradient();
        self.kkt.find_step(&self.gradient, &self.values.equalities);
    }

    /// Newton step of the barrier problem that meets the linearised equalities however stiff they are.
    pub(super) fn find_rigid_step(&mut self) {
        self.find_barrier_gradient();
        let targets = &self.values.equalities;
        self.kkt.find_rigid_step(&self.gradient, targets);
    }

    /// Puts the equalities' multipliers where Newton steps lead, at the same point, while this lowers the residual: rounding of
    /// a long step of the multipliers is large beside a short step of the point.
    pub(super) fn find_multipliers(&mut self) {
        /// Greatest count of steps, a number.
        const STEPS: usize = 10;
        /// Ratio of successive residuals above which they end, dimensionless.
        const FALLEN: f64 = 0.5;
        let mut before = self.residuals().stationarity;
        for _ in 0..STEPS {
            self.assemble();
            if self.kkt.factorise(UNBOUNDED).is_err() {
                return;
            }
            self.find_rigid_step();
            let known = self.multipliers.equalities.clone();
            let steps = self.kkt.multiplier_step.iter();
            for (multiplier, step) in self.multipliers.equalities.iter_mut().zip(steps) {
                *multiplier += step;
            }
            self.linearise();
            let now = self.residuals().stationarity;
            if now > before {
                self.multipliers.equalities = known;
                self.linearise();
            }
            if now > FALLEN * before {
                return;
            }
            before = now;
        }
    }

    /// Gradient of the barrier problem's Lagrangian.
    pub(crate) fn find_barrier_gradient(&mut self) {
        self.gradient.copy_from_slice(&self.kkt.linear.gradient);
        let (barrier, slacks) = (&self.barrier, &self.values.slacks);
        let force = |row: usize| -barrier.target(row) / slacks[row];
        self.kkt
            .linear
            .add_slack_gradients(force, &mut self.gradient);
    }

    /// Step of the inequalities' multipliers, and the lengths that keep slacks and multipliers positive.
    pub(crate) fn find_inequality_step(&mut self) -> Lengths {
        self.kkt.slack_rates(&mut self.rates);
        self.barrier.find_step(
            &self.values.slacks,
            &self.multipliers.inequalities,
            &self.rates,
            &self.kkt.stiffness,
            &mut self.inequality_step,
        )
    }

    /// Evaluates the trial point along the step; false outside the domain.
    pub(crate) fn try_step(&mut self, length: f64) -> bool {
        self.program
            .retract(&self.point, &self.kkt.step, length, &mut self.trial);
        self.program
            .evaluate(&mut self.trial, &mut self.trial_values)
    }

    /// Evaluates the trial point along a step of another system; false outside the domain.
    pub(crate) fn try_along(&mut self, step: &[NodeVector<N>], length: f64) -> bool {
        self.program
            .retract(&self.point, step, length, &mut self.trial);
        self.program
            .evaluate(&mut self.trial, &mut self.trial_values)
    }

    /// Makes the trial point the point, and moves the multipliers along their step.
    pub(crate) fn accept(&mut self, lengths: Lengths) {
        self.take_trial();
        let steps = self.kkt.multiplier_step.iter();
        for (multiplier, step) in self.multipliers.equalities.iter_mut().zip(steps) {
            *multiplier += lengths.primal * step;
        }
        self.barrier.advance(
            &self.values.slacks,
            lengths.dual,
            &self.inequality_step,
            &mut self.multipliers.inequalities,
        );
    }

    pub(crate) fn take_trial(&mut self) {
        std::mem::swap(&mut self.point, &mut self.trial);
        std::mem::swap(&mut self.values, &mut self.trial_values);
    }
}

/// Size of an entry of the gradient beyond what rounding makes of it; NaN where the entry is NaN.
fn beyond_rounding(entry: f64, rounded: f64) -> f64 {
    /// Greatest amount that still counts as rounding, in the unit of the gradient.
    const MOST: f64 = 1e-6;
    let size = entry.abs();
    match rounded <= MOST {
        true if size <= rounded => 0.0,
        true => size - rounded,
        false => size,
    }
}
