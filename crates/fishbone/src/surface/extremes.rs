//! Highest point, tightest bend, narrowest margin.

use super::curvature::{bend_radius, curvature};
use super::thick::{BoardTensor, ThickBoard};
use crate::board::feet::Board;
use crate::strip::flat::FLAT;
use crate::strip::ribs::rib_convergence_bound;
use crate::strip::spine::{Spine, SpinePoint};
use nalgebra::Vector3;

/// The farthest point of the spine along a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HighestPoint {
    /// Arc length of the point.
    pub u: f64,
    /// Position of the point.
    pub position: Vector3<f64>,
}

/// The farthest point of the spine along a direction (of any length), between nodes too; the first of equals.
///
/// # Panics
///
/// If the spine has no nodes.
pub(crate) fn highest_point(spine: &Spine, direction: &Vector3<f64>) -> HighestPoint {
    let nodes = (0..spine.u.len()).map(|node| spine.node(node));
    let peaks = (0..spine.elements()).flat_map(|element| peaks(spine, element, direction));
    let height = |point: &SpinePoint| point.pose.position.dot(direction);
    let higher = |best: SpinePoint, point| {
        if height(&point) > height(&best) {
            point
        } else {
            best
        }
    };
    let best = nodes.chain(peaks).fold(spine.node(0), higher);
    HighestPoint {
        u: best.u,
        position: best.pose.position,
    }
}

/// Number of equal pieces of an element that turn by half a radian at most, so that none hides a peak and a valley.
fn pieces(spine: &Spine, element: usize) -> usize {
    let geodesic = spine.pieces[element].geodesic();
    let bend = |node: usize| spine.bend[node] * 1f64.hypot(spine.rib_slope[node]);
    let rate = |node: usize| bend(node).hypot(geodesic);
    let turn = spine.element_length(element) * rate(element).max(rate(element + 1));
    (2.0 * turn).ceil().clamp(1.0, 1000.0) as usize
}

/// The points inside an element where the spine turns from rising to falling along a direction.
fn peaks(spine: &Spine, element: usize, direction: &Vector3<f64>) -> Vec<SpinePoint> {
    let rise = |distance: f64| {
        let tangent = spine
            .within(element, distance)
            .pose
            .frame
            .column(1)
            .into_owned();
        tangent.dot(direction)
    };
    let piece = spine.element_length(element) / pieces(spine, element) as f64;
    let bounds = (0..pieces(spine, element)).map(|i| (i as f64 * piece, (i + 1) as f64 * piece));
    let with_peak = bounds.filter(|&(a, b)| rise(a) > 0.0 && rise(b) < 0.0);
    with_peak
        .map(|(a, b)| spine.within(element, bisect(rise, a, b)))
        .collect()
}

/// The root of a falling function between a and b.
fn bisect(f: impl Fn(f64) -> f64, mut a: f64, mut b: f64) -> f64 {
    for _ in 0..60 {
        let middle = 0.5 * (a + b);
        if f(middle) > 0.0 {
            a = middle;
        } else {
            b = middle;
        }
    }
    0.5 * (a + b)
}

/// An extreme value over the board, with its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extreme {
    /// The value; a radius is 0 where straight ribs meet on an edge.
    pub value: f64,
    /// Arc length u of the place; where ribs are straight, of the foot of its rib.
    pub u: f64,
    /// Distance v of the place from the spine, in the flat board.
    pub v: f64,
}

/// The tightest bend of the spine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpineRadius {
    /// Radius.
    pub value: f64,
    /// Arc length of its place.
    pub u: f64,
}

/// The least radius of bend on the spine, 1/|κ₁|, between nodes too; `None` where the belt is flat all over: where no radius
/// is below 1e8 U, as bends below 1e-8/U are rounding of a solve.
///
/// Over the whole width the radius falls with every refinement of the mesh, at the inflections of the spine; on the
/// spine it converges.
pub fn least_spine_radius(spine: &Spine) -> Option<SpineRadius> {
    let at_node = |node: usize| SpineRadius {
        value: 1.0 / node_curvature(spine, node),
        u: peak_at(spine, node),
    };
    let inside = |element: usize| {
        let turning = turning_points(spine, element).into_iter();
        turning.map(move |distance| {
            let (bend, slope) = spine.fields(element, distance);
            SpineRadius {
                value: 1.0 / curvature(bend, slope).abs(),
                u: spine.u[element] + distance,
            }
        })
    };
    let radii = (0..spine.u.len())
        .map(at_node)
        .chain(spine.strips().flat_map(inside));
    let radii: Vec<SpineRadius> = match spine.curved {
        Some(_) => radii_on_spine(spine),
        None => radii.collect(),
    };
    let least = radii.into_iter().min_by(|a, b| a.value.total_cmp(&b.value));
    least.filter(|radius| radius.value * FLAT < spine.length())
}

/// Radii of a strip of finite thickness at points of its spine.
fn radii_on_spine(spine: &Spine) -> Vec<SpineRadius> {
    /// Parts of an element between the points, a number.
    const PARTS: usize = 4;
    let places = |element: usize| (0..=PARTS).map(move |i| (element, i as f64 / PARTS as f64));
    let at = |(element, share): (usize, f64)| {
        let distance = share * spine.element_length(element);
        let rib = spine.rib(element, distance)?;
        let bend = BoardTensor::on_rib(&rib.curvature(0.0, 0.0), rib.slope).largest();
        Some(SpineRadius {
            value: 1.0 / bend,
            u: spine.u[element] + distance,
        })
    };
    spine.strips().flat_map(places).filter_map(at).collect()
}

fn node_curvature(spine: &Spine, node: usize) -> f64 {
    curvature(spine.bend[node], spine.rib_slope[node]).abs()
}

/// Arc length of the peak of the curvature at a node: the vertex of the parabola through it and its neighbours, where they
/// lie on one smooth stretch and are no higher.
///
/// The slope of the parabola is that of the chords in the middles of the elements, and linear.
fn peak_at(spine: &Spine, node: usize) -> f64 {
    let u = spine.u[node];
    let is_inside = 0 < node && node < spine.elements();
    if !is_inside || spine.pieces[node - 1] != spine.pieces[node] {
        return u;
    }
    let [before, after] = [node - 1, node].map(|element| {
        let rise = node_curvature(spine, element + 1) - node_curvature(spine, element);
        let middle = 0.5 * (spine.u[element] + spine.u[element + 1]);
        (middle, rise / spine.element_length(element))
    });
    match before.1 >= 0.0 && after.1 <= 0.0 && before.1 > after.1 {
        true => before.0 + (after.0 - before.0) * before.1 / (before.1 - after.1),
        false => u,
    }
}

/// Distances into an element at which its curvature, ω_ζ (1 + β²) with both fields linear, turns from rising to falling or
/// back: the roots of its derivative, a quadratic.
fn turning_points(spine: &Spine, element: usize) -> Vec<f64> {
    let rise = |field: &[f64]| (field[element], field[element + 1] - field[element]);
    let ((bend, bend_rise), (slope, slope_rise)) = (rise(&spine.bend), rise(&spine.rib_slope));
    let constant = bend_rise * (1.0 + slope * slope) + 2.0 * bend * slope * slope_rise;
    let linear = 2.0 * slope_rise * (2.0 * bend_rise * slope + bend * slope_rise);
    let square = 3.0 * bend_rise * slope_rise * slope_rise;
    // The larger of the two sums keeps the digits of both roots.
    let root = (linear * linear - 4.0 * square * constant).sqrt();
    let sum = -0.5 * (linear + root.copysign(linear));
    let shares = [sum / square, constant / sum].into_iter();
    shares
        .filter(|share| 0.0 < *share && *share < 1.0)
        .map(|share| share * spine.element_length(element))
        .collect()
}

/// Samples in each smooth piece from which the tightest bend is refined, a number.
const SAMPLES: usize = 8;

/// The least radius of bend over the whole width, (1 − v s)/|κ₁|; `None` where the belt is flat all over, as for
/// [`least_spine_radius`].
///
/// The tightest point of a straight rib is the end towards which the ribs converge.
///
/// Of a strip of finite thickness the radius converges with the mesh: it is that of the whole board, the layers along its free
/// edges included, at least V/5 away from clamps: from both ends of the board (of a closed belt, from its seam), from
/// stiffeners and corners, and from places where the bend may jump, as at supports that hold a frame. Nearer, at the corners of
/// a clamp, the curvature of a sheet is far larger, and the model does not know it. `None` also where no part of the board is so
/// far from clamps.
pub fn least_bend_radius(spine: &Spine) -> Option<Extreme> {
    /// Radius at the samples of a part over the least of all beyond which the part has no tighter bend; dimensionless.
    const FAR: f64 = 2.0;
    if let Some(board) = ThickBoard::of(spine) {
        return board.least_radius();
    }
    least_spine_radius(spine)?;
    let board = Board::of(spine);
    let parts = spine
        .strips()
        .flat_map(|element| smooth_parts(spine, &board, element));
    let sampled: Vec<_> = parts
        .map(|part| (part, tightest_sample(spine, &board, part)))
        .collect();
    let values = sampled.iter().map(|(_, sample)| sample.value);
    let near = FAR * values.fold(f64::INFINITY, f64::min);
    let tight = sampled
        .into_iter()
        .filter(|(_, sample)| sample.value <= near);
    let bends = tight.map(|(part, sample)| tightest_near(spine, &board, part, sample));
    let least = bends.min_by(|a, b| a.value.total_cmp(&b.value));
    least.filter(|bend| bend.value.is_finite())
}

/// A part of an element, by distances from its first node.
#[derive(Clone, Copy)]
pub(super) struct Part {
    pub(super) element: usize,
    pub(super) from: f64,
    pub(super) to: f64,
}

/// The parts of an element between the ribs through the board's vertices, where the ribs' ends change lines.
pub(super) fn smooth_parts(spine: &Spine, board: &Board, element: usize) -> Vec<Part> {
    let mut cuts = board.vertex_ribs(spine, element);
    cuts.insert(0, 0.0);
    cuts.push(spine.element_length(element));
    cuts.windows(2)
        .map(|cut| Part {
            element,
            from: cut[0],
            to: cut[1],
        })
        .collect()
}

/// Distance between the samples of a part.
fn step(part: Part) -> f64 {
    (part.to - part.from) / SAMPLES as f64
}

fn sharper(a: Extreme, b: Extreme) -> Extreme {
    if b.value < a.value { b } else { a }
}

/// The tightest of the samples of a part.
fn tightest_sample(spine: &Spine, board: &Board, part: Part) -> Extreme {
    let radius = |distance: f64| tightest_on_rib(spine, board, part.element, distance);
    let samples = (1..=SAMPLES).map(|i| radius(part.from + i as f64 * step(part)));
    samples.fold(radius(part.from), sharper)
}

/// The tightest bend of a part about the tightest of its samples.
fn tightest_near(spine: &Spine, board: &Board, part: Part, best: Extreme) -> Extreme {
    let radius = |distance: f64| tightest_on_rib(spine, board, part.element, distance);
    let centre = best.u - spine.u[part.element];
    let step = step(part);
    let (low, high) = ((centre - step).max(part.from), (centre + step).min(part.to));
    sharper(best, radius(golden_section(|x| radius(x).value, low, high)))
}

fn tightest_on_rib(spine: &Spine, board: &Board, element: usize, distance: f64) -> Extreme {
    let (bend, slope) = spine.fields(element, distance);
    let s = spine.convergence(element, slope);
    let [minus, plus] = board.ends(&board.rib_within(spine, element, distance));
    let v = if s > 0.0 {
        plus.v
    } else if s < 0.0 {
        minus.v
    } else {
        0.0
    };
    Extreme {
        value: bend_radius(curvature(bend, slope), s, v),
        u: spine.u[element] + distance,
        v,
    }
}

/// The minimiser of a function with one valley between a and b.
fn golden_section(f: impl Fn(f64) -> f64, mut a: f64, mut b: f64) -> f64 {
    /// Count of cuts, a number: what is left is the square root of rounding, which the value at a valley does not show.
    const CUTS: usize = 40;
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let inner = |a: f64, b: f64| [b - ratio * (b - a), a + ratio * (b - a)];
    let [mut left, mut right] = inner(a, b);
    let (mut at_left, mut at_right) = (f(left), f(right));
    for _ in 0..CUTS {
        if at_left < at_right {
            (b, right, at_right) = (right, left, at_left);
            left = inner(a, b)[0];
            at_left = f(left);
        } else {
            (a, left, at_left) = (left, right, at_right);
            right = inner(a, b)[1];
            at_right = f(right);
        }
    }
    0.5 * (a + b)
}

/// Margin of the ribs against crossing on an edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RibMargin {
    /// Least of 2/V − |s|; negative where ribs cross inside the width.
    pub value: f64,
    /// Arc length of the middle of the element where the margin is least.
    pub u: f64,
}

/// The least of 2/V − |s| over the flexible elements, with s in the middle of each element, where the solver bounds it.
///
/// Source: Eq. (33)
pub fn rib_margin(spine: &Spine) -> RibMargin {
    let bound = rib_convergence_bound(spine.width);
    let margin = |element: usize| RibMargin {
        value: bound - spine.mean_convergence(element).abs(),
        u: 0.5 * (spine.u[element] + spine.u[element + 1]),
    };
    let start = RibMargin {
        value: bound,
        u: spine.u.first().copied().unwrap_or(0.0),
    };
    let narrower = |a: RibMargin, b: RibMargin| if b.value < a.value { b } else { a };
    spine.strips().map(margin).fold(start, narrower)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::samples::{spine, waves};
    use crate::geometry::Pose;
    use crate::strip::spine::Piece;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    #[test]
    fn test_tightest_bend_of_the_spine_is_where_its_curvature_is_largest() {
        let hump = |u: f64| 3.0 - 8.0 * (u - 0.5).powi(2);
        let least = least_spine_radius(&spine(1.0, 0.1, 40, hump, |_| 0.5)).unwrap();
        assert!((least.value - 1.0 / (3.0 * 1.25)).abs() < 1e-12);
        assert!((least.u - 0.5).abs() < 1e-12);
        assert_eq!(
            least_spine_radius(&spine(1.0, 0.1, 40, |_| 0.0, |_| 0.5)),
            None
        );
    }

    #[test]
    fn test_tightest_bend_of_the_spine_is_found_between_nodes() {
        // ω (1 + β²) = (2 − u)(1 + 25 u²) in one element has its maximum where 25 (4u − 3u²) = 1 a second time.
        let spine = spine(1.0, 0.1, 1, |u| 2.0 - u, |u| 5.0 * u);
        let least = least_spine_radius(&spine).unwrap();
        assert_eq!(least.u, 1.0);
        let spine = self::spine(1.9, 0.1, 1, |u| 2.0 - u, |u| 5.0 * u);
        let least = least_spine_radius(&spine).unwrap();
        let u = (2.0 + (4.0f64 - 3.0 / 25.0).sqrt()) / 3.0;
        assert_relative_eq!(least.u, u, epsilon = 1e-13);
        let expected = 1.0 / ((2.0 - u) * (1.0 + 25.0 * u * u));
        assert_relative_eq!(least.value, expected, epsilon = 1e-13);
    }

    #[test]
    fn test_tightest_bend_of_the_spine_is_placed_between_equal_nodes() {
        let hump = |u: f64| 3.0 - 8.0 * (u - 0.43).powi(2);
        for n in [7, 9, 20] {
            let least = least_spine_radius(&spine(1.0, 0.1, n, hump, |_| 0.0)).unwrap();
            assert_relative_eq!(least.u, 0.43, epsilon = 1e-13);
            let tent = |u: f64| 1.0 - (u - 1.0).abs();
            let peak = least_spine_radius(&spine(2.0, 0.1, 2 * n, tent, |_| 0.0)).unwrap();
            assert_eq!((peak.u, peak.value), (1.0, 1.0));
        }
    }

    #[test]
    fn test_highest_point_of_a_circle_is_found_between_nodes() {
        // The spine is half a turn of a circle of radius 1/3 in three elements.
        let length = 3.0 * std::f64::consts::PI / 3.0;
        let u = (0..4).map(|i| length * f64::from(i) / 3.0).collect();
        let spine = Spine::straight(0.1, Pose::identity(), u, vec![3.0; 4], vec![0.0; 4]);
        let direction = Vector3::new(-0.6, 0.8, 0.0) * 5.0;
        let top = highest_point(&spine, &direction);
        let expected = Vector3::new(-1.0 / 3.0, 0.0, 0.0) + direction / 15.0;
        assert_relative_eq!(top.position, expected, epsilon = 1e-14);
        assert_relative_eq!(spine.at(top.u).pose.position, expected, epsilon = 1e-14);
    }

    #[test]
    fn test_highest_point_may_be_an_end() {
        let spine = Spine::straight(
            0.1,
            Pose::identity(),
            vec![0.0, 1.0],
            vec![0.0; 2],
            vec![0.0; 2],
        );
        assert_eq!(highest_point(&spine, &Vector3::y()).u, 1.0);
        assert_eq!(highest_point(&spine, &-Vector3::y()).u, 0.0);
    }

    #[test]
    fn test_least_bend_radius_of_a_wrap_is_that_of_its_cylinder() {
        let (a, radius) = (0.6f64, 0.25);
        let spine = spine(1.0, 0.1, 20, |_| a.cos().powi(2) / radius, |_| a.tan());
        let least = least_bend_radius(&spine).map(|bend| bend.value);
        assert_relative_eq!(least.unwrap_or(f64::NAN), radius, epsilon = 1e-14);
    }

    #[test]
    fn test_least_bend_radius_of_a_cone_is_on_its_near_edge() {
        // Ribs through the apex (y, z) = (0.5, 0.2): β = (u − 0.5)/0.2, s = 5, away from the ends.
        let cone = |u: f64| 2.0 / (1.0 + ((u - 0.5) / 0.2).powi(2)).powf(1.5);
        let spine = spine(1.0, 0.1, 2000, cone, |u| (u - 0.5) / 0.2);
        let least = least_bend_radius(&spine).unwrap_or(Extreme {
            value: 0.0,
            u: 0.0,
            v: 0.0,
        });
        assert_relative_eq!(least.value, 0.75 / 2.0, epsilon = 1e-6);
        assert_relative_eq!(least.u, 0.5, epsilon = 1e-3);
        assert_relative_eq!(least.v, 0.05);
    }

    #[test]
    fn test_flat_belt_has_no_bend_radius() {
        assert_eq!(least_bend_radius(&spine(1.0, 0.1, 9, |_| 0.0, |u| u)), None);
    }

    #[test]
    fn test_rib_margin_is_least_where_ribs_turn_fastest() {
        let spine = spine(1.0, 0.1, 10, |_| 1.0, |u| -15.0 * (u - 0.7).clamp(0.0, 0.1));
        let margin = rib_margin(&spine);
        assert_relative_eq!(margin.value, 5.0, epsilon = 1e-12);
        assert_relative_eq!(margin.u, 0.75, epsilon = 1e-12);
        assert_eq!(rib_margin(&straight()).value, 20.0);
    }

    /// A spine of one arc, length 0.4 and curvature 4, in 80 elements.
    fn arc(bend: impl Fn(f64) -> f64, slope: impl Fn(f64) -> f64) -> Spine {
        let u: Vec<f64> = (0..=80).map(|i| 0.4 * f64::from(i) / 80.0).collect();
        let bend = u.iter().copied().map(bend).collect();
        let slope = u.iter().copied().map(slope).collect();
        let pieces = vec![Piece::Strip { geodesic: 4.0 }; 80];
        Spine::from_fields(0.1, Pose::identity(), pieces, u, bend, slope)
    }

    #[test]
    fn test_square_ribs_of_an_arc_bend_tightest_on_its_inner_edge() {
        let least = least_bend_radius(&arc(|u| 2.0 + u, |_| 0.0)).unwrap();
        assert_relative_eq!(least.value, (1.0 - 4.0 * 0.05) / 2.4, epsilon = 1e-14);
        assert_relative_eq!(least.u, 0.4, epsilon = 1e-14);
        assert_relative_eq!(least.v, 0.05, epsilon = 1e-14);
        assert_relative_eq!(rib_margin(&arc(|_| 2.0, |_| 0.0)).value, 16.0);
    }

    #[test]
    fn test_parallel_ribs_of_an_arc_bend_to_a_cylinder() {
        let slope = |u: f64| (0.8 - 4.0 * u).tan();
        let bent = arc(|u| 3.0 / (1.0 + slope(u).powi(2)), slope);
        let least = least_bend_radius(&bent).unwrap();
        // Slopes linear in each element leave the ribs parallel in its middle alone.
        assert_relative_eq!(least.value, 1.0 / 3.0, max_relative = 1e-2);
        assert!(rib_margin(&bent).value > 20.0 - 1e-2);
    }

    #[test]
    fn test_stiffeners_and_joints_have_no_rib_margin() {
        let pieces = vec![
            Piece::Strip { geodesic: 0.0 },
            Piece::Joint { angle: 0.7 },
            Piece::Rigid,
        ];
        let (u, bend) = (vec![0.0, 0.5, 0.5, 1.0], vec![0.0; 4]);
        let slope = vec![0.0, 0.7f64.tan(), 0.0, 30.0];
        let spine = Spine::from_fields(0.1, Pose::identity(), pieces, u, bend, slope);
        assert_relative_eq!(
            rib_margin(&spine).value,
            20.0 - 2.0 * 0.7f64.tan(),
            epsilon = 1e-12
        );
        assert_eq!(least_bend_radius(&spine), None);
    }

    fn straight() -> Spine {
        spine(1.0, 0.1, 4, |_| 1.0, |_| 0.3)
    }

    proptest! {
        #[test]
        fn test_no_sampled_point_is_higher((bend, slope) in waves(15.0)) {
            let spine = spine(1.0, 0.1, 80, |u| bend.at(u), |u| slope.at(u));
            let direction = Vector3::new(0.3, -0.5, 0.7);
            let top = highest_point(&spine, &direction).position.dot(&direction);
            for i in 0..=1000 {
                prop_assert!(spine.at(f64::from(i) / 1000.0).pose.position.dot(&direction) <= top + 1e-9);
            }
        }

        #[test]
        fn test_no_sampled_bend_of_the_spine_is_tighter((bend, slope) in waves(15.0)) {
            let spine = spine(1.0, 0.1, 12, |u| bend.at(u), |u| slope.at(u));
            let least = least_spine_radius(&spine).map_or(0.0, |radius| radius.value);
            for i in 0..=1200 {
                let point = spine.at(f64::from(i) / 1200.0);
                let sampled = 1.0 / curvature(point.bend, point.rib_slope).abs();
                prop_assert!(sampled >= least * (1.0 - 1e-12));
            }
        }

        #[test]
        fn test_no_sampled_bend_is_tighter((bend, slope) in waves(15.0)) {
            let spine = spine(1.0, 0.1, 12, |u| bend.at(u), |u| slope.at(u));
            let least = least_bend_radius(&spine).map_or(0.0, |bend| bend.value);
            let board = Board::of(&spine);
            for element in 0..12 {
                let h = spine.element_length(element);
                for i in 0..=100 {
                    let (bend, slope) = spine.fields(element, h * f64::from(i) / 100.0);
                    let u = spine.u[element] + h * f64::from(i) / 100.0;
                    let [a, b] = board.ends(&board.foot_at(&spine, u).rib).map(|end| end.v);
                    for j in 0..=4 {
                        let v = a + (b - a) * f64::from(j) / 4.0;
                        let s = spine.convergence(element, slope);
                        let radius = bend_radius(curvature(bend, slope), s, v);
                        prop_assert!(radius >= least * (1.0 - 1e-9));
                    }
                }
            }
        }
    }
}
