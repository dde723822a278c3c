//! The board before it is bent: its material, its flat spine, its outline, and how ribs lie on it, Eq. (20)–(33).

pub mod curve;
pub(crate) mod feet;
pub mod flat;
pub mod material;
pub mod outline;
pub(crate) mod reach;
#[cfg(test)]
pub(crate) mod samples;
