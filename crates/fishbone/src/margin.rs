//! How far a support may move before the belt loses its stability.

use crate::equilibrium::{Equilibrium, Status, excess_distance};
use crate::follow::{Along, NoBranch};
use crate::lie::{Pose, exp, log};
use crate::path::{Motion, Path};
use crate::solver::{Continuation, End, Events, Pace, Turn};
use nalgebra::{Vector3, Vector6};
use std::ops::ControlFlow;
use thiserror::Error;

/// A way to the loss of stability.
#[derive(Debug, Clone, PartialEq)]
pub struct Margin {
    /// How far it is: the norm of displacement in U and rotation in rad.
    pub distance: f64,
    /// Where to: displacement and rotation left in world axes, of norm 1.
    pub direction: Vector6<f64>,
    /// Whether stability ends in a fold, where the belt snaps; else other equilibria branch off.
    pub is_fold: bool,
    /// Position of the support there.
    pub position: Vector3<f64>,
    /// Rotation vector of the support there.
    pub rotation: Vector3<f64>,
}

/// Why there is no margin.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum NoMargin {
    /// The equilibrium cannot be followed.
    #[error(transparent)]
    NoBranch(#[from] NoBranch),
    /// It is none that is stable.
    #[error("the equilibrium is not stable: it has no stability to lose")]
    NotStable,
    /// The support does not hold all of a pose.
    #[error(
        "supports[{0}] does not hold a position and a rotation, all of both: nothing can be moved there"
    )]
    NotClamped(usize),
    /// The equilibrium could be followed only so far, stable on the way.
    #[error(
        "the equilibrium could be followed only {0:.3} of the way to `reach`, stable until there: a shorter reach may do"
    )]
    Lost(f64),
}

/// The boundary of stability, as it is met along a direction.
struct Boundary {
    margin: Margin,
    /// Square to it, where it is a fold: the change of the support's reaction along the mode that vanishes.
    normal: Option<Vector6<f64>>,
}

/// Whether the supports are out of the belt's reach a little beyond a place.
fn is_taut_beyond(path: &Path, place: f64) -> bool {
    const A_LITTLE: f64 = 0.02;
    let beyond = path.at(place + A_LITTLE);
    beyond.is_none_or(|scenario| excess_distance(&scenario).is_some())
}

impl Equilibrium {
    /// How far a support may move along a direction before stability is lost; `None` where that is not so within `reach`, and
    /// where the belt is taut before.
    ///
    /// Directions are displacement in U and rotation left in world axes about the support point; their length does not matter.
    /// `proceed` is asked once a step whether to go on.
    ///
    /// # Errors
    ///
    /// [`NoMargin`] unless the equilibrium is stable and the support holds all of a pose, and where it cannot be followed.
    pub fn margin_along(
        &self,
        support: usize,
        direction: &Vector6<f64>,
        reach: f64,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<Margin>, NoMargin> {
        let found = self.boundary(support, &direction.normalize(), reach, proceed)?;
        Ok(found.map(|boundary| boundary.margin))
    }

    /// The same to wherever it is nearest, as far as can be told: from the nearest place along either way of the six axes on
    /// along the normal of the boundary there, until that is the way that was taken.
    ///
    /// # Errors
    ///
    /// [`NoMargin`] unless the equilibrium is stable and the support holds all of a pose.
    pub fn margin(
        &self,
        support: usize,
        reach: f64,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<Margin>, NoMargin> {
        const ROUNDS: usize = 8;
        const SAME: f64 = 1e-6;
        let mut nearest: Option<Boundary> = None;
        let mut lost = None;
        for axis in 0..6 {
            for sign in [1.0, -1.0] {
                // Farther than what is known already there is nothing to find.
                let reach = nearest.as_ref().map_or(reach, |b| b.margin.distance);
                let direction = sign * Vector6::ith(axis, 1.0);
                match self.boundary(support, &direction, reach, proceed) {
                    Ok(found) => nearest = found.or(nearest),
                    Err(NoMargin::Lost(share)) => lost = Some(share),
                    Err(other) => return Err(other),
                }
            }
        }
        if let (None, Some(share)) = (&nearest, lost) {
            return Err(NoMargin::Lost(share));
        }
        for _ in 0..ROUNDS {
            let Some(best) = &nearest else {
                return Ok(None);
            };
            let Some(normal) = best.normal else {
                break;
            };
            let towards = normal * normal.dot(&best.margin.direction).signum();
            if 1.0 - towards.dot(&best.margin.direction) < SAME {
                break;
            }
            match self.boundary(support, &towards, best.margin.distance, proceed) {
                Ok(Some(nearer)) => nearest = Some(nearer),
                Ok(None) | Err(NoMargin::Lost(_)) => break,
                Err(other) => return Err(other),
            }
        }
        Ok(nearest.map(|boundary| boundary.margin))
    }

    /// Where stability is lost along a direction of norm 1.
    fn boundary(
        &self,
        support: usize,
        direction: &Vector6<f64>,
        reach: f64,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<Boundary>, NoMargin> {
        const PACE: Pace = Pace {
            longest: 0.05,
            stations: 300,
            events: Events::EndAtFirst,
        };
        let solved = self.solved.as_ref().ok_or(NoBranch::NoMultipliers)?;
        if self.status != Status::Converged {
            return Err(NoBranch::NotConverged(self.message.clone()).into());
        }
        if self.stable() != Some(true) {
            return Err(NoMargin::NotStable);
        }
        let held = self.scenario.supports.get(support);
        let held = held.and_then(|held| {
            held.point()
                .zip(held.frame())
                .filter(|_| held.hinge.is_none())
        });
        let (position, frame) = held.ok_or(NoMargin::NotClamped(support))?;
        let moved = |far: f64| Pose {
            position: position + far * solved.units.length * direction.fixed_rows::<3>(0),
            frame: exp(&(far * direction.fixed_rows::<3>(3))) * frame,
        };
        let end = moved(reach);
        let poses = [(end.position, log(&end.frame))];
        let path = Path::poses(&self.scenario, support, &poses, Motion::Straight);
        let path = path.map_err(|_| NoMargin::NotClamped(support))?;
        let family = Along {
            path: &path,
            elements: self.scenario.elements(),
            nodes: solved.at.point.poses.len(),
        };
        let tolerance = self.scenario.solver.tolerance;
        let continuation = Continuation::new(&family, tolerance, [0.0, 1.0], PACE);
        let start = continuation.start(&solved.at, 0.0, true);
        let start = start.ok_or(NoBranch::Singular)?;
        let curve = continuation.trace(start, &mut |_| proceed());
        let reached = curve
            .stations
            .last()
            .map_or(0.0, |station| station.parameter);
        let Some((_, event)) = curve
            .events
            .first()
            .filter(|(_, event)| event.negative[0] == 0)
        else {
            return match curve.end {
                End::Lost | End::Budget if !is_taut_beyond(&path, reached) => {
                    Err(NoMargin::Lost(reached))
                }
                _ => Ok(None),
            };
        };
        let pose = moved(event.parameter * reach);
        let rows = continuation.multipliers_along(event);
        let normal = rows.filter(|_| event.turn == Turn::Fold).map(|rows| {
            let held = &solved.program.supports[support];
            let at = &event.station.at.point.poses[held.node];
            let (force, moment) = held.reaction(at, &rows[support]);
            Vector6::from_iterator(force.iter().chain(&moment).copied()).normalize()
        });
        Ok(Some(Boundary {
            margin: Margin {
                distance: event.parameter * reach,
                direction: *direction,
                is_fold: event.turn == Turn::Fold,
                position: pose.position,
                rotation: log(&pose.frame),
            },
            normal,
        }))
    }
}
