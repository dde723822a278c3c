//! Equilibrium shapes of thin, inextensible belts by the fishbone model.
//!
//! A belt is described by its centre line (the *spine*) and the straight lines across it (the *ribs*); its
//! shape is the least bending energy under the poses of its supports. One direction of flow:
//! [`scenario`] → [`belt`] → [`program`] → [`solver`] → [`equilibrium`] → [`surface`].
//!
//! Equation numbers, as in `Eq. (34)`, are those of Wakamatsu, Arai and Hirai, "Fishbone Model for Belt Object
//! Deformation".
//!
//! ```
//! use fishbone::{equilibrium::solve, scenario::Scenario};
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
//! let equilibrium = solve(&scenario, &mut || ControlFlow::Continue(()));
//! assert!((equilibrium.energy - 17.6586).abs() < 1e-4);
//! assert!((equilibrium.highest_point().position.x - 0.3487).abs() < 1e-4);
//! # Ok::<(), fishbone::error::ScenarioError>(())
//! ```

pub mod belt;
pub mod branches;
pub mod element;
pub mod energy;
pub mod equilibrium;
pub mod error;
pub mod follow;
mod guess;
pub mod lie;
pub mod linking;
pub mod margin;
pub mod material;
pub mod names;
pub mod path;
pub mod program;
pub mod result;
pub mod ritz;
pub mod scenario;
pub mod sensitivity;
pub mod solver;
pub mod spine;
pub mod stability;
pub mod strip;
pub mod surface;
pub mod tracker;
mod twins;
