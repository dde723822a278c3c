//! Supports of a node: positions, frames, hinges, Eq. (35), (36).

use super::Rows;
use crate::geometry::{Pose, carried_hessian, hat};
use nalgebra::{Matrix3, Matrix6, Rotation3, UnitQuaternion, Vector3, Vector6};
use std::f64::consts::TAU;

/// The prescribed part of a node's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub enum Hold {
    /// Nothing.
    Free,
    /// The whole frame.
    Frame(UnitQuaternion<f64>),
    /// The frame but for a turn about one of its own axes.
    Hinge {
        /// The prescribed frame, from which the node's may be turned about `axis`.
        frame: UnitQuaternion<f64>,
        /// Body axis: 0, 1, 2 for ξ, η, ζ.
        axis: usize,
        /// Moment on the belt about the axis, in mean R_f/U.
        moment: f64,
    },
}

impl Hold {
    /// The prescribed frame, free to turn about an axis or not.
    pub(crate) fn frame(&self) -> Option<UnitQuaternion<f64>> {
        match self {
            Self::Free => None,
            Self::Frame(frame) | Self::Hinge { frame, .. } => Some(*frame),
        }
    }

    /// The moment about a hinge's axis; 0 where there is none.
    pub(crate) fn moment(&self) -> f64 {
        match self {
            Self::Hinge { moment, .. } => *moment,
            Self::Free | Self::Frame(_) => 0.0,
        }
    }
}

/// Conditions at one node.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct NodeSupport {
    /// Index of the node.
    pub node: usize,
    /// Prescribed position, Eq. (35), each component or none.
    pub position: [Option<f64>; 3],
    /// Prescribed frame, Eq. (36).
    pub hold: Hold,
    /// Whether the rib at the node is square, β = 0.
    pub square_rib: bool,
}

/// The rotation from the prescribed frame to the present one as modified Rodrigues parameters `4 tan(θ/4) axis`, with
/// derivatives by the body rotation.
///
/// These parameters equal the rotation vector to first order near zero, and are zero at no other rotation. Unlike the
/// rotation vector and the skew part of the matrix they have regular derivatives up to and at a half-turn, where the shorter
/// of the two turns changes side.
#[derive(Debug, Clone, Copy)]
pub(super) struct RotationGap {
    scalar: f64,
    vector: Vector3<f64>,
}

impl RotationGap {
    pub(super) fn new(prescribed: &UnitQuaternion<f64>, frame: &Matrix3<f64>) -> Self {
        let now = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*frame));
        let gap = prescribed.conjugate() * now;
        /// Scalar part of the unit quaternion below which the turn counts as a half-turn, dimensionless: rounding must not
        /// choose between its two sides.
        const HALF_TURN: f64 = 1e-9;
        let decisive = match gap.w.abs() > HALF_TURN {
            true => gap.w,
            false => gap.imag()[gap.imag().iamax()],
        };
        let sign = 1f64.copysign(decisive);
        Self {
            scalar: sign * gap.w,
            vector: sign * gap.imag(),
        }
    }

    pub(super) fn value(&self) -> Vector3<f64> {
        4.0 * self.vector / (1.0 + self.scalar)
    }

    pub(super) fn jacobian(&self) -> Matrix3<f64> {
        let denominator = 1.0 + self.scalar;
        let by_rotation = self.scalar * Matrix3::identity() + hat(&self.vector);
        2.0 / denominator * by_rotation
            + 2.0 / (denominator * denominator) * self.vector * self.vector.transpose()
    }

    /// Second derivative of `weights · value`.
    fn hessian(&self, weights: &Vector3<f64>) -> Matrix3<f64> {
        let denominator = 1.0 + self.scalar;
        let numerator = weights.dot(&self.vector);
        let numerator_by = 0.5 * (self.scalar * weights + weights.cross(&self.vector));
        let denominator_by = -0.5 * self.vector;
        let mixed = numerator_by * denominator_by.transpose();
        let isotropic = -0.25 * numerator / denominator
            + 0.25 * numerator * self.scalar / (denominator * denominator);
        4.0 * (isotropic * Matrix3::identity() - (mixed + mixed.transpose()) / denominator.powi(2)
            + 2.0 * numerator / denominator.powi(3) * denominator_by * denominator_by.transpose())
    }
}

/// The gap between the prescribed axis of a hinge and the present axis: stereographic coordinates of the present axis, in
/// the prescribed frame, about the prescribed axis.
///
/// The gap is zero where the axes agree and nowhere else, and regular unless they oppose each other.
#[derive(Debug, Clone, Copy)]
struct AxisGap {
    axis: usize,
    /// The present body axis in the prescribed frame.
    seen: Vector3<f64>,
    /// Rotation from body axes to the prescribed frame's axes.
    to_prescribed: Matrix3<f64>,
}

/// A linear function of the seen axis with its derivatives by the body rotation.
struct Seen {
    value: f64,
    gradient: Vector3<f64>,
    hessian: Matrix3<f64>,
}

impl AxisGap {
    fn new(prescribed: &UnitQuaternion<f64>, axis: usize, frame: &Matrix3<f64>) -> Self {
        let to_prescribed = prescribed.to_rotation_matrix().matrix().transpose() * frame;
        Self {
            axis,
            seen: to_prescribed.column(axis).into_owned(),
            to_prescribed,
        }
    }

    /// The two axes square to the hinge's.
    fn square(&self) -> [usize; 2] {
        [(self.axis + 1) % 3, (self.axis + 2) % 3]
    }

    fn value(&self) -> Vector3<f64> {
        let [b, c] = self.square();
        let denominator = 1.0 + self.seen[self.axis];
        Vector3::new(self.seen[b], self.seen[c], 0.0) * (2.0 / denominator)
    }

    fn along(&self, direction: &Vector3<f64>) -> Seen {
        let axis = Vector3::ith(self.axis, 1.0);
        let direction = self.to_prescribed.tr_mul(direction);
        let outer = axis * direction.transpose();
        Seen {
            value: direction[self.axis],
            gradient: axis.cross(&direction),
            hessian: 0.5 * (outer + outer.transpose()) - direction[self.axis] * Matrix3::identity(),
        }
    }

    fn jacobian(&self) -> Matrix3<f64> {
        let own = self.along(&Vector3::ith(self.axis, 1.0));
        let denominator = 1.0 + own.value;
        let mut rows = Matrix3::zeros();
        for (row, other) in self.square().into_iter().enumerate() {
            let seen = self.along(&Vector3::ith(other, 1.0));
            let gradient = seen.gradient / denominator
                - seen.value / (denominator * denominator) * own.gradient;
            rows.row_mut(row).copy_from(&(2.0 * gradient).transpose());
        }
        rows
    }

    /// Second derivative of `weights · value`.
    fn hessian(&self, weights: &Vector3<f64>) -> Matrix3<f64> {
        let own = self.along(&Vector3::ith(self.axis, 1.0));
        let [b, c] = self.square();
        let seen = self.along(&(Vector3::ith(b, weights[0]) + Vector3::ith(c, weights[1])));
        let d = 1.0 + own.value;
        let mixed = seen.gradient * own.gradient.transpose();
        2.0 * (seen.hessian / d
            - (mixed + mixed.transpose() + seen.value * own.hessian) / d.powi(2)
            + 2.0 * seen.value / d.powi(3) * own.gradient * own.gradient.transpose())
    }
}

/// The angle by which a frame is turned about the axis of a hinge: that of the turn about the axis which, followed by the
/// shortest turn that tilts the axis, leads from the prescribed frame to the present one. With derivatives by the body
/// rotation.
///
/// The angle is determined but for whole turns, and regular unless the axes oppose each other.
#[derive(Debug, Clone, Copy)]
struct HingeAngle {
    axis: usize,
    /// Rotation from the prescribed frame to the present one.
    gap: UnitQuaternion<f64>,
}

impl HingeAngle {
    fn new(prescribed: &UnitQuaternion<f64>, axis: usize, frame: &Matrix3<f64>) -> Self {
        let now = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*frame));
        Self {
            axis,
            gap: prescribed.conjugate() * now,
        }
    }

    /// The angle, between −2π and 2π.
    fn value(&self) -> f64 {
        2.0 * self.gap.imag()[self.axis].atan2(self.gap.w)
    }

    /// Derivatives of the angle, and of the logarithm of cos(tilt/2).
    fn gradients(&self) -> [Vector3<f64>; 2] {
        let (scalar, vector) = (self.gap.w, self.gap.imag());
        let along = vector[self.axis];
        let scalar_by = -0.5 * vector;
        let axis = Vector3::ith(self.axis, 1.0);
        let along_by = 0.5 * (scalar * axis + axis.cross(&vector));
        let square = scalar * scalar + along * along;
        [
            2.0 / square * (scalar * along_by - along * scalar_by),
            (scalar * scalar_by + along * along_by) / square,
        ]
    }

    fn gradient(&self) -> Vector3<f64> {
        self.gradients()[0]
    }

    fn hessian(&self) -> Matrix3<f64> {
        let [angle, tilt] = self.gradients();
        let mixed = angle * tilt.transpose();
        -(mixed + mixed.transpose())
    }
}

/// The gap between the present frame and the prescribed part of it.
enum Gap {
    None,
    Rotation(RotationGap),
    Axis(AxisGap),
}

impl Gap {
    fn value(&self) -> Vector3<f64> {
        match self {
            Self::None => Vector3::zeros(),
            Self::Rotation(gap) => gap.value(),
            Self::Axis(gap) => gap.value(),
        }
    }

    fn jacobian(&self) -> Matrix3<f64> {
        match self {
            Self::None => Matrix3::zeros(),
            Self::Rotation(gap) => gap.jacobian(),
            Self::Axis(gap) => gap.jacobian(),
        }
    }

    fn hessian(&self, weights: &Vector3<f64>) -> Matrix3<f64> {
        match self {
            Self::None => Matrix3::zeros(),
            Self::Rotation(gap) => gap.hessian(weights),
            Self::Axis(gap) => gap.hessian(weights),
        }
    }
}

/// Derivatives of a support's conditions on a frame, and of the potential of its moment, by turns of the frame, from the left
/// and in world axes.
///
/// They depend only on the rotation from the prescribed frame to the present frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Turn {
    /// Derivative of the conditions.
    pub(crate) jacobian: Matrix3<f64>,
    /// Generalised force: the derivative of multipliers times conditions, and of the potential.
    pub(crate) generalised_force: Vector3<f64>,
    /// Second derivative of multipliers times conditions, and of the potential, along single turns.
    pub(crate) hessian: Matrix3<f64>,
}

impl NodeSupport {
    /// The prescribed position; `None` where a component is free.
    pub(crate) fn point(&self) -> Option<Vector3<f64>> {
        let [x, y, z] = self.position;
        Some(Vector3::new(x?, y?, z?))
    }

    /// The pose that is held; `None` unless all of it is.
    pub(crate) fn pose(&self) -> Option<Pose> {
        let Hold::Frame(frame) = self.hold else {
            return None;
        };
        Some(Pose {
            frame: frame.to_rotation_matrix().into_inner(),
            position: self.point()?,
        })
    }

    /// Holds another position, all of it, and, where it holds a frame, that of a pose.
    pub(crate) fn move_to(&mut self, pose: &Pose) {
        let [x, y, z] = pose.position.into();
        self.position = [Some(x), Some(y), Some(z)];
        match &mut self.hold {
            Hold::Free => (),
            Hold::Frame(frame) | Hold::Hinge { frame, .. } => {
                let turn = Rotation3::from_matrix_unchecked(pose.frame);
                *frame = UnitQuaternion::from_rotation_matrix(&turn);
            }
        }
    }

    /// The components of a vector along which the position is held.
    pub(crate) fn held(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|i, _| {
            if self.position[i].is_some() {
                vector[i]
            } else {
                0.0
            }
        })
    }

    fn gap(&self, pose: &Pose) -> Gap {
        match &self.hold {
            Hold::Free => Gap::None,
            Hold::Frame(frame) => Gap::Rotation(RotationGap::new(frame, &pose.frame)),
            Hold::Hinge { frame, axis, .. } => Gap::Axis(AxisGap::new(frame, *axis, &pose.frame)),
        }
    }

    /// The angle about the axis of a hinge, but for whole turns; `None` without a hinge that bears a moment.
    fn angle(&self, frame: &Matrix3<f64>) -> Option<HingeAngle> {
        match &self.hold {
            Hold::Hinge {
                frame: prescribed,
                axis,
                moment,
            } if *moment != 0.0 => Some(HingeAngle::new(prescribed, *axis, frame)),
            _ => None,
        }
    }

    /// The angle by which the last of some frames is turned about the axis of a hinge that bears a moment, followed from
    /// frame to frame, from less than half a turn at `origin`; `None` of another support.
    pub(super) fn turned<'a>(
        &self,
        origin: &'a Matrix3<f64>,
        frames: impl Iterator<Item = &'a Matrix3<f64>>,
    ) -> Option<f64> {
        let shortest = |angle: f64| angle - TAU * (angle / TAU).round();
        let mut before = self.angle(origin)?.value();
        let mut turned = shortest(before);
        for frame in frames {
            let angle = self.angle(frame)?.value();
            turned += shortest(angle - before);
            before = angle;
        }
        Some(turned)
    }

    /// Derivative of the angle about the axis of a hinge that bears a moment by the node's twist in world axes about the
    /// origin; `None` of another support.
    pub(super) fn turned_by_twist(&self, pose: &Pose) -> Option<Vector6<f64>> {
        let mut by_twist = Vector6::zeros();
        let by_turn = pose.frame * self.angle(&pose.frame)?.gradient();
        by_twist.fixed_rows_mut::<3>(3).copy_from(&by_turn);
        Some(by_twist)
    }

    /// Generalised force of the support by the node's twist in world axes about the origin: the derivative of multipliers
    /// times conditions, and of the potential of a hinge's moment, −moment × angle.
    pub(super) fn generalised_force(&self, pose: &Pose, multipliers: &Rows) -> Vector6<f64> {
        let of_conditions = self.jacobian(pose).tr_mul(multipliers);
        match self.turned_by_twist(pose) {
            Some(by_twist) => of_conditions - self.hold.moment() * by_twist,
            None => of_conditions,
        }
    }

    /// Second derivative, by body rotations, of multipliers times the frame's conditions and of the potential of a hinge's
    /// moment.
    fn hessian_of_frame(&self, pose: &Pose, multipliers: &Rows) -> Matrix3<f64> {
        let weights = multipliers.fixed_rows::<3>(3).into_owned();
        let of_conditions = self.gap(pose).hessian(&weights);
        match self.angle(&pose.frame) {
            Some(angle) => of_conditions - self.hold.moment() * angle.hessian(),
            None => of_conditions,
        }
    }

    pub(super) fn value(&self, pose: &Pose) -> Rows {
        let mut rows = Rows::zeros();
        for (i, held) in self.components() {
            rows[i] = pose.position[i] - held;
        }
        rows.fixed_rows_mut::<3>(3)
            .copy_from(&self.gap(pose).value());
        rows
    }

    /// Derivative of the values by the node's twist in world axes about the origin.
    pub(super) fn jacobian(&self, pose: &Pose) -> Matrix6<f64> {
        let mut rows = Matrix6::zeros();
        let by_turn = -hat(&pose.position);
        for (i, _) in self.components() {
            rows[(i, i)] = 1.0;
            rows.fixed_view_mut::<1, 3>(i, 3)
                .copy_from(&by_turn.fixed_rows::<1>(i));
        }
        rows.fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&(self.gap(pose).jacobian() * pose.frame.transpose()));
        rows
    }

    /// Second derivative of `multipliers · value`, and of the potential of a hinge's moment, by the node's twist.
    pub(super) fn hessian(&self, pose: &Pose, multipliers: &Rows) -> Matrix6<f64> {
        let force = self.held(&multipliers.fixed_rows::<3>(0).into());
        let mut hessian = carried_hessian(&pose.position, &force);
        let by_turn = self.hessian_of_frame(pose, multipliers);
        let mut turns = hessian.fixed_view_mut::<3, 3>(3, 3);
        turns += pose.frame * by_turn * pose.frame.transpose();
        hessian
    }

    /// The components of the position that are prescribed.
    fn components(&self) -> impl Iterator<Item = (usize, f64)> {
        let components = self.position.into_iter().enumerate();
        components.filter_map(|(i, held)| Some((i, held?)))
    }

    /// Derivatives of the frame's conditions by turns.
    pub(crate) fn turn(&self, pose: &Pose, multipliers: &Rows) -> Turn {
        let generalised_force = self.generalised_force(pose, multipliers);
        let about_node = pose.position.cross(&generalised_force.fixed_rows::<3>(0));
        let hessian = self.hessian_of_frame(pose, multipliers);
        Turn {
            jacobian: self.gap(pose).jacobian() * pose.frame.transpose(),
            generalised_force: generalised_force.fixed_rows::<3>(3) - about_node,
            hessian: pose.frame * hessian * pose.frame.transpose(),
        }
    }

    /// Force and moment of the support on the belt about its point, world axes.
    pub(crate) fn reaction(&self, pose: &Pose, multipliers: &Rows) -> (Vector3<f64>, Vector3<f64>) {
        let generalised_force = self.generalised_force(pose, multipliers);
        let force: Vector3<f64> = generalised_force.fixed_rows::<3>(0).into_owned();
        let moment = generalised_force.fixed_rows::<3>(3) - pose.position.cross(&force);
        (-force, -moment)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Twist, exp};

    fn frame() -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.4, 0.7))
    }

    fn support(hold: Hold) -> NodeSupport {
        NodeSupport {
            node: 0,
            position: [None; 3],
            hold,
            square_rib: false,
        }
    }

    fn turned(by: Vector3<f64>) -> Pose {
        Pose {
            frame: frame().to_rotation_matrix().into_inner() * exp(&by),
            position: Vector3::zeros(),
        }
    }

    #[test]
    fn test_derivatives_of_the_gaps_agree_with_finite_differences() {
        let mut holds: Vec<Hold> = (0..3)
            .map(|axis| Hold::Hinge {
                frame: frame(),
                axis,
                moment: 0.8,
            })
            .collect();
        holds.push(Hold::Frame(frame()));
        let weights = Rows::new(1.1, 0.6, -0.8, 0.7, -1.3, 0.4);
        let h = 1e-4;
        for mut support in holds.into_iter().map(support) {
            support.position = [Some(0.3), None, Some(-0.2)];
            let at = Pose {
                position: Vector3::new(0.5, -0.4, 0.8),
                ..turned(Vector3::new(0.9, -1.1, 0.5))
            };
            let moved = |by: Vector6<f64>| {
                let pose = Pose::exp(&Twist::from_vector(&by)) * at;
                let turned = support.turned(&at.frame, [&pose.frame].into_iter());
                let potential = -support.hold.moment() * turned.unwrap_or(0.0);
                support.value(&pose).dot(&weights) + potential
            };
            let exact = support.generalised_force(&at, &weights);
            let second = support.hessian(&at, &weights);
            for i in 0..6 {
                let e_i = h * Vector6::ith(i, 1.0);
                let difference = (moved(e_i) - moved(-e_i)) / (2.0 * h);
                assert!((difference - exact[i]).abs() < 1e-7);
                for j in 0..6 {
                    let e_j = h * Vector6::ith(j, 1.0);
                    let difference = (moved(e_i + e_j) - moved(e_i - e_j) - moved(e_j - e_i)
                        + moved(-e_i - e_j))
                        / (4.0 * h * h);
                    assert!((difference - second[(i, j)]).abs() < 1e-6);
                }
            }
        }
    }

    #[test]
    fn test_angle_about_a_hinge_is_counted_beyond_whole_turns() {
        for axis in 0..3 {
            let about = Vector3::ith(axis, 1.0);
            let support = support(Hold::Hinge {
                frame: frame(),
                axis,
                moment: 1.0,
            });
            for angle in [-20.0, -3.2, 0.5, 9.5] {
                let steps = (1..=40).map(|i| turned(about * (angle * f64::from(i) / 40.0)).frame);
                let steps: Vec<_> = steps.collect();
                let origin = turned(Vector3::zeros()).frame;
                let found = support.turned(&origin, steps.iter()).unwrap();
                assert!((found - angle).abs() < 1e-12, "{found} {angle}");
            }
        }
    }

    #[test]
    fn test_hinge_is_met_by_every_turn_about_its_axis_and_by_no_other() {
        for axis in 0..3 {
            let support = support(Hold::Hinge {
                frame: frame(),
                axis,
                moment: 0.0,
            });
            let value = |by: Vector3<f64>| support.value(&turned(by)).norm();
            for angle in [-3.0, -1.0, 0.0, 2.0, 3.1, 6.0] {
                assert!(value(angle * Vector3::ith(axis, 1.0)) < 1e-14);
                assert!(value(angle * Vector3::ith((axis + 1) % 3, 1.0)) > 0.1 || angle == 0.0);
            }
        }
    }
}
