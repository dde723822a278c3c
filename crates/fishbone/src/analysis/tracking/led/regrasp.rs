//! Another grasp of the belt: a support takes hold of it where it is, and another one lets it go.

use super::{Led, Update};
use crate::equilibrium::model::{StripModel, snapped_from};
use crate::equilibrium::{Equilibrium, Status};
use crate::geometry::log;
use crate::problem::{Mesh, Problem};
use crate::scenario::error::ScenarioError;
use crate::scenario::{Component, Place, SupportSpec};
use nalgebra::Vector3;
use std::ops::ControlFlow;

impl<D: StripModel<F, N>, const F: usize, const N: usize> Led<D, F, N> {
    /// As [`Tracker::regrasp`](super::super::Tracker::regrasp).
    pub(in super::super) fn regrasp(
        &mut self,
        hold: Option<f64>,
        release: Option<usize>,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Update, ScenarioError> {
        let (problem, moving) = self.regrasped(hold, release)?;
        let energy = self.energy();
        let before: Vec<_> = self.nodes().into_iter().zip(self.world()).collect();
        let found = self.on_supports_of(&problem, release.is_some(), proceed);
        let taken = found.as_ref().and_then(|found| {
            let solved = found.certified().ok()?;
            Some((Self::new(found, solved, &moving).ok()?, found.iterations))
        });
        let Some((taken, iterations)) = taken else {
            return Ok(Update {
                message:
                    "no equilibrium was found with these supports: the belt stays as it was held"
                        .to_owned(),
                ..self.report(Status::NotConverged, 0)
            });
        };
        *self = taken;
        /// Displacement of what is still held from which it has snapped, in V: beside a new hold ribs turn, which moves it by
        /// less.
        const SNAPPED: f64 = 0.2;
        let jump = self.displacement_between_supports(&before);
        Ok(Update {
            fraction: 1.0,
            snapped: jump >= SNAPPED * self.problem.belt().width,
            jump,
            released: energy - self.energy(),
            ..self.report(Status::Converged, iterations)
        })
    }

    /// The problem with other supports, and those of them that move.
    fn regrasped(
        &mut self,
        hold: Option<f64>,
        release: Option<usize>,
    ) -> Result<(Problem, Vec<usize>), ScenarioError> {
        let problem = self.present_problem();
        let mut supports = problem.scenario().supports.clone();
        let mut moving = self.moving.clone();
        let let_go = release.and_then(|release| supports.get(release).cloned());
        if let Some(release) = release {
            if release >= supports.len() {
                return Err(ScenarioError::invalid(
                    format!("supports[{release}]"),
                    "nothing",
                    "a support of the scenario",
                ));
            }
            supports.remove(release);
            moving.retain(|support| *support != release);
            for support in moving.iter_mut().filter(|support| **support > release) {
                *support -= 1;
            }
        }
        if let Some(u) = hold {
            let length = self.units().length;
            let place = supports.partition_point(|support| support.at.arc_length(length) < u);
            let let_go = let_go.filter(|support| support.at.arc_length(length) == u);
            let square = let_go.is_some_and(|support| problem.scenario().is_square_rib(&support));
            supports.insert(place, self.holding(u, square));
            for support in moving.iter_mut().filter(|support| **support >= place) {
                *support += 1;
            }
            moving.push(place);
        }
        let problem = problem.with_supports(supports)?;
        Ok((problem.about(self.problem.origin()), moving))
    }

    /// A support that holds the belt at an arc length where it is, and its rib square to the spine or not at all.
    fn holding(&mut self, u: f64, square: bool) -> SupportSpec {
        let pose = self.present(D::of_solution_on_mesh).spine.at(u).pose;
        let mut held = SupportSpec::new(Place::ArcLength(u));
        held.position = Some([0, 1, 2].map(|i| Component::Held(pose.position[i])));
        held.rotation = Some(log(&pose.frame).into());
        held.square_rib = Some(square);
        held
    }

    /// The equilibrium next to the present shape with the supports of another problem of the same belt, which let a part of it go
    /// or not; `None` where there is none.
    fn on_supports_of(
        &self,
        problem: &Problem,
        lets_go: bool,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Equilibrium> {
        let own = self.follower.program();
        let mesh = Mesh::of(&self.problem, own).with_stretches_of(problem, &self.problem);
        let mut program = D::program_on(problem, &mesh)?;
        let shape = D::prolonged(own, self.point(), &program);
        D::choose_active_sets(problem, &mut program, &shape);
        let mesh = Mesh::of(problem, &program);
        match lets_go {
            true => snapped_from::<D, F, N>(problem, &mesh, &shape, proceed),
            false => Some(D::minimum_next_to(problem, &mesh, &shape, proceed)),
        }
    }

    /// Largest displacement of the nodes of an earlier shape that supports still hold between them.
    fn displacement_between_supports(&mut self, before: &[(f64, Vector3<f64>)]) -> f64 {
        let held = self.supports();
        let [Some(first), Some(last)] = [held.first(), held.last()] else {
            return 0.0;
        };
        let spine = self.present(D::of_solution_on_mesh).spine;
        let between = before.iter().filter(|(u, _)| (*first..=*last).contains(u));
        let moved = between.map(|(u, position)| (spine.at(*u).pose.position - position).norm());
        moved.fold(0.0, f64::max)
    }
}
