//! A value on which one thread at a time works, with the GIL released.

use crate::signals::Signals;
use crossbeam_utils::atomic::AtomicCell;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::process;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::{self, ThreadId};
use std::time::Duration;

/// A value that a thread takes away to work on it, and brings back.
///
/// There is no lock: a child made by `fork` at any moment would wait for one for ever. Python code that runs during the work,
/// such as the handler of a signal, may ask for the value and gets an error, and so does a child made during the work of
/// another thread. Other threads wait with the GIL released; Ctrl-C ends their wait.
pub(crate) struct Exclusive<T> {
    /// `None` while a thread works on the value.
    value: AtomicCell<Option<Box<T>>>,
    /// The thread that works on the value, and the process that it belongs to.
    thread: AtomicCell<Option<ThreadId>>,
    process: AtomicU32,
}

/// A value taken away, which is brought back at the end, also of work that panics.
struct Taken<'a, T> {
    value: Option<Box<T>>,
    from: &'a Exclusive<T>,
}

impl<T: Send> Exclusive<T> {
    pub(crate) fn new(value: T) -> Self {
        Self {
            value: AtomicCell::new(Some(Box::new(value))),
            thread: AtomicCell::new(None),
            process: AtomicU32::new(process::id()),
        }
    }

    /// Works on the value with the GIL released; the work asks the signals whether to go on. What is done `after` it has the GIL,
    /// and comes before the work of any other thread.
    ///
    /// Errors: those that a signal handler raises; `RuntimeError` where this very thread is at work on the value already, or
    /// where another one was when this process was made by `fork`.
    pub(crate) fn with<R: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut T, &mut Signals) -> R + Send,
        after: impl FnOnce(&T),
    ) -> PyResult<R> {
        let mut signals = Signals::new();
        let (taken, result) = py.detach(|| {
            let mut taken = self.take(&mut signals)?;
            let value = taken.value.as_mut().expect("it is brought back at the end");
            let result = work(value, &mut signals);
            PyResult::Ok((taken, result))
        })?;
        if let Some(value) = taken.value.as_deref() {
            after(value);
        }
        drop(taken);
        signals.raised.map_or(Ok(result), Err)
    }

    /// Takes the value away, once it is here.
    fn take(&self, signals: &mut Signals) -> PyResult<Taken<'_, T>> {
        /// Interval between looks for the value.
        const PATIENCE: Duration = Duration::from_micros(200);
        let own = thread::current().id();
        loop {
            if let Some(value) = self.value.take() {
                self.thread.store(Some(own));
                self.process.store(process::id(), Ordering::Relaxed);
                return Ok(Taken {
                    value: Some(value),
                    from: self,
                });
            }
            if self.process.load(Ordering::Relaxed) != process::id() {
                return Err(PyRuntimeError::new_err(
                    "lost: another thread was at work on this object when this process was made by fork; make a copy before",
                ));
            }
            if self.thread.load() == Some(own) {
                return Err(PyRuntimeError::new_err(
                    "in use: this call was made while another one of this thread, on the same object, had not returned",
                ));
            }
            thread::sleep(PATIENCE);
            // The handlers of signals may use the object.
            if signals.proceed().is_break()
                && let Some(raised) = signals.raised.take()
            {
                return Err(raised);
            }
        }
    }
}

impl<T> Drop for Taken<'_, T> {
    fn drop(&mut self) {
        self.from.thread.store(None);
        self.from.value.store(self.value.take());
    }
}
