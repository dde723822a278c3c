//! A border around the chain's factorisation: rows of constraints between pairs of nodes.

use super::TooConcave;
use super::chain::{Chain, Factor, NodeVector};
use super::pair_matrix::Square;
use crate::linearisation::product;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// One row of the border: a constraint, or a square in the second derivative of a constraint.
///
/// A row with gradient r and compliance c adds rᵀr/c to the second derivative of the chain: an inequality has the
/// compliance slack over multiplier, and f times a square is a row of compliance 1/f.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row<const N: usize> {
    /// The two nodes of the row.
    pub(super) nodes: [usize; 2],
    /// Gradient of the row by either node's unknowns.
    pub(super) by: [NodeVector<N>; 2],
    /// Compliance of the row itself, its change under a unit multiplier on a rigid chain: zero of an equality, slack over
    /// multiplier of an inequality, the inverse factor of a square.
    pub(super) compliance: f64,
    /// Whether the row is an equality, to which `softness` applies.
    is_equality: bool,
}

impl<const N: usize> Row<N> {
    /// An equality of a single node.
    pub(super) fn at(node: usize, by: NodeVector<N>) -> Self {
        Self {
            by: [by, NodeVector::zeros()],
            ..Self::between([node; 2], true)
        }
    }

    /// Room for a constraint between two nodes.
    pub(super) fn between(nodes: [usize; 2], is_equality: bool) -> Self {
        Self {
            nodes,
            by: [NodeVector::zeros(); 2],
            compliance: 0.0,
            is_equality,
        }
    }

    /// A factor times the square of a linear form in the unknowns of two nodes.
    pub(super) fn square(nodes: [usize; 2], (factor, by): Square<N>) -> Self {
        Self {
            nodes,
            by,
            compliance: factor.recip(),
            is_equality: false,
        }
    }

    /// Change of the row along a step.
    fn change(&self, step: &[NodeVector<N>]) -> f64 {
        let [a, b] = self.nodes;
        product(&self.by[0], &step[a]) + product(&self.by[1], &step[b])
    }
}

/// The rows between pairs of nodes, and their elimination after the chain.
#[derive(Debug, Clone)]
pub(super) struct Border<const N: usize> {
    pub(super) rows: Vec<Row<N>>,
    /// Step of the chain under a unit multiplier of every row.
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

    /// Replaces all rows but the first ones.
    pub(super) fn replace_beyond(&mut self, kept: usize, rows: impl Iterator<Item = Row<N>>) {
        self.rows.truncate(kept);
        self.rows.extend(rows);
        let answer = || vec![NodeVector::zeros(); self.gradient.len()];
        self.answers.resize_with(self.rows.len(), answer);
    }

    /// The number of concave rows, which have a negative compliance.
    pub(super) fn concave_rows(&self) -> usize {
        let rows = self.rows.iter();
        rows.filter(|row| row.compliance < 0.0).count()
    }

    /// Eliminates the rows after the chain, each equality with `softness` added to its compliance; gives the number of
    /// concave directions, of chain and rows, that the rows hold. The multipliers of redundant rows are the least.
    ///
    /// With chain K, gradients R of the rows and compliances C, the second derivative of chain and rows has as many
    /// negative eigenvalues as K and C together, less those of C + R K⁻¹ Rᵀ: both orders of elimination give the same
    /// inertia.
    ///
    /// Errors: [`TooConcave`] where the compliance is not finite: the chain has a direction of zero curvature.
    pub(super) fn factorise<const U: usize>(
        &mut self,
        chain: &Chain<U, N>,
        factor: &mut Factor<U, N>,
        softness: f64,
    ) -> Result<usize, TooConcave> {
        /// Eigenvalue of the scaled compliance below which a row depends on others; dimensionless.
        const ROUNDING: f64 = 1e-14;
        if self.rows.is_empty() {
            return Ok(0);
        }
        let compliance = self.compliance(chain, factor, softness);
        // Rows may have any units: each is scaled to a compliance of order one.
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

    /// Compliance matrix: change of every row under a unit multiplier of every row, by chain and rows.
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
            let row = &self.rows[i];
            let own = match (i == j, row.is_equality) {
                (true, true) => softness + row.compliance,
                (true, false) => row.compliance,
                _ => 0.0,
            };
            own - row.change(&self.answers[j])
        });
        0.5 * (&compliance + compliance.transpose())
    }

    /// Corrects a step of the chain so that every row changes by `−missing`; gives the multipliers of the rows.
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
