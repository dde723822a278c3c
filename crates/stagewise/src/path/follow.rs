//! Predictor–corrector: follows a minimum while its programme changes. Predicts by the last factorisation, corrects by
//! Newton's method, takes no step that might lead to another minimum, and says where there is no more to follow.

use crate::interior_point::{Outcome, PrimalDual, Residuals, Settings, Solution, minimise};
use crate::linear::chain::NodeVector;
use crate::program::{Distance, Multipliers, Program, Stationary, Values};
use std::ops::ControlFlow;

/// How a minimum was followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Followed {
    /// Steps of Newton's method.
    pub iterations: usize,
    /// Residuals where it ended.
    pub residuals: Residuals,
    /// Whether the minimum ceased to be one on the way, and this is another.
    pub jumped: bool,
    /// Whether the end of the way was reached; if not, the minimum is the last that was found.
    pub arrived: bool,
}

/// A minimum, and all that it takes to follow it: nothing is allocated on the way but for links.
pub struct Follower<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize> {
    iterate: PrimalDual<P, X, U, N>,
    settings: FollowSettings,
    /// The last minimum on the way.
    last: Stationary<P::Point>,
    /// The minimum from which the way began.
    first: Stationary<P::Point>,
    /// Room for the gradients of the equalities at nodes.
    gradients: Vec<NodeVector<N>>,
}

/// Settings of a follower.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FollowSettings {
    /// Largest residual of a minimum.
    pub tolerance: f64,
    /// Distance between minima up to which a step downhill is no jump, in the unit of [`Distance`]: that of an inequality
    /// which passes from one stage to the next.
    pub smallest_jump: f64,
}

/// How far a minimum has been followed on a way of length 1.
struct Way {
    done: f64,
    stride: f64,
    iterations: usize,
    leaps: usize,
    jumped: bool,
}

impl<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize> Follower<P, X, U, N>
where
    P::Point: Distance,
{
    /// Starts at a minimum; `None` where it is none that can be followed.
    pub fn new(
        program: P,
        settings: FollowSettings,
        minimum: &Stationary<P::Point>,
    ) -> Option<Self> {
        let (mut iterate, _) = PrimalDual::new(program, 0.0, minimum.point.clone());
        // Half of the complementarity that is allowed: the higher, the farther a Newton step is good for.
        let heaviest = iterate.barrier.heaviest();
        iterate.barrier.parameter = 0.5 * settings.tolerance / heaviest;
        let mut follower = Self {
            first: minimum.clone(),
            gradients: iterate.kkt.linear.equalities_at.clone(),
            iterate,
            settings,
            last: minimum.clone(),
        };
        let started = follower.start_from(minimum);
        follower.keep();
        started.then_some(follower)
    }

    /// The programme as it is now.
    pub fn program(&self) -> &P {
        &self.iterate.program
    }

    /// The present minimum.
    pub fn point(&self) -> &P::Point {
        &self.iterate.point
    }

    /// Its values.
    pub fn values(&self) -> &Values {
        &self.iterate.values
    }

    /// Its multipliers.
    pub fn multipliers(&self) -> &Multipliers {
        &self.iterate.multipliers
    }

    /// Follows the minimum while `change` takes the programme from where it is, at 0, to where it should be, at 1, which is
    /// `length` away: in one stride, or where that might lose it in shorter ones. Where it ends it gives way to the next
    /// minimum downhill, and that is followed on. The programme ends at 1.
    ///
    /// `proceed` is asked once a stride whether to go on.
    pub fn follow(
        &mut self,
        length: f64,
        change: &mut dyn FnMut(&mut P, f64),
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Followed {
        const SHORTEST: f64 = 1e-4;
        const MOST_LEAPS: usize = 20;
        let mut way = Way {
            done: 0.0,
            stride: 1.0,
            iterations: 0,
            leaps: 0,
            jumped: false,
        };
        self.first.copy_from(&self.last);
        while way.done < 1.0 && way.leaps < MOST_LEAPS && proceed().is_continue() {
            let next = (way.done + way.stride).min(1.0);
            change(&mut self.iterate.program, next);
            let (iterations, kept) = self.stride();
            way.iterations += iterations;
            let arrived = kept || {
                self.go_back();
                way.stride <= SHORTEST && self.leap(length, next, &mut way, proceed)
            };
            if arrived {
                self.keep();
                way.done = next;
                way.stride *= 2.0;
            } else if way.stride <= SHORTEST {
                break;
            } else {
                way.stride *= 0.25;
            }
        }
        change(&mut self.iterate.program, 1.0);
        Followed {
            iterations: way.iterations,
            residuals: self.iterate.residuals(),
            jumped: way.jumped,
            arrived: way.done >= 1.0,
        }
    }

    /// Goes downhill from the last minimum where the shortest stride has lost it; false where that leads nowhere.
    fn leap(
        &mut self,
        length: f64,
        next: f64,
        way: &mut Way,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> bool {
        /// As near to the minimum that was lost as a step may begin.
        const NEAR: f64 = 1e-5;
        const ITERATIONS: usize = 300;
        /// A smooth way leads no farther than so many times its length.
        const SMOOTH: f64 = 100.0;
        way.leaps += 1;
        let settings = Settings {
            tolerance: self.settings.tolerance,
            iterations: ITERATIONS,
            barrier: NEAR,
        };
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
        way.jumped |= found.at.point.distance(&self.last.point)
            > SMOOTH * moved + self.settings.smallest_jump;
        self.start_from(&found.at)
    }

    /// Takes over a minimum; false where it is none that can be followed.
    fn start_from(&mut self, minimum: &Stationary<P::Point>) -> bool {
        let iterate = &mut self.iterate;
        iterate.point.copy_from(&minimum.point);
        iterate.multipliers.copy_from(&minimum.multipliers);
        let admissible = iterate
            .program
            .evaluate(&mut iterate.point, &mut iterate.values);
        iterate.linearise();
        let (_, kept) = self.correct(f64::INFINITY);
        admissible && kept
    }

    /// The minimum where it is now.
    pub fn solution(&mut self) -> Solution<P::Point> {
        let residuals = self.iterate.residuals();
        let iterate = &mut self.iterate;
        let inertia = iterate.inertia();
        let solution = Solution {
            at: Stationary {
                point: iterate.point.clone(),
                multipliers: iterate.multipliers.clone(),
            },
            values: iterate.values.clone(),
            residuals,
            iterations: 0,
            outcome: Outcome::Converged,
            inertia,
        };
        self.iterate.linearise();
        self.factorise();
        solution
    }

    /// Goes back to where the last way began, and so does the programme.
    pub fn return_to_start(&mut self, change: impl FnOnce(&mut P)) {
        change(&mut self.iterate.program);
        self.last.copy_from(&self.first);
        self.go_back();
    }

    /// Predicts, then corrects; the steps taken, and whether it is the same minimum.
    fn stride(&mut self) -> (usize, bool) {
        let iterate = &mut self.iterate;
        let admissible = iterate
            .program
            .evaluate(&mut iterate.point, &mut iterate.values);
        if !admissible {
            return (0, false);
        }
        iterate.find_barrier_gradient();
        // Where the programme has changed, the equalities pull another way.
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
            return (1, false);
        };
        iterate.linearise();
        let (steps, kept) = self.correct(left(taken, 1.0) * predicted);
        (steps + 1, kept)
    }

    /// Newton steps until all residuals are within the tolerance; false where they do not get shorter, each against the one
    /// before and the first against what is expected, or where it is no minimum. The last point is factorised too: there it
    /// shows whether that is one, and from there the next prediction is made.
    fn correct(&mut self, expected: f64) -> (usize, bool) {
        const MOST: usize = 12;
        const SHORTER: f64 = 0.7;
        const ROUNDING: f64 = 1e-9;
        let mut expected = SHORTER * expected;
        for steps in 0..MOST {
            if !self.factorise() {
                return (steps, false);
            }
            let iterate = &mut self.iterate;
            if iterate.residuals().largest() <= self.settings.tolerance {
                return (steps, true);
            }
            iterate.find_step();
            let now = size(iterate);
            let shorter = now <= expected.max(ROUNDING);
            let Some(taken) = take(iterate).filter(|_| shorter) else {
                return (steps + 1, false);
            };
            expected = left(taken, SHORTER) * now;
            iterate.linearise();
        }
        (MOST, false)
    }

    /// Factorises at the present point; false where it is concave along the constraints.
    fn factorise(&mut self) -> bool {
        self.iterate.assemble();
        self.iterate.kkt.factorise_damped(0.0).is_ok()
    }

    /// Makes the present point the one to go back to.
    fn keep(&mut self) {
        let iterate = &self.iterate;
        self.last.point.copy_from(&iterate.point);
        self.last.multipliers.copy_from(&iterate.multipliers);
    }

    /// Goes back to the last minimum, with its factorisation.
    fn go_back(&mut self) {
        let iterate = &mut self.iterate;
        iterate.point.copy_from(&self.last.point);
        iterate.multipliers.copy_from(&self.last.multipliers);
        iterate
            .program
            .evaluate(&mut iterate.point, &mut iterate.values);
        iterate.linearise();
        // At a minimum it has been factorised before.
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

/// The share that is left of a step of which a share has been taken, where a whole one leaves `rest`.
fn left(taken: f64, rest: f64) -> f64 {
    1.0 - taken * (1.0 - rest)
}

/// Takes the present step as far as slacks and multipliers stay positive, and gives the share that was taken; `None` where it
/// leaves the domain.
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
