//! Supports that are turned by more than half a turn: the belt is followed there from less.

use super::side::wound_on_side_of_bulge;
use super::{Equilibrium, Solved, Status, beside_the_guess, minimum_next_to, of_solution};
use crate::problem::program::{BeltPoint, BeltProgram, Hold, Piece};
use crate::problem::{Mesh, Problem, number};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use stagewise::{Distance, FollowSettings, Follower};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::iter;
use std::ops::ControlFlow;

/// Angle from which a rotation vector is more than half a turn, in rad: half turns may be given with few decimals.
const MORE_THAN_HALF: f64 = PI + 1e-3;
/// Greatest angle to which a belt is followed, in rad: four turns.
pub(super) const MOST: f64 = 4.0 * TAU + 1e-3;
/// Angle from which a belt is followed, in rad: there the shorter way round is not in doubt.
const BEGIN: f64 = FRAC_PI_2;

/// The minimum of a problem whose supports are turned by more than half a turn, followed from a quarter turn; `None` of
/// another problem, of one whose board turns so by itself, and of more than [`MOST`]. Where the belt cannot be followed, it is
/// turned the shorter way round, and a warning says so.
pub(super) fn wound(
    problem: &Problem,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Equilibrium> {
    let angle = problem.largest_turn();
    if !(MORE_THAN_HALF..=MOST).contains(&angle) {
        return None;
    }
    let turned_by_itself = parities_beside_flat(problem).and_then(|parities_beside_flat| {
        let found = beside_the_guess(problem, proceed);
        (parities(&found) == parities_beside_flat).then_some(found)
    });
    if turned_by_itself.is_some() {
        return turned_by_itself;
    }
    for way in Way::all(problem, angle) {
        if let Some((found, has_snapped)) = way.end(problem, proceed) {
            let mut found = wound_on_side_of_bulge(found, proceed);
            found.warnings.extend(way.warnings(has_snapped));
            return Some(found);
        }
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
    /// The largest angle of the problem, in rad.
    angle: f64,
    /// The angle at the end, in rad: the largest angle, or one that is two whole turns less.
    end: f64,
}

impl Way {
    /// The ways to a problem, the one asked for first. From a whole turn on a single support may also turn the other way round
    /// by two whole turns less: a belt undoes two whole turns as it passes round its end. None where the mesh cannot be as fine
    /// as they need.
    fn all(problem: &Problem, angle: f64) -> Vec<Self> {
        /// Turn of an element of the mesh, if the belt turns evenly, in rad.
        const TURN: f64 = 0.1;
        /// Angle by which a whole turn may be less for want of decimals, in rad.
        const DECIMALS: f64 = 1e-3;
        let least = (angle / TURN).ceil() as usize;
        let elements = match problem.has_fixed_mesh() {
            true => problem.elements(),
            false => problem.elements().max(least),
        };
        let Ok(goal) = problem.with_elements(elements) else {
            return Vec::new();
        };
        let rotations = problem.scenario().supports.iter();
        let rotations = rotations.filter_map(|support| support.rotation);
        let wound = rotations.filter(|r| Vector3::from(*r).norm() > MORE_THAN_HALF);
        let other = (wound.count() == 1 && angle >= TAU - DECIMALS).then_some(angle - 2.0 * TAU);
        let other = other.filter(|end| *end < -BEGIN);
        let ends = iter::once(angle).chain(other);
        ends.map(|end| Self {
            goal: goal.clone(),
            angle,
            end,
        })
        .collect()
    }

    /// The problem on the way at which the largest angle is another.
    fn at(&self, angle: f64) -> Problem {
        self.goal.turned_back(MORE_THAN_HALF, angle / self.angle)
    }

    /// The warnings of the way itself.
    fn warnings(&self, has_snapped: bool) -> Vec<String> {
        let angle = number(self.angle);
        let snapped = has_snapped.then(|| {
            format!(
                "the belt has snapped on the way on which its support was turned by {angle} rad, and may have undone whole turns"
            )
        });
        let other = (self.end != self.angle).then(|| {
            format!(
                "a support is turned by {angle} rad, and the belt could only be followed the other way round, to two whole \
                 turns less: it is turned by {} rad",
                number(self.end)
            )
        });
        snapped.into_iter().chain(other).collect()
    }

    /// The minimum at the end of the way, and whether it has snapped on the way; `None` where the belt is lost on the way.
    fn end(
        &self,
        problem: &Problem,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<(Equilibrium, bool)> {
        /// Angle of a leg of the way, in rad.
        const LEG: f64 = 0.5;
        /// How often a leg is halved on which the belt is lost.
        const HALVINGS: usize = 2;
        /// Displacement up to which the refined minimum is the same, in U.
        const SAME: f64 = 0.1;
        let (begin, mut found) = self.begin(proceed)?;
        let legs = ((self.end - begin).abs() / LEG).ceil();
        let place = |leg: f64| begin + (self.end - begin) * leg / legs;
        let mut has_snapped = false;
        for leg in 1..=legs as usize {
            let ends = [leg - 1, leg].map(|leg| place(leg as f64));
            has_snapped |= self.go_on_in_parts(&mut found, ends, HALVINGS, proceed)?;
        }
        let iterations = found.iterations;
        let refined = found.refined_for(problem, proceed);
        let is_same = |refined: &Equilibrium| found.displacement(refined) <= SAME;
        let end = match refined.filter(is_same) {
            Some(refined) => Equilibrium {
                iterations: refined.iterations + iterations,
                ..refined
            },
            None => Equilibrium {
                problem: problem.clone(),
                ..found
            },
        };
        end.is_minimum().then_some((end, has_snapped))
    }

    /// The angle at which the way begins and a minimum there; of a straight board one that turns by this angle, and not the
    /// longer way round. `None` where there is none.
    fn begin(&self, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> Option<(f64, Equilibrium)> {
        /// Shares of the angle of the beginning that are tried, dimensionless.
        const SHARES: [f64; 2] = [1.0, 0.2];
        let program = self.goal.program(self.goal.elements());
        let is_straight = program.pieces.iter().all(|piece| match piece {
            Piece::Strip(element) => element.geodesic == 0.0,
            Piece::Rigid { .. } => true,
            Piece::Joint { .. } => false,
        });
        let angles = SHARES.map(|share| share * BEGIN.copysign(self.end));
        angles.into_iter().find_map(|begin| {
            let found = beside_the_guess(&self.at(begin), proceed);
            let is_right = !is_straight || parities(&found).iter().all(|is_alike| *is_alike);
            (found.status == Status::Converged && is_right).then_some((begin, found))
        })
    }

    /// Follows a minimum from one angle to another as [`Self::go_on`] does, in halves where it is lost or its parities change.
    fn go_on_in_parts(
        &self,
        found: &mut Equilibrium,
        [from, to]: [f64; 2],
        halvings: usize,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<bool> {
        let mut next = found.clone();
        let has_snapped = self.go_on(&mut next, [from, to], proceed);
        if has_snapped.is_some() && parities(&next) == parities(found) {
            *found = next;
            return has_snapped;
        }
        let halvings = halvings.checked_sub(1)?;
        let middle = 0.5 * (from + to);
        let first = self.go_on_in_parts(found, [from, middle], halvings, proceed)?;
        let second = self.go_on_in_parts(found, [middle, to], halvings, proceed)?;
        Some(first || second)
    }

    /// Follows a minimum from one angle to another, and gives whether it has snapped on the way; `None` where it is lost.
    fn go_on(
        &self,
        found: &mut Equilibrium,
        [from, to]: [f64; 2],
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<bool> {
        let solved: &Solved = found.certified().ok()?;
        let mesh = Mesh::of(&self.goal, &solved.program);
        /// Displacement beyond which the next minimum is another one, in U.
        const ANOTHER: f64 = 0.05;
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
        let problem = self.at(to);
        let mut program = follower.program().clone();
        change(&mut program, 1.0);
        let fault = problem.active_set_fault(&program, follower.point());
        let before = follower.point().clone();
        let mut next = match followed.arrived && fault.is_none() {
            true => of_solution(&problem, program, follower.solution()),
            false => settled(&problem, follower.point(), proceed),
        };
        next.iterations += found.iterations + followed.iterations;
        *found = next;
        let after: &Solved = found.certified().ok()?;
        Some(followed.jump > 0.0 || after.at.point.distance(&before) > ANOTHER)
    }
}

/// The minimum to which a belt settles from a shape; where the search has not come to its end, it goes on.
fn settled(
    problem: &Problem,
    shape: &BeltPoint,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    /// Searches after the first one.
    const MORE: usize = 3;
    let mut found = minimum_next_to(problem, shape, proceed);
    for _ in 0..MORE {
        if found.status == Status::Converged {
            break;
        }
        let Some(shape) = found.developable().map(|solved| solved.at.point.clone()) else {
            break;
        };
        let iterations = found.iterations;
        found = minimum_next_to(problem, &shape, proceed);
        found.iterations += iterations;
    }
    found
}

/// The [`parities`] of a belt that turns from one held frame to the next by no more than half a turn more or less than its flat
/// board does, where a way from a quarter turn leads to such a belt; `None` where it leads to another one, and where frames are
/// not held by rotation vectors about one axis.
fn parities_beside_flat(problem: &Problem) -> Option<Vec<bool>> {
    /// Sine of the angle between axes that are the same, dimensionless.
    const PARALLEL: f64 = 1e-9;
    let program = problem.program(problem.elements());
    let own_turn = |node: usize| {
        let turn = |piece: &Piece| match piece {
            Piece::Strip(element) => element.geodesic * element.length,
            Piece::Joint { angle } => *angle,
            Piece::Rigid { .. } => 0.0,
        };
        program.pieces[..node].iter().map(turn).sum::<f64>()
    };
    let held: Vec<_> = held_frames(&program, problem).collect();
    let frames = problem.scenario().supports.iter();
    let frames = frames.filter(|support| support.frame().is_some()).count();
    if frames < 2 || held.len() < frames {
        return None;
    }
    let (start, first) = held[0];
    let normal = UnitQuaternion::from_scaled_axis(first) * Vector3::x();
    let whole_turns = |(node, vector): &(usize, Vector3<f64>)| {
        let turn = vector - first;
        if first.cross(vector).norm() > PARALLEL * first.norm() * vector.norm() {
            return None;
        }
        let flat = normal * (own_turn(*node) - own_turn(start));
        let axis = turn.try_normalize(PARALLEL).unwrap_or(normal);
        let begin = match turn.norm() > MORE_THAN_HALF {
            true => BEGIN * axis,
            false => turn,
        };
        let away = |turn: &Vector3<f64>, whole: f64| (turn + whole * TAU * axis - flat).norm();
        let nearer = |a: &f64, b: &f64| away(&begin, *a).total_cmp(&away(&begin, *b));
        let whole = [0.0, -1.0, 1.0].into_iter().min_by(nearer)?;
        (away(&turn, whole) <= MORE_THAN_HALF).then_some(whole)
    };
    let whole_turns: Vec<_> = held.iter().map(whole_turns).collect::<Option<_>>()?;
    let is_alike = |ends: &[f64]| (ends[0] == 0.0) == (ends[1] == 0.0);
    Some(whole_turns.windows(2).map(is_alike).collect())
}

/// The nodes and the rotation vectors of the supports that hold a whole frame by such a vector.
fn held_frames<'a>(
    program: &'a BeltProgram,
    problem: &'a Problem,
) -> impl Iterator<Item = (usize, Vector3<f64>)> + 'a {
    let held = program.supports.iter().zip(&problem.scenario().supports);
    let held = held.filter(|(support, _)| matches!(support.hold, Hold::Frame(_)));
    held.filter_map(|(support, given)| Some((support.node, given.rotation?.into())))
}

/// Whether the belt turns from one held frame to the next by the rotation between them, and not by a whole turn more or less:
/// one for each pair of frames. A belt that turns along a way keeps them, unless it passes beyond any belt on the way.
///
/// A rotation and a whole turn more are two unit quaternions of opposite sign; those of the supports have the signs of their
/// rotation vectors, and those of the belt are continuous along it.
fn parities(found: &Equilibrium) -> Vec<bool> {
    let Ok(solved): Result<&Solved, _> = found.certified() else {
        return Vec::new();
    };
    let frame = |node: usize| {
        let frame = Rotation3::from_matrix_unchecked(solved.at.point.poses[node].frame);
        UnitQuaternion::from_rotation_matrix(&frame)
    };
    let held = held_frames(&solved.program, &found.problem);
    let held: Vec<_> = held
        .map(|(node, vector)| (node, UnitQuaternion::from_scaled_axis(vector)))
        .collect();
    let is_alike = |ends: &[(usize, UnitQuaternion<f64>)]| {
        let [(from, start), (to, end)] = [ends[0], ends[1]];
        let step = |k: usize| {
            let step = frame(k).conjugate() * frame(k + 1);
            if step.w < 0.0 {
                UnitQuaternion::new_unchecked(-step.into_inner())
            } else {
                step
            }
        };
        let along = (from..to).map(step);
        let along = along.fold(UnitQuaternion::identity(), |turned, step| turned * step);
        along.dot(&(start.conjugate() * end)) > 0.0
    };
    held.windows(2).map(is_alike).collect()
}
