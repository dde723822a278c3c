//! The search for a diagram: a branch is traced, then the branches that cross it at its events.

use super::{Branch, CrossingSettings, Diagram, End, Event, Kind, Origin, Snapped, State};
use crate::analysis::family::{Along, Station};
use crate::analysis::symmetry::{SAME, are_images};
use crate::equilibrium::{Status, of_solution};
use crate::problem::program::BeltPoint;
use stagewise::{Continuation, Distance, Family, Turn};
use std::ops::ControlFlow;

/// A place where the number of negative modes changes.
type Crossing = stagewise::Event<BeltPoint, 8>;
/// A curve of equilibria that may have been interrupted.
type Curve = stagewise::Curve<BeltPoint, (), 8>;

/// Traces a branch from a station, and the branches off it, into an empty diagram.
pub(super) fn run(
    family: &Along,
    continuation: Continuation<'_, Along, 6, 2, 8>,
    diagram: Diagram,
    start: Station,
    proceed: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
) -> Diagram {
    let mut search = Search {
        family,
        continuation,
        proceed,
        diagram,
    };
    search.trace(None, start);
    search.diagram
}

/// A diagram in the making.
struct Search<'a, 'b> {
    family: &'a Along,
    continuation: Continuation<'a, Along, 6, 2, 8>,
    proceed: &'b mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    diagram: Diagram,
}

impl Search<'_, '_> {
    /// Traces a branch, then the branches off it.
    fn trace(&mut self, origin: Option<Origin>, start: Station) {
        let index = self.diagram.branches.len();
        let curve = self
            .continuation
            .trace(start, &mut |place| (self.proceed)(index, place));
        let (
            Curve {
                stations, events, ..
            },
            end,
        ) = self.settled(curve);
        if stations.is_empty() {
            return;
        }
        self.diagram.branches.push(Branch {
            origin,
            states: stations.iter().map(State::of).collect(),
            events: Vec::new(),
            end,
        });
        for (state, event) in events {
            if end == End::Interrupted {
                return;
            }
            let crossing = self.crossing(&event, &stations[..state]);
            let onwards = (event.parameter - stations[state - 1].parameter).signum();
            let is_loss = event.negative[0] == 0 && event.negative[1] > 0;
            let snapped = is_loss
                .then(|| self.snapped(&event, &crossing, onwards))
                .flatten();
            let events = &mut self.diagram.branches[index].events;
            let origin = Origin {
                branch: index,
                event: events.len(),
            };
            events.push(Event {
                kind: kind(&event, &crossing),
                state,
                place: event.parameter,
                negative_modes: event.negative,
                snapped,
            });
            for side in self.different(crossing) {
                let is_known = self.is_known(&side);
                if is_known || self.diagram.branches.len() >= self.diagram.settings.branches {
                    continue;
                }
                for rising in self.ways(&event, &side) {
                    let start = self.continuation.start(&side.at, side.parameter, rising);
                    if let Some(start) = start {
                        self.trace(Some(origin), start);
                    }
                }
            }
        }
    }

    /// A curve up to the first station for which the active edges are wrong, with the reason of its end.
    fn settled(&self, mut curve: Curve) -> (Curve, End) {
        let mut end = End::from(curve.end);
        let is_unsettled = |station: &Station| !self.family.holds(station);
        if let Some(first) = curve.stations.iter().position(is_unsettled) {
            curve.stations.truncate(first);
            curve.events.retain(|(state, _)| *state < first);
            end = End::Edges;
        }
        let reached = curve.stations.last().map(|station| station.parameter);
        let is_open = matches!(end, End::Event | End::Lost);
        if is_open && reached.is_some_and(|place| self.family.is_near_limit(place)) {
            // Through the flat belt the branch would go over into its mirror image.
            curve.events.retain(|(_, event)| event.turn != Turn::Apex);
            end = End::Taut;
        }
        (curve, end)
    }

    /// The stations of other branches that cross at an event, a little before it or beyond.
    ///
    /// From beside the event a load along the vanishing mode leads over to these branches.
    fn crossing(&mut self, event: &Crossing, before: &[Station]) -> Vec<Station> {
        let settings = self.diagram.settings.crossings;
        match event.turn {
            Turn::Fold => return Vec::new(),
            // A modal load leads to the crossing branch from a station at some distance from the event.
            Turn::Apex => {
                let mut found = settings.before.into_iter().map(|far| {
                    let before = before_by(far, event, before);
                    let others = self.beyond_modal_load(before, &event.mode);
                    let is_other = |other: &Station| other.negative != before.negative;
                    let others = others.into_iter().flatten().flatten().filter(is_other);
                    others.collect::<Vec<_>>()
                });
                return found.find(|others| !others.is_empty()).unwrap_or_default();
            }
            Turn::Bifurcation => (),
        }
        for by in settings.beside {
            let mut found = Vec::new();
            for by in [by, -by] {
                let Some(beside) = self.continuation.beside(event, by) else {
                    continue;
                };
                let others = self.beyond_modal_load(&beside, &event.mode);
                let near =
                    |other: &Station| other.at.point.distance(&beside.at.point) < settings.near;
                found.extend(others.into_iter().flatten().flatten().filter(near));
            }
            if !found.is_empty() {
                return found;
            }
        }
        Vec::new()
    }

    /// The stations on other branches that are reached from a station, at its place, by a load along a mode and against it.
    fn beyond_modal_load(
        &mut self,
        from: &Station,
        mode: &stagewise::Mode<8>,
    ) -> Option<[Option<Station>; 2]> {
        let Self {
            family,
            continuation,
            proceed,
            diagram,
        } = self;
        let branch = diagram.branches.len();
        let program = family.at(from.parameter)?;
        let tolerance = family.path.base().tolerance();
        let mut beyond = |forth| {
            let ask = &mut |_| proceed(branch, from.parameter);
            let at = stagewise::over_modal_load(&program, tolerance, &from.at, mode, forth, ask)?;
            continuation.start(&at, from.parameter, true)
        };
        Some([beyond(true), beyond(false)])
    }

    /// Directions in which to follow a branch from a station beside an event, as whether the parameter grows: away from the
    /// crossing; both ways at an apex, where the other branch goes straight through.
    fn ways(&self, event: &Crossing, side: &Station) -> Vec<bool> {
        let away = side.parameter > event.parameter;
        match event.turn {
            Turn::Apex => vec![true, false],
            Turn::Fold | Turn::Bifurcation => vec![away],
        }
    }

    /// Whether one of the branches passes through a station, by straight lines between their states.
    fn is_known(&self, station: &Station) -> bool {
        let settings = &self.diagram.settings.crossings;
        self.diagram.branches.iter().any(|branch| {
            let mut pairs = branch.states.windows(2);
            pairs.any(|pair| lies_between(station, [&pair[0], &pair[1]], settings))
        })
    }

    /// The stations without duplicates: of two mirror images only the one that bulges more along `solver.bulge` is kept.
    fn different(&self, stations: Vec<Station>) -> Vec<Station> {
        let bulge = self.diagram.path.base().bulge();
        let reach = |station: &Station| {
            let poses = station.at.point.poses.iter();
            let reach = poses.map(|pose| pose.position.dot(&bulge));
            reach.fold(f64::NEG_INFINITY, f64::max)
        };
        let mut different: Vec<Station> = Vec::new();
        for station in stations {
            let is_image = |other: &&mut Station| {
                are_images(&other.at.point.poses, &station.at.point.poses, SAME)
            };
            match different.iter_mut().find(is_image) {
                Some(image) if reach(&station) > reach(image) => *image = station,
                Some(_) => (),
                None => different.push(station),
            }
        }
        different
    }

    /// The minimum to which a belt led on past an event snaps.
    fn snapped(&mut self, event: &Crossing, crossing: &[Station], onwards: f64) -> Option<Snapped> {
        let place = event.parameter + self.diagram.settings.crossings.past * onwards;
        let beyond = |station: &&Station| {
            station.negative == 0 && (station.parameter - event.parameter) * onwards > 0.0
        };
        let from = crossing.iter().find(beyond).unwrap_or(&event.station);
        let proceed = &mut || (self.proceed)(0, place);
        let found = self
            .continuation
            .descend(from, &event.mode, place, proceed)?;
        let (problem, program) = self.family.meshed(place)?;
        let equilibrium = of_solution(&problem, program, found);
        let is_converged = equilibrium.status == Status::Converged;
        is_converged.then_some(Snapped { place, equilibrium })
    }
}

/// The last station at a distance of at least `far` before an event, else the first.
fn before_by<'a>(far: f64, event: &Crossing, stations: &'a [Station]) -> &'a Station {
    let is_before = |station: &&Station| (station.parameter - event.parameter).abs() >= far;
    stations
        .iter()
        .rev()
        .find(is_before)
        .unwrap_or(&stations[0])
}

/// The kind of an event, by the places of the crossing branches.
fn kind(event: &Crossing, crossing: &[Station]) -> Kind {
    let beyond = |station: &&Station| station.parameter > event.parameter;
    match (event.turn, crossing.iter().filter(beyond).count()) {
        (Turn::Fold, _) => Kind::Fold,
        (Turn::Apex | Turn::Bifurcation, _) if crossing.is_empty() => Kind::Bifurcation,
        (Turn::Apex, _) => Kind::Pitchfork,
        (Turn::Bifurcation, 1) if crossing.len() == 2 => Kind::Transcritical,
        (Turn::Bifurcation, _) => Kind::Pitchfork,
    }
}

/// Whether a station lies between two states of a branch.
fn lies_between(station: &Station, [a, b]: [&State; 2], settings: &CrossingSettings) -> bool {
    let share = (station.parameter - a.place) / (b.place - a.place);
    let point = |state: &State| {
        state
            .at
            .point
            .poses
            .iter()
            .map(|pose| pose.position)
            .collect::<Vec<_>>()
    };
    (0.0..=1.0).contains(&share) && {
        let between = point(a)
            .into_iter()
            .zip(point(b))
            .zip(&station.at.point.poses);
        let off = between.map(|((a, b), pose)| (pose.position - a.lerp(&b, share)).norm());
        let sag = settings.sag * a.at.point.distance(&b.at.point);
        off.fold(0.0, f64::max) < settings.on_branch + sag
    }
}
