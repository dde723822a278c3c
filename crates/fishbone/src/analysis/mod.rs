//! Analysis of equilibria: modes, derivatives, tracking, paths, margins, all equilibria of a problem.

pub mod branches;
pub mod continuation;
mod family;
pub mod margin;
pub mod modes;
pub mod path;
pub mod sensitivity;
mod symmetry;
pub mod tracking;
