//! Starts of the search for an equilibrium: an arch on the side of the bulge, with ribs that do not cross.

mod headings;
mod ribs;

use crate::geometry::{Pose, exp, log};
use crate::problem::program::{BeltPoint, BeltProgram, NodeSupport};
use headings::Headings;
use nalgebra::{Matrix3, UnitQuaternion, Vector2, Vector3};
use ribs::calm_slopes;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Samples of the arch along which its reach is integrated, a number.
const SAMPLES: usize = 24;
/// Cost of a miss by the whole length against the arch's energy ∫ω_ζ² du, in rad²/U: a miss by a tenth costs as much
/// as a turn.
const MISS: f64 = 10.0 * TAU * TAU;
/// Gain of a bulge straight to the side asked for against the arch's energy ∫ω_ζ² du, in rad²/U.
const BULGE: f64 = 100.0;
/// Amplitude of the arch at which its ends meet, the greatest of any use, in rad.
const HIGHEST: f64 = 2.4;
/// Values of the amplitude from which the best is refined, a number.
const AMPLITUDES: usize = 24;
/// Width of the interval at which the refinement of the amplitude ends, as a share of the amplitude.
const NARROW: f64 = 1e-3;
/// Width of the interval at which the refinement of a vanishing amplitude ends, in rad.
const NARROWEST: f64 = 1e-7;
/// Miss of the supports by which one side of a ring must be the better to be preferred, lengths in U and angles in rad.
const NEARER: f64 = 1e-6;
/// Cost by which an arch must be the better to be preferred, as a share of the cost.
const LEVEL: f64 = 1e-6;
/// Angle by which a rotation may be off by rounding, in rad.
const ROUNDING: f64 = 1e-9;
/// Bend up to which a node counts as flat, in rad/U.
const FLAT: f64 = 1e-6;
/// Bend given to a flat belt that may buckle, in rad/U.
const BUCKLED_BEND: f64 = 1.0;
/// Part of the way from rib slopes far from crossing to a shape's own rib slopes that is tried first, a share.
const INTERIOR: f64 = 0.999;
/// Greatest count of halvings of this part, until the ribs do not cross, a number.
const HALVINGS: usize = 12;

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

    /// The integral of the squared bend.
    fn energy(&self) -> f64 {
        let wave = if self.pinned { PI } else { TAU };
        self.turn * self.turn + 0.5 * (wave * self.amplitude).powi(2)
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

/// A start for the search: the arch whose reach is nearest to the pose of the end that the supports at the two ends
/// prescribe, bulging to the side of `bulge`, with ribs that do not cross.
pub(crate) fn guess(program: &BeltProgram, bulge: &Vector3<f64>) -> BeltPoint {
    let last = program.pieces.len();
    let at = |node: usize| program.supports.iter().find(|s| s.node == node);
    let (start, end) = (at(0), at(last));
    let slopes = calm_slopes(program);
    let frame = start_frame(program, start, end, bulge);
    let arch = fit_arch(program, &slopes, &frame, start, end, bulge);
    let mut point = arched(program, &arch, &slopes, &frame);
    place(&mut point, start, end);
    point
}

/// The start for a closed belt before it is twisted: a ring or, of a curved board, a cone; on the side where it is nearer to
/// its supports, else the side of its natural bend, else the side of the bulge.
pub(crate) fn ring(program: &BeltProgram, bulge: &Vector3<f64>) -> BeltPoint {
    let start = program.supports.first();
    let frame = start_frame(program, start, None, bulge);
    let curl: f64 = program
        .elements()
        .map(|(_, element)| element.length * element.curl.bend)
        .sum();
    let side = match curl == 0.0 {
        true => -frame.column(0).dot(bulge).signum(),
        false => curl.signum(),
    };
    let slopes = calm_slopes(program);
    let [one, other] = [side, -side].map(|side| {
        let bend = side * (TAU * TAU - total_turn(program).powi(2)).max(0.0).sqrt();
        let field = |slope: &f64| Vector2::new(bend, *slope);
        let fields: Vec<_> = slopes.iter().map(field).collect();
        let pose = Pose {
            frame,
            position: Vector3::zeros(),
        };
        let mut point = BeltPoint {
            poses: vec![pose; fields.len()],
            fields,
        };
        program.settle(&mut point);
        place(&mut point, start, None);
        point
    });
    match program.miss_of_supports(&other) + NEARER < program.miss_of_supports(&one) {
        true => other,
        false => one,
    }
}

/// The start for a closed belt that is to keep more half turns than a ring twisted up keeps: as many bends to and fro as half
/// turns, twisted alike, around an axis about which it looks the same from as many sides.
pub(crate) fn folded_band(
    program: &BeltProgram,
    half_turns: i32,
    bulge: &Vector3<f64>,
) -> BeltPoint {
    /// Amplitude of the bend for each half turn, in rad/U.
    const BEND: f64 = 4.0;
    /// Amplitude of the rib slope, dimensionless.
    const SLOPE: f64 = 0.8;
    let turns = f64::from(half_turns);
    let fields =
        |u: f64| Vector2::new(BEND * turns.abs(), -SLOPE * turns.signum()) * (PI * turns * u).cos();
    waved(program, &ring(program, bulge), 0.0, &fields)
}

/// The belt bent to an arch, from a frame at the origin.
fn arched(program: &BeltProgram, arch: &Arch, slopes: &[f64], frame: &Matrix3<f64>) -> BeltPoint {
    let nodes = program.nodes();
    let field = |(u, slope): (&f64, &f64)| Vector2::new(arch.bend(*u), *slope);
    let start = Pose {
        frame: frame * exp(&Vector3::new(0.0, 0.0, arch.angle(0.0))),
        position: Vector3::zeros(),
    };
    let mut point = BeltPoint {
        fields: nodes.iter().zip(slopes).map(field).collect(),
        poses: vec![start; nodes.len()],
    };
    program.settle(&mut point);
    point
}

/// Disturbs a start or a saddle out of its symmetry by a smooth twist and a sway, by a `share` of the rib bound.
pub(crate) fn disturb(program: &BeltProgram, point: &BeltPoint, share: f64) -> BeltPoint {
    let steepest = PI * (1.0 + 2.0 * 0.7);
    let bound = program
        .elements()
        .map(|(_, element)| 1.0 / element.half_width)
        .fold(f64::INFINITY, f64::min);
    let twist = share * (bound / steepest).min(1.0);
    let calm = calm_slopes(program);
    let mut disturbed = point.clone();
    for ((fields, calm), u) in disturbed.fields.iter_mut().zip(&calm).zip(program.nodes()) {
        let (once, twice) = ((PI * u).sin(), (2.0 * PI * u).sin());
        let sway = Vector2::new(share * twice, twist * (once + 0.7 * twice));
        *fields =
            Vector2::new(0.0, *calm) + (1.0 - share) * (*fields - Vector2::new(0.0, *calm)) + sway;
    }
    inside(program, disturbed)
}

/// A belt with a share of its own bend kept, bend and slope added by u in U, and ribs brought back until they do not cross.
pub(crate) fn waved(
    program: &BeltProgram,
    base: &BeltPoint,
    kept: f64,
    added: &dyn Fn(f64) -> Vector2<f64>,
) -> BeltPoint {
    let mut waved = base.clone();
    for (fields, u) in waved.fields.iter_mut().zip(program.nodes()) {
        fields[0] *= kept;
        *fields += added(u);
    }
    inside(program, waved)
}

/// Whether a belt is flat at a node.
pub(crate) fn is_flat(fields: &Vector2<f64>) -> bool {
    fields[0].abs() <= FLAT
}

/// A belt bent where it is flat, with ribs all sloping one way, near a shape into which a load may buckle it. With no waves
/// the belt is bent to the side of the bulge, most at the start, as a cantilever; with waves it is bent to and fro, as
/// between clamps.
///
/// In the flat state every slope of the ribs costs the same, so that small disturbances do not decide.
pub(crate) fn buckle(
    program: &BeltProgram,
    point: &BeltPoint,
    slope: f64,
    waves: f64,
    bulge: &Vector3<f64>,
) -> BeltPoint {
    let side = -point.poses[0].frame.column(0).dot(bulge).signum();
    let mut buckled = point.clone();
    let calm = calm_slopes(program);
    let board = Headings::of(program);
    let steepest = program
        .elements()
        .map(|(_, element)| 0.5 / element.half_width)
        .fold(f64::INFINITY, f64::min);
    for ((fields, calm), u) in buckled.fields.iter_mut().zip(calm).zip(&board.u) {
        if is_flat(fields) {
            let most = board.to_held(*u) * steepest;
            let bend = match waves == 0.0 {
                true => 1.0 - u,
                false => 4.0 * (TAU * waves * u).cos(),
            };
            *fields = Vector2::new(side * BUCKLED_BEND * bend, calm + slope.clamp(-most, most));
        }
    }
    inside(program, buckled)
}

/// A shape with its ribs a little off the bound, where a barrier can start.
pub(crate) fn inside(program: &BeltProgram, mut point: BeltPoint) -> BeltPoint {
    let calm = calm_slopes(program);
    let wild: Vec<f64> = point.fields.iter().map(|fields| fields[1]).collect();
    let mut share = INTERIOR;
    for _ in 0..HALVINGS {
        for ((fields, calm), wild) in point.fields.iter_mut().zip(&calm).zip(&wild) {
            fields[1] = calm + share * (wild - calm);
        }
        program.settle(&mut point);
        if program.least_slack(&point) > 0.0 {
            break;
        }
        share *= 0.5;
    }
    point
}

/// Frame at u = 0: the frame held there; else the frame from which the flat board ends in the frame held at u = U; else
/// along the chord with the normal toward the bulge.
fn start_frame(
    program: &BeltProgram,
    start: Option<&NodeSupport>,
    end: Option<&NodeSupport>,
    bulge: &Vector3<f64>,
) -> Matrix3<f64> {
    let held = |support: Option<&NodeSupport>| {
        support
            .and_then(|s| s.hold.frame())
            .map(|q| q.to_rotation_matrix().into_inner())
    };
    let turned = |end| end * exp(&(-total_turn(program) * Vector3::x()));
    held(start)
        .or_else(|| held(end).map(turned))
        .unwrap_or_else(|| frame_along(&chord(start, end).unwrap_or_default(), bulge))
}

/// Angle from the heading of the flat board's start to that of its end.
fn total_turn(program: &BeltProgram) -> f64 {
    Headings::of(program).heading.last().copied().unwrap_or(0.0)
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

/// Chord from the start's position to the end's; `None` unless both are held.
fn chord(start: Option<&NodeSupport>, end: Option<&NodeSupport>) -> Option<Vector3<f64>> {
    Some(end?.point()? - start?.point()?)
}

/// The arch whose reach is nearest to the chord, on the side of the bulge. If the belt turns so far that neither side is the
/// bulge's, or the end's frame may be reached either way round, the arch is the least bent of the candidates.
fn fit_arch(
    program: &BeltProgram,
    slopes: &[f64],
    frame: &Matrix3<f64>,
    start: Option<&NodeSupport>,
    end: Option<&NodeSupport>,
    bulge: &Vector3<f64>,
) -> Arch {
    let held = |support: Option<&NodeSupport>| support.and_then(|s| s.hold.frame());
    let flat = UnitQuaternion::from_scaled_axis(total_turn(program) * Vector3::x());
    let gaps = match (held(start), held(end)) {
        (Some(a), Some(b)) => ways_round(&(a.conjugate() * b * flat.conjugate())),
        _ => vec![Vector3::zeros()],
    };
    let chord = chord(start, end);
    let straight = Headings::of(program).is_straight();
    let miss = |arch: &Arch| {
        let Some(chord) = chord else { return 0.0 };
        let reach = match straight {
            true => arch.reach().push(0.0),
            false => {
                let poses = arched(program, arch, slopes, frame).poses;
                frame.tr_mul(&poses.last().map_or(Vector3::zeros(), |pose| pose.position))
            }
        };
        // The miss is not squared: near the inextensible limit it is itself a square of the height.
        match held(start).is_some() {
            true => (reach - frame.tr_mul(&chord)).norm(),
            false => (reach.norm() - chord.norm()).abs(),
        }
    };
    let fitted = |gap: &Vector3<f64>, side: f64| {
        let arch = |height: f64| Arch {
            amplitude: side * height,
            turn: gap.z,
            pinned: held(start).is_none() && held(end).is_none(),
        };
        arch(match chord {
            None => 0.0,
            Some(_) => least(HIGHEST, |height| miss(&arch(height))),
        })
    };
    let ways = gaps.iter().flat_map(|gap| {
        let top = frame * exp(&(0.5 * gap));
        let towards = top.column(0).dot(&bulge.normalize());
        let is_clear = towards.abs() >= 0.5;
        let first = if frame.column(0).dot(bulge) < 0.0 {
            -1.0
        } else {
            1.0
        };
        let sides = [first, -first].map(|side: f64| (side, side * towards));
        let sides = sides
            .into_iter()
            .filter(move |(_, towards)| *towards >= 0.0 || !is_clear);
        sides.map(move |(side, towards)| (gap, side, towards))
    });
    let costed = ways.map(|(gap, side, towards)| {
        let arch = fitted(gap, side);
        (arch.energy() + MISS * miss(&arch) - BULGE * towards, arch)
    });
    // Of two that cost the same but for rounding, the first.
    let best = costed.reduce(|best, next| match best.0 - next.0 > LEVEL * best.0.abs() {
        true => next,
        false => best,
    });
    best.map_or_else(|| fitted(&Vector3::zeros(), 1.0), |(_, arch)| arch)
}

/// The rotation vectors of a rotation, the shorter way and, beyond a quarter turn, the longer. Of half a turn, whose ways are
/// equally long, first the one whose largest component is positive.
fn ways_round(rotation: &UnitQuaternion<f64>) -> Vec<Vector3<f64>> {
    let shorter = log(rotation.to_rotation_matrix().matrix());
    let angle = shorter.norm();
    let longer = shorter * (1.0 - TAU / angle);
    let is_negative = shorter[shorter.iamax()] < 0.0;
    match angle > FRAC_PI_2 + ROUNDING {
        true if is_negative && angle > PI - ROUNDING => vec![longer, shorter],
        true => vec![shorter, longer],
        false => vec![shorter],
    }
}

/// The minimiser of a function of [0, `most`]: the best of a grid, then a golden-section search around it.
fn least(most: f64, f: impl Fn(f64) -> f64) -> f64 {
    let step = most / AMPLITUDES as f64;
    let (mut best, mut value) = (0.0, f64::INFINITY);
    for k in 0..=AMPLITUDES {
        let here = f(k as f64 * step);
        if here < value {
            (best, value) = (k as f64 * step, here);
        }
    }
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let (mut low, mut high) = ((best - step).max(0.0), (best + step).min(most));
    let inner = |low: f64, high: f64| [high - ratio * (high - low), low + ratio * (high - low)];
    let [mut left, mut right] = inner(low, high);
    let (mut at_left, mut at_right) = (f(left), f(right));
    while high - low > NARROW * high + NARROWEST {
        if at_left <= at_right {
            high = right;
            (right, at_right) = (left, at_left);
            left = inner(low, high)[0];
            at_left = f(left);
        } else {
            low = left;
            (left, at_left) = (right, at_right);
            right = inner(low, high)[1];
            at_right = f(right);
        }
    }
    0.5 * (low + high)
}

/// Moves the whole belt so that the start, or else the end, is at its held position.
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
    use crate::problem::program::Hold;
    use crate::problem::program::Piece;
    use crate::strip::developable::DevelopableEnergy;
    use crate::strip::element::Curl;
    use crate::strip::element::Element;

    fn held(node: usize, position: [f64; 3], rotation: Option<[f64; 3]>) -> NodeSupport {
        NodeSupport {
            node,
            position: position.map(Some),
            hold: rotation.map_or(Hold::Free, |r| {
                Hold::Frame(UnitQuaternion::from_scaled_axis(Vector3::from(r)))
            }),
            square_rib: false,
        }
    }

    fn program(supports: Vec<NodeSupport>) -> BeltProgram {
        let element = Element {
            length: 0.025,
            geodesic: 0.0,
            rigidity: [1.0; 2],
            half_width: 0.05,
            curl: Curl::default(),
            stretching: f64::INFINITY,
        };
        BeltProgram::new(
            vec![Piece::Strip(element); 40],
            DevelopableEnergy::Wunderlich,
        )
        .with_supports(supports)
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
        assert!(program.least_slack(&disturbed) > 0.0);
        assert_eq!((disturbed.fields[0][1], disturbed.poses.len()), (0.0, 41));
        assert!(disturbed.poses[20].position.z.abs() > 1e-3);
    }

    /// A belt of strips (length, in-plane curvature) and bends (angle) between clamps.
    fn board(strips: &[(f64, f64)], bend: f64) -> BeltProgram {
        let mut pieces = Vec::new();
        for (i, (length, geodesic)) in strips.iter().enumerate() {
            if i > 0 {
                pieces.push(Piece::Joint { angle: bend });
            }
            let element = Element {
                length: length / 40.0,
                geodesic: *geodesic,
                rigidity: [1.0; 2],
                half_width: 0.05,
                curl: Curl::default(),
                stretching: f64::INFINITY,
            };
            pieces.extend([Piece::Strip(element); 40]);
        }
        let mut supports = vec![
            held(0, [0.0; 3], Some([0.0; 3])),
            held(pieces.len(), [0.0, 0.4, 0.0], Some([0.0; 3])),
        ];
        for support in &mut supports {
            support.square_rib = true;
        }
        BeltProgram::new(pieces, DevelopableEnergy::Wunderlich).with_supports(supports)
    }

    #[test]
    fn test_start_has_no_ribs_that_cross_whatever_the_board() {
        let boards = [
            board(&[(0.5, 0.0), (0.5, 0.0)], 1.57),
            board(&[(0.4, 0.0), (0.2, 0.0), (0.4, 0.0)], -2.0),
            board(&[(0.5, 0.0), (0.5, 0.0)], 2.09),
            board(&[(0.45, 0.0), (0.02, 60.0), (0.53, 0.0)], 0.0),
            board(&[(1.0, 12.0)], 0.0),
        ];
        for program in boards {
            let start = guess(&program, &Vector3::x());
            assert!(program.least_slack(&start) > 0.05);
            assert!(program.least_slack(&disturb(&program, &start, 0.4)) > 0.0);
        }
    }

    #[test]
    fn test_ribs_of_a_gentle_arc_start_square() {
        let slopes = calm_slopes(&board(&[(1.0, 1.4)], 0.0));
        assert!(slopes.iter().all(|slope| slope.abs() < 1e-5));
    }
}
