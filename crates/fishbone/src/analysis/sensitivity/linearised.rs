//! The factorised first-order conditions of an equilibrium, of any model of the strip.

use super::scales::Scales;
use super::system::System;
use super::{Change, Motion, NoSensitivity, Parameters};
use crate::equilibrium::model::StripModel;
use crate::equilibrium::{Equilibrium, Solved};
use crate::geometry::Wrench;
use nalgebra::Vector3;
use stagewise::{Direction as Step, Response, Singular};

/// The factorised first-order conditions of an equilibrium.
#[derive(Debug)]
pub(super) struct Linearised<D: StripModel<F, N>, const F: usize, const N: usize> {
    response: Response<6, F, N>,
    system: System<D, F, N>,
    pub(super) scales: Scales,
    pub(super) nodes: usize,
}

impl<D: StripModel<F, N>, const F: usize, const N: usize> Linearised<D, F, N> {
    /// Factorises the first-order conditions of an equilibrium, given with its solved programme.
    pub(super) fn of(
        equilibrium: &Equilibrium,
        solved: &Solved<D, F, N>,
    ) -> Result<Self, NoSensitivity> {
        if let Some(names) = &solved.redundant {
            return Err(NoSensitivity::Redundant(names.clone()));
        }
        if solved.inertia.is_some_and(|inertia| inertia.negative > 0) {
            return Err(NoSensitivity::Saddle);
        }
        if equilibrium.problem.has_no_slack() {
            return Err(NoSensitivity::NoSlack);
        }
        if solved.is_flat {
            return Err(NoSensitivity::Flat);
        }
        let response = Response::of_minimum(&solved.program, &mut solved.at.clone());
        let mut linearised = Self {
            response: response.map_err(|Singular| NoSensitivity::Marginal)?,
            system: System::new(solved),
            scales: Scales::new(&equilibrium.problem, &solved.program),
            nodes: solved.at.point.poses.len(),
        };
        let is_strict = solved
            .inertia
            .is_some_and(|inertia| inertia.zero + inertia.symmetries == 0);
        match is_strict || linearised.is_held() {
            true => Ok(linearised),
            false => Err(NoSensitivity::Marginal),
        }
    }

    /// No change of the equilibrium.
    fn no_change(&self) -> Change {
        let nothing = Vector3::zeros();
        let no_wrench = Wrench {
            force: nothing,
            moment: nothing,
        };
        Change {
            position: vec![nothing; self.nodes],
            rotation: vec![nothing; self.nodes],
            bend: vec![0.0; self.nodes],
            rib_slope: vec![0.0; self.nodes],
            reactions: vec![no_wrench; self.scales.supports()],
            energy: 0.0,
        }
    }

    /// As [`Sensitivity::forward`](super::Sensitivity::forward).
    pub(super) fn forward(&mut self, parameters: &Parameters) -> Result<Change, NoSensitivity> {
        let direction = self.scales.to_program(parameters, self.system.unchanged());
        let mut right = self.response.zero();
        self.system.add_change(&direction, &mut right);
        let solution = self.solve(&right)?;
        let units = self.scales.units;
        let mut change = self.no_change();
        for k in 0..self.nodes {
            let motion = self.system.motion(k, &solution.nodes);
            change.position[k] = motion.translation * units.length;
            change.rotation[k] = motion.rotation;
            change.bend[k] = solution.nodes[k][6] / units.length;
            change.rib_slope[k] = solution.nodes[k][7];
        }
        let responses = self.system.response(&solution).supports;
        for (i, reaction) in change.reactions.iter_mut().enumerate() {
            let own = self.system.own_moment(i, &direction.supports[i].rotation);
            *reaction = Wrench {
                force: responses[i].translation * units.force(),
                moment: (responses[i].rotation + own) * units.energy,
            };
        }
        change.energy = self.system.by_change().dot(&direction) * units.energy
            + self.scales.origin_by_gravity.dot(&parameters.gravity);
        Ok(change)
    }

    /// As [`Sensitivity::adjoint`](super::Sensitivity::adjoint).
    pub(super) fn adjoint(&mut self, by: &Change) -> Result<Parameters, NoSensitivity> {
        let units = self.scales.units;
        let mut direction = self.system.unchanged();
        for (motion, by_reaction) in direction.supports.iter_mut().zip(&by.reactions) {
            *motion = Motion {
                translation: by_reaction.force * units.force(),
                rotation: by_reaction.moment * units.energy,
            };
        }
        let mut right = self.response.zero();
        self.system.add_change(&direction, &mut right);
        for k in 0..self.nodes {
            let force = by.position[k] * units.length;
            self.system
                .add_generalised_force(k, &force, &by.rotation[k], &mut right.nodes);
            right.nodes[k][6] += by.bend[k] / units.length;
            right.nodes[k][7] += by.rib_slope[k];
        }
        let solution = self.solve(&right)?;
        let mut gradient = self.system.response(&solution);
        for (i, by_reaction) in direction.supports.iter().enumerate() {
            gradient.supports[i].rotation += self.system.by_own_moment(i, &by_reaction.rotation);
        }
        gradient.add(by.energy * units.energy, &self.system.by_change());
        let mut parameters = self.scales.to_scenario(&gradient, self.nodes);
        parameters.gravity += by.energy * self.scales.origin_by_gravity;
        Ok(parameters)
    }

    /// Whether no node moves far under unit loads, so that no compliance is infinite. Where the belt does not bend, the
    /// slope of its ribs costs nothing, but moves no node either.
    fn is_held(&mut self) -> bool {
        /// Displacement under unit loads from which the belt counts as free to move, in U.
        const FAR: f64 = 1e6;
        let mut right = self.response.zero();
        for k in 0..self.nodes {
            let in_general =
                |seed: f64| Vector3::new(1.0, 2.0, 3.0).map(|i| (i * k as f64 + seed).sin());
            let [force, moment] = [1.0, 2.0].map(|seed| in_general(seed) / self.nodes as f64);
            self.system
                .add_generalised_force(k, &force, &moment, &mut right.nodes);
        }
        self.response.solve(&right).is_ok_and(|solution| {
            let motions = (0..self.nodes).map(|k| self.system.motion(k, &solution.nodes));
            motions.fold(0.0, |most, motion| {
                f64::max(most, motion.translation.amax())
            }) < FAR
        })
    }

    fn solve(&mut self, right: &Step<N>) -> Result<Step<N>, NoSensitivity> {
        self.response
            .solve(right)
            .map_err(|Singular| NoSensitivity::NoSlack)
    }
}
