//! Derivatives of the present shape by the motion of a support, by the factorisation that the tracker keeps.

use super::Led;
use crate::analysis::sensitivity::{Motion, NoSensitivity, add_support_motion, node_motion};
use crate::analysis::tracking::Derivatives;
use crate::equilibrium::model::StripModel;
use crate::problem::program::rows_of;
use nalgebra::{Matrix3x6, Matrix6, Vector3};
use stagewise::{Direction, Program};

impl<D: StripModel<F, N>, const F: usize, const N: usize> Led<D, F, N> {
    /// As [`Tracker::derivatives`](super::super::Tracker::derivatives).
    pub(in super::super) fn derivatives(
        &mut self,
        support: usize,
    ) -> Result<Derivatives, NoSensitivity> {
        if self.is_taut() {
            return Err(NoSensitivity::NoSlack);
        }
        let program = self.follower.program();
        if program.undetermined(self.point()).is_some() {
            return Err(NoSensitivity::Redundant("supports".to_owned()));
        }
        if D::is_flat(self.follower.program(), self.point()) {
            return Err(NoSensitivity::Flat);
        }
        let units = self.units();
        let nodes = self.point().poses.len();
        let mut derivatives = Derivatives {
            position: vec![Matrix3x6::zeros(); nodes],
            rotation: vec![Matrix3x6::zeros(); nodes],
            reaction: Matrix6::zeros(),
        };
        let held = program.supports[support].clone();
        let multipliers = &self.follower.multipliers().equalities;
        let poses = self.point().poses.clone();
        let turn = held.turn(&poses[held.node], &rows_of(multipliers, support));
        let mut change = Direction::<N>::zeros(&program.layout());
        for column in 0..6 {
            change.nodes.iter_mut().for_each(|node| node.fill(0.0));
            change.equalities.fill(0.0);
            let mut motion = Motion::default();
            match column {
                0..3 => motion.translation[column] = 1.0 / units.length,
                _ => motion.rotation[column - 3] = 1.0,
            }
            add_support_motion(
                &held,
                &turn,
                &poses[held.node],
                support,
                &motion,
                &mut change,
            );
            let (steps, by_rows) = self.follower.response(&change.nodes, &change.equalities);
            for (k, (pose, step)) in poses.iter().zip(steps).enumerate() {
                let moved = node_motion(pose, step);
                let translation = moved.translation * units.length;
                derivatives.position[k].set_column(column, &translation);
                derivatives.rotation[k].set_column(column, &moved.rotation);
            }
            let node_rotation = node_motion(&poses[held.node], &steps[held.node]).rotation;
            let rows = rows_of(by_rows, support);
            let force: Vector3<f64> = -held.held(&rows.fixed_rows::<3>(0).into());
            // As the reaction of the derivatives of an equilibrium: of the multipliers, of the turn of the node, and of the
            // support's own turn.
            let moment = -turn.jacobian.tr_mul(&rows.fixed_rows::<3>(3))
                + turn.hessian * (motion.rotation - node_rotation)
                + 0.5
                    * turn
                        .generalised_force
                        .cross(&(motion.rotation + node_rotation));
            let mut into = derivatives.reaction.column_mut(column);
            into.fixed_rows_mut::<3>(0)
                .copy_from(&(force * units.force()));
            into.fixed_rows_mut::<3>(3)
                .copy_from(&(moment * units.energy));
        }
        Ok(derivatives)
    }

    /// The line across the belt at a node, ζ − β η, world axes.
    pub(in super::super) fn rib(&self, node: usize) -> Vector3<f64> {
        let frame = &self.point().poses[node].frame;
        frame.column(2) - self.rib_slope(node) * frame.column(1)
    }
}
