use super::*;
use crate::geometry::exp;
use crate::scenario::{BeltSpec, Place, Rigidity, RigidityTable, SegmentSpec};
use stagewise::{Multipliers, Program, Residuals};
use std::f64::consts::PI;

fn scenario() -> Scenario {
    let belt = BeltSpec::new(0.1, 2.0, vec![SegmentSpec::straight(1.0)]);
    let held = |position: [f64; 3]| Some(position.map(Component::Held));
    Scenario {
        supports: vec![
            SupportSpec {
                position: held([3.0, 0.0, 0.0]),
                rotation: Some([0.0; 3]),
                ..SupportSpec::new(Place::Start)
            },
            SupportSpec {
                position: held([3.0, 0.6, 0.0]),
                euler: Some([0.1, 0.0, 0.0]),
                ..SupportSpec::new(Place::End)
            },
        ],
        ..Scenario::new(belt)
    }
}

fn problem() -> Problem {
    Problem::new(scenario()).unwrap()
}

#[test]
fn test_invalid_scenarios_are_no_problem() {
    type Spoil = fn(&mut Scenario);
    let cases: [(&str, Spoil); 20] = [
        ("belt.width", |s| s.belt.width = -0.1),
        ("belt.width", |s| s.belt.width = 0.0),
        ("belt.width", |s| s.belt.width = f64::NAN),
        ("belt.segments", |s| s.belt.segments.clear()),
        ("belt.segments", |s| {
            s.belt.segments = vec![SegmentSpec::Rigid { length: 1.0 }];
        }),
        ("belt.segments[0].length", |s| {
            s.belt.segments[0] = SegmentSpec::straight(-1.0);
        }),
        ("belt.segments[0].rigidity", |s| {
            s.belt.segments[0] = SegmentSpec::Straight {
                length: 1.0,
                natural_bend: None,
                rigidity: Some(Rigidity::Table(RigidityTable {
                    u: Vec::new(),
                    value: Vec::new(),
                })),
            };
        }),
        ("belt", |s| s.belt.rigidity = None),
        ("belt.rigidity", |s| s.belt.rigidity = Some(f64::INFINITY)),
        ("belt.density", |s| s.belt.density = -1.0),
        ("belt.half_turns", |s| s.belt.half_turns = Some(1)),
        ("supports[1].position[0]", |s| {
            s.supports[1].position = Some([Component::Held(f64::NAN); 3]);
        }),
        ("supports[1].euler[2]", |s| {
            s.supports[1].euler = Some([0.0, 0.0, f64::NAN]);
        }),
        ("supports[1].at", |s| {
            s.supports[1].at = Place::ArcLength(7.0)
        }),
        ("supports[1].at", |s| s.supports.swap(0, 1)),
        ("loads.gravity[0]", |s| {
            s.loads.gravity = Some([f64::NAN; 3]);
        }),
        ("solver.elements", |s| s.solver.elements = Some(0)),
        ("solver.tolerance", |s| s.solver.tolerance = 0.0),
        ("solver.bulge", |s| s.solver.bulge = [0.0; 3]),
        ("solver.method", |s| {
            s.solver.method = Method::Ritz;
            s.supports[1].position = None;
        }),
    ];
    for (field, spoil) in cases {
        let mut spoiled = scenario();
        spoil(&mut spoiled);
        let refused = Problem::new(spoiled).expect_err(field);
        assert_eq!(refused.field(), Some(field), "{refused}");
    }
}

#[test]
fn test_units_are_length_and_mean_rigidity_over_it() {
    let mut scenario = scenario();
    scenario.belt.segments = vec![SegmentSpec::straight(4.0)];
    let units = Problem::new(scenario).unwrap().units();
    assert_eq!(
        (units.length, units.energy, units.force()),
        (4.0, 0.5, 0.125)
    );
}

#[test]
fn test_programme_has_its_origin_at_the_first_support() {
    let problem = problem();
    assert_eq!(problem.origin(), Vector3::new(3.0, 0.0, 0.0));
    let program = problem.program(problem.elements());
    assert_eq!(program.supports[1].position, [0.0, 0.6, 0.0].map(Some));
}

#[test]
fn test_support_is_moved_to_a_pose_and_to_nothing_else() {
    let pose = Pose {
        frame: exp(&Vector3::new(0.3, -0.2, 0.1)),
        position: Vector3::new(3.0, 0.5, 0.1),
    };
    let moved = problem().with_support_pose(1, &pose).unwrap();
    let held = moved.clamp(1).unwrap();
    assert!((held.frame - pose.frame).norm() < 1e-15);
    assert_eq!(held.position, pose.position);
    let mut back = moved.scenario().clone();
    back.supports[1] = scenario().supports[1].clone();
    assert_eq!(back, scenario());
}

#[test]
fn test_pose_that_no_support_may_have_is_refused() {
    let at = |x: f64, turn: f64| Pose {
        frame: turn * exp(&Vector3::x()),
        position: Vector3::new(x, 0.0, 0.0),
    };
    let cases = [
        (0, at(f64::NAN, 1.0), "supports[0].position[0]"),
        (1, at(f64::INFINITY, 1.0), "supports[1].position[0]"),
        (1, at(1e7, 1.0), "supports[1].position[0]"),
        (1, at(0.0, f64::NAN), "supports[1].rotation"),
        (1, at(0.0, 0.9), "supports[1].rotation"),
        (1, at(0.0, -1.0), "supports[1].rotation"),
        (2, at(0.0, 1.0), "supports[2]"),
    ];
    for (support, pose, field) in cases {
        let refused = problem().with_support_pose(support, &pose).unwrap_err();
        assert_eq!(refused.field(), Some(field));
    }
}

#[test]
fn test_position_and_rotation_vector_are_refused_as_by_a_scenario() {
    let (level, here) = (Vector3::zeros(), Vector3::new(3.0, 0.0, 0.0));
    let cases = [
        (f64::NAN * here, level),
        (f64::INFINITY * here, level),
        (1e300 * here, level),
        (1e7 * here, level),
        (here, Vector3::new(0.0, f64::NAN, 0.0)),
        (here, Vector3::new(0.0, 1e300, 0.0)),
        (here, Vector3::new(0.0, -1.1e6, 0.0)),
    ];
    for (position, rotation) in cases {
        let mut scenario = problem().scenario().clone();
        let support = &mut scenario.supports[1];
        support.position = Some([0, 1, 2].map(|i| Component::Held(position[i])));
        support.rotation = Some(rotation.into());
        (support.euler, support.quaternion) = (None, None);
        let refused = scenario.validate().unwrap_err();
        let checked = problem().check_support_pose(1, Some(&position), Some(&rotation));
        assert_eq!(checked, Err(refused));
    }
    let turned = Vector3::new(0.0, 7.0, 0.0);
    assert_eq!(
        problem().check_support_pose(1, Some(&here), Some(&turned)),
        Ok(())
    );
    assert!(problem().check_support_pose(2, Some(&here), None).is_err());
}

#[test]
fn test_mesh_of_another_number_of_elements_is_another_problem() {
    let fine = problem().with_elements(200).unwrap();
    assert_eq!((fine.elements(), problem().elements()), (200, 80));
    let refused = problem().with_elements(3).unwrap_err();
    assert_eq!(refused.field(), Some("solver.elements"));
}

#[test]
fn test_clamp_holds_all_of_a_pose() {
    let mut scenario = scenario();
    scenario.supports[1].position =
        Some([Component::Held(3.0), Component::Free, Component::Held(0.0)]);
    let problem = Problem::new(scenario).unwrap();
    assert_eq!(problem.clamp(0).unwrap().position.x, 3.0);
    assert_eq!((problem.clamp(1), problem.clamp(2)), (None, None));
}

#[test]
fn test_rounding_of_forces_hides_no_residual() {
    let program = problem().program(16);
    let of = |stationarity: f64, force: f64| {
        let residuals = Residuals {
            stationarity,
            constraint: 0.0,
            complementarity: 0.0,
        };
        let multipliers = Multipliers {
            equalities: vec![-force; 12],
            inequalities: Vec::new(),
        };
        program.judged(residuals, &multipliers).stationarity
    };
    assert_eq!(of(1.0, 1e5), 1.0);
    assert!((1.0 - of(1.0, 1e9) - 4.44e-6).abs() < 1e-8);
    assert!(of(1.0, 1e30) >= 0.999);
    assert_eq!(of(1e-6, 1e9), 0.0);
    assert!(
        [1e5, 1e9, 1e30]
            .iter()
            .all(|force| of(f64::NAN, *force).is_nan())
    );
}

#[test]
fn test_supports_out_of_reach_are_named_with_the_missing_length() {
    assert_eq!(problem().unreachable_supports(), None);
    let pose = Pose {
        frame: exp(&(PI * Vector3::x())),
        position: Vector3::new(3.0, 1.25, 0.0),
    };
    let apart = problem().with_support_pose(1, &pose).unwrap();
    let too_far = apart.unreachable_supports().unwrap();
    assert_eq!((too_far.distance, too_far.belt), (1.25, 1.0));
    assert_eq!(
        too_far.to_string(),
        "supports[0] and supports[1], at u = 0 and u = 1, are 1.25 apart, 0.25 more than the belt between them (1); move them \
         closer"
    );
}

#[test]
fn test_twist_without_slack_is_out_of_reach_by_the_slack_that_it_needs() {
    let twisted = |y: f64, angle: f64| {
        let pose = Pose {
            frame: exp(&(angle * Vector3::y())),
            position: Vector3::new(3.0, y, 0.0),
        };
        let problem = problem().with_support_pose(1, &pose).unwrap();
        problem.unreachable_supports()
    };
    // Ends of width V a length L apart, turned by θ: the diagonal of a corner is √(D² + V²/2 (1 − cos θ)) ≤ L.
    let (width, angle) = (0.1f64, 0.5 * PI);
    let reach = (1.0 - 0.5 * width * width * (1.0 - angle.cos())).sqrt();
    let refused = twisted(1.0, angle).unwrap();
    assert!((refused.closer - (1.0 - reach)).abs() < 1e-12);
    assert!(refused.to_string().starts_with(
        "supports[0] and supports[1], at u = 0, v = 0.05 and u = 1, v = 0.05, are 1.002497 apart"
    ));
    assert!(twisted(reach + 1e-9, angle).is_some());
    assert_eq!(twisted(reach - 1e-9, angle), None);
    assert_eq!(twisted(1.0, 0.0), None);
}

#[test]
fn test_link_that_takes_up_the_slack_is_out_of_reach() {
    let linked = |offset: [f64; 3]| {
        let mut scenario = scenario();
        scenario.links = vec![crate::scenario::LinkSpec {
            from: Place::ArcLength(0.3),
            to: Place::ArcLength(0.7),
            offset,
        }];
        Problem::new(scenario).unwrap().unreachable_supports()
    };
    // The ends are 0.6 apart along y: a link that goes back by d leaves 0.6 + d for the 0.6 of belt outside it.
    assert_eq!(linked([0.0, 0.001, 0.0]), None);
    let refused = linked([0.0, -0.1, 0.0]).unwrap();
    assert!((refused.closer - 0.1).abs() < 1e-12);
    assert!(refused.held.contains("less the offset of links[0]"));
}
