//! The curve of a rib in space.

use super::*;
use nalgebra::Matrix3;

/// Radius R of the cylinder, U.
const RADIUS: f64 = 0.15;
/// Distances from the spine, U.
const PLACES: [f64; 5] = [-0.2, -0.05, 0.0, 0.03, 0.25];

/// The place on a cylinder that a board is wound on at an angle, of the point of the board at (along, across) the spine; the
/// natural pose is that of the origin, and the axis lies on the +x side.
fn on_cylinder(angle: f64, [along, across]: [f64; 2]) -> Vector3<f64> {
    let (s, c) = angle.sin_cos();
    let around = (along * c + across * s) / RADIUS;
    let height = across * c - along * s;
    let tangent = Vector3::new(0.0, c, s);
    let axis = Vector3::new(0.0, -s, c);
    Vector3::x() * (RADIUS * (1.0 - around.cos()))
        + tangent * (RADIUS * around.sin())
        + axis * height
}

/// Checks the motion along a rib of a cylinder: its points, that they lie on the cylinder, and its frame.
fn check(angle: f64, slope: f64, curve: &RibCurve) {
    let (s, c) = angle.sin_cos();
    let axis = Vector3::new(0.0, -s, c);
    let centre = Vector3::x() * RADIUS;
    for v in PLACES {
        let pose = curve.motion(slope, v);
        let exact = on_cylinder(angle, [-slope * v, v]);
        assert!((pose.position - exact).norm() < 1e-9, "{angle} {slope} {v}");
        let inwards = centre - pose.position;
        let inwards = inwards - axis * inwards.dot(&axis);
        assert_relative_eq!(inwards.norm(), RADIUS, epsilon = 1e-9);
        let normal = pose.frame.column(0).into_owned();
        assert_relative_eq!(normal, inwards / RADIUS, epsilon = 1e-9);
        check_frame(&pose.frame);
    }
}

fn check_frame(frame: &Matrix3<f64>) {
    assert_relative_eq!(
        frame.transpose() * frame,
        Matrix3::identity(),
        epsilon = 1e-13
    );
    assert_relative_eq!(frame.determinant(), 1.0, epsilon = 1e-13);
}

/// Twist m and bend q of a rib of a slope on the cylinder.
fn twist_and_bend(angle: f64, slope: f64) -> [f64; 2] {
    let (s, c) = angle.sin_cos();
    let twist = (s - slope * c) * c / RADIUS;
    let across = (s - slope * c).powi(2) / RADIUS;
    [twist, across]
}

#[test]
fn test_the_straight_rib_of_a_cylinder_is_a_line_of_it() {
    for angle in [0.0f64, 0.6, -0.9] {
        let curve = RibCurve {
            twist: 0.0,
            across: 0.0,
            convergence: 0.0,
            growth: 0.0,
        };
        check(angle, angle.tan(), &curve);
        for v in PLACES {
            let pose = curve.motion(angle.tan(), v);
            assert_relative_eq!(pose.frame, Matrix3::identity(), epsilon = 1e-15);
            let exact = Vector3::new(0.0, -angle.tan() * v, v);
            assert_relative_eq!(pose.position, exact, epsilon = 1e-15);
        }
    }
}

#[test]
fn test_a_bent_rib_of_a_cylinder_is_a_helix_on_it() {
    for angle in [0.0, 0.6, -0.9] {
        for slope in [0.0, 0.5, -0.8] {
            let [twist, across] = twist_and_bend(angle, slope);
            let curve = RibCurve {
                twist,
                across,
                convergence: 0.0,
                growth: 0.0,
            };
            check(angle, slope, &curve);
        }
    }
}

#[test]
fn test_a_rib_of_a_cylinder_is_the_same_where_its_neighbours_meet() {
    for angle in [0.6, -0.9] {
        for (slope, convergence) in [(0.0, 2.5), (0.5, -3.0)] {
            let [twist, across] = twist_and_bend(angle, slope);
            // On a cylinder b(t,d) is the same all along the rib.
            let growth = -2.0 * convergence * twist;
            let curve = RibCurve {
                twist,
                across,
                convergence,
                growth,
            };
            check(angle, slope, &curve);
        }
    }
}

#[test]
fn test_a_rib_keeps_its_length() {
    let curve = RibCurve {
        twist: 1.5,
        across: -3.0,
        convergence: 2.0,
        growth: 4.0,
    };
    let slope = 0.4;
    // Pieces, a number, and their length, U.
    let (pieces, piece) = (400, 1.25e-4);
    let mut length = 0.0;
    for i in 0..pieces {
        let [a, b] = [i, i + 1].map(|i| curve.motion(slope, f64::from(i) * piece).position);
        length += (b - a).norm();
    }
    let exact = f64::from(pieces) * piece * f64::hypot(1.0, slope);
    assert_relative_eq!(length, exact, max_relative = 1e-6);
}

/// The motion along a rib from its foot, by short straight pieces: the normal ξ turns by minus b(d,t) towards t and by minus
/// b(d,n) towards n, at the curvature in the middle of each piece.
fn integrated(rib: &Rib<f64>, v: f64) -> Pose {
    /// Pieces of a rib, a number.
    const PIECES: usize = 4000;
    let length = v / PIECES as f64;
    (0..PIECES).fold(Pose::identity(), |pose, i| {
        let curvature = rib.curvature(0.0, (i as f64 + 0.5) * length);
        let along = curvature.mixed;
        let across = curvature.across + rib.slope * curvature.mixed;
        pose * Pose::exp(&Twist {
            translation: Vector3::new(0.0, -rib.slope, 1.0) * length,
            rotation: Vector3::new(0.0, across, -along) * length,
        })
    })
}

#[test]
fn test_the_frame_turns_along_a_rib_by_the_curvature_there() {
    for (slope, convergence) in [(0.0, 3.0), (0.4, 8.0), (-0.7, -12.0)] {
        let rib = Rib {
            bend: -4.0,
            twist: 1.5,
            slope,
            across: -3.0,
            convergence,
            growth: 9.0,
            rates: [0.0; 3],
        };
        let curve = RibCurve {
            twist: rib.twist,
            across: rib.across,
            convergence: rib.convergence,
            growth: rib.growth,
        };
        // Four steps of fourth order: the error rises as the fifth power of the distance.
        for (v, bound) in [(-0.05, 5e-5), (-0.02, 1e-6), (0.02, 1e-6), (0.05, 5e-5)] {
            let (found, exact) = (curve.motion(slope, v), integrated(&rib, v));
            check_frame(&found.frame);
            assert_relative_eq!(found.frame, exact.frame, epsilon = bound);
            assert_relative_eq!(found.position, exact.position, epsilon = 0.05 * bound);
        }
    }
}
