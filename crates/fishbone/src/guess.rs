//! Where the search for an equilibrium starts: a plane arch on the side of the bulge.

use crate::lie::{Pose, exp, log};
use crate::program::{BeltPoint, BeltProgram, NodeSupport};
use nalgebra::{Matrix3, Vector2, Vector3};
use std::f64::consts::PI;

/// Samples of the arch when its reach is measured.
const SAMPLES: usize = 64;
/// Height of the arch at which its ends meet, the largest of any use.
const HIGHEST: f64 = 2.4;

/// A plane arch as the angle its tangent has turned about ζ, by u in U.
#[derive(Debug, Clone, Copy)]
struct Arch {
    /// Amplitude, positive where the arch rises to the +ξ side.
    amplitude: f64,
    /// Turn from end to end on top of the arch.
    turn: f64,
    /// Whether the tangent leaves the ends at an angle, as at a pin, or along them, as at a clamp.
    pinned: bool,
}

impl Arch {
    fn angle(&self, u: f64) -> f64 {
        let wave = if self.pinned {
            (PI * u).cos()
        } else {
            (2.0 * PI * u).sin()
        };
        self.turn * u - self.amplitude * wave
    }

    fn bend(&self, u: f64) -> f64 {
        let wave = if self.pinned {
            -PI * (PI * u).sin()
        } else {
            2.0 * PI * (2.0 * PI * u).cos()
        };
        self.turn - self.amplitude * wave
    }

    /// Displacement from end to end along (ξ, η) of the frame at u = 0 before the amplitude turns it.
    fn reach(&self) -> Vector2<f64> {
        let tangent = |k: usize| {
            let angle = self.angle((k as f64 + 0.5) / SAMPLES as f64);
            Vector2::new(-angle.sin(), angle.cos())
        };
        (0..SAMPLES).map(tangent).sum::<Vector2<f64>>() / SAMPLES as f64
    }
}

/// A start for the search: the plane arch whose reach comes nearest to what the supports at the two ends ask for,
/// bulging to the side of `bulge`.
pub(crate) fn guess(program: &BeltProgram, bulge: &Vector3<f64>) -> BeltPoint {
    let last = program.elements.len();
    let at = |node: usize| program.supports.iter().find(|s| s.node == node);
    let (start, end) = (at(0), at(last));
    let frame = start_frame(start, end, bulge);
    let arch = fit_arch(&frame, start, end, bulge);
    let field = |u: f64| Vector2::new(arch.bend(u), 0.0);
    let fields = program.nodes().into_iter().map(field).collect();
    let tilt = exp(&Vector3::new(0.0, 0.0, arch.angle(0.0)));
    let mut point = BeltPoint {
        fields,
        poses: vec![
            Pose {
                frame: frame * tilt,
                position: Vector3::zeros(),
            };
            last + 1
        ],
    };
    program.carry(&mut point);
    place(&mut point, start, end);
    point
}

/// Disturbs a start or a saddle out of its symmetry by a smooth twist and a sway, `share` of what the rib bound allows.
pub(crate) fn disturb(program: &BeltProgram, point: &BeltPoint, share: f64) -> BeltPoint {
    let steepest = PI * (1.0 + 2.0 * 0.7);
    let bound = program
        .elements
        .iter()
        .map(|element| 1.0 / element.half_width)
        .fold(f64::INFINITY, f64::min);
    let twist = share * (bound / steepest).min(1.0);
    let mut disturbed = point.clone();
    for (fields, u) in disturbed.fields.iter_mut().zip(program.nodes()) {
        let (once, twice) = ((PI * u).sin(), (2.0 * PI * u).sin());
        *fields *= 1.0 - share;
        *fields += Vector2::new(share * twice, twist * (once + 0.7 * twice));
    }
    program.carry(&mut disturbed);
    disturbed
}

/// Frame at u = 0: as held there, else as held at the end, else along the chord with the normal toward the bulge.
fn start_frame(
    start: Option<&NodeSupport>,
    end: Option<&NodeSupport>,
    bulge: &Vector3<f64>,
) -> Matrix3<f64> {
    let held = |support: Option<&NodeSupport>| {
        support
            .and_then(|s| s.frame)
            .map(|q| q.to_rotation_matrix().into_inner())
    };
    held(start)
        .or_else(|| held(end))
        .unwrap_or_else(|| frame_along(&chord(start, end).unwrap_or_default(), bulge))
}

/// The frame with the tangent along `along` and the normal as near as can be to `toward`; the natural frame where
/// `along` is zero.
fn frame_along(along: &Vector3<f64>, toward: &Vector3<f64>) -> Matrix3<f64> {
    let Some(tangent) = along.try_normalize(f64::EPSILON) else {
        return Matrix3::identity();
    };
    let across = |v: &Vector3<f64>| (v - tangent * tangent.dot(v)).try_normalize(1e-6);
    let normal = [*toward, Vector3::x(), Vector3::z()]
        .iter()
        .find_map(across)
        .unwrap_or_default();
    Matrix3::from_columns(&[normal, tangent, normal.cross(&tangent)])
}

/// From the start's position to the end's, where both are held.
fn chord(start: Option<&NodeSupport>, end: Option<&NodeSupport>) -> Option<Vector3<f64>> {
    Some(end?.point()? - start?.point()?)
}

/// The arch whose reach is nearest to the chord.
fn fit_arch(
    frame: &Matrix3<f64>,
    start: Option<&NodeSupport>,
    end: Option<&NodeSupport>,
    bulge: &Vector3<f64>,
) -> Arch {
    let frames = start.and_then(|s| s.frame).zip(end.and_then(|s| s.frame));
    let gap = frames.map_or(Vector3::zeros(), |(a, b)| {
        log((a.conjugate() * b).to_rotation_matrix().matrix())
    });
    let middle = frame * exp(&(0.5 * gap));
    let side = if middle.column(0).dot(bulge) < 0.0 {
        -1.0
    } else {
        1.0
    };
    let pinned = [start, end]
        .iter()
        .all(|s| s.is_none_or(|s| s.frame.is_none()));
    let arch = |height: f64| Arch {
        amplitude: side * height,
        turn: gap.z,
        pinned,
    };
    let Some(chord) = chord(start, end) else {
        return arch(0.0);
    };
    let local = frame.tr_mul(&chord);
    let anchored = start.is_some_and(|s| s.frame.is_some());
    arch(least(HIGHEST, |height| {
        let reach = arch(height).reach();
        // Not squared: on a nearly taut belt the miss is itself a square of the height.
        if anchored {
            (Vector3::new(reach.x, reach.y, 0.0) - local).norm()
        } else {
            (reach.norm() - chord.norm()).abs()
        }
    }))
}

/// Where a function of [0, `most`] is least: the best of a grid, then a ternary search around it.
fn least(most: f64, f: impl Fn(f64) -> f64) -> f64 {
    const GRID: usize = 24;
    const NARROWINGS: usize = 60;
    let step = most / GRID as f64;
    let (mut best, mut value) = (0.0, f64::INFINITY);
    for k in 0..=GRID {
        let here = f(k as f64 * step);
        if here < value {
            (best, value) = (k as f64 * step, here);
        }
    }
    let (mut low, mut high) = ((best - step).max(0.0), (best + step).min(most));
    for _ in 0..NARROWINGS {
        let third = (high - low) / 3.0;
        if f(low + third) <= f(high - third) {
            high -= third;
        } else {
            low += third;
        }
    }
    0.5 * (low + high)
}

/// Moves the whole belt so that the start, or else the end, is where it is held.
fn place(point: &mut BeltPoint, start: Option<&NodeSupport>, end: Option<&NodeSupport>) {
    let from_end = || Some(end?.point()? - point.poses.last()?.position);
    let shift = start
        .and_then(NodeSupport::point)
        .or_else(from_end)
        .unwrap_or_default();
    for pose in &mut point.poses {
        pose.position += shift;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::Element;
    use crate::energy::EnergyModel;
    use nalgebra::UnitQuaternion;

    fn held(node: usize, position: [f64; 3], rotation: Option<[f64; 3]>) -> NodeSupport {
        NodeSupport {
            node,
            position: position.map(Some),
            frame: rotation.map(|r| UnitQuaternion::from_scaled_axis(Vector3::from(r))),
            square_rib: false,
        }
    }

    fn program(supports: Vec<NodeSupport>) -> BeltProgram {
        let element = Element {
            length: 0.025,
            geodesic: 0.0,
            rigidity: [1.0; 2],
            half_width: 0.05,
        };
        BeltProgram {
            elements: vec![element; 40],
            model: EnergyModel::Wunderlich,
            supports,
        }
    }

    fn end(point: &BeltPoint) -> Vector3<f64> {
        point.poses.last().unwrap().position
    }

    #[test]
    fn test_arch_between_facing_clamps_meets_both_and_rises_to_the_bulge() {
        for distance in [0.2, 0.6, 0.99, 0.9999] {
            for side in [1.0, -1.0] {
                let clamps = vec![
                    held(0, [0.3, 0.0, 0.0], Some([0.0; 3])),
                    held(40, [0.3, distance, 0.0], Some([0.0; 3])),
                ];
                let point = guess(&program(clamps), &(side * Vector3::x()));
                assert!((end(&point) - Vector3::new(0.3, distance, 0.0)).norm() < 1e-2);
                assert!(side * (point.poses[20].position.x - 0.3) > 0.0);
            }
        }
    }

    #[test]
    fn test_fold_by_a_half_turn_starts_folded() {
        let clamps = vec![
            held(0, [0.0; 3], Some([0.0; 3])),
            held(40, [-0.4, 0.0, 0.0], Some([0.0, 0.0, PI])),
        ];
        let point = guess(&program(clamps), &Vector3::x());
        let tangent = point.poses[40].frame.column(1).into_owned();
        assert!((tangent + Vector3::y()).norm() < 1e-6);
    }

    #[test]
    fn test_pins_are_met_and_the_belt_bulges_between_them() {
        let pins = vec![
            held(0, [0.0, 0.1, 0.2], None),
            held(40, [0.5, 0.3, 0.4], None),
        ];
        let bulge = Vector3::new(0.0, 0.0, -1.0);
        let point = guess(&program(pins), &bulge);
        assert!((end(&point) - Vector3::new(0.5, 0.3, 0.4)).norm() < 2e-3);
        assert!((point.poses[20].position - point.poses[0].position).dot(&bulge) > 0.2);
    }

    #[test]
    fn test_belt_held_at_its_end_alone_is_straight_and_ends_there() {
        let point = guess(
            &program(vec![held(40, [1.0, 2.0, 3.0], Some([0.0, 0.0, PI / 2.0]))]),
            &Vector3::x(),
        );
        assert!((end(&point) - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-12);
        assert!((point.poses[0].position - Vector3::new(2.0, 2.0, 3.0)).norm() < 1e-9);
    }

    #[test]
    fn test_disturbed_start_keeps_its_ribs_apart() {
        let clamps = vec![
            held(0, [0.0; 3], Some([0.0; 3])),
            held(40, [0.0, 0.5, 0.0], Some([0.0; 3])),
        ];
        let program = program(clamps);
        let start = guess(&program, &Vector3::x());
        let disturbed = disturb(&program, &start, 0.4);
        for pair in disturbed.fields.windows(2) {
            assert!((pair[1][1] - pair[0][1]).abs() * 0.05 / 0.025 < 1.0);
        }
        assert_eq!((disturbed.fields[0][1], disturbed.poses.len()), (0.0, 41));
        assert!(disturbed.poses[20].position.z.abs() > 1e-3);
    }
}
