//! Rotations and rigid motions: SO(3) and SE(3), Eq. (1)–(4).
//!
//! A unit quaternion (w, x, y, z) of a frame is `nalgebra::UnitQuaternion::from_rotation_matrix`; it is
//! not wrapped here.

#[cfg(test)]
mod tests;

use nalgebra::{Matrix3, Matrix6, Rotation3, UnitQuaternion, Vector3, Vector6};
use std::ops::{Add, Mul, Neg, Sub};

/// A pose: the frame at a point of the spine and the point itself.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
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
    pub(crate) fn exp(twist: &Twist) -> Self {
        Self {
            frame: exp(&twist.rotation),
            position: left_jacobian(&twist.rotation) * twist.translation,
        }
    }

    /// The body twist that reaches this pose from the identity, its turn at most π.
    pub(crate) fn log(&self) -> Twist {
        let rotation = log(&self.frame);
        Twist {
            translation: left_jacobian_inverse(&rotation) * self.position,
            rotation,
        }
    }

    /// The pose that undoes this one.
    pub(crate) fn inverse(&self) -> Self {
        let frame = self.frame.transpose();
        Self {
            frame,
            position: -(frame * self.position),
        }
    }

    /// World coordinates of a point given in this pose's body axes.
    pub(crate) fn transform(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.position + self.frame * point
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
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct Wrench {
    /// Force.
    pub force: Vector3<f64>,
    /// Moment.
    pub moment: Vector3<f64>,
}

/// A twist in body axes: an element of se(3).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Twist {
    /// Translation ρ.
    pub translation: Vector3<f64>,
    /// Rotation vector ω.
    pub rotation: Vector3<f64>,
}

impl Twist {
    /// The twist as [translation; rotation].
    pub(crate) fn to_vector(self) -> Vector6<f64> {
        let (a, b) = (&self.translation, &self.rotation);
        Vector6::new(a.x, a.y, a.z, b.x, b.y, b.z)
    }

    /// The twist of [translation; rotation].
    pub(crate) fn from_vector(vector: &Vector6<f64>) -> Self {
        Self {
            translation: vector.fixed_rows::<3>(0).into(),
            rotation: vector.fixed_rows::<3>(3).into(),
        }
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
pub(crate) fn bracket(a: &Twist, b: &Twist) -> Twist {
    Twist {
        translation: a.rotation.cross(&b.translation) - b.rotation.cross(&a.translation),
        rotation: a.rotation.cross(&b.rotation),
    }
}

/// The twist Ω of a fourth-order step T(u + h) = T(u) exp(Ω) of `T' = T [ξ(u)]`.
///
/// `twist_1` and `twist_2` are ξ, per unit u, at the two Gauss points of the step, `u + h (1/2 ∓ √3/6)`. The bracket
/// has the opposite sign of the textbooks' Y' = A(u) Y, because ξ acts from the right.
pub(crate) fn magnus(twist_1: &Twist, twist_2: &Twist, h: f64) -> Twist {
    (*twist_1 + *twist_2) * (0.5 * h) + bracket(twist_1, twist_2) * (3f64.sqrt() / 12.0 * h * h)
}

/// Shortening of the chord of a step, per cube of its length and square of the rise of the bend between its Gauss points,
/// dimensionless.
///
/// A fourth-order step along which the bend changes from −a to a is longer than its arc, by as much as the arc is longer
/// than its true chord. A belt under tension would gain by such a zigzag of its bend. The term of the sixth-order step that makes the
/// chord as short as it is, [δ, [δ, ξ]] h³/80 with the rise δ of the twist, is therefore kept, of the translation along η.
///
/// Source: S. Blanes, F. Casas, J. A. Oteo, J. Ros, "The Magnus expansion and some of its applications" (2009), Sec. 5.4
pub(crate) const SHORTENING: f64 = 1.0 / 80.0;

/// Positions of the two Gauss points of an element, as fractions of its length.
#[inline(always)]
pub(crate) fn gauss_points() -> [f64; 2] {
    let offset = 3f64.sqrt() / 6.0;
    [0.5 - offset, 0.5 + offset]
}

/// Derivative of `force · x` by a twist, world axes about the origin, that carries the point x along: the force and its
/// moment about the origin.
pub(crate) fn carried_gradient(point: &Vector3<f64>, force: &Vector3<f64>) -> Vector6<f64> {
    let moment = point.cross(force);
    Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
}

/// Second derivative of `force · x` by the twist.
pub(crate) fn carried_hessian(point: &Vector3<f64>, force: &Vector3<f64>) -> Matrix6<f64> {
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
pub(crate) fn hat(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
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
pub(crate) fn left_jacobian(rotation: &Vector3<f64>) -> Matrix3<f64> {
    Coefficients::at(rotation.norm_squared()).left_jacobian(rotation)
}

/// The inverse of the left Jacobian; singular at a full turn.
pub(crate) fn left_jacobian_inverse(rotation: &Vector3<f64>) -> Matrix3<f64> {
    let c = Coefficients::at(rotation.norm_squared());
    even_polynomial(rotation, -0.5, -c.cosine[1] / c.cosine[0])
}

/// `I + a [φ]× + b [φ]×²`.
fn even_polynomial(rotation: &Vector3<f64>, a: f64, b: f64) -> Matrix3<f64> {
    let k = hat(rotation);
    Matrix3::identity() + k * a + k * k * b
}

/// The three even functions of the angle θ that SO(3) and SE(3) are made of, with their first and second
/// derivatives by t = θ².
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Coefficients {
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
    pub(crate) fn at(t: f64) -> Self {
        match t < SERIES_BELOW {
            true => Self::near(t),
            false => Self::of(&stumpff_closed(t)),
        }
    }

    /// The coefficients at t ≤ 1, without a branch.
    #[inline(always)]
    pub(crate) fn near(t: f64) -> Self {
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
    pub(crate) fn exp(&self, rotation: &Vector3<f64>) -> Matrix3<f64> {
        even_polynomial(rotation, self.sine[0], self.cosine[0])
    }

    /// The left Jacobian of SO(3) at φ, the coefficients being those of φ.
    pub(crate) fn left_jacobian(&self, rotation: &Vector3<f64>) -> Matrix3<f64> {
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

/// Squared angle t = θ² below which the Stumpff functions come from their series, in rad². At t = 1 the closed forms of c₆
/// and c₇ have lost three digits, at t = 0.01 ten.
const SERIES_BELOW: f64 = 1.0;

/// Reciprocal factorials 1/n! for n = 0 … 7, dimensionless.
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

/// Terms of the series of c₆ and c₇, a number: the rest is less than 1e-18 at t = 1.
const TERMS: usize = 9;
/// Coefficients of the series of c₆ in powers of t, dimensionless.
const SIXTH: [f64; TERMS] = series_coefficients(6);
/// Coefficients of the series of c₇ in powers of t, dimensionless.
const SEVENTH: [f64; TERMS] = series_coefficients(7);

/// The coefficients (−1)^k / (2k + n)! of the series of c_n.
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

/// The Stumpff functions in closed form: c₀ and c₁ by cos and sin, the others by c_{n+2} = (1/n! − c_n) / t.
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
pub(crate) fn frame_from_euler(euler: &Euler) -> Matrix3<f64> {
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

/// Sine of θ below which rounding alone separates the first turn from the third, dimensionless.
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
