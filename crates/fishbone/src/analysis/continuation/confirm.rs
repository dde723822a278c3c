//! The confirmation of an event: on a finer mesh the branch has the same event at nearly the same place.

use super::trace::{Crossing, Stretch, trace};
use crate::analysis::family::Station;
use crate::equilibrium::model::StripModel;
use stagewise::{Distance, Pace};
use std::ops::ControlFlow;

/// Largest difference of the places of an event on two meshes, in legs of the path.
const SAME_PLACE: f64 = 0.01;
/// Largest displacement of a node between the states of an event on two meshes, in U.
const SAME_STATE: f64 = 0.02;
/// Most states of the branch on the finer mesh, a number.
const STATES: usize = 100;

/// Stations before an event from which the branch is sought on the finer mesh, a number, and how many stations lie between.
const STARTS: [usize; 2] = [4, 5];

/// Whether an event of a stretch is found again on the mesh of elements half as long.
///
/// There the branch is followed from a station before the event that is farther from it than the event on the finer mesh may
/// be, up to the event or past it. Events that the bounds of single elements make, where ribs turn over, lie elsewhere on
/// every mesh.
pub(super) fn is_confirmed<D: StripModel<F, N>, const F: usize, const N: usize>(
    stretch: &Stretch<D, F, N>,
    state: usize,
    event: &Crossing<F, N>,
    pace: Pace,
    proceed: &mut dyn FnMut(&Station<F, N>) -> ControlFlow<()>,
) -> bool {
    let family = &stretch.family;
    let stations = &stretch.stations[..state];
    let off = |station: &Station<F, N>| station.parameter - event.parameter;
    let far = stations.iter().rev().filter(|s| off(s).abs() > SAME_PLACE);
    let far = far.step_by(STARTS[1]).take(STARTS[0]);
    let mut starts = far.chain(stations.first());
    let Some((onwards, fine, start)) = starts.find_map(|before| {
        let (fine, start) = family.on_mesh(family.mesh.halved(), before, pace)?;
        Some((-off(before).signum(), fine, start))
    }) else {
        return false;
    };
    let pace = Pace {
        stations: STATES,
        ..pace
    };
    // A branch that has turned back passes its start again.
    let window = off(&start) * onwards - SAME_PLACE..=SAME_PLACE;
    let (found, _) = trace(&fine, start, pace, &mut |station| match window
        .contains(&(off(station) * onwards))
    {
        true => proceed(station),
        false => ControlFlow::Break(()),
    });
    let Some(here) = family.shape_on(&event.station, &fine) else {
        return false;
    };
    let mut events = found.iter().flat_map(|stretch| &stretch.events);
    events.any(|(_, other)| {
        other.turn == event.turn
            && other.negative == event.negative
            && off(&other.station).abs() <= SAME_PLACE
            && other.station.at.point.distance(&here) <= SAME_STATE
    })
}
