//! Exact derivatives of an equilibrium by the data of its problem, from its factorised first-order conditions.
//!
//! A solution meets F(x; p) = 0, with x the unknowns and multipliers and p the poses of the supports, the rigidity and so
//! on. So ∂F/∂x dx = −∂F/∂p dp, where ∂F/∂x is symmetric and was factorised in the last step of the solver. One
//! back-substitution carries a change of p to the change of x, and one carries a derivative by x back to p.

mod data;
mod motion;
mod scales;
mod system;

use crate::equilibrium::{Equilibrium, Uncertified};
use crate::geometry::Wrench;
use crate::names::named;
pub(super) use motion::add_support_motion;
use nalgebra::{Matrix3x6, Vector3};
use scales::Scales;
use stagewise::{Response, Singular};
use system::{Direction, System};
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
/// All other data are held fixed: mass and rigidity do not change with the width, and the mesh never changes.
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

/// A vector of the first-order conditions.
type Step = stagewise::Direction<8>;

/// The factorised first-order conditions of an equilibrium.
#[derive(Debug)]
pub struct Sensitivity {
    response: Response<6, 2, 8>,
    system: System,
    scales: Scales,
    nodes: usize,
}

impl Equilibrium {
    /// Factorises the first-order conditions.
    ///
    /// # Errors
    ///
    /// [`NoSensitivity`] unless it is a strict minimum that its supports determine.
    pub fn sensitivity(&self) -> Result<Sensitivity, NoSensitivity> {
        let solved = self.certified()?;
        if let Some(names) = &solved.redundant {
            return Err(NoSensitivity::Redundant(names.clone()));
        }
        if solved.inertia.is_some_and(|inertia| inertia.negative > 0) {
            return Err(NoSensitivity::Saddle);
        }
        if self.problem.has_no_slack() {
            return Err(NoSensitivity::NoSlack);
        }
        if solved.is_flat {
            return Err(NoSensitivity::Flat);
        }
        let response = Response::of_minimum(&solved.program, &mut solved.at.clone());
        let mut sensitivity = Sensitivity {
            response: response.map_err(|Singular| NoSensitivity::Marginal)?,
            system: System::new(solved),
            scales: Scales::new(&self.problem, &solved.program),
            nodes: solved.at.point.poses.len(),
        };
        let is_strict = solved
            .inertia
            .is_some_and(|inertia| inertia.zero + inertia.symmetries == 0);
        match is_strict || sensitivity.is_held() {
            true => Ok(sensitivity),
            false => Err(NoSensitivity::Marginal),
        }
    }
}

impl Sensitivity {
    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Number of supports.
    pub fn supports(&self) -> usize {
        self.scales.supports()
    }

    /// Number of segments of the belt.
    pub fn segments(&self) -> usize {
        self.scales.segments()
    }

    /// No change of any parameter.
    pub(crate) fn no_parameters(&self) -> Parameters {
        Parameters {
            supports: vec![Motion::default(); self.supports()],
            rigidity: vec![0.0; self.nodes],
            natural_bend: vec![0.0; self.segments()],
            ..Parameters::default()
        }
    }

    /// No change of the equilibrium.
    pub(crate) fn no_change(&self) -> Change {
        let nothing = Vector3::zeros();
        let no_wrench = Wrench {
            force: nothing,
            moment: nothing,
        };
        Change {
            position: vec![nothing; self.nodes],
            rotation: vec![nothing; self.nodes],
            bend: vec![0.0; self.nodes],
            rib_slope: vec![0.0; self.nodes],
            reactions: vec![no_wrench; self.supports()],
            energy: 0.0,
        }
    }

    /// The change of the equilibrium by a change of the parameters.
    ///
    /// # Errors
    ///
    /// [`NoSensitivity::NoSlack`] where the supports cannot make this motion.
    pub fn forward(&mut self, parameters: &Parameters) -> Result<Change, NoSensitivity> {
        let direction = self.scales.to_program(parameters, &self.system);
        let mut right = self.response.zero();
        self.system.add_change(&direction, &mut right);
        let solution = self.solve(&right)?;
        let units = self.scales.units;
        let mut change = self.no_change();
        for k in 0..self.nodes {
            let motion = self.system.motion(k, &solution.nodes);
            change.position[k] = motion.translation * units.length;
            change.rotation[k] = motion.rotation;
            change.bend[k] = solution.nodes[k][6] / units.length;
            change.rib_slope[k] = solution.nodes[k][7];
        }
        let responses = self.system.response(&solution).supports;
        for (i, reaction) in change.reactions.iter_mut().enumerate() {
            let own = self.system.own_moment(i, &direction.supports[i].rotation);
            *reaction = Wrench {
                force: responses[i].translation * units.force(),
                moment: (responses[i].rotation + own) * units.energy,
            };
        }
        change.energy = self.system.by_change().dot(&direction) * units.energy
            + self.scales.origin_by_gravity.dot(&parameters.gravity);
        Ok(change)
    }

    /// Derivative by the parameters of a function that has given derivatives by the equilibrium: the transpose of
    /// [`Self::forward`].
    ///
    /// # Errors
    ///
    /// [`NoSensitivity::NoSlack`] where the supports cannot move each by itself.
    pub fn adjoint(&mut self, by: &Change) -> Result<Parameters, NoSensitivity> {
        let units = self.scales.units;
        let mut direction = self.system.unchanged();
        for (motion, by_reaction) in direction.supports.iter_mut().zip(&by.reactions) {
            *motion = Motion {
                translation: by_reaction.force * units.force(),
                rotation: by_reaction.moment * units.energy,
            };
        }
        let mut right = self.response.zero();
        self.system.add_change(&direction, &mut right);
        for k in 0..self.nodes {
            let force = by.position[k] * units.length;
            self.system
                .add_generalised_force(k, &force, &by.rotation[k], &mut right.nodes);
            right.nodes[k][6] += by.bend[k] / units.length;
            right.nodes[k][7] += by.rib_slope[k];
        }
        let solution = self.solve(&right)?;
        let mut gradient = self.system.response(&solution);
        for (i, by_reaction) in direction.supports.iter().enumerate() {
            gradient.supports[i].rotation += self.system.by_own_moment(i, &by_reaction.rotation);
        }
        gradient.add(by.energy * units.energy, &self.system.by_change());
        let mut parameters = self.scales.to_scenario(&gradient, self.nodes);
        parameters.gravity += by.energy * self.scales.origin_by_gravity;
        Ok(parameters)
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
        let mut jacobian = vec![Matrix3x6::zeros(); self.nodes];
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

    /// Whether no node moves far under unit loads, so that no compliance is infinite. Where the belt does not bend, the
    /// slope of its ribs costs nothing, but moves no node either.
    fn is_held(&mut self) -> bool {
        /// Displacement under unit loads from which the belt counts as free to move, in U.
        const FAR: f64 = 1e6;
        let mut right = self.response.zero();
        for k in 0..self.nodes {
            let in_general =
                |seed: f64| Vector3::new(1.0, 2.0, 3.0).map(|i| (i * k as f64 + seed).sin());
            let [force, moment] = [1.0, 2.0].map(|seed| in_general(seed) / self.nodes as f64);
            self.system
                .add_generalised_force(k, &force, &moment, &mut right.nodes);
        }
        self.response.solve(&right).is_ok_and(|solution| {
            let motions = (0..self.nodes).map(|k| self.system.motion(k, &solution.nodes));
            motions.fold(0.0, |most, motion| {
                f64::max(most, motion.translation.amax())
            }) < FAR
        })
    }

    fn solve(&mut self, right: &Step) -> Result<Step, NoSensitivity> {
        self.response
            .solve(right)
            .map_err(|Singular| NoSensitivity::NoSlack)
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

impl Direction {
    fn add(&mut self, factor: f64, other: &Self) {
        for (own, other) in self.supports.iter_mut().zip(&other.supports) {
            own.add(factor, other);
        }
        for (own, other) in self.elements.iter_mut().zip(&other.elements) {
            *own += factor * other;
        }
        self.weight += factor * other.weight;
    }

    fn dot(&self, other: &Self) -> f64 {
        let supports = self.supports.iter().zip(&other.supports);
        let elements = self.elements.iter().zip(&other.elements);
        supports.map(|(a, b)| a.dot(b)).sum::<f64>()
            + elements.map(|(a, b)| a.dot(b)).sum::<f64>()
            + self.weight.dot(&other.weight)
    }
}
