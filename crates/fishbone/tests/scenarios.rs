//! The shipped scenarios, solved: the golden cases of every suite.

use fishbone::analysis::modes::NoModes;
use fishbone::analysis::sensitivity::NoSensitivity;
use fishbone::equilibrium::{Equilibrium, Status, Uncertified};
use fishbone::problem::Problem;
use fishbone::scenario::Scenario;
use fishbone::solve::{NoShape, solve, solve_from};
use std::ops::ControlFlow;

fn solved(text: &str) -> Equilibrium {
    let problem = Problem::new(Scenario::from_toml(text).unwrap()).unwrap();
    solve(&problem, &mut || ControlFlow::Continue(()))
}

/// Asserts a converged minimum: residuals, supports and bounds, independently of the solver's own report.
fn assert_minimum(equilibrium: &Equilibrium) {
    assert_eq!(
        equilibrium.status,
        Status::Converged,
        "{}",
        equilibrium.message
    );
    assert_eq!(equilibrium.stable(), Some(true));
    assert!(equilibrium.residuals.largest() <= 1e-8);
    let (spine, scenario) = (&equilibrium.spine, equilibrium.scenario());
    for (support, pose) in scenario
        .supports
        .iter()
        .zip([spine.pose[0], spine.pose[spine.u.len() - 1]])
    {
        let length = spine.length();
        assert!((pose.position - support.point().unwrap()).norm() <= 1e-7 * length);
        assert!((pose.frame - support.frame().unwrap()).norm() <= 1e-7);
    }
    for k in 1..spine.u.len() {
        let rate = (spine.rib_slope[k] - spine.rib_slope[k - 1]) / (spine.u[k] - spine.u[k - 1]);
        assert!(rate.abs() <= 2.0 / spine.width);
    }
}

fn assert_near(value: f64, expected: f64, tolerance: f64) {
    assert!(
        (value - expected).abs() <= tolerance,
        "{value} for {expected}"
    );
}

#[test]
fn test_example_1_is_that_of_an_independent_solver() {
    let equilibrium = solved(include_str!("../../../scenarios/example1.toml"));
    assert_minimum(&equilibrium);
    assert_near(equilibrium.energy, 23.50, 0.05);
    assert_near(equilibrium.highest_point().position.x, 0.369, 5e-4);
}

#[test]
fn test_example_2_is_that_of_an_independent_solver() {
    let equilibrium = solved(include_str!("../../../scenarios/example2.toml"));
    assert_minimum(&equilibrium);
    assert_near(equilibrium.energy, 18.95, 0.05);
    let peak = equilibrium.highest_point().position;
    assert_near(peak.x, 0.294, 0.005);
    assert_near(peak.y, 0.43, 0.01);
    assert_near(peak.z, -0.067, 0.005);
}

#[test]
fn test_polystyrene_sheet_is_example_1_in_si_with_the_energy_of_its_thickness() {
    let equilibrium = solved(include_str!("../../../scenarios/polystyrene.toml"));
    assert_minimum(&equilibrium);
    let rigidity = 3.2e9 * 140e-6f64.powi(3) * 0.02 / (12.0 * (1.0 - 0.34f64.powi(2)));
    // That of shell finite elements; a developable plate has 23.60.
    assert_near(equilibrium.energy * 0.2 / rigidity, 22.974, 0.003 * 22.974);
    assert_near(equilibrium.highest_point().position.x / 0.2, 0.3685, 3e-3);
}

#[test]
fn test_planar_and_twisted_belts_converge_to_minima() {
    let planar = solved(include_str!("../../../scenarios/planar.toml"));
    assert_minimum(&planar);
    assert!(
        planar
            .spine
            .rib_slope
            .iter()
            .all(|slope| slope.abs() < 1e-9)
    );
    let twisted = solved(include_str!("../../../scenarios/twist.toml"));
    assert_minimum(&twisted);
    assert!(twisted.spine.twist() > 1.0);
}

/// Converged values of a scenario on ever finer meshes: energy, to a thousandth, and highest point in U.
struct Golden {
    text: &'static str,
    energy: f64,
    highest: [f64; 3],
}

#[test]
fn test_boards_loads_curls_and_closed_belts_are_those_of_finer_meshes() {
    let golden = [
        Golden {
            text: include_str!("../../../scenarios/bent.toml"),
            energy: 11.536,
            highest: [0.2955, 0.3708, -0.0224],
        },
        Golden {
            text: include_str!("../../../scenarios/curved.toml"),
            energy: 12.867,
            highest: [0.3077, 0.3062, 0.1438],
        },
        Golden {
            text: include_str!("../../../scenarios/hinge.toml"),
            energy: 1.2775e-4,
            highest: [-0.0208, 0.2551, 0.3309],
        },
        Golden {
            text: include_str!("../../../scenarios/cantilever.toml"),
            energy: -5.2392e-5,
            highest: [0.0305, 0.0987, 0.0197],
        },
        Golden {
            text: include_str!("../../../scenarios/curl.toml"),
            energy: -7.289,
            highest: [-0.3168, -0.0213, 0.2170],
        },
    ];
    for case in golden {
        let equilibrium = solved(case.text);
        let message = &equilibrium.message;
        assert_eq!(equilibrium.status, Status::Converged, "{message}");
        assert_eq!(equilibrium.stable(), Some(true), "{message}");
        assert!(equilibrium.warnings().is_empty());
        assert!(equilibrium.residuals.largest() <= 1e-8);
        assert_near(equilibrium.energy, case.energy, 1e-3 * case.energy.abs());
        let highest = equilibrium.highest_point().position / equilibrium.spine.length();
        for (value, expected) in highest.iter().zip(case.highest) {
            assert_near(*value, expected, 1e-3);
        }
    }
}

#[test]
fn test_moebius_band_has_the_published_energy() {
    let equilibrium = solved(include_str!("../../../scenarios/mobius.toml"));
    assert_eq!(equilibrium.status, Status::Converged);
    assert_eq!(equilibrium.stable(), Some(true));
    // The published energy is 18.63 half-widths, by Starostin & van der Heijden.
    assert_near(
        equilibrium.energy * 30.0 / std::f64::consts::PI,
        18.63,
        0.01,
    );
}

#[test]
fn test_solves_are_identical_bit_by_bit() {
    let text = include_str!("../../../scenarios/example2.toml");
    assert_eq!(solved(text).to_json(), solved(text).to_json());
}

#[test]
fn test_the_sources_own_method_never_calls_its_compromise_converged() {
    let text = include_str!("../../../scenarios/example1.toml");
    let equilibrium = solved(&format!("{text}\n[solver]\nmethod = \"ritz\"\n"));
    assert_eq!(equilibrium.status, Status::NotConverged);
    assert_eq!(
        (equilibrium.stable(), equilibrium.reactions.len()),
        (None, 0)
    );
    assert!(equilibrium.residuals.constraint > 1e-2);
    assert_near(equilibrium.highest_point().position.x, 0.35, 5e-3);
    let uncertified = Uncertified::NoMultipliers;
    let modes = equilibrium.modes(1, &mut || ControlFlow::Continue(()));
    assert_eq!(modes, Err(NoModes::Uncertified(uncertified.clone())));
    let derivatives = equilibrium.sensitivity().map(drop);
    assert_eq!(derivatives, Err(NoSensitivity::Uncertified(uncertified)));
}

#[test]
fn test_supports_out_of_reach_are_infeasible_by_the_missing_length() {
    let text = include_str!("../../../scenarios/example1.toml");
    let equilibrium = solved(&text.replace("[0.0, 0.5, 0.1]", "[0.0, 1.25, 0.0]"));
    assert_eq!(equilibrium.status, Status::Infeasible);
    assert!(
        equilibrium.message.contains("0.25"),
        "{}",
        equilibrium.message
    );
}

#[test]
fn test_caller_ends_a_solve() {
    let scenario = Scenario::from_toml(include_str!("../../../scenarios/example1.toml")).unwrap();
    let equilibrium = solve(&Problem::new(scenario).unwrap(), &mut || {
        ControlFlow::Break(())
    });
    assert_eq!(
        (equilibrium.status, equilibrium.iterations),
        (Status::NotConverged, 0)
    );
}

#[test]
fn test_belts_near_the_inextensible_limit_are_warned_of_and_belts_with_slack_are_solved() {
    let text = include_str!("../../../scenarios/planar.toml");
    let at = |distance: f64| {
        solved(&text.replace("[0.0, 0.6, 0.0]", &format!("[0.0, {distance}, 0.0]")))
    };
    let fits = at(0.9999);
    assert_minimum(&fits);
    assert!(fits.warnings().is_empty());
    // At small amplitude E = 4π² (1 − d), and the force is Euler's load.
    let load = 4.0 * std::f64::consts::PI.powi(2);
    assert_near(fits.energy, load * 1e-4, 1e-6 * load);
    assert_near(fits.reactions[1].wrench.force.y, -load, 1e-3 * load);
    let loose = solved(&format!(
        "{}\n[solver]\ntolerance = 1e-2\n",
        text.replace("[0.0, 0.6, 0.0]", "[0.0, 0.9999, 0.0]")
    ));
    assert_near(loose.reactions[1].wrench.force.y, -load, 0.1 * load);
    let without_slack = at(1.0);
    assert_eq!(without_slack.status, Status::Converged);
    let warnings = without_slack.warnings();
    assert!(warnings[0].contains("not determined"), "{warnings:?}");
    let force = without_slack.reactions[1].wrench.force;
    assert!(force.x.abs() < 1e-6 && force.y.is_nan(), "{force}");
}

#[test]
fn test_belt_that_may_slide_along_itself_is_not_called_a_saddle() {
    let text = include_str!("../../../scenarios/planar.toml");
    let closed = solved(&text.replace("[0.0, 0.6, 0.0]", "[0.0, 0.0, 0.0]"));
    assert_eq!((closed.status, closed.stable()), (Status::Converged, None));
}

#[test]
fn test_finer_mesh_shows_the_same_shape() {
    // This belt has another minimum at a quarter of the energy.
    let text = include_str!("../../../scenarios/planar.toml").replace(
        "position = [0.0, 0.6, 0.0]\nrotation = [0.0, 0.0, 0.0]",
        "position = [0.5, -0.06, -0.02]\nrotation = [0.37, -0.55, 0.11]",
    );
    let on = |elements: usize| solved(&format!("{text}\n[solver]\nelements = {elements}\n"));
    let (coarse, fine) = (on(80), on(320));
    assert_minimum(&coarse);
    assert_minimum(&fine);
    assert_near(fine.energy / coarse.energy, 1.0, 0.01);
}

#[test]
fn test_caller_ends_a_solve_by_one_break() {
    // The end is hardly within reach, so that the search passes through its restoration.
    let text = include_str!("../../../scenarios/planar.toml")
        .replace("[0.0, 0.6, 0.0]", "[0.0, 0.7, 0.62]");
    let problem = Problem::new(Scenario::from_toml(&text).unwrap()).unwrap();
    for last in 1..40 {
        let mut asked = 0;
        let equilibrium = solve(&problem, &mut || {
            asked += 1;
            if asked == last {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        assert_eq!(equilibrium.status, Status::NotConverged);
        assert!(
            equilibrium.message.contains("interrupted") || asked < last,
            "{}",
            equilibrium.message
        );
        assert!(asked <= last);
    }
}

#[test]
fn test_solve_from_a_shape_ends_in_its_equilibrium_and_refuses_invalid_shapes() {
    let scenario = Scenario::from_toml(include_str!("../../../scenarios/planar.toml")).unwrap();
    let problem = Problem::new(scenario).unwrap();
    let from = |bend: &[f64], slope: &[f64]| {
        solve_from(&problem, bend, slope, &mut || ControlFlow::Continue(()))
    };
    let found = solve(&problem, &mut || ControlFlow::Continue(()));
    let again = from(&found.spine.bend, &found.spine.rib_slope).unwrap();
    assert_near(again.energy, found.energy, 1e-8 * found.energy);
    let lengths = |bend, rib_slope| NoShape::Lengths { bend, rib_slope };
    assert_eq!(from(&[0.0], &[0.0]), Err(lengths(1, 1)));
    assert_eq!(from(&[0.0; 2], &[0.0; 3]), Err(lengths(2, 3)));
    let not_finite = from(&[0.0; 3], &[0.0, f64::NAN, 0.0]);
    assert_eq!(not_finite, Err(NoShape::NotFinite(1)));
}
