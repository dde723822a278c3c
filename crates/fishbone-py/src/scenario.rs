//! `_core.Scenario`.

use fishbone::problem::Problem;
use fishbone::scenario;
use fishbone::scenario::error::ScenarioError;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A validated scenario: what is solved.
#[pyclass(frozen, module = "fishbone._core")]
pub(crate) struct Scenario(pub(crate) Problem);

#[pymethods]
impl Scenario {
    /// Reads a scenario file's text.
    ///
    /// Errors: `ValueError`, one line "field: found …, allowed …".
    #[staticmethod]
    fn from_toml(text: &str) -> PyResult<Self> {
        checked(scenario::Scenario::from_toml(text))
    }

    /// Reads the same structure as JSON.
    ///
    /// Errors: `ValueError`, one line "field: found …, allowed …".
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        checked(scenario::Scenario::from_json(text))
    }

    /// The scenario, normalised, as JSON.
    fn to_json(&self) -> String {
        self.0.scenario().to_json()
    }
}

fn checked(result: Result<scenario::Scenario, ScenarioError>) -> PyResult<Scenario> {
    result
        .and_then(Problem::new)
        .map(Scenario)
        .map_err(|error| PyValueError::new_err(error.to_string()))
}
