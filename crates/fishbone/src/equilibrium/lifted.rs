//! Boards that their supports hold nearly in their flat shape: solved where they are farther off the plane, then brought back.
//!
//! Off the plane by a small lift, bends are in proportion to the lift, shortenings and the energy to its square, and the ribs
//! lie the same. So a shape with a larger lift gives those of all smaller ones, where a search from anywhere else would have
//! to find supports to within the square of the lift.

use super::search::Search;
use super::{Equilibrium, MeshError, Status, beside_the_guess, of_solution};
use crate::geometry::{Pose, exp, log};
use crate::problem::program::{BeltPoint, BeltProgram, Hold, NodeSupport, ROWS};
use crate::problem::{Mesh, Problem};
use crate::scenario::Component;
use crate::strip::density::Density;
use nalgebra::{Matrix3, SVector, Vector3};
use stagewise::{Outcome, Stationary, assess};
use std::ops::ControlFlow;
use std::sync::OnceLock;

/// Lift below which a board is brought back, in U and rad.
const LIFT: f64 = 0.01;

/// The minimum of a board that is held in its flat shape, or off it by less than [`LIFT`], on the mesh of the larger lift;
/// `None` of another one, and where the search finds no minimum.
///
/// Supports that hold the ends of an arc in its plane, too, shorten it by the square of the lift. At a lift of 1e-6 that is but
/// a few thousand roundings of a position, so that no search finds it. There the shape is that of a larger lift in proportion,
/// off by the square of that lift.
pub(super) fn brought_back(
    problem: &Problem,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Equilibrium> {
    /// Lifts from which it is brought back, tried in turn, in U and rad.
    const LIFTS: [f64; 3] = [LIFT, 3.0 * LIFT, 10.0 * LIFT];
    /// Factor by which the lift falls from search to search, and the least such factor that is tried, dimensionless.
    const STEPS: [f64; 2] = [10.0, 1.5];
    /// Lift down to which a minimum is searched, and the greatest from which shapes are in proportion, in U and rad.
    const PROPORTIONAL: [f64; 2] = [1e-4, 1.5e-3];
    let lifted = Lifted::of(problem)?;
    if lifted.lift == 0.0 {
        return lifted.at_rest(problem, proceed);
    }
    let mut tries = LIFTS.into_iter();
    let (farther, far, mut lift) = tries.find_map(|lift| {
        let farther = lifted.problem(problem, lift)?;
        let far = beside_the_guess(&farther, proceed);
        far.is_minimum().then_some((farther, far, lift))
    })?;
    let solved = far.developable()?;
    let mesh = Mesh::of(&farther, &solved.program);
    let on_mesh = |problem: &Problem| {
        let mut program = problem.program_on(&mesh)?;
        // Ribs of the same slopes come to the same edges.
        program.edges.clone_from(&solved.program.edges);
        Some(program)
    };
    // In proportion to the shape, relative errors are those of the larger lift.
    let error = far.error().map(|error| MeshError {
        position: error.position * lifted.lift / lift,
        ..error
    });
    let error = OnceLock::from(error);
    let (mut at, mut stability, mut iterations) = (solved.at.clone(), None, far.iterations);
    let least = lifted.lift.max(PROPORTIONAL[0]);
    let mut step = STEPS[0];
    while lift > least && step > STEPS[1] {
        let next = least.max(lift / step);
        let near = lifted.problem(problem, next)?;
        let program = on_mesh(&near)?;
        let mut lower = at.clone();
        lifted.lower(&program, &mut lower, lift / next);
        let found = Search::of(&near).sharpened_from(&program, &lower, proceed);
        iterations += found.iterations;
        if found.outcome != Outcome::Converged {
            step = step.sqrt();
            continue;
        }
        (lift, at) = (next, found.at.clone());
        let near = of_solution(&near, program, found);
        if !near.is_minimum() {
            return None;
        }
        if next <= lifted.lift {
            return Some(Equilibrium {
                iterations,
                error,
                warnings: with_warnings(&far, &near),
                ..near
            });
        }
        stability = near.stability;
    }
    if lift > PROPORTIONAL[1] {
        return None;
    }
    let program = on_mesh(problem)?;
    lifted.lower(&program, &mut at, lift / lifted.lift);
    let found = assess(&program, problem.tolerance(), &at);
    let near = of_solution(problem, program, found);
    (near.status == Status::Converged).then_some(Equilibrium {
        iterations,
        error,
        stability,
        warnings: with_warnings(&far, &near),
        ..near
    })
}

/// The warnings of a solve, and those of the larger lift that it does not have itself, as that of the side.
fn with_warnings(far: &Equilibrium, near: &Equilibrium) -> Vec<String> {
    let own = near.warnings.iter();
    let further = far
        .warnings
        .iter()
        .filter(|warning| !near.warnings.contains(warning));
    own.chain(further).cloned().collect()
}

/// A board that is held nearly in its flat shape.
struct Lifted {
    /// The flat shape.
    flat: BeltPoint,
    /// The direction off its plane.
    normal: Vector3<f64>,
    /// Greatest deviation of a support off the plane, in U and rad.
    lift: f64,
    /// Deviations of the supports from the flat shape: displacement and turn, of each the part off the plane and that in it.
    moves: Vec<[[Vector3<f64>; 2]; 2]>,
    /// Nodes of the supports in the flat shape.
    nodes: Vec<usize>,
}

impl Lifted {
    /// `None` of a board whose supports do not hold it nearly in the plane, or the energy of which is not in proportion to the
    /// square of the lift.
    fn of(problem: &Problem) -> Option<Self> {
        /// Greatest ratio of deviations in the plane to the squares of those off it.
        const IN_PLANE: f64 = 10.0;
        /// Deviation that is nothing but rounding, in U and rad.
        const ROUNDING: f64 = 2e-14;
        let program = problem.program(problem.elements());
        let flat = laid_flat(&program)?;
        let normal: Vector3<f64> = flat.poses[0].frame.column(0).into_owned();
        let off = |vector: Vector3<f64>| vector.dot(&normal) * normal;
        let beyond_rounding = |vector: Vector3<f64>| match vector.norm() <= ROUNDING {
            true => Vector3::zeros(),
            false => vector,
        };
        let supports = program.supports.iter();
        let moves: Vec<_> = supports
            .map(|support| {
                let (way, turn) = deviation(support, &flat.poses[support.node]);
                // A turn about the normal is one in the plane.
                let parts = [[off(way), way - off(way)], [turn - off(turn), off(turn)]];
                parts.map(|both| both.map(beyond_rounding))
            })
            .collect();
        let largest = |i: usize| {
            let both = moves.iter().flatten();
            both.map(|parts| parts[i].norm()).fold(0.0, f64::max)
        };
        let (lift, inside) = (largest(0), largest(1));
        let is_near = lift < LIFT && inside <= IN_PLANE * lift * lift;
        is_near.then(|| Self {
            nodes: program.supports.iter().map(|s| s.node).collect(),
            flat,
            normal,
            lift,
            moves,
        })
    }

    /// The same board with its supports off the plane by another lift.
    fn problem(&self, problem: &Problem, lift: f64) -> Option<Problem> {
        let times = lift / self.lift;
        if times == 1.0 {
            return Some(problem.clone());
        }
        let mut supports = problem.scenario().supports.clone();
        let farther = |[off, inside]: &[Vector3<f64>; 2]| times * off + times * times * inside;
        let length = problem.units().length;
        let known = self.nodes.iter().zip(&self.moves);
        for (spec, (node, [way, turn])) in supports.iter_mut().zip(known) {
            let pose = &self.flat.poses[*node];
            let place = problem.origin() + length * (pose.position + farther(way));
            if let Some(position) = &mut spec.position {
                for (held, place) in position.iter_mut().zip(&place) {
                    if matches!(held, Component::Held(_)) {
                        *held = Component::Held(*place);
                    }
                }
            }
            if spec.rotation.is_some() || spec.euler.is_some() || spec.quaternion.is_some() {
                spec.rotation = Some(log(&(exp(&farther(turn)) * pose.frame)).into());
                (spec.euler, spec.quaternion) = (None, None);
            }
        }
        problem.with_supports(supports).ok()
    }

    /// Lowers a shape of a programme with its multipliers by a factor: bends and all that is off the plane are in proportion to
    /// the lift, all in the plane to its square; so the forces in the plane stay, and those off it are in proportion to the lift.
    fn lower(&self, program: &BeltProgram, at: &mut Stationary<BeltPoint>, factor: f64) {
        for fields in &mut at.point.fields {
            fields[0] /= factor;
        }
        let off = |vector: Vector3<f64>| vector.dot(&self.normal) * self.normal;
        let (flat, pose) = (&self.flat.poses[0], &mut at.point.poses[0]);
        let way = pose.position - flat.position;
        let turn = log(&(pose.frame * flat.frame.transpose()));
        let nearer =
            |off: Vector3<f64>, inside: Vector3<f64>| off / factor + inside / (factor * factor);
        pose.position = flat.position + nearer(off(way), way - off(way));
        pose.frame = exp(&nearer(turn - off(turn), off(turn))) * flat.frame;
        program.settle(&mut at.point);
        let multipliers = &mut at.multipliers;
        let supports = multipliers.equalities.chunks_exact_mut(ROWS);
        for (support, rows) in program.supports.iter().zip(supports) {
            let force = Vector3::from_column_slice(&rows[..3]);
            let force = force - off(force) * (1.0 - factor.recip());
            rows[..3].copy_from_slice(force.as_slice());
            if let Hold::Frame(frame) = support.hold {
                let moment = frame * Vector3::from_column_slice(&rows[3..]);
                let moment = off(moment) + (moment - off(moment)) / factor;
                rows[3..].copy_from_slice((frame.inverse() * moment).as_slice());
            }
        }
        for multiplier in &mut multipliers.inequalities {
            *multiplier /= factor * factor;
        }
    }

    /// The board in its flat shape, where no energy is the least; `None` if square ribs cross.
    fn at_rest(
        self,
        problem: &Problem,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Equilibrium> {
        let program = problem.program(problem.elements());
        let mut flat = self.flat;
        program.settle(&mut flat);
        if program.least_slack(&flat) <= 0.0 {
            return None;
        }
        // The barrier of a converged minimum, which gives the ribs multipliers.
        let barrier = 0.1 * problem.tolerance();
        let found = Search::of(problem).minimise(&program, flat, barrier, proceed);
        let found = of_solution(problem, program, found);
        found.is_minimum().then_some(found)
    }
}

/// A board as it lies flat and at rest, by the poses of the nodes that supports hold.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Flat {
    /// Poses of the flat board, one a support, in the units of the programme.
    poses: Vec<Pose>,
    /// The support that the flat board is laid on.
    clamp: usize,
}

impl Flat {
    /// The flat board of a programme; `None` where one support alone holds it or none holds a whole pose, and of a board that
    /// is not at rest where it is flat.
    pub(crate) fn of<D: Density<F>, const F: usize, const N: usize>(
        program: &BeltProgram<D, F, N>,
    ) -> Option<Self> {
        let clamp = first_clamp(&program.supports).filter(|_| program.supports.len() > 1)?;
        let flat = laid_flat(program)?;
        let nodes = program.supports.iter().map(|support| support.node);
        Some(Self {
            poses: nodes.map(|node| flat.poses[node]).collect(),
            clamp,
        })
    }

    /// How far some supports are from holding the board flat, in U and rad, together; given in order.
    pub(crate) fn distance(&self, supports: impl Iterator<Item = NodeSupport> + Clone) -> f64 {
        let clamp = supports.clone().nth(self.clamp);
        let held = clamp.and_then(|clamp| clamp.pose());
        let held = held.expect("it was laid on a clamp");
        let laid = held * self.poses[self.clamp].inverse();
        let off = supports.zip(&self.poses).map(|(support, flat)| {
            let (way, turn) = deviation(&support, &(laid * *flat));
            way.norm() + turn.norm()
        });
        off.sum()
    }
}

/// By how much a support is off a pose of its node in the coordinates that it holds: displacement, and turn in world axes.
fn deviation(support: &NodeSupport, pose: &Pose) -> (Vector3<f64>, Vector3<f64>) {
    let way = |i: usize| support.position[i].map_or(0.0, |held| held - pose.position[i]);
    let turn = support.hold.frame().map_or_else(Vector3::zeros, |held| {
        let held: Matrix3<f64> = held.to_rotation_matrix().into_inner();
        log(&(held * pose.frame.transpose()))
    });
    (Vector3::from([0, 1, 2].map(way)), turn)
}

/// The place of the first support that holds a whole pose.
fn first_clamp(supports: &[NodeSupport]) -> Option<usize> {
    supports.iter().position(|support| support.pose().is_some())
}

/// The flat board on a programme, where the first support that holds a whole pose holds it; `None` without such a support, and
/// of a board that is not at rest where it is flat.
fn laid_flat<D: Density<F>, const F: usize, const N: usize>(
    program: &BeltProgram<D, F, N>,
) -> Option<BeltPoint<F>> {
    if program.is_curled() || program.is_loaded() || !program.links.is_empty() {
        return None;
    }
    let clamp = &program.supports[first_clamp(&program.supports)?];
    let held = clamp.pose()?;
    let start = Pose {
        frame: Matrix3::identity(),
        position: Vector3::zeros(),
    };
    let nodes = program.pieces.len() + 1;
    let mut flat = BeltPoint {
        fields: vec![SVector::zeros(); nodes],
        poses: vec![start; nodes],
    };
    program.carry(&mut flat);
    flat.poses[0] = held * flat.poses[clamp.node].inverse();
    program.carry(&mut flat);
    Some(flat)
}
