//! Pseudo-arclength continuation: the curve of stationary points, minima or not, of a family of programmes.
//!
//! Every step goes along the tangent and is corrected by Newton's method orthogonal to the tangent, so that the curve may
//! turn back in the parameter. Where the inertia of the second variation changes, the event is located: a fold, where the
//! parameter turns back, or a bifurcation, where another curve crosses.
//!
//! Source of the method: H. B. Keller, "Numerical solution of bifurcation and nonlinear eigenvalue problems" (1977).

use super::curve::{Curve, End, Event, Events, Pace, Station, Turn};
use super::descent::descend;
use super::family::{Alone, Family};
use crate::interior_point::{Solution, assess};
use crate::linear::modes::dot;
use crate::linear::{Mode, Response, lowest_modes, moved};
use crate::program::{Distance, Program, Stationary, Values};
use std::ops::ControlFlow;

/// Follows the stationary points of a family.
pub struct Continuation<'a, F, const X: usize, const U: usize, const N: usize> {
    pub(super) family: &'a F,
    pub(super) tolerance: f64,
    /// Softness of the inequalities: ratio of slack times multiplier to the tolerance.
    pub(super) softness: f64,
    pub(super) range: [f64; 2],
    pub(super) pace: Pace,
    /// Unit of distance.
    pub(super) unit: f64,
}

/// Length of the shortest step along a curve; in [`Scales::distance`](crate::Scales::distance).
const SHORTEST: f64 = 1e-7;

/// A step of a continuation.
pub(super) struct Step<P, const N: usize> {
    /// Length along the tangent.
    pub(super) length: f64,
    pub(super) station: Station<P, N>,
    pub(super) event: Option<Event<P, N>>,
    pub(super) arrived: bool,
}

impl<'a, F: Family<X, U, N>, const X: usize, const U: usize, const N: usize>
    Continuation<'a, F, X, U, N>
{
    /// A continuation over a range of the parameter.
    pub fn new(family: &'a F, tolerance: f64, range: [f64; 2], pace: Pace) -> Self {
        Self {
            family,
            tolerance,
            softness: 1.0,
            range,
            pace,
            unit: family.scales().distance,
        }
    }

    /// The shortest step.
    pub(super) fn shortest(&self) -> f64 {
        SHORTEST * self.unit
    }

    /// The station at a solution of the programme at a parameter, with a tangent toward larger parameters, or smaller ones.
    pub fn start(
        &self,
        at: &Stationary<F::Point>,
        parameter: f64,
        rising: bool,
    ) -> Option<Station<F::Point, N>> {
        let mut at = at.clone();
        let arrival = self.correct(&mut at, parameter, None)?;
        let mut station = self.station(at, arrival, None)?;
        if (station.tangent.parameter > 0.0) != rising {
            station.tangent.turn_round();
        }
        Some(station)
    }

    /// As [`Self::start`], at a point close to a solution: that of a programme with other inequalities, or on other stages.
    /// A multiplier that is too small for its slack is raised.
    pub fn start_near(
        &self,
        near: &Stationary<F::Point>,
        parameter: f64,
        rising: bool,
    ) -> Option<Station<F::Point, N>> {
        let program = self.family.at(parameter)?;
        let mut at = near.clone();
        let mut values = Values::default();
        if !program.evaluate(&mut at.point, &mut values) {
            return None;
        }
        let barrier = self.barrier(&program);
        let layout = program.layout();
        let rows = values.slacks.iter().zip(layout.row_weights());
        for (multiplier, (slack, weight)) in at.multipliers.inequalities.iter_mut().zip(rows) {
            *multiplier = multiplier.max(barrier * weight / slack);
        }
        self.start(&at, parameter, rising)
    }

    /// Follows the curve from a station to the end of the range or of the budget. `proceed` is called with every station
    /// before the curve goes on from there, and ends the curve for a reason of the caller's by `Break`.
    pub fn trace<R>(
        &self,
        start: Station<F::Point, N>,
        proceed: &mut dyn FnMut(&Station<F::Point, N>) -> ControlFlow<R>,
    ) -> Curve<F::Point, R, N> {
        self.trace_on(start, None, proceed)
    }

    /// As [`Self::trace`]; a curve that goes on from another one is closed where that one began: at a first station of a
    /// family with the same programmes there.
    pub fn trace_on<R>(
        &self,
        start: Station<F::Point, N>,
        first: Option<&Station<F::Point, N>>,
        proceed: &mut dyn FnMut(&Station<F::Point, N>) -> ControlFlow<R>,
    ) -> Curve<F::Point, R, N> {
        let mut curve = Curve {
            stations: vec![start],
            events: Vec::new(),
            end: End::Budget,
        };
        let mut length = 0.2 * self.pace.longest;
        while curve.stations.len() < self.pace.stations {
            let last = curve.stations.last().expect("it began with one");
            if let ControlFlow::Break(reason) = proceed(last) {
                curve.end = End::Stopped(reason);
                break;
            }
            let step = self.advance(last, &mut length);
            let Some(mut step) = step.or_else(|| self.round_corner(last, &mut length)) else {
                curve.end = End::Lost;
                break;
            };
            let may_close = first.is_some() || curve.stations.len() > 1;
            let first = first.unwrap_or(&curve.stations[0]);
            // A curve that begins at an end of the range leaves the range where it would be closed.
            let is_inside = self.range[0] < first.parameter && first.parameter < self.range[1];
            let closing = match may_close && is_inside {
                true => self.closing(first, last, &step),
                false => None,
            };
            if let Some(length) = closing {
                step.station = first.clone();
                step.event = self.event_on(last, first, length);
            }
            if let Some(event) = step.event {
                let is_last = self.pace.events == Events::EndAtFirst || event.turn == Turn::Apex;
                curve.stations.push(event.station.clone());
                curve.events.push((curve.stations.len() - 1, event));
                if is_last {
                    curve.end = End::Event;
                    break;
                }
            }
            curve.stations.push(step.station);
            if closing.is_some() {
                curve.end = End::Closed;
                break;
            }
            if step.arrived {
                curve.end = End::Range;
                break;
            }
        }
        curve
    }

    /// The station of the curve at a parameter offset from an event.
    pub fn beside(&self, event: &Event<F::Point, N>, by: f64) -> Option<Station<F::Point, N>> {
        let mut at = event.station.at.clone();
        let arrival = self.correct(&mut at, event.parameter + by, None)?;
        self.station(at, arrival, None)
    }

    /// The change of the equalities' multipliers along the mode of an event.
    pub fn multipliers_along(&self, event: &Event<F::Point, N>) -> Option<Vec<f64>> {
        let program = self.family.at(event.station.parameter)?;
        let mut at = event.station.at.clone();
        let mut response = Response::of_stationary(&program, &mut at).ok()?;
        let mut load = response.zero();
        load.nodes = event.mode.force.iter().map(|force| -force).collect();
        // Next to the event the stiffness along the mode is small: the response is a large multiple of the mode.
        let answer = response.solve_nearly(&load).ok()?;
        let multiple = dot(&event.mode.force, &answer.nodes);
        Some(answer.equalities.iter().map(|row| row / multiple).collect())
    }

    /// The minimum downhill from a station, at another value of the parameter; from a saddle, after a perturbation along a
    /// mode.
    pub fn descend(
        &self,
        from: &Station<F::Point, N>,
        mode: &Mode<N>,
        parameter: f64,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Solution<F::Point>> {
        /// Perturbation off a saddle along a mode; in [`Scales::distance`](crate::Scales::distance).
        const PERTURBATION: f64 = 1e-3;
        let program = self.family.at(parameter)?;
        let mut found = descend(&program, self.tolerance, from.at.point.clone(), proceed);
        for off in [PERTURBATION, -PERTURBATION, 10.0 * PERTURBATION] {
            if found.is_minimum() {
                break;
            }
            let off = moved(&program, &from.at.point, mode, off * self.unit);
            found = descend(&program, self.tolerance, off, proceed);
        }
        found.is_minimum().then_some(found)
    }

    /// The lowest modes at a station.
    pub fn modes(&self, station: &Station<F::Point, N>, count: usize) -> Option<Vec<Mode<N>>> {
        let program = self.family.at(station.parameter)?;
        lowest_modes(&program, &mut station.at.clone(), count).ok()
    }

    /// The next station, and the event between the two stations; adapts the length of the step.
    pub(super) fn advance(
        &self,
        last: &Station<F::Point, N>,
        length: &mut f64,
    ) -> Option<Step<F::Point, N>> {
        /// Ratio of successive step lengths where a step was accepted; dimensionless.
        const LONGER: f64 = 1.5;
        /// Cosine of the sharpest turn of the tangent within a step; dimensionless.
        const SHARPEST: f64 = 0.9;
        loop {
            let step = self.step(last, &last.tangent, *length);
            let shortest = *length < 2.0 * self.shortest() && self.softness == 1.0;
            let taken = step.filter(|next| {
                let straight = last.cosine(next) > SHARPEST;
                let apart = self.pace.events == Events::Ignore
                    || last.negative.abs_diff(next.negative) <= 1;
                shortest || (straight && apart)
            });
            let Some(next) = taken else {
                *length *= 0.5;
                if *length < self.shortest() {
                    return None;
                }
                continue;
            };
            let event = self.event_on(last, &next, *length);
            let leaves = self.is_outside(&next);
            let turns_outside = event.as_ref().is_some_and(|e| self.is_outside(&e.station));
            if leaves || turns_outside {
                let step = self.step_to_end(last, &next, event, *length);
                if step.is_some() {
                    return step;
                }
                *length *= 0.5;
                if *length < self.shortest() {
                    return None;
                }
                continue;
            }
            let taken = *length;
            *length = (LONGER * taken).min(self.pace.longest);
            return Some(Step {
                length: taken,
                station: next,
                event,
                arrived: false,
            });
        }
    }

    /// Whether a station lies outside the range.
    fn is_outside(&self, station: &Station<F::Point, N>) -> bool {
        let [low, high] = self.range;
        !(low..=high).contains(&station.parameter)
    }

    /// The step to where a step of a length, with its event, leaves the range; the curve may turn back outside. `None` where
    /// no station is found there, or one of another curve.
    fn step_to_end(
        &self,
        last: &Station<F::Point, N>,
        next: &Station<F::Point, N>,
        event: Option<Event<F::Point, N>>,
        length: f64,
    ) -> Option<Step<F::Point, N>> {
        let [low, high] = self.range;
        let is_counted = self.pace.events != Events::Ignore
            && (event.is_some() || last.turn_before(next).is_none());
        let (inside, outside) = match event {
            Some(event) if self.is_outside(&event.station) => (None, Some(event)),
            event => (event, None),
        };
        let from = inside.as_ref().map_or(last, |event| &event.station);
        let to = outside.as_ref().map_or(next, |event| &event.station);
        let mut station = self.land(from, to, to.parameter.clamp(low, high))?;
        if station.parameter == low {
            station.tangent.turn_round();
        }
        let negative = inside.as_ref().map_or(last.negative, |e| e.negative[1]);
        let is_same = !is_counted || station.negative == negative;
        is_same.then_some(Step {
            length,
            station,
            event: inside,
            arrived: true,
        })
    }

    /// The station at a parameter between two stations, with its tangent toward larger parameters.
    fn land(
        &self,
        from: &Station<F::Point, N>,
        to: &Station<F::Point, N>,
        parameter: f64,
    ) -> Option<Station<F::Point, N>> {
        let share = (parameter - from.parameter) / (to.parameter - from.parameter);
        // A curve that begins at the parameter ends at a second station of the same parameter.
        let begins_there = from.parameter == parameter;
        let nearer = if share < 0.5 && !begins_there {
            from
        } else {
            to
        };
        let mut at = nearer.at.clone();
        let arrival = self.correct(&mut at, parameter, None)?;
        self.station(at, arrival, None)
    }

    /// Barrier parameter at half of the tolerated complementarity.
    pub(super) fn barrier(&self, program: &F::Program) -> f64 {
        let layout = program.layout();
        let weights = layout.stage_weights().iter().chain(layout.row_weights());
        let heaviest = weights.copied().fold(0.0, f64::max);
        0.5 * self.softness * self.tolerance / heaviest
    }

    /// The length at which a step from a station passes through the first station of its curve, so that the curve is closed:
    /// the nearest station on the step, found by golden sections, coincides with the first one. `None` of other steps.
    fn closing(
        &self,
        first: &Station<F::Point, N>,
        from: &Station<F::Point, N>,
        step: &Step<F::Point, N>,
    ) -> Option<f64> {
        /// Largest distance from the first station at the ends of a step that may pass it, in steps; dimensionless.
        const NEAR: f64 = 1.5;
        /// Cosine of the largest angle of the tangents there; dimensionless.
        const SAME_WAY: f64 = 0.8;
        /// Distance up to which stations coincide, in steps; dimensionless.
        const SAME: f64 = 1e-3;
        /// Count of golden sections; a number.
        const SECTIONS: usize = 20;
        let way = from.distance(&step.station);
        let may_pass = [from, &step.station]
            .into_iter()
            .all(|end| end.distance(first) <= NEAR * way && end.cosine(first) > SAME_WAY);
        if !may_pass {
            return None;
        }
        let golden = 0.5 * (5f64.sqrt() - 1.0);
        let off = |length: f64| {
            let station = self.step(from, &from.tangent, length);
            station.map_or(f64::INFINITY, |station| station.distance(first))
        };
        let [mut low, mut high] = [0.0, step.length];
        let mut inner = [1.0 - golden, golden].map(|share| share * step.length);
        let mut values = inner.map(off);
        for _ in 0..SECTIONS {
            if values[0] < values[1] {
                high = inner[1];
                inner = [high - golden * (high - low), inner[0]];
                values = [off(inner[0]), values[0]];
            } else {
                low = inner[0];
                inner = [inner[1], low + golden * (high - low)];
                values = [values[1], off(inner[1])];
            }
        }
        let nearest = usize::from(values[1] < values[0]);
        (values[nearest] <= SAME * way).then_some(inner[nearest])
    }
}

/// The stationary point, minimum or not, to which Newton's method converges from a point.
pub fn settle<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
    tolerance: f64,
    mut near: Stationary<P::Point>,
) -> Option<Solution<P::Point>>
where
    P::Point: Distance,
{
    let pace = Pace {
        longest: 1.0,
        stations: 1,
        events: Events::Ignore,
    };
    let family = Alone(program);
    let continuation = Continuation::new(&family, tolerance, [0.0, 1.0], pace);
    continuation.correct(&mut near, 0.0, None)?;
    Some(assess(program, tolerance, &near))
}
