//! Triangle meshes of the whole belt.

use super::patch::{Polygon, edge_points};
use super::rib::Rib;
use crate::board::feet::{Board, End, Foot};
use crate::strip::spine::Spine;
use nalgebra::{Vector2, Vector3};

/// A triangle mesh of the deformed belt, with the same mesh on the flat board.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Deformed points.
    pub vertices: Vec<Vector3<f64>>,
    /// The same points of the flat board, (y, z). Of a closed belt the points of its seam follow once more, where the
    /// flat board ends.
    pub flat: Vec<Vector2<f64>>,
    /// Vertex indices, counter-clockwise about +ξ.
    pub triangles: Vec<[u32; 3]>,
    /// The same triangles in the flat board, as indices of `flat`; they differ along the seam of a closed belt alone.
    pub flat_triangles: Vec<[u32; 3]>,
    /// Arc lengths of the feet of the two ribs between which each triangle lies; twice the same foot in the flat corner
    /// beyond a rib.
    pub spans: Vec<[f64; 2]>,
}

/// The mesh of the whole belt: strips between ribs of `n_across` points (at least 2), flat patches in the corners
/// that no rib reaches and where stiffeners are joined at corners.
///
/// The mesh covers the flat board without gaps, overlaps or T-junctions, exactly but for the arcs of its outline, which
/// become chords between neighbouring ribs: ribs are added through those vertices of the outline that lie between two nodes'
/// ribs, and ribs that meet on an edge share their vertex. A closed belt has no ends, and its last rib is its first,
/// reversed after an odd number of half turns. Where ribs cross inside the board, against Eq. (33), there is no surface, and
/// the triangles overlap.
///
/// # Panics
///
/// If the spine has no nodes.
pub fn mesh(spine: &Spine, n_across: usize) -> Mesh {
    let mut builder = Builder::new(spine);
    let rows = builder.rows(n_across.max(2));
    for pair in rows.windows(2) {
        match pair[1].closes_plate {
            true => builder.plate(&pair[0], &pair[1]),
            false => builder.strip(&pair[0], &pair[1]),
        }
    }
    if let [first, .., last] = rows.as_slice() {
        builder.end_patch(first, true);
        builder.end_patch(last, false);
        if let Some(half_turns) = spine.half_turns {
            return builder.closed(first, last, half_turns % 2 != 0);
        }
    }
    builder.mesh
}

/// A rib of the mesh.
struct Row {
    foot: Foot,
    ends: [End; 2],
    /// Vertex indices from the −ζ end to the +ζ end.
    points: Vec<u32>,
    /// Whether a plate, and not a strip, joins it to the row before.
    closes_plate: bool,
}

impl Row {
    /// Arc length of its foot.
    fn u(&self) -> f64 {
        self.foot.point.u
    }

    /// Vertex indices with their places on the rib, exactly in line.
    fn boundary(&self) -> Vec<(u32, Vector2<f64>)> {
        let [minus, plus] = &self.ends;
        let last = (self.points.len() - 1) as f64;
        let at = |i: usize| minus.flat.lerp(&plus.flat, i as f64 / last);
        let points = self.points.iter().enumerate();
        points.map(|(i, &vertex)| (vertex, at(i))).collect()
    }
}

struct Builder<'a> {
    spine: &'a Spine,
    board: Board,
    mesh: Mesh,
}

impl<'a> Builder<'a> {
    fn new(spine: &'a Spine) -> Self {
        Self {
            spine,
            board: Board::of(spine),
            mesh: Mesh::default(),
        }
    }

    /// All ribs, in the order of u; a rib that coincides with the rib before is left out.
    fn rows(&mut self, n: usize) -> Vec<Row> {
        let mut rows: Vec<Row> = Vec::new();
        for (foot, closes_plate) in self.feet() {
            let ends = self.board.ends(&foot.rib);
            let shared = rows
                .last()
                .map_or([None; 2], |before| self.shared_ends(before, &ends));
            if shared.contains(&None) {
                let points = self.row(&Rib::new(&foot, &ends), &ends, &shared, n);
                rows.push(Row {
                    foot,
                    ends,
                    points,
                    closes_plate,
                });
            }
        }
        rows
    }

    /// Feet of the ribs to draw, and whether each closes a plate: the nodes, and the ribs through vertices.
    fn feet(&self) -> Vec<(Foot, bool)> {
        let (board, spine) = (&self.board, self.spine);
        let mut feet = Vec::new();
        for node in 0..spine.u.len() {
            let inside = |&[from, to]: &[usize; 2]| from < node && node < to;
            if board.plates.iter().any(inside) {
                continue;
            }
            let closes_plate = board.plates.iter().any(|&[_, to]| to == node);
            feet.push((board.foot_at_node(spine, node), closes_plate));
            if node < spine.elements() {
                let between = board.vertex_ribs(spine, node).into_iter();
                feet.extend(between.map(|at| (board.foot_within(spine, node, at), false)));
            }
        }
        feet
    }

    /// The end vertices of the previous row that coincide with the ends of the next rib, by side.
    fn shared_ends(&self, before: &Row, ends: &[End; 2]) -> [Option<u32>; 2] {
        let last = before.points.len() - 1;
        [(0, before.points[0]), (1, before.points[last])].map(|(side, vertex)| {
            let gap = (self.mesh.flat[vertex as usize] - ends[side].flat).norm();
            (gap <= self.board.tolerance()).then_some(vertex)
        })
    }

    /// The vertices of one rib, from the −ζ end to the +ζ end.
    fn row(&mut self, rib: &Rib, ends: &[End; 2], shared: &[Option<u32>; 2], n: usize) -> Vec<u32> {
        let mut row = Vec::with_capacity(n);
        for (i, v) in rib.stations(n).enumerate() {
            let shared = if i == 0 {
                shared[0]
            } else if i == n - 1 {
                shared[1]
            } else {
                None
            };
            let flat = ends[0].flat.lerp(&ends[1].flat, i as f64 / (n - 1) as f64);
            row.push(shared.unwrap_or_else(|| self.vertex(rib.point(v), flat)));
        }
        row
    }

    fn vertex(&mut self, point: Vector3<f64>, flat: Vector2<f64>) -> u32 {
        self.mesh.vertices.push(point);
        self.mesh.flat.push(flat);
        (self.mesh.vertices.len() - 1) as u32
    }

    fn strip(&mut self, before: &Row, after: &Row) {
        let span = [before, after].map(Row::u);
        for (a, b) in before.points.windows(2).zip(after.points.windows(2)) {
            self.triangle([a[0], b[0], b[1]], span);
            self.triangle([a[0], b[1], a[1]], span);
        }
    }

    /// The flat corner beyond the rib at an end of an open belt.
    fn end_patch(&mut self, row: &Row, at_start: bool) {
        let Some(side) = self.board.leftover(&row.ends, at_start) else {
            return;
        };
        let last = (self.board.chains.edges[side].len() - 1) as f64;
        let (corner, end) = (if at_start { 1.0 } else { last }, row.ends[side].place);
        let [from, to] = [corner.min(end), corner.max(end)];
        let mut edge = edge_points(&self.board, side, [from, to], self.step());
        if !at_start {
            edge.reverse();
        }
        // The boundary goes from the rib's end to the spine's end, by the corner and back along the edge.
        let mut polygon = row.boundary();
        if side == 1 {
            polygon.reverse();
        }
        let corner = self.board.chains.edges[side][corner as usize].curve.first();
        let around = [corner].into_iter().chain(edge);
        polygon.extend(around.map(|flat| (self.flat_vertex(&row.foot, flat), flat)));
        self.patch(polygon, [row.u(); 2]);
    }

    /// The bent stiffener between two ribs.
    fn plate(&mut self, before: &Row, after: &Row) {
        let [minus, mut plus] = [0, 1].map(|side| {
            let places = [before.ends[side].place, after.ends[side].place];
            edge_points(&self.board, side, places, self.step())
        });
        plus.reverse();
        let mut polygon: Vec<(u32, Vector2<f64>)> = Vec::new();
        let mut add = |flat| (self.flat_vertex(&before.foot, flat), flat);
        polygon.extend(minus.into_iter().map(&mut add));
        polygon.extend(after.boundary());
        polygon.extend(plus.into_iter().map(&mut add));
        polygon.extend(before.boundary().into_iter().rev());
        polygon.dedup_by_key(|(vertex, _)| *vertex);
        if polygon.len() > 1 && polygon[0].0 == polygon[polygon.len() - 1].0 {
            polygon.pop();
        }
        self.patch(polygon, [before, after].map(Row::u));
    }

    /// Mean length of the elements, the step in which arcs are divided where there are no ribs.
    fn step(&self) -> f64 {
        self.spine.length() / self.spine.elements().max(1) as f64
    }

    /// A vertex in the tangent plane at a foot.
    fn flat_vertex(&mut self, foot: &Foot, flat: Vector2<f64>) -> u32 {
        let local = foot.rib.foot.local(&flat);
        let point = Vector3::new(0.0, local.x, local.y);
        self.vertex(foot.point.pose.transform(&point), flat)
    }

    /// Adds the triangles of a polygon in one plane, given by its vertices and their exact flat positions.
    fn patch(&mut self, boundary: Vec<(u32, Vector2<f64>)>, span: [f64; 2]) {
        let (mut vertices, corners): (Vec<u32>, Vec<_>) = boundary.into_iter().unzip();
        let mut polygon = Polygon(corners);
        if polygon.doubled_area() < 0.0 {
            vertices.reverse();
            polygon.0.reverse();
        }
        for triangle in polygon.triangles() {
            self.triangle(triangle.map(|i| vertices[i]), span);
        }
    }

    /// Adds a triangle unless shared vertices have reduced it to a line.
    fn triangle(&mut self, [a, b, c]: [u32; 3], span: [f64; 2]) {
        if a != b && b != c && c != a {
            self.mesh.triangles.push([a, b, c]);
            self.mesh.flat_triangles.push([a, b, c]);
            self.mesh.spans.push(span);
        }
    }

    /// The mesh with its last row merged into its first.
    fn closed(self, first: &Row, last: &Row, is_reversed: bool) -> Mesh {
        let mut onto = first.points.clone();
        if is_reversed {
            onto.reverse();
        }
        let mut target: Vec<Option<u32>> = vec![None; self.mesh.flat.len()];
        for (&from, to) in last.points.iter().zip(onto) {
            target[from as usize] = Some(to);
        }
        self.mesh.merged(&target)
    }
}

impl Mesh {
    /// The mesh with some vertices merged into others; their flat points go to the end.
    fn merged(self, target: &[Option<u32>]) -> Self {
        let (kept, gone): (Vec<usize>, Vec<usize>) =
            (0..self.flat.len()).partition(|&index| target[index].is_none());
        let order = || kept.iter().chain(&gone).copied();
        let mut index = vec![0; self.flat.len()];
        for (new, old) in order().enumerate() {
            index[old] = new as u32;
        }
        let merged = |old: u32| index[target[old as usize].unwrap_or(old) as usize];
        let triangles = self.triangles.iter();
        Self {
            vertices: kept.iter().map(|&old| self.vertices[old]).collect(),
            flat: order().map(|old| self.flat[old]).collect(),
            triangles: triangles.clone().map(|t| t.map(merged)).collect(),
            flat_triangles: triangles
                .map(|t| t.map(|old| index[old as usize]))
                .collect(),
            spans: self.spans,
        }
    }
}

#[cfg(test)]
mod tests;
