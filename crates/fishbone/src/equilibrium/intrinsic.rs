//! The intrinsic method: the interior-point search in the two fields bend and rib slope.

use super::{Equilibrium, Reaction, Status, Units, Wrench};
use crate::belt::Belt;
use crate::guess::{disturb, guess};
use crate::lie::Pose;
use crate::program::{BeltPoint, BeltProgram, NodeSupport};
use crate::scenario::{Scenario, SupportSpec};
use crate::solver::{self, Curvature, Outcome, Settings, Solution};
use crate::spine::Spine;
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use std::ops::ControlFlow;

/// First barrier: so high that the search first finds the supports, then lowers the energy.
const BARRIER: f64 = 10.0;
const ITERATIONS: usize = 500;
/// By how much the start is disturbed where the plain one leads to no minimum.
const DISTURBANCES: [f64; 3] = [0.05, 0.2, 0.4];

/// Finds a minimum of the energy in the two fields.
pub(super) fn solve(
    scenario: &Scenario,
    belt: &Belt,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    let units = Units::of(belt);
    let program = program(scenario, belt);
    let start = guess(&program, &Vector3::from(scenario.solver.bulge));
    let settings = Settings {
        tolerance: scenario.solver.tolerance,
        iterations: ITERATIONS,
        barrier: BARRIER,
    };
    let excess = excess_distance(scenario, belt.length());
    let solution = match excess {
        Some(_) => search(
            &program,
            &Settings {
                iterations: 0,
                ..settings
            },
            &start,
            proceed,
        ),
        None => search(&program, &settings, &start, proceed),
    };
    let (status, message) = match excess {
        Some(message) => (Status::Infeasible, message),
        None => judge(&solution, settings.tolerance),
    };
    let energy = solution.values.objective * units.energy;
    let spine = units.spine(&program, &solution.point, belt.width);
    let internal = program.internal(&solution.point, &solution.multipliers);
    let stable = stable(status, solution.curvature);
    Equilibrium {
        status,
        message,
        warnings: warnings(&program, stable),
        energy,
        elastic_energy: energy,
        torsion: spine.torsion(),
        spine,
        internal: internal.into_iter().map(|w| units.wrench(w)).collect(),
        reactions: reactions(scenario, &program, &solution, units),
        stable,
        residuals: solution.residuals,
        iterations: solution.iterations,
        scenario: scenario.clone(),
    }
}

/// The programme of a scenario, lengths in U and energy in mean R_f/U.
fn program(scenario: &Scenario, belt: &Belt) -> BeltProgram {
    let elements = belt.elements(scenario.elements());
    let last = elements.len();
    let mut supports: Vec<NodeSupport> = scenario
        .supports
        .iter()
        .map(|support| node_support(support, belt.length(), last))
        .collect();
    if supports.is_empty() {
        supports.push(NodeSupport {
            node: 0,
            position: [Some(0.0); 3],
            frame: Some(UnitQuaternion::identity()),
            square_rib: false,
        });
    }
    BeltProgram {
        elements,
        model: scenario.energy,
        supports,
    }
}

/// The conditions of a support at one of the two ends.
fn node_support(support: &SupportSpec, length: f64, last: usize) -> NodeSupport {
    let at_start = support.at.arc_length(length) < 0.5 * length;
    let quaternion =
        |frame| UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(frame));
    NodeSupport {
        node: if at_start { 0 } else { last },
        position: support.components().map(|held| Some(held? / length)),
        frame: support.frame().map(quaternion),
        square_rib: support.is_square_rib(length),
    }
}

/// Arc length of every node, in U.
fn nodes(program: &BeltProgram) -> Vec<f64> {
    let mut u = 0.0;
    let mut nodes = vec![u];
    for element in &program.elements {
        u += element.length;
        nodes.push(u);
    }
    nodes[program.elements.len()] = 1.0;
    nodes
}

/// Says by how much two supports are too far apart for the belt between them, where they are.
fn excess_distance(scenario: &Scenario, length: f64) -> Option<String> {
    const ROUNDING: f64 = 1e-12;
    let held: Vec<(f64, Vector3<f64>)> = scenario
        .supports
        .iter()
        .filter_map(|s| Some((s.at.arc_length(length), s.point()?)))
        .collect();
    held.windows(2).find_map(|pair| {
        let ((u, x), (u_next, x_next)) = (pair[0], pair[1]);
        let (distance, between) = ((x_next - x).norm(), u_next - u);
        (distance > between * (1.0 + ROUNDING)).then(|| {
            format!(
                "supports at u = {u} and u = {u_next} are {distance:.6} apart, {:.6} more than the belt between them \
                 ({between}); move them closer",
                distance - between
            )
        })
    })
}

/// Searches from the start, then from disturbed ones, until a minimum is found; the best that was found otherwise.
fn search(
    program: &BeltProgram,
    settings: &Settings,
    start: &BeltPoint,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Solution<BeltPoint> {
    let mut best = solver::minimise(program, settings, start.clone(), proceed);
    for share in DISTURBANCES {
        let done = match best.outcome {
            Outcome::Interrupted => true,
            Outcome::Converged => best.curvature != Curvature::Negative,
            _ => settings.iterations == 0,
        };
        if done {
            break;
        }
        let from = if best.outcome == Outcome::Converged {
            &best.point
        } else {
            start
        };
        let from = disturb(program, from, share);
        let mut next = solver::minimise(program, settings, from, proceed);
        next.iterations += best.iterations;
        if rank(&next) >= rank(&best) {
            best = next;
        } else {
            best.iterations = next.iterations;
        }
    }
    best
}

/// The better of two ends has the higher rank: a minimum, another equilibrium, anything else.
fn rank(solution: &Solution<BeltPoint>) -> u8 {
    match (solution.outcome, solution.curvature) {
        (Outcome::Converged, Curvature::Positive | Curvature::Marginal) => 2,
        (Outcome::Converged, Curvature::Negative) => 1,
        _ => 0,
    }
}

/// Status and message of a search that was not infeasible from the outset.
fn judge(solution: &Solution<BeltPoint>, tolerance: f64) -> (Status, String) {
    let largest = solution.residuals.largest();
    let (iterations, violation) = (solution.iterations, solution.residuals.constraint);
    match solution.outcome {
        Outcome::Converged => (
            Status::Converged,
            format!("converged in {iterations} iterations, largest residual {largest:.1e}"),
        ),
        Outcome::IterationLimit => (
            Status::NotConverged,
            format!(
                "largest residual {largest:.1e} after {iterations} iterations, more than the tolerance {tolerance:.1e}; \
                 try another solver.bulge or more solver.elements"
            ),
        ),
        Outcome::LocallyInfeasible => (
            Status::NotConverged,
            format!(
                "no shape found that meets the supports, the nearest misses them by {violation:.1e} (lengths in U, \
                 angles in rad); move the supports closer, try another solver.bulge or more solver.elements"
            ),
        ),
        Outcome::Unbounded => (
            Status::NotConverged,
            format!(
                "the energy gives no direction to go after {iterations} iterations, largest residual {largest:.1e}; \
                 try another solver.bulge or more solver.elements"
            ),
        ),
        Outcome::Interrupted => (
            Status::NotConverged,
            format!("interrupted after {iterations} iterations, largest residual {largest:.1e}"),
        ),
    }
}

fn warnings(program: &BeltProgram, stable: Option<bool>) -> Vec<String> {
    // Strong twist makes facets of the scale of V, which longer elements cannot resolve.
    const SAFE: f64 = 8.0;
    let shares = program
        .elements
        .iter()
        .map(|e| e.length / (2.0 * e.half_width));
    let longest = shares.fold(0.0, f64::max);
    let coarse = longest * SAFE > 1.0 + 1e-9;
    let saddle = stable == Some(false);
    [
        coarse.then(|| {
            format!(
                "elements of {longest:.2} V may settle on a false level: V/8 is safe, so raise solver.elements to {:.0}",
                (SAFE * longest * program.elements.len() as f64).ceil()
            )
        }),
        saddle.then(|| "the equilibrium is no minimum of the energy: try another solver.bulge".to_owned()),
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn stable(status: Status, curvature: Curvature) -> Option<bool> {
    match (status, curvature) {
        (Status::Converged, Curvature::Positive) => Some(true),
        (Status::Converged, Curvature::Negative) => Some(false),
        _ => None,
    }
}

fn reactions(
    scenario: &Scenario,
    program: &BeltProgram,
    solution: &Solution<BeltPoint>,
    units: Units,
) -> Vec<Reaction> {
    let wrenches = program.reactions(&solution.point, &solution.multipliers);
    scenario
        .supports
        .iter()
        .zip(wrenches)
        .map(|(support, wrench)| Reaction {
            at: support.at.arc_length(units.length),
            wrench: units.wrench(wrench),
        })
        .collect()
}

impl Units {
    fn wrench(&self, (force, moment): (Vector3<f64>, Vector3<f64>)) -> Wrench {
        Wrench {
            force: force * self.energy / self.length,
            moment: moment * self.energy,
        }
    }

    fn spine(&self, program: &BeltProgram, point: &BeltPoint, width: f64) -> Spine {
        let pose = |pose: &Pose| Pose {
            frame: pose.frame,
            position: pose.position * self.length,
        };
        let nodes = nodes(program);
        Spine {
            width,
            u: nodes.iter().map(|u| u * self.length).collect(),
            pose: point.poses.iter().map(pose).collect(),
            bend: point.fields.iter().map(|f| f[0] / self.length).collect(),
            rib_slope: point.fields.iter().map(|f| f[1]).collect(),
        }
    }
}
