//! The equilibria along a path, stable or not: where they fold, where others branch off, and what the belt snaps to.

use crate::analysis::path::Path;
use crate::analysis::symmetry::{SAME, are_twins};
use crate::equilibrium::{Equilibrium, Stability, Status, Uncertified, of_solution};
use crate::geometry::Wrench;
use crate::names::named;
use crate::problem::program::{BeltPoint, BeltProgram};
use crate::problem::{Mesh, Problem};
use crate::surface;
use stagewise::{Continuation, Distance, Events, Family, Pace, Residuals, Stationary, Turn};
use std::ops::ControlFlow;
use thiserror::Error;

/// A station of a branch.
type Station = stagewise::Station<BeltPoint, 8>;
/// A place where the number of negative modes changes.
type Crossing = stagewise::Event<BeltPoint, 8>;
/// A curve of equilibria that may have been interrupted.
type Curve = stagewise::Curve<BeltPoint, (), 8>;

named! {
    /// Why a branch ended.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum End {
        /// The path ends.
        Range = "range",
        /// At an event beyond which the branch would be its own mirror image.
        Event = "event",
        /// The branch has come back to where it began.
        Closed = "closed",
        /// All states that were allowed are used up.
        Budget = "budget",
        /// No step, however short, leads on.
        Lost = "lost",
        /// Ribs reach edges beside a bend that held none before, or leave those that held them.
        Edges = "edges",
        /// The belt is drawn straight.
        Taut = "taut",
        /// The caller asked to end.
        Interrupted = "interrupted",
    }
}

impl From<stagewise::End<()>> for End {
    fn from(end: stagewise::End<()>) -> Self {
        match end {
            stagewise::End::Range => Self::Range,
            stagewise::End::Event => Self::Event,
            stagewise::End::Closed => Self::Closed,
            stagewise::End::Budget => Self::Budget,
            stagewise::End::Lost => Self::Lost,
            stagewise::End::Stopped(()) => Self::Interrupted,
        }
    }
}

/// Why there is nothing to follow.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum NoBranch {
    /// There is no equilibrium to begin with.
    #[error(transparent)]
    Uncertified(#[from] Uncertified),
    /// The equilibrium has no single continuation.
    #[error(
        "no single branch could be found to follow: the equilibrium may move at no cost of energy, or the solver cannot go on"
    )]
    Singular,
}

named!(impl NoBranch {
    Singular = "singular",
    ..Uncertified,
});

/// How far to look. Lengths along a branch count the parameter of the path, from 0 to its length, and the motion of the belt
/// in U alike.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Longest step along a branch.
    pub step: f64,
    /// Most states of a branch.
    pub states: usize,
    /// Most branches.
    pub branches: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            step: 0.05,
            states: 1000,
            branches: 10,
        }
    }
}

/// The branches of equilibria that hang together along a path.
#[derive(Debug, Clone)]
pub struct Diagram {
    /// The path.
    pub path: Path,
    /// The branches: first that of the equilibrium where the path begins, then those that branch off.
    pub branches: Vec<Branch>,
    mesh: Mesh,
    settings: Settings,
}

/// A curve of equilibria.
#[derive(Debug, Clone)]
pub struct Branch {
    /// Where it begins: at the start of the path, or at an event of another branch.
    pub origin: Option<Origin>,
    /// Its states in order, those of its events among them.
    pub states: Vec<State>,
    /// Its events in order.
    pub events: Vec<Event>,
    /// Why it ends.
    pub end: End,
}

/// Where a branch comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Origin {
    /// The other branch.
    pub branch: usize,
    /// Which of its events.
    pub event: usize,
}

/// An equilibrium of a branch.
#[derive(Debug, Clone)]
pub struct State {
    /// How far along the path.
    pub place: f64,
    /// Number of independent motions along which the energy falls.
    pub negative_modes: usize,
    /// How far it is from a solution of its discrete equations.
    pub residuals: Residuals,
    at: Stationary<BeltPoint>,
}

/// What a report says of a state, in the units of its scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// What the path calls the place.
    pub parameter: f64,
    /// Total potential.
    pub energy: f64,
    /// How far the highest point is along the bulge.
    pub height: f64,
    /// What the supports do to the belt, in the order of the scenario.
    pub reactions: Vec<Wrench>,
    /// Least radius of bend over the whole width, where it bends.
    pub least_bend_radius: Option<f64>,
    /// Least radius of bend on the spine, where it bends.
    pub least_spine_radius: Option<f64>,
    /// How far the ribs are from crossing.
    pub rib_margin: f64,
    /// The second variation, where it can be decided.
    pub stability: Option<Stability>,
    /// How far it is from a solution of its discrete equations.
    pub residuals: Residuals,
}

named! {
    /// What happens at an event.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Kind {
        /// The branch turns back.
        Fold = "fold",
        /// Another branch crosses that is its own mirror image, or touches it to first order.
        Pitchfork = "pitchfork",
        /// Another branch crosses at an angle.
        Transcritical = "transcritical",
        /// Other branches cross that could not be followed.
        Bifurcation = "bifurcation",
    }
}

/// A place on a branch where the number of negative modes changes.
#[derive(Debug, Clone)]
pub struct Event {
    /// What happens there.
    pub kind: Kind,
    /// The state next to it.
    pub state: usize,
    /// How far along the path it is.
    pub place: f64,
    /// Negative modes before and after.
    pub negative_modes: [usize; 2],
    /// Where the belt goes when it is led past the loss of its stability.
    pub snapped: Option<Snapped>,
}

/// The minimum downhill from where stability was lost.
#[derive(Debug, Clone)]
pub struct Snapped {
    /// How far along the path, a little past the event.
    pub place: f64,
    /// The minimum.
    pub equilibrium: Equilibrium,
}

/// The programmes of the problems along a path, all on the same mesh.
pub(crate) struct Along<'a> {
    pub(crate) path: &'a Path,
    pub(crate) mesh: &'a Mesh,
}

impl Family<6, 2, 8> for Along<'_> {
    type Point = BeltPoint;
    type Program = BeltProgram;

    fn at(&self, place: f64) -> Option<BeltProgram> {
        self.path.at(place)?.program_on(self.mesh)
    }
}

/// The problem at a place on a path, with its programme on a mesh.
pub(crate) fn meshed(path: &Path, mesh: &Mesh, place: f64) -> Option<(Problem, BeltProgram)> {
    let problem = path.at(place)?;
    let program = problem.program_on(mesh)?;
    Some((problem, program))
}

/// Whether the supports are out of the belt's reach next to a place, so that the belt is near its inextensible limit.
pub(crate) fn is_near_limit(path: &Path, place: f64) -> bool {
    /// Of what may be a long way.
    const A_LITTLE: f64 = 2e-3;
    let beside = [place - A_LITTLE, place + A_LITTLE].map(|place| path.at(place));
    let mut known = beside.iter().flatten();
    known.any(|problem| problem.unreachable_supports().is_some())
}

/// Follows an equilibrium of the path's first problem along the path.
///
/// `proceed` is asked once a step whether to go on, with the number of the branch and the place on the path.
///
/// # Errors
///
/// [`NoBranch`] unless it has converged, by a method that knows multipliers, to a single equilibrium.
pub fn follow(
    equilibrium: &Equilibrium,
    path: &Path,
    settings: &Settings,
    proceed: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
) -> Result<Diagram, NoBranch> {
    let solved = equilibrium.certified()?;
    let mesh = Mesh::of(path.base(), &solved.program);
    let family = Along { path, mesh: &mesh };
    let pace = Pace {
        longest: settings.step,
        stations: settings.states,
        events: Events::Find,
    };
    let tolerance = path.base().tolerance();
    let continuation = Continuation::new(&family, tolerance, [0.0, path.length()], pace);
    let start = continuation.start(&solved.at, 0.0, true);
    let start = start.ok_or(NoBranch::Singular)?;
    let mut search = Search {
        continuation,
        proceed,
        diagram: Diagram {
            path: path.clone(),
            branches: Vec::new(),
            mesh: mesh.clone(),
            settings: *settings,
        },
    };
    search.trace(None, start);
    match search.diagram.branches.is_empty() {
        true => Err(NoBranch::Singular),
        false => Ok(search.diagram),
    }
}

/// A diagram in the making.
struct Search<'a, 'b> {
    continuation: Continuation<'a, Along<'a>, 6, 2, 8>,
    proceed: &'b mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    diagram: Diagram,
}

impl Search<'_, '_> {
    /// Traces a branch, then those that branch off it.
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
                let is_known = self.diagram.passes_through(&side);
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

    /// A curve as far as the ribs are bounded by the edges that they reach, and by no others.
    fn settled(&self, mut curve: Curve) -> (Curve, End) {
        let mut end = End::from(curve.end);
        let Diagram { path, mesh, .. } = &self.diagram;
        let is_unsettled = |station: &Station| {
            let meshed = meshed(path, mesh, station.parameter);
            meshed.is_none_or(|(problem, program)| {
                let fault = problem.active_set_fault(&program, &station.at.point);
                fault.is_some()
            })
        };
        if let Some(first) = curve.stations.iter().position(is_unsettled) {
            curve.stations.truncate(first);
            curve.events.retain(|(state, _)| *state < first);
            end = End::Edges;
        }
        let reached = curve.stations.last().map(|station| station.parameter);
        let is_open = matches!(end, End::Event | End::Lost);
        if is_open && reached.is_some_and(|place| is_near_limit(path, place)) {
            // Through the flat belt it would go over into its mirror image.
            curve.events.retain(|(_, event)| event.turn != Turn::Apex);
            end = End::Taut;
        }
        (curve, end)
    }

    /// The stations of other branches that cross at an event, a little before it or beyond.
    ///
    /// From beside the event a load along the mode that is about to vanish leads over to them.
    fn crossing(&mut self, event: &Crossing, before: &[Station]) -> Vec<Station> {
        /// As near to where a branch is its own mirror image a modal load off it begins.
        const BEFORE: [f64; 4] = [5e-3, 1e-3, 2e-2, 2e-4];
        const BESIDE: [f64; 3] = [2e-3, 5e-4, 1e-2];
        /// Farther off it is none that crosses there.
        const NEAR: f64 = 0.2;
        match event.turn {
            Turn::Fold => return Vec::new(),
            // A modal load off the branch, where it has not come close yet, leads to the branch that it crosses.
            Turn::Apex => {
                let mut found = BEFORE.into_iter().map(|far| {
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
        for by in BESIDE {
            let mut found = Vec::new();
            for by in [by, -by] {
                let Some(beside) = self.continuation.beside(event, by) else {
                    continue;
                };
                let others = self.beyond_modal_load(&beside, &event.mode);
                let near = |other: &Station| other.at.point.distance(&beside.at.point) < NEAR;
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
            continuation,
            proceed,
            diagram: Diagram { path, mesh, .. },
        } = self;
        let branch = self.diagram.branches.len();
        let program = path.at(from.parameter)?.program_on(mesh)?;
        let tolerance = path.base().tolerance();
        let mut beyond = |forth| {
            let ask = &mut |_| proceed(branch, from.parameter);
            let at = stagewise::over_modal_load(&program, tolerance, &from.at, mode, forth, ask)?;
            continuation.start(&at, from.parameter, true)
        };
        Some([beyond(true), beyond(false)])
    }

    /// Which ways to follow a branch from a station beside an event: away from where it crosses, or both where it is the one
    /// that goes straight through.
    fn ways(&self, event: &Crossing, side: &Station) -> Vec<bool> {
        let away = side.parameter > event.parameter;
        match event.turn {
            Turn::Apex => vec![true, false],
            Turn::Fold | Turn::Bifurcation => vec![away],
        }
    }

    /// Of two that are mirror images the one that bulges as the scenario asks; else all.
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
                are_twins(&other.at.point.poses, &station.at.point.poses, SAME)
            };
            match different.iter_mut().find(is_image) {
                Some(image) if reach(&station) > reach(image) => *image = station,
                Some(_) => (),
                None => different.push(station),
            }
        }
        different
    }

    /// Where the belt goes that is led on past an event.
    fn snapped(&mut self, event: &Crossing, crossing: &[Station], onwards: f64) -> Option<Snapped> {
        const PAST: f64 = 1e-4;
        let place = event.parameter + PAST * onwards;
        let beyond = |station: &&Station| {
            station.negative == 0 && (station.parameter - event.parameter) * onwards > 0.0
        };
        let from = crossing.iter().find(beyond).unwrap_or(&event.station);
        let proceed = &mut || (self.proceed)(0, place);
        let found = self
            .continuation
            .descend(from, &event.mode, place, proceed)?;
        let (problem, program) = meshed(&self.diagram.path, &self.diagram.mesh, place)?;
        let equilibrium = of_solution(&problem, program, found);
        let is_converged = equilibrium.status == Status::Converged;
        is_converged.then_some(Snapped { place, equilibrium })
    }
}

/// The last station at least so far before an event, else the first.
fn before_by<'a>(far: f64, event: &Crossing, stations: &'a [Station]) -> &'a Station {
    let is_before = |station: &&Station| (station.parameter - event.parameter).abs() >= far;
    stations
        .iter()
        .rev()
        .find(is_before)
        .unwrap_or(&stations[0])
}

/// What an event is, by where the other branches are.
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

impl Summary {
    /// Whether it is a local minimum; `None` where that cannot be decided.
    pub fn stable(&self) -> Option<bool> {
        self.stability?.is_stable()
    }
}

impl State {
    fn of(station: &Station) -> Self {
        Self {
            place: station.parameter,
            negative_modes: station.negative,
            residuals: station.residuals,
            at: station.at.clone(),
        }
    }
}

impl Diagram {
    /// The problem of a state.
    ///
    /// # Panics
    ///
    /// If there is no such state.
    pub fn problem(&self, branch: usize, state: usize) -> Problem {
        let place = self.branches[branch].states[state].place;
        let problem = self.path.at(place);
        let problem = problem.and_then(|p| p.with_elements(self.path.base().elements()).ok());
        problem.expect("it was solved there")
    }

    /// All that is to be known of a state.
    ///
    /// # Panics
    ///
    /// If there is no such state.
    pub fn equilibrium(&self, branch: usize, state: usize) -> Equilibrium {
        let problem = self.problem(branch, state);
        let program = problem.program_on(&self.mesh);
        let program = program.expect("it was solved there");
        let at = &self.branches[branch].states[state].at;
        let solution = stagewise::assess(&program, problem.tolerance(), at);
        of_solution(&problem, program, solution)
    }

    /// What a report on the path says of a state.
    ///
    /// # Panics
    ///
    /// If there is no such state.
    pub fn summary(&self, branch: usize, state: usize) -> Summary {
        let equilibrium = self.equilibrium(branch, state);
        let spine = &equilibrium.spine;
        let bulge = equilibrium.problem.bulge();
        Summary {
            parameter: self
                .path
                .parameter(self.branches[branch].states[state].place),
            energy: equilibrium.energy,
            height: equilibrium.highest_point().position.dot(&bulge.normalize()),
            reactions: equilibrium.reactions.iter().map(|on| on.wrench).collect(),
            least_bend_radius: surface::least_bend_radius(spine).map(|least| least.value),
            least_spine_radius: surface::least_spine_radius(spine).map(|least| least.value),
            rib_margin: surface::rib_margin(spine).value,
            stability: equilibrium.stability,
            residuals: equilibrium.residuals,
        }
    }

    /// Whether a branch passes through a station, as far as its states tell by straight lines between them.
    fn passes_through(&self, station: &Station) -> bool {
        self.branches.iter().any(|branch| {
            let pairs = branch.states.windows(2);
            pairs
                .map(|pair| [&pair[0], &pair[1]])
                .any(|pair| lies_between(station, pair))
        })
    }
}

/// Whether a station lies between two states of a branch.
fn lies_between(station: &Station, [a, b]: [&State; 2]) -> bool {
    const NEAR: f64 = 2e-3;
    const SAG: f64 = 0.05;
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
        let sag = SAG * a.at.point.distance(&b.at.point);
        off.fold(0.0, f64::max) < NEAR + sag
    }
}
