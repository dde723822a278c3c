//! `_core.Tracker`.

use crate::array::{self, Grid, Points, Scalars};
use crate::equilibrium::Equilibrium;
use crate::errors::{invalid_scenario, raised};
use crate::scenario::Scenario;
use crate::signals::Signals;
use fishbone::analysis::tracking as core;
use fishbone::names::Named;
use nalgebra::Vector3;
use numpy::IntoPyArray;
use pyo3::prelude::*;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// An equilibrium that is followed while one of its supports moves.
#[pyclass(frozen, module = "fishbone._core")]
pub(crate) struct Tracker(Mutex<core::Tracker>);

/// Status, whether it snapped, energy, iterations, largest residual, largest displacement and energy released in snaps.
type Updated = (&'static str, bool, f64, usize, f64, f64, f64);

impl Tracker {
    fn lock(&self) -> MutexGuard<'_, core::Tracker> {
        // A poisoned lock is taken all the same: an update that has panicked is not resumed.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Tracker {
    /// Starts at an equilibrium.
    ///
    /// Errors: `NoTracker`.
    #[new]
    fn new(py: Python<'_>, equilibrium: &Equilibrium, support: usize) -> PyResult<Self> {
        core::Tracker::new(equilibrium.core(), support)
            .map(|tracker| Self(Mutex::new(tracker)))
            .map_err(|error| raised(py, &error))
    }

    /// (status, snapped, energy, iterations, largest residual, jump, energy released).
    ///
    /// Errors: `InvalidScenario` for a pose that no scenario may hold; those that a signal handler raises,
    /// `KeyboardInterrupt` first of all.
    fn update(&self, py: Python<'_>, position: [f64; 3], rotation: [f64; 3]) -> PyResult<Updated> {
        let [position, rotation] = [position, rotation].map(Vector3::from);
        let mut signals = Signals::new();
        let update = py.detach(|| {
            self.lock()
                .update(&position, &rotation, &mut || signals.proceed())
        });
        match (signals.raised, update) {
            (Some(error), _) => Err(error),
            (None, Err(refused)) => Err(invalid_scenario(py, &refused, None)),
            (None, Ok(update)) => Ok((
                update.status.name(),
                update.snapped,
                update.energy,
                update.iterations,
                update.residuals.largest(),
                update.jump,
                update.released,
            )),
        }
    }

    /// The present scenario and its equilibrium.
    fn equilibrium(&self, py: Python<'_>) -> (Scenario, Equilibrium) {
        py.detach(|| {
            let found = Equilibrium::of(|| self.lock().equilibrium());
            (Scenario(found.core().problem().clone()), found)
        })
    }

    #[getter]
    fn energy(&self) -> f64 {
        self.lock().energy()
    }

    /// Shapes: (n,).
    #[getter]
    fn u<'py>(&self, py: Python<'py>) -> Scalars<'py> {
        self.lock().nodes().into_pyarray(py)
    }

    /// Shapes: (n, 3).
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Points<'py> {
        let positions: Vec<_> = self.lock().positions().collect();
        array::points(py, &positions)
    }

    /// Shapes: (n, 3, 3).
    #[getter]
    fn frame<'py>(&self, py: Python<'py>) -> Grid<'py> {
        let tracker = self.lock();
        array::frames(py, tracker.frames())
    }

    /// Shapes: (n,).
    #[getter]
    fn bend<'py>(&self, py: Python<'py>) -> Scalars<'py> {
        self.lock().bends().collect::<Vec<_>>().into_pyarray(py)
    }

    /// Shapes: (n,).
    #[getter]
    fn rib_slope<'py>(&self, py: Python<'py>) -> Scalars<'py> {
        self.lock()
            .rib_slopes()
            .collect::<Vec<_>>()
            .into_pyarray(py)
    }

    /// Force and moment of a support on the belt.
    fn reaction(&self, support: usize) -> ([f64; 3], [f64; 3]) {
        let wrench = self.lock().reaction(support);
        (array::row(&wrench.force), array::row(&wrench.moment))
    }
}
