//! The source's own method: Ritz's method in Eulerian angles with the multiplier method, for one straight belt
//! clamped at both ends.
//!
//! The method is kept to show the results of the source, and does not lead to an accurate shape. Four functions stand for
//! two free ones, so Eq. (25) and (32) are constraints; with the source's numbers 43 equations, 41 or 42 of them
//! independent, meet 40 coefficients, and no exact solution exists. The result is a compromise that depends on the penalty
//! and the start. [`Violation`] reports its residuals: at the collocation points, and along the belt in between, where the
//! examples miss Eq. (25) by some tens of times more. There is no status "converged", and with multiplier updates or high
//! penalties the last bits of the input can decide between many compromises.
//!
//! Lengths are in U, energies in R_f/U, and the start frame is the coordinate system.
//!
//! Source: Sec. III-A, Eq. (37)–(43)

mod basis;
pub(crate) mod equilibrium;
mod lagrangian;
mod local;
mod newton;

use crate::scenario::RitzSpec;
use crate::strip::developable::DevelopableEnergy;
use basis::{FIELDS, localiser, quadrature};
use lagrangian::Lagrangian;
use local::Local;
use nalgebra::{DMatrix, DVector, Matrix3, Vector2, Vector3};
use newton::{Minimum, minimise};
use std::f64::consts::PI;
use std::iter::successors;
use std::ops::ControlFlow;

/// The one of two mirror images to which the automatic start leans.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Side {
    /// Towards +ξ of the start frame.
    #[default]
    Plus,
    /// Towards −ξ of the start frame.
    Minus,
}

impl Side {
    fn sign(self) -> f64 {
        match self {
            Self::Plus => 1.0,
            Self::Minus => -1.0,
        }
    }
}

/// Prescribed orientation of the end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Orientation {
    /// Eulerian angles φ, θ, ψ, as in Eq. (46).
    Angles([f64; 3]),
    /// Frame [ξ η ζ], as in Eq. (49): whichever Eulerian angles belong to it.
    Frame(Matrix3<f64>),
}

impl Orientation {
    /// The form in which the source prescribes this frame: the angles where it is the natural one, else the frame.
    ///
    /// At the natural frame the angles are singular, and φ = θ = ψ = 0 is more than the frame requires: φ could go on to ±π,
    /// compensated by ψ.
    ///
    /// Source: Eq. (46), (49)
    pub(crate) fn as_in_source(frame: &Matrix3<f64>) -> Self {
        if (frame - Matrix3::identity()).amax() < 1e-12 {
            return Self::Angles([0.0; 3]);
        }
        Self::Frame(*frame)
    }
}

/// The boundary value problem of the method.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// Width over length, V/U.
    pub width_over_length: f64,
    /// Position of the end, x(U).
    pub end_position: Vector3<f64>,
    /// Orientation of the end.
    pub end_orientation: Orientation,
    /// Energy model.
    pub energy: DevelopableEnergy,
    /// Side to which the belt bulges.
    pub bulge: Side,
}

/// Numbers of the method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Basis functions for each of φ, θ, ψ, β; at least 6.
    pub basis: usize,
    /// Collocation points of Eq. (25), (32), (33); at least 2. With too few points for the basis the belt may break the
    /// conditions in between: see [`Solution::violation_along`].
    pub points: usize,
    /// Penalty factor ρ of Eq. (25), (32), (33): a residual g at a point costs ρ g²/2. Positive.
    pub penalty: f64,
    /// Multiplier updates; 0 is the plain penalty method.
    pub updates: usize,
}

impl From<&RitzSpec> for Options {
    fn from(spec: &RitzSpec) -> Self {
        Self {
            basis: spec.basis,
            points: spec.points,
            penalty: spec.penalty,
            updates: spec.updates,
        }
    }
}

impl Default for Options {
    /// The source's numbers, and the penalty that reproduces its printed shapes.
    fn default() -> Self {
        Self::from(&RitzSpec::default())
    }
}

/// Residuals of the conditions, as max-norms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Violation {
    /// Eq. (44)–(50): position in U, orientation in rad, rib slope.
    pub geometric: f64,
    /// Eq. (25): the in-plane curvature ω_ξ, in rad/U.
    pub geodesic: f64,
    /// Eq. (32): ω_η + ω_ζ β, in rad/U.
    pub rib_slope: f64,
    /// Eq. (33): |β'| above 2/V, in 1/U.
    pub rib_crossing: f64,
}

impl Violation {
    /// The largest of all.
    pub(crate) fn max(&self) -> f64 {
        [
            self.geometric,
            self.geodesic,
            self.rib_slope,
            self.rib_crossing,
        ]
        .into_iter()
        .fold(0.0, f64::max)
    }
}

/// The compromise found, with lengths in U and energy in R_f/U.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// Coefficients a^φ, a^θ, a^ψ, a^β, one column each.
    ///
    /// Shapes: (n, 4).
    pub coefficients: DMatrix<f64>,
    /// Elastic energy, Eq. (34).
    pub energy: f64,
    /// Residuals at the collocation points, where the method imposes the conditions.
    pub violation: Violation,
    /// Residuals along the whole belt.
    pub violation_along: Violation,
    /// Penalty factor used.
    pub penalty: f64,
    /// Multiplier updates made.
    pub updates: usize,
    /// Largest derivative of the augmented Lagrangian by a coefficient.
    pub stationarity: f64,
    /// Newton iterations of all inner minimisations.
    pub iterations: usize,
    /// Whether the last inner minimisation met its gradient tolerance, whatever the violation.
    pub stationary: bool,
    /// Whether the caller, or the budget of iterations, cut the solve short.
    pub cut_short: bool,
}

impl Solution {
    /// Eulerian angles φ, θ, ψ at u.
    pub(crate) fn euler(&self, u: f64) -> [f64; 3] {
        local::euler(&self.local(u))
    }

    /// Rib slope β at u.
    pub(crate) fn rib_slope(&self, u: f64) -> f64 {
        self.local(u)[6]
    }

    /// Body rates ω_ξ, ω_η, ω_ζ at u.
    ///
    /// Units: rad/U.
    /// Source: Eq. (4)
    pub(crate) fn rates(&self, u: f64) -> Vector3<f64> {
        local::rates(&self.local(u)).into()
    }

    /// Frame [ξ η ζ] at u.
    ///
    /// Source: Eq. (1), (2)
    pub(crate) fn frame(&self, u: f64) -> Matrix3<f64> {
        local::frame(self.euler(u))
    }

    /// Positions of the spine at each of `u`.
    ///
    /// Source: Eq. (3)
    pub(crate) fn positions(&self, u: &[f64]) -> Vec<Vector3<f64>> {
        let rule = quadrature(self.coefficients.nrows());
        let tangent = |u: f64| self.frame(u).column(1).into_owned();
        let position = |&u: &f64| rule.iter().map(|(s, w)| tangent(u * s) * (u * w)).sum();
        u.iter().map(position).collect()
    }

    fn local(&self, u: f64) -> Local<f64> {
        let coefficients = DVector::from_column_slice(self.coefficients.as_slice());
        let local = localiser(self.coefficients.nrows(), u) * coefficients;
        Local::from_column_slice(local.as_slice())
    }
}

/// Iterations after which an inner minimisation is given up, a number.
const ITERATION_LIMIT: usize = 2000;

/// Violation of the clamps at which their multipliers are no longer updated, in U, rad and a number.
const CLAMP_TOLERANCE: f64 = 1e-8;

/// Updates of the clamps' multipliers, the greatest count, a number.
const CLAMP_UPDATES: usize = 50;

/// Penalty from which the automatic start climbs, in R_f/U.
const SOFTEST_PENALTY: f64 = 0.1;

/// Iterations over all stages and updates after which a solve is cut short, a number.
const BUDGET: usize = 10_000;

/// Solves from the automatic start, with the penalty climbing by decades to the penalty of the options.
///
/// At once at a high penalty the method locks near its start; climbing, it locks later.
///
/// Panics: on options out of their ranges.
pub fn solve(
    problem: &Problem,
    options: &Options,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Solution {
    let mut left = BUDGET;
    let proceed = &mut || {
        left = left.saturating_sub(1);
        if left == 0 {
            ControlFlow::Break(())
        } else {
            proceed()
        }
    };
    let (mut coefficients, mut iterations) = (start(problem, options), 0);
    for penalty in climb(options.penalty) {
        let stage = Options {
            penalty,
            updates: 0,
            ..*options
        };
        let solution = solve_from(problem, &stage, &coefficients, proceed);
        iterations += solution.iterations;
        if solution.cut_short {
            return Solution {
                iterations,
                ..solution
            };
        }
        coefficients = solution.coefficients;
    }
    let solution = solve_from(problem, options, &coefficients, proceed);
    Solution {
        iterations: iterations + solution.iterations,
        ..solution
    }
}

/// The penalties on the way to a given penalty.
fn climb(penalty: f64) -> impl Iterator<Item = f64> {
    let decades = successors(Some(SOFTEST_PENALTY), |softer| Some(10.0 * softer));
    // A decade that rounding leaves just below the goal is the goal.
    decades.take_while(move |softer| *softer < 0.99 * penalty)
}

/// Solves from given coefficients, such as those of a solution with a smaller penalty.
///
/// Shapes: coefficients (n, 4).
/// Source: Sec. III-A
///
/// Panics: on options out of their ranges or coefficients of another shape.
pub fn solve_from(
    problem: &Problem,
    options: &Options,
    coefficients: &DMatrix<f64>,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Solution {
    check(options);
    assert_eq!(
        coefficients.shape(),
        (options.basis, FIELDS),
        "shape of the coefficients"
    );
    let mut lagrangian = Lagrangian::new(problem, options);
    let x = DVector::from_column_slice(coefficients.as_slice());
    let mut minimum = clamped(&mut lagrangian, x, proceed);
    let mut updates = 0;
    while updates < options.updates && !minimum.interrupted {
        lagrangian.update_ribs(&minimum.x);
        minimum = clamped(&mut lagrangian, minimum.x.clone(), proceed).after(minimum);
        updates += 1;
    }
    solution(problem, options, updates, minimum)
}

fn check(options: &Options) {
    assert!(options.basis >= 6, "at least 6 basis functions");
    assert!(options.points >= 2, "at least 2 collocation points");
    assert!(options.penalty > 0.0, "a positive penalty");
}

/// Minimises, with the multipliers of the clamps updated until the clamps hold.
fn clamped(
    lagrangian: &mut Lagrangian,
    x: DVector<f64>,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Minimum {
    let tolerance = lagrangian.tolerance();
    let mut minimum = minimise(lagrangian, x, tolerance, ITERATION_LIMIT, proceed);
    for _ in 0..CLAMP_UPDATES {
        if minimum.interrupted || lagrangian.violation(&minimum.x).geometric <= CLAMP_TOLERANCE {
            break;
        }
        lagrangian.update_clamps(&minimum.x);
        minimum = minimise(
            lagrangian,
            minimum.x.clone(),
            tolerance,
            ITERATION_LIMIT,
            proceed,
        )
        .after(minimum);
    }
    minimum
}

/// Points at which the violation along the whole belt is evaluated, a number.
const DENSE: usize = 601;

fn solution(problem: &Problem, options: &Options, updates: usize, minimum: Minimum) -> Solution {
    let lagrangian = Lagrangian::new(problem, options);
    let dense = Options {
        points: DENSE,
        ..*options
    };
    Solution {
        coefficients: DMatrix::from_column_slice(options.basis, FIELDS, minimum.x.as_slice()),
        energy: lagrangian.energy(&minimum.x),
        violation: lagrangian.violation(&minimum.x),
        violation_along: Lagrangian::new(problem, &dense).violation(&minimum.x),
        penalty: options.penalty,
        updates,
        stationarity: minimum.gradient,
        iterations: minimum.iterations,
        stationary: minimum.stationary,
        cut_short: minimum.interrupted,
    }
}

/// Coefficients of the automatic start: an arch of the right span, on top of a uniform turn towards the end's frame.
///
/// With θ = 0 all along, φ and ψ would be the same turn and the Hessian singular; so the arch leans a little.
///
/// Shapes: (n, 4).
///
/// Panics: on options out of their ranges.
pub(crate) fn start(problem: &Problem, options: &Options) -> DMatrix<f64> {
    /// Lean of the arch out of its plane, in rad.
    const LEAN: f64 = 0.1;
    check(options);
    let turn = turn(problem);
    let side = problem.bulge.sign();
    let arch = -0.5 * side * arch(problem.end_position.norm(), turn[0] + turn[2]);
    let mut coefficients = DMatrix::zeros(options.basis, FIELDS);
    for (field, angle) in turn.into_iter().enumerate() {
        coefficients[(LINEAR, field)] = angle;
    }
    coefficients[(WAVE, 0)] = arch;
    coefficients[(WAVE, 2)] = arch;
    coefficients[(CONSTANT, 1)] = -side * LEAN;
    coefficients[(WAVE + 1, 1)] = side * LEAN;
    coefficients
}

/// Row of the coefficients of 1, an index.
const CONSTANT: usize = 0;
/// Row of the coefficients of u, an index.
const LINEAR: usize = 1;
/// Row of the coefficients of sin 2πu, which the row of cos 2πu follows; an index.
const WAVE: usize = 4;

/// Eulerian angles of the end to start from.
///
/// A turn in the plane if it is within a right angle of the end's frame, for it bends the belt only; else the frame's own
/// angles.
fn turn(problem: &Problem) -> [f64; 3] {
    match &problem.end_orientation {
        Orientation::Angles(angles) => *angles,
        Orientation::Frame(frame) => {
            let heading = heading(problem, frame);
            let planar = [0.5 * heading, 0.0, 0.5 * heading];
            let cosine = 0.5 * (frame.tr_mul(&local::frame(planar)).trace() - 1.0);
            if cosine > 0.0 {
                planar
            } else {
                euler(frame, problem.bulge.sign())
            }
        }
    }
}

/// Angle about z that turns the start's tangent towards the end's.
///
/// A half-turn can be made either way; the way towards the end's position is taken.
fn heading(problem: &Problem, frame: &Matrix3<f64>) -> f64 {
    let heading = (-frame.m12).atan2(frame.m22);
    if PI - heading.abs() > 1e-6 {
        return heading;
    }
    let x = problem.end_position.x;
    let side = if x.abs() > 1e-6 {
        x.signum()
    } else {
        problem.bulge.sign()
    };
    -side * heading.abs()
}

/// Eulerian angles of a frame that is not natural, with θ of the given sign.
///
/// Source: Eq. (1)
fn euler(frame: &Matrix3<f64>, sign: f64) -> [f64; 3] {
    let theta = sign * frame.m33.clamp(-1.0, 1.0).acos();
    if frame.m13.hypot(frame.m23) < 1e-6 {
        // Only φ − ψ is determined where the belt's width points backwards.
        return [(-frame.m21).atan2(-frame.m11), theta, 0.0];
    }
    let phi = (sign * frame.m23).atan2(sign * frame.m13);
    let psi = (sign * frame.m32).atan2(-sign * frame.m31);
    [phi, theta, psi]
}

/// Amplitude a at which the heading `turn` u + a sin(2πu) spans `chord`.
fn arch(chord: f64, turn: f64) -> f64 {
    // The ends of the arch without a turn meet at the first zero of the Bessel function J₀, 2.405.
    let (mut low, mut high) = (0.0, 2.405);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if span(middle, turn) > chord {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Distance of the ends of an arch whose heading is `turn` u + a sin(2πu).
fn span(amplitude: f64, turn: f64) -> f64 {
    let tangent = |(u, weight): (f64, f64)| {
        let (sine, cosine) = (turn * u + amplitude * (2.0 * PI * u).sin()).sin_cos();
        Vector2::new(-sine, cosine) * weight
    };
    let chord: Vector2<f64> = quadrature(1).into_iter().map(tangent).sum();
    chord.norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use std::f64::consts::FRAC_PI_6;

    /// Examples 1 and 2 of the source.
    pub(super) fn examples() -> [Problem; 2] {
        let tilt = nalgebra::Rotation3::from_axis_angle(&Vector3::x_axis(), FRAC_PI_6);
        let clamped = |position, frame| Problem {
            width_over_length: 0.1,
            end_position: position,
            end_orientation: Orientation::as_in_source(&frame),
            energy: DevelopableEnergy::Fishbone,
            bulge: Side::Plus,
        };
        [
            clamped(Vector3::new(0.0, 0.5, 0.1), Matrix3::identity()),
            clamped(Vector3::new(0.0, 0.7, 0.0), tilt.into_inner()),
        ]
    }

    fn solved(problem: &Problem, options: &Options) -> Solution {
        solve(problem, options, &mut || ControlFlow::Continue(()))
    }

    fn soft() -> Options {
        Options {
            penalty: 1.0,
            ..Options::default()
        }
    }

    /// The point of the spine farthest along ξ of the start, of either sign.
    fn peak(solution: &Solution) -> Vector3<f64> {
        let u: Vec<f64> = (0..=200).map(|i| i as f64 / 200.0).collect();
        let highest = |a: &Vector3<f64>, b: &Vector3<f64>| a.x.abs().total_cmp(&b.x.abs());
        solution.positions(&u).into_iter().max_by(highest).unwrap()
    }

    #[test]
    fn printed_digits_come_out_at_the_default_penalty() {
        let [first, second] = examples().map(|problem| solved(&problem, &Options::default()));
        assert_eq!(format!("{:.2}", peak(&first).x), "0.35");
        let [x, y, z] = peak(&second).into();
        assert_eq!(format!("{x:.1} {y:.1} {z:.2}"), "0.3 0.4 -0.01");
        for solution in [first, second] {
            assert!(solution.stationary);
            assert!(solution.violation.geometric < 1e-6);
            assert!(solution.violation.max() > 0.02, "no exact solution exists");
        }
    }

    #[test]
    fn example_1_locks_as_the_penalty_rises() {
        let [problem, _] = examples();
        let [soft, middling, stiff, stiffest] =
            [1.0, 1e2, 1e4, 1e6].map(|penalty| solved(&problem, &Options { penalty, ..soft() }));
        for (softer, stiffer) in [(&soft, &middling), (&middling, &stiff), (&stiff, &stiffest)] {
            assert!(stiffer.violation.max() < softer.violation.max());
            assert!(stiffer.energy > softer.energy);
            assert!(peak(stiffer).x < peak(softer).x);
        }
        assert!(stiffest.energy > 2.0 * soft.energy);
    }

    #[test]
    fn multipliers_do_not_drive_the_violation_to_zero() {
        let [problem, _] = examples();
        let options = Options {
            updates: 10,
            ..Options::default()
        };
        let solution = solved(&problem, &options);
        assert_eq!(solution.updates, 10);
        assert!(solution.violation.max() > 1e-2);
    }

    #[test]
    fn conditions_are_missed_by_far_more_between_the_points() {
        for problem in examples() {
            let solution = solved(&problem, &Options::default());
            assert!(solution.violation_along.max() > 10.0 * solution.violation.max());
        }
    }

    #[test]
    fn solves_are_identical_bit_by_bit() {
        let [_, problem] = examples();
        let [one, two] = [(), ()].map(|()| solved(&problem, &soft()));
        assert_eq!(one, two);
    }

    #[test]
    fn mirror_images_have_the_same_energy() {
        let [problem, _] = examples();
        let mirrored = Problem {
            bulge: Side::Minus,
            ..problem.clone()
        };
        let [one, two] = [problem, mirrored].map(|problem| solved(&problem, &soft()));
        assert_relative_eq!(one.energy, two.energy, max_relative = 1e-9);
        assert_relative_eq!(peak(&one).x, -peak(&two).x, epsilon = 1e-6);
        assert!(peak(&one).x > 0.3);
    }

    #[test]
    fn every_energy_can_be_minimised() {
        let [problem, _] = examples();
        let minimum = |energy| {
            let problem = Problem {
                energy,
                ..problem.clone()
            };
            let solution = solved(&problem, &soft());
            assert!(solution.stationary);
            solution.energy
        };
        let sadowsky = minimum(DevelopableEnergy::Sadowsky);
        assert!(sadowsky < minimum(DevelopableEnergy::Fishbone));
        assert!(sadowsky < minimum(DevelopableEnergy::Wunderlich));
    }

    #[test]
    fn energy_is_that_of_the_reported_fields() {
        let [problem, _] = examples();
        let solution = solved(&problem, &soft());
        let density = |u: f64| {
            let stretch = 1.0 + solution.rib_slope(u).powi(2);
            0.5 * stretch.sqrt() * (solution.rates(u).z * stretch).powi(2)
        };
        let cells = 2000;
        let middles = (0..cells).map(|i| (i as f64 + 0.5) / cells as f64);
        let energy: f64 = middles.map(density).sum::<f64>() / cells as f64;
        assert_relative_eq!(solution.energy, energy, max_relative = 1e-5);
    }

    #[test]
    fn belts_start_and_end_where_they_were_asked_to() {
        for problem in examples() {
            let solution = solved(&problem, &soft());
            let positions = solution.positions(&[0.0, 1.0]);
            assert_eq!(positions[0], Vector3::zeros());
            assert_relative_eq!(positions[1], problem.end_position, epsilon = 1e-7);
            assert_relative_eq!(solution.frame(0.0), Matrix3::identity(), epsilon = 1e-7);
            if let Orientation::Frame(frame) = problem.end_orientation {
                assert_relative_eq!(solution.frame(1.0), frame, epsilon = 1e-7);
            }
        }
    }

    #[test]
    fn ends_out_of_reach_stay_missed() {
        let problem = Problem {
            end_position: Vector3::new(0.0, 1.2, 0.0),
            ..examples()[0].clone()
        };
        let solution = solved(&problem, &soft());
        assert!(solution.violation.geometric > 0.19);
    }

    #[test]
    fn callers_can_break_off() {
        let [problem, _] = examples();
        let mut asked = 0;
        let mut proceed = || {
            asked += 1;
            match asked {
                6 => ControlFlow::Break(()),
                _ => ControlFlow::Continue(()),
            }
        };
        let solution = solve(&problem, &Options::default(), &mut proceed);
        assert!(solution.cut_short && !solution.stationary);
        assert_eq!((solution.iterations, solution.updates), (5, 0));
    }

    #[test]
    fn start_spans_the_distance_of_the_ends() {
        for chord in [0.1, 0.5, 0.9] {
            for turn in [0.0, 0.5] {
                assert_relative_eq!(span(arch(chord, turn), turn), chord, epsilon = 1e-9);
            }
        }
    }

    /// Turns in the plane, half-turns about every axis, and something crooked.
    fn frames() -> impl Iterator<Item = Matrix3<f64>> {
        let turns = [
            Vector3::z() * PI,
            Vector3::z() * -2.0,
            Vector3::x() * PI,
            Vector3::y() * PI,
            Vector3::y() * 1.2,
            Vector3::new(0.5, -2.0, 1.0),
        ];
        turns
            .into_iter()
            .map(|turn| nalgebra::Rotation3::new(turn).into_inner())
    }

    #[test]
    fn start_comes_within_a_right_angle_of_every_frame() {
        for frame in frames() {
            for bulge in [Side::Plus, Side::Minus] {
                let problem = Problem {
                    end_orientation: Orientation::Frame(frame),
                    bulge,
                    ..examples()[0].clone()
                };
                let reached = local::frame(turn(&problem));
                assert!(frame.tr_mul(&reached).trace() > 1.0 - 1e-9);
            }
        }
    }

    #[test]
    fn every_end_frame_is_reached() {
        for frame in frames() {
            let problem = Problem {
                end_position: Vector3::new(0.3, 0.2, 0.1),
                end_orientation: Orientation::Frame(frame),
                ..examples()[0].clone()
            };
            let solution = solved(&problem, &soft());
            assert!(solution.stationary);
            assert_relative_eq!(solution.frame(1.0), frame, epsilon = 1e-6);
        }
    }

    #[test]
    #[should_panic = "at least 2 collocation points"]
    fn options_out_of_range_are_refused() {
        let [problem, _] = examples();
        let options = Options {
            points: 1,
            ..Options::default()
        };
        solved(&problem, &options);
    }
}
