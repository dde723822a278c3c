//! An equilibrium of any model of the strip, led by one of its supports.

mod mesh;
#[cfg(feature = "io")]
mod stored;
mod way;

use super::{NoTracker, Update};
use crate::equilibrium::model::{StripModel, snapped_from};
use crate::equilibrium::{Equilibrium, Solved, Status, flat_pose, from_guess, largest_change};
use crate::geometry::{Pose, Wrench, exp, log};
use crate::problem::program::{BeltPoint, BeltProgram};
use crate::problem::{Mesh, Problem, Shape, Units};
use crate::scenario::error::ScenarioError;
use crate::scenario::{Scenario, SegmentSpec, SupportSpec};
use nalgebra::{SVector, Vector3};
use stagewise::{Distance, FollowSettings, Follower, Program, Solution, Stationary};
use std::ops::ControlFlow;
use way::{Way, distance};

/// Most changes of the active edges, or attempts of one, on the way to a pose, a number.
const SWITCHES: usize = 40;

/// Distance past the loss of an equilibrium at which the belt is let go downhill, in U and rad.
const PAST: f64 = 1e-5;

/// An equilibrium of a model of the strip and the support that moves.
#[derive(Clone)]
pub(super) struct Led<D: StripModel<F, N>, const F: usize, const N: usize> {
    /// The problem at the tracker's start.
    problem: Problem,
    support: usize,
    follower: Follower<BeltProgram<D, F, N>, 6, F, N>,
    /// Whether the mesh is graded anew on the way.
    is_graded_anew: bool,
    /// Largest change of turning within an element when the error of the mesh was estimated last, in rad.
    watched: f64,
    /// Fields at the nodes when the shape was last seen to be an equilibrium of the belt, and not of its mesh alone.
    sound: Vec<SVector<f64, F>>,
    /// Present pose of the support, in the units of the programme.
    pose: Pose,
    /// Pose of the support at which the board lies flat and at rest, in the units of the programme.
    flat: Option<Pose>,
    /// Room for the shape by which the active sets are judged; `None` where they do not depend on it.
    shape: Option<Shape>,
    /// Difference between the scenario's potential and the programme's, for their origins.
    potential_of_origin: f64,
}

impl<D: StripModel<F, N>, const F: usize, const N: usize> Led<D, F, N> {
    /// Starts at an equilibrium, given with its solved programme.
    pub(super) fn new(
        equilibrium: &Equilibrium,
        solved: &Solved<D, F, N>,
        support: usize,
    ) -> Result<Self, NoTracker> {
        let problem = equilibrium.problem.clone();
        if support >= problem.scenario().supports.len() {
            return Err(NoTracker::NoSupport(support));
        }
        let Pose { frame, position } = problem
            .clamp(support)
            .ok_or(NoTracker::NotClamped(support))?;
        let follower = Self::follower(&problem, solved.program.clone(), &solved.at)?;
        let (units, origin) = (problem.units(), problem.origin());
        let (program, point) = (&solved.program, &solved.at.point);
        let stored = program.elastic_energy(&point.fields) + program.load_potential(&point.poses);
        Ok(Self {
            support,
            is_graded_anew: D::is_graded_anew(&problem),
            watched: largest_change(program, point),
            sound: Vec::new(),
            pose: Pose {
                frame,
                position: (position - origin) / units.length,
            },
            flat: flat_pose(&problem, &solved.program, support),
            shape: D::shape(&problem, &solved.program, point),
            potential_of_origin: equilibrium.energy - stored * units.energy,
            problem,
            follower,
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
        Follower::new(program, settings, minimum).ok_or(NoTracker::Marginal)
    }

    /// As [`Tracker::support`](super::Tracker::support).
    pub(super) fn support(&self) -> usize {
        self.support
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
        position: &Vector3<f64>,
        rotation: &Vector3<f64>,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Update, ScenarioError> {
        let from = self.pose;
        self.check_pose(position, rotation)?;
        let goal = Pose {
            frame: exp(rotation),
            position: (position - self.problem.origin()) / self.units().length,
        };
        let mut way = Way::new(from, goal);
        let mut status = match self.is_out_of_reach(&goal) {
            true => Status::Infeasible,
            false => self.lead(&mut way, proceed),
        };
        if status == Status::Converged {
            status = self.follow_error(&mut way, proceed);
            if status != Status::Converged && way.start.is_none() {
                self.pose = from;
                self.return_to_start();
            }
        }
        if status != Status::Converged {
            (way.jump, way.released) = (0.0, 0.0);
            if let Some(start) = way.start {
                self.restart(&start);
            }
        }
        let units = self.units();
        Ok(Update {
            status,
            message: self.message(status, &goal),
            solved_afresh: way.solved_afresh && status == Status::Converged,
            snapped: way.jump > 0.0,
            jump: way.jump * units.length,
            released: way.released * units.energy,
            energy: self.energy(),
            iterations: way.iterations,
            residuals: self.follower.residuals(),
        })
    }

    /// Why a pose was not reached, for people; empty where it was.
    fn message(&self, status: Status, goal: &Pose) -> String {
        let too_far = || self.problem_at(goal).ok()?.unreachable_supports();
        match status {
            Status::Converged => String::new(),
            Status::Infeasible => too_far().map_or_else(
                || "no shape of the belt meets the supports at this pose".to_owned(),
                |too_far| too_far.to_string(),
            ),
            Status::NotConverged => {
                "no minimum was found on the way to this pose, nor at it: move there in smaller steps"
                    .to_owned()
            }
        }
    }

    /// As [`Tracker::check_pose`](super::Tracker::check_pose).
    pub(super) fn check_pose(
        &self,
        position: &Vector3<f64>,
        rotation: &Vector3<f64>,
    ) -> Result<(), ScenarioError> {
        self.problem
            .check_support_pose(self.support, position, rotation)
    }

    /// Whether a pose is proved to be out of reach. The proof is only tried where the belt is nearly straight to another support.
    fn is_out_of_reach(&self, pose: &Pose) -> bool {
        /// Distance over the flexible length of the belt in between from which the proof is tried.
        const NEARLY: f64 = 0.9;
        let Scenario { belt, supports, .. } = self.problem.scenario();
        let length = belt.length();
        let own = supports[self.support].at.arc_length(length);
        let stiff = belt
            .segments
            .iter()
            .filter(|s| matches!(s, SegmentSpec::Rigid { .. }));
        let stiff: f64 = stiff.map(SegmentSpec::length).sum();
        let position = self.in_scenario(pose).position;
        let is_nearly_straight = |other: &SupportSpec| {
            let way = (other.at.arc_length(length) - own).abs();
            let between = if belt.closed {
                way.min(length - way)
            } else {
                way
            };
            let along = |k: usize| other.components()[k].map_or(0.0, |held| held - position[k]);
            Vector3::from_fn(|k, _| along(k)).norm() > NEARLY * (between - stiff)
        };
        let mut others = supports.iter().enumerate();
        others.any(|(i, other)| i != self.support && is_nearly_straight(other))
            && self
                .problem_at(pose)
                .is_ok_and(|problem| problem.unreachable_supports().is_some())
    }

    /// Leads the support along a way. Next to the pose at which the board lies flat no tangent leads on: there it is solved.
    fn lead(&mut self, way: &mut Way, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> Status {
        /// Length of a way without motion, in U and rad.
        const NOWHERE: f64 = 1e-12;
        let Some([from, to]) = self.beside_flat(way) else {
            return self.lead_along(way, proceed);
        };
        self.remember_start(way);
        let ends = [from, to, 1.0].map(|share| way.pose(share));
        for (leg, end) in ends.into_iter().enumerate() {
            way.redirect(self.pose, end);
            let is_solved = leg == 1 && self.solve_beside_flat(way, proceed);
            if is_solved || way.length() <= NOWHERE {
                continue;
            }
            let status = self.lead_along(way, proceed);
            if status != Status::Converged {
                return status;
            }
        }
        Status::Converged
    }

    /// Leads the support along a way as far as a tangent leads on. Where the ribs come to other edges, the belt is followed up
    /// to the place, and goes on with these.
    fn lead_along(
        &mut self,
        way: &mut Way,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Status {
        let support = self.support;
        let (mut done, mut ahead) = (0.0, 1.0);
        for _ in 0..SWITCHES {
            if self.is_graded_anew
                && let Some(reached) = self.go_on_anew_graded(done, way, proceed)
            {
                done = reached;
                if done >= 1.0 {
                    return Status::Converged;
                }
            }
            let mut change = |program: &mut BeltProgram<D, F, N>, share: f64| {
                program.move_support(support, &way.pose(done + share * (ahead - done)));
            };
            let length = way.length() * (ahead - done);
            let followed = self.follower.follow(length, &mut change, proceed);
            way.iterations += followed.iterations;
            if !followed.arrived {
                self.return_to_start();
                self.remember_start(way);
                if followed.reached * length > PAST {
                    ahead = done + followed.reached * (ahead - done);
                    continue;
                }
                let past = (done + PAST / way.length()).min(1.0);
                let shape = self.point().clone();
                if !self.snap_to(&shape, &way.pose(past), way, proceed) {
                    break;
                }
                if past >= 1.0 {
                    return Status::Converged;
                }
                (done, ahead) = (past, 1.0);
                continue;
            }
            if self.is_settled() {
                self.pose = way.pose(ahead);
                if ahead >= 1.0 {
                    return Status::Converged;
                }
                (done, ahead) = (ahead, 1.0);
                continue;
            }
            let beyond = self.follower.point().clone();
            self.return_to_start();
            self.remember_start(way);
            if !self.switch_to_edges_of(&beyond, way, proceed) {
                ahead = 0.5 * (done + ahead);
            }
        }
        self.solve_at(way, proceed)
    }

    /// Leads a slender belt on from a share of a way by a search on a mesh graded anew: on nodes that stay, each place where its
    /// ribs turn passes from element to element, which takes many steps. Gives the share of the way that is reached; `None`
    /// where the search finds no minimum that is surely of the same branch.
    fn go_on_anew_graded(
        &mut self,
        done: f64,
        way: &mut Way,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<f64> {
        /// Parts of the way that are tried in turn, as shares of what is left.
        const PARTS: [f64; 3] = [1.0, 0.5, 0.25];
        for part in PARTS {
            let ahead = if part < 1.0 {
                done + part * (1.0 - done)
            } else {
                1.0
            };
            let problem = self.problem_at(&way.pose(ahead)).ok()?;
            let (program, from) = (self.follower.program(), self.follower.point());
            let found = D::minimum_graded_anew(&problem, program, from, proceed)?;
            way.iterations += found.iterations;
            self.remember_start(way);
            if self.is_smooth_way(&found, [done, ahead], way) && self.restart(&found) {
                self.pose = way.pose(ahead);
                return Some(ahead);
            }
        }
        None
    }

    /// Whether a minimum at the end of a part of a way, given by its shares, is of the present branch: its energy differs from
    /// the present one by the work of the support. A snap releases energy.
    fn is_smooth_way(&self, found: &Equilibrium, [done, ahead]: [f64; 2], way: &Way) -> bool {
        /// Energy released over the work of force and moment, each without its sign, up to which the way is smooth; dimensionless.
        const RELEASED: f64 = 0.01;
        if found.status != Status::Converged {
            return false;
        }
        let [start, end] = [done, ahead].map(|share| self.in_scenario(&way.pose(share)));
        let moved = end.position - start.position;
        let turned = log(&(end.frame * start.frame.transpose()));
        let wrenches = [
            self.reaction(self.support),
            found.reactions[self.support].wrench,
        ];
        // By the trapezoidal rule, off by the third power of the way.
        let [work, most] = [0, 1].map(|i| {
            let of_wrench = |wrench: &Wrench| {
                let (force, moment) = (&wrench.force, &wrench.moment);
                match i {
                    0 => force.dot(&moved) + moment.dot(&turned),
                    _ => force.norm() * moved.norm() + moment.norm() * turned.norm(),
                }
            };
            0.5 * wrenches.iter().map(of_wrench).sum::<f64>()
        });
        let released = self.energy() + work - found.energy;
        let by_meshes = self.problem.accuracy() * found.elastic_energy;
        released.abs() <= RELEASED * (most + by_meshes)
    }

    /// The part of a way, from share to share, on which the board is solved beside its flat shape: the first part where it is
    /// nearly flat now, the last where the way ends there; `None` of other ways.
    fn beside_flat(&self, way: &Way) -> Option<[f64; 2]> {
        /// Distance to the pose at which the board is flat from which its shape is near to flat, in U and rad.
        const NEAR: f64 = 0.01;
        /// Elastic energy of such a board, in mean R_f/U.
        const ENERGY: f64 = 0.1;
        let flat = self.flat.as_ref()?;
        let is_near = |pose: &Pose| distance(pose, flat) <= 0.5 * NEAR;
        let part = NEAR / way.length();
        let size = self.follower.program().size(self.point());
        match (is_near(&way.from) && size <= ENERGY, is_near(&way.goal)) {
            (true, false) => Some([0.0, part.min(1.0)]),
            (true, true) => Some([0.0, 1.0]),
            (false, true) => Some([(1.0 - part).max(0.0), 1.0]),
            (false, false) => None,
        }
    }

    /// Solves at the end of a way beside the flat shape; false where this finds no shape near by that can be followed.
    fn solve_beside_flat(
        &mut self,
        way: &mut Way,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> bool {
        let Ok(problem) = self.problem_at(&way.goal) else {
            return false;
        };
        let found = from_guess(&problem, proceed);
        way.iterations += found.iterations;
        self.remember_start(way);
        let moved = self.present(D::of_solution_on_mesh).displacement(&found);
        // A belt that is shortened by the square of a length leaves its flat shape by much this length.
        moved <= way.length().sqrt() + self.problem.snap_size() && self.restart(&found)
    }

    fn remember_start(&mut self, way: &mut Way) {
        if way.start.is_none() {
            way.start = Some(self.present(D::of_solution_on_mesh));
        }
    }

    /// Takes the active edges of a shape near by; false where these are not right for the present shape.
    fn switch_to_edges_of(
        &mut self,
        shape: &BeltPoint<F>,
        way: &mut Way,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> bool {
        let Ok(problem) = self.problem_at(&self.pose) else {
            return false;
        };
        let mut program = self.follower.program().clone();
        D::choose_active_sets(&problem, &mut program, shape);
        let mesh = Mesh::of(&problem, &program);
        let found = D::minimum_next_to(&problem, &mesh, self.follower.point(), proceed);
        way.iterations += found.iterations;
        let is_near = |solved: &Solved<D, F, N>| {
            solved.program.edges == program.edges
                && solved.at.point.distance(self.follower.point()) <= problem.snap_size()
        };
        found.certified().is_ok_and(is_near) && self.restart(&found)
    }

    /// Snaps to the minimum downhill from a shape, with the active edges that are right there; false where there is none.
    fn snap_to(
        &mut self,
        shape: &BeltPoint<F>,
        pose: &Pose,
        way: &mut Way,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> bool {
        let Ok(problem) = self.problem_at(pose) else {
            return false;
        };
        let mesh = Mesh::of(&problem, self.follower.program());
        let found = snapped_from::<D, F, N>(&problem, &mesh, shape, proceed);
        found.is_some_and(|found| self.take(&found, way))
    }

    /// Solves at the end of a way on which the belt could not be followed.
    fn solve_at(&mut self, way: &mut Way, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> Status {
        let goal = way.goal;
        let Ok(problem) = self.problem_at(&goal) else {
            self.return_to_start();
            return Status::Infeasible;
        };
        let mesh = Mesh::of(&problem, self.follower.program());
        let found = D::solve_near(&problem, &mesh, self.follower.point(), proceed);
        way.solved_afresh = true;
        match self.take(&found, way) {
            true => Status::Converged,
            false if found.status == Status::Infeasible => Status::Infeasible,
            false => Status::NotConverged,
        }
    }

    /// Takes over an equilibrium to which the belt has gone; false where there is none to follow.
    fn take(&mut self, found: &Equilibrium, way: &mut Way) -> bool {
        way.iterations += found.iterations;
        let (energy, before) = (self.energy(), self.point().clone());
        if !self.restart(found) {
            self.return_to_start();
            return false;
        }
        let jump = self.point().distance(&before);
        let released = energy - self.energy();
        if self.problem.is_snap(jump, released, found.elastic_energy) {
            way.add(jump, released / self.units().energy);
        }
        true
    }

    fn restart(&mut self, found: &Equilibrium) -> bool {
        let other = found.certified().ok();
        match other.and_then(|solved| Self::new(found, solved, self.support).ok()) {
            Some(other) => {
                let watched = self.watched.max(other.watched);
                *self = Self { watched, ..other };
                true
            }
            None => false,
        }
    }

    fn is_settled(&mut self) -> bool {
        let Some(shape) = &mut self.shape else {
            return true;
        };
        shape.move_to(&self.problem, self.follower.point());
        D::active_set_fault(self.follower.program(), shape).is_none()
    }

    fn return_to_start(&mut self) {
        let (support, pose) = (self.support, self.pose);
        self.follower
            .return_to_start(|program| program.move_support(support, &pose));
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

    /// The problem with the support at another pose. The programme keeps its origin, even if the origin is the moving
    /// support.
    fn problem_at(&self, pose: &Pose) -> Result<Problem, ScenarioError> {
        let pose = self.in_scenario(pose);
        let moved = self.problem.with_support_pose(self.support, &pose)?;
        Ok(moved.about(self.problem.origin()))
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
        let problem = self.problem_at(&self.pose);
        let problem = problem.expect("the pose was checked before the belt was led there");
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
