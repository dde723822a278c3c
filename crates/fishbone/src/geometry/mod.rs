//! Rotations and rigid motions: SO(3) and SE(3), Eq. (1)–(4).
//!
//! A unit quaternion (w, x, y, z) of a frame is `nalgebra::UnitQuaternion::from_rotation_matrix`; it is
//! not wrapped here.

use nalgebra::{Matrix3, Matrix6, Rotation3, UnitQuaternion, Vector3, Vector6};
use std::ops::{Add, Mul, Neg, Sub};

/// A pose: the frame at a point of the spine and the point itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Frame R = [ξ η ζ]: its columns are the normal, the tangent and the width direction, Eq. (2).
    pub frame: Matrix3<f64>,
    /// Position x of the point.
    pub position: Vector3<f64>,
}

impl Pose {
    /// The natural pose: at the origin, normal +x, spine along +y, width +z.
    pub fn identity() -> Self {
        Self {
            frame: Matrix3::identity(),
            position: Vector3::zeros(),
        }
    }

    /// The pose reached from the identity by a constant body twist.
    pub fn exp(twist: &Twist) -> Self {
        Self {
            frame: exp(&twist.rotation),
            position: left_jacobian(&twist.rotation) * twist.translation,
        }
    }

    /// The body twist that reaches this pose from the identity, its turn at most π.
    pub fn log(&self) -> Twist {
        let rotation = log(&self.frame);
        Twist {
            translation: left_jacobian_inverse(&rotation) * self.position,
            rotation,
        }
    }

    /// The pose that undoes this one.
    pub fn inverse(&self) -> Self {
        let frame = self.frame.transpose();
        Self {
            frame,
            position: -(frame * self.position),
        }
    }

    /// World coordinates of a point given in this pose's body axes.
    pub fn transform(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.position + self.frame * point
    }

    /// The adjoint Ad with T exp(ξ) = exp(Ad ξ) T.
    ///
    /// Shapes: 6×6 on [translation; rotation].
    pub fn adjoint(&self) -> Matrix6<f64> {
        block_triangular(&self.frame, &(hat(&self.position) * self.frame))
    }
}

impl Mul for Pose {
    type Output = Self;

    /// Composition: `other` is given in the axes of `self`.
    fn mul(self, other: Self) -> Self {
        Self {
            frame: self.frame * other.frame,
            position: self.transform(&other.position),
        }
    }
}

/// A force and a moment about the point where they act, world axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wrench {
    /// Force.
    pub force: Vector3<f64>,
    /// Moment.
    pub moment: Vector3<f64>,
}

/// A twist in body axes: an element of se(3).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Twist {
    /// Translation ρ.
    pub translation: Vector3<f64>,
    /// Rotation vector ω.
    pub rotation: Vector3<f64>,
}

impl Twist {
    /// No motion.
    pub fn zero() -> Self {
        Self {
            translation: Vector3::zeros(),
            rotation: Vector3::zeros(),
        }
    }

    /// The twist as [translation; rotation].
    pub fn to_vector(&self) -> Vector6<f64> {
        let (a, b) = (&self.translation, &self.rotation);
        Vector6::new(a.x, a.y, a.z, b.x, b.y, b.z)
    }

    /// The twist of [translation; rotation].
    pub fn from_vector(vector: &Vector6<f64>) -> Self {
        Self {
            translation: vector.fixed_rows::<3>(0).into(),
            rotation: vector.fixed_rows::<3>(3).into(),
        }
    }

    /// The left Jacobian: exp(ξ + dξ) = exp(J dξ) exp(ξ) to first order.
    ///
    /// Shapes: 6×6 on [translation; rotation].
    pub fn left_jacobian(&self) -> Matrix6<f64> {
        block_triangular(&left_jacobian(&self.rotation), &self.coupling())
    }

    /// The right Jacobian: exp(ξ + dξ) = exp(ξ) exp(J dξ) to first order.
    ///
    /// Shapes: 6×6 on [translation; rotation].
    pub fn right_jacobian(&self) -> Matrix6<f64> {
        (-*self).left_jacobian()
    }

    /// The inverse of the left Jacobian; singular at a full turn.
    ///
    /// Shapes: 6×6 on [translation; rotation].
    pub fn left_jacobian_inverse(&self) -> Matrix6<f64> {
        let inverse = left_jacobian_inverse(&self.rotation);
        block_triangular(&inverse, &-(inverse * self.coupling() * inverse))
    }

    /// The inverse of the right Jacobian; singular at a full turn.
    ///
    /// Shapes: 6×6 on [translation; rotation].
    pub fn right_jacobian_inverse(&self) -> Matrix6<f64> {
        (-*self).left_jacobian_inverse()
    }

    /// Translation–rotation block Q of the left Jacobian (Barfoot and Furgale, IEEE T-RO 30, 2014, Eq. (102)),
    /// its quotients written in [`Coefficients`].
    fn coupling(&self) -> Matrix3<f64> {
        let (p, k) = (hat(&self.translation), hat(&self.rotation));
        let c = Coefficients::at(self.rotation.norm_squared());
        let (kp, pk, kpk) = (k * p, p * k, k * p * k);
        p * 0.5
            + (kp + pk + kpk) * c.cubic[0]
            + (k * kp + pk * k - kpk * 3.0) * (c.cosine[1] + 0.5 * c.cubic[0])
            - (kpk * k + k * kpk) * c.cubic[1]
    }
}

impl Add for Twist {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            translation: self.translation + other.translation,
            rotation: self.rotation + other.rotation,
        }
    }
}

impl Sub for Twist {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Neg for Twist {
    type Output = Self;

    fn neg(self) -> Self {
        self * -1.0
    }
}

impl Mul<f64> for Twist {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self {
            translation: self.translation * factor,
            rotation: self.rotation * factor,
        }
    }
}

/// The Lie bracket of two twists.
pub fn bracket(a: &Twist, b: &Twist) -> Twist {
    Twist {
        translation: a.rotation.cross(&b.translation) - b.rotation.cross(&a.translation),
        rotation: a.rotation.cross(&b.rotation),
    }
}

/// The twist Ω of a fourth-order step T(u + h) = T(u) exp(Ω) of `T' = T [ξ(u)]`.
///
/// `twist_1` and `twist_2` are ξ, per unit u, at the two Gauss points of the step, `u + h (1/2 ∓ √3/6)`. The bracket
/// has the opposite sign of the textbooks' Y' = A(u) Y, because ξ acts from the right.
pub fn magnus(twist_1: &Twist, twist_2: &Twist, h: f64) -> Twist {
    (*twist_1 + *twist_2) * (0.5 * h) + bracket(twist_1, twist_2) * (3f64.sqrt() / 12.0 * h * h)
}

/// Where the two Gauss points of an element lie, as fractions of its length.
#[inline(always)]
pub fn gauss_points() -> [f64; 2] {
    let offset = 3f64.sqrt() / 6.0;
    [0.5 - offset, 0.5 + offset]
}

fn block_triangular(diagonal: &Matrix3<f64>, upper: &Matrix3<f64>) -> Matrix6<f64> {
    let mut block = Matrix6::zeros();
    block.fixed_view_mut::<3, 3>(0, 0).copy_from(diagonal);
    block.fixed_view_mut::<3, 3>(3, 3).copy_from(diagonal);
    block.fixed_view_mut::<3, 3>(0, 3).copy_from(upper);
    block
}

/// Derivative of `force · x` by a twist, world axes about the origin, that carries the point x along: the force and its
/// moment about the origin.
pub fn carried_gradient(point: &Vector3<f64>, force: &Vector3<f64>) -> Vector6<f64> {
    let moment = point.cross(force);
    Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
}

/// Second derivative of `force · x` by the twist.
pub fn carried_hessian(point: &Vector3<f64>, force: &Vector3<f64>) -> Matrix6<f64> {
    let mut hessian = Matrix6::zeros();
    let mixed = 0.5 * hat(force);
    hessian.fixed_view_mut::<3, 3>(0, 3).copy_from(&mixed);
    hessian
        .fixed_view_mut::<3, 3>(3, 0)
        .copy_from(&mixed.transpose());
    let outer = force * point.transpose();
    hessian
        .fixed_view_mut::<3, 3>(3, 3)
        .copy_from(&(0.5 * (outer + outer.transpose()) - force.dot(point) * Matrix3::identity()));
    hessian
}

/// The matrix `[a]×` with `[a]× b = a × b`.
pub fn hat(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// The vector a of the skew part `[a]×` of a matrix.
pub fn vee(m: &Matrix3<f64>) -> Vector3<f64> {
    0.5 * Vector3::new(m.m32 - m.m23, m.m13 - m.m31, m.m21 - m.m12)
}

/// The rotation `exp([φ]×)` by a rotation vector.
pub fn exp(rotation: &Vector3<f64>) -> Matrix3<f64> {
    Coefficients::at(rotation.norm_squared()).exp(rotation)
}

/// The rotation vector of a rotation, its angle in [0, π].
///
/// At a half-turn both ±φ give the matrix; one of them is returned.
pub fn log(frame: &Matrix3<f64>) -> Vector3<f64> {
    // Shepperd's quaternion keeps full accuracy at both ends of [0, π], where trace and skew part lose it.
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*frame)).scaled_axis()
}

/// The left Jacobian: exp(φ + dφ) = exp(J dφ) exp(φ) to first order.
pub fn left_jacobian(rotation: &Vector3<f64>) -> Matrix3<f64> {
    Coefficients::at(rotation.norm_squared()).left_jacobian(rotation)
}

/// The right Jacobian: exp(φ + dφ) = exp(φ) exp(J dφ) to first order.
pub fn right_jacobian(rotation: &Vector3<f64>) -> Matrix3<f64> {
    left_jacobian(&-rotation)
}

/// The inverse of the left Jacobian; singular at a full turn.
pub fn left_jacobian_inverse(rotation: &Vector3<f64>) -> Matrix3<f64> {
    let c = Coefficients::at(rotation.norm_squared());
    even_polynomial(rotation, -0.5, -c.cosine[1] / c.cosine[0])
}

/// The inverse of the right Jacobian; singular at a full turn.
pub fn right_jacobian_inverse(rotation: &Vector3<f64>) -> Matrix3<f64> {
    left_jacobian_inverse(&-rotation)
}

/// `I + a [φ]× + b [φ]×²`.
fn even_polynomial(rotation: &Vector3<f64>, a: f64, b: f64) -> Matrix3<f64> {
    let k = hat(rotation);
    Matrix3::identity() + k * a + k * k * b
}

/// The three even functions of the angle θ that SO(3) and SE(3) are made of, with their first and second
/// derivatives by t = θ².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficients {
    /// sin θ / θ, then d/dt and d²/dt².
    pub sine: [f64; 3],
    /// (1 − cos θ) / θ², then d/dt and d²/dt².
    pub cosine: [f64; 3],
    /// (θ − sin θ) / θ³, then d/dt and d²/dt².
    pub cubic: [f64; 3],
}

impl Coefficients {
    /// The coefficients at t = θ² ≥ 0.
    ///
    /// They are the Stumpff functions c₁, c₂, c₃, and their derivatives follow from c₁ … c₇ without a division:
    /// `2 c_n' = n c_{n+2} − c_{n+1}`.
    pub fn at(t: f64) -> Self {
        match t < SERIES_BELOW {
            true => Self::near(t),
            false => Self::of(&stumpff_closed(t)),
        }
    }

    /// The same at t ≤ 1, without a branch.
    #[inline(always)]
    pub fn near(t: f64) -> Self {
        Self::of(&stumpff_by_series(t))
    }

    #[inline(always)]
    fn of(c: &[f64; 8]) -> Self {
        Self {
            sine: with_derivatives(c, 1),
            cosine: with_derivatives(c, 2),
            cubic: with_derivatives(c, 3),
        }
    }

    /// `exp([φ]×)`, the coefficients being those of φ.
    pub fn exp(&self, rotation: &Vector3<f64>) -> Matrix3<f64> {
        even_polynomial(rotation, self.sine[0], self.cosine[0])
    }

    /// The left Jacobian of SO(3) at φ, the coefficients being those of φ.
    pub fn left_jacobian(&self, rotation: &Vector3<f64>) -> Matrix3<f64> {
        even_polynomial(rotation, self.cosine[0], self.cubic[0])
    }
}

/// c_n, c_n' and c_n'' from the table c₀ … c₇.
#[inline(always)]
fn with_derivatives(c: &[f64; 8], n: usize) -> [f64; 3] {
    let m = n as f64;
    let first = 0.5 * (m * c[n + 2] - c[n + 1]);
    let second = 0.25 * (m * (m + 2.0) * c[n + 4] - (2.0 * m + 1.0) * c[n + 3] + c[n + 2]);
    [c[n], first, second]
}

/// Below this t = θ² the Stumpff functions come from their series. At t = 1 the closed forms of c₆ and c₇ have lost
/// three digits, at t = 0.01 ten.
const SERIES_BELOW: f64 = 1.0;

/// 1/n! for n = 0 … 7.
const INVERSE_FACTORIAL: [f64; 8] = [
    1.0,
    1.0,
    1.0 / 2.0,
    1.0 / 6.0,
    1.0 / 24.0,
    1.0 / 120.0,
    1.0 / 720.0,
    1.0 / 5040.0,
];

/// The Stumpff functions c_n(t) = Σ (−t)^k / (2k + n)! for n = 0 … 7 and t ≤ 1: c₆ and c₇ by their series, the others by
/// c_n = 1/n! − t c_{n+2}, which is stable downwards.
#[inline(always)]
fn stumpff_by_series(t: f64) -> [f64; 8] {
    let mut c = INVERSE_FACTORIAL;
    (c[6], c[7]) = (series(t, &SIXTH), series(t, &SEVENTH));
    for n in (0..6).rev() {
        c[n] -= t * c[n + 2];
    }
    c
}

/// Terms that leave less than 1e-18 at t = 1.
const TERMS: usize = 9;
const SIXTH: [f64; TERMS] = series_coefficients(6);
const SEVENTH: [f64; TERMS] = series_coefficients(7);

/// (−1)^k / (2k + n)!
const fn series_coefficients(n: usize) -> [f64; TERMS] {
    let mut coefficients = [INVERSE_FACTORIAL[n]; TERMS];
    let mut k = 1;
    while k < TERMS {
        let j = (n + 2 * k) as f64;
        coefficients[k] = -coefficients[k - 1] / (j * (j - 1.0));
        k += 1;
    }
    coefficients
}

/// A power series.
#[inline(always)]
fn series(t: f64, coefficients: &[f64; TERMS]) -> f64 {
    let [a, b, c, d, e, f, g, h, i] = *coefficients;
    a + t * (b + t * (c + t * (d + t * (e + t * (f + t * (g + t * (h + t * i)))))))
}

/// sin and cos, the others by c_{n+2} = (1/n! − c_n) / t.
fn stumpff_closed(t: f64) -> [f64; 8] {
    let theta = t.sqrt();
    let half = (0.5 * theta).sin();
    let mut c = [
        theta.cos(),
        theta.sin() / theta,
        2.0 * half * half / t,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    ];
    for n in 3..8 {
        c[n] = (INVERSE_FACTORIAL[n - 2] - c[n - 2]) / t;
    }
    c
}

/// Eulerian angles φ, θ, ψ: turns about z, then the new y, then the new z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Euler {
    /// First turn, about z.
    pub phi: f64,
    /// Second turn, about y; in [0, π] where it comes from a frame.
    pub theta: f64,
    /// Third turn, about z again.
    pub psi: f64,
}

/// The frame of Eulerian angles.
///
/// Source: Eq. (1)
pub fn frame_from_euler(euler: &Euler) -> Matrix3<f64> {
    let (s_phi, c_phi) = euler.phi.sin_cos();
    let (s_theta, c_theta) = euler.theta.sin_cos();
    let (s_psi, c_psi) = euler.psi.sin_cos();
    Matrix3::new(
        c_theta * c_phi * c_psi - s_phi * s_psi,
        -c_theta * c_phi * s_psi - s_phi * c_psi,
        s_theta * c_phi,
        c_theta * s_phi * c_psi + c_phi * s_psi,
        -c_theta * s_phi * s_psi + c_phi * c_psi,
        s_theta * s_phi,
        -s_theta * c_psi,
        s_theta * s_psi,
        c_theta,
    )
}

/// Below this sin θ the first and third turns are told apart by rounding only.
const EULER_SINGULAR: f64 = 8.0 * f64::EPSILON;

/// The Eulerian angles of a frame, θ in [0, π].
///
/// At θ = 0 only φ + ψ is determined, at θ = π only φ − ψ: there ψ = 0 is returned.
///
/// Source: Eq. (1), solved
pub fn euler_from_frame(frame: &Matrix3<f64>) -> Euler {
    if frame.m13.hypot(frame.m23) <= EULER_SINGULAR {
        return Euler {
            phi: (-frame.m12).atan2(frame.m22),
            theta: if frame.m33 > 0.0 {
                0.0
            } else {
                std::f64::consts::PI
            },
            psi: 0.0,
        };
    }
    let phi = frame.m23.atan2(frame.m13);
    // θ and ψ are read after undoing φ, so that an ill-determined φ near the singularities is made up for by ψ.
    let (s, c) = phi.sin_cos();
    Euler {
        phi,
        theta: (c * frame.m13 + s * frame.m23).atan2(frame.m33),
        psi: (c * frame.m21 - s * frame.m11).atan2(c * frame.m22 - s * frame.m12),
    }
}

/// The body rates ω of `R' = R [ω]×` from Eulerian angles and their rates.
///
/// Source: Eq. (4)
pub fn body_rates(euler: &Euler, rates: &Euler) -> Vector3<f64> {
    let (s_theta, c_theta) = euler.theta.sin_cos();
    let (s_psi, c_psi) = euler.psi.sin_cos();
    Vector3::new(-s_theta * c_psi, s_theta * s_psi, c_theta) * rates.phi
        + Vector3::new(s_psi, c_psi, 0.0) * rates.theta
        + Vector3::new(0.0, 0.0, rates.psi)
}

#[cfg(test)]
mod tests {
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
        fn test_vee_undoes_hat(a in vector(5.0)) {
            prop_assert!((vee(&hat(&a)) - a).norm() < 1e-15);
        }

        #[test]
        fn test_jacobians_are_derivatives_of_exp(t in twist(1.5), d in twist(1.0)) {
            let h = 1e-5;
            let moved = Pose::exp(&(t + d * h)) * Pose::exp(&(t - d * h)).inverse();
            let left = moved.log().to_vector() / (2.0 * h);
            prop_assert!((t.left_jacobian() * d.to_vector() - left).norm() < 1e-7);
            let moved = Pose::exp(&(t - d * h)).inverse() * Pose::exp(&(t + d * h));
            let right = moved.log().to_vector() / (2.0 * h);
            prop_assert!((t.right_jacobian() * d.to_vector() - right).norm() < 1e-7);
        }

        #[test]
        fn test_jacobian_inverses_invert(t in twist(1.7)) {
            let identity = Matrix6::identity();
            prop_assert!((t.left_jacobian() * t.left_jacobian_inverse() - identity).norm() < 1e-11);
            prop_assert!((t.right_jacobian() * t.right_jacobian_inverse() - identity).norm() < 1e-11);
            let r = t.rotation;
            prop_assert!((right_jacobian(&r) * right_jacobian_inverse(&r) - Matrix3::identity()).norm() < 1e-12);
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
        fn test_adjoint_moves_a_twist_across_a_pose(a in pose(), t in twist(0.5)) {
            let left = a * Pose::exp(&t);
            let right = Pose::exp(&Twist::from_vector(&(a.adjoint() * t.to_vector()))) * a;
            prop_assert!((matrix4(&left) - matrix4(&right)).norm() < 1e-12);
        }

        #[test]
        fn test_bracket_is_the_derivative_of_the_adjoint(a in twist(1.0), b in twist(1.0)) {
            let h = 1e-5;
            let (up, down) = (Pose::exp(&(a * h)).adjoint(), Pose::exp(&(a * -h)).adjoint());
            let expected = (up - down) * b.to_vector() / (2.0 * h);
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
}
