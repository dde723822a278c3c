//! Eigenvectors of the second variation, the lowest ones.

use super::chain::NodeVector;
use super::{Kkt, Program, Singular, Stationary};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// A direction that the constraints leave, in which the second variation is a multiple of the metric.
#[derive(Debug, Clone)]
pub struct Mode {
    /// The multiple.
    pub eigenvalue: f64,
    /// Motion of every node, of norm 1 in the metric.
    pub motion: Vec<NodeVector>,
    /// The metric's pull on it.
    pub pull: Vec<NodeVector>,
}

/// The lowest modes at a solution, rising; fewer than `count` where there are no more.
///
/// Subspace iteration with the inverse, shifted below all eigenvalues, so that it converges to the lowest in their order.
///
/// Errors: [`Singular`] where that cannot be factorised.
pub fn lowest_modes<P: Program>(
    program: &P,
    at: &mut Stationary<P::Point>,
    count: usize,
) -> Result<Vec<Mode>, Singular> {
    lowest_modes_of(Kkt::factorise_any(program, at)?, count)
}

/// The same of a system that has been factorised.
pub(super) fn lowest_modes_of(mut kkt: Kkt, count: usize) -> Result<Vec<Mode>, Singular> {
    const GUARDS: usize = 4;
    const ITERATIONS: usize = 100;
    const SETTLED: f64 = 1e-12;
    let shift = shift_below_all(&mut kkt)?;
    let mut subspace = first_guess(&kkt, count + GUARDS);
    let mut last = vec![f64::INFINITY; count];
    for _ in 0..ITERATIONS {
        let pulls: Vec<_> = subspace.iter().map(|mode| mode.pull.clone()).collect();
        let motions = answers(&mut kkt, &pulls)?;
        subspace = ritz(&kkt, &motions, &pulls, shift);
        let now: Vec<f64> = subspace
            .iter()
            .take(count)
            .map(|mode| mode.eigenvalue)
            .collect();
        let moved = |(now, last): (&f64, &f64)| (now - last).abs() > SETTLED * (now - shift).abs();
        let is_settled = now.len() < last.len() || !now.iter().zip(&last).any(moved);
        if is_settled && now.len() == last.len() {
            break;
        }
        last = now;
    }
    subspace.truncate(count);
    Ok(subspace)
}

/// A point moved so far along a mode.
pub fn moved<P: Program>(program: &P, point: &P::Point, mode: &Mode, length: f64) -> P::Point {
    let mut moved = point.clone();
    program.retract(point, &mode.motion, length, &mut moved);
    moved
}

/// Shifts the system to where no eigenvalue is below, and says by how much.
fn shift_below_all(kkt: &mut Kkt) -> Result<f64, Singular> {
    const FIRST: f64 = -100.0;
    const MOST: usize = 20;
    let (mut shift, mut next) = (0.0, FIRST);
    for _ in 0..MOST {
        let negative = kkt.shift(next - shift);
        shift = next;
        if negative == Ok(0) {
            return Ok(shift);
        }
        next = 8.0 * shift;
    }
    Err(Singular)
}

/// Smooth motions in general position.
fn first_guess(kkt: &Kkt, count: usize) -> Vec<Mode> {
    let zero = kkt.zero().nodes;
    let nodes = zero.len() as f64;
    let motion = |mode: usize| {
        let at = |node: usize| {
            let u = node as f64 / nodes;
            NodeVector::from_fn(|i, _| match i {
                0..6 => ((mode as f64 + 1.0) * (3.0 * u + 0.7 * i as f64)).sin(),
                _ => 0.0,
            })
        };
        (0..zero.len()).map(at).collect()
    };
    let guess = |mode| {
        let motion: Vec<_> = motion(mode);
        Mode {
            eigenvalue: 0.0,
            pull: kkt.pull(&motion),
            motion,
        }
    };
    (0..count).map(guess).collect()
}

/// The motions under some pulls.
fn answers(kkt: &mut Kkt, pulls: &[Vec<NodeVector>]) -> Result<Vec<Vec<NodeVector>>, Singular> {
    let mut answer = |pull: &Vec<NodeVector>| {
        let mut right = kkt.zero();
        for (right, pull) in right.nodes.iter_mut().zip(pull) {
            *right = -pull;
        }
        Ok(kkt.solve(&right)?.nodes)
    };
    pulls.iter().map(&mut answer).collect()
}

/// The best approximations of modes within the span of some motions, of which the pulls are known under which they arise.
fn ritz(
    kkt: &Kkt,
    motions: &[Vec<NodeVector>],
    pulls: &[Vec<NodeVector>],
    shift: f64,
) -> Vec<Mode> {
    const DEPENDENT: f64 = 1e-14;
    let own: Vec<_> = motions.iter().map(|motion| kkt.pull(motion)).collect();
    let count = motions.len();
    let products = |with: &[Vec<NodeVector>]| {
        let product = DMatrix::from_fn(count, count, |i, j| dot(&motions[i], &with[j]));
        0.5 * (&product + product.transpose())
    };
    let (stiffness, mass) = (products(pulls), products(&own));
    // First to coordinates in which the mass is 1, without the motions that depend on others.
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
            pull: combine(&own, coefficients.iter().copied()),
        }
    };
    order.into_iter().map(mode).collect()
}

fn combine(motions: &[Vec<NodeVector>], factors: impl Iterator<Item = f64>) -> Vec<NodeVector> {
    let mut sum = vec![NodeVector::zeros(); motions[0].len()];
    for (motion, factor) in motions.iter().zip(factors) {
        for (sum, node) in sum.iter_mut().zip(motion) {
            *sum += factor * node;
        }
    }
    sum
}

fn dot(a: &[NodeVector], b: &[NodeVector]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}
