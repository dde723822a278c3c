//! Rates, frame and energy density at one point, from the unknown functions.

use super::Orientation;
use super::basis::LOCALS;
use crate::strip::developable::DevelopableEnergy;
use crate::strip::element::Curl;
use crate::strip::ribs::Across;
use nalgebra::{Matrix3, SVector};
use num_dual::DualNum;

/// A number that may carry derivatives.
pub(super) trait Scalar: DualNum<Primitive = f64> + Copy {}
impl<D: DualNum<Primitive = f64> + Copy> Scalar for D {}

/// Local variables (φ, φ', θ, θ', ψ, ψ', β, β').
pub(super) type Local<D> = SVector<D, LOCALS>;

/// Body rates ω_ξ, ω_η, ω_ζ.
///
/// Units: rad/U.
/// Source: Eq. (4)
pub(super) fn rates<D: Scalar>(q: &Local<D>) -> [D; 3] {
    let (dphi, dtheta, dpsi) = (q[1], q[3], q[5]);
    let ((st, ct), (sp, cp)) = (q[2].sin_cos(), q[4].sin_cos());
    [
        sp * dtheta - st * cp * dphi,
        st * sp * dphi + cp * dtheta,
        ct * dphi + dpsi,
    ]
}

/// Frame [ξ η ζ] of the Eulerian angles φ, θ, ψ.
///
/// Source: Eq. (1)
pub(super) fn frame<D: Scalar>([phi, theta, psi]: [D; 3]) -> Matrix3<D> {
    let ((sf, cf), (st, ct), (sp, cp)) = (phi.sin_cos(), theta.sin_cos(), psi.sin_cos());
    #[rustfmt::skip]
    let frame = Matrix3::new(
        ct * cf * cp - sf * sp, -ct * cf * sp - sf * cp, st * cf,
        ct * sf * cp + cf * sp, -ct * sf * sp + cf * cp, st * sf,
        -st * cp, st * sp, ct,
    );
    frame
}

/// The Eulerian angles among the local variables.
pub(super) fn euler<D: Scalar>(q: &Local<D>) -> [D; 3] {
    [q[0], q[2], q[4]]
}

/// Energy of a unit of length.
///
/// Units: R_f/U².
/// Source: Eq. (29), (34)
pub(super) fn density<D: Scalar>(energy: DevelopableEnergy, width: f64, q: &Local<D>) -> D {
    let across = Across::straight(q[7] * (0.5 * width));
    energy.value(rates(q)[2], q[6], &Curl::<f64>::default(), &across)
}

/// The three residuals that vanish where the orientation is the prescribed one.
///
/// For a frame R₁ the residuals are twice the Rodrigues vector of R₁ᵀA: the rotation vector to first order, rational, and
/// without the half-turns that the skew part of R₁ᵀA admits.
///
/// Units: rad.
/// Source: Eq. (36), (46), (49)
pub(super) fn misalignment<D: Scalar>(target: &Orientation, angles: [D; 3]) -> [D; 3] {
    match target {
        Orientation::Angles(prescribed) => [0, 1, 2].map(|i| angles[i] - prescribed[i]),
        Orientation::Frame(prescribed) => {
            let error = prescribed.map(D::from).transpose() * frame(angles);
            let scale = (error.trace() + 1.0).recip() * 2.0;
            [(2, 1), (0, 2), (1, 0)].map(|(i, j)| (error[(i, j)] - error[(j, i)]) * scale)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::Vector3;
    use num_dual::Dual64;

    /// Local variables in general position, in rad, rad/U, dimensionless and 1/U.
    const LOCAL: [f64; LOCALS] = [0.3, -0.7, 0.9, 1.1, -0.4, 0.6, 0.5, 2.0];

    #[test]
    fn rates_are_those_of_the_frame() {
        let q = Local::from(LOCAL);
        let angle = |i: usize, t: Dual64| t * q[2 * i + 1] + q[2 * i];
        let frame = |t| frame([0, 1, 2].map(|i| angle(i, t)));
        let still = frame(Dual64::from(0.0)).map(|entry| entry.re);
        let moving = frame(Dual64::from(0.0).derivative()).map(|entry| entry.eps);
        let [xi, eta, zeta] = rates(&q);
        let cross = Vector3::new(xi, eta, zeta).cross_matrix();
        assert_relative_eq!(moving, still * cross, epsilon = 1e-14);
    }

    #[test]
    fn misalignment_is_the_rotation_vector_to_first_order() {
        let q = Local::from(LOCAL);
        let at = frame(euler(&q));
        let turn = Vector3::new(1e-4, -2e-4, 3e-4);
        let target = at * nalgebra::Rotation3::new(-turn).into_inner();
        let error = misalignment(&Orientation::Frame(target), euler(&q));
        assert_relative_eq!(Vector3::from(error), turn, epsilon = 1e-11);
    }

    #[test]
    fn misalignment_does_not_vanish_at_a_half_turn() {
        let nearly = std::f64::consts::PI - 1e-3;
        let error = misalignment(&Orientation::Frame(Matrix3::identity()), [nearly, 0.0, 0.0]);
        assert!(error[2].abs() > 1e3);
    }
}
