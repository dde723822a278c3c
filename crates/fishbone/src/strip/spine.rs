//! The solved centre line with its ribs, from which the surface and every report are drawn.

use crate::geometry::{Pose, exp, gauss_points};
use crate::strip::element::{increment, increment_of, torsion};
use crate::strip::ribs::rib_convergence;
use crate::strip::shell::{Rib, RibCurve, interpolated};
use nalgebra::{Vector3, Vector4};

/// The piece of the belt between a node of the spine and the next.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub enum Piece {
    /// A flexible stretch.
    Strip {
        /// In-plane curvature κ_g of the flat board.
        geodesic: f64,
    },
    /// A stiffened stretch, straight and flat.
    Rigid,
    /// A place of no length where the fields may jump.
    Joint {
        /// Angle χ by which the board turns there, from η towards ζ; 0 but at a corner.
        angle: f64,
    },
}

impl Piece {
    /// In-plane curvature κ_g of the flat board along it.
    pub(crate) fn geodesic(self) -> f64 {
        match self {
            Self::Strip { geodesic } => geodesic,
            Self::Rigid | Self::Joint { .. } => 0.0,
        }
    }

    /// Angle by which the board turns at a point, from η towards ζ.
    pub(crate) fn corner(self) -> f64 {
        match self {
            Self::Joint { angle } => angle,
            Self::Rigid | Self::Strip { .. } => 0.0,
        }
    }
}

/// The spine at its nodes, in the units of the scenario.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct Spine {
    /// Width V of the belt.
    pub width: f64,
    /// The piece from each node to the next. Shapes: one fewer than there are nodes.
    pub pieces: Vec<Piece>,
    /// Signed half turns after which the end of a closed belt joins its start; `None` of an open belt.
    pub half_turns: Option<i32>,
    /// Arc length u of every node, not falling from 0 to U; repeated at a joint, before and after.
    pub u: Vec<f64>,
    /// Pose of every node.
    pub pose: Vec<Pose>,
    /// Bend ω_ζ at every node; linear in between.
    pub bend: Vec<f64>,
    /// Rib slope β = tan α at every node, Eq. (31); linear in between, but for curved ribs.
    pub rib_slope: Vec<f64>,
    /// The fields that curve the ribs of a strip of finite thickness; `None` where ribs are straight.
    pub(crate) curved: Option<CurvedRibs>,
}

/// The fields of a strip of finite thickness beyond bend and rib slope, at every node of its spine, and what it is made of.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct CurvedRibs {
    /// Rate of the rib slope; the slope is cubic in between.
    pub(crate) slope_rate: Vec<f64>,
    /// Twist m along the rib, b(t,d); linear in between.
    pub(crate) twist: Vec<f64>,
    /// Bend q of the rib, b(d,d); cubic in between.
    pub(crate) across: Vec<f64>,
    /// Rate of the bend of the rib.
    pub(crate) across_rate: Vec<f64>,
    /// The sheet of every element; of stiffeners and joints, which do not bend, [`Sheet::RIGID`].
    pub(crate) sheets: Vec<Sheet>,
    /// Heights along ξ above the neutral surface, from the bottom face through the faces between layers to the top face.
    pub(crate) faces: Vec<f64>,
}

/// What the strain of an element depends on besides its curvature.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Sheet {
    /// Poisson's ratio ν.
    pub(crate) poisson: f64,
    /// Stretching stiffness E h over the rigidity D.
    pub(crate) stretching: f64,
    /// Natural curvature along the spine, of the unloaded board.
    pub(crate) natural: f64,
}

impl Sheet {
    /// The sheet of a piece that does not bend.
    pub(crate) const RIGID: Self = Self {
        poisson: 0.0,
        stretching: f64::INFINITY,
        natural: 0.0,
    };
}

/// The spine at one arc length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SpinePoint {
    /// Arc length.
    pub u: f64,
    /// Pose: frame and position.
    pub pose: Pose,
    /// Bend ω_ζ.
    pub bend: f64,
    /// Rib slope β.
    pub rib_slope: f64,
    /// How its rib curves; `None` where it is straight.
    pub(crate) curve: Option<RibCurve>,
}

impl Spine {
    /// The open spine of given fields at the nodes, integrated from the pose at the first one.
    ///
    /// Shapes: `u`, `bend` and `rib_slope` of one length, `u` not falling, `pieces` one shorter.
    ///
    /// # Panics
    ///
    /// If the lengths differ.
    pub(crate) fn from_fields(
        width: f64,
        start: Pose,
        pieces: Vec<Piece>,
        u: Vec<f64>,
        bend: Vec<f64>,
        rib_slope: Vec<f64>,
    ) -> Self {
        assert!(u.len() == bend.len() && u.len() == rib_slope.len());
        assert_eq!(pieces.len() + 1, u.len());
        let mut spine = Self {
            width,
            pieces,
            half_turns: None,
            pose: vec![start; u.len()],
            u,
            bend,
            rib_slope,
            curved: None,
        };
        for element in 0..spine.elements() {
            spine.pose[element + 1] = spine.pose_within(element, spine.element_length(element));
        }
        spine
    }

    /// The open straight spine of given fields at the nodes; the fields may jump where a node is repeated.
    ///
    /// # Panics
    ///
    /// If the lengths differ.
    pub fn straight(
        width: f64,
        start: Pose,
        u: Vec<f64>,
        bend: Vec<f64>,
        rib_slope: Vec<f64>,
    ) -> Self {
        let piece = |pair: &[f64]| match pair[0] == pair[1] {
            true => Piece::Joint { angle: 0.0 },
            false => Piece::Strip { geodesic: 0.0 },
        };
        let pieces = u.windows(2).map(piece).collect();
        Self::from_fields(width, start, pieces, u, bend, rib_slope)
    }

    /// Length U.
    pub fn length(&self) -> f64 {
        self.u.last().copied().unwrap_or(0.0) - self.u.first().copied().unwrap_or(0.0)
    }

    /// Torsion ω_η at every node: −β ω_ζ, and the twist along curved ribs.
    ///
    /// Source: Eq. (32)
    pub(crate) fn torsion(&self) -> Vec<f64> {
        let fields = self.bend.iter().zip(&self.rib_slope);
        let twist = |node: usize| {
            self.curved
                .as_ref()
                .map_or(0.0, |curved| curved.twist[node])
        };
        fields
            .enumerate()
            .map(|(node, (&bend, &slope))| torsion(bend, slope) + twist(node))
            .collect()
    }

    /// Total torsion ∫ ω_η du.
    ///
    /// Simpson's rule, exact for the product of two linear fields, and of order four for curved ribs.
    ///
    /// Units: rad
    pub fn twist(&self) -> f64 {
        (0..self.elements())
            .map(|element| self.element_twist(element))
            .sum()
    }

    /// The spine at arc length u, held to [0, U]; before the jump where a node is repeated.
    ///
    /// # Panics
    ///
    /// If the spine has no nodes.
    pub(crate) fn at(&self, u: f64) -> SpinePoint {
        let next = self.u.partition_point(|&node| node < u);
        if next == self.u.len() {
            return self.node(next - 1);
        }
        if next == 0 || self.u[next] == u {
            return self.node(next);
        }
        self.within(next - 1, u - self.u[next - 1])
    }

    /// The spine at a node.
    ///
    /// # Panics
    ///
    /// If there is no such node.
    pub(crate) fn node(&self, index: usize) -> SpinePoint {
        SpinePoint {
            u: self.u[index],
            pose: self.pose[index],
            bend: self.bend[index],
            rib_slope: self.rib_slope[index],
            curve: self.curve_at_node(index),
        }
    }

    /// The curve of the rib at a node, by the flexible element that begins or ends there.
    fn curve_at_node(&self, index: usize) -> Option<RibCurve> {
        let is_strip =
            |element: &usize| matches!(self.pieces.get(*element), Some(Piece::Strip { .. }));
        let before = index.checked_sub(1).filter(is_strip);
        match Some(index).filter(is_strip) {
            Some(element) => self.curve(element, 0.0),
            None => before.and_then(|element| self.curve(element, self.element_length(element))),
        }
    }

    /// The curve of the rib inside an element; `None` where ribs are straight.
    fn curve(&self, element: usize, distance: f64) -> Option<RibCurve> {
        let rib = self.rib(element, distance)?;
        Some(RibCurve {
            twist: rib.twist,
            across: rib.across,
            convergence: rib.convergence,
            growth: rib.growth,
        })
    }

    /// What the curvature along a curved rib inside an element depends on; `None` where ribs are straight.
    pub(crate) fn rib(&self, element: usize, distance: f64) -> Option<Rib<f64>> {
        let curved = self.curved.as_ref()?;
        let node = |node: usize| {
            [
                self.bend[node],
                self.rib_slope[node],
                curved.slope_rate[node],
                curved.twist[node],
                curved.across[node],
                curved.across_rate[node],
            ]
        };
        let length = self.element_length(element);
        let t = if length > 0.0 { distance / length } else { 0.0 };
        let geodesic = self.pieces[element].geodesic();
        let (fields, rates) = interpolated([node(element), node(element + 1)], length, t);
        Some(Rib::of(&fields, &rates, geodesic))
    }

    /// The flexible elements: neither joints, which have no length, nor stiffeners, which have no ribs.
    pub(crate) fn strips(&self) -> impl Iterator<Item = usize> {
        (0..self.elements()).filter(|&element| {
            matches!(self.pieces[element], Piece::Strip { .. })
                && self.element_length(element) > 0.0
        })
    }

    /// Rib convergence s inside an element with straight ribs, at a point of given rib slope.
    pub(crate) fn convergence(&self, element: usize, rib_slope: f64) -> f64 {
        let rise = self.rib_slope[element + 1] - self.rib_slope[element];
        let rate = rise / self.element_length(element);
        rib_convergence(rate, self.pieces[element].geodesic(), rib_slope)
    }

    /// Rib convergence s in the middle of an element.
    pub(crate) fn mean_convergence(&self, element: usize) -> f64 {
        if let Some(rib) = self.rib(element, 0.5 * self.element_length(element)) {
            return rib.convergence;
        }
        let mean = 0.5 * (self.rib_slope[element] + self.rib_slope[element + 1]);
        self.convergence(element, mean)
    }

    /// Number of elements.
    pub(crate) fn elements(&self) -> usize {
        self.u.len().saturating_sub(1)
    }

    /// Length of an element; 0 where a node is repeated.
    pub(crate) fn element_length(&self, element: usize) -> f64 {
        self.u[element + 1] - self.u[element]
    }

    /// The spine inside an element, a distance after its first node.
    ///
    /// The fields are taken at the two Gauss points of the part before, so that a full element repeats the
    /// solver's own step.
    pub(crate) fn within(&self, element: usize, distance: f64) -> SpinePoint {
        let (bend, rib_slope) = self.fields(element, distance);
        SpinePoint {
            u: self.u[element] + distance,
            pose: self.pose_within(element, distance),
            bend,
            rib_slope,
            curve: self.curve(element, distance),
        }
    }

    /// Bend and rib slope inside an element.
    pub(crate) fn fields(&self, element: usize, distance: f64) -> (f64, f64) {
        if let Some(rib) = self.rib(element, distance) {
            return (-rib.bend, rib.slope);
        }
        let fraction = distance / self.element_length(element);
        let between = |field: &[f64]| match fraction.is_finite() {
            true => field[element] + fraction * (field[element + 1] - field[element]),
            false => field[element],
        };
        (between(&self.bend), between(&self.rib_slope))
    }

    fn pose_within(&self, element: usize, distance: f64) -> Pose {
        if self.curved.is_some()
            && let Piece::Strip { geodesic } = self.pieces[element]
        {
            let at = |t: f64| self.bend_and_torsion(element, t * distance);
            let step = increment_of(distance, geodesic, gauss_points().map(at));
            return self.pose[element] * step;
        }
        let (bend, slope) = (self.bend[element], self.rib_slope[element]);
        let (bend_there, slope_there) = self.fields(element, distance);
        let fields = Vector4::new(bend, slope, bend_there, slope_there);
        let piece = self.pieces[element];
        self.pose[element]
            * match piece {
                Piece::Joint { angle } => turn(angle),
                Piece::Strip { .. } | Piece::Rigid => {
                    increment(distance, piece.geodesic(), &fields)
                }
            }
    }

    /// Bend and torsion inside an element.
    fn bend_and_torsion(&self, element: usize, distance: f64) -> [f64; 2] {
        match self.rib(element, distance) {
            Some(rib) => [-rib.bend, rib.torsion()],
            None => {
                let (bend, rib_slope) = self.fields(element, distance);
                [bend, torsion(bend, rib_slope)]
            }
        }
    }

    fn element_twist(&self, element: usize) -> f64 {
        let length = self.element_length(element);
        let at = |distance: f64| self.bend_and_torsion(element, distance)[1];
        length / 6.0 * (at(0.0) + 4.0 * at(0.5 * length) + at(length))
    }
}

/// The turn of the frame about ξ at a bend of the board, Rot_ξ(χ).
pub(crate) fn turn(angle: f64) -> Pose {
    Pose {
        frame: exp(&(angle * Vector3::x())),
        position: Vector3::zeros(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::hat;
    use crate::strip::element::strain;
    use approx::assert_relative_eq;
    use nalgebra::Vector3;

    fn uniform(n: usize, bend: impl Fn(f64) -> f64, slope: impl Fn(f64) -> f64) -> Spine {
        let u: Vec<f64> = (0..=n).map(|i| i as f64 / n as f64).collect();
        let bend = u.iter().copied().map(bend).collect();
        let slope = u.iter().copied().map(slope).collect();
        Spine::straight(0.1, Pose::identity(), u, bend, slope)
    }

    #[test]
    fn test_constant_bend_makes_a_circle() {
        let spine = uniform(7, |_| 2.0, |_| 0.0);
        for u in [0.0f64, 0.1, 0.5, 0.93, 1.0] {
            let expected = Vector3::new((2.0 * u).cos() - 1.0, (2.0 * u).sin(), 0.0) / 2.0;
            assert_relative_eq!(spine.at(u).pose.position, expected, epsilon = 1e-14);
        }
    }

    #[test]
    fn test_constant_fields_make_a_helix_on_a_cylinder() {
        let (a, radius) = (0.4f64, 0.3);
        let spine = uniform(5, |_| a.cos().powi(2) / radius, |_| a.tan());
        let axis = Vector3::new(0.0, -a.sin(), a.cos());
        for i in 0..50 {
            let from_axis = spine.at(f64::from(i) / 49.0).pose.position + Vector3::x() * radius;
            assert_relative_eq!(from_axis.cross(&axis).norm(), radius, epsilon = 1e-13);
        }
    }

    #[test]
    fn test_points_between_nodes_converge_with_order_four() {
        let make = |n| uniform(n, |u| 3.0 - 5.0 * u, |u| 2.0 * u - 0.5);
        let fine = make(512).at(0.77).pose;
        let error = |n| (make(n).at(0.77).pose.position - fine.position).norm();
        assert!(error(16) < 1e-5);
        assert!((error(8) / error(32)).log2() > 7.0);
    }

    #[test]
    fn test_frame_turns_by_the_rates_between_nodes() {
        let spine = uniform(40, |u| 3.0 - 5.0 * u, |u| 2.0 * u - 0.5);
        let (u, h) = (0.4321, 1e-5);
        let (before, here, after) = (spine.at(u - h), spine.at(u), spine.at(u + h));
        let rates = strain(0.0, here.bend, here.rib_slope).rotation;
        let frame_rate = (after.pose.frame - before.pose.frame) / (2.0 * h);
        assert!((frame_rate - here.pose.frame * hat(&rates)).norm() < 1e-4);
        let tangent = (after.pose.position - before.pose.position) / (2.0 * h);
        assert!((tangent - here.pose.frame.column(1)).norm() < 1e-4);
    }

    #[test]
    fn test_end_of_an_element_is_its_second_node() {
        let spine = uniform(9, |u| 3.0 - 5.0 * u, |u| 2.0 * u);
        for element in 0..9 {
            let end = spine.within(element, spine.element_length(element));
            assert_relative_eq!(
                end.pose.position,
                spine.pose[element + 1].position,
                epsilon = 1e-14
            );
        }
    }

    #[test]
    fn test_arc_length_beyond_the_ends_is_held() {
        let spine = uniform(3, |_| 1.0, |u| u);
        assert_eq!(spine.at(-1.0), spine.node(0));
        assert_eq!(spine.at(2.0), spine.node(3));
    }

    #[test]
    fn test_at_a_repeated_node_the_one_before_counts() {
        let u = vec![0.0, 0.5, 0.5, 1.0];
        let spine = Spine::straight(
            0.1,
            Pose::identity(),
            u,
            vec![1.0, 1.0, 3.0, 3.0],
            vec![0.0; 4],
        );
        assert_eq!(spine.at(0.5).bend, 1.0);
        assert_eq!(spine.at(0.5 + 1e-9).bend, 3.0);
        assert_eq!(spine.pose[1], spine.pose[2]);
    }

    #[test]
    fn test_twist_is_exact_for_linear_fields() {
        // −∫ (3 − 5u)(2u − 0.5) du over [0, 1]
        let spine = uniform(3, |u| 3.0 - 5.0 * u, |u| 2.0 * u - 0.5);
        assert_relative_eq!(
            spine.twist(),
            -(-1.5 + 8.5 / 2.0 - 10.0 / 3.0),
            epsilon = 1e-14
        );
        assert_relative_eq!(spine.length(), 1.0);
    }
}
