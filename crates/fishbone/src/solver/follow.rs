//! Follows a minimum while its programme changes: predicts by the last factorisation, corrects by Newton's method, takes no
//! step that might lead to another minimum, and tells where there is no more to follow.

use super::interior_point::{State, minimise};
use super::{
    Outcome, Program, Residuals, Rows, RowsByNode, Settings, Solution, Stationary, Values,
};
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
pub struct Follower<P: Program> {
    state: State<P>,
    /// The last minimum on the way.
    last: Stationary<P::Point>,
    /// The minimum from which the way began.
    first: Stationary<P::Point>,
    /// Room for the derivatives of the constraints at nodes.
    jacobians: Vec<RowsByNode>,
}

impl<P: Shape> Stationary<P> {
    fn copy_from(&mut self, other: &Self) {
        self.point.copy_from(&other.point);
        self.multipliers.copy_from_slice(&other.multipliers);
        self.bound_multipliers
            .copy_from_slice(&other.bound_multipliers);
    }
}

/// How far a minimum has been followed on a way of length 1.
struct Way {
    done: f64,
    stride: f64,
    iterations: usize,
    leaps: usize,
    jumped: bool,
}

impl<P: Program> Follower<P>
where
    P::Point: Shape,
{
    /// Starts at a minimum; `None` where it is none that can be followed.
    pub fn new(program: P, tolerance: f64, minimum: &Stationary<P::Point>) -> Option<Self> {
        let settings = Settings {
            tolerance,
            iterations: 0,
            barrier: 0.0,
        };
        let mut state = State::new(program, settings, minimum.point.clone());
        // Half of what complementarity may be: the higher, the farther a Newton step is good for.
        let heaviest = state.weights.iter().fold(0.0, |most: f64, w| most.max(*w));
        state.barrier = 0.5 * tolerance / heaviest;
        let mut follower = Self {
            first: minimum.clone(),
            jacobians: state.linear.constraints.clone(),
            state,
            last: minimum.clone(),
        };
        let started = follower.start_from(minimum);
        follower.keep();
        started.then_some(follower)
    }

    /// The programme as it is now.
    pub fn program(&self) -> &P {
        &self.state.program
    }

    /// The present minimum.
    pub fn point(&self) -> &P::Point {
        &self.state.point
    }

    /// Its values.
    pub fn values(&self) -> &Values {
        &self.state.values
    }

    /// Its multipliers.
    pub fn multipliers(&self) -> &[Rows] {
        &self.state.multipliers
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
            change(&mut self.state.program, next);
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
        change(&mut self.state.program, 1.0);
        Followed {
            iterations: way.iterations,
            residuals: self.state.residuals(),
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
        /// A smooth way leads no farther than so many times its length. Less than the other is how far it goes where an
        /// inequality passes from one stage to the next, which is the mesh's doing.
        const SMOOTH: f64 = 100.0;
        const OF_THE_MESH: f64 = 2e-3;
        way.leaps += 1;
        let settings = Settings {
            iterations: ITERATIONS,
            barrier: NEAR,
            ..self.state.settings
        };
        let found = minimise(
            &self.state.program,
            &settings,
            self.last.point.clone(),
            proceed,
        );
        way.iterations += found.iterations;
        if !found.is_minimum() {
            return false;
        }
        let moved = length * (next - way.done);
        way.jumped |= found.at.point.distance(&self.last.point) > SMOOTH * moved + OF_THE_MESH;
        self.start_from(&found.at)
    }

    /// Takes over a minimum; false where it is none that can be followed.
    fn start_from(&mut self, minimum: &Stationary<P::Point>) -> bool {
        let state = &mut self.state;
        state.point.copy_from(&minimum.point);
        state.multipliers.copy_from_slice(&minimum.multipliers);
        state
            .bound_multipliers
            .copy_from_slice(&minimum.bound_multipliers);
        let admissible = state.program.evaluate(&mut state.point, &mut state.values);
        state.linearise();
        let (_, kept) = self.correct(f64::INFINITY);
        admissible && kept
    }

    /// The minimum where it is now.
    pub fn solution(&mut self) -> Solution<P::Point> {
        let residuals = self.state.residuals();
        let state = &mut self.state;
        let inertia = state.inertia();
        let solution = Solution {
            at: Stationary {
                point: state.point.clone(),
                multipliers: state.multipliers.clone(),
                bound_multipliers: state.bound_multipliers.clone(),
            },
            values: state.values.clone(),
            residuals,
            iterations: 0,
            outcome: Outcome::Converged,
            inertia,
        };
        self.state.linearise();
        self.factorise();
        solution
    }

    /// Goes back to where the last way began, and so does the programme.
    pub fn return_to_start(&mut self, change: impl FnOnce(&mut P)) {
        change(&mut self.state.program);
        self.last.copy_from(&self.first);
        self.go_back();
    }

    /// Predicts, then corrects; the steps taken, and whether it is the same minimum.
    fn stride(&mut self) -> (usize, bool) {
        let state = &mut self.state;
        if !state.program.evaluate(&mut state.point, &mut state.values) {
            return (0, false);
        }
        state.find_barrier_gradient();
        // Where the programme has changed, the constraints pull another way.
        state
            .program
            .constraint_jacobians(&state.point, &mut self.jacobians);
        for (i, (now, before)) in self
            .jacobians
            .iter()
            .zip(&state.linear.constraints)
            .enumerate()
        {
            let node = state.linear.diagonal.nodes[i].node;
            state.gradient[node] += (now - before).tr_mul(&state.multipliers[i]);
        }
        let missed = &state.values.constraints;
        state.newton.solve(&state.linear, &state.gradient, missed);
        let predicted = size(state);
        let Some(taken) = take(state) else {
            return (1, false);
        };
        state.linearise();
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
            let state = &mut self.state;
            if state.residuals().largest() <= state.settings.tolerance {
                return (steps, true);
            }
            state.find_step();
            let now = size(state);
            let shorter = now <= expected.max(ROUNDING);
            let Some(taken) = take(state).filter(|_| shorter) else {
                return (steps + 1, false);
            };
            expected = left(taken, SHORTER) * now;
            state.linearise();
        }
        (MOST, false)
    }

    /// Factorises at the present point; false where it is concave along the constraints.
    fn factorise(&mut self) -> bool {
        let state = &mut self.state;
        state
            .newton
            .assemble(&state.linear, &state.values, &state.bound_multipliers);
        state.newton.factorise_damped(&state.linear, 0.0).is_ok()
    }

    /// Makes the present point the one to go back to.
    fn keep(&mut self) {
        let state = &self.state;
        self.last.point.copy_from(&state.point);
        self.last.multipliers.copy_from_slice(&state.multipliers);
        self.last
            .bound_multipliers
            .copy_from_slice(&state.bound_multipliers);
    }

    /// Goes back to the last minimum, with its factorisation.
    fn go_back(&mut self) {
        let state = &mut self.state;
        state.point.copy_from(&self.last.point);
        state.multipliers.copy_from_slice(&self.last.multipliers);
        state
            .bound_multipliers
            .copy_from_slice(&self.last.bound_multipliers);
        state.program.evaluate(&mut state.point, &mut state.values);
        state.linearise();
        // At a minimum it has been factorised before.
        self.factorise();
    }
}

/// A point that can be kept and compared.
pub trait Shape: Clone {
    /// Takes over another of the same size, without allocating.
    fn copy_from(&mut self, other: &Self);

    /// How far apart two are, in the unit in which a way is measured.
    fn distance(&self, other: &Self) -> f64;
}

/// Length of the present step.
fn size<P: Program>(state: &State<P>) -> f64 {
    let squares = state.newton.step.iter().map(|node| node.norm_squared());
    squares.sum::<f64>().sqrt()
}

/// What is left of a step of which a share has been taken, where a whole one leaves `rest`.
fn left(taken: f64, rest: f64) -> f64 {
    1.0 - taken * (1.0 - rest)
}

/// Takes the present step as far as slacks and multipliers stay positive, and says how far that was; `None` where it leaves
/// the domain.
fn take<P: Program>(state: &mut State<P>) -> Option<f64> {
    let lengths = state.find_bound_step();
    let taken = state.try_step(lengths.primal);
    taken.then(|| {
        state.accept(lengths.primal, lengths.dual);
        lengths.primal
    })
}
