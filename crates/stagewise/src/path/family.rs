//! One-parameter families of programmes.

use crate::linear::{Direction, Response};
use crate::program::{Distance, Program, Scales, Stationary};

/// A one-parameter family of programmes.
pub trait Family<const X: usize, const U: usize, const N: usize> {
    /// A point of every programme.
    type Point: Distance;
    /// The programmes.
    type Program: Program<X, U, N, Point = Self::Point>;

    /// The programme at a value of the parameter; `None` where there is none.
    fn at(&self, parameter: f64) -> Option<Self::Program>;

    /// Units of the programmes; the unit of the parameter is that of distance.
    fn scales(&self) -> Scales {
        Scales::default()
    }

    /// Derivative by the parameter of the first-order conditions of the programme there; `None` where it cannot be evaluated.
    ///
    /// By default [`by_differences`].
    fn conditions_by_parameter(
        &self,
        _program: &Self::Program,
        at: &Stationary<Self::Point>,
        parameter: f64,
    ) -> Option<Direction<N>> {
        by_differences(self, at, parameter)
    }
}

/// Derivative by the parameter of the first-order conditions of a family's programmes by central differences, one-sided at the
/// end of the parameters that the family knows; `None` where there is none to either side.
pub fn by_differences<F, const X: usize, const U: usize, const N: usize>(
    family: &F,
    at: &Stationary<F::Point>,
    parameter: f64,
) -> Option<Direction<N>>
where
    F: Family<X, U, N> + ?Sized,
{
    /// Step of the finite differences in the parameter; in [`Scales::distance`].
    const STEP: f64 = 1e-5;
    let h = STEP * family.scales().distance;
    let conditions = |parameter: f64| {
        let program = family.at(parameter)?;
        Response::conditions_of(&program, at)
    };
    let (mut high, low, width) = match (conditions(parameter + h), conditions(parameter - h)) {
        (Some(high), Some(low)) => (high, low, 2.0 * h),
        (Some(high), None) => (high, conditions(parameter)?, h),
        (None, Some(low)) => (conditions(parameter)?, low, h),
        (None, None) => return None,
    };
    high.add(-1.0, &low);
    high.scale(width.recip());
    Some(high)
}

/// A family whose programme does not depend on the parameter.
pub(super) struct Alone<'a, P>(pub(super) &'a P);

impl<'a, P: Program<X, U, N>, const X: usize, const U: usize, const N: usize> Family<X, U, N>
    for Alone<'a, P>
where
    P::Point: Distance,
{
    type Point = P::Point;
    type Program = &'a P;

    fn at(&self, _: f64) -> Option<&'a P> {
        Some(self.0)
    }

    fn scales(&self) -> Scales {
        self.0.scales()
    }
}
