//! `_core.Tracker`.

use crate::array::{self, Grid, Points, Scalars};
use crate::equilibrium::Equilibrium;
use crate::errors::exception::InvalidArgument;
use crate::errors::{invalid_scenario, raised};
use crate::exclusive::Exclusive;
use crate::scenario::Scenario;
use crate::signals::Signals;
use crate::stored::{self, Reduced};
use fishbone::analysis::tracking as core;
use fishbone::equilibrium::Status;
use fishbone::io::stored::Stored;
use fishbone::names::Named;
use fishbone::surface;
use nalgebra::{Matrix3, Vector3};
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyType};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// An equilibrium that is followed while some of its supports move.
#[pyclass(frozen, module = "fishbone._core")]
pub(crate) struct Tracker {
    moving: Exclusive<core::Tracker>,
    /// Locked to be copied alone, and with the GIL held, so that no child made by `fork` finds it locked.
    shown: Mutex<Shown>,
}

/// The shape after the last update, which can be read during the next one.
#[derive(Default)]
struct Shown {
    /// Arc length of every support.
    supports: Vec<f64>,
    /// The supports that move.
    moving: Vec<usize>,
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
        fill(&mut self.supports, tracker.supports());
        fill(&mut self.moving, tracker.moving().iter().copied());
        self.energy = tracker.energy();
        fill(&mut self.nodes, tracker.nodes());
        fill(&mut self.positions, tracker.positions());
        fill(&mut self.frames, tracker.frames().copied());
        fill(&mut self.bends, tracker.bends());
        fill(&mut self.rib_slopes, tracker.rib_slopes());
    }
}

/// Status, whether it snapped, energy, iterations, residual of the supports, largest displacement and energy released in snaps,
/// message, whether it was solved afresh, share of the way, whether the belt has no slack, whether it crosses itself.
type Updated = (
    &'static str,
    bool,
    f64,
    usize,
    f64,
    f64,
    f64,
    String,
    bool,
    f64,
    bool,
    Option<bool>,
);

fn updated(update: core::Update, crosses_itself: Option<bool>) -> Updated {
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
        update.fraction,
        update.taut,
        crosses_itself,
    )
}

/// A support, its position and its rotation vector; what is None stays as it is.
type Goal = (usize, Option<[f64; 3]>, Option<[f64; 3]>);

fn goals(goals: &[Goal]) -> Vec<core::Goal> {
    let goal = |(support, position, rotation): &Goal| core::Goal {
        support: *support,
        position: position.map(Vector3::from),
        rotation: rotation.map(Vector3::from),
    };
    goals.iter().map(goal).collect()
}

impl Tracker {
    /// Copies a part of the shape. No object of Python is made meanwhile: this may run other Python code.
    fn read<T>(&self, part: impl FnOnce(&Shown) -> T) -> T {
        part(&self.shown())
    }

    /// Works on the tracker with the GIL released, and shows its shape then.
    ///
    /// Errors: as [`Exclusive::with`].
    fn with<R: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut core::Tracker, &mut Signals) -> R + Send,
    ) -> PyResult<R> {
        self.moving
            .with(py, work, |tracker| self.shown().copy(tracker))
    }

    fn of(tracker: core::Tracker) -> Self {
        let mut shown = Shown::default();
        shown.copy(&tracker);
        Self {
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
    fn new(py: Python<'_>, equilibrium: &Equilibrium, moving: Vec<usize>) -> PyResult<Self> {
        let tracker = core::Tracker::new(equilibrium.core(), &moving);
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
        let bytes = self.with(py, |tracker, _| tracker.to_bytes())?;
        Ok(PyBytes::new(py, &bytes.map_err(stored::refused)?))
    }

    /// Another tracker in the same state, which moves by itself.
    ///
    /// Errors: as `equilibrium`.
    fn copy(&self, py: Python<'_>) -> PyResult<Self> {
        self.with(py, |tracker, _| Self::of(tracker.clone()))
    }

    /// What `pickle` and `copy` make it anew of.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let bytes = slf.get().to_bytes(slf.py())?;
        Ok((slf.get_type().getattr("from_bytes")?, (bytes,)))
    }

    /// The data of the update, which ends after `max_time` seconds or `max_iterations` at the latest; only if asked to, whether the
    /// belt crosses itself.
    ///
    /// Errors: `InvalidScenario` for a pose that no scenario may hold; those that a signal handler raises,
    /// `KeyboardInterrupt` first of all; `RuntimeError` inside of another update of this thread.
    fn update(
        &self,
        py: Python<'_>,
        to: Vec<Goal>,
        max_time: Option<f64>,
        max_iterations: Option<usize>,
        check_crossing: bool,
    ) -> PyResult<Updated> {
        let time =
            max_time.map(|seconds| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX));
        let mut budget = core::Budget::new(time, max_iterations);
        let update = self.with(py, |tracker, signals| {
            let update = tracker.update(&goals(&to), &mut || {
                signals.proceed()?;
                budget.proceed()
            });
            let crosses_itself = check_crossing
                .then(|| surface::crosses_itself(&tracker.equilibrium().spine).is_some());
            update.map(|update| updated(update, crosses_itself))
        })?;
        update.map_err(|refused| invalid_scenario(py, &refused, None))
    }

    /// As `update`, goals after goals, with the positions at the nodes of the first shape and the reactions of the moving supports;
    /// ends after an update that has not converged and, if asked to, after a snap.
    ///
    /// Shapes: positions (n, 3) an update, forces and moments (k, 3) an update, of k moving supports; one after the other.
    /// Errors: as `update`; of an invalid pose, before the first update.
    fn update_many<'py>(
        &self,
        py: Python<'py>,
        to: Vec<Vec<Goal>>,
        stop_on_snap: bool,
    ) -> PyResult<(Vec<Updated>, [Points<'py>; 3])> {
        let [mut positions, mut forces, mut moments] = [const { Vec::new() }; 3];
        let updates = self.with(py, |tracker, signals| {
            let to: Vec<_> = to.iter().map(|row| goals(row)).collect();
            for goals in &to {
                tracker.check(goals)?;
            }
            let nodes = tracker.nodes();
            let mut updates = Vec::new();
            for goals in &to {
                let update = tracker.update(goals, &mut || signals.proceed())?;
                let ends = update.status != Status::Converged || stop_on_snap && update.snapped;
                updates.push(update);
                positions.extend(tracker.positions_at(&nodes));
                for wrench in tracker
                    .moving()
                    .iter()
                    .map(|support| tracker.reaction(*support))
                {
                    forces.push(wrench.force);
                    moments.push(wrench.moment);
                }
                if ends || signals.proceed().is_break() {
                    break;
                }
            }
            Ok(updates)
        })?;
        let updates: Vec<core::Update> =
            updates.map_err(|refused| invalid_scenario(py, &refused, None))?;
        let updates = updates.into_iter().map(|update| updated(update, None));
        let arrays = [positions, forces, moments].map(|rows| array::points(py, &rows));
        Ok((updates.collect(), arrays))
    }

    /// Takes hold of the belt at an arc length and lets a support go, which is named by its place before; as `update`.
    ///
    /// Errors: as `update`.
    fn regrasp(
        &self,
        py: Python<'_>,
        hold: Option<f64>,
        release: Option<usize>,
    ) -> PyResult<Updated> {
        let update = self.with(py, |tracker, signals| {
            tracker.regrasp(hold, release, &mut || signals.proceed())
        })?;
        let update = update.map_err(|refused| invalid_scenario(py, &refused, None))?;
        Ok(updated(update, None))
    }

    /// Places v across of the ends of the ribs of the nodes, on the −ζ and on the +ζ side.
    ///
    /// Shapes: (n,) each.
    /// Errors: as `equilibrium`.
    fn rib_ends<'py>(&self, py: Python<'py>) -> PyResult<[Scalars<'py>; 2]> {
        let ribs = self.with(py, |tracker, _| surface::ribs(&tracker.equilibrium().spine))?;
        let ends = |of: fn(&surface::Rib) -> f64| {
            let ends: Vec<f64> = ribs.iter().map(of).collect();
            ends.into_pyarray(py)
        };
        Ok([ends(|rib| rib.v_minus), ends(|rib| rib.v_plus)])
    }

    /// Derivatives by the motion of a support, of points at v across on the ribs of the nodes, one a node, and of its reaction.
    ///
    /// Shapes: (n, 3, 6), (6, 6).
    /// Errors: `NoSensitivity`; `InvalidArgument` of points off the spine of a strip of finite thickness; as `equilibrium`.
    fn derivatives<'py>(
        &self,
        py: Python<'py>,
        support: usize,
        across: Vec<f64>,
    ) -> PyResult<(Grid<'py>, Points<'py>)> {
        let (found, ribs) = self.with(py, |tracker, _| {
            (tracker.derivatives(support), tracker.ribs())
        })?;
        let found = found.map_err(|error| raised(py, &error))?;
        let points = match ribs {
            _ if across.iter().all(|v| *v == 0.0) => found.position,
            Some(ribs) => {
                let lines = ribs.iter().zip(&across).map(|(rib, v)| *v * rib);
                found.at(&lines.collect::<Vec<_>>())
            }
            None => {
                return Err(InvalidArgument::new_err(
                    "v: found points off the spine with energy = \"shell\", allowed 0: its ribs are not straight",
                ));
            }
        };
        Ok((
            array::matrices(py, &points),
            array::square(py, &found.reaction),
        ))
    }

    /// The lowest eigenvalue of the second variation, and its derivatives by the motion of a support that moves.
    ///
    /// Shapes: (6,).
    /// Errors: `NoModes`; as `update`, but for the pose.
    fn lowest_eigenvalue<'py>(
        &self,
        py: Python<'py>,
        support: usize,
    ) -> PyResult<(f64, Scalars<'py>)> {
        let found = self.with(py, |tracker, signals| {
            tracker.lowest_eigenvalue(support, &mut || signals.proceed())
        })?;
        let found = found.map_err(|error| raised(py, &error))?;
        let gradient = found.gradient.as_slice().to_vec();
        Ok((found.value, gradient.into_pyarray(py)))
    }

    /// The present scenario and its equilibrium.
    ///
    /// Errors: as `update`, but for the pose.
    fn equilibrium(&self, py: Python<'_>) -> PyResult<(Scenario, Equilibrium)> {
        self.with(py, |tracker, _| {
            let found = Equilibrium::of(|| tracker.equilibrium());
            (Scenario(found.core().problem().clone()), found)
        })
    }

    /// The supports that move, by their places in the scenario.
    #[getter]
    fn moving(&self) -> Vec<usize> {
        self.read(|shown| shown.moving.clone())
    }

    /// Arc length of every support.
    #[getter]
    fn supports(&self) -> Vec<f64> {
        self.read(|shown| shown.supports.clone())
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
        let wrench = self.with(py, |tracker, _| tracker.reaction(support))?;
        Ok((array::row(&wrench.force), array::row(&wrench.moment)))
    }
}
