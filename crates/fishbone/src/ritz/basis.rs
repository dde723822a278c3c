//! The basis functions and the quadrature rule.

use nalgebra::DMatrix;
use num_dual::{DualNum, first_derivative};
use std::f64::consts::PI;

/// Unknown functions φ, θ, ψ, β, in the order of the coefficients; a number.
pub(super) const FIELDS: usize = 4;

/// Local variables, the value and u-derivative of each unknown function; a number.
pub(super) const LOCALS: usize = 2 * FIELDS;

/// Basis function e_k at u, counted from 1.
///
/// Units: u in U.
/// Source: Eq. (41)–(43)
pub(super) fn function<D: DualNum<Primitive = f64> + Copy>(k: usize, u: D) -> D {
    let angle = u * (PI * ((k - 1) / 2) as f64);
    match k {
        1 => D::one(),
        2 => u,
        _ if k % 2 == 1 => angle.sin(),
        _ => (u * (PI * ((k - 2) / 2) as f64)).cos(),
    }
}

/// The matrix that takes the coefficients to the local variables (φ, φ', θ, θ', ψ, ψ', β, β') at u.
///
/// Shapes: (8, 4n).
/// Units: u in U.
/// Source: Eq. (37)–(40)
pub(super) fn localiser(n: usize, u: f64) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(LOCALS, FIELDS * n);
    for k in 0..n {
        let (value, slope) = first_derivative(|u| function(k + 1, u), u);
        for field in 0..FIELDS {
            matrix[(2 * field, field * n + k)] = value;
            matrix[(2 * field + 1, field * n + k)] = slope;
        }
    }
    matrix
}

/// Nodes and weights that integrate energy and tangent for n basis functions over [0, 1].
pub(super) fn quadrature(n: usize) -> Vec<(f64, f64)> {
    gauss_legendre((4 * n).max(48))
}

/// Nodes and weights of Gauss–Legendre quadrature on [0, 1].
pub(super) fn gauss_legendre(count: usize) -> Vec<(f64, f64)> {
    (0..count).map(|i| gauss_node(count, i)).collect()
}

/// Node i and its weight, from Newton's method on the Legendre polynomial.
fn gauss_node(count: usize, i: usize) -> (f64, f64) {
    let mut x = -(PI * (i as f64 + 0.75) / (count as f64 + 0.5)).cos();
    // Tricomi's approximation is close enough for quadratic convergence at once.
    for _ in 0..6 {
        let (value, slope) = legendre(count, x);
        x -= value / slope;
    }
    let (_, slope) = legendre(count, x);
    (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
}

/// Legendre polynomial and its derivative, by the three-term recurrence.
fn legendre(degree: usize, x: f64) -> (f64, f64) {
    let (mut before, mut value) = (0.0, 1.0);
    for k in 1..=degree {
        let k = k as f64;
        let next = ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k;
        (before, value) = (value, next);
    }
    let slope = degree as f64 * (x * value - before) / (x * x - 1.0);
    (value, slope)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn the_ten_functions_are_those_printed() {
        let u = 0.3;
        let (s, c) = (|i: f64| (PI * i * u).sin(), |i: f64| (PI * i * u).cos());
        let printed = [
            1.0,
            u,
            s(1.0),
            c(1.0),
            s(2.0),
            c(2.0),
            s(3.0),
            c(3.0),
            s(4.0),
            c(4.0),
        ];
        for (k, value) in printed.into_iter().enumerate() {
            assert_relative_eq!(function(k + 1, u), value, epsilon = 1e-15);
        }
    }

    #[test]
    fn derivatives_are_those_of_the_closed_forms() {
        let (n, u) = (10, 0.3);
        let matrix = localiser(n, u);
        for i in 1..=4 {
            let w = PI * i as f64;
            assert_relative_eq!(matrix[(1, 2 * i)], w * (w * u).cos(), epsilon = 1e-13);
            assert_relative_eq!(matrix[(1, 2 * i + 1)], -w * (w * u).sin(), epsilon = 1e-13);
        }
        assert_eq!((matrix[(1, 0)], matrix[(1, 1)]), (0.0, 1.0));
    }

    #[test]
    fn quadrature_is_exact_up_to_degree_2n_minus_1() {
        for count in [1, 2, 5, 48] {
            let degree = 2 * count - 1;
            let sum: f64 = gauss_legendre(count)
                .iter()
                .map(|(x, w)| w * x.powi(degree as i32))
                .sum();
            assert_relative_eq!(sum, 1.0 / (degree as f64 + 1.0), epsilon = 1e-14);
        }
    }
}
