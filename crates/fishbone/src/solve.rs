//! The solution of a problem by the method of its scenario.

use crate::equilibrium::{self, Equilibrium};
use crate::problem::{Formulation, Problem};
use crate::ritz;
use std::ops::ControlFlow;
use thiserror::Error;

/// Finds an equilibrium of a problem.
///
/// `proceed` is asked once an iteration whether to go on; `Break` ends the solve as not converged.
///
/// Source: Sec. II-D, in the two fields bend and rib slope; Sec. III where the scenario asks for the source's method.
pub fn solve(problem: &Problem, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> Equilibrium {
    match problem.formulation() {
        Formulation::Intrinsic => equilibrium::from_guess(problem, proceed),
        Formulation::Ritz { ends } => ritz::equilibrium::solve(problem, ends, proceed),
    }
}

/// Finds an equilibrium from a given shape alone, in place of the guess: bend and rib slope at equal steps of the arc length
/// from start to end. The source's method, which has no first-order conditions to start from, ignores the shape.
///
/// Shapes: (m,) both, m at least 2.
/// Units: `bend` in rad per unit of length of the scenario.
///
/// # Errors
///
/// [`NoShape`] where the arrays are no shape.
pub fn solve_from(
    problem: &Problem,
    bend: &[f64],
    rib_slope: &[f64],
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Equilibrium, NoShape> {
    NoShape::check(bend, rib_slope)?;
    Ok(match problem.formulation() {
        Formulation::Intrinsic => equilibrium::from_fields(problem, bend, rib_slope, proceed),
        Formulation::Ritz { ends } => ritz::equilibrium::solve(problem, ends, proceed),
    })
}

/// The reason why two arrays are no shape to start from.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum NoShape {
    /// Their lengths differ or are less than 2.
    #[error(
        "start: found {bend} bends and {rib_slope} rib slopes, allowed as many of each, at least 2"
    )]
    Lengths {
        /// Number of bends.
        bend: usize,
        /// Number of rib slopes.
        rib_slope: usize,
    },
    /// A number is not finite.
    #[error("start: found a number that is not finite at place {0}, allowed finite numbers")]
    NotFinite(usize),
}

impl NoShape {
    fn check(bend: &[f64], rib_slope: &[f64]) -> Result<(), Self> {
        if bend.len() != rib_slope.len() || bend.len() < 2 {
            return Err(Self::Lengths {
                bend: bend.len(),
                rib_slope: rib_slope.len(),
            });
        }
        let mut pairs = bend.iter().zip(rib_slope);
        match pairs.position(|(bend, slope)| !(bend.is_finite() && slope.is_finite())) {
            Some(place) => Err(Self::NotFinite(place)),
            None => Ok(()),
        }
    }
}
