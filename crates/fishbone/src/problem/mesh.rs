//! A mesh that stays the same while the data of a problem change.

use super::Problem;
use crate::problem::program::{BeltProgram, Piece};
use crate::strip::bounds::ActiveEdges;

/// The mesh of a solution and its active edges, which stay the same while the solution is continued.
#[derive(Debug, Clone)]
pub(crate) struct Mesh {
    /// Number of elements of every stretch of the belt.
    shares: Vec<usize>,
    /// Whether each piece is a strip, and its active edges.
    pieces: Vec<(bool, ActiveEdges)>,
}

impl Mesh {
    /// The mesh of a programme of a problem.
    pub(crate) fn of(problem: &Problem, program: &BeltProgram) -> Self {
        let pieces = program.pieces.iter().map(is_strip);
        Self {
            shares: problem.shares(problem.elements()),
            pieces: pieces.zip(program.edges.iter().copied()).collect(),
        }
    }
}

impl Problem {
    /// The programme on a mesh; `None` where the belt has other stretches than the mesh.
    pub(crate) fn program_on(&self, mesh: &Mesh) -> Option<BeltProgram> {
        let mut program = self.program_shared(&mesh.shares)?;
        let pieces = program.pieces.iter().map(is_strip);
        if !pieces.eq(mesh.pieces.iter().map(|(is_strip, _)| *is_strip)) {
            return None;
        }
        program.edges = mesh.pieces.iter().map(|(_, edges)| *edges).collect();
        Some(program)
    }
}

fn is_strip(piece: &Piece) -> bool {
    matches!(piece, Piece::Strip(_))
}
