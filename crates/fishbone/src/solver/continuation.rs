//! Pseudo-arclength continuation: the curve of stationary points, minima or not, of a family of programmes.
//!
//! Every step goes along the tangent and is corrected by Newton's method square to it, so that the curve may turn back in the
//! parameter. Where the inertia of the second variation changes, the place is found: a fold, where the parameter turns back,
//! or a bifurcation, where another curve crosses.
//!
//! Source of the method: H. B. Keller, "Numerical solution of bifurcation and nonlinear eigenvalue problems" (1977).

mod event;
mod kink;

use super::chain::NodeVector;
use super::kkt::KktVector;
use super::modes::{lowest_modes_of, moved};
use super::{BOUNDS, Kkt, Program, Residuals, Rows, Settings, Shape, Stationary};
use super::{Mode, Solution};
use super::{assess, larger, minimise};
use std::ops::ControlFlow;

/// Programmes by one parameter.
pub trait Family {
    /// What they are.
    type Program: Program;

    /// The programme at a value of the parameter; `None` where there is none.
    fn at(&self, parameter: f64) -> Option<Self::Program>;
}

/// A stationary point on a curve.
#[derive(Debug, Clone)]
pub struct Station<X> {
    /// Parameter of its programme.
    pub parameter: f64,
    /// The point.
    pub at: Stationary<X>,
    /// Objective there.
    pub objective: f64,
    /// Residuals there.
    pub residuals: Residuals,
    /// Number of negative eigenvalues of the second variation.
    pub negative: usize,
    /// Which way the curve goes on.
    tangent: Tangent,
}

/// A direction along a curve, of length 1.
#[derive(Debug, Clone)]
struct Tangent {
    motion: KktVector,
    /// The metric's pull on it.
    pull: Vec<NodeVector>,
    parameter: f64,
}

/// What happens where the inertia changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turn {
    /// The parameter turns back.
    Fold,
    /// Another curve crosses, or several.
    Bifurcation,
    /// The parameter turns back where another curve crosses, and this one is its own mirror image.
    Apex,
}

/// A place on a curve where the second variation is singular.
#[derive(Debug, Clone)]
pub struct Event<X> {
    /// What happens.
    pub turn: Turn,
    /// Parameter at the place.
    pub parameter: f64,
    /// The station next to the place.
    pub station: Station<X>,
    /// Negative eigenvalues before and after.
    pub negative: [usize; 2],
    /// The direction in which the second variation vanishes.
    pub mode: Mode,
}

/// Why a curve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The parameter has left its range.
    Range,
    /// At an event: the first, as asked, or one beyond which it would be its own mirror image.
    Event,
    /// The curve has come back to where it began.
    Closed,
    /// All stations that were allowed are used up.
    Budget,
    /// No step, however short, leads on.
    Lost,
    /// Ribs reach edges beside a bend that held none before, or leave those that held them.
    Edges,
    /// The belt is drawn straight.
    Taut,
    /// The caller asked to end.
    Interrupted,
}

/// A stretch of a curve.
#[derive(Debug, Clone)]
pub struct Curve<X> {
    /// Its stations in order; the events are among them.
    pub stations: Vec<Station<X>>,
    /// Its events in order, each with its place among the stations.
    pub events: Vec<(usize, Event<X>)>,
    /// Why it ended.
    pub end: End,
}

/// Settings of a continuation. Lengths along the curve count the parameter like motion in the metric of the programme.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Longest step.
    pub longest: f64,
    /// Most stations of a curve.
    pub stations: usize,
    /// What to do about events.
    pub events: Events,
}

/// What to do where the inertia changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Events {
    /// Go on without looking.
    Ignore,
    /// Find the place.
    Find,
    /// Find the first place, and end there.
    EndAtFirst,
}

/// Follows the stationary points of a family.
pub struct Continuation<'a, F: Family> {
    family: &'a F,
    tolerance: f64,
    /// What slack times multiplier may be, in multiples of the tolerance.
    softness: f64,
    range: [f64; 2],
    pace: Pace,
}

type PointOf<F> = <<F as Family>::Program as Program>::Point;

/// A shorter step is none.
const SHORTEST: f64 = 1e-7;

impl<'a, F: Family> Continuation<'a, F>
where
    PointOf<F>: Shape,
{
    /// Over a range of the parameter.
    pub fn new(family: &'a F, tolerance: f64, range: [f64; 2], pace: Pace) -> Self {
        Self {
            family,
            tolerance,
            softness: 1.0,
            range,
            pace,
        }
    }

    /// The station at a solution of the programme at a parameter, heading for larger ones, or for smaller.
    pub fn start(
        &self,
        at: &Stationary<PointOf<F>>,
        parameter: f64,
        rising: bool,
    ) -> Option<Station<PointOf<F>>> {
        let mut at = at.clone();
        let arrival = self.correct(&mut at, parameter, None)?;
        let mut station = self.station(at, arrival, None)?;
        if (station.tangent.parameter > 0.0) != rising {
            station.tangent.turn_round();
        }
        Some(station)
    }

    /// Follows the curve from a station to the end of the range or of the budget. `proceed` is asked once a step whether to
    /// go on.
    pub fn trace(
        &self,
        start: Station<PointOf<F>>,
        proceed: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Curve<PointOf<F>> {
        let mut curve = Curve {
            stations: vec![start],
            events: Vec::new(),
            end: End::Budget,
        };
        let mut length = 0.2 * self.pace.longest;
        while curve.stations.len() < self.pace.stations {
            let last = curve.stations.last().expect("it began with one");
            if proceed(last.parameter).is_break() {
                curve.end = End::Interrupted;
                break;
            }
            let step = self.advance(last, &mut length);
            let Some(step) = step.or_else(|| self.round_kink(last, &mut length)) else {
                curve.end = End::Lost;
                break;
            };
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
            if step.arrived {
                curve.end = End::Range;
                break;
            }
            if self.is_closed(&curve.stations) {
                curve.end = End::Closed;
                break;
            }
        }
        curve
    }

    /// The station of the curve that is followed, at a place a little before an event or beyond it.
    pub fn beside(&self, event: &Event<PointOf<F>>, by: f64) -> Option<Station<PointOf<F>>> {
        let mut at = event.station.at.clone();
        let arrival = self.correct(&mut at, event.parameter + by, None)?;
        self.station(at, arrival, None)
    }

    /// How the constraints' multipliers change along the mode of an event.
    pub fn multipliers_along(&self, event: &Event<PointOf<F>>) -> Option<Vec<Rows>> {
        let program = self.family.at(event.station.parameter)?;
        let mut kkt = Kkt::factorise_any(&program, &mut event.station.at.clone()).ok()?;
        let mut push = kkt.zero();
        push.nodes = event.mode.pull.iter().map(|pull| -pull).collect();
        // Next to the event hardly anything resists along the mode: the answer is a large multiple of it.
        let answer = kkt.solve_nearly(&push).ok()?;
        let multiple = dot(&event.mode.pull, &answer.nodes);
        Some(
            answer
                .constraints
                .iter()
                .map(|rows| rows / multiple)
                .collect(),
        )
    }

    /// The minimum downhill from a station, at another value of the parameter; where it is a saddle, off along a mode.
    pub fn descend(
        &self,
        from: &Station<PointOf<F>>,
        mode: &Mode,
        parameter: f64,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Solution<PointOf<F>>> {
        const NEAR: f64 = 1e-5;
        const ITERATIONS: usize = 300;
        const OFF: f64 = 1e-3;
        let settings = Settings {
            tolerance: self.tolerance,
            iterations: ITERATIONS,
            barrier: NEAR,
        };
        let program = self.family.at(parameter)?;
        let mut found = minimise(&program, &settings, from.at.point.clone(), proceed);
        for off in [OFF, -OFF, 10.0 * OFF] {
            if found.is_minimum() {
                break;
            }
            let off = moved(&program, &from.at.point, mode, off);
            found = minimise(&program, &settings, off, proceed);
        }
        found.is_minimum().then_some(found)
    }

    /// The next station, and what lies between; the length of the step is adapted.
    fn advance(&self, last: &Station<PointOf<F>>, length: &mut f64) -> Option<Step<PointOf<F>>> {
        const LONGER: f64 = 1.5;
        /// Cosine of the sharpest turn within a step.
        const SHARPEST: f64 = 0.9;
        loop {
            let step = self.step(last, &last.tangent, *length);
            let shortest = *length < 2.0 * SHORTEST && self.softness == 1.0;
            let taken = step.filter(|next| {
                let straight = last.cosine(next) > SHARPEST;
                let apart = self.pace.events == Events::Ignore
                    || last.negative.abs_diff(next.negative) <= 1;
                shortest || (straight && apart)
            });
            let Some(next) = taken else {
                *length *= 0.5;
                if *length < SHORTEST {
                    return None;
                }
                continue;
            };
            let event = match self.pace.events {
                Events::Ignore => None,
                Events::Find | Events::EndAtFirst => self.event_between(last, &next, *length),
            };
            let [low, high] = self.range;
            if next.parameter < low || next.parameter > high {
                let inside = event.filter(|event| (low..=high).contains(&event.station.parameter));
                let from = inside.as_ref().map_or(last, |event| &event.station);
                let end = next.parameter.clamp(low, high);
                let station = self.land(from, &next, end)?;
                return Some(Step {
                    station,
                    event: inside,
                    arrived: true,
                });
            }
            *length = (LONGER * *length).min(self.pace.longest);
            return Some(Step {
                station: next,
                event,
                arrived: false,
            });
        }
    }

    /// The station between two where the parameter has a value.
    fn land(
        &self,
        from: &Station<PointOf<F>>,
        to: &Station<PointOf<F>>,
        parameter: f64,
    ) -> Option<Station<PointOf<F>>> {
        let share = (parameter - from.parameter) / (to.parameter - from.parameter);
        // A curve that begins there goes on to another such station.
        let begins_there = from.parameter == parameter;
        let nearer = if share < 0.5 && !begins_there {
            from
        } else {
            to
        };
        let mut at = nearer.at.clone();
        let arrival = self.correct(&mut at, parameter, None)?;
        self.station(at, arrival, Some(&to.tangent))
    }

    /// The lowest modes at a station.
    pub fn modes(&self, station: &Station<PointOf<F>>, count: usize) -> Option<Vec<Mode>> {
        let program = self.family.at(station.parameter)?;
        let kkt = Kkt::factorise_any(&program, &mut station.at.clone()).ok()?;
        lowest_modes_of(kkt, count).ok()
    }

    /// The station so far along a direction from another.
    fn step(
        &self,
        from: &Station<PointOf<F>>,
        along: &Tangent,
        length: f64,
    ) -> Option<Station<PointOf<F>>> {
        let mut at = from.at.clone();
        let arrival = self.correct(&mut at, from.parameter, Some((along, length)))?;
        self.station(at, arrival, Some(along))
    }

    /// Newton's method at a fixed parameter or, with a direction given, so far along that and at most so far aside, lest it end
    /// on another curve.
    fn correct(
        &self,
        at: &mut Stationary<PointOf<F>>,
        mut parameter: f64,
        along: Option<(&Tangent, f64)>,
    ) -> Option<Arrival> {
        const MOST: usize = 20;
        const ROUNDING: f64 = 1e-6;
        const BY_SOFTNESS: f64 = 0.02;
        let mut left = along.map_or(0.0, |(_, length)| length);
        let mut aside = 0.0;
        for _ in 0..MOST {
            let program = self.family.at(parameter)?;
            let mut kkt = Kkt::factorise_any(&program, at).ok()?;
            let barrier = self.barrier(&program);
            let missed = kkt.conditions(&at.bound_multipliers, barrier);
            let residuals = kkt.residuals(&missed, &at.bound_multipliers);
            let is_met = larger(residuals.stationarity, residuals.constraint) <= self.tolerance
                && kkt.is_centred(&at.bound_multipliers, barrier);
            if is_met && left == 0.0 {
                return Some(Arrival {
                    kkt,
                    parameter,
                    residuals,
                });
            }
            let mut step = kkt.solve_nearly(&missed).ok()?;
            let mut moved = 0.0;
            let mut drift = None;
            if let Some((along, length)) = along {
                let by_parameter = self.by_parameter(at, parameter)?;
                let answer = kkt.solve_nearly(&by_parameter).ok()?;
                moved = (left - dot(&along.pull, &step.nodes))
                    / (along.parameter + dot(&along.pull, &answer.nodes));
                if !moved.is_finite() {
                    return None;
                }
                step.add(moved, &answer);
                drift = Some(by_parameter);
                let way = dot(&kkt.pull_by_slacks(&step.nodes), &step.nodes) + moved * moved;
                aside += (way - left * left).max(0.0).sqrt();
                let widest = if length == 0.0 {
                    BY_SOFTNESS
                } else {
                    length.abs().max(ROUNDING)
                };
                if aside > widest {
                    return None;
                }
            }
            let drift = |stage: usize, bound: usize| {
                moved * drift.as_ref().map_or(0.0, |by| by.bounds[stage][bound])
            };
            let taken = move_along(&program, &kkt, at, &step, drift);
            parameter += taken * moved;
            left *= 1.0 - taken;
        }
        None
    }

    /// The station where Newton's method has arrived.
    fn station(
        &self,
        at: Stationary<PointOf<F>>,
        mut arrival: Arrival,
        before: Option<&Tangent>,
    ) -> Option<Station<PointOf<F>>> {
        let parameter = arrival.parameter;
        let by_parameter = self.by_parameter(&at, parameter)?;
        let negative = arrival.kkt.negative();
        let motion = arrival.kkt.solve_nearly(&by_parameter).ok()?;
        let mut tangent = Tangent {
            pull: arrival.kkt.pull_by_slacks(&motion.nodes),
            motion,
            parameter: 1.0,
        };
        tangent.scale(tangent.dot(&tangent).sqrt().recip());
        if before.is_some_and(|before| tangent.dot(before) < 0.0) {
            tangent.turn_round();
        }
        Some(Station {
            parameter,
            at,
            objective: arrival.kkt.values().objective,
            residuals: arrival.residuals,
            negative,
            tangent,
        })
    }

    /// Derivative of the first-order conditions by the parameter, by central differences; one-sided at the end of what the
    /// family knows.
    fn by_parameter(&self, at: &Stationary<PointOf<F>>, parameter: f64) -> Option<KktVector> {
        let h = 1e-5;
        let conditions = |parameter: f64| {
            let program = self.family.at(parameter)?;
            Kkt::conditions_of(&program, at)
        };
        let (mut high, low, width) = match (conditions(parameter + h), conditions(parameter - h)) {
            (Some(high), Some(low)) => (high, low, 2.0 * h),
            (Some(high), None) => (high, conditions(parameter)?, h),
            (None, Some(low)) => (conditions(parameter)?, low, h),
            (None, None) => return None,
        };
        high.add(-1.0, &low);
        high.scale(width.recip());
        Some(high)
    }

    /// Half of what complementarity may be.
    fn barrier(&self, program: &F::Program) -> f64 {
        let heaviest = program.weights().into_iter().fold(0.0, f64::max);
        0.5 * self.softness * self.tolerance / heaviest
    }

    /// Whether the last of the stations is where the first was, some way on.
    fn is_closed(&self, stations: &[Station<PointOf<F>>]) -> bool {
        const SOME_WAY: usize = 10;
        const SAME: f64 = 1e-6;
        let [first, .., last] = stations else {
            return false;
        };
        let objective = (first.objective - last.objective).abs();
        let parameter = (first.parameter - last.parameter).abs();
        stations.len() > SOME_WAY && parameter <= SAME && objective <= SAME * first.objective.abs()
    }
}

/// A single programme is a family too.
struct Alone<'a, P>(&'a P);

impl<'a, P: Program> Family for Alone<'a, P> {
    type Program = &'a P;

    fn at(&self, _: f64) -> Option<&'a P> {
        Some(self.0)
    }
}

/// The stationary point, minimum or not, that Newton's method finds next to a point.
pub fn settle<P: Program>(
    program: &P,
    tolerance: f64,
    mut near: Stationary<P::Point>,
) -> Option<Solution<P::Point>>
where
    P::Point: Shape,
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

/// A step of a continuation.
struct Step<X> {
    station: Station<X>,
    event: Option<Event<X>>,
    arrived: bool,
}

/// Where Newton's method has converged, factorised there.
struct Arrival {
    kkt: Kkt,
    parameter: f64,
    residuals: Residuals,
}

impl<X> Station<X> {
    /// Cosine of the angle between the curve here and there.
    fn cosine(&self, other: &Self) -> f64 {
        self.tangent.dot(&other.tangent)
    }

    /// What happens on the way to the next station, if anything does.
    fn turn_before(&self, next: &Self) -> Option<Turn> {
        let turns_back = (self.tangent.parameter < 0.0) != (next.tangent.parameter < 0.0);
        match (turns_back, self.negative.abs_diff(next.negative)) {
            (false, 0) => None,
            (true, 0) => Some(Turn::Apex),
            (true, 1) => Some(Turn::Fold),
            _ => Some(Turn::Bifurcation),
        }
    }
}

impl Tangent {
    fn scale(&mut self, by: f64) {
        self.motion.scale(by);
        self.pull.iter_mut().for_each(|node| *node *= by);
        self.parameter *= by;
    }

    fn dot(&self, other: &Self) -> f64 {
        dot(&self.pull, &other.motion.nodes) + self.parameter * other.parameter
    }

    fn turn_round(&mut self) {
        self.scale(-1.0);
    }
}

/// Moves a point and its multipliers along a step, as far as slacks and multipliers stay positive, and says which share of it
/// that was. `drift` is what the programme's own change adds to a slack along the whole step.
fn move_along<P: Program>(
    program: &P,
    kkt: &Kkt,
    at: &mut Stationary<P::Point>,
    step: &KktVector,
    drift: impl Fn(usize, usize) -> f64,
) -> f64 {
    const KEEP: f64 = 0.995;
    let slacks = &kkt.values().slacks;
    let used = program.bounds();
    let mut rates = vec![[0.0; BOUNDS]; slacks.len()];
    let mut primal = 1.0;
    for (k, rates) in rates.iter_mut().enumerate() {
        for (b, rate) in rates.iter_mut().enumerate().take(used) {
            *rate = kkt.slack_rate(k, b, &step.nodes) + drift(k, b);
            if *rate * primal < -KEEP * slacks[k][b] {
                primal = -KEEP * slacks[k][b] / *rate;
            }
        }
    }
    let mut moved = at.point.clone();
    program.retract(&at.point, &step.nodes, primal, &mut moved);
    at.point = moved;
    for (rows, step) in at.multipliers.iter_mut().zip(&step.constraints) {
        *rows += primal * step;
    }
    for (k, multipliers) in at.bound_multipliers.iter_mut().enumerate() {
        for (b, multiplier) in multipliers.iter_mut().enumerate().take(used) {
            let next = *multiplier - primal * step.bounds[k][b];
            // That of a bound which lets go falls as the slack grows, and holds up no other.
            let let_go = *multiplier * slacks[k][b] / (slacks[k][b] + primal * rates[k][b]);
            let goes_on = next > (1.0 - KEEP) * *multiplier;
            *multiplier = if goes_on { next } else { let_go };
        }
    }
    primal
}

fn dot(a: &[NodeVector], b: &[NodeVector]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}
