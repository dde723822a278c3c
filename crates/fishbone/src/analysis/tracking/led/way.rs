//! The way of a tracker's supports in one update.

use crate::geometry::{Pose, exp};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// A way of supports from pose to pose, and what has happened on it.
#[derive(Clone)]
pub(super) struct Way<L> {
    legs: Vec<Leg>,
    /// Share of the way that the belt has been led.
    pub(super) reached: f64,
    /// The belt at the start, once it has been led on in parts.
    pub(super) start: Option<Box<L>>,
    pub(super) iterations: usize,
    /// Whether the problem at the end was solved afresh.
    pub(super) solved_afresh: bool,
    /// Largest displacement of a node in a snap, in U.
    pub(super) jump: f64,
    /// Energy released, in mean R_f/U.
    pub(super) released: f64,
}

/// The way of one support.
#[derive(Clone)]
struct Leg {
    from: Pose,
    goal: Pose,
    /// Turn of the support, in its own axes.
    turn: Vector3<f64>,
}

impl<L> Default for Way<L> {
    fn default() -> Self {
        Self {
            legs: Vec::new(),
            reached: 0.0,
            start: None,
            iterations: 0,
            solved_afresh: false,
            jump: 0.0,
            released: 0.0,
        }
    }
}

impl<L> Way<L> {
    /// Becomes the way between poses, in the room of the last one.
    pub(super) fn begin(&mut self, from: &[Pose], goals: impl Iterator<Item = Pose>) {
        let mut legs = std::mem::take(&mut self.legs);
        legs.clear();
        legs.extend(from.iter().zip(goals).map(|(from, goal)| Leg {
            from: *from,
            goal,
            turn: turn_between(&from.frame, &goal.frame),
        }));
        *self = Self {
            legs,
            ..Self::default()
        };
    }

    /// Length, displacements in U and turns in rad.
    pub(super) fn length(&self) -> f64 {
        let way = |leg: &Leg| (leg.goal.position - leg.from.position).norm() + leg.turn.norm();
        self.legs.iter().map(way).sum()
    }

    /// The poses at a share of the way.
    pub(super) fn poses(&self, share: f64) -> impl ExactSizeIterator<Item = Pose> + Clone {
        self.legs.iter().map(move |leg| leg.pose(share))
    }

    pub(super) fn add(&mut self, jump: f64, released: f64) {
        self.jump = self.jump.max(jump);
        self.released += released;
    }
}

impl Leg {
    fn pose(&self, share: f64) -> Pose {
        if share >= 1.0 {
            return self.goal;
        }
        Pose {
            position: self.from.position.lerp(&self.goal.position, share),
            frame: self.from.frame * exp(&(share * self.turn)),
        }
    }
}

/// The turn from one frame to another as a rotation vector in the axes of the first.
fn turn_between(from: &Matrix3<f64>, to: &Matrix3<f64>) -> Vector3<f64> {
    let turn = Rotation3::from_matrix_unchecked(from.tr_mul(to));
    UnitQuaternion::from_rotation_matrix(&turn).scaled_axis()
}
