//! Equilibrium shapes of thin, inextensible belts by the fishbone model.
//!
//! A belt is described by its centre line (the *spine*) and the straight lines across it (the *ribs*); its
//! shape is the least bending energy under the poses of its supports. One direction of flow:
//! [`scenario`] → [`belt`] → [`program`] → [`solver`] → [`equilibrium`] → [`surface`].
//!
//! Equation numbers, as in `Eq. (34)`, are those of Wakamatsu, Arai and Hirai, "Fishbone Model for Belt Object
//! Deformation".

pub mod belt;
pub mod element;
pub mod energy;
pub mod equilibrium;
pub mod error;
mod guess;
pub mod lie;
pub mod program;
pub mod result;
pub mod ritz;
pub mod scenario;
pub mod solver;
pub mod spine;
pub mod surface;
