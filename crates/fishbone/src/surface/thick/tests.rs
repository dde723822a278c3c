//! The board against closed forms and against shells.

use super::rows::SPINE;
use super::*;
use crate::board::samples::spine;
use crate::geometry::Pose;
use crate::strip::shell::edge_layer::psi;
use crate::strip::spine::{CurvedRibs, Piece};
use crate::surface::{BendDistribution, least_bend_radius};
use approx::assert_relative_eq;

/// Width of the test boards, in the unit of their length.
const WIDTH: f64 = 0.1;

/// The strip of a sheet whose ribs of constant slopes are straight.
fn thick(mut spine: Spine, sheet: Sheet, thickness: f64) -> Spine {
    let none = vec![0.0; spine.u.len()];
    spine.curved = Some(CurvedRibs {
        slope_rate: none.clone(),
        twist: none.clone(),
        across: none.clone(),
        across_rate: none,
        sheets: vec![sheet; spine.elements()],
        faces: vec![-0.5 * thickness, 0.5 * thickness],
    });
    spine
}

/// A flat sheet of one material.
fn plain(thickness: f64, poisson: f64) -> Sheet {
    Sheet {
        poisson,
        stretching: 12.0 * (1.0 - poisson * poisson) / (thickness * thickness),
        natural: 0.0,
    }
}

/// The strip of a plain sheet.
fn of_plain(spine: Spine, thickness: f64, poisson: f64) -> Spine {
    thick(spine, plain(thickness, poisson), thickness)
}

fn radius_quantiles(spine: &Spine) -> [f64; 3] {
    BendDistribution::of(spine).quantiles()
}

/// The curvature at a point.
fn curvature(spine: &Spine, u: f64, v: f64) -> BoardTensor {
    ThickBoard::of(spine).unwrap().at(u, v).unwrap().1
}

#[test]
fn test_a_cylinder_is_one_all_over_and_does_not_stretch() {
    let (a, radius) = (0.6f64, 0.25);
    let wrap = spine(1.0, WIDTH, 20, |_| a.cos().powi(2) / radius, |_| a.tan());
    let wrap = of_plain(wrap, 0.001, 0.0);
    let (cells, ribs) = stretches(&wrap, &Rows::new()).remove(0);
    for (cell, row) in [(60, 0), (60, ROWS - 1), (120, SPINE), (180, 7)] {
        let b = ribs.at(cell, row);
        assert_relative_eq!(b.largest(), 1.0 / radius, max_relative = 1e-12);
        assert!(b.determinant().abs() < 1e-12);
        assert_relative_eq!(b.uu, -a.cos().powi(2) / radius, max_relative = 1e-12);
    }
    assert_eq!(cells.count(), 240);
    // Without a Poisson effect a square cylinder has no layers.
    let arch = of_plain(spine(1.0, WIDTH, 20, |_| 1.0 / radius, |_| 0.0), 0.001, 0.0);
    let least = least_bend_radius(&arch).unwrap();
    assert_relative_eq!(least.value, radius, max_relative = 1e-12);
    let strain = strain(&arch).unwrap();
    assert!(strain.membrane.largest.unwrap().value < 1e-12);
    for (radius_there, strain) in radius_quantiles(&arch).iter().zip(strain.layers[0].area) {
        assert_relative_eq!(*radius_there, radius, max_relative = 1e-12);
        assert_relative_eq!(strain, 0.0005 / radius, max_relative = 1e-12);
    }
}

#[test]
fn test_a_bent_board_curls_at_its_edges_until_no_moment_acts_across() {
    let (bend, sheet) = (4.0, plain(2e-4, 0.3));
    let nu = sheet.poisson;
    let mut arch = thick(spine(1.0, WIDTH, 20, |_| bend, |_| 0.0), sheet, 2e-4);
    // The bend across of the least energy of uniform ribs.
    let number = sheet.stretching * bend * bend * WIDTH.powi(4) / 4.0;
    let share = (1.0 - psi(number)) / (1.0 + number / 180.0);
    arch.curved.as_mut().unwrap().across = vec![nu * bend * share / (1.0 + share); 21];
    for v in [-0.05, 0.05] {
        let b = curvature(&arch, 0.5, v);
        assert_relative_eq!(b.uu, -bend, max_relative = 1e-12);
        assert_relative_eq!(b.vv, nu * bend, max_relative = 1e-5);
    }
    assert!(curvature(&arch, 0.5, 0.0).vv.abs() < 1e-3 * bend);
    // The layer's strain along the edge is ν h/(2 R √(3(1−ν²))), that of the bend is h/(2 R).
    let expected = nu * 1e-4 * bend / (3.0 * (1.0 - nu * nu)).sqrt();
    let at = |u: f64, v: f64| strain_at(&arch, &[[u, v]]).unwrap().remove(0);
    assert_relative_eq!(at(0.5, 0.05).membrane[0], expected, max_relative = 1e-5);
    let face = strain(&arch).unwrap().layers[0].largest.unwrap();
    assert_relative_eq!(face.value, expected + 1e-4 * bend, max_relative = 1e-5);
    assert_eq!(face.v.abs(), 0.05);
    assert_eq!(at(face.u, face.v).layers, [face.value]);
    // The outside of the bend, on the side of ξ, is stretched more than the inside is pressed.
    arch.curved.as_mut().unwrap().faces = vec![-1e-4, 0.0, 1e-4];
    let [bottom, top] = strain_at(&arch, &[[0.5, 0.05]]).unwrap()[0].layers[..] else {
        panic!("there are two layers");
    };
    assert_relative_eq!(bottom, 1e-4 * bend - expected, max_relative = 1e-4);
    assert_relative_eq!(top, 1e-4 * bend + expected, max_relative = 1e-4);
}

#[test]
fn test_there_is_nothing_off_the_board() {
    let arch = of_plain(spine(1.0, WIDTH, 20, |_| 4.0, |_| 0.0), 1e-3, 0.3);
    let at = |u: f64, v: f64| strain_at(&arch, &[[u, v]]).unwrap().remove(0);
    assert!(at(1.0, -0.05).curvature[0] < -3.9);
    for off in [at(0.5, 0.0501), at(1.0001, 0.0), at(-0.0001, 0.0)] {
        assert!(off.curvature[0].is_nan() && off.layers[0].is_nan());
    }
}

#[test]
fn test_ribs_go_on_beyond_the_seam_of_a_closed_belt() {
    let cos = |u: f64| (std::f64::consts::PI * u).cos();
    let even = spine(1.0, WIDTH, 40, |_| 2.0, |_| 0.5);
    let odd = spine(1.0, WIDTH, 40, |u| 2.0 * cos(u), |u| 0.5 * cos(u));
    for (half_turns, mut belt) in [(0, even), (1, odd)] {
        belt.half_turns = Some(half_turns);
        let sign = if half_turns == 0 { 1.0 } else { -1.0 };
        let (cells, ribs) = stretches(&of_plain(belt, 1e-4, 0.0), &Rows::new()).remove(0);
        for row in [0, 7, SPINE, ROWS - 1] {
            let first = ribs.at(0, row);
            let far = if half_turns == 0 { row } else { ROWS - 1 - row };
            let last = ribs.at(cells.count() - 1, far);
            assert!(first.uu < -1.8, "{row} {first:?}");
            assert_relative_eq!(first.uu, sign * last.uu, max_relative = 0.02);
            assert_relative_eq!(first.uv, last.uv, max_relative = 0.02);
            assert_relative_eq!(first.vv, sign * last.vv, max_relative = 0.05);
        }
    }
}

#[test]
fn test_square_ribs_of_an_arc_are_tighter_on_its_inside() {
    let u: Vec<f64> = (0..=20).map(|i| 0.4 * f64::from(i) / 20.0).collect();
    let pieces = vec![Piece::Strip { geodesic: 4.0 }; 20];
    let (bend, slope) = (vec![2.0; 21], vec![0.0; 21]);
    let arc = Spine::from_fields(WIDTH, Pose::identity(), pieces, u, bend, slope);
    let arc = of_plain(arc, 1e-5, 0.0);
    for v in [-0.05, 0.0, 0.05] {
        let b = curvature(&arc, 0.2, v);
        assert_relative_eq!(b.uu, -2.0 / (1.0 - 4.0 * v), max_relative = 1e-10);
        assert!(b.uv.abs() < 1e-10 && b.vv.abs() < 1e-10);
    }
    let least = least_bend_radius(&arc).unwrap();
    assert_relative_eq!(least.value, 0.4, max_relative = 1e-10);
    assert_eq!(least.v, 0.05);
    let [_, q99, q95] = radius_quantiles(&arc);
    for (radius, share) in [(q99, 0.01), (q95, 0.05)] {
        let v: f64 = (1.0 - 2.0 * radius) / 4.0;
        let area = ((0.25 - v).powi(2) - 0.2f64.powi(2)) / (0.3f64.powi(2) - 0.2f64.powi(2));
        assert!((area - share).abs() < 3e-3, "{area}");
    }
}

#[test]
fn test_sloping_ribs_of_an_arc_lie_in_the_axes_of_its_radius() {
    // A cylinder with straight parallel ribs, on an arc: the slope to the turning spine is tan(a − κ u).
    let (kappa, a, bend) = (2.0, 0.3f64, 5.0);
    let n = 80;
    let u: Vec<f64> = (0..=n).map(|i| 0.3 * f64::from(i) / f64::from(n)).collect();
    let angle = |u: f64| a - kappa * u;
    let fields = |f: &dyn Fn(f64) -> f64| u.iter().map(|&u| f(u)).collect::<Vec<f64>>();
    let along = fields(&|u| bend * angle(u).cos().powi(2));
    let slope = fields(&|u| angle(u).tan());
    let rate = fields(&|u| -kappa / angle(u).cos().powi(2));
    let pieces = vec![Piece::Strip { geodesic: kappa }; n as usize];
    let arc = Spine::from_fields(WIDTH, Pose::identity(), pieces, u, along, slope);
    let mut arc = of_plain(arc, 1e-4, 0.0);
    arc.curved.as_mut().unwrap().slope_rate = rate;
    let (cells, ribs) = stretches(&arc, &Rows::new()).remove(0);
    for cell in [20, 40, 55] {
        let across = angle(cells.middle(cell));
        for row in [0, 13, ROWS - 1] {
            let b = ribs.at(cell, row);
            assert_relative_eq!(b.uu, -bend * across.cos().powi(2), max_relative = 3e-3);
            assert_relative_eq!(b.vv, -bend * across.sin().powi(2), epsilon = 3e-3 * bend);
            let mixed = -bend * across.sin() * across.cos();
            assert_relative_eq!(b.uv, mixed, epsilon = 3e-3 * bend);
        }
    }
}

#[test]
fn test_stiffeners_are_flat_and_part_the_board() {
    let pieces = vec![
        Piece::Strip { geodesic: 0.0 },
        Piece::Joint { angle: 0.0 },
        Piece::Rigid,
    ];
    let (u, bend) = (vec![0.0, 0.03, 0.03, 1.0], vec![5.0, 5.0, 0.0, 0.0]);
    let belt = Spine::from_fields(WIDTH, Pose::identity(), pieces, u, bend, vec![0.0; 4]);
    let belt = of_plain(belt, 1e-3, 0.0);
    let [q999, q99, q95] = radius_quantiles(&belt);
    assert_relative_eq!(q999, 0.2, max_relative = 1e-10);
    assert_relative_eq!(q99, 0.2, max_relative = 1e-10);
    assert_eq!(q95, f64::INFINITY);
    let stiffener = strain_at(&belt, &[[0.5, 0.0]]).unwrap().remove(0);
    assert_eq!(
        (stiffener.curvature, stiffener.membrane, stiffener.layers),
        ([0.0; 3], [0.0; 3], vec![0.0])
    );
    // It has no part that is clear of clamps.
    assert_eq!(least_bend_radius(&belt), None);
    let strain = strain(&belt).unwrap().layers[0];
    assert_eq!(strain.largest, None);
    assert_relative_eq!(strain.area[0], 2.5e-3, max_relative = 1e-10);
    assert_eq!(strain.area[2], 0.0);
}

#[test]
fn test_flat_boards_have_no_radius_and_straight_ribs_no_board() {
    let flat = spine(1.0, WIDTH, 9, |_| 0.0, |_| 0.0);
    assert!(ThickBoard::of(&flat).is_none());
    let flat = of_plain(flat, 1e-3, 0.3);
    assert_eq!(least_bend_radius(&flat), None);
    assert_eq!(radius_quantiles(&flat), [f64::INFINITY; 3]);
    let strain = strain(&flat).unwrap();
    assert_eq!(strain.layers[0].largest.unwrap().value, 0.0);
}

#[test]
fn test_layers_stretch_by_their_heights_and_rolled_strips_by_their_own_bend() {
    let arch = spine(1.0, WIDTH, 20, |_| 3.0, |_| 0.0);
    let rolled = Sheet {
        natural: 2.0,
        ..plain(1e-3, 0.0)
    };
    let mut arch = thick(arch, rolled, 1e-3);
    arch.curved.as_mut().unwrap().faces = vec![-8e-4, -1e-4, 2e-4];
    let strain = strain(&arch).unwrap();
    // The curvature b_uu is −3, from a natural one of 2.
    for (layer, height) in strain.layers.iter().zip([8e-4, 2e-4]) {
        assert_relative_eq!(
            layer.largest.unwrap().value,
            5.0 * height,
            max_relative = 1e-3
        );
        assert_relative_eq!(layer.area[2], 5.0 * height, max_relative = 1e-3);
    }
}

#[test]
fn test_extremes_are_a_fifth_of_the_width_from_joints() {
    let pieces = vec![
        Piece::Strip { geodesic: 0.0 },
        Piece::Joint { angle: 0.0 },
        Piece::Strip { geodesic: 0.0 },
    ];
    let (u, bend) = (vec![0.0, 0.4, 0.4, 1.0], vec![1.0, 9.0, 9.0, 1.0]);
    let belt = Spine::from_fields(WIDTH, Pose::identity(), pieces, u, bend, vec![0.0; 4]);
    let least = least_bend_radius(&of_plain(belt, 1e-5, 0.0)).unwrap();
    assert_relative_eq!(least.u, 0.42, max_relative = 1e-12);
    assert_relative_eq!(least.value, 0.6 / (9.0 * 0.58 + 0.02), max_relative = 1e-2);
}

#[cfg(feature = "io")]
mod shells {
    use super::*;
    use serde_json::Value;

    fn numbers(value: &Value) -> Vec<f64> {
        let values = value.as_array().unwrap().iter();
        values.map(|value| value.as_f64().unwrap()).collect()
    }

    fn strip(case: &Value) -> Spine {
        let [thickness, poisson] = ["thickness", "poisson"].map(|key| case[key].as_f64().unwrap());
        let nodes: Vec<Vec<f64>> = case["nodes"]
            .as_array()
            .unwrap()
            .iter()
            .map(numbers)
            .collect();
        let column = |i: usize| nodes.iter().map(|node| node[i]).collect::<Vec<f64>>();
        let width = case["width"].as_f64().unwrap();
        let spine = Spine::straight(width, Pose::identity(), column(0), column(1), column(2));
        let mut spine = of_plain(spine, thickness, poisson);
        let curved = spine.curved.as_mut().unwrap();
        curved.slope_rate = column(3);
        curved.twist = column(4);
        curved.across = column(5);
        curved.across_rate = column(6);
        spine
    }

    /// Whether a value is another's but for a share from below to above it.
    fn is_near(found: f64, expected: &Value, [below, above]: [f64; 2]) -> bool {
        (below..=above).contains(&(found / expected.as_f64().unwrap() - 1.0))
    }

    #[test]
    fn test_curvature_and_strain_are_those_of_shells() {
        let text = include_str!("../../../../../tests/data/edge/boards.json");
        let cases: Value = serde_json::from_str(text).unwrap();
        for (name, case) in cases.as_object().unwrap() {
            let (spine, shell) = (strip(case), &case["shell"]);
            let least = least_bend_radius(&spine).unwrap();
            assert!(
                is_near(1.0 / least.value, &shell["curvature"], [-0.025, 0.025]),
                "{name}"
            );
            let Strain { membrane, layers } = strain(&spine).unwrap();
            let face = layers[0].largest.unwrap().value;
            assert!(
                is_near(face, &shell["face"], [-0.05, 0.05]),
                "{name} {face}"
            );
            let membrane = membrane.largest.unwrap().value;
            assert!(
                is_near(membrane, &shell["membrane"], [-0.05, 0.25]),
                "{name} {membrane}"
            );
            let (radii, faces) = (radius_quantiles(&spine), layers[0].area);
            for (i, error) in [0.05, 0.012, 0.012].into_iter().enumerate() {
                let [bend, face] =
                    ["curvature_quantiles", "face_quantiles"].map(|key| &shell[key][i]);
                assert!(
                    is_near(1.0 / radii[i], bend, [-error, error]),
                    "{name} {i} {radii:?}"
                );
                assert!(
                    is_near(faces[i], face, [-error, error]),
                    "{name} {i} {faces:?}"
                );
            }
        }
    }
}
