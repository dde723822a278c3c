//! Boards of every kind.

use super::patch::Polygon;
use super::*;
use crate::board::curve::Curve;
use crate::board::feet::Board;
use crate::board::outline::outline;
use crate::board::samples::{Part, Plan, plans};
use crate::strip::spine::{Piece, Spine};
use approx::assert_relative_eq;
use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;
use std::collections::{HashMap, HashSet};
use std::f64::consts::{PI, TAU};

/// Width of the test boards, in the unit of their length.
const WIDTH: f64 = 0.1;

/// Whether ribs keep clear of one another on the board.
pub(super) fn is_admissible(spine: &Spine) -> bool {
    let board = Board::of(spine);
    let strip = |element: &usize| matches!(spine.pieces[*element], Piece::Strip { .. });
    (0..spine.elements()).filter(strip).all(|element| {
        let [before, after] =
            [element, element + 1].map(|node| board.ends(&board.rib_at_node(spine, node)));
        (0..2).all(|side| {
            let gap = (after[side].flat - before[side].flat).norm();
            after[side].place > before[side].place && gap > 0.05 * spine.element_length(element)
        })
    })
}

fn flat_area(mesh: &Mesh, triangle: [u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|i| mesh.flat[i as usize]);
    0.5 * (b - a).perp(&(c - a))
}

fn area(mesh: &Mesh, triangle: [u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|i| mesh.vertices[i as usize]);
    0.5 * (b - a).cross(&(c - a)).norm()
}

fn edges_of(triangles: &[[u32; 3]]) -> impl Iterator<Item = (u32, u32)> {
    triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
}

/// The edges of one triangle alone, and how many edges there are.
fn boundary(mesh: &Mesh) -> (Vec<(u32, u32)>, usize) {
    let mut count: HashMap<(u32, u32), Vec<(u32, u32)>> = HashMap::new();
    for (a, b) in edges_of(&mesh.triangles) {
        count.entry((a.min(b), a.max(b))).or_default().push((a, b));
    }
    assert!(
        count.values().all(|uses| uses.len() <= 2),
        "an edge of three triangles"
    );
    let single = count.values().filter(|uses| uses.len() == 1);
    (single.map(|uses| uses[0]).collect(), count.len())
}

fn loops(boundary: &[(u32, u32)]) -> usize {
    let mut neighbours: HashMap<u32, Vec<u32>> = HashMap::new();
    for &(a, b) in boundary {
        neighbours.entry(a).or_default().push(b);
        neighbours.entry(b).or_default().push(a);
    }
    assert!(
        neighbours.values().all(|ends| ends.len() == 2),
        "a boundary that branches"
    );
    let mut seen = HashSet::new();
    let mut count = 0;
    for &start in neighbours.keys() {
        let mut stack = vec![start];
        count += usize::from(!seen.contains(&start));
        while let Some(vertex) = stack.pop() {
            if seen.insert(vertex) {
                stack.extend(&neighbours[&vertex]);
            }
        }
    }
    count
}

fn distance_to_curve(curve: &Curve, point: &Vector2<f64>) -> f64 {
    let tips = [curve.first(), curve.last()].map(|tip| (tip - point).norm());
    let nearest_tip = tips[0].min(tips[1]);
    let Curve::Arc { start, .. } = curve else {
        let (from, along) = (curve.first(), curve.last() - curve.first());
        let fraction = along.dot(&(point - from)) / along.norm_squared().max(1e-300);
        return (from + fraction.clamp(0.0, 1.0) * along - point).norm();
    };
    let (centre, radius) = curve.circle().unwrap();
    let arms = [start.position - centre, point - centre];
    let angle = (arms[0].perp(&arms[1]) * curve.turn().signum()).atan2(arms[0].dot(&arms[1]));
    match angle.rem_euclid(TAU) <= curve.turn().abs() {
        true => ((point - centre).norm() - radius).abs(),
        false => nearest_tip,
    }
}

fn distance_to_outline(spine: &Spine, point: &Vector2<f64>) -> f64 {
    let chains = Board::of(spine).chains;
    let curves = chains
        .edges
        .iter()
        .flatten()
        .map(|edge| distance_to_curve(&edge.curve, point));
    curves.fold(f64::INFINITY, f64::min)
}

/// A disc, a ring or a Möbius band, its boundary on the outline, its flat area the outline's but for the arcs.
fn assert_tiles_the_board(spine: &Spine, n_across: usize) {
    let mesh = mesh(spine, n_across);
    let is_odd = spine
        .half_turns
        .is_some_and(|half_turns| half_turns % 2 != 0);
    let distinct: HashSet<_> = edges_of(&mesh.triangles).collect();
    assert!(
        is_odd || distinct.len() == 3 * mesh.triangles.len(),
        "an edge used twice one way"
    );
    let (rim, edges) = boundary(&mesh);
    let used: HashSet<u32> = mesh.triangles.iter().flatten().copied().collect();
    assert_eq!(used.len(), mesh.vertices.len(), "an unused vertex");
    let euler = used.len() as i64 - edges as i64 + mesh.triangles.len() as i64;
    let (expected_euler, expected_loops) = match spine.half_turns {
        None => (1, 1),
        Some(_) => (0, if is_odd { 1 } else { 2 }),
    };
    assert_eq!((euler, loops(&rim)), (expected_euler, expected_loops));
    for vertex in rim.iter().map(|&(a, _)| mesh.flat[a as usize]) {
        let gap = distance_to_outline(spine, &vertex);
        assert!(
            gap <= 1e-9 * spine.width,
            "{vertex} is {gap} off the outline"
        );
    }
    assert!(
        mesh.flat_triangles
            .iter()
            .all(|&t| flat_area(&mesh, t) > 0.0),
        "a degenerate triangle"
    );
    let total: f64 = mesh
        .flat_triangles
        .iter()
        .map(|&t| flat_area(&mesh, t))
        .sum();
    let slack = segments_beyond_chords(spine, &mesh, &rim);
    assert!(
        (total - outline(spine).area()).abs() <= 1e-10 + slack,
        "{total} {slack} {}",
        outline(spine).area()
    );
}

/// Area between the arcs of the outline and the chords of a mesh, at most.
fn segments_beyond_chords(spine: &Spine, mesh: &Mesh, rim: &[(u32, u32)]) -> f64 {
    let chains = Board::of(spine).chains;
    let curvature = |curve: &Curve| curve.circle().map_or(0.0, |(_, radius)| 1.0 / radius);
    let flat_edges: HashMap<(u32, u32), (u32, u32)> = edges_of(&mesh.triangles)
        .zip(edges_of(&mesh.flat_triangles))
        .collect();
    let segment = |&(a, b): &(u32, u32)| {
        let (a, b) = flat_edges[&(a, b)];
        let [a, b] = [a, b].map(|i| mesh.flat[i as usize]);
        let is_on = |curve: &Curve| [a, b].iter().all(|p| distance_to_curve(curve, p) < 1e-8);
        let arcs = chains
            .edges
            .iter()
            .flatten()
            .map(|edge| &edge.curve)
            .filter(|curve| is_on(curve));
        let sharpest = arcs.map(curvature).fold(0.0, f64::max);
        1.1 * sharpest * (b - a).norm().powi(3) / 12.0
    };
    rim.iter().map(segment).sum()
}

fn turning(plan: &Plan) -> f64 {
    let turn = |part: &Part| match part {
        Part::Arc(length, curvature) => (length * curvature).abs(),
        Part::Corner(angle) => angle.abs(),
        Part::Straight(_) | Part::Rigid(_) => 0.0,
    };
    plan.parts.iter().map(turn).sum()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, max_global_rejects: 4096, ..ProptestConfig::default() })]

    #[test]
    fn test_mesh_tiles_every_board(plan in plans(), n_across in 2usize..6) {
        let spine = plan.spine();
        prop_assume!(is_admissible(&spine));
        assert_tiles_the_board(&spine, n_across);
    }

    #[test]
    fn test_mesh_of_a_closed_belt_closes(plan in plans(), half_turns in -2i32..3) {
        let rounded = Plan { half_turns: Some(half_turns), ..plan };
        let spine = rounded.spine();
        prop_assume!(is_admissible(&spine));
        assert_tiles_the_board(&spine, 4);
    }

    #[test]
    fn test_ribs_end_on_the_outline_and_stay_on_the_board(plan in plans()) {
        prop_assume!(turning(&plan) < 3.0);
        let spine = plan.spine();
        let board = Polygon(outline(&spine).lines(1e-7).concat());
        for rib in ribs(&spine) {
            let length = (rib.flat_point(rib.v_plus) - rib.flat_point(rib.v_minus)).norm();
            prop_assert!((length - (rib.point(rib.v_plus) - rib.point(rib.v_minus)).norm()).abs() < 1e-14);
            prop_assert!(rib.stations(7).all(|v| board.holds(&rib.flat_point(v), 2e-7)));
        }
        prop_assume!(is_admissible(&spine));
        let flat = Board::of(&spine);
        for node in 0..spine.u.len() {
            for end in flat.ends(&flat.rib_at_node(&spine, node)) {
                prop_assert!(distance_to_outline(&spine, &end.flat) < 1e-9 * WIDTH);
            }
        }
        for rib in ribs(&spine) {
            for (v, beyond) in [(rib.v_minus, rib.v_minus - 1e-3), (rib.v_plus, rib.v_plus + 1e-3)] {
                prop_assert!(distance_to_outline(&spine, &rib.flat_point(v)) < 1.01 * flat.tolerance());
                prop_assert!(!board.holds(&rib.flat_point(beyond), 0.0));
            }
        }
    }

    #[test]
    fn test_mesh_vertices_are_material_points_of_every_board(plan in plans()) {
        let spine = plan.spine();
        prop_assume!(turning(&plan) < 3.0 && is_admissible(&spine));
        let mesh = mesh(&spine, 4);
        for (x, flat) in mesh.vertices.iter().zip(&mesh.flat) {
            let expected = material_point(&spine, flat.x, flat.y);
            prop_assert!(expected.is_some_and(|expected| (x - expected).norm() < 1e-6), "{flat}");
        }
    }

    #[test]
    fn test_triangles_lie_between_the_ribs_of_their_span(plan in plans()) {
        let spine = plan.spine();
        prop_assume!(turning(&plan) < 3.0 && is_admissible(&spine));
        let mesh = mesh(&spine, 3);
        prop_assert_eq!(mesh.spans.len(), mesh.triangles.len());
        for (triangle, [from, to]) in mesh.flat_triangles.iter().zip(&mesh.spans) {
            let [a, b, c] = triangle.map(|i| mesh.flat[i as usize]);
            let middle = (a + b + c) / 3.0;
            let foot = rib_foot(&spine, middle.x, middle.y);
            prop_assert!(foot.is_some_and(|u| from - 1e-6 <= u && u <= to + 1e-6), "{foot:?} {from} {to}");
        }
    }

    #[test]
    fn test_points_of_the_board_are_found_and_others_not(plan in plans(), y in -0.3..1.0f64, z in -0.5..0.5f64) {
        let spine = plan.spine();
        prop_assume!(turning(&plan) < 3.0 && is_admissible(&spine));
        let point = Vector2::new(y, z);
        prop_assume!(distance_to_outline(&spine, &point) > 1e-4);
        let inside = Polygon(outline(&spine).lines(1e-6).concat()).holds(&point, 0.0);
        prop_assert_eq!(material_point(&spine, y, z).is_some(), inside);
        prop_assert_eq!(rib_foot(&spine, y, z).is_some(), inside);
    }

    #[test]
    fn test_area_is_length_times_width_whatever_the_arcs(
        arcs in prop::collection::vec((0.05..0.4f64, -19.0..19.0f64), 1..6),
        half_turns in prop::option::of(-1i32..2),
    ) {
        let parts: Vec<_> = arcs.iter().map(|&(length, curvature)| Part::Arc(length, curvature)).collect();
        let spine = Plan { half_turns, ..Plan::open(WIDTH, &parts) }.spine();
        assert_relative_eq!(outline(&spine).area(), spine.length() * WIDTH, max_relative = 1e-12);
    }
}

#[test]
fn test_outline_of_a_straight_belt_is_a_rectangle() {
    let spine = Plan::open(
        WIDTH,
        &[Part::Straight(0.4), Part::Rigid(0.1), Part::Straight(0.5)],
    )
    .spine();
    let outline = outline(&spine);
    let line = |a: [f64; 2], b: [f64; 2]| Curve::Line {
        from: a.into(),
        to: b.into(),
    };
    assert_eq!(outline.minus, [line([0.0, -0.05], [1.0, -0.05])]);
    assert_eq!(outline.plus, [line([0.0, 0.05], [1.0, 0.05])]);
    let corners = outline.lines(1.0).remove(0);
    assert_eq!((corners.len(), corners[0]), (5, corners[4]));
}

#[test]
fn test_edges_of_an_arc_are_concentric() {
    let spine = Plan::open(WIDTH, &[Part::Arc(0.5, 4.0)]).spine();
    let outline = outline(&spine);
    for (edge, radius) in [(&outline.minus, 0.3), (&outline.plus, 0.2)] {
        let (centre, found) = edge[0].circle().unwrap();
        assert_relative_eq!(centre, Vector2::new(0.0, 0.25), epsilon = 1e-15);
        assert_relative_eq!(found, radius, epsilon = 1e-15);
        assert_relative_eq!(edge[0].turn(), 2.0, epsilon = 1e-14);
        assert_relative_eq!(edge[0].length(), 2.0 * radius, epsilon = 1e-14);
    }
}

#[test]
fn test_corner_is_mitred_on_both_sides() {
    for angle in [0.3f64, -1.0, 2.0] {
        let spine = Plan::open(
            WIDTH,
            &[
                Part::Straight(0.5),
                Part::Corner(angle),
                Part::Straight(0.5),
            ],
        )
        .spine();
        let outline = outline(&spine);
        let mitre = 0.05 * Vector2::new(-(0.5 * angle).tan(), 1.0);
        let corner = Vector2::new(0.5, 0.0);
        assert_relative_eq!(outline.plus[0].last(), corner + mitre, epsilon = 1e-15);
        assert_relative_eq!(outline.minus[0].last(), corner - mitre, epsilon = 1e-15);
        assert_relative_eq!(outline.plus[1].first(), corner + mitre, epsilon = 1e-15);
        assert_relative_eq!(outline.area(), 0.1, epsilon = 1e-15);
    }
}

#[test]
fn test_symmetric_rib_at_a_corner_runs_from_mitre_point_to_mitre_point() {
    let spine = Plan::open(
        WIDTH,
        &[Part::Straight(0.5), Part::Corner(1.2), Part::Straight(0.5)],
    )
    .spine();
    let at_corner = |rib: &&Rib| (rib.u - 0.5).abs() < 1e-12;
    let ribs = ribs(&spine);
    let found: Vec<_> = ribs.iter().filter(at_corner).collect();
    assert_eq!(found.len(), 3);
    for (rib, slope) in found
        .iter()
        .zip([0.6f64.tan(), -0.6f64.tan(), -0.6f64.tan()])
    {
        assert_relative_eq!(rib.slope, slope, epsilon = 1e-12);
        assert_relative_eq!(rib.v_plus, 0.05, epsilon = 1e-14);
        assert_relative_eq!(rib.v_minus, -0.05, epsilon = 1e-14);
    }
    assert_relative_eq!(found[0].point(0.05), found[1].point(0.05), epsilon = 1e-12);
}

#[test]
fn test_inner_edge_of_a_tight_arc_ends_where_its_neighbours_meet() {
    for sign in [1.0, -1.0] {
        let (radius, turn) = (0.03, 1.2f64);
        let arc = Part::Arc(radius * turn, sign / radius);
        let spine = Plan::open(WIDTH, &[Part::Straight(0.4), arc, Part::Straight(0.4)]).spine();
        let outline = outline(&spine);
        let inner = if sign > 0.0 {
            &outline.plus
        } else {
            &outline.minus
        };
        assert_eq!(inner.len(), 2);
        // The vertex is on the bisector beyond the centre, from which both offset lines pass at (V/2 − R).
        let centre = Vector2::new(0.4, sign * radius);
        let bisector = Vector2::new(-(0.5 * turn).sin(), sign * (0.5 * turn).cos());
        let expected = centre + (0.05 - radius) / (0.5 * turn).cos() * bisector;
        assert_relative_eq!(inner[0].last(), expected, epsilon = 1e-14);
        assert!(is_admissible(&spine));
        assert_tiles_the_board(&spine, 4);
    }
}

#[test]
fn test_edges_of_a_short_leg_are_cut_where_its_neighbours_meet() {
    let leg = [Part::Corner(0.8), Part::Straight(0.01), Part::Corner(0.8)];
    let ends = [Part::Straight(0.5)];
    let spine = Plan::open(WIDTH, &[&ends[..], &leg, &ends].concat()).spine();
    let outline = outline(&spine);
    assert_eq!((outline.plus.len(), outline.minus.len()), (2, 3));
    let expected = outline.plus[0].last();
    assert_relative_eq!(expected.y, 0.05, epsilon = 1e-15);
    assert_relative_eq!(outline.plus[1].first(), expected, epsilon = 1e-15);
    assert_tiles_the_board(&spine, 4);
}

#[test]
fn test_end_shorter_than_its_mitre_is_cut_by_the_edge_beyond() {
    let spine = Plan::open(
        WIDTH,
        &[Part::Straight(0.02), Part::Corner(1.2), Part::Straight(0.5)],
    )
    .spine();
    let outline = outline(&spine);
    let [start, _] = outline.ends.unwrap();
    assert_eq!(start.first(), Vector2::new(0.0, -0.05));
    // The expected height is that of the line z cos χ − (y − 0.02) sin χ = V/2 at y = 0.
    let expected = (0.05 - 0.02 * 1.2f64.sin()) / 1.2f64.cos();
    assert_relative_eq!(start.last(), Vector2::new(0.0, expected), epsilon = 1e-15);
    assert_relative_eq!(outline.plus[0].first(), start.last(), epsilon = 1e-15);
}

#[test]
fn test_far_turns_do_not_clip_ribs() {
    let spine = Plan::open(WIDTH, &[Part::Arc(2.4 * TAU * 0.2, 5.0)]).spine();
    for rib in &ribs(&spine)[40..100] {
        assert_relative_eq!(rib.v_minus, -0.05, epsilon = 1e-12);
        assert_relative_eq!(rib.v_plus, 0.05, epsilon = 1e-12);
    }
    assert_tiles_the_board(&spine, 4);
    let side = [Part::Straight(0.6), Part::Corner(2.0)];
    let triangle = Plan {
        reach: 0.3,
        ..Plan::open(WIDTH, &[side, side, side, side].concat())
    };
    let mut triangle = triangle;
    triangle.parts.push(Part::Straight(0.6));
    assert!(is_admissible(&triangle.spine()));
    assert_tiles_the_board(&triangle.spine(), 4);
}

#[test]
fn test_ring_and_moebius_band_close() {
    for half_turns in -3..=3 {
        let plan = Plan {
            half_turns: Some(half_turns),
            wave: (0.5, 2.0),
            ..Plan::open(WIDTH, &[Part::Straight(1.0)])
        };
        assert_tiles_the_board(&plan.spine(), 5);
        let outline = outline(&plan.spine());
        assert_eq!(outline.ends, None);
        assert_eq!(outline.lines(1.0).len(), 2);
        assert_relative_eq!(outline.area(), 0.1, epsilon = 1e-14);
        assert!(
            ribs(&plan.spine())
                .iter()
                .all(|rib| rib.v_plus == 0.05 && rib.v_minus == -0.05)
        );
    }
}

#[test]
fn test_flat_board_of_a_closed_belt_goes_on_beyond_its_seam() {
    let plan = Plan {
        half_turns: Some(1),
        wave: (0.5, 2.0),
        ..Plan::open(WIDTH, &[Part::Straight(1.0)])
    };
    let foot = |y: f64, z: f64| rib_foot(&plan.spine(), y, z).unwrap();
    assert_relative_eq!(foot(1.3, 0.04), foot(0.3, -0.04), epsilon = 1e-12);
    assert_relative_eq!(foot(-0.3, 0.04), foot(0.7, -0.04), epsilon = 1e-12);
    assert_eq!(material_point(&plan.spine(), 0.3, 0.06), None);
}

#[test]
fn test_bent_stiffener_is_one_plane() {
    let parts = [
        Part::Straight(0.3),
        Part::Rigid(0.1),
        Part::Corner(PI / 3.0),
        Part::Rigid(0.1),
        Part::Straight(0.3),
    ];
    let plan = Plan {
        reach: 0.1,
        wave: (0.3, 1.0),
        ..Plan::open(WIDTH, &parts)
    };
    let spine = plan.spine();
    assert_tiles_the_board(&spine, 4);
    let pose = spine.at(0.35).pose;
    for (y, z) in [(0.31, 0.0), (0.4, -0.05), (0.4, 0.04), (0.43, 0.06)] {
        let expected = pose.transform(&Vector3::new(0.0, y - 0.35, z));
        assert_relative_eq!(
            material_point(&spine, y, z).unwrap(),
            expected,
            epsilon = 1e-12
        );
    }
}

#[test]
fn test_lengths_and_areas_of_a_bent_board_converge_to_the_flat_ones() {
    let errors = |refinement: f64| {
        let parts = [
            Part::Straight(0.2),
            Part::Arc(0.3, 4.0),
            Part::Straight(0.3),
            Part::Corner(-1.0),
            Part::Straight(0.3),
        ];
        let plan = Plan {
            wave: (0.2, 1.5),
            step: WIDTH / refinement,
            ..Plan::open(WIDTH, &parts)
        };
        let mesh = mesh(&plan.spine(), refinement as usize);
        let flat: f64 = mesh
            .flat_triangles
            .iter()
            .map(|&t| flat_area(&mesh, t))
            .sum();
        let deformed: f64 = mesh.triangles.iter().map(|&t| area(&mesh, t)).sum();
        let worst = edges_of(&mesh.triangles).map(|(a, b)| {
            let (a, b) = (a as usize, b as usize);
            ((mesh.vertices[a] - mesh.vertices[b]).norm() / (mesh.flat[a] - mesh.flat[b]).norm()
                - 1.0)
                .abs()
        });
        let outline = outline(&plan.spine()).area();
        [
            (deformed / flat - 1.0).abs(),
            worst.fold(0.0, f64::max),
            (flat / outline - 1.0).abs(),
        ]
    };
    let (coarse, fine) = (errors(6.0), errors(24.0));
    for (coarse, fine) in coarse.into_iter().zip(fine) {
        assert!(fine < 0.12 * coarse && fine < 1e-3, "{coarse} {fine}");
    }
}
