//! Keeps ribs apart on the whole board.
//!
//! |s| ≤ 2/V keeps them apart between the edges of their own stretch. Where the outline turns inwards, at the inner side of a bend,
//! steep ribs reach farther; which edge bounds them there depends on the shape. So the search begins without, and goes on with
//! the edges that the ribs of the shape found are nearest to crossing at, until none cross and none is held by an edge that it
//! does not reach.

use super::search::Search;
use crate::board::reach::{crossings, further_edges};
use crate::problem::Problem;
use crate::problem::program::{BeltPoint, BeltProgram, Piece};
use crate::strip::element::Element;
use crate::strip::ribs::{Edge, FURTHER};
use crate::strip::spine::Spine;
use stagewise::{Outcome, Solution};
use std::ops::ControlFlow;

/// Most times that the active edges are chosen anew.
const ROUNDS: usize = 20;
/// An edge at which 1 − s v is below this holds ribs.
const TOUCHING: f64 = 1e-4;
/// Edges at which 1 − s v differs by less than this are one.
const SAME: f64 = 1e-3;

/// Goes on from a minimum in which ribs may cross to one in which they do not, and bounds the programme so; with the arc
/// length where the edges are not settled, if they are not: ribs cross there, or are held by an edge they do not reach.
pub(super) fn keep_apart(
    problem: &Problem,
    search: &Search,
    program: &mut BeltProgram,
    mut solution: Solution<BeltPoint>,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> (Solution<BeltPoint>, Option<f64>) {
    for _ in 0..ROUNDS {
        let spine = problem.spine(program, &solution.at.point);
        if solution.outcome != Outcome::Converged || unsettled(program, &spine).is_none() {
            return (solution, None);
        }
        bound_by_edges_beyond(program, &spine);
        solution = search.again(program, solution, proceed);
    }
    let spine = problem.spine(program, &solution.at.point);
    let unsettled = unsettled(program, &spine).map(|element| spine.u[element]);
    (solution, unsettled)
}

/// The first element of which ribs cross, or are held by an edge that they no longer reach: taken for another shape, it
/// would bound this one for nothing.
pub(super) fn unsettled(program: &BeltProgram, spine: &Spine) -> Option<usize> {
    let crossing = crossings(spine).first().copied();
    crossing.or_else(|| {
        let is_bounded = |(_, element): (usize, &Element)| element.further != [None; FURTHER];
        if !program.elements().any(is_bounded) {
            return None;
        }
        let mut reached = further_edges(spine).into_iter();
        let held_for_nothing = |(k, edges): &(usize, [Option<Edge>; FURTHER])| {
            let Piece::Strip(element) = &program.pieces[*k] else {
                return false;
            };
            let (slope, s) = element
                .strips()
                .measure([spine.rib_slope[*k], spine.rib_slope[k + 1]]);
            let slack = |edge: &Edge| edge.slack(slope, s);
            let scaled = |edge: &Edge| edge.scaled(1.0 / spine.length());
            element.further.iter().zip(edges).any(|(taken, reached)| {
                let taken = taken.as_ref().map_or(f64::INFINITY, slack);
                let reached = reached
                    .as_ref()
                    .map_or(f64::INFINITY, |edge| slack(&scaled(edge)));
                taken < TOUCHING && reached > SAME + taken
            })
        };
        reached.find(held_for_nothing).map(|(k, _)| k)
    })
}

/// Bounds every element by the edges that its ribs reach past those of their own stretch.
fn bound_by_edges_beyond(program: &mut BeltProgram, spine: &Spine) {
    let scale = 1.0 / spine.length();
    for (k, edges) in further_edges(spine) {
        if let Piece::Strip(element) = &mut program.pieces[k] {
            element.further = edges.map(|edge| edge.map(|edge| edge.scaled(scale)));
        }
    }
}
