//! The second variation of the energy at an equilibrium: whether it is a minimum, and along which motions least so.

use crate::equilibrium::{Equilibrium, Status};
use crate::names::named;
use crate::sensitivity::Motion;
use crate::solver::{self, Singular};
use thiserror::Error;

/// What the second variation of the energy says of an equilibrium, on the shapes that its supports and the ribs that are
/// about to cross leave.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stability {
    /// Number of independent ways in which the energy falls.
    pub negative_modes: usize,
    /// Number of independent ways in which it stays, to second order.
    pub zero_modes: usize,
}

/// A motion of the belt from an equilibrium, one of the lowest of a set that the second variation does not couple; in the
/// units of the scenario.
///
/// Its scale is such that the mean over the board of the squared displacement is 1: that of a strip across the spine that
/// turns with the frame, V²/12 about the spine, all of the board weighing alike.
#[derive(Debug, Clone, PartialEq)]
pub struct Mode {
    /// Second variation of the energy: twice what it rises by, per squared displacement.
    pub eigenvalue: f64,
    /// Motion of every node.
    pub motion: Vec<Motion>,
    /// Change of the bend ω_ζ at every node.
    pub bend: Vec<f64>,
    /// Change of the rib slope β at every node.
    pub rib_slope: Vec<f64>,
}

/// Why an equilibrium has no modes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum NoModes {
    /// The method of the solve has no first-order conditions that it meets.
    #[error(
        "the source's method knows no multipliers, which modes take: use solver.method = \"intrinsic\""
    )]
    NoMultipliers,
    /// There is no equilibrium.
    #[error("the solve has not converged: what it ended with has no modes")]
    NotConverged,
    /// The factorisation broke down.
    #[error("the second variation could not be factorised")]
    Singular,
}

named!(impl NoModes {
    NoMultipliers = "no_multipliers",
    NotConverged = "not_converged",
    Singular = "singular",
});

impl Stability {
    /// Whether the equilibrium is a local minimum; `None` where a way of no second variation leaves that open.
    pub fn is_stable(&self) -> Option<bool> {
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

    /// The lowest modes, rising; fewer than `count` where the mesh has no more.
    ///
    /// # Errors
    ///
    /// [`NoModes`] unless the solve has converged.
    pub fn modes(&self, count: usize) -> Result<Vec<Mode>, NoModes> {
        let solved = self.solved.as_ref().ok_or(NoModes::NoMultipliers)?;
        if self.status != Status::Converged {
            return Err(NoModes::NotConverged);
        }
        let modes = solver::lowest_modes(&solved.program, &mut solved.at.clone(), count);
        let length = solved.units.length;
        let of_node = |node: usize, motion: &solver::chain::NodeVector| {
            let rotation = motion.fixed_rows::<3>(3).into_owned();
            let position = solved.at.point.poses[node].position;
            Motion {
                translation: motion.fixed_rows::<3>(0) + rotation.cross(&position),
                rotation: rotation / length,
            }
        };
        let mode = |mode: solver::Mode| {
            let nodes = mode.motion.iter();
            Mode {
                eigenvalue: mode.eigenvalue * solved.units.energy / length.powi(2),
                motion: nodes
                    .clone()
                    .enumerate()
                    .map(|(k, node)| of_node(k, node))
                    .collect(),
                bend: nodes.clone().map(|node| node[6] / length.powi(2)).collect(),
                rib_slope: nodes.map(|node| node[7] / length).collect(),
            }
        };
        let modes = modes.map_err(|Singular| NoModes::Singular)?;
        Ok(modes.into_iter().map(mode).collect())
    }
}
