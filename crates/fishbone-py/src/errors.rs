//! The exceptions of `fishbone.errors`, made of the core's errors: their text, and their data as attributes.

use fishbone::analysis::continuation::NoBranch;
use fishbone::analysis::margin::NoMargin;
use fishbone::analysis::modes::NoModes;
use fishbone::analysis::path::NoPath;
use fishbone::analysis::sensitivity::NoSensitivity;
use fishbone::analysis::tracking::NoTracker;
use fishbone::equilibrium::Uncertified;
use fishbone::names::Named;
use fishbone::scenario::error::ScenarioError;
use pyo3::prelude::*;
use pyo3::type_object::PyTypeInfo;
use pyo3::types::{PyString, PyTuple};
use std::error::Error;

/// The exception classes. Python defines them, for users to find them there.
pub(crate) mod exception {
    pyo3::import_exception!(fishbone.errors, InvalidArgument);
    pyo3::import_exception!(fishbone.errors, InvalidScenario);
    pyo3::import_exception!(fishbone.errors, NoBranch);
    pyo3::import_exception!(fishbone.errors, NoMargin);
    pyo3::import_exception!(fishbone.errors, NoModes);
    pyo3::import_exception!(fishbone.errors, NoPath);
    pyo3::import_exception!(fishbone.errors, NoSensitivity);
    pyo3::import_exception!(fishbone.errors, NoTracker);
}

/// An error of the core that is an exception of its own in Python.
pub(crate) trait Refusal: Error + Named {
    /// Class of the exception.
    type Exception: PyTypeInfo;

    /// Sets the attributes that not every error of the class has; the exception class declares their names.
    fn describe(&self, exception: &Bound<'_, PyAny>) -> PyResult<()>;
}

/// The exception that is raised for an error.
pub(crate) fn raised(py: Python<'_>, error: &impl Refusal) -> PyErr {
    let text = PyString::new(py, &error.to_string());
    match exception(error, text.into_any()) {
        Ok(exception) => PyErr::from_value(exception),
        Err(failure) => failure,
    }
}

/// The exception for an invalid scenario, in one line, which begins with the file's name if there is one.
pub(crate) fn invalid_scenario(
    py: Python<'_>,
    error: &ScenarioError,
    file: Option<&Bound<'_, PyString>>,
) -> PyErr {
    let made = || {
        let text = error.to_string();
        let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
        let text = match file {
            // Added by Python: the name of a file need not be Unicode.
            Some(file) => file.add(format!(": {line}"))?,
            None => PyString::new(py, &line).into_any(),
        };
        let exception = exception(error, text)?;
        exception.setattr("file", file)?;
        Ok(exception)
    };
    match made() {
        Ok(exception) => PyErr::from_value(exception),
        Err(failure) => failure,
    }
}

fn exception<'py, R: Refusal>(error: &R, text: Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let class = text.py().get_type::<R::Exception>();
    let exception = class.call1((text,))?;
    exception.setattr("reason", error.name())?;
    error.describe(&exception)?;
    Ok(exception)
}

impl Refusal for ScenarioError {
    type Exception = exception::InvalidScenario;

    fn describe(&self, exception: &Bound<'_, PyAny>) -> PyResult<()> {
        exception.setattr("field", self.field())?;
        match self {
            Self::Syntax { line, column, .. } => {
                exception.setattr("line", line)?;
                exception.setattr("column", column)
            }
            Self::UnknownField {
                nearest, allowed, ..
            } => choices(exception, nearest.as_deref(), allowed),
            Self::UnknownChoice {
                found,
                nearest,
                allowed,
                ..
            } => {
                exception.setattr("found", found)?;
                choices(exception, nearest.as_deref(), allowed)
            }
            Self::Invalid { found, allowed, .. } => {
                exception.setattr("found", found)?;
                exception.setattr("allowed", allowed)
            }
            _ => Ok(()),
        }
    }
}

/// A closed list of words, and which of them was probably meant.
fn choices(
    exception: &Bound<'_, PyAny>,
    nearest: Option<&str>,
    allowed: &[String],
) -> PyResult<()> {
    exception.setattr("nearest", nearest)?;
    exception.setattr("allowed", allowed.join(", "))?;
    exception.setattr("choices", PyTuple::new(exception.py(), allowed)?)
}

impl Refusal for NoPath {
    type Exception = exception::NoPath;

    fn describe(&self, exception: &Bound<'_, PyAny>) -> PyResult<()> {
        match self {
            Self::NoNumber { field, found, .. } => {
                exception.setattr("field", field)?;
                exception.setattr("found", found)
            }
            Self::NotClamped(support) => exception.setattr("support", support),
            Self::Invalid(error) => {
                exception.setattr("field", error.field())?;
                match error {
                    ScenarioError::Invalid { found, allowed, .. } => {
                        exception.setattr("found", found)?;
                        exception.setattr("allowed", allowed)
                    }
                    _ => Ok(()),
                }
            }
            _ => Ok(()),
        }
    }
}

impl Refusal for NoBranch {
    type Exception = exception::NoBranch;

    fn describe(&self, exception: &Bound<'_, PyAny>) -> PyResult<()> {
        match self {
            Self::Uncertified(uncertified) => solve_message(uncertified, exception),
            _ => Ok(()),
        }
    }
}

impl Refusal for NoMargin {
    type Exception = exception::NoMargin;

    fn describe(&self, exception: &Bound<'_, PyAny>) -> PyResult<()> {
        match self {
            Self::Uncertified(uncertified) => solve_message(uncertified, exception),
            Self::NoBranch(inner) => inner.describe(exception),
            Self::NoPath(inner) => inner.describe(exception),
            Self::NotClamped(support) => exception.setattr("support", support),
            Self::Lost(share) => exception.setattr("share", share),
            _ => Ok(()),
        }
    }
}

impl Refusal for NoTracker {
    type Exception = exception::NoTracker;

    fn describe(&self, exception: &Bound<'_, PyAny>) -> PyResult<()> {
        match self {
            Self::Uncertified(uncertified) => solve_message(uncertified, exception),
            Self::NotHeld(support) | Self::NoSupport(support) => {
                exception.setattr("support", support)
            }
            _ => Ok(()),
        }
    }
}

impl Refusal for NoSensitivity {
    type Exception = exception::NoSensitivity;

    fn describe(&self, exception: &Bound<'_, PyAny>) -> PyResult<()> {
        match self {
            Self::Uncertified(uncertified) => solve_message(uncertified, exception),
            Self::Redundant(names) => exception.setattr("redundant", names),
            _ => Ok(()),
        }
    }
}

impl Refusal for NoModes {
    type Exception = exception::NoModes;

    fn describe(&self, exception: &Bound<'_, PyAny>) -> PyResult<()> {
        match self {
            Self::Uncertified(uncertified) => solve_message(uncertified, exception),
            _ => Ok(()),
        }
    }
}

/// Sets the message of a solve that has not converged.
fn solve_message(uncertified: &Uncertified, exception: &Bound<'_, PyAny>) -> PyResult<()> {
    match uncertified {
        Uncertified::NotConverged { message } => exception.setattr("solve_message", message),
        _ => Ok(()),
    }
}
