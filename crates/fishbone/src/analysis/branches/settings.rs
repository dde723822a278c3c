//! Settings of the search for all equilibria: its extent, and its tolerances for equal equilibria.

use super::{Watch, height};
use crate::analysis::symmetry::{SAME, are_images, are_images_slid, sampled};
use crate::equilibrium::{Equilibrium, Solved};
use std::ops::ControlFlow;

/// Extent of the search and its tolerances for equal equilibria; with the defaults it finds all that are known of the
/// scenarios tried.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchSettings {
    /// Greatest number of elements of the mesh on which the search begins: from starts, and with modal loads.
    pub coarse_elements: usize,
    /// Greatest number of elements of the mesh on which it goes on, from sums of waves and with perturbations, until its
    /// equilibria are confirmed.
    pub elements: usize,
    /// Highest barrier at which a search may be known by the shape that it passes, in mean R_f/U: higher ones make shapes
    /// alike that go different ways afterwards.
    pub highest_barrier: f64,
    /// Greatest count of iterations of a search for a minimum on one mesh, a number.
    pub iterations: usize,
    /// Greatest count of iterations of a search for the same minimum on meshes that follow the error, a number.
    pub refining_iterations: usize,
    /// Waves of bend, laid over every arch and the straight belt; amplitudes in 1/U.
    pub bend_waves: Vec<Wave>,
    /// Waves of rib slope, each laid over with every wave of bend; amplitudes, a number.
    pub slope_waves: Vec<Wave>,
    /// Greatest count of sums of waves from which the search starts on either mesh, a number.
    pub sums: usize,
    /// Sums of waves at a time, a number: the search goes on to the next as long as such a batch leads to anything unlike
    /// what is known.
    pub batch: usize,
    /// Searches for minima at a time, a number: each of them ends where it comes to the way of one of those before.
    pub searches_at_a_time: usize,
    /// Greatest count of equilibria of a mesh alone that are carried over to finer ones, the lowest in energy, a number.
    pub carried: usize,
    /// Greatest count of perturbed minima, a number.
    pub perturbed: usize,
    /// Modes along which a minimum is perturbed, a number.
    pub perturbed_modes: usize,
    /// Displacements of a minimum along each of these modes, in norms of the mode.
    pub perturbations: Vec<f64>,
    /// Greatest count of equilibria continued in modal loads, a number.
    pub continued: usize,
    /// Equilibria continued at a time, a number: lower ones that are found meanwhile come first.
    pub at_a_time: usize,
    /// Modes along which an equilibrium is loaded, a number for each count of negative modes; equilibria with more negative
    /// modes are not reported.
    pub loaded_modes: [usize; 3],
    /// Displacement from a saddle along its lowest mode, from where it is downhill, in norms of the mode.
    pub off_saddle: f64,
    /// Elements of the mesh that confirms an equilibrium, as a multiple of the scenario's.
    pub refinement: usize,
    /// Difference of energy up to which two equilibria on one mesh may be the same, a share.
    pub same_level: f64,
    /// Distance of nodes up to which two equilibria on one mesh may be the same, in U.
    pub same_distance: f64,
    /// Difference of energy up to which two equilibria on different meshes may be the same, a share.
    pub like_level: f64,
    /// Distance of nodes up to which two equilibria on different meshes may be the same, in U.
    pub like_distance: f64,
    /// Bending energy of a belt that counts as flat, in the scenario's unit of energy.
    pub flat_energy: f64,
    /// Bulge by which one mirror image is the higher, in U.
    pub higher: f64,
    /// Miss of the supports up to which a mirror image meets them, lengths in U and angles in rad.
    pub miss: f64,
}

/// A wave along the belt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wave {
    /// Half waves over the length of the belt, a number.
    pub half_waves: f64,
    /// Largest value, in the unit of the field.
    pub amplitude: f64,
}

impl Default for SearchSettings {
    fn default() -> Self {
        let waves = |waves: &[(f64, f64)]| {
            let wave = |&(half_waves, amplitude)| Wave {
                half_waves,
                amplitude,
            };
            waves.iter().map(wave).collect()
        };
        Self {
            coarse_elements: 40,
            elements: 80,
            highest_barrier: 0.1,
            iterations: 200,
            refining_iterations: 1000,
            bend_waves: waves(&[
                (0.0, 0.0),
                (0.0, 4.0),
                (0.0, -4.0),
                (1.0, 4.0),
                (1.0, -4.0),
                (2.0, 8.0),
                (2.0, -8.0),
                (3.0, 12.0),
                (3.0, -12.0),
            ]),
            slope_waves: waves(&[(1.0, 0.0), (1.0, 0.5), (1.0, -0.5), (2.0, 0.5), (2.0, -0.5)]),
            sums: 2048,
            batch: 160,
            searches_at_a_time: 32,
            carried: 32,
            perturbed: 32,
            perturbed_modes: 4,
            perturbations: vec![0.1, -0.1, 0.3, -0.3],
            continued: 4,
            at_a_time: 4,
            loaded_modes: [3, 2, 0],
            off_saddle: 0.01,
            refinement: 2,
            same_level: 1e-4,
            same_distance: SAME,
            like_level: 0.02,
            like_distance: 0.03,
            flat_energy: 1e-6,
            higher: 1e-9,
            miss: 1e-6,
        }
    }
}

impl SearchSettings {
    /// Whether to go on with a search for a minimum on one mesh, asked once an iteration.
    pub(super) fn budget(&self, watch: &dyn Watch) -> impl FnMut() -> ControlFlow<()> {
        at_most(self.iterations, watch)
    }

    /// Whether to go on with a search for the same minimum on meshes that follow the error, asked once an iteration.
    pub(super) fn long_budget(&self, watch: &dyn Watch) -> impl FnMut() -> ControlFlow<()> {
        at_most(self.refining_iterations, watch)
    }

    /// Greatest number of negative modes of a reported equilibrium.
    pub(super) fn highest_index(&self) -> usize {
        self.loaded_modes.len() - 1
    }

    /// Whether two equilibria are the same but for a symmetry, or for sliding along themselves.
    pub(super) fn is_same(&self, a: &Equilibrium, b: &Equilibrium) -> bool {
        self.is_within(a, b, self.same_level, self.same_distance)
    }

    /// Whether two equilibria may be the same but for a symmetry and the mesh.
    pub(super) fn is_like(&self, a: &Equilibrium, b: &Equilibrium) -> bool {
        self.is_within(a, b, self.like_level, self.like_distance)
    }

    /// Whether two equilibria differ by no more than the error that their meshes make of one of them.
    pub(super) fn is_unresolved(&self, a: &Equilibrium, b: &Equilibrium) -> bool {
        let error = |e: &Equilibrium| e.error().map_or(0.0, |error| error.energy * self.size(e));
        self.is_like(a, b) && (a.energy - b.energy).abs() <= error(a).max(error(b))
    }

    /// Whether two equilibria differ by no more than a share of the energy, a distance in U and a symmetry, and in no number
    /// of negative modes; a belt that may slide along itself is the same wherever it has slid.
    fn is_within(&self, a: &Equilibrium, b: &Equilibrium, share: f64, distance: f64) -> bool {
        let at =
            |places: &[f64], of: &Solved| sampled(&of.at.point.poses, &of.program.nodes(), places);
        let are_images = |[a, b]: [&Solved; 2]| {
            let middles: Vec<f64> = (0..PLACES)
                .map(|k| (k as f64 + 0.5) / PLACES as f64)
                .collect();
            are_images(&at(&middles, a), &at(&middles, b), distance)
        };
        let are_slid = |[a, b]: [&Solved; 2]| {
            a.program.slides().is_some_and(|half_turns| {
                let u: Vec<f64> = (0..=PLACES).map(|k| k as f64 / PLACES as f64).collect();
                are_images_slid(&at(&u, a), &at(&u, b), &u, half_turns, distance)
            })
        };
        self.is_level(a, b, share)
            && solved(a, b).is_some_and(|both| are_images(both) || are_slid(both))
    }

    /// Whether two equilibria differ by no more than a share of the energy, and in no number of negative modes.
    fn is_level(&self, a: &Equilibrium, b: &Equilibrium, share: f64) -> bool {
        let index = |e: &Equilibrium| e.stability.map(|s| s.negative_modes);
        let most = share * self.size(a).max(self.size(b));
        (a.energy - b.energy).abs() <= most && index(a) == index(b)
    }

    /// Scale of differences of energy: the bending energy, because the zero of a load's potential is arbitrary; of a flat
    /// belt `flat_energy`.
    pub(super) fn size(&self, equilibrium: &Equilibrium) -> f64 {
        let unit = equilibrium.problem.units().energy;
        equilibrium.elastic_energy.max(self.flat_energy * unit)
    }

    /// Whether the first of two mirror images bulges more along `solver.bulge`.
    pub(super) fn is_higher(&self, one: &Equilibrium, other: &Equilibrium) -> bool {
        height(one) > height(other) + self.higher * one.spine.length()
    }
}

/// Whether to go on with a search of no more than some iterations, asked once an iteration.
fn at_most(iterations: usize, watch: &dyn Watch) -> impl FnMut() -> ControlFlow<()> {
    let mut left = iterations;
    move || match left.checked_sub(1) {
        Some(less) => {
            left = less;
            watch.proceed()
        }
        None => ControlFlow::Break(()),
    }
}

/// Places of the spine at which two shapes are compared, a number.
const PLACES: usize = 80;

/// The solutions of two equilibria, if both have one.
fn solved<'a>(a: &'a Equilibrium, b: &'a Equilibrium) -> Option<[&'a Solved; 2]> {
    Some([a.developable()?, b.developable()?])
}
