//! Half turns of a closed belt, counted on its shape: twist plus writhe.

use crate::strip::spine::Spine;
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use std::f64::consts::{PI, TAU};

/// The signed half turns that a closed belt has made; `None` of an open one.
///
/// Twist plus writhe is the linking number of the two edges, half the number of half turns (Călugăreanu, White, Fuller).
/// Where a belt passes through itself the number changes by four; the frames alone determine it up to a multiple of four. Of
/// a shape that touches itself the writhe is in doubt, and the number closest to the initial one that agrees with the frames
/// is reported.
pub(crate) fn half_turns(spine: &Spine) -> Option<i32> {
    /// Change of the linking number from which a self-passage is certain, in passages of four half turns each.
    const DOUBT: f64 = 0.6;
    let begun = spine.half_turns?;
    let by_frames = begun
        + if is_lifted_as_begun(spine, begun) {
            0
        } else {
            2
        };
    let points = polygon(spine);
    if touches_itself(&points) {
        return Some(by_frames);
    }
    let counted = 2.0 * (spine.twist() / TAU + writhe(&points));
    let passes = (counted - f64::from(by_frames)) / 4.0;
    match passes.is_finite() && passes.abs() > DOUBT {
        true => Some(by_frames + 4 * passes.round() as i32),
        false => Some(by_frames),
    }
}

/// Whether the frames, followed along the belt as quaternions, return with the sign that frames of a ring with these half
/// turns return with; a ring without half turns returns with the opposite sign.
fn is_lifted_as_begun(spine: &Spine, begun: i32) -> bool {
    let quaternion = |k: usize| {
        let frame = Rotation3::from_matrix_unchecked(spine.pose[k].frame);
        UnitQuaternion::from_rotation_matrix(&frame)
    };
    let last = spine.pose.len() - 1;
    let mut lifted = quaternion(0);
    for k in 1..=last {
        let next = quaternion(k);
        lifted = match lifted.coords.dot(&next.coords) < 0.0 {
            true => UnitQuaternion::new_unchecked(-next.into_inner()),
            false => next,
        };
    }
    let turn = UnitQuaternion::from_scaled_axis(PI * f64::from(begun) * Vector3::y());
    let expected = quaternion(0) * turn;
    expected.coords.dot(&lifted.coords) < 0.0
}

/// The closed polygon through nodes of the spine, of no more points than a count of half turns takes.
fn polygon(spine: &Spine) -> Vec<Vector3<f64>> {
    /// Greatest count of points of the polygon, a number.
    const POINTS: usize = 240;
    let last = spine.pose.len() - 1;
    let count = last.min(POINTS);
    let mut points: Vec<_> = (0..count)
        .map(|i| spine.pose[i * last / count].position)
        .collect();
    points.dedup();
    points
}

/// Whether points far from each other along a closed polygon lie too close for its writhe to be certain.
fn touches_itself(points: &[Vector3<f64>]) -> bool {
    /// Distance below which two parts of the polygon touch, as a share of its length.
    const CLOSE: f64 = 1e-4;
    let count = points.len();
    let length: f64 = (0..count)
        .map(|i| (points[(i + 1) % count] - points[i]).norm())
        .sum();
    let apart = |i: usize, j: usize| (i - j).min(count - (i - j)) > count / 20;
    let close = |i: usize, j: usize| {
        let (a, b) = (points[j], points[(j + 1) % count]);
        let along = b - a;
        let share = along.dot(&(points[i] - a)) / along.norm_squared();
        (a + share.clamp(0.0, 1.0) * along - points[i]).norm() < CLOSE * length
    };
    (0..count).any(|i| (0..i).any(|j| apart(i, j) && close(i, j)))
}

/// Writhe of a closed polygon: the signed areas that pairs of its edges sweep on the sphere of directions, over 2π.
/// Edges that meet or coincide sweep none.
///
/// Source: K. Klenin and J. Langowski, "Computation of writhe in modeling of supercoiled DNA" (2000), method 1a
fn writhe(points: &[Vector3<f64>]) -> f64 {
    let edge = |i: usize| [points[i], points[(i + 1) % points.len()]];
    let pairs = (0..points.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    pairs.map(|(i, j)| swept(edge(i), edge(j))).sum::<f64>() / TAU
}

fn swept([a, b]: [Vector3<f64>; 2], [c, d]: [Vector3<f64>; 2]) -> f64 {
    let (ac, ad, bc, bd) = (c - a, d - a, c - b, d - b);
    let sides = [ac.cross(&ad), ad.cross(&bd), bd.cross(&bc), bc.cross(&ac)];
    let [Some(n1), Some(n2), Some(n3), Some(n4)] = sides.map(|n| n.try_normalize(1e-12)) else {
        return 0.0;
    };
    let arc = |p: Vector3<f64>, q: Vector3<f64>| p.dot(&q).clamp(-1.0, 1.0).asin();
    let area = arc(n1, n2) + arc(n2, n3) + arc(n3, n4) + arc(n4, n1);
    area * (d - c).cross(&(b - a)).dot(&ac).signum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Pose, exp};
    use crate::strip::spine::Piece;

    /// A torus knot-like closed curve with frames twisted about its tangent.
    fn twisted_ring(half_turns: i32, nodes: usize) -> Spine {
        let pose = |k: usize| {
            let t = k as f64 / nodes as f64;
            let about = exp(&(TAU * t * Vector3::z()));
            let twist = exp(&(PI * f64::from(half_turns) * t * Vector3::y()));
            Pose {
                frame: about * twist,
                position: Vector3::new((TAU * t).cos() - 1.0, (TAU * t).sin(), 0.0) / TAU,
            }
        };
        // Constant bend and slope give the torsion of the frames; their other rates do not matter.
        let torsion = PI * f64::from(half_turns);
        Spine {
            width: 0.01,
            pieces: vec![Piece::Strip { geodesic: 0.0 }; nodes],
            half_turns: Some(half_turns),
            u: (0..=nodes).map(|k| k as f64 / nodes as f64).collect(),
            pose: (0..=nodes).map(pose).collect(),
            bend: vec![-1.0; nodes + 1],
            rib_slope: vec![torsion; nodes + 1],
            curved: None,
        }
    }

    #[test]
    fn test_twisted_ring_has_the_half_turns_it_was_given() {
        for n in -9..=9 {
            assert_eq!(half_turns(&twisted_ring(n, 160)), Some(n));
            for passes in [-4, 4] {
                let passed = Spine {
                    half_turns: Some(n + passes),
                    ..twisted_ring(n, 160)
                };
                assert_eq!(half_turns(&passed), Some(n));
            }
        }
    }

    #[test]
    fn test_writhe_of_plane_curves_is_zero_and_of_a_trefoil_that_of_its_integral() {
        let ring: Vec<_> = (0..50)
            .map(|k| exp(&(TAU * f64::from(k) / 50.0 * Vector3::z())) * Vector3::x())
            .collect();
        assert!(writhe(&ring).abs() < 1e-12);
        let trefoil = |mirror: f64| -> Vec<_> {
            (0..300)
                .map(|k| {
                    let t = TAU * f64::from(k) / 300.0;
                    Vector3::new(
                        t.sin() + 2.0 * (2.0 * t).sin(),
                        t.cos() - 2.0 * (2.0 * t).cos(),
                        -mirror * (3.0 * t).sin(),
                    )
                })
                .collect()
        };
        // The expected writhe is Gauss's double integral by the midpoint rule.
        let points = trefoil(1.0);
        let n = points.len();
        let mut gauss = 0.0;
        for i in 0..n {
            for j in (0..n).filter(|j| *j != i) {
                let (a, b) = (
                    points[(i + 1) % n] - points[i],
                    points[(j + 1) % n] - points[j],
                );
                let middle = |k: usize| 0.5 * (points[k] + points[(k + 1) % n]);
                let r = middle(i) - middle(j);
                gauss += a.cross(&b).dot(&r) / r.norm().powi(3) / (2.0 * TAU);
            }
        }
        assert!((writhe(&points) - gauss).abs() < 0.02 && gauss.abs() > 3.0);
        assert!((writhe(&trefoil(-1.0)) + writhe(&points)).abs() < 1e-9);
    }

    #[test]
    fn test_open_belt_has_no_half_turns() {
        let open = Spine {
            half_turns: None,
            ..twisted_ring(1, 20)
        };
        assert_eq!(half_turns(&open), None);
    }
}
