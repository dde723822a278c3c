//! Keeps ribs apart on the whole board.
//!
//! |s| ≤ 2/V keeps them apart between the edges of their own stretch. Where the outline turns inwards, at the inner side of a bend,
//! steep ribs reach farther; which edge bounds them there depends on the shape. So the search begins without, and goes on with
//! the edges that the ribs of the shape found are nearest to crossing at, until none cross.

use super::assembly::Assembly;
use super::search::Search;
use crate::program::{BeltPoint, BeltProgram, Piece};
use crate::solver::{Outcome, Solution};
use crate::spine::Spine;
use crate::surface::{crossings, further_edges};
use std::ops::ControlFlow;

/// Most times that further edges are taken.
const ROUNDS: usize = 20;

/// Goes on from a minimum in which ribs may cross to one in which they do not, and bounds the programme so; with the arc
/// length where they still cross, if they do.
pub(super) fn keep_apart(
    assembly: &Assembly,
    search: &Search,
    program: &mut BeltProgram,
    mut solution: Solution<BeltPoint>,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> (Solution<BeltPoint>, Option<f64>) {
    let crossing = |spine: &Spine| crossings(spine).first().map(|element| spine.u[*element]);
    for _ in 0..ROUNDS {
        let spine = assembly.spine(program, &solution.point);
        if solution.outcome != Outcome::Converged || crossing(&spine).is_none() {
            return (solution, None);
        }
        take_further_edges(program, &spine);
        solution = search.again(program, solution, proceed);
    }
    let crossing = crossing(&assembly.spine(program, &solution.point));
    (solution, crossing)
}

/// Bounds every element by the edges that its ribs reach past those of their own stretch.
fn take_further_edges(program: &mut BeltProgram, spine: &Spine) {
    let scale = 1.0 / spine.length();
    for (k, edges) in further_edges(spine) {
        if let Piece::Strip(element) = &mut program.pieces[k] {
            element.further = edges.map(|edge| edge.map(|edge| edge.scaled(scale)));
        }
    }
}
