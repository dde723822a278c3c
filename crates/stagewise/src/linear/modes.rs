//! The lowest eigenvectors of the second variation.

use super::chain::NodeVector;
use super::response::{Response, Singular};
use super::symmetries::{Held, Motions, zero_modes};
use crate::program::{Program, Scales, Stationary};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use std::ops::ControlFlow;

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
/// The symmetries of the programme are modes of eigenvalue 0, and the others are square to them. By band Lanczos iteration
/// with the inverse of the second variation, shifted below all eigenvalues.
///
/// Errors: [`Singular`] where the shifted second variation cannot be factorised.
pub fn lowest_modes<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
    at: &mut Stationary<P::Point>,
    count: usize,
) -> Result<Vec<Mode<N>>, Singular> {
    lowest_modes_while(program, at, count, &mut || ControlFlow::Continue(()))
}

/// As [`lowest_modes`]; `proceed` is called once a motion, and interrupts by `Break`: the modes are then approximations, and may
/// be fewer.
///
/// Errors: as [`lowest_modes`].
pub fn lowest_modes_while<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
    at: &mut Stationary<P::Point>,
    count: usize,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Vec<Mode<N>>, Singular> {
    let mut response = Response::unfactorised(program, at)?;
    let shift = shift_below_all(&mut response, &program.scales())?;
    let mut modes = zero_modes(response.metric(), &program.symmetries(&at.point));
    let beside = lowest_beside(&modes, &mut response, shift, count, proceed)?;
    modes.extend(beside);
    modes.sort_by(|a, b| a.eigenvalue.total_cmp(&b.eigenvalue));
    modes.truncate(count);
    Ok(modes)
}

/// The lowest modes of a shifted system square to given ones, rising.
///
/// Source: Ruhe, Implementation aspects of band Lanczos algorithms (1979), with full orthogonalisation.
fn lowest_beside<const X: usize, const U: usize, const N: usize>(
    given: &[Mode<N>],
    response: &mut Response<X, U, N>,
    shift: f64,
    count: usize,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Vec<Mode<N>>, Singular> {
    /// Motions to begin with, and so the largest multiplicity of an eigenvalue that is found for certain; a number.
    const BAND: usize = 4;
    /// Growth of the basis from one look at its modes to the next; dimensionless.
    const GROWTH: f64 = 1.2;
    let held = Held::new(given, response)?;
    let mut basis = Basis::default();
    for force in first_forces(response, BAND) {
        basis.add(response, &held, &force)?;
    }
    let mut next = count;
    loop {
        let is_whole = !basis.multiply(response, &held)?;
        let stops = is_whole || proceed().is_break();
        if !stops && basis.columns.len() < next {
            continue;
        }
        next = (GROWTH * basis.columns.len() as f64).ceil() as usize;
        let ritz = basis.ritz(count);
        if stops || ritz.len() == count && ritz.iter().all(|pair| pair.has_converged) {
            let going = ritz.iter().take_while(|_| proceed().is_continue());
            let modes = going.map(|pair| basis.mode(response, shift, pair));
            return Ok(modes.collect());
        }
    }
}

/// Motions that are orthonormal in the metric: the first ones, then the products of the inverse of the second variation with
/// all in turn, as far as they are new.
#[derive(Default)]
struct Basis<const N: usize> {
    motions: Motions<N>,
    /// Products of the inverse with the first motions, in the coordinates of the basis: one column for each.
    columns: Vec<Vec<f64>>,
}

/// An approximation of an eigenvector of the inverse, in the coordinates of a basis.
struct Ritz {
    /// Eigenvalue of the inverse.
    eigenvalue: f64,
    coordinates: DVector<f64>,
    has_converged: bool,
}

impl<const N: usize> Basis<N> {
    /// Multiplies the inverse with the next motion; false where there is none left.
    fn multiply<const X: usize, const U: usize>(
        &mut self,
        response: &mut Response<X, U, N>,
        held: &Held<'_, N>,
    ) -> Result<bool, Singular> {
        let Some(motion) = self.motions.get(self.columns.len()) else {
            return Ok(false);
        };
        let force = response.force(motion);
        let column = self.add(response, held, &force)?;
        self.columns.push(column);
        Ok(true)
    }

    /// Adds the motion under a force as far as it is new to the basis; gives its coordinates.
    fn add<const X: usize, const U: usize>(
        &mut self,
        response: &mut Response<X, U, N>,
        held: &Held<'_, N>,
        force: &[NodeVector<N>],
    ) -> Result<Vec<f64>, Singular> {
        /// Share of a motion outside the basis up to which it is rounding; dimensionless.
        const DEPENDENT: f64 = 1e-12;
        let mut motion = response.answer(force)?;
        held.project(&mut motion);
        let norm = |motion: &[NodeVector<N>]| dot(motion, &response.force(motion)).sqrt();
        let whole = norm(&motion);
        let mut column = vec![0.0; self.motions.len()];
        // Twice, as the first time leaves what rounding makes of a nearly dependent motion.
        for _ in 0..2 {
            let force = response.force(&motion);
            for (known, coordinate) in self.motions.iter().zip(&mut column) {
                let along = dot(known, &force);
                *coordinate += along;
                for (node, known) in motion.iter_mut().zip(known) {
                    *node -= along * known;
                }
            }
        }
        let rest = norm(&motion);
        if rest > DEPENDENT * whole {
            motion.iter_mut().for_each(|node| *node /= rest);
            self.motions.push(motion);
            column.push(rest);
        }
        Ok(column)
    }

    /// The approximations of the largest eigenvalues of the inverse, falling.
    fn ritz(&self, count: usize) -> Vec<Ritz> {
        /// Residual over the eigenvalue at which an approximation has converged; dimensionless.
        const CONVERGED: f64 = 1e-8;
        /// Residual over the largest eigenvalue that is rounding; dimensionless.
        const ROUNDING: f64 = 1e-14;
        let size = self.columns.len();
        let entry =
            |row: usize, column: usize| self.columns[column].get(row).copied().unwrap_or(0.0);
        let inverse = DMatrix::from_fn(size, size, |i, j| 0.5 * (entry(i, j) + entry(j, i)));
        let beyond = DMatrix::from_fn(self.motions.len() - size, size, |i, j| entry(size + i, j));
        let eigen = SymmetricEigen::new(inverse);
        let mut order: Vec<usize> = (0..size).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let largest = eigen.eigenvalues.amax();
        let pair = |of: usize| {
            let (eigenvalue, coordinates) = (eigen.eigenvalues[of], eigen.eigenvectors.column(of));
            let residual = (&beyond * coordinates).norm();
            Ritz {
                eigenvalue,
                coordinates: coordinates.into_owned(),
                has_converged: residual <= (CONVERGED * eigenvalue).max(ROUNDING * largest),
            }
        };
        order.into_iter().take(count).map(pair).collect()
    }

    /// The mode of an approximation, of a system that is shifted.
    fn mode<const X: usize, const U: usize>(
        &self,
        response: &Response<X, U, N>,
        shift: f64,
        ritz: &Ritz,
    ) -> Mode<N> {
        let mut motion = combine(&self.motions, ritz.coordinates.iter().copied());
        let norm = dot(&motion, &response.force(&motion)).sqrt();
        motion.iter_mut().for_each(|node| *node /= norm);
        Mode {
            eigenvalue: ritz.eigenvalue.recip() + shift,
            force: response.force(&motion),
            motion,
        }
    }
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

/// Forces of smooth motions in general position.
fn first_forces<const X: usize, const U: usize, const N: usize>(
    response: &Response<X, U, N>,
    count: usize,
) -> Motions<N> {
    let nodes = response.zero().nodes.len();
    let force = |mode: usize| {
        let at = |node: usize| {
            let u = node as f64 / nodes as f64;
            NodeVector::<N>::from_fn(|i, _| match i < X {
                true => ((mode as f64 + 1.0) * (3.0 * u + 0.7 * i as f64)).sin(),
                false => 0.0,
            })
        };
        response.force(&(0..nodes).map(at).collect::<Vec<_>>())
    };
    (0..count).map(force).collect()
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
