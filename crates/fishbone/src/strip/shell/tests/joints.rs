//! Fields beyond a corner of the board or a jump of its in-plane curvature.

use super::*;

/// Fields before a joint: bend ω_ζ, β, β', m, q, q'.
const FIELDS_BEFORE: [[f64; FIELDS]; 3] = [
    [-8.0, 0.2, 4.0, 0.5, -0.1, 1.5],
    [5.0, -0.4, -12.0, 1.2, 0.3, -6.0],
    [4.3, 0.5, 18.0, -0.4, 0.9, -9.0],
];
/// Corners, and jumps of the in-plane curvature: angle χ, then κ_g before and beyond, 1/U.
const JOINTS: [Joint; 5] = [
    joint(0.5, [0.0, 0.0]),
    joint(-0.7, [0.0, 0.0]),
    joint(0.0, [0.0, 1.4]),
    joint(0.3, [2.0, 0.0]),
    joint(-1.0, [-1.5, 3.0]),
];

/// A place of no length: the angle by which the board bends, and its in-plane curvature before and beyond.
struct Joint {
    angle: f64,
    geodesic: [f64; 2],
}

const fn joint(angle: f64, geodesic: [f64; 2]) -> Joint {
    Joint { angle, geodesic }
}

fn beyond(joint: &Joint, fields: &[f64; FIELDS]) -> [f64; FIELDS] {
    Shell::new(Gauge::WEAK, 6)
        .beyond(joint.angle, joint.geodesic, fields)
        .unwrap()
}

/// Convergence s and growth of q at a node.
fn convergence_and_growth(fields: &[f64; FIELDS], geodesic: f64) -> [f64; 2] {
    let [_, slope, slope_rate, _, across, across_rate] = *fields;
    [
        slope_rate + geodesic * (1.0 + slope * slope),
        across_rate + 2.0 * slope * geodesic * across,
    ]
}

#[test]
fn test_curvature_of_the_material_rib_is_the_same_on_both_sides_of_a_joint() {
    for joint in &JOINTS {
        for fields in &FIELDS_BEFORE {
            let sides = [*fields, beyond(joint, fields)];
            let found = [0, 1].map(|i| {
                let [bend, slope, _, twist, across, _] = sides[i];
                let [convergence, _] = convergence_and_growth(&sides[i], joint.geodesic[i]);
                let square = 1.0 + slope * slope;
                // b(d,d) and b(d,f) by unit vectors along the rib and across it, and the convergence per unit of the rib.
                let [dd, td] = [across, twist];
                let crosswise = (square * td + slope * dd) / square;
                (bend, [dd / square, crosswise, convergence / square.sqrt()])
            });
            assert_eq!(found[0].0, found[1].0);
            for i in 0..3 {
                assert_relative_eq!(found[0].1[i], found[1].1[i], max_relative = 1e-12);
            }
        }
    }
}

#[test]
fn test_the_rib_turns_with_the_material_at_a_corner() {
    for joint in &JOINTS {
        for fields in &FIELDS_BEFORE {
            let slope = beyond(joint, fields)[1];
            assert_relative_eq!(
                slope.atan(),
                fields[1].atan() - joint.angle,
                epsilon = 1e-14
            );
        }
    }
}

#[test]
fn test_a_joint_is_undone_by_the_opposite_joint() {
    for joint in &JOINTS {
        let [before, after] = joint.geodesic;
        let opposite = Joint {
            angle: -joint.angle,
            geodesic: [after, before],
        };
        for fields in &FIELDS_BEFORE {
            let back = beyond(&opposite, &beyond(joint, fields));
            for i in 0..FIELDS {
                assert_relative_eq!(back[i], fields[i], max_relative = 1e-12);
            }
        }
    }
}

#[test]
fn test_convergence_and_growth_go_on_where_only_the_in_plane_curvature_jumps() {
    for geodesic in [[0.0, 1.4], [-3.0, 2.0]] {
        let joint = joint(0.0, geodesic);
        for fields in &FIELDS_BEFORE {
            let after = beyond(&joint, fields);
            let [s, g] = convergence_and_growth(fields, geodesic[0]);
            let found = convergence_and_growth(&after, geodesic[1]);
            assert_relative_eq!(found[0], s, max_relative = 1e-13);
            assert_relative_eq!(found[1], g, max_relative = 1e-13);
            for i in [0, 1, 3, 4] {
                assert_relative_eq!(after[i], fields[i], max_relative = 1e-14);
            }
        }
    }
}

#[test]
fn test_no_rib_passes_a_corner_that_it_would_leave_through() {
    let shell = Shell::new(Gauge::WEAK, 6);
    let mut fields = FIELDS_BEFORE[0];
    fields[1] = -3.0;
    assert!(shell.beyond(0.5, [0.0; 2], &fields).is_none());
    assert!(shell.beyond(-0.5, [0.0; 2], &fields).is_some());
}

#[test]
fn test_a_corner_is_the_limit_of_a_short_tight_arc() {
    // Steps of Runge and Kutta's rule along the arc, a number.
    const STEPS: usize = 200;
    for corner in &JOINTS[..2] {
        for fields in &FIELDS_BEFORE {
            // By the angle turned, in the limit of a vanishing length: β' = s − κ_g (1+β²), q' + 2 β κ_g q bounded; s and m
            // such that b(t,t) is bounded.
            let rate = |[slope, s, _, across]: [f64; 4]| {
                [
                    -(1.0 + slope * slope),
                    -slope * s,
                    across,
                    -2.0 * slope * across,
                ]
            };
            let [_, slope, slope_rate, twist, across, _] = *fields;
            let mut x = [slope, slope_rate, twist, across];
            let h = corner.angle / STEPS as f64;
            for _ in 0..STEPS {
                let go = |by: [f64; 4], h: f64| std::array::from_fn(|i| x[i] + h * by[i]);
                let a = rate(x);
                let b = rate(go(a, 0.5 * h));
                let c = rate(go(b, 0.5 * h));
                let d = rate(go(c, h));
                x = go(
                    std::array::from_fn(|i| (a[i] + 2.0 * (b[i] + c[i]) + d[i]) / 6.0),
                    h,
                );
            }
            let found = beyond(corner, fields);
            for (i, exact) in [1, 2, 3, 4].into_iter().zip(x) {
                assert_relative_eq!(found[i], exact, max_relative = 1e-9);
            }
        }
    }
}

#[test]
fn test_in_a_tight_arc_that_turns_beneath_a_resting_rib_the_curvature_is_that_without_an_arc() {
    // In-plane curvature of the arc, 1/U.
    let tight = 1e7;
    for fields in &FIELDS_BEFORE {
        let [bend, slope, s, twist, across, g] = *fields;
        // Of the order of κ_g, the rates at which m, s and the growth g change so that b(t,t) is bounded for all v.
        let rates = [across, -slope * s, -slope * g - 2.0 * s * across];
        let rib = Rib {
            bend: -bend,
            twist,
            slope,
            across,
            convergence: s,
            growth: g,
            rates: rates.map(|rate| rate * tight),
        };
        for v in [-0.04, 0.02, 0.05] {
            let found = rib.curvature(tight, v).along;
            assert_relative_eq!(found, -bend / (1.0 - s * v), epsilon = 1e-6);
        }
    }
}

/// Ribs of a family through a point of the board, or parallel, with a potential quadratic along every one of them.
#[derive(Clone, Copy)]
enum Ribs {
    /// All ribs pass through this point, U.
    Through([f64; 2]),
    /// All ribs have this direction, an angle.
    Parallel(f64),
}

impl Ribs {
    /// At a point of the board: the rib's direction e, and the second derivative of the potential by (e, e) and by (e, f), f a
    /// quarter turn onwards from e.
    fn at<T: DualNum<Primitive = f64> + Copy>(self, [x, y]: [T; 2]) -> ([T; 2], [T; 2]) {
        match self {
            Ribs::Through([x0, y0]) => {
                let (x, y) = (x - x0, y - y0);
                let radius = (x * x + y * y).sqrt();
                let angle = y.atan2(x);
                // φ = A + B r + C r²/2 with A = sin θ/8, C = 3 + sin 2θ; B is in neither.
                let bend = (angle * 2.0).sin() + 3.0;
                let bend_rate = (angle * 2.0).cos() * 2.0;
                let rate = angle.cos() * 0.125;
                let mixed = bend_rate * 0.5 - rate / (radius * radius);
                ([x / radius, y / radius], [bend, mixed])
            }
            Ribs::Parallel(angle) => {
                let (s, c) = angle.sin_cos();
                let (w, z) = (x * c + y * s, -x * s + y * c);
                // φ = B(z) w + C(z) w²/2 with B' = 1 + z, C = 3 + 4 z.
                ([T::from(c), T::from(s)], [z * 4.0 + 3.0, z + 1.0 + w * 4.0])
            }
        }
    }

    /// The fields of a spine that passes the origin of the board in a direction: b(t,d), b(d,d) and rib slope of these ribs.
    fn fields(self, direction: f64, geodesic: f64) -> [f64; FIELDS] {
        let at = |u: Dual64| {
            let (s, c) = (u * geodesic + direction).sin_cos();
            let (s0, c0) = direction.sin_cos();
            // To the first order the spine goes straight on while its direction turns.
            let (e, [bend, mixed]) = self.at([u * c0, u * s0]);
            let along = e[0] * c + e[1] * s;
            let rise = -e[0] * s + e[1] * c;
            let slope = -along / rise;
            // t = along · e − rise · f.
            let twist = (along * bend - rise * mixed) / rise;
            [slope, twist, bend / (rise * rise)]
        };
        let [slope, twist, across] = [0, 1, 2].map(|i| first_derivative(|u| at(u)[i], 0.0));
        [0.0, slope.0, slope.1, twist.0, across.0, across.1]
    }
}

/// Directions of the spine before the joint, angles.
const DIRECTIONS: [f64; 2] = [0.0, 0.4];

#[test]
fn test_parallel_ribs_beyond_a_joint_are_those_of_the_same_surface() {
    for joint in &JOINTS {
        for direction in DIRECTIONS {
            let ribs = Ribs::Parallel(1.3);
            let found = beyond(joint, &ribs.fields(direction, joint.geodesic[0]));
            let exact = ribs.fields(direction + joint.angle, joint.geodesic[1]);
            for i in 0..FIELDS {
                assert_relative_eq!(found[i], exact[i], max_relative = 1e-12, epsilon = 1e-12);
            }
        }
    }
}

#[test]
fn test_converging_ribs_beyond_a_joint_lie_and_bend_as_those_of_the_same_surface() {
    for joint in &JOINTS {
        for direction in DIRECTIONS {
            for centre in [[0.05, -0.3], [-0.02, 0.2]] {
                let ribs = Ribs::Through(centre);
                let found = beyond(joint, &ribs.fields(direction, joint.geodesic[0]));
                let exact = ribs.fields(direction + joint.angle, joint.geodesic[1]);
                for (found, exact) in found.iter().zip(exact).take(5) {
                    assert_relative_eq!(*found, exact, max_relative = 1e-12, epsilon = 1e-12);
                }
            }
        }
    }
}

#[test]
fn test_growth_beyond_a_corner_is_the_limit_of_a_short_tight_arc() {
    // Steps of Runge and Kutta's rule along the arc, a number.
    const STEPS: usize = 200;
    for corner in &JOINTS[..2] {
        for fields in &FIELDS_BEFORE {
            // By the angle turned, in the limit of a vanishing length, so that b(t,t) is bounded for all v.
            let rate = |[slope, s, across, g]: [f64; 4]| {
                [
                    -(1.0 + slope * slope),
                    -slope * s,
                    -2.0 * slope * across,
                    -slope * g - 2.0 * s * across,
                ]
            };
            let [_, slope, slope_rate, _, across, across_rate] = *fields;
            let mut x = [slope, slope_rate, across, across_rate];
            let h = corner.angle / STEPS as f64;
            for _ in 0..STEPS {
                let go = |by: [f64; 4], h: f64| std::array::from_fn(|i| x[i] + h * by[i]);
                let a = rate(x);
                let b = rate(go(a, 0.5 * h));
                let c = rate(go(b, 0.5 * h));
                let d = rate(go(c, h));
                x = go(
                    std::array::from_fn(|i| (a[i] + 2.0 * (b[i] + c[i]) + d[i]) / 6.0),
                    h,
                );
            }
            let found = beyond(corner, fields);
            assert_relative_eq!(found[5], x[3], max_relative = 1e-9);
        }
    }
}

#[test]
fn test_converging_ribs_beyond_a_joint_are_those_of_the_same_surface() {
    for joint in &JOINTS {
        for direction in DIRECTIONS {
            for centre in [[0.05, -0.3], [-0.02, 0.2]] {
                let ribs = Ribs::Through(centre);
                let found = beyond(joint, &ribs.fields(direction, joint.geodesic[0]));
                let exact = ribs.fields(direction + joint.angle, joint.geodesic[1]);
                for i in 0..FIELDS {
                    assert_relative_eq!(found[i], exact[i], max_relative = 1e-12, epsilon = 1e-12);
                }
            }
        }
    }
}
