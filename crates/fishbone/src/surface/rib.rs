//! Ribs: the straight lines of the surface, Eq. (20)–(22) and (26)–(33).

use super::locate::locate;
use crate::board::feet::{Board, End, Foot};
use crate::board::flat::FlatFrame;
use crate::geometry::Pose;
use crate::strip::shell::RibCurve;
use crate::strip::spine::Spine;
use nalgebra::{Vector2, Vector3};

/// Rib angle α = atan β.
///
/// Source: Eq. (31)
///
/// Units: rad, in (−π/2, π/2)
pub(crate) fn rib_angle(rib_slope: f64) -> f64 {
    rib_slope.atan()
}

/// Rib angle α = −atan(ω_η/ω_ζ) from the rates; `None` where both vanish and any line is a rib.
///
/// Source: Eq. (30)
///
/// Units: rad, in [−π/2, π/2]
pub fn rib_angle_from_rates(bend: f64, torsion: f64) -> Option<f64> {
    if bend == 0.0 && torsion == 0.0 {
        return None;
    }
    Some(-(torsion / bend).atan())
}

/// Unit vector along a rib, r = −η sin α + ζ cos α.
///
/// Source: Eq. (20)
pub fn rib_vector(pose: &Pose, rib_slope: f64) -> Vector3<f64> {
    pose.frame * Vector3::new(0.0, -rib_slope, 1.0) / 1f64.hypot(rib_slope)
}

/// Unit vector across a rib in the tangent plane, d₁ = η cos α + ζ sin α, the direction of κ₁.
///
/// The source prints ξ cos α + η sin α before Eq. (29), which does not lie in the surface.
pub fn bend_vector(pose: &Pose, rib_slope: f64) -> Vector3<f64> {
    pose.frame * Vector3::new(0.0, 1.0, rib_slope) / 1f64.hypot(rib_slope)
}

/// The greatest |dα/du| for which the ribs of a straight belt do not cross inside the width.
///
/// Source: Eq. (28)
pub fn rib_angle_rate_bound(rib_angle: f64, width: f64) -> f64 {
    2.0 * rib_angle.cos().powi(2) / width
}

/// A rib within the board, with the data from which its points follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rib {
    /// Arc length of its foot on the spine.
    pub u: f64,
    /// Pose of the foot.
    pub pose: Pose,
    /// Place of the foot in the flat board.
    pub flat: FlatFrame,
    /// Rib slope β.
    pub slope: f64,
    /// Coordinate of its end on the −ζ side, v ≤ 0.
    pub v_minus: f64,
    /// Coordinate of its end on the +ζ side, v ≥ 0.
    pub v_plus: f64,
    /// How it curves; `None` of a straight rib.
    pub(crate) curve: Option<RibCurve>,
}

impl Rib {
    /// The rib through P(u), ending where it leaves the board.
    ///
    /// # Panics
    ///
    /// If the spine has no nodes.
    pub fn at(spine: &Spine, u: f64) -> Self {
        let board = Board::of(spine);
        let foot = board.foot_at(spine, u);
        Self::new(&foot, &board.ends(&foot.rib))
    }

    pub(super) fn new(foot: &Foot, [minus, plus]: &[End; 2]) -> Self {
        Self {
            u: foot.point.u,
            pose: foot.point.pose,
            flat: foot.rib.foot,
            slope: foot.point.rib_slope,
            v_minus: minus.v,
            v_plus: plus.v,
            curve: foot.point.curve,
        }
    }

    /// The point v of the rib, x(u) + v (ζ − β η) of a straight one.
    ///
    /// Source: Eq. (20), (21)
    pub(crate) fn point(&self, v: f64) -> Vector3<f64> {
        match &self.curve {
            Some(curve) => (self.pose * curve.motion(self.slope, v)).position,
            None => self.pose.transform(&Vector3::new(0.0, -v * self.slope, v)),
        }
    }

    /// The same point of the flat board, (y, z).
    pub fn flat_point(&self, v: f64) -> Vector2<f64> {
        self.flat.global(&Vector2::new(-v * self.slope, v))
    }

    /// `n` values of v, evenly from the −ζ end to the +ζ end.
    pub(crate) fn stations(&self, n: usize) -> impl Iterator<Item = f64> + use<> {
        let (minus, plus) = (self.v_minus, self.v_plus);
        (0..n).map(move |i| {
            let fraction = i as f64 / (n.max(2) - 1) as f64;
            minus * (1.0 - fraction) + plus * fraction
        })
    }
}

/// The ribs at all nodes, clipped to the board.
///
/// At an end without a square rib the last ribs leave through the end line; the corner that no rib reaches is flat. Between
/// two stiffeners joined at a corner the whole board is flat, and the nodes' ribs there are lines of its plane.
///
/// # Panics
///
/// If the spine has no nodes.
pub fn ribs(spine: &Spine) -> Vec<Rib> {
    let board = Board::of(spine);
    let rib = |node: usize| {
        let foot = board.foot_at_node(spine, node);
        Rib::new(&foot, &board.ends(&foot.rib))
    };
    (0..spine.u.len()).map(rib).collect()
}

/// The ends of the ribs at all nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Edges {
    /// Ends on the −ζ side.
    pub minus: Vec<Vector3<f64>>,
    /// Ends on the +ζ side.
    pub plus: Vec<Vector3<f64>>,
}

/// The ends of the ribs at all nodes, clipped to the board.
///
/// Source: Eq. (21)
pub fn edges(spine: &Spine) -> Edges {
    let ribs = ribs(spine);
    Edges {
        minus: ribs.iter().map(|rib| rib.point(rib.v_minus)).collect(),
        plus: ribs.iter().map(|rib| rib.point(rib.v_plus)).collect(),
    }
}

/// `n_across` points along the rib of every node, evenly from its −ζ end to its +ζ end.
///
/// The first and the last of each row are the [`edges`].
///
/// Shapes: nodes × `n_across`
pub fn points(spine: &Spine, n_across: usize) -> Vec<Vec<Vector3<f64>>> {
    let row = |rib: &Rib| rib.stations(n_across).map(|v| rib.point(v)).collect();
    ribs(spine).iter().map(row).collect()
}

/// The deformed point of the flat point (y, z), or `None` off the board.
///
/// In a corner that no rib reaches the surface is the tangent plane of the nearest end. Where a flat board overlaps
/// itself the layer of the least arc length counts. The board of a closed belt goes on beyond its start and its end,
/// by a round to either side.
///
/// # Panics
///
/// If the spine has no nodes.
pub fn material_point(spine: &Spine, y: f64, z: f64) -> Option<Vector3<f64>> {
    let place = locate(spine, &Vector2::new(y, z))?;
    let local = place.foot.rib.foot.local(&place.point);
    let foot = &place.foot.point;
    let Some(curve) = &foot.curve else {
        return Some(foot.pose.transform(&Vector3::new(0.0, local.x, local.y)));
    };
    // Beyond the last rib the surface is the tangent plane along it.
    let beyond = local.x + local.y * foot.rib_slope;
    let there = foot.pose * curve.motion(foot.rib_slope, local.y);
    Some(there.transform(&Vector3::new(0.0, beyond, 0.0)))
}

/// Arc length of the foot of the rib through the flat point (y, z), that of the nearest rib where the board is flat
/// and no rib reaches the point, or `None` off the board.
///
/// # Panics
///
/// If the spine has no nodes.
pub fn rib_foot(spine: &Spine, y: f64, z: f64) -> Option<f64> {
    locate(spine, &Vector2::new(y, z)).map(|place| place.foot.point.u)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::samples::{spine, waves};
    use crate::strip::ribs::{rib_convergence, rib_convergence_bound};
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    fn wrap(a: f64, radius: f64) -> Spine {
        spine(1.0, 0.2, 60, |_| a.cos().powi(2) / radius, |_| a.tan())
    }

    /// Distance of a point from the axis of the cylinder that `wrap` is wound on.
    fn distance_from_axis(spine: &Spine, a: f64, radius: f64, point: &Vector3<f64>) -> f64 {
        let start = spine.pose[0];
        let axis = start.frame * Vector3::new(0.0, -a.sin(), a.cos());
        (point - start.transform(&Vector3::new(-radius, 0.0, 0.0)))
            .cross(&axis)
            .norm()
    }

    #[test]
    fn test_points_of_a_wrap_lie_on_its_cylinder() {
        for (a, radius) in [(0.5f64, 0.3), (-0.8, 0.7), (1.2, 0.1)] {
            let spine = wrap(a, radius);
            for point in points(&spine, 7).iter().flatten() {
                assert_relative_eq!(
                    distance_from_axis(&spine, a, radius, point),
                    radius,
                    epsilon = 1e-12
                );
            }
        }
    }

    #[test]
    fn test_rows_of_points_begin_and_end_on_the_edges() {
        let spine = spine(1.0, 0.1, 30, |u| 3.0 * u, |u| 0.4 - u);
        let edges = edges(&spine);
        for (i, row) in points(&spine, 5).iter().enumerate() {
            assert_eq!(
                (row.len(), row[0], row[4]),
                (5, edges.minus[i], edges.plus[i])
            );
        }
    }

    #[test]
    fn test_ribs_of_square_ends_span_the_width() {
        let spine = spine(1.0, 0.1, 30, |u| 3.0 * u, |u| u * (1.0 - u) + 1e-9);
        for rib in [ribs(&spine)[0], ribs(&spine)[30]] {
            assert_eq!((rib.v_minus, rib.v_plus), (-0.05, 0.05));
        }
    }

    #[test]
    fn test_last_ribs_of_a_free_end_leave_through_the_end_line() {
        let spine = spine(1.0, 0.1, 100, |u| 3.0 * u, |_| 1.0);
        let ribs = ribs(&spine);
        assert_relative_eq!(ribs[2].v_plus, 0.02, epsilon = 1e-14);
        assert_eq!(
            (ribs[2].v_minus, ribs[50].v_plus, ribs[0].v_plus),
            (-0.05, 0.05, 0.0)
        );
        assert_relative_eq!(ribs[98].v_minus, -0.02, epsilon = 1e-14);
    }

    #[test]
    fn test_rib_angle_has_the_slope_of_the_rates() {
        for (bend, slope) in [(2.0, 0.7), (-2.0, 0.7), (0.5, -3.0)] {
            let torsion = crate::strip::element::torsion(bend, slope);
            let angle = rib_angle_from_rates(bend, torsion).unwrap_or(f64::NAN);
            assert_relative_eq!(angle, rib_angle(slope), epsilon = 1e-15);
        }
        assert_eq!(rib_angle_from_rates(0.0, 0.0), None);
    }

    #[test]
    fn test_rib_bounds_are_one_bound() {
        // dα/du = β' cos² α
        let alpha = rib_angle(0.8);
        let rate = rib_convergence_bound(0.1) * alpha.cos().powi(2);
        assert_relative_eq!(rib_angle_rate_bound(alpha, 0.1), rate, epsilon = 1e-14);
        assert_eq!(rib_convergence(3.0, 2.0, 0.5), 5.5);
    }

    #[test]
    fn test_rib_and_bend_vectors_are_unit_and_square() {
        let pose = wrap(0.5, 0.3).pose[20];
        let (rib, bend) = (rib_vector(&pose, 0.7), bend_vector(&pose, 0.7));
        assert_relative_eq!(rib.norm(), 1.0, epsilon = 1e-14);
        assert_relative_eq!(
            bend.cross(&rib),
            pose.frame.column(0).into_owned(),
            epsilon = 1e-14
        );
    }

    #[test]
    fn test_points_off_the_board_are_none() {
        let spine = wrap(0.5, 0.3);
        for (y, z) in [
            (-0.01, 0.0),
            (1.01, 0.0),
            (0.5, 0.11),
            (0.5, -0.11),
            (f64::NAN, 0.0),
        ] {
            assert_eq!(material_point(&spine, y, z), None);
        }
    }

    #[test]
    fn test_ends_of_ribs_are_their_own_material_points() {
        let spine = spine(1.0, 0.1, 50, |u| 4.0 * u - 1.0, |u| 0.6 - 1.1 * u);
        for rib in ribs(&spine) {
            for v in rib.stations(4) {
                let flat = rib.flat_point(v);
                let point = material_point(&spine, flat.x, flat.y).unwrap_or_default();
                assert_relative_eq!(point, rib.point(v), epsilon = 1e-12);
            }
        }
    }

    proptest! {
        #[test]
        fn test_material_points_keep_lengths_and_angles(
            (bend, slope) in waves(15.0), y in 0.02..0.98f64, z in -0.045..0.045f64,
        ) {
            let spine = spine(1.0, 0.1, 400, |u| bend.at(u), |u| slope.at(u));
            let h = 1e-5;
            let x = |dy: f64, dz: f64| material_point(&spine, y + dy, z + dz).unwrap_or_default();
            let along = (x(h, 0.0) - x(-h, 0.0)) / (2.0 * h);
            let across = (x(0.0, h) - x(0.0, -h)) / (2.0 * h);
            prop_assert!((along.norm() - 1.0).abs() < 2e-3);
            prop_assert!((across.norm() - 1.0).abs() < 2e-3);
            prop_assert!(along.dot(&across).abs() < 2e-3);
        }
    }
}
