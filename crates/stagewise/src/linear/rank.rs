//! Redundant constraints, by the rank of their gradients.

use super::kkt::Kkt;
use crate::program::{Multipliers, Program};
use nalgebra::{DMatrix, SymmetricEigen};

/// Rows of redundant equalities: their gradients are linearly dependent at a point.
///
/// Gradients that are dependent at a point in general position are dependent at every point.
pub fn redundant_equalities<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
    point: &P::Point,
) -> Vec<usize> {
    let mut kkt = Kkt::new(program.layout());
    let multipliers = Multipliers::zero(kkt.layout());
    kkt.linearise(program, point, &multipliers);
    kkt.linear.forget_second_derivatives();
    kkt.compliance_of_equalities()
        .map_or_else(Vec::new, |compliance| involved(&compliance))
}

/// The rows in linear combinations of zero compliance.
fn involved(compliance: &DMatrix<f64>) -> Vec<usize> {
    /// Eigenvalue of the scaled compliance below which rows depend on each other; dimensionless.
    const DEPENDENT: f64 = 1e-11;
    /// Entry of a unit eigenvector above which a row participates in the dependence; dimensionless.
    const PARTICIPATION: f64 = 1e-3;
    let rows = 0..compliance.nrows();
    let used: Vec<usize> = rows.filter(|row| compliance[(*row, *row)] > 0.0).collect();
    let scale = |row: usize| 1.0 / compliance[(used[row], used[row])].sqrt();
    let scaled = DMatrix::from_fn(used.len(), used.len(), |i, j| {
        compliance[(used[i], used[j])] * scale(i) * scale(j)
    });
    let eigen = SymmetricEigen::new(scaled);
    let mut involved = Vec::new();
    let combinations = eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.column_iter());
    for (_, vector) in combinations.filter(|(value, _)| **value < DEPENDENT) {
        let parts = vector.iter().enumerate();
        let taking_part = parts.filter(|(_, part)| part.abs() > PARTICIPATION);
        involved.extend(taking_part.map(|(row, _)| used[row]));
    }
    involved.sort_unstable();
    involved.dedup();
    involved
}
