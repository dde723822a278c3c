//! Distances on the flat board.

use crate::scenario::{BeltSpec, SAME_PLACE, SegmentSpec};
use nalgebra::Vector2;

/// A point of the flat board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BoardPoint {
    /// Arc length from the start.
    pub(super) u: f64,
    /// Distance from the spine along the square rib, positive towards +ζ.
    pub(super) v: f64,
}

/// A stretch of the board between two points: of one in-plane curvature, after a turn at a corner.
struct Stretch {
    corner: f64,
    length: f64,
    curvature: f64,
}

/// An upper bound of the length of the shortest path on the board from one point to another: the length of the straight line
/// where the board between them is straight, else of the shortest of the paths along the spine or an edge and along the two
/// square ribs, and of the path from mitre to mitre across a board of straight stretches and corners.
///
/// On a closed belt the path goes the shorter way round; the points must be on the spine.
pub(super) fn distance([a, b]: [BoardPoint; 2], belt: &BeltSpec) -> f64 {
    let way = (b.u - a.u).abs();
    if belt.closed {
        return way.min(belt.length() - way);
    }
    let stretches = stretches([a.u.min(b.u), a.u.max(b.u)], belt);
    if stretches
        .iter()
        .all(|s| s.corner == 0.0 && s.curvature == 0.0)
    {
        return way.hypot(b.v - a.v);
    }
    let half = 0.5 * belt.width;
    let by_edge = [half, -half].into_iter().filter_map(|edge| {
        let along = offset_length(&stretches, edge)?;
        Some((a.v - edge).abs() + along + (b.v - edge).abs())
    });
    let ends = if a.u <= b.u { [a.v, b.v] } else { [b.v, a.v] };
    let across = across_corners(&stretches, ends, half);
    let paths = by_edge.chain(across);
    paths.fold(a.v.abs() + way + b.v.abs(), f64::min)
}

/// A mitre: the points of the board at a corner, by their distance from the spine.
struct Mitre {
    /// The corner of the spine.
    corner: Vector2<f64>,
    /// Place of a point of the mitre off the corner, per distance from the spine.
    along: Vector2<f64>,
}

/// Length of a path from mitre to mitre across a board of straight stretches and corners, between points off its first and
/// its last square rib; `None` of a board with arcs, with a corner at its start, or with mitres that meet.
///
/// Parts of the board between two mitres are convex, so that the path is straight there. It is the shortest path once every
/// point on a mitre is where the line between its neighbours crosses the mitre, or on the edge next to that. The points are
/// moved there in turn; every such path is on the board.
fn across_corners(stretches: &[Stretch], ends: [f64; 2], half: f64) -> Option<f64> {
    /// Rounds over all mitres, a number.
    const ROUNDS: usize = 50;
    let cuts = |stretch: &Stretch| half * (0.5 * stretch.corner).tan().abs();
    let after = stretches.iter().skip(1).map(cuts).chain([0.0]);
    let mut legs = stretches.iter().zip(after);
    let is_convex =
        |(leg, after): (&Stretch, f64)| leg.curvature == 0.0 && leg.length >= cuts(leg) + after;
    if stretches.first()?.corner != 0.0 || !legs.all(is_convex) {
        return None;
    }
    let normal = |heading: f64| Vector2::new(-heading.sin(), heading.cos());
    let (mut at, mut heading) = (Vector2::zeros(), 0.0f64);
    let first = at + ends[0] * normal(heading);
    let mut mitres = Vec::new();
    for stretch in stretches {
        if stretch.corner != 0.0 {
            let normals = normal(heading) + normal(heading + stretch.corner);
            mitres.push(Mitre {
                corner: at,
                along: normals / (1.0 + stretch.corner.cos()),
            });
            heading += stretch.corner;
        }
        at += stretch.length * Vector2::new(heading.cos(), heading.sin());
    }
    let last = at + ends[1] * normal(heading);
    let corners = mitres.iter().map(|mitre| mitre.corner);
    let mut path: Vec<_> = [first].into_iter().chain(corners).chain([last]).collect();
    for _ in 0..ROUNDS {
        for (k, mitre) in mitres.iter().enumerate() {
            let (before, chord) = (path[k], path[k + 2] - path[k]);
            let v = (before - mitre.corner).perp(&chord) / mitre.along.perp(&chord);
            if v.is_finite() {
                path[k + 1] = mitre.corner + v.clamp(-half, half) * mitre.along;
            }
        }
    }
    Some(path.windows(2).map(|ends| (ends[1] - ends[0]).norm()).sum())
}

/// The stretches between two arc lengths in rising order. A support at a corner holds the frame before it.
fn stretches([from, to]: [f64; 2], belt: &BeltSpec) -> Vec<Stretch> {
    let same = SAME_PLACE * belt.length();
    let (mut u, mut corner) = (0.0, 0.0);
    let mut stretches = Vec::new();
    for segment in &belt.segments {
        if let SegmentSpec::Corner { angle } = segment {
            if u >= from - same {
                corner += angle;
            }
            continue;
        }
        let length = (u + segment.length()).min(to) - u.max(from);
        if length > same {
            stretches.push(Stretch {
                corner,
                length,
                curvature: segment.curvature(),
            });
            corner = 0.0;
        }
        u += segment.length();
    }
    stretches
}

/// Length of the line at a distance `v` from the spine, mitred at corners; `None` where a stretch is too short for its
/// mitres or an arc too sharp for the distance.
fn offset_length(stretches: &[Stretch], v: f64) -> Option<f64> {
    let cut = |corner: f64| v * (0.5 * corner).tan();
    let corners = stretches.iter().map(|stretch| stretch.corner);
    let after = corners.clone().skip(1).chain([0.0]);
    let mut total = 0.0;
    for ((stretch, before), after) in stretches.iter().zip(corners).zip(after) {
        let cuts = [before, after].map(cut);
        // A mitre beside an arc meets the offset arc elsewhere.
        let is_known = stretch.curvature == 0.0 || cuts == [0.0; 2];
        let length = stretch.length * (1.0 - stretch.curvature * v) - cuts[0] - cuts[1];
        if !is_known || length < 0.0 {
            return None;
        }
        total += length;
    }
    Some(total)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn belt(segments: Vec<SegmentSpec>) -> BeltSpec {
        BeltSpec::new(0.2, 1.0, segments)
    }

    fn arc(length: f64, curvature: f64) -> SegmentSpec {
        SegmentSpec::Arc {
            length,
            curvature,
            natural_bend: None,
            rigidity: None,
        }
    }

    fn between(from: [f64; 2], to: [f64; 2], belt: &BeltSpec) -> f64 {
        distance([from, to].map(|[u, v]| BoardPoint { u, v }), belt)
    }

    #[test]
    fn test_distance_on_a_straight_board_is_straight() {
        let belt = belt(vec![SegmentSpec::straight(0.5), SegmentSpec::straight(0.5)]);
        assert_eq!(between([0.9, -0.1], [0.1, 0.1], &belt), 0.8f64.hypot(0.2));
    }

    #[test]
    fn test_way_round_an_arc_is_that_of_its_inner_edge() {
        let belt = belt(vec![arc(FRAC_PI_2, 1.0)]);
        let inner = between([0.0, 0.1], [FRAC_PI_2, 0.1], &belt);
        assert!((inner - 0.9 * FRAC_PI_2).abs() < 1e-12);
        let spine = between([0.0, 0.0], [FRAC_PI_2, 0.0], &belt);
        assert!((spine - FRAC_PI_2).abs() < 1e-12);
    }

    #[test]
    fn test_way_across_a_corner_is_straight_or_touches_its_inner_edge() {
        let bent = |angle: f64| {
            let legs = [0.5, 0.5].map(SegmentSpec::straight);
            let turn = SegmentSpec::Corner { angle };
            between(
                [0.0, 0.0],
                [1.0, 0.0],
                &belt(vec![legs[0].clone(), turn, legs[1].clone()]),
            )
        };
        for sign in [1.0, -1.0] {
            // Half the width is 0.1: the chord passes the corner at 0.5 sin(angle/2).
            assert!((bent(0.2 * sign) - 0.1f64.cos()).abs() < 1e-12);
            let to_edge = (0.5 - 0.1 * 0.5f64.tan()).hypot(0.1);
            assert!((bent(sign) - 2.0 * to_edge).abs() < 1e-12);
        }
        // Bends to and fro: the ends are on a line.
        let bends = [0.25, -0.5, 0.5, -0.25].map(|angle| SegmentSpec::Corner { angle });
        let mut segments = vec![SegmentSpec::straight(0.1)];
        for (bend, length) in bends.into_iter().zip([0.2, 0.4, 0.2, 0.1]) {
            segments.extend([bend, SegmentSpec::straight(length)]);
        }
        let straight = 0.2 + 0.8 * 0.25f64.cos();
        assert!((between([0.0, 0.0], [1.0, 0.0], &belt(segments)) - straight).abs() < 1e-9);
    }

    #[test]
    fn test_way_round_a_corner_is_that_of_its_inner_edge() {
        let turn = SegmentSpec::Corner { angle: -FRAC_PI_2 };
        let legs = [0.5, 0.7].map(SegmentSpec::straight);
        let belt = belt(vec![legs[0].clone(), turn, legs[1].clone()]);
        let inner = between([0.0, -0.1], [1.2, -0.1], &belt);
        assert!((inner - (0.4 + 0.6)).abs() < 1e-12);
        // Before the corner the board is straight; a support at the corner is before it.
        assert!((between([0.1, 0.0], [0.5, 0.0], &belt) - 0.4).abs() < 1e-12);
        assert!((between([0.5, -0.1], [1.2, -0.1], &belt) - 0.6 - 0.1).abs() > 0.05);
    }

    #[test]
    fn test_closed_belt_is_measured_the_shorter_way_round() {
        let mut belt = belt(vec![SegmentSpec::straight(1.0)]);
        belt.closed = true;
        assert!((between([0.1, 0.0], [0.9, 0.0], &belt) - 0.2).abs() < 1e-12);
    }
}
