//! Branches that begin or end at a flat board: there its ribs lie anyhow, so that no tangent leads off the plane.

use super::{Branch, Diagram, End, Settings, State};
use crate::analysis::family::{Along, Station};
use crate::analysis::path::Path;
use crate::equilibrium::model::StripModel;
use crate::equilibrium::{Equilibrium, Solved, from_guess};
use crate::problem::Mesh;
use crate::strip::density::Density;
use stagewise::Pace;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Whether a belt is flat and at rest.
fn is_flat_at_rest<D: Density<F>, const F: usize, const N: usize>(
    Solved { program, at, .. }: &Solved<D, F, N>,
) -> bool {
    at.point.is_flat() && program.is_at_rest(&at.point)
}

/// The start of the branch that leaves a flat board at rest: a minimum a little on along the path, with the path on its mesh;
/// `None` of another start, where the board stays flat, and where no minimum is found.
pub(super) fn off_flat<D: StripModel<F, N>, const F: usize, const N: usize>(
    solved: &Solved<D, F, N>,
    path: &Path,
    settings: &Settings,
    pace: Pace,
    proceed: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
) -> Option<(Along<D, F, N>, Station<F, N>)> {
    /// Places to start from, in the longest step, tried in turn.
    const PLACES: [f64; 3] = [0.2, 1.0, 0.05];
    if !is_flat_at_rest(solved) {
        return None;
    }
    PLACES.into_iter().find_map(|share| {
        let place = (share * settings.step).min(path.length());
        let problem = path.at(place)?;
        let found = from_guess(&problem, &mut || proceed(0, place));
        let solved: &Solved<D, F, N> = found.certified().ok()?;
        if is_flat_at_rest(solved) || found.stable() == Some(false) {
            return None;
        }
        let family = Along::new(path.clone(), Mesh::of(&problem, &solved.program));
        let start = family.continuation(pace).start(&solved.at, place, true)?;
        Some((family, start))
    })
}

/// The state at an equilibrium.
fn state<D: StripModel<F, N>, const F: usize, const N: usize>(
    equilibrium: &Equilibrium,
    solved: &Solved<D, F, N>,
    place: f64,
) -> State {
    State {
        place,
        negative_modes: equilibrium.stability.map_or(0, |s| s.negative_modes),
        residuals: equilibrium.residuals,
        at: D::any_stationary(solved.at.clone()),
        mesh: Arc::new(Mesh::of(equilibrium.problem(), &solved.program)),
    }
}

/// Puts a flat start before the first state of a branch.
pub(super) fn begin_at<D: StripModel<F, N>, const F: usize, const N: usize>(
    branch: &mut Branch,
    flat: &Equilibrium,
    solved: &Solved<D, F, N>,
) {
    branch.states.insert(0, state(flat, solved, 0.0));
    for event in &mut branch.events {
        event.state += 1;
    }
}

/// Ends the first branch at the end of the path where it was lost next to it and the board lies flat there.
pub(super) fn end_flat<D: StripModel<F, N>, const F: usize, const N: usize>(
    diagram: &mut Diagram,
    proceed: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
) -> Option<()> {
    /// Displacement of a node up to which a flat board is next to a state, in U.
    const NEAR: f64 = 0.05;
    let (path, branch) = (&diagram.path, diagram.branches.first()?);
    let (end, last) = (path.length(), branch.states.last()?);
    if branch.end != End::Lost || end - last.place > diagram.settings.step {
        return None;
    }
    let flat = from_guess(&path.at(end)?, &mut || proceed(0, end));
    let solved: &Solved<D, F, N> = flat.certified().ok()?;
    if !is_flat_at_rest(solved) {
        return None;
    }
    let here = diagram.equilibrium(0, branch.states.len() - 1);
    if here.displacement(&flat) > NEAR {
        return None;
    }
    let state = state(&flat, solved, end);
    let branch = &mut diagram.branches[0];
    branch.states.push(state);
    branch.end = End::Range;
    Some(())
}
