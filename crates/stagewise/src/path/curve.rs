//! A curve of stationary points: its stations, its events, its end.

use crate::interior_point::Residuals;
use crate::linear::chain::NodeVector;
use crate::linear::modes::dot;
use crate::linear::{Direction, Mode};
use crate::program::{Distance, Stationary};

/// A stationary point on a curve.
#[derive(Debug, Clone)]
pub struct Station<P, const N: usize> {
    /// Parameter of the programme.
    pub parameter: f64,
    /// The point.
    pub at: Stationary<P>,
    /// Objective at the point.
    pub objective: f64,
    /// Residuals at the point.
    pub residuals: Residuals,
    /// Number of negative eigenvalues of the second variation.
    pub negative: usize,
    /// Tangent of the curve.
    pub(super) tangent: Tangent<N>,
}

/// A direction along a curve, of length 1.
#[derive(Debug, Clone)]
pub(super) struct Tangent<const N: usize> {
    pub(super) motion: Direction<N>,
    /// Product of the metric with the motion.
    pub(super) force: Vec<NodeVector<N>>,
    pub(super) parameter: f64,
}

/// Kind of an event, where the inertia changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turn {
    /// The parameter turns back.
    Fold,
    /// Another curve crosses, or several.
    Bifurcation,
    /// The parameter turns back where another curve crosses, and the followed curve is its own mirror image.
    Apex,
}

/// A point of a curve where the second variation is singular.
#[derive(Debug, Clone)]
pub struct Event<P, const N: usize> {
    /// Kind of the event.
    pub turn: Turn,
    /// Parameter of the event.
    pub parameter: f64,
    /// The station next to the event.
    pub station: Station<P, N>,
    /// Numbers of negative eigenvalues before and after the event.
    pub negative: [usize; 2],
    /// The direction in which the second variation vanishes.
    pub mode: Mode<N>,
}

/// Reason of the end of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End<R> {
    /// The parameter has left its range.
    Range,
    /// At an event: the first one, by [`Events::EndAtFirst`], or an apex, beyond which the curve is its own mirror image.
    Event,
    /// The curve is closed.
    Closed,
    /// The largest count of stations was reached.
    Budget,
    /// Newton's method fails for steps of all lengths.
    Lost,
    /// The caller ended the curve, for a reason of its own.
    Stopped(R),
}

/// A stretch of a curve, which may have been ended for a reason `R` of the caller's.
#[derive(Debug, Clone)]
pub struct Curve<P, R, const N: usize> {
    /// Stations in order, those of events included.
    pub stations: Vec<Station<P, N>>,
    /// Events in order, each with its index among the stations.
    pub events: Vec<(usize, Event<P, N>)>,
    /// Reason of its end.
    pub end: End<R>,
}

/// Settings of a continuation. Lengths along the curve count the parameter like motion in the metric of the programme.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Longest step.
    pub longest: f64,
    /// Largest count of stations of a curve.
    pub stations: usize,
    /// Treatment of events.
    pub events: Events,
}

/// Treatment of events, where the inertia changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Events {
    /// Events are not located.
    Ignore,
    /// Every event is located.
    Find,
    /// The first event is located and ends the curve.
    EndAtFirst,
}

impl<P: Distance, const N: usize> Station<P, N> {
    /// Distance of two stations, in point and parameter alike.
    pub(super) fn distance(&self, other: &Self) -> f64 {
        let moved = self.at.point.distance(&other.at.point);
        moved.hypot(self.parameter - other.parameter)
    }
}

impl<P, const N: usize> Station<P, N> {
    /// Whether the parameter grows along the curve.
    pub fn is_rising(&self) -> bool {
        self.tangent.parameter > 0.0
    }

    /// Cosine of the angle between the tangents of two stations.
    pub(super) fn cosine(&self, other: &Self) -> f64 {
        self.tangent.dot(&other.tangent)
    }

    /// Kind of the event between this station and the next; `None` without an event.
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
