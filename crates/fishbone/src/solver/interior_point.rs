//! The main loop: barrier, step, line search, restoration.

use super::chain::NodeVector;
use super::filter::{Filter, Measure};
use super::newton::Newton;
use super::{
    BOUNDS, Bounds, Inertia, Linearisation, Outcome, Program, Residuals, Rows, Settings, Solution,
    Stationary, Values, add_controls, larger,
};
use std::ops::ControlFlow;

/// Minimises a programme from a point of its domain.
///
/// `proceed` is asked once an iteration whether to go on.
pub fn minimise<P: Program>(
    program: &P,
    settings: &Settings,
    start: P::Point,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Solution<P::Point> {
    let mut state = State::new(program, *settings, start);
    let outcome = state.iterate(proceed);
    state.finish(outcome)
}

/// What a stationary point that was found by other means is worth.
pub fn assess<P: Program>(
    program: &P,
    tolerance: f64,
    at: &Stationary<P::Point>,
) -> Solution<P::Point> {
    let settings = Settings {
        tolerance,
        iterations: 0,
        barrier: 0.0,
    };
    let mut state = State::new(program, settings, at.point.clone());
    state.multipliers.clone_from(&at.multipliers);
    state.bound_multipliers.clone_from(&at.bound_multipliers);
    state.linearise();
    let outcome = match state.residuals().largest() <= tolerance {
        true => Outcome::Converged,
        false => Outcome::IterationLimit,
    };
    state.finish(outcome)
}

/// An objective below minus this, in its unit, has no least.
const BOTTOMLESS: f64 = 1e12;

/// Everything that changes from one iteration to the next, and room for all that an iteration needs.
pub(super) struct State<P: Program> {
    pub(super) program: P,
    pub(super) settings: Settings,
    pub(super) weights: Vec<f64>,
    /// Inequalities in use at every stage.
    bounds: usize,
    pub(super) point: P::Point,
    pub(super) values: Values,
    pub(super) multipliers: Vec<Rows>,
    pub(super) bound_multipliers: Bounds,
    pub(super) barrier: f64,
    iteration: usize,
    interrupted: bool,
    /// Whether the derivatives are those of the restoration.
    restoring: bool,
    admissible: bool,
    pub(super) linear: Linearisation,
    pub(super) newton: Newton,
    filter: Filter,
    pub(super) trial: P::Point,
    pub(super) trial_values: Values,
    bound_step: Bounds,
    pub(super) gradient: Vec<NodeVector>,
    targets: Vec<Rows>,
    plain_step: Vec<NodeVector>,
    plain_multiplier_step: Vec<Rows>,
}

/// How far a step may go: along the unknowns and along the bounds' multipliers.
#[derive(Clone, Copy)]
pub(super) struct Lengths {
    pub(super) primal: f64,
    pub(super) dual: f64,
}

impl<P: Program> State<P> {
    pub(super) fn new(program: P, settings: Settings, mut point: P::Point) -> Self {
        let weights = program.weights();
        let linear = Linearisation::new(&program);
        let newton = Newton::new(&linear, program.linked_nodes(), &weights, program.bounds());
        let mut values = Values::default();
        let admissible = program.evaluate(&mut point, &mut values);
        let rows = vec![Rows::zeros(); linear.constraints.len() + linear.links.len()];
        let bounds = vec![[0.0; BOUNDS]; weights.len()];
        let mut state = Self {
            bounds: program.bounds(),
            program,
            settings,
            filter: Filter::new(violation(&values)),
            trial: point.clone(),
            trial_values: values.clone(),
            point,
            values,
            multipliers: rows.clone(),
            bound_multipliers: bounds.clone(),
            barrier: settings.barrier,
            iteration: 0,
            interrupted: false,
            restoring: false,
            admissible,
            gradient: linear.gradient.clone(),
            plain_step: linear.gradient.clone(),
            linear,
            newton,
            bound_step: bounds,
            targets: rows.clone(),
            plain_multiplier_step: rows,
            weights,
        };
        state.centre_bound_multipliers();
        state.linearise();
        state
    }

    fn iterate(&mut self, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> Outcome {
        if !self.admissible {
            return Outcome::Inadmissible;
        }
        loop {
            let residuals = self.residuals();
            if residuals.largest() <= self.settings.tolerance {
                return Outcome::Converged;
            }
            if self.values.objective < -BOTTOMLESS {
                return Outcome::Unbounded;
            }
            if self.iteration >= self.settings.iterations {
                return Outcome::IterationLimit;
            }
            if self.is_interrupted(proceed) {
                return Outcome::Interrupted;
            }
            self.lower_barrier(&residuals);
            self.newton
                .assemble(&self.linear, &self.values, &self.bound_multipliers);
            if self.newton.factorise(&self.linear).is_err() {
                return Outcome::Unbounded;
            }
            self.find_step();
            if !self.search()
                && let Some(outcome) = self.recover(proceed)
            {
                return outcome;
            }
            self.linearise();
            self.iteration += 1;
        }
    }

    /// Asks the caller, who need not say so twice.
    fn is_interrupted(&mut self, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> bool {
        self.interrupted = self.interrupted || proceed().is_break();
        self.interrupted
    }

    fn finish(mut self, outcome: Outcome) -> Solution<P::Point> {
        if self.restoring {
            self.linearise();
        }
        self.prefer_zero_multipliers();
        let residuals = self.residuals();
        let inertia = self.inertia();
        Solution {
            residuals,
            at: Stationary {
                point: self.point,
                multipliers: self.multipliers,
                bound_multipliers: self.bound_multipliers,
            },
            values: self.values,
            iterations: self.iteration,
            outcome,
            inertia,
        }
    }

    /// Inertia of the second variation; the linearisation is not to be relied on afterwards.
    pub(super) fn inertia(&mut self) -> Option<Inertia> {
        let metric = self.program.metric(&self.point);
        self.newton.inertia(
            &mut self.linear,
            &self.values,
            &self.bound_multipliers,
            &metric,
        )
    }

    /// Drops multipliers that stationarity does not need: where constraints depend on each other they are not unique.
    ///
    /// A loose tolerance must not do so: it would call small forces none.
    fn prefer_zero_multipliers(&mut self) {
        const NONE: f64 = 1e-8;
        self.gradient.copy_from_slice(&self.linear.gradient);
        self.newton
            .take_off_pulls(&self.linear, &self.multipliers, &mut self.gradient);
        if self.stationarity() <= NONE.min(self.settings.tolerance) {
            self.multipliers.fill(Rows::zeros());
            self.linearise();
        }
    }

    pub(super) fn linearise(&mut self) {
        self.restoring = false;
        self.program.linearise(
            &self.point,
            &self.multipliers,
            &self.bound_multipliers,
            &mut self.linear,
        );
    }

    pub(super) fn residuals(&mut self) -> Residuals {
        self.gradient.copy_from_slice(&self.linear.gradient);
        Residuals {
            stationarity: self.stationarity(),
            constraint: largest(self.values.constraints.iter().flatten()),
            complementarity: self.complementarity(0.0),
        }
    }

    /// Largest entry of the gradient once the bounds' multipliers are taken off.
    fn stationarity(&mut self) -> f64 {
        for (k, multipliers) in self.bound_multipliers.iter().enumerate() {
            for (b, multiplier) in multipliers.iter().enumerate().take(self.bounds) {
                add_controls(
                    &mut self.gradient,
                    k,
                    &(-*multiplier * self.linear.slacks[k][b]),
                );
            }
        }
        self.linear.chain.fold(&mut self.gradient);
        largest(self.gradient.iter().flatten())
    }

    /// By how much slacks times their multipliers differ from `barrier` times the stage's weight.
    fn complementarity(&self, barrier: f64) -> f64 {
        let stages = self.bound_multipliers.iter().zip(&self.values.slacks);
        let product = |(k, (multipliers, slacks)): (usize, (&[f64; BOUNDS], &[f64; BOUNDS]))| {
            let pairs = multipliers.iter().zip(slacks).take(self.bounds);
            let target = barrier * self.weights[k];
            pairs.fold(0.0, |most, (a, b)| larger(most, (a * b - target).abs()))
        };
        stages.enumerate().map(product).fold(0.0, larger)
    }

    /// Lowers the barrier while its problem is solved well enough; `residuals` are those without a barrier.
    fn lower_barrier(&mut self, residuals: &Residuals) {
        const SOLVED: f64 = 10.0;
        let heaviest = largest(self.weights.iter());
        let least = 0.1 * self.settings.tolerance / heaviest;
        let left = |barrier: f64, state: &Self| Residuals {
            complementarity: state.complementarity(barrier),
            ..*residuals
        };
        while self.barrier > least
            && left(self.barrier, self).largest() <= SOLVED * self.barrier * heaviest
        {
            self.barrier = least.max((0.2 * self.barrier).min(self.barrier.powf(1.5)));
            self.filter.clear();
        }
    }

    /// Newton step of the barrier problem.
    pub(super) fn find_step(&mut self) {
        self.find_barrier_gradient();
        self.newton
            .solve(&self.linear, &self.gradient, &self.values.constraints);
    }

    /// Gradient of the barrier problem's Lagrangian.
    pub(super) fn find_barrier_gradient(&mut self) {
        self.gradient.copy_from_slice(&self.linear.gradient);
        for (k, slacks) in self.values.slacks.iter().enumerate() {
            let push = self.barrier * self.weights[k];
            for (b, slack) in slacks.iter().enumerate().take(self.bounds) {
                add_controls(
                    &mut self.gradient,
                    k,
                    &(-push / slack * self.linear.slacks[k][b]),
                );
            }
        }
    }

    /// Derivative of the barrier function along the step.
    fn slope(&self) -> f64 {
        let along: f64 = self
            .gradient
            .iter()
            .zip(&self.newton.step)
            .map(|(gradient, step)| gradient.dot(step))
            .sum();
        along - self.newton.constraint_work(&self.linear, &self.multipliers)
    }

    /// Violation and barrier function of some values.
    fn measure(&self, values: &Values) -> Measure {
        let logarithms: f64 = values
            .slacks
            .iter()
            .zip(&self.weights)
            .map(|(slacks, weight)| {
                let slacks = slacks.iter().take(self.bounds);
                weight * slacks.map(|slack| slack.ln()).sum::<f64>()
            })
            .sum();
        Measure {
            violation: violation(values),
            merit: values.objective - self.barrier * logarithms,
        }
    }

    /// Step of the bounds' multipliers, and the lengths that keep slacks and multipliers positive.
    pub(super) fn find_bound_step(&mut self) -> Lengths {
        let keep = (1.0 - self.barrier).clamp(0.99, 1.0 - 1e-9);
        let mut lengths = Lengths {
            primal: 1.0,
            dual: 1.0,
        };
        for (k, steps) in self.bound_step.iter_mut().enumerate() {
            for (b, step) in steps.iter_mut().enumerate().take(self.bounds) {
                let (slack, multiplier) = (self.values.slacks[k][b], self.bound_multipliers[k][b]);
                let rate = self.newton.slack_rate(&self.linear, k, b);
                let central = self.barrier * self.weights[k] / slack;
                *step = central - multiplier - self.newton.yielding(k, b, rate);
                if rate < 0.0 {
                    lengths.primal = lengths.primal.min(-keep * slack / rate);
                }
                if *step < 0.0 {
                    lengths.dual = lengths.dual.min(-keep * multiplier / *step);
                }
            }
        }
        lengths
    }

    /// Shortens the step until the filter takes the trial point; false where it takes none.
    fn search(&mut self) -> bool {
        const SHORTEST: f64 = 1e-10;
        let longest = self.find_bound_step();
        let (now, slope) = (self.measure(&self.values), self.slope());
        let mut length = longest.primal;
        while length > SHORTEST {
            if self.try_step(length) {
                let trial = self.measure(&self.trial_values);
                let taken = self.filter.takes(now, trial, length, slope)
                    || (length == longest.primal
                        && trial.violation >= now.violation
                        && self.correct(now, length, slope));
                if taken {
                    self.accept(length, longest.dual);
                    return true;
                }
            }
            length *= 0.5;
        }
        false
    }

    /// Second-order correction: bends the full step back to the constraints until the filter takes it.
    fn correct(&mut self, now: Measure, length: f64, slope: f64) -> bool {
        const MOST: usize = 4;
        const CONTRACTION: f64 = 0.99;
        self.plain_step.copy_from_slice(&self.newton.step);
        self.plain_multiplier_step
            .copy_from_slice(&self.newton.multiplier_step);
        self.targets.copy_from_slice(&self.values.constraints);
        let mut scale = length;
        let mut before = violation(&self.trial_values);
        let mut taken = false;
        for _ in 0..MOST {
            for (target, value) in self.targets.iter_mut().zip(&self.trial_values.constraints) {
                *target = *target * scale + value;
            }
            self.newton
                .solve(&self.linear, &self.gradient, &self.targets);
            scale = self.find_bound_step().primal;
            if !self.try_step(scale) {
                break;
            }
            let trial = self.measure(&self.trial_values);
            taken = self.filter.takes(now, trial, length, slope);
            if taken || trial.violation > CONTRACTION * before {
                break;
            }
            before = trial.violation;
        }
        self.newton.step.copy_from_slice(&self.plain_step);
        self.newton
            .multiplier_step
            .copy_from_slice(&self.plain_multiplier_step);
        self.find_bound_step();
        taken
    }

    /// Evaluates the trial point; false outside the domain.
    pub(super) fn try_step(&mut self, length: f64) -> bool {
        self.program
            .retract(&self.point, &self.newton.step, length, &mut self.trial);
        self.program
            .evaluate(&mut self.trial, &mut self.trial_values)
    }

    /// Takes the trial point and moves the multipliers along.
    pub(super) fn accept(&mut self, primal: f64, dual: f64) {
        const SPREAD: f64 = 1e10;
        self.take_trial();
        for (multiplier, step) in self
            .multipliers
            .iter_mut()
            .zip(&self.newton.multiplier_step)
        {
            *multiplier += primal * step;
        }
        for (k, multipliers) in self.bound_multipliers.iter_mut().enumerate() {
            for (b, multiplier) in multipliers.iter_mut().enumerate().take(self.bounds) {
                let central = self.barrier * self.weights[k] / self.values.slacks[k][b];
                *multiplier = (*multiplier + dual * self.bound_step[k][b])
                    .clamp(central / SPREAD, central * SPREAD);
            }
        }
    }

    pub(super) fn take_trial(&mut self) {
        std::mem::swap(&mut self.point, &mut self.trial);
        std::mem::swap(&mut self.values, &mut self.trial_values);
    }

    /// Goes on where the line search found nothing: toward the constraints, or where these hold without the filter's
    /// memory; an outcome where neither is left.
    fn recover(&mut self, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> Option<Outcome> {
        if self.violation() > self.settings.tolerance {
            return (!self.restore(proceed)).then_some(Outcome::LocallyInfeasible);
        }
        if self.filter.is_empty() {
            return Some(Outcome::Stalled);
        }
        self.filter.clear();
        self.centre_bound_multipliers();
        None
    }

    /// Feasibility restoration: steps of least length toward the constraints until the filter takes the point; false
    /// where the violation cannot be lowered.
    fn restore(&mut self, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> bool {
        const ENOUGH: f64 = 0.1;
        let left = self.measure(&self.values);
        self.filter.leave(left);
        self.multipliers.fill(Rows::zeros());
        while self.iteration < self.settings.iterations && !self.is_interrupted(proceed) {
            self.iteration += 1;
            self.centre_bound_multipliers();
            if !self.step_toward_constraints() {
                return false;
            }
            let now = self.measure(&self.values);
            if now.violation <= ENOUGH * left.violation && self.filter.admits(now) {
                self.centre_bound_multipliers();
                return true;
            }
        }
        true
    }

    /// One step of least length toward the constraints, shortened until the violation falls.
    fn step_toward_constraints(&mut self) -> bool {
        const SHORTEST: f64 = 1e-8;
        const SUFFICIENT: f64 = 1e-4;
        self.linearise();
        self.restoring = true;
        self.linear.forget_second_derivatives();
        self.linear.gradient.fill(NodeVector::zeros());
        self.newton
            .assemble(&self.linear, &self.values, &self.bound_multipliers);
        let damping = self.barrier.sqrt();
        if self.newton.factorise_damped(&self.linear, damping).is_err() {
            return false;
        }
        self.find_step();
        let before = self.violation();
        let mut length = self.find_bound_step().primal;
        while length > SHORTEST {
            if self.try_step(length)
                && violation(&self.trial_values) <= (1.0 - SUFFICIENT * length) * before
            {
                self.take_trial();
                return true;
            }
            length *= 0.5;
        }
        false
    }

    fn violation(&self) -> f64 {
        violation(&self.values)
    }

    /// Puts the bounds' multipliers on the central path.
    pub(super) fn centre_bound_multipliers(&mut self) {
        for (k, multipliers) in self.bound_multipliers.iter_mut().enumerate() {
            let push = self.barrier * self.weights[k];
            *multipliers = self.values.slacks[k].map(|slack| push / slack);
        }
    }
}

/// 1-norm of the constraint violation.
fn violation(values: &Values) -> f64 {
    values.constraints.iter().map(|rows| rows.lp_norm(1)).sum()
}

/// Largest absolute value; NaN where one is.
fn largest<'a>(numbers: impl Iterator<Item = &'a f64>) -> f64 {
    numbers.fold(0.0, |most, x| larger(most, x.abs()))
}

#[cfg(test)]
mod tests {
    use super::super::RowsByNode;
    use super::*;
    use nalgebra::{Matrix6, Vector4};

    const STAGES: usize = 8;

    /// A cart pushed along a line: its position is carried by the mean push of each stage, it must arrive at `goal`,
    /// the pushes cost their square, and their change is bounded. Nothing of it is a belt.
    struct Cart {
        goal: f64,
        steepest: f64,
        /// The pair of nodes that are `goal` apart, in place of the last node's distance from the origin.
        tied: Option<[usize; 2]>,
    }

    #[derive(Debug, Clone, PartialEq)]
    struct Ride {
        position: Vec<f64>,
        push: Vec<[f64; 2]>,
    }

    const SHARE: f64 = 1.0 / STAGES as f64;

    impl Cart {
        fn rate(&self, ride: &Ride, stage: usize) -> f64 {
            (ride.push[stage + 1][0] - ride.push[stage][0]) / SHARE / self.steepest
        }

        fn start(&self) -> Ride {
            Ride {
                position: vec![0.0; STAGES + 1],
                push: vec![[0.0; 2]; STAGES + 1],
            }
        }
    }

    impl Program for Cart {
        type Point = Ride;

        fn stages(&self) -> usize {
            STAGES
        }

        fn constrained_nodes(&self) -> Vec<usize> {
            vec![0, STAGES]
        }

        fn linked_nodes(&self) -> Vec<[usize; 2]> {
            self.tied.iter().copied().collect()
        }

        fn bounds(&self) -> usize {
            2
        }

        fn weights(&self) -> Vec<f64> {
            vec![SHARE; STAGES]
        }

        fn evaluate(&self, ride: &mut Ride, values: &mut Values) -> bool {
            values.objective = 0.0;
            values.slacks.clear();
            for k in 0..STAGES {
                let mean = 0.5 * (ride.push[k][0] + ride.push[k + 1][0]);
                ride.position[k + 1] = ride.position[k] + SHARE * mean;
                values.objective += 0.5 * SHARE * (mean * mean + ride.push[k][1].powi(2));
                let rate = self.rate(ride, k);
                values.slacks.push([1.0 - rate, 1.0 + rate, 1.0, 1.0, 1.0]);
            }
            let mut held = vec![Rows::zeros(); 2];
            held[0][0] = ride.position[0];
            held[0][1] = ride.push[0][0];
            match self.tied {
                None => held[1][0] = ride.position[STAGES] - self.goal,
                Some([a, b]) => {
                    let mut gap = Rows::zeros();
                    gap[0] = ride.position[b] - ride.position[a] - self.goal;
                    held.push(gap);
                }
            }
            values.constraints = held;
            values.slacks.iter().flatten().all(|slack| *slack > 0.0)
        }

        fn constraint_jacobians(&self, _: &Ride, into: &mut [RowsByNode]) {
            into.fill(RowsByNode::zeros());
            into[0][(0, 0)] = 1.0;
            into[0][(1, 6)] = 1.0;
            into[1][(0, 0)] = f64::from(self.tied.is_none());
        }

        fn linearise(
            &self,
            ride: &Ride,
            multipliers: &[Rows],
            _: &Bounds,
            into: &mut Linearisation,
        ) {
            into.gradient.fill(NodeVector::zeros());
            let pulls = |k: usize| match self.tied {
                None if k == STAGES => multipliers[1][0],
                Some([a, b]) => multipliers[2][0] * (f64::from(b == k) - f64::from(a == k)),
                None => 0.0,
            };
            let mut beyond = 0.0;
            for k in (0..STAGES).rev() {
                beyond += pulls(k + 1);
                let mean = 0.5 * (ride.push[k][0] + ride.push[k + 1][0]);
                let stage = &mut into.chain.stages[k];
                stage.growth_by_first[(0, 0)] = 0.5 * SHARE;
                stage.growth_by_second[(0, 0)] = 0.5 * SHARE;
                let by_mean = Vector4::new(0.5, 0.0, 0.5, 0.0);
                let controls = &mut into.diagonal.controls[k];
                *controls = SHARE * by_mean * by_mean.transpose();
                controls[(1, 1)] += SHARE;
                let pull = SHARE * (mean + beyond) * by_mean;
                add_controls(&mut into.gradient, k, &pull);
                into.gradient[k][7] += SHARE * ride.push[k][1];
                let by_rate = Vector4::new(-1.0, 0.0, 1.0, 0.0) / SHARE / self.steepest;
                let none = Vector4::zeros();
                into.slacks[k] = [-by_rate, by_rate, none, none, none];
            }
            into.gradient[0][0] = beyond + pulls(0) + multipliers[0][0];
            into.gradient[0][6] += multipliers[0][1];
            self.constraint_jacobians(ride, &mut into.constraints);
            for rows in &mut into.links {
                rows[0][(0, 0)] = -1.0;
                rows[1][(0, 0)] = 1.0;
            }
        }

        fn retract(&self, ride: &Ride, step: &[NodeVector], length: f64, into: &mut Ride) {
            into.position[0] = ride.position[0] + length * step[0][0];
            for (k, change) in step.iter().enumerate() {
                into.push[k] = [0, 1].map(|i| ride.push[k][i] + length * change[6 + i]);
            }
        }

        fn metric(&self, _: &Ride) -> Vec<Matrix6<f64>> {
            let mut along = Matrix6::zeros();
            along[(0, 0)] = SHARE;
            vec![along; STAGES + 1]
        }
    }

    fn settings() -> Settings {
        Settings {
            tolerance: 1e-9,
            iterations: 100,
            barrier: 1.0,
        }
    }

    fn solved(cart: &Cart) -> Solution<Ride> {
        minimise(cart, &settings(), cart.start(), &mut || {
            ControlFlow::Continue(())
        })
    }

    #[test]
    fn test_bound_is_active_where_the_free_optimum_breaks_it() {
        let cart = Cart {
            goal: 1.0,
            steepest: 4.0,
            tied: None,
        };
        let solution = solved(&cart);
        assert_eq!(solution.outcome, Outcome::Converged);
        assert!(solution.residuals.largest() <= 1e-9);
        // From rest the push rises as steeply as it may, to means of 1/4 and 3/4; the other six share the rest.
        let push: Vec<f64> = solution.at.point.push.iter().map(|push| push[0]).collect();
        let means: Vec<f64> = push
            .windows(2)
            .map(|pair| 0.5 * (pair[0] + pair[1]))
            .collect();
        for (mean, expected) in means
            .iter()
            .zip([0.25, 0.75].into_iter().chain([7.0 / 6.0; 6]))
        {
            assert!((mean - expected).abs() < 1e-5, "{means:?}");
        }
        assert!((solution.at.point.position[STAGES] - 1.0).abs() < 1e-9);
    }

    #[test]
    fn test_multiplier_is_minus_the_slope_of_the_least_objective() {
        let least = |goal: f64| {
            solved(&Cart {
                goal,
                steepest: 4.0,
                tied: None,
            })
        };
        let (below, here, above) = (least(0.999), least(1.0), least(1.001));
        let slope = (above.values.objective - below.values.objective) / 0.002;
        assert!((slope + here.at.multipliers[1][0]).abs() < 1e-5 * slope.abs());
    }

    #[test]
    fn test_tie_between_two_nodes_is_worth_the_constraint_it_replaces() {
        let cart = |tied| Cart {
            goal: 1.0,
            steepest: 4.0,
            tied,
        };
        let (held, tied) = (solved(&cart(None)), solved(&cart(Some([0, STAGES]))));
        assert_eq!(tied.outcome, Outcome::Converged);
        assert!((held.values.objective - tied.values.objective).abs() < 1e-9);
        assert!((held.at.multipliers[1][0] - tied.at.multipliers[2][0]).abs() < 1e-6);
        let inner = solved(&Cart {
            goal: 0.5,
            ..cart(Some([3, 6]))
        });
        let gap = inner.at.point.position[6] - inner.at.point.position[3];
        assert_eq!(inner.outcome, Outcome::Converged);
        assert!((gap - 0.5).abs() < 1e-9);
    }

    #[test]
    fn test_goal_out_of_reach_is_locally_infeasible() {
        let cart = Cart {
            goal: 10.0,
            steepest: 1.0,
            tied: None,
        };
        let solution = solved(&cart);
        assert_ne!(solution.outcome, Outcome::Converged);
        assert!(solution.residuals.constraint > 1.0);
    }

    #[test]
    fn test_caller_may_end_it() {
        let cart = Cart {
            goal: 1.0,
            steepest: 4.0,
            tied: None,
        };
        let solution = minimise(&cart, &settings(), cart.start(), &mut || {
            ControlFlow::Break(())
        });
        assert_eq!(
            (solution.outcome, solution.iterations),
            (Outcome::Interrupted, 0)
        );
    }
}
