//! What the analyses of an equilibrium need of the model of its strip.

use super::{AnySolved, Equilibrium, Solved, Start, intrinsic, refinement, search};
use crate::geometry::Pose;
use crate::problem::program::{BeltPoint, BeltProgram};
use crate::problem::{Mesh, Problem, Shape};
use crate::strip::density::Density;
use crate::strip::developable::DevelopableEnergy;
use crate::strip::shell::FIELDS;
use nalgebra::SVector;
use stagewise::{Distance, Solution, Stationary};
use std::ops::ControlFlow;

type Proceed<'a> = dyn FnMut() -> ControlFlow<()> + 'a;

/// A model of the strip whose equilibria are searched for, followed and differentiated: `F` fields and `N` unknowns a node.
pub(crate) trait StripModel<const F: usize, const N: usize>: Density<F> {
    /// The programme of this model and its solution; `None` of another model.
    fn solved(any: &AnySolved) -> Option<&Solved<Self, F, N>>;

    /// A stationary point of this model.
    fn any_stationary(at: Stationary<BeltPoint<F>>) -> AnyStationary;

    /// The programme of a problem on a mesh; `None` where the belt has other stretches than the mesh.
    fn program_on(problem: &Problem, mesh: &Mesh) -> Option<BeltProgram<Self, F, N>>;

    /// The same shape on another mesh of the same belt.
    fn prolonged(
        from: &BeltProgram<Self, F, N>,
        point: &BeltPoint<F>,
        to: &BeltProgram<Self, F, N>,
    ) -> BeltPoint<F>;

    /// A shape with its multipliers on another mesh of the same belt, or with other active edges.
    fn prolonged_with_multipliers(
        from: &BeltProgram<Self, F, N>,
        at: &Stationary<BeltPoint<F>>,
        to: &BeltProgram<Self, F, N>,
    ) -> Stationary<BeltPoint<F>>;

    /// The equilibrium of a solution of a problem's programme that was found by other means; it has converged only if this
    /// is an equilibrium of the belt, not of its mesh alone.
    fn of_solution(
        problem: &Problem,
        program: BeltProgram<Self, F, N>,
        solution: Solution<BeltPoint<F>>,
    ) -> Equilibrium;

    /// The equilibrium of a mesh, be it one of the belt or not.
    fn of_solution_on_mesh(
        problem: &Problem,
        program: BeltProgram<Self, F, N>,
        solution: Solution<BeltPoint<F>>,
    ) -> Equilibrium;

    /// The minimum next to a shape on a mesh, whatever its active sets.
    fn minimum_next_to(
        problem: &Problem,
        mesh: &Mesh,
        shape: &BeltPoint<F>,
        proceed: &mut Proceed,
    ) -> Equilibrium;

    /// The equilibrium on a mesh from a shape that is near to a minimum; from the guess if this shape leads to no minimum.
    fn solve_near(
        problem: &Problem,
        mesh: &Mesh,
        shape: &BeltPoint<F>,
        proceed: &mut Proceed,
    ) -> Equilibrium;

    /// The nearest minimum downhill from a shape on a mesh.
    fn downhill(
        problem: &Problem,
        mesh: &Mesh,
        shape: &BeltPoint<F>,
        proceed: &mut Proceed,
    ) -> Equilibrium;

    /// Whether a mesh that follows the error carries a stationary point of a problem's programme well enough to be followed on
    /// it; a mesh that the scenario fixes carries all.
    fn carries(
        problem: &Problem,
        program: &BeltProgram<Self, F, N>,
        at: &Stationary<BeltPoint<F>>,
        objective: f64,
    ) -> bool;

    /// A mesh that should carry a stationary point of a problem's programme; `None` where there is none, or none of few
    /// elements.
    fn mesh_that_carries(
        problem: &Problem,
        program: &BeltProgram<Self, F, N>,
        at: &Stationary<BeltPoint<F>>,
    ) -> Option<Mesh>;

    /// Whether fields at the nodes of a mesh are so near to others, of an equilibrium of the belt, that theirs is one, too:
    /// never where it takes no time to see.
    fn is_as_sound_as(_fields: &[SVector<f64, F>], _sound: &[SVector<f64, F>]) -> bool {
        false
    }

    /// Whether an equilibrium of a mesh is none of the belt: elements turn too far.
    fn is_of_mesh_alone(
        _problem: &Problem,
        program: &BeltProgram<Self, F, N>,
        shape: &BeltPoint<F>,
    ) -> bool {
        refinement::turns_too_far(program, shape)
    }

    /// Whether a part of the loaded belt has stayed flat, so that how it begins to twist is not smooth.
    fn is_flat(_program: &BeltProgram<Self, F, N>, _point: &BeltPoint<F>) -> bool {
        false
    }

    /// Whether the active sets of a programme depend on its shape.
    fn has_active_sets(_problem: &Problem, _program: &BeltProgram<Self, F, N>) -> bool {
        false
    }

    /// The shape by which the active sets of a programme are judged; `None` where they do not depend on it.
    fn shape(
        _problem: &Problem,
        _program: &BeltProgram<Self, F, N>,
        _point: &BeltPoint<F>,
    ) -> Option<Shape> {
        None
    }

    /// The first fault of the active sets of a programme for a shape; `None` where they are right.
    fn active_set_fault(_program: &BeltProgram<Self, F, N>, _shape: &Shape) -> Option<String> {
        None
    }

    /// Gives a programme the active sets for a shape.
    fn choose_active_sets(
        _problem: &Problem,
        _program: &mut BeltProgram<Self, F, N>,
        _point: &BeltPoint<F>,
    ) {
    }

    /// Whether the mesh is graded anew as the belt is led on.
    fn is_graded_anew(_problem: &Problem) -> bool {
        false
    }

    /// The minimum that a search finds from a shape of a programme, and nowhere else, on a mesh graded anew for this shape and its
    /// error; `None` of a programme of another belt, and of a model whose meshes are uniform.
    fn minimum_graded_anew(
        _problem: &Problem,
        _program: &BeltProgram<Self, F, N>,
        _shape: &BeltPoint<F>,
        _proceed: &mut Proceed,
    ) -> Option<Equilibrium> {
        None
    }
}

/// A stationary point of a strip's programme.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum AnyStationary {
    /// Of a developable belt.
    Developable(Stationary<BeltPoint>),
    /// Of a strip of finite thickness.
    Shell(Stationary<BeltPoint<FIELDS>>),
}

impl AnyStationary {
    /// Poses of the nodes.
    pub(crate) fn poses(&self) -> &[Pose] {
        match self {
            Self::Developable(at) => &at.point.poses,
            Self::Shell(at) => &at.point.poses,
        }
    }
}

/// The minimum to which a belt snaps from a shape that is no minimum: of those that a descent from the shape and a search near
/// to it find, the one next to the shape; `None` where neither finds any.
pub(crate) fn snapped_from<D: StripModel<F, N>, const F: usize, const N: usize>(
    problem: &Problem,
    mesh: &Mesh,
    shape: &BeltPoint<F>,
    proceed: &mut Proceed,
) -> Option<Equilibrium> {
    let found = [
        D::downhill(problem, mesh, shape, proceed),
        D::solve_near(problem, mesh, shape, proceed),
    ];
    let distance = |found: &Equilibrium| {
        let solved = found.certified::<D, F, N>().ok();
        solved.map_or(f64::INFINITY, |solved| solved.at.point.distance(shape))
    };
    let is_minimum =
        |found: &Equilibrium| distance(found).is_finite() && found.stable() != Some(false);
    let minima = found.into_iter().filter(is_minimum);
    minima.min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

impl StripModel<2, 8> for DevelopableEnergy {
    fn solved(any: &AnySolved) -> Option<&Solved> {
        match any {
            AnySolved::Developable(solved) => Some(solved),
            AnySolved::Shell(_) => None,
        }
    }

    fn any_stationary(at: Stationary<BeltPoint>) -> AnyStationary {
        AnyStationary::Developable(at)
    }

    fn program_on(problem: &Problem, mesh: &Mesh) -> Option<BeltProgram> {
        problem.program_on(mesh)
    }

    fn prolonged(from: &BeltProgram, point: &BeltPoint, to: &BeltProgram) -> BeltPoint {
        search::prolonged(from, point, to)
    }

    fn prolonged_with_multipliers(
        from: &BeltProgram,
        at: &Stationary<BeltPoint>,
        to: &BeltProgram,
    ) -> Stationary<BeltPoint> {
        search::prolonged_with_multipliers(from, at, to)
    }

    fn is_flat(program: &BeltProgram, point: &BeltPoint) -> bool {
        search::is_flat_under_load(program, point)
    }

    fn of_solution(
        problem: &Problem,
        program: BeltProgram,
        solution: Solution<BeltPoint>,
    ) -> Equilibrium {
        intrinsic::of_solution(problem, program, solution)
    }

    fn of_solution_on_mesh(
        problem: &Problem,
        program: BeltProgram,
        solution: Solution<BeltPoint>,
    ) -> Equilibrium {
        intrinsic::of_solution_on_mesh(problem, program, solution)
    }

    fn minimum_next_to(
        problem: &Problem,
        mesh: &Mesh,
        shape: &BeltPoint,
        proceed: &mut Proceed,
    ) -> Equilibrium {
        intrinsic::solve(problem, Start::Close(mesh, shape), proceed)
    }

    fn solve_near(
        problem: &Problem,
        mesh: &Mesh,
        shape: &BeltPoint,
        proceed: &mut Proceed,
    ) -> Equilibrium {
        intrinsic::solve(problem, Start::Near(mesh, shape), proceed)
    }

    fn downhill(
        problem: &Problem,
        mesh: &Mesh,
        shape: &BeltPoint,
        proceed: &mut Proceed,
    ) -> Equilibrium {
        intrinsic::solve(problem, Start::Downhill(mesh, shape), proceed)
    }

    fn carries(
        problem: &Problem,
        program: &BeltProgram,
        at: &Stationary<BeltPoint>,
        objective: f64,
    ) -> bool {
        refinement::carries(problem, program, at, objective)
    }

    fn mesh_that_carries(
        problem: &Problem,
        program: &BeltProgram,
        at: &Stationary<BeltPoint>,
    ) -> Option<Mesh> {
        refinement::mesh_that_carries(problem, program, at)
    }

    fn has_active_sets(problem: &Problem, program: &BeltProgram) -> bool {
        problem.has_active_sets(program)
    }

    fn shape(problem: &Problem, program: &BeltProgram, point: &BeltPoint) -> Option<Shape> {
        problem.shape(program, point)
    }

    fn active_set_fault(program: &BeltProgram, shape: &Shape) -> Option<String> {
        shape.active_set_fault(program)
    }

    fn choose_active_sets(problem: &Problem, program: &mut BeltProgram, point: &BeltPoint) {
        problem.choose_active_sets(program, point);
    }

    fn is_graded_anew(problem: &Problem) -> bool {
        super::is_slender_on_graded_mesh(problem)
    }

    fn minimum_graded_anew(
        problem: &Problem,
        program: &BeltProgram,
        shape: &BeltPoint,
        proceed: &mut Proceed,
    ) -> Option<Equilibrium> {
        super::slender_minimum_near(problem, program, shape, proceed)
    }
}
