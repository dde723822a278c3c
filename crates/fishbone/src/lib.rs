//! Equilibrium shapes of thin belts by the fishbone model.
//!
//! A belt is described by its centre line (the *spine*) and the straight lines across it (the *ribs*); its shape is the
//! least bending energy under the poses of its supports. A [`scenario`] becomes a [`problem`], and a problem an
//! [`equilibrium`], from which every [`analysis`] starts; the crate `stagewise` minimises.
//!
//! | room | contents |
//! |---|---|
//! | [`names`] | names of variants in files and other languages |
//! | [`geometry`] | rotations, poses, twists |
//! | [`strip`] | energy and motion of the strip between neighbouring ribs, Eq. (34) |
//! | [`board`] | material, flat spine, outline, feet and reach of ribs |
//! | [`surface`] | curvatures, ribs, meshes of the deformed surface, Eq. (5)–(31) |
//! | [`scenario`] | the input: its schema, its checks |
//! | [`problem`] | a validated scenario with belt, units, mesh and programme |
//! | [`equilibrium`] | the search for a minimum, and its result |
//! | [`ritz`] | the source's own method, Eq. (37)–(43), as history |
//! | [`solve`] | the solution of a problem by its scenario's method |
//! | [`analysis`] | modes, derivatives, tracking, continuation, margins, all equilibria |
//! | [`io`] | scenarios as TOML and JSON, results as JSON |
//!
//! Every room uses only those above it in this table; a test keeps it so. The last is there with the feature `io`, which is
//! on by default: without it, a scenario is made of its Rust types.
//!
//! Equation numbers, as in `Eq. (34)`, are those of Wakamatsu, Arai and Hirai, "Fishbone Model for Belt Object
//! Deformation".
//!
#![cfg_attr(feature = "io", doc = "```")]
#![cfg_attr(not(feature = "io"), doc = "```ignore")]
//! use fishbone::prelude::*;
//! use std::ops::ControlFlow;
//!
//! // A belt whose ends face each other at 0.6 of its length: the planar elastica.
//! let scenario = Scenario::from_toml(
//!     r#"
//!     belt = { width = 0.1, rigidity = 1.0, segments = [{ kind = "straight", length = 1.0 }] }
//!     supports = [
//!       { at = "start", position = [0, 0, 0], rotation = [0, 0, 0] },
//!       { at = "end", position = [0, 0.6, 0], rotation = [0, 0, 0] },
//!     ]
//!     "#,
//! )?;
//! let problem = Problem::new(scenario)?;
//! let equilibrium = solve(&problem, &mut || ControlFlow::Continue(()));
//! assert!((equilibrium.energy - 17.6586).abs() < 1e-4);
//! assert!((equilibrium.highest_point().position.x - 0.3487).abs() < 1e-4);
//! # Ok::<(), ScenarioError>(())
//! ```

pub mod analysis;
pub mod board;
pub mod equilibrium;
pub mod geometry;
#[cfg(feature = "io")]
pub mod io;
pub mod names;
pub mod problem;
pub mod ritz;
pub mod scenario;
#[cfg(feature = "io")]
pub(crate) mod serial;
pub mod solve;
pub mod strip;
pub mod surface;

/// The names that most uses need.
pub mod prelude {
    pub use crate::analysis::branches::{Watch, branches};
    pub use crate::analysis::continuation::{Diagram, Settings, follow};
    pub use crate::analysis::margin::Margin;
    pub use crate::analysis::modes::Mode;
    pub use crate::analysis::path::{Motion, Path};
    pub use crate::analysis::sensitivity::{Parameters, Sensitivity};
    pub use crate::analysis::tracking::{Tracker, Update};
    pub use crate::equilibrium::{Equilibrium, Stability, Status};
    pub use crate::geometry::{Pose, Wrench};
    pub use crate::problem::Problem;
    pub use crate::scenario::Scenario;
    pub use crate::scenario::error::ScenarioError;
    pub use crate::solve::{solve, solve_from};
    pub use crate::strip::density::Density;
}
