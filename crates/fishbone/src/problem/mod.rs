//! A belt problem: a validated scenario with its belt, its units and its origin. Every computation starts from a
//! [`Problem`].
//!
//! A [`Problem`] can only be made of a scenario that [`Scenario::validate`] passes, and cannot be changed afterwards: a
//! problem with other numbers is another problem, validated in its turn.

mod active_set;
mod assembly;
pub mod belt;
mod constraints;
mod edges;
mod mesh;
pub mod program;
mod reach;
#[cfg(test)]
mod tests;
mod units;

use crate::geometry::{Pose, log};
use crate::problem::belt::Belt;
use crate::scenario::error::ScenarioError;
use crate::scenario::{Component, EnergyModel, Method, Scenario, SupportSpec};
use nalgebra::{Matrix3, Vector3};
use std::sync::Arc;

pub(crate) use active_set::Shape;
pub(crate) use mesh::Mesh;
pub use reach::OutOfReach;
pub(crate) use reach::number;
pub use units::Units;

/// Tolerance of the products of a frame's columns against those of a rotation, dimensionless.
const ROTATION_TOLERANCE: f64 = 1e-6;

/// A validated scenario, with the belt that it describes, and the units and the origin of its programme.
///
/// A clone shares the scenario and the belt.
///
/// ```
/// use fishbone::problem::Problem;
/// use fishbone::scenario::{BeltSpec, Scenario, SegmentSpec};
///
/// let mut scenario = Scenario::new(BeltSpec::new(0.1, 2.0, vec![SegmentSpec::straight(0.5)]));
/// let problem = Problem::new(scenario.clone())?;
/// assert_eq!(problem.units().energy, 2.0 / 0.5);
///
/// scenario.belt.width = -0.1;
/// let refused = Problem::new(scenario).unwrap_err();
/// assert_eq!(refused.to_string(), "belt.width: found -0.1, must be a positive finite number");
/// # Ok::<(), fishbone::scenario::error::ScenarioError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    scenario: Arc<Scenario>,
    belt: Arc<Belt>,
    units: Units,
    /// Origin of the programme, world axes: at the first support, so that a belt far from the world's origin loses no
    /// digits.
    origin: Vector3<f64>,
    formulation: Formulation,
}

/// The method of solution, with its data beyond the belt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Formulation {
    /// Bend and rib slope as the only unknowns.
    Intrinsic,
    /// The source's own method, for a belt clamped at both ends.
    Ritz {
        /// Poses of the start and of the end.
        ends: [Pose; 2],
    },
}

impl Formulation {
    fn of(scenario: &Scenario) -> Result<Self, ScenarioError> {
        match scenario.solver.method {
            Method::Intrinsic => Ok(Self::Intrinsic),
            Method::Ritz => match [0, 1].map(|support| clamp(scenario, support)) {
                [Some(start), Some(end)] => Ok(Self::Ritz { ends: [start, end] }),
                _ => Err(ScenarioError::invalid(
                    "solver.method",
                    "\"ritz\" with an end that is not clamped",
                    "\"intrinsic\", or have both ends clamped",
                )),
            },
        }
    }
}

impl Problem {
    /// The problem of a scenario.
    ///
    /// Supports that no shape of the belt can meet are no error: that is an outcome of a solve.
    ///
    /// # Errors
    ///
    /// The first thing wrong with the scenario, with its field, as [`Scenario::validate`] finds it.
    pub fn new(scenario: Scenario) -> Result<Self, ScenarioError> {
        scenario.validate()?;
        let belt = Belt::new(&scenario.belt)?;
        Self::of(scenario, Arc::new(belt))
    }

    /// The same problem on a mesh of another number of elements.
    ///
    /// # Errors
    ///
    /// [`ScenarioError`] where a scenario may not have so many elements, or so few.
    pub(crate) fn with_elements(&self, elements: usize) -> Result<Self, ScenarioError> {
        let mut scenario = Scenario::clone(&self.scenario);
        scenario.solver.elements = Some(elements);
        self.on_the_same_belt(scenario)
    }

    /// Whether the belt is a strip of finite thickness.
    pub(crate) fn is_of_shell(&self) -> bool {
        self.scenario.energy_model() == EnergyModel::Shell
    }

    /// The same problem with another energy of the same belt.
    pub(crate) fn with_energy(&self, energy: EnergyModel) -> Self {
        let mut scenario = Scenario::clone(&self.scenario);
        scenario.energy = Some(energy);
        Self {
            scenario: Arc::new(scenario),
            ..self.clone()
        }
    }

    /// The same problem with a support, given by its place in the scenario, held at another pose.
    ///
    /// Units: those of the scenario.
    ///
    /// # Errors
    ///
    /// [`ScenarioError`] where there is no such support, and where it may not be held at the pose: a frame that is no
    /// rotation, a position that is not finite or too many lengths of the belt away.
    pub(crate) fn with_support_pose(
        &self,
        support: usize,
        pose: &Pose,
    ) -> Result<Self, ScenarioError> {
        self.with_support_poses([(support, *pose)].into_iter())
    }

    /// The same problem with several supports, given by their places in the scenario, at other poses; the rotation counts only
    /// where a support holds one.
    ///
    /// Units: those of the scenario.
    ///
    /// # Errors
    ///
    /// As [`Self::with_support_pose`].
    pub(crate) fn with_support_poses(
        &self,
        poses: impl Iterator<Item = (usize, Pose)>,
    ) -> Result<Self, ScenarioError> {
        let mut scenario = Scenario::clone(&self.scenario);
        for (support, pose) in poses {
            scenario.supports[support] = self.moved(support, &pose)?;
        }
        self.on_the_same_belt(scenario)
    }

    /// The same problem with other supports.
    ///
    /// # Errors
    ///
    /// [`ScenarioError`] where a scenario may not have them.
    pub(crate) fn with_supports(&self, supports: Vec<SupportSpec>) -> Result<Self, ScenarioError> {
        let mut scenario = Scenario::clone(&self.scenario);
        scenario.supports = supports;
        self.on_the_same_belt(scenario)
    }

    /// The same problem with the origin of its programmes elsewhere, world axes.
    pub(crate) fn about(self, origin: Vector3<f64>) -> Self {
        Self { origin, ..self }
    }

    /// Checks a position and a rotation vector for a support as a scenario is checked, without making the problem: nothing is
    /// allocated. What is `None` stays as it is.
    ///
    /// Units: those of the scenario; rad.
    pub(crate) fn check_support_pose(
        &self,
        support: usize,
        position: Option<&Vector3<f64>>,
        rotation: Option<&Vector3<f64>>,
    ) -> Result<(), ScenarioError> {
        let moved = self.held_at(support, position, rotation)?;
        self.scenario.check_support(support, &moved)
    }

    /// A support held at another pose.
    fn moved(&self, support: usize, pose: &Pose) -> Result<SupportSpec, ScenarioError> {
        let moved = self.held_at(support, Some(&pose.position), Some(&log(&pose.frame)))?;
        if !is_rotation(&pose.frame) {
            return Err(ScenarioError::invalid(
                format!("supports[{support}].rotation"),
                "a frame that is no rotation",
                "a right-handed frame of columns of length 1 that are square to each other",
            ));
        }
        Ok(moved)
    }

    /// A support held at another position and with another rotation vector, one of them or both; the rotation counts only if it
    /// holds one.
    fn held_at(
        &self,
        support: usize,
        position: Option<&Vector3<f64>>,
        rotation: Option<&Vector3<f64>>,
    ) -> Result<SupportSpec, ScenarioError> {
        let Some(held) = self.scenario.supports.get(support) else {
            return Err(ScenarioError::invalid(
                format!("supports[{support}]"),
                "nothing",
                "a support of the scenario",
            ));
        };
        let mut held = held.clone();
        if let Some(position) = position {
            held.position = Some([0, 1, 2].map(|i| Component::Held(position[i])));
        }
        if let Some(rotation) = rotation.filter(|_| held.frame().is_some()) {
            (held.rotation, held.euler, held.quaternion) = (Some((*rotation).into()), None, None);
        }
        Ok(held)
    }

    /// The largest angle by which a rotation vector turns a support; 0 where all supports turn alike, and so none against
    /// another. Units: rad.
    pub(crate) fn largest_turn(&self) -> f64 {
        let turned = self
            .scenario
            .supports
            .iter()
            .filter(|s| s.frame().is_some());
        let rotations: Vec<_> = turned.map(|support| support.rotation).collect();
        let are_alike = rotations.len() > 1 && rotations.iter().all(|r| *r == rotations[0]);
        let angles = rotations.iter().flatten().map(|r| Vector3::from(*r).norm());
        match are_alike {
            true => 0.0,
            false => angles.fold(0.0, f64::max),
        }
    }

    /// The same problem with a share of all rotation vectors that turn a support by more than an angle.
    pub(crate) fn turned_back(&self, angle: f64, share: f64) -> Self {
        let mut scenario = Scenario::clone(&self.scenario);
        let supports = scenario.supports.iter_mut();
        for rotation in supports.filter_map(|support| support.rotation.as_mut()) {
            let vector = Vector3::from(*rotation);
            if vector.norm() > angle {
                *rotation = (share * vector).into();
            }
        }
        Self {
            scenario: Arc::new(scenario),
            ..self.clone()
        }
    }

    /// The problem of a scenario with the same belt.
    fn on_the_same_belt(&self, scenario: Scenario) -> Result<Self, ScenarioError> {
        scenario.validate()?;
        Self::of(scenario, Arc::clone(&self.belt))
    }

    /// The problem of a validated scenario and its belt.
    fn of(scenario: Scenario, belt: Arc<Belt>) -> Result<Self, ScenarioError> {
        let first = |i: usize| scenario.supports.iter().find_map(|s| s.components()[i]);
        Ok(Self {
            units: Units::of(&belt),
            origin: Vector3::from([0, 1, 2].map(|i| first(i).unwrap_or(0.0))),
            formulation: Formulation::of(&scenario)?,
            scenario: Arc::new(scenario),
            belt,
        })
    }

    /// The scenario.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The belt, in the units of the scenario.
    pub(crate) fn belt(&self) -> &Belt {
        &self.belt
    }

    /// The units of length and energy of the programme.
    pub fn units(&self) -> Units {
        self.units
    }

    /// Origin of its programmes, world axes: at the first support, unless a tracker has kept the origin while that support
    /// moved. Units: those of the scenario.
    pub fn origin(&self) -> Vector3<f64> {
        self.origin
    }

    /// Number of elements of a mesh that is to suit many shapes.
    pub fn elements(&self) -> usize {
        self.scenario.elements()
    }

    /// The largest estimated error by the mesh that is asked for, relative.
    pub(crate) fn accuracy(&self) -> f64 {
        self.scenario.solver.accuracy
    }

    /// The largest displacement from which a jump to another equilibrium is a snap, in U.
    pub(crate) fn snap_size(&self) -> f64 {
        self.scenario.solver.snap_size * self.belt.width / self.units.length
    }

    /// Whether a displacement and the energy released in it, of a belt of an elastic energy, are a snap. Where a branch splits
    /// into two smoothly, the belt goes over to one of them, and the energy released there tends to 0.
    ///
    /// Units: U, and any unit of energy
    pub(crate) fn is_snap(&self, jump: f64, released: f64, elastic_energy: f64) -> bool {
        /// Least energy released in a snap over the elastic energy, dimensionless.
        const LEAST_RELEASED: f64 = 1e-4;
        jump >= self.snap_size() && released >= LEAST_RELEASED * elastic_energy
    }

    /// Whether the scenario names the number of elements.
    pub(crate) fn has_fixed_mesh(&self) -> bool {
        self.scenario.solver.elements.is_some()
    }

    /// Arc lengths where elements must meet, in U.
    pub(crate) fn break_points(&self) -> Vec<f64> {
        let points = self.scenario.break_points();
        points.iter().map(|u| u / self.units.length).collect()
    }

    /// The direction along which the belt should bulge, world axes; of any length.
    pub(crate) fn bulge(&self) -> Vector3<f64> {
        Vector3::from(self.scenario.solver.bulge)
    }

    /// The largest residual that counts as converged: lengths in U and energy in mean R_f/U.
    pub(crate) fn tolerance(&self) -> f64 {
        self.scenario.solver.tolerance
    }

    /// The pose at which a support, given by its place in the scenario, holds the belt; `None` where there is no such
    /// support, or it leaves any part of the pose free. Units: those of the scenario.
    pub(crate) fn clamp(&self, support: usize) -> Option<Pose> {
        clamp(&self.scenario, support)
    }

    /// The position that a support holds, with its frame, or no turn where it holds none; `None` unless it holds all of a
    /// position. Units: those of the scenario.
    pub(crate) fn held_pose(&self, support: usize) -> Option<Pose> {
        let held = self.scenario.supports.get(support)?;
        Some(Pose {
            frame: held.frame().unwrap_or_else(Matrix3::identity),
            position: held.point()?,
        })
    }

    /// The method of solution.
    pub(crate) fn formulation(&self) -> &Formulation {
        &self.formulation
    }
}

fn is_rotation(frame: &Matrix3<f64>) -> bool {
    let off = frame.tr_mul(frame) - Matrix3::identity();
    off.iter().all(|entry| entry.abs() <= ROTATION_TOLERANCE) && frame.determinant() > 0.0
}

fn clamp(scenario: &Scenario, support: usize) -> Option<Pose> {
    let held = scenario.supports.get(support)?;
    let held = Some(held).filter(|held| held.hinge.is_none())?;
    Some(Pose {
        frame: held.frame()?,
        position: held.point()?,
    })
}
