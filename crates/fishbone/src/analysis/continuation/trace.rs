//! A branch: a curve, which goes on over leg after leg of the path, with other active edges wherever the ribs come to other
//! edges, and on another mesh wherever its own carries the shape no more.

use crate::analysis::family::{Along, Station};
use crate::equilibrium::model::StripModel;
use crate::problem::program::BeltPoint;
use stagewise::{Curve, Distance, End, Pace};
use std::ops::ControlFlow;

/// A place where the number of negative modes changes.
pub(super) type Crossing<const F: usize, const N: usize> = stagewise::Event<BeltPoint<F>, N>;

/// Largest displacement of a node on a switch to other active edges, in U: beyond, the switch leads to another branch.
const SAME_SHAPE: f64 = 1e-3;

/// Greatest number of meshes of a branch but for the first.
const MESHES: usize = 40;
/// Displacement of a node on the way to another mesh beyond which it leads to another branch, in U.
const SAME_BELT: f64 = 1e-2;

/// Why a stretch ends, for a reason of this crate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stop {
    /// The ribs have come to other edges.
    Edges,
    /// The mesh does not carry the shape.
    Mesh,
    /// The caller asked to end.
    Interrupted,
}

/// A part of a branch on one mesh with one active set of edges.
pub(super) struct Stretch<D, const F: usize, const N: usize> {
    pub(super) family: Along<D, F, N>,
    /// Whether the ribs have come to other edges at its start.
    pub(super) has_other_edges: bool,
    /// Stations in order, those of events included.
    pub(super) stations: Vec<Station<F, N>>,
    /// Events in order, each with its index among the stations.
    pub(super) events: Vec<(usize, Crossing<F, N>)>,
}

/// Follows a branch from a station to its end, over at most as many stations as the pace says; gives its stretches, and the
/// reason of its end.
pub(super) fn trace<D: StripModel<F, N>, const F: usize, const N: usize>(
    family: &Along<D, F, N>,
    start: Station<F, N>,
    pace: Pace,
    proceed: &mut dyn FnMut(&Station<F, N>) -> ControlFlow<()>,
) -> (Vec<Stretch<D, F, N>>, End<Stop>) {
    let mut stretches: Vec<Stretch<D, F, N>> = Vec::new();
    let mut meshes = Meshes {
        begun: (family.clone(), start.clone()),
        left: MESHES,
        unwatched: 1,
    };
    let (mut family, mut start) = (family.clone(), start);
    let mut has_other_edges = false;
    let mut left = pace.stations;
    loop {
        let pace = Pace {
            stations: left,
            ..pace
        };
        let (begun_on, first) = &meshes.begun;
        let is_back = !stretches.is_empty() && family.mesh == begun_on.mesh;
        let may_close = is_back && start.parameter != first.parameter;
        let mut passed = 0;
        let curve = curve_over_legs(
            &family,
            start,
            may_close.then_some(first),
            pace,
            &mut |station| {
                if proceed(station).is_break() {
                    return ControlFlow::Break(Stop::Interrupted);
                }
                if !family.holds(station) {
                    return ControlFlow::Break(Stop::Edges);
                }
                passed += 1;
                match passed > meshes.unwatched && !family.carries(station) {
                    true => ControlFlow::Break(Stop::Mesh),
                    false => ControlFlow::Continue(()),
                }
            },
        );
        let (mut stations, mut events) = (curve.stations, curve.events);
        let mut beyond = None;
        while stations.last().is_some_and(|last| !family.holds(last)) {
            beyond = stations.pop();
        }
        let is_uncarried = beyond.is_none() && curve.end == End::Stopped(Stop::Mesh);
        if is_uncarried && stations.len() > 1 {
            beyond = stations.pop();
        }
        events.retain(|(state, _)| *state < stations.len());
        let end = match beyond {
            Some(_) if !is_uncarried => End::Stopped(Stop::Edges),
            _ => curve.end,
        };
        let next = match (stations.last(), beyond) {
            (Some(last), Some(beyond)) if is_uncarried => {
                let regraded = meshes.regraded(&family, last, &beyond, pace);
                let has_event = events.last().is_some_and(|e| e.0 + 1 == stations.len());
                if regraded.is_some() && stations.len() > 1 && !has_event {
                    // The same state is the first on the other mesh.
                    stations.pop();
                }
                Some(regraded.unwrap_or_else(|| (family.clone(), beyond)))
            }
            (Some(last), Some(beyond)) => switched(&family, last, &beyond, pace),
            _ => None,
        };
        left -= stations.len();
        if !stations.is_empty() {
            stretches.push(Stretch {
                family: family.clone(),
                has_other_edges,
                stations,
                events,
            });
        }
        has_other_edges = !is_uncarried;
        match next.filter(|_| left > 1) {
            Some(next) => (family, start) = next,
            None => return (stretches, end),
        }
    }
}

/// The meshes of a branch.
struct Meshes<D, const F: usize, const N: usize> {
    /// The first station of the branch, on the mesh of the present lengths of elements.
    begun: (Along<D, F, N>, Station<F, N>),
    /// Number of changes of the mesh that may follow.
    left: usize,
    /// Stations that are passed on a mesh before it has to carry them, a number.
    unwatched: usize,
}

impl<D: StripModel<F, N>, const F: usize, const N: usize> Meshes<D, F, N> {
    /// The branch on a mesh that carries the station beyond, next to the last station that its own mesh carries; `None` where
    /// there is no such mesh, so that the branch has to go on on its own for a while.
    fn regraded(
        &mut self,
        family: &Along<D, F, N>,
        last: &Station<F, N>,
        beyond: &Station<F, N>,
        pace: Pace,
    ) -> Option<(Along<D, F, N>, Station<F, N>)> {
        /// Stations on a mesh that does not carry them before another one is tried, a number.
        const WHILE: usize = 10;
        self.left -= 1;
        let next = next_to(family, last, beyond, pace);
        self.unwatched = match (&next, self.left) {
            (_, 0) => usize::MAX,
            (Some(_), _) => 1,
            (None, _) => WHILE,
        };
        if let Some((other, _)) = &next {
            let (begun_on, first) = &self.begun;
            let begun = begun_on.on_mesh(other.mesh.clone(), first, pace);
            self.begun = begun.unwrap_or_else(|| self.begun.clone());
        }
        next
    }
}

/// The branch on a mesh that carries the station beyond, next to another station.
fn next_to<D: StripModel<F, N>, const F: usize, const N: usize>(
    family: &Along<D, F, N>,
    last: &Station<F, N>,
    beyond: &Station<F, N>,
    pace: Pace,
) -> Option<(Along<D, F, N>, Station<F, N>)> {
    let (other, start) = family.on_mesh_that_carries(beyond, last, pace)?;
    let here = family.shape_on(last, &other)?;
    let is_here = start.at.point.distance(&here) <= SAME_BELT;
    // Beside a fold the estimate by one Newton step is large on any mesh.
    let is_better = || other.carries(&start);
    (is_here && start.negative == last.negative && is_better()).then_some((other, start))
}

/// The curve of a family from a station to its end, over leg after leg of the path. The curve of a branch that began at
/// another station may be closed there.
///
/// Where two legs meet at an angle, the curve has a corner, and a step along its tangent misses the leg ahead. So the curve is
/// followed up to there, and from there along its tangent on the leg ahead, in the same sense of the parameter.
fn curve_over_legs<D: StripModel<F, N>, const F: usize, const N: usize>(
    family: &Along<D, F, N>,
    start: Station<F, N>,
    first: Option<&Station<F, N>>,
    pace: Pace,
    proceed: &mut dyn FnMut(&Station<F, N>) -> ControlFlow<Stop>,
) -> Curve<BeltPoint<F>, Stop, N> {
    let mut first = first.cloned();
    let mut whole = Curve {
        stations: vec![start],
        events: Vec::new(),
        end: End::Range,
    };
    loop {
        // The station where two legs meet is the last on one and the first on the other.
        let last = whole.stations.pop().expect("a curve has its start");
        let before = whole.stations.len();
        let pace = Pace {
            stations: pace.stations - before,
            ..pace
        };
        let (leg, ends) = family.leg(&last);
        let continuation = leg.continuation_between(ends, pace);
        let start = match family.path.is_between_legs(last.parameter) {
            true => continuation.start(&last.at, last.parameter, last.is_rising()),
            false => Some(last.clone()),
        };
        let Some(start) = start else {
            whole.stations.push(last);
            whole.end = End::Lost;
            return whole;
        };
        let curve = continuation.trace_on(start.clone(), first.as_ref(), proceed);
        first = first.or(Some(start));
        let events = curve.events.into_iter();
        let events = events.map(|(state, event)| (before + state, event));
        whole.events.extend(events);
        whole.stations.extend(curve.stations);
        whole.end = curve.end;
        let last = whole.stations.last();
        let goes_on = last.is_some_and(|last| family.path.is_between_legs(last.parameter));
        if whole.end != End::Range || !goes_on {
            return whole;
        }
    }
}

/// The branch with other active edges next to its last station for which the present edges are right.
fn switched<D: StripModel<F, N>, const F: usize, const N: usize>(
    family: &Along<D, F, N>,
    last: &Station<F, N>,
    beyond: &Station<F, N>,
    pace: Pace,
) -> Option<(Along<D, F, N>, Station<F, N>)> {
    let mut shapes = [beyond, last].into_iter();
    shapes.find_map(|shape| {
        let other = family.with_active_sets_for(shape.parameter, &shape.at.point)?;
        let near = family.carried_over(last, &other, pace)?;
        let is_here = near.at.point.distance(&last.at.point) <= SAME_SHAPE;
        (is_here && other.holds(&near)).then_some((other, near))
    })
}
