//! Paths through the space of problems: one number or several that change together, or a support that moves.

use crate::analysis::sensitivity::Motion as SupportMotion;
use crate::geometry::{Pose, Twist, exp, log};
use crate::names::named;
use crate::problem::{OutOfReach, Problem};
use crate::scenario::error::ScenarioError;
use nalgebra::Vector3;
use std::any::Any;
use std::fmt::Debug;
use std::sync::Arc;
use thiserror::Error;

/// A change of a problem along a path.
pub trait Change: Any + Debug + Send + Sync {
    /// The problem at a place on the path that begins at `base`, or a little before or beyond it.
    ///
    /// # Errors
    ///
    /// [`NoPath`] where there is no valid problem.
    fn problem(&self, base: &Problem, place: f64) -> Result<Problem, NoPath>;

    /// The support that moves at a place on the path, if nothing else changes there, with its motion per unit of place:
    /// displacement in the unit of the scenario, rotation left in world axes.
    fn support_motion(&self, _place: f64) -> Option<(usize, SupportMotion)> {
        None
    }

    /// Length of the path, which begins at 0.
    fn length(&self) -> f64 {
        1.0
    }

    /// The parameter of a place on the path, for reports.
    fn parameter(&self, place: f64) -> f64 {
        place
    }

    /// Of a change in legs that meet at whole numbers of the place, perhaps at an angle: the change along one of them, counted
    /// from 0, which goes on beyond both ends of the leg without an angle.
    fn on_leg(&self, _leg: usize) -> Option<Arc<dyn Change>> {
        None
    }
}

/// A path: the problem at its start, and the change from place to place.
///
/// A clone shares the change.
#[derive(Debug, Clone)]
pub struct Path {
    base: Problem,
    change: Arc<dyn Change>,
}

/// Poses of a support, one after the other; the first is its own.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Poses {
    support: usize,
    poses: Vec<Pose>,
    motion: Motion,
    /// The leg that goes on beyond its ends; `None` of all legs.
    leg: Option<usize>,
}

named! {
    /// How a support moves from one pose to the next.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    pub enum Motion {
        /// Its point on a straight line, its frame about a fixed axis, both at a steady rate.
        #[default]
        Straight = "straight",
        /// As a screw turns: about a fixed axis and along it, both at a steady rate.
        Screw = "screw",
    }
}

/// The reason why a path cannot be made.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum NoPath {
    /// The field holds no number.
    #[error("{field}: found {found}, allowed a number that the scenario gives, as in {example}")]
    NoNumber {
        /// Path of the field.
        field: String,
        /// The value of the field.
        found: String,
        /// A field that holds a number.
        example: String,
    },
    /// Nothing changes along the path.
    #[error("path: found nothing that changes, allowed a number with another value, or poses")]
    Nothing,
    /// The support does not hold all of a pose.
    #[error(
        "supports[{0}]: found a support that does not hold a position and a rotation, allowed one that does"
    )]
    NotClamped(usize),
    /// The support may not be held at one of the poses, counted from 0.
    #[error("poses[{0}]: {1}")]
    NoPose(usize, String),
    /// The scenario at the path's end is not valid.
    #[error("at the end of the path, {0}")]
    Invalid(ScenarioError),
    /// The scenario at the path's end cannot be read: a number is not of the kind that its field takes.
    #[error("at the end of the path, {0}")]
    Unreadable(String),
}

named!(impl NoPath {
    NoNumber = "no_number",
    Nothing = "nothing",
    NotClamped = "not_clamped",
    NoPose = "no_pose",
    Invalid = "invalid",
    Unreadable = "unreadable",
});

impl Path {
    /// A path from a problem to the problem at the end of a change.
    ///
    /// # Errors
    ///
    /// [`NoPath`] where there is no problem at the end.
    pub fn new(base: &Problem, change: impl Change + 'static) -> Result<Self, NoPath> {
        change.problem(base, change.length())?;
        Ok(Self {
            base: base.clone(),
            change: Arc::new(change),
        })
    }

    /// A support that moves from its own pose through others, each a position and a rotation vector, world axes.
    ///
    /// # Errors
    ///
    /// [`NoPath`] if there are no other poses, if the support does not hold all of a pose, or if it may not be held at one
    /// of the poses.
    pub fn poses(
        problem: &Problem,
        support: usize,
        given: &[(Vector3<f64>, Vector3<f64>)],
        motion: Motion,
    ) -> Result<Self, NoPath> {
        let first = problem.clamp(support);
        let first = first.ok_or(NoPath::NotClamped(support))?;
        let others = given.iter().map(|(position, rotation)| Pose {
            frame: exp(rotation),
            position: *position,
        });
        let poses: Vec<_> = std::iter::once(first).chain(others).collect();
        for (i, (position, rotation)) in given.iter().enumerate() {
            let checked = problem.check_support_pose(support, Some(position), Some(rotation));
            checked.map_err(|error| NoPath::NoPose(i, error.to_string()))?;
        }
        if poses.iter().all(|pose| *pose == first) {
            return Err(NoPath::Nothing);
        }
        let change = Poses {
            support,
            poses,
            motion,
            leg: None,
        };
        Self::new(problem, change)
    }

    /// The problem where the path begins.
    pub(crate) fn base(&self) -> &Problem {
        &self.base
    }

    /// The change along the path.
    #[cfg(feature = "io")]
    pub(crate) fn change(&self) -> &dyn Change {
        &*self.change
    }

    /// Length of the path: 1, or the number of poses after the first.
    pub fn length(&self) -> f64 {
        self.change.length()
    }

    /// The parameter of a place on the path, for reports: the number that changes if there is only one, else the place
    /// itself.
    pub fn parameter(&self, place: f64) -> f64 {
        self.change.parameter(place)
    }

    /// The support that moves at a place, if nothing else changes there, with its motion per unit of place, in the units of
    /// the programme.
    pub(super) fn support_motion(&self, place: f64) -> Option<(usize, SupportMotion)> {
        let (support, mut motion) = self.change.support_motion(place)?;
        motion.translation /= self.base.units().length;
        Some((support, motion))
    }

    /// The first end of a leg of the path whose supports are proved to be out of reach, as its parameter, and the supports;
    /// `None` where nothing is proved, and where the path begins out of reach. Nothing is solved.
    pub fn out_of_reach(&self) -> Option<(f64, OutOfReach)> {
        if self.base.unreachable_supports().is_some() {
            return None;
        }
        let legs = self.length().ceil() as usize;
        let mut ends = (1..=legs).map(|leg| self.length().min(leg as f64));
        ends.find_map(|place| {
            let supports = self.at(place)?.unreachable_supports()?;
            Some((self.parameter(place), supports))
        })
    }

    /// The path along the leg on which a place lies, and the places of the ends of this leg, beyond which the path goes on
    /// without an angle. Where two legs meet, it is the leg ahead. A path without legs is its own leg.
    pub(super) fn leg(&self, place: f64, rising: bool) -> (Self, [f64; 2]) {
        let length = self.length();
        let start = if rising {
            place.floor()
        } else {
            place.ceil() - 1.0
        };
        let start = start.clamp(0.0, (length - 1.0).max(0.0));
        let Some(change) = self.change.on_leg(start as usize) else {
            return (self.clone(), [0.0, length]);
        };
        let base = self.base.clone();
        (Self { base, change }, [start, start + 1.0])
    }

    /// Whether two legs of the path meet at a place.
    pub(super) fn is_between_legs(&self, place: f64) -> bool {
        let [ahead, behind] = [true, false].map(|rising| self.leg(place, rising).1);
        ahead != behind
    }

    /// The problem at a place on the path, or a little before or beyond it; `None` where the scenario there is not valid.
    pub fn at(&self, place: f64) -> Option<Problem> {
        self.change.problem(&self.base, place).ok()
    }
}

impl Poses {
    /// The poses between which a place lies, and its share of the way from one to the other.
    fn leg(&self, place: f64) -> (&Pose, &Pose, f64) {
        let leg = self.leg.unwrap_or(place.max(0.0) as usize);
        let leg = leg.min(self.poses.len() - 2);
        (&self.poses[leg], &self.poses[leg + 1], place - leg as f64)
    }
}

impl Change for Poses {
    fn problem(&self, base: &Problem, place: f64) -> Result<Problem, NoPath> {
        let (from, to, share) = self.leg(place);
        let pose = self.motion.between(from, to, share);
        let moved = base.with_support_pose(self.support, &pose);
        moved.map_err(NoPath::Invalid)
    }

    fn support_motion(&self, place: f64) -> Option<(usize, SupportMotion)> {
        let (from, to, share) = self.leg(place);
        Some((self.support, self.motion.rate(from, to, share)))
    }

    fn length(&self) -> f64 {
        self.poses.len() as f64 - 1.0
    }

    fn on_leg(&self, leg: usize) -> Option<Arc<dyn Change>> {
        Some(Arc::new(Self {
            leg: Some(leg),
            ..self.clone()
        }))
    }
}

impl Motion {
    /// The pose at a share of the way from one to another.
    fn between(self, from: &Pose, to: &Pose, share: f64) -> Pose {
        let turn = log(&(from.frame.transpose() * to.frame));
        match self {
            Self::Straight => Pose {
                frame: from.frame * exp(&(share * turn)),
                position: from.position.lerp(&to.position, share),
            },
            Self::Screw => {
                let screw = (from.inverse() * *to).log().to_vector();
                *from * Pose::exp(&Twist::from_vector(&(share * screw)))
            }
        }
    }

    /// Rate of the pose by the share.
    fn rate(self, from: &Pose, to: &Pose, share: f64) -> SupportMotion {
        match self {
            Self::Straight => SupportMotion {
                translation: to.position - from.position,
                rotation: from.frame * log(&(from.frame.transpose() * to.frame)),
            },
            Self::Screw => {
                let screw = (from.inverse() * *to).log();
                let frame = self.between(from, to, share).frame;
                SupportMotion {
                    translation: frame * screw.translation,
                    rotation: frame * screw.rotation,
                }
            }
        }
    }
}
