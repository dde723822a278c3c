//! Ties between two nodes: an offset of their positions, Eq. (35), and the seam of a closed belt.

use super::support::RotationGap;
use super::{BeltPoint, ROWS, Rows};
use crate::geometry::{Pose, carried_hessian, hat};
use nalgebra::{Matrix6, SMatrix, UnitQuaternion, Vector3};

/// Conditions between two nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct NodeLink {
    /// The two nodes.
    pub nodes: [usize; 2],
    /// State of the second node that follows from the first.
    pub tie: Tie,
}

/// State of one node that follows from another.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub enum Tie {
    /// Position, at a fixed offset in world axes, Eq. (35).
    Offset(Vector3<f64>),
    /// Pose: the same position, the frame turned by a rotation in body axes.
    Pose(UnitQuaternion<f64>),
    /// Fields in their order, each by a factor; `None` where it does not follow, and beyond the last field.
    Fields([Option<f64>; ROWS]),
}

impl NodeLink {
    pub(super) fn value<const F: usize>(&self, point: &BeltPoint<F>) -> Rows {
        let [a, b] = self.nodes;
        let [first, second] = [a, b].map(|node| &point.poses[node]);
        let mut rows = Rows::zeros();
        let mut set = |from: usize, values: Vector3<f64>| {
            rows.fixed_rows_mut::<3>(from).copy_from(&values);
        };
        match self.tie {
            Tie::Offset(offset) => set(0, second.position - first.position - offset),
            Tie::Pose(turn) => {
                set(0, second.position - first.position);
                set(3, gap(first, &turn, second).value());
            }
            Tie::Fields(factors) => {
                for (i, factor) in factors.into_iter().enumerate() {
                    let tied = |f| point.fields[b][i] - f * point.fields[a][i];
                    rows[i] = factor.map_or(0.0, tied);
                }
            }
        }
        rows
    }

    /// Derivative of the values by both nodes' unknowns, of which the first are a twist in world axes about the origin.
    pub(super) fn jacobian<const F: usize, const N: usize>(
        &self,
        point: &BeltPoint<F>,
    ) -> [SMatrix<f64, ROWS, N>; 2] {
        let [first, second] = self.nodes.map(|node| &point.poses[node]);
        let mut by = [SMatrix::zeros(); 2];
        if let Tie::Fields(factors) = self.tie {
            for (i, factor) in factors.into_iter().enumerate() {
                if let Some(factor) = factor {
                    (by[0][(i, 6 + i)], by[1][(i, 6 + i)]) = (-factor, 1.0);
                }
            }
            return by;
        }
        for (rows, pose, sign) in [(0, first, -1.0), (1, second, 1.0)] {
            let mut moved = by[rows].fixed_view_mut::<3, 3>(0, 0);
            moved.fill_diagonal(sign);
            by[rows]
                .fixed_view_mut::<3, 3>(0, 3)
                .copy_from(&(-sign * hat(&pose.position)));
        }
        if let Tie::Pose(turn) = self.tie {
            let jacobian = gap(first, &turn, second).jacobian() * second.frame.transpose();
            by[0].fixed_view_mut::<3, 3>(3, 3).copy_from(&-jacobian);
            by[1].fixed_view_mut::<3, 3>(3, 3).copy_from(&jacobian);
        }
        by
    }

    /// Second derivatives of `multipliers · values` by the twists of both nodes.
    ///
    /// Second derivatives of a frame tied to another are left out: where the tie is met they vanish in all directions that
    /// keep it.
    pub(super) fn hessians<const F: usize>(
        &self,
        point: &BeltPoint<F>,
        multipliers: &Rows,
    ) -> [Matrix6<f64>; 2] {
        let force = match self.tie {
            Tie::Offset(_) | Tie::Pose(_) => multipliers.fixed_rows::<3>(0).into_owned(),
            Tie::Fields(_) => Vector3::zeros(),
        };
        let [first, second] = self.nodes.map(|node| &point.poses[node].position);
        [
            carried_hessian(first, &-force),
            carried_hessian(second, &force),
        ]
    }
}

fn gap(first: &Pose, turn: &UnitQuaternion<f64>, second: &Pose) -> RotationGap {
    let frame = nalgebra::Rotation3::from_matrix_unchecked(first.frame);
    let prescribed = UnitQuaternion::from_rotation_matrix(&frame) * turn;
    RotationGap::new(&prescribed, &second.frame)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Twist, exp};
    use nalgebra::{Vector2, Vector6};

    #[test]
    fn test_derivatives_of_ties_agree_with_finite_differences() {
        let pose = |a: f64| Pose {
            frame: exp(&Vector3::new(0.3 * a, -0.8, 0.5 + a)),
            position: Vector3::new(a, 0.2, -0.1 * a),
        };
        let point = BeltPoint {
            fields: vec![Vector2::new(1.0, 0.3), Vector2::new(-2.0, 0.7)],
            poses: vec![pose(0.1), pose(1.3)],
        };
        let ties = [
            Tie::Offset(Vector3::new(0.1, 0.2, 0.3)),
            Tie::Pose(UnitQuaternion::from_scaled_axis(Vector3::new(
                0.2, 1.0, -0.4,
            ))),
            Tie::Fields([Some(-1.0), None, None, None, None, None]),
        ];
        let h = 1e-6;
        for tie in ties {
            let link = NodeLink { nodes: [0, 1], tie };
            let exact = link.jacobian::<2, 8>(&point);
            for (node, by_node) in exact.iter().enumerate() {
                for entry in 0..8 {
                    let moved = |size: f64| {
                        let mut moved = point.clone();
                        match entry {
                            0..6 => {
                                let twist = Twist::from_vector(&(size * Vector6::ith(entry, 1.0)));
                                moved.poses[node] = Pose::exp(&twist) * moved.poses[node];
                            }
                            _ => moved.fields[node][entry - 6] += size,
                        }
                        link.value(&moved)
                    };
                    let difference = (moved(h) - moved(-h)) / (2.0 * h);
                    assert!((difference - by_node.column(entry)).amax() < 1e-8);
                }
            }
        }
    }
}
