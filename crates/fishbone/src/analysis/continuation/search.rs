//! The search for a diagram: a branch is traced, then the branches that cross it at its events.

use super::confirm::is_confirmed;
use super::known::lies_between;
use super::trace::{Crossing, Stretch, trace};
use super::{Branch, Diagram, End, Event, Kind, Origin, Snapped, State};
use crate::analysis::family::{Along, Station};
use crate::analysis::symmetry::{SAME, are_images};
use crate::equilibrium::model::{StripModel, snapped_from};
use crate::equilibrium::{Equilibrium, Solved};
use crate::problem::Mesh;
use stagewise::{Distance, Events, Family, Pace, Turn};
use std::marker::PhantomData;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Traces a branch from a station, and the branches off it, into an empty diagram.
pub(super) fn run<D: StripModel<F, N>, const F: usize, const N: usize>(
    family: &Along<D, F, N>,
    pace: Pace,
    diagram: Diagram,
    start: Station<F, N>,
    proceed: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
) -> Diagram {
    let mut search = Search::<D, F, N> {
        pace,
        proceed,
        diagram,
        model: PhantomData,
    };
    match search.diagram.settings.snaps {
        true => search.lead(family, start),
        false => {
            search.trace(None, family, start);
        }
    }
    search.diagram
}

/// A diagram in the making.
struct Search<'a, D, const F: usize, const N: usize> {
    pace: Pace,
    proceed: &'a mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    diagram: Diagram,
    model: PhantomData<D>,
}

impl<D: StripModel<F, N>, const F: usize, const N: usize> Search<'_, D, F, N> {
    /// Traces a branch, then the branches off it; gives the reason of its end.
    fn trace(
        &mut self,
        origin: Option<Origin>,
        family: &Along<D, F, N>,
        start: Station<F, N>,
    ) -> Option<End> {
        let index = self.diagram.branches.len();
        let proceed = &mut |station: &Station<F, N>| (self.proceed)(index, station.parameter);
        let (mut stretches, end) = trace(family, start, self.pace, proceed);
        let last = stretches.last_mut()?;
        let end = without_mirror_image(last, End::from(end));
        self.diagram.branches.push(Branch {
            origin,
            states: stretches.iter().flat_map(states).collect(),
            events: Vec::new(),
            end,
        });
        if end == End::Interrupted {
            return Some(end);
        }
        let mut first = 0;
        for (place, stretch) in stretches.iter().enumerate() {
            if place > 0 && stretch.has_other_edges {
                self.add_switch(index, first, stretch);
            }
            for (state, event) in &stretch.events {
                self.add_event(index, first, *state, event, stretch);
            }
            first += stretch.stations.len();
        }
        Some(end)
    }

    /// Adds the event of other active edges at the first state of a stretch.
    fn add_switch(&mut self, branch: usize, state: usize, stretch: &Stretch<D, F, N>) {
        let start = &stretch.stations[0];
        let branch = &mut self.diagram.branches[branch];
        branch.events.push(Event {
            kind: Kind::Edges,
            state,
            place: start.parameter,
            negative_modes: [branch.states[state - 1].negative_modes, start.negative],
            confirmed: true,
            snapped: None,
        });
    }

    /// Adds an event of a stretch whose first state on its branch is given, and traces the branches off it.
    fn add_event(
        &mut self,
        branch: usize,
        first: usize,
        state: usize,
        event: &Crossing<F, N>,
        stretch: &Stretch<D, F, N>,
    ) {
        let found = self.found_at(branch, state, event, stretch, None);
        let origin = Origin {
            branch,
            event: self.diagram.branches[branch].events.len(),
        };
        let is_snap = self.add_found(branch, first + state, event, &found);
        let Found {
            crossing, landed, ..
        } = found;
        // The belt passes over a fold that is smaller than a snap.
        let landed = landed.filter(|_| event.turn == Turn::Fold && !is_snap);
        let landed = landed.and_then(|landed| self.start_at(&landed, event, stretch));
        if let Some((family, start)) =
            landed.filter(|(family, start)| self.may_follow(family, start))
        {
            self.trace(Some(origin), &family, start);
        }
        for side in self.different(crossing) {
            if !self.may_follow(&stretch.family, &side) {
                continue;
            }
            for rising in self.ways(event, &side) {
                let continuation = stretch.family.continuation(self.pace);
                let start = continuation.start(&side.at, side.parameter, rising);
                let end = start.and_then(|start| self.trace(Some(origin), &stretch.family, start));
                if end == Some(End::Closed) {
                    // The other way round is the same curve.
                    break;
                }
            }
        }
    }

    /// Leads the belt along the path: its minima, and where one is lost the minimum to which the belt goes on. A branch ends
    /// where the belt snaps.
    fn lead(&mut self, family: &Along<D, F, N>, start: Station<F, N>) {
        let (mut family, mut start) = (family.clone(), start);
        let mut origin = None;
        while self.diagram.branches.len() < self.diagram.settings.branches {
            let index = self.diagram.branches.len();
            self.diagram.branches.push(Branch {
                origin,
                states: Vec::new(),
                events: Vec::new(),
                end: End::Budget,
            });
            let Some(next) = self.lead_to_snap(index, family, start) else {
                return;
            };
            (family, start) = next;
            let event = self.diagram.branches[index].events.len() - 1;
            origin = Some(Origin {
                branch: index,
                event,
            });
        }
    }

    /// Leads the belt along a branch to its end; gives the start beyond if it ends with a snap.
    fn lead_to_snap(
        &mut self,
        index: usize,
        mut family: Along<D, F, N>,
        mut start: Station<F, N>,
    ) -> Option<(Along<D, F, N>, Station<F, N>)> {
        /// Ratio of successive distances past an event that the branch comes back to, dimensionless.
        const FARTHER: f64 = 10.0;
        let (mut past, mut landing) = (self.diagram.settings.crossings.past, None);
        loop {
            let first = self.diagram.branches[index].states.len();
            let pace = Pace {
                stations: self.pace.stations.saturating_sub(first),
                events: Events::EndAtFirst,
                ..self.pace
            };
            if pace.stations < 2 {
                return None;
            }
            let proceed = &mut |station: &Station<F, N>| (self.proceed)(index, station.parameter);
            let (stretches, end) = trace(&family, start, pace, proceed);
            let mut state = first;
            for (place, stretch) in stretches.iter().enumerate() {
                let branch = &mut self.diagram.branches[index];
                branch.states.extend(states(stretch));
                branch.end = End::from(end);
                if place > 0 && stretch.has_other_edges {
                    self.add_switch(index, state, stretch);
                }
                state += stretch.stations.len();
            }
            let last = stretches.last()?;
            let (event_state, event) = last.events.last()?;
            let is_same = landing.is_some_and(|place| event.parameter <= place + past);
            past = match is_same {
                true => FARTHER * past,
                false => self.diagram.settings.crossings.past,
            };
            landing = Some(event.parameter + past);
            self.diagram.branches[index].end = End::Unstable;
            if is_same {
                let before = &last.stations[event_state.checked_sub(1)?];
                let landed = self.landed(event, &[], Some(before), past, &last.family)?;
                (family, start) = self.start_at(&landed, event, last)?;
                continue;
            }
            let found = self.found_at(index, *event_state, event, last, Some(past));
            let at = state - last.stations.len() + event_state;
            let is_snap = self.add_found(index, at, event, &found);
            let next = self.start_at(&found.landed?, event, last)?;
            if is_snap {
                return Some(next);
            }
            (family, start) = next;
        }
    }

    /// What is found at an event of a stretch. A belt that is led goes on by a distance past any event, forward on the path;
    /// else it goes on where a branch loses its stability, in the direction of the branch.
    fn found_at(
        &mut self,
        branch: usize,
        state: usize,
        event: &Crossing<F, N>,
        stretch: &Stretch<D, F, N>,
        led: Option<f64>,
    ) -> Found<F, N> {
        /// Distances past an event at which a minimum is sought, in the first one.
        const FARTHER: [f64; 3] = [1.0, 10.0, 100.0];
        let crossing = self.crossing(event, &stretch.stations[..state], &stretch.family);
        let before = state.checked_sub(1).map(|before| &stretch.stations[before]);
        let is_loss = event.negative[0] == 0 && event.negative[1] > 0;
        let past = led.unwrap_or_else(|| {
            let onwards = before.map_or(1.0, |before| event.parameter - before.parameter);
            self.diagram.settings.crossings.past * onwards.signum()
        });
        // Just past an event the second variation may be too small to tell a minimum from a saddle.
        let goes_on = is_loss || led.is_some();
        let farther = FARTHER.iter().filter(|_| goes_on);
        let landed = farther
            .map(|times| times * past)
            .find_map(|past| self.landed(event, &crossing, before, past, &stretch.family));
        let pace = self.pace;
        let ask = &mut |station: &Station<F, N>| (self.proceed)(branch, station.parameter);
        let confirmed = is_confirmed(stretch, state, event, pace, ask);
        Found {
            crossing,
            landed,
            confirmed,
        }
    }

    /// Adds an event at a state of a branch; gives whether the belt snaps there.
    fn add_found(
        &mut self,
        branch: usize,
        state: usize,
        event: &Crossing<F, N>,
        found: &Found<F, N>,
    ) -> bool {
        let is_snap = |landed: &&Snapped| {
            let (to, jump) = (&landed.equilibrium, landed.jump);
            let jump = jump / to.problem().units().length;
            to.problem()
                .is_snap(jump, landed.released, to.elastic_energy)
        };
        let snapped = found.landed.as_ref().filter(is_snap);
        self.diagram.branches[branch].events.push(Event {
            kind: kind(event, &found.crossing),
            state,
            place: event.parameter,
            negative_modes: event.negative,
            confirmed: found.confirmed,
            snapped: snapped.cloned(),
        });
        snapped.is_some()
    }

    /// The start of the branch on which the belt goes on past an event, in the direction in which it was led.
    fn start_at(
        &self,
        landed: &Snapped,
        event: &Crossing<F, N>,
        stretch: &Stretch<D, F, N>,
    ) -> Option<(Along<D, F, N>, Station<F, N>)> {
        let solved: &Solved<D, F, N> = landed.equilibrium.solved_on_mesh()?;
        let mesh = Mesh::of(landed.equilibrium.problem(), &solved.program);
        let family = stretch.family.on(mesh);
        let continuation = family.continuation(self.pace);
        let rising = landed.place > event.parameter;
        let start = continuation.start(&solved.at, landed.place, rising)?;
        Some((family, start))
    }

    /// Whether a branch from a station of a family is new and not one too many.
    fn may_follow(&self, family: &Along<D, F, N>, station: &Station<F, N>) -> bool {
        !self.is_known(family, station)
            && self.diagram.branches.len() < self.diagram.settings.branches
    }

    /// The stations of other branches that cross at an event, a little before it or beyond.
    ///
    /// From beside the event a load along the vanishing mode leads over to these branches.
    fn crossing(
        &mut self,
        event: &Crossing<F, N>,
        before: &[Station<F, N>],
        family: &Along<D, F, N>,
    ) -> Vec<Station<F, N>> {
        let settings = self.diagram.settings.crossings;
        match event.turn {
            Turn::Fold => return Vec::new(),
            // A modal load leads to the crossing branch from a station at some distance from the event.
            Turn::Apex => {
                let mut found = settings.before.into_iter().map(|far| {
                    let before = before_by(far, event, before);
                    let others = self.beyond_modal_load(before, &event.mode, family);
                    let is_other = |other: &Station<F, N>| other.negative != before.negative;
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
                let Some(beside) = family.continuation(self.pace).beside(event, by) else {
                    continue;
                };
                let others = self.beyond_modal_load(&beside, &event.mode, family);
                let near = |other: &Station<F, N>| {
                    other.at.point.distance(&beside.at.point) < settings.near
                };
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
        from: &Station<F, N>,
        mode: &stagewise::Mode<N>,
        family: &Along<D, F, N>,
    ) -> Option<[Option<Station<F, N>>; 2]> {
        let Self {
            pace,
            proceed,
            diagram,
            ..
        } = self;
        let continuation = family.continuation(*pace);
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
    fn ways(&self, event: &Crossing<F, N>, side: &Station<F, N>) -> Vec<bool> {
        let away = side.parameter > event.parameter;
        match event.turn {
            Turn::Apex => vec![true, false],
            Turn::Fold | Turn::Bifurcation => vec![away],
        }
    }

    /// Whether one of the branches passes through a station of a family, by straight lines between their states.
    fn is_known(&self, family: &Along<D, F, N>, station: &Station<F, N>) -> bool {
        let settings = &self.diagram.settings.crossings;
        self.diagram.branches.iter().any(|branch| {
            let mut pairs = branch.states.windows(2);
            pairs.any(|pair| lies_between(family, station, [&pair[0], &pair[1]], settings))
        })
    }

    /// The stations without duplicates: of two mirror images only the one that bulges more along `solver.bulge` is kept.
    fn different(&self, stations: Vec<Station<F, N>>) -> Vec<Station<F, N>> {
        let bulge = self.diagram.path.base().bulge();
        let reach = |station: &Station<F, N>| {
            let poses = station.at.point.poses.iter();
            let reach = poses.map(|pose| pose.position.dot(&bulge));
            reach.fold(f64::NEG_INFINITY, f64::max)
        };
        let mut different: Vec<Station<F, N>> = Vec::new();
        for station in stations {
            let is_image = |other: &&mut Station<F, N>| {
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

    /// The minimum to which a belt led on past an event goes.
    fn landed(
        &mut self,
        event: &Crossing<F, N>,
        crossing: &[Station<F, N>],
        before: Option<&Station<F, N>>,
        past: f64,
        family: &Along<D, F, N>,
    ) -> Option<Snapped> {
        let place = event.parameter + past;
        let beyond = |station: &&Station<F, N>| {
            station.negative == 0 && (station.parameter - event.parameter) * past > 0.0
        };
        let from = crossing.iter().find(beyond).unwrap_or(&event.station);
        let proceed = &mut || (self.proceed)(0, place);
        let (problem, program) = family.meshed(place)?;
        let descended = family
            .continuation(self.pace)
            .descend(from, &event.mode, place, proceed);
        let descended = descended.map(|found| D::of_solution(&problem, program, found));
        let others = match descended {
            Some(_) => Some(D::solve_near(
                &problem,
                &family.mesh,
                &from.at.point,
                proceed,
            )),
            None => snapped_from::<D, F, N>(&problem, &family.mesh, &from.at.point, proceed),
        };
        let distance = |found: &Equilibrium| {
            let solved = found.solved_on_mesh::<D, F, N>();
            let point = &event.station.at.point;
            solved.map_or(f64::INFINITY, |solved| solved.at.point.distance(point))
        };
        // Beside a pitchfork the saddle is nearer than the minima.
        let found = descended.into_iter().chain(others);
        let minima = found.filter(|found| found.stable() != Some(false));
        let equilibrium = minima.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        let solved: &Solved<D, F, N> = equilibrium.solved_on_mesh()?;
        let objective = solved.values.objective;
        let rate = before.map_or(0.0, |before| {
            (event.station.objective - before.objective) / (event.parameter - before.parameter)
        });
        let led = event.station.objective + rate * past;
        let units = problem.units();
        Some(Snapped {
            place,
            jump: distance(&equilibrium) * units.length,
            released: (led - objective) * units.energy,
            equilibrium,
        })
    }
}

/// What is found at an event.
struct Found<const F: usize, const N: usize> {
    /// Stations of the branches that cross there.
    crossing: Vec<Station<F, N>>,
    /// The minimum on which the belt goes on where it loses its stability.
    landed: Option<Snapped>,
    /// Whether a finer mesh has the event.
    confirmed: bool,
}

/// The states of a stretch.
fn states<D: StripModel<F, N>, const F: usize, const N: usize>(
    stretch: &Stretch<D, F, N>,
) -> impl Iterator<Item = State> {
    let mesh = Arc::new(stretch.family.mesh.clone());
    let stations = stretch.stations.iter();
    stations.map(move |station| State::of::<D, F, N>(station, Arc::clone(&mesh)))
}

/// The end of a branch, given its last stretch: through the flat belt the branch would go over into its mirror image.
fn without_mirror_image<D: StripModel<F, N>, const F: usize, const N: usize>(
    last: &mut Stretch<D, F, N>,
    end: End,
) -> End {
    let reached = last.stations.last().map(|station| station.parameter);
    let is_open = matches!(end, End::Event | End::Lost);
    let is_near_limit = reached.is_some_and(|place| last.family.is_near_limit(place));
    if !is_open || !is_near_limit {
        return end;
    }
    last.events.retain(|(_, event)| event.turn != Turn::Apex);
    End::NoSlack
}

/// The last station at a distance of at least `far` before an event, else the first.
fn before_by<'a, const F: usize, const N: usize>(
    far: f64,
    event: &Crossing<F, N>,
    stations: &'a [Station<F, N>],
) -> &'a Station<F, N> {
    let is_before = |station: &&Station<F, N>| (station.parameter - event.parameter).abs() >= far;
    stations
        .iter()
        .rev()
        .find(is_before)
        .unwrap_or(&stations[0])
}

/// The kind of an event, by the places of the crossing branches.
fn kind<const F: usize, const N: usize>(
    event: &Crossing<F, N>,
    crossing: &[Station<F, N>],
) -> Kind {
    let beyond = |station: &&Station<F, N>| station.parameter > event.parameter;
    match (event.turn, crossing.iter().filter(beyond).count()) {
        (Turn::Fold, _) => Kind::Fold,
        (Turn::Apex | Turn::Bifurcation, _) if crossing.is_empty() => Kind::Bifurcation,
        (Turn::Apex, _) => Kind::Pitchfork,
        (Turn::Bifurcation, 1) if crossing.len() == 2 => Kind::Transcritical,
        (Turn::Bifurcation, _) => Kind::Pitchfork,
    }
}
