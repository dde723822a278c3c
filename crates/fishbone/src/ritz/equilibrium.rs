//! The source's own method, its result reported as an equilibrium.

use crate::equilibrium::{Equilibrium, Status};
use crate::geometry::{Pose, exp, log};
use crate::problem::Problem;
use crate::ritz::{self, Options, Orientation, Side, Solution};
use crate::strip::spine::{Piece, Spine};
use nalgebra::Vector3;
use stagewise::Residuals;
use std::ops::ControlFlow;
use std::sync::OnceLock;

/// Solves a belt clamped at both ends.
pub(crate) fn solve(
    problem: &Problem,
    [start, end]: &[Pose; 2],
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    let (scenario, length) = (problem.scenario(), problem.units().length);
    let to_end = start.inverse() * *end;
    let clamped = ritz::Problem {
        width_over_length: problem.belt().width / length,
        end_position: to_end.position / length,
        end_orientation: Orientation::as_in_source(&to_end.frame),
        energy: scenario.energy_model().developable(),
        bulge: side(start, &to_end, &problem.bulge()),
    };
    let options = Options::from(&scenario.solver.ritz);
    let solution = ritz::solve(&clamped, &options, proceed);
    report(problem, start, &solution)
}

/// The side of the start frame on which the bulge lies, judged by the normal half way to the end.
fn side(start: &Pose, to_end: &Pose, bulge: &Vector3<f64>) -> Side {
    let middle = start.frame * exp(&(0.5 * log(&to_end.frame)));
    if middle.column(0).dot(bulge) < 0.0 {
        Side::Minus
    } else {
        Side::Plus
    }
}

fn report(problem: &Problem, start: &Pose, solution: &Solution) -> Equilibrium {
    let units = problem.units();
    let count = problem.elements();
    let u: Vec<f64> = (0..=count).map(|k| k as f64 / count as f64).collect();
    let pose = |(u, position): (&f64, Vector3<f64>)| {
        *start
            * Pose {
                frame: solution.frame(*u),
                position: position * units.length,
            }
    };
    let rate = |i: usize| u.iter().map(move |u| solution.rates(*u)[i] / units.length);
    let energy = solution.energy * units.energy;
    let (status, message) = match problem.unreachable_supports() {
        Some(too_far) => (Status::Infeasible, too_far.to_string()),
        None => (Status::NotConverged, message(solution)),
    };
    Equilibrium {
        error: OnceLock::from(None),
        problem: problem.clone(),
        status,
        message,
        warnings: Vec::new(),
        energy,
        elastic_energy: energy,
        torsion: rate(1).collect(),
        spine: Spine {
            width: problem.belt().width,
            pieces: vec![Piece::Strip { geodesic: 0.0 }; count],
            half_turns: None,
            pose: u.iter().zip(solution.positions(&u)).map(pose).collect(),
            bend: rate(2).collect(),
            rib_slope: u.iter().map(|u| solution.rib_slope(*u)).collect(),
            curved: None,
            u: u.iter().map(|u| u * units.length).collect(),
        },
        internal: Vec::new(),
        reactions: Vec::new(),
        links: Vec::new(),
        half_turns: None,
        stability: None,
        residuals: Residuals {
            stationarity: solution.stationarity,
            constraint: solution.violation_along.max(),
            complementarity: 0.0,
        },
        iterations: solution.iterations,
        solved: None,
    }
}

fn message(solution: &Solution) -> String {
    let (points, along) = (&solution.violation, &solution.violation_along);
    let ended = if solution.cut_short {
        "cut short"
    } else {
        "ended"
    };
    format!(
        "the source's method does not solve its own equations, of which there are more than unknowns: {ended} with Eq. \
         (25) missed by {:.2e} and Eq. (32) by {:.2e} rad/U at the collocation points, by {:.2e} and {:.2e} between \
         them; for an equilibrium use solver.method = \"intrinsic\"",
        points.geodesic, points.rib_slope, along.geodesic, along.rib_slope
    )
}
