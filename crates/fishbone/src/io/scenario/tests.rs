//! Facts of the schema: the input that is read, the input that is refused, and the words of refusals.

use super::*;
use crate::scenario::*;
use approx::assert_relative_eq;
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_6};

/// Shipped scenarios, by name and text.
const SHIPPED: [(&str, &str); 5] = [
    (
        "example1",
        include_str!("../../../../../scenarios/example1.toml"),
    ),
    (
        "example2",
        include_str!("../../../../../scenarios/example2.toml"),
    ),
    (
        "planar",
        include_str!("../../../../../scenarios/planar.toml"),
    ),
    (
        "polystyrene",
        include_str!("../../../../../scenarios/polystyrene.toml"),
    ),
    ("twist", include_str!("../../../../../scenarios/twist.toml")),
];

/// Scenario in TOML of a belt between two clamps, with most sections written out, so that one edit reaches any field.
const BASE: &str = r#"
name = "base"
energy = "sadowsky"

[belt]
width = 0.1
rigidity = 1.0
segments = [{ kind = "straight", length = 1.0 }]

[[supports]]
at = "start"
position = [0.0, 0.0, 0.0]
rotation = [0.0, 0.0, 0.0]

[[supports]]
at = "end"
position = [0.0, 0.5, 0.1]
rotation = [0.0, 0.0, 0.0]

[solver]
method = "intrinsic"
elements = 80
tolerance = 1e-8
bulge = [1.0, 0.0, 0.0]

[solver.ritz]
basis = 10
"#;

/// Segment in TOML: a straight belt, in m.
const STRAIGHT: &str = r#"{ kind = "straight", length = 1.0 }"#;
/// Segment in TOML: half a straight belt, for boards of several segments, in m.
const HALF: &str = r#"{ kind = "straight", length = 0.5 }"#;
/// Rigidity line of [`BASE`], for edits, in N·m².
const RIGIDITY: &str = "rigidity = 1.0";
/// Rotation line of the end's clamp in [`BASE`], for edits, in rad.
const END_ROTATION: &str = "0.1]\nrotation = [0.0, 0.0, 0.0]";

fn shipped(name: &str) -> Scenario {
    let (_, text) = SHIPPED
        .iter()
        .find(|(shipped, _)| *shipped == name)
        .unwrap();
    Scenario::from_toml(text).unwrap()
}

fn base() -> Scenario {
    Scenario::from_toml(BASE).unwrap()
}

/// BASE with one piece of text replaced.
fn edited(from: &str, to: &str) -> String {
    assert_eq!(BASE.matches(from).count(), 1, "{from} must occur once");
    BASE.replace(from, to)
}

fn refusal(toml: &str) -> String {
    Scenario::from_toml(toml).expect_err(toml).to_string()
}

/// Checks the whole message after each edit (from, to, message) of BASE, and that it is one line.
fn assert_refusals(cases: &[(&str, &str, &str)]) {
    for (from, to, message) in cases {
        let refusal = refusal(&edited(from, to));
        assert_eq!(refusal, *message);
        assert!(!refusal.contains('\n'));
    }
}

fn assert_reads(cases: &[(&str, &str)]) {
    for (from, to) in cases {
        let scenario =
            Scenario::from_toml(&edited(from, to)).unwrap_or_else(|error| panic!("{to}: {error}"));
        assert_eq!(Scenario::from_json(&scenario.to_json()), Ok(scenario));
    }
}

#[test]
fn shipped_scenarios_are_valid_and_survive_a_round_trip() {
    for (name, _) in SHIPPED {
        let scenario = shipped(name);
        let json = scenario.to_json();
        assert_eq!(Scenario::from_json(&json).as_ref(), Ok(&scenario));
        assert_eq!(Scenario::from_json(&json).unwrap().to_json(), json);
    }
}

#[test]
fn scenarios_in_the_documentation_are_valid() {
    let page = include_str!("../../../../../docs/scenario.md");
    let mut blocks = 0;
    for part in page.split("```toml\n").skip(1) {
        let (block, _) = part.split_once("```").unwrap();
        Scenario::from_toml(block).unwrap_or_else(|error| panic!("{block}: {error}"));
        blocks += 1;
    }
    assert_eq!(blocks, 2);
}

#[test]
fn materials_in_the_documentation_are_those_of_the_code() {
    let page = include_str!("../../../../../docs/scenario.md");
    for (name, material) in crate::board::material::PRESETS {
        let (young, poisson) = (material.young / 1e9, material.poisson);
        let density = material.density.unwrap();
        let row = format!("| `{name}` | {young} | {poisson} | {density} |");
        assert!(page.contains(&row), "{row}");
    }
}

#[test]
fn examples_of_the_source_name_the_energy_of_the_source_and_others_take_the_default() {
    for (name, _) in SHIPPED {
        let energy = match name {
            "example1" | "example2" => EnergyModel::Fishbone,
            "cantilever" | "hinge" | "polystyrene" => EnergyModel::Shell,
            _ => EnergyModel::Wunderlich,
        };
        assert_eq!(shipped(name).energy_model(), energy, "{name}");
    }
}

#[test]
fn energy_that_is_not_named_is_that_of_the_thickness_if_one_is_known() {
    let scenario = |head: &str, belt: &str| {
        let segments = r#"segments = [{ kind = "straight", length = 1.0 }]"#;
        let text = format!("{head}\n[belt]\nwidth = 0.1\n{belt}\n{segments}");
        Scenario::from_toml(&text).unwrap()
    };
    let energy = |head, belt| scenario(head, belt).energy_model();
    let sheet = r#"material = { preset = "PET", thickness = 1e-4 }"#;
    let layers = r#"layers = [{ material = "polyimide", thickness = 25e-6 }]"#;
    let thick = "rigidity = 1.0\nthickness = 1e-4";
    assert_eq!(energy("", "rigidity = 1.0"), EnergyModel::Wunderlich);
    for known in [sheet, layers, thick] {
        assert_eq!(energy("", known), EnergyModel::Shell);
        assert_eq!(
            energy("energy = \"sadowsky\"", known),
            EnergyModel::Sadowsky
        );
    }
    let mut by_ritz = scenario("", sheet);
    by_ritz.solver.method = Method::Ritz;
    assert_eq!(by_ritz.energy_model(), EnergyModel::Wunderlich);
    let written = scenario("", sheet).to_json();
    assert!(!written.contains("energy"), "{written}");
    assert_eq!(Scenario::from_json(&written).unwrap().energy, None);
}

#[test]
fn example_2_ends_turned_by_thirty_degrees_about_x() {
    let (sin, cos) = FRAC_PI_6.sin_cos();
    let frame = shipped("example2").supports[1].frame().unwrap();
    assert_relative_eq!(
        frame.column(1).into_owned(),
        Vector3::new(0.0, cos, sin),
        epsilon = 1e-15
    );
    assert_relative_eq!(
        frame.column(2).into_owned(),
        Vector3::new(0.0, -sin, cos),
        epsilon = 1e-15
    );
}

#[test]
fn rigidity_of_the_polystyrene_sheet_is_that_of_a_plate() {
    let belt = shipped("polystyrene").belt;
    let expected = 3.2e9 * 140e-6_f64.powi(3) * 0.02 / (12.0 * (1.0 - 0.34 * 0.34));
    assert_relative_eq!(
        belt.rigidity_value().unwrap(),
        expected,
        max_relative = 1e-14
    );
    assert_relative_eq!(
        belt.rigidity_value().unwrap(),
        1.6548e-5,
        max_relative = 1e-4
    );
    assert_eq!((belt.length(), belt.width), (0.2, 0.02));
}

#[test]
fn defaults_are_those_of_the_contract() {
    let least = r#"belt = { width = 0.1, rigidity = 1.0, segments = [{ kind = "straight", length = 1.0 }] }"#;
    let scenario = Scenario::from_toml(least).unwrap();
    assert_eq!(scenario.name, "");
    assert_eq!(scenario.energy_model(), EnergyModel::Wunderlich);
    assert_eq!(scenario.belt.natural_bend, 0.0);
    assert_eq!(scenario.belt.density, 0.0);
    assert!(!scenario.belt.closed);
    assert_eq!(scenario.solver, SolverSpec::default());
    assert_eq!(scenario.solver.tolerance, 1e-8);
    assert_eq!(scenario.solver.bulge, [1.0, 0.0, 0.0]);
    assert_eq!(scenario.solver.method, Method::Intrinsic);
    let ritz = RitzSpec {
        basis: 10,
        points: 16,
        penalty: 1e2,
        updates: 1,
    };
    assert_eq!(scenario.solver.ritz, ritz);
}

#[test]
fn default_elements_are_eight_per_width_and_at_least_eighty() {
    let mut scenario = base();
    assert_eq!(scenario.elements(), 80);
    scenario.solver.elements = None;
    assert_eq!(scenario.elements(), 80);
    for (width, elements) in [(0.05, 160), (0.03, 267), (0.2, 80), (1.0 / 30.0, 240)] {
        scenario.belt.width = width;
        assert_eq!(scenario.elements(), elements, "V = {width}");
    }
}

#[test]
fn the_three_forms_of_an_orientation_agree() {
    let half = FRAC_PI_6 / 2.0;
    let mut support = base().supports.remove(1);
    support.rotation = Some([0.0, FRAC_PI_6, 0.0]);
    let by_vector = support.frame().unwrap();
    (support.rotation, support.euler) = (None, Some([0.0, FRAC_PI_6, 0.0]));
    assert_relative_eq!(support.frame().unwrap(), by_vector, epsilon = 1e-15);
    (support.euler, support.quaternion) = (None, Some([half.cos(), 0.0, half.sin(), 0.0]));
    assert_relative_eq!(support.frame().unwrap(), by_vector, epsilon = 1e-15);
    support.quaternion = None;
    assert_eq!(support.frame(), None);
}

#[test]
fn euler_angles_turn_about_z_then_y_then_z() {
    let (phi, theta, psi) = (0.3_f64, 0.5_f64, 0.7_f64);
    let mut support = base().supports.remove(1);
    (support.rotation, support.euler) = (None, Some([phi, theta, psi]));
    let frame = support.frame().unwrap();
    // Entries of Rz(φ) Ry(θ) Rz(ψ) written out.
    assert_relative_eq!(frame[(2, 2)], theta.cos(), epsilon = 1e-15);
    assert_relative_eq!(frame[(0, 2)], phi.cos() * theta.sin(), epsilon = 1e-15);
    assert_relative_eq!(frame[(1, 2)], phi.sin() * theta.sin(), epsilon = 1e-15);
    assert_relative_eq!(frame[(2, 0)], -theta.sin() * psi.cos(), epsilon = 1e-15);
    assert_relative_eq!(frame[(2, 1)], theta.sin() * psi.sin(), epsilon = 1e-15);
}

#[test]
fn a_quaternion_within_tolerance_is_normalised() {
    let text = edited(
        END_ROTATION,
        "0.1]\nquaternion = [1.0000009, 0.0, 0.0, 0.0]",
    );
    let frame = Scenario::from_toml(&text).unwrap().supports[1]
        .frame()
        .unwrap();
    assert_relative_eq!(frame, Matrix3::identity(), epsilon = 1e-15);
}

#[test]
fn a_rib_is_square_by_default_only_at_a_full_clamp_at_an_end() {
    let clamp = base().supports.remove(1);
    assert!(clamp.is_square_rib(1.0));
    assert!(
        SupportSpec {
            at: Place::ArcLength(1.0),
            ..clamp.clone()
        }
        .is_square_rib(1.0)
    );
    assert!(
        !SupportSpec {
            at: Place::ArcLength(0.5),
            ..clamp.clone()
        }
        .is_square_rib(1.0)
    );
    assert!(
        !SupportSpec {
            position: None,
            ..clamp.clone()
        }
        .is_square_rib(1.0)
    );
    assert!(
        !SupportSpec {
            rotation: None,
            ..clamp.clone()
        }
        .is_square_rib(1.0)
    );
    assert!(
        !SupportSpec {
            square_rib: Some(false),
            ..clamp.clone()
        }
        .is_square_rib(1.0)
    );
    assert!(
        SupportSpec {
            position: None,
            square_rib: Some(true),
            ..clamp
        }
        .is_square_rib(1.0)
    );
}

#[test]
fn a_place_within_rounding_of_an_end_is_that_end() {
    let length = 0.1 + 0.2;
    assert_eq!(Place::ArcLength(0.3).arc_length(length), length);
    assert_eq!(Place::ArcLength(-1e-12).arc_length(length), 0.0);
    assert_eq!(Place::ArcLength(0.2).arc_length(length), 0.2);
    assert!(Place::ArcLength(0.3).is_end(length) && !Place::ArcLength(0.2).is_end(length));
}

#[test]
fn a_position_with_a_free_component_is_no_point() {
    let mut support = base().supports.remove(1);
    assert_eq!(support.point(), Some(Vector3::new(0.0, 0.5, 0.1)));
    support.position.as_mut().unwrap()[2] = Component::Free;
    assert_eq!(support.point(), None);
}

#[test]
fn segments_of_one_rigidity_are_one_belt() {
    let two = r#"{ kind = "straight", length = 0.4, rigidity = 1.0 }, { kind = "straight", length = 0.6 }"#;
    let belt = Scenario::from_toml(&edited(STRAIGHT, two)).unwrap().belt;
    assert_eq!((belt.length(), belt.rigidity_value()), (1.0, Some(1.0)));
    // A belt needs no rigidity if every segment has its own.
    let own = edited(
        STRAIGHT,
        r#"{ kind = "straight", length = 1, rigidity = 2 }"#,
    )
    .replace(RIGIDITY, "");
    assert_eq!(
        Scenario::from_toml(&own).unwrap().belt.rigidity_value(),
        Some(2.0)
    );
}

#[test]
fn a_belt_without_one_rigidity_has_no_rigidity_value() {
    let mut belt = base().belt;
    let constant = |value| Some(Rigidity::Constant(value));
    let straight = |rigidity| SegmentSpec::Straight {
        length: 1.0,
        natural_bend: None,
        rigidity,
    };
    belt.segments = vec![straight(constant(2.0)), straight(None)];
    assert_eq!(belt.rigidity_value(), None);
    let table = RigidityTable {
        u: vec![0.0, 1.0],
        value: vec![1.0, 2.0],
    };
    belt.segments = vec![straight(Some(Rigidity::Table(table)))];
    assert_eq!(belt.rigidity_value(), None);
    belt.segments = vec![SegmentSpec::Rigid { length: 1.0 }];
    assert_eq!(belt.rigidity_value(), None);
}

#[test]
fn density_of_a_material_wins() {
    let material = |density: &str| {
        format!(
            "density = 3.0\nmaterial = {{ young = 1e9, poisson = 0.3, thickness = 1e-3{density} }}"
        )
    };
    let read = |text: &str| {
        Scenario::from_toml(&edited(RIGIDITY, text))
            .unwrap()
            .belt
            .density_value()
    };
    assert_eq!(read(&material("")), 3.0);
    assert_relative_eq!(
        read(&material(", density = 1000")),
        0.1,
        max_relative = 1e-15
    );
}

#[test]
fn every_field_reads_at_the_edges_of_its_range() {
    assert_reads(&[
        ("name = \"base\"", "name = \"Möbius \\n\""),
        ("energy = \"sadowsky\"", "energy = \"fishbone\""),
        ("energy = \"sadowsky\"", "energy = \"wunderlich\""),
        ("width = 0.1", "width = 1"),
        (RIGIDITY, "rigidity = 1e-100"),
        (
            RIGIDITY,
            "rigidity = 1\npoisson = -0.99\nnatural_bend = -0.0\ndensity = 0\nclosed = false\nhalf_turns = 0",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 1.0, natural_bend = 0, rigidity = 1 }",
        ),
        ("at = \"start\"", "at = 0"),
        ("at = \"end\"", "at = 1.0"),
        ("position = [0.0, 0.5, 0.1]\n", ""),
        (END_ROTATION, "0.1]"),
        (END_ROTATION, "0.1]\neuler = [0, 1, 2]"),
        (END_ROTATION, "0.1]\nquaternion = [0, -1, 0, 0]"),
        (
            END_ROTATION,
            "0.1]\nrotation = [0, 0, 7]\nsquare_rib = false",
        ),
        ("method = \"intrinsic\"", "method = \"ritz\""),
        ("elements = 80", "elements = 4"),
        ("elements = 80", "elements = 100000"),
        ("elements = 80\n", ""),
        ("tolerance = 1e-8", "tolerance = 1e-13"),
        ("bulge = [1.0, 0.0, 0.0]", "bulge = [0, 0, -1e-100]"),
        (
            "basis = 10",
            "basis = 6\npoints = 2\npenalty = 1e-3\nupdates = 0",
        ),
        (
            "basis = 10",
            "basis = 40\npoints = 500\npenalty = 1e12\nupdates = 1000",
        ),
        (
            "[solver]",
            "[loads]\ngravity = [0, 0, 0]\npoints = []\n[solver]",
        ),
    ]);
}

#[test]
fn an_unknown_field_is_named_with_its_path_and_the_field_meant() {
    assert_refusals(&[
        (
            "width = 0.1",
            "widht = 0.1",
            "belt.widht: unknown field, did you mean \"width\"? allowed: width, rigidity, material, layers, thickness, poisson, \
             natural_bend, density, closed, half_turns, segments",
        ),
        (
            "name = \"base\"",
            "zzz = 1",
            "zzz: unknown field, allowed: name, energy, belt, supports, links, loads, solver",
        ),
        (
            "position = [0.0, 0.5, 0.1]",
            "positon = [0.0, 0.5, 0.1]",
            "supports[1].positon: unknown field, did you mean \"position\"? allowed: at, position, rotation, euler, \
             quaternion, hinge, moment, square_rib",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", lenght = 1.0 }",
            "belt.segments[0].lenght: unknown field, did you mean \"length\"? allowed: kind, length, natural_bend, \
             rigidity",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 1.0, curvature = 0 }",
            "belt.segments[0].curvature: unknown field, allowed: kind, length, natural_bend, rigidity",
        ),
        (
            STRAIGHT,
            "{ kind = \"corner\", angle = 1.0, length = 0 }",
            "belt.segments[0].length: unknown field, allowed: kind, angle",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 1.0, rigidity = { u = [0, 1], values = [1, 2] } }",
            "belt.segments[0].rigidity.values: unknown field, did you mean \"value\"? allowed: u, value",
        ),
        (
            "basis = 10",
            "bases = 10",
            "solver.ritz.bases: unknown field, did you mean \"basis\"? allowed: basis, points, penalty, updates",
        ),
        (
            "tolerance = 1e-8",
            "\"tol\\n\" = 1e-8",
            "solver.tol\\n: unknown field, allowed: method, accuracy, elements, tolerance, snap_size, bulge, ritz",
        ),
    ]);
}

#[test]
fn an_unknown_word_is_named_with_the_words_allowed() {
    assert_refusals(&[
        (
            "energy = \"sadowsky\"",
            "energy = \"wunderlch\"",
            "energy: found \"wunderlch\", allowed: fishbone, sadowsky, wunderlich, shell (did you mean \"wunderlich\"?)",
        ),
        (
            "energy = \"sadowsky\"",
            "energy = \"elastica\"",
            "energy: found \"elastica\", allowed: fishbone, sadowsky, wunderlich, shell",
        ),
        (
            "method = \"intrinsic\"",
            "method = \"RITZ\"",
            "solver.method: found \"RITZ\", allowed: intrinsic, ritz (did you mean \"ritz\"?)",
        ),
        (
            STRAIGHT,
            "{ kind = \"strait\", length = 1.0 }",
            "belt.segments[0].kind: found \"strait\", allowed: straight, arc, corner, rigid (did you mean \"straight\"?)",
        ),
        (
            END_ROTATION,
            "0.1]\nrotation = [0, 0, 0]\nhinge = \"z\\n\"",
            "supports[1].hinge: found \"z\\n\", allowed: xi, eta, zeta",
        ),
        (
            "at = \"end\"",
            "at = \"middle\"",
            "supports[1].at: found \"middle\", must be \"start\", \"end\" or an arc length from the start",
        ),
        (
            "position = [0.0, 0.5, 0.1]",
            "position = [0.0, 0.5, \"fee\"]",
            "supports[1].position[2]: found \"fee\", must be a number or \"free\"",
        ),
    ]);
}

#[test]
fn a_wrong_type_is_named_with_the_type_found_and_the_types_allowed() {
    assert_refusals(&[
        (
            "name = \"base\"",
            "name = 3",
            "name: found 3, must be a text in quotes",
        ),
        (
            "energy = \"sadowsky\"",
            "energy = 1",
            "energy: found 1, must be one of fishbone, sadowsky, wunderlich, shell",
        ),
        (
            "width = 0.1",
            "width = \"0.1\"",
            "belt.width: found \"0.1\", must be a number",
        ),
        (
            "width = 0.1",
            "width = 1979-05-27",
            "belt.width: found a date, must be a number",
        ),
        (
            "width = 0.1",
            "width = [0.1]",
            "belt.width: found an array of 1 entry, must be a number",
        ),
        (
            RIGIDITY,
            "rigidity = true",
            "belt.rigidity: found true, must be a number",
        ),
        (
            RIGIDITY,
            "rigidity = 1\nclosed = 0",
            "belt.closed: found 0, must be true or false",
        ),
        (
            RIGIDITY,
            "rigidity = 1\nhalf_turns = 0.5",
            "belt.half_turns: found 0.5, must be a whole number of at most 32 bits",
        ),
        (
            RIGIDITY,
            "material = \"steel\"",
            "belt.material: found \"steel\", must be a table",
        ),
        (
            "[{ kind = \"straight\", length = 1.0 }]",
            "1.0",
            "belt.segments: found 1.0, must be an array",
        ),
        (
            STRAIGHT,
            "1.0",
            "belt.segments[0]: found 1.0, must be a table",
        ),
        (
            STRAIGHT,
            "{ length = 1.0 }",
            "belt.segments[0].kind: found nothing, must be given",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\" }",
            "belt.segments[0].length: found nothing, must be given",
        ),
        (
            STRAIGHT,
            "{ kind = \"arc\", length = 1.0 }",
            "belt.segments[0].curvature: found nothing, must be given",
        ),
        (
            STRAIGHT,
            "{ kind = \"corner\" }",
            "belt.segments[0].angle: found nothing, must be given",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 1.0, rigidity = \"stiff\" }",
            "belt.segments[0].rigidity: found \"stiff\", must be a number or a table { u = […], value = […] }",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 1.0, rigidity = { u = [0, 1], value = [1, \"2\"] } }",
            "belt.segments[0].rigidity.value[1]: found \"2\", must be a number",
        ),
        (
            "at = \"end\"",
            "at = [1]",
            "supports[1].at: found an array, must be \"start\", \"end\" or an arc length from the start",
        ),
        (
            "at = \"end\"\n",
            "",
            "supports[1].at: found nothing, must be given",
        ),
        (
            "position = [0.0, 0.5, 0.1]",
            "position = [0.0, 0.5]",
            "supports[1].position: found an array of 2 entries, must be an array of 3 entries",
        ),
        (
            "position = [0.0, 0.5, 0.1]",
            "position = \"free\"",
            "supports[1].position: found \"free\", must be an array of 3 entries",
        ),
        (
            "position = [0.0, 0.5, 0.1]",
            "position = [0.0, true, 0.1]",
            "supports[1].position[1]: found true, must be a number or \"free\"",
        ),
        (
            "position = [0.0, 0.5, 0.1]",
            "position = [0.0, 07:32:00, 0.1]",
            "supports[1].position[1]: found a date, must be a number or \"free\"",
        ),
        (
            END_ROTATION,
            "0.1]\nrotation = [0, 0, 0, 1]",
            "supports[1].rotation: found an array of 4 entries, must be an array of 3 entries",
        ),
        (
            "elements = 80",
            "elements = 80.0",
            "solver.elements: found 80.0, must be a whole number, not negative",
        ),
        (
            "elements = 80",
            "elements = -1",
            "solver.elements: found -1, must be a whole number, not negative",
        ),
    ]);
    assert_eq!(
        refusal("name = \"x\""),
        "belt: found nothing, must be given"
    );
    assert_eq!(
        refusal("belt = { rigidity = 1, segments = [] }"),
        "belt.width: found nothing, must be given"
    );
    assert_eq!(
        refusal("belt = 1\nsupports = {}"),
        "belt: found 1, must be a table"
    );
    let error = Scenario::from_json("[1, 2]").unwrap_err();
    assert_eq!(
        error.to_string(),
        "scenario: found an array of 2 entries, must be a table"
    );
}

#[test]
fn a_value_of_the_belt_outside_its_range_is_refused() {
    assert_refusals(&[
        (
            "width = 0.1",
            "width = -0.1",
            "belt.width: found -0.1, must be a positive finite number",
        ),
        (
            "width = 0.1",
            "width = 0",
            "belt.width: found 0.0, must be a positive finite number",
        ),
        (
            "width = 0.1",
            "width = nan",
            "belt.width: found nan, must be a positive finite number",
        ),
        (
            "width = 0.1",
            "width = inf",
            "belt.width: found inf, must be a positive finite number",
        ),
        (
            RIGIDITY,
            "rigidity = 0.0",
            "belt.rigidity: found 0.0, must be a positive finite number",
        ),
        (
            RIGIDITY,
            "rigidity = 1\npoisson = 0.5",
            "belt.poisson: found 0.5, must be between -1 and 0.5, both excluded",
        ),
        (
            RIGIDITY,
            "rigidity = 1\nnatural_bend = -inf",
            "belt.natural_bend: found -inf, must be a finite number",
        ),
        (
            RIGIDITY,
            "rigidity = 1\ndensity = -1",
            "belt.density: found -1.0, must be a finite number, not negative",
        ),
        (
            RIGIDITY,
            "rigidity = 1\nhalf_turns = 1",
            "belt.half_turns: found 1, must be 0 or left out where belt.closed is false",
        ),
        (
            RIGIDITY,
            "rigidity = 1\nclosed = true\nhalf_turns = -21",
            "belt.half_turns: found -21, must be from -20 to 20",
        ),
        (
            STRAIGHT,
            "",
            "belt.segments: found an empty array, must be at least one segment",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 0 }",
            "belt.segments[0].length: found 0.0, must be a positive finite number",
        ),
        (
            STRAIGHT,
            "{ kind = \"rigid\", length = -1 }",
            "belt.segments[0].length: found -1.0, must be a positive finite number",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 1e308 }, { kind = \"straight\", length = 1e308 }",
            "belt.segments: found a total length of inf, must be of a length from 1e-100 to 1e100",
        ),
        (
            STRAIGHT,
            "{ kind = \"corner\", angle = 1 }",
            "belt.segments: found a total length of 0.0, must be of a length from 1e-100 to 1e100",
        ),
        (
            STRAIGHT,
            "{ kind = \"rigid\", length = 1 }",
            "belt.segments: found nothing that bends, must be given a straight segment or an arc",
        ),
        (
            STRAIGHT,
            "{ kind = \"arc\", length = 1, curvature = -6284 }",
            "belt.segments: found arcs of 1000.1296623894704 full turns in all, must be at most 1000",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 1, natural_bend = 1e300 }",
            "belt.segments: found natural bends of 1.5915494309189535e299 full turns in all, must be at most 1000",
        ),
        (
            STRAIGHT,
            "{ kind = \"arc\", length = 1, curvature = nan }",
            "belt.segments[0].curvature: found nan, must be a finite number",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 1, natural_bend = inf }",
            "belt.segments[0].natural_bend: found inf, must be a finite number",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 1, rigidity = -2 }",
            "belt.segments[0].rigidity: found -2.0, must be a positive finite number",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 1, rigidity = { u = [0, 1], value = [1] } }",
            "belt.segments[0].rigidity: found 2 of u and 1 of value, must be as many of each, at least 2",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 1, rigidity = { u = [0, 1], value = [1, 0] } }",
            "belt.segments[0].rigidity.value[1]: found 0.0, must be a positive finite number",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 1, rigidity = { u = [0, 0], value = [1, 2] } }",
            "belt.segments[0].rigidity.u[1]: found 0.0, must be rising from 0 to the segment's length 1.0",
        ),
    ]);
}

#[test]
fn a_belt_has_exactly_one_source_of_rigidity() {
    let sheet = "material = { young = 1e9, poisson = 0.3, thickness = 1e-3 }";
    let both = format!("{RIGIDITY}\n{sheet}");
    let layers = format!("{sheet}\nlayers = [{{ material = \"pet\", thickness = 1e-3 }}]");
    assert_refusals(&[
        (
            RIGIDITY,
            "",
            "belt: found no rigidity, must be given one of rigidity, material, layers",
        ),
        (
            RIGIDITY,
            &both,
            "belt: found rigidity and material, must be given one of rigidity, material, layers",
        ),
        (
            RIGIDITY,
            &layers,
            "belt: found material and layers, must be given one of rigidity, material, layers",
        ),
    ]);
}

#[test]
fn a_value_of_the_material_outside_its_range_is_refused() {
    let cases = [
        (
            "young = 0, poisson = 0.3, thickness = 1",
            "young: found 0.0, must be a positive finite number",
        ),
        (
            "young = 1, poisson = 0.3, thickness = -1",
            "thickness: found -1.0, must be a positive finite number",
        ),
        (
            "young = 1, poisson = 0.3",
            "thickness: found nothing, must be given",
        ),
        (
            "poisson = 0.3, thickness = 1",
            "young: found nothing, must be given where there is no preset",
        ),
        (
            "young = 1, thickness = 1",
            "poisson: found nothing, must be given where there is no preset",
        ),
        (
            "young = 1, poisson = -1, thickness = 1",
            "poisson: found -1.0, must be between -1 and 0.5, both excluded",
        ),
        (
            "young = 1, poisson = 0, thickness = 1, density = nan",
            "density: found nan, must be a finite number, not negative",
        ),
    ];
    for (fields, message) in cases {
        let text = edited(RIGIDITY, &format!("material = {{ {fields} }}"));
        assert_eq!(refusal(&text), format!("belt.material.{message}"));
    }
    assert_refusals(&[
        (
            RIGIDITY,
            "material = { young = 1, poisson = 0, thickness = 1e-200 }",
            "belt.material: found a rigidity of 0.0 that follows, must be such that it is from 1e-100 to 1e100",
        ),
        (
            RIGIDITY,
            "material = { young = 1e9, poisson = 0, thickness = 20, density = 1e100 }",
            "belt.material: found a mass per length of 2e100 that follows, must be such that it is at most 1e100",
        ),
        (
            RIGIDITY,
            "material = { preset = \"polyimid\", thickness = 1e-4 }",
            "belt.material.preset: found \"polyimid\", allowed: polyimide, rolled-copper, PET, polystyrene, FR-4, \
             stainless-steel, acrylic-adhesive (did you mean \"polyimide\"?)",
        ),
        (
            RIGIDITY,
            "layers = [{ material = \"PET\", thickness = 1e-4 }, { material = \"unobtainium\", thickness = 1e-4 }]",
            "belt.layers[1].material: found \"unobtainium\", allowed: polyimide, rolled-copper, PET, polystyrene, FR-4, \
             stainless-steel, acrylic-adhesive",
        ),
        (
            RIGIDITY,
            "layers = [{ material = \"PET\", thickness = 1e200 }]",
            "belt.layers: found a rigidity of inf that follows, must be such that it is from 1e-100 to 1e100",
        ),
        (
            RIGIDITY,
            "layers = []",
            "belt.layers: found an empty array, must be at least one layer, or left out",
        ),
        (
            RIGIDITY,
            "layers = [{ material = \"pet\", thickness = 0 }]",
            "belt.layers[0].thickness: found 0.0, must be a positive finite number",
        ),
    ]);
}

#[test]
fn an_invalid_support_is_refused() {
    assert_refusals(&[
        (
            END_ROTATION,
            "0.1]\nquaternion = [1.01, 0, 0, 0]",
            "supports[1].quaternion: found norm 1.01, must be 1 within 1e-6",
        ),
        (
            END_ROTATION,
            "0.1]\nquaternion = [1.0000011, 0, 0, 0]",
            "supports[1].quaternion: found norm 1.0000011, must be 1 within 1e-6",
        ),
        (
            END_ROTATION,
            "0.1]\nquaternion = [nan, 0, 0, 0]",
            "supports[1].quaternion[0]: found nan, must be a finite number",
        ),
        (
            END_ROTATION,
            "0.1]\nrotation = [0, 0, 0]\neuler = [0, 0, 0]",
            "supports[1]: found rotation and euler, must be given one of rotation, euler, quaternion",
        ),
        (
            END_ROTATION,
            "0.1]\neuler = [0, inf, 0]",
            "supports[1].euler[1]: found inf, must be a finite number",
        ),
        (
            END_ROTATION,
            "0.1]\nrotation = [0, 0, nan]",
            "supports[1].rotation[2]: found nan, must be a finite number",
        ),
        (
            END_ROTATION,
            "0.1]\nhinge = \"zeta\"",
            "supports[1].hinge: found a hinge without an orientation, must be given with one of rotation, euler, \
             quaternion",
        ),
        (
            "position = [0.0, 0.5, 0.1]\nrotation = [0.0, 0.0, 0.0]",
            "",
            "supports[1]: found nothing held, must be given a position, an orientation or a square rib",
        ),
        (
            "position = [0.0, 0.5, 0.1]",
            "position = [0.0, nan, 0.1]",
            "supports[1].position[1]: found nan, must be a finite number",
        ),
        (
            "at = \"end\"",
            "at = 1.5",
            "supports[1].at: found 1.5, must be from 0 to the belt's length 1.0",
        ),
        (
            "at = \"start\"",
            "at = -0.5",
            "supports[0].at: found -0.5, must be from 0 to the belt's length 1.0",
        ),
        (
            "at = \"end\"",
            "at = nan",
            "supports[1].at: found nan, must be from 0 to the belt's length 1.0",
        ),
        (
            "at = \"end\"",
            "at = \"start\"",
            "supports[1].at: found 0.0 (start), the place of supports[0], must be another place",
        ),
        (
            "at = \"start\"",
            "at = 1",
            "supports[1].at: found 1.0 (end), the place of supports[0], must be another place",
        ),
    ]);
    let swapped = edited("at = \"end\"", "at = 0.0").replace("at = \"start\"", "at = \"end\"");
    assert_eq!(
        refusal(&swapped),
        "supports[1].at: found 0.0 after 1.0, must be in order along the belt"
    );
}

#[test]
fn invalid_links_and_loads_are_refused() {
    assert_refusals(&[
        (
            "[solver]",
            "[[links]]\nfrom = 0.2\nto = 0.2\noffset = [0, 0, 0]\n[solver]",
            "links[0].to: found 0.2, the place of from, must be another place",
        ),
        (
            "[solver]",
            "[[links]]\nfrom = 0.2\nto = 2\noffset = [0, 0, 0]\n[solver]",
            "links[0].to: found 2.0, must be from 0 to the belt's length 1.0",
        ),
        (
            "[solver]",
            "[[links]]\nfrom = 0.2\nto = 0.8\noffset = [0, 0, inf]\n[solver]",
            "links[0].offset[2]: found inf, must be a finite number",
        ),
        (
            "[solver]",
            "[[links]]\nfrom = 0.2\nto = 0.8\noffset = [0, -2e6, 0]\n[solver]",
            "links[0].offset[1]: found -2000000.0, must be within 1e6 lengths of the belt",
        ),
        (
            "[solver]",
            "[[loads.points]]\nat = 0.5\nforce = [0, 0, -1e200]\n[solver]",
            "loads.points[0].force[2]: found -1e200, must be at most 1e100 in magnitude",
        ),
        (
            "[solver]",
            "[loads]\ngravity = [0, 0, nan]\n[solver]",
            "loads.gravity[2]: found nan, must be a finite number",
        ),
        (
            "[solver]",
            "[[loads.points]]\nat = 7\nforce = [0, 0, 1]\n[solver]",
            "loads.points[0].at: found 7.0, must be from 0 to the belt's length 1.0",
        ),
        (
            "[solver]",
            "[[loads.points]]\nat = 0.5\nforce = [0, 0, inf]\n[solver]",
            "loads.points[0].force[2]: found inf, must be a finite number",
        ),
        (
            "[solver]",
            "[[loads.points]]\nat = 0.5\nforce = [0, 0, 1]\nlever = [nan, 0, 0]\n[solver]",
            "loads.points[0].lever[0]: found nan, must be a finite number",
        ),
    ]);
}

#[test]
fn a_solver_setting_outside_its_range_is_refused() {
    assert_refusals(&[
        (
            "elements = 80",
            "elements = 3",
            "solver.elements: found 3, must be from 4 to 100000",
        ),
        (
            "elements = 80",
            "elements = 100001",
            "solver.elements: found 100001, must be from 4 to 100000",
        ),
        (
            "elements = 80",
            "accuracy = 1e-7",
            "solver.accuracy: found 1e-7, must be from 1e-6 to 1e-1",
        ),
        (
            "elements = 80",
            "accuracy = 0.2",
            "solver.accuracy: found 0.2, must be from 1e-6 to 1e-1",
        ),
        (
            "elements = 80",
            "snap_size = -0.1",
            "solver.snap_size: found -0.1, must be from 0 to 10",
        ),
        (
            "tolerance = 1e-8",
            "tolerance = 0.0",
            "solver.tolerance: found 0.0, must be from 1e-13 to 1e-2",
        ),
        (
            "tolerance = 1e-8",
            "tolerance = nan",
            "solver.tolerance: found nan, must be from 1e-13 to 1e-2",
        ),
        (
            "tolerance = 1e-8",
            "tolerance = 1",
            "solver.tolerance: found 1.0, must be from 1e-13 to 1e-2",
        ),
        (
            "bulge = [1.0, 0.0, 0.0]",
            "bulge = [0, 0, 0]",
            "solver.bulge: found a vector of length 0.0, must be of a positive finite length",
        ),
        (
            "bulge = [1.0, 0.0, 0.0]",
            "bulge = [0, nan, 0]",
            "solver.bulge[1]: found nan, must be a finite number",
        ),
        (
            "basis = 10",
            "basis = 2",
            "solver.ritz.basis: found 2, must be an even number from 6 to 40",
        ),
        (
            "basis = 10",
            "basis = 9",
            "solver.ritz.basis: found 9, must be an even number from 6 to 40",
        ),
        (
            "basis = 10",
            "points = 1",
            "solver.ritz.points: found 1, must be from 2 to 500",
        ),
        (
            "basis = 10",
            "penalty = 0",
            "solver.ritz.penalty: found 0.0, must be from 1e-6 to 1e12",
        ),
        (
            "basis = 10",
            "updates = 1001",
            "solver.ritz.updates: found 1001, must be from 0 to 1000",
        ),
    ]);
}

/// One edit for each part that a scenario may hold beyond straight belts between two clamps.
#[test]
fn every_field_of_the_schema_is_accepted() {
    let circuit = "layers = [{ material = \"PET\", thickness = 25e-6 }, { material = \"rolled copper\", thickness = 18e-6 }]";
    let several = format!("{HALF}, {{ kind = \"arc\", length = 0.5, curvature = 40 }}");
    let stiffened = format!("{HALF}, {{ kind = \"rigid\", length = 0.1 }}");
    let inner = "at = \"start\"\nposition = [0, 0, 0]\n[[supports]]\nat = 0.5\nsquare_rib = true\n[[supports]]\nat = 0.6";
    assert_reads(&[
        (
            RIGIDITY,
            "material = { preset = \"Polyimide\", thickness = 25e-6 }",
        ),
        (
            RIGIDITY,
            "material = { preset = \"FR4\", thickness = 1e-4, young = 21e9, density = 0 }",
        ),
        (RIGIDITY, circuit),
        (RIGIDITY, "rigidity = 1\nnatural_bend = -3\npoisson = 0.4"),
        (STRAIGHT, &several),
        (STRAIGHT, &stiffened),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 1, natural_bend = -1 }",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 1, rigidity = { u = [0, 0.1], value = [1, 2] } }",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 0.5 }, { kind = \"straight\", length = 0.5, rigidity = 2 }",
        ),
        ("at = \"start\"\nposition = [0.0, 0.0, 0.0]", inner),
        (END_ROTATION, "0.1]\nrotation = [0, 0, 0]\nhinge = \"zeta\""),
        (
            "[solver]",
            "[[links]]\nfrom = 0.2\nto = \"end\"\noffset = [0, 0.3, 0]\n[solver]",
        ),
        (
            "[solver]",
            "[[loads.points]]\nat = \"end\"\nforce = [0, 0, -1]\nlever = [0, 0, 0.05]\n[solver]",
        ),
    ]);
    let heavy = edited(RIGIDITY, "rigidity = 1\ndensity = 2")
        .replace("[solver]", "[loads]\ngravity = [0, 0, -9.81]\n[solver]");
    assert!(Scenario::from_toml(&heavy).is_ok());
}

/// BASE with other segments.
fn with_segments(segments: &str) -> String {
    edited(STRAIGHT, segments)
}

#[test]
fn a_corner_bends_the_board_by_at_most_120_degrees() {
    let corner = |angle: &str| format!("{{ kind = \"corner\", angle = {angle} }}");
    let between = |angles: &[&str]| {
        let corners: Vec<String> = angles.iter().map(|angle| corner(angle)).collect();
        with_segments(&format!("{HALF}, {}, {HALF}", corners.join(", ")))
    };
    for angles in [
        &["2.0943951023931953"][..],
        &["-2.0943951033"],
        &["1.0471975511965976", "1.0471975511965976"],
        &["2", "2", "-2"],
    ] {
        assert!(Scenario::from_toml(&between(angles)).is_ok(), "{angles:?}");
    }
    let allowed = "must be at most 2π/3 (120°) in magnitude";
    for (angles, at, found) in [
        (&["2.1"][..], 1, "2.1"),
        (&["-2.1"], 1, "-2.1"),
        (&["1", "-3"], 2, "-3.0"),
        (&["1.5", "1"], 2, "2.5 in all with the corners before it"),
    ] {
        let message = format!("belt.segments[{at}].angle: found {found}, {allowed}");
        assert_eq!(refusal(&between(angles)), message);
    }
    assert_eq!(
        refusal(&between(&["inf"])),
        "belt.segments[1].angle: found inf, must be a finite number"
    );
}

#[test]
fn a_corner_stands_between_segments_with_a_length() {
    let corner = "{ kind = \"corner\", angle = 1 }";
    for (segments, at) in [
        (format!("{corner}, {HALF}"), 0),
        (format!("{HALF}, {corner}"), 1),
        (format!("{HALF}, {corner}, {HALF}, {corner}, {corner}"), 3),
    ] {
        let message = format!(
            "belt.segments[{at}]: found a corner at an end of the belt, must be between two segments that have a length"
        );
        assert_eq!(refusal(&with_segments(&segments)), message);
        let closed = with_segments(&segments).replace(RIGIDITY, "rigidity = 1\nclosed = true");
        assert_eq!(refusal(&closed), message);
    }
}

#[test]
fn a_corner_at_a_stiffener_is_below_90_degrees() {
    let rigid = "{ kind = \"rigid\", length = 0.1 }";
    let joined = |before: &str, angle: &str, after: &str| {
        with_segments(&format!(
            "{HALF}, {before}, {{ kind = \"corner\", angle = {angle} }}, {after}, {HALF}"
        ))
    };
    for text in [
        joined(rigid, "1.57", HALF),
        joined(HALF, "-1.57", rigid),
        joined(rigid, "2", rigid),
        joined(HALF, "2", HALF),
    ] {
        assert!(Scenario::from_toml(&text).is_ok(), "{text}");
    }
    for (text, angle) in [
        (joined(rigid, "1.5708", HALF), "1.5708"),
        (joined(HALF, "-2", rigid), "-2.0"),
    ] {
        let message = format!(
            "belt.segments[2].angle: found {angle} between a rigid and a flexible segment, must be below π/2 (90°) in \
             magnitude"
        );
        assert_eq!(refusal(&text), message);
    }
}

/// BASE closed, with other supports and tables.
fn closed(rest: &str) -> String {
    let (head, _) = BASE.split_once("[[supports]]").unwrap();
    let belt = head.replace(RIGIDITY, "rigidity = 1.0\nclosed = true\nhalf_turns = -20");
    format!("{belt}{rest}")
}

#[test]
fn a_closed_belt_is_held_anywhere_but_at_its_end() {
    let start = "[[supports]]\nat = \"start\"\nrotation = [0, 0, 0]\n";
    for text in [
        String::new(),
        start.to_owned(),
        "[[supports]]\nat = 0.5\nposition = [0, 0, 0]".to_owned(),
        format!(
            "{start}[[supports]]\nat = 0.9\nposition = [0, 0, 0]\nhinge = \"xi\"\neuler = [0, 0, 0]"
        ),
        "[[links]]\nfrom = \"start\"\nto = 0.5\noffset = [0, 0.1, 0]".to_owned(),
        "[[loads.points]]\nat = 0\nforce = [0, 0, 1]".to_owned(),
    ] {
        assert!(Scenario::from_toml(&closed(&text)).is_ok(), "{text}");
    }
    for (text, message) in [
        (
            "[[supports]]\nat = \"start\"\nrotation = [0, 0, 0]\n[[supports]]\nat = \"end\"\nposition = [0, 0, 0]",
            "supports[1].at: found 1.0 (end) of a closed belt, must be \"start\", which is the same place",
        ),
        (
            "[[links]]\nfrom = 1.0\nto = 0.5\noffset = [0, 0.1, 0]",
            "links[0].from: found 1.0 (end) of a closed belt, must be \"start\", which is the same place",
        ),
        (
            "[[links]]\nfrom = 0.5\nto = \"end\"\noffset = [0, 0.1, 0]",
            "links[0].to: found 1.0 (end) of a closed belt, must be \"start\", which is the same place",
        ),
        (
            "[[loads.points]]\nat = \"end\"\nforce = [0, 0, 1]",
            "loads.points[0].at: found 1.0 (end) of a closed belt, must be \"start\", which is the same place",
        ),
    ] {
        assert_eq!(refusal(&closed(text)), message);
    }
}

#[test]
fn the_work_of_a_scenario_is_bounded() {
    let mut scenario = base();
    let straight = |rigidity| SegmentSpec::Straight {
        length: 1.0,
        natural_bend: None,
        rigidity: Some(rigidity),
    };
    let table = |entries: usize| {
        straight(Rigidity::Table(RigidityTable {
            u: (0..entries).map(|i| i as f64 / 1e4).collect(),
            value: vec![1.0; entries],
        }))
    };
    scenario.belt.segments = vec![table(10_000)];
    assert_eq!(scenario.validate(), Ok(()));
    scenario.belt.segments = vec![table(10_001)];
    let refused = |scenario: &Scenario| scenario.validate().unwrap_err().to_string();
    assert_eq!(
        refused(&scenario),
        "belt.segments[0].rigidity: found 10001 entries, must be at most 10000"
    );
    scenario = base();
    let link = LinkSpec {
        from: Place::Start,
        to: Place::End,
        offset: [0.0; 3],
    };
    scenario.links = vec![link; 101];
    assert_eq!(
        refused(&scenario),
        "links: found 101 links, must be at most 100"
    );
    scenario.links.truncate(100);
    assert_eq!(scenario.validate(), Ok(()));
    let load = PointLoad {
        at: Place::End,
        force: [0.0; 3],
        lever: [0.0; 3],
    };
    scenario.loads.points = vec![load; 10_001];
    assert_eq!(
        refused(&scenario),
        "loads.points: found 10001 point loads, must be at most 10000"
    );
    scenario.loads.points.truncate(10_000);
    assert_eq!(scenario.validate(), Ok(()));
    let layer = LayerSpec {
        material: "PET".into(),
        thickness: 1e-6,
    };
    (scenario.belt.rigidity, scenario.belt.layers) = (None, Some(vec![layer; 1001]));
    assert_eq!(
        refused(&scenario),
        "belt.layers: found 1001 layers, must be at most 1000"
    );
}

#[test]
fn elements_meet_at_every_break_of_the_belt() {
    let mut scenario = base();
    let length = 0.1 + 0.2 + 0.7;
    scenario.belt.segments = [0.1, 0.2, 0.7].map(SegmentSpec::straight).to_vec();
    scenario.loads.points = vec![PointLoad {
        // The arc length is the joint of the second and the third segment, by another sum.
        at: Place::ArcLength(0.3),
        force: [0.0; 3],
        lever: [0.0; 3],
    }];
    scenario.links = vec![LinkSpec {
        from: Place::ArcLength(0.9),
        to: Place::ArcLength(0.8),
        offset: [0.0; 3],
    }];
    let points = scenario.break_points();
    assert_eq!(points.len(), 6);
    assert_relative_eq!(points[2], 0.3, max_relative = 1e-12);
    assert_eq!(
        [points[0], points[1], points[3], points[4], points[5]],
        [0.0, 0.1, 0.8, 0.9, length]
    );
    scenario.solver.elements = Some(5);
    assert_eq!(scenario.validate(), Ok(()));
    scenario.solver.elements = Some(4);
    assert_eq!(
        scenario.validate().unwrap_err().to_string(),
        "solver.elements: found 4, must be at least 5, one a stretch between joints, supports, links and point loads"
    );
}

#[test]
fn rigidity_of_a_table_is_linear_between_entries_and_held_outside() {
    let table = RigidityTable {
        u: vec![0.1, 0.3, 0.4],
        value: vec![1.0, 3.0, 2.0],
    };
    for (u, value) in [
        (0.0, 1.0),
        (0.1, 1.0),
        (0.2, 2.0),
        (0.3, 3.0),
        (0.35, 2.5),
        (0.4, 2.0),
        (9.0, 2.0),
    ] {
        assert_relative_eq!(table.at(u), value, max_relative = 1e-14);
    }
}

#[test]
fn a_material_by_name_is_its_constants_written_out() {
    let belt = |source: &str| Scenario::from_toml(&edited(RIGIDITY, source)).unwrap().belt;
    let named = belt("material = { preset = \"PET\", thickness = 1e-4 }");
    let written =
        belt("material = { young = 4.9e9, poisson = 0.38, density = 1390, thickness = 1e-4 }");
    let layered = belt("layers = [{ material = \"pet\", thickness = 1e-4 }]");
    for same in [&written, &layered] {
        assert_eq!(named.own_rigidity(), same.own_rigidity());
        assert_eq!(named.poisson_value(), same.poisson_value());
        assert_eq!(named.density_value(), same.density_value());
    }
    assert_relative_eq!(named.density_value(), 1390.0 * 1e-5, max_relative = 1e-14);
    let softer =
        belt("material = { preset = \"PET\", thickness = 1e-4, young = 2.45e9, density = 0 }");
    assert_relative_eq!(
        softer.own_rigidity().unwrap(),
        0.5 * named.own_rigidity().unwrap(),
        max_relative = 1e-14
    );
    assert_eq!(softer.density_value(), 0.0);
}

#[test]
fn poissons_ratio_is_the_materials_else_the_belts_else_the_default() {
    let poisson = |source: &str| {
        let belt = Scenario::from_toml(&edited(RIGIDITY, source)).unwrap().belt;
        belt.poisson_value()
    };
    assert_eq!(poisson("rigidity = 1"), 0.3);
    assert_eq!(poisson("rigidity = 1\npoisson = 0.1"), 0.1);
    let sheet = "poisson = 0.1\nmaterial = { young = 1, poisson = 0.2, thickness = 1 }";
    assert_relative_eq!(poisson(sheet), 0.2, max_relative = 1e-14);
}

#[test]
fn natural_bend_of_a_segment_stands_in_for_that_of_the_belt() {
    let mut belt = base().belt;
    assert!(!belt.has_natural_bend());
    belt.natural_bend = 2.0;
    assert!(belt.has_natural_bend());
    let flat = SegmentSpec::Straight {
        length: 1.0,
        natural_bend: Some(0.0),
        rigidity: None,
    };
    let rigid = SegmentSpec::Rigid { length: 1.0 };
    assert_eq!(belt.natural_bend_of(&belt.segments[0]), 2.0);
    assert_eq!(belt.natural_bend_of(&flat), 0.0);
    assert_eq!(belt.natural_bend_of(&rigid), 0.0);
    belt.segments = vec![flat, rigid];
    assert!(!belt.has_natural_bend());
}

#[test]
fn every_part_of_the_schema_survives_a_round_trip_of_types() {
    let mut scenario = base();
    let table = RigidityTable {
        u: vec![0.0, 0.1],
        value: vec![1.0, 2.0],
    };
    scenario.belt.segments = vec![
        SegmentSpec::Arc {
            length: 0.5,
            curvature: 1.4,
            natural_bend: Some(1.0),
            rigidity: Some(Rigidity::Table(table)),
        },
        SegmentSpec::Corner { angle: FRAC_PI_2 },
        SegmentSpec::Rigid { length: 0.05 },
    ];
    scenario.supports[1].position =
        Some([Component::Free, Component::Held(1.0), Component::Held(2.0)]);
    scenario.supports[1].hinge = Some(Axis::Zeta);
    scenario.links = vec![LinkSpec {
        from: Place::ArcLength(0.2),
        to: Place::End,
        offset: [0.0, 0.3, 0.0],
    }];
    scenario.loads.gravity = Some([0.0, 0.0, -9.81]);
    scenario.loads.points = vec![PointLoad {
        at: Place::End,
        force: [0.0; 3],
        lever: [0.0, 0.0, 0.05],
    }];
    assert_eq!(
        serde_json::from_str::<Scenario>(&scenario.to_json()).unwrap(),
        scenario
    );
}

#[test]
fn an_error_carries_its_parts() {
    let error = Scenario::from_toml(&edited("width = 0.1", "widht = 0.1")).unwrap_err();
    assert_eq!(error.field(), Some("belt.widht"));
    let ScenarioError::UnknownField {
        nearest, allowed, ..
    } = error
    else {
        panic!("{error:?}");
    };
    assert_eq!(nearest.as_deref(), Some("width"));
    assert_eq!(allowed.len(), 11);
    assert_eq!(Scenario::from_toml("=").unwrap_err().field(), None);
}

#[test]
fn a_syntax_error_names_its_line() {
    assert_eq!(
        refusal("name = \"x\"\nwidth 3\n"),
        "line 2, column 7: key with no value, expected `=`"
    );
    assert_eq!(
        refusal("name = \"a\"\n\nname = \"b\"\n"),
        "line 3, column 1: duplicate key"
    );
    assert_eq!(
        refusal("é = 1"),
        "line 1, column 1: invalid unquoted key, expected letters, numbers, `-`, `_`"
    );
    let json = |text| Scenario::from_json(text).unwrap_err().to_string();
    assert_eq!(json("{\"name\":\n 1,}"), "line 2, column 4: trailing comma");
    assert_eq!(
        json("{\"name\": \"a\", \"name\": \"b\"}"),
        "line 1, column 26: duplicate key \"name\""
    );
    assert_eq!(
        json("{\"name\": 1e999}"),
        "line 1, column 14: number out of range"
    );
}

#[test]
fn an_empty_text_is_refused_with_the_least_scenario() {
    let least = r#"belt = { width = 0.1, rigidity = 1.0, segments = [{ kind = "straight", length = 1.0 }] }"#;
    for text in ["", " \n\t", "# a comment", "\u{feff}"] {
        assert_eq!(
            refusal(text),
            format!("scenario: found an empty text, must be at least {least}")
        );
    }
    let least = r#"{"belt": {"width": 0.1, "rigidity": 1.0, "segments": [{"kind": "straight", "length": 1.0}]}}"#;
    for text in ["", "\n", "{}"] {
        let error = Scenario::from_json(text).unwrap_err().to_string();
        assert_eq!(
            error,
            format!("scenario: found an empty text, must be at least {least}")
        );
    }
    assert!(Scenario::from_json(least).is_ok());
}

#[test]
fn null_in_json_stands_for_a_field_left_out() {
    let text = r#"{"belt": {"width": 0.1, "rigidity": 1, "material": null, "segments": [{"kind": "straight", "length": 1}]}}"#;
    assert_eq!(Scenario::from_json(text).unwrap().belt.material, None);
    let required = text.replace("0.1", "null");
    let error = Scenario::from_json(&required).unwrap_err().to_string();
    assert_eq!(error, "belt.width: found null, must be a number");
}

#[test]
fn a_byte_order_mark_is_skipped() {
    assert_eq!(
        Scenario::from_toml(&format!("\u{feff}{BASE}")).unwrap(),
        base()
    );
    assert_eq!(
        Scenario::from_json(&format!("\u{feff}{}", base().to_json())).unwrap(),
        base()
    );
}

#[test]
fn a_text_that_is_too_long_is_refused_unread() {
    let toml = "#".repeat(LONGEST_TOML + 1);
    assert_eq!(
        refusal(&toml),
        "scenario: found 2000001 bytes, must be a text of at most 2000000 bytes"
    );
    let json = " ".repeat(LONGEST_JSON + 1);
    let error = Scenario::from_json(&json).unwrap_err().to_string();
    assert_eq!(
        error,
        "scenario: found 16000001 bytes, must be a text of at most 16000000 bytes"
    );
}

#[test]
fn deep_nesting_is_refused_and_does_not_overflow_the_stack() {
    let deep = 100_000;
    for text in [
        format!("a = {}", "[".repeat(deep)),
        format!("a = {}", "{ a = ".repeat(deep)),
        format!("{}a = 1", "a.".repeat(deep)),
        format!("[{}a]", "a.".repeat(deep)),
        format!("[[{}a]]", "a.".repeat(deep)),
    ] {
        assert!(matches!(
            Scenario::from_toml(&text),
            Err(ScenarioError::Syntax { .. })
        ));
    }
    for text in ["[".repeat(deep), r#"{"a":"#.repeat(deep)] {
        assert!(matches!(
            Scenario::from_json(&text),
            Err(ScenarioError::Syntax { .. })
        ));
    }
}

#[test]
fn a_long_word_is_cut_in_the_message() {
    let long = refusal(&edited(
        "energy = \"sadowsky\"",
        &format!("energy = \"{}\"", "é".repeat(1000)),
    ));
    assert_eq!(
        long,
        format!(
            "energy: found \"{}…\", allowed: fishbone, sadowsky, wunderlich, shell",
            "é".repeat(60)
        )
    );
}

#[test]
fn segments_and_supports_are_limited() {
    let refusal = |scenario: &Scenario| scenario.validate().unwrap_err().to_string();
    let mut scenario = base();
    scenario.belt.segments = vec![SegmentSpec::straight(1e-4); 10_001];
    let most = "belt.segments: found 10001 segments, must be at most 10000";
    assert_eq!(refusal(&scenario), most);
    scenario.belt.segments.pop();
    scenario.solver.elements = None;
    assert_eq!(scenario.validate(), Ok(()));

    let mut scenario = base();
    let clamp = scenario.supports[0].clone();
    let support = |i: usize| SupportSpec {
        at: Place::ArcLength(i as f64 * 0.005),
        ..clamp.clone()
    };
    scenario.supports = (0..101).map(support).collect();
    let most = "supports: found 101 supports, must be at most 100";
    assert_eq!(refusal(&scenario), most);
    scenario.supports.pop();
    scenario.solver.elements = None;
    assert_eq!(scenario.validate(), Ok(()));
}

/// Writes the schema instead of comparing where `FISHBONE_WRITE_SCHEMA` is set.
#[test]
fn the_committed_schema_is_the_generated_one() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../scenarios/scenario.schema.json"
    );
    if std::env::var_os("FISHBONE_WRITE_SCHEMA").is_some() {
        std::fs::write(path, json_schema()).unwrap();
    }
    let committed = std::fs::read_to_string(path).unwrap();
    assert_eq!(
        committed,
        json_schema(),
        "run FISHBONE_WRITE_SCHEMA=1 cargo test -p fishbone schema"
    );
}

/// Any text of the base and the shipped scenarios.
fn any_valid_text() -> impl Strategy<Value = String> {
    let mut texts: Vec<String> = SHIPPED.iter().map(|(_, text)| (*text).to_owned()).collect();
    texts.push(BASE.to_owned());
    prop::sample::select(texts)
}

/// One replacement of a stretch of bytes: place (as a fraction), length, new bytes.
fn any_edit() -> impl Strategy<Value = (f64, usize, Vec<u8>)> {
    let pieces = [
        "nan",
        "inf",
        "-0",
        "1e308",
        "1e-320",
        "[",
        "]",
        "{",
        "}",
        "\"",
        "'",
        "=",
        ".",
        ",",
        "\n",
        "\\u",
        "é",
        "\0",
        "[[",
        "]]",
        "99999999999999999999999999",
        "1979-05-27",
        "\"free\"",
        "kind = \"arc\"",
        "at = 0.5",
        "0x1",
        "true",
    ];
    let piece = prop_oneof![
        prop::sample::select(pieces.to_vec()).prop_map(|piece| piece.as_bytes().to_vec()),
        prop::collection::vec(any::<u8>(), 0..4),
    ];
    (0.0..1.0, 0_usize..12, piece)
}

fn mutated(text: &str, edits: &[(f64, usize, Vec<u8>)]) -> String {
    let mut bytes = text.as_bytes().to_vec();
    for (place, removed, inserted) in edits {
        let start = (place * bytes.len() as f64) as usize;
        let end = (start + removed).min(bytes.len());
        bytes.splice(start..end, inserted.iter().copied());
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// A result is a valid scenario that survives a round trip, or an error of one line.
fn assert_sound(result: Result<Scenario, ScenarioError>) {
    match result {
        Ok(scenario) => assert_eq!(Scenario::from_json(&scenario.to_json()), Ok(scenario)),
        Err(error) => {
            let message = error.to_string();
            assert!(
                !message.contains(char::is_control) && message.contains(": "),
                "{message:?}"
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let text = String::from_utf8_lossy(&bytes);
        assert_sound(Scenario::from_toml(&text));
        assert_sound(Scenario::from_json(&text));
    }

    #[test]
    fn a_mutated_toml_never_panics(text in any_valid_text(), edits in prop::collection::vec(any_edit(), 1..4)) {
        assert_sound(Scenario::from_toml(&mutated(&text, &edits)));
    }

    #[test]
    fn a_mutated_json_never_panics(text in any_valid_text(), edits in prop::collection::vec(any_edit(), 1..4)) {
        let json = Scenario::from_toml(&text).unwrap().to_json();
        assert_sound(Scenario::from_json(&mutated(&json, &edits)));
    }

    #[test]
    fn any_numbers_survive_a_round_trip(
        width in 1e-3..1e3_f64,
        rigidity in prop::num::f64::POSITIVE,
        position in prop::array::uniform3(prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO),
        rotation in prop::array::uniform3(-10.0..10.0_f64),
    ) {
        let mut scenario = base();
        scenario.belt.width = width;
        scenario.belt.rigidity = Some(rigidity);
        scenario.supports[1].position = Some(position.map(Component::Held));
        scenario.supports[1].rotation = Some(rotation);
        match scenario.validate() {
            Ok(()) => prop_assert_eq!(Scenario::from_json(&scenario.to_json()), Ok(scenario)),
            Err(error) => {
                let far = position.iter().any(|x| x.abs() > 1e6);
                prop_assert!(!(1e-100..=1e100).contains(&rigidity) || far, "{}", error);
            }
        }
    }
}

#[test]
fn the_sources_own_method_takes_plain_belts_between_two_clamps() {
    let ritz = edited("\"intrinsic\"", "\"ritz\"");
    assert!(Scenario::from_toml(&ritz).is_ok());
    let two = format!("{HALF}, {HALF}");
    assert!(Scenario::from_toml(&ritz.replace(STRAIGHT, &two)).is_ok());
    let arc = "{ kind = \"arc\", length = 1, curvature = 1 }";
    let varied = "{ kind = \"straight\", length = 0.5, rigidity = 2 }, { kind = \"straight\", length = 0.5 }";
    let clamps = "both ends alone held in position and orientation with square ribs";
    let not_clamped = "other supports than two clamped ends";
    for (from, to, found, cure) in [
        (
            STRAIGHT,
            arc,
            "a belt that is not straight",
            "straight segments alone",
        ),
        (STRAIGHT, varied, "a rigidity that varies", "one rigidity"),
        (
            RIGIDITY,
            "rigidity = 1\nnatural_bend = 1",
            "a natural bend",
            "a natural bend of 0",
        ),
        (
            "[solver]",
            "[[links]]\nfrom = 0\nto = 0.5\noffset = [0, 0, 0]\n[solver]",
            "links",
            "no links",
        ),
        (
            "[solver]",
            "[[loads.points]]\nat = 0.5\nforce = [0, 0, 1]\n[solver]",
            "loads",
            "no loads",
        ),
        (
            END_ROTATION,
            "0.1]\nrotation = [0, 0, 0]\nhinge = \"xi\"",
            "a hinge",
            "no hinges",
        ),
        (
            "at = \"end\"",
            "at = \"end\"\nsquare_rib = false",
            not_clamped,
            clamps,
        ),
        (
            "at = \"end\"",
            "at = 0.5\nsquare_rib = true",
            not_clamped,
            clamps,
        ),
    ] {
        let message = format!(
            "solver.method: found \"ritz\" with {found}, must be \"intrinsic\", or have {cure}"
        );
        assert_eq!(refusal(&ritz.replace(from, to)), message);
    }
    let ring = closed("[solver]\nmethod = \"ritz\"");
    assert_eq!(
        refusal(&ring),
        "solver.method: found \"ritz\" with a closed belt, must be \"intrinsic\", or have an open belt"
    );
}

#[test]
fn numbers_of_extreme_magnitude_are_refused() {
    assert_refusals(&[
        (
            RIGIDITY,
            "rigidity = 1e308",
            "belt.rigidity: found 1e308, must be from 1e-100 to 1e100",
        ),
        (
            "width = 0.1",
            "width = 1e-300",
            "belt.width: found 1e-300, must be from 1e-100 to 1e100",
        ),
        (
            "position = [0.0, 0.5, 0.1]",
            "position = [0.0, 1e7, 0.1]",
            "supports[1].position[1]: found 10000000.0, must be within 1e6 lengths of the belt",
        ),
        (
            END_ROTATION,
            "0.1]\nrotation = [0, 1e200, 0]",
            "supports[1].rotation: found 1e200, must be angles of at most 1e6 rad",
        ),
        (
            STRAIGHT,
            "{ kind = \"straight\", length = 1.0 }, { kind = \"straight\", length = 1e-12 }",
            "belt.segments[1].length: found 1e-12, must be more than 1e-9 of the belt's length",
        ),
    ]);
}
