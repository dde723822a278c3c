//! `_core.solve` and `_core.solve_from`.

use crate::equilibrium::Equilibrium;
use crate::scenario::Scenario;
use crate::signals::Signals;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Solves a scenario with the GIL released.
///
/// Errors: those that a signal handler raises, `KeyboardInterrupt` first of all.
#[pyfunction]
pub(crate) fn solve(py: Python<'_>, scenario: &Scenario) -> PyResult<Equilibrium> {
    let mut signals = Signals::new();
    let found = py.detach(|| Equilibrium::timed(&scenario.0, &mut || signals.proceed()));
    match signals.raised {
        Some(error) => Err(error),
        None => Ok(found),
    }
}

/// Solves a scenario from a shape with the GIL released: bend and rib slope at equal steps of the arc length.
///
/// Shapes: (m,) both.
/// Errors: `ValueError`, one line, if the arrays are no shape; those that a signal handler raises, `KeyboardInterrupt` first
/// of all.
#[pyfunction]
pub(crate) fn solve_from(
    py: Python<'_>,
    scenario: &Scenario,
    bend: Vec<f64>,
    rib_slope: Vec<f64>,
) -> PyResult<Equilibrium> {
    let mut signals = Signals::new();
    let found = py.detach(|| {
        Equilibrium::try_of(|| {
            fishbone::solve::solve_from(&scenario.0, &bend, &rib_slope, &mut || signals.proceed())
        })
    });
    match signals.raised {
        Some(error) => Err(error),
        None => found.map_err(|error| PyValueError::new_err(error.to_string())),
    }
}
