//! Flat polygons of the board that no ribs divide: left-over corners and bent stiffeners.

use crate::board::feet::Board;
use crate::strip::spine::Spine;
use nalgebra::Vector2;

/// A simple polygon; neighbouring edges may lie on one line.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Polygon(pub(super) Vec<Vector2<f64>>);

/// Distance of chords from arcs in the polygon that decides whether points are inside, in half widths.
const FINE: f64 = 1e-3;

impl Polygon {
    /// The outline of a bent stiffener, from its first rib to its last.
    pub(super) fn of_plate(spine: &Spine, board: &Board, plate: &[usize; 2]) -> Self {
        let [first, last] = plate.map(|node| board.ends(&board.rib_at_node(spine, node)));
        let step = FINE * board.half_width;
        let edge = |side: usize| {
            let between = edge_points(board, side, [first[side].place, last[side].place], step);
            [first[side].flat]
                .into_iter()
                .chain(between)
                .chain([last[side].flat])
        };
        Self(
            edge(0)
                .chain(edge(1).collect::<Vec<_>>().into_iter().rev())
                .collect(),
        )
    }

    /// Whether a point is inside, or no farther from the boundary than a margin.
    pub(super) fn holds(&self, point: &Vector2<f64>, margin: f64) -> bool {
        let sides = || self.0.iter().zip(self.0.iter().cycle().skip(1));
        let is_near = sides().any(|(a, b)| distance_to_line(point, a, b) <= margin);
        let crossed = |&(a, b): &(&Vector2<f64>, &Vector2<f64>)| {
            (a.y > point.y) != (b.y > point.y)
                && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
        };
        is_near || sides().filter(crossed).count() % 2 == 1
    }

    /// Triangles of all its vertices, by their indices, counter-clockwise where the polygon is.
    ///
    /// Ears are cut off, the roundest first; every simple polygon has two, and none that is used holds another vertex.
    pub(super) fn triangles(&self) -> Vec<[usize; 3]> {
        let mut left: Vec<usize> = (0..self.0.len()).collect();
        let mut triangles = Vec::new();
        while let Some(ear) = self.roundest_ear(&left) {
            triangles.push(corner(&left, ear));
            left.remove(ear);
        }
        triangles
    }

    /// Twice the signed area.
    pub(super) fn doubled_area(&self) -> f64 {
        let sides = self.0.iter().zip(self.0.iter().cycle().skip(1));
        sides.map(|(a, b)| a.perp(b)).sum()
    }

    fn roundest_ear(&self, left: &[usize]) -> Option<usize> {
        if left.len() < 3 {
            return None;
        }
        let shape = |&ear: &usize| roundness(corner(left, ear).map(|i| self.0[i]));
        let ears = (0..left.len()).filter(|&ear| self.is_ear(left, ear));
        ears.max_by(|a, b| shape(a).total_cmp(&shape(b)))
    }

    fn is_ear(&self, left: &[usize], ear: usize) -> bool {
        let indices = corner(left, ear);
        let triangle = indices.map(|i| self.0[i]);
        let others = left.iter().filter(|i| !indices.contains(i));
        roundness(triangle) > 1e-9
            && others
                .map(|&i| &self.0[i])
                .all(|point| !is_in_triangle(point, &triangle))
    }
}

/// A vertex of the polygon with its neighbours.
fn corner(left: &[usize], at: usize) -> [usize; 3] {
    let n = left.len();
    [left[(at + n - 1) % n], left[at], left[(at + 1) % n]]
}

/// Doubled area over the square of the longest side: at most √3/2, negative if clockwise.
fn roundness([a, b, c]: [Vector2<f64>; 3]) -> f64 {
    let sides = [b - a, c - b, a - c];
    let longest = sides.iter().map(Vector2::norm_squared).fold(0.0, f64::max);
    (b - a).perp(&(c - a)) / longest
}

fn is_in_triangle(point: &Vector2<f64>, [a, b, c]: &[Vector2<f64>; 3]) -> bool {
    let area = (b - a).perp(&(c - a));
    let is_left = |a: &Vector2<f64>, b: &Vector2<f64>| (b - a).perp(&(point - a)) >= -1e-6 * area;
    is_left(a, b) && is_left(b, c) && is_left(c, a)
}

fn distance_to_line(point: &Vector2<f64>, a: &Vector2<f64>, b: &Vector2<f64>) -> f64 {
    let along = b - a;
    let square = along.norm_squared();
    let fraction = if square == 0.0 {
        0.0
    } else {
        along.dot(&(point - a)) / square
    };
    (point - (a + fraction.clamp(0.0, 1.0) * along)).norm()
}

/// Points of an edge strictly between two places: its vertices, and points of its arcs at most a step apart.
pub(super) fn edge_points(
    board: &Board,
    side: usize,
    [from, to]: [f64; 2],
    step: f64,
) -> Vec<Vector2<f64>> {
    let chain = &board.chains.edges[side];
    let mut points = Vec::new();
    for (index, edge) in chain.iter().enumerate().skip(from.floor() as usize) {
        let start = index as f64;
        let (a, b) = ((from - start).max(0.0), (to - start).min(1.0));
        if a >= b {
            break;
        }
        if a == 0.0 && start > from {
            points.push(edge.curve.first());
        }
        let part = edge.curve.part(a, b);
        let count = match part.circle() {
            None => 1,
            Some(_) => (part.length() / step).ceil().max(1.0) as usize,
        };
        points.extend((1..count).map(|i| part.point(i as f64 / count as f64)));
    }
    points
}
