//! The deformed surface: fundamental forms, curvatures, ribs, edges and meshes, Eq. (5)–(31).
//!
//! The rib through P(u) is the straight line `x(u) + v (ζ − β η)`; in the flat board it is the line `p(u) + v (n − β t)`,
//! where p is the flat spine with its tangent t and its normal n. Both are known once a [`Rib`] is. The flat board is laid
//! out in [`crate::board`].

mod curvature;
mod distribution;
mod extremes;
pub mod linking;
mod locate;
mod mesh;
mod patch;
mod rib;
mod self_crossing;
mod thick;

pub use curvature::*;
pub use distribution::*;
pub use extremes::*;
pub use mesh::*;
pub use rib::*;
pub use self_crossing::*;
pub use thick::{PointStrain, Strain, StrainExtremes, strain, strain_at};

#[cfg(test)]
mod tests;
