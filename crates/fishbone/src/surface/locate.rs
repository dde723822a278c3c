//! The rib or the plane of the surface to which a flat point belongs.

use super::patch::Polygon;
use crate::board::feet::{Board, FlatRib, Foot};
use crate::strip::spine::Spine;
use nalgebra::Vector2;

/// A flat point with the rib or the plane that it lies on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    pub(super) foot: Foot,
    /// The point, in the round of a closed belt to which the foot belongs.
    pub(super) point: Vector2<f64>,
}

/// The place of a flat point; `None` off the board.
pub(super) fn locate(spine: &Spine, point: &Vector2<f64>) -> Option<Place> {
    let board = Board::of(spine);
    let rounds = match &board.round {
        None => vec![*point],
        Some(round) => vec![*point, round.next(point), round.previous(point)],
    };
    rounds.into_iter().find_map(|point| {
        let foot = foot_of(spine, &board, &point)?;
        Some(Place { foot, point })
    })
}

fn foot_of(spine: &Spine, board: &Board, point: &Vector2<f64>) -> Option<Foot> {
    (0..spine.elements())
        .filter(|&element| !board.is_in_plate(element))
        .find_map(|element| on_element(spine, board, element, point))
        .or_else(|| on_plate(spine, board, point))
        .or_else(|| beyond_end(spine, board, point))
}

fn on_element(spine: &Spine, board: &Board, element: usize, point: &Vector2<f64>) -> Option<Foot> {
    let distance = board.distance_to(spine, element, point)?;
    let foot = board.foot_within(spine, element, distance);
    board.is_on_rib(&foot.rib, point).then_some(foot)
}

fn on_plate(spine: &Spine, board: &Board, point: &Vector2<f64>) -> Option<Foot> {
    let holds = |plate: &&[usize; 2]| {
        Polygon::of_plate(spine, board, plate).holds(point, board.tolerance())
    };
    let &[from, _] = board.plates.iter().find(holds)?;
    Some(board.foot_at_node(spine, from))
}

/// The first or the last rib, if the point is in the corner that this rib leaves out.
fn beyond_end(spine: &Spine, board: &Board, point: &Vector2<f64>) -> Option<Foot> {
    [0, spine.u.len() - 1].into_iter().find_map(|node| {
        let foot = board.foot_at_node(spine, node);
        let inside = |&side: &usize| is_beyond(board, &foot.rib, node == 0, side, point);
        (0..2)
            .any(|side| board.chains.is_open && inside(&side))
            .then_some(foot)
    })
}

fn is_beyond(
    board: &Board,
    rib: &FlatRib,
    at_start: bool,
    side: usize,
    point: &Vector2<f64>,
) -> bool {
    let margin = board.tolerance();
    let sign = if at_start { 1.0 } else { -1.0 };
    let local = rib.foot.local(point);
    let on_side = local.y * (side as f64 - 0.5) >= -margin;
    let before_line = sign * local.x >= -margin;
    let behind_rib = sign * rib.excess(point) >= -margin;
    let depth = || board.depth(rib, side, point);
    on_side && before_line && behind_rib && depth().is_some_and(|depth| depth >= -margin)
}
