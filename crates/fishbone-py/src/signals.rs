//! Ctrl-C and other signals, while the GIL is released.

use pyo3::prelude::*;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Interval between checks for signals, in ms: short enough for Ctrl-C to feel immediate, long enough to cost nothing.
pub(crate) const SIGNAL_INTERVAL: Duration = Duration::from_millis(50);

/// Checks with Python, once an interval, whether a signal has arrived.
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

    /// Whether to go on, with a report to Python at every check.
    pub(crate) fn proceed_with(
        &mut self,
        report: impl FnOnce(Python<'_>) -> PyResult<()>,
    ) -> ControlFlow<()> {
        if self.raised.is_none() && self.asked.elapsed() >= SIGNAL_INTERVAL {
            self.asked = Instant::now();
            let asked = Python::attach(|py| {
                py.check_signals()?;
                report(py)
            });
            self.raised = asked.err();
        }
        match self.raised {
            Some(_) => ControlFlow::Break(()),
            None => ControlFlow::Continue(()),
        }
    }
}
