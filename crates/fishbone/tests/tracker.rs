//! Tracking from Rust: its allocations, and the equilibria to which it leads.

use fishbone::analysis::tracking::{NoTracker, Tracker, Update};
use fishbone::equilibrium::{Equilibrium, Status, Uncertified};
use fishbone::problem::Problem;
use fishbone::scenario::Scenario;
use fishbone::solve::solve;
use nalgebra::Vector3;
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
    let updated = tracker.update(&position, &rotation, &mut || ControlFlow::Continue(()));
    updated.unwrap()
}

#[test]
fn test_update_ends_in_the_equilibrium_of_its_pose() {
    let mut tracker = Tracker::new(&solved(&clamped(0.5)), 1).unwrap();
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
/// of the scenario in place of a straight belt.
fn allocations(energy: &str, segments: &str, links: &str) -> u64 {
    let toml = format!("energy = '{energy}'\nlinks = [{links}]\n{}", clamped(0.5));
    let straight = "{ kind = 'straight', length = 1.0 }";
    let equilibrium = solved(&toml.replace(straight, segments));
    let mut tracker = Tracker::new(&equilibrium, 1).unwrap();
    update(&mut tracker, 0.501, 0.001);
    let allocated = allocation_counter::measure(|| {
        for step in 2..100 {
            let share = f64::from(step) * 5e-4;
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
        for segments in [straight, bend, stiffener, arc] {
            assert_eq!(allocations(energy, segments, ""), 0, "{energy} {segments}");
        }
        assert_eq!(allocations(energy, straight, link), 0, "{energy} {link}");
    }
}

#[test]
fn test_interrupted_update_leaves_the_tracker_at_its_last_pose() {
    let mut tracker = Tracker::new(&solved(&clamped(0.5)), 1).unwrap();
    let energy = tracker.energy();
    let far = Vector3::new(0.2, 0.3, -0.2);
    let ended = tracker.update(&far, &Vector3::new(1.0, 2.0, 0.5), &mut || {
        ControlFlow::Break(())
    });
    let ended = ended.unwrap();
    assert_eq!(ended.status, Status::NotConverged);
    assert!((tracker.energy() / energy - 1.0).abs() < 1e-12);
    assert_eq!(update(&mut tracker, 0.5, 0.0).status, Status::Converged);
}

#[test]
fn test_equilibria_that_cannot_be_followed_are_refused() {
    let equilibrium = solved(&clamped(0.5));
    assert_eq!(
        Tracker::new(&equilibrium, 7).err(),
        Some(NoTracker::NoSupport(7))
    );
    let out_of_reach = Tracker::new(&solved(&clamped(1.5)), 1);
    assert!(matches!(
        out_of_reach.err(),
        Some(NoTracker::Uncertified(Uncertified::NotConverged { .. }))
    ));
    let pinned = clamped(0.5).replace(", 0.1], rotation = [0, 0, 0] }", ", 0.1] }");
    assert_eq!(
        Tracker::new(&solved(&pinned), 1).err(),
        Some(NoTracker::NotClamped(1))
    );
}

#[test]
fn test_belt_follows_its_first_support() {
    let mut tracker = Tracker::new(&solved(&clamped(0.5)), 0).unwrap();
    let to = Vector3::new(0.05, -0.02, 0.03);
    let moved = tracker.update(&to, &Vector3::zeros(), &mut || ControlFlow::Continue(()));
    assert_eq!(moved.unwrap().status, Status::Converged);
    let equilibrium = tracker.equilibrium();
    assert!((equilibrium.spine.pose[0].position - to).norm() < 1e-9);
    for (pose, position) in equilibrium.spine.pose.iter().zip(tracker.positions()) {
        assert!((pose.position - position).norm() < 1e-12);
    }
    // Tracking from the moved belt begins at its present pose.
    let again = Tracker::new(&equilibrium, 0).unwrap();
    assert!((again.positions().next().unwrap() - to).norm() < 1e-9);
}

#[test]
fn test_invalid_pose_leaves_the_tracker_at_its_last_pose() {
    let mut tracker = Tracker::new(&solved(&clamped(0.5)), 1).unwrap();
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
        let refused = tracker.update(&position, &rotation, go_on).unwrap_err();
        assert_eq!(refused.field(), Some(&*format!("supports[1].{field}")));
        assert_eq!(tracker.energy(), energy);
    }
}
