//! Tracking: an equilibrium is followed at the rate of a robot while some of its supports move.

mod budget;
mod led;

use super::modes::NoModes;
use super::sensitivity::NoSensitivity;
use crate::equilibrium::{AnySolved, Equilibrium, Status, Uncertified};
use crate::geometry::Wrench;
use crate::names::named;
use crate::scenario::error::ScenarioError;
use crate::strip::developable::DevelopableEnergy;
use crate::strip::shell::{FIELDS, Shell};
pub use budget::Budget;
use led::Led;
use nalgebra::{Matrix3, Matrix3x6, Matrix6, Vector3, Vector6};
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
    /// The support does not hold all of a position.
    #[error("supports[{0}] does not hold a position, all of it: it cannot be moved")]
    NotHeld(usize),
    /// There is no such support.
    #[error("the scenario has no supports[{0}] that could move")]
    NoSupport(usize),
    /// The energy is no minimum.
    #[error("the equilibrium is no minimum of the energy: there is nothing to follow")]
    NoMinimum,
}

named!(impl NoTracker {
    NotHeld = "not_held",
    NoSupport = "no_support",
    NoMinimum = "no_minimum",
    ..Uncertified,
});

/// Where a support goes. What is `None` stays as it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Goal {
    /// The support, by its place in the scenario.
    pub support: usize,
    /// Position, world axes. Units: those of the scenario.
    pub position: Option<Vector3<f64>>,
    /// Rotation vector, world axes; of supports that hold a frame alone. Units: rad.
    pub rotation: Option<Vector3<f64>>,
}

/// The outcome of a motion of the supports.
#[derive(Debug, Clone, PartialEq)]
pub struct Update {
    /// Whether the belt is in equilibrium at the goals.
    pub status: Status,
    /// One line for people: why the goals were not reached; empty where they were.
    pub message: String,
    /// Share of the way to the goals that was reached: unless converged, the tracker stays at the last equilibrium on the way.
    pub fraction: f64,
    /// Whether the belt could not be followed to the goals, so that its problem there was solved afresh.
    pub solved_afresh: bool,
    /// Whether the belt has no slack, so that its shape does not determine all reactions: these are NaN.
    pub taut: bool,
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

/// Derivatives of a tracker's shape by the motion of a support: [translation, rotation left in world axes about its point].
#[derive(Debug, Clone, PartialEq)]
pub struct Derivatives {
    /// Of the spine's position at every node.
    pub position: Vec<Matrix3x6<f64>>,
    /// Of the frame's rotation at every node, left, in world axes.
    pub rotation: Vec<Matrix3x6<f64>>,
    /// Of the support's own reaction: [force, moment], about a point that moves along.
    pub reaction: Matrix6<f64>,
}

impl Derivatives {
    /// Derivatives of material points, one a node, at lines off the spine along its ribs: they move with the frame of their rib,
    /// as the surface along a rib of a developable belt has one tangent plane.
    pub fn at(&self, lines: &[Vector3<f64>]) -> Vec<Matrix3x6<f64>> {
        let nodes = self.position.iter().zip(&self.rotation).zip(lines);
        nodes
            .map(|((position, rotation), line)| position - line.cross_matrix() * rotation)
            .collect()
    }
}

/// The lowest eigenvalue of the second variation of the energy, and how it changes with the motion of a support. The shape is
/// stable where it is positive; where it comes to zero the belt snaps, or other shapes branch off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LowestEigenvalue {
    /// The eigenvalue of the lowest [`Mode`](super::modes::Mode).
    pub value: f64,
    /// Its derivatives by the motion of the support: [translation, rotation left in world axes about its point]. NaN where the
    /// shape can be followed neither way, of one side where it can be followed that way alone.
    pub gradient: Vector6<f64>,
}

/// An equilibrium and the supports that move.
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
    /// Starts at an equilibrium; the supports that are to move are named by their places in the scenario.
    ///
    /// # Errors
    ///
    /// [`NoTracker`] unless it has converged to a minimum and each of the supports holds a position.
    pub fn new(equilibrium: &Equilibrium, moving: &[usize]) -> Result<Self, NoTracker> {
        let led = match equilibrium.certified_any()? {
            AnySolved::Developable(solved) => {
                AnyLed::Developable(Box::new(Led::new(equilibrium, solved, moving)?))
            }
            AnySolved::Shell(solved) => {
                AnyLed::Shell(Box::new(Led::new(equilibrium, solved, moving)?))
            }
        };
        Ok(Self(led))
    }

    /// The supports that move, by their places in the scenario.
    pub fn moving(&self) -> &[usize] {
        of_led!(&self.0, led => led.moving())
    }

    /// Arc lengths of the supports, in the order of the scenario.
    pub fn supports(&self) -> Vec<f64> {
        of_led!(&self.0, led => led.supports())
    }

    /// Moves supports to their goals, together and each straight to its own, and the belt with them.
    ///
    /// Nothing is allocated after the first update where the equilibrium is followed on its mesh and its ribs keep to the edges
    /// of the board that bound them. Unless the scenario fixes the mesh, its error is estimated where turning changes more
    /// within an element than before, and the belt goes on on another mesh where this one carries it no more; the mesh of a
    /// slender belt is graded anew at every update. `proceed`, such as that of a [`Budget`], is asked once an iteration whether
    /// to go on; `Break` leaves the tracker at the last equilibrium on the way.
    ///
    /// # Errors
    ///
    /// [`ScenarioError`] for a support that does not move, and for a pose that no scenario may hold: a pose that is not finite,
    /// too many lengths of the belt away, or turned too far. The tracker stays where it was.
    pub fn update(
        &mut self,
        goals: &[Goal],
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Update, ScenarioError> {
        of_led!(&mut self.0, led => led.update(goals, proceed))
    }

    /// Takes hold of the belt at an arc length, by a support that moves from then on, and lets another support go, named by its
    /// place in the scenario before. What supports still hold between them keeps its shape; the rest comes to rest from the
    /// shape that it has. The update's jump is the largest displacement of what is still held. Where no equilibrium is found the
    /// tracker stays as it was.
    ///
    /// Units: those of the scenario.
    ///
    /// # Errors
    ///
    /// [`ScenarioError`] for supports that no scenario may have: two at one place, one off the belt, none to let go.
    pub fn regrasp(
        &mut self,
        hold: Option<f64>,
        release: Option<usize>,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Update, ScenarioError> {
        of_led!(&mut self.0, led => led.regrasp(hold, release, proceed))
    }

    /// Derivatives by the motion of any support, by the factorisation that the tracker keeps: no Newton step is taken.
    ///
    /// Units: those of the scenario.
    ///
    /// # Errors
    ///
    /// [`NoSensitivity`] where the belt has no slack, or where a part of it has stayed flat under load.
    ///
    /// # Panics
    ///
    /// If there is no such support.
    pub fn derivatives(&mut self, support: usize) -> Result<Derivatives, NoSensitivity> {
        of_led!(&mut self.0, led => led.derivatives(support))
    }

    /// The lowest eigenvalue of the second variation, and its gradient by the motion of a support that moves: by central
    /// differences, each of which follows the shape by 1e-5 of the belt's length or of a radian.
    ///
    /// Units: those of the scenario; rad.
    ///
    /// # Errors
    ///
    /// [`NoModes`] where the second variation cannot be factorised.
    pub fn lowest_eigenvalue(
        &self,
        support: usize,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<LowestEigenvalue, NoModes> {
        of_led!(&self.0, led => led.lowest_eigenvalue(support, proceed))
    }

    /// Lines across the belt at the nodes, ζ − β η: the rib's point at v across is v times this line off the spine. `None` of a
    /// strip of finite thickness, which is not straight along its ribs.
    pub fn ribs(&self) -> Option<Vec<Vector3<f64>>> {
        match &self.0 {
            AnyLed::Developable(led) => {
                let nodes = 0..led.poses().len();
                Some(nodes.map(|node| led.rib(node)).collect())
            }
            AnyLed::Shell(_) => None,
        }
    }

    /// Checks goals as [`Self::update`] does, without moving.
    ///
    /// # Errors
    ///
    /// As [`Self::update`].
    pub fn check(&self, goals: &[Goal]) -> Result<(), ScenarioError> {
        of_led!(&self.0, led => led.check(goals))
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
    pub fn positions(&self) -> impl ExactSizeIterator<Item = Vector3<f64>> {
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
    pub fn frames(&self) -> impl ExactSizeIterator<Item = &Matrix3<f64>> {
        let poses = of_led!(&self.0, led => led.poses()).iter();
        poses.map(|pose| &pose.frame)
    }

    /// Bend at the nodes.
    pub fn bends(&self) -> impl ExactSizeIterator<Item = f64> {
        let nodes = 0..of_led!(&self.0, led => led.poses()).len();
        nodes.map(|node| of_led!(&self.0, led => led.bend(node)))
    }

    /// Rib slope at the nodes.
    pub fn rib_slopes(&self) -> impl ExactSizeIterator<Item = f64> {
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
