//! Ctrl-C and other signals, while the GIL is released.

use pyo3::prelude::*;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Short enough for Ctrl-C to feel immediate, long enough to cost nothing.
pub(crate) const SIGNAL_INTERVAL: Duration = Duration::from_millis(50);

/// Asks Python now and then whether a signal has arrived.
pub(crate) struct Signals {
    asked: Instant,
    pub(crate) raised: Option<PyErr>,
}

impl Signals {
    pub(crate) fn new() -> Self {
        Self {
            asked: Instant::now(),
            raised: None,
        }
    }

    pub(crate) fn proceed(&mut self) -> ControlFlow<()> {
        self.proceed_with(|_| Ok(()))
    }

    /// The same, with something to be told to Python whenever it is asked.
    pub(crate) fn proceed_with(
        &mut self,
        tell: impl FnOnce(Python<'_>) -> PyResult<()>,
    ) -> ControlFlow<()> {
        if self.raised.is_none() && self.asked.elapsed() >= SIGNAL_INTERVAL {
            self.asked = Instant::now();
            let asked = Python::attach(|py| {
                py.check_signals()?;
                tell(py)
            });
            self.raised = asked.err();
        }
        match self.raised {
            Some(_) => ControlFlow::Break(()),
            None => ControlFlow::Continue(()),
        }
    }
}
