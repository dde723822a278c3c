use super::*;
use crate::board::samples::{Part, Plan, Wave, plans, spine, waves};
use crate::geometry::{Pose, Twist};
use crate::surface::tests::is_admissible;
use approx::assert_relative_eq;
use proptest::prelude::*;
use std::f64::consts::{PI, TAU};

/// Width of the test belts, in the unit of their length.
const WIDTH: f64 = 0.1;

/// Amplitude of the sinusoidal direction of a closed figure-eight, the first root of J₀, in rad.
const EIGHT: f64 = 2.404_825_557_695_773;

/// A belt on the cylinder over a figure-eight of one length, from a place of it on; it crosses itself at ¼ and ¾.
///
/// Ribs lie along the axis, along which the belt climbs by sin α per length.
fn eight(n: usize, from: f64, length: f64, rib_angle: f64) -> Spine {
    let bend = |u: f64| TAU * EIGHT * rib_angle.cos() * (TAU * (from + u)).cos();
    spine(length, WIDTH, n, bend, |_| rib_angle.tan())
}

/// A belt of two straight legs and an arc in between that turns by an angle, of radius 0.04.
fn loop_of(turn: f64, n: usize) -> Spine {
    let bend = |u: f64| {
        if (u - 0.5).abs() < 0.02 * turn {
            25.0
        } else {
            0.0
        }
    };
    spine(1.0, WIDTH, n, bend, |_| 0.0)
}

fn closed(spine: Spine) -> Spine {
    Spine {
        half_turns: Some(0),
        ..spine
    }
}

/// The first pair of facets that cross, of all pairs, and whether any cross in doubt.
fn crosses_by_brute_force(spine: &Spine) -> (bool, bool) {
    let (facets, _) = facets(&trimmed(spine, 1));
    let pairs = (0..facets.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let met = pairs.filter(|&(i, j)| facets[i].meets(&facets[j]));
    let clear: Vec<bool> = met.map(|(i, j)| facets[i].is_across(&facets[j])).collect();
    (clear.contains(&true), clear.contains(&false))
}

#[test]
fn test_figure_eight_crosses_itself_at_its_inflections() {
    for n in [40, 41, 42, 43, 80, 1000] {
        let [a, b] = crosses_itself(&eight(n, 0.0, 1.0, 0.0)).expect("a crossing");
        let h = f64::max(1.0 / n as f64, WIDTH / 32.0);
        assert!((a - 0.25).abs() < h && (b - 0.75).abs() < h, "{n}: {a} {b}");
    }
}

#[test]
fn test_figure_eight_that_climbs_by_its_width_between_passes_is_clear() {
    // The belt climbs ½ sin α between passes, and each pass takes V/cos α along the axis.
    let least = 0.5 * (4.0 * WIDTH).asin();
    for sign in [1.0, -1.0] {
        for share in [0.5, 0.99] {
            assert!(crosses_itself(&eight(160, 0.0, 1.0, sign * share * least)).is_some());
        }
        for share in [1.01, 2.0] {
            assert_eq!(
                crosses_itself(&eight(160, 0.0, 1.0, sign * share * least)),
                None
            );
        }
    }
}

#[test]
fn test_end_that_rests_against_the_belt_does_not_cross_it() {
    // The belt goes from the crossing round both loops to the crossing: its ends rest on its middle.
    for slip in [0.0, 1e-7, 1e-6] {
        let resting = eight(10_000, 0.25 - slip, 1.0 + 2.0 * slip, 0.0);
        assert_eq!(crosses_itself(&resting), None);
    }
    let [a, b] = crosses_itself(&eight(80, 0.249, 1.0, 0.0)).expect("a crossing");
    assert!(a < 0.02 && (b - 0.501).abs() < 0.02, "{a} {b}");
}

#[test]
fn test_crossing_on_the_seam_of_a_closed_belt_is_found() {
    let [a, b] = crosses_itself(&closed(eight(80, 0.25, 1.0, 0.0))).expect("a crossing");
    let is_near =
        |[a, b]: [f64; 2], from: f64| (a - from).abs() < 0.02 && (b - from - 0.5).abs() < 0.02;
    assert!(is_near([a, b], 0.0) || is_near([a, b], 0.5), "{a} {b}");
}

#[test]
fn test_legs_of_a_loop_cross_where_their_lines_do() {
    // The arc turns by more than half a turn and less than a whole one; the legs meet tan(½ turn) radii beyond the arc.
    for turn in [3.6f64, 5.0, 6.0] {
        let [a, b] = crosses_itself(&loop_of(turn, 800)).expect("a crossing");
        let beyond = 0.04 * (0.5 * turn - (0.5 * turn).tan());
        assert!((a - 0.5 + beyond).abs() < 4e-3, "{turn}: {a}");
        assert!((b - 0.5 - beyond).abs() < 4e-3, "{turn}: {b}");
    }
    for turn in [1.0, PI, 3.2] {
        assert_eq!(crosses_itself(&loop_of(turn, 800)), None);
    }
}

#[test]
fn test_layers_of_a_wound_belt_lie_on_each_other_and_do_not_cross() {
    for turns in [1.2, 3.0, 3.1] {
        for (n, rib_angle) in [(80, 0.0), (97, 0.0), (80, 0.01), (160, 0.05)] {
            let bend = TAU * turns * f64::cos(rib_angle);
            let wound = spine(1.0, WIDTH, n, |_| bend, |_| rib_angle.tan());
            assert_eq!(crosses_itself(&wound), None, "{turns} {n} {rib_angle}");
        }
    }
}

#[test]
fn test_layers_of_an_oval_winding_that_turns_cross_and_a_steep_one_is_clear() {
    // The windings are ovals on a helix, with a long axis that turns from one winding to the next.
    let winding = |rib_angle: f64| {
        let around = TAU * 3.0;
        let bend = move |u: f64| around * rib_angle.cos() * (1.0 + 0.5 * (1.9 * around * u).cos());
        spine(1.0, 0.02, 300, bend, |_| rib_angle.tan())
    };
    // The belt climbs a third of sin α between windings, and each winding takes V/cos α along the axis.
    assert!(crosses_itself(&winding(0.0)).is_some());
    assert!(crosses_itself(&winding(0.03)).is_some());
    assert_eq!(crosses_itself(&winding(0.1)), None);
}

#[test]
fn test_spiral_crosses_nothing() {
    for tightening in [0.02, 0.3, 3.0] {
        let spiral = spine(1.0, WIDTH, 160, |u| 14.0 + tightening * u, |_| 0.0);
        assert_eq!(crosses_itself(&spiral), None);
    }
}

#[test]
fn test_sheets_that_cross_at_less_than_an_element_turns_are_divided_until_the_crossing_is_clear() {
    // The belt is two rounds of a ring whose bend waves once a round: each round is the other turned over, and they meet a
    // quarter on.
    for (wave, levels_in_doubt) in [(0.05, 1), (0.01, 2)] {
        let bend = |u: f64| 2.0 * TAU * (1.0 + wave * (2.0 * TAU * u).sin());
        let belt = spine(1.0, WIDTH, 80, bend, |_| 0.0);
        for parts in &PARTS[..levels_in_doubt] {
            let found = first_crossing(&trimmed(&belt, *parts));
            assert!(matches!(found, Crossing::Doubtful));
        }
        let [a, b] = crosses_itself(&belt).expect("a crossing");
        assert!(
            (a - 0.125).abs() < 0.01 && (b - 0.625).abs() < 0.01,
            "{a} {b}"
        );
    }
}

#[test]
fn test_closed_rings_do_not_cross_at_their_seam() {
    for rounds in [1.0, 2.0, 3.0] {
        for n in [20, 80, 81] {
            let ring = spine(1.0, WIDTH, n, |_| TAU * rounds, |_| 0.0);
            assert_eq!(crosses_itself(&ring), None);
            assert_eq!(crosses_itself(&closed(ring)), None);
        }
    }
}

#[test]
fn test_moebius_band_does_not_cross_itself() {
    // The band is that of scenarios/mobius.toml.
    let segments = vec![crate::scenario::SegmentSpec::straight(TAU)];
    let mut belt = crate::scenario::BeltSpec::new(TAU / 30.0, TAU / 30.0, segments);
    (belt.closed, belt.half_turns) = (true, Some(1));
    let problem = crate::problem::Problem::new(crate::scenario::Scenario::new(belt)).unwrap();
    let band = crate::solve::solve(&problem, &mut || std::ops::ControlFlow::Continue(()));
    assert_eq!(band.spine.half_turns.map(|n| n % 2), Some(1));
    assert_eq!(crosses_itself(&band.spine), None);
}

#[test]
fn test_flat_belts_and_empty_belts_cross_nothing() {
    assert_eq!(crosses_itself(&spine(1.0, WIDTH, 9, |_| 0.0, |u| u)), None);
    assert_eq!(crosses_itself(&spine(0.0, WIDTH, 0, |_| 1.0, |u| u)), None);
    assert_eq!(crosses_itself(&spine(0.0, WIDTH, 3, |_| 1.0, |u| u)), None);
    let nowhere = spine(
        1.0,
        WIDTH,
        80,
        |u| if u < 0.5 { 20.0 } else { f64::NAN },
        |_| 0.0,
    );
    assert_eq!(crosses_itself(&nowhere), None);
}

#[test]
fn test_boards_that_turn_in_their_plane_cross_without_bending_by_half_a_turn() {
    // The boards: more than a round of an arc in its plane, one end tilted; and a triangle whose last leg passes through its
    // first.
    let u: Vec<f64> = (0..=160).map(|i| f64::from(i) / 160.0).collect();
    let bend = u.iter().map(|u| (0.5 * TAU * u).sin()).collect();
    let pieces = vec![Piece::Strip { geodesic: 7.0 }; 160];
    let arc = Spine::from_fields(0.05, Pose::identity(), pieces, u, bend, vec![0.0; 161]);
    let leg = Part::Straight(0.7);
    let parts = [leg, Part::Corner(2.4), leg, Part::Corner(2.4), leg];
    let board = Plan {
        reach: 0.3,
        ..Plan::open(0.05, &parts)
    };
    let board = board.spine();
    assert!(is_admissible(&board));
    let bend = |u: f64| match u {
        u if u < 0.7 => 0.0,
        u if u < 1.4 => 1.4,
        _ => 0.4,
    };
    let triangle = Spine::from_fields(
        board.width,
        board.pose[0],
        board.pieces.clone(),
        board.u.clone(),
        board.u.iter().copied().map(bend).collect(),
        board.rib_slope.clone(),
    );
    for belt in [arc, triangle] {
        let is_flat = |piece: &Piece| matches!(piece, Piece::Joint { .. });
        let straight = belt.pieces.iter().map(|piece| match is_flat(piece) {
            true => Piece::Joint { angle: 0.0 },
            false => Piece::Strip { geodesic: 0.0 },
        });
        let bent_alone = Spine {
            pieces: straight.collect(),
            ..belt.clone()
        };
        assert!(turns(&bent_alone).last().is_some_and(|&turn| turn < 2.0));
        assert!(crosses_itself(&belt).is_some());
    }
}

#[test]
fn test_fine_elements_are_merged() {
    let fine = eight(20_000, 0.0, 1.0, 0.0);
    let taken = thinned(&fine, 1);
    assert!(taken.elements() < 5000);
    assert_eq!((taken.u[0], taken.length()), (0.0, 1.0));
    let [a, b] = crosses_itself(&fine).expect("a crossing");
    assert!((a - 0.25).abs() < 2e-3 && (b - 0.75).abs() < 2e-3);
    let coarse = eight(80, 0.0, 1.0, 0.0);
    assert_eq!(thinned(&coarse, 1), coarse);
}

#[test]
fn test_trimmed_spine_is_the_same_but_for_its_margin() {
    let spine = eight(40, 0.1, 1.0, 0.3);
    for parts in [1, 4] {
        let trimmed = trimmed(&spine, parts);
        assert_eq!(trimmed.elements(), 40 * parts);
        assert_relative_eq!(trimmed.width, WIDTH - 2e-5, epsilon = 1e-15);
        assert_relative_eq!(trimmed.length(), 1.0 - 2e-5, epsilon = 1e-14);
        for (node, &u) in trimmed.u.iter().enumerate() {
            let expected = spine.at(u);
            let found = trimmed.node(node);
            assert_relative_eq!(found.pose.position, expected.pose.position, epsilon = 1e-14);
            assert_relative_eq!(found.bend, expected.bend, epsilon = 1e-12);
        }
    }
}

#[test]
fn test_triangle_is_pierced_through_its_boundary_and_its_vertices_but_not_beside_them() {
    let [a, b, c] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|[x, y]| Vector3::new(x, y, 0.0));
    let facet = Facet {
        corners: [a, b, c],
        u: [0.0; 2],
        turn: [0.0; 2],
        normal: Vector3::z(),
        spread: 0.0,
    };
    let through = |x: f64, y: f64, [from, to]: [f64; 2]| {
        facet.is_pierced_by(&[Vector3::new(x, y, from), Vector3::new(x + 0.1, y, to)])
    };
    for (x, y) in [
        (0.2, 0.2),
        (-0.05, 0.0),
        (0.45, 0.5),
        (0.95, 0.0),
        (-0.05, 1.0),
    ] {
        assert!(through(x, y, [-1.0, 1.0]) && through(x, y, [1.0, -1.0]));
        assert!(!through(x, y, [0.1, 1.0]) && !through(x, y, [-1.0, -0.1]));
    }
    for (x, y) in [(-0.06, 0.2), (0.5, 0.5), (0.2, -0.01), (-0.05, 1.01)] {
        assert!(!through(x, y, [-1.0, 1.0]));
    }
    // Two edges meet in the triangle's plane: one edge pierces it if they lie on two sides, none or both if they lie on one.
    for [from, to] in [[-1.0, 1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, -1.0]] {
        let [first, second] = [through(0.2, 0.2, [from, 0.0]), through(0.3, 0.2, [0.0, to])];
        assert_eq!(first != second, from != to);
    }
}

/// Ends of the part of the line of intersection of two planes that is in a triangle, as coordinates along it.
fn on_line(triangle: &Facet, other: &Facet, direction: &Vector3<f64>) -> Option<[f64; 2]> {
    let [a, b, c] = &other.corners;
    let normal = (b - a).cross(&(c - a));
    let crossings = triangle.edges().into_iter().filter_map(|[p, q]| {
        let [above, below] = [p, q].map(|point| normal.dot(&(point - a)));
        (above * below < 0.0).then(|| direction.dot(&p.lerp(&q, above / (above - below))))
    });
    let ends: Vec<f64> = crossings.collect();
    (ends.len() == 2).then(|| [ends[0].min(ends[1]), ends[0].max(ends[1])])
}

/// Whether two triangles meet in general position.
///
/// Source: T. Möller, "A fast triangle-triangle intersection test" (1997)
fn meet_by_intervals(a: &Facet, b: &Facet) -> bool {
    let normal = |[p, q, r]: &[Vector3<f64>; 3]| (q - p).cross(&(r - p));
    let direction = normal(&a.corners).cross(&normal(&b.corners));
    match (on_line(a, b, &direction), on_line(b, a, &direction)) {
        (Some([low, high]), Some([other_low, other_high])) => low < other_high && other_low < high,
        _ => false,
    }
}

fn triangles() -> impl Strategy<Value = Facet> {
    prop::array::uniform3(prop::array::uniform3(-1.0..1.0f64)).prop_map(|corners| Facet {
        corners: corners.map(Vector3::from),
        u: [0.0; 2],
        turn: [0.0; 2],
        normal: Vector3::z(),
        spread: 0.0,
    })
}

/// A belt with its bend multiplied.
fn bent(spine: &Spine, factor: f64) -> Spine {
    let bend = spine.bend.iter().map(|bend| factor * bend).collect();
    let (u, slope) = (spine.u.clone(), spine.rib_slope.clone());
    Spine::from_fields(
        spine.width,
        spine.pose[0],
        spine.pieces.clone(),
        u,
        bend,
        slope,
    )
}

fn curled((bend, slope): (Wave, Wave), factor: f64) -> Spine {
    spine(1.0, WIDTH, 60, |u| factor * bend.at(u), |u| slope.at(u))
}

proptest! {
    #[test]
    fn test_triangles_meet_where_their_intervals_on_the_common_line_do(a in triangles(), b in triangles()) {
        prop_assert_eq!(a.meets(&b), meet_by_intervals(&a, &b));
    }

    #[test]
    fn test_crossings_of_curled_belts_are_those_of_all_pairs_of_triangles(
        fields in waves(15.0), factor in 1.0..8.0f64,
    ) {
        let belt = curled(fields, factor);
        let (is_clear, is_doubtful) = crosses_by_brute_force(&belt);
        match first_crossing(&trimmed(&belt, 1)) {
            Crossing::At(_) => prop_assert!(is_clear),
            Crossing::Doubtful => prop_assert!(is_doubtful && !is_clear),
            Crossing::None => prop_assert!(!is_clear),
        }
    }

    #[test]
    fn test_crossings_of_boards_of_every_kind_are_those_of_all_pairs_of_triangles(
        plan in plans(), factor in 1.0..8.0f64,
    ) {
        let board = plan.spine();
        prop_assume!(is_admissible(&board));
        let belt = bent(&board, factor);
        let is_found = matches!(first_crossing(&trimmed(&belt, 1)), Crossing::At(_));
        prop_assert_eq!(is_found, crosses_by_brute_force(&belt).0);
    }

    #[test]
    fn test_crossings_move_and_scale_with_the_belt(
        fields in waves(15.0), factor in 2.0..8.0f64, scale in prop::sample::select(vec![1e-3, 0.3, 1e3]),
        translation in prop::array::uniform3(-5.0..5.0f64), rotation in prop::array::uniform3(-3.0..3.0f64),
    ) {
        let belt = curled(fields, factor);
        let motion = Pose::exp(&Twist { translation: translation.into(), rotation: rotation.into() });
        let placed = |pose: &Pose| {
            let moved = motion * *pose;
            Pose { position: scale * moved.position, ..moved }
        };
        let moved = Spine {
            width: scale * belt.width,
            u: belt.u.iter().map(|u| scale * u).collect(),
            pose: belt.pose.iter().map(placed).collect(),
            bend: belt.bend.iter().map(|bend| bend / scale).collect(),
            ..belt.clone()
        };
        let found = crosses_itself(&moved).map(|places| places.map(|u| u / scale));
        match (found, crosses_itself(&belt)) {
            (None, None) => {}
            (Some(found), Some(expected)) => {
                prop_assert!((found[0] - expected[0]).abs() < 1e-9 && (found[1] - expected[1]).abs() < 1e-9);
            }
            different => prop_assert!(false, "{:?}", different),
        }
    }
}
