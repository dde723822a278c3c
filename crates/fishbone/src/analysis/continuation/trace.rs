//! A branch on one mesh: a curve, which goes on with other active edges wherever the ribs come to other edges.

use crate::analysis::family::{Along, Station};
use crate::problem::program::BeltPoint;
use stagewise::{Distance, Pace};
use std::ops::ControlFlow;

/// A place where the number of negative modes changes.
pub(super) type Crossing = stagewise::Event<BeltPoint, 8>;

/// Largest displacement of a node on a switch to other active edges, in U: beyond, the switch leads to another branch.
const SAME_SHAPE: f64 = 1e-3;

/// Why a stretch ends, for a reason of this crate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stop {
    /// The ribs have come to other edges.
    Edges,
    /// The caller asked to end.
    Interrupted,
}

/// A part of a branch on one active set of edges.
pub(super) struct Stretch {
    pub(super) family: Along,
    /// Stations in order, those of events included.
    pub(super) stations: Vec<Station>,
    /// Events in order, each with its index among the stations.
    pub(super) events: Vec<(usize, Crossing)>,
}

/// Follows a branch from a station to its end, over at most as many stations as the pace says; gives its stretches, and the
/// reason of its end.
pub(super) fn trace(
    family: &Along,
    start: Station,
    pace: Pace,
    proceed: &mut dyn FnMut(&Station) -> ControlFlow<()>,
) -> (Vec<Stretch>, stagewise::End<Stop>) {
    let mut stretches: Vec<Stretch> = Vec::new();
    let (mut family, mut start) = (family.clone(), start);
    let mut left = pace.stations;
    loop {
        let pace = Pace {
            stations: left,
            ..pace
        };
        let curve = family.continuation(pace).trace(start, &mut |station| {
            if proceed(station).is_break() {
                return ControlFlow::Break(Stop::Interrupted);
            }
            match family.holds(station) {
                true => ControlFlow::Continue(()),
                false => ControlFlow::Break(Stop::Edges),
            }
        });
        let (mut stations, mut events) = (curve.stations, curve.events);
        let mut beyond = None;
        while stations.last().is_some_and(|last| !family.holds(last)) {
            beyond = stations.pop();
        }
        events.retain(|(state, _)| *state < stations.len());
        left -= stations.len();
        let next = match (stations.last(), &beyond) {
            (Some(last), Some(beyond)) if left > 1 => switched(&family, last, beyond, pace),
            _ => None,
        };
        let end = match beyond {
            Some(_) => stagewise::End::Stopped(Stop::Edges),
            None => curve.end,
        };
        if !stations.is_empty() {
            stretches.push(Stretch {
                family: family.clone(),
                stations,
                events,
            });
        }
        match next {
            Some(next) => (family, start) = next,
            None => return (stretches, end),
        }
    }
}

/// The branch with other active edges next to its last station for which the present edges are right.
fn switched(
    family: &Along,
    last: &Station,
    beyond: &Station,
    pace: Pace,
) -> Option<(Along, Station)> {
    let mut shapes = [beyond, last].into_iter();
    shapes.find_map(|shape| {
        let other = family.with_active_sets_for(shape.parameter, &shape.at.point)?;
        let near = family.carried_over(last, &other, pace)?;
        let is_here = near.at.point.distance(&last.at.point) <= SAME_SHAPE;
        (is_here && other.holds(&near)).then_some((other, near))
    })
}
