//! `_core.names`.

use fishbone::analysis::continuation::{End, Kind, NoBranch};
use fishbone::analysis::margin::NoMargin;
use fishbone::analysis::modes::NoModes;
use fishbone::analysis::path::{Motion, NoPath};
use fishbone::analysis::sensitivity::NoSensitivity;
use fishbone::analysis::tracking::NoTracker;
use fishbone::equilibrium::Status;
use fishbone::names::Named;
use fishbone::scenario::error::ScenarioError;
use fishbone::scenario::{Axis, EnergyModel, Method};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// The core's names: of the variants in scenarios and results, and, by exception, of the reasons for which it is raised.
#[pyfunction]
pub(crate) fn names(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let lists = [
        ("Status", Status::names()),
        ("EnergyModel", EnergyModel::names()),
        ("Method", Method::names()),
        ("Axis", Axis::names()),
        ("Motion", Motion::names()),
        ("Kind", Kind::names()),
        ("End", End::names()),
        ("InvalidScenario", ScenarioError::names()),
        ("NoBranch", NoBranch::names()),
        ("NoMargin", NoMargin::names()),
        ("NoModes", NoModes::names()),
        ("NoPath", NoPath::names()),
        ("NoSensitivity", NoSensitivity::names()),
        ("NoTracker", NoTracker::names()),
    ];
    let dict = PyDict::new(py);
    for (list, names) in lists {
        dict.set_item(list, PyTuple::new(py, names)?)?;
    }
    Ok(dict)
}
