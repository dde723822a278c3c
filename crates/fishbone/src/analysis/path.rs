//! Ways through the space of problems: one number or several that change together, or a support that moves.

use crate::geometry::{Pose, Twist, exp, log};
use crate::names::named;
use crate::problem::Problem;
use crate::scenario::error::ScenarioError;
use nalgebra::Vector3;
use serde::Serialize;
use serde_json::Value;
use thiserror::Error;

/// How a problem changes: the problem where the path begins, and what of its scenario differs from place to place.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    base: Problem,
    change: Change,
}

#[derive(Debug, Clone, PartialEq)]
enum Change {
    /// Numbers of the scenario, each from its own value to another.
    Numbers { base: Value, numbers: Vec<Number> },
    /// Poses of a support, one after the other; the first is its own.
    Poses {
        support: usize,
        poses: Vec<Pose>,
        motion: Motion,
    },
}

/// A number of a scenario that changes.
#[derive(Debug, Clone, PartialEq)]
struct Number {
    /// Where it stands, a JSON pointer.
    pointer: String,
    from: f64,
    to: f64,
}

named! {
    /// How a support moves from one pose to the next.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
    pub enum Motion {
        /// Its point on a straight line, its frame about a fixed axis, both at a steady rate.
        #[default]
        Straight = "straight",
        /// As a screw turns: about a fixed axis and along it, both at a steady rate.
        Screw = "screw",
    }
}

/// Why there is no such path.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum NoPath {
    /// No number stands there.
    #[error("{field}: found {found}, allowed a number that the scenario gives, as in {example}")]
    NoNumber {
        /// What was asked for.
        field: String,
        /// What stands there.
        found: String,
        /// What could have been asked for.
        example: String,
    },
    /// Nothing changes along it.
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
    /// The scenario at its end is not valid.
    #[error("at the end of the path, {0}")]
    Invalid(ScenarioError),
    /// The scenario at its end cannot be read: a number is not of the kind that its field takes.
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

/// A value that is no number as text; by its kind where that is long.
fn shown(value: &Value) -> String {
    const SHORT: usize = 40;
    let text = value.to_string();
    match value {
        Value::Object(_) if text.len() > SHORT => "a table".to_owned(),
        Value::Array(_) if text.len() > SHORT => "a list".to_owned(),
        _ => text,
    }
}

impl Path {
    /// Numbers of the scenario, each named as in `supports[1].position[2]`, that change together from their own values to
    /// others.
    ///
    /// # Errors
    ///
    /// [`NoPath`] where no such number stands in the scenario, and where the scenario at the end is not valid.
    pub fn numbers(problem: &Problem, changes: &[(String, f64)]) -> Result<Self, NoPath> {
        let base = serde_json::to_value(problem.scenario()).expect("a scenario is plain data");
        let number = |(field, to): &(String, f64)| {
            let pointer = pointer(field);
            let found = base.pointer(&pointer);
            let from = found.and_then(Value::as_f64);
            let from = from.ok_or_else(|| NoPath::NoNumber {
                field: field.clone(),
                found: found.map_or("nothing".to_owned(), shown),
                example: "supports[1].position[1]".to_owned(),
            })?;
            Ok(Number {
                pointer,
                from,
                to: *to,
            })
        };
        let numbers: Vec<_> = changes.iter().map(number).collect::<Result<_, _>>()?;
        if numbers.iter().all(|number| number.from == number.to) {
            return Err(NoPath::Nothing);
        }
        Self {
            base: problem.clone(),
            change: Change::Numbers { base, numbers },
        }
        .checked()
    }

    /// A support that moves from its own pose through others, each a position and a rotation vector, world axes.
    ///
    /// # Errors
    ///
    /// [`NoPath`] where there are no others, where the support does not hold all of a pose, and where it may not be held at
    /// one of them.
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
        for (i, (pose, (_, rotation))) in poses[1..].iter().zip(given).enumerate() {
            if rotation.iter().any(|angle| !angle.is_finite()) {
                return Err(NoPath::NoPose(
                    i,
                    "found a rotation that is not finite".to_owned(),
                ));
            }
            let refused = |error: ScenarioError| NoPath::NoPose(i, error.to_string());
            problem.check_support_pose(support, pose).map_err(refused)?;
        }
        if poses.iter().all(|pose| *pose == first) {
            return Err(NoPath::Nothing);
        }
        Self {
            base: problem.clone(),
            change: Change::Poses {
                support,
                poses,
                motion,
            },
        }
        .checked()
    }

    /// The problem where the path begins.
    pub fn base(&self) -> &Problem {
        &self.base
    }

    /// How far the path goes: 1, or the number of poses after the first.
    pub fn length(&self) -> f64 {
        match &self.change {
            Change::Numbers { .. } => 1.0,
            Change::Poses { poses, .. } => poses.len() as f64 - 1.0,
        }
    }

    /// What a place on the path is called: the number that changes where there is one, else how far along the path it is.
    pub fn parameter(&self, place: f64) -> f64 {
        match &self.change {
            Change::Numbers { numbers, .. } => match numbers.as_slice() {
                [number] => number.at(place),
                _ => place,
            },
            Change::Poses { .. } => place,
        }
    }

    /// The problem at a place on the path, or a little before or beyond it; `None` where the scenario there is not valid.
    pub fn at(&self, place: f64) -> Option<Problem> {
        self.problem(place).ok()
    }

    fn problem(&self, place: f64) -> Result<Problem, NoPath> {
        match &self.change {
            Change::Numbers { base, numbers } => {
                let mut tables = base.clone();
                for number in numbers {
                    if let Some(value) = tables.pointer_mut(&number.pointer) {
                        *value = number.at(place).into();
                    }
                }
                let scenario = serde_json::from_value(tables)
                    .map_err(|error| NoPath::Unreadable(error.to_string()))?;
                Problem::new(scenario).map_err(NoPath::Invalid)
            }
            Change::Poses {
                support,
                poses,
                motion,
            } => {
                let leg = (place.max(0.0) as usize).min(poses.len() - 2);
                let pose = motion.between(&poses[leg], &poses[leg + 1], place - leg as f64);
                let moved = self.base.with_support_pose(*support, &pose);
                moved.map_err(NoPath::Invalid)
            }
        }
    }

    fn checked(self) -> Result<Self, NoPath> {
        self.problem(self.length())?;
        Ok(self)
    }
}

impl Number {
    fn at(&self, place: f64) -> f64 {
        match place {
            1.0 => self.to,
            _ => self.from + place * (self.to - self.from),
        }
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
}

/// The JSON pointer of a field: `supports[1].position[2]` is `/supports/1/position/2`.
fn pointer(field: &str) -> String {
    let parts = field.split(['.', '[', ']']).filter(|part| !part.is_empty());
    parts.flat_map(|part| ["/", part]).collect()
}
