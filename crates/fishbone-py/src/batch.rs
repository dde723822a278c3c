//! Many solves at once, over all cores.

use crate::equilibrium::Equilibrium;
use crate::scenario::Scenario;
use crate::signals::SIGNAL_INTERVAL;
use crate::threads::pool;
use pyo3::prelude::*;
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;

/// Solves scenarios with the GIL released, in the order given; `progress(solved, all)` is called from the calling thread.
///
/// Errors: those that `progress` or a signal handler raises; the solves then end. `RuntimeError` where the system gives no
/// threads.
#[pyfunction]
#[pyo3(signature = (scenarios, progress=None))]
pub(crate) fn solve_many(
    py: Python<'_>,
    scenarios: Vec<Py<Scenario>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<Equilibrium>> {
    let stop = AtomicBool::new(false);
    let proceed = || match stop.load(Ordering::Relaxed) {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    };
    let solve = |scenario: &Py<Scenario>| Equilibrium::timed(&scenario.get().0, &mut || proceed());
    let pool = pool()?;
    py.detach(|| {
        thread::scope(|scope| {
            let (sender, solved) = channel();
            let all = scenarios.len();
            let scenarios = scenarios.as_slice();
            let pool = &pool;
            let solves = scope.spawn(move || {
                let outcomes = scenarios.par_iter().map_with(sender, |sender, scenario| {
                    let found = proceed().is_continue().then(|| solve(scenario));
                    // The receiver is gone once an error has ended the wait.
                    let _ = sender.send(());
                    found
                });
                pool.install(|| outcomes.collect::<Option<_>>())
            });
            let waited = wait(&solved, all, progress.as_ref());
            stop.store(waited.is_err(), Ordering::Relaxed);
            let found = solves.join();
            let found = found.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            waited.map(|()| found.unwrap_or_default())
        })
    })
}

/// Waits until all scenarios are solved; meanwhile reports progress to Python and checks for signals.
fn wait(solved: &Receiver<()>, all: usize, progress: Option<&Py<PyAny>>) -> PyResult<()> {
    let mut count = 0;
    loop {
        let news = solved.recv_timeout(SIGNAL_INTERVAL);
        if news == Err(RecvTimeoutError::Disconnected) {
            return Ok(());
        }
        count += usize::from(news.is_ok()) + solved.try_iter().count();
        Python::attach(|py| {
            py.check_signals()?;
            match progress {
                Some(progress) if news.is_ok() => progress.call1(py, (count, all)).map(drop),
                _ => Ok(()),
            }
        })?;
    }
}
