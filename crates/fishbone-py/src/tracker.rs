//! `_core.Tracker`.

use crate::array::{self, Grid, Points, Scalars};
use crate::equilibrium::Equilibrium;
use crate::errors::{invalid_scenario, raised};
use crate::exclusive::Exclusive;
use crate::scenario::Scenario;
use crate::stored::{self, Reduced};
use fishbone::analysis::tracking as core;
use fishbone::equilibrium::Status;
use fishbone::io::stored::Stored;
use fishbone::names::Named;
use nalgebra::{Matrix3, Vector3};
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyType};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// An equilibrium that is followed while one of its supports moves.
#[pyclass(frozen, module = "fishbone._core")]
pub(crate) struct Tracker {
    moving: Exclusive<core::Tracker>,
    /// Locked to be copied alone, never while the GIL is waited for.
    shown: Mutex<Shown>,
    /// Arc length of every support.
    supports: Vec<f64>,
}

/// The shape after the last update, which can be read during the next one.
#[derive(Default)]
struct Shown {
    energy: f64,
    nodes: Vec<f64>,
    positions: Vec<Vector3<f64>>,
    frames: Vec<Matrix3<f64>>,
    bends: Vec<f64>,
    rib_slopes: Vec<f64>,
}

impl Shown {
    /// Copies the shape of a tracker.
    fn copy(&mut self, tracker: &core::Tracker) {
        fn fill<T>(values: &mut Vec<T>, with: impl IntoIterator<Item = T>) {
            values.clear();
            values.extend(with);
        }
        self.energy = tracker.energy();
        fill(&mut self.nodes, tracker.nodes());
        fill(&mut self.positions, tracker.positions());
        fill(&mut self.frames, tracker.frames().copied());
        fill(&mut self.bends, tracker.bends());
        fill(&mut self.rib_slopes, tracker.rib_slopes());
    }
}

/// Status, whether it snapped, energy, iterations, residual of the supports, largest displacement and energy released in snaps,
/// message, whether it was solved afresh.
type Updated = (&'static str, bool, f64, usize, f64, f64, f64, String, bool);

fn updated(update: core::Update) -> Updated {
    (
        update.status.name(),
        update.snapped,
        update.energy,
        update.iterations,
        update.residuals.constraint,
        update.jump,
        update.released,
        update.message,
        update.solved_afresh,
    )
}

impl Tracker {
    /// Copies a part of the shape. No object of Python is made meanwhile: this may run other Python code.
    fn read<T>(&self, part: impl FnOnce(&Shown) -> T) -> T {
        part(&self.shown())
    }

    fn of(tracker: core::Tracker) -> Self {
        let mut shown = Shown::default();
        shown.copy(&tracker);
        Self {
            supports: tracker.supports(),
            moving: Exclusive::new(tracker),
            shown: Mutex::new(shown),
        }
    }

    fn shown(&self) -> MutexGuard<'_, Shown> {
        // A poisoned lock is taken all the same: the next update copies the whole shape.
        self.shown.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Tracker {
    /// Starts at an equilibrium.
    ///
    /// Errors: `NoTracker`.
    #[new]
    fn new(py: Python<'_>, equilibrium: &Equilibrium, support: usize) -> PyResult<Self> {
        let tracker = core::Tracker::new(equilibrium.core(), support);
        tracker.map(Self::of).map_err(|error| raised(py, &error))
    }

    /// The tracker of its bytes.
    ///
    /// Errors: `InvalidArgument` of other bytes.
    #[classmethod]
    fn from_bytes(_class: &Bound<'_, PyType>, py: Python<'_>, content: &[u8]) -> PyResult<Self> {
        stored::from_bytes(py, content).map(Self::of)
    }

    /// The state of the tracker as bytes.
    ///
    /// Errors: as `equilibrium`.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = self.moving.with(py, |tracker, _| tracker.to_bytes())?;
        Ok(PyBytes::new(py, &bytes.map_err(stored::refused)?))
    }

    /// Another tracker in the same state, which moves by itself.
    ///
    /// Errors: as `equilibrium`.
    fn copy(&self, py: Python<'_>) -> PyResult<Self> {
        self.moving.with(py, |tracker, _| Self::of(tracker.clone()))
    }

    /// What `pickle` and `copy` make it anew of.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let bytes = slf.get().to_bytes(slf.py())?;
        Ok((slf.get_type().getattr("from_bytes")?, (bytes,)))
    }

    /// The data of the update.
    ///
    /// Errors: `InvalidScenario` for a pose that no scenario may hold; those that a signal handler raises,
    /// `KeyboardInterrupt` first of all; `RuntimeError` inside of another update of this thread.
    fn update(&self, py: Python<'_>, position: [f64; 3], rotation: [f64; 3]) -> PyResult<Updated> {
        let [position, rotation] = [position, rotation].map(Vector3::from);
        let update = self.moving.with(py, |tracker, signals| {
            let update = tracker.update(&position, &rotation, &mut || signals.proceed());
            self.shown().copy(tracker);
            update
        })?;
        let update = update.map_err(|refused| invalid_scenario(py, &refused, None))?;
        Ok(updated(update))
    }

    /// As `update`, from pose to pose, with the support's reactions and the positions at the nodes of the first shape; ends
    /// after an update that has not converged and, if asked to, after a snap.
    ///
    /// Shapes: (m, 2, 3); one shape (n, 3) an update, forces and moments (updates, 3).
    /// Errors: as `update`; of an invalid pose, before the first update.
    fn update_many<'py>(
        &self,
        py: Python<'py>,
        poses: Vec<[[f64; 3]; 2]>,
        stop_on_snap: bool,
    ) -> PyResult<(Vec<Updated>, Vec<Points<'py>>, [Points<'py>; 2])> {
        let mut shapes = Vec::new();
        let mut wrenches = Vec::new();
        let updates = self.moving.with(py, |tracker, signals| {
            let poses: Vec<_> = poses.iter().map(|pose| pose.map(Vector3::from)).collect();
            for [position, rotation] in &poses {
                tracker.check_pose(position, rotation)?;
            }
            let nodes = tracker.nodes();
            let mut updates = Vec::new();
            for [position, rotation] in &poses {
                let update = tracker.update(position, rotation, &mut || signals.proceed())?;
                let ends = update.status != Status::Converged || stop_on_snap && update.snapped;
                updates.push(update);
                shapes.push(tracker.positions_at(&nodes));
                wrenches.push(tracker.reaction(tracker.support()));
                if ends || signals.proceed().is_break() {
                    break;
                }
            }
            self.shown().copy(tracker);
            Ok(updates)
        })?;
        let updates: Vec<core::Update> =
            updates.map_err(|refused| invalid_scenario(py, &refused, None))?;
        let shapes = shapes.iter().map(|shape| array::points(py, shape));
        let forces: Vec<_> = wrenches.iter().map(|wrench| wrench.force).collect();
        let moments: Vec<_> = wrenches.iter().map(|wrench| wrench.moment).collect();
        let wrenches = [forces, moments].map(|parts| array::points(py, &parts));
        Ok((
            updates.into_iter().map(updated).collect(),
            shapes.collect(),
            wrenches,
        ))
    }

    /// The present scenario and its equilibrium.
    ///
    /// Errors: as `update`, but for the pose.
    fn equilibrium(&self, py: Python<'_>) -> PyResult<(Scenario, Equilibrium)> {
        self.moving.with(py, |tracker, _| {
            let found = Equilibrium::of(|| tracker.equilibrium());
            (Scenario(found.core().problem().clone()), found)
        })
    }

    /// Arc length of every support.
    #[getter]
    fn supports(&self) -> Vec<f64> {
        self.supports.clone()
    }

    #[getter]
    fn energy(&self) -> f64 {
        self.read(|shown| shown.energy)
    }

    /// Shapes: (n,).
    #[getter]
    fn u<'py>(&self, py: Python<'py>) -> Scalars<'py> {
        self.read(|shown| shown.nodes.clone()).into_pyarray(py)
    }

    /// Shapes: (n, 3).
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Points<'py> {
        let positions = self.read(|shown| shown.positions.clone());
        array::points(py, &positions)
    }

    /// Shapes: (n, 3, 3).
    #[getter]
    fn frame<'py>(&self, py: Python<'py>) -> Grid<'py> {
        let frames = self.read(|shown| shown.frames.clone());
        array::frames(py, &frames)
    }

    /// Shapes: (n,).
    #[getter]
    fn bend<'py>(&self, py: Python<'py>) -> Scalars<'py> {
        self.read(|shown| shown.bends.clone()).into_pyarray(py)
    }

    /// Shapes: (n,).
    #[getter]
    fn rib_slope<'py>(&self, py: Python<'py>) -> Scalars<'py> {
        self.read(|shown| shown.rib_slopes.clone()).into_pyarray(py)
    }

    /// Force and moment of a support on the belt.
    ///
    /// Errors: as `equilibrium`.
    fn reaction(&self, py: Python<'_>, support: usize) -> PyResult<([f64; 3], [f64; 3])> {
        let wrench = self
            .moving
            .with(py, |tracker, _| tracker.reaction(support))?;
        Ok((array::row(&wrench.force), array::row(&wrench.moment)))
    }
}
