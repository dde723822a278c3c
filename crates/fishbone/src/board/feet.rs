//! The feet of ribs on the flat board: the ribs' ends, and the rib through a flat point.

use crate::board::flat::{FlatFrame, FlatSpine, Round, direction};
use crate::board::outline::{Chains, Edge};
use crate::strip::spine::{Piece, Spine, SpinePoint};
use nalgebra::Vector2;
use std::f64::consts::FRAC_PI_2;

/// The foot of a rib.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Foot {
    pub(crate) point: SpinePoint,
    pub(crate) rib: FlatRib,
}

/// A rib on the flat board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FlatRib {
    /// Frame of its foot.
    pub(crate) foot: FlatFrame,
    /// Rib slope β.
    pub(crate) slope: f64,
    /// Segment of the chains on which the foot lies.
    owner: usize,
}

impl FlatRib {
    /// Distance along the spine by which the rib passes ahead of a flat point.
    pub(crate) fn excess(&self, point: &Vector2<f64>) -> f64 {
        excess(&self.foot, self.slope, point)
    }

    /// Vector along the rib, of length 1 across the spine.
    pub(crate) fn direction(&self) -> Vector2<f64> {
        let along = Vector2::new(-self.slope, 1.0);
        self.foot.global(&along) - self.foot.position
    }

    /// Angle of the rib's normal from the y axis: the heading, turned by the rib angle α.
    fn normal_angle(&self) -> f64 {
        self.foot.heading + self.slope.atan()
    }
}

fn excess(frame: &FlatFrame, rib_slope: f64, point: &Vector2<f64>) -> f64 {
    let local = frame.local(point);
    -(local.x + local.y * rib_slope)
}

/// End of a rib: its point on the outline of the board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct End {
    /// Coordinate v along the rib.
    pub(crate) v: f64,
    pub(crate) flat: Vector2<f64>,
    /// Place on its chain: the index of a piece and the fraction of its length; whole at vertices.
    pub(crate) place: f64,
}

/// The flat board: its outline, its nodes, its plates, its period if it is closed.
#[derive(Debug, Clone)]
pub(crate) struct Board {
    pub(crate) half_width: f64,
    pub(crate) chains: Chains,
    /// Stiffeners joined at corners, by their first and last node: no ribs, one plane.
    pub(crate) plates: Vec<[usize; 2]>,
    pub(crate) round: Option<Round>,
    flat: FlatSpine,
}

impl Board {
    pub(crate) fn of(spine: &Spine) -> Self {
        let flat = FlatSpine::of(spine);
        Self {
            half_width: 0.5 * spine.width,
            chains: Chains::of(spine, &flat),
            plates: plates(spine),
            round: Round::of(spine, &flat),
            flat,
        }
    }

    /// Flat length below which two points are one: far above a solver's residuals, far below any drawn or made length.
    pub(crate) fn tolerance(&self) -> f64 {
        2e-6 * self.half_width
    }

    pub(crate) fn foot_at_node(&self, spine: &Spine, node: usize) -> Foot {
        Foot {
            point: spine.node(node),
            rib: self.rib_at_node(spine, node),
        }
    }

    /// The rib at a node.
    pub(crate) fn rib_at_node(&self, spine: &Spine, node: usize) -> FlatRib {
        FlatRib {
            foot: self.flat.nodes[node],
            slope: spine.rib_slope[node],
            owner: self.chains.own[0] + self.flat.owner[node],
        }
    }

    /// The foot inside an element, a distance after its first node.
    pub(crate) fn foot_within(&self, spine: &Spine, element: usize, distance: f64) -> Foot {
        if spine.element_length(element) == 0.0 {
            return self.foot_at_node(spine, element);
        }
        Foot {
            point: spine.within(element, distance),
            rib: self.rib_within(spine, element, distance),
        }
    }

    /// The rib inside an element of some length, a distance after its first node.
    pub(crate) fn rib_within(&self, spine: &Spine, element: usize, distance: f64) -> FlatRib {
        let (_, slope) = spine.fields(element, distance);
        FlatRib {
            foot: self.frame_within(spine, element, distance),
            slope,
            owner: self.chains.own[0] + self.flat.owner[element + 1],
        }
    }

    /// The foot at an arc length, before the jump where a node is repeated.
    pub(crate) fn foot_at(&self, spine: &Spine, u: f64) -> Foot {
        let next = spine.u.partition_point(|&node| node < u);
        if next == 0 || next == spine.u.len() || spine.u[next] == u {
            return self.foot_at_node(spine, next.min(spine.u.len() - 1));
        }
        self.foot_within(spine, next - 1, u - spine.u[next - 1])
    }

    fn frame_within(&self, spine: &Spine, element: usize, distance: f64) -> FlatFrame {
        self.flat.nodes[element].along(spine.pieces[element].geodesic(), distance)
    }

    /// Whether an element lies inside a plate.
    pub(crate) fn is_in_plate(&self, element: usize) -> bool {
        let holds = |&[from, to]: &[usize; 2]| (from..to).contains(&element);
        self.plates.iter().any(holds)
    }

    /// The ends of a rib, on the −ζ and on the +ζ side.
    ///
    /// An end within the tolerance of a vertex is put on it: a rib that a solver left square to ten digits ends at
    /// the corners of the board and not on its end line.
    pub(crate) fn ends(&self, rib: &FlatRib) -> [End; 2] {
        [0, 1].map(|side| self.end(rib, side))
    }

    /// The end of a rib on one side, as [`Self::ends`].
    pub(crate) fn end(&self, rib: &FlatRib, side: usize) -> End {
        let window = Window::new(&self.chains, side, rib);
        let mut end = window.end(&rib.foot.position, self.tolerance());
        let v = rib.foot.local(&end.flat).y;
        end.v = if side == 0 { v.min(0.0) } else { v.max(0.0) };
        end
    }

    /// Depth of a flat point inside the edge on one side, in the direction of a rib; `None` beyond the edge's end.
    pub(crate) fn depth(&self, rib: &FlatRib, side: usize, point: &Vector2<f64>) -> Option<f64> {
        let window = Window::new(&self.chains, side, rib);
        let end = window.hit(point, self.tolerance())?;
        let outwards = direction(rib.normal_angle() + FRAC_PI_2.copysign(side as f64 - 0.5));
        Some(outwards.dot(&(end.flat - point)))
    }

    /// The edges of a side in three runs: behind a rib's foot, beside the foot (empty where the outline has no edge there),
    /// ahead of the foot. Lines across the ends of the board are left out.
    pub(crate) fn edges_beside(&self, side: usize, rib: &FlatRib) -> [&[Edge]; 3] {
        let chain = self.chains.edges[side].as_slice();
        let ends = usize::from(self.chains.is_open);
        let (own, is_there) = nearest_piece(&self.chains, side, rib);
        let ahead = own + usize::from(is_there);
        [
            &chain[ends..own],
            &chain[own..ahead],
            &chain[ahead..chain.len() - ends],
        ]
    }

    /// Chain vertices strictly between two places, by their place and position.
    pub(crate) fn vertices_between(
        &self,
        side: usize,
        from: f64,
        to: f64,
    ) -> impl Iterator<Item = Vector2<f64>> {
        let chain = &self.chains.edges[side];
        let first = from.floor() as usize + 1;
        (first..chain.len())
            .take_while(move |&index| (index as f64) < to)
            .map(|index| chain[index].curve.first())
    }

    /// Distances into an element of the ribs through vertices of the outline, rising.
    pub(crate) fn vertex_ribs(&self, spine: &Spine, element: usize) -> Vec<f64> {
        let length = spine.element_length(element);
        if length == 0.0 || self.is_in_plate(element) {
            return Vec::new();
        }
        let [before, after] =
            [element, element + 1].map(|node| self.ends(&self.rib_at_node(spine, node)));
        let mut distances: Vec<f64> = (0..2)
            .flat_map(|side| self.vertices_between(side, before[side].place, after[side].place))
            .filter_map(|vertex| self.distance_to(spine, element, &vertex))
            .collect();
        distances.sort_by(f64::total_cmp);
        distances
    }

    /// Distance into an element of its rib whose line passes a flat point, if the element has such a rib.
    pub(crate) fn distance_to(
        &self,
        spine: &Spine,
        element: usize,
        point: &Vector2<f64>,
    ) -> Option<f64> {
        let excess = |distance: f64| {
            let (_, slope) = spine.fields(element, distance);
            excess(&self.frame_within(spine, element, distance), slope, point)
        };
        let ahead = |node: usize| self.rib_at_node(spine, node).excess(point);
        let (mut low, mut high) = (0.0, spine.element_length(element));
        if !(ahead(element) <= 0.0 && ahead(element + 1) >= 0.0) {
            return None;
        }
        for _ in 0..64 {
            let middle = 0.5 * (low + high);
            if excess(middle) < 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(0.5 * (low + high))
    }

    /// Whether a flat point lies on the part of a rib's line that is on the board.
    pub(crate) fn is_on_rib(&self, rib: &FlatRib, point: &Vector2<f64>) -> bool {
        let [minus, plus] = self.ends(rib);
        let margin = self.tolerance();
        (minus.v - margin..=plus.v + margin).contains(&rib.foot.local(point).y)
    }

    /// The side on which the end of an open belt has a corner that its last rib leaves out, with that rib's end.
    pub(crate) fn leftover(&self, ends: &[End; 2], at_start: bool) -> Option<usize> {
        let beyond_corner = |&side: &usize| {
            let corner = if at_start {
                1
            } else {
                self.chains.edges[side].len() - 1
            };
            match at_start {
                true => ends[side].place > corner as f64,
                false => ends[side].place < corner as f64,
            }
        };
        (0..2).filter(|_| self.chains.is_open).find(beyond_corner)
    }
}

/// Runs of stiffeners with corners between them.
fn plates(spine: &Spine) -> Vec<[usize; 2]> {
    let mut runs: Vec<[usize; 2]> = Vec::new();
    for element in (0..spine.elements()).filter(|&element| spine.pieces[element] == Piece::Rigid) {
        let is_strip = |piece: &Piece| matches!(piece, Piece::Strip { .. });
        match runs.last_mut() {
            Some([_, to]) if !spine.pieces[*to..element].iter().any(is_strip) => *to = element + 1,
            _ => runs.push([element, element + 1]),
        }
    }
    let is_bent = |&[from, to]: &[usize; 2]| {
        let run = &spine.pieces[from..to];
        run.iter().any(|piece| piece.corner() != 0.0)
    };
    runs.retain(is_bent);
    runs
}

/// The part of an edge that faces a rib: around its foot, as far as the edge heads forward across the rib.
///
/// Along it the coordinate normal to the rib rises, so that the rib meets it once; far turns of a board that
/// overlaps itself are not in it.
struct Window<'a> {
    chain: &'a [Edge],
    /// Angle of the rib's normal.
    angle: f64,
    /// The rib's normal, a unit vector.
    normal: Vector2<f64>,
    /// The piece beside the foot.
    start: usize,
    /// The first piece ahead of the foot.
    next: usize,
    is_open: bool,
}

/// A piece of a window: its index, and the fractions of its length between which it counts.
type Facing = (usize, [f64; 2]);

impl<'a> Window<'a> {
    fn new(chains: &'a Chains, side: usize, rib: &FlatRib) -> Self {
        let (start, is_own) = nearest_piece(chains, side, rib);
        let angle = rib.normal_angle();
        Self {
            chain: chains.edges[side].as_slice(),
            angle,
            normal: direction(angle),
            start,
            next: start + usize::from(is_own),
            is_open: chains.is_open,
        }
    }

    /// The pieces beside and behind the foot, from the nearest on.
    fn back(&self) -> impl Iterator<Item = Facing> {
        let mut ends = false;
        (0..self.next).rev().map_while(move |index| {
            let [from, to] = self.facing(index);
            let is_first = index + 1 == self.next;
            let counts = !ends && from <= to && (to >= 1.0 || is_first);
            ends = from > 0.0;
            counts.then_some((index, [from, to]))
        })
    }

    /// The pieces ahead of the foot, from the nearest on; none where the window ends inside the piece beside it.
    fn forward(&self) -> impl Iterator<Item = Facing> {
        let ends_inside = |(index, [_, to]): Facing| index == self.start && to < 1.0;
        let mut ends = self.back().next().is_some_and(ends_inside);
        (self.next..self.chain.len()).map_while(move |index| {
            let [from, to] = self.facing(index);
            let counts = !ends && from <= to && from <= 0.0;
            ends = to < 1.0;
            counts.then_some((index, [from, to]))
        })
    }

    /// The first and the last piece.
    fn ends(&self) -> Option<[Facing; 2]> {
        let first = self.back().last().or_else(|| self.forward().next())?;
        let last = self.forward().last().or_else(|| self.back().next())?;
        Some([first, last])
    }

    /// The fractions of a piece between which it heads forward across the rib; reversed where it nowhere does.
    fn facing(&self, index: usize) -> [f64; 2] {
        let (heading, turn) = (
            self.chain[index].heading - self.angle,
            self.chain[index].curve.turn(),
        );
        if turn == 0.0 {
            return if heading.abs() < FRAC_PI_2 {
                [0.0, 1.0]
            } else {
                [1.0, 0.0]
            };
        }
        let [a, b] = [-FRAC_PI_2, FRAC_PI_2].map(|bound| (bound - heading) / turn);
        [a.min(b).max(0.0), a.max(b).min(1.0)]
    }

    /// The point of the edge on the line of a rib through a flat point; where that line passes beyond the edge, its nearest
    /// approach.
    fn end(&self, point: &Vector2<f64>, tolerance: f64) -> End {
        self.hit(point, tolerance)
            .unwrap_or_else(|| self.graze(point))
    }

    fn hit(&self, point: &Vector2<f64>, tolerance: f64) -> Option<End> {
        match self.on_piece(point) {
            Some(end) => Some(self.snapped(end, point, tolerance)),
            None => self.at_tip(point, tolerance),
        }
    }

    /// Distance of a flat point from the rib's line, forwards.
    fn ahead(&self, point: &Vector2<f64>, of: &Vector2<f64>) -> f64 {
        self.normal.dot(&(point - of))
    }

    fn end_at(&self, index: usize, fraction: f64) -> End {
        End {
            v: 0.0,
            flat: self.chain[index].curve.point(fraction),
            place: index as f64 + fraction,
        }
    }

    /// The end put on a vertex within the tolerance.
    ///
    /// A rib along an end line, but for the tolerance, ends at the corner: where it would meet the edge, prolonged,
    /// counts.
    fn snapped(&self, end: End, point: &Vector2<f64>, tolerance: f64) -> End {
        let index = (end.place.floor() as usize).min(self.chain.len() - 1);
        let corner = || {
            let (length, passed) = (self.chain[index].curve.length(), end.place - index as f64);
            let is_near = |at: &f64| length * (at - passed).abs() <= tolerance;
            let at = [0.0, 1.0].into_iter().find(is_near)?;
            Some(self.end_at(index, at))
        };
        let along_end_line = || {
            let (corner, heading) = self.corner_of_end_line(index)?;
            let reach = tolerance * (heading - self.angle).cos();
            (self.ahead(&corner.flat, point).abs() <= reach).then_some(corner)
        };
        along_end_line().or_else(corner).unwrap_or(end)
    }

    /// The corner at which an end line meets the edge, and the heading of the edge there.
    fn corner_of_end_line(&self, index: usize) -> Option<(End, f64)> {
        let last = self.chain.len() - 1;
        if !self.is_open || (index != 0 && index != last) {
            return None;
        }
        let edge = |index: usize| self.chain[index];
        Some(match index {
            0 => (self.end_at(1, 0.0), edge(1).heading),
            _ => (
                self.end_at(last, 0.0),
                edge(last - 1).heading + edge(last - 1).curve.turn(),
            ),
        })
    }

    /// The first or the last point of the window, if the line passes it within the tolerance.
    fn at_tip(&self, point: &Vector2<f64>, tolerance: f64) -> Option<End> {
        let is_near = |tip: &End| self.ahead(&tip.flat, point).abs() <= tolerance;
        self.tips()?.into_iter().find(is_near)
    }

    /// The first and the last point.
    fn tips(&self) -> Option<[End; 2]> {
        let [(first, [from, _]), (last, [_, to])] = self.ends()?;
        Some([self.end_at(first, from), self.end_at(last, to)])
    }

    /// The crossing of the line with the window, if there is one: on the first piece that ends ahead of the line.
    fn on_piece(&self, point: &Vector2<f64>) -> Option<End> {
        let ahead = |index: usize, at: f64| self.ahead(&self.chain[index].curve.point(at), point);
        let (index, [from, to]) = self.crossed(ahead)?;
        let fraction = match self.chain[index].curve.circle() {
            None => {
                let (a, b) = (ahead(index, 0.0), ahead(index, 1.0));
                if a < 0.0 { a / (a - b) } else { 0.0 }
            }
            Some(_) => {
                // From the first facing point on: the sine of the arc's angle to the normal changes by curvature times
                // distance ahead, its cosine is positive, and half the turn has the tangent of their differences' ratio.
                let edge = &self.chain[index];
                let turn = edge.curve.turn();
                let (sine, cosine) = (edge.direction(from) - self.angle).sin_cos();
                let change = -turn / edge.curve.length() * ahead(index, from);
                let there = (1.0 - (sine + change).powi(2)).max(0.0).sqrt();
                let half = change.atan2(cosine + there);
                (from + 2.0 * half / turn).clamp(from, to)
            }
        };
        Some(self.end_at(index, fraction))
    }

    /// The first piece that ends ahead of a line, by the distance of points ahead of it; `None` where the line passes by.
    fn crossed(&self, ahead: impl Fn(usize, f64) -> f64) -> Option<Facing> {
        let ends_ahead = |&(index, [_, to]): &Facing| ahead(index, to) >= 0.0;
        let mut first = None;
        for piece in self.back() {
            if !ends_ahead(&piece) {
                return first.or_else(|| self.forward().find(ends_ahead));
            }
            first = Some(piece);
        }
        let (index, [from, _]) = first.or_else(|| self.forward().next())?;
        match ahead(index, from) > 0.0 {
            true => None,
            false => first.or_else(|| self.forward().find(ends_ahead)),
        }
    }

    /// The foot of the perpendicular from the nearer end of the window onto the rib's line.
    fn graze(&self, point: &Vector2<f64>) -> End {
        let nearest = self.end_at(self.start.min(self.chain.len() - 1), 0.0);
        let [a, b] = self.tips().unwrap_or([nearest; 2]);
        let gap = |end: &End| self.ahead(&end.flat, point);
        let nearer = if gap(&a).abs() < gap(&b).abs() { a } else { b };
        End {
            flat: nearer.flat - gap(&nearer) * self.normal,
            ..nearer
        }
    }
}

/// The index of the piece of an edge beside the foot of a rib, and whether the outline has a piece there; if not, the index is
/// the next piece's.
fn nearest_piece(chains: &Chains, side: usize, rib: &FlatRib) -> (usize, bool) {
    let chain = &chains.edges[side];
    let ends = usize::from(chains.is_open);
    let inner = &chain[ends..chain.len() - ends];
    // Along a chain the segments come in order.
    let own = ends + inner.partition_point(|edge| edge.owner < rib.owner);
    let after = ends + inner.partition_point(|edge| edge.owner <= rib.owner);
    let distance = |&index: &usize| {
        let edge = &chain[index];
        let (a, b) = (edge.heading, edge.heading + edge.curve.turn());
        let heading = rib.foot.heading;
        (heading - heading.clamp(a.min(b), a.max(b))).abs()
    };
    let nearest = (own..after).min_by(|a, b| distance(a).total_cmp(&distance(b)));
    match nearest {
        Some(index) => (index, true),
        None => (after, false),
    }
}
