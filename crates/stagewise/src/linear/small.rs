//! Symmetric matrices of a few rows: inverse and inertia.

use super::TooConcave;
use nalgebra::{DMatrix, SMatrix, SVector, SymmetricEigen};

/// Inverse of a symmetric matrix with at most `most` negative eigenvalues, and their number.
///
/// Errors: [`TooConcave`] where more eigenvalues are negative, or the matrix is singular.
#[inline(always)]
pub(super) fn invert<const U: usize>(
    matrix: &[[f64; U]; U],
    most: usize,
) -> Result<([[f64; U]; U], usize), TooConcave> {
    match U {
        // The closed form is the fastest, and two controls a node are the most frequent case.
        2 => {
            let ([a, b, d], negative) =
                invert_two([matrix[0][0], matrix[0][1], matrix[1][1]], most)?;
            let mut inverse = [[0.0; U]; U];
            (inverse[0][0], inverse[1][1]) = (a, d);
            (inverse[0][1], inverse[1][0]) = (b, b);
            Ok((inverse, negative))
        }
        _ => invert_any(matrix, most),
    }
}

/// Inverse of a 2×2 matrix and its number of negative eigenvalues, by the entries (0, 0), (0, 1) and (1, 1).
#[inline(always)]
fn invert_two([a, b, d]: [f64; 3], most: usize) -> Result<([f64; 3], usize), TooConcave> {
    let determinant = a * d - b * b;
    let floor = f64::EPSILON * (a * d).abs().max(b * b);
    let negative = if determinant < 0.0 {
        1
    } else if a < 0.0 {
        2
    } else {
        0
    };
    // The comparison is false for a NaN.
    let regular = determinant.abs() > floor;
    if !regular || negative > most {
        return Err(TooConcave);
    }
    let inverse = 1.0 / determinant;
    Ok(([d * inverse, -b * inverse, a * inverse], negative))
}

#[inline(always)]
fn invert_any<const U: usize>(
    matrix: &[[f64; U]; U],
    most: usize,
) -> Result<([[f64; U]; U], usize), TooConcave> {
    if let Some(inverse) = invert_positive(matrix) {
        return Ok((inverse, 0));
    }
    let matrix = SMatrix::<f64, U, U>::from_fn(|i, j| matrix[i][j]);
    let (inverse, negative) = invert_indefinite(&matrix, most)?;
    Ok((inverse.data.0, negative))
}

/// Inverse of a positive definite matrix, by exchange of one unknown after the other for its equation's right-hand side;
/// `None` where the matrix is not positive definite.
#[inline(always)]
fn invert_positive<const U: usize>(matrix: &[[f64; U]; U]) -> Option<[[f64; U]; U]> {
    let mut rows = *matrix;
    for k in 0..U {
        let mut own = rows[k];
        let pivot = std::mem::replace(&mut own[k], 1.0);
        // The comparison is false for a NaN.
        let positive = pivot > 0.0;
        if !positive {
            return None;
        }
        let inverse = 1.0 / pivot;
        for entry in &mut own {
            *entry *= inverse;
        }
        for row in &mut rows {
            let by = std::mem::replace(&mut row[k], 0.0);
            for (entry, own) in row.iter_mut().zip(&own) {
                *entry -= by * own;
            }
        }
        rows[k] = own;
    }
    Some(rows)
}

/// Inverse of a symmetric matrix by its eigenvectors, with at most `most` negative eigenvalues, and their number.
///
/// Unknowns are scaled by their stiffness first, as stiffnesses may differ by many orders of magnitude.
///
/// Errors: [`TooConcave`] where more eigenvalues are negative, or the matrix is singular.
pub(super) fn invert_indefinite<const N: usize>(
    matrix: &SMatrix<f64, N, N>,
    most: usize,
) -> Result<(SMatrix<f64, N, N>, usize), TooConcave> {
    if most == 0 {
        return Err(TooConcave);
    }
    let scale = SVector::<f64, N>::from_fn(|i, _| matrix.row(i).amax().sqrt().recip());
    let scaled = matrix.component_mul(&(scale * scale.transpose()));
    let eigen = SymmetricEigen::new(DMatrix::from_fn(N, N, |i, j| {
        0.5 * (scaled[(i, j)] + scaled[(j, i)])
    }));
    let values = &eigen.eigenvalues;
    let negative = values.iter().filter(|value| **value < 0.0).count();
    let floor = f64::EPSILON * values.amax();
    // The comparison is false for a NaN.
    let regular = values.iter().all(|value| value.abs() > floor);
    if negative > most || !regular {
        return Err(TooConcave);
    }
    let vectors = SMatrix::<f64, N, N>::from_fn(|i, j| eigen.eigenvectors[(i, j)]);
    let inverses = SMatrix::from_diagonal(&SVector::from_fn(|i, _| 1.0 / values[i]));
    let inverse = vectors * inverses * vectors.transpose();
    Ok((
        inverse.component_mul(&(scale * scale.transpose())),
        negative,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn symmetric<const N: usize>(numbers: &[f64]) -> SMatrix<f64, N, N> {
        let full = SMatrix::<f64, N, N>::from_iterator(numbers.iter().copied());
        full + full.transpose()
    }

    fn assert_inverse<const N: usize>(numbers: &[f64]) -> Result<(), TestCaseError> {
        let matrix = symmetric::<N>(numbers);
        let rows = std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)]));
        let values = DMatrix::from_fn(N, N, |i, j| matrix[(i, j)]).symmetric_eigenvalues();
        prop_assume!(values.iter().all(|value| value.abs() > 1e-3));
        let negative = values.iter().filter(|value| **value < 0.0).count();
        let (inverse, count) = invert::<N>(&rows, N).unwrap();
        let product = SMatrix::<f64, N, N>::from_fn(|i, j| inverse[i][j]) * matrix;
        prop_assert!((product - SMatrix::identity()).amax() < 1e-9);
        prop_assert_eq!(count, negative);
        if negative > 0 {
            prop_assert_eq!(invert::<N>(&rows, negative - 1), Err(TooConcave));
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn test_inverse_and_inertia_of_any_size(numbers in prop::collection::vec(-1.0..1.0f64, 36)) {
            assert_inverse::<1>(&numbers)?;
            assert_inverse::<2>(&numbers)?;
            assert_inverse::<3>(&numbers)?;
            assert_inverse::<6>(&numbers)?;
        }
    }

    #[test]
    fn test_singular_matrices_have_no_inverse() {
        assert_eq!(invert(&[[1.0, 1.0], [1.0, 1.0]], 2), Err(TooConcave));
        assert_eq!(invert(&[[0.0]], 1), Err(TooConcave));
        assert_eq!(invert(&[[f64::NAN, 0.0], [0.0, 1.0]], 2), Err(TooConcave));
    }
}
