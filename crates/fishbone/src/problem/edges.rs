//! The edges of the board as inequalities: the active edges keep ribs apart on the whole board.
//!
//! |s| ≤ 2/V keeps ribs apart between the edges of their own stretch. Where the outline turns inwards, at the inner side of
//! a bend, steep ribs reach farther; the edge that bounds them there depends on the shape.

use super::active_set::ActiveSet;
use super::number;
use crate::board::reach::{crossings, edges_in_reach};
use crate::problem::program::{BeltProgram, Piece};
use crate::strip::bounds::{ACTIVE, ActiveEdges, Edge};
use crate::strip::element::Element;
use crate::strip::spine::Spine;

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

    fn fault(&self, program: &BeltProgram, shape: &Spine) -> Option<String> {
        let crossing = crossings(shape).first().copied();
        let element = crossing.or_else(|| held_from_afar(program, shape))?;
        Some(format!(
            "ribs beside a bend, at u = {}, could not be kept apart on the board; try another solver.bulge, a \
             narrower board or a gentler bend",
            number(shape.u[element])
        ))
    }

    fn choose(&self, program: &mut BeltProgram, shape: &Spine) {
        for (k, edges) in edges_in_reach(shape) {
            program.edges[k] = in_programme(&edges, shape);
        }
    }
}

/// The first element with ribs held by an active edge that they do not reach: an edge chosen for another shape would bound
/// this shape without cause.
fn held_from_afar(program: &BeltProgram, shape: &Spine) -> Option<usize> {
    let is_bounded = |(k, _): (usize, &Element)| program.edges[k] != [None; ACTIVE];
    if !program.elements().any(is_bounded) {
        return None;
    }
    let mut reached = edges_in_reach(shape).into_iter();
    let is_held_from_afar = |(k, edges): &(usize, ActiveEdges)| {
        let Piece::Strip(element) = &program.pieces[*k] else {
            return false;
        };
        let slopes = [shape.rib_slope[*k], shape.rib_slope[k + 1]];
        let (slope, s) = element.strips().middle(slopes);
        let slack = |edge: &Option<Edge>| {
            edge.as_ref()
                .map_or(f64::INFINITY, |edge| edge.slack(slope, s))
        };
        let reached = in_programme(edges, shape);
        let mut active = program.edges[*k].iter().zip(&reached);
        active.any(|(active, reached)| {
            let slacks = [active, reached].map(slack);
            slacks[0] < TOUCHING && slacks[1] > SAME + slacks[0]
        })
    };
    reached.find(is_held_from_afar).map(|(k, _)| k)
}

/// Edges of a shape in units of its length U.
fn in_programme(edges: &ActiveEdges, shape: &Spine) -> ActiveEdges {
    let scale = 1.0 / shape.length();
    edges.map(|edge| edge.map(|edge| edge.scaled(scale)))
}
