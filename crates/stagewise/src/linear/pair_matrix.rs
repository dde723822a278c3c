//! Quadratic forms in numbers at two nodes.

use nalgebra::{DMatrix, SMatrix, SVector, SymmetricEigen};

/// A quadratic form in numbers at two nodes, `M` at either: in all unknowns of a pair, or in the controls at both ends of a
/// stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairMatrix<const M: usize> {
    /// Second derivative by the numbers at the first node.
    pub first: SMatrix<f64, M, M>,
    /// Second derivative by the numbers at the first node (rows) and at the second node (columns).
    pub mixed: SMatrix<f64, M, M>,
    /// Second derivative by the numbers at the second node.
    pub second: SMatrix<f64, M, M>,
}

/// A quadratic form in the controls at both ends of a stage.
pub type StageMatrix<const U: usize> = PairMatrix<U>;

/// Numbers at a node from which on a linear form has few that are not zero, a number.
const MANY: usize = 3;

/// A square of a linear form in numbers at two nodes, and the factor before it.
pub(super) type Square<const M: usize> = (f64, [SVector<f64, M>; 2]);

impl<const M: usize> PairMatrix<M> {
    /// The zero form.
    pub fn zeros() -> Self {
        Self {
            first: SMatrix::zeros(),
            mixed: SMatrix::zeros(),
            second: SMatrix::zeros(),
        }
    }

    /// Adds a factor times the square of a linear form.
    #[inline(always)]
    pub(crate) fn add_square(&mut self, factor: f64, [first, second]: &[SVector<f64, M>; 2]) {
        let (by_first, by_second) = (factor * first, factor * second);
        let columns =
            |by: &SVector<f64, M>, form: &SVector<f64, M>, into: &mut SMatrix<f64, M, M>| {
                for (mut column, entry) in into.column_iter_mut().zip(form) {
                    // Forms of many entries have few that are not zero.
                    if M < MANY || *entry != 0.0 {
                        column += *entry * by;
                    }
                }
            };
        columns(&by_first, first, &mut self.first);
        columns(&by_first, second, &mut self.mixed);
        columns(&by_second, second, &mut self.second);
    }

    /// The product with a vector at either node.
    pub(crate) fn product(&self, [a, b]: [&SVector<f64, M>; 2]) -> [SVector<f64, M>; 2] {
        [
            self.first * a + self.mixed * b,
            self.mixed.tr_mul(a) + self.second * b,
        ]
    }

    /// The form as a sum of squares, as few as its rank.
    pub(super) fn squares(&self) -> Vec<Square<M>> {
        /// Share of the largest eigenvalue below which another is rounding, dimensionless.
        const ROUNDING: f64 = 1e-14;
        if *self == Self::zeros() {
            return Vec::new();
        }
        let eigen = SymmetricEigen::new(DMatrix::from_fn(2 * M, 2 * M, |i, j| {
            match (i < M, j < M) {
                (true, true) => self.first[(i, j)],
                (true, false) => self.mixed[(i, j - M)],
                (false, true) => self.mixed[(j, i - M)],
                (false, false) => self.second[(i - M, j - M)],
            }
        }));
        let least = ROUNDING * eigen.eigenvalues.amax();
        let vectors = eigen.eigenvectors.column_iter();
        let pairs = eigen.eigenvalues.iter().copied().zip(vectors);
        pairs
            .filter(|(value, _)| value.abs() > least)
            .map(|(value, vector)| {
                let part = |from: usize| SVector::from_fn(|i, _| vector[from + i]);
                (value, [part(0), part(M)])
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn test_squares_sum_up_to_the_form_and_are_as_many_as_its_rank() {
        let by = Vector3::new(1.0, -2.0, 0.5);
        let along = Vector3::new(0.3, 0.4, -1.0);
        // Square of a difference: rank 1. A product of one number at either node: rank 2.
        let mut difference = PairMatrix::zeros();
        difference.add_square(-3.0, &[by, -by]);
        let product = PairMatrix {
            mixed: by * along.transpose(),
            ..PairMatrix::zeros()
        };
        for (form, rank) in [(difference, 1), (product, 2), (PairMatrix::zeros(), 0)] {
            let squares = form.squares();
            assert_eq!(squares.len(), rank);
            let mut sum = PairMatrix::<3>::zeros();
            for (factor, by) in &squares {
                sum.add_square(*factor, by);
            }
            let differences: [Matrix3<f64>; 3] = [
                sum.first - form.first,
                sum.mixed - form.mixed,
                sum.second - form.second,
            ];
            assert!(differences.iter().all(|entries| entries.amax() < 1e-13));
        }
    }
}
