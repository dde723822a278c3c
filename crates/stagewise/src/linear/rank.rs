//! Constraints that say the same, or the opposite, whatever the point: rank of their gradients.

use super::kkt::Kkt;
use crate::program::{Multipliers, Program};
use nalgebra::{DMatrix, SymmetricEigen};

/// The rows of equalities whose gradients depend on each other at a point.
///
/// At a point in general position they do so everywhere.
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

/// The rows that take part in a combination with no compliance.
fn involved(compliance: &DMatrix<f64>) -> Vec<usize> {
    const NOTHING: f64 = 1e-13;
    const PART: f64 = 1e-3;
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
    for (_, vector) in combinations.filter(|(value, _)| **value < NOTHING) {
        let parts = vector.iter().enumerate();
        let taking_part = parts.filter(|(_, part)| part.abs() > PART);
        involved.extend(taking_part.map(|(row, _)| used[row]));
    }
    involved.sort_unstable();
    involved.dedup();
    involved
}
