//! Distances on the flat board.

use crate::scenario::{BeltSpec, SAME_PLACE, SegmentSpec};

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
/// square ribs.
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
    by_edge.fold(a.v.abs() + way + b.v.abs(), f64::min)
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
