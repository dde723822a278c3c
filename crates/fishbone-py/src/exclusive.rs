//! A value on which one thread at a time works, with the GIL released.

use crate::signals::{SIGNAL_INTERVAL, Signals};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};

/// A value that a thread takes away to work on it, and brings back.
///
/// No lock is held meanwhile. Python code that runs during the work, such as the handler of a signal, may ask for the value and
/// gets an error. Other threads wait with the GIL released; Ctrl-C ends their wait.
pub(crate) struct Exclusive<T> {
    place: Mutex<Place<T>>,
    returned: Condvar,
}

/// Where the value is.
enum Place<T> {
    Here(T),
    With(ThreadId),
}

impl<T: Send> Exclusive<T> {
    pub(crate) fn new(value: T) -> Self {
        Self {
            place: Mutex::new(Place::Here(value)),
            returned: Condvar::new(),
        }
    }

    /// Works on the value with the GIL released; the work asks the signals whether to go on.
    ///
    /// Errors: those that a signal handler raises; `RuntimeError` where this very thread is at work on the value already.
    pub(crate) fn with<R: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut T, &mut Signals) -> R + Send,
    ) -> PyResult<R> {
        py.detach(|| {
            let mut signals = Signals::new();
            let mut value = self.take(&mut signals)?;
            // After a panic the value is brought back all the same: work that has panicked is not resumed.
            let result = catch_unwind(AssertUnwindSafe(|| work(&mut value, &mut signals)));
            *self.lock() = Place::Here(value);
            self.returned.notify_one();
            let result = result.unwrap_or_else(|panic| resume_unwind(panic));
            signals.raised.map_or(Ok(result), Err)
        })
    }

    /// Takes the value away, once it is here.
    fn take(&self, signals: &mut Signals) -> PyResult<T> {
        let own = thread::current().id();
        loop {
            let mut place = self.lock();
            match std::mem::replace(&mut *place, Place::With(own)) {
                Place::Here(value) => return Ok(value),
                Place::With(thread) if thread == own => {
                    return Err(PyRuntimeError::new_err(
                        "in use: this call was made while another one of this thread, on the same object, had not returned",
                    ));
                }
                Place::With(thread) => *place = Place::With(thread),
            }
            let waited = self.returned.wait_timeout(place, SIGNAL_INTERVAL);
            // The signals are asked without the lock: their handlers may use the object.
            drop(waited.unwrap_or_else(PoisonError::into_inner));
            if signals.proceed().is_break()
                && let Some(raised) = signals.raised.take()
            {
                return Err(raised);
            }
        }
    }

    fn lock(&self) -> MutexGuard<'_, Place<T>> {
        // Nothing that holds the lock can panic.
        self.place.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
