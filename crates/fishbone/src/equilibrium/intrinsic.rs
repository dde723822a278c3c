//! The intrinsic method: the interior-point search in the two fields bend and rib slope.

use super::assembly::Assembly;
use super::search::Search;
use super::{
    Equilibrium, LinkForce, Reaction, Status, Units, Wrench, excess_distance, is_taut, number,
};
use crate::belt::Belt;
use crate::guess::{disturb, guess};
use crate::lie::Pose;
use crate::linking::half_turns;
use crate::program::{self, BeltPoint, BeltProgram};
use crate::scenario::{Scenario, SupportSpec};
use crate::solver::{Curvature, Outcome, Solution, dependent_constraints};
use crate::spine::{Piece, Spine};
use crate::surface::fold;
use nalgebra::Vector3;
use std::ops::ControlFlow;

/// Why a search does not begin.
const CROSSING: &str = "no ribs found that do not cross: the bends, arcs and square ribs of the board are too close together \
                        for its width; make it narrower or the segments longer";

/// Finds a minimum of the energy in the two fields.
pub(super) fn solve(
    scenario: &Scenario,
    belt: &Belt,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    let units = Units::of(belt);
    let assembly = Assembly::new(scenario, belt);
    let program = assembly.program(scenario.elements());
    let search = Search {
        bulge: Vector3::from(scenario.solver.bulge),
        tolerance: scenario.solver.tolerance,
    };
    let finer = scenario.elements() > scenario.default_elements();
    let coarse = finer.then(|| assembly.program(scenario.default_elements()));
    let excess = excess_distance(scenario, units.length);
    let solution = match excess {
        Some(_) => search.start(&program),
        None => search.run(&program, coarse.as_ref(), proceed),
    };
    let crossing = program.least_slack(&solution.point) <= 0.0;
    let said_twice = said_twice(scenario, &program, &search.bulge);
    let (status, message) = match excess {
        Some(message) => (Status::Infeasible, message),
        None if crossing => (Status::NotConverged, CROSSING.to_owned()),
        None => judge(&solution, search.tolerance, said_twice.as_deref()),
    };
    let stable = stable(status, solution.curvature);
    let spine = units.spine(&program, &solution.point, belt, &assembly.origin);
    let internal = program.internal(&solution.point, &solution.multipliers);
    let links = program.link_forces(&solution.multipliers).into_iter();
    Equilibrium {
        status,
        message,
        warnings: [
            warnings(scenario, &program, stable),
            doubts(scenario, status, said_twice, half_turns(&spine)),
            folds(&spine, status),
        ]
        .concat(),
        half_turns: half_turns(&spine),
        energy: solution.values.objective * units.energy + assembly.potential_of_origin(),
        elastic_energy: program.elastic_energy(&solution.point.fields) * units.energy,
        torsion: spine.torsion(),
        spine,
        internal: internal.into_iter().map(|w| units.wrench(w)).collect(),
        reactions: reactions(scenario, &program, &solution, units),
        links: links
            .take(scenario.links.len())
            .map(|force| LinkForce {
                force: force * units.force(),
            })
            .collect(),
        stable,
        residuals: solution.residuals,
        iterations: solution.iterations,
        scenario: scenario.clone(),
    }
}

/// The supports and links that hold the same twice over, by name; `None` where all are independent.
///
/// Two supports, one at either end of a belt that bends, always are.
fn said_twice(scenario: &Scenario, program: &BeltProgram, bulge: &Vector3<f64>) -> Option<String> {
    let rigid = program
        .pieces
        .iter()
        .any(|piece| matches!(piece, program::Piece::Rigid { .. }));
    let (supports, links) = (scenario.supports.len(), scenario.links.len());
    if supports <= 2 && links == 0 && !rigid {
        return None;
    }
    // In general position: some constraints depend on each other on the straight belt and nowhere else.
    let general = disturb(program, &guess(program, bulge), 0.3);
    let name = |i: usize| match i.checked_sub(program.supports.len()) {
        None if i < supports => Some(format!("supports[{i}]")),
        Some(link) if link < links => Some(format!("links[{link}]")),
        _ => None,
    };
    let dependent = dependent_constraints(program, &general);
    let names: Vec<_> = dependent.into_iter().filter_map(name).collect();
    (!names.is_empty()).then(|| names.join(" and "))
}

/// Status and message of a search that was not infeasible from the outset.
fn judge(
    solution: &Solution<BeltPoint>,
    tolerance: f64,
    said_twice: Option<&str>,
) -> (Status, String) {
    if let (Some(names), false) = (said_twice, solution.outcome == Outcome::Converged) {
        return (
            Status::Infeasible,
            format!(
                "{names} contradict each other: they hold the same twice over, and not alike; leave one out"
            ),
        );
    }
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
        Outcome::Stalled => (
            Status::NotConverged,
            format!(
                "no step improves the shape any more, largest residual {largest:.1e} after {iterations} iterations; try \
                 a tolerance above it or another solver.elements"
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

/// Says where the surface folds over itself beside a bend of the board.
fn folds(spine: &Spine, status: Status) -> Vec<String> {
    let fold = fold(spine).filter(|_| status == Status::Converged);
    let said = fold.map(|u| {
        format!(
            "ribs cross near an edge at u = {}, beside a bend or an arc where steep ribs reach farther than V/2: no board \
             can take that shape there; try another solver.bulge, a narrower board or a gentler bend",
            number(u)
        )
    });
    said.into_iter().collect()
}

/// What should be known of constraints and turns before the result is relied on.
fn doubts(
    scenario: &Scenario,
    status: Status,
    said_twice: Option<String>,
    half_turns: Option<i32>,
) -> Vec<String> {
    let said = said_twice
        .filter(|_| status == Status::Converged)
        .map(|names| {
            format!("{names} hold the same twice over: what each of them bears is not determined")
        });
    let asked = scenario.belt.half_turns.unwrap_or(0);
    let passed = half_turns.filter(|made| *made != asked).map(|made| {
        format!("the belt has passed through itself: it was given {asked} half turns and ended with {made}")
    });
    said.into_iter().chain(passed).collect()
}

fn warnings(scenario: &Scenario, program: &BeltProgram, stable: Option<bool>) -> Vec<String> {
    // Strong twist makes facets of the scale of V, which longer elements cannot resolve.
    const SAFE: f64 = 8.0;
    let shares = program
        .elements()
        .map(|(_, e)| e.length / (2.0 * e.half_width));
    let longest = shares.fold(0.0, f64::max);
    let coarse = longest * SAFE > 1.0 + 1e-9;
    let taut = is_taut(scenario, scenario.belt.length());
    let weightless = scenario.loads.gravity.is_some_and(|g| g != [0.0; 3])
        && scenario.belt.density_value() == 0.0;
    let saddle = stable == Some(false);
    let turned = scenario
        .supports
        .iter()
        .enumerate()
        .filter_map(more_than_a_turn);
    [
        coarse.then(|| {
            format!(
                "elements of {longest:.2} V may settle on a false level: V/8 is safe, so raise solver.elements to {:.0}",
                (SAFE * longest * program.elements().count() as f64).ceil()
            )
        }),
        taut.then(|| {
            "the supports leave the belt less than 1e-6 of slack: the reactions are not determined".to_owned()
        }),
        weightless.then(|| {
            "gravity acts on no mass: give belt.density, or that of its material or layers".to_owned()
        }),
        saddle.then(|| "the equilibrium is no minimum of the energy: try another solver.bulge".to_owned()),
    ]
    .into_iter()
    .flatten()
    .chain(turned)
    .collect()
}

/// Says where an orientation is given by more than a turn, as degrees would be.
fn more_than_a_turn((i, support): (usize, &SupportSpec)) -> Option<String> {
    let angles = support.rotation.or(support.euler)?;
    let largest = angles
        .iter()
        .fold(0.0, |most: f64, angle| most.max(angle.abs()));
    (largest > std::f64::consts::TAU).then(|| {
        format!("supports[{i}] is turned by {largest} rad, which is more than a turn: angles are in radians")
    })
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
    let supports = scenario.supports.iter().zip(wrenches);
    supports
        .map(|(support, wrench)| Reaction {
            at: support.at.arc_length(units.length),
            wrench: units.wrench(wrench),
        })
        .collect()
}

impl Units {
    fn wrench(&self, (force, moment): (Vector3<f64>, Vector3<f64>)) -> Wrench {
        Wrench {
            force: force * self.force(),
            moment: moment * self.energy,
        }
    }

    fn spine(
        &self,
        program: &BeltProgram,
        point: &BeltPoint,
        belt: &Belt,
        origin: &Vector3<f64>,
    ) -> Spine {
        let pose = |pose: &Pose| Pose {
            frame: pose.frame,
            position: origin + pose.position * self.length,
        };
        let piece = |piece: &program::Piece| match piece {
            program::Piece::Strip(element) => Piece::Strip {
                geodesic: element.geodesic / self.length,
            },
            program::Piece::Rigid { .. } => Piece::Rigid,
            program::Piece::Joint { angle } => Piece::Joint { angle: *angle },
        };
        let nodes = program.nodes();
        Spine {
            width: belt.width,
            pieces: program.pieces.iter().map(piece).collect(),
            half_turns: belt.half_turns,
            u: nodes.iter().map(|u| u * self.length).collect(),
            pose: point.poses.iter().map(pose).collect(),
            bend: point.fields.iter().map(|f| f[0] / self.length).collect(),
            rib_slope: point.fields.iter().map(|f| f[1]).collect(),
        }
    }
}
