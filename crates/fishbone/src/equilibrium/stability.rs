//! Stability of an equilibrium by the second variation of the energy.

use super::Equilibrium;

/// The inertia of the second variation of the energy at an equilibrium, on the shapes that its supports and its active rib
/// bounds leave free.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stability {
    /// Number of independent directions in which the energy falls.
    pub negative_modes: usize,
    /// Number of independent directions in which the energy is constant to second order.
    pub zero_modes: usize,
}

impl Stability {
    /// Whether the equilibrium is a local minimum; `None` where a direction of zero second variation leaves the answer open.
    pub(crate) fn is_stable(&self) -> Option<bool> {
        match (self.negative_modes, self.zero_modes) {
            (0, 0) => Some(true),
            (0, _) => None,
            _ => Some(false),
        }
    }
}

impl Equilibrium {
    /// Whether the equilibrium is a local minimum; `None` where this is undecided.
    pub fn stable(&self) -> Option<bool> {
        self.stability?.is_stable()
    }
}
