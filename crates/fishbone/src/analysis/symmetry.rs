//! Symmetry images: shapes that are the same but for a mirror or for an exchange of start and end.

use crate::geometry::Pose;
use nalgebra::{Matrix3, Vector3};

/// Distance of nodes up to which two shapes are the same, in U.
pub(crate) const SAME: f64 = 1e-3;

/// Whether one shape is a symmetry image of the other to within a distance of its nodes, in U: moved as a whole, mirrored or
/// not, run through forwards or backwards. Both have the same mesh.
///
/// A mirror that takes the belt to itself takes its frame, as columns, from R to Q R S: Q is the mirror of space, S the
/// mirror of the belt, diag(±1, 1, ±1), which keeps the spine. Run through backwards, S is diag(±1, −1, ±1).
pub(crate) fn are_images(a: &[Pose], b: &[Pose], within: f64) -> bool {
    /// Largest difference of the frames' entries per difference of positions, in 1/U.
    const TURN: f64 = 10.0;
    let seen = in_frame_of_first(a.iter());
    let is_same = |other: &[Pose]| {
        let sides = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
        sides.into_iter().any(|[normal, across]| {
            let mirror = Matrix3::from_diagonal(&Vector3::new(normal, 1.0, across));
            let differs = |(a, b): (&Pose, &Pose)| {
                (a.position - mirror * b.position).norm() > within
                    || (a.frame - mirror * b.frame * mirror).norm() > TURN * within
            };
            !seen.iter().zip(other).any(differs)
        })
    };
    is_same(&in_frame_of_first(b.iter()))
        || is_same(&in_frame_of_first(
            b.iter().rev().map(turned).collect::<Vec<_>>().iter(),
        ))
}

/// The pose of the belt run through backwards: turned by half a turn about its normal.
fn turned(pose: &Pose) -> Pose {
    let half_turn = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
    Pose {
        frame: pose.frame * half_turn,
        position: pose.position,
    }
}

/// Poses as seen from the first.
fn in_frame_of_first<'a>(poses: impl Iterator<Item = &'a Pose> + Clone) -> Vec<Pose> {
    let first = poses
        .clone()
        .next()
        .map(Pose::inverse)
        .unwrap_or_else(Pose::identity);
    poses.map(|pose| first * *pose).collect()
}
