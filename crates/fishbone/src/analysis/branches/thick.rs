//! All equilibria of a strip of finite thickness.

use super::{SearchSettings, Watch, branches};
use crate::equilibrium::{Equilibrium, Status, shell};
use crate::problem::Problem;

/// The minima of a strip of finite thickness next to those of the developable one, rising in energy.
pub(super) fn branches_of_thick(
    problem: &Problem,
    settings: &SearchSettings,
    run: &super::Run,
    watch: &dyn Watch,
) -> Vec<Equilibrium> {
    /// Displacement up to which two minima are one, in U.
    const SAME: f64 = 1e-3;
    let developable = branches(&shell::as_developable(problem), settings, run, watch);
    let proceed = &mut || watch.proceed();
    let mut found: Vec<Equilibrium> = Vec::new();
    for start in developable {
        if start.stable() == Some(false) {
            continue;
        }
        let next = shell::next_to(problem, start, proceed);
        let is_new = |known: &Equilibrium| known.displacement(&next) > SAME;
        if next.status == Status::Converged && found.iter().all(is_new) {
            found.push(next);
        }
    }
    if found.is_empty() {
        found.push(crate::solve::solve(problem, proceed));
    }
    found.sort_by(|a, b| a.energy.total_cmp(&b.energy));
    found
}
