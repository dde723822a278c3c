//! `_core.Path`, `_core.follow` and `_core.Diagram`.

use crate::array::{self, Grid, Points, Scalars};
use crate::equilibrium::Equilibrium;
use crate::errors::raised;
use crate::scenario::Scenario;
use crate::signals::Signals;
use crate::stored::{self, Reduced};
use fishbone::analysis::continuation::{self as core, Settings, Summary};
use fishbone::analysis::path::{self, Motion};
use fishbone::names::Named;
use nalgebra::Vector3;
use numpy::IntoPyArray;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyType;

/// A path through the space of scenarios.
#[pyclass(frozen, module = "fishbone._core")]
pub(crate) struct Path(path::Path);

#[pymethods]
impl Path {
    /// Numbers of a scenario that change together, each a field and its last value.
    ///
    /// Errors: `NoPath`.
    #[staticmethod]
    fn numbers(py: Python<'_>, scenario: &Scenario, changes: Vec<(String, f64)>) -> PyResult<Self> {
        path::Path::numbers(&scenario.0, &changes)
            .map(Self)
            .map_err(|error| raised(py, &error))
    }

    /// The parameter at the end of the path.
    #[getter]
    fn goal(&self) -> f64 {
        self.0.parameter(self.0.length())
    }

    /// The parameter of the first end of a leg whose supports are proved to be out of reach, and why; nothing is solved.
    fn out_of_reach(&self) -> Option<(f64, String)> {
        let (parameter, supports) = self.0.out_of_reach()?;
        Some((parameter, supports.to_string()))
    }

    /// A support that moves through poses, each a position and a rotation vector, from one to the next by a motion's name.
    ///
    /// Errors: `NoPath`; `ValueError` if no motion has the name.
    #[staticmethod]
    fn poses(
        py: Python<'_>,
        scenario: &Scenario,
        support: usize,
        poses: Vec<([f64; 3], [f64; 3])>,
        motion: &str,
    ) -> PyResult<Self> {
        let poses: Vec<_> = poses
            .into_iter()
            .map(|(position, rotation)| (Vector3::from(position), Vector3::from(rotation)))
            .collect();
        let motion = Motion::ALL.iter().find(|known| known.name() == motion);
        let motion = motion.ok_or_else(|| PyValueError::new_err("no name of a motion"))?;
        path::Path::poses(&scenario.0, support, &poses, *motion)
            .map(Self)
            .map_err(|error| raised(py, &error))
    }
}

/// Follows an equilibrium along a path with the GIL released; `progress(branch, share of the path)` is called during the
/// search.
///
/// Errors: `NoBranch`; those that `progress` or a signal handler raises.
#[pyfunction]
#[pyo3(signature = (equilibrium, path, step, states, branches, snaps, progress=None))]
#[expect(clippy::too_many_arguments, reason = "one for each of Python's")]
pub(crate) fn follow(
    py: Python<'_>,
    equilibrium: &Equilibrium,
    path: &Path,
    step: f64,
    states: usize,
    branches: usize,
    snaps: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Diagram> {
    let settings = Settings {
        step,
        states,
        branches,
        snaps,
        ..Settings::default()
    };
    let mut signals = Signals::new();
    let found = py.detach(|| {
        let proceed = &mut |branch: usize, place: f64| {
            let share = place / path.0.length();
            signals.proceed_with(|py| match &progress {
                Some(progress) => progress.call1(py, (branch, share)).map(drop),
                None => Ok(()),
            })
        };
        core::follow(equilibrium.core(), &path.0, &settings, proceed)
    });
    match signals.raised {
        Some(error) => Err(error),
        None => found.map(Diagram).map_err(|error| raised(py, &error)),
    }
}

/// The branches of equilibria along a path.
#[pyclass(frozen, module = "fishbone._core")]
pub(crate) struct Diagram(core::Diagram);

/// Parameter of a snap, the minimum to which the belt snaps, largest displacement and energy released.
type Snapped = (f64, Scenario, Equilibrium, f64, f64);

/// Kind, parameter, state, negative modes before and after, whether it is confirmed, and the snap.
type Event = (
    &'static str,
    f64,
    usize,
    (usize, usize),
    bool,
    Option<Snapped>,
);

/// Parameter, energy, height, forces and moments of the supports, least bend radius, least radius on the spine, radii exceeded
/// on 99.9, 99 and 95 % of the area, rib margin, whether it is stable, status, largest residual and largest error by the mesh.
type Report<'py> = (
    Scalars<'py>,
    Scalars<'py>,
    Scalars<'py>,
    Grid<'py>,
    Grid<'py>,
    Scalars<'py>,
    Scalars<'py>,
    [Scalars<'py>; 3],
    Scalars<'py>,
    Vec<Option<bool>>,
    Vec<&'static str>,
    [Scalars<'py>; 2],
);

#[pymethods]
impl Diagram {
    /// The diagram of its bytes.
    ///
    /// Errors: `InvalidArgument` of other bytes.
    #[classmethod]
    fn from_bytes(_class: &Bound<'_, PyType>, py: Python<'_>, content: &[u8]) -> PyResult<Self> {
        stored::from_bytes(py, content).map(Self)
    }

    /// What `pickle` and `copy` make it anew of.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let bytes = stored::to_bytes(slf.py(), &slf.get().0)?;
        Ok((slf.get_type().getattr("from_bytes")?, (bytes,)))
    }

    /// Number of branches.
    #[getter]
    fn branches(&self) -> usize {
        self.0.branches.len()
    }

    /// Number of states of a branch.
    fn states(&self, branch: usize) -> usize {
        self.0.branches[branch].states.len()
    }

    /// (branch, event) where a branch begins.
    fn origin(&self, branch: usize) -> Option<(usize, usize)> {
        let origin = self.0.branches[branch].origin?;
        Some((origin.branch, origin.event))
    }

    /// The reason for which a branch ends.
    fn end(&self, branch: usize) -> &'static str {
        self.0.branches[branch].end.name()
    }

    /// Negative modes of every state of a branch.
    fn negative_modes(&self, branch: usize) -> Vec<usize> {
        let states = self.0.branches[branch].states.iter();
        states.map(|state| state.negative_modes).collect()
    }

    /// The events of a branch.
    fn events(&self, branch: usize) -> Vec<Event> {
        let event = |event: &core::Event| {
            let [before, after] = event.negative_modes;
            let snapped = event.snapped.as_ref().map(|snapped| {
                let equilibrium = snapped.equilibrium.clone();
                let scenario = Scenario(equilibrium.problem().clone());
                let parameter = self.0.path.parameter(snapped.place);
                let equilibrium = Equilibrium::of(|| equilibrium);
                let (jump, released) = (snapped.jump, snapped.released);
                (parameter, scenario, equilibrium, jump, released)
            });
            let parameter = self.0.path.parameter(event.place);
            (
                event.kind.name(),
                parameter,
                event.state,
                (before, after),
                event.confirmed,
                snapped,
            )
        };
        self.0.branches[branch].events.iter().map(event).collect()
    }

    /// The summaries of all states of a branch.
    ///
    /// Shapes: (m,) each, forces and moments (m, supports, 3); NaN where the belt is flat.
    /// Errors: those that a signal handler raises.
    fn report<'py>(&self, py: Python<'py>, branch: usize) -> PyResult<Report<'py>> {
        let states = 0..self.0.branches[branch].states.len();
        let mut signals = Signals::new();
        let summaries: Vec<Summary> = py.detach(|| {
            let going = states.take_while(|_| signals.proceed().is_continue());
            going.map(|state| self.0.summary(branch, state)).collect()
        });
        if let Some(error) = signals.raised {
            return Err(error);
        }
        let column = |of: fn(&Summary) -> f64| -> Scalars<'py> {
            summaries
                .iter()
                .map(of)
                .collect::<Vec<_>>()
                .into_pyarray(py)
        };
        let supports = summaries.first().map_or(0, |first| first.reactions.len());
        let wrenches = || summaries.iter().flat_map(|summary| &summary.reactions);
        Ok((
            column(|s| s.parameter),
            column(|s| s.energy),
            column(|s| s.height),
            array::grid(py, supports, wrenches().map(|wrench| wrench.force))?,
            array::grid(py, supports, wrenches().map(|wrench| wrench.moment))?,
            column(|s| s.least_bend_radius.unwrap_or(f64::NAN)),
            column(|s| s.least_spine_radius.unwrap_or(f64::NAN)),
            [
                column(|s| s.area_radii[0]),
                column(|s| s.area_radii[1]),
                column(|s| s.area_radii[2]),
            ],
            column(|s| s.rib_margin),
            summaries.iter().map(Summary::stable).collect(),
            summaries.iter().map(|s| s.status.name()).collect(),
            [
                column(|s| s.residuals.largest()),
                column(|s| s.error.unwrap_or(f64::NAN)),
            ],
        ))
    }

    /// Spine positions of all states of a branch, at the nodes of the state with the most nodes.
    ///
    /// Shapes: (n, 3) each.
    fn positions<'py>(&self, py: Python<'py>, branch: usize) -> Vec<Points<'py>> {
        let positions = py.detach(|| self.0.positions(branch));
        positions
            .iter()
            .map(|points| array::points(py, points))
            .collect()
    }

    /// The scenario and the equilibrium of a state.
    fn equilibrium(&self, py: Python<'_>, branch: usize, state: usize) -> (Scenario, Equilibrium) {
        py.detach(|| {
            let found = Equilibrium::of(|| self.0.equilibrium(branch, state));
            (Scenario(found.core().problem().clone()), found)
        })
    }
}
