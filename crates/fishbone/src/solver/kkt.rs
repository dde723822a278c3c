//! The first-order conditions of a solution, linearised and factorised: how it answers to small changes of its programme.

use super::chain::{NodeVector, TooConcave};
use super::newton::Newton;
use super::{
    BOUNDS, Bounds, Linearisation, Program, Residuals, Rows, Stationary, Values, add_controls,
    larger,
};
use nalgebra::{Matrix6, SVector, Vector2, Vector4};

/// Most times that the solution of the system is improved by what it misses.
const REFINEMENTS: usize = 20;
/// Share of the solution below which an improvement is not worth it.
const ENOUGH: f64 = 1e-16;
/// Share of the right-hand side below which what answers to it is rounding.
const NOTHING: f64 = 1e-8;
/// Share of the solution above which what is missed is more than rounding.
const CLEARLY: f64 = 1e-6;

/// The symmetric system
///
/// ```text
/// [ H  Jᵀ  Sᵀ  ] [ step ]       [ gradient    ]
/// [ J          ] [  λ   ]  =  − [ constraints ]
/// [ S     −s/ν ] [  κ   ]       [ slacks      ]
/// ```
///
/// at a solution: H the second derivative of the Lagrangian, J and S the first ones of constraints and slacks. With the
/// change of these and of the Lagrangian's gradient on the right, it yields the step of the unknowns, that of the
/// constraints' multipliers, and that of the bounds' with the sign changed, in which slack times multiplier is kept.
#[derive(Debug, Clone)]
pub struct Kkt {
    linear: Linearisation,
    newton: Newton,
    pairs: Vec<[usize; 2]>,
    /// Multiplier over slack of every bound in use; 0 of the others.
    stiffness: Bounds,
    metric: Vec<Matrix6<f64>>,
    values: Values,
    weights: Vec<f64>,
    negative: usize,
}

/// A vector of the system: its right-hand side, or its solution.
#[derive(Debug, Clone)]
pub struct KktVector {
    /// Entries of the unknowns; of a right-hand side they are derivatives by all states and controls, of a solution the
    /// states are carried along.
    pub nodes: Vec<NodeVector>,
    /// Entries of the constraints.
    pub constraints: Vec<Rows>,
    /// Entries of the bounds.
    pub bounds: Bounds,
}

/// The system has no solution, or not a single one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Singular;

impl Kkt {
    /// Factorises the system of a programme at its minimum.
    ///
    /// Errors: [`Singular`] where the second variation is not positive.
    pub fn factorise<P: Program>(
        program: &P,
        at: &mut Stationary<P::Point>,
    ) -> Result<Self, Singular> {
        let mut kkt = Self::evaluate(program, at)?;
        let factorised = kkt.newton.factorise_damped(&kkt.linear, 0.0);
        factorised.map_err(|TooConcave| Singular)?;
        Ok(kkt)
    }

    /// The same at any solution, minimum or not.
    ///
    /// Errors: [`Singular`] where the second variation vanishes in some direction.
    pub fn factorise_any<P: Program>(
        program: &P,
        at: &mut Stationary<P::Point>,
    ) -> Result<Self, Singular> {
        let mut kkt = Self::evaluate(program, at)?;
        kkt.linear.hold_idle_controls();
        kkt.refactorise()?;
        Ok(kkt)
    }

    /// The system at a point of the domain, not factorised yet.
    fn evaluate<P: Program>(program: &P, at: &mut Stationary<P::Point>) -> Result<Self, Singular> {
        let mut values = Values::default();
        let is_admissible = program.evaluate(&mut at.point, &mut values);
        match is_admissible {
            true => Ok(Self::assemble(program, at, values)),
            false => Err(Singular),
        }
    }

    /// The system at a point with some values, not factorised yet.
    fn assemble<P: Program>(program: &P, at: &Stationary<P::Point>, values: Values) -> Self {
        let Stationary {
            point,
            multipliers,
            bound_multipliers: bounds,
        } = at;
        let mut linear = Linearisation::new(program);
        program.linearise(point, multipliers, bounds, &mut linear);
        let (pairs, used) = (program.linked_nodes(), program.bounds());
        let mut newton = Newton::new(&linear, pairs.clone(), &program.weights(), used);
        newton.assemble(&linear, &values, bounds);
        let mut stiffness = vec![[0.0; BOUNDS]; bounds.len()];
        for (k, stiffness) in stiffness.iter_mut().enumerate() {
            for (b, stiffness) in stiffness.iter_mut().enumerate().take(used) {
                *stiffness = bounds[k][b] / values.slacks[k][b];
            }
        }
        Self {
            linear,
            newton,
            pairs,
            stiffness,
            metric: program.metric(point),
            values,
            weights: program.weights(),
            negative: 0,
        }
    }

    /// What the first-order conditions miss where the system was factorised, with slacks times multipliers to become
    /// `barrier` times the stage's weight: minus the right-hand side of Newton's step.
    pub(super) fn conditions(&self, bounds: &Bounds, barrier: f64) -> KktVector {
        let mut missed = self.zero();
        missed.nodes.copy_from_slice(&self.linear.gradient);
        missed.constraints.clone_from(&self.values.constraints);
        for (k, multipliers) in bounds.iter().enumerate() {
            for (b, multiplier) in multipliers.iter().enumerate() {
                if self.stiffness[k][b] != 0.0 {
                    let pull = -*multiplier * self.linear.slacks[k][b];
                    add_controls(&mut missed.nodes, k, &pull);
                    missed.bounds[k][b] =
                        self.values.slacks[k][b] - barrier * self.weights[k] / multiplier;
                }
            }
        }
        self.linear.chain.fold(&mut missed.nodes);
        missed
    }

    /// What the first-order conditions of a programme miss at a point that may lie a little outside its bounds, slacks for
    /// themselves; `None` where they cannot be told.
    pub(super) fn conditions_of<P: Program>(
        program: &P,
        at: &Stationary<P::Point>,
    ) -> Option<KktVector> {
        let mut at = at.clone();
        let mut values = Values::default();
        program.evaluate(&mut at.point, &mut values);
        if values.constraints.is_empty() {
            return None;
        }
        let kkt = Self::assemble(program, &at, values);
        let conditions = kkt.conditions(&at.bound_multipliers, 0.0);
        let is_finite = conditions
            .nodes
            .iter()
            .all(|node| node.iter().all(|x| x.is_finite()));
        is_finite.then_some(conditions)
    }

    /// Moves the entries of controls that follow others to these, and drops those that are held.
    pub(super) fn fold(&self, vector: &mut KktVector) {
        self.linear.chain.carry_back(&mut vector.nodes);
        self.linear.chain.fold(&mut vector.nodes);
    }

    /// Residuals of what the conditions miss.
    pub(super) fn residuals(&self, missed: &KktVector, bounds: &Bounds) -> Residuals {
        let mut complementarity: f64 = 0.0;
        for (k, multipliers) in bounds.iter().enumerate() {
            for (b, multiplier) in multipliers.iter().enumerate() {
                if self.stiffness[k][b] != 0.0 {
                    let product = multiplier * self.values.slacks[k][b];
                    complementarity = larger(complementarity, product.abs());
                }
            }
        }
        Residuals {
            stationarity: largest(&missed.nodes),
            constraint: largest(&missed.constraints),
            complementarity,
        }
    }

    /// Whether every slack times its multiplier is `barrier` times the stage's weight, to the order.
    pub(super) fn is_centred(&self, bounds: &Bounds, barrier: f64) -> bool {
        const LITTLE: f64 = 1e-3;
        let stages = bounds.iter().zip(&self.values.slacks).zip(&self.weights);
        let mut used =
            stages
                .zip(&self.stiffness)
                .flat_map(|(((bounds, slacks), weight), stiffness)| {
                    let pairs = bounds.iter().zip(slacks).zip(stiffness);
                    pairs.filter(|(_, stiffness)| **stiffness != 0.0).map(
                        move |((multiplier, slack), _)| multiplier * slack / (barrier * weight),
                    )
                });
        used.all(|share| (share - 1.0).abs() <= LITTLE)
    }

    /// Change of a slack along a motion, to first order.
    pub(super) fn slack_rate(&self, stage: usize, bound: usize, motion: &[NodeVector]) -> f64 {
        let by = &self.linear.slacks[stage][bound];
        let [first, second] = [stage, stage + 1].map(|node| &motion[node]);
        by[0] * first[6] + by[1] * first[7] + by[2] * second[6] + by[3] * second[7]
    }

    /// Values where the system was factorised.
    pub(super) fn values(&self) -> &Values {
        &self.values
    }

    /// In how many of the directions that the constraints leave the second variation is negative.
    pub(super) fn negative(&self) -> usize {
        self.negative
    }

    fn refactorise(&mut self) -> Result<(), Singular> {
        let factorised = self.newton.factorise_any(&self.linear);
        self.negative = factorised.map_err(|TooConcave| Singular)?;
        Ok(())
    }

    /// Takes a multiple of the metric off the second derivatives and factorises the system again; in how many directions,
    /// of those that the constraints leave, it is negative then.
    ///
    /// Errors: [`Singular`] where it vanishes in some direction.
    pub(super) fn shift(&mut self, by: f64) -> Result<usize, Singular> {
        self.linear.diagonal.shift(&self.metric, by);
        self.newton.shift(&self.metric, by);
        self.refactorise()?;
        Ok(self.negative)
    }

    /// The pull of the metric on motions: its product with them.
    pub(super) fn pull(&self, motion: &[NodeVector]) -> Vec<NodeVector> {
        let pull = |(metric, motion): (&Matrix6<f64>, &NodeVector)| {
            let mut pull = NodeVector::zeros();
            pull.fixed_rows_mut::<6>(0)
                .copy_from(&(metric * motion.fixed_rows::<6>(0)));
            pull
        };
        self.metric.iter().zip(motion).map(pull).collect()
    }

    /// The same, with the squares of the slacks' changes in it.
    ///
    /// Where a stage is about to be straight, its slacks change at hardly any motion.
    pub(super) fn pull_by_slacks(&self, motion: &[NodeVector]) -> Vec<NodeVector> {
        const SHARE: f64 = 0.1;
        let mut pull = self.pull(motion);
        for (k, weight) in self.weights.iter().enumerate() {
            for b in 0..BOUNDS {
                if self.stiffness[k][b] != 0.0 {
                    let by_rate = SHARE * weight * self.slack_rate(k, b, motion);
                    add_controls(&mut pull, k, &(by_rate * self.linear.slacks[k][b]));
                }
            }
        }
        pull
    }

    /// A vector of zeros.
    pub fn zero(&self) -> KktVector {
        KktVector {
            nodes: vec![NodeVector::zeros(); self.linear.gradient.len()],
            constraints: vec![Rows::zeros(); self.linear.constraints.len() + self.pairs.len()],
            bounds: vec![[0.0; BOUNDS]; self.stiffness.len()],
        }
    }

    /// Solves the system.
    ///
    /// The bounds are eliminated for the factorisation, and where one is active that drowns its multiplier in rounding.
    /// What is missed is counted with the multipliers themselves, so that it does not come back.
    ///
    /// Errors: [`Singular`] where the constraints cannot change as asked.
    pub fn solve(&mut self, right: &KktVector) -> Result<KktVector, Singular> {
        let (found, last, missed) = self.improve(right);
        let size = largest(&found.nodes).max(NOTHING * largest(&right.nodes));
        let moved = size.max(largest(&right.constraints)).max(f64::MIN_POSITIVE);
        let is_met = largest(&missed.constraints) <= CLEARLY * moved;
        match last <= CLEARLY && is_met {
            true => Ok(found),
            false => Err(Singular),
        }
    }

    /// Solves the system as well as can be, however near to singular it is: for what is improved on later.
    ///
    /// Errors: [`Singular`] where nothing finite comes out.
    pub(super) fn solve_nearly(&mut self, right: &KktVector) -> Result<KktVector, Singular> {
        let (found, ..) = self.improve(right);
        let is_finite =
            largest(&found.nodes).is_finite() && largest(&found.constraints).is_finite();
        is_finite.then_some(found).ok_or(Singular)
    }

    /// The solution, improved until that is not worth while; the share of the last improvement, and what is still missed.
    fn improve(&mut self, right: &KktVector) -> (KktVector, f64, KktVector) {
        let mut found = self.zero();
        self.pull_by_stiffness(right, &mut found.bounds);
        let mut missed = self.missed(right, &found);
        let mut last = f64::INFINITY;
        let least = NOTHING * largest(&right.nodes).max(largest(&right.constraints));
        let size = |vectors: &[NodeVector]| largest(vectors).max(least).max(f64::MIN_POSITIVE);
        for _ in 0..=REFINEMENTS {
            self.newton
                .solve(&self.linear, &missed.nodes, &missed.constraints);
            self.add_step(&mut found);
            missed = self.missed(right, &found);
            let share = largest(&self.newton.step) / size(&found.nodes);
            let no_better = share >= last;
            // Every improvement is by about the same factor.
            let next = share * share / last.min(1.0);
            last = share;
            if next <= ENOUGH || no_better {
                break;
            }
        }
        (found, last, missed)
    }

    /// What the changes of the slacks alone do to the bounds' multipliers.
    fn pull_by_stiffness(&self, right: &KktVector, into: &mut Bounds) {
        for (k, pulls) in into.iter_mut().enumerate() {
            for (b, pull) in pulls.iter_mut().enumerate() {
                *pull = self.stiffness[k][b] * right.bounds[k][b];
            }
        }
    }

    /// Adds the step that was solved for last.
    fn add_step(&self, to: &mut KktVector) {
        for (node, step) in to.nodes.iter_mut().zip(&self.newton.step) {
            *node += step;
        }
        let steps = &self.newton.multiplier_step;
        for (rows, step) in to.constraints.iter_mut().zip(steps) {
            *rows += step;
        }
        for (k, bounds) in to.bounds.iter_mut().enumerate() {
            for (b, bound) in bounds.iter_mut().enumerate() {
                if self.stiffness[k][b] != 0.0 {
                    let rate = self.newton.slack_rate(&self.linear, k, b);
                    *bound += self.stiffness[k][b] * rate;
                }
            }
        }
    }

    /// Left-hand side of the first two rows plus the right-hand side: nothing at the solution.
    fn missed(&self, right: &KktVector, at: &KktVector) -> KktVector {
        let mut missed = right.clone();
        self.add_second_derivatives(&at.nodes, &mut missed.nodes);
        for (k, bounds) in at.bounds.iter().enumerate() {
            for (b, bound) in bounds.iter().enumerate() {
                if *bound != 0.0 {
                    let pull = *bound * self.linear.slacks[k][b];
                    add_controls(&mut missed.nodes, k, &pull);
                }
            }
        }
        let (at_nodes, between) = missed
            .constraints
            .split_at_mut(self.linear.constraints.len());
        let (pulls, link_pulls) = at.constraints.split_at(at_nodes.len());
        let terms = self
            .linear
            .diagonal
            .nodes
            .iter()
            .zip(&self.linear.constraints);
        for (i, (term, rows)) in terms.enumerate() {
            at_nodes[i] += rows * at.nodes[term.node];
            missed.nodes[term.node] += rows.tr_mul(&pulls[i]) + term.hessian * at.nodes[term.node];
        }
        for (i, (pair, by_nodes)) in self.pairs.iter().zip(&self.linear.links).enumerate() {
            for (node, rows) in pair.iter().zip(by_nodes) {
                between[i] += rows * at.nodes[*node];
                missed.nodes[*node] += rows.tr_mul(&link_pulls[i]);
            }
        }
        missed
    }

    /// Adds the second derivatives of stages and states along a step.
    fn add_second_derivatives(&self, step: &[NodeVector], into: &mut [NodeVector]) {
        let Linearisation {
            chain, diagonal, ..
        } = &self.linear;
        for (k, (stage, own)) in chain.stages.iter().zip(&diagonal.controls).enumerate() {
            let [first, second]: [Vector2<f64>; 2] =
                [k, k + 1].map(|node| step[node].fixed_rows::<2>(6).into_owned());
            into[k] += stage.state_first * first + stage.state_second * second;
            let controls = Vector4::new(first[0], first[1], second[0], second[1]);
            let mut by_controls = own * controls;
            let mut by_first = by_controls.fixed_rows_mut::<2>(0);
            by_first += stage.state_first.tr_mul(&step[k]);
            let mut by_second = by_controls.fixed_rows_mut::<2>(2);
            by_second += stage.state_second.tr_mul(&step[k]);
            add_controls(into, k, &by_controls);
        }
        for (k, own) in diagonal.states.iter().enumerate() {
            let mut by_state = into[k].fixed_rows_mut::<6>(0);
            by_state += own * step[k].fixed_rows::<6>(0);
        }
    }
}

impl KktVector {
    /// Adds a multiple of another.
    pub fn add(&mut self, factor: f64, other: &Self) {
        for (own, other) in self.nodes.iter_mut().zip(&other.nodes) {
            *own += factor * other;
        }
        for (own, other) in self.constraints.iter_mut().zip(&other.constraints) {
            *own += factor * other;
        }
        for (own, other) in self.bounds.iter_mut().zip(&other.bounds) {
            for (own, other) in own.iter_mut().zip(other) {
                *own += factor * other;
            }
        }
    }

    /// Multiplies it by a factor.
    pub fn scale(&mut self, factor: f64) {
        self.nodes.iter_mut().for_each(|node| *node *= factor);
        self.constraints.iter_mut().for_each(|rows| *rows *= factor);
        for bounds in &mut self.bounds {
            bounds.iter_mut().for_each(|bound| *bound *= factor);
        }
    }
}

/// Largest absolute entry; NaN where one is.
fn largest<const N: usize>(vectors: &[SVector<f64, N>]) -> f64 {
    let amax = vectors.iter().map(SVector::amax);
    amax.fold(0.0, larger)
}
