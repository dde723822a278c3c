//! An equilibrium with all its data, of any density: forces, warnings, the shape in the units of the scenario.

use super::accuracy::MeshError;
use super::stability::Stability;
use super::{AnySolved, Equilibrium, LinkForce, Reaction, Solved, Status, winding};
use crate::geometry::Wrench;
use crate::problem::program::{BeltPoint, BeltProgram};
use crate::problem::{Problem, number};
use crate::scenario::{Scenario, SupportSpec};
use crate::strip::density::Density;
use crate::surface::linking::half_turns;
use nalgebra::Vector3;
use stagewise::{Solution, Stationary};
use std::f64::consts::TAU;
use std::sync::OnceLock;

/// A solution with what is known of it.
pub(super) struct Judged<D, const F: usize, const N: usize> {
    pub(super) program: BeltProgram<D, F, N>,
    pub(super) solution: Solution<BeltPoint<F>>,
    pub(super) status: Status,
    pub(super) message: String,
    pub(super) redundant: Option<String>,
    pub(super) stability: Option<Stability>,
    /// Whether a part of the belt has stayed flat under load.
    pub(super) is_flat: bool,
    /// Whether this is an equilibrium, but not of the belt, because elements turn too far.
    pub(super) is_of_mesh_alone: bool,
    pub(super) error: OnceLock<Option<MeshError>>,
}

impl<D: Density<F>, const F: usize, const N: usize> Judged<D, F, N> {
    /// The equilibrium with all its data.
    pub(super) fn equilibrium(
        self,
        problem: &Problem,
        wrap: impl Fn(Solved<D, F, N>) -> AnySolved,
    ) -> Equilibrium {
        let Self {
            program,
            solution,
            status,
            message,
            redundant,
            stability,
            is_flat,
            is_of_mesh_alone,
            error,
        } = self;
        let (scenario, units) = (problem.scenario(), problem.units());
        let spine = problem.spine(&program, &solution.at.point);
        let half_turns = match status {
            Status::Converged => half_turns(&spine),
            Status::Infeasible | Status::NotConverged => None,
        };
        let forces = Forces::of(problem, &program, &solution, status);
        Equilibrium {
            status,
            message,
            warnings: [
                warnings(problem, status, stability, is_flat),
                doubts(status, redundant.as_deref(), &forces.undetermined),
                passed_through_itself(scenario, half_turns),
            ]
            .concat(),
            half_turns,
            energy: solution.values.objective * units.energy + problem.potential_of_origin(),
            elastic_energy: program.elastic_energy(&solution.at.point.fields) * units.energy,
            torsion: spine.torsion(),
            spine,
            internal: forces.internal,
            reactions: forces.reactions,
            links: forces.links,
            stability,
            residuals: solution.residuals,
            iterations: solution.iterations,
            problem: problem.clone(),
            error,
            solved: Some(wrap(Solved {
                values: solution.values,
                program,
                at: solution.at,
                inertia: solution.inertia,
                redundant,
                is_flat,
                is_of_mesh_alone,
            })),
        }
    }
}

/// The warning of forces that are not determined: of constraints that are redundant in every shape, else in this one.
fn doubts(status: Status, redundant: Option<&str>, undetermined: &[String]) -> Vec<String> {
    let names = redundant.filter(|_| status == Status::Converged);
    let redundant = names.map(|names| {
        format!("{names} hold the same twice over: what each of them bears is not determined")
    });
    let in_this_shape = || {
        (!undetermined.is_empty()).then(|| {
            format!(
                "in this shape {} hold the same twice over: components of the forces that they bear are not determined",
                undetermined.join(" and ")
            )
        })
    };
    redundant.or_else(in_this_shape).into_iter().collect()
}

/// The warning of a closed belt that ended with another number of half turns than it was given.
fn passed_through_itself(scenario: &Scenario, half_turns: Option<i32>) -> Vec<String> {
    let asked = scenario.belt.half_turns.unwrap_or(0);
    let made = half_turns.filter(|made| *made != asked);
    let warning = made.map(|made| {
        format!("the belt has passed through itself: it was given {asked} half turns and ended with {made}")
    });
    warning.into_iter().collect()
}

fn warnings(
    problem: &Problem,
    status: Status,
    stability: Option<Stability>,
    is_flat: bool,
) -> Vec<String> {
    let scenario = problem.scenario();
    let no_slack = status == Status::NotConverged && problem.has_no_slack();
    let flat = status == Status::Converged && is_flat && stability.is_none();
    let weightless = scenario.loads.gravity.is_some_and(|g| g != [0.0; 3])
        && scenario.belt.density_value() == 0.0;
    let is_stable = stability.and_then(|stability| stability.is_stable());
    let is_undecided = status == Status::Converged && is_stable.is_none() && !flat;
    let turned = scenario
        .supports
        .iter()
        .enumerate()
        .filter_map(more_than_a_turn);
    [
        no_slack.then(|| {
            "the supports leave the belt less than 1e-6 of slack: they hardly determine its shape and its forces".to_owned()
        }),
        weightless.then(|| {
            "gravity acts on no mass: give belt.density, or that of its material or layers".to_owned()
        }),
        flat.then(|| {
            "a part of the loaded belt has stayed flat: whether it would rather buckle could not be told".to_owned()
        }),
        is_undecided.then(|| {
            "whether the equilibrium is a minimum of the energy is undecided: some motion hardly changes the energy".to_owned()
        }),
        (is_stable == Some(false))
            .then(|| "the equilibrium is no minimum of the energy: try another solver.bulge".to_owned()),
    ]
    .into_iter()
    .flatten()
    .chain(turned)
    .collect()
}

/// The warning of an orientation given by more than a turn, as degrees would be.
fn more_than_a_turn((i, support): (usize, &SupportSpec)) -> Option<String> {
    let rotation = support.rotation.map(|r| Vector3::from(r).norm());
    let largest = rotation.or_else(|| Some(Vector3::from(support.euler?).amax()))?;
    let way = match largest > winding::MOST {
        true => "it is taken the shorter way round, and ",
        false => "",
    };
    (largest > TAU + 1e-9).then(|| {
        format!(
            "supports[{i}] is turned by {} rad, which is more than a turn: {way}angles are in radians",
            number(largest)
        )
    })
}

/// Forces and moments of an equilibrium in the units of its scenario; NaN where the shape does not determine them.
struct Forces {
    internal: Vec<Wrench>,
    reactions: Vec<Reaction>,
    links: Vec<LinkForce>,
    /// Names of the supports and links with undetermined components.
    undetermined: Vec<String>,
}

impl Forces {
    fn of<D: Density<F>, const F: usize, const N: usize>(
        problem: &Problem,
        program: &BeltProgram<D, F, N>,
        solution: &Solution<BeltPoint<F>>,
        status: Status,
    ) -> Self {
        let (scenario, units) = (problem.scenario(), problem.units());
        let Stationary { point, multipliers } = &solution.at;
        let mut internal = program.internal(point, &multipliers.equalities);
        let mut wrenches = program.reactions(point, &multipliers.equalities);
        let mut forces = program.link_forces(&multipliers.equalities);
        wrenches.truncate(scenario.supports.len());
        forces.truncate(scenario.links.len());
        let mut names = Vec::new();
        let undetermined = program.undetermined(point);
        if let Some(undetermined) = undetermined.filter(|_| status == Status::Converged) {
            undetermined.set(f64::NAN, &mut wrenches, &mut forces, &mut internal);
            let is_nan = |vector: &Vector3<f64>| vector.iter().any(|part| part.is_nan());
            let supports = wrenches.iter().enumerate();
            let supports = supports.filter(|(_, (force, moment))| is_nan(force) || is_nan(moment));
            names.extend(supports.map(|(i, _)| format!("supports[{i}]")));
            let links = forces.iter().enumerate();
            let links = links.filter(|(_, force)| is_nan(force));
            names.extend(links.map(|(i, _)| format!("links[{i}]")));
        }
        let supports = scenario.supports.iter().zip(wrenches);
        Self {
            internal: internal.into_iter().map(|w| units.wrench(w)).collect(),
            reactions: supports
                .map(|(support, wrench)| Reaction {
                    at: support.at.arc_length(units.length),
                    wrench: units.wrench(wrench),
                })
                .collect(),
            links: forces
                .into_iter()
                .map(|force| LinkForce {
                    force: force * units.force(),
                })
                .collect(),
            undetermined: names,
        }
    }
}
