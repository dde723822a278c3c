//! `_core.Tracker`.

use crate::array::{self, Grid, Points, Scalars};
use crate::equilibrium::{Equilibrium, status_name};
use crate::scenario::Scenario;
use fishbone::tracker::{self, NoTracker};
use nalgebra::Vector3;
use numpy::IntoPyArray;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// An equilibrium that is followed while one of its supports moves.
#[pyclass(module = "fishbone._core")]
pub(crate) struct Tracker(tracker::Tracker);

impl Tracker {
    /// Errors: `ValueError`, one line, where there is nothing to follow.
    pub(crate) fn new(
        equilibrium: &fishbone::equilibrium::Equilibrium,
        support: usize,
    ) -> PyResult<Self> {
        let refused = |error: NoTracker| PyValueError::new_err(error.to_string());
        tracker::Tracker::new(equilibrium, support)
            .map(Self)
            .map_err(refused)
    }
}

#[pymethods]
impl Tracker {
    /// (status, snapped, energy, iterations, largest residual).
    fn update(
        &mut self,
        py: Python<'_>,
        position: [f64; 3],
        rotation: [f64; 3],
    ) -> (&'static str, bool, f64, usize, f64) {
        let [position, rotation] = [position, rotation].map(Vector3::from);
        let update = py.detach(|| self.0.update(&position, &rotation));
        (
            status_name(update.status),
            update.snapped,
            update.energy,
            update.iterations,
            update.residuals.largest(),
        )
    }

    /// The present scenario and its equilibrium, solved anew from its own shape.
    fn equilibrium(&self, py: Python<'_>) -> (Scenario, Equilibrium) {
        py.detach(|| {
            let found = Equilibrium::of(|| self.0.equilibrium());
            (Scenario(found.scenario().clone()), found)
        })
    }

    #[getter]
    fn energy(&self) -> f64 {
        self.0.energy()
    }

    /// Shapes: (n, 3).
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Points<'py> {
        let positions: Vec<_> = self.0.positions().collect();
        array::points(py, &positions)
    }

    /// Shapes: (n, 3, 3).
    #[getter]
    fn frame<'py>(&self, py: Python<'py>) -> Grid<'py> {
        array::frames(py, self.0.frames())
    }

    /// Shapes: (n,).
    #[getter]
    fn bend<'py>(&self, py: Python<'py>) -> Scalars<'py> {
        self.0.bends().collect::<Vec<_>>().into_pyarray(py)
    }

    /// Shapes: (n,).
    #[getter]
    fn rib_slope<'py>(&self, py: Python<'py>) -> Scalars<'py> {
        self.0.rib_slopes().collect::<Vec<_>>().into_pyarray(py)
    }

    /// Force and moment of a support on the belt.
    fn reaction(&self, support: usize) -> ([f64; 3], [f64; 3]) {
        let wrench = self.0.reaction(support);
        (array::row(&wrench.force), array::row(&wrench.moment))
    }
}
