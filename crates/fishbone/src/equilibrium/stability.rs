//! Whether an equilibrium is a minimum, by the second variation of the energy.

use super::Equilibrium;

/// What the second variation of the energy says of an equilibrium, on the shapes that its supports and the ribs that are
/// about to cross leave.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stability {
    /// Number of independent ways in which the energy falls.
    pub negative_modes: usize,
    /// Number of independent ways in which it stays, to second order.
    pub zero_modes: usize,
}

impl Stability {
    /// Whether the equilibrium is a local minimum; `None` where a way of no second variation leaves that open.
    pub(crate) fn is_stable(&self) -> Option<bool> {
        match (self.negative_modes, self.zero_modes) {
            (0, 0) => Some(true),
            (0, _) => None,
            _ => Some(false),
        }
    }
}

impl Equilibrium {
    /// Whether it is a local minimum; `None` where that cannot be decided.
    pub fn stable(&self) -> Option<bool> {
        self.stability?.is_stable()
    }
}
