//! The way of a tracker's support in one update.

use crate::equilibrium::Equilibrium;
use crate::geometry::{Pose, exp};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// A way of the support from pose to pose, and what has happened on it.
pub(super) struct Way {
    pub(super) from: Pose,
    pub(super) goal: Pose,
    /// Turn of the support, in its own axes.
    pub(super) turn: Vector3<f64>,
    /// The equilibrium at its start, once the belt has been led on in parts.
    pub(super) start: Option<Equilibrium>,
    pub(super) iterations: usize,
    /// Whether the problem at its end was solved afresh.
    pub(super) solved_afresh: bool,
    /// Largest displacement of a node in a snap, in U.
    pub(super) jump: f64,
    /// Energy released, in mean R_f/U.
    pub(super) released: f64,
}

impl Way {
    pub(super) fn new(from: Pose, goal: Pose) -> Self {
        let mut way = Self {
            from,
            goal,
            turn: Vector3::zeros(),
            start: None,
            iterations: 0,
            solved_afresh: false,
            jump: 0.0,
            released: 0.0,
        };
        way.redirect(from, goal);
        way
    }

    /// Takes other ends, with what has happened so far.
    pub(super) fn redirect(&mut self, from: Pose, goal: Pose) {
        (self.from, self.goal) = (from, goal);
        self.turn = turn_between(&from.frame, &goal.frame);
    }

    /// Length, displacement in U and turn in rad.
    pub(super) fn length(&self) -> f64 {
        (self.goal.position - self.from.position).norm() + self.turn.norm()
    }

    /// The pose at a share of the way.
    pub(super) fn pose(&self, share: f64) -> Pose {
        if share >= 1.0 {
            return self.goal;
        }
        Pose {
            position: self.from.position.lerp(&self.goal.position, share),
            frame: self.from.frame * exp(&(share * self.turn)),
        }
    }

    pub(super) fn add(&mut self, jump: f64, released: f64) {
        self.jump = self.jump.max(jump);
        self.released += released;
    }
}

/// Distance of two poses, displacement in U and turn in rad.
pub(super) fn distance(from: &Pose, to: &Pose) -> f64 {
    (to.position - from.position).norm() + turn_between(&from.frame, &to.frame).norm()
}

/// The turn from one frame to another as a rotation vector in the axes of the first.
fn turn_between(from: &Matrix3<f64>, to: &Matrix3<f64>) -> Vector3<f64> {
    let turn = Rotation3::from_matrix_unchecked(from.tr_mul(to));
    UnitQuaternion::from_rotation_matrix(&turn).scaled_axis()
}
