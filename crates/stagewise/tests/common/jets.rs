//! Numbers with first and second derivatives, and blocks of these.

use nalgebra::{SMatrix, SVector};
use num_dual::{Derivative, Dual2SVec64, DualNum};

/// A number, or one with derivatives.
pub(crate) trait Number: DualNum<Primitive = f64> + Copy {}

impl<D: DualNum<Primitive = f64> + Copy> Number for D {}

/// Most unknowns that a formula depends on.
pub(crate) const W: usize = 10;

pub(crate) type Jet = Dual2SVec64<W>;

/// The gradient of a jet by its first numbers.
pub(crate) fn gradient<const R: usize>(jet: &Jet, from: usize) -> SVector<f64, R> {
    let all = jet.v1.unwrap_generic(nalgebra::Const, nalgebra::Const::<W>);
    SVector::from_fn(|i, _| all[from + i])
}

/// A block of the second derivative of a jet.
pub(crate) fn hessian<const R: usize, const C: usize>(
    jet: &Jet,
    from: [usize; 2],
) -> SMatrix<f64, R, C> {
    let all = jet
        .v2
        .unwrap_generic(nalgebra::Const::<W>, nalgebra::Const::<W>);
    SMatrix::from_fn(|i, j| all[(from[0] + i, from[1] + j)])
}

/// Numbers as independent unknowns, the first of which has a place among all.
pub(crate) fn jets<const R: usize>(values: &SVector<f64, R>, from: usize) -> [Jet; R] {
    std::array::from_fn(|i| {
        let mut jet = Jet::from_re(values[i]);
        jet.v1 = Derivative::derivative_generic(nalgebra::Const, nalgebra::Const::<W>, from + i);
        jet
    })
}

/// Sum of numbers times jets.
pub(crate) fn weighted(jets: &[Jet], by: impl IntoIterator<Item = f64>) -> Jet {
    let terms = jets.iter().zip(by);
    terms.fold(Jet::from_re(0.0), |sum, (jet, by)| sum + *jet * by)
}

/// A quadratic form in other coordinates.
pub(crate) fn congruent<const X: usize>(
    by: &SMatrix<f64, X, X>,
    form: &SMatrix<f64, X, X>,
) -> SMatrix<f64, X, X> {
    by.transpose() * form * by
}

/// With rows of zeros for the controls.
pub(crate) fn padded<const X: usize, const U: usize, const N: usize>(
    by: &SMatrix<f64, X, U>,
) -> SMatrix<f64, N, U> {
    let mut all = SMatrix::<f64, N, U>::zeros();
    all.fixed_view_mut::<X, U>(0, 0).copy_from(by);
    all
}
