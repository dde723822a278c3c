//! Motions of a node in the world along the step of its state. Only this file depends on the coordinates of the programme's
//! states.

use super::Motion;
use crate::geometry::Pose;
use crate::problem::program::{NodeSupport, ROWS, Turn};
use nalgebra::Vector3;
use stagewise::{Direction, NodeVector};

/// The motion of a node along the step of its state, a twist about the programme's origin.
pub(in crate::analysis) fn motion<const N: usize>(pose: &Pose, step: &NodeVector<N>) -> Motion {
    let rotation: Vector3<f64> = step.fixed_rows::<3>(3).into_owned();
    Motion {
        translation: step.fixed_rows::<3>(0) + rotation.cross(&pose.position),
        rotation,
    }
}

/// Adds the derivative by the state of a node whose derivatives by its motion are a force and a moment: the transpose of
/// [`motion`].
pub(super) fn add_generalised_force<const N: usize>(
    pose: &Pose,
    force: &Vector3<f64>,
    moment: &Vector3<f64>,
    into: &mut NodeVector<N>,
) {
    let mut by_displacement = into.fixed_rows_mut::<3>(0);
    by_displacement += force;
    let mut by_rotation = into.fixed_rows_mut::<3>(3);
    by_rotation += moment + pose.position.cross(force);
}

/// Adds the derivative of the first-order conditions by the motion of a support, given with its node's pose and its place.
///
/// A support's conditions depend on the turn from its frame to the node's alone. Let the support's frame turn by q and the
/// node's by e: the turn changes by e − q − ½ q × e. So the mixed second derivative of multipliers times conditions is minus
/// their second derivative by e, and −½ m · (q × e) with their moment m.
pub(in crate::analysis) fn add_support_motion<const N: usize>(
    support: &NodeSupport,
    turn: &Turn,
    pose: &Pose,
    place: usize,
    motion: &Motion,
    into: &mut Direction<N>,
) {
    let rotation = &motion.rotation;
    let position = support.held(&motion.translation);
    let frame = turn.jacobian * rotation;
    let missed = position.iter().chain(&frame);
    let rows = &mut into.equalities[ROWS * place..ROWS * (place + 1)];
    for (row, missed) in rows.iter_mut().zip(missed) {
        *row -= missed;
    }
    let moment = -turn.hessian * rotation - 0.5 * turn.generalised_force.cross(rotation);
    let node = &mut into.nodes[support.node];
    add_generalised_force(pose, &Vector3::zeros(), &moment, node);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::exp;

    #[test]
    fn test_generalised_force_does_the_work_of_force_and_moment_along_the_motion() {
        let pose = Pose {
            frame: exp(&Vector3::new(0.4, -0.9, 0.3)),
            position: Vector3::new(0.1, 0.5, -0.2),
        };
        let step = NodeVector::<8>::from_fn(|i, _| 0.3 * i as f64 - 0.8);
        let (force, moment) = (Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.3, 0.7, -1.1));
        let mut generalised_force = NodeVector::<8>::zeros();
        add_generalised_force(&pose, &force, &moment, &mut generalised_force);
        let Motion {
            translation,
            rotation,
        } = motion(&pose, &step);
        let work = force.dot(&translation) + moment.dot(&rotation);
        assert!((generalised_force.dot(&step) - work).abs() < 1e-14);
    }
}
