//! Primal–dual interior-point minimisation: main loop.

mod barrier;
mod correction;
mod filter;
mod line_search;
mod primal_dual;
mod restoration;

pub use correction::{Correction, correct};
pub(crate) use primal_dual::PrimalDual;

use crate::larger;
use crate::layout::Layout;
use crate::linear::Inertia;
use crate::program::{Multipliers, Program, Stationary, Values};
use crate::scaled::Scaled;
use filter::{Filter, Measure};
use line_search::SecondOrderCorrection;
use restoration::Restoration;
use std::ops::ControlFlow;

/// Settings of the minimisation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Largest residual of a converged point.
    pub tolerance: f64,
    /// Largest count of iterations.
    pub iterations: usize,
    /// First barrier parameter, an objective per unit weight.
    pub barrier: f64,
    /// Longest step in the metric of the programme. Short steps lead to the nearest minimum downhill, infinite ones to a
    /// minimum in few iterations.
    pub longest_step: f64,
}

/// Why the minimisation ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// All residuals are within the tolerance.
    Converged,
    /// The iteration limit was reached.
    IterationLimit,
    /// The violation of the equalities cannot be lowered any further.
    LocallyInfeasible,
    /// The equalities hold, and no step decreases the merit by more than rounding.
    Stalled,
    /// The objective is not bounded below, or not finite.
    Unbounded,
    /// The start is outside the domain.
    Inadmissible,
    /// The caller interrupted.
    Interrupted,
}

/// Residuals of the first-order conditions, max-norms.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Residuals {
    /// Gradient of the Lagrangian by the unknowns, beyond what [rounding](Program::rounding) of the controls makes of it.
    pub stationarity: f64,
    /// Violation of the equalities.
    pub constraint: f64,
    /// Products of slacks and their multipliers.
    pub complementarity: f64,
}

impl Residuals {
    /// The largest residual; NaN where a residual is NaN.
    pub fn largest(&self) -> f64 {
        [self.stationarity, self.constraint, self.complementarity]
            .into_iter()
            .fold(0.0, larger)
    }
}

/// Result of a minimisation.
#[derive(Debug, Clone)]
pub struct Solution<P> {
    /// The last point, with its multipliers.
    pub at: Stationary<P>,
    /// Values at the point.
    pub values: Values,
    /// Residuals at the point.
    pub residuals: Residuals,
    /// Count of iterations.
    pub iterations: usize,
    /// Reason of the end.
    pub outcome: Outcome,
    /// Inertia of the second variation at the point; `None` where it is undecided.
    pub inertia: Option<Inertia>,
}

impl<P> Solution<P> {
    /// Whether the point has converged and no direction of negative curvature is known.
    pub fn is_minimum(&self) -> bool {
        let descends = self.inertia.is_some_and(|inertia| inertia.negative > 0);
        self.outcome == Outcome::Converged && !descends
    }

    /// The same result with the iterations of an earlier search added to its count.
    #[must_use]
    pub fn after(self, iterations: usize) -> Self {
        Self {
            iterations: self.iterations + iterations,
            ..self
        }
    }
}

/// Minimises a programme from a point of its domain. Residuals are within the tolerance; where the objective is small, also
/// beside its [size](Program::size), as far as rounding allows.
///
/// `proceed` is called once an iteration, and interrupts by `Break`.
pub fn minimise<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
    settings: &Settings,
    start: P::Point,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Solution<P::Point> {
    let mut interior_point = InteriorPoint::new(program, *settings, start);
    let outcome = interior_point.iterate(proceed);
    let barrier = interior_point.iterate.barrier.parameter;
    let found = interior_point.finish(outcome);
    if outcome != Outcome::Converged || settings.iterations <= found.iterations {
        return found;
    }
    match Scaled::of(program, &found.at.point) {
        None => found,
        Some(scaled) => {
            let settings = Settings {
                barrier: scaled.own_objective(barrier),
                iterations: settings.iterations - found.iterations,
                ..*settings
            };
            let (sharp, is_nearer) = sharpened(program, &scaled, &settings, &found.at, proceed);
            match sharp.outcome == Outcome::Converged || is_nearer {
                true => Solution {
                    outcome: Outcome::Converged,
                    ..sharp.after(found.iterations)
                },
                false => found.after(sharp.iterations),
            }
        }
    }
}

/// As [`minimise`] where the objective is not small. `passed` gets the solution of every barrier problem but the last, with
/// its barrier parameter, and interrupts by `Break`: from solutions near to each other two searches go the same way.
pub fn minimise_past<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
    settings: &Settings,
    start: P::Point,
    passed: &mut dyn FnMut(f64, &P::Point) -> ControlFlow<()>,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Solution<P::Point> {
    let mut interior_point = InteriorPoint::new(program, *settings, start);
    let outcome = interior_point.iterate_past(passed, proceed);
    interior_point.finish(outcome)
}

/// A minimum found from a stationary point nearby, with its multipliers, and from nowhere else: in the units of what the
/// objective is there where it is small, as [`minimise`] ends.
///
/// `proceed` is called once an iteration, and interrupts by `Break`.
pub fn minimise_near<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
    settings: &Settings,
    near: &Stationary<P::Point>,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Solution<P::Point> {
    match Scaled::of(program, &near.point) {
        None => {
            let mut interior_point = InteriorPoint::new(program, *settings, near.point.clone());
            interior_point.start_from(&near.multipliers);
            let outcome = interior_point.iterate(proceed);
            interior_point.finish(outcome)
        }
        Some(scaled) => sharpened(program, &scaled, settings, near, proceed).0,
    }
}

/// The minimum near to a stationary point, found in the units of what the objective is there, in which `settings` are; and
/// whether its residuals are smaller in these units than at the start, and within the tolerance in the programme's own.
fn sharpened<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
    scaled: &Scaled<&P>,
    settings: &Settings,
    near: &Stationary<P::Point>,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> (Solution<P::Point>, bool) {
    let mut interior_point = InteriorPoint::new(scaled, *settings, near.point.clone());
    interior_point.iterate.kkt.is_rigid = true;
    interior_point.start_from(&scaled.own(near).multipliers);
    let before = interior_point.iterate.residuals().largest();
    if before > settings.tolerance {
        interior_point.iterate.find_multipliers();
    }
    let outcome = interior_point.iterate(proceed);
    let found = interior_point.finish(outcome);
    let at = Stationary {
        multipliers: scaled.multipliers_of_original(&found.at.multipliers),
        point: found.at.point,
    };
    let known = assess(program, settings.tolerance, &at);
    let is_within = known.outcome == Outcome::Converged;
    let sharp = Solution {
        iterations: found.iterations,
        outcome: match found.outcome {
            Outcome::Converged if !is_within => Outcome::Stalled,
            outcome => outcome,
        },
        ..known
    };
    (sharp, is_within && found.residuals.largest() < before)
}

/// Residuals and inertia of a given stationary point.
pub fn assess<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
    tolerance: f64,
    at: &Stationary<P::Point>,
) -> Solution<P::Point> {
    let settings = Settings {
        tolerance,
        iterations: 0,
        barrier: 0.0,
        longest_step: f64::INFINITY,
    };
    let mut interior_point = InteriorPoint::new(program, settings, at.point.clone());
    interior_point.start_from(&at.multipliers);
    let outcome = match interior_point.iterate.residuals().largest() <= tolerance {
        true => Outcome::Converged,
        false => Outcome::IterationLimit,
    };
    let assessed = interior_point.finish(outcome);
    match Scaled::of(program, &assessed.at.point) {
        None => assessed,
        Some(scaled) => {
            let at = scaled.own(&assessed.at);
            let mut interior_point = InteriorPoint::new(&scaled, settings, at.point);
            interior_point.start_from(&at.multipliers);
            Solution {
                inertia: interior_point.iterate.inertia(),
                ..assessed
            }
        }
    }
}

/// Depth of an objective that is unbounded below; in [`Scales::objective`](crate::Scales::objective). Also the damping beyond
/// which a programme counts as unbounded; second derivative per unit weight.
const UNBOUNDED: f64 = 1e12;
/// Damping beyond which multipliers of violated equalities have run away, so that restoration begins with none; second
/// derivative per unit weight.
const RUNAWAY: f64 = 1e6;

/// A minimisation under way.
struct InteriorPoint<'a, P: Program<X, U, N>, const X: usize, const U: usize, const N: usize> {
    iterate: PrimalDual<&'a P, X, U, N>,
    settings: Settings,
    /// Layout, by whose blocks the violation of the equalities is summed.
    layout: Layout,
    bottom: f64,
    filter: Filter,
    correction: SecondOrderCorrection<N>,
    iteration: usize,
    admissible: bool,
    interrupted: bool,
    /// Whether the last step was under drag, so that no residual need fall.
    is_creeping: bool,
    /// Drag of the last step.
    drag: f64,
    progress: Progress,
}

/// How long the residual has not fallen since the barrier is at its least.
#[derive(Debug, Clone, Copy)]
struct Progress {
    /// Least residual, and the count of iterations since it was found.
    least: f64,
    since: usize,
}

impl Progress {
    const NONE: Self = Self {
        least: f64::INFINITY,
        since: 0,
    };

    /// Takes in the residual of one more iteration; false where rounding keeps it from falling any further.
    fn goes_on(&mut self, residual: f64) -> bool {
        /// Ratio of residuals below which the residual has fallen, dimensionless.
        const FALLEN: f64 = 0.5;
        /// Count of iterations within which it must fall, a number.
        const PATIENCE: usize = 50;
        self.since += 1;
        if residual < FALLEN * self.least {
            *self = Self {
                least: residual,
                since: 0,
            };
        }
        self.since < PATIENCE
    }
}

impl<'a, P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>
    InteriorPoint<'a, P, X, U, N>
{
    fn new(program: &'a P, settings: Settings, start: P::Point) -> Self {
        let (iterate, admissible) = PrimalDual::new(program, settings.barrier, start);
        let layout = iterate.kkt.layout().clone();
        Self {
            bottom: -UNBOUNDED * program.scales().objective,
            filter: Filter::new(violation(&layout, &iterate.values)),
            correction: SecondOrderCorrection::new(&layout),
            layout,
            iterate,
            settings,
            iteration: 0,
            admissible,
            interrupted: false,
            is_creeping: false,
            drag: 0.0,
            progress: Progress::NONE,
        }
    }

    /// Starts with multipliers in place of those on the central path.
    fn start_from(&mut self, multipliers: &Multipliers) {
        self.iterate.multipliers.clone_from(multipliers);
        self.iterate.linearise();
    }

    fn iterate(&mut self, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> Outcome {
        self.iterate_past(&mut |_, _| ControlFlow::Continue(()), proceed)
    }

    /// Iterates, and tells the solution of every barrier problem, with the parameter of its barrier.
    fn iterate_past(
        &mut self,
        passed: &mut dyn FnMut(f64, &P::Point) -> ControlFlow<()>,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Outcome {
        if !self.admissible {
            return Outcome::Inadmissible;
        }
        loop {
            let residuals = self.iterate.residuals();
            if residuals.largest() <= self.settings.tolerance {
                return Outcome::Converged;
            }
            if self.iterate.values.objective < self.bottom {
                return Outcome::Unbounded;
            }
            if self.iteration >= self.settings.iterations {
                return Outcome::IterationLimit;
            }
            if self.is_interrupted(proceed) {
                return Outcome::Interrupted;
            }
            let barrier = self.iterate.barrier.parameter;
            if self
                .iterate
                .lower_barrier(&residuals, self.settings.tolerance)
            {
                if passed(barrier, &self.iterate.point).is_break() {
                    return Outcome::Interrupted;
                }
                self.filter.clear();
                self.progress = Progress::NONE;
            }
            let is_least = self.iterate.is_barrier_least(self.settings.tolerance);
            if is_least && !self.is_creeping && !self.progress.goes_on(residuals.largest()) {
                return Outcome::Stalled;
            }
            self.iterate.assemble();
            let is_feasible =
                violation(&self.layout, &self.iterate.values) <= self.settings.tolerance;
            let most_damping = if is_feasible { UNBOUNDED } else { RUNAWAY };
            let is_convex = self.iterate.kkt.factorise(most_damping).is_ok();
            if !is_convex && is_feasible {
                return Outcome::Unbounded;
            }
            if !(is_convex && self.descends())
                && let Some(outcome) = self.recover(proceed)
            {
                return outcome;
            }
            self.iterate.linearise();
            self.iteration += 1;
        }
    }

    /// Goes along the Newton step as far as the filter accepts; false where no length is accepted.
    fn descends(&mut self) -> bool {
        self.iterate.find_rigid_step();
        self.is_creeping = self.drag_step();
        self.search()
    }

    /// Adds drag, a multiple of the metric, to the second derivative until it is convex and the step no longer than the longest
    /// step; gives whether drag was needed.
    fn drag_step(&mut self) -> bool {
        /// First drag, and the drag beyond which a step is taken as it is; second derivative in the metric.
        const DRAGS: [f64; 2] = [1.0, 1e9];
        /// Least ratio of successive drags; dimensionless.
        const STRONGER: f64 = 2.0;
        /// Ratio of the last drag to the first that is tried after it; dimensionless.
        const WEAKER: f64 = 4.0;
        let longest = self.settings.longest_step;
        if longest.is_infinite() {
            return false;
        }
        let iterate = &mut self.iterate;
        let metric = iterate.program.metric(&iterate.point);
        let (mut drag, known) = (0.0, self.drag / WEAKER);
        loop {
            let excess = iterate.kkt.step_length(&metric) / longest;
            if drag > DRAGS[1] || (excess <= 1.0 && !iterate.kkt.is_damped()) {
                self.drag = drag;
                return drag > 0.0;
            }
            let more = (drag * excess.max(STRONGER)).max(DRAGS[0]).max(known);
            iterate.kkt.shift(&metric, drag - more);
            drag = more;
            if iterate.kkt.factorise(UNBOUNDED).is_err() {
                return true;
            }
            iterate.find_rigid_step();
        }
    }

    /// Whether the caller has interrupted, now or before.
    fn is_interrupted(&mut self, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> bool {
        self.interrupted = self.interrupted || proceed().is_break();
        self.interrupted
    }

    /// Continues after a failed line search: by restoration where equalities are violated, else with an empty filter. Gives
    /// an outcome where both fail.
    fn recover(&mut self, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> Option<Outcome> {
        if violation(&self.layout, &self.iterate.values) > self.settings.tolerance {
            return (!self.restore(proceed)).then_some(Outcome::LocallyInfeasible);
        }
        if self.filter.is_empty() {
            return Some(Outcome::Stalled);
        }
        self.filter.clear();
        self.iterate.centre();
        None
    }

    /// Feasibility restoration: steps of least length toward the equalities until the filter accepts the point; false where
    /// no step lowers the violation of the equalities.
    fn restore(&mut self, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> bool {
        /// Share of the violation that is left where restoration may end; dimensionless.
        const VIOLATION_LEFT: f64 = 0.1;
        let left = self.measure(&self.iterate.values);
        self.filter.leave(left);
        self.iterate.multipliers.equalities.fill(0.0);
        let mut restoration = Restoration::new(&self.layout);
        while self.iteration < self.settings.iterations && !self.is_interrupted(proceed) {
            self.iteration += 1;
            self.iterate.centre();
            if !restoration.step(&mut self.iterate) {
                self.iterate.linearise();
                return false;
            }
            let now = self.measure(&self.iterate.values);
            if now.violation <= VIOLATION_LEFT * left.violation && self.filter.admits(now) {
                self.iterate.centre();
                return true;
            }
        }
        true
    }

    fn finish(mut self, outcome: Outcome) -> Solution<P::Point> {
        self.prefer_zero_multipliers();
        let residuals = self.iterate.residuals();
        let inertia = self.iterate.inertia();
        Solution {
            residuals,
            at: Stationary {
                point: self.iterate.point,
                multipliers: self.iterate.multipliers,
            },
            values: self.iterate.values,
            iterations: self.iteration,
            outcome,
            inertia,
        }
    }

    /// Sets the equalities' multipliers to zero where the point is stationary without them: multipliers of redundant
    /// equalities are not unique.
    ///
    /// A loose tolerance does not apply here: it would drop small multipliers that are unique.
    fn prefer_zero_multipliers(&mut self) {
        /// Stationarity residual at which the multipliers of the equalities are zero; in the unit of the gradient, or as a
        /// share of the programme's size where that is smaller.
        const NEGLIGIBLE: f64 = 1e-8;
        let iterate = &mut self.iterate;
        let size = iterate.program.size(&iterate.point) / iterate.program.scales().objective;
        let share = if size > 0.0 { size.min(1.0) } else { 1.0 };
        let negligible = share * NEGLIGIBLE.min(self.settings.tolerance);
        if iterate.stationarity_without_equalities() <= negligible {
            iterate.multipliers.equalities.fill(0.0);
            iterate.linearise();
        }
    }

    /// Violation and barrier function of values.
    fn measure(&self, values: &Values) -> Measure {
        Measure {
            violation: violation(&self.layout, values),
            merit: self.iterate.barrier.merit(values),
        }
    }
}

/// 1-norm of the equalities' violation.
fn violation(layout: &Layout, values: &Values) -> f64 {
    let of_block = |rows: std::ops::Range<usize>| {
        let rows = values.equalities.get(rows).unwrap_or_default();
        rows.iter().fold(0.0, |sum, value| sum + value.abs())
    };
    layout.equality_blocks().map(of_block).sum()
}
