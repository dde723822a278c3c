//! The reach of ribs over the board, and the edges on which they may end.

use crate::board::feet::{Board, FlatRib};
use crate::board::flat::direction;
use crate::board::outline;
use crate::strip::bounds::{ActiveEdges, Edge};
use crate::strip::spine::{Piece, Spine};
use std::f64::consts::PI;

/// Depth of 1 − s v below 0 from which ribs count as crossing, dimensionless: rounding alone moves ribs that just touch by
/// less.
const TOUCHING: f64 = 1e-4;
/// Turn of the outline up to which it counts as straight, in rad.
const STRAIGHT: f64 = 1e-9;

/// The first element whose ribs cross on the board: the rib in the middle of the element with its neighbours, or the ribs at
/// its two ends with each other. A straight board has none: the bound |s| ≤ 2/V covers its ribs.
pub(crate) fn first_crossing(board: &Board, spine: &Spine) -> Option<usize> {
    let bends = |piece: &Piece| piece.geodesic() != 0.0 || piece.corner() != 0.0;
    if !spine.pieces.iter().any(bends) {
        return None;
    }
    spine
        .strips()
        .find(|element| crosses(board, spine, *element))
}

/// Whether ribs of an element cross on the board.
fn crosses(board: &Board, spine: &Spine, element: usize) -> bool {
    let s = spine.mean_convergence(element);
    let end = board.end(&middle(board, spine, element), side_of(s));
    let ribs = || [0, 1].map(|i| board.rib_at_node(spine, element + i));
    s * end.v > 1.0 + TOUCHING || cross(board, ribs())
}

/// Whether two ribs cross clearly inside the board. On an arc the bound holds in the middle of an element; at its ends it is
/// missed by a part that grows with the element's length.
fn cross(board: &Board, ribs: [FlatRib; 2]) -> bool {
    /// Part of a rib, from the spine towards its end, on which a crossing counts as inside, a share.
    const INSIDE: f64 = 0.95;
    let directions = ribs.map(|rib| rib.direction());
    let gap = ribs[1].foot.position - ribs[0].foot.position;
    let parallel = directions[0].perp(&directions[1]);
    let v = [1, 0].map(|other: usize| gap.perp(&directions[other]) / parallel);
    parallel != 0.0
        && ribs.iter().zip(v).all(|(rib, v)| {
            let end = board.end(rib, side_of(v));
            v.abs() < INSIDE * end.v.abs()
        })
}

/// The side on which a coordinate along a rib lies: 0 of −ζ, 1 of +ζ.
fn side_of(v: f64) -> usize {
    usize::from(v > 0.0)
}

/// The active edges of a flexible element: edges before which its ribs must not cross, in addition to |s| ≤ 2/V. Where the
/// outline turns inwards ribs pass the end of their own edge and reach an edge farther on, on the −ζ or on the +ζ side; of
/// several edges in reach the one nearest to a crossing is active. Last comes the inner edge of the element's own arc, which
/// very steep ribs may pass by.
pub(crate) fn edges_in_reach(board: &Board, spine: &Spine, element: usize) -> ActiveEdges {
    let rib = MiddleRib {
        rib: middle(board, spine, element),
        convergence: spine.mean_convergence(element),
        length: spine.element_length(element),
    };
    let [minus, plus] = [0, 1].map(|side| rib.nearest_edge(board, side));
    let mut sides = [0, 1].into_iter();
    let own = sides.find_map(|side| rib.own_arc(board, side));
    [minus, plus, own]
}

fn middle(board: &Board, spine: &Spine, element: usize) -> FlatRib {
    board.rib_within(spine, element, 0.5 * spine.element_length(element))
}

/// The rib in the middle of an element, with the s of the element.
struct MiddleRib {
    rib: FlatRib,
    convergence: f64,
    length: f64,
}

/// The direction in which edges are followed, as two signs: the −ζ or the +ζ side, behind or ahead of the foot.
#[derive(Clone, Copy)]
struct Way {
    side: f64,
    sense: f64,
}

impl MiddleRib {
    /// The edge in reach, ahead or behind, at which the rib is nearest to a crossing.
    fn nearest_edge(&self, board: &Board, side: usize) -> Option<Edge> {
        let [behind, own, ahead] = board.edges_beside(side, &self.rib);
        let side = sign(side);
        let end = |at: f64| own.first().map_or(0.0, |own| self.direction(own, at));
        let ahead = self.run(ahead.iter(), end(1.0), Way { side, sense: 1.0 });
        let behind = self.run(behind.iter().rev(), end(0.0), Way { side, sense: -1.0 });
        let slack = |edge: &Edge| edge.slack(self.rib.slope, self.convergence);
        let edges = ahead.chain(behind);
        edges.min_by(|a, b| slack(a).total_cmp(&slack(b)))
    }

    /// The arc beside the foot, if this is its inner side.
    fn own_arc(&self, board: &Board, side: usize) -> Option<Edge> {
        let [_, own, _] = board.edges_beside(side, &self.rib);
        let own = own.first()?;
        (sign(side) * own.curve.turn() > 0.0).then(|| self.view(own, sign(side), 0.0))?
    }

    /// The edges that follow each other turning inwards, from a given direction on, as far as ribs of the
    /// element pass their near ends; the last one may turn outwards itself.
    fn run<'a>(
        &self,
        edges: impl Iterator<Item = &'a outline::Edge>,
        from: f64,
        way: Way,
    ) -> impl Iterator<Item = Edge> {
        let inwards = way.side * way.sense;
        let near = if way.sense > 0.0 { 0.0 } else { 1.0 };
        let nearly = 0.5 * self.length;
        let (mut turned, mut ends) = (inwards * from, false);
        let run = edges.map_while(move |edge| {
            let [first, last] = [near, 1.0 - near].map(|at| inwards * self.direction(edge, at));
            let goes_on = !ends && first >= turned - STRAIGHT && first < PI;
            (turned, ends) = (last, last < first);
            let passes = || way.sense * self.rib.excess(&edge.curve.point(near)) > -nearly;
            (goes_on && passes()).then(|| self.view(edge, way.side, near))
        });
        run.flatten()
    }

    /// Direction of an edge at a fraction of its length, from the direction of the spine at the foot.
    fn direction(&self, edge: &outline::Edge, fraction: f64) -> f64 {
        edge.direction(fraction) - self.rib.foot.heading
    }

    /// The part of an edge that faces the foot; of an arc that turns outwards, its tangent at the near end.
    fn view(&self, edge: &outline::Edge, side: f64, near: f64) -> Option<Edge> {
        let turn = edge.curve.turn();
        match edge.curve.circle() {
            Some((centre, radius)) if side * turn > 0.0 => {
                let centre = self.rib.foot.local(&centre);
                let nearest = (-side * centre.x).atan2(side * centre.y);
                // Tangents that turn farther have the foot on their other side.
                let most = (radius / centre.norm()).min(1.0).acos();
                let first = self.direction(edge, if turn > 0.0 { 0.0 } else { 1.0 }) - nearest;
                let turn = [first.max(-most), (first + turn.abs()).min(most)];
                (turn[0] < turn[1]).then(|| Edge {
                    direction: direction(nearest),
                    distance: side * (centre.norm() - radius),
                    curvature: side / radius,
                    turn,
                })
            }
            _ => {
                let direction = direction(self.direction(edge, near));
                let point = self.rib.foot.local(&edge.curve.point(near));
                let distance = direction.perp(&point);
                // Along the element the distance grows or falls, and 1 − s v is constant.
                let farthest = side * distance + 0.5 * self.length * direction.y.abs();
                (farthest > 0.0).then(|| Edge::line(direction, distance))
            }
        }
    }
}

/// −1 of the −ζ side, +1 of the +ζ side.
fn sign(side: usize) -> f64 {
    [-1.0, 1.0][side]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::samples::{Part, Plan};
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    /// Width of the test boards, in U.
    const WIDTH: f64 = 0.1;

    fn ell(angle: f64) -> Spine {
        let leg = Part::Straight(0.5);
        Plan::open(WIDTH, &[leg, Part::Corner(angle), leg]).spine()
    }

    #[test]
    fn test_inner_edge_beyond_a_corner_is_as_far_as_the_corner_says() {
        for angle in [0.4f64, 1.0, 1.5] {
            let spine = ell(angle);
            let mut seen = 0;
            let board = Board::of(&spine);
            for element in spine.strips() {
                let [minus, plus, own] = edges_in_reach(&board, &spine, element);
                assert_eq!((minus, own), (None, None));
                let Some(edge) = plus else { continue };
                let ahead = 0.5 - 0.5 * (spine.u[element] + spine.u[element + 1]);
                let towards = angle * ahead.signum();
                assert_relative_eq!(edge.direction, direction(towards), epsilon = 1e-12);
                let expected = 0.5 * WIDTH - ahead.abs() * angle.sin();
                assert_relative_eq!(edge.distance, expected, epsilon = 1e-12);
                seen += 1;
            }
            assert!(seen >= 2, "{seen}");
        }
    }

    #[test]
    fn test_steep_ribs_before_a_corner_cross_although_they_do_not_within_half_the_width() {
        let mut spine = ell(1.0);
        let board = Board::of(&spine);
        assert_eq!(first_crossing(&board, &spine), None);
        let corner = spine.u.iter().position(|u| *u > 0.4999).unwrap_or(0);
        let beside = corner - 3..corner;
        for (share, expected) in [(0.9, true), (0.3, false)] {
            let s = share * 2.0 / WIDTH;
            for node in beside.start..=corner {
                spine.rib_slope[node] = -0.2 - s * (spine.u[corner] - spine.u[node]);
            }
            let mut beside = beside.clone();
            assert_eq!(
                beside.any(|element| crosses(&board, &spine, element)),
                expected
            );
        }
    }

    proptest! {
        #[test]
        fn test_slack_is_nought_where_the_rib_ends_on_an_edge(
            turns in prop::collection::vec((0.1..0.4f64, 0.0..0.9f64, any::<bool>()), 1..4),
            lean in -0.8..0.8f64,
            mirror in any::<bool>(),
        ) {
            let sign = if mirror { -1.0 } else { 1.0 };
            let mut parts = vec![Part::Straight(0.3)];
            for (length, turn, is_corner) in turns {
                match is_corner {
                    true => parts.extend([Part::Corner(sign * turn), Part::Straight(length)]),
                    false => parts.push(Part::Arc(length, sign * turn / length)),
                }
            }
            parts.push(Part::Straight(0.3));
            let spine = Plan::open(WIDTH, &parts).spine();
            let board = Board::of(&spine);
            let side = usize::from(!mirror);
            for element in spine.strips() {
                let mut leaning = middle(&board, &spine, element);
                leaning.slope += lean;
                let end = board.end(&leaning, side);
                let v = end.v;
                let edges = &board.chains.edges[side];
                let edge = edges[end.place as usize];
                let is_end_line = [0, edges.len() - 1].contains(&(end.place as usize));
                let missed = (edge.curve.point(end.place.fract()) - end.flat).norm();
                let u = 0.5 * (spine.u[element] + spine.u[element + 1]);
                // Left out: ribs that may leave through an end line, and ribs that pass by all edges of their side.
                if u < 0.2 || u > spine.length() - 0.2 || is_end_line || missed > 1e-6 {
                    continue;
                }
                let rib = MiddleRib { rib: leaning, convergence: 1.0 / v, length: 0.0 };
                let slope = leaning.slope;
                let near = [rib.nearest_edge(&board, side), rib.own_arc(&board, side)];
                let active = near.into_iter().flatten().map(|edge| edge.slack(slope, 1.0 / v));
                let geodesic = spine.pieces[element].geodesic();
                let own = (geodesic == 0.0).then(|| 1.0 - 0.5 * WIDTH / v.abs());
                let least = active.chain(own).fold(f64::INFINITY, f64::min);
                prop_assert!(least.abs() < 1e-4, "{element} {u} {v} {slope} {least}");
            }
        }
    }
}
