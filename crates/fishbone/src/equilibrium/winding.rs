//! Supports that are turned by more than half a turn: the belt is followed there from less.

use super::side::wound_on_side_of_bulge;
use super::{Equilibrium, Status, beside_the_guess, minimum_next_to, of_solution};
use crate::problem::program::BeltProgram;
use crate::problem::{Mesh, Problem, number};
use stagewise::{FollowSettings, Follower};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::ops::ControlFlow;

/// Angle from which a rotation vector is more than half a turn, in rad: half turns may be given with few decimals.
const MORE_THAN_HALF: f64 = PI + 1e-3;
/// Greatest angle to which a belt is followed, in rad: four turns.
pub(super) const MOST: f64 = 4.0 * TAU + 1e-3;
/// Angle from which a belt is followed, in rad: there the shorter way round is not in doubt.
const BEGIN: f64 = FRAC_PI_2;

/// The minimum of a problem whose supports are turned by more than half a turn, followed from a quarter turn; `None` of
/// another problem, and of more than [`MOST`]. Where the belt cannot be followed, it is turned the shorter way round, and a
/// warning says so.
pub(super) fn wound(
    problem: &Problem,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Equilibrium> {
    let angle = problem.largest_turn();
    if !(MORE_THAN_HALF..=MOST).contains(&angle) {
        return None;
    }
    if let Some(found) = Way::new(problem, angle).and_then(|way| way.end(problem, proceed)) {
        return Some(wound_on_side_of_bulge(found, proceed));
    }
    let mut found = beside_the_guess(problem, proceed);
    if found.status == Status::Converged {
        found.warnings.push(format!(
            "a support is turned by {} rad, and the belt could not be followed to more than half a turn: it is turned the \
             shorter way round",
            number(angle)
        ));
    }
    Some(found)
}

/// A way on which supports turn from a quarter turn to all their angle.
struct Way {
    /// The problem at the end, on the mesh of the way.
    goal: Problem,
    /// The largest angle at the end, in rad.
    angle: f64,
}

impl Way {
    /// The way to a problem; `None` where its mesh cannot be as fine as the way needs.
    fn new(problem: &Problem, angle: f64) -> Option<Self> {
        /// Turn of an element of the mesh, if the belt turns evenly, in rad.
        const TURN: f64 = 0.1;
        let least = (angle / TURN).ceil() as usize;
        let elements = match problem.has_fixed_mesh() {
            true => problem.elements(),
            false => problem.elements().max(least),
        };
        let goal = problem.with_elements(elements).ok()?;
        Some(Self { goal, angle })
    }

    /// The problem on the way at which the largest angle is another.
    fn at(&self, angle: f64) -> Problem {
        self.goal.turned_back(MORE_THAN_HALF, angle / self.angle)
    }

    /// The minimum at the end of the way; `None` where the belt is lost on the way.
    fn end(
        &self,
        problem: &Problem,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Equilibrium> {
        /// Angle of a leg of the way, in rad.
        const LEG: f64 = 0.5;
        /// Displacement up to which the refined minimum is the same, in U.
        const SAME: f64 = 0.1;
        let legs = ((self.angle - BEGIN) / LEG).ceil();
        let place = |leg: f64| BEGIN + (self.angle - BEGIN) * leg / legs;
        let mut found = beside_the_guess(&self.at(BEGIN), proceed);
        let mut has_snapped = false;
        for leg in 1..=legs as usize {
            let ends = [leg - 1, leg].map(|leg| place(leg as f64));
            has_snapped |= self.go_on(&mut found, ends, proceed)?;
        }
        let iterations = found.iterations;
        let refined = found.refined_for(problem, proceed);
        let is_same = |refined: &Equilibrium| found.displacement(refined) <= SAME;
        let mut end = match refined.filter(is_same) {
            Some(refined) => Equilibrium {
                iterations: refined.iterations + iterations,
                ..refined
            },
            None => Equilibrium {
                problem: problem.clone(),
                ..found
            },
        };
        if has_snapped {
            end.warnings.push(format!(
                "the belt has snapped on the way on which its support was turned by {} rad",
                number(self.angle)
            ));
        }
        Some(end)
    }

    /// Follows a minimum from one angle to another, and gives whether it has snapped on the way; `None` where it is lost.
    fn go_on(
        &self,
        found: &mut Equilibrium,
        [from, to]: [f64; 2],
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<bool> {
        let solved = found.certified().ok()?;
        let mesh = Mesh::of(&self.goal, &solved.program);
        let settings = FollowSettings {
            tolerance: self.goal.tolerance(),
            smallest_jump: 2e-3,
            jumps: true,
        };
        let mut follower = Follower::new(solved.program.clone(), settings, &solved.at)?;
        let mut change = |program: &mut BeltProgram, share: f64| {
            let between = self.at(from + share * (to - from)).program_on(&mesh);
            *program = between.expect("the same belt on the same mesh");
        };
        let followed = follower.follow(to - from, &mut change, proceed);
        let (problem, program) = (self.at(to), follower.program().clone());
        let fault = problem.active_set_fault(&program, follower.point());
        let mut next = match followed.arrived && fault.is_none() {
            true => of_solution(&problem, program, follower.solution()),
            false => minimum_next_to(&problem, follower.point(), proceed),
        };
        next.iterations += found.iterations + followed.iterations;
        *found = next;
        (found.status == Status::Converged).then_some(followed.jump > 0.0)
    }
}
