//! A mesh that stays the same while the numbers of a problem change.

use super::Problem;
use crate::problem::program::{BeltProgram, Piece};
use crate::strip::ribs::{Edge, FURTHER};

/// The mesh of a solution, and the edges that bound its ribs: what stays the same while the solution is continued.
#[derive(Debug, Clone)]
pub(crate) struct Mesh {
    /// Number of elements of every stretch of the belt.
    shares: Vec<usize>,
    /// Of every strip the active edges beyond those of its own stretch.
    further: Vec<Option<[Option<Edge>; FURTHER]>>,
}

impl Mesh {
    /// That of a programme of a problem.
    pub(crate) fn of(problem: &Problem, program: &BeltProgram) -> Self {
        let further = |piece: &Piece| match piece {
            Piece::Strip(element) => Some(element.further),
            Piece::Rigid { .. } | Piece::Joint { .. } => None,
        };
        Self {
            shares: problem.shares(problem.elements()),
            further: program.pieces.iter().map(further).collect(),
        }
    }
}

impl Problem {
    /// The programme on a mesh; `None` where the belt has other stretches than those that were meshed.
    pub(crate) fn program_on(&self, mesh: &Mesh) -> Option<BeltProgram> {
        let mut program = self.program_shared(&mesh.shares)?;
        if program.pieces.len() != mesh.further.len() {
            return None;
        }
        for (piece, held) in program.pieces.iter_mut().zip(&mesh.further) {
            match (piece, held) {
                (Piece::Strip(element), Some(held)) => element.further = *held,
                (Piece::Rigid { .. } | Piece::Joint { .. }, None) => (),
                _ => return None,
            }
        }
        Some(program)
    }
}
