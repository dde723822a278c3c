//! Response of a stationary point to a perturbation of its programme, by the factorised first-order conditions.

use super::TooConcave;
use super::chain::NodeVector;
use super::kkt::Kkt;
use super::symmetries::{Motions, force_of};
use crate::layout::Layout;
use crate::linearisation::Linearisation;
use crate::program::{Program, Stationary, Values};
use crate::{Residuals, larger, largest, largest_entry};
use nalgebra::SMatrix;

/// Largest count of refinements of a solution; a number.
const REFINEMENTS: usize = 20;
/// Ratio of refinement to solution at which refinement has converged; dimensionless.
const CONVERGED: f64 = 1e-16;
/// Ratio of solution to right-hand side below which the solution is rounding, as where forces alone change; dimensionless.
const NEGLIGIBLE: f64 = 1e-5;
/// Ratio of residual to solution above which the system is singular; dimensionless.
const SIGNIFICANT: f64 = 1e-6;

/// The symmetric system
///
/// ```text
/// [ H  Jᵀ  Sᵀ  ] [ step ]       [ gradient   ]
/// [ J          ] [  λ   ]  =  − [ equalities ]
/// [ S     −s/ν ] [  κ   ]       [ slacks     ]
/// ```
///
/// at a solution: H the second derivative of the Lagrangian, J and S the gradients of equalities and slacks s, whose
/// multipliers are ν. The right-hand side is the perturbation of the Lagrangian's gradient, of the equalities and of
/// the slacks. The solution is the step of the unknowns, the step of the equalities' multipliers, and minus the step of the
/// inequalities' multipliers, along which slack times multiplier is constant.
#[derive(Debug, Clone)]
pub struct Response<const X: usize, const U: usize, const N: usize> {
    kkt: Kkt<X, U, N>,
    metric: Vec<SMatrix<f64, X, X>>,
    values: Values,
    negative: usize,
}

/// A right-hand side or a solution of the system.
#[derive(Debug, Clone, PartialEq)]
pub struct Direction<const N: usize> {
    /// Entries of the nodes: in a right-hand side, derivatives by all states and controls; in a solution, changes of all
    /// states and controls.
    pub nodes: Vec<NodeVector<N>>,
    /// Entries of the equalities.
    pub equalities: Vec<f64>,
    /// Entries of the inequalities.
    pub inequalities: Vec<f64>,
}

/// The system has no unique solution.
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

    /// Factorises the system of a programme at a stationary point of any inertia.
    ///
    /// Errors: [`Singular`] where the second variation has a zero eigenvalue.
    pub fn of_stationary<P: Program<X, U, N>>(
        program: &P,
        at: &mut Stationary<P::Point>,
    ) -> Result<Self, Singular> {
        let mut response = Self::unfactorised(program, at)?;
        response.refactorise()?;
        Ok(response)
    }

    /// The system at a stationary point, with the cost-free controls held; not factorised yet.
    pub(super) fn unfactorised<P: Program<X, U, N>>(
        program: &P,
        at: &mut Stationary<P::Point>,
    ) -> Result<Self, Singular> {
        let mut response = Self::evaluate(program, at)?;
        response.kkt.linear.hold_cost_free_controls();
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

    /// Residual of the first-order conditions of the barrier problem at the point of the factorisation: the right-hand side
    /// of Newton's step.
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

    /// Residual of the first-order conditions of a programme at a point whose slacks may be slightly negative; `None` where
    /// the conditions cannot be evaluated.
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

    /// Turns a right-hand side by all states and controls into a right-hand side by the unknowns.
    pub(crate) fn fold(&self, vector: &mut Direction<N>) {
        self.linear().chain.carry_back(&mut vector.nodes);
        self.linear().chain.fold(&mut vector.nodes);
    }

    /// Max-norms of a residual.
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

    /// Whether every slack times its multiplier is near `barrier` times its weight.
    pub(crate) fn is_centred(&self, multipliers: &[f64], barrier: f64) -> bool {
        /// Relative distance of slack times multiplier from the central path that counts as centred; dimensionless.
        const CENTRED: f64 = 1e-3;
        let weights = self.layout().row_weights();
        let rows = multipliers.iter().zip(&self.values.slacks).zip(weights);
        let mut shares =
            rows.map(|((multiplier, slack), weight)| multiplier * slack / (barrier * weight));
        shares.all(|share| (share - 1.0).abs() <= CENTRED)
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

    /// Number of negative eigenvalues of the second variation on the tangent space of the equalities.
    pub(crate) fn negative(&self) -> usize {
        self.negative
    }

    fn refactorise(&mut self) -> Result<(), Singular> {
        let factorised = self.kkt.factorise_exactly();
        self.negative = factorised.map_err(|TooConcave| Singular)?;
        Ok(())
    }

    /// Subtracts a multiple of the metric from the second derivatives and factorises the system again; gives the number of
    /// negative eigenvalues on the tangent space of the equalities.
    ///
    /// Errors: [`Singular`] where the shifted second variation has a zero eigenvalue.
    pub(crate) fn shift(&mut self, by: f64) -> Result<usize, Singular> {
        self.kkt.linear.diagonal.shift(&self.metric, by);
        self.kkt.shift(&self.metric, by);
        self.refactorise()?;
        Ok(self.negative)
    }

    /// The metric of every node.
    pub(super) fn metric(&self) -> &[SMatrix<f64, X, X>] {
        &self.metric
    }

    /// The force of the metric on motions: its product with them.
    pub(crate) fn force(&self, motion: &[NodeVector<N>]) -> Vec<NodeVector<N>> {
        force_of(&self.metric, motion)
    }

    /// Force of the metric with the squares of the slack rates added: a motion of small states may have large slack rates.
    pub(crate) fn force_with_slacks(&self, motion: &[NodeVector<N>]) -> Vec<NodeVector<N>> {
        /// Weight of the squares of slack rates beside the metric; squared distance per unit weight and squared slack.
        const SLACK_SHARE: f64 = 0.1;
        let mut force = self.force(motion);
        let rates = self.slack_rates(motion);
        let weights = self.layout().row_weights();
        self.linear()
            .add_slack_gradients(|row| SLACK_SHARE * weights[row] * rates[row], &mut force);
        force
    }

    /// A vector of zeros.
    pub fn zero(&self) -> Direction<N> {
        Direction::zeros(self.layout())
    }

    /// Solves the system.
    ///
    /// Elimination of an active inequality loses its multiplier in rounding. The residual is computed with the multipliers
    /// themselves, so that refinement restores the multiplier.
    ///
    /// Errors: [`Singular`] where no step changes the equalities by their right-hand side.
    pub fn solve(&mut self, right: &Direction<N>) -> Result<Direction<N>, Singular> {
        let (found, last, missed) = self.improve(right);
        let size = largest_entry(&found.nodes).max(NEGLIGIBLE * largest_entry(&right.nodes));
        let moved = size
            .max(largest(right.equalities.iter()))
            .max(f64::MIN_POSITIVE);
        let is_met = largest(missed.equalities.iter()) <= SIGNIFICANT * moved;
        match last <= SIGNIFICANT && is_met {
            true => Ok(found),
            false => Err(Singular),
        }
    }

    /// The motions that answer forces.
    ///
    /// Errors: [`Singular`] as [`Self::solve`].
    pub(super) fn answers(&mut self, forces: &Motions<N>) -> Result<Motions<N>, Singular> {
        forces.iter().map(|force| self.answer(force)).collect()
    }

    /// The motion that answers a force.
    ///
    /// Errors: [`Singular`] as [`Self::solve`].
    pub(super) fn answer(
        &mut self,
        force: &[NodeVector<N>],
    ) -> Result<Vec<NodeVector<N>>, Singular> {
        let mut right = self.zero();
        for (right, force) in right.nodes.iter_mut().zip(force) {
            *right = -force;
        }
        Ok(self.solve(&right)?.nodes)
    }

    /// Solves a system that may be nearly singular, for an approximation that a later iteration corrects.
    ///
    /// Errors: [`Singular`] where the solution is not finite.
    pub(crate) fn solve_nearly(&mut self, right: &Direction<N>) -> Result<Direction<N>, Singular> {
        let (found, ..) = self.improve(right);
        let is_finite =
            largest_entry(&found.nodes).is_finite() && largest(found.equalities.iter()).is_finite();
        is_finite.then_some(found).ok_or(Singular)
    }

    /// The solution by iterative refinement, the ratio of the last refinement to the solution, and the last residual.
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
        let least = NEGLIGIBLE * least;
        let size = |vectors: &[_]| largest_entry(vectors).max(least).max(f64::MIN_POSITIVE);
        for _ in 0..=REFINEMENTS {
            let of_pairs = &missed.inequalities[first_pair_row..];
            self.kkt.pair_targets.copy_from_slice(of_pairs);
            self.kkt.find_step(&missed.nodes, &missed.equalities);
            self.add_step(&mut found);
            missed = self.missed(right, &found);
            let share = largest_entry(&self.kkt.step) / size(&found.nodes);
            let no_better = share >= last;
            // Refinement converges linearly: the ratio of the next refinement is known.
            let next = share * share / last.min(1.0);
            last = share;
            if next <= CONVERGED || no_better {
                break;
            }
        }
        (found, last, missed)
    }

    /// Adds the last refinement to a solution.
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
        // These multipliers are unknowns of the border: no difference of states loses them in rounding.
        for (row, force) in pairs.iter_mut().zip(self.kkt.pair_forces()) {
            *row += force;
        }
    }

    /// Residual of the system, left-hand side plus right-hand side: of stationarity, of the equalities and of the
    /// inequalities between pairs. The other inequalities are eliminated, and their rows hold exactly.
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
    /// A vector of zeros.
    pub fn zeros(layout: &Layout) -> Self {
        Self {
            nodes: vec![NodeVector::zeros(); layout.nodes()],
            equalities: vec![0.0; layout.equalities()],
            inequalities: vec![0.0; layout.inequalities()],
        }
    }

    /// Adds a multiple of another direction.
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

    /// Multiplies all entries by a factor.
    pub(crate) fn scale(&mut self, factor: f64) {
        self.nodes.iter_mut().for_each(|node| *node *= factor);
        let rows = self.equalities.iter_mut().chain(&mut self.inequalities);
        rows.for_each(|row| *row *= factor);
    }
}
