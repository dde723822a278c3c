//! The edges of the board as inequalities: the active edges keep ribs apart on the whole board.
//!
//! |s| ≤ 2/V keeps ribs apart between the edges of their own stretch. Where the outline turns inwards, at the inner side of
//! a bend, steep ribs reach farther; the edge that bounds them there depends on the shape.

use super::active_set::{ActiveSet, Shape};
use super::number;
use crate::board::reach::{edges_in_reach, first_crossing};
use crate::problem::program::{BeltProgram, Piece};
use crate::strip::bounds::{ActiveEdges, Edge};
use crate::strip::element::Element;

/// Slack 1 − s v at an edge below which the edge holds ribs, dimensionless.
const TOUCHING: f64 = 1e-4;
/// Difference of slacks 1 − s v below which two edges are the same, dimensionless.
const SAME: f64 = 1e-3;

/// The edges of the board.
pub(super) struct BoardEdges;

impl ActiveSet for BoardEdges {
    fn depends_on_shape(&self, program: &BeltProgram) -> bool {
        program.pieces.iter().any(|piece| match piece {
            Piece::Strip(element) => element.geodesic != 0.0,
            Piece::Joint { angle } => *angle != 0.0,
            Piece::Rigid { .. } => false,
        })
    }

    fn fault(&self, program: &BeltProgram, shape: &Shape) -> Option<String> {
        let crossing = first_crossing(&shape.board, &shape.spine);
        let element = crossing.or_else(|| held_from_afar(program, shape))?;
        Some(format!(
            "ribs beside a bend, at u = {}, could not be kept apart on the board; try another solver.bulge, a \
             narrower board or a gentler bend",
            number(shape.spine.u[element])
        ))
    }

    fn choose(&self, program: &mut BeltProgram, shape: &Shape) {
        for element in shape.spine.strips() {
            program.edges[element] = reached(shape, element);
        }
    }
}

/// The first element with ribs held by an active edge that they do not reach: an edge chosen for another shape would bound
/// this shape without cause.
fn held_from_afar(program: &BeltProgram, shape: &Shape) -> Option<usize> {
    let is_held_from_afar = |(k, element): &(usize, &Element)| {
        let slopes = [0, 1].map(|end| shape.spine.rib_slope[k + end]);
        let (slope, s) = element.strips().middle(slopes);
        let slack = |edge: &Option<Edge>| {
            edge.as_ref()
                .map_or(f64::INFINITY, |edge| edge.slack(slope, s))
        };
        let holding = program.edges[*k].each_ref().map(slack);
        holding.iter().any(|slack| *slack < TOUCHING) && {
            let in_reach = reached(shape, *k).each_ref().map(slack);
            let mut slacks = holding.iter().zip(&in_reach);
            slacks.any(|(holding, in_reach)| *holding < TOUCHING && *in_reach > SAME + *holding)
        }
    };
    program.elements().find(is_held_from_afar).map(|(k, _)| k)
}

/// The edges that ribs of an element of a shape reach, in units of its length U.
fn reached(shape: &Shape, element: usize) -> ActiveEdges {
    let scale = 1.0 / shape.spine.length();
    let edges = edges_in_reach(&shape.board, &shape.spine, element);
    edges.map(|edge| edge.map(|edge| edge.scaled(scale)))
}
