//! The constraints of a problem that have active sets.

use super::Problem;
use super::active_set::{ActiveSet, Shape};
use super::edges::BoardEdges;
use crate::board::feet::Board;
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
        self.shape(program, point)?.active_set_fault(program)
    }

    /// The shape by which the active sets of a programme are judged; `None` where they do not depend on it.
    pub(crate) fn shape(&self, program: &BeltProgram, point: &BeltPoint) -> Option<Shape> {
        self.has_active_sets(program)
            .then(|| self.on_board(program, point))
    }

    fn on_board(&self, program: &BeltProgram, point: &BeltPoint) -> Shape {
        let spine = self.spine(program, point);
        let board = Board::of(&spine);
        Shape { spine, board }
    }

    /// Gives a programme the active sets for a shape.
    pub(crate) fn choose_active_sets(&self, program: &mut BeltProgram, point: &BeltPoint) {
        let shape = self.on_board(program, point);
        for kind in KINDS {
            kind.choose(program, &shape);
        }
    }
}

impl Shape {
    /// Takes another shape of the same programme.
    pub(crate) fn move_to<const F: usize>(&mut self, problem: &Problem, point: &BeltPoint<F>) {
        problem.move_spine(&mut self.spine, point);
    }

    /// The first fault of the active sets of a programme for the shape; `None` where they are right.
    pub(crate) fn active_set_fault(&self, program: &BeltProgram) -> Option<String> {
        KINDS.iter().find_map(|kind| kind.fault(program, self))
    }
}
