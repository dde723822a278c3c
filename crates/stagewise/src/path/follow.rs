//! Predictor–corrector: follows a minimum while its programme changes. The predictor uses the last factorisation, the
//! corrector is Newton's method. Steps that might lead to another minimum are refused, and the loss of a minimum is reported.
//!
//! At a marginal minimum, along a direction of which the objective does not change, Newton's method is damped: its steps leave
//! this direction as it is.

use crate::interior_point::{Outcome, PrimalDual, Residuals, Settings, Solution, minimise};
use crate::linear::Inertia;
use crate::linear::chain::NodeVector;
use crate::program::{Distance, Multipliers, Program, Stationary, Values};
use std::ops::ControlFlow;

/// Report on a minimum that was followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Followed {
    /// Count of Newton steps.
    pub iterations: usize,
    /// Residuals at the end.
    pub residuals: Residuals,
    /// Distance of the largest jump to another minimum where the minimum was lost on the way; 0 without a jump.
    pub jump: f64,
    /// Fall of the objective in all jumps.
    pub released: f64,
    /// Whether the end of the way was reached.
    pub arrived: bool,
    /// Share of the way up to which the minimum was followed: the programme and the point are there.
    pub reached: f64,
}

/// A minimum with the work arrays to follow it. Nothing is allocated on the way but where constraints between pairs have second
/// derivatives, or hold directions along which the rest of the programme is concave.
#[derive(Clone)]
pub struct Follower<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize> {
    iterate: PrimalDual<P, X, U, N>,
    settings: FollowSettings,
    /// The last minimum on the way.
    last: Stationary<P::Point>,
    /// The minimum to return to, and the damping there.
    first: (Stationary<P::Point>, f64),
    /// Room for the gradients of the equalities at nodes.
    gradients: Vec<NodeVector<N>>,
    next_stride: NextStride,
}

/// How a follower goes on from its minimum.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct NextStride {
    /// Length of the stride with which a way that was interrupted goes on; `None`: that of the whole way.
    length: Option<f64>,
    /// Damping of Newton's method, of the controls per unit weight: 0 at a strict minimum.
    damping: f64,
}

/// Settings of a follower.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FollowSettings {
    /// Largest residual of a minimum.
    pub tolerance: f64,
    /// Distance between minima up to which a descent is no jump, in the unit of [`Distance`].
    pub smallest_jump: f64,
    /// Whether the follower jumps; if not, a way ends before its first jump.
    pub jumps: bool,
}

/// The end of a correction.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Corrected {
    Kept,
    Lost,
    Interrupted,
}

/// Progress on a way of length 1.
struct Way {
    done: f64,
    stride: f64,
    iterations: usize,
    leaps: usize,
    jump: f64,
    released: f64,
}

/// Ratio of the distance between minima to the length of the way up to which the way is smooth; dimensionless.
const SMOOTH: f64 = 100.0;

/// Damping of the controls per unit weight at a marginal minimum; objective per squared control.
const MARGINAL: f64 = 1e-3;

impl<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize> Follower<P, X, U, N>
where
    P::Point: Distance,
{
    /// Starts at a minimum, strict or marginal; `None` where the point is neither.
    pub fn new(
        program: P,
        settings: FollowSettings,
        minimum: &Stationary<P::Point>,
    ) -> Option<Self> {
        let (mut iterate, _) = PrimalDual::new(program, 0.0, minimum.point.clone());
        // Half of the tolerance: a higher barrier parameter gives Newton steps a larger radius of convergence.
        let heaviest = iterate.barrier.heaviest();
        iterate.barrier.parameter = 0.5 * settings.tolerance / heaviest;
        let mut follower = Self {
            first: (minimum.clone(), 0.0),
            gradients: iterate.kkt.linear.equalities_at.clone(),
            iterate,
            settings,
            last: minimum.clone(),
            next_stride: NextStride::default(),
        };
        let started = follower.start_from(minimum);
        follower.keep();
        follower.depart();
        started.then_some(follower)
    }

    /// The present programme.
    pub fn program(&self) -> &P {
        &self.iterate.program
    }

    /// The present minimum.
    pub fn point(&self) -> &P::Point {
        &self.iterate.point
    }

    /// Values at the present minimum.
    pub fn values(&self) -> &Values {
        &self.iterate.values
    }

    /// Residuals at the present minimum.
    pub fn residuals(&mut self) -> Residuals {
        self.iterate.residuals()
    }

    /// The present minimum with its multipliers.
    pub fn minimum(&self) -> &Stationary<P::Point> {
        &self.last
    }

    /// Multipliers at the present minimum.
    pub fn multipliers(&self) -> &Multipliers {
        &self.iterate.multipliers
    }

    /// Follows the minimum while `change` takes the programme along a way of a `length`, from share 0 to share 1: in one
    /// stride, or in shorter strides where a stride might lose the minimum. Where the minimum ends, the next minimum downhill
    /// takes its place. Where the minimum is lost, or on `Break`, the programme ends at the share of the last minimum.
    ///
    /// `proceed` is called once a Newton step, and interrupts by `Break`. The next way then begins with the stride that this one
    /// would have gone on with, so that ways of few steps come on, too.
    pub fn follow(
        &mut self,
        length: f64,
        change: &mut dyn FnMut(&mut P, f64),
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Followed {
        /// Bounds of the length of the shortest stride, as a share of the way; dimensionless. On a long way it is so short that
        /// smooth motion on it hides no jump.
        const SHORTEST_STRIDES: [f64; 2] = [1e-8, 1e-4];
        /// Largest count of leaps to another minimum on one way; a number.
        const MOST_LEAPS: usize = 20;
        let mut way = Way {
            done: 0.0,
            stride: self
                .next_stride
                .length
                .take()
                .map_or(1.0, |stride| (stride / length).min(1.0)),
            iterations: 0,
            leaps: 0,
            jump: 0.0,
            released: 0.0,
        };
        let hidden = self.settings.smallest_jump / (SMOOTH * length);
        let shortest = hidden.clamp(SHORTEST_STRIDES[0], SHORTEST_STRIDES[1]);
        while way.done < 1.0 && way.leaps < MOST_LEAPS {
            if proceed().is_break() {
                self.next_stride.length = Some(way.stride * length);
                break;
            }
            let next = (way.done + way.stride).min(1.0);
            change(&mut self.iterate.program, next);
            let (iterations, corrected) = self.stride(proceed);
            way.iterations += iterations;
            let is_interrupted = corrected == Corrected::Interrupted;
            let is_kept = corrected == Corrected::Kept && self.is_minimum();
            let arrived = is_kept || {
                self.go_back();
                way.stride <= shortest
                    && !is_interrupted
                    && self.leap(length, next, &mut way, proceed)
            };
            if is_interrupted && way.done > 0.0 {
                // The next way has the time for this stride.
                self.next_stride.length = Some(way.stride * length);
                break;
            } else if arrived {
                self.keep();
                self.go_on_undamped();
                way.done = next;
                way.stride *= 2.0;
            } else if way.stride <= shortest {
                break;
            } else {
                way.stride *= 0.25;
            }
        }
        if way.done < 1.0 {
            change(&mut self.iterate.program, way.done);
            self.go_back();
        }
        Followed {
            iterations: way.iterations,
            residuals: self.iterate.residuals(),
            jump: way.jump,
            released: way.released,
            arrived: way.done >= 1.0,
            reached: way.done,
        }
    }

    /// Descends from the last minimum where the shortest stride has lost it; false where the descent finds no minimum.
    fn leap(
        &mut self,
        length: f64,
        next: f64,
        way: &mut Way,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> bool {
        /// Barrier parameter with which a leap begins, low enough to stay near the lost minimum; objective per unit weight.
        const FIRST_BARRIER: f64 = 1e-5;
        /// Largest count of interior-point iterations of a leap; a number.
        const ITERATIONS: usize = 300;
        way.leaps += 1;
        let settings = Settings {
            tolerance: self.settings.tolerance,
            iterations: ITERATIONS,
            barrier: FIRST_BARRIER,
            longest_step: f64::INFINITY,
        };
        // The iterate is at the lost minimum; the little that the programme has changed since is left out.
        let before = self.iterate.values.objective;
        let found = minimise(
            &self.iterate.program,
            &settings,
            self.last.point.clone(),
            proceed,
        );
        way.iterations += found.iterations;
        if !found.is_minimum() {
            return false;
        }
        let moved = length * (next - way.done);
        let jump = found.at.point.distance(&self.last.point);
        if jump > SMOOTH * moved + self.settings.smallest_jump {
            if !self.settings.jumps {
                return false;
            }
            way.jump = way.jump.max(jump);
            way.released += before - found.values.objective;
        }
        self.start_from(&found.at)
    }

    /// Starts from a minimum, strict or marginal; false where the point is neither.
    fn start_from(&mut self, minimum: &Stationary<P::Point>) -> bool {
        let before = self.next_stride.damping;
        let started = self.start_damped(minimum, 0.0)
            || self.start_damped(minimum, MARGINAL) && self.is_minimum();
        if !started {
            self.next_stride.damping = before;
        }
        started
    }

    /// Starts from a minimum with a given damping; false where the point is no minimum of the damped programme.
    fn start_damped(&mut self, minimum: &Stationary<P::Point>, damping: f64) -> bool {
        self.next_stride.damping = damping;
        let iterate = &mut self.iterate;
        iterate.point.copy_from(&minimum.point);
        iterate.multipliers.copy_from(&minimum.multipliers);
        let admissible = iterate
            .program
            .evaluate(&mut iterate.point, &mut iterate.values);
        iterate.linearise();
        let (_, corrected) = self.correct(f64::INFINITY, &mut || ControlFlow::Continue(()));
        admissible && corrected == Corrected::Kept
    }

    /// Goes on without damping from a minimum that is strict again.
    fn go_on_undamped(&mut self) {
        if self.next_stride.damping > 0.0 {
            self.iterate.assemble();
            if self
                .iterate
                .kkt
                .factorise_damped(-self.next_stride.damping)
                .is_ok()
            {
                self.next_stride.damping = 0.0;
            }
            self.factorise();
        }
    }

    /// The present minimum as a solution.
    pub fn solution(&mut self) -> Solution<P::Point> {
        let residuals = self.iterate.residuals();
        let inertia = self.inertia();
        let iterate = &self.iterate;
        Solution {
            at: Stationary {
                point: iterate.point.clone(),
                multipliers: iterate.multipliers.clone(),
            },
            values: iterate.values.clone(),
            residuals,
            iterations: 0,
            outcome: Outcome::Converged,
            inertia,
        }
    }

    /// Whether the point of a correction is a minimum: a damped factorisation does not see a weak saddle.
    fn is_minimum(&mut self) -> bool {
        self.next_stride.damping == 0.0
            || self.inertia().is_some_and(|inertia| inertia.negative == 0)
    }

    /// Inertia of the second derivative at the present minimum.
    fn inertia(&mut self) -> Option<Inertia> {
        let inertia = self.iterate.inertia();
        self.iterate.linearise();
        self.factorise();
        inertia
    }

    /// The steps of the unknowns and of the equalities' multipliers by which the minimum answers a change of its programme, to
    /// first order and by the present factorisation. The change is that of the Lagrangian's gradient, by all states and
    /// controls, and of the equalities.
    pub fn response(
        &mut self,
        gradient: &[NodeVector<N>],
        equalities: &[f64],
    ) -> (&[NodeVector<N>], &[f64]) {
        let kkt = &mut self.iterate.kkt;
        kkt.pair_targets.fill(0.0);
        kkt.find_step(gradient, equalities);
        (&kkt.step, &kkt.multiplier_step)
    }

    /// How the next way begins.
    pub fn next_stride(&self) -> NextStride {
        self.next_stride
    }

    /// Sets how the next way begins, to that of another follower at the same minimum.
    pub fn set_next_stride(&mut self, stride: NextStride) {
        self.next_stride = stride;
        self.factorise();
    }

    /// Makes the present minimum the one to return to.
    pub fn depart(&mut self) {
        self.first.0.copy_from(&self.last);
        self.first.1 = self.next_stride.damping;
    }

    /// Returns to the minimum of the last departure; `change` sets the programme back.
    pub fn return_to_start(&mut self, change: impl FnOnce(&mut P)) {
        change(&mut self.iterate.program);
        self.last.copy_from(&self.first.0);
        self.next_stride.damping = self.first.1;
        self.go_back();
    }

    /// Predictor, then corrector; gives the count of steps, and how the correction ended.
    fn stride(&mut self, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> (usize, Corrected) {
        let iterate = &mut self.iterate;
        let admissible = iterate
            .program
            .evaluate(&mut iterate.point, &mut iterate.values);
        if !admissible {
            return (0, Corrected::Lost);
        }
        iterate.find_barrier_gradient();
        // A change of the programme changes the gradients of the equalities too.
        iterate
            .program
            .equality_gradients(&iterate.point, &mut self.gradients);
        let linear = &iterate.kkt.linear;
        let changes = self.gradients.iter().zip(&linear.equalities_at);
        let mut rows = changes.zip(&iterate.multipliers.equalities);
        for block in linear.layout().equalities_at() {
            let mut change = NodeVector::zeros();
            for ((now, before), multiplier) in rows.by_ref().take(block.rows) {
                change += *multiplier * (now - before);
            }
            iterate.gradient[block.at] += change;
        }
        iterate
            .kkt
            .find_step(&iterate.gradient, &iterate.values.equalities);
        let predicted = size(iterate);
        let Some(taken) = take(iterate) else {
            return (1, Corrected::Lost);
        };
        iterate.linearise();
        let (steps, corrected) = self.correct(left(taken, 1.0) * predicted, proceed);
        (steps + 1, corrected)
    }

    /// Newton steps until all residuals are within the tolerance. The minimum is lost where the steps do not contract, the first
    /// against the expected length, and where the point is no minimum. The factorisation at the last point decides whether the point
    /// is a minimum, and serves the next predictor.
    fn correct(
        &mut self,
        expected: f64,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> (usize, Corrected) {
        /// Largest count of Newton steps of one correction; a number.
        const CORRECTIONS: usize = 12;
        /// Ratio of successive Newton steps up to which they converge; dimensionless.
        const CONTRACTION: f64 = 0.7;
        /// Length of a Newton step that is rounding; in the unit of the unknowns.
        const ROUNDING: f64 = 1e-9;
        let mut expected = CONTRACTION * expected;
        for steps in 0..CORRECTIONS {
            if !self.factorise() {
                return (steps, Corrected::Lost);
            }
            let iterate = &mut self.iterate;
            if iterate.residuals().largest() <= self.settings.tolerance {
                return (steps, Corrected::Kept);
            }
            if proceed().is_break() {
                return (steps, Corrected::Interrupted);
            }
            iterate.find_step();
            let now = size(iterate);
            let shorter = now <= expected.max(ROUNDING);
            let Some(taken) = take(iterate).filter(|_| shorter) else {
                return (steps + 1, Corrected::Lost);
            };
            expected = left(taken, CONTRACTION) * now;
            iterate.linearise();
        }
        (CORRECTIONS, Corrected::Lost)
    }

    /// Factorises at the present point; false where the damped second derivative is not positive on the tangent space.
    fn factorise(&mut self) -> bool {
        self.iterate.assemble();
        self.iterate
            .kkt
            .factorise_damped(self.next_stride.damping)
            .is_ok()
    }

    /// Stores the present point as the last minimum.
    fn keep(&mut self) {
        let iterate = &self.iterate;
        self.last.point.copy_from(&iterate.point);
        self.last.multipliers.copy_from(&iterate.multipliers);
    }

    /// Returns to the last minimum, with its factorisation.
    fn go_back(&mut self) {
        let iterate = &mut self.iterate;
        iterate.point.copy_from(&self.last.point);
        iterate.multipliers.copy_from(&self.last.multipliers);
        iterate
            .program
            .evaluate(&mut iterate.point, &mut iterate.values);
        iterate.linearise();
        // The factorisation at the last minimum has succeeded before.
        self.factorise();
    }
}

/// Length of the present step.
fn size<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    iterate: &PrimalDual<P, X, U, N>,
) -> f64 {
    let squares = iterate.kkt.step.iter().map(|node| node.norm_squared());
    squares.sum::<f64>().sqrt()
}

/// Expected ratio of the next step to a step of which a share was taken, where the whole step leaves the ratio `rest`.
fn left(taken: f64, rest: f64) -> f64 {
    1.0 - taken * (1.0 - rest)
}

/// Takes the share of the present step that keeps slacks and multipliers positive; gives the share, or `None` outside the
/// domain.
fn take<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    iterate: &mut PrimalDual<P, X, U, N>,
) -> Option<f64> {
    let lengths = iterate.find_inequality_step();
    let taken = iterate.try_step(lengths.primal);
    taken.then(|| {
        iterate.accept(lengths);
        lengths.primal
    })
}
