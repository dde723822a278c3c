//! An obstacle defined outside the crate: a half-space that no node may enter, and the forces of the contact.

use fishbone::problem::Problem;
use fishbone::problem::program::{BeltPoint, BeltProgram, NodeObstacle, Obstacle};
use fishbone::scenario::Scenario;
use nalgebra::{Matrix3, Vector3};
use stagewise::{Outcome, Program, Settings, Solution};
use std::ops::ControlFlow;
use std::sync::Arc;

/// The half-space beyond a height along a direction.
#[derive(Debug)]
struct HalfSpace {
    normal: Vector3<f64>,
    height: f64,
}

impl Obstacle for HalfSpace {
    fn gap(&self, point: &Vector3<f64>) -> f64 {
        self.height - self.normal.dot(point)
    }

    fn gradient(&self, _: &Vector3<f64>) -> Vector3<f64> {
        -self.normal
    }

    fn hessian(&self, _: &Vector3<f64>) -> Matrix3<f64> {
        Matrix3::zeros()
    }
}

fn arch() -> (BeltProgram, Solution<BeltPoint>) {
    let scenario = Scenario::from_toml(
        r#"
        belt = { width = 0.1, rigidity = 1.0, segments = [{ kind = "straight", length = 1.0 }] }
        supports = [
          { at = "start", position = [0, 0, 0], rotation = [0, 0, 0] },
          { at = "end", position = [0, 0.6, 0], rotation = [0, 0, 0.4] },
        ]
        "#,
    );
    let program = Problem::new(scenario.unwrap()).unwrap().program(80);
    let start = BeltPoint {
        fields: (0..=80)
            .map(|k| nalgebra::Vector2::new(-2.0 * (k as f64 * 0.0785).cos(), 0.0))
            .collect(),
        poses: vec![fishbone::geometry::Pose::identity(); 81],
    };
    let found = minimum(&program, start);
    (program, found)
}

fn minimum(program: &BeltProgram, mut start: BeltPoint) -> Solution<BeltPoint> {
    program.settle(&mut start);
    let settings = Settings {
        tolerance: 1e-9,
        iterations: 300,
        barrier: 1.0,
        longest_step: f64::INFINITY,
    };
    stagewise::minimise(program, &settings, start, &mut || ControlFlow::Continue(()))
}

fn highest(found: &Solution<BeltPoint>) -> f64 {
    let heights = found.at.point.poses.iter().map(|pose| pose.position.x);
    heights.fold(0.0, f64::max)
}

#[test]
fn test_arch_under_a_ceiling_touches_it_and_its_contact_forces_balance_the_reactions() {
    let (mut program, free) = arch();
    assert_eq!(free.outcome, Outcome::Converged);
    let height = 0.8 * highest(&free);
    let normal = Vector3::x();
    let ceiling = Arc::new(HalfSpace { normal, height });
    let before_node = |node| NodeObstacle {
        node,
        obstacle: ceiling.clone(),
        weight: 1.0 / 80.0,
    };
    program.obstacles = (1..80).map(before_node).collect();
    // From a lower arch, which does not reach the end's support yet.
    let mut low = free.at.point.clone();
    low.fields.iter_mut().for_each(|fields| *fields *= 0.6);
    let found = minimum(&program, low);
    assert_eq!(found.outcome, Outcome::Converged, "{:?}", found.residuals);
    assert!(found.values.objective > free.values.objective);
    let (point, multipliers) = (&found.at.point, &found.at.multipliers);
    let first = program.layout().inequalities_at_stages();
    let contacts = program
        .obstacles
        .iter()
        .zip(&multipliers.inequalities[first..]);
    let contact: Vector3<f64> = contacts
        .map(|(contact, multiplier)| contact.force(&point.poses[contact.node], *multiplier))
        .sum();
    let reactions = program.reactions(point, &multipliers.equalities);
    let held: Vector3<f64> = reactions.iter().map(|(force, _)| force).sum();
    let miss = (contact + held).norm();
    assert!(
        contact.x < -1.0 && miss < 1e-6 * contact.norm(),
        "{contact} {held}"
    );
    assert!((highest(&found) - height).abs() < 1e-6);
}
