//! The strip between neighbouring ribs: its energy, its motion, and the spine that strips make up.

pub mod automatic;
pub mod bounds;
pub mod density;
pub mod developable;
pub mod element;
pub(crate) mod energy;
pub(crate) mod flat;
pub mod kernel;
pub mod ribs;
pub(crate) mod shell;
pub mod spine;
