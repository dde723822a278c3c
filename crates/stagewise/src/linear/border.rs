//! Constraints that tie pairs of nodes together: a border around the chain's factorisation.

use super::TooConcave;
use super::chain::{Chain, Factor, NodeVector};
use crate::program::product;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// One constraint of the border.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row<const N: usize> {
    /// The nodes that it touches.
    pub(super) nodes: [usize; 2],
    /// Its gradient by either node's unknowns.
    pub(super) by: [NodeVector<N>; 2],
    /// By how much it changes under a unit multiplier, besides what the chain does: zero of an equality, slack over
    /// multiplier of an inequality.
    pub(super) compliance: f64,
}

impl<const N: usize> Row<N> {
    /// A constraint of a single node.
    pub(super) fn at(node: usize, by: NodeVector<N>) -> Self {
        Self::between([node; 2], [by, NodeVector::zeros()])
    }

    /// A constraint between two nodes.
    pub(super) fn between(nodes: [usize; 2], by: [NodeVector<N>; 2]) -> Self {
        Self {
            nodes,
            by,
            compliance: 0.0,
        }
    }

    /// Its change along a step.
    fn change(&self, step: &[NodeVector<N>]) -> f64 {
        let [a, b] = self.nodes;
        product(&self.by[0], &step[a]) + product(&self.by[1], &step[b])
    }
}

/// The constraints between pairs of nodes, and how they are eliminated after the chain.
#[derive(Debug, Clone)]
pub(super) struct Border<const N: usize> {
    pub(super) rows: Vec<Row<N>>,
    /// The chain's answer to a unit multiplier of every row.
    answers: Vec<Vec<NodeVector<N>>>,
    inverse: DMatrix<f64>,
    gradient: Vec<NodeVector<N>>,
}

impl<const N: usize> Border<N> {
    pub(super) fn new(rows: Vec<Row<N>>, nodes: usize) -> Self {
        Self {
            answers: vec![vec![NodeVector::zeros(); nodes]; rows.len()],
            inverse: DMatrix::zeros(rows.len(), rows.len()),
            gradient: vec![NodeVector::zeros(); nodes],
            rows,
        }
    }

    /// Eliminates the rows after the chain, each with `softness` added to its compliance; gives the number of the chain's
    /// concave directions that the rows hold. Rows that follow from others bear nothing.
    ///
    /// Errors: [`TooConcave`] where the compliance is not finite: the chain has a direction that costs nothing.
    pub(super) fn factorise<const U: usize>(
        &mut self,
        chain: &Chain<U, N>,
        factor: &mut Factor<U, N>,
        softness: f64,
    ) -> Result<usize, TooConcave> {
        const ROUNDING: f64 = 1e-14;
        if self.rows.is_empty() {
            return Ok(0);
        }
        let compliance = self.compliance(chain, factor, softness);
        // Each row in a unit of its own: the rows may have any units.
        let scale = DVector::from_fn(self.rows.len(), |row, _| match compliance.row(row).amax() {
            0.0 => 0.0,
            largest => largest.sqrt().recip(),
        });
        let scaled = compliance.component_mul(&(&scale * scale.transpose()));
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

    /// The change of every row under a unit multiplier of every other: its own compliance, and the chain's.
    pub(super) fn compliance<const U: usize>(
        &mut self,
        chain: &Chain<U, N>,
        factor: &mut Factor<U, N>,
        softness: f64,
    ) -> DMatrix<f64> {
        for (row, answer) in self.rows.iter().zip(&mut self.answers) {
            self.gradient.fill(NodeVector::zeros());
            for (node, by) in row.nodes.iter().zip(&row.by) {
                self.gradient[*node] += by;
            }
            chain.solve(factor, &self.gradient, answer);
        }
        let count = self.rows.len();
        let compliance = DMatrix::from_fn(count, count, |i, j| {
            let own = if i == j {
                softness + self.rows[i].compliance
            } else {
                0.0
            };
            own - self.rows[i].change(&self.answers[j])
        });
        0.5 * (&compliance + compliance.transpose())
    }

    /// Adds to a step of the chain the part by which every row changes by `−missing`, less what the step brings already; gives
    /// the multipliers of the rows.
    pub(super) fn correct(&self, missing: &[f64], step: &mut [NodeVector<N>]) -> DVector<f64> {
        let rows = self.rows.iter().zip(missing);
        let left = rows.map(|(row, missing)| row.change(step) + missing);
        let multipliers = &self.inverse * DVector::from_iterator(self.rows.len(), left);
        for (answer, multiplier) in self.answers.iter().zip(&multipliers) {
            for (node, change) in step.iter_mut().zip(answer) {
                *node += *multiplier * change;
            }
        }
        multipliers
    }

    /// Change of every row along a step.
    pub(super) fn changes(&self, step: &[NodeVector<N>]) -> impl Iterator<Item = f64> {
        self.rows.iter().map(|row| row.change(step))
    }
}
