//! Symmetry images: shapes that are the same but for a mirror, for an exchange of start and end, or for sliding along
//! themselves.

use crate::geometry::Pose;
use nalgebra::{Matrix3, Vector3};

/// Distance of nodes up to which two shapes are the same, in U.
pub(crate) const SAME: f64 = 1e-3;

/// Whether one shape is a symmetry image of the other to within a distance of its nodes, in U: moved as a whole, mirrored or
/// not, run through forwards or backwards. Both have the same mesh.
pub(crate) fn are_images(a: &[Pose], b: &[Pose], within: f64) -> bool {
    distance(a, b) <= within
}

/// Whether one shape of a closed uniform belt is a symmetry image of the other that may have slid along itself. `u` are the
/// arc lengths of the nodes, in U.
pub(crate) fn are_images_slid(
    a: &[Pose],
    b: &[Pose],
    u: &[f64],
    half_turns: i32,
    within: f64,
) -> bool {
    /// Times that the interval with the nearest image is cut by a third, a number.
    const CUTS: usize = 24;
    let slid = |by: f64| distance(a, &slid(b, u, half_turns, by));
    let distances = u
        .iter()
        .skip(1)
        .enumerate()
        .map(|(k, by)| (k + 1, slid(*by)));
    let Some((nearest, _)) = distances.min_by(|a, b| a.1.total_cmp(&b.1)) else {
        return false;
    };
    let [mut low, mut high] = [
        u[nearest - 1],
        u.get(nearest + 1).copied().unwrap_or(1.0 + u[1]),
    ];
    for _ in 0..CUTS {
        let third = (high - low) / 3.0;
        match slid(low + third) < slid(high - third) {
            true => high -= third,
            false => low += third,
        }
    }
    slid(0.5 * (low + high)) <= within
}

/// Poses of a shape at given places of its spine. `u` are the arc lengths of its nodes, in U.
pub(crate) fn sampled(poses: &[Pose], u: &[f64], places: &[f64]) -> Vec<Pose> {
    places
        .iter()
        .map(|place| pose_at(poses, u, *place))
        .collect()
}

/// The pose at a place between two nodes, on the screw from one to the other.
fn pose_at(poses: &[Pose], u: &[f64], place: f64) -> Pose {
    let k = u.partition_point(|u| *u <= place).clamp(1, u.len() - 1) - 1;
    let step = (poses[k + 1] * poses[k].inverse()).log();
    let share = (place - u[k]) / (u[k + 1] - u[k]);
    Pose::exp(&(step * share)) * poses[k]
}

/// The shape of a closed belt whose nodes have moved on along the spine, less than once round.
fn slid(poses: &[Pose], u: &[f64], half_turns: i32, by: f64) -> Vec<Pose> {
    let flip = if half_turns % 2 == 0 { 1.0 } else { -1.0 };
    let across_seam = Matrix3::from_diagonal(&Vector3::new(flip, 1.0, flip));
    let at = |u_node: &f64| {
        let whole = u_node + by;
        let pose = pose_at(poses, u, whole % 1.0);
        match whole.floor() as i32 % 2 {
            0 => pose,
            _ => Pose {
                frame: pose.frame * across_seam,
                ..pose
            },
        }
    };
    u.iter().map(at).collect()
}

/// Least distance of the nodes of one shape from those of a symmetry image of the other, in U; a difference of frames
/// counts too.
///
/// A mirror that takes the belt to itself takes its frame, as columns, from R to Q R S: Q is the mirror of space, S the
/// mirror of the belt, diag(±1, 1, ±1), which keeps the spine. Run through backwards, S is diag(±1, −1, ±1).
fn distance(a: &[Pose], b: &[Pose]) -> f64 {
    /// Largest difference of the frames' entries per difference of positions, in 1/U.
    const TURN: f64 = 10.0;
    let seen = in_frame_of_first(a.iter());
    let of = |other: &[Pose]| {
        let sides = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
        let distances = sides.into_iter().map(|[normal, across]| {
            let mirror = Matrix3::from_diagonal(&Vector3::new(normal, 1.0, across));
            let between = |(a, b): (&Pose, &Pose)| {
                let moved = (a.position - mirror * b.position).norm();
                moved.max((a.frame - mirror * b.frame * mirror).norm() / TURN)
            };
            seen.iter().zip(other).map(between).fold(0.0, f64::max)
        });
        distances.fold(f64::INFINITY, f64::min)
    };
    let backwards: Vec<_> = b.iter().rev().map(turned).collect();
    of(&in_frame_of_first(b.iter())).min(of(&in_frame_of_first(backwards.iter())))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::exp;
    use std::f64::consts::PI;

    /// Nodes of an oval of one axis 0.2 and another, with half turns spread out along it, from a place on.
    fn oval(other_axis: f64, half_turns: i32, from: f64) -> Vec<Pose> {
        let at = |k: usize| {
            let place = from + k as f64 / NODES as f64;
            let (sine, cosine) = (2.0 * PI * place).sin_cos();
            let tangent = Vector3::new(-0.2 * sine, other_axis * cosine, 0.0).normalize();
            let level =
                Matrix3::from_columns(&[tangent.cross(&Vector3::z()), tangent, Vector3::z()]);
            Pose {
                frame: level * exp(&(Vector3::y() * (PI * f64::from(half_turns) * place))),
                position: Vector3::new(0.2 * cosine, other_axis * sine, 0.0),
            }
        };
        (0..=NODES).map(at).collect()
    }

    /// Elements of a test's belt, a number.
    const NODES: usize = 80;

    #[test]
    fn test_closed_belts_are_the_same_wherever_their_seam_is() {
        let u: Vec<f64> = (0..=NODES).map(|k| k as f64 / NODES as f64).collect();
        let elsewhere = Pose {
            frame: exp(&Vector3::new(0.3, -1.0, 0.4)),
            position: Vector3::new(1.0, 2.0, 3.0),
        };
        for half_turns in [0, 1, 3] {
            let first = oval(0.1, half_turns, 0.0);
            let moved = |poses: Vec<Pose>| -> Vec<Pose> {
                poses.into_iter().map(|pose| elsewhere * pose).collect()
            };
            let slid = moved(oval(0.1, half_turns, 0.3147));
            assert!(!are_images(&first, &slid, SAME));
            assert!(are_images_slid(&first, &slid, &u, half_turns, SAME));
            let other = moved(oval(0.12, half_turns, 0.3147));
            assert!(!are_images_slid(&first, &other, &u, half_turns, SAME));
        }
    }
}
