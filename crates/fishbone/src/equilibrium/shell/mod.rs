//! The equilibrium of a strip of finite thickness, from that of the developable strip.
//!
//! The energy of such a strip has minima that are none of the belt, with ribs that all but meet beside a clamp, and they lie
//! lower than the right one. A strong gauge has none of them. So the search takes the developable shape with its rib slopes
//! smoothed, finds the minimum with the strong gauge, and follows it to the weak one.

mod model;
mod saddle;

use super::accuracy::{MeshError, Quantities};
use super::intrinsic;
use super::judged::Judged;
use super::search::{self, MinimumSettings, Search};
use super::{AnySolved, Equilibrium, Solved, Stability, Status, left_free};
use crate::problem::program::{BeltPoint, BeltProgram, Piece};
use crate::problem::{Mesh, Problem};
use crate::scenario::EnergyModel;
use crate::strip::density::Density;
use crate::strip::shell::{FIELDS, Gauge, Shell, interpolated, slope_step};
use nalgebra::SVector;
use stagewise::{
    Distance, Multipliers, Outcome, Program, Settings, Solution, Stationary, assess, lowest_modes,
};
use std::ops::ControlFlow;
use std::sync::OnceLock;

type Proceed<'a> = dyn FnMut() -> ControlFlow<()> + 'a;
/// The programme of a strip of finite thickness.
type ShellProgram = BeltProgram<Shell, FIELDS, 12>;
type ShellSolution = Solution<BeltPoint<FIELDS>>;

/// Points across the width, a number: where ribs come nearly as close as they may, the energy taken at 6 is off by up to 1 %.
const POINTS: usize = 8;
/// First barriers of a search with the strong gauge, the others where the one before leads astray; in mean R_f/U.
const STRONG_BARRIERS: [f64; 3] = [1e-3, 1e-5, 1e-1];
/// First barriers of a search with the weak gauge, likewise.
const BARRIERS: [f64; 2] = [1e-4, 1e-7];
/// Error over its change on halving all elements: energies converge with the length of elements, dimensionless.
const OVER_CHANGE: f64 = 2.0;
/// Displacement of nodes up to which a minimum on a finer mesh is the same, in U.
const NEXT: f64 = 0.01;
/// Iterations that a search on a finer mesh may take, a number.
const FEW: usize = 100;
/// Times that all elements are halved at most, a number.
const HALVINGS: usize = 3;

/// The equilibrium of a strip of finite thickness, next to that of the developable strip of the same scenario.
pub(super) fn solve(problem: &Problem, proceed: &mut Proceed) -> Equilibrium {
    let developable = super::from_guess(&as_developable(problem), proceed);
    next_to(problem, developable, proceed)
}

/// The problem of the developable strip, the limit of no thickness.
pub(crate) fn as_developable(problem: &Problem) -> Problem {
    problem.with_energy(EnergyModel::Wunderlich)
}

/// The minimum of a strip of finite thickness next to an equilibrium of the developable one, on meshes that follow the
/// error; the result for the developable one where no shape meets the supports.
pub(crate) fn next_to(problem: &Problem, found: Equilibrium, proceed: &mut Proceed) -> Equilibrium {
    let (Some(start), false) = (found.developable(), found.status == Status::Infeasible) else {
        return Equilibrium {
            problem: problem.clone(),
            ..found
        };
    };
    let from_start = |mesh: &Mesh, proceed: &mut Proceed| {
        let bare = problem.program_on(mesh)?;
        let shape = search::prolonged(&start.program, &start.at.point, &bare);
        Some(from_developable(problem, &bare, &shape, proceed))
    };
    let mesh = Mesh::uniform(problem, problem.elements());
    let (mut program, mut solution) = through_coarse(problem, &mesh, from_start, proceed)
        .or_else(|| from_start(&mesh, proceed))
        .expect("a division for every stretch");
    if let Some(fallen) = saddle::fallen(problem, &program, &solution, proceed) {
        solution = fallen;
    }
    let mut iterations = found.iterations + solution.iterations;
    let mut error = OnceLock::new();
    for time in 0..HALVINGS {
        if problem.has_fixed_mesh() || solution.outcome != Outcome::Converged {
            break;
        }
        let finer = halved(problem, &program, &solution, proceed).or_else(|| {
            // On finer meshes such a search takes long, and hardly finds what the one beside the solution does not.
            if time > 0 {
                return None;
            }
            let mesh = Mesh::of(problem, &program).halved();
            let (program, solution) = from_start(&mesh, proceed)?;
            (solution.outcome == Outcome::Converged).then_some((program, solution))
        });
        let Some((finer, better)) = finer else {
            break;
        };
        iterations += better.iterations;
        let known = change(problem, (&program, &solution), (&finer, &better));
        let is_accurate = known
            .worst()
            .is_some_and(|(_, error)| error <= problem.accuracy())
            && !hides_energy(problem, &program, &solution.at.point);
        error = OnceLock::from(Some(known).filter(MeshError::is_finite));
        if is_accurate {
            break;
        }
        // The finer solution's own error is about half of the change.
        error = OnceLock::from(Some(known.times(0.5)).filter(MeshError::is_finite));
        (program, solution) = (finer, better);
    }
    solution.iterations = iterations;
    Equilibrium {
        error,
        ..judged(problem, program, solution)
    }
}

/// The minimum on a fine mesh next to that of a coarse one; `None` on a coarse mesh, and where none is found.
fn through_coarse(
    problem: &Problem,
    mesh: &Mesh,
    from_start: impl Fn(&Mesh, &mut Proceed) -> Option<(ShellProgram, ShellSolution)>,
    proceed: &mut Proceed,
) -> Option<(ShellProgram, ShellSolution)> {
    let coarse = Mesh::uniform(problem, problem.scenario().default_elements());
    if mesh.elements() <= 2 * coarse.elements() {
        return None;
    }
    let (program, solution) = from_start(&coarse, proceed)
        .filter(|(_, solution)| solution.outcome == Outcome::Converged)?;
    let finer = problem.program_on(mesh)?.as_shell(program.model.clone());
    let point = drawn_in(&finer, prolonged(&program, &solution.at.point, &finer));
    let settings = Settings {
        iterations: FEW,
        ..settings(problem, BARRIERS[0])
    };
    let found = minimise(&finer, &settings, point, proceed);
    (found.outcome == Outcome::Converged).then(|| (finer, found.after(solution.iterations)))
}

/// The equilibrium of a solution of a problem's programme, which has converged only if no energy hides from its mesh.
fn judged(problem: &Problem, program: ShellProgram, solution: ShellSolution) -> Equilibrium {
    // Which constraints follow from others does not depend on the energy.
    let redundant = intrinsic::redundant(problem, &problem.program(problem.elements()));
    let is_hiding = hides_energy(problem, &program, &solution.at.point);
    let fault = is_hiding.then(|| hidden(problem));
    let (status, message) =
        intrinsic::judge(problem, &program, &solution, fault, redundant.as_deref());
    let judged = Judged {
        stability: stability(problem, &program, &solution, status),
        is_of_mesh_alone: is_hiding && solution.outcome == Outcome::Converged,
        program,
        solution,
        status,
        message,
        redundant,
        is_flat: false,
        error: OnceLock::new(),
    };
    judged.equilibrium(problem, |solved| AnySolved::Shell(Box::new(solved)))
}

/// Message of a mesh too coarse for its own energy, for people.
fn hidden(problem: &Problem) -> String {
    let other = match problem.has_fixed_mesh() {
        true => "leave them out",
        false => "name energy = \"wunderlich\"",
    };
    format!(
        "the ribs turn so fast within elements that the energy taken at their points is not that of the shape: give more \
         solver.elements, or {other}"
    )
}

/// The estimated error of a solution by its mesh: its change on halving all elements.
pub(super) fn error(
    problem: &Problem,
    solved: &Solved<Shell, FIELDS, 12>,
    proceed: &mut Proceed,
) -> Option<MeshError> {
    let solution = assess(&solved.program, problem.tolerance(), &solved.at);
    let (finer, better) = halved(problem, &solved.program, &solution, proceed)?;
    let error = change(problem, (&solved.program, &solution), (&finer, &better));
    error.is_finite().then_some(error)
}

/// Estimated errors of a solution by those on the mesh of elements half as long.
fn change(
    problem: &Problem,
    own: (&ShellProgram, &ShellSolution),
    better: (&ShellProgram, &ShellSolution),
) -> MeshError {
    let [own, better] = [own, better].map(|(program, solution)| {
        Quantities::of(
            problem,
            program,
            &solution.at.point,
            &solution.at.multipliers.equalities,
            solution.values.objective,
        )
    });
    own.off(&better).times(OVER_CHANGE)
}

/// The minimum next to a solution on the mesh of elements half as long; `None` where none is found.
fn halved(
    problem: &Problem,
    program: &ShellProgram,
    solution: &ShellSolution,
    proceed: &mut Proceed,
) -> Option<(ShellProgram, ShellSolution)> {
    let finer = split(problem, program, 2)?;
    let point = prolonged(program, &solution.at.point, &finer);
    let point = drawn_in(&finer, point);
    let near = Stationary {
        multipliers: Multipliers {
            equalities: solution.at.multipliers.equalities.clone(),
            inequalities: shared_out(program, &solution.at.multipliers.inequalities, &finer),
        },
        point,
    };
    let tolerance = problem.tolerance();
    let is_next = |found: &ShellSolution| found.at.point.distance(&near.point) <= NEXT;
    let settled = stagewise::settle(&finer, tolerance, near.clone()).filter(is_next);
    if let Some(settled) = settled.filter(|found| found.is_minimum()) {
        return Some((finer, settled));
    }
    let settings = Settings {
        iterations: FEW,
        ..settings(problem, BARRIERS[0])
    };
    let found = minimise(&finer, &settings, near.point.clone(), proceed);
    let is_found = found.outcome == Outcome::Converged && is_next(&found);
    is_found.then_some((finer, found))
}

/// Multipliers of the inequalities of elements, shared out among their parts.
fn shared_out(from: &ShellProgram, multipliers: &[f64], to: &ShellProgram) -> Vec<f64> {
    let layout = from.layout();
    let parents = parents(from, to);
    let rows = to.elements().flat_map(|(k, element)| {
        let parent = parents[k];
        let share = element.length / from.pieces[parent].length();
        let rows = &multipliers[layout.stage_rows(parent)];
        rows.iter().map(move |multiplier| share * multiplier)
    });
    rows.collect()
}

/// The piece of a programme that holds the middle of every piece of another.
fn parents(from: &ShellProgram, to: &ShellProgram) -> Vec<usize> {
    let (nodes, known) = (to.nodes(), from.nodes());
    let parent = |pair: &[f64]| {
        let middle = 0.5 * (pair[0] + pair[1]);
        let after = known.partition_point(|node| *node <= middle);
        after.clamp(1, from.pieces.len()) - 1
    };
    nodes.windows(2).map(parent).collect()
}

/// The same programme with every element split into parts of equal length.
fn split(problem: &Problem, program: &ShellProgram, parts: usize) -> Option<ShellProgram> {
    let mesh = Mesh::of(problem, program);
    let mesh = mesh.split(&vec![parts; mesh.elements()]);
    Some(problem.program_on(&mesh)?.as_shell(program.model.clone()))
}

/// The same shape on another mesh; exactly so on one that has all nodes of its own.
fn prolonged(
    from: &ShellProgram,
    point: &BeltPoint<FIELDS>,
    to: &ShellProgram,
) -> BeltPoint<FIELDS> {
    let (nodes, known, parents) = (to.nodes(), from.nodes(), parents(from, to));
    let element = |k: &usize| matches!(to.pieces.get(*k), Some(Piece::Strip(_)));
    let fields = |k: usize| {
        let beside = Some(k).filter(element).or(k.checked_sub(1).filter(element));
        let Some(own) = beside else {
            return SVector::zeros();
        };
        let parent = parents[own];
        let length = known[parent + 1] - known[parent];
        let ends = [parent, parent + 1].map(|node| point.fields[node].data.0[0]);
        let (fields, _) = interpolated(ends, length, (nodes[k] - known[parent]) / length);
        SVector::from(fields)
    };
    let mut prolonged = BeltPoint {
        fields: (0..nodes.len()).map(fields).collect(),
        poses: vec![point.poses[0]; nodes.len()],
    };
    to.settle(&mut prolonged);
    prolonged
}

/// The same surface described by ribs of less slope, so that they keep apart.
fn drawn_in(program: &ShellProgram, point: BeltPoint<FIELDS>) -> BeltPoint<FIELDS> {
    /// Least slack of the ribs, dimensionless.
    const SLACK: f64 = 1e-3;
    /// Share by which slopes are lowered at a time, dimensionless, and times at most, a number.
    const LESS: f64 = 0.02;
    const TIMES: usize = 50;
    let mut drawn = point;
    for _ in 0..TIMES {
        if program.least_slack(&drawn) >= SLACK {
            break;
        }
        for fields in &mut drawn.fields {
            let [slope, rate] = [fields[1], fields[2]].map(|x| -LESS * x);
            *fields = program
                .model
                .moved(fields, &slope_step(fields, slope, rate));
        }
        program.settle(&mut drawn);
    }
    drawn
}

/// Whether the energy of a shape changes as it is taken at more points along and across the belt: beside clamps, coarse elements
/// may hide energy between their points.
fn hides_energy(problem: &Problem, program: &ShellProgram, shape: &BeltPoint<FIELDS>) -> bool {
    /// Change of the energy that is no error of the integral, as a share of the energy.
    const CHANGE: f64 = 1e-3;
    /// Parts of an element along the belt, and points across it, a number.
    const FINER: [usize; 2] = [4, 12];
    let Some(mut finer) = split(problem, program, FINER[0]) else {
        return true;
    };
    finer.model = finer.model.with_points(FINER[1]);
    let point = prolonged(program, shape, &finer);
    let [own, true_one] = [
        program.elastic_energy(&shape.fields),
        finer.elastic_energy(&point.fields),
    ];
    // A change that is no number is no small one.
    let is_small = (own - true_one).abs() <= CHANGE * own.abs().max(program.size(shape));
    !is_small
}

/// Stability of a solution by its second variation, on all motions that its scenario leaves.
///
/// With the weak gauge the slopes of ribs may change at a free end while the surface hardly does, at a change of the energy of
/// either sign. Such motions of the description alone do not count: they cost energy with the strong gauge, and their
/// eigenvalue, over the square of a small displacement, is far below any of the belt's.
fn stability(
    problem: &Problem,
    program: &ShellProgram,
    solution: &ShellSolution,
    status: Status,
) -> Option<Stability> {
    /// Eigenvalue below those of the belt's own motions, in mean R_f/U³; its own go down to some hundreds.
    const LEAST: f64 = -1e4;
    if status != Status::Converged {
        return None;
    }
    let free = left_free(problem, program, &solution.at);
    let (program, at, own) = match &free {
        Some((program, at)) => (program, at, None),
        None => (program, &solution.at, solution.inertia),
    };
    let inertia = |program| assess(program, problem.tolerance(), at).inertia;
    let mut own = own.or_else(|| inertia(program))?;
    if own.negative == 0 {
        return Some(own.into());
    }
    let mut strong = program.clone();
    strong.model = Shell::new(Gauge::STRONG, POINTS);
    let dearer = own.negative.saturating_sub(inertia(&strong)?.negative);
    if dearer > 0 {
        let modes = lowest_modes(program, &mut at.clone(), own.negative).ok()?;
        let scales = program.scales();
        let least = LEAST * scales.objective / scales.distance.powi(2);
        let below = modes.iter().filter(|mode| mode.eigenvalue < least);
        own.negative -= below.count().min(dearer);
    }
    Some(own.into())
}

/// The minimum that a search finds; of a band that may slide along itself the one with a square rib at its seam, unless only
/// forces would hold it there.
fn minimise(
    program: &ShellProgram,
    settings: &Settings,
    start: BeltPoint<FIELDS>,
    proceed: &mut Proceed,
) -> ShellSolution {
    let Some(held) = program.with_square_seam() else {
        return stagewise::minimise(program, settings, start, proceed);
    };
    let found = stagewise::minimise(&held, settings, start, proceed);
    if found.outcome == Outcome::Interrupted {
        return found;
    }
    let own = assess(program, settings.tolerance, &found.at);
    if own.outcome == Outcome::Converged {
        return own.after(found.iterations);
    }
    stagewise::minimise(program, settings, found.at.point, proceed).after(found.iterations)
}

/// Settings of a search with a first barrier, in mean R_f/U.
fn settings(problem: &Problem, barrier: f64) -> Settings {
    Settings {
        tolerance: problem.tolerance(),
        iterations: MinimumSettings::default().iterations,
        barrier,
        longest_step: f64::INFINITY,
    }
}

/// The minimum of a strip of finite thickness next to the shape of a developable one, on its mesh. Where the shape leads to none,
/// or to one that hides energy, those of wider developable belts follow, whose ribs keep farther apart.
fn from_developable(
    problem: &Problem,
    developable: &BeltProgram,
    shape: &BeltPoint,
    proceed: &mut Proceed,
) -> (ShellProgram, ShellSolution) {
    /// Widths of the other developable belts, over the width.
    const WIDER: [f64; 2] = [1.25, 1.5];
    let strong = developable.as_shell(Shell::new(Gauge::STRONG, POINTS));
    let mut found = from_shape(problem, &strong, smooth_from(&strong, shape), proceed);
    let mut iterations = found.1.iterations;
    for wider in WIDER {
        let (program, solution) = &found;
        let is_sound = is_over(solution) && !may_hide_energy(problem, program, solution);
        if is_sound || solution.outcome == Outcome::Interrupted {
            break;
        }
        let search = Search::of(problem);
        let wide = developable.clone().widened(wider);
        let barrier = search.settings.close_barrier;
        let apart = search.only_from(&wide, shape.clone(), barrier, proceed);
        iterations += apart.iterations;
        if apart.outcome == Outcome::Converged {
            let start = smooth_from(&strong, &apart.at.point);
            let other = from_shape(problem, &strong, start, proceed);
            iterations += other.1.iterations;
            if is_over(&other.1) || !is_over(solution) {
                found = other;
            }
        }
    }
    found.1.iterations = iterations;
    found
}

/// Whether energy hides from the mesh of a solution whose ribs come close to each other.
fn may_hide_energy(problem: &Problem, program: &ShellProgram, solution: &ShellSolution) -> bool {
    /// Least slack of ribs that are far apart, dimensionless.
    const FAR: f64 = 0.2;
    let point = &solution.at.point;
    program.least_slack(point) < FAR && hides_energy(problem, program, point)
}

/// Whether a search needs no other.
fn is_over(solution: &ShellSolution) -> bool {
    matches!(solution.outcome, Outcome::Converged | Outcome::Interrupted)
}

/// The minimum of a strip of finite thickness that a search from one shape finds: with the strong gauge, then with the weak one.
fn from_shape(
    problem: &Problem,
    strong: &ShellProgram,
    shape: BeltPoint<FIELDS>,
    proceed: &mut Proceed,
) -> (ShellProgram, ShellSolution) {
    let near = minimum(problem, strong, &STRONG_BARRIERS, &shape, proceed);
    if near.outcome != Outcome::Converged {
        return (strong.clone(), near);
    }
    let mut weak = strong.clone();
    weak.model = Shell::new(Gauge::WEAK, POINTS);
    let found = minimum(problem, &weak, &BARRIERS, &near.at.point, proceed);
    (weak, found.after(near.iterations))
}

/// The minimum of a programme that a search from a shape finds with one of several first barriers, tried in turn.
fn minimum(
    problem: &Problem,
    program: &ShellProgram,
    barriers: &[f64],
    shape: &BeltPoint<FIELDS>,
    proceed: &mut Proceed,
) -> ShellSolution {
    /// Iterations that a search may take, a number: most take 10 to 60.
    const ITERATIONS: usize = 300;
    let mut search = |barrier: f64| {
        let settings = Settings {
            iterations: ITERATIONS,
            ..settings(problem, barrier)
        };
        minimise(program, &settings, shape.clone(), proceed)
    };
    let (first, others) = barriers.split_first().expect("at least one barrier");
    let mut found = search(*first);
    for barrier in others {
        if is_over(&found) {
            break;
        }
        found = search(*barrier).after(found.iterations);
    }
    found
}

/// The fields of a developable shape with rib slopes so smooth that the ribs keep apart; the twist of the ribs keeps the
/// torsion.
fn smooth_from(program: &ShellProgram, shape: &BeltPoint) -> BeltPoint<FIELDS> {
    /// Slack of the ribs at the start, dimensionless.
    const SLACK: f64 = 0.1;
    /// Times that slopes are drawn together at least, and at most, a number.
    const TIMES: [usize; 2] = [4, 64];
    let slopes: Vec<f64> = shape.fields.iter().map(|fields| fields[1]).collect();
    let mut smooth = slopes.clone();
    for time in 1.. {
        smooth_once(program, &mut smooth);
        if time < TIMES[0] {
            continue;
        }
        if time > TIMES[1] {
            smooth.fill(0.0);
        }
        let point = with_slopes(program, shape, &smooth);
        if time > TIMES[1] || program.least_slack(&point) >= SLACK {
            return point;
        }
    }
    unreachable!("the last slopes are taken as they are")
}

/// A developable shape with other rib slopes.
fn with_slopes(program: &ShellProgram, shape: &BeltPoint, slopes: &[f64]) -> BeltPoint<FIELDS> {
    let node = |k: usize| {
        let [bend, slope] = shape.fields[k].into();
        let twist = (slopes[k] - slope) * bend;
        SVector::from([bend, slopes[k], rate(program, slopes, k), twist, 0.0, 0.0])
    };
    let mut point = BeltPoint {
        fields: (0..slopes.len()).map(node).collect(),
        poses: shape.poses.clone(),
    };
    program.settle(&mut point);
    point
}

/// Draws slopes of ribs towards the mean of their neighbours' on the same stretch.
fn smooth_once(program: &ShellProgram, slopes: &mut [f64]) {
    let before = slopes.to_vec();
    for k in 1..slopes.len() - 1 {
        let beside = [&program.pieces[k - 1], &program.pieces[k]];
        if beside.iter().all(|piece| matches!(piece, Piece::Strip(_))) {
            slopes[k] = 0.25 * (before[k - 1] + 2.0 * before[k] + before[k + 1]);
        }
    }
}

/// Rate of the slopes at a node: the mean over the elements beside it.
fn rate(program: &ShellProgram, slopes: &[f64], node: usize) -> f64 {
    let rate = |k: usize| match program.pieces.get(k) {
        Some(Piece::Strip(element)) => Some((slopes[k + 1] - slopes[k]) / element.length),
        _ => None,
    };
    let beside = [node.checked_sub(1), Some(node)];
    let (sum, count) = beside
        .into_iter()
        .filter_map(|k| rate(k?))
        .fold((0.0, 0), |(sum, count), rate| (sum + rate, count + 1));
    sum / f64::from(count.max(1))
}
