//! An equilibrium of any model of the strip, led by some of its supports.

mod derivatives;
mod eigenvalue;
mod lead;
mod mesh;
mod regrasp;
#[cfg(feature = "io")]
mod stored;
mod way;

use super::{Goal, NoTracker, Update};
use crate::equilibrium::model::StripModel;
use crate::equilibrium::{Equilibrium, Flat, Solved, Status, largest_change};
use crate::geometry::{Pose, Wrench, exp};
use crate::problem::program::{BeltPoint, BeltProgram};
use crate::problem::{Problem, Shape, Units};
use crate::scenario::error::ScenarioError;
use crate::scenario::{Scenario, SegmentSpec, SupportSpec};
use nalgebra::{SVector, Vector3};
use stagewise::{FollowSettings, Follower, Solution, Stationary};
use std::ops::ControlFlow;
use way::Way;

/// An equilibrium of a model of the strip and the supports that move.
#[derive(Clone)]
pub(super) struct Led<D: StripModel<F, N>, const F: usize, const N: usize> {
    /// The problem at the tracker's start.
    problem: Problem,
    /// The supports that move, by their places in the scenario.
    moving: Vec<usize>,
    /// Their present poses, in the units of the programme.
    poses: Vec<Pose>,
    follower: Follower<BeltProgram<D, F, N>, 6, F, N>,
    /// Whether the mesh is graded anew on the way.
    is_graded_anew: bool,
    /// Length of the way since it was, or was to be, in U and rad.
    since_graded: f64,
    /// Largest change of turning within an element when the error of the mesh was estimated last, in rad.
    watched: f64,
    /// Fields at the nodes when the shape was last seen to be an equilibrium of the belt, and not of its mesh alone.
    sound: Vec<SVector<f64, F>>,
    /// The board as it lies flat and at rest.
    flat: Option<Flat>,
    /// Room for the shape by which the active sets are judged; `None` where they do not depend on it.
    shape: Option<Shape>,
    /// Difference between the scenario's potential and the programme's, for their origins.
    potential_of_origin: f64,
    /// Room for the way of an update.
    way: Way<Self>,
}

impl<D: StripModel<F, N>, const F: usize, const N: usize> Led<D, F, N> {
    /// Starts at an equilibrium, given with its solved programme.
    pub(super) fn new(
        equilibrium: &Equilibrium,
        solved: &Solved<D, F, N>,
        moving: &[usize],
    ) -> Result<Self, NoTracker> {
        let problem = equilibrium.problem.clone();
        let (units, origin) = (problem.units(), problem.origin());
        let pose_of = |support: &usize| {
            if *support >= problem.scenario().supports.len() {
                return Err(NoTracker::NoSupport(*support));
            }
            let held = problem.held_pose(*support);
            let Pose { frame, position } = held.ok_or(NoTracker::NotHeld(*support))?;
            Ok(Pose {
                frame,
                position: (position - origin) / units.length,
            })
        };
        let poses = moving.iter().map(pose_of).collect::<Result<_, _>>()?;
        let follower = Self::follower(&problem, solved.program.clone(), &solved.at)?;
        let (program, point) = (&solved.program, &solved.at.point);
        let stored = program.elastic_energy(&point.fields) + program.load_potential(&point.poses);
        Ok(Self {
            moving: moving.to_vec(),
            poses,
            is_graded_anew: D::is_graded_anew(&problem),
            since_graded: 0.0,
            watched: largest_change(program, point),
            sound: Vec::new(),
            flat: Flat::of(&solved.program),
            shape: D::shape(&problem, &solved.program, point),
            potential_of_origin: equilibrium.energy - stored * units.energy,
            problem,
            follower,
            way: Way::default(),
        })
    }

    /// Starts to follow a minimum.
    fn follower(
        problem: &Problem,
        program: BeltProgram<D, F, N>,
        minimum: &Stationary<BeltPoint<F>>,
    ) -> Result<Follower<BeltProgram<D, F, N>, 6, F, N>, NoTracker> {
        let settings = FollowSettings {
            tolerance: problem.tolerance(),
            smallest_jump: problem.snap_size(),
            jumps: false,
        };
        Follower::new(program, settings, minimum).ok_or(NoTracker::NoMinimum)
    }

    /// As [`Tracker::moving`](super::Tracker::moving).
    pub(super) fn moving(&self) -> &[usize] {
        &self.moving
    }

    /// As [`Tracker::supports`](super::Tracker::supports).
    pub(super) fn supports(&self) -> Vec<f64> {
        let supports = self.problem.scenario().supports.iter();
        let arc_length = |support: &SupportSpec| support.at.arc_length(self.units().length);
        supports.map(arc_length).collect()
    }

    /// As [`Tracker::update`](super::Tracker::update).
    pub(super) fn update(
        &mut self,
        goals: &[Goal],
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Update, ScenarioError> {
        self.check(goals)?;
        let mut is_stopped = false;
        let proceed = &mut || {
            is_stopped = is_stopped || proceed().is_break();
            match is_stopped {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        };
        let mut way = std::mem::take(&mut self.way);
        way.begin(&self.poses, self.goal_poses(goals));
        self.follower.depart();
        let mut status = match self.is_out_of_reach(&way) {
            true => Status::Infeasible,
            false => self.lead(&mut way, proceed),
        };
        if way.reached > 0.0 {
            let carried = self.follow_error(&mut way, proceed);
            if carried != Status::Converged {
                status = carried;
                self.return_to_start_of(&mut way);
            }
        }
        let units = self.units();
        let update = Update {
            message: self.message(status, &way, is_stopped),
            fraction: match status {
                Status::Converged => 1.0,
                _ => way.reached,
            },
            solved_afresh: way.solved_afresh && status == Status::Converged,
            snapped: way.jump > 0.0,
            jump: way.jump * units.length,
            released: way.released * units.energy,
            ..self.report(status, way.iterations)
        };
        way.start = None;
        self.way = way;
        Ok(update)
    }

    /// What holds of the present shape, whatever has led to it.
    fn report(&mut self, status: Status, iterations: usize) -> Update {
        Update {
            status,
            message: String::new(),
            fraction: 0.0,
            solved_afresh: false,
            taut: self.is_taut(),
            snapped: false,
            jump: 0.0,
            released: 0.0,
            energy: self.energy(),
            iterations,
            residuals: self.follower.residuals(),
        }
    }

    /// Poses that the moving supports are to take, in the units of the programme.
    fn goal_poses(&self, goals: &[Goal]) -> impl Iterator<Item = Pose> {
        let supports = &self.follower.program().supports;
        let moving = self.moving.iter().zip(&self.poses);
        moving.map(|(support, pose)| {
            let turns = supports[*support].hold.frame().is_some();
            let of_support = goals.iter().filter(|goal| goal.support == *support);
            of_support.fold(*pose, |pose, goal| Pose {
                frame: match goal.rotation.filter(|_| turns) {
                    Some(rotation) => exp(&rotation),
                    None => pose.frame,
                },
                position: goal.position.map_or(pose.position, |position| {
                    (position - self.problem.origin()) / self.units().length
                }),
            })
        })
    }

    /// Why goals were not reached, for people; empty where they were.
    fn message(&self, status: Status, way: &Way<Self>, is_stopped: bool) -> String {
        let too_far = || self.problem_at(way.poses(1.0)).ok()?.unreachable_supports();
        match status {
            Status::Converged => String::new(),
            Status::Infeasible => too_far().map_or_else(
                || "no shape of the belt meets the supports there".to_owned(),
                |too_far| too_far.to_string(),
            ),
            Status::NotConverged if is_stopped && way.reached > 0.0 => {
                "stopped on the way: update again to go on".to_owned()
            }
            Status::NotConverged if is_stopped => {
                "stopped before the next equilibrium on the way: allow more to go on".to_owned()
            }
            Status::NotConverged => {
                "no minimum was found farther on the way, nor at its end: move there in smaller steps"
                    .to_owned()
            }
        }
    }

    /// As [`Tracker::check`](super::Tracker::check).
    pub(super) fn check(&self, goals: &[Goal]) -> Result<(), ScenarioError> {
        goals.iter().try_for_each(|goal| {
            if !self.moving.contains(&goal.support) {
                return Err(ScenarioError::invalid(
                    format!("supports[{}]", goal.support),
                    "a support that does not move",
                    "the supports that the tracker moves",
                ));
            }
            let (position, rotation) = (goal.position.as_ref(), goal.rotation.as_ref());
            self.problem
                .check_support_pose(goal.support, position, rotation)
        })
    }

    /// Whether the end of a way is proved to be out of reach. The proof is only tried where the belt is nearly straight there.
    fn is_out_of_reach(&self, way: &Way<Self>) -> bool {
        let poses = way.poses(1.0);
        self.is_nearly_straight(poses.clone())
            && self
                .problem_at(poses)
                .is_ok_and(|problem| problem.unreachable_supports().is_some())
    }

    /// Whether the shape leaves reactions open. This is only tried where the belt is nearly straight.
    fn is_taut(&self) -> bool {
        self.is_nearly_straight(self.poses.iter().copied())
            && self.follower.program().undetermined(self.point()).is_some()
    }

    /// Whether the belt is nearly straight from a moving support, at a given pose, to any other support.
    fn is_nearly_straight(&self, poses: impl Iterator<Item = Pose> + Clone) -> bool {
        /// Distance over the flexible length of the belt in between.
        const NEARLY: f64 = 0.9;
        let Scenario { belt, supports, .. } = self.problem.scenario();
        let length = belt.length();
        let rigid = |segment: &&SegmentSpec| matches!(segment, SegmentSpec::Rigid { .. });
        let stiff = belt.segments.iter().filter(rigid);
        let stiff: f64 = stiff.map(SegmentSpec::length).sum();
        let held = |support: usize| {
            let mut moving = self.moving.iter().zip(poses.clone());
            let moved = moving.find_map(|(i, pose)| (*i == support).then_some(pose));
            match moved {
                Some(pose) => self.in_scenario(&pose).position.data.0[0].map(Some),
                None => supports[support].components(),
            }
        };
        let is_nearly_straight = |from: usize, to: usize| {
            let [start, end] = [from, to].map(|support| supports[support].at.arc_length(length));
            let way = (end - start).abs();
            let between = if belt.closed {
                way.min(length - way)
            } else {
                way
            };
            let (from, to) = (held(from), held(to));
            let along = |k: usize| to[k].zip(from[k]).map_or(0.0, |(to, from)| to - from);
            Vector3::from_fn(|k, _| along(k)).norm() > NEARLY * (between - stiff)
        };
        let mut moving = self.moving.iter();
        moving
            .any(|from| (0..supports.len()).any(|to| to != *from && is_nearly_straight(*from, to)))
    }

    fn is_settled(&mut self) -> bool {
        let Some(shape) = &mut self.shape else {
            return true;
        };
        shape.move_to(&self.problem, self.follower.point());
        D::active_set_fault(self.follower.program(), shape).is_none()
    }

    /// Returns to the minimum of the last departure.
    fn return_to_start(&mut self) {
        let moving = self.moving.iter().zip(&self.poses);
        self.follower.return_to_start(|program| {
            moving.for_each(|(support, pose)| program.move_support(*support, pose));
        });
    }

    fn units(&self) -> Units {
        self.problem.units()
    }

    /// A pose of the programme in the units of the scenario.
    fn in_scenario(&self, pose: &Pose) -> Pose {
        Pose {
            frame: pose.frame,
            position: self.problem.origin() + pose.position * self.units().length,
        }
    }

    /// The problem with the moving supports at other poses. The programme keeps its origin, even if the origin is one of them.
    fn problem_at(&self, poses: impl Iterator<Item = Pose>) -> Result<Problem, ScenarioError> {
        let poses = poses.map(|pose| self.in_scenario(&pose));
        let moved = self.moving.iter().copied().zip(poses);
        let moved = self.problem.with_support_poses(moved)?;
        Ok(moved.about(self.problem.origin()))
    }

    /// The problem with the moving supports at their present poses.
    fn present_problem(&self) -> Problem {
        let problem = self.problem_at(self.poses.iter().copied());
        problem.expect("the poses were checked before the belt was led there")
    }

    /// As [`Tracker::equilibrium`](super::Tracker::equilibrium).
    pub(super) fn equilibrium(&mut self) -> Equilibrium {
        self.present(D::of_solution)
    }

    /// The present equilibrium, made of the problem, its programme and the solution.
    fn present(
        &mut self,
        of: fn(&Problem, BeltProgram<D, F, N>, Solution<BeltPoint<F>>) -> Equilibrium,
    ) -> Equilibrium {
        let problem = self.present_problem();
        let solution = self.follower.solution();
        of(&problem, self.follower.program().clone(), solution)
    }

    fn point(&self) -> &BeltPoint<F> {
        self.follower.point()
    }

    /// Total potential.
    pub(super) fn energy(&self) -> f64 {
        self.follower.values().objective * self.units().energy + self.potential_of_origin
    }

    /// Position of a pose of the programme.
    pub(super) fn position(&self, pose: &Pose) -> Vector3<f64> {
        self.in_scenario(pose).position
    }

    /// Positions of the nodes.
    fn world(&self) -> impl Iterator<Item = Vector3<f64>> {
        self.poses().iter().map(|pose| self.position(pose))
    }

    /// Poses of the nodes, in the units of the programme.
    pub(super) fn poses(&self) -> &[Pose] {
        &self.point().poses
    }

    /// Arc lengths of the nodes.
    pub(super) fn nodes(&self) -> Vec<f64> {
        let nodes = self.follower.program().nodes();
        nodes.iter().map(|u| u * self.units().length).collect()
    }

    /// Bend at a node.
    pub(super) fn bend(&self, node: usize) -> f64 {
        self.point().fields[node][0] / self.units().length
    }

    /// Rib slope at a node.
    pub(super) fn rib_slope(&self, node: usize) -> f64 {
        self.point().fields[node][1]
    }

    /// As [`Tracker::reaction`](super::Tracker::reaction).
    pub(super) fn reaction(&self, support: usize) -> Wrench {
        let program = self.follower.program();
        let mut wrenches = program.reactions(self.point(), &self.follower.multipliers().equalities);
        if let Some(undetermined) = program.undetermined(self.point()) {
            undetermined.set(f64::NAN, &mut wrenches, &mut [], &mut []);
        }
        self.units().wrench(wrenches[support])
    }
}
