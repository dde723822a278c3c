//! The flat outline of the developed board: offset curves of the flat spine, mitred at corners, cut at free ends.

use crate::board::curve::Curve;
use crate::board::flat::{FlatFrame, FlatSpine, Round, Segment, direction};
use crate::strip::spine::Spine;
use nalgebra::Vector2;
use std::f64::consts::FRAC_PI_2;

/// The outline of the flat board in exact pieces.
#[derive(Debug, Clone, PartialEq)]
pub struct Outline {
    /// The edge on the −ζ side, from the start of the belt to its end.
    pub minus: Vec<Curve>,
    /// The edge on the +ζ side, from the start of the belt to its end.
    pub plus: Vec<Curve>,
    /// The lines across the first and the last point of an open belt, from −ζ to +ζ; `None` of a closed belt.
    pub ends: Option<[Curve; 2]>,
}

/// The outline of the flat board.
///
/// The edges lie V/2 to either side of the flat spine: lines along straight and rigid stretches, circular arcs along
/// arcs. At a corner the outer edge runs straight on to the mitre point, the inner one is cut at it; an inner edge
/// that would cross itself is cut where its neighbours meet. A closed belt is cut open at its start, which its end
/// continues.
///
/// # Panics
///
/// If the spine has no nodes.
pub fn outline(spine: &Spine) -> Outline {
    let chains = Chains::of(spine, &FlatSpine::of(spine));
    let [minus, plus] = chains.edges.each_ref().map(|chain| chains.own(chain));
    let corner = |side: usize, at_start: bool| {
        let chain = &chains.edges[side];
        match at_start {
            true => chain[0].curve.last(),
            false => chain[chain.len() - 1].curve.first(),
        }
    };
    let end_line = |at_start: bool| Curve::Line {
        from: corner(0, at_start),
        to: corner(1, at_start),
    };
    Outline {
        minus,
        plus,
        ends: chains.is_open.then(|| [true, false].map(end_line)),
    }
}

impl Outline {
    /// Area of the board; where it overlaps itself, every layer counts.
    pub fn area(&self) -> f64 {
        let sum = |edge: &[Curve]| edge.iter().map(Curve::swept_area).sum::<f64>();
        let [start, end] = self.cuts().map(|cut| cut.swept_area());
        sum(&self.minus) + end - sum(&self.plus) - start
    }

    /// The outline as polylines for drawing, no chord farther from it than a tolerance.
    ///
    /// An open belt has one counter-clockwise loop, its first point repeated at its end; a closed belt has two lines, the −ζ
    /// and the +ζ edge.
    pub fn lines(&self, tolerance: f64) -> Vec<Vec<Vector2<f64>>> {
        let [minus, plus] = [&self.minus, &self.plus].map(|edge| polyline(edge, tolerance));
        let Some([start, end]) = self.ends else {
            return vec![minus, plus];
        };
        let corners = |line: Curve| [line.first(), line.last()];
        let mut plus = plus;
        plus.reverse();
        let mut outline: Vec<_> = [corners(start)[0]].into_iter().chain(minus).collect();
        outline.extend(corners(end));
        outline.extend(plus);
        outline.extend([corners(start)[1], corners(start)[0]]);
        outline.dedup();
        vec![outline]
    }

    /// The lines that close the edges into a loop.
    fn cuts(&self) -> [Curve; 2] {
        self.ends.unwrap_or_else(|| {
            let [minus, plus] = [&self.minus, &self.plus].map(|edge| tips(edge));
            [0, 1].map(|i| Curve::Line {
                from: minus[i],
                to: plus[i],
            })
        })
    }
}

/// First and last point of an edge.
fn tips(edge: &[Curve]) -> [Vector2<f64>; 2] {
    match edge {
        [] => [Vector2::zeros(); 2],
        [first, ..] => [first.first(), edge[edge.len() - 1].last()],
    }
}

fn polyline(edge: &[Curve], tolerance: f64) -> Vec<Vector2<f64>> {
    let mut line: Vec<_> = edge.first().map(Curve::first).into_iter().collect();
    for curve in edge {
        line.extend(curve.points(tolerance).into_iter().skip(1));
    }
    line
}

/// One piece of an edge, with its heading and its segment of the spine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Edge {
    pub(crate) curve: Curve,
    /// Heading of the spine beside its first point; on a free end, the edge's own direction.
    pub(crate) heading: f64,
    /// Segment of the spine to which the piece belongs.
    pub(crate) owner: usize,
}

impl Edge {
    fn line(from: Vector2<f64>, to: Vector2<f64>, heading: f64, owner: usize) -> Self {
        Self {
            curve: Curve::Line { from, to },
            heading,
            owner,
        }
    }

    /// Direction of the edge at a fraction of its length, as an angle from the y axis.
    pub(crate) fn direction(&self, fraction: f64) -> f64 {
        self.heading + fraction * self.curve.turn()
    }

    fn part(&self, from: f64, to: f64) -> Self {
        Self {
            curve: self.curve.part(from, to),
            heading: self.direction(from),
            owner: self.owner,
        }
    }
}

/// The two edges as unbroken chains, −ζ side first: of an open belt from the first point of the spine, along its end
/// line, the edge and the other end line, to the last point; of a closed one over three rounds.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Chains {
    pub(crate) edges: [Vec<Edge>; 2],
    pub(crate) is_open: bool,
    /// First segment of the belt itself, and the one after its last.
    pub(crate) own: [usize; 2],
}

impl Chains {
    pub(crate) fn of(spine: &Spine, flat: &FlatSpine) -> Self {
        let count = flat.segments.len();
        let round = Round::of(spine, flat);
        let segments = match &round {
            None => flat.segments.clone(),
            Some(round) => round.unrolled(&flat.segments),
        };
        let is_open = round.is_none();
        let chain = |side: f64| {
            let builder = EdgeBuilder {
                segments: &segments,
                distance: side * 0.5 * spine.width,
            };
            mended(builder.edges(is_open), is_open, 1e-9 * spine.width)
        };
        Self {
            edges: [chain(-1.0), chain(1.0)],
            is_open,
            own: if is_open {
                [0, count]
            } else {
                [count, 2 * count]
            },
        }
    }

    /// The pieces of the belt itself, without end lines and other rounds.
    fn own(&self, chain: &[Edge]) -> Vec<Curve> {
        let ends = usize::from(self.is_open);
        let [from, to] = self.own;
        chain[ends..chain.len() - ends]
            .iter()
            .filter(|edge| (from..to).contains(&edge.owner))
            .map(|edge| edge.curve)
            .collect()
    }
}

/// Lays out the edge at a distance to the +ζ side of the flat spine.
struct EdgeBuilder<'a> {
    segments: &'a [Segment],
    distance: f64,
}

impl EdgeBuilder<'_> {
    /// The pieces in order, with gaps at inner corners and where arcs are too tight to have an inner edge.
    fn edges(&self, is_open: bool) -> Vec<Edge> {
        let mut edges = Vec::new();
        for index in 0..self.segments.len() {
            edges.extend(self.along(index));
        }
        if is_open {
            let (first, last) = (
                self.segments[0].start,
                self.segments[self.segments.len() - 1].end(),
            );
            let quarter = FRAC_PI_2.copysign(self.distance);
            let out = Edge::line(
                first.position,
                self.beside(&first),
                first.heading + quarter,
                0,
            );
            edges.insert(0, out);
            let owner = self.segments.len() - 1;
            edges.push(Edge::line(
                self.beside(&last),
                last.position,
                last.heading - quarter,
                owner,
            ));
        }
        if edges.is_empty() {
            // A closed belt all of whose arcs are tight: its centre.
            let Segment {
                start, geodesic, ..
            } = self.segments[0];
            let centre = start.position + start.across() / geodesic;
            edges.push(Edge::line(centre, centre, start.heading, 0));
        }
        edges
    }

    /// The pieces of one segment: its offset curve, prolonged to the mitre points of outer corners.
    fn along(&self, index: usize) -> Vec<Edge> {
        let Segment {
            start,
            geodesic,
            length,
            ..
        } = self.segments[index];
        let end = self.segments[index].end();
        let [before, after] = [self.mitre(index), self.mitre(index + 1)];
        if geodesic == 0.0 {
            let from = before.unwrap_or_else(|| self.beside(&start));
            let to = after.unwrap_or_else(|| self.beside(&end));
            return vec![Edge::line(from, to, start.heading, index)];
        }
        let curve = Curve::offset(&start, geodesic, length, self.distance);
        let arc = curve.map(|curve| Edge {
            curve,
            heading: start.heading,
            owner: index,
        });
        let lead_in =
            before.map(|mitre| Edge::line(mitre, self.beside(&start), start.heading, index));
        let lead_out = after.map(|mitre| Edge::line(self.beside(&end), mitre, end.heading, index));
        [lead_in, arc, lead_out].into_iter().flatten().collect()
    }

    fn beside(&self, frame: &FlatFrame) -> Vector2<f64> {
        frame.position + self.distance * frame.across()
    }

    /// The mitre point at the start of a segment, if that is a corner with its outer side here.
    fn mitre(&self, index: usize) -> Option<Vector2<f64>> {
        let (before, after) = (index.checked_sub(1)?, self.segments.get(index)?);
        let heading = self.segments[before].end().heading;
        let angle = after.start.heading - heading;
        let is_outer = angle * self.distance < 0.0;
        let across = direction(heading + 0.5 * angle + FRAC_PI_2);
        let reach = self.distance / (0.5 * angle).cos();
        is_outer.then(|| after.start.position + reach * across)
    }
}

/// A cut through a chain: the pieces on both sides of the cut, and the fractions of their length.
struct Cut {
    before: usize,
    after: usize,
    at: [f64; 2],
}

/// The chain without gaps: at each gap the nearest pieces that cross are cut at their crossing, and the pieces between them
/// are left out. Pieces that graze each other may leave the gap as it was by rounding: then it is bridged.
fn mended(mut edges: Vec<Edge>, is_open: bool, tolerance: f64) -> Vec<Edge> {
    let mut open = gaps(&edges, tolerance);
    while !open.is_empty() {
        let known = (edges.len(), open.len());
        let cut = nearest_cut(&edges, &open, is_open);
        if let Some(cut) = &cut {
            edges[cut.before] = edges[cut.before].part(0.0, cut.at[0]);
            edges[cut.after] = edges[cut.after].part(cut.at[1], 1.0);
            edges.drain(cut.before + 1..cut.after);
        }
        open = gaps(&edges, tolerance);
        if edges.len() == known.0 && open.len() >= known.1 {
            bridge(&mut edges, tolerance);
            break;
        }
    }
    edges
}

/// Indices of the pieces that do not end where the next one starts.
fn gaps(edges: &[Edge], tolerance: f64) -> Vec<usize> {
    let ends_apart = |&index: &usize| {
        let gap = edges[index].curve.last() - edges[index + 1].curve.first();
        gap.norm() > tolerance
    };
    (0..edges.len().saturating_sub(1))
        .filter(ends_apart)
        .collect()
}

/// The cut across a gap that leaves out the fewest pieces, and of those the least length.
fn nearest_cut(edges: &[Edge], gaps: &[usize], is_open: bool) -> Option<Cut> {
    (1..edges.len()).find_map(|span| {
        let befores = |gap: usize| (gap + 1).saturating_sub(span)..=gap;
        let cuts = gaps
            .iter()
            .flat_map(|&gap| befores(gap))
            .filter(|before| before + span < edges.len())
            .flat_map(|before| cuts(edges, [before, before + span], is_open));
        let lost = |cut: &Cut| {
            (1.0 - cut.at[0]) * edges[cut.before].curve.length()
                + cut.at[1] * edges[cut.after].curve.length()
        };
        cuts.min_by(|a, b| lost(a).total_cmp(&lost(b)))
    })
}

/// The cuts at the crossings of two pieces; end lines, whose corner may be gone, reach farther out than their own.
fn cuts(edges: &[Edge], [before, after]: [usize; 2], is_open: bool) -> Vec<Cut> {
    let reach = |index: usize| match is_open {
        true if index == 0 => [0.0, 4.0],
        true if index == edges.len() - 1 => [-3.0, 1.0],
        _ => [0.0, 1.0],
    };
    let reached = |index: usize| edges[index].curve.part(reach(index)[0], reach(index)[1]);
    let own = |index: usize, at: f64| reach(index)[0] + at * (reach(index)[1] - reach(index)[0]);
    let crossings = reached(before).crossings(&reached(after));
    let cut = |at: [f64; 2]| Cut {
        before,
        after,
        at: [own(before, at[0]), own(after, at[1])],
    };
    crossings.into_iter().map(cut).collect()
}

/// Closes the gaps that no cut closes by straight lines: a board with these gaps folds back onto itself.
fn bridge(edges: &mut Vec<Edge>, tolerance: f64) {
    for gap in gaps(edges, tolerance).into_iter().rev() {
        let (before, after) = (edges[gap], edges[gap + 1]);
        let heading = before.heading + before.curve.turn();
        let line = Edge::line(
            before.curve.last(),
            after.curve.first(),
            0.5 * (heading + after.heading),
            before.owner,
        );
        edges.insert(gap + 1, line);
    }
}
