//! The lowest eigenvectors of the second variation.

use super::chain::NodeVector;
use super::response::{Response, Singular};
use super::symmetries::{Held, Motions, products, zero_modes};
use crate::program::{Program, Scales, Stationary};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// An eigenvector of the second variation relative to the metric, on the tangent space of the constraints.
#[derive(Debug, Clone)]
pub struct Mode<const N: usize> {
    /// Eigenvalue.
    pub eigenvalue: f64,
    /// Motion of every node, of norm 1 in the metric.
    pub motion: Vec<NodeVector<N>>,
    /// Product of the metric with the motion.
    pub force: Vec<NodeVector<N>>,
}

/// The lowest modes at a solution, rising; fewer than `count` where the programme has fewer.
///
/// The symmetries of the programme are modes of eigenvalue 0, and the others are square to them. By subspace iteration with
/// the inverse of the second variation, shifted below all eigenvalues.
///
/// Errors: [`Singular`] where the shifted second variation cannot be factorised.
pub fn lowest_modes<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
    at: &mut Stationary<P::Point>,
    count: usize,
) -> Result<Vec<Mode<N>>, Singular> {
    let mut response = Response::unfactorised(program, at)?;
    let shift = shift_below_all(&mut response, &program.scales())?;
    let mut modes = zero_modes(response.metric(), &program.symmetries(&at.point));
    let beside = lowest_beside(&modes, &mut response, shift, count)?;
    modes.extend(beside);
    modes.sort_by(|a, b| a.eigenvalue.total_cmp(&b.eigenvalue));
    modes.truncate(count);
    Ok(modes)
}

/// The lowest modes of a shifted system square to given ones, rising.
fn lowest_beside<const X: usize, const U: usize, const N: usize>(
    given: &[Mode<N>],
    response: &mut Response<X, U, N>,
    shift: f64,
    count: usize,
) -> Result<Vec<Mode<N>>, Singular> {
    /// Count of guard vectors beyond the modes that are sought; a number.
    const GUARDS: usize = 4;
    /// Largest count of subspace iterations; a number.
    const ITERATIONS: usize = 100;
    /// Relative change of shifted eigenvalues at which the iteration has converged; dimensionless.
    const CONVERGED: f64 = 1e-10;
    let held = Held::new(given, response)?;
    let mut subspace = first_guess(response, count + GUARDS);
    let mut last = vec![f64::INFINITY; count];
    for _ in 0..ITERATIONS {
        let forces: Motions<N> = subspace.iter().map(|mode| mode.force.clone()).collect();
        let mut motions = response.answers(&forces)?;
        motions.iter_mut().for_each(|motion| held.project(motion));
        subspace = ritz(response, &motions, &forces, shift);
        let now: Vec<f64> = subspace
            .iter()
            .take(count)
            .map(|mode| mode.eigenvalue)
            .collect();
        let moved =
            |(now, last): (&f64, &f64)| (now - last).abs() > CONVERGED * (now - shift).abs();
        let is_settled = now.len() < last.len() || !now.iter().zip(&last).any(moved);
        if is_settled && now.len() == last.len() {
            break;
        }
        last = now;
    }
    subspace.truncate(count);
    Ok(subspace)
}

/// A point perturbed along a mode by a length.
pub fn moved<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
    point: &P::Point,
    mode: &Mode<N>,
    length: f64,
) -> P::Point {
    let mut moved = point.clone();
    program.retract(point, &mode.motion, length, &mut moved);
    moved
}

/// Shifts the system below all eigenvalues; gives the shift.
fn shift_below_all<const X: usize, const U: usize, const N: usize>(
    response: &mut Response<X, U, N>,
    scales: &Scales,
) -> Result<f64, Singular> {
    /// Shift of the eigenvalues that is tried first; in [`Scales::eigenvalue`].
    const FIRST_SHIFT: f64 = -100.0;
    /// Largest count of shifts that are tried; a number.
    const SHIFTS: usize = 20;
    let (mut shift, mut next) = (0.0, FIRST_SHIFT * scales.eigenvalue());
    for _ in 0..SHIFTS {
        let negative = response.shift(next - shift);
        shift = next;
        if negative == Ok(0) {
            return Ok(shift);
        }
        next = 8.0 * shift;
    }
    Err(Singular)
}

/// First subspace: smooth motions in general position.
fn first_guess<const X: usize, const U: usize, const N: usize>(
    response: &Response<X, U, N>,
    count: usize,
) -> Vec<Mode<N>> {
    let zero = response.zero().nodes;
    let nodes = zero.len() as f64;
    let motion = |mode: usize| {
        let at = |node: usize| {
            let u = node as f64 / nodes;
            NodeVector::<N>::from_fn(|i, _| match i < X {
                true => ((mode as f64 + 1.0) * (3.0 * u + 0.7 * i as f64)).sin(),
                false => 0.0,
            })
        };
        (0..zero.len()).map(at).collect()
    };
    let guess = |mode| {
        let motion: Vec<_> = motion(mode);
        Mode {
            eigenvalue: 0.0,
            force: response.force(&motion),
            motion,
        }
    };
    (0..count).map(guess).collect()
}

/// Ritz approximations of modes in the span of motions, each the solution under a known force.
fn ritz<const X: usize, const U: usize, const N: usize>(
    response: &Response<X, U, N>,
    motions: &Motions<N>,
    forces: &Motions<N>,
    shift: f64,
) -> Vec<Mode<N>> {
    /// Eigenvalue of the scaled mass matrix below which motions depend on each other; dimensionless.
    const DEPENDENT: f64 = 1e-14;
    let own: Motions<N> = motions
        .iter()
        .map(|motion| response.force(motion))
        .collect();
    let count = motions.len();
    let (stiffness, mass) = (products(motions, forces), products(motions, &own));
    // To coordinates of unit mass first, without dependent motions.
    let scale = DVector::from_fn(count, |i, _| {
        mass[(i, i)].max(f64::MIN_POSITIVE).sqrt().recip()
    });
    let scaled =
        |m: &DMatrix<f64>| DMatrix::from_fn(count, count, |i, j| m[(i, j)] * scale[i] * scale[j]);
    let eigen = SymmetricEigen::new(scaled(&mass));
    let largest = eigen.eigenvalues.amax();
    let kept: Vec<usize> = (0..count)
        .filter(|i| eigen.eigenvalues[*i] > DEPENDENT * largest)
        .collect();
    let basis = DMatrix::from_fn(count, kept.len(), |i, j| {
        eigen.eigenvectors[(i, kept[j])] / eigen.eigenvalues[kept[j]].sqrt() * scale[i]
    });
    let eigen = SymmetricEigen::new(basis.transpose() * stiffness * &basis);
    let mut order: Vec<usize> = (0..kept.len()).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let coefficients = &basis * &eigen.eigenvectors;
    let mode = |of: usize| {
        let coefficients = coefficients.column(of);
        Mode {
            eigenvalue: eigen.eigenvalues[of] + shift,
            motion: combine(motions, coefficients.iter().copied()),
            force: combine(&own, coefficients.iter().copied()),
        }
    };
    order.into_iter().map(mode).collect()
}

pub(super) fn combine<const N: usize>(
    motions: &[Vec<NodeVector<N>>],
    factors: impl Iterator<Item = f64>,
) -> Vec<NodeVector<N>> {
    let mut sum = vec![NodeVector::zeros(); motions[0].len()];
    for (motion, factor) in motions.iter().zip(factors) {
        for (sum, node) in sum.iter_mut().zip(motion) {
            *sum += factor * node;
        }
    }
    sum
}

pub(crate) fn dot<const N: usize>(a: &[NodeVector<N>], b: &[NodeVector<N>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}
