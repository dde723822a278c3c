//! Tracking: an equilibrium is followed at the rate of a robot while one of its supports moves.

use crate::equilibrium::{Equilibrium, Status, Uncertified, of_solution, solve_near};
use crate::geometry::{Pose, Wrench, exp};
use crate::names::named;
use crate::problem::program::{BeltPoint, BeltProgram};
use crate::problem::{Mesh, Problem, Units};
use crate::scenario::error::ScenarioError;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use stagewise::{Distance, FollowSettings, Followed, Follower, Residuals};
use std::ops::ControlFlow;
use thiserror::Error;

/// Distance between equilibria up to which a step downhill is no snap, in U: a rib bound that passes from one element to the
/// next moves the belt by as much.
const SMALLEST_JUMP: f64 = 2e-3;
/// Distance between shapes up to which a change of active edges is no snap, in U: ribs held by another edge move the belt
/// less.
const SAME_SHAPE: f64 = 0.01;

/// The reason why an equilibrium cannot be followed.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum NoTracker {
    /// There is no equilibrium.
    #[error(transparent)]
    Uncertified(#[from] Uncertified),
    /// The support does not hold all of a pose.
    #[error(
        "supports[{0}] does not hold a position and a rotation, all of both: nothing can be moved there"
    )]
    NotClamped(usize),
    /// There is no such support.
    #[error("the scenario has no supports[{0}] that could move")]
    NoSupport(usize),
    /// The shape may change at no cost of energy.
    #[error("the equilibrium is no strict minimum of the energy: there is no one branch to follow")]
    Marginal,
}

named!(impl NoTracker {
    NotClamped = "not_clamped",
    NoSupport = "no_support",
    Marginal = "marginal",
    ..Uncertified,
});

/// The outcome of a motion of the support.
#[derive(Debug, Clone, PartialEq)]
pub struct Update {
    /// Whether the belt is in equilibrium under the new pose; unless converged, the tracker keeps its last pose.
    pub status: Status,
    /// Whether the equilibrium that was followed ceased to exist or to be stable on the way, or could not be followed, and
    /// the belt has snapped to another equilibrium.
    pub snapped: bool,
    /// Total potential of the tracker's present shape.
    pub energy: f64,
    /// Iterations.
    pub iterations: usize,
    /// Residuals of the shape's discrete equations.
    pub residuals: Residuals,
}

/// An equilibrium and the support that moves.
pub struct Tracker {
    /// The problem at the tracker's start.
    problem: Problem,
    support: usize,
    follower: Follower<BeltProgram, 6, 2, 8>,
    /// Present pose of the support, in the units of the programme.
    pose: Pose,
    /// Difference between the scenario's potential and the programme's, for their origins.
    potential_of_origin: f64,
}

impl Tracker {
    /// Starts at an equilibrium; the support is named by its place in the scenario.
    ///
    /// # Errors
    ///
    /// [`NoTracker`] unless it has converged to a strict minimum and the support holds position and rotation.
    pub fn new(equilibrium: &Equilibrium, support: usize) -> Result<Self, NoTracker> {
        let solved = equilibrium.certified()?;
        let problem = equilibrium.problem.clone();
        if support >= problem.scenario().supports.len() {
            return Err(NoTracker::NoSupport(support));
        }
        let Pose { frame, position } = problem
            .clamp(support)
            .ok_or(NoTracker::NotClamped(support))?;
        let settings = FollowSettings {
            tolerance: problem.tolerance(),
            smallest_jump: SMALLEST_JUMP,
        };
        let follower = Follower::new(solved.program.clone(), settings, &solved.at);
        let follower = follower.ok_or(NoTracker::Marginal)?;
        let (units, origin) = (problem.units(), problem.origin());
        let (program, point) = (&solved.program, &solved.at.point);
        let stored = program.elastic_energy(&point.fields) + program.load_potential(&point.poses);
        Ok(Self {
            support,
            pose: Pose {
                frame,
                position: (position - origin) / units.length,
            },
            potential_of_origin: equilibrium.energy - stored * units.energy,
            problem,
            follower,
        })
    }

    /// Moves the support to a position and a rotation vector, world axes, and the belt with it.
    ///
    /// Nothing is allocated where the equilibrium is followed and the board has neither links nor bends. `proceed` is asked
    /// during the motion whether to go on; `Break` leaves the tracker at its last pose.
    ///
    /// # Errors
    ///
    /// [`ScenarioError`] for a pose that no scenario may hold: a pose that is not finite, too many lengths of the belt away, or
    /// turned too far. The tracker stays at its last pose.
    pub fn update(
        &mut self,
        position: &Vector3<f64>,
        rotation: &Vector3<f64>,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Update, ScenarioError> {
        let (from, support) = (self.pose, self.support);
        self.problem
            .check_support_pose(support, position, rotation)?;
        let goal = Pose {
            frame: exp(rotation),
            position: (position - self.problem.origin()) / self.units().length,
        };
        let turn = turn_between(&from.frame, &goal.frame);
        let length = (goal.position - from.position).norm() + turn.norm();
        let mut change = |program: &mut BeltProgram, share: f64| {
            let between = Pose {
                position: from.position.lerp(&goal.position, share),
                frame: match share < 1.0 {
                    true => from.frame * exp(&(share * turn)),
                    false => goal.frame,
                },
            };
            program.move_support(support, &between);
        };
        let followed = self.follower.follow(length, &mut change, proceed);
        if followed.arrived && self.is_settled() {
            self.pose = goal;
            return Ok(Update {
                status: Status::Converged,
                snapped: followed.jumped,
                energy: self.energy(),
                iterations: followed.iterations,
                residuals: followed.residuals,
            });
        }
        let problem = self.problem_at(&goal);
        let problem = problem.expect("the pose has been checked");
        let mesh = Mesh::of(&problem, self.follower.program());
        let found = solve_near(&problem, &mesh, self.follower.point(), proceed);
        Ok(self.take(&found, followed))
    }

    /// Takes over a found equilibrium where the last equilibrium could not be followed, or its active edges have changed.
    fn take(&mut self, found: &Equilibrium, followed: Followed) -> Update {
        let solved = found.solved.as_ref();
        let is_same = |shape: &BeltPoint| shape.distance(self.follower.point()) < SAME_SHAPE;
        let goes_on = followed.arrived && solved.is_some_and(|solved| is_same(&solved.at.point));
        let mut update = Update {
            status: found.status,
            snapped: found.status == Status::Converged && (followed.jumped || !goes_on),
            energy: found.energy,
            iterations: followed.iterations + found.iterations,
            residuals: found.residuals,
        };
        match Self::new(found, self.support) {
            Ok(other) => *self = other,
            Err(_) => {
                self.return_to_start();
                if update.status == Status::Converged {
                    (update.status, update.snapped) = (Status::NotConverged, false);
                }
                update.energy = self.energy();
            }
        }
        update
    }

    fn is_settled(&self) -> bool {
        let (program, point) = (self.follower.program(), self.follower.point());
        self.problem.active_set_fault(program, point).is_none()
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

    /// The present equilibrium, with all its data.
    pub fn equilibrium(&mut self) -> Equilibrium {
        let problem = self.problem_at(&self.pose);
        let problem = problem.expect("the pose was checked before the belt was led there");
        let solution = self.follower.solution();
        of_solution(&problem, self.follower.program().clone(), solution)
    }

    fn point(&self) -> &BeltPoint {
        self.follower.point()
    }

    /// Total potential.
    pub fn energy(&self) -> f64 {
        self.follower.values().objective * self.units().energy + self.potential_of_origin
    }

    /// Positions of the nodes.
    pub fn positions(&self) -> impl Iterator<Item = Vector3<f64>> {
        let poses = self.point().poses.iter();
        poses.map(|pose| self.problem.origin() + pose.position * self.units().length)
    }

    /// Frames of the nodes.
    pub fn frames(&self) -> impl Iterator<Item = &Matrix3<f64>> {
        self.point().poses.iter().map(|pose| &pose.frame)
    }

    /// Bend at the nodes.
    pub fn bends(&self) -> impl Iterator<Item = f64> {
        let fields = self.point().fields.iter();
        fields.map(|fields| fields[0] / self.units().length)
    }

    /// Rib slope at the nodes.
    pub fn rib_slopes(&self) -> impl Iterator<Item = f64> {
        self.point().fields.iter().map(|fields| fields[1])
    }

    /// The reaction of a support on the belt; a component is NaN where the shape does not determine it.
    ///
    /// # Panics
    ///
    /// If there is no such support.
    pub fn reaction(&self, support: usize) -> Wrench {
        let program = self.follower.program();
        let mut wrenches = program.reactions(self.point(), &self.follower.multipliers().equalities);
        if let Some(undetermined) = program.undetermined(self.point()) {
            undetermined.set(f64::NAN, &mut wrenches, &mut [], &mut []);
        }
        self.units().wrench(wrenches[support])
    }
}

/// The turn from one frame to another as a rotation vector in the axes of the first.
fn turn_between(from: &Matrix3<f64>, to: &Matrix3<f64>) -> Vector3<f64> {
    let turn = Rotation3::from_matrix_unchecked(from.tr_mul(to));
    UnitQuaternion::from_rotation_matrix(&turn).scaled_axis()
}
