//! The derivatives of a programme at a point, and the products with them that the solver needs.

use crate::layout::Layout;
use crate::linear::chain::{Chain, Diagonal, NodeMatrix, NodeTerm, NodeVector, Stage};
use crate::linear::{PairMatrix, StageMatrix};
use nalgebra::SVector;

/// A programme to second order at a point.
#[derive(Debug, Clone)]
pub struct Linearisation<const X: usize, const U: usize, const N: usize> {
    /// How states are carried along the chain, and second derivatives by states and controls at once.
    pub chain: Chain<U, N>,
    /// Second derivatives by controls, by states, and at single nodes.
    pub diagonal: Diagonal<X, U, N>,
    /// Gradient of the Lagrangian of the equalities, by the unknowns of every node.
    pub gradient: Vec<NodeVector<N>>,
    /// Gradients of the equalities at nodes.
    pub equalities_at: Vec<NodeVector<N>>,
    /// Gradients of the equalities between pairs, by either node.
    pub equalities_between: Vec<[NodeVector<N>; 2]>,
    /// Gradients of the inequalities of stages, by the controls at either end.
    pub stage_slacks: Vec<[SVector<f64, U>; 2]>,
    /// Gradients of the inequalities of nodes.
    pub node_slacks: Vec<NodeVector<N>>,
    /// Gradients of the inequalities between pairs, by either node.
    pub pair_slacks: Vec<[NodeVector<N>; 2]>,
    /// Second derivatives of the constraints between pairs, by the unknowns of both nodes: of every block of equalities, then
    /// of every block of inequalities.
    pair_hessians: Vec<PairMatrix<N>>,
    layout: Layout,
    /// Indices among the terms at single nodes: of every block of equalities, then of every block of inequalities.
    terms: Vec<usize>,
}

impl<const X: usize, const U: usize, const N: usize> Linearisation<X, U, N> {
    /// Zero derivatives of a programme of a layout.
    pub fn new(layout: Layout) -> Self {
        const { assert!(X + U == N) }
        let stages = layout.stages();
        let equalities = layout.equalities_at().iter().map(|block| block.at);
        let inequalities = layout.inequalities_at().iter().map(|block| block.at);
        let places: Vec<usize> = equalities.chain(inequalities).collect();
        let mut order: Vec<usize> = (0..places.len()).collect();
        order.sort_by_key(|block| places[*block]);
        let mut terms = vec![0; places.len()];
        for (term, block) in order.iter().enumerate() {
            terms[*block] = term;
        }
        let term = |block: &usize| NodeTerm {
            node: places[*block],
            hessian: NodeMatrix::zeros(),
        };
        let pair_rows = layout.equalities() - layout.equalities_at_nodes();
        let rows_of_nodes = layout.inequalities_at().iter().map(|block| block.rows);
        let rows_of_pairs = layout.inequalities_between().iter();
        let rows_of_pairs = rows_of_pairs.map(|block| block.rows);
        let pairs = layout.equalities_between().len() + layout.inequalities_between().len();
        let zero = NodeVector::zeros();
        Self {
            chain: Chain {
                stages: vec![Stage::zero(); stages],
                first_free: [true; U],
            },
            diagonal: Diagonal {
                controls: vec![StageMatrix::zeros(); stages],
                states: Vec::new(),
                nodes: order.iter().map(term).collect(),
            },
            gradient: vec![zero; stages + 1],
            equalities_at: vec![zero; layout.equalities_at_nodes()],
            equalities_between: vec![[zero; 2]; pair_rows],
            stage_slacks: vec![[SVector::zeros(); 2]; layout.inequalities_at_stages()],
            node_slacks: vec![zero; rows_of_nodes.sum()],
            pair_slacks: vec![[zero; 2]; rows_of_pairs.sum()],
            pair_hessians: vec![PairMatrix::zeros(); pairs],
            layout,
            terms,
        }
    }

    /// Layout of the programme.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Second derivative of multipliers times equalities of a block at a node, by the node's unknowns.
    pub fn equality_hessian(&mut self, block: usize) -> &mut NodeMatrix<N> {
        &mut self.diagonal.nodes[self.terms[block]].hessian
    }

    /// Minus the second derivative of multipliers times slacks of a block of inequalities of a node, by its unknowns.
    pub fn inequality_hessian(&mut self, block: usize) -> &mut NodeMatrix<N> {
        let block = self.layout.equalities_at().len() + block;
        &mut self.diagonal.nodes[self.terms[block]].hessian
    }

    /// Second derivative of multipliers times equalities of a block between a pair, by the unknowns of both nodes.
    pub fn equality_hessian_between(&mut self, block: usize) -> &mut PairMatrix<N> {
        &mut self.pair_hessians[block]
    }

    /// Minus the second derivative of multipliers times slacks of a block of inequalities between a pair, by the unknowns of
    /// both nodes.
    pub fn inequality_hessian_between(&mut self, block: usize) -> &mut PairMatrix<N> {
        &mut self.pair_hessians[self.layout.equalities_between().len() + block]
    }

    /// The pairs of nodes, and the second derivatives of the constraints between them.
    pub(crate) fn pair_hessians(&self) -> impl Iterator<Item = ([usize; 2], &PairMatrix<N>)> {
        let equalities = self.layout.equalities_between().iter();
        let inequalities = self.layout.inequalities_between().iter();
        let pairs = equalities.chain(inequalities).map(|block| block.at);
        pairs.zip(&self.pair_hessians)
    }

    /// The second derivatives of the constraints between pairs.
    pub(crate) fn pair_hessians_mut(&mut self) -> &mut [PairMatrix<N>] {
        &mut self.pair_hessians
    }

    /// Second derivative of the Lagrangian along two steps whose states have been carried along.
    pub fn second_derivative(&self, a: &[NodeVector<N>], b: &[NodeVector<N>]) -> f64 {
        let pairs = self.pair_hessians().map(|([first, second], hessian)| {
            let [by_first, by_second] = hessian.product([&b[first], &b[second]]);
            a[first].dot(&by_first) + a[second].dot(&by_second)
        });
        self.chain.second_derivative(&self.diagonal, a, b) + pairs.sum::<f64>()
    }

    /// Change of the gradient by the controls of a node that a change of the controls of this node and its neighbours makes at
    /// most, whatever the signs.
    pub(crate) fn gradient_change(
        &self,
        node: usize,
        change: impl Fn(usize) -> SVector<f64, U>,
    ) -> SVector<f64, U> {
        let stages = &self.diagonal.controls;
        let own = change(node);
        let before = node.checked_sub(1).map(|k| {
            let mixed = stages[k].mixed.abs().tr_mul(&change(k));
            mixed + stages[k].second.abs() * own
        });
        let after = stages
            .get(node)
            .map(|stage| stage.first.abs() * own + stage.mixed.abs() * change(node + 1));
        before.into_iter().chain(after).sum()
    }

    /// Index of a block among the terms at single nodes; blocks of inequalities follow blocks of equalities.
    pub(crate) fn term(&self, block: usize) -> usize {
        self.terms[block]
    }

    /// Change of every slack along a step, to first order.
    pub(crate) fn slack_rates(&self, step: &[NodeVector<N>], into: &mut [f64]) {
        let layout = &self.layout;
        let (of_stages, rest) = into.split_at_mut(layout.inequalities_at_stages());
        let mut rows = self.stage_slacks.iter().zip(of_stages);
        for (count, ends) in layout.stage_counts().zip(step.windows(2)) {
            for ([first, second], rate) in rows.by_ref().take(count) {
                let ahead = along_controls::<X, U, N>(0.0, first, &ends[0]);
                *rate = along_controls::<X, U, N>(ahead, second, &ends[1]);
            }
        }
        let mut rest = rest.iter_mut();
        let mut node_slacks = self.node_slacks.iter();
        for block in layout.inequalities_at() {
            for (slack, rate) in node_slacks.by_ref().zip(rest.by_ref()).take(block.rows) {
                *rate = slack.dot(&step[block.at]);
            }
        }
        let mut pair_slacks = self.pair_slacks.iter();
        for block in layout.inequalities_between() {
            for ([a, b], rate) in pair_slacks.by_ref().zip(rest.by_ref()).take(block.rows) {
                *rate = a.dot(&step[block.at[0]]) + b.dot(&step[block.at[1]]);
            }
        }
    }

    /// Turns a gradient by states and controls of all nodes into a gradient by the unknowns. Entries by states beyond the
    /// first are carried back; only inequalities of nodes and pairs have such entries. Entries by tied controls are folded.
    pub(crate) fn gather_gradient(&self, gradient: &mut [NodeVector<N>]) {
        if self.layout.inequalities() > self.layout.inequalities_at_stages() {
            self.chain.carry_back(gradient);
        }
        self.chain.fold(gradient);
    }

    /// Adds to a gradient the slacks' gradients, each times a factor of its row.
    pub(crate) fn add_slack_gradients(
        &self,
        factor: impl Fn(usize) -> f64,
        into: &mut [NodeVector<N>],
    ) {
        let layout = &self.layout;
        let mut stage_slacks = self.stage_slacks.iter().enumerate();
        for (stage, rows) in layout.stage_counts().enumerate() {
            let [first, second, ..] = &mut into[stage..] else {
                break;
            };
            let mut ends = [first, second].map(|node| node.fixed_rows_mut::<U>(X));
            let mut sums = [ends[0].clone_owned(), ends[1].clone_owned()];
            for (row, slack) in stage_slacks.by_ref().take(rows) {
                let factor = factor(row);
                for i in 0..U {
                    sums[0][i] += factor * slack[0][i];
                    sums[1][i] += factor * slack[1][i];
                }
            }
            for (end, sum) in ends.iter_mut().zip(&sums) {
                end.copy_from(sum);
            }
        }
        let mut row = layout.inequalities_at_stages();
        let mut node_slacks = self.node_slacks.iter();
        for block in layout.inequalities_at() {
            for slack in node_slacks.by_ref().take(block.rows) {
                into[block.at] += factor(row) * slack;
                row += 1;
            }
        }
        let mut pair_slacks = self.pair_slacks.iter();
        for block in layout.inequalities_between() {
            for slack in pair_slacks.by_ref().take(block.rows) {
                for (node, by) in block.at.iter().zip(slack) {
                    into[*node] += factor(row) * by;
                }
                row += 1;
            }
        }
    }

    /// Adds the equalities' gradients, each times its multiplier.
    pub(crate) fn add_equality_gradients(&self, multipliers: &[f64], into: &mut [NodeVector<N>]) {
        let blocks = self.layout.equalities_at().iter();
        for (block, pull) in blocks.zip(self.pulls_at(multipliers)) {
            into[block.at] += pull;
        }
        self.add_gradients_between(multipliers, into);
    }

    /// The sum of the gradients of every block of equalities at a node, each times its multiplier.
    fn pulls_at(&self, multipliers: &[f64]) -> impl Iterator<Item = NodeVector<N>> {
        let mut rows = self.equalities_at.iter().zip(multipliers);
        let blocks = self.layout.equalities_at().iter();
        blocks.map(move |block| {
            let rows = rows.by_ref().take(block.rows);
            rows.fold(NodeVector::zeros(), |sum, (row, multiplier)| {
                sum + *multiplier * row
            })
        })
    }

    /// Adds the gradients of the equalities between pairs, each times its multiplier.
    fn add_gradients_between(&self, multipliers: &[f64], into: &mut [NodeVector<N>]) {
        let between = &multipliers[self.layout.equalities_at_nodes()..];
        let mut rows = self.equalities_between.iter().zip(between);
        for block in self.layout.equalities_between() {
            let mut pulls = [NodeVector::zeros(); 2];
            for (row, multiplier) in rows.by_ref().take(block.rows) {
                pulls[0] += *multiplier * row[0];
                pulls[1] += *multiplier * row[1];
            }
            for (node, pull) in block.at.iter().zip(pulls) {
                into[*node] += pull;
            }
        }
    }

    /// Adds the left-hand side of the linearised stationarity: second derivatives along a step, and the gradients of slacks
    /// and equalities, each times its multiplier.
    pub(crate) fn add_stationarity(
        &self,
        step: &[NodeVector<N>],
        equalities: &[f64],
        inequalities: &[f64],
        into: &mut [NodeVector<N>],
    ) {
        self.add_second_derivatives(step, into);
        self.add_slack_gradients(|row| inequalities[row], into);
        let blocks = self.layout.equalities_at().iter().enumerate();
        for ((i, block), pull) in blocks.zip(self.pulls_at(equalities)) {
            let hessian = &self.diagonal.nodes[self.terms[i]].hessian;
            into[block.at] += pull + hessian * step[block.at];
        }
        let first = self.layout.equalities_at().len();
        for (i, block) in self.layout.inequalities_at().iter().enumerate() {
            let hessian = &self.diagonal.nodes[self.terms[first + i]].hessian;
            into[block.at] += hessian * step[block.at];
        }
        self.add_gradients_between(equalities, into);
        for (nodes, hessian) in self.pair_hessians() {
            let by = hessian.product(nodes.map(|node| &step[node]));
            for (node, by) in nodes.into_iter().zip(by) {
                into[node] += by;
            }
        }
    }

    /// Change of every equality along a step.
    pub(crate) fn equality_rates(&self, step: &[NodeVector<N>], into: &mut [f64]) {
        let (at, between) = into.split_at_mut(self.layout.equalities_at_nodes());
        let mut rows = self.equalities_at.iter().zip(at);
        for block in self.layout.equalities_at() {
            for (row, rate) in rows.by_ref().take(block.rows) {
                *rate = product(row, &step[block.at]);
            }
        }
        let mut rows = self.equalities_between.iter().zip(between);
        for block in self.layout.equalities_between() {
            for (row, rate) in rows.by_ref().take(block.rows) {
                *rate = product(&row[0], &step[block.at[0]]) + product(&row[1], &step[block.at[1]]);
            }
        }
    }

    /// Adds the second derivatives of stages and states along a step.
    fn add_second_derivatives(&self, step: &[NodeVector<N>], into: &mut [NodeVector<N>]) {
        let stages = self.chain.stages.iter().zip(&self.diagonal.controls);
        for (k, (stage, own)) in stages.enumerate() {
            let [first, second]: [SVector<f64, U>; 2] =
                [k, k + 1].map(|node| step[node].fixed_rows::<U>(X).into_owned());
            into[k] += stage.state_first * first + stage.state_second * second;
            let mut by_first = own.first * first;
            by_first.gemv(1.0, &own.mixed, &second, 1.0);
            let mut by_second = own.mixed.tr_mul(&first);
            by_second.gemv(1.0, &own.second, &second, 1.0);
            by_first += stage.state_first.tr_mul(&step[k]);
            by_second += stage.state_second.tr_mul(&step[k]);
            let mut part = into[k].fixed_rows_mut::<U>(X);
            part += by_first;
            let mut part = into[k + 1].fixed_rows_mut::<U>(X);
            part += by_second;
        }
        for (k, own) in self.diagonal.states.iter().enumerate() {
            let mut by_state = into[k].fixed_rows_mut::<X>(0);
            by_state += own * step[k].fixed_rows::<X>(0);
        }
    }

    /// Sets all second derivatives to zero, and keeps the growth of states and the ties of controls.
    pub(crate) fn forget_second_derivatives(&mut self) {
        for stage in &mut self.chain.stages {
            stage.state_first.fill(0.0);
            stage.state_second.fill(0.0);
        }
        self.diagonal.states.clear();
        self.diagonal.controls.fill(StageMatrix::zeros());
        for term in &mut self.diagonal.nodes {
            term.hessian.fill(0.0);
        }
        self.pair_hessians.fill(PairMatrix::zeros());
    }
}

/// A sum, and to it the product of a gradient by controls with those of a node's step.
#[inline(always)]
fn along_controls<const X: usize, const U: usize, const N: usize>(
    sum: f64,
    by_controls: &SVector<f64, U>,
    step: &NodeVector<N>,
) -> f64 {
    (0..U).fold(sum, |sum, i| sum + by_controls[i] * step[X + i])
}

/// Scalar product, summed in order.
#[inline(always)]
pub(crate) fn product<const N: usize>(a: &NodeVector<N>, b: &NodeVector<N>) -> f64 {
    (0..N).fold(0.0, |sum, i| sum + a[i] * b[i])
}
