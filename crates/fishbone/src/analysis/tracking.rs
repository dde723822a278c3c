//! Tracking: an equilibrium is followed at the rate of a robot while one of its supports moves.

mod led;

use crate::equilibrium::{AnySolved, Equilibrium, Status, Uncertified};
use crate::geometry::Wrench;
use crate::names::named;
use crate::scenario::error::ScenarioError;
use crate::strip::developable::DevelopableEnergy;
use crate::strip::shell::{FIELDS, Shell};
use led::Led;
use nalgebra::{Matrix3, Vector3};
use stagewise::Residuals;
use std::ops::ControlFlow;
use thiserror::Error;

/// The reason why an equilibrium cannot be followed.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum NoTracker {
    /// There is no equilibrium.
    #[error(transparent)]
    Uncertified(#[from] Uncertified),
    /// The support does not hold all of a pose.
    #[error(
        "supports[{0}] does not hold a position and a rotation, all of both: nothing can be moved there"
    )]
    NotClamped(usize),
    /// There is no such support.
    #[error("the scenario has no supports[{0}] that could move")]
    NoSupport(usize),
    /// The shape may change at no cost of energy.
    #[error("the equilibrium is no strict minimum of the energy: there is no one branch to follow")]
    Marginal,
}

named!(impl NoTracker {
    NotClamped = "not_clamped",
    NoSupport = "no_support",
    Marginal = "marginal",
    ..Uncertified,
});

/// The outcome of a motion of the support.
#[derive(Debug, Clone, PartialEq)]
pub struct Update {
    /// Whether the belt is in equilibrium under the new pose; unless converged, the tracker keeps its last pose.
    pub status: Status,
    /// One line for people: why the pose was not reached; empty where it was.
    pub message: String,
    /// Whether the belt could not be followed to the pose, so that its problem there was solved afresh.
    pub solved_afresh: bool,
    /// Whether the equilibrium that was followed ceased to exist or to be stable on the way, or could not be followed, and
    /// the belt has snapped to another equilibrium, by `solver.snap_size` or more.
    pub snapped: bool,
    /// Largest displacement of a node in the largest snap; 0 without a snap.
    pub jump: f64,
    /// Energy released in all snaps.
    pub released: f64,
    /// Total potential of the tracker's present shape.
    pub energy: f64,
    /// Iterations.
    pub iterations: usize,
    /// Residuals of the shape's discrete equations.
    pub residuals: Residuals,
}

/// An equilibrium and the support that moves.
#[derive(Clone)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct Tracker(AnyLed);

/// An equilibrium of either model of the strip.
#[derive(Clone)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
enum AnyLed {
    Developable(Box<Led<DevelopableEnergy, 2, 8>>),
    Shell(Box<Led<Shell, FIELDS, 12>>),
}

/// The value of an expression of the tracker's equilibrium, of whichever model.
macro_rules! of_led {
    ($tracker:expr, $led:ident => $value:expr) => {
        match $tracker {
            AnyLed::Developable($led) => $value,
            AnyLed::Shell($led) => $value,
        }
    };
}

impl Tracker {
    /// Starts at an equilibrium; the support is named by its place in the scenario.
    ///
    /// # Errors
    ///
    /// [`NoTracker`] unless it has converged to a strict minimum and the support holds position and rotation.
    pub fn new(equilibrium: &Equilibrium, support: usize) -> Result<Self, NoTracker> {
        let led = match equilibrium.certified_any()? {
            AnySolved::Developable(solved) => {
                AnyLed::Developable(Box::new(Led::new(equilibrium, solved, support)?))
            }
            AnySolved::Shell(solved) => {
                AnyLed::Shell(Box::new(Led::new(equilibrium, solved, support)?))
            }
        };
        Ok(Self(led))
    }

    /// The support that moves, by its place in the scenario.
    pub fn support(&self) -> usize {
        of_led!(&self.0, led => led.support())
    }

    /// Arc lengths of the supports, in the order of the scenario.
    pub fn supports(&self) -> Vec<f64> {
        of_led!(&self.0, led => led.supports())
    }

    /// Moves the support to a position and a rotation vector, world axes, and the belt with it.
    ///
    /// Nothing is allocated after the first update where the equilibrium is followed on its mesh and its ribs keep to the edges
    /// of the board that bound them. Unless the scenario fixes the mesh, its error is estimated where turning changes more
    /// within an element than before, and the belt goes on on another mesh where this one carries it no more; the mesh of a
    /// slender belt is graded anew at every update. `proceed` is asked during the motion whether to go on; `Break` leaves the tracker at its last pose.
    ///
    /// # Errors
    ///
    /// [`ScenarioError`] for a pose that no scenario may hold: a pose that is not finite, too many lengths of the belt away, or
    /// turned too far. The tracker stays at its last pose.
    pub fn update(
        &mut self,
        position: &Vector3<f64>,
        rotation: &Vector3<f64>,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Update, ScenarioError> {
        of_led!(&mut self.0, led => led.update(position, rotation, proceed))
    }

    /// Checks a pose as [`Self::update`] does, without moving.
    ///
    /// # Errors
    ///
    /// As [`Self::update`].
    pub fn check_pose(
        &self,
        position: &Vector3<f64>,
        rotation: &Vector3<f64>,
    ) -> Result<(), ScenarioError> {
        of_led!(&self.0, led => led.check_pose(position, rotation))
    }

    /// The present equilibrium, with all its data; not converged where elements turn too far for a belt.
    pub fn equilibrium(&mut self) -> Equilibrium {
        of_led!(&mut self.0, led => led.equilibrium())
    }

    /// Total potential.
    pub fn energy(&self) -> f64 {
        of_led!(&self.0, led => led.energy())
    }

    /// Positions of the nodes.
    pub fn positions(&self) -> impl Iterator<Item = Vector3<f64>> {
        let poses = of_led!(&self.0, led => led.poses()).iter();
        poses.map(|pose| of_led!(&self.0, led => led.position(pose)))
    }

    /// Positions at arc lengths of nodes that the mesh has had, on whatever mesh the tracker is now.
    pub fn positions_at(&mut self, nodes: &[f64]) -> Vec<Vector3<f64>> {
        if self.nodes() == nodes {
            return self.positions().collect();
        }
        let spine = self.equilibrium().spine;
        nodes.iter().map(|u| spine.at(*u).pose.position).collect()
    }

    /// Arc lengths of the nodes.
    pub fn nodes(&self) -> Vec<f64> {
        of_led!(&self.0, led => led.nodes())
    }

    /// Frames of the nodes.
    pub fn frames(&self) -> impl Iterator<Item = &Matrix3<f64>> {
        let poses = of_led!(&self.0, led => led.poses()).iter();
        poses.map(|pose| &pose.frame)
    }

    /// Bend at the nodes.
    pub fn bends(&self) -> impl Iterator<Item = f64> {
        let nodes = 0..of_led!(&self.0, led => led.poses()).len();
        nodes.map(|node| of_led!(&self.0, led => led.bend(node)))
    }

    /// Rib slope at the nodes.
    pub fn rib_slopes(&self) -> impl Iterator<Item = f64> {
        let nodes = 0..of_led!(&self.0, led => led.poses()).len();
        nodes.map(|node| of_led!(&self.0, led => led.rib_slope(node)))
    }

    /// The reaction of a support on the belt; a component is NaN where the shape does not determine it.
    ///
    /// # Panics
    ///
    /// If there is no such support.
    pub fn reaction(&self, support: usize) -> Wrench {
        of_led!(&self.0, led => led.reaction(support))
    }
}
