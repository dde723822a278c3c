//! Inequalities of which a programme holds only those that its shape comes near.
//!
//! Which part of the board's outline stops a rib depends on the shape, as does which of two parts touches which. So a search
//! begins without these inequalities, and goes on with those that the shape found breaks or comes near, until the set is right
//! for the shape found with it.

use crate::problem::program::BeltProgram;
use crate::strip::spine::Spine;

/// Inequalities of one kind, of which a programme holds an active set.
pub(crate) trait ActiveSet {
    /// Whether the set may be another for another shape: if not, the programme holds all that there are.
    fn depends_on_shape(&self, program: &BeltProgram) -> bool;

    /// The fault of the programme's set for a shape, in words: an inequality that it lacks is broken, or one that it holds bounds
    /// the shape without being near. `None` where the set is right.
    fn fault(&self, program: &BeltProgram, shape: &Spine) -> Option<String>;

    /// Gives the programme the set for a shape.
    fn choose(&self, program: &mut BeltProgram, shape: &Spine);
}
