//! The deformed surface: fundamental forms, curvatures, ribs, edges and meshes, Eq. (5)–(31).
//!
//! The rib through P(u) is the straight line `x(u) + v (ζ − β η)`; in the flat board it is the line `p(u) + v (n − β t)`,
//! where p is the flat spine with its tangent t and its normal n. Both are known once a [`Rib`] is. The flat spine is
//! made of lines, arcs and corners, and so is the [`Outline`] of the board.

mod board;
mod curvature;
mod curve;
mod extremes;
mod flat;
mod locate;
mod mesh;
mod outline;
mod patch;
mod reach;
mod rib;
mod self_crossing;

pub use curvature::*;
pub use curve::*;
pub use extremes::*;
pub use flat::*;
pub use mesh::*;
pub use outline::*;
pub use reach::*;
pub use rib::*;
pub use self_crossing::*;

#[cfg(test)]
pub(crate) mod samples;
#[cfg(test)]
mod tests;
