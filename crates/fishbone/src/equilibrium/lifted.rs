//! Boards that their supports hold nearly in their flat shape: solved where they are farther off the plane, then brought back.
//!
//! Off the plane by a small lift, bends are in proportion to the lift, shortenings and the energy to its square, and the ribs
//! lie the same. So a shape with a larger lift gives those of all smaller ones, where a search from anywhere else would have
//! to find supports to within the square of the lift.

use super::{Equilibrium, Start, beside_the_guess, intrinsic};
use crate::geometry::{Pose, exp, log};
use crate::problem::program::{BeltPoint, BeltProgram, Hold, NodeSupport};
use crate::problem::{Mesh, Problem};
use crate::scenario::Component;
use nalgebra::{Matrix3, Vector2, Vector3};
use std::ops::ControlFlow;

/// Lift from which a board is brought back, in U and rad.
const LIFT: f64 = 0.01;

/// The minimum of a board that is held off its flat shape by less than [`LIFT`]; `None` of another one, and where the search
/// finds no minimum.
pub(super) fn brought_back(
    problem: &Problem,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Equilibrium> {
    let (farther, times) = farther(problem)?;
    let far = beside_the_guess(&farther, proceed);
    let solved = far.solved.as_ref().filter(|_| far.is_minimum())?;
    let mut shape = solved.at.point.clone();
    for fields in &mut shape.fields {
        fields[0] /= times;
    }
    let mesh = Mesh::of(&farther, &solved.program);
    let program = problem.program_on(&mesh)?;
    let flat = laid_flat(problem, &program, None)?;
    shape.poses[0] = flat.poses[0];
    program.settle(&mut shape);
    let near = intrinsic::solve(problem, Start::Minimum(&mesh, &shape), proceed);
    near.is_minimum().then(|| Equilibrium {
        iterations: near.iterations + far.iterations,
        ..near
    })
}

/// The same board with its supports farther off the flat shape, as far as [`LIFT`], and how many times as far; `None` where they
/// are not nearly in the plane, or the energy is not in proportion to the square of the lift.
fn farther(problem: &Problem) -> Option<(Problem, f64)> {
    /// Greatest ratio of deviations in the plane to the squares of those off it.
    const IN_PLANE: f64 = 10.0;
    let program = problem.program(problem.elements());
    let flat = laid_flat(problem, &program, None)?;
    let normal: Vector3<f64> = flat.poses[0].frame.column(0).into_owned();
    let off = |vector: &Vector3<f64>| vector.dot(&normal) * normal;
    let mut supports = problem.scenario().supports.clone();
    let moves: Vec<_> = program
        .supports
        .iter()
        .map(|support| {
            let (way, turn) = deviation(support, &flat);
            // A turn about the normal is one in the plane.
            [
                (off(&way), way - off(&way)),
                (turn - off(&turn), off(&turn)),
            ]
        })
        .collect();
    let both = moves.iter().flatten();
    let [lift, inside] = both.fold([0.0f64; 2], |[most_off, most_inside], (off, inside)| {
        [most_off.max(off.norm()), most_inside.max(inside.norm())]
    });
    let is_near = lift > 0.0 && lift < LIFT && inside <= IN_PLANE * lift * lift;
    if !is_near {
        return None;
    }
    let times = LIFT / lift;
    let farther =
        |(off, inside): &(Vector3<f64>, Vector3<f64>)| times * off + times * times * inside;
    let length = problem.units().length;
    for ((spec, support), [way, turn]) in supports.iter_mut().zip(&program.supports).zip(&moves) {
        let pose = &flat.poses[support.node];
        let place = problem.origin() + length * (pose.position + farther(way));
        if let Some(position) = &mut spec.position {
            for (held, place) in position.iter_mut().zip(&place) {
                if matches!(held, Component::Held(_)) {
                    *held = Component::Held(*place);
                }
            }
        }
        if support.hold.frame().is_some() {
            spec.rotation = Some(log(&(exp(&farther(turn)) * pose.frame)).into());
            (spec.euler, spec.quaternion) = (None, None);
        }
    }
    Some((problem.with_supports(supports).ok()?, times))
}

/// The pose at which a support, given by its place in the scenario, holds a board flat where the other supports hold it; `None`
/// where these do not hold it flat at rest. Units: those of the programme.
pub(crate) fn flat_pose(problem: &Problem, program: &BeltProgram, support: usize) -> Option<Pose> {
    /// Deviation up to which supports hold a board flat, in U and rad.
    const NONE: f64 = 1e-9;
    let flat = laid_flat(problem, program, Some(support))?;
    let others = program.supports.iter().enumerate();
    let mut others = others.filter(|(i, _)| *i != support);
    let is_met = others.all(|(_, other)| {
        let (way, turn) = deviation(other, &flat);
        way.norm() + turn.norm() <= NONE
    });
    is_met.then(|| flat.poses[program.supports[support].node])
}

/// By how much a support is off a shape in the coordinates that it holds: displacement, and turn in world axes.
fn deviation(support: &NodeSupport, shape: &BeltPoint) -> (Vector3<f64>, Vector3<f64>) {
    let pose = &shape.poses[support.node];
    let way = |i: usize| support.position[i].map_or(0.0, |held| held - pose.position[i]);
    let turn = support.hold.frame().map_or_else(Vector3::zeros, |held| {
        let held: Matrix3<f64> = held.to_rotation_matrix().into_inner();
        log(&(held * pose.frame.transpose()))
    });
    (Vector3::from([0, 1, 2].map(way)), turn)
}

/// The flat board on a programme, where the first support that holds a whole pose holds it, but for one that does not count;
/// `None` without such a support, and of a board that is not at rest where it is flat.
fn laid_flat(problem: &Problem, program: &BeltProgram, but: Option<usize>) -> Option<BeltPoint> {
    let is_curled = program.elements().any(|(_, e)| e.curl.bend != 0.0);
    if is_curled || program.is_loaded() || !program.links.is_empty() {
        return None;
    }
    let is_clamp = |support: &usize| Some(*support) != but && problem.clamp(*support).is_some();
    let clamp = (0..problem.scenario().supports.len()).find(is_clamp)?;
    let clamp = &program.supports[clamp];
    let Hold::Frame(frame) = clamp.hold else {
        return None;
    };
    let start = Pose {
        frame: Matrix3::identity(),
        position: Vector3::zeros(),
    };
    let nodes = program.pieces.len() + 1;
    let mut flat = BeltPoint {
        fields: vec![Vector2::zeros(); nodes],
        poses: vec![start; nodes],
    };
    program.carry(&mut flat);
    let there = flat.poses[clamp.node];
    let frame: Matrix3<f64> = frame.to_rotation_matrix().into_inner() * there.frame.transpose();
    let [x, y, z] = clamp.position;
    let position = Vector3::new(x?, y?, z?) - frame * there.position;
    flat.poses[0] = Pose { frame, position };
    program.carry(&mut flat);
    Some(flat)
}
