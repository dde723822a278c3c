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
/// square ribs, and of the path drawn tight between the edges.
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
    let tight = drawn_tight(&stretches, ends, half);
    let paths = by_edge.chain(tight);
    paths.fold(a.v.abs() + way + b.v.abs(), f64::min)
}

/// Two points of the board, on the −ζ and on the +ζ side, between which a path passes.
type Gate = [Vector2<f64>; 2];

/// Length of the shortest path through the gates of a board, between points off its first and its last square rib; `None` of a
/// board with a corner at its start, or with mitres that meet.
fn drawn_tight(stretches: &[Stretch], ends: [f64; 2], half: f64) -> Option<f64> {
    let normal = |heading: f64| Vector2::new(-heading.sin(), heading.cos());
    let (gates, end, heading) = gates(stretches, half)?;
    let first = ends[0] * normal(0.0);
    let last = end + ends[1] * normal(heading);
    Some(shortest_through(first, &gates, last))
}

/// The gates of a board that starts at the origin along the first axis, then the end of its spine and the heading there: the
/// mitres of corners, and on arcs square ribs so close to each other that the lines between their gates are on the board.
fn gates(stretches: &[Stretch], half: f64) -> Option<(Vec<Gate>, Vector2<f64>, f64)> {
    /// Largest turn between the square ribs of an arc, in rad.
    const TURN: f64 = 0.01;
    let cuts = |stretch: &Stretch| half * (0.5 * stretch.corner).tan().abs();
    let after = stretches.iter().skip(1).map(cuts).chain([0.0]);
    let are_apart = |(leg, after): (&Stretch, f64)| leg.length >= cuts(leg) + after;
    if stretches.first()?.corner != 0.0 || !stretches.iter().zip(after).all(are_apart) {
        return None;
    }
    let (mut at, mut heading) = (Vector2::zeros(), 0.0f64);
    let mut gates = Vec::new();
    let mut before: Option<&Stretch> = None;
    let reach = |stretch: &Stretch| reach_beside(stretch.curvature, half, TURN);
    for stretch in stretches {
        if let Some(before) = before.replace(stretch) {
            let are_straight = before.curvature == 0.0 && stretch.curvature == 0.0;
            let [a, b] = [before, stretch].map(reach);
            // A mitre beside an arc meets its edges elsewhere: there the path goes by way of the spine.
            let reach = match stretch.corner == 0.0 || are_straight {
                true => [a[0].min(b[0]), a[1].min(b[1])],
                false => [0.0; 2],
            };
            gates.push(gate(at, heading, stretch.corner, reach));
        }
        heading += stretch.corner;
        let turn = stretch.curvature * stretch.length;
        let parts = (turn.abs() / TURN).ceil().max(1.0);
        let step = |heading: f64| {
            let half_turn = 0.5 * turn / parts;
            let chord = match half_turn == 0.0 {
                true => stretch.length / parts,
                false => 2.0 * half_turn.sin() / stretch.curvature,
            };
            let along = heading + half_turn;
            chord * Vector2::new(along.cos(), along.sin())
        };
        for part in 1..=parts as usize {
            at += step(heading);
            heading += turn / parts;
            if part < parts as usize {
                gates.push(gate(at, heading, 0.0, reach(stretch)));
            }
        }
    }
    Some((gates, at, heading))
}

/// Distances from the spine, towards −ζ and towards +ζ, up to which lines between the square ribs of a stretch, a turn
/// apart, stay on the board.
fn reach_beside(curvature: f64, half: f64, turn: f64) -> [f64; 2] {
    let radius = curvature.abs().recip();
    // Of a sharper arc the inner side is trimmed.
    let inner_edge = if half < radius { radius - half } else { radius };
    let inner = radius - inner_edge / turn.cos();
    match curvature {
        k if k > 0.0 => [half, inner],
        k if k < 0.0 => [inner, half],
        _ => [half; 2],
    }
}

/// The gate on the mitre of a corner, or on the square rib where there is none.
fn gate(corner: Vector2<f64>, heading: f64, turn: f64, reach: [f64; 2]) -> Gate {
    let middle = heading + 0.5 * turn;
    let along = Vector2::new(-middle.sin(), middle.cos()) / (0.5 * turn).cos();
    [corner - reach[0] * along, corner + reach[1] * along]
}

/// Length of the shortest path from a point through gates to a point. Between two neighbouring gates the board is convex.
///
/// The path is straight until a gate turns it: the funnel of straight lines from the last turn through the gates after it is
/// narrowed from gate to gate, and its nearer side is the next turn where the funnel closes. Source: D. T. Lee and F. P.
/// Preparata, "Euclidean shortest paths in the presence of rectilinear barriers" (1984).
fn shortest_through(first: Vector2<f64>, gates: &[Gate], last: Vector2<f64>) -> f64 {
    let gate = |k: usize| gates.get(k).copied().unwrap_or([last; 2]);
    let mut length = 0.0;
    let mut turn = first;
    let mut next = 0;
    // Both sides of the funnel, each with the gate after its point.
    let mut funnel = [(first, 0); 2];
    while next <= gates.len() {
        let mut closes = None;
        for (side, point) in gate(next).into_iter().enumerate() {
            // Positive towards the other side.
            let inwards = |from: Vector2<f64>, to: Vector2<f64>| {
                let sense = if side == 0 { 1.0 } else { -1.0 };
                sense * (from - turn).perp(&(to - turn))
            };
            let (own, other) = (funnel[side].0, funnel[1 - side]);
            if inwards(own, point) < 0.0 {
                continue;
            }
            if own == turn || inwards(other.0, point) < 0.0 {
                funnel[side] = (point, next + 1);
            } else {
                closes = Some(other);
                break;
            }
        }
        next += 1;
        if let Some((point, after)) = closes {
            length += (point - turn).norm();
            (turn, next) = (point, after);
            funnel = [(turn, after); 2];
        }
    }
    length + (last - turn).norm()
}

/// The arc lengths of the ends of the straight stiff piece that a frame at an arc length holds; `None` where there is none, and
/// on a closed belt. A frame at a corner is that before it.
pub(super) fn stiffener_about(u: f64, belt: &BeltSpec) -> Option<[f64; 2]> {
    let same = SAME_PLACE * belt.length();
    let (mut at, mut goes_on) = (0.0, false);
    let (mut pieces, mut corners) = (Vec::<[f64; 2]>::new(), Vec::new());
    for segment in &belt.segments {
        let next = at + segment.length();
        let is_stiff = matches!(segment, SegmentSpec::Rigid { .. });
        match (is_stiff, pieces.last_mut()) {
            (true, Some(piece)) if goes_on => piece[1] = next,
            (true, _) => pieces.push([at, next]),
            (false, _) if matches!(segment, SegmentSpec::Corner { .. }) => corners.push(at),
            (false, _) => {}
        }
        (at, goes_on) = (next, is_stiff);
    }
    let is_here = |place: f64| (place - u).abs() <= same;
    let is_at_corner = corners.into_iter().any(is_here);
    let holds = |piece: &[f64; 2]| {
        let is_beyond_corner = is_at_corner && is_here(piece[0]);
        piece[0] <= u + same && u <= piece[1] + same && !is_beyond_corner
    };
    pieces.into_iter().find(holds).filter(|_| !belt.closed)
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
        // From the spine two tangents lead to the inner edge and from it.
        let spine = between([0.0, 0.0], [FRAC_PI_2, 0.0], &belt);
        let tangents = 2.0 * 0.19f64.sqrt();
        let round_edge = 0.9 * (FRAC_PI_2 - 2.0 * 0.9f64.acos());
        assert!((spine - tangents - round_edge).abs() < 1e-4);
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

    /// Length of the shortest path between points of a plane that does not enter a circle about the origin.
    fn round_circle(radius: f64, [a, b]: [Vector2<f64>; 2]) -> f64 {
        let chord = b - a;
        let nearest = (a + chord * (-a.dot(&chord) / chord.norm_squared()).clamp(0.0, 1.0)).norm();
        if nearest >= radius {
            return chord.norm();
        }
        let angles = [a, b].map(|point| (radius / point.norm()).min(1.0).acos());
        let tangents = angles.map(|angle| radius * angle.tan());
        let between = a.perp(&b).atan2(a.dot(&b)).abs();
        tangents[0] + tangents[1] + radius * (between - angles[0] - angles[1])
    }

    #[test]
    fn test_way_along_an_arc_is_straight_or_touches_its_inner_edge() {
        // Half the width is 0.1, and the radius 0.5.
        for (turn, sign) in [(0.4, 1.0), (0.4, -1.0), (FRAC_PI_2, 1.0), (2.5, -1.0)] {
            for v in [[0.0, 0.0], [-0.1, 0.05], [0.1, 0.0], [-0.1, -0.1]] {
                let belt = belt(vec![arc(0.5 * turn, 2.0 * sign)]);
                let found = between([0.0, v[0]], [0.5 * turn, v[1]], &belt);
                let at =
                    |v: f64, angle: f64| (0.5 - sign * v) * Vector2::new(angle.cos(), angle.sin());
                let shortest = round_circle(0.4, [at(v[0], 0.0), at(v[1], turn)]);
                assert!(found >= shortest - 1e-12, "{found} {shortest}");
                assert!(found <= (1.0 + 2e-4) * shortest, "{found} {shortest}");
            }
        }
    }

    #[test]
    fn test_way_along_a_spiral_goes_round_as_often() {
        let belt = belt(vec![arc(5.0 * FRAC_PI_2, 1.0), arc(4.0 * FRAC_PI_2, 0.5)]);
        let found = between([0.0, 0.0], [9.0 * FRAC_PI_2, 0.0], &belt);
        let edge = 0.9 * 2.5 * FRAC_PI_2 * 2.0 + 1.9 * FRAC_PI_2 * 2.0;
        assert!(
            found < 9.0 * FRAC_PI_2 && found > edge - 0.2,
            "{found} {edge}"
        );
    }

    #[test]
    fn test_way_through_arcs_to_and_fro_is_straight() {
        // Two arcs that turn by 0.2 to and fro: their middle line is off the chord by much less than half the width.
        let belt = belt(vec![arc(0.2, 1.0), arc(0.4, -1.0), arc(0.2, 1.0)]);
        let found = between([0.0, 0.0], [0.8, 0.0], &belt);
        let straight = 4.0 * 0.2f64.sin();
        assert!((found - straight).abs() < 1e-9, "{found} {straight}");
    }

    #[test]
    fn test_way_by_a_corner_beside_an_arc_is_on_the_board() {
        let turn = SegmentSpec::Corner { angle: 0.3 };
        let belt = belt(vec![SegmentSpec::straight(0.5), turn, arc(0.5, 1.0)]);
        let found = between([0.0, 0.0], [1.0, 0.0], &belt);
        // By way of the spine's corner.
        let by_corner = 0.5 + 2.0 * 0.25f64.sin();
        assert!((found - by_corner).abs() < 1e-9, "{found} {by_corner}");
    }

    #[test]
    fn test_stiffener_that_a_frame_holds_ends_at_corners() {
        let stiff = |length| SegmentSpec::Rigid { length };
        let turn = SegmentSpec::Corner { angle: 0.3 };
        let board = belt(vec![
            stiff(0.1),
            stiff(0.2),
            turn,
            stiff(0.3),
            SegmentSpec::straight(0.4),
        ]);
        let of = |u: f64| stiffener_about(u, &board).map(|ends| ends.map(|u| (10.0 * u).round()));
        assert_eq!(of(0.0), Some([0.0, 3.0]));
        assert_eq!(of(0.3), Some([0.0, 3.0]));
        assert_eq!(of(0.35), Some([3.0, 6.0]));
        assert_eq!(of(0.6), Some([3.0, 6.0]));
        assert_eq!(of(0.7), None);
        let beyond = belt(vec![
            SegmentSpec::straight(0.4),
            SegmentSpec::Corner { angle: 0.3 },
            stiff(0.6),
        ]);
        assert_eq!(stiffener_about(0.4, &beyond), None);
    }

    #[test]
    fn test_closed_belt_is_measured_the_shorter_way_round() {
        let mut belt = belt(vec![SegmentSpec::straight(1.0)]);
        belt.closed = true;
        assert!((between([0.1, 0.0], [0.9, 0.0], &belt) - 0.2).abs() < 1e-12);
    }
}
