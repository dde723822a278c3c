//! The first-order conditions of a barrier problem, linearised: inequalities eliminated, inertia controlled, equalities met
//! exactly.
//!
//! ```text
//! [ H  Jᵀ  Sᵀ  ] [ step ]       [ gradient   ]
//! [ J          ] [  λ   ]  =  − [ equalities ]
//! [ S     −s/ν ] [  κ   ]       [     0      ]
//! ```
//!
//! H is the second derivative of the Lagrangian, J and S the gradients of equalities and slacks, s the slacks and ν their
//! multipliers. Inequalities of stages and nodes are folded into H; inequalities between pairs are rows of the border, and so
//! are the second derivatives of constraints between pairs, which the chain has no place for.

#[cfg(test)]
mod tests;

use super::TooConcave;
use super::border::{Border, Row};
use super::chain::{Damping, Diagonal, Factor, NodeMatrix, NodeVector};
use crate::layout::{Block, Layout};
use crate::linearisation::{Linearisation, product};
use crate::program::{Multipliers, Program, Values};
use crate::{larger, largest};
use nalgebra::SMatrix;
use std::ops::Range;

/// Compliance of the springs that stand for equalities in the chain; equality per unit multiplier.
const COMPLIANCE: f64 = 1e-7;
/// Largest count of refinements by which springs become rigid; a number.
const REFINEMENTS: usize = 2;
/// Residual of the linearised equalities after the refinements above which the springs are too soft beside the chain, and
/// the equalities become rows of a border; a share of their targets.
const SOFT: f64 = 1e-3;
/// Residual of the linearised equalities that is rounding; in the unit of the equalities.
const EXACT: f64 = 1e-12;

/// A factorised system and its solution, with their work arrays.
#[derive(Debug, Clone)]
pub(crate) struct Kkt<const X: usize, const U: usize, const N: usize> {
    /// Derivatives of the programme.
    pub(crate) linear: Linearisation<X, U, N>,
    /// Stiffness of every inequality: multiplier over slack at the assembly; zero of an inequality that is left out.
    pub(crate) stiffness: Vec<f64>,
    /// Whether equalities are always rows of a border: springs would be too soft to hold what they have to.
    pub(crate) is_rigid: bool,
    diagonal: Diagonal<X, U, N>,
    factor: Factor<U, N>,
    /// Equalities between pairs, inequalities between pairs, then the squares in the second derivatives of both.
    border: Border<N>,
    /// The border of the exact factorisation: all equalities, then the other rows of pairs.
    exact: Option<Border<N>>,
    node_weights: Vec<f64>,
    control_weights: [f64; U],
    /// Damping that the last concave second derivative took.
    damping: f64,
    /// Damping of the present factorisation.
    factor_damping: f64,
    right: Vec<NodeVector<N>>,
    /// Force of the springs, nonzero at the nodes of equalities only.
    pulls: Vec<NodeVector<N>>,
    correction: Vec<NodeVector<N>>,
    /// Multipliers along the step of the rows of pairs that are not equalities.
    pair_forces: Vec<f64>,
    /// Residual of the rows of pairs.
    missing: Vec<f64>,
    /// Right-hand side of the inequalities between pairs: the third row of the system is `S step − s/ν κ = −pair_targets`.
    pub(crate) pair_targets: Vec<f64>,
    rates: Vec<f64>,
    /// Step of the unknowns.
    pub(crate) step: Vec<NodeVector<N>>,
    /// Step of the equalities' multipliers.
    pub(crate) multiplier_step: Vec<f64>,
}

impl<const X: usize, const U: usize, const N: usize> Kkt<X, U, N> {
    pub(crate) fn new(layout: Layout) -> Self {
        let zeros = vec![NodeVector::zeros(); layout.nodes()];
        let linear = Linearisation::new(layout);
        let layout = linear.layout();
        let rows = |blocks: &[Block<[usize; 2]>], is_equality: bool| {
            let rows = |block: &Block<_>| vec![Row::between(block.at, is_equality); block.rows];
            blocks.iter().flat_map(rows).collect::<Vec<_>>()
        };
        let mut pairs = rows(layout.equalities_between(), true);
        pairs.extend(rows(layout.inequalities_between(), false));
        Self {
            border: Border::new(pairs, layout.nodes()),
            exact: None,
            is_rigid: false,
            stiffness: vec![0.0; layout.inequalities()],
            diagonal: linear.diagonal.clone(),
            factor: Factor::new(layout.stages()),
            node_weights: layout.node_weights(),
            control_weights: std::array::from_fn(|i| layout.control_weight(i)),
            damping: 0.0,
            factor_damping: 0.0,
            right: zeros.clone(),
            pulls: zeros.clone(),
            correction: zeros.clone(),
            pair_forces: vec![0.0; linear.pair_slacks.len()],
            pair_targets: vec![0.0; linear.pair_slacks.len()],
            missing: Vec::new(),
            rates: vec![0.0; layout.equalities()],
            multiplier_step: vec![0.0; layout.equalities()],
            step: zeros,
            linear,
        }
    }

    /// Sizes of the programme.
    pub(crate) fn layout(&self) -> &Layout {
        self.linear.layout()
    }

    /// Evaluates the derivatives of a programme at a point.
    pub(crate) fn linearise<P: Program<X, U, N>>(
        &mut self,
        program: &P,
        point: &P::Point,
        multipliers: &Multipliers,
    ) {
        program.linearise(point, multipliers, &mut self.linear);
    }

    /// Assembles the second derivatives, with the inequalities eliminated and the equalities as stiff springs.
    pub(crate) fn assemble(&mut self, values: &Values, multipliers: &[f64]) {
        self.assemble_where(values, multipliers, |_, _| true);
    }

    /// Assembles with those inequalities only of which `counts(slack, multiplier per weight)` is true.
    pub(crate) fn assemble_where(
        &mut self,
        values: &Values,
        multipliers: &[f64],
        counts: impl Fn(f64, f64) -> bool,
    ) {
        let weights = self.linear.layout().row_weights();
        let rows = values.slacks.iter().zip(multipliers).zip(weights);
        for (stiffness, ((slack, multiplier), weight)) in self.stiffness.iter_mut().zip(rows) {
            let counted = counts(*slack, multiplier / weight);
            *stiffness = if counted { multiplier / slack } else { 0.0 };
        }
        let layout = self.linear.layout();
        self.diagonal
            .controls
            .copy_from_slice(&self.linear.diagonal.controls);
        let mut rows = self.stiffness.iter().zip(&self.linear.stage_slacks);
        for (controls, count) in self.diagonal.controls.iter_mut().zip(layout.stage_counts()) {
            for (stiffness, slack) in rows.by_ref().take(count) {
                controls.add_square(*stiffness, slack);
            }
        }
        self.diagonal
            .states
            .clone_from(&self.linear.diagonal.states);
        self.assemble_nodes();
        self.assemble_border();
    }

    /// Second derivatives at single nodes: of the programme, of the springs, of the nodes' inequalities.
    fn assemble_nodes(&mut self) {
        let linear = &self.linear;
        let layout = linear.layout();
        self.diagonal.nodes.copy_from_slice(&linear.diagonal.nodes);
        let mut rows = linear.equalities_at.iter();
        for (i, block) in layout.equalities_at().iter().enumerate() {
            let mut springs = NodeMatrix::zeros();
            for row in rows.by_ref().take(block.rows) {
                springs += row * row.transpose();
            }
            self.diagonal.nodes[linear.term(i)].hessian += springs / COMPLIANCE;
        }
        let stiffness = &self.stiffness[layout.inequalities_at_stages()..];
        let mut rows = linear.node_slacks.iter().zip(stiffness);
        for (i, block) in layout.inequalities_at().iter().enumerate() {
            let term = linear.term(layout.equalities_at().len() + i);
            for (row, stiffness) in rows.by_ref().take(block.rows) {
                self.diagonal.nodes[term].hessian += *stiffness * row * row.transpose();
            }
        }
    }

    /// The assembled second derivatives by the controls of every node alone.
    pub(crate) fn control_curvatures(&self) -> Vec<SMatrix<f64, U, U>> {
        let mut curvatures = vec![SMatrix::zeros(); self.step.len()];
        for (k, stage) in self.diagonal.controls.iter().enumerate() {
            curvatures[k] += stage.first;
            curvatures[k + 1] += stage.second;
        }
        for term in &self.diagonal.nodes {
            curvatures[term.node] += term.hessian.fixed_view::<U, U>(X, X);
        }
        curvatures
    }

    fn assemble_border(&mut self) {
        let linear = &self.linear;
        let (equalities, inequalities) = self
            .border
            .rows
            .split_at_mut(linear.equalities_between.len());
        for (row, by) in equalities.iter_mut().zip(&linear.equalities_between) {
            row.by = *by;
        }
        let first = linear.layout().first_pair_row();
        let slacks = linear.pair_slacks.iter().zip(&self.stiffness[first..]);
        for (row, (by, stiffness)) in inequalities.iter_mut().zip(slacks) {
            // The row of an inequality that is left out is zero.
            let counted = *stiffness != 0.0;
            row.by = if counted {
                *by
            } else {
                [NodeVector::zeros(); 2]
            };
            row.compliance = if counted { stiffness.recip() } else { 0.0 };
        }
        let constraints = linear.equalities_between.len() + linear.pair_slacks.len();
        if constraints > 0 {
            let squares = linear.pair_hessians().flat_map(|(nodes, hessian)| {
                let squares = hessian.squares().into_iter();
                squares.map(move |square| Row::square(nodes, square))
            });
            self.border.replace_beyond(constraints, squares);
            let multipliers = self.border.rows.len() - linear.equalities_between.len();
            self.pair_forces.resize(multipliers, 0.0);
        }
    }

    /// Factorises with the least damping tried that makes the second derivative positive on the tangent space of the
    /// equalities.
    ///
    /// Errors: [`TooConcave`] where no damping below `most_damping`, a second derivative per unit weight, is enough.
    pub(crate) fn factorise(&mut self, most_damping: f64) -> Result<(), TooConcave> {
        /// Damping that is tried first where none is known; second derivative per unit weight.
        const FIRST_DAMPING: f64 = 1e-4;
        if self.factorise_damped(0.0).is_ok() {
            return Ok(());
        }
        let known = self.damping > 0.0;
        let mut damping = if known {
            self.damping / 3.0
        } else {
            FIRST_DAMPING
        };
        while damping < most_damping {
            if self.factorise_damped(damping).is_ok() {
                self.damping = damping;
                return Ok(());
            }
            damping *= if known { 8.0 } else { 100.0 };
        }
        Err(TooConcave)
    }

    /// Whether the present factorisation is damped.
    pub(crate) fn is_damped(&self) -> bool {
        self.factor_damping > 0.0
    }

    /// Length of the step in a metric.
    pub(crate) fn step_length(&self, metric: &[SMatrix<f64, X, X>]) -> f64 {
        let states = self.step.iter().map(|node| node.fixed_rows::<X>(0));
        let squares = states.zip(metric);
        let squares = squares.map(|(state, metric)| state.dot(&(metric * state)));
        squares.sum::<f64>().sqrt()
    }

    /// Factorises with a given damping of the controls per unit weight.
    ///
    /// Errors: [`TooConcave`] where the second derivative is not positive on the tangent space of the equalities.
    pub(crate) fn factorise_damped(&mut self, damping: f64) -> Result<(), TooConcave> {
        self.exact = None;
        self.factor_damping = damping;
        let damping = Damping {
            strength: damping,
            nodes: &self.node_weights,
            controls: self.control_weights,
        };
        if self.is_rigid {
            let (chain, factor, most) = (&self.linear.chain, &mut self.factor, usize::MAX);
            let concave = chain.factorise(&self.diagonal, &damping, most, factor)?;
            let concave = concave + self.border.concave_rows();
            return match self.hold_exactly()? >= concave {
                true => Ok(()),
                false => Err(TooConcave),
            };
        }
        let (chain, factor) = (&self.linear.chain, &mut self.factor);
        let most = self.border.rows.len();
        let concave = chain.factorise(&self.diagonal, &damping, most, factor)?;
        let held = self.border.factorise(chain, factor, COMPLIANCE)?;
        match concave + self.border.concave_rows() == held {
            true => Ok(()),
            false => Err(TooConcave),
        }
    }

    /// Factorises a second derivative of any inertia; gives its number of negative eigenvalues on the tangent space of the
    /// equalities.
    ///
    /// The equalities are rows of the border here: where the second derivative is nearly singular, refinement does not make
    /// springs rigid.
    ///
    /// Errors: [`TooConcave`] where the chain has a direction of zero curvature.
    pub(crate) fn factorise_exactly(&mut self) -> Result<usize, TooConcave> {
        let concave = self.factorise_chain()? + self.border.concave_rows();
        let held = self.hold_exactly()?;
        Ok(concave.saturating_sub(held))
    }

    /// Number of negative eigenvalues of the assembled second derivative on the tangent space of the equalities.
    ///
    /// Springs in place of equalities can only raise the count: the directions that rigid equalities hold are subtracted.
    ///
    /// Errors: [`TooConcave`] where there is a direction of zero curvature.
    pub(crate) fn count_negative(&mut self) -> Result<usize, TooConcave> {
        let concave = self.factorise_chain()? + self.border.concave_rows();
        if concave == 0 {
            return Ok(0);
        }
        let mut border = self.all_rows();
        let held = border.factorise(&self.linear.chain, &mut self.factor, 0.0)?;
        Ok(concave.saturating_sub(held))
    }

    fn factorise_chain(&mut self) -> Result<usize, TooConcave> {
        let (chain, factor) = (&self.linear.chain, &mut self.factor);
        let undamped = Damping::none(&self.node_weights);
        chain.factorise(&self.diagonal, &undamped, usize::MAX, factor)
    }

    /// A border of all equalities and of the other rows of pairs.
    fn all_rows(&self) -> Border<N> {
        let mut by = self.linear.equalities_at.iter();
        let blocks = self.layout().equalities_at().iter();
        let mut rows = Vec::with_capacity(by.len() + self.border.rows.len());
        for block in blocks {
            rows.extend(
                by.by_ref()
                    .take(block.rows)
                    .map(|by| Row::at(block.at, *by)),
            );
        }
        rows.extend(&self.border.rows);
        Border::new(rows, self.layout().nodes())
    }

    /// Compliance matrix of the equalities where the second derivative by the unknowns is the identity; `None` where the
    /// factorisation fails.
    ///
    /// Equalities at nodes act as springs too, which leaves of each combination of compliance λ the compliance λ c/(λ + c):
    /// soft and stiff combinations come close together, and redundant ones keep a compliance of zero.
    pub(crate) fn compliance_of_equalities(&mut self) -> Option<nalgebra::DMatrix<f64>> {
        let stages = self.layout().stages();
        let weights = vec![1.0 / stages as f64; stages + 1];
        self.diagonal.clone_from(&self.linear.diagonal);
        self.assemble_nodes();
        let (chain, factor) = (&self.linear.chain, &mut self.factor);
        let identity = Damping {
            strength: 1.0,
            nodes: &weights,
            controls: self.control_weights,
        };
        let factorised = chain.factorise(&self.diagonal, &identity, 0, factor);
        factorised.ok()?;
        self.assemble_border();
        let mut border = self.all_rows();
        border.rows.truncate(self.layout().equalities());
        Some(border.compliance(&self.linear.chain, &mut self.factor, 0.0))
    }

    /// Subtracts a multiple of a metric from the assembled second derivatives.
    pub(crate) fn shift(&mut self, metric: &[SMatrix<f64, X, X>], by: f64) {
        self.diagonal.shift(metric, by);
    }

    /// Finds the step of least cost along which the equalities change by `−targets`, and the step of their multipliers.
    ///
    /// The springs in place of equalities have a compliance. Refinement by the remaining residual, the method of multipliers
    /// on the quadratic programme, makes them rigid.
    ///
    /// Gives the largest residual that is left of the equalities at nodes.
    pub(crate) fn find_step(&mut self, gradient: &[NodeVector<N>], targets: &[f64]) -> f64 {
        if let Some(mut border) = self.exact.take() {
            let left = self.find_step_exactly(&mut border, gradient, targets);
            self.exact = Some(border);
            return left;
        }
        let at_nodes = self.layout().equalities_at_nodes();
        let (targets_at, targets_between) = targets.split_at(at_nodes);
        self.right.copy_from_slice(gradient);
        self.multiplier_step.fill(0.0);
        self.pair_forces.fill(0.0);
        self.pull_at_nodes(targets_at);
        self.linear
            .chain
            .solve(&mut self.factor, &self.right, &mut self.correction);
        self.correct_pairs(targets_between, None);
        std::mem::swap(&mut self.step, &mut self.correction);
        for _ in 0..REFINEMENTS {
            let most = self.take_missing_at_nodes(targets_at);
            if most <= EXACT && self.border.rows.is_empty() {
                return most;
            }
            self.pull_again_at_nodes(targets_at);
            self.linear
                .chain
                .solve(&mut self.factor, &self.pulls, &mut self.correction);
            let step = std::mem::take(&mut self.step);
            self.correct_pairs(targets_between, Some(&step));
            self.step = step;
            for (step, correction) in self.step.iter_mut().zip(&self.correction) {
                *step += correction;
            }
        }
        self.take_missing_at_nodes(targets_at)
    }

    /// Finds the step as [`Self::find_step`] does; where that leaves a residual, with the equalities as rows of a border.
    pub(crate) fn find_rigid_step(&mut self, gradient: &[NodeVector<N>], targets: &[f64]) {
        let left = self.find_step(gradient, targets);
        let at_nodes = &targets[..self.layout().equalities_at_nodes()];
        let is_soft = left > EXACT.max(SOFT * largest(at_nodes.iter()));
        if is_soft && self.exact.is_none() && self.hold_exactly().is_ok() {
            self.find_step(gradient, targets);
        }
    }

    /// Factorises the equalities as rows of a border, exactly; gives the number of concave directions that they hold.
    fn hold_exactly(&mut self) -> Result<usize, TooConcave> {
        let mut border = self.all_rows();
        let held = border.factorise(&self.linear.chain, &mut self.factor, 0.0)?;
        self.exact = Some(border);
        Ok(held)
    }

    /// Adds the springs' forces by the targets at nodes to the right-hand side.
    fn pull_at_nodes(&mut self, targets: &[f64]) {
        let mut rows = self.linear.equalities_at.iter().zip(targets);
        for block in self.linear.layout().equalities_at() {
            let mut pull = NodeVector::zeros();
            for (row, target) in rows.by_ref().take(block.rows) {
                pull += *target * row;
            }
            self.right[block.at] += pull / COMPLIANCE;
        }
    }

    /// Computes the springs' forces by the residual of the equalities at nodes.
    fn pull_again_at_nodes(&mut self, targets: &[f64]) {
        let layout = self.linear.layout();
        for block in layout.equalities_at() {
            self.pulls[block.at].fill(0.0);
        }
        let mut rows = self.linear.equalities_at.iter().zip(targets);
        for block in layout.equalities_at() {
            let mut pull = NodeVector::zeros();
            for (row, target) in rows.by_ref().take(block.rows) {
                pull += (product(row, &self.step[block.at]) + target) * row;
            }
            self.pulls[block.at] += pull / COMPLIANCE;
        }
    }

    /// Adds the springs' forces by the residual of the equalities at nodes to the multipliers' step; gives the largest
    /// residual.
    fn take_missing_at_nodes(&mut self, targets: &[f64]) -> f64 {
        let mut most: f64 = 0.0;
        let mut rows = self.linear.equalities_at.iter().zip(targets);
        let mut steps = self.multiplier_step.iter_mut();
        for block in self.linear.layout().equalities_at() {
            for ((row, target), step) in rows.by_ref().zip(steps.by_ref()).take(block.rows) {
                let missing = product(row, &self.step[block.at]) + target;
                *step += missing / COMPLIANCE;
                most = larger(most, missing.abs());
            }
        }
        most
    }

    /// Corrects the correction of a step for the rows between pairs; `None` is a step of zero.
    fn correct_pairs(&mut self, targets: &[f64], step: Option<&[NodeVector<N>]>) {
        if self.border.rows.is_empty() {
            return;
        }
        self.missing.clear();
        match step {
            Some(step) => self.missing.extend(self.border.changes(step)),
            None => self.missing.resize(self.border.rows.len(), 0.0),
        }
        let (equalities, inequalities) = self.missing.split_at_mut(targets.len());
        for (missing, target) in equalities.iter_mut().zip(targets) {
            *missing += target;
        }
        for (missing, target) in inequalities.iter_mut().zip(&self.pair_targets) {
            *missing += target;
        }
        let rows = &self.border.rows[targets.len()..];
        for ((missing, row), force) in inequalities.iter_mut().zip(rows).zip(&self.pair_forces) {
            *missing -= row.compliance * force;
        }
        let forces = self.border.correct(&self.missing, &mut self.correction);
        let (equalities, inequalities) = forces.split_at(targets.len());
        let at_nodes = self.linear.layout().equalities_at_nodes();
        for (step, force) in self.multiplier_step[at_nodes..].iter_mut().zip(equalities) {
            *step += force;
        }
        for (own, force) in self.pair_forces.iter_mut().zip(inequalities) {
            *own += force;
        }
    }

    /// Finds the step where all equalities are rows of a border.
    fn find_step_exactly(
        &mut self,
        border: &mut Border<N>,
        gradient: &[NodeVector<N>],
        targets: &[f64],
    ) -> f64 {
        let targets_at = &targets[..self.layout().equalities_at_nodes()];
        self.right.copy_from_slice(gradient);
        self.pull_at_nodes(targets_at);
        self.linear
            .chain
            .solve(&mut self.factor, &self.right, &mut self.step);
        let mut all = targets.to_vec();
        all.extend(&self.pair_targets);
        all.resize(border.rows.len(), 0.0);
        let forces = border.correct(&all, &mut self.step);
        let (equalities, others) = forces.split_at(targets.len());
        self.multiplier_step.copy_from_slice(equalities);
        self.pair_forces.copy_from_slice(others);
        for _ in 0..REFINEMENTS {
            let most = self.take_missing_at_nodes(targets_at);
            if most <= EXACT {
                return most;
            }
            self.pull_again_at_nodes(targets_at);
            self.linear
                .chain
                .solve(&mut self.factor, &self.pulls, &mut self.correction);
            let forces = [vec![0.0; targets.len()], self.pair_forces.clone()].concat();
            let rows = border.rows.iter().zip(border.changes(&self.step));
            let rows = rows.zip(all.iter().zip(&forces));
            let missing: Vec<f64> = rows
                .map(|((row, change), (target, force))| change + target - row.compliance * force)
                .collect();
            let forces = border.correct(&missing, &mut self.correction);
            let steps = self.multiplier_step.iter_mut().chain(&mut self.pair_forces);
            steps.zip(forces).for_each(|(step, force)| *step += force);
            for (step, correction) in self.step.iter_mut().zip(&self.correction) {
                *step += correction;
            }
        }
        self.take_missing_at_nodes(targets_at)
    }

    /// Subtracts the equalities' multipliers times their gradients from a gradient by the unknowns.
    pub(crate) fn take_off_pulls(&mut self, multipliers: &[f64], gradient: &mut [NodeVector<N>]) {
        self.right.fill(NodeVector::zeros());
        self.linear
            .add_equality_gradients(multipliers, &mut self.right);
        self.linear.chain.carry_back(&mut self.right);
        for (gradient, pull) in gradient.iter_mut().zip(&self.right) {
            *gradient -= pull;
        }
    }

    /// Multipliers along the step of the inequalities between pairs: stiffness times the change of their slacks.
    pub(crate) fn pair_forces(&self) -> &[f64] {
        &self.pair_forces[..self.linear.pair_slacks.len()]
    }

    /// Change of every slack along the step, to first order.
    pub(crate) fn slack_rates(&self, into: &mut [f64]) {
        self.linear.slack_rates(&self.step, into);
    }

    /// Change of the multipliers' work on the equalities along the step, to first order.
    pub(crate) fn equality_work(&mut self, multipliers: &[f64]) -> f64 {
        self.linear.equality_rates(&self.step, &mut self.rates);
        let of_block = |rows: Range<usize>| {
            let rows = self.rates[rows.clone()].iter().zip(&multipliers[rows]);
            rows.fold(0.0, |sum, (rate, multiplier)| sum + multiplier * rate)
        };
        self.linear.layout().equality_blocks().map(of_block).sum()
    }
}
