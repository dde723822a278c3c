//! Obstacles: inequalities of a node's position.

use crate::geometry::{Pose, carried_gradient, carried_hessian, hat};
use nalgebra::{Matrix3, Matrix3x6, Matrix6, Vector3, Vector6};
use std::fmt::Debug;
use std::sync::Arc;

/// A region that points of the belt must not enter, by a function of the point that is positive outside.
pub trait Obstacle: Debug + Send + Sync {
    /// The gap between the obstacle and a point.
    fn gap(&self, point: &Vector3<f64>) -> f64;

    /// Gradient of the gap.
    fn gradient(&self, point: &Vector3<f64>) -> Vector3<f64>;

    /// Second derivative of the gap.
    fn hessian(&self, point: &Vector3<f64>) -> Matrix3<f64>;
}

/// An obstacle that a node must not enter.
#[derive(Debug, Clone)]
pub struct NodeObstacle {
    /// Index of the node.
    pub node: usize,
    /// The obstacle.
    pub obstacle: Arc<dyn Obstacle>,
    /// Share of the belt that the node stands for, in U: the weight of the contact in the barrier.
    pub weight: f64,
}

impl PartialEq for NodeObstacle {
    /// Equality of the node, the obstacle (by identity) and the weight.
    fn eq(&self, other: &Self) -> bool {
        self.node == other.node
            && self.weight == other.weight
            && Arc::ptr_eq(&self.obstacle, &other.obstacle)
    }
}

impl NodeObstacle {
    /// Force of the contact on the belt, world axes, from its multiplier.
    pub fn force(&self, pose: &Pose, multiplier: f64) -> Vector3<f64> {
        multiplier * self.obstacle.gradient(&pose.position)
    }

    pub(super) fn gap(&self, pose: &Pose) -> f64 {
        self.obstacle.gap(&pose.position)
    }

    /// Derivative of the gap by the node's twist about the origin, world axes.
    pub(super) fn gradient(&self, pose: &Pose) -> Vector6<f64> {
        carried_gradient(&pose.position, &self.obstacle.gradient(&pose.position))
    }

    /// Second derivative of the gap by the node's twist.
    pub(super) fn hessian(&self, pose: &Pose) -> Matrix6<f64> {
        let point = &pose.position;
        let curved = self.obstacle.hessian(point);
        let by_twist = by_twist(point);
        by_twist.tr_mul(&(curved * by_twist))
            + carried_hessian(point, &self.obstacle.gradient(point))
    }
}

/// Derivative of a point by a twist about the origin.
fn by_twist(point: &Vector3<f64>) -> Matrix3x6<f64> {
    let mut by_twist = Matrix3x6::identity();
    by_twist.fixed_columns_mut::<3>(3).copy_from(&-hat(point));
    by_twist
}
