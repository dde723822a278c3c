//! How a stationary point answers to small changes of its programme: the first-order conditions, factorised there.

use super::TooConcave;
use super::chain::NodeVector;
use super::kkt::Kkt;
use crate::layout::Layout;
use crate::linearisation::Linearisation;
use crate::program::{Program, Stationary, Values};
use crate::{Residuals, larger, largest, largest_entry};
use nalgebra::SMatrix;

/// Most times that the solution of the system is improved by what it misses.
const REFINEMENTS: usize = 20;
/// Share of the solution below which an improvement is not worth it.
const ENOUGH: f64 = 1e-16;
/// Share of the right-hand side below which the answer to it is rounding.
const NOTHING: f64 = 1e-8;
/// Share of the solution above which a miss is more than rounding.
const CLEARLY: f64 = 1e-6;

/// The symmetric system
///
/// ```text
/// [ H  Jᵀ  Sᵀ  ] [ step ]       [ gradient   ]
/// [ J          ] [  λ   ]  =  − [ equalities ]
/// [ S     −s/ν ] [  κ   ]       [ slacks     ]
/// ```
///
/// at a solution: H the second derivative of the Lagrangian, J and S the gradients of equalities and slacks s, whose
/// multipliers are ν. With the change of these and of the Lagrangian's gradient on the right, it yields the step of the
/// unknowns, that of the equalities' multipliers, and that of the inequalities' with the sign changed, along which slack
/// times multiplier stays the same.
#[derive(Debug, Clone)]
pub struct Response<const X: usize, const U: usize, const N: usize> {
    kkt: Kkt<X, U, N>,
    metric: Vec<SMatrix<f64, X, X>>,
    values: Values,
    negative: usize,
}

/// A vector of the system: its right-hand side, or its solution.
#[derive(Debug, Clone, PartialEq)]
pub struct Direction<const N: usize> {
    /// Entries of the unknowns; of a right-hand side they are derivatives by all states and controls, of a solution the
    /// states are carried along.
    pub nodes: Vec<NodeVector<N>>,
    /// Entries of the equalities.
    pub equalities: Vec<f64>,
    /// Entries of the inequalities.
    pub inequalities: Vec<f64>,
}

/// The system has no solution, or not a single one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Singular;

impl<const X: usize, const U: usize, const N: usize> Response<X, U, N> {
    /// Factorises the system of a programme at its minimum.
    ///
    /// Errors: [`Singular`] where the second variation is not positive.
    pub fn of_minimum<P: Program<X, U, N>>(
        program: &P,
        at: &mut Stationary<P::Point>,
    ) -> Result<Self, Singular> {
        let mut response = Self::evaluate(program, at)?;
        let factorised = response.kkt.factorise_damped(0.0);
        factorised.map_err(|TooConcave| Singular)?;
        Ok(response)
    }

    /// The same at any stationary point, minimum or not.
    ///
    /// Errors: [`Singular`] where the second variation vanishes in some direction.
    pub fn of_stationary<P: Program<X, U, N>>(
        program: &P,
        at: &mut Stationary<P::Point>,
    ) -> Result<Self, Singular> {
        let mut response = Self::evaluate(program, at)?;
        response.kkt.linear.hold_cost_free_controls();
        response.refactorise()?;
        Ok(response)
    }

    /// The system at a point of the domain, not factorised yet.
    fn evaluate<P: Program<X, U, N>>(
        program: &P,
        at: &mut Stationary<P::Point>,
    ) -> Result<Self, Singular> {
        let mut values = Values::default();
        let is_admissible = program.evaluate(&mut at.point, &mut values);
        match is_admissible {
            true => Ok(Self::assemble(program, at, values)),
            false => Err(Singular),
        }
    }

    /// The system at a point with some values, not factorised yet.
    fn assemble<P: Program<X, U, N>>(
        program: &P,
        at: &Stationary<P::Point>,
        values: Values,
    ) -> Self {
        let mut kkt = Kkt::new(program.layout());
        kkt.linearise(program, &at.point, &at.multipliers);
        kkt.assemble(&values, &at.multipliers.inequalities);
        Self {
            metric: program.metric(&at.point),
            kkt,
            values,
            negative: 0,
        }
    }

    fn linear(&self) -> &Linearisation<X, U, N> {
        &self.kkt.linear
    }

    fn layout(&self) -> &Layout {
        self.kkt.layout()
    }

    /// What the first-order conditions miss where the system was factorised, with slacks times multipliers to become
    /// `barrier` times their weight: minus the right-hand side of Newton's step.
    pub(crate) fn conditions(&self, multipliers: &[f64], barrier: f64) -> Direction<N> {
        let mut missed = self.zero();
        missed.nodes.copy_from_slice(&self.linear().gradient);
        missed.equalities.clone_from(&self.values.equalities);
        self.linear()
            .add_slack_gradients(|row| -multipliers[row], &mut missed.nodes);
        let weights = self.layout().row_weights();
        for (row, missed) in missed.inequalities.iter_mut().enumerate() {
            if multipliers[row] != 0.0 {
                *missed = self.values.slacks[row] - barrier * weights[row] / multipliers[row];
            }
        }
        self.linear().gather_gradient(&mut missed.nodes);
        missed
    }

    /// What the first-order conditions of a programme miss at a point where slacks may be a little below zero, slacks for
    /// themselves; `None` where they cannot be told.
    pub(crate) fn conditions_of<P: Program<X, U, N>>(
        program: &P,
        at: &Stationary<P::Point>,
    ) -> Option<Direction<N>> {
        let mut at = at.clone();
        let mut values = Values::default();
        program.evaluate(&mut at.point, &mut values);
        if values.equalities.is_empty() {
            return None;
        }
        let response = Self::assemble(program, &at, values);
        let conditions = response.conditions(&at.multipliers.inequalities, 0.0);
        let is_finite = |node: &NodeVector<N>| node.iter().all(|x| x.is_finite());
        conditions.nodes.iter().all(is_finite).then_some(conditions)
    }

    /// Moves the entries of controls that follow others to these, and drops those that are held.
    pub(crate) fn fold(&self, vector: &mut Direction<N>) {
        self.linear().chain.carry_back(&mut vector.nodes);
        self.linear().chain.fold(&mut vector.nodes);
    }

    /// Residuals of what the conditions miss.
    pub(crate) fn residuals(&self, missed: &Direction<N>, multipliers: &[f64]) -> Residuals {
        let products = multipliers.iter().zip(&self.values.slacks);
        Residuals {
            stationarity: largest_entry(&missed.nodes),
            constraint: largest(missed.equalities.iter()),
            complementarity: products.fold(0.0, |most, (multiplier, slack)| {
                larger(most, (multiplier * slack).abs())
            }),
        }
    }

    /// Whether every slack times its multiplier is `barrier` times its weight, to the order.
    pub(crate) fn is_centred(&self, multipliers: &[f64], barrier: f64) -> bool {
        const LITTLE: f64 = 1e-3;
        let weights = self.layout().row_weights();
        let rows = multipliers.iter().zip(&self.values.slacks).zip(weights);
        let mut shares =
            rows.map(|((multiplier, slack), weight)| multiplier * slack / (barrier * weight));
        shares.all(|share| (share - 1.0).abs() <= LITTLE)
    }

    /// Change of every slack along a motion, to first order.
    pub(crate) fn slack_rates(&self, motion: &[NodeVector<N>]) -> Vec<f64> {
        let mut rates = vec![0.0; self.layout().inequalities()];
        self.linear().slack_rates(motion, &mut rates);
        rates
    }

    /// Values where the system was factorised.
    pub(crate) fn values(&self) -> &Values {
        &self.values
    }

    /// Number of directions, of those that the equalities leave, in which the second variation is negative.
    pub(crate) fn negative(&self) -> usize {
        self.negative
    }

    fn refactorise(&mut self) -> Result<(), Singular> {
        let factorised = self.kkt.factorise_exactly();
        self.negative = factorised.map_err(|TooConcave| Singular)?;
        Ok(())
    }

    /// Takes a multiple of the metric off the second derivatives and factorises the system again; gives the number of
    /// directions, of those that the equalities leave, in which it is negative then.
    ///
    /// Errors: [`Singular`] where it vanishes in some direction.
    pub(crate) fn shift(&mut self, by: f64) -> Result<usize, Singular> {
        self.kkt.linear.diagonal.shift(&self.metric, by);
        self.kkt.shift(&self.metric, by);
        self.refactorise()?;
        Ok(self.negative)
    }

    /// The force of the metric on motions: its product with them.
    pub(crate) fn force(&self, motion: &[NodeVector<N>]) -> Vec<NodeVector<N>> {
        let force = |(metric, motion): (&SMatrix<f64, X, X>, &NodeVector<N>)| {
            let mut force = NodeVector::<N>::zeros();
            force
                .fixed_rows_mut::<X>(0)
                .copy_from(&(metric * motion.fixed_rows::<X>(0)));
            force
        };
        self.metric.iter().zip(motion).map(force).collect()
    }

    /// The same, with the squares of the slacks' changes in it.
    ///
    /// Motions that hardly change any state may still change slacks.
    pub(crate) fn force_with_slacks(&self, motion: &[NodeVector<N>]) -> Vec<NodeVector<N>> {
        const SHARE: f64 = 0.1;
        let mut force = self.force(motion);
        let rates = self.slack_rates(motion);
        let weights = self.layout().row_weights();
        self.linear()
            .add_slack_gradients(|row| SHARE * weights[row] * rates[row], &mut force);
        force
    }

    /// A vector of zeros.
    pub fn zero(&self) -> Direction<N> {
        Direction {
            nodes: vec![NodeVector::zeros(); self.layout().nodes()],
            equalities: vec![0.0; self.layout().equalities()],
            inequalities: vec![0.0; self.layout().inequalities()],
        }
    }

    /// Solves the system.
    ///
    /// The inequalities are eliminated for the factorisation, and where one is active that drowns its multiplier in
    /// rounding. What is missed is counted with the multipliers themselves, so that it does not come back.
    ///
    /// Errors: [`Singular`] where the equalities cannot change as asked.
    pub fn solve(&mut self, right: &Direction<N>) -> Result<Direction<N>, Singular> {
        let (found, last, missed) = self.improve(right);
        let size = largest_entry(&found.nodes).max(NOTHING * largest_entry(&right.nodes));
        let moved = size
            .max(largest(right.equalities.iter()))
            .max(f64::MIN_POSITIVE);
        let is_met = largest(missed.equalities.iter()) <= CLEARLY * moved;
        match last <= CLEARLY && is_met {
            true => Ok(found),
            false => Err(Singular),
        }
    }

    /// Solves the system as well as can be, however near to singular it is: for what is improved on later.
    ///
    /// Errors: [`Singular`] where nothing finite comes out.
    pub(crate) fn solve_nearly(&mut self, right: &Direction<N>) -> Result<Direction<N>, Singular> {
        let (found, ..) = self.improve(right);
        let is_finite =
            largest_entry(&found.nodes).is_finite() && largest(found.equalities.iter()).is_finite();
        is_finite.then_some(found).ok_or(Singular)
    }

    /// The solution, improved until that is not worth while; the share of the last improvement, and what is still missed.
    fn improve(&mut self, right: &Direction<N>) -> (Direction<N>, f64, Direction<N>) {
        let mut found = self.zero();
        let first_pair_row = self.layout().first_pair_row();
        let stiffness = self.kkt.stiffness.iter().zip(&right.inequalities);
        let rows = found.inequalities[..first_pair_row].iter_mut();
        for (found, (stiffness, right)) in rows.zip(stiffness) {
            *found = stiffness * right;
        }
        let mut missed = self.missed(right, &found);
        let mut last = f64::INFINITY;
        let least = largest_entry(&right.nodes).max(largest(right.equalities.iter()));
        let least = NOTHING * least;
        let size = |vectors: &[_]| largest_entry(vectors).max(least).max(f64::MIN_POSITIVE);
        for _ in 0..=REFINEMENTS {
            let of_pairs = &missed.inequalities[first_pair_row..];
            self.kkt.pair_targets.copy_from_slice(of_pairs);
            self.kkt.find_step(&missed.nodes, &missed.equalities);
            self.add_step(&mut found);
            missed = self.missed(right, &found);
            let share = largest_entry(&self.kkt.step) / size(&found.nodes);
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

    /// Adds the step that was solved for last.
    fn add_step(&self, to: &mut Direction<N>) {
        for (node, step) in to.nodes.iter_mut().zip(&self.kkt.step) {
            *node += step;
        }
        for (row, step) in to.equalities.iter_mut().zip(&self.kkt.multiplier_step) {
            *row += step;
        }
        let rates = self.slack_rates(&self.kkt.step);
        let rows = rates.iter().zip(&self.kkt.stiffness);
        let (others, pairs) = to.inequalities.split_at_mut(self.layout().first_pair_row());
        for (row, (rate, stiffness)) in others.iter_mut().zip(rows) {
            *row += stiffness * rate;
        }
        // These are unknowns of the border, not differences that drown in rounding.
        for (row, force) in pairs.iter_mut().zip(self.kkt.pair_forces()) {
            *row += force;
        }
    }

    /// Left-hand side plus right-hand side, zero at the solution: of stationarity, of the equalities and of the inequalities
    /// between pairs. The other inequalities are eliminated.
    fn missed(&self, right: &Direction<N>, at: &Direction<N>) -> Direction<N> {
        let linear = self.linear();
        let mut missed = right.clone();
        linear.add_stationarity(
            &at.nodes,
            &at.equalities,
            &at.inequalities,
            &mut missed.nodes,
        );
        let mut rates = vec![0.0; at.equalities.len()];
        linear.equality_rates(&at.nodes, &mut rates);
        for (missed, rate) in missed.equalities.iter_mut().zip(rates) {
            *missed += rate;
        }
        let first = self.layout().first_pair_row();
        if first < missed.inequalities.len() {
            let rates = self.slack_rates(&at.nodes);
            let rows = missed.inequalities.iter_mut().zip(&at.inequalities);
            let rows = rows.zip(rates).zip(&self.kkt.stiffness).skip(first);
            for (((missed, multiplier), rate), stiffness) in rows {
                *missed = match *stiffness {
                    0.0 => 0.0,
                    stiffness => *missed + rate - multiplier / stiffness,
                };
            }
        }
        missed
    }
}

impl<const N: usize> Direction<N> {
    /// Adds a multiple of another.
    pub fn add(&mut self, factor: f64, other: &Self) {
        for (own, other) in self.nodes.iter_mut().zip(&other.nodes) {
            *own += factor * other;
        }
        let equalities = self.equalities.iter_mut().zip(&other.equalities);
        let inequalities = self.inequalities.iter_mut().zip(&other.inequalities);
        for (own, other) in equalities.chain(inequalities) {
            *own += factor * other;
        }
    }

    /// Multiplies it by a factor.
    pub(crate) fn scale(&mut self, factor: f64) {
        self.nodes.iter_mut().for_each(|node| *node *= factor);
        let rows = self.equalities.iter_mut().chain(&mut self.inequalities);
        rows.for_each(|row| *row *= factor);
    }
}
