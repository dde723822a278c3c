//! What an update may take.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// What an update may take: time, iterations, both or neither. It begins to run when it is made.
#[derive(Debug, Clone, Copy)]
pub struct Budget {
    end: Option<Instant>,
    iterations: Option<usize>,
}

impl Budget {
    /// A budget of some time and of some iterations; `None` is no limit.
    pub fn new(time: Option<Duration>, iterations: Option<usize>) -> Self {
        Self {
            // A time that no clock reaches is no limit.
            end: time.and_then(|time| Instant::now().checked_add(time)),
            iterations,
        }
    }

    /// Takes one iteration more; `Break` where none is left.
    pub fn proceed(&mut self) -> ControlFlow<()> {
        let is_late = self.end.is_some_and(|end| Instant::now() >= end);
        if is_late || self.iterations == Some(0) {
            return ControlFlow::Break(());
        }
        self.iterations = self.iterations.map(|left| left - 1);
        ControlFlow::Continue(())
    }
}
