use super::*;
use crate::board::samples::{spine, waves};
use crate::strip::spine::Piece;
use crate::surface::material_point;
use approx::assert_relative_eq;
use proptest::prelude::*;
use std::collections::{HashMap, HashSet};
use std::f64::consts::TAU;

fn flat_area(mesh: &Mesh, [a, b, c]: [u32; 3]) -> f64 {
    let flat = |i: u32| mesh.flat[i as usize];
    0.5 * (flat(b) - flat(a)).perp(&(flat(c) - flat(a)))
}

fn area(mesh: &Mesh, [a, b, c]: [u32; 3]) -> f64 {
    let x = |i: u32| mesh.vertices[i as usize];
    0.5 * (x(b) - x(a)).cross(&(x(c) - x(a))).norm()
}

fn directed_edges(mesh: &Mesh) -> Vec<(u32, u32)> {
    mesh.triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .collect()
}

fn boundary(mesh: &Mesh) -> Vec<(u32, u32)> {
    let all = directed_edges(mesh);
    let set: HashSet<_> = all.iter().copied().collect();
    all.into_iter()
        .filter(|&(a, b)| !set.contains(&(b, a)))
        .collect()
}

/// A disc, oriented, every vertex in use, its flat boundary on the rectangle, its flat area the rectangle's.
fn assert_tiles_the_board(mesh: &Mesh, length: f64, width: f64) {
    let edges = directed_edges(mesh);
    let distinct: HashSet<_> = edges.iter().copied().collect();
    assert_eq!(
        distinct.len(),
        edges.len(),
        "an edge is used twice in one direction"
    );
    let boundary = boundary(mesh);
    let used: HashSet<u32> = mesh.triangles.iter().flatten().copied().collect();
    assert_eq!(used.len(), mesh.vertices.len(), "an unused vertex");
    let undirected = (edges.len() + boundary.len()) / 2;
    let euler = used.len() as i64 - undirected as i64 + mesh.triangles.len() as i64;
    assert_eq!(euler, 1);
    for &(a, b) in &boundary {
        let (a, b) = (mesh.flat[a as usize], mesh.flat[b as usize]);
        let on = |p: f64, q: f64, line: f64| p == line && q == line;
        let lines = on(a.x, b.x, 0.0) || on(a.x, b.x, length);
        assert!(
            lines || on(a.y, b.y, -0.5 * width) || on(a.y, b.y, 0.5 * width),
            "{a} {b}"
        );
    }
    assert!(
        mesh.triangles.iter().all(|&t| flat_area(mesh, t) > 0.0),
        "a degenerate triangle"
    );
    let total: f64 = mesh.triangles.iter().map(|&t| flat_area(mesh, t)).sum();
    assert_relative_eq!(total, length * width, max_relative = 1e-12);
}

/// Sum over interior vertices of |2π − Σ angles|.
fn total_angle_defect(mesh: &Mesh) -> f64 {
    let rim: HashSet<u32> = boundary(mesh).into_iter().map(|(a, _)| a).collect();
    let mut angles: HashMap<u32, f64> = HashMap::new();
    for &[a, b, c] in &mesh.triangles {
        for [p, q, r] in [[a, b, c], [b, c, a], [c, a, b]] {
            let x = |i: u32| mesh.vertices[i as usize];
            *angles.entry(p).or_default() += (x(q) - x(p)).angle(&(x(r) - x(p)));
        }
    }
    let interior = angles.iter().filter(|(vertex, _)| !rim.contains(vertex));
    interior.map(|(_, sum)| (TAU - sum).abs()).sum()
}

#[test]
fn test_square_ends_need_no_extra_ribs_or_patches() {
    let spine = spine(1.0, 0.1, 20, |u| 3.0 * u, |u| u * (1.0 - u));
    let mesh = mesh(&spine, 5);
    assert_tiles_the_board(&mesh, 1.0, 0.1);
    assert_eq!(
        (mesh.vertices.len(), mesh.triangles.len()),
        (21 * 5, 20 * 4 * 2)
    );
}

#[test]
fn test_ribs_left_square_by_a_solver_count_as_square() {
    let spine = spine(1.0, 0.1, 20, |u| 3.0 * u, |u| u * (1.0 - u) + 3e-9);
    let mesh = mesh(&spine, 5);
    assert_tiles_the_board(&mesh, 1.0, 0.1);
    assert_eq!(mesh.vertices.len(), 21 * 5);
}

#[test]
fn test_unsquare_ends_get_corner_ribs_and_patches() {
    let spine = spine(1.0, 0.1, 20, |u| 3.0 * u, |_| 0.7);
    let mesh = mesh(&spine, 4);
    assert_tiles_the_board(&mesh, 1.0, 0.1);
    assert_eq!(mesh.vertices.len(), (21 + 2) * 4 + 2);
}

#[test]
fn test_corner_ribs_on_nodes_are_not_doubled() {
    let spine = spine(1.0, 0.1, 20, |u| 3.0 * u, |_| 1.0);
    let mesh = mesh(&spine, 4);
    assert_tiles_the_board(&mesh, 1.0, 0.1);
    assert_eq!(mesh.vertices.len(), 21 * 4 + 2);
}

#[test]
fn test_ribs_that_meet_on_an_edge_share_its_vertex() {
    for (sign, error) in [(1.0, 0.0), (-1.0, 1e-9), (1.0, -1e-9)] {
        let slope = move |u: f64| sign * (20.0 + error) * (0.1 - (u - 0.5).abs()).max(0.0);
        let spine = spine(1.0, 0.1, 80, |u| 1.0 + u, slope);
        let mesh = mesh(&spine, 5);
        assert_tiles_the_board(&mesh, 1.0, 0.1);
        assert!(mesh.vertices.len() < 81 * 5 - 10);
    }
}

#[test]
fn test_ribs_steeper_than_the_board_is_long_leave_two_corners_flat() {
    for slope in [8.0, -8.0, 2.0, 1.999_999_99, 2.000_000_01] {
        let spine = spine(1.0, 1.0, 20, |u| 3.0 * u, |_| slope);
        assert_tiles_the_board(&mesh(&spine, 4), 1.0, 1.0);
    }
}

#[test]
fn test_repeated_nodes_add_no_ribs() {
    let mut once = spine(1.0, 0.1, 10, |u| 3.0 * u, |u| u - 0.4);
    let mesh_once = mesh(&once, 3);
    once.u.insert(4, once.u[4]);
    once.pieces.insert(4, Piece::Joint { angle: 0.0 });
    once.pose.insert(4, once.pose[4]);
    once.bend.insert(4, 7.0);
    once.rib_slope.insert(4, once.rib_slope[4]);
    assert_eq!(mesh(&once, 3).vertices.len(), mesh_once.vertices.len());
}

#[test]
fn test_flat_belt_is_its_own_board() {
    let spine = spine(1.0, 0.1, 10, |_| 0.0, |u| 0.5 - 2.0 * u);
    let mesh = mesh(&spine, 3);
    for (x, flat) in mesh.vertices.iter().zip(&mesh.flat) {
        let expected = spine.pose[0].transform(&Vector3::new(0.0, flat.x, flat.y));
        assert_relative_eq!(*x, expected, epsilon = 1e-14);
    }
    let [a, b, c] = mesh.triangles[0].map(|i| mesh.vertices[i as usize]);
    assert!((b - a).cross(&(c - a)).dot(&spine.pose[0].frame.column(0)) > 0.0);
}

#[test]
fn test_gaussian_curvature_is_zero_and_would_not_be_for_other_ribs() {
    let mut spine = spine(
        1.0,
        0.2,
        80,
        |u| 4.0 - 6.0 * u,
        |u| 0.8 * (3.0 * u).sin() + 0.3,
    );
    assert!(total_angle_defect(&mesh(&spine, 9)) < 1e-10);
    spine.rib_slope.iter_mut().for_each(|slope| *slope *= 0.9);
    assert!(total_angle_defect(&mesh(&spine, 9)) > 1e-4);
}

#[test]
fn test_lengths_and_areas_converge_to_those_of_the_flat_board() {
    let errors = |n| {
        let spine = spine(
            1.0,
            0.2,
            n,
            |u| 4.0 - 6.0 * u,
            |u| 0.8 * (3.0 * u).sin() + 0.3,
        );
        let mesh = mesh(&spine, n / 5);
        let total: f64 = mesh.triangles.iter().map(|&t| area(&mesh, t)).sum();
        let stretch = |&(a, b): &(u32, u32)| {
            let (a, b) = (a as usize, b as usize);
            let flat = (mesh.flat[a] - mesh.flat[b]).norm();
            ((mesh.vertices[a] - mesh.vertices[b]).norm() / flat - 1.0).abs()
        };
        let worst = directed_edges(&mesh)
            .iter()
            .map(stretch)
            .fold(0.0, f64::max);
        ((total / 0.2 - 1.0).abs(), worst)
    };
    let (coarse, fine) = (errors(40), errors(160));
    assert!(
        fine.0 < 0.1 * coarse.0 && fine.0 < 1e-4,
        "{coarse:?} {fine:?}"
    );
    assert!(
        fine.1 < 0.1 * coarse.1 && fine.1 < 1e-3,
        "{coarse:?} {fine:?}"
    );
}

proptest! {
    #[test]
    fn test_mesh_tiles_the_board((bend, slope) in waves(19.0), n in 10usize..60, n_across in 0usize..7) {
        let spine = spine(1.0, 0.1, n, |u| bend.at(u), |u| slope.at(u));
        assert_tiles_the_board(&mesh(&spine, n_across), 1.0, 0.1);
    }

    #[test]
    fn test_mesh_tiles_the_board_where_ribs_sit_on_their_bound(
        start in prop_oneof![-25.0..25.0f64, -1e-4..1e-4f64, Just(0.0), Just(20.0), Just(-20.0), 19.9999..20.0001f64],
        steps in prop::collection::vec((-1i8..=1, -1e-8..1e-8f64), 1..60),
    ) {
        let h = 1.0 / steps.len() as f64;
        let mut slopes = vec![start];
        for (direction, noise) in &steps {
            slopes.push(slopes[slopes.len() - 1] + 20.0 * h * (f64::from(*direction) + noise));
        }
        let spine = spine(1.0, 0.1, steps.len(), |u| u, |u| slopes[(u / h).round() as usize]);
        assert_tiles_the_board(&mesh(&spine, 4), 1.0, 0.1);
    }

    #[test]
    fn test_mesh_vertices_are_material_points((bend, slope) in waves(15.0)) {
        let spine = spine(1.0, 0.1, 30, |u| bend.at(u), |u| slope.at(u));
        let mesh = mesh(&spine, 4);
        for (x, flat) in mesh.vertices.iter().zip(&mesh.flat) {
            let expected = material_point(&spine, flat.x, flat.y).unwrap_or_default();
            prop_assert!((x - expected).norm() < 1e-6);
        }
    }
}
