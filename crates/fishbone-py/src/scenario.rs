//! `_core.Scenario`.

use crate::errors::invalid_scenario;
use fishbone::problem::Problem;
use fishbone::scenario;
use fishbone::scenario::error::ScenarioError;
use pyo3::prelude::*;
use pyo3::types::PyString;

/// A validated scenario, ready to be solved.
#[pyclass(frozen, module = "fishbone._core")]
pub(crate) struct Scenario(pub(crate) Problem);

#[pymethods]
impl Scenario {
    /// Reads a scenario file's text.
    ///
    /// Errors: `InvalidScenario`, one line "field: found …, allowed …" after the file's name, if there is one.
    #[staticmethod]
    #[pyo3(signature = (text, file=None))]
    fn from_toml(py: Python<'_>, text: &str, file: Option<&Bound<'_, PyString>>) -> PyResult<Self> {
        checked(py, scenario::Scenario::from_toml(text), file)
    }

    /// Reads a scenario in JSON, of the same structure.
    ///
    /// Errors: those of `from_toml`.
    #[staticmethod]
    #[pyo3(signature = (text, file=None))]
    fn from_json(py: Python<'_>, text: &str, file: Option<&Bound<'_, PyString>>) -> PyResult<Self> {
        checked(py, scenario::Scenario::from_json(text), file)
    }

    /// Whether the material is given in SI units, so that all numbers are.
    #[getter]
    fn is_in_si_units(&self) -> bool {
        self.0.scenario().belt.is_in_si_units()
    }

    /// The scenario, normalised, as JSON.
    fn to_json(&self) -> String {
        self.0.scenario().to_json()
    }
}

fn checked(
    py: Python<'_>,
    result: Result<scenario::Scenario, ScenarioError>,
    file: Option<&Bound<'_, PyString>>,
) -> PyResult<Scenario> {
    result
        .and_then(Problem::new)
        .map(Scenario)
        .map_err(|error| invalid_scenario(py, &error, file))
}
