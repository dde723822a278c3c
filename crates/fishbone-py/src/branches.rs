//! `_core.branches`.

use crate::equilibrium::Equilibrium;
use crate::scenario::Scenario;
use crate::signals::SIGNAL_INTERVAL;
use crate::threads::pool;
use fishbone::analysis::branches::{self as core, SearchSettings, Watch};
use pyo3::prelude::*;
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

/// Progress of the search, and whether the search is to end.
#[derive(Default)]
struct Counter {
    done: AtomicUsize,
    planned: AtomicUsize,
    stop: AtomicBool,
}

impl Watch for Counter {
    fn proceed(&self) -> ControlFlow<()> {
        match self.stop.load(Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }

    fn report(&self, done: usize, planned: usize) {
        // In this order a reader never sees more tasks done than planned.
        self.planned.fetch_max(planned, Ordering::SeqCst);
        self.done.fetch_max(done, Ordering::SeqCst);
    }
}

/// Finds the equilibria of a scenario over all cores with the GIL released; `progress(done, planned)` is called now and then
/// from the calling thread.
///
/// `budget` is the greatest numbers of sums of waves to start from, of minima to perturb and of equilibria to continue,
/// where they are to be fewer than the defaults: a search of moments, which may miss some equilibria.
///
/// Errors: those that `progress` or a signal handler raises; the search then ends. `RuntimeError` where the system gives no
/// threads.
#[pyfunction]
#[pyo3(signature = (scenario, progress=None, budget=None))]
pub(crate) fn branches(
    py: Python<'_>,
    scenario: &Scenario,
    progress: Option<Py<PyAny>>,
    budget: Option<(usize, usize, usize)>,
) -> PyResult<Vec<Equilibrium>> {
    let mut settings = SearchSettings::default();
    if let Some((sums, perturbed, continued)) = budget {
        settings.sums = sums;
        settings.perturbed = perturbed;
        settings.continued = continued;
    }
    let counter = Counter::default();
    let pool = pool()?;
    py.detach(|| {
        thread::scope(|scope| {
            let search = scope.spawn(|| {
                let run = |count: usize, task: &(dyn Fn(usize) + Sync)| {
                    pool.install(|| (0..count).into_par_iter().for_each(task));
                };
                core::branches(&scenario.0, &settings, &run, &counter)
            });
            let mut waited = Ok(());
            while waited.is_ok() && !search.is_finished() {
                thread::park_timeout(SIGNAL_INTERVAL);
                waited = report_progress(&counter, progress.as_ref());
            }
            counter.stop.store(waited.is_err(), Ordering::Relaxed);
            let found = search.join();
            waited.map(|()| {
                let found = found.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
                found
                    .into_iter()
                    .map(|found| Equilibrium::of(|| found))
                    .collect()
            })
        })
    })
}

fn report_progress(counter: &Counter, progress: Option<&Py<PyAny>>) -> PyResult<()> {
    let [done, planned] = [&counter.done, &counter.planned].map(|n| n.load(Ordering::SeqCst));
    Python::attach(|py| {
        py.check_signals()?;
        match progress {
            Some(progress) => progress.call1(py, (done, planned)).map(drop),
            None => Ok(()),
        }
    })
}
