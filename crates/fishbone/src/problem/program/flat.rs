//! Flat belts and belts at rest, and the programme of a belt that may twist where it is flat, by whatever slope of ribs.

use super::{BeltPoint, BeltProgram, Piece};
use crate::strip::density::Density;
use crate::strip::flat::{FLAT, FreeTorsion};
use nalgebra::SVector;
use stagewise::{Program, Stationary};

/// The programme of a belt with its torsion as a third field.
pub(crate) type TwistingProgram = BeltProgram<FreeTorsion, 3, 9>;

impl<const F: usize> BeltPoint<F> {
    /// Whether the belt is flat all along.
    pub(crate) fn is_flat(&self) -> bool {
        self.fields.iter().all(|fields| fields[0].abs() <= FLAT)
    }
}

impl<D: Density<F>, const F: usize, const N: usize> BeltProgram<D, F, N> {
    /// Whether a part of the belt has a natural bend.
    pub(crate) fn is_curled(&self) -> bool {
        self.elements().any(|(_, element)| element.curl.bend != 0.0)
    }

    /// Whether a shape has no energy and the belt no load.
    pub(crate) fn is_at_rest(&self, shape: &BeltPoint<F>) -> bool {
        /// Energy that is nothing but rounding, in mean R_f/U.
        const NOTHING: f64 = 1e-20;
        !self.is_loaded() && self.elastic_energy(&shape.fields) <= NOTHING
    }
}

impl BeltProgram {
    /// The nodes inside flat parts: flat, with flat elements alone beside them.
    pub(crate) fn flat_nodes(&self, point: &BeltPoint) -> Vec<bool> {
        let is_flat = |node: usize| point.fields[node][0].abs() <= FLAT;
        let mut inside: Vec<bool> = (0..point.fields.len()).map(is_flat).collect();
        for (k, _) in self.elements() {
            if !(is_flat(k) && is_flat(k + 1)) {
                (inside[k], inside[k + 1]) = (false, false);
            }
        }
        inside
    }

    /// The programme in which flat parts may twist beyond their ribs, and its stationary point with slopes of the ribs inside
    /// flat parts: its energy is no more than that of this programme, and equal at the point.
    ///
    /// The ribs inside flat parts keep their slopes and are not bounded, and the elements there count as narrow.
    pub(crate) fn twisting(
        &self,
        at: &Stationary<BeltPoint>,
        slopes: &[f64],
    ) -> (TwistingProgram, Stationary<BeltPoint<3>>) {
        /// Width of a flat element over its own, dimensionless: its ribs never cross.
        const NARROW: f64 = 1e-3;
        let layout = self.layout();
        let inside = self.flat_nodes(&at.point);
        let is_flat = |node: usize| at.point.fields[node][0].abs() <= FLAT;
        let (mut pieces, mut multipliers) = (self.pieces.clone(), at.multipliers.clone());
        for (k, piece) in pieces.iter_mut().enumerate() {
            if let Piece::Strip(element) = piece
                && is_flat(k)
                && is_flat(k + 1)
            {
                // On an arc, leaning ribs miss a part of the width.
                let softened = 1.0 / (1.0 + element.geodesic.abs() * element.half_width);
                element.rigidity = element.rigidity.map(|rigidity| rigidity * softened);
                element.half_width *= NARROW;
                multipliers.inequalities[layout.stage_rows(k)].fill(0.0);
            }
        }
        let fixed = self.fixed.iter().zip(&inside).zip(slopes);
        let fixed = fixed.map(|((fixed, inside), slope)| match inside {
            true => [fixed[0], Some(*slope), None],
            false => [fixed[0], fixed[1], Some(0.0)],
        });
        let program = BeltProgram {
            fixed: fixed.collect(),
            pieces,
            edges: self.edges.clone(),
            model: FreeTorsion { model: self.model },
            supports: self.supports.clone(),
            links: self.links.clone(),
            loads: self.loads.clone(),
            weight: self.weight,
            half_turns: self.half_turns,
            obstacles: self.obstacles.clone(),
        };
        let mut point = BeltPoint {
            fields: at
                .point
                .fields
                .iter()
                .map(|fields| SVector::from([fields[0], fields[1], 0.0]))
                .collect(),
            poses: at.point.poses.clone(),
        };
        program.settle(&mut point);
        (program, Stationary { point, multipliers })
    }
}
