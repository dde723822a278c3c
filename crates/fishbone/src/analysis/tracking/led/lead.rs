//! A belt is led along a way of its supports: followed where a tangent leads on, and else searched for.

use super::Led;
use super::way::Way;
use crate::equilibrium::model::{StripModel, snapped_from};
use crate::equilibrium::{Equilibrium, Solved, Status, from_guess};
use crate::geometry::log;
use crate::problem::Mesh;
use crate::problem::program::{BeltPoint, BeltProgram, NodeSupport};
use stagewise::{Distance, Followed, Program};
use std::ops::ControlFlow;

/// Most changes of the active edges, or attempts of one, on the way to a pose, a number.
const SWITCHES: usize = 40;

/// Distance past the loss of an equilibrium at which the belt is let go downhill, in U and rad.
const PAST: f64 = 1e-5;

impl<D: StripModel<F, N>, const F: usize, const N: usize> Led<D, F, N> {
    /// Leads the supports along a way. Next to poses at which the board lies flat no tangent leads on: there it is solved.
    pub(super) fn lead(
        &mut self,
        way: &mut Way<Self>,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Status {
        /// Length of a way without motion, in U and rad.
        const NOWHERE: f64 = 1e-12;
        if way.length() <= NOWHERE {
            // The supports stay, so that many such ways add up.
            way.reached = 1.0;
            return Status::Converged;
        }
        let Some([from, to]) = self.beside_flat(way) else {
            return self.lead_along(way, 1.0, proceed);
        };
        self.remember_start(way);
        for (leg, until) in [from, to, 1.0].into_iter().enumerate() {
            let is_solved = leg == 1 && self.solve_beside_flat(until, way, proceed);
            if is_solved || (until - way.reached) * way.length() <= NOWHERE {
                continue;
            }
            let status = self.lead_along(way, until, proceed);
            if status != Status::Converged {
                return status;
            }
        }
        Status::Converged
    }

    /// Leads the supports up to a share of a way, as far as a tangent leads on. Where the ribs come to other edges, the belt is
    /// followed up to the place, and goes on with these.
    fn lead_along(
        &mut self,
        way: &mut Way<Self>,
        until: f64,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Status {
        if self.follow_in_few_steps(until, way, proceed) {
            return Status::Converged;
        }
        let mut ahead = until;
        for _ in 0..SWITCHES {
            if self.is_graded_anew
                && self.go_on_anew_graded(until, way, proceed)
                && way.reached >= until
            {
                return Status::Converged;
            }
            let done = way.reached;
            let followed = self.follow(ahead, way, proceed);
            let reached = at_share(followed.reached, [done, ahead]);
            if !self.is_settled() {
                let beyond = self.follower.point().clone();
                self.return_to_start();
                self.remember_start(way);
                if proceed().is_break() {
                    return Status::NotConverged;
                }
                if !self.switch_to_edges_of(&beyond, way, proceed) {
                    ahead = 0.5 * (done + reached);
                }
                continue;
            }
            if reached < until {
                self.remember_start(way);
            }
            self.stand_at(reached, way);
            if reached >= until {
                return Status::Converged;
            }
            ahead = until;
            if followed.arrived {
                continue;
            }
            if proceed().is_break() {
                return Status::NotConverged;
            }
            let past = (reached + PAST / way.length()).min(until);
            let shape = self.point().clone();
            if !self.snap_to(&shape, past, way, proceed) {
                break;
            }
            if past >= until {
                return Status::Converged;
            }
        }
        self.solve_at(until, way, proceed)
    }

    /// Follows the minimum from the present share of a way up to another one.
    fn follow(
        &mut self,
        ahead: f64,
        way: &mut Way<Self>,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Followed {
        let done = way.reached;
        let mut change = |program: &mut BeltProgram<D, F, N>, share: f64| {
            let poses = way.poses(at_share(share, [done, ahead]));
            for (support, pose) in self.moving.iter().zip(poses) {
                program.move_support(*support, &pose);
            }
        };
        let length = way.length() * (ahead - done);
        self.follower.depart();
        let followed = self.follower.follow(length, &mut change, proceed);
        way.iterations += followed.iterations;
        followed
    }

    /// Follows a slender belt on its mesh up to a share of a way, where the places where its ribs turn stay within their elements,
    /// or nearly so. False where this takes more than a few steps, and where the belt has been led so far that its mesh has to
    /// be graded anew: the belt is then where it was.
    fn follow_in_few_steps(
        &mut self,
        until: f64,
        way: &mut Way<Self>,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> bool {
        /// Length of the way from one mesh to the next, in V.
        const ON_ONE_MESH: f64 = 0.5;
        /// Greatest number of steps.
        const FEW: usize = 10;
        if !self.is_graded_anew {
            return false;
        }
        let width = self.problem.belt().width / self.units().length;
        self.since_graded += (until - way.reached) * way.length();
        if self.since_graded > ON_ONE_MESH * width {
            self.since_graded = 0.0;
            return false;
        }
        let mut steps = 0..FEW;
        let mut few = || match steps.next() {
            Some(_) => proceed(),
            None => ControlFlow::Break(()),
        };
        let arrived = self.follow(until, way, &mut few).arrived && self.is_settled();
        match arrived {
            true => self.stand_at(until, way),
            false => self.return_to_start(),
        }
        arrived
    }

    /// Takes the share of the way to which the follower has come as the present one.
    fn stand_at(&mut self, share: f64, way: &mut Way<Self>) {
        self.poses.clear();
        self.poses.extend(way.poses(share));
        way.reached = share;
    }

    /// Leads a slender belt on towards a share of a way by a search on a mesh graded anew: on nodes that stay, each place where
    /// its ribs turn passes from element to element, which takes many steps. False where the search finds no minimum that is
    /// surely of the same branch.
    fn go_on_anew_graded(
        &mut self,
        until: f64,
        way: &mut Way<Self>,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> bool {
        /// Parts of the way that are tried in turn, as shares of what is left.
        const PARTS: [f64; 3] = [1.0, 0.5, 0.25];
        for part in PARTS {
            let ahead = at_share(part, [way.reached, until]);
            let Ok(problem) = self.problem_at(way.poses(ahead)) else {
                return false;
            };
            let (program, from) = (self.follower.program(), self.follower.point());
            let Some(found) = D::minimum_graded_anew(&problem, program, from, proceed) else {
                return false;
            };
            way.iterations += found.iterations;
            self.remember_start(way);
            if self.is_smooth_way(&found, ahead, way) && self.restart(&found) {
                self.stand_at(ahead, way);
                return true;
            }
        }
        false
    }

    /// Whether a minimum at a share of a way farther on is of the present branch: its energy differs from the present one by the
    /// work of the supports. A snap releases energy.
    fn is_smooth_way(&self, found: &Equilibrium, ahead: f64, way: &Way<Self>) -> bool {
        /// Energy released over the work of forces and moments, each without its sign, up to which the way is smooth; dimensionless.
        const RELEASED: f64 = 0.01;
        /// Difference of the energies on two meshes over the energy, as much as the least snap releases; dimensionless.
        const OTHER_MESH: f64 = 1e-4;
        if found.status != Status::Converged {
            return false;
        }
        let (mut work, mut most) = (0.0, 0.0);
        let legs = self.moving.iter().zip(way.poses(way.reached));
        for ((support, start), end) in legs.zip(way.poses(ahead)) {
            let [start, end] = [start, end].map(|pose| self.in_scenario(&pose));
            let moved = end.position - start.position;
            let turned = log(&(end.frame * start.frame.transpose()));
            // By the trapezoidal rule, off by the third power of the way.
            for wrench in [self.reaction(*support), found.reactions[*support].wrench] {
                let (force, moment) = (&wrench.force, &wrench.moment);
                work += 0.5 * (force.dot(&moved) + moment.dot(&turned));
                most += 0.5 * (force.norm() * moved.norm() + moment.norm() * turned.norm());
            }
        }
        let released = self.energy() + work - found.energy;
        released.abs() <= RELEASED * most + OTHER_MESH * found.elastic_energy
    }

    /// The part of a way, from share to share, on which the board is solved beside its flat shape: the first part where it is
    /// nearly flat now, the last where the way ends there; `None` of other ways.
    fn beside_flat(&self, way: &Way<Self>) -> Option<[f64; 2]> {
        /// Distance to poses at which the board is flat from which its shape is near to flat, in U and rad.
        const NEAR: f64 = 0.01;
        /// Elastic energy of such a board, in mean R_f/U.
        const ENERGY: f64 = 0.1;
        let flat = self.flat.as_ref()?;
        let is_near = |share: f64| flat.distance(self.supports_at(share, way)) <= 0.5 * NEAR;
        let part = NEAR / way.length();
        let size = self.follower.program().size(self.point());
        match (is_near(0.0) && size <= ENERGY, is_near(1.0)) {
            (true, false) => Some([0.0, part.min(1.0)]),
            (true, true) => Some([0.0, 1.0]),
            (false, true) => Some([(1.0 - part).max(0.0), 1.0]),
            (false, false) => None,
        }
    }

    /// All supports as they are at a share of a way.
    fn supports_at(
        &self,
        share: f64,
        way: &Way<Self>,
    ) -> impl Iterator<Item = NodeSupport> + Clone {
        let supports = self.follower.program().supports.iter().enumerate();
        supports.map(move |(i, support)| {
            let mut support = support.clone();
            let mut moving = self.moving.iter().zip(way.poses(share));
            if let Some((_, pose)) = moving.find(|(moving, _)| **moving == i) {
                support.move_to(&pose);
            }
            support
        })
    }

    /// Solves at a share of a way beside the flat shape; false where this finds no shape near by that can be followed.
    fn solve_beside_flat(
        &mut self,
        until: f64,
        way: &mut Way<Self>,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> bool {
        let Ok(problem) = self.problem_at(way.poses(until)) else {
            return false;
        };
        let found = from_guess(&problem, proceed);
        way.iterations += found.iterations;
        self.remember_start(way);
        let moved = self.present(D::of_solution_on_mesh).displacement(&found);
        let length = (until - way.reached) * way.length();
        // A belt that is shortened by the square of a length leaves its flat shape by much this length.
        let is_near = moved <= length.sqrt() + self.problem.snap_size();
        let is_taken = is_near && self.restart(&found);
        if is_taken {
            self.stand_at(until, way);
        }
        is_taken
    }

    /// Remembers the belt at the start of a way, before it is first led to other poses, or to another mesh or other edges.
    fn remember_start(&mut self, way: &mut Way<Self>) {
        if way.start.is_none() {
            let mut start = self.clone();
            start.return_to_start();
            way.start = Some(Box::new(start));
        }
    }

    /// Returns to the start of a way, as if nothing had happened on it.
    pub(super) fn return_to_start_of(&mut self, way: &mut Way<Self>) {
        if let Some(start) = way.start.take() {
            *self = *start;
        } else {
            self.poses.clear();
            self.poses.extend(way.poses(0.0));
            self.return_to_start();
        }
        (way.reached, way.jump, way.released) = (0.0, 0.0, 0.0);
    }

    /// Takes the active edges of a shape near by; false where these are not right for the present shape.
    fn switch_to_edges_of(
        &mut self,
        shape: &BeltPoint<F>,
        way: &mut Way<Self>,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> bool {
        let problem = self.present_problem();
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

    /// Snaps to the minimum downhill from a shape, at a share of the way a little farther on, with the active edges that are right
    /// there; false where there is none.
    fn snap_to(
        &mut self,
        shape: &BeltPoint<F>,
        past: f64,
        way: &mut Way<Self>,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> bool {
        let Ok(problem) = self.problem_at(way.poses(past)) else {
            return false;
        };
        let mesh = Mesh::of(&problem, self.follower.program());
        let found = snapped_from::<D, F, N>(&problem, &mesh, shape, proceed);
        found.is_some_and(|found| self.take(&found, past, way))
    }

    /// Solves at a share of a way up to which the belt could not be followed.
    fn solve_at(
        &mut self,
        until: f64,
        way: &mut Way<Self>,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Status {
        let Ok(problem) = self.problem_at(way.poses(until)) else {
            return Status::Infeasible;
        };
        let mesh = Mesh::of(&problem, self.follower.program());
        let found = D::solve_near(&problem, &mesh, self.follower.point(), proceed);
        way.solved_afresh = true;
        match self.take(&found, until, way) {
            true => Status::Converged,
            false if found.status == Status::Infeasible => Status::Infeasible,
            false => Status::NotConverged,
        }
    }

    /// Takes over an equilibrium to which the belt has gone at a share of a way; false where there is none to follow.
    fn take(&mut self, found: &Equilibrium, share: f64, way: &mut Way<Self>) -> bool {
        way.iterations += found.iterations;
        self.remember_start(way);
        let (energy, before) = (self.energy(), self.point().clone());
        if !self.restart(found) {
            return false;
        }
        self.stand_at(share, way);
        let jump = self.point().distance(&before);
        let released = energy - self.energy();
        if self.problem.is_snap(jump, released, found.elastic_energy) {
            way.add(jump, released / self.units().energy);
        }
        true
    }

    /// Starts anew at an equilibrium; false where there is none to follow.
    pub(super) fn restart(&mut self, found: &Equilibrium) -> bool {
        let other = found.certified().ok();
        match other.and_then(|solved| Self::new(found, solved, &self.moving).ok()) {
            Some(other) => {
                let watched = self.watched.max(other.watched);
                *self = Self { watched, ..other };
                true
            }
            None => false,
        }
    }
}

/// The place at a share of a part of a way, given by its ends.
fn at_share(share: f64, [from, to]: [f64; 2]) -> f64 {
    match share >= 1.0 {
        true => to,
        false => from + share * (to - from),
    }
}
