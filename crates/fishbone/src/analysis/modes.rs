//! Modes: eigenvectors of the second variation of the energy at an equilibrium.

use crate::analysis::sensitivity::Motion;
use crate::equilibrium::{AnySolved, Equilibrium, Solved, Uncertified, left_free};
use crate::names::named;
use crate::strip::density::Density;
use stagewise::{NodeVector, Singular};
use std::ops::ControlFlow;
use thiserror::Error;

/// A motion of the belt from an equilibrium, one of the lowest of a set that the second variation does not couple; in the
/// units of the scenario.
///
/// Its scale is such that the mean over the board of the squared displacement is 1: a strip across the spine turns with the
/// frame, V²/12 about the spine, and the board has uniform weight.
#[derive(Debug, Clone, PartialEq)]
pub struct Mode {
    /// Second variation of the energy: twice its rise per squared displacement.
    pub eigenvalue: f64,
    /// Motion of every node.
    pub motion: Vec<Motion>,
    /// Change of the bend ω_ζ at every node.
    pub bend: Vec<f64>,
    /// Change of the rib slope β at every node.
    pub rib_slope: Vec<f64>,
}

/// The reason why an equilibrium has no modes.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum NoModes {
    /// There is no equilibrium.
    #[error(transparent)]
    Uncertified(#[from] Uncertified),
    /// The factorisation broke down.
    #[error("the second variation could not be factorised")]
    Singular,
}

named!(impl NoModes {
    Singular = "singular",
    ..Uncertified,
});

impl Equilibrium {
    /// The lowest modes, rising; fewer than `count` where the mesh has no more. Motions that change nothing, of the whole
    /// belt or of a uniform closed belt along itself, have the eigenvalue 0. The cost is that of 2 to 3 solves of a linear
    /// system for each mode.
    ///
    /// `proceed` is asked now and then whether to go on; after `Break` the modes are approximations.
    ///
    /// # Errors
    ///
    /// [`NoModes`] unless the solve has converged.
    pub fn modes(
        &self,
        count: usize,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Vec<Mode>, NoModes> {
        match self.certified_any()? {
            AnySolved::Developable(solved) => self.modes_of(solved, count, proceed),
            AnySolved::Shell(solved) => self.modes_of(solved, count, proceed),
        }
    }

    fn modes_of<D: Density<F>, const F: usize, const N: usize>(
        &self,
        solved: &Solved<D, F, N>,
        count: usize,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Vec<Mode>, NoModes> {
        let (program, mut at) = match left_free(&self.problem, &solved.program, &solved.at) {
            Some(free) => free,
            None => (solved.program.clone(), solved.at.clone()),
        };
        let modes = stagewise::lowest_modes_while(&program, &mut at, count, proceed);
        let units = self.problem.units();
        let length = units.length;
        let of_node = |node: usize, motion: &NodeVector<N>| {
            let rotation = motion.fixed_rows::<3>(3).into_owned();
            let position = solved.at.point.poses[node].position;
            Motion {
                translation: motion.fixed_rows::<3>(0) + rotation.cross(&position),
                rotation: rotation / length,
            }
        };
        let mode = |mode: stagewise::Mode<N>| {
            let nodes = mode.motion.iter();
            Mode {
                eigenvalue: mode.eigenvalue * units.energy / length.powi(2),
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
