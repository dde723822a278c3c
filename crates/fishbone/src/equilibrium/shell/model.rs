//! A strip of finite thickness as the analyses follow it: on uniform meshes, with the weak gauge.

use super::{
    BARRIERS, HALVINGS, POINTS, Proceed, ShellProgram, ShellSolution, change, drawn_in, halved,
    hides_energy, judged, minimise, prolonged, settings, shared_out, solve,
};
use crate::equilibrium::model::{AnyStationary, StripModel};
use crate::equilibrium::refinement::turns_too_far;
use crate::equilibrium::{AnySolved, Equilibrium, Solved, Status};
use crate::problem::program::BeltPoint;
use crate::problem::{Mesh, Problem};
use crate::strip::shell::{FIELDS, Gauge, Shell};
use nalgebra::SVector;
use stagewise::{Multipliers, Outcome, Settings, Stationary, assess};
use std::ops::ControlFlow;

impl StripModel<FIELDS, 12> for Shell {
    fn solved(any: &AnySolved) -> Option<&Solved<Self, FIELDS, 12>> {
        match any {
            AnySolved::Developable(_) => None,
            AnySolved::Shell(solved) => Some(solved),
        }
    }

    fn any_stationary(at: Stationary<BeltPoint<FIELDS>>) -> AnyStationary {
        AnyStationary::Shell(at)
    }

    fn program_on(problem: &Problem, mesh: &Mesh) -> Option<ShellProgram> {
        let weak = Shell::new(Gauge::WEAK, POINTS);
        Some(problem.program_on(mesh)?.as_shell(weak))
    }

    fn prolonged(
        from: &ShellProgram,
        point: &BeltPoint<FIELDS>,
        to: &ShellProgram,
    ) -> BeltPoint<FIELDS> {
        prolonged(from, point, to)
    }

    fn prolonged_with_multipliers(
        from: &ShellProgram,
        at: &Stationary<BeltPoint<FIELDS>>,
        to: &ShellProgram,
    ) -> Stationary<BeltPoint<FIELDS>> {
        Stationary {
            point: drawn_in(to, prolonged(from, &at.point, to)),
            multipliers: Multipliers {
                equalities: at.multipliers.equalities.clone(),
                inequalities: shared_out(from, &at.multipliers.inequalities, to),
            },
        }
    }

    fn of_solution(
        problem: &Problem,
        program: ShellProgram,
        solution: ShellSolution,
    ) -> Equilibrium {
        judged(problem, program, solution)
    }

    /// Every such equilibrium is looked at for energy that hides from its mesh.
    fn of_solution_on_mesh(
        problem: &Problem,
        program: ShellProgram,
        solution: ShellSolution,
    ) -> Equilibrium {
        judged(problem, program, solution)
    }

    fn minimum_next_to(
        problem: &Problem,
        mesh: &Mesh,
        shape: &BeltPoint<FIELDS>,
        proceed: &mut Proceed,
    ) -> Equilibrium {
        let Some(program) = Self::program_on(problem, mesh) else {
            return solve(problem, proceed);
        };
        let start = drawn_in(&program, shape.clone());
        let found = minimise(&program, &settings(problem, BARRIERS[0]), start, proceed);
        judged(problem, program, found)
    }

    fn solve_near(
        problem: &Problem,
        mesh: &Mesh,
        shape: &BeltPoint<FIELDS>,
        proceed: &mut Proceed,
    ) -> Equilibrium {
        let near = Self::minimum_next_to(problem, mesh, shape, proceed);
        match near.status {
            Status::Converged => near,
            Status::Infeasible | Status::NotConverged => {
                let found = solve(problem, proceed);
                Equilibrium {
                    iterations: near.iterations + found.iterations,
                    ..found
                }
            }
        }
    }

    /// The way down is that of the strong gauge, which has no false minima to stop at.
    fn downhill(
        problem: &Problem,
        mesh: &Mesh,
        shape: &BeltPoint<FIELDS>,
        proceed: &mut Proceed,
    ) -> Equilibrium {
        let Some(weak) = Self::program_on(problem, mesh) else {
            return solve(problem, proceed);
        };
        let mut strong = weak.clone();
        strong.model = Self::new(Gauge::STRONG, POINTS);
        let downhill = Settings::downhill(problem.tolerance(), 1.0);
        let start = drawn_in(&strong, shape.clone());
        let down = minimise(&strong, &downhill, start, proceed);
        if down.outcome != Outcome::Converged {
            return judged(problem, strong, down);
        }
        let found = minimise(
            &weak,
            &settings(problem, BARRIERS[0]),
            down.at.point,
            proceed,
        );
        judged(problem, weak, found.after(down.iterations))
    }

    fn carries(
        problem: &Problem,
        program: &ShellProgram,
        at: &Stationary<BeltPoint<FIELDS>>,
        _objective: f64,
    ) -> bool {
        /// Error from which a strip goes on on another mesh, over the accuracy, dimensionless.
        const TOO_LARGE: f64 = 10.0;
        if problem.has_fixed_mesh() {
            return true;
        }
        let solution = assess(program, problem.tolerance(), at);
        let go_on: &mut Proceed = &mut || ControlFlow::Continue(());
        halved(problem, program, &solution, go_on).is_some_and(|(finer, better)| {
            let error = change(problem, (program, &solution), (&finer, &better));
            error.of_the_whole() <= TOO_LARGE * problem.accuracy()
        })
    }

    /// Energy that hides from a mesh grows with the fields, and to see it takes as long as an iteration.
    fn is_as_sound_as(fields: &[SVector<f64, FIELDS>], sound: &[SVector<f64, FIELDS>]) -> bool {
        /// Largest change of any field at a node, over the largest of its kind on the belt, and in programme units of one that
        /// vanishes but for rounding.
        const CHANGE: f64 = 0.02;
        const ROUNDING: f64 = 1e-6;
        let largest = |field: usize| {
            let sizes = sound.iter().map(|fields| fields[field].abs());
            sizes.fold(0.0, f64::max)
        };
        let scales = SVector::<f64, FIELDS>::from_fn(|field, _| CHANGE * largest(field) + ROUNDING);
        fields.len() == sound.len()
            && fields.iter().zip(sound).all(|(own, other)| {
                let changes = own.iter().zip(other).zip(&scales);
                changes
                    .into_iter()
                    .all(|((own, other), scale)| (own - other).abs() <= *scale)
            })
    }

    /// As elements turn, or because energy hides from the mesh.
    fn is_of_mesh_alone(
        problem: &Problem,
        program: &ShellProgram,
        shape: &BeltPoint<FIELDS>,
    ) -> bool {
        turns_too_far(program, shape) || hides_energy(problem, program, shape)
    }

    /// The mesh of elements half as long.
    fn mesh_that_carries(
        problem: &Problem,
        program: &ShellProgram,
        _at: &Stationary<BeltPoint<FIELDS>>,
    ) -> Option<Mesh> {
        let mesh = Mesh::of(problem, program).halved();
        let is_fine = mesh.elements() > problem.elements() << HALVINGS;
        (!problem.has_fixed_mesh() && !is_fine).then_some(mesh)
    }
}
