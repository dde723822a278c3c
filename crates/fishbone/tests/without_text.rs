//! Scenarios and paths made of Rust's types alone: with the feature `io` and without it.

use approx::assert_relative_eq;
use fishbone::analysis::path::{Change, NoPath, Path};
use fishbone::problem::Problem;
use fishbone::scenario::{BeltSpec, Component, Place, Scenario, SegmentSpec, SupportSpec};
use fishbone::solve::solve;
use std::ops::ControlFlow;

fn clamp(at: Place, position: [f64; 3]) -> SupportSpec {
    SupportSpec {
        position: Some(position.map(Component::Held)),
        rotation: Some([0.0; 3]),
        ..SupportSpec::new(at)
    }
}

/// A belt whose ends face each other at this distance: the planar elastica.
fn elastica(distance: f64) -> Scenario {
    Scenario {
        supports: vec![
            clamp(Place::Start, [0.0; 3]),
            clamp(Place::End, [0.0, distance, 0.0]),
        ],
        ..Scenario::new(BeltSpec::new(0.1, 1.0, vec![SegmentSpec::straight(1.0)]))
    }
}

#[test]
fn test_a_scenario_made_of_types_is_solved() {
    let problem = Problem::new(elastica(0.6)).unwrap();
    let equilibrium = solve(&problem, &mut || ControlFlow::Continue(()));
    assert_relative_eq!(equilibrium.energy, 17.6586, epsilon = 1e-4);
    assert_relative_eq!(
        equilibrium.highest_point().position.x,
        0.3487,
        epsilon = 1e-4
    );
}

#[test]
fn test_a_scenario_made_of_types_is_checked() {
    let mut scenario = elastica(0.6);
    scenario.belt.width = -0.1;
    let refused = Problem::new(scenario).unwrap_err();
    let text = "belt.width: found -0.1, must be a positive finite number";
    assert_eq!(refused.to_string(), text);
}

/// A change of the distance of the ends, from its value in the path's first problem.
#[derive(Debug)]
struct Approach {
    to: f64,
}

impl Change for Approach {
    fn problem(&self, base: &Problem, place: f64) -> Result<Problem, NoPath> {
        let from = base.scenario().supports[1].point().ok_or(NoPath::Nothing)?;
        let scenario = elastica(from.y + place * (self.to - from.y));
        Problem::new(scenario).map_err(NoPath::Invalid)
    }
}

#[test]
fn test_a_path_goes_through_scenarios_made_of_types() {
    let base = Problem::new(elastica(0.6)).unwrap();
    let path = Path::new(&base, Approach { to: 0.4 }).unwrap();
    let halfway = path.at(0.5).unwrap();
    assert_relative_eq!(halfway.scenario().supports[1].point().unwrap().y, 0.5);
    let refused = Path::new(&base, Approach { to: f64::NAN }).unwrap_err();
    assert!(matches!(refused, NoPath::Invalid(_)), "{refused}");
}
