//! `_core.Scenario`.

use fishbone::error::ScenarioError;
use fishbone::scenario;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A checked scenario.
#[pyclass(frozen, module = "fishbone._core")]
pub(crate) struct Scenario(pub(crate) scenario::Scenario);

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
        self.0.to_json()
    }
}

fn checked(result: Result<scenario::Scenario, ScenarioError>) -> PyResult<Scenario> {
    result
        .map(Scenario)
        .map_err(|error| PyValueError::new_err(error.to_string()))
}
