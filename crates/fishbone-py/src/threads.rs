//! Threads for the solves of one call.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// One thread a core, or as many as the environment variable `RAYON_NUM_THREADS` says. They end with the pool: a child made by
/// `fork` after the call would wait for them for ever.
///
/// Errors: `RuntimeError` where the system gives no more threads.
pub(crate) fn pool() -> PyResult<ThreadPool> {
    ThreadPoolBuilder::new()
        .build()
        .map_err(|error| PyRuntimeError::new_err(error.to_string()))
}
