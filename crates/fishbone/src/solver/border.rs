//! Constraints that tie pairs of nodes together: a border around the chain's factorisation.

use super::chain::{Chain, Factor, NodeTerm, NodeVector, TooConcave};
use super::{Linearisation, ROWS, Rows, RowsByNode};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// The constraints between pairs of nodes, with what they need to be eliminated after the chain.
#[derive(Debug, Clone)]
pub(super) struct Border {
    pairs: Vec<[usize; 2]>,
    /// The chain's answer to a unit multiplier of every row.
    answers: Vec<Vec<NodeVector>>,
    inverse: DMatrix<f64>,
    gradient: Vec<NodeVector>,
}

impl Border {
    pub(super) fn new(pairs: Vec<[usize; 2]>, nodes: usize) -> Self {
        let rows = ROWS * pairs.len();
        Self {
            pairs,
            answers: vec![vec![NodeVector::zeros(); nodes]; rows],
            inverse: DMatrix::zeros(rows, rows),
            gradient: vec![NodeVector::zeros(); nodes],
        }
    }

    /// The same border with the constraints at nodes as rows before its own, and all these rows.
    pub(super) fn with_nodes(
        &self,
        nodes: &[NodeTerm],
        linear: &Linearisation,
    ) -> (Self, Vec<[RowsByNode; 2]>) {
        let at_nodes = nodes.iter().map(|term| [term.node; 2]);
        let pairs = at_nodes.chain(self.pairs.iter().copied()).collect();
        let at_nodes = linear.constraints.iter();
        let at_nodes = at_nodes.map(|rows| [*rows, RowsByNode::zeros()]);
        let rows = at_nodes.chain(linear.links.iter().copied()).collect();
        (Self::new(pairs, self.gradient.len()), rows)
    }

    /// Number of rows, used or not.
    pub(super) fn rows(&self) -> usize {
        self.answers.len()
    }

    /// Eliminates the rows, each with a compliance, after the chain; in how many of the directions in which that is
    /// concave they hold it. Rows that follow from others bear nothing.
    ///
    /// Errors: [`TooConcave`] where the rows give way in a direction at no cost.
    pub(super) fn factorise(
        &mut self,
        chain: &Chain,
        factor: &mut Factor,
        links: &[[RowsByNode; 2]],
        compliance: f64,
    ) -> Result<usize, TooConcave> {
        const ROUNDING: f64 = 1e-14;
        if self.pairs.is_empty() {
            return Ok(0);
        }
        let give = self.give(chain, factor, links, compliance);
        // Each row in a unit of its own: that of a spring is not that of a belt.
        let scale = DVector::from_fn(self.rows(), |row, _| match give.row(row).amax() {
            0.0 => 0.0,
            largest => largest.sqrt().recip(),
        });
        let scaled = give.component_mul(&(&scale * scale.transpose()));
        if scaled.iter().any(|entry| !entry.is_finite()) {
            return Err(TooConcave);
        }
        let eigen = SymmetricEigen::new(scaled);
        let counts = |value: f64| value.abs() > ROUNDING;
        let inverse = |value: f64| if counts(value) { value.recip() } else { 0.0 };
        let inverse = &eigen.eigenvectors
            * DMatrix::from_diagonal(&eigen.eigenvalues.map(inverse))
            * eigen.eigenvectors.transpose();
        self.inverse = inverse.component_mul(&(&scale * scale.transpose()));
        let negative = |value: &&f64| counts(**value) && **value < 0.0;
        Ok(eigen.eigenvalues.iter().filter(negative).count())
    }

    /// How far every row gives way to a unit multiplier of every other, by a compliance of its own and by the chain's.
    pub(super) fn give(
        &mut self,
        chain: &Chain,
        factor: &mut Factor,
        links: &[[RowsByNode; 2]],
        compliance: f64,
    ) -> DMatrix<f64> {
        for row in 0..self.rows() {
            self.gradient.fill(NodeVector::zeros());
            let rows = &links[row / ROWS];
            for (node, by_node) in self.pairs[row / ROWS].iter().zip(rows) {
                self.gradient[*node] += by_node.row(row % ROWS).transpose();
            }
            chain.solve(factor, &self.gradient, &mut self.answers[row]);
        }
        let mut give = DMatrix::identity(self.rows(), self.rows()) * compliance;
        for (column, answer) in self.answers.iter().enumerate() {
            for (i, change) in self.changes(links, answer).into_iter().enumerate() {
                for (j, value) in change.iter().enumerate() {
                    give[(ROWS * i + j, column)] -= value;
                }
            }
        }
        0.5 * (&give + give.transpose())
    }

    /// Adds to a step of the chain what the links take to change by `−missing` less what it brings already; the
    /// multipliers of the rows.
    pub(super) fn correct(
        &self,
        links: &[[RowsByNode; 2]],
        missing: &[Rows],
        step: &mut [NodeVector],
    ) -> Vec<Rows> {
        let mut left = DVector::zeros(self.rows());
        for (i, change) in self.changes(links, step).into_iter().enumerate() {
            left.fixed_rows_mut::<ROWS>(ROWS * i)
                .copy_from(&(change + missing[i]));
        }
        let multipliers = &self.inverse * left;
        for (answer, multiplier) in self.answers.iter().zip(&multipliers) {
            for (node, change) in step.iter_mut().zip(answer) {
                *node += *multiplier * change;
            }
        }
        (0..self.pairs.len())
            .map(|i| multipliers.fixed_rows::<ROWS>(ROWS * i).into_owned())
            .collect()
    }

    /// Adds the pull of the rows' multipliers at the nodes of every pair.
    pub(super) fn add_pulls(
        &self,
        links: &[[RowsByNode; 2]],
        multipliers: &[Rows],
        into: &mut [NodeVector],
    ) {
        for ((pair, rows), multipliers) in self.pairs.iter().zip(links).zip(multipliers) {
            for (node, by_node) in pair.iter().zip(rows) {
                into[*node] += by_node.tr_mul(multipliers);
            }
        }
    }

    /// Change of the rows of every pair along a step.
    pub(super) fn changes(&self, links: &[[RowsByNode; 2]], step: &[NodeVector]) -> Vec<Rows> {
        let change = |(pair, rows): (&[usize; 2], &[RowsByNode; 2])| {
            rows[0] * step[pair[0]] + rows[1] * step[pair[1]]
        };
        self.pairs.iter().zip(links).map(change).collect()
    }
}
