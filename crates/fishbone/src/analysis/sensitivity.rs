//! Exact derivatives of an equilibrium by the data of its problem, from its factorised first-order conditions.
//!
//! A solution meets F(x; p) = 0, with x the unknowns and multipliers and p the poses of the supports, the rigidity and so
//! on. So ∂F/∂x dx = −∂F/∂p dp, where ∂F/∂x is symmetric and was factorised in the last step of the solver. One
//! back-substitution carries a change of p to the change of x, and one carries a derivative by x back to p.

mod data;
mod linearised;
mod motion;
mod scales;
mod system;

use crate::equilibrium::{AnySolved, Equilibrium, Uncertified};
use crate::geometry::Wrench;
use crate::names::named;
use crate::strip::developable::DevelopableEnergy;
use crate::strip::shell::{FIELDS, Shell};
use linearised::Linearised;
pub(super) use motion::{add_support_motion, motion as node_motion};
use nalgebra::{Matrix3x6, Vector3};
use scales::Scales;
use thiserror::Error;

/// A small motion in world axes, its rotation left and about the point that moves; or a derivative by one.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Motion {
    /// Displacement.
    pub translation: Vector3<f64>,
    /// Rotation vector.
    pub rotation: Vector3<f64>,
}

/// A change of the data of an equilibrium's problem, in the units of its scenario; or a derivative by such a change.
///
/// All other data are held fixed: mass and rigidity do not change with width, thickness and Poisson's ratio, and the mesh never
/// changes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Parameters {
    /// Motion of every support, in the order of the scenario.
    pub supports: Vec<Motion>,
    /// Rigidity R_f at every node, linear in between.
    pub rigidity: Vec<f64>,
    /// Natural bend of every segment of the belt.
    pub natural_bend: Vec<f64>,
    /// Width V.
    pub width: f64,
    /// Thickness h of the sheet; of layers, that of the sheet of as much stretching stiffness over rigidity.
    pub thickness: f64,
    /// Poisson's ratio ν.
    pub poisson: f64,
    /// Gravity.
    pub gravity: Vector3<f64>,
}

/// A change of an equilibrium, in the units of its scenario; or a derivative by such a change.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Change {
    /// Displacement of the spine at every node.
    pub position: Vec<Vector3<f64>>,
    /// Rotation of the frame at every node, left, in world axes.
    pub rotation: Vec<Vector3<f64>>,
    /// Bend ω_ζ at every node.
    pub bend: Vec<f64>,
    /// Rib slope β at every node.
    pub rib_slope: Vec<f64>,
    /// Reactions of the supports, in the order of the scenario.
    pub reactions: Vec<Wrench>,
    /// Total potential.
    pub energy: f64,
}

/// The reason why an equilibrium has no derivatives.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum NoSensitivity {
    /// There is no equilibrium.
    #[error(transparent)]
    Uncertified(#[from] Uncertified),
    /// The shape does not follow from the supports.
    #[error(
        "the belt can move at no cost of energy, so that its supports do not determine the shape, which has no derivatives"
    )]
    Marginal,
    /// The belt is flat under load: the smallest change of load may twist it either way.
    #[error(
        "a part of the loaded belt has stayed flat: how it begins to twist is not smooth, and has no derivatives"
    )]
    Flat,
    /// The shape is no minimum.
    #[error("the equilibrium is no minimum of the energy: derivatives are of minima only")]
    Saddle,
    /// Some constraints follow from others.
    #[error("{0} hold the same twice over: they cannot move each by itself")]
    Redundant(String),
    /// The belt is at its inextensible limit, so that the supports cannot move so.
    #[error("the belt between its supports has no slack: they cannot move each by itself")]
    NoSlack,
}

named!(impl NoSensitivity {
    Marginal = "marginal",
    Flat = "flat",
    Saddle = "saddle",
    Redundant = "redundant",
    NoSlack = "no_slack",
    ..Uncertified,
});

/// The factorised first-order conditions of an equilibrium.
#[derive(Debug)]
pub struct Sensitivity(AnyLinearised);

/// Those of either model of the strip.
#[derive(Debug)]
enum AnyLinearised {
    Developable(Box<Linearised<DevelopableEnergy, 2, 8>>),
    Shell(Box<Linearised<Shell, FIELDS, 12>>),
}

/// The value of an expression of the linearised conditions, of whichever model.
macro_rules! of_linearised {
    ($any:expr, $linearised:ident => $value:expr) => {
        match $any {
            AnyLinearised::Developable($linearised) => $value,
            AnyLinearised::Shell($linearised) => $value,
        }
    };
}

impl Equilibrium {
    /// Factorises the first-order conditions.
    ///
    /// # Errors
    ///
    /// [`NoSensitivity`] unless it is a strict minimum that its supports determine.
    pub fn sensitivity(&self) -> Result<Sensitivity, NoSensitivity> {
        let linearised = match self.certified_any()? {
            AnySolved::Developable(solved) => {
                AnyLinearised::Developable(Box::new(Linearised::of(self, solved)?))
            }
            AnySolved::Shell(solved) => {
                AnyLinearised::Shell(Box::new(Linearised::of(self, solved)?))
            }
        };
        Ok(Sensitivity(linearised))
    }
}

impl Sensitivity {
    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        of_linearised!(&self.0, linearised => linearised.nodes)
    }

    /// Number of supports.
    pub fn supports(&self) -> usize {
        self.scales().supports()
    }

    /// Number of segments of the belt.
    pub fn segments(&self) -> usize {
        self.scales().segments()
    }

    fn scales(&self) -> &Scales {
        of_linearised!(&self.0, linearised => &linearised.scales)
    }

    /// No change of any parameter.
    pub(crate) fn no_parameters(&self) -> Parameters {
        Parameters {
            supports: vec![Motion::default(); self.supports()],
            rigidity: vec![0.0; self.nodes()],
            natural_bend: vec![0.0; self.segments()],
            ..Parameters::default()
        }
    }

    /// The change of the equilibrium by a change of the parameters.
    ///
    /// # Errors
    ///
    /// [`NoSensitivity::NoSlack`] where the supports cannot make this motion.
    pub fn forward(&mut self, parameters: &Parameters) -> Result<Change, NoSensitivity> {
        of_linearised!(&mut self.0, linearised => linearised.forward(parameters))
    }

    /// Derivative by the parameters of a function that has given derivatives by the equilibrium: the transpose of
    /// [`Self::forward`].
    ///
    /// # Errors
    ///
    /// [`NoSensitivity::NoSlack`] where the supports cannot move each by itself.
    pub fn adjoint(&mut self, by: &Change) -> Result<Parameters, NoSensitivity> {
        of_linearised!(&mut self.0, linearised => linearised.adjoint(by))
    }

    /// Derivative of the spine's positions by the motion of a support, at every node by [translation, rotation].
    ///
    /// # Errors
    ///
    /// [`NoSensitivity::NoSlack`] where the support cannot move by itself.
    ///
    /// # Panics
    ///
    /// If there is no such support.
    pub fn jacobian(&mut self, support: usize) -> Result<Vec<Matrix3x6<f64>>, NoSensitivity> {
        let mut jacobian = vec![Matrix3x6::zeros(); self.nodes()];
        for column in 0..6 {
            let mut parameters = self.no_parameters();
            let motion = &mut parameters.supports[support];
            match column {
                0..3 => motion.translation[column] = 1.0,
                _ => motion.rotation[column - 3] = 1.0,
            }
            let change = self.forward(&parameters)?;
            for (by, position) in jacobian.iter_mut().zip(&change.position) {
                by.set_column(column, position);
            }
        }
        Ok(jacobian)
    }
}

impl Motion {
    fn add(&mut self, factor: f64, other: &Self) {
        self.translation += factor * other.translation;
        self.rotation += factor * other.rotation;
    }

    fn dot(&self, other: &Self) -> f64 {
        self.translation.dot(&other.translation) + self.rotation.dot(&other.rotation)
    }
}
