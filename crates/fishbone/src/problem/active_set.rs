//! Active sets: the inequalities of a kind that a programme holds, those that its shape comes near.
//!
//! The part of the board's outline that stops a rib depends on the shape; so does the pair of parts in contact. So a search
//! begins without these inequalities, and goes on with the inequalities that the shape found breaks or comes near, until the
//! active set is right for the shape found with it.

use crate::board::feet::Board;
use crate::problem::program::BeltProgram;
use crate::strip::spine::Spine;

/// A shape with its flat board, by which active sets are chosen and judged. The board is that of all shapes of a programme.
#[derive(Debug, Clone)]
pub(crate) struct Shape {
    pub(crate) spine: Spine,
    pub(crate) board: Board,
}

/// Inequalities of one kind, of which a programme holds an active set.
pub(crate) trait ActiveSet {
    /// Whether the active set depends on the shape: if not, the programme holds all inequalities of the kind.
    fn depends_on_shape(&self, program: &BeltProgram) -> bool;

    /// The fault of the programme's active set for a shape, in words: an inequality outside the set is broken, or an
    /// inequality of the set bounds the shape from afar. `None` where the set is right.
    fn fault(&self, program: &BeltProgram, shape: &Shape) -> Option<String>;

    /// Gives the programme the active set for a shape.
    fn choose(&self, program: &mut BeltProgram, shape: &Shape);
}
