//! The mesh of a tracker follows the error of its shape.

use super::Led;
use super::way::Way;
use crate::equilibrium::model::StripModel;
use crate::equilibrium::{Equilibrium, Solved, Status, largest_change};
use crate::problem::Mesh;
use stagewise::Distance;
use std::ops::ControlFlow;

impl<D: StripModel<F, N>, const F: usize, const N: usize> Led<D, F, N> {
    /// Goes on on another mesh where the present one carries the shape at the end of a way no more; not converged where this is an
    /// equilibrium of its mesh alone.
    pub(super) fn follow_error(
        &mut self,
        way: &mut Way<Self>,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Status {
        /// Change within an element over that of the last estimate from which the error is estimated again, dimensionless.
        const GROWN: f64 = 1.5;
        let (program, point) = (self.follower.program(), self.follower.point());
        let change = largest_change(program, point);
        let is_as_before = D::is_as_sound_as(&point.fields, &self.sound);
        let is_far = !is_as_before && D::is_of_mesh_alone(&self.problem, program, point);
        if !is_as_before && !is_far {
            self.sound.clone_from(&point.fields);
        }
        let is_watched = way.jump > 0.0 || change > GROWN * self.watched;
        if !is_far && !is_watched {
            return Status::Converged;
        }
        // Without time left this waits for the next update, so that updates of little time come on.
        if !is_far && proceed().is_break() {
            if way.jump > 0.0 {
                self.watched = 0.0;
            }
            return Status::Converged;
        }
        let better = self.on_mesh_that_carries(way, proceed);
        // A search that was stopped is made up for by the next update.
        let is_stopped = better.is_none() && proceed().is_break();
        self.watched = match is_stopped {
            true => 0.0,
            false => change.max(self.watched),
        };
        let is_carried = match better {
            Some(better) => {
                self.watched = 0.0;
                self.restart(&better)
            }
            None => !is_far,
        };
        match is_carried {
            true => Status::Converged,
            false => self.equilibrium().status,
        }
    }

    /// The present equilibrium on a mesh that carries it; `None` where its own mesh does, or where there is no other.
    fn on_mesh_that_carries(
        &mut self,
        way: &mut Way<Self>,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Equilibrium> {
        /// Largest displacement of a node from mesh to mesh, in U: beyond, the shape is another one.
        const SAME_BELT: f64 = 1e-2;
        let problem = self.present_problem();
        let at = self.follower.solution().at;
        let (own, objective) = (self.follower.program(), self.follower.values().objective);
        if D::carries(&problem, own, &at, objective) {
            return None;
        }
        let mesh = D::mesh_that_carries(&problem, own, &at)?;
        let mut program = D::program_on(&problem, &mesh)?;
        let shape = D::prolonged(own, &at.point, &program);
        D::choose_active_sets(&problem, &mut program, &shape);
        let mesh = Mesh::of(&problem, &program);
        let found = D::minimum_next_to(&problem, &mesh, &shape, proceed);
        way.iterations += found.iterations;
        let is_here = |solved: &Solved<D, F, N>| solved.at.point.distance(&shape) <= SAME_BELT;
        found.certified().is_ok_and(is_here).then_some(found)
    }
}
