//! Tracking from Rust: its allocations, and the equilibria to which it leads.

use fishbone::analysis::tracking::{Goal, NoTracker, Tracker, Update};
use fishbone::equilibrium::{Equilibrium, Status, Uncertified};
use fishbone::problem::Problem;
use fishbone::scenario::Scenario;
use fishbone::solve::solve;
use nalgebra::{Rotation3, Vector3};
use std::ops::ControlFlow;

fn solved(toml: &str) -> Equilibrium {
    let problem = Problem::new(Scenario::from_toml(toml).unwrap()).unwrap();
    solve(&problem, &mut || ControlFlow::Continue(()))
}

/// A straight belt of 80 elements with its end at (0, y, 0.1).
fn clamped(y: f64) -> String {
    format!(
        "belt = {{ width = 0.1, rigidity = 2.0, segments = [{{ kind = 'straight', length = 1.0 }}] }}
         supports = [
           {{ at = 'start', position = [0, 0, 0], rotation = [0, 0, 0] }},
           {{ at = 'end', position = [0, {y}, 0.1], rotation = [0, 0, 0] }},
         ]
         solver = {{ elements = 80 }}"
    )
}

fn update(tracker: &mut Tracker, y: f64, angle: f64) -> Update {
    let (position, rotation) = (Vector3::new(0.0, y, 0.1), Vector3::new(0.0, 0.0, angle));
    moved(tracker, &[to(1, position, rotation)])
}

fn to(support: usize, position: Vector3<f64>, rotation: Vector3<f64>) -> Goal {
    Goal {
        support,
        position: Some(position),
        rotation: Some(rotation),
    }
}

fn moved(tracker: &mut Tracker, goals: &[Goal]) -> Update {
    let updated = tracker.update(goals, &mut || ControlFlow::Continue(()));
    updated.unwrap()
}

#[test]
fn test_update_ends_in_the_equilibrium_of_its_pose() {
    let mut tracker = Tracker::new(&solved(&clamped(0.5)), &[1]).unwrap();
    for step in 1..=20 {
        let y = 0.5 + 0.005 * f64::from(step);
        let followed = update(&mut tracker, y, 0.0);
        assert_eq!(
            (followed.status, followed.snapped),
            (Status::Converged, false)
        );
    }
    let afresh = solved(&clamped(0.6));
    assert!((tracker.energy() / afresh.energy - 1.0).abs() < 1e-6);
    let apart = tracker.reaction(1).force - afresh.reactions[1].wrench.force;
    assert!(apart.norm() < 1e-4 * afresh.reactions[1].wrench.force.norm());
    let made_of_it = tracker.equilibrium();
    assert!((made_of_it.energy - tracker.energy()).abs() < 1e-12 * tracker.energy());
    assert_eq!(made_of_it.stable(), Some(true));
}

/// Counts the allocations of updates in which the end of a belt of 80 elements moves from (0, 0.5, 0.1), with some tables
/// of the scenario in place of a straight belt, in steps of a length.
fn allocations(energy: &str, segments: &str, links: &str, length: f64) -> u64 {
    let toml = format!("energy = '{energy}'\nlinks = [{links}]\n{}", clamped(0.5));
    let straight = "{ kind = 'straight', length = 1.0 }";
    let equilibrium = solved(&toml.replace(straight, segments));
    let mut tracker = Tracker::new(&equilibrium, &[1]).unwrap();
    update(&mut tracker, 0.501, 0.001);
    let allocated = allocation_counter::measure(|| {
        for step in 2..100 {
            let share = f64::from(step) * length;
            let followed = update(&mut tracker, 0.5 + share, share);
            assert_eq!(
                (followed.status, followed.snapped),
                (Status::Converged, false)
            );
        }
    });
    allocated.count_total
}

#[test]
fn test_update_allocates_nothing_after_the_first() {
    let straight = "{ kind = 'straight', length = 1.0 }";
    let bend = "{ kind = 'straight', length = 0.5 }, { kind = 'corner', angle = 0.8 },
                { kind = 'straight', length = 0.5 }";
    let stiffener = "{ kind = 'straight', length = 0.4 }, { kind = 'rigid', length = 0.1 },
                     { kind = 'straight', length = 0.5 }";
    let arc =
        "{ kind = 'arc', length = 0.5, curvature = 1.4 }, { kind = 'straight', length = 0.5 }";
    let link = "{ from = 0.3, to = 0.7, offset = [0, 0.2, 0.05] }";
    for energy in ["fishbone", "wunderlich"] {
        // In longer steps the belt beside the bend comes to a place that is hard to follow.
        let boards = [
            (straight, 1e-3),
            (bend, 5e-4),
            (stiffener, 1e-3),
            (arc, 5e-4),
        ];
        for (segments, length) in boards {
            let allocated = allocations(energy, segments, "", length);
            assert_eq!(allocated, 0, "{energy} {segments}");
        }
        assert_eq!(
            allocations(energy, straight, link, 5e-4),
            0,
            "{energy} {link}"
        );
    }
}

#[test]
fn test_interrupted_update_leaves_the_tracker_at_its_last_pose() {
    let mut tracker = Tracker::new(&solved(&clamped(0.5)), &[1]).unwrap();
    let energy = tracker.energy();
    let far = Vector3::new(0.2, 0.3, -0.2);
    let goal = to(1, far, Vector3::new(1.0, 2.0, 0.5));
    let ended = tracker.update(&[goal], &mut || ControlFlow::Break(()));
    let ended = ended.unwrap();
    assert_eq!((ended.status, ended.fraction), (Status::NotConverged, 0.0));
    assert!((tracker.energy() / energy - 1.0).abs() < 1e-12);
    assert_eq!(update(&mut tracker, 0.5, 0.0).status, Status::Converged);
}

#[test]
fn test_equilibria_that_cannot_be_followed_are_refused() {
    let equilibrium = solved(&clamped(0.5));
    assert_eq!(
        Tracker::new(&equilibrium, &[7]).err(),
        Some(NoTracker::NoSupport(7))
    );
    let out_of_reach = Tracker::new(&solved(&clamped(1.5)), &[1]);
    assert!(matches!(
        out_of_reach.err(),
        Some(NoTracker::Uncertified(Uncertified::NotConverged { .. }))
    ));
    let turned_alone =
        clamped(0.5).replace("position = [0, 0.5, 0.1], ", "position = [0, 0.5, '*'], ");
    let free = turned_alone.replace("'*'", "'free'");
    assert_eq!(
        Tracker::new(&solved(&free), &[1]).err(),
        Some(NoTracker::NotHeld(1))
    );
}

#[test]
fn test_belt_follows_its_first_support() {
    let mut tracker = Tracker::new(&solved(&clamped(0.5)), &[0]).unwrap();
    let there = Vector3::new(0.05, -0.02, 0.03);
    let led = moved(&mut tracker, &[to(0, there, Vector3::zeros())]);
    assert_eq!(led.status, Status::Converged);
    let equilibrium = tracker.equilibrium();
    assert!((equilibrium.spine.pose[0].position - there).norm() < 1e-9);
    for (pose, position) in equilibrium.spine.pose.iter().zip(tracker.positions()) {
        assert!((pose.position - position).norm() < 1e-12);
    }
    // Tracking from the moved belt begins at its present pose.
    let again = Tracker::new(&equilibrium, &[0]).unwrap();
    assert!((again.positions().next().unwrap() - there).norm() < 1e-9);
}

#[test]
fn test_invalid_pose_leaves_the_tracker_at_its_last_pose() {
    let mut tracker = Tracker::new(&solved(&clamped(0.5)), &[1]).unwrap();
    let energy = tracker.energy();
    let (at, level) = (Vector3::new(0.0, 0.5, 0.1), Vector3::zeros());
    let poses = [
        (f64::NAN * at, level, "position[0]"),
        (1e300 * at, level, "position[1]"),
        (at, Vector3::new(f64::NAN, 0.0, 0.0), "rotation[0]"),
        (at, Vector3::new(0.0, f64::INFINITY, 0.0), "rotation[1]"),
        (at, Vector3::new(0.0, 1e300, 0.0), "rotation"),
    ];
    for (position, rotation, field) in poses {
        let go_on = &mut || ControlFlow::Continue(());
        let refused = tracker.update(&[to(1, position, rotation)], go_on);
        let refused = refused.unwrap_err();
        assert_eq!(refused.field(), Some(&*format!("supports[1].{field}")));
        assert_eq!(tracker.energy(), energy);
    }
}

#[test]
fn test_shape_moves_along_with_both_of_its_ends() {
    let mut tracker = Tracker::new(&solved(&clamped(0.5)), &[0, 1]).unwrap();
    let (energy, start) = (tracker.energy(), tracker.reaction(1).force);
    let turn = Rotation3::new(Vector3::new(0.4, -0.3, 0.8));
    let by = Vector3::new(0.3, -0.2, 0.1);
    let ends = [Vector3::zeros(), Vector3::new(0.0, 0.5, 0.1)];
    let goals = [0, 1].map(|i| to(i, turn * ends[i] + by, turn.scaled_axis()));
    let led = moved(&mut tracker, &goals);
    assert_eq!((led.status, led.fraction), (Status::Converged, 1.0));
    assert!((tracker.energy() / energy - 1.0).abs() < 1e-9);
    assert!((tracker.reaction(1).force - turn * start).norm() < 1e-7 * start.norm());
}

#[test]
fn test_pin_and_hinge_move_as_they_are_solved_for() {
    let held = |middle: &str| {
        let end = "{ at = 'end', position = [0, 0.75, 0.1], rotation = [0, 0, 0]";
        clamped(0.5).replace(
            "{ at = 'end', position = [0, 0.5, 0.1], rotation = [0, 0, 0] },",
            &format!("{middle} {end} }}"),
        )
    };
    let pin = |z: f64| held(&format!("{{ at = 0.5, position = [0, 0.35, {z}] }},"));
    let hinge = |z: f64, angle: f64| {
        held(&format!(
            "{{ at = 0.5, position = [0, 0.35, {z}], rotation = [0, 0, {angle}], hinge = 'zeta' }},"
        ))
    };
    let here = Vector3::new(0.0, 0.35, 0.25);
    let cases = [
        (pin(0.24), pin(0.25), None),
        (
            hinge(0.24, 0.0),
            hinge(0.25, 0.1),
            Some(Vector3::new(0.0, 0.0, 0.1)),
        ),
    ];
    for (from, goal, rotation) in cases {
        let mut tracker = Tracker::new(&solved(&from), &[1, 2]).unwrap();
        let goals = Goal {
            support: 1,
            position: Some(here),
            rotation,
        };
        let led = moved(&mut tracker, &[goals]);
        assert_eq!(led.status, Status::Converged);
        let afresh = solved(&goal);
        assert!((tracker.energy() / afresh.energy - 1.0).abs() < 1e-6);
        let apart = tracker.reaction(1).force - afresh.reactions[1].wrench.force;
        assert!(apart.norm() < 1e-4 * afresh.reactions[1].wrench.force.norm());
    }
}

#[test]
fn test_rotation_of_a_pin_is_not_read() {
    let pinned = clamped(0.5).replace(", 0.1], rotation = [0, 0, 0] }", ", 0.1] }");
    let mut tracker = Tracker::new(&solved(&pinned), &[1]).unwrap();
    let energy = tracker.energy();
    let turned = moved(
        &mut tracker,
        &[to(1, Vector3::new(0.0, 0.5, 0.1), Vector3::x())],
    );
    assert_eq!(turned.status, Status::Converged);
    assert!((tracker.energy() / energy - 1.0).abs() < 1e-12);
    let refused = tracker.check(&[to(0, Vector3::y(), Vector3::x())]);
    assert_eq!(refused.unwrap_err().field(), Some("supports[0]"));
    assert_eq!(moved(&mut tracker, &[]).status, Status::Converged);
}

#[test]
fn test_update_that_is_stopped_keeps_the_way_that_it_has_made() {
    let mut tracker = Tracker::new(&solved(&clamped(0.5)), &[1]).unwrap();
    let (far, turned) = (Vector3::new(0.1, 0.4, 0.0), Vector3::new(0.2, 0.4, 0.1));
    let stopped_after = |tracker: &mut Tracker, steps: usize| {
        let mut asked = 0;
        let stopped = tracker.update(&[to(1, far, turned)], &mut || {
            asked += 1;
            match asked > steps {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        });
        stopped.unwrap()
    };
    let mut left = 1.0;
    let mut stops = 0;
    while left > 0.0 {
        let update = stopped_after(&mut tracker, 30);
        left *= 1.0 - update.fraction;
        stops += 1;
        let end = tracker.positions().last().unwrap();
        let way = far - Vector3::new(0.0, 0.5, 0.1);
        assert!((far - left * way - end).norm() < 1e-9);
        assert_eq!(tracker.equilibrium().status, Status::Converged);
        assert!(stops < 100);
    }
    assert!(stops > 2);
    let mut at_once = Tracker::new(&solved(&clamped(0.5)), &[1]).unwrap();
    moved(&mut at_once, &[to(1, far, turned)]);
    assert!((tracker.energy() / at_once.energy() - 1.0).abs() < 1e-9);
}

#[test]
fn test_belt_that_is_pulled_straight_is_taut() {
    let mut tracker = Tracker::new(&solved(&clamped(0.5)), &[1]).unwrap();
    let straight = [to(1, Vector3::y(), Vector3::zeros())];
    let pulled = moved(&mut tracker, &straight);
    assert_eq!((pulled.status, pulled.taut), (Status::Converged, true));
    assert!(tracker.reaction(1).force.y.is_nan());
    assert!(!update(&mut tracker, 0.95, 0.1).taut);
    let beyond = moved(
        &mut tracker,
        &[to(1, 1.001 * Vector3::y(), Vector3::zeros())],
    );
    assert_eq!((beyond.status, beyond.fraction), (Status::Infeasible, 0.0));
}
