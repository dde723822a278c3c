//! The constraints of a problem that have active sets.

use super::Problem;
use super::active_set::ActiveSet;
use super::edges::BoardEdges;
use crate::problem::program::{BeltPoint, BeltProgram};

/// Kinds of inequalities with an active set, one of each.
const KINDS: [&dyn ActiveSet; 1] = [&BoardEdges];

impl Problem {
    /// Whether the active sets of a programme depend on its shape.
    pub(crate) fn has_active_sets(&self, program: &BeltProgram) -> bool {
        KINDS.iter().any(|kind| kind.depends_on_shape(program))
    }

    /// The first fault of the active sets of a programme for a shape; `None` where they are right.
    pub(crate) fn active_set_fault(
        &self,
        program: &BeltProgram,
        point: &BeltPoint,
    ) -> Option<String> {
        if !self.has_active_sets(program) {
            return None;
        }
        let shape = self.spine(program, point);
        KINDS.iter().find_map(|kind| kind.fault(program, &shape))
    }

    /// Gives a programme the active sets for a shape.
    pub(crate) fn choose_active_sets(&self, program: &mut BeltProgram, point: &BeltPoint) {
        let shape = self.spine(program, point);
        for kind in KINDS {
            kind.choose(program, &shape);
        }
    }
}
