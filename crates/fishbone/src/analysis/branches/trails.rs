//! The ways of searches for minima: a search that comes to the way of an earlier one ends where that one ended.

use crate::problem::program::BeltPoint;

/// Shapes that searches on one mesh have passed.
#[derive(Default)]
pub(super) struct Trails {
    passed: Vec<Passed>,
}

/// A shape that a search has passed: the solution of a barrier problem.
pub(super) struct Passed {
    /// Barrier, in mean R_f/U.
    pub(super) barrier: f64,
    pub(super) shape: BeltPoint,
}

impl Trails {
    /// Whether an earlier search has passed next to a shape at the same barrier.
    pub(super) fn lead_past(&self, barrier: f64, shape: &BeltPoint) -> bool {
        /// Distance of nodes next to each other, as a share of the depth of the shape.
        const NEXT: f64 = 0.02;
        let next = NEXT * depth(shape);
        let known = self.passed.iter().filter(|p| p.barrier == barrier);
        known.into_iter().any(|p| are_next(&p.shape, shape, next))
    }

    /// Adds what a search has passed.
    pub(super) fn extend(&mut self, passed: Vec<Passed>) {
        self.passed.extend(passed);
    }
}

/// Whether the nodes of two shapes on one mesh are within a distance in U of each other, with ribs of much the same slope.
fn are_next(a: &BeltPoint, b: &BeltPoint, distance: f64) -> bool {
    /// Difference of slopes that are much the same, dimensionless.
    const SLOPE: f64 = 0.1;
    let mut fields = a.fields.iter().zip(&b.fields);
    let mut poses = a.poses.iter().zip(&b.poses);
    fields.all(|(a, b)| (a[1] - b[1]).abs() <= SLOPE)
        && poses.all(|(a, b)| (a.position - b.position).norm() <= distance)
}

/// The largest distance of a node from where it would be if the nodes were spaced evenly from the first to the last, in U.
fn depth(shape: &BeltPoint) -> f64 {
    let last = shape.poses.len() - 1;
    let [start, end] = [0, last].map(|k| shape.poses[k].position);
    let poses = shape.poses.iter().enumerate();
    let away =
        poses.map(|(k, pose)| (pose.position - start.lerp(&end, k as f64 / last as f64)).norm());
    away.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pose;
    use nalgebra::{Vector2, Vector3};

    /// An arch of a height in U, its ribs with a slope.
    fn arch(height: f64, slope: f64) -> BeltPoint {
        let at = |k: usize| {
            let place = k as f64 / 10.0;
            Pose {
                position: Vector3::new(4.0 * height * place * (1.0 - place), place, 0.0),
                ..Pose::identity()
            }
        };
        BeltPoint {
            poses: (0..=10).map(at).collect(),
            fields: vec![Vector2::new(1.0, slope); 11],
        }
    }

    #[test]
    fn test_a_way_is_known_by_its_shapes_slopes_and_barrier() {
        let mut trails = Trails::default();
        trails.extend(vec![Passed {
            barrier: 0.1,
            shape: arch(0.5, 0.0),
        }]);
        assert!(trails.lead_past(0.1, &arch(0.505, 0.05)));
        assert!(!trails.lead_past(0.01, &arch(0.505, 0.05)));
        assert!(!trails.lead_past(0.1, &arch(0.52, 0.05)));
        assert!(!trails.lead_past(0.1, &arch(0.505, 0.2)));
    }

    #[test]
    fn test_shallow_arches_to_either_side_are_apart() {
        let mut trails = Trails::default();
        trails.extend(vec![Passed {
            barrier: 0.1,
            shape: arch(1e-4, 0.0),
        }]);
        assert!(trails.lead_past(0.1, &arch(1.01e-4, 0.0)));
        assert!(!trails.lead_past(0.1, &arch(-1e-4, 0.0)));
    }
}
