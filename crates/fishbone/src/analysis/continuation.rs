//! Continuation of equilibria along a path, stable or not: folds, bifurcations, and the minima to which the belt snaps.

mod confirm;
mod flat;
mod known;
mod search;
mod trace;

use crate::analysis::family::{Along, Station};
use crate::analysis::path::Path;
use crate::equilibrium::model::{AnyStationary, StripModel};
use crate::equilibrium::{AnySolved, Equilibrium, Solved, Stability, Status, Uncertified};
use crate::geometry::Wrench;
use crate::names::named;
use crate::problem::program::BeltPoint;
use crate::problem::{Mesh, Problem};
use crate::strip::developable::DevelopableEnergy;
use crate::strip::shell::{FIELDS, Shell};
use crate::surface;
use nalgebra::Vector3;
use stagewise::{Events, Pace, Residuals, Stationary};
use std::ops::ControlFlow;
use std::sync::Arc;
use thiserror::Error;
use trace::Stop;

named! {
    /// Why a branch ended.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum End {
        /// The path ends.
        Range = "range",
        /// At an event beyond which the branch would be its own mirror image.
        Event = "event",
        /// The branch has come back to its start.
        Closed = "closed",
        /// The belt loses its stability, and leaves the branch.
        Unstable = "unstable",
        /// The allowed number of states is used up.
        Budget = "budget",
        /// No step, however short, leads on.
        Lost = "lost",
        /// The active edges change at a bend of the board.
        Edges = "edges",
        /// The belt is at its inextensible limit.
        NoSlack = "no_slack",
        /// The caller asked to end.
        Interrupted = "interrupted",
    }
}

impl From<stagewise::End<Stop>> for End {
    fn from(end: stagewise::End<Stop>) -> Self {
        match end {
            stagewise::End::Range => Self::Range,
            stagewise::End::Event => Self::Event,
            stagewise::End::Closed => Self::Closed,
            stagewise::End::Budget => Self::Budget,
            stagewise::End::Lost => Self::Lost,
            stagewise::End::Stopped(Stop::Edges) => Self::Edges,
            // A branch is left on a mesh that does not carry it only for want of states.
            stagewise::End::Stopped(Stop::Mesh) => Self::Budget,
            stagewise::End::Stopped(Stop::Interrupted) => Self::Interrupted,
        }
    }
}

/// The reason why an equilibrium has no branch to follow.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum NoBranch {
    /// There is no equilibrium to begin with.
    #[error(transparent)]
    Uncertified(#[from] Uncertified),
    /// The supports leave the belt no slack.
    #[error(
        "the supports hold the belt straight, without slack, so that there is no shape to follow: move the supports a little \
         closer together, or begin at the other end of the path"
    )]
    NoSlack,
    /// The belt is flat, and has no single continuation.
    #[error(
        "the belt lies flat at the start of the path, where its ribs may turn at no cost of energy, so that it may leave the \
         plane in many ways: move a support a little, so that the belt is bent, or load it"
    )]
    Flat,
    /// The equilibrium has no single continuation.
    #[error(
        "no single branch could be found to follow: the equilibrium may move at no cost of energy, or the solver cannot go on"
    )]
    Singular,
}

named!(impl NoBranch {
    NoSlack = "no_slack",
    Flat = "flat",
    Singular = "singular",
    ..Uncertified,
});

/// Extent of a continuation. Lengths along a branch count the parameter of the path, from 0 to its length, and the motion of
/// the belt in U alike.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct Settings {
    /// Longest step along a branch.
    pub step: f64,
    /// Most states of a branch.
    pub states: usize,
    /// Most branches.
    pub branches: usize,
    /// Whether the belt is led along its minima and from each loss of one to the next minimum, and nowhere else.
    pub snaps: bool,
    /// Search for crossing branches.
    pub crossings: CrossingSettings,
}

/// Settings of the search for branches that cross at an event: its distances, and its tolerances for near and equal states.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct CrossingSettings {
    /// Distances before an apex at which a modal load leads off the branch, in the parameter of the path: tried in turn
    /// until one leads to another branch.
    pub before: [f64; 4],
    /// Distances to either side of a bifurcation, tried likewise, in the parameter of the path.
    pub beside: [f64; 3],
    /// Distance from the branch beyond which another branch does not cross at the event, in U.
    pub near: f64,
    /// Distance past a loss of stability at which the belt is let go downhill, in the parameter of the path.
    pub past: f64,
    /// Distance from the straight line between two states of a branch up to which a station lies on it, in U.
    pub on_branch: f64,
    /// Sag of a branch between two states that is allowed in addition, as a share of their distance.
    pub sag: f64,
}

impl Default for CrossingSettings {
    fn default() -> Self {
        Self {
            before: [5e-3, 1e-3, 2e-2, 2e-4],
            beside: [2e-3, 5e-4, 1e-2],
            near: 0.2,
            past: 1e-5,
            on_branch: 2e-3,
            sag: 0.05,
        }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            step: 0.05,
            states: 1000,
            branches: 10,
            snaps: false,
            crossings: CrossingSettings::default(),
        }
    }
}

/// The connected branches of equilibria along a path.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct Diagram {
    /// The path.
    pub path: Path,
    /// The branches: first the branch of the equilibrium where the path begins, then those that branch off.
    pub branches: Vec<Branch>,
    settings: Settings,
}

/// A curve of equilibria.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct Branch {
    /// Origin at an event of another branch; `None` at the start of the path.
    pub origin: Option<Origin>,
    /// States in order, including the states at its events.
    pub states: Vec<State>,
    /// Events in order.
    pub events: Vec<Event>,
    /// The reason for which it ends.
    pub end: End,
}

/// Origin of a branch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct Origin {
    /// The other branch.
    pub branch: usize,
    /// Index of that branch's event.
    pub event: usize,
}

/// An equilibrium of a branch.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct State {
    /// Place on the path.
    pub place: f64,
    /// Number of independent motions along which the energy falls.
    pub negative_modes: usize,
    /// Largest residuals of the state's discrete equations.
    pub residuals: Residuals,
    at: AnyStationary,
    mesh: Arc<Mesh>,
}

/// Summary of a state for a report, in the units of its scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// The path's parameter at the place.
    pub parameter: f64,
    /// Total potential.
    pub energy: f64,
    /// Coordinate of the highest point along the bulge.
    pub height: f64,
    /// Reactions of the supports on the belt, in the order of the scenario.
    pub reactions: Vec<Wrench>,
    /// Least radius of bend over the whole width; `None` of a flat belt.
    pub least_bend_radius: Option<f64>,
    /// Least radius of bend on the spine; `None` of a flat belt.
    pub least_spine_radius: Option<f64>,
    /// Bend radii exceeded on 99.9, 99 and 95 % of the board's area; infinite where it is flat.
    pub area_radii: [f64; 3],
    /// Margin of the ribs against crossing.
    pub rib_margin: f64,
    /// Stability by the second variation, where it is decided.
    pub stability: Option<Stability>,
    /// Whether the state is an equilibrium to the tolerance, with its ribs apart on the whole board.
    pub status: Status,
    /// Largest residuals of the state's discrete equations.
    pub residuals: Residuals,
    /// The largest estimated error by the mesh, relative; `None` where it is not known.
    pub error: Option<f64>,
}

named! {
    /// Kind of an event.
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
        /// The ribs beside a bend come to other edges of the board.
        Edges = "edges",
    }
}

/// A place on a branch where the number of negative modes changes, or where other edges hold the ribs.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct Event {
    /// Kind of the event.
    pub kind: Kind,
    /// The state next to it.
    pub state: usize,
    /// Place on the path.
    pub place: f64,
    /// Negative modes before and after.
    pub negative_modes: [usize; 2],
    /// Whether the event is found again on the mesh of elements half as long, within 0.01 legs of the path.
    pub confirmed: bool,
    /// The minimum to which the belt snaps when it is led past the loss of its stability.
    pub snapped: Option<Snapped>,
}

/// The minimum downhill from a loss of stability.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct Snapped {
    /// Place on the path, a little past the event.
    pub place: f64,
    /// Largest displacement of a node.
    pub jump: f64,
    /// Energy released.
    pub released: f64,
    /// The minimum.
    pub equilibrium: Equilibrium,
}

/// Follows an equilibrium of the path's first problem along the path.
///
/// `proceed` is asked once a step whether to go on, with the number of the branch and the place on the path.
///
/// # Errors
///
/// [`NoBranch`] unless it has converged, by a method with multipliers, to a single equilibrium.
pub fn follow(
    equilibrium: &Equilibrium,
    path: &Path,
    settings: &Settings,
    proceed: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
) -> Result<Diagram, NoBranch> {
    equilibrium.certified_any()?;
    if path.base().has_no_slack() {
        return Err(NoBranch::NoSlack);
    }
    let suited = equilibrium.for_paths(&mut || proceed(0, 0.0));
    let equilibrium = suited.as_ref().unwrap_or(equilibrium);
    match equilibrium.certified_any()? {
        AnySolved::Developable(solved) => {
            follow_solved(equilibrium, solved, path, settings, proceed)
        }
        AnySolved::Shell(solved) => follow_solved(equilibrium, solved, path, settings, proceed),
    }
}

/// As [`follow`], of an equilibrium given with its solved programme.
fn follow_solved<D: StripModel<F, N>, const F: usize, const N: usize>(
    equilibrium: &Equilibrium,
    solved: &Solved<D, F, N>,
    path: &Path,
    settings: &Settings,
    proceed: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
) -> Result<Diagram, NoBranch> {
    let family = Along::<D, F, N>::new(path.clone(), Mesh::of(path.base(), &solved.program));
    let pace = Pace {
        longest: settings.step,
        stations: settings.states,
        events: Events::Find,
    };
    let off_flat = flat::off_flat(solved, path, settings, pace, proceed);
    let is_off_flat = off_flat.is_some();
    let (family, start) = match off_flat {
        Some((family, start)) => (family, Some(start)),
        None => {
            let start = family.continuation(pace).start(&solved.at, 0.0, true);
            (family, start)
        }
    };
    let start = start.ok_or_else(|| match solved.at.point.is_flat() {
        true => NoBranch::Flat,
        false => NoBranch::Singular,
    })?;
    let diagram = Diagram {
        path: path.clone(),
        branches: Vec::new(),
        settings: *settings,
    };
    let mut diagram = search::run(&family, pace, diagram, start, proceed);
    let first = diagram.branches.first_mut().ok_or(NoBranch::Singular)?;
    if is_off_flat {
        flat::begin_at(first, equilibrium, solved);
    }
    flat::end_flat::<D, F, N>(&mut diagram, proceed);
    Ok(diagram)
}

impl Branch {
    /// Whether the number of negative modes of a state comes from an event that a finer mesh does not confirm, and that no other
    /// event has undone.
    fn is_in_doubt_at(&self, state: usize) -> bool {
        let until = self.events.iter().take_while(|event| event.state <= state);
        let doubted = until.fold(None, |doubted: Option<usize>, event| {
            let [before, after] = event.negative_modes;
            match doubted {
                _ if event.confirmed => None,
                None => (before != after).then_some(before),
                // The state of the event itself may still be on either side.
                Some(number) => (after != number || event.state == state).then_some(number),
            }
        });
        doubted.is_some()
    }
}

impl Summary {
    /// Whether the state is a local minimum; `None` where this is undecided.
    pub fn stable(&self) -> Option<bool> {
        self.stability?.is_stable()
    }
}

impl State {
    fn of<D: StripModel<F, N>, const F: usize, const N: usize>(
        station: &Station<F, N>,
        mesh: Arc<Mesh>,
    ) -> Self {
        Self {
            mesh,
            place: station.parameter,
            negative_modes: station.negative,
            residuals: station.residuals,
            at: D::any_stationary(station.at.clone()),
        }
    }
}

/// The equilibrium at a stationary point of a problem's programme on a mesh.
fn equilibrium_at<D: StripModel<F, N>, const F: usize, const N: usize>(
    problem: &Problem,
    mesh: &Mesh,
    at: &Stationary<BeltPoint<F>>,
) -> Equilibrium {
    let program = D::program_on(problem, mesh).expect("it was solved there");
    let solution = stagewise::assess(&program, problem.tolerance(), at);
    D::of_solution(problem, program, solution)
}

impl Diagram {
    /// The problem of a state.
    ///
    /// # Panics
    ///
    /// If there is no such state.
    pub(crate) fn problem(&self, branch: usize, state: usize) -> Problem {
        let place = self.branches[branch].states[state].place;
        let problem = self.path.at(place);
        problem.expect("it was solved there")
    }

    /// The equilibrium of a state, with all its data.
    ///
    /// # Panics
    ///
    /// If there is no such state.
    pub fn equilibrium(&self, branch: usize, state: usize) -> Equilibrium {
        let problem = self.problem(branch, state);
        let state = &self.branches[branch].states[state];
        match &state.at {
            AnyStationary::Developable(at) => {
                equilibrium_at::<DevelopableEnergy, 2, 8>(&problem, &state.mesh, at)
            }
            AnyStationary::Shell(at) => {
                equilibrium_at::<Shell, FIELDS, 12>(&problem, &state.mesh, at)
            }
        }
    }

    /// The summary of a state for a report on the path.
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
            area_radii: surface::BendDistribution::of(spine).quantiles(),
            rib_margin: surface::rib_margin(spine).value,
            stability: (equilibrium.stability)
                .filter(|_| !self.branches[branch].is_in_doubt_at(state)),
            status: equilibrium.status,
            residuals: equilibrium.residuals,
            error: equilibrium.error().and_then(|error| error.largest_known()),
        }
    }

    /// The positions of the spine in all states of a branch, at the nodes of the state with the most nodes.
    ///
    /// # Panics
    ///
    /// If there is no such branch.
    pub fn positions(&self, branch: usize) -> Vec<Vec<Vector3<f64>>> {
        let states = &self.branches[branch].states;
        let most = states.iter().enumerate();
        let most = most.max_by_key(|(_, state)| state.mesh.elements());
        let Some((most, finest)) = most else {
            return Vec::new();
        };
        let spine = self.equilibrium(branch, most).spine;
        let shares: Vec<f64> = spine.u.iter().map(|u| u / spine.length()).collect();
        let position = |(index, state): (usize, &State)| {
            let spine = self.equilibrium(branch, index).spine;
            if state.mesh == finest.mesh {
                return spine.pose.iter().map(|pose| pose.position).collect();
            }
            let places = shares.iter().map(|share| share * spine.length());
            places.map(|u| spine.at(u).pose.position).collect()
        };
        states.iter().enumerate().map(position).collect()
    }
}
