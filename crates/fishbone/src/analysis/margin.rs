//! The stability margin: the distance a support may move before the belt loses its stability.

use crate::analysis::continuation::NoBranch;
use crate::analysis::family::{Along, Station};
use crate::analysis::path::{Motion, NoPath, Path};
use crate::equilibrium::model::StripModel;
use crate::equilibrium::{AnySolved, Equilibrium, Solved, Uncertified};
use crate::geometry::{Pose, exp, log};
use crate::names::named;
use crate::problem::Mesh;
use crate::problem::program::rows_of;
use nalgebra::{Vector3, Vector6};
use stagewise::{Continuation, End, Events, Pace, Turn};
use std::ops::ControlFlow;
use thiserror::Error;

/// A motion of a support to the loss of stability.
#[derive(Debug, Clone, PartialEq)]
pub struct Margin {
    /// Distance: the norm of displacement in U and rotation in rad.
    pub distance: f64,
    /// Direction: displacement and rotation left in world axes, of norm 1.
    pub direction: Vector6<f64>,
    /// Whether stability ends in a fold, where the belt snaps; else other equilibria branch off.
    pub is_fold: bool,
    /// Position of the support there.
    pub position: Vector3<f64>,
    /// Rotation vector of the support there.
    pub rotation: Vector3<f64>,
    /// Whether a mesh twice as fine loses its stability at much the same distance along the direction.
    pub confirmed: bool,
}

/// Settings of the search for the nearest loss of stability: its extent, steps and tolerances.
#[derive(Debug, Clone, PartialEq)]
pub struct MarginSettings {
    /// Greatest count of places on the boundary from which the search goes on, the nearest first, a number.
    pub refined: usize,
    /// Distance up to which other places are sought to go on from, in distances of the nearest known place.
    pub farther: f64,
    /// Turns to the side of a direction that ends where other equilibria branch off, as tangents of the angle.
    pub aside: [f64; 2],
    /// Greatest count of rounds along the boundary's normal from each place, a number.
    pub rounds: usize,
    /// Deviation of the normal from the direction taken below which they are the same, as 1 − cos of the angle,
    /// dimensionless.
    pub same_way: f64,
    /// Step of the differences that give the fall of eigenvalues, in U and rad.
    pub difference: f64,
    /// Turn of a leg, less than half a turn, in rad.
    pub leg: f64,
    /// Longest step along a direction, in U and rad.
    pub step: f64,
    /// Greatest count of states along a direction, a number.
    pub states: usize,
}

impl Default for MarginSettings {
    fn default() -> Self {
        Self {
            refined: 4,
            farther: 2.0,
            aside: [0.3, -0.3],
            rounds: 16,
            same_way: 1e-6,
            difference: 1e-3,
            leg: 3.0,
            step: 0.05,
            states: 1000,
        }
    }
}

/// The reason why there is no margin.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum NoMargin {
    /// There is no equilibrium.
    #[error(transparent)]
    Uncertified(#[from] Uncertified),
    /// The equilibrium cannot be followed.
    #[error(transparent)]
    NoBranch(#[from] NoBranch),
    /// The equilibrium is not stable.
    #[error("the equilibrium is not stable: it has no stability to lose")]
    NotStable,
    /// The support does not hold all of a pose.
    #[error(
        "supports[{0}] does not hold a position and a rotation, all of both: nothing can be moved there"
    )]
    NotClamped(usize),
    /// The support may not be moved to a pose on the way.
    #[error(transparent)]
    NoPath(#[from] NoPath),
    /// The equilibrium was lost on the way, stable up to a reported distance.
    #[error(
        "the equilibrium could be followed only {0:.3} of the way to `reach`, stable until there: a shorter reach may do"
    )]
    Lost(f64),
}

named!(impl NoMargin {
    NotStable = "not_stable",
    NotClamped = "not_clamped",
    Lost = "lost",
    ..Uncertified,
    ..NoBranch,
    ..NoPath,
});

/// A point on the boundary of stability, reached along a direction.
struct Boundary {
    margin: Margin,
    /// The change of the support's reaction along the mode that vanishes, of norm 1: normal to the boundary at a fold; at a
    /// bifurcation, the direction along which the branches separate.
    across: Option<Vector6<f64>>,
}

impl Equilibrium {
    /// Distance a support may move along a direction before stability is lost; `None` if stability is kept within `reach`,
    /// or if the belt comes to its inextensible limit before.
    ///
    /// Directions are displacement in U and rotation left in world axes about the support point; their length does not
    /// matter. `proceed` is asked once a step whether to go on.
    ///
    /// # Errors
    ///
    /// [`NoMargin`] unless the equilibrium is stable and the support holds all of a pose, and where it cannot be followed.
    pub fn margin_along(
        &self,
        support: usize,
        direction: &Vector6<f64>,
        reach: f64,
        settings: &MarginSettings,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<Margin>, NoMargin> {
        match self.certified_any()? {
            AnySolved::Developable(solved) => {
                Search::new(self, solved, support, settings)?.along(direction, reach, proceed)
            }
            AnySolved::Shell(solved) => {
                Search::new(self, solved, support, settings)?.along(direction, reach, proceed)
            }
        }
    }

    /// The nearest loss of stability that a local search finds. The search starts from places along the six axes and along
    /// the directions in which the lowest eigenvalues of the second variation fall fastest. From each place it goes on along
    /// the normal of the boundary, until the normal is the direction taken.
    ///
    /// # Errors
    ///
    /// [`NoMargin`] unless the equilibrium is stable and the support holds all of a pose, and where it cannot be followed.
    pub fn margin(
        &self,
        support: usize,
        reach: f64,
        settings: &MarginSettings,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<Margin>, NoMargin> {
        match self.certified_any()? {
            AnySolved::Developable(solved) => {
                Search::new(self, solved, support, settings)?.nearest(reach, proceed)
            }
            AnySolved::Shell(solved) => {
                Search::new(self, solved, support, settings)?.nearest(reach, proceed)
            }
        }
    }
}

/// The search for the loss of stability of an equilibrium as one of its supports moves.
struct Search<'a, D, const F: usize, const N: usize> {
    equilibrium: &'a Equilibrium,
    solved: &'a Solved<D, F, N>,
    support: usize,
    /// Pose of the support at the equilibrium.
    from: Pose,
    settings: &'a MarginSettings,
}

impl<'a, D: StripModel<F, N>, const F: usize, const N: usize> Search<'a, D, F, N> {
    /// The search from a stable equilibrium, given with its solved programme, by a support that holds all of a pose.
    fn new(
        equilibrium: &'a Equilibrium,
        solved: &'a Solved<D, F, N>,
        support: usize,
        settings: &'a MarginSettings,
    ) -> Result<Self, NoMargin> {
        if equilibrium.stable() != Some(true) {
            return Err(NoMargin::NotStable);
        }
        let from = equilibrium.problem.clamp(support);
        Ok(Self {
            equilibrium,
            solved,
            support,
            from: from.ok_or(NoMargin::NotClamped(support))?,
            settings,
        })
    }

    /// The loss of stability along a direction of any length.
    fn along(
        &self,
        direction: &Vector6<f64>,
        reach: f64,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<Margin>, NoMargin> {
        let found = self.boundary(&direction.normalize(), reach, proceed)?;
        let margin = found.map(|boundary| boundary.margin);
        Ok(margin.map(|margin| self.with_confirmation(margin, proceed)))
    }

    /// The nearest loss of stability that a local search finds.
    fn nearest(
        &self,
        reach: f64,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<Margin>, NoMargin> {
        let settings = self.settings;
        let axes = (0..6).flat_map(|axis| [1.0, -1.0].map(|sign| sign * Vector6::ith(axis, 1.0)));
        let steepest = self.falls(proceed)?;
        let mut found = Vec::new();
        let mut lost = None;
        let mut look = |direction: &Vector6<f64>, found: &mut Vec<Boundary>| {
            let farther = |nearest: &Boundary| settings.farther * nearest.margin.distance;
            let far = found.first().map_or(reach, farther).min(reach);
            match self.boundary(direction, far, proceed) {
                Ok(boundary) => found.extend(boundary),
                Err(NoMargin::Lost(share)) => lost = Some(share),
                Err(other) => return Err(other),
            }
            found.sort_by(|a, b| a.margin.distance.total_cmp(&b.margin.distance));
            Ok(())
        };
        for direction in steepest.into_iter().chain(axes) {
            look(&direction, &mut found)?;
        }
        // At a bifurcation the boundary has an edge: folds lie nearer to either side of it.
        let edges = found
            .iter()
            .filter(|b| !b.margin.is_fold)
            .take(settings.refined);
        let beside = |edge: &Boundary| {
            let across = edge.across?;
            let aside = settings.aside;
            Some(aside.map(|aside| (edge.margin.direction + aside * across).normalize()))
        };
        let sides: Vec<_> = edges.filter_map(beside).flatten().collect();
        for direction in sides {
            look(&direction, &mut found)?;
        }
        if let (true, Some(share)) = (found.is_empty(), lost) {
            return Err(NoMargin::Lost(share));
        }
        found.truncate(settings.refined);
        let mut margins = Vec::new();
        for boundary in found {
            margins.push(self.nearest_from(boundary, proceed)?);
        }
        let nearest = margins
            .into_iter()
            .min_by(|a, b| a.distance.total_cmp(&b.distance));
        Ok(nearest.map(|nearest| self.with_confirmation(nearest, proceed)))
    }

    /// The margin, confirmed where the equilibrium on a mesh twice as fine has much the same along its direction.
    fn with_confirmation(
        &self,
        margin: Margin,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Margin {
        /// Difference of the distances, as a share of the distance.
        const SAME: f64 = 0.1;
        let elements = self.solved.program.elements().count();
        let far = (1.0 + SAME) * margin.distance;
        let fine = self.equilibrium.refined(2 * elements, proceed);
        let on_fine = fine.as_ref().and_then(|fine| {
            let solved: &Solved<D, F, N> = fine.certified().ok()?;
            let fine = Search::new(fine, solved, self.support, self.settings).ok()?;
            let found = fine.boundary(&margin.direction, far, proceed);
            found.ok().flatten()
        });
        let is_same = |other: &Boundary| other.margin.distance >= (1.0 - SAME) * margin.distance;
        Margin {
            confirmed: on_fine.as_ref().is_some_and(is_same),
            ..margin
        }
    }

    /// The nearest place found from a place on the boundary of stability by going on along its normal, until the normal is
    /// the direction taken.
    fn nearest_from(
        &self,
        mut best: Boundary,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Margin, NoMargin> {
        for _ in 0..self.settings.rounds {
            let Some(normal) = best.across.filter(|_| best.margin.is_fold) else {
                break;
            };
            let towards = normal * normal.dot(&best.margin.direction).signum();
            if 1.0 - towards.dot(&best.margin.direction) < self.settings.same_way {
                break;
            }
            // The whole turn to the normal, or half of it if the whole turn leads to no nearer place.
            let mut nearer = None;
            for way in [towards, (towards + best.margin.direction).normalize()] {
                let far = best.margin.distance;
                nearer = match self.boundary(&way, far, proceed) {
                    Ok(found) => found,
                    Err(NoMargin::Lost(_)) => None,
                    Err(other) => return Err(other),
                };
                if nearer.is_some() {
                    break;
                }
            }
            match nearer {
                Some(nearer) => best = nearer,
                None => break,
            }
        }
        Ok(best.margin)
    }

    /// Directions in which the lowest eigenvalues of the second variation fall fastest, by central differences.
    fn falls(
        &self,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Vec<Vector6<f64>>, NoMargin> {
        /// Lowest eigenvalues, each of which gives a direction, a number.
        const LOWEST: usize = 2;
        let mut gradients = [Vector6::zeros(); LOWEST];
        for axis in 0..6 {
            let mut values = [[0.0; LOWEST]; 2];
            for (sign, values) in [1.0, -1.0].into_iter().zip(&mut values) {
                let direction = sign * Vector6::ith(axis, 1.0);
                let way = self.way(&direction, self.settings.difference)?;
                let continuation = way.continuation();
                let modes = continuation
                    .start(&self.solved.at, way.length(), true)
                    .and_then(|station| continuation.modes(&station, LOWEST));
                let Some(modes) = modes.filter(|modes| modes.len() == LOWEST) else {
                    return Ok(Vec::new());
                };
                *values = [0, 1].map(|i| modes[i].eigenvalue);
                if proceed().is_break() {
                    return Ok(Vec::new());
                }
            }
            for (i, gradient) in gradients.iter_mut().enumerate() {
                gradient[axis] = values[0][i] - values[1][i];
            }
        }
        let falling = gradients
            .into_iter()
            .filter(|gradient| gradient.norm() > 0.0);
        Ok(falling.map(|gradient| -gradient.normalize()).collect())
    }

    /// The place where stability is lost along a direction of norm 1.
    fn boundary(
        &self,
        direction: &Vector6<f64>,
        reach: f64,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<Boundary>, NoMargin> {
        let way = self.way(direction, reach)?;
        let continuation = way.continuation();
        let start = continuation.start(&self.solved.at, 0.0, true);
        let start = start.ok_or(NoBranch::Singular)?;
        let curve = continuation.trace(start, &mut |_| proceed());
        let length = way.length();
        let is_open = |station: &Station<F, N>| station.negative == 0 && way.family.holds(station);
        let stable = curve
            .stations
            .iter()
            .take_while(|station| is_open(station))
            .count();
        let last = curve.stations[..stable]
            .last()
            .map_or(0.0, |station| station.parameter);
        let event = curve.events.first().filter(|(state, _)| *state <= stable);
        let is_near_limit = way.family.is_near_limit(last);
        let Some((_, event)) =
            event.filter(|(_, event)| event.turn != Turn::Apex || !is_near_limit)
        else {
            let goes_on = stable == curve.stations.len();
            return match curve.end {
                End::Range | End::Stopped(()) if goes_on => Ok(None),
                _ if is_near_limit => Ok(None),
                _ => Err(NoMargin::Lost(last / length)),
            };
        };
        let distance = event.parameter / length * reach;
        let pose = way.pose_at(distance);
        let rows = continuation.multipliers_along(event);
        let across = rows.map(|rows| {
            let held = &self.solved.program.supports[self.support];
            let at = &event.station.at.point.poses[held.node];
            let (force, moment) = held.reaction(at, &rows_of(&rows, self.support));
            Vector6::from_iterator(force.iter().chain(&moment).copied()).normalize()
        });
        Ok(Some(Boundary {
            margin: Margin {
                distance,
                direction: *direction,
                is_fold: event.turn == Turn::Fold,
                position: pose.position,
                rotation: log(&pose.frame),
                confirmed: false,
            },
            across,
        }))
    }

    /// The path over a distance along a direction of norm 1, in legs that turn by less than half a turn.
    fn way(&self, direction: &Vector6<f64>, reach: f64) -> Result<Way<D, F, N>, NoMargin> {
        let (problem, settings) = (&self.equilibrium.problem, self.settings);
        let unit = problem.units().length;
        let legs = (reach * direction.fixed_rows::<3>(3).norm() / settings.leg)
            .ceil()
            .max(1.0);
        let ends = (1..=legs as usize).map(|leg| {
            let end = displaced(&self.from, direction, unit, reach * leg as f64 / legs);
            (end.position, log(&end.frame))
        });
        let poses: Vec<_> = ends.collect();
        let path = Path::poses(problem, self.support, &poses, Motion::Straight)?;
        Ok(Way {
            family: Along::new(path, Mesh::of(problem, &self.solved.program)),
            from: self.from,
            direction: *direction,
            unit,
            pace: Pace {
                longest: settings.step,
                stations: settings.states,
                events: Events::EndAtFirst,
            },
        })
    }
}

/// The path of a support along a direction of norm 1.
struct Way<D, const F: usize, const N: usize> {
    family: Along<D, F, N>,
    from: Pose,
    direction: Vector6<f64>,
    /// Unit of length U.
    unit: f64,
    pace: Pace,
}

impl<D: StripModel<F, N>, const F: usize, const N: usize> Way<D, F, N> {
    /// The support's pose at a distance along the path.
    fn pose_at(&self, far: f64) -> Pose {
        displaced(&self.from, &self.direction, self.unit, far)
    }

    /// Length of the path.
    fn length(&self) -> f64 {
        self.family.path.length()
    }

    fn continuation(&self) -> Continuation<'_, Along<D, F, N>, 6, F, N> {
        self.family.continuation(self.pace)
    }
}

/// A pose displaced by a distance along a direction, lengths in a unit.
fn displaced(from: &Pose, direction: &Vector6<f64>, unit: f64, far: f64) -> Pose {
    let [shift, turn] = [0, 3].map(|i| far * direction.fixed_rows::<3>(i).into_owned());
    Pose {
        position: from.position + unit * shift,
        frame: exp(&turn) * from.frame,
    }
}
