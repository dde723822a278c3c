//! Nonlinear programmes on a chain of stages: minimisation, stability, response, continuation.
//!
//! A programme is a chain of nodes joined by stages. Every node carries a state and controls; the state is carried along the
//! chain by what the controls add to it. Equalities tie nodes, or pairs of nodes; inequalities bound the controls of a stage,
//! a node, or a pair of nodes. An implementation of [`Program`] gives all of these with their
//! derivatives. The time of an iteration is linear in the length of the chain, and at most quadratic in the number of
//! constraints between pairs.
//!
//! - [`minimise`] is a primal–dual interior-point method: A. Wächter and L. T. Biegler, "On the implementation of an
//!   interior-point filter line-search algorithm for large-scale nonlinear programming" (2006).
//! - [`Inertia`] and [`lowest_modes`] decide whether a stationary point is a minimum; [`Response`] is its sensitivity to
//!   perturbations of the programme.
//! - [`Follower`] follows a minimum while its programme changes, [`Continuation`] a curve of stationary points.
//!
//! Sizes are constants: `X` numbers of a state, `U` controls, `N = X + U` unknowns of a node.

mod interior_point;
mod layout;
mod linear;
mod linearisation;
mod path;
mod program;
mod scaled;

pub use interior_point::{
    Correction, Outcome, Residuals, Settings, Solution, assess, correct, minimise, minimise_near,
    minimise_past,
};
pub use layout::{Block, Layout};
pub use linear::chain::{ByControls, Chain, Diagonal, NodeMatrix, NodeVector, Stage};
pub use linear::{
    Direction, Inertia, Mode, PairMatrix, Response, Singular, StageMatrix, lowest_modes,
    lowest_modes_while, moved, redundant_equalities,
};
pub use linearisation::Linearisation;
pub use path::{
    Continuation, Curve, End, Event, Events, Family, FollowSettings, Followed, Follower,
    NextStride, Pace, Station, Turn, by_differences, over_modal_load, settle,
};
pub use program::{Distance, Multipliers, Program, Scales, Stationary, Values};

/// The larger of two numbers; NaN where either number is NaN, so that no NaN is lost.
fn larger(a: f64, b: f64) -> f64 {
    if a >= b || a.is_nan() { a } else { b }
}

/// Largest absolute value; NaN where a number is NaN.
fn largest<'a>(numbers: impl Iterator<Item = &'a f64>) -> f64 {
    numbers.fold(0.0, |most, x| larger(most, x.abs()))
}

/// Largest absolute entry; NaN where an entry is NaN.
fn largest_entry<const N: usize>(vectors: &[NodeVector<N>]) -> f64 {
    largest(vectors.iter().flatten())
}
