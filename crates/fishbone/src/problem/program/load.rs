//! Dead forces: of fixed size and direction in the world, at points fixed in the body.

use crate::geometry::{Pose, carried_gradient, carried_hessian};
use nalgebra::{Matrix6, Vector3, Vector6};

/// A dead force at a node, or off it at the end of a lever fixed in the node's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct DeadForce {
    /// Force, world axes.
    pub force: Vector3<f64>,
    /// Lever from the node to the point of the force, body axes.
    pub lever: Vector3<f64>,
}

/// A dead force and the node that it acts on.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct NodeLoad {
    /// Index of the node.
    pub node: usize,
    /// The dead force.
    pub load: DeadForce,
}

impl DeadForce {
    /// Potential −F · (x + R l) of the force.
    pub(crate) fn potential(&self, pose: &Pose) -> f64 {
        -self.force.dot(&pose.transform(&self.lever))
    }

    /// Generalised force by a twist of the belt from the node on, as the gradient of the potential: a wrench about the
    /// origin, world axes.
    pub(super) fn generalised_force(&self, pose: &Pose) -> Vector6<f64> {
        carried_gradient(&pose.transform(&self.lever), &-self.force)
    }

    /// Second derivative of the potential by the twist.
    pub(super) fn hessian(&self, pose: &Pose) -> Matrix6<f64> {
        carried_hessian(&pose.transform(&self.lever), &-self.force)
    }
}

/// The weight of a piece of the belt as dead forces at its two ends, half of it each, with levers along the spine: the
/// integral of the position by Hermite's rule, h/2 (x₀ + x₁) + h²/12 (η₀ − η₁).
pub(crate) fn weight(per_length: &Vector3<f64>, length: f64) -> [DeadForce; 2] {
    [1.0, -1.0].map(|sign| DeadForce {
        force: 0.5 * length * per_length,
        lever: Vector3::y() * (sign * length / 6.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Twist, exp};
    use crate::strip::element::increment;
    use nalgebra::Vector4;

    #[test]
    fn test_derivatives_of_the_potential_agree_with_finite_differences() {
        let load = DeadForce {
            force: Vector3::new(1.0, -2.0, 0.5),
            lever: Vector3::new(0.3, 0.1, -0.2),
        };
        let at = Pose {
            frame: exp(&Vector3::new(0.5, 1.0, -0.7)),
            position: Vector3::new(0.1, 0.2, 0.3),
        };
        let moved = |by: Vector6<f64>| load.potential(&(Pose::exp(&Twist::from_vector(&by)) * at));
        let h = 1e-4;
        for i in 0..6 {
            let e_i = h * Vector6::ith(i, 1.0);
            let difference = (moved(e_i) - moved(-e_i)) / (2.0 * h);
            assert!((difference - load.generalised_force(&at)[i]).abs() < 1e-7);
            for j in 0..6 {
                let e_j = h * Vector6::ith(j, 1.0);
                let difference = (moved(e_i + e_j) - moved(e_i - e_j) - moved(e_j - e_i)
                    + moved(-e_i - e_j))
                    / (4.0 * h * h);
                assert!((difference - load.hessian(&at)[(i, j)]).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn test_weight_acts_at_the_centre_of_mass_of_a_bent_piece() {
        let (length, bend) = (0.2, 2.0);
        let fields = Vector4::new(bend, 0.0, bend, 0.0);
        let end = increment(length, 0.0, &fields);
        let gravity = Vector3::new(-3.0, 1.0, 0.7);
        let by_rule: f64 = weight(&gravity, length)
            .iter()
            .zip([Pose::identity(), end])
            .map(|(load, pose)| load.potential(&pose))
            .sum();
        let n = 2000;
        let exact: f64 = (0..n)
            .map(|i| {
                let u = (f64::from(i) + 0.5) / f64::from(n) * length;
                let x = Vector3::new((bend * u).cos() - 1.0, (bend * u).sin(), 0.0) / bend;
                -gravity.dot(&x) * length / f64::from(n)
            })
            .sum();
        assert!((by_rule - exact).abs() < 2e-5, "{by_rule} {exact}");
    }
}
