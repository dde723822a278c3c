//! Motions along which a programme is known to be constant, and the motions square to them.

use super::TooConcave;
use super::chain::NodeVector;
use super::kkt::Kkt;
use super::modes::{Mode, combine, dot};
use super::response::{Response, Singular};
use nalgebra::{DMatrix, DVector, SMatrix, SymmetricEigen};

/// Several motions, each of all nodes.
pub(super) type Motions<const N: usize> = Vec<Vec<NodeVector<N>>>;

/// Product of a metric with a motion.
pub(super) fn force_of<const X: usize, const N: usize>(
    metric: &[SMatrix<f64, X, X>],
    motion: &[NodeVector<N>],
) -> Vec<NodeVector<N>> {
    let force = |(metric, motion): (&SMatrix<f64, X, X>, &NodeVector<N>)| {
        let mut force = NodeVector::<N>::zeros();
        force
            .fixed_rows_mut::<X>(0)
            .copy_from(&(metric * motion.fixed_rows::<X>(0)));
        force
    };
    metric.iter().zip(motion).map(force).collect()
}

/// Modes of eigenvalue 0 that span the given motions, as many as are independent in the metric.
pub(super) fn zero_modes<const X: usize, const N: usize>(
    metric: &[SMatrix<f64, X, X>],
    motions: &Motions<N>,
) -> Vec<Mode<N>> {
    /// Eigenvalue of the mass matrix, relative to the largest, up to which motions depend on each other; dimensionless.
    const DEPENDENT: f64 = 1e-10;
    if motions.is_empty() {
        return Vec::new();
    }
    let forces: Vec<_> = motions.iter().map(|m| force_of(metric, m)).collect();
    let eigen = SymmetricEigen::new(products(motions, &forces));
    let least = DEPENDENT * eigen.eigenvalues.amax();
    let pairs = eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.column_iter());
    let independent = pairs.filter(|(square, _)| **square > least);
    let mode = |(square, vector): (&f64, nalgebra::DVectorView<'_, f64>)| {
        let factors: Vec<f64> = vector.iter().map(|part| part / square.sqrt()).collect();
        Mode {
            eigenvalue: 0.0,
            motion: combine(motions, factors.iter().copied()),
            force: combine(&forces, factors.iter().copied()),
        }
    };
    independent.map(mode).collect()
}

/// Scalar products of motions with forces, symmetric but for rounding.
pub(super) fn products<const N: usize>(motions: &Motions<N>, forces: &Motions<N>) -> DMatrix<f64> {
    let (rows, columns) = (motions.len(), forces.len());
    let product = DMatrix::from_fn(rows, columns, |i, j| dot(&motions[i], &forces[j]));
    0.5 * (&product + product.transpose())
}

/// The projection of solutions of a system to the motions square to given modes: the given modes are held.
pub(super) struct Held<'a, const N: usize> {
    modes: &'a [Mode<N>],
    /// Solutions under the modes' forces.
    answers: Motions<N>,
    /// Inverse of the modes' compliance.
    inverse: DMatrix<f64>,
}

impl<'a, const N: usize> Held<'a, N> {
    /// Errors: [`Singular`] where the system has no solution under the modes' forces.
    pub(super) fn new<const X: usize, const U: usize>(
        modes: &'a [Mode<N>],
        response: &mut Response<X, U, N>,
    ) -> Result<Self, Singular> {
        let forces: Motions<N> = modes.iter().map(|mode| mode.force.clone()).collect();
        let answers = response.answers(&forces)?;
        let inverse = products(&answers, &forces).try_inverse().ok_or(Singular)?;
        Ok(Self {
            modes,
            answers,
            inverse,
        })
    }

    /// The solution with the modes held, from the solution with the modes free.
    pub(super) fn project(&self, motion: &mut [NodeVector<N>]) {
        let along = self.modes.iter().map(|mode| dot(&mode.force, motion));
        let forces = &self.inverse * DVector::from_iterator(self.modes.len(), along);
        for (answer, force) in self.answers.iter().zip(&forces) {
            for (node, change) in motion.iter_mut().zip(answer) {
                *node -= *force * change;
            }
        }
    }
}

impl<const X: usize, const U: usize, const N: usize> Kkt<X, U, N> {
    /// Number of negative eigenvalues of the assembled second derivative on the tangent space of the equalities, on the
    /// motions square to given modes.
    ///
    /// To hold directions takes away as many negative eigenvalues as their compliance has eigenvalues that are not positive.
    ///
    /// Errors: [`TooConcave`] where there is a direction of zero curvature.
    pub(super) fn count_negative_beside(&mut self, modes: &[Mode<N>]) -> Result<usize, TooConcave> {
        let negative = self.count_negative()?;
        if negative == 0 || modes.is_empty() {
            return Ok(negative);
        }
        self.factorise_exactly()?;
        let forces: Motions<N> = modes.iter().map(|mode| mode.force.clone()).collect();
        let targets = vec![0.0; self.layout().equalities()];
        let answer = |force: &Vec<NodeVector<N>>| {
            self.find_step(force, &targets);
            self.step.iter().map(|node| -node).collect()
        };
        let answers: Motions<N> = forces.iter().map(answer).collect();
        let compliance = products(&answers, &forces).symmetric_eigenvalues();
        let held = compliance.iter().filter(|value| **value <= 0.0).count();
        Ok(negative.saturating_sub(held))
    }
}
