//! Whether a branch passes through a state: by straight lines between the states that it has.

use super::{CrossingSettings, State};
use crate::analysis::family::{Along, Station};
use crate::analysis::symmetry::sampled;
use crate::equilibrium::model::StripModel;
use crate::geometry::Pose;
use stagewise::Family;

/// Whether a station of a family lies between two states of a branch.
pub(super) fn lies_between<D: StripModel<F, N>, const F: usize, const N: usize>(
    family: &Along<D, F, N>,
    station: &Station<F, N>,
    [a, b]: [&State; 2],
    settings: &CrossingSettings,
) -> bool {
    let share = (station.parameter - a.place) / (b.place - a.place);
    let is_as_stable = [a, b].map(|state| state.negative_modes == station.negative);
    (0.0..=1.0).contains(&share) && is_as_stable.contains(&true) && {
        let Some(nodes) = family.at(station.parameter).map(|program| program.nodes()) else {
            return false;
        };
        let [Some(from), Some(to)] = [a, b].map(|state| poses_at(family, state, &nodes)) else {
            return false;
        };
        let ends = || from.iter().zip(&to).map(|(a, b)| (a.position, b.position));
        let between = ends().zip(&station.at.point.poses);
        let off = between.map(|((a, b), pose)| (pose.position - a.lerp(&b, share)).norm());
        let moved = ends().map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        off.fold(0.0, f64::max) < settings.on_branch + settings.sag * moved
    }
}

/// The poses of a state at places of the spine, arc lengths in U; `None` where the state's mesh is none of the family's path.
fn poses_at<D: StripModel<F, N>, const F: usize, const N: usize>(
    family: &Along<D, F, N>,
    state: &State,
    places: &[f64],
) -> Option<Vec<Pose>> {
    let poses = state.at.poses();
    if *state.mesh == family.mesh {
        return Some(poses.to_vec());
    }
    let own = family.on((*state.mesh).clone()).at(state.place)?;
    Some(sampled(poses, &own.nodes(), places))
}
