//! Whether the bent belt passes through itself.
//!
//! The belt is taken as the triangles of its [`mesh`] between neighbouring ribs. Two triangles cross where an edge of one
//! pierces the other. Three conditions keep sheets that only touch, or only lie side by side, from being reported as a
//! crossing:
//!
//! - **Turn.** A line that is straight in the flat board turns, where the belt is bent, by no more than the normal ξ turns
//!   from rib to rib, and along the board's inner edges by no more than the board itself. A closed curve with one corner
//!   turns by π elsewhere. So places between which the belt turns by less than half a turn cannot meet, and neighbours, ribs
//!   that meet on an edge, corners of the board and the seam of a closed belt need no care.
//! - **Angle.** Sheets pass through each other where their normals differ by more than they turn within the two triangles.
//!   Where they do not, elements are divided; sheets that no division separates lie on each other, as the layers of a wound
//!   belt do.
//! - **Margin.** The belt is made narrower and shorter by a ten-thousandth of its width on all sides, so that an edge
//!   or an end that rests against the belt, as exactly as a solver puts it there, stays clear.

use super::mesh::mesh;
use crate::strip::spine::{Piece, Spine, SpinePoint};
use nalgebra::Vector3;
use std::ops::Range;

/// Margin cut off the belt on all sides, in widths: far above a solver's residuals, far below the tolerances of a made belt.
const MARGIN: f64 = 1e-4;

/// Least turn between places that may meet: half a turn, less the uncertainty of turns between nodes.
///
/// Units: rad
const LEAST_TURN: f64 = 3.0;

/// Angle below which sheets without bend count as lying on each other.
///
/// Units: rad
const LEAST_ANGLE: f64 = 1e-3;

/// Parts into which each element is divided, a number for each attempt: tried in order until the sheets clearly cross or
/// clearly do not.
const PARTS: [usize; 3] = [1, 4, 16];

/// Greatest count of elements after a division, a number: so many elements turn by little undivided.
const MOST_ELEMENTS: usize = 1 << 12;

/// Length, in widths, and turn up to which neighbouring elements are taken as one: slivers lie in boxes much larger than
/// themselves.
///
/// Units: 1, rad
const FINEST: [f64; 2] = [1.0 / 32.0, 0.01];

/// The first self-crossing of the bent belt, as the arc lengths of the two places that pass through each other; `None` where
/// there is none.
///
/// The arc lengths are the middles of the two elements, or parts of elements, that meet. The triangles lie off the bent belt
/// by the sagitta of an element, |κ₁| h²/8, and the test resolves nothing finer: a shallower crossing may be missed, and an
/// edge that passes another sheet closer than the sagitta may be reported as crossing it. Sheets that lie on each other or
/// touch do not count as crossing, nor do sheets that cross at less than a hundredth of a radian or than the turn of an
/// element, of a sixteenth of one up to 256 elements, of a quarter up to 1024. Nor do crossings within 1e-4 widths of the
/// edges and the ends. Where ribs cross inside the board, against Eq. (33), there is no surface, and no certain answer.
pub fn crosses_itself(spine: &Spine) -> Option<[f64; 2]> {
    for parts in PARTS {
        if parts > 1 && parts * spine.elements() > MOST_ELEMENTS {
            break;
        }
        match first_crossing(&thinned(&trimmed(spine, parts), parts)) {
            Crossing::None => break,
            Crossing::Doubtful => {}
            Crossing::At(places) => return Some(places),
        }
    }
    None
}

/// The outcome of the test at one division of the elements.
enum Crossing {
    None,
    /// Triangles cross, but at smaller angles than the belt turns by within them.
    Doubtful,
    At([f64; 2]),
}

/// The first facet, in the order of u, with another facet that passes through it.
fn first_crossing(spine: &Spine) -> Crossing {
    if spine.elements() == 0 {
        return Crossing::None;
    }
    let (facets, whole_turn) = facets(spine);
    let tree = Tree::new(facets.iter().map(Facet::bounds).collect());
    let mut is_doubtful = false;
    for facet in &facets {
        let mut is_crossed = |index: usize| {
            let is_across = facet.is_across(&facets[index]);
            // One crossing in doubt is enough to ask for a finer division.
            let counts = is_across || !is_doubtful;
            let is_crossed = counts && facet.meets(&facets[index]);
            is_doubtful |= is_crossed && !is_across;
            is_crossed && is_across
        };
        let first = facets.partition_point(|other| other.turn[1] < facet.turn[0] + LEAST_TURN);
        let last = match spine.half_turns {
            Some(_) => {
                let latest = facet.turn[1] + whole_turn - LEAST_TURN;
                facets.partition_point(|other| other.turn[0] <= latest)
            }
            None => facets.len(),
        };
        if let Some(other) = tree.find(&facet.bounds(), first..last, &mut is_crossed) {
            return Crossing::At([facet.middle(), facets[other].middle()]);
        }
    }
    match is_doubtful {
        true => Crossing::Doubtful,
        false => Crossing::None,
    }
}

/// The spine of the belt without the margin, its elements divided into equal parts.
fn trimmed(spine: &Spine, parts: usize) -> Spine {
    let margin = MARGIN * spine.width.min(spine.length());
    let ends = [0, spine.elements()].map(|node| spine.u.get(node).copied().unwrap_or(0.0));
    let [from, to] = match spine.half_turns {
        Some(_) => ends,
        None => [ends[0] + margin, ends[1] - margin],
    };
    let (mut nodes, mut pieces): (Vec<SpinePoint>, Vec<Piece>) = (Vec::new(), Vec::new());
    for element in 0..spine.elements() {
        let (first, length) = (spine.u[element], spine.element_length(element));
        let [start, end] = [from, to].map(|u| (u - first).max(0.0).min(length));
        let is_joint = length == 0.0 && from <= first && first <= to;
        if start >= end && !is_joint {
            continue;
        }
        if nodes.is_empty() {
            nodes.push(point(spine, element, start));
        }
        let parts = if is_joint { 1 } else { parts };
        for part in 1..parts {
            let share = part as f64 / parts as f64;
            nodes.push(spine.within(element, start + share * (end - start)));
        }
        nodes.push(match end == length {
            true => spine.node(element + 1),
            false => spine.within(element, end),
        });
        pieces.extend(vec![spine.pieces[element]; parts]);
    }
    Spine {
        width: spine.width - 2.0 * margin,
        pieces,
        half_turns: spine.half_turns,
        u: nodes.iter().map(|node| node.u).collect(),
        pose: nodes.iter().map(|node| node.pose).collect(),
        bend: nodes.iter().map(|node| node.bend).collect(),
        rib_slope: nodes.iter().map(|node| node.rib_slope).collect(),
        curved: None,
    }
}

/// The spine with neighbouring elements merged as long as the merged element is short and turns little.
fn thinned(spine: &Spine, parts: usize) -> Spine {
    let turns = turns(spine);
    let [length, turn] = FINEST.map(|finest| finest / parts as f64);
    let mut kept: Vec<usize> = Vec::new();
    for node in 0..spine.u.len() {
        let is_needless = |&last: &usize| {
            let next = node + 1;
            next < spine.u.len()
                && spine.pieces[node - 1] == spine.pieces[node]
                && spine.u[next] - spine.u[last] <= length * spine.width
                && turns[next] - turns[last] <= turn
        };
        if !kept.last().is_some_and(is_needless) {
            kept.push(node);
        }
    }
    Spine {
        width: spine.width,
        pieces: kept
            .iter()
            .skip(1)
            .map(|&node| spine.pieces[node - 1])
            .collect(),
        half_turns: spine.half_turns,
        u: kept.iter().map(|&node| spine.u[node]).collect(),
        pose: kept.iter().map(|&node| spine.pose[node]).collect(),
        bend: kept.iter().map(|&node| spine.bend[node]).collect(),
        rib_slope: kept.iter().map(|&node| spine.rib_slope[node]).collect(),
        curved: None,
    }
}

/// The spine inside an element, its first node included.
fn point(spine: &Spine, element: usize, distance: f64) -> SpinePoint {
    match distance > 0.0 {
        true => spine.within(element, distance),
        false => spine.node(element),
    }
}

/// Turn of the belt from its start to every node: of the normal from rib to rib, plus of the board in its plane.
///
/// Units: rad
fn turns(spine: &Spine) -> Vec<f64> {
    let normal_rate = |node: usize| spine.bend[node].abs() * 1f64.hypot(spine.rib_slope[node]);
    let mut turned = 0.0;
    let mut turns = vec![turned];
    for element in 0..spine.elements() {
        let piece = spine.pieces[element];
        let rate = 0.5 * (normal_rate(element) + normal_rate(element + 1)) + piece.geodesic().abs();
        turned += spine.element_length(element) * rate + piece.corner().abs();
        turns.push(turned);
    }
    turns
}

/// The triangles of the belt in the order of u, and the turn of the whole belt.
///
/// Coordinates are in the axes of the start, to which the ribs of many belts are parallel: boxes along these axes are tight.
fn facets(spine: &Spine) -> (Vec<Facet>, f64) {
    let (mesh, turns) = (mesh(spine, 2), turns(spine));
    let last = turns.len() - 1;
    let start = spine.pose[0].inverse();
    let facet = |(triangle, &u): (&[u32; 3], &[f64; 2])| {
        let normals = u.map(|u| (start * spine.at(u).pose).frame.column(0).into_owned());
        let before = spine.u.partition_point(|&node| node < u[0]);
        let after = spine.u.partition_point(|&node| node <= u[1]);
        Facet {
            corners: triangle.map(|index| start.transform(&mesh.vertices[index as usize])),
            u,
            turn: [turns[before.saturating_sub(1)], turns[after.min(last)]],
            normal: normals[0] + normals[1],
            spread: 0.5 * normals[0].angle(&normals[1]),
        }
    };
    let mut facets: Vec<_> = mesh.triangles.iter().zip(&mesh.spans).map(facet).collect();
    facets.sort_by(|a, b| a.u[0].total_cmp(&b.u[0]));
    (facets, turns[last])
}

/// A triangle of the belt.
#[derive(Debug)]
struct Facet {
    corners: [Vector3<f64>; 3],
    /// Arc lengths of the feet of the two ribs beside the triangle.
    u: [f64; 2],
    /// Turn of the belt up to the rib before and the rib after the triangle.
    turn: [f64; 2],
    /// Normal of the belt in the middle of the triangle, of any length.
    normal: Vector3<f64>,
    /// Greatest angle within the triangle between the belt's normal and `normal`.
    spread: f64,
}

impl Facet {
    fn middle(&self) -> f64 {
        0.5 * (self.u[0] + self.u[1])
    }

    fn bounds(&self) -> Bounds {
        let [a, b, c] = &self.corners;
        Bounds {
            low: a.inf(b).inf(c),
            high: a.sup(b).sup(c),
        }
    }

    fn edges(&self) -> [[Vector3<f64>; 2]; 3] {
        let [a, b, c] = self.corners;
        [[a, b], [b, c], [c, a]]
    }

    /// Whether an edge of one triangle pierces the other.
    fn meets(&self, other: &Self) -> bool {
        let pierces = |a: &Self, b: &Self| a.edges().iter().any(|edge| b.is_pierced_by(edge));
        pierces(self, other) || pierces(other, self)
    }

    /// Whether the sheets differ in direction all over the two triangles.
    fn is_across(&self, other: &Self) -> bool {
        let (sine, cosine) = (
            self.normal.cross(&other.normal).norm(),
            self.normal.dot(&other.normal).abs(),
        );
        sine.atan2(cosine) > self.spread + other.spread + LEAST_ANGLE
    }

    /// Whether an edge goes from one side of the triangle through it to the other.
    ///
    /// A point of the triangle's plane counts to one side, always the same, so that of a line of edges that passes through
    /// at a vertex exactly one pierces the triangle. The boundary is part of the triangle, widened a little against
    /// rounding.
    fn is_pierced_by(&self, [p, q]: &[Vector3<f64>; 2]) -> bool {
        /// Widening of the triangle against rounding, as a share of its doubled area.
        const SLACK: f64 = 1e-6;
        let [a, b, c] = &self.corners;
        let normal = (b - a).cross(&(c - a));
        let [above, below] = [p, q].map(|point| normal.dot(&(point - a)));
        if (above > 0.0) == (below > 0.0) {
            return false;
        }
        let point = p + above / (above - below) * (q - p);
        let is_inside = |[a, b]: [Vector3<f64>; 2]| {
            normal.dot(&(b - a).cross(&(point - a))) >= -SLACK * normal.norm_squared()
        };
        self.edges().into_iter().all(is_inside)
    }
}

/// A box along the axes.
#[derive(Clone, Copy)]
struct Bounds {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Bounds {
    /// The box of nothing.
    fn empty() -> Self {
        Self {
            low: Vector3::repeat(f64::INFINITY),
            high: Vector3::repeat(f64::NEG_INFINITY),
        }
    }

    fn around(&self, other: &Self) -> Self {
        Self {
            low: self.low.inf(&other.low),
            high: self.high.sup(&other.high),
        }
    }

    fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|k| self.low[k] <= other.high[k] && other.low[k] <= self.high[k])
    }
}

/// Boxes around neighbours, around pairs of neighbouring boxes, and so on: neighbours along the belt are neighbours in
/// space.
struct Tree {
    /// The box of the whole belt at index 1, the two halves of box k at 2k and 2k + 1.
    bounds: Vec<Bounds>,
}

impl Tree {
    fn new(leaves: Vec<Bounds>) -> Self {
        let size = leaves.len().next_power_of_two();
        let mut bounds = vec![Bounds::empty(); 2 * size];
        bounds[size..size + leaves.len()].copy_from_slice(&leaves);
        for index in (1..size).rev() {
            bounds[index] = bounds[2 * index].around(&bounds[2 * index + 1]);
        }
        Self { bounds }
    }

    /// The first wanted leaf of a range whose box overlaps another.
    fn find(
        &self,
        bounds: &Bounds,
        range: Range<usize>,
        is_wanted: &mut impl FnMut(usize) -> bool,
    ) -> Option<usize> {
        self.find_below(1, 0..self.bounds.len() / 2, bounds, &range, is_wanted)
    }

    /// The first wanted leaf of a range, among the leaves below one box, whose box overlaps another.
    fn find_below(
        &self,
        index: usize,
        leaves: Range<usize>,
        bounds: &Bounds,
        range: &Range<usize>,
        is_wanted: &mut impl FnMut(usize) -> bool,
    ) -> Option<usize> {
        let is_outside = leaves.end <= range.start || range.end <= leaves.start;
        if is_outside || !self.bounds[index].overlaps(bounds) {
            return None;
        }
        if leaves.len() == 1 {
            return is_wanted(leaves.start).then_some(leaves.start);
        }
        let middle = leaves.start + leaves.len() / 2;
        self.find_below(2 * index, leaves.start..middle, bounds, range, is_wanted)
            .or_else(|| {
                self.find_below(2 * index + 1, middle..leaves.end, bounds, range, is_wanted)
            })
    }
}

#[cfg(test)]
mod tests;
