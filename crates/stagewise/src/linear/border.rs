//! A border around the chain's factorisation: rows of constraints between pairs of nodes.

use super::TooConcave;
use super::chain::{Chain, Factor, NodeVector};
use super::pair_matrix::Square;
use crate::linearisation::product;
use nalgebra::{DMatrix, SymmetricEigen};

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
    /// Change of every row under a unit multiplier of every row, by chain and rows.
    compliance: DMatrix<f64>,
    inverse: DMatrix<f64>,
    /// Factor that scales the compliance of every row to order one.
    scale: Vec<f64>,
    /// Change of every row that a correction makes.
    left: Vec<f64>,
    /// Multipliers of the rows in the last correction.
    multipliers: Vec<f64>,
    gradient: Vec<NodeVector<N>>,
}

impl<const N: usize> Border<N> {
    pub(super) fn new(rows: Vec<Row<N>>, nodes: usize) -> Self {
        let mut border = Self {
            rows,
            answers: Vec::new(),
            compliance: DMatrix::zeros(0, 0),
            inverse: DMatrix::zeros(0, 0),
            scale: Vec::new(),
            left: Vec::new(),
            multipliers: Vec::new(),
            gradient: vec![NodeVector::zeros(); nodes],
        };
        border.make_room();
        border
    }

    /// Makes room for the rows; allocates only where their number changes.
    fn make_room(&mut self) {
        let count = self.rows.len();
        if self.scale.len() != count {
            let nodes = self.gradient.len();
            let answer = || vec![NodeVector::zeros(); nodes];
            self.answers.resize_with(count, answer);
            self.compliance = DMatrix::zeros(count, count);
            self.inverse = DMatrix::zeros(count, count);
            for numbers in [&mut self.scale, &mut self.left, &mut self.multipliers] {
                numbers.resize(count, 0.0);
            }
        }
    }

    /// Replaces all rows but the first ones.
    pub(super) fn replace_beyond(&mut self, kept: usize, rows: impl Iterator<Item = Row<N>>) {
        self.rows.truncate(kept);
        self.rows.extend(rows);
        self.make_room();
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
        if self.rows.is_empty() {
            return Ok(0);
        }
        self.find_compliance(chain, factor, softness);
        // Rows may have any units: each is scaled to a compliance of order one.
        for (scale, row) in self.scale.iter_mut().zip(self.compliance.row_iter()) {
            *scale = match row.amax() {
                0.0 => 0.0,
                largest => largest.sqrt().recip(),
            };
        }
        scale_both_sides(&mut self.compliance, &self.scale);
        if self.compliance.iter().any(|entry| !entry.is_finite()) {
            return Err(TooConcave);
        }
        self.inverse.copy_from(&self.compliance);
        let negative = match invert_positive(&mut self.inverse) {
            true => 0,
            false => {
                let negative;
                (self.inverse, negative) = invert_any(self.compliance.clone());
                negative
            }
        };
        scale_both_sides(&mut self.inverse, &self.scale);
        Ok(negative)
    }

    /// The compliance matrix: change of every row under a unit multiplier of every row, by chain and rows.
    pub(super) fn compliance<const U: usize>(
        mut self,
        chain: &Chain<U, N>,
        factor: &mut Factor<U, N>,
        softness: f64,
    ) -> DMatrix<f64> {
        self.make_room();
        self.find_compliance(chain, factor, softness);
        self.compliance
    }

    fn find_compliance<const U: usize>(
        &mut self,
        chain: &Chain<U, N>,
        factor: &mut Factor<U, N>,
        softness: f64,
    ) {
        for (row, answer) in self.rows.iter().zip(&mut self.answers) {
            self.gradient.fill(NodeVector::zeros());
            for (node, by) in row.nodes.iter().zip(&row.by) {
                self.gradient[*node] += by;
            }
            chain.solve(factor, &self.gradient, answer);
        }
        for (i, row) in self.rows.iter().enumerate() {
            for (j, other) in self.rows[..=i].iter().enumerate() {
                let [change, back] = [row.change(&self.answers[j]), other.change(&self.answers[i])];
                let both = -0.5 * (change + back);
                (self.compliance[(i, j)], self.compliance[(j, i)]) = (both, both);
            }
            let softness = if row.is_equality { softness } else { 0.0 };
            self.compliance[(i, i)] += softness + row.compliance;
        }
    }

    /// Corrects a step of the chain so that every row changes by `−missing`; gives the multipliers of the rows.
    pub(super) fn correct(&mut self, missing: &[f64], step: &mut [NodeVector<N>]) -> &[f64] {
        let rows = self.rows.iter().zip(missing);
        for (left, (row, missing)) in self.left.iter_mut().zip(rows) {
            *left = row.change(step) + missing;
        }
        for (multiplier, row) in self.multipliers.iter_mut().zip(self.inverse.row_iter()) {
            let terms = row.iter().zip(&self.left);
            *multiplier = terms.map(|(entry, left)| entry * left).sum();
        }
        for (answer, multiplier) in self.answers.iter().zip(&self.multipliers) {
            for (node, change) in step.iter_mut().zip(answer) {
                *node += *multiplier * change;
            }
        }
        &self.multipliers
    }

    /// Change of every row along a step.
    pub(super) fn changes(&self, step: &[NodeVector<N>]) -> impl Iterator<Item = f64> {
        self.rows.iter().map(|row| row.change(step))
    }
}

/// Multiplies every entry of a matrix by the factors of its row and of its column.
fn scale_both_sides(matrix: &mut DMatrix<f64>, scale: &[f64]) {
    for (mut column, by_column) in matrix.column_iter_mut().zip(scale) {
        for (entry, by_row) in column.iter_mut().zip(scale) {
            *entry *= by_row * by_column;
        }
    }
}

/// Inverts a matrix in its place by exchange of one unknown after the other for its equation's right-hand side; false, and the
/// matrix lost, where it is not clearly positive.
fn invert_positive(matrix: &mut DMatrix<f64>) -> bool {
    /// Least pivot of a scaled matrix that is clearly positive, dimensionless.
    const LEAST: f64 = 1e-12;
    for k in 0..matrix.nrows() {
        let pivot = matrix[(k, k)];
        // The comparison is false for a NaN.
        let is_positive = pivot > LEAST;
        if !is_positive {
            return false;
        }
        for j in (0..matrix.ncols()).filter(|j| *j != k) {
            let by = matrix[(k, j)] / pivot;
            for i in (0..matrix.nrows()).filter(|i| *i != k) {
                matrix[(i, j)] -= by * matrix[(i, k)];
            }
            matrix[(k, j)] = by;
        }
        for i in (0..matrix.nrows()).filter(|i| *i != k) {
            matrix[(i, k)] /= -pivot;
        }
        matrix[(k, k)] = pivot.recip();
    }
    true
}

/// Inverse of a scaled symmetric matrix by its eigenvectors, zero along those of eigenvalue zero, and its number of negative
/// eigenvalues.
fn invert_any(matrix: DMatrix<f64>) -> (DMatrix<f64>, usize) {
    /// Eigenvalue below which a row depends on others; dimensionless.
    const ROUNDING: f64 = 1e-14;
    let eigen = SymmetricEigen::new(matrix);
    let counts = |value: f64| value.abs() > ROUNDING;
    let inverse = |value: f64| if counts(value) { value.recip() } else { 0.0 };
    let inverse = &eigen.eigenvectors
        * DMatrix::from_diagonal(&eigen.eigenvalues.map(inverse))
        * eigen.eigenvectors.transpose();
    let negative = |value: &&f64| counts(**value) && **value < 0.0;
    (inverse, eigen.eigenvalues.iter().filter(negative).count())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn test_inverse_of_a_positive_matrix_is_that_by_its_eigenvectors() {
        let root = DMatrix::from_fn(5, 5, |i, j| 1.0 / (1.0 + (i * i + 3 * j) as f64));
        let positive = DMatrix::identity(5, 5) + &root * root.transpose();
        let mut inverse = positive.clone();
        assert!(invert_positive(&mut inverse));
        let (by_eigenvectors, negative) = invert_any(positive.clone());
        assert_eq!(negative, 0);
        assert!((&inverse - by_eigenvectors).amax() < 1e-14);
        assert!((inverse * positive - DMatrix::identity(5, 5)).amax() < 1e-14);
    }

    #[test]
    fn test_redundant_and_concave_rows_are_not_positive() {
        let redundant = DMatrix::from_element(2, 2, 1.0);
        let concave = DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0]);
        for (matrix, negative) in [(redundant, 0), (concave, 1)] {
            assert!(!invert_positive(&mut matrix.clone()));
            assert_eq!(invert_any(matrix).1, negative);
        }
    }
}
