//! Results as bytes: what `pickle` writes of them.

use crate::errors::exception::InvalidArgument;
use fishbone::io::stored::{NotStored, Stored};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// The function that makes a value anew, and its arguments: what `pickle` and `copy` make of the value.
pub(crate) type Reduced<'py, Arguments = (Bound<'py, PyBytes>,)> = (Bound<'py, PyAny>, Arguments);

/// The bytes of a result; written with the GIL released.
///
/// Errors: `InvalidArgument` of what cannot be stored.
pub(crate) fn to_bytes<'py>(
    py: Python<'py>,
    result: &(impl Stored + Sync),
) -> PyResult<Bound<'py, PyBytes>> {
    let bytes = py.detach(|| result.to_bytes());
    Ok(PyBytes::new(py, &bytes.map_err(refused)?))
}

/// The result of bytes; read with the GIL released.
///
/// Errors: `InvalidArgument` of other bytes.
pub(crate) fn from_bytes<T: Stored + Send>(py: Python<'_>, bytes: &[u8]) -> PyResult<T> {
    py.detach(|| T::from_bytes(bytes)).map_err(refused)
}

/// The exception of bytes that hold no such result.
pub(crate) fn refused(error: NotStored) -> PyErr {
    InvalidArgument::new_err(format!("state: {error}"))
}
