//! A curve of stationary points: its stations, its events, its end.

use crate::interior_point::Residuals;
use crate::linear::chain::NodeVector;
use crate::linear::modes::dot;
use crate::linear::{Direction, Mode};
use crate::program::Stationary;

/// A stationary point on a curve.
#[derive(Debug, Clone)]
pub struct Station<P, const N: usize> {
    /// Parameter of its programme.
    pub parameter: f64,
    /// The point.
    pub at: Stationary<P>,
    /// Objective there.
    pub objective: f64,
    /// Residuals there.
    pub residuals: Residuals,
    /// Number of negative eigenvalues of the second variation.
    pub negative: usize,
    /// The direction in which the curve goes on.
    pub(super) tangent: Tangent<N>,
}

/// A direction along a curve, of length 1.
#[derive(Debug, Clone)]
pub(super) struct Tangent<const N: usize> {
    pub(super) motion: Direction<N>,
    /// The metric's force on it.
    pub(super) force: Vec<NodeVector<N>>,
    pub(super) parameter: f64,
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
pub struct Event<P, const N: usize> {
    /// What happens.
    pub turn: Turn,
    /// Parameter at the place.
    pub parameter: f64,
    /// The station next to the place.
    pub station: Station<P, N>,
    /// Negative eigenvalues before and after.
    pub negative: [usize; 2],
    /// The direction in which the second variation vanishes.
    pub mode: Mode<N>,
}

/// Why a curve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End<R> {
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
    /// The caller asked to end, for a reason of its own.
    Stopped(R),
}

/// A stretch of a curve, which may have been ended for a reason `R` of the caller's.
#[derive(Debug, Clone)]
pub struct Curve<P, R, const N: usize> {
    /// Its stations in order; the events are among them.
    pub stations: Vec<Station<P, N>>,
    /// Its events in order, each with its place among the stations.
    pub events: Vec<(usize, Event<P, N>)>,
    /// Why it ended.
    pub end: End<R>,
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

impl<P, const N: usize> Station<P, N> {
    /// Cosine of the angle between the curve here and there.
    pub(super) fn cosine(&self, other: &Self) -> f64 {
        self.tangent.dot(&other.tangent)
    }

    /// What happens on the way to the next station, if anything does.
    pub(super) fn turn_before(&self, next: &Self) -> Option<Turn> {
        let turns_back = (self.tangent.parameter < 0.0) != (next.tangent.parameter < 0.0);
        match (turns_back, self.negative.abs_diff(next.negative)) {
            (false, 0) => None,
            (true, 0) => Some(Turn::Apex),
            (true, 1) => Some(Turn::Fold),
            _ => Some(Turn::Bifurcation),
        }
    }
}

impl<const N: usize> Tangent<N> {
    pub(super) fn scale(&mut self, by: f64) {
        self.motion.scale(by);
        self.force.iter_mut().for_each(|node| *node *= by);
        self.parameter *= by;
    }

    pub(super) fn dot(&self, other: &Self) -> f64 {
        dot(&self.force, &other.motion.nodes) + self.parameter * other.parameter
    }

    pub(super) fn turn_round(&mut self) {
        self.scale(-1.0);
    }
}
