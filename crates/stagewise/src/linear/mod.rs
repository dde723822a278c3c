//! Linear algebra on the chain: recursion along the chain, a border for constraints between pairs of nodes, and inertia,
//! modes and responses by both.

mod border;
pub(crate) mod chain;
mod inertia;
mod kkt;
pub(crate) mod modes;
mod pair_matrix;
mod rank;
mod response;
mod small;
mod symmetries;

pub use inertia::Inertia;
pub(crate) use kkt::Kkt;
pub use modes::{Mode, lowest_modes, lowest_modes_while, moved};
pub use pair_matrix::{PairMatrix, StageMatrix};
pub use rank::redundant_equalities;
pub use response::{Direction, Response, Singular};

/// The objective has more directions of negative curvature than allowed, or a direction of zero curvature.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TooConcave;
