use super::*;
use approx::assert_relative_eq;
use num_dual::{Dual2, DualNum, second_derivative};
use proptest::prelude::*;
use std::f64::consts::PI;

/// d^m/dt^m of Σ (−t)^k / (2k + n)!, term by term.
fn long_series(n: u32, derivative: u32, t: f64) -> f64 {
    let term = |k: u32| {
        let factorial: f64 = (1..=2 * k + n).map(f64::from).product();
        let power: f64 = (0..derivative)
            .map(|m| f64::from(k) - f64::from(m))
            .product();
        let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        sign * power * t.powi((k - derivative) as i32) / factorial
    };
    (derivative..40).rev().map(term).sum()
}

fn all(t: f64) -> [[f64; 3]; 3] {
    let c = Coefficients::at(t);
    [c.sine, c.cosine, c.cubic]
}

fn angles() -> impl Iterator<Item = f64> {
    (0..2000).map(|i| 1e-12 * (PI / 1e-12).powf(f64::from(i) / 1999.0))
}

#[test]
fn test_coefficients_equal_their_long_series_up_to_a_half_turn() {
    for theta in angles() {
        for (n, function) in all(theta * theta).iter().enumerate() {
            for (m, value) in function.iter().enumerate() {
                let expected = long_series(n as u32 + 1, m as u32, theta * theta);
                let (relative, absolute) = if m == 0 { (1e-14, 1e-15) } else { (2e-12, 0.0) };
                let error = (value - expected).abs();
                assert!(
                    error <= relative * expected.abs() + absolute,
                    "θ = {theta}, c{}, d{m}: {value} for {expected}",
                    n + 1
                );
            }
        }
    }
}

#[test]
fn test_coefficients_equal_differentiated_closed_forms_beyond_a_half_turn() {
    for i in 0..200 {
        let t = 1.5 + 0.3 * f64::from(i);
        let closed = [
            second_derivative(|t: Dual2<f64>| t.sqrt().sin() / t.sqrt(), t),
            second_derivative(|t: Dual2<f64>| (-t.sqrt().cos() + 1.0) / t, t),
            second_derivative(
                |t: Dual2<f64>| (t.sqrt() - t.sqrt().sin()) / (t * t.sqrt()),
                t,
            ),
        ];
        for (function, (value, first, second)) in all(t).iter().zip(closed) {
            for (x, y) in function.iter().zip([value, first, second]) {
                assert_relative_eq!(*x, y, max_relative = 1e-11, epsilon = 1e-14);
            }
        }
    }
}

#[test]
fn test_coefficients_agree_across_the_switch() {
    let (series, closed) = (
        stumpff_by_series(SERIES_BELOW),
        stumpff_closed(SERIES_BELOW),
    );
    for (x, y) in series.iter().zip(closed) {
        assert_relative_eq!(*x, y, max_relative = 1e-12);
    }
}

fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    [-size..size, -size..size, -size..size].prop_map(Vector3::from)
}

fn twist(size: f64) -> impl Strategy<Value = Twist> {
    (vector(size), vector(size)).prop_map(|(translation, rotation)| Twist {
        translation,
        rotation,
    })
}

fn pose() -> impl Strategy<Value = Pose> {
    twist(1.7).prop_map(|t| Pose::exp(&t))
}

fn matrix4(pose: &Pose) -> nalgebra::Matrix4<f64> {
    let mut m = pose.frame.to_homogeneous();
    m.fixed_view_mut::<3, 1>(0, 3).copy_from(&pose.position);
    m
}

/// Scaling and squaring of the power series, on 4×4 matrices.
fn matrix_exponential(twist: &Twist) -> nalgebra::Matrix4<f64> {
    let mut a = hat(&twist.rotation).to_homogeneous();
    a[(3, 3)] = 0.0;
    a.fixed_view_mut::<3, 1>(0, 3).copy_from(&twist.translation);
    a /= 1024.0;
    let mut sum = nalgebra::Matrix4::identity();
    for k in (1..=12).rev() {
        sum = nalgebra::Matrix4::identity() + a * sum / f64::from(k);
    }
    (0..10).fold(sum, |m, _| m * m)
}

proptest! {
    #[test]
    fn test_exp_is_the_matrix_exponential(t in twist(3.0)) {
        prop_assert!((matrix4(&Pose::exp(&t)) - matrix_exponential(&t)).norm() < 1e-11);
    }

    #[test]
    fn test_log_undoes_exp(axis in vector(1.0), exponent in -12.0f64..0.0) {
        prop_assume!(axis.norm() > 1e-3);
        let rotation = axis.normalize() * (PI * 10f64.powf(exponent));
        let relative = (log(&exp(&rotation)) - rotation).norm() / rotation.norm();
        prop_assert!(relative < 1e-14);
    }

    #[test]
    fn test_log_undoes_exp_near_a_half_turn(axis in vector(1.0), exponent in -14.0f64..0.0) {
        prop_assume!(axis.norm() > 1e-3);
        let rotation = axis.normalize() * (PI - 10f64.powf(exponent));
        prop_assert!((log(&exp(&rotation)) - rotation).norm() < 1e-13);
    }

    #[test]
    fn test_pose_log_undoes_exp(t in twist(1.7)) {
        let back = Pose::exp(&t).log();
        prop_assert!((back - t).to_vector().norm() < 1e-11);
    }

    #[test]
    fn test_inverse_composes_to_identity(a in pose()) {
        prop_assert!((matrix4(&(a * a.inverse())) - nalgebra::Matrix4::identity()).norm() < 1e-13);
    }

    #[test]
    fn test_bracket_is_the_derivative_of_a_twist_moved_across_a_pose(a in twist(1.0), b in twist(1.0)) {
        let h = 1e-5;
        let moved = |far: f64| {
            let across = Pose::exp(&(a * far));
            (across * Pose::exp(&b) * across.inverse()).log()
        };
        let expected = (moved(h) - moved(-h)).to_vector() / (2.0 * h);
        prop_assert!((bracket(&a, &b).to_vector() - expected).norm() < 1e-8);
    }

    #[test]
    fn test_frame_from_euler_is_three_turns(phi in -PI..PI, theta in 0.0..PI, psi in -PI..PI) {
        let turns = exp(&(Vector3::z() * phi)) * exp(&(Vector3::y() * theta)) * exp(&(Vector3::z() * psi));
        let frame = frame_from_euler(&Euler { phi, theta, psi });
        prop_assert!((frame - turns).norm() < 1e-14);
    }

    #[test]
    fn test_euler_from_frame_gives_the_frame_back_even_near_singularities(
        phi in -PI..PI, exponent in -17.0f64..0.0, psi in -PI..PI, flip in any::<bool>(),
    ) {
        let small = 10f64.powf(exponent);
        let theta = if flip { PI - small } else { small };
        let frame = frame_from_euler(&Euler { phi, theta, psi });
        let euler = euler_from_frame(&frame);
        prop_assert!((0.0..=PI).contains(&euler.theta));
        prop_assert!((frame_from_euler(&euler) - frame).norm() < 1e-14);
    }

    #[test]
    fn test_euler_angles_come_back(phi in -PI..PI, theta in 0.1..3.0, psi in -PI..PI) {
        let euler = euler_from_frame(&frame_from_euler(&Euler { phi, theta, psi }));
        prop_assert!((euler.phi - phi).abs() + (euler.theta - theta).abs() + (euler.psi - psi).abs() < 1e-13);
    }

    #[test]
    fn test_body_rates_are_those_of_the_frame(
        angle in vector(3.0), rate in vector(2.0),
    ) {
        let at = |h: f64| Euler {
            phi: angle.x + h * rate.x,
            theta: angle.y + h * rate.y,
            psi: angle.z + h * rate.z,
        };
        let h = 1e-5;
        let slope = (frame_from_euler(&at(h)) - frame_from_euler(&at(-h))) / (2.0 * h);
        let rates = Euler { phi: rate.x, theta: rate.y, psi: rate.z };
        let omega = body_rates(&at(0.0), &rates);
        prop_assert!((slope - frame_from_euler(&at(0.0)) * hat(&omega)).norm() < 1e-8);
    }
}

#[test]
fn test_third_angle_is_zero_at_the_singularities() {
    for theta in [0.0, PI] {
        let euler = euler_from_frame(&frame_from_euler(&Euler {
            phi: 0.7,
            theta,
            psi: 0.2,
        }));
        assert_eq!((euler.theta, euler.psi), (theta, 0.0));
        assert_relative_eq!(
            euler.phi,
            if theta == 0.0 { 0.9 } else { 0.5 },
            epsilon = 1e-14
        );
    }
}

fn twist_rate(u: f64) -> Twist {
    Twist {
        translation: Vector3::new(0.3 * u, 1.0, (2.0 * u).sin()),
        rotation: Vector3::new(1.0 + u * u, 3.0 * (1.5 * u).cos(), 2.0 - 4.0 * u),
    }
}

fn integrate(steps: usize, step: impl Fn(f64, f64) -> Twist) -> Pose {
    let h = 1.0 / steps as f64;
    (0..steps).fold(Pose::identity(), |pose, i| {
        pose * Pose::exp(&step(i as f64 * h, h))
    })
}

fn magnus_step(u: f64, h: f64) -> Twist {
    let [a, b] = gauss_points();
    magnus(&twist_rate(u + a * h), &twist_rate(u + b * h), h)
}

#[test]
fn test_magnus_converges_with_order_four_to_fine_midpoint_steps() {
    // Richardson on the second-order midpoint rule: independent of the bracket and its sign.
    let midpoint = |n| matrix4(&integrate(n, |u, h| twist_rate(u + 0.5 * h) * h));
    let exact = (midpoint(20_000) * 4.0 - midpoint(10_000)) / 3.0;
    let error = |n| (matrix4(&integrate(n, magnus_step)) - exact).norm();
    let order = (error(16) / error(32)).log2();
    assert!(
        (order - 4.0).abs() < 0.2,
        "order {order}, error {}",
        error(32)
    );
    assert!(error(32) < 1e-5);
}
