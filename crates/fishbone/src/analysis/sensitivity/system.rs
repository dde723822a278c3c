//! The linearised first-order conditions of a belt, and their right-hand sides for changes of its data.

use super::Motion;
use super::data::{ByData, Data, HALF_WIDTH};
use super::motion::{add_generalised_force, add_support_motion, motion};
use crate::equilibrium::Solved;
use crate::problem::program::{
    BeltPoint, BeltProgram, NodeSupport, Piece, Rows, Turn, rows_of, weight,
};
use crate::strip::density::Density;
use nalgebra::Vector3;
use stagewise::{Direction as Step, NodeVector, Program};
use std::ops::Range;

/// A change of a programme's data, in its units; or a derivative by such a change.
#[derive(Debug, Clone)]
pub(super) struct Direction {
    /// Motions of the supports.
    pub(super) supports: Vec<Motion>,
    /// Changes of the elements' data, one entry a piece.
    pub(super) elements: Vec<Data>,
    /// Change of the weight per unit length.
    pub(super) weight: Vector3<f64>,
}

impl Direction {
    pub(super) fn add(&mut self, factor: f64, other: &Self) {
        for (own, other) in self.supports.iter_mut().zip(&other.supports) {
            own.add(factor, other);
        }
        for (own, other) in self.elements.iter_mut().zip(&other.elements) {
            *own += factor * other;
        }
        self.weight += factor * other.weight;
    }

    pub(super) fn dot(&self, other: &Self) -> f64 {
        let supports = self.supports.iter().zip(&other.supports);
        let elements = self.elements.iter().zip(&other.elements);
        supports.map(|(a, b)| a.dot(b)).sum::<f64>()
            + elements.map(|(a, b)| a.dot(b)).sum::<f64>()
            + self.weight.dot(&other.weight)
    }
}

/// Derivatives of the Lagrangian by the programme's data.
#[derive(Debug)]
pub(super) struct System<D, const F: usize, const N: usize> {
    program: BeltProgram<D, F, N>,
    point: BeltPoint<F>,
    multipliers: Vec<Rows>,
    turns: Vec<Turn>,
    elements: Vec<Option<ByData<F>>>,
    /// Rows of the inequalities of every piece.
    rows: Vec<Range<usize>>,
}

impl<D: Density<F>, const F: usize, const N: usize> System<D, F, N> {
    pub(super) fn new(solved: &Solved<D, F, N>) -> Self {
        let (program, point) = (&solved.program, &solved.at.point);
        let multipliers = &solved.at.multipliers;
        let supports = program.supports.iter().enumerate();
        let multipliers_of = |place| rows_of(&multipliers.equalities, place);
        let layout = program.layout();
        let rows: Vec<_> = (0..layout.stages())
            .map(|stage| layout.stage_rows(stage))
            .collect();
        Self {
            turns: supports
                .map(|(i, support)| support.turn(&point.poses[support.node], &multipliers_of(i)))
                .collect(),
            elements: by_data(program, point, &rows, &multipliers.inequalities),
            rows,
            multipliers: (0..program.supports.len()).map(multipliers_of).collect(),
            program: program.clone(),
            point: point.clone(),
        }
    }

    fn supports(&self) -> impl Iterator<Item = (usize, &NodeSupport, &Turn)> {
        let supports = self.program.supports.iter().zip(&self.turns);
        supports
            .enumerate()
            .map(|(i, (support, turn))| (i, support, turn))
    }

    /// The flexible elements, each with its number.
    fn elements(&self) -> impl Iterator<Item = (usize, &ByData<F>)> {
        let elements = self.elements.iter().enumerate();
        elements.filter_map(|(k, element)| Some((k, element.as_ref()?)))
    }

    /// The zero change.
    pub(super) fn unchanged(&self) -> Direction {
        Direction {
            supports: vec![Motion::default(); self.turns.len()],
            elements: vec![Data::zeros(); self.elements.len()],
            weight: Vector3::zeros(),
        }
    }

    /// Adds the right-hand side of a change.
    pub(super) fn add_change(&self, change: &Direction, into: &mut Step<N>) {
        for (i, support, turn) in self.supports() {
            let pose = &self.point.poses[support.node];
            add_support_motion(support, turn, pose, i, &change.supports[i], into);
        }
        for (k, element) in self.elements() {
            let data = &change.elements[k];
            for (node, mixed) in [k, k + 1].into_iter().zip(&element.mixed) {
                let mut fields = into.nodes[node].fixed_rows_mut::<F>(6);
                fields += mixed * data;
            }
            let rows = &mut into.inequalities[self.rows[k].clone()];
            for (row, slack) in rows.iter_mut().zip(&element.slacks) {
                *row += slack * data[HALF_WIDTH];
            }
        }
        for (node, force, lever) in self.weights(change.weight) {
            let force = -force;
            self.add_generalised_force(node, &force, &lever.cross(&force), &mut into.nodes);
        }
    }

    /// The derivative, by a change, of a solution's product with the change's right-hand side: the transpose of
    /// [`Self::add_change`].
    pub(super) fn response(&self, solution: &Step<N>) -> Direction {
        let mut response = self.unchanged();
        for (i, support, turn) in self.supports() {
            let rows = rows_of(&solution.equalities, i);
            let rotation = self.motion(support.node, &solution.nodes).rotation;
            response.supports[i] = Motion {
                translation: -support.held(&rows.fixed_rows::<3>(0).into()),
                rotation: -turn.jacobian.tr_mul(&rows.fixed_rows::<3>(3)) - turn.hessian * rotation
                    + 0.5 * turn.generalised_force.cross(&rotation),
            };
        }
        for (k, element) in self.elements() {
            let data = &mut response.elements[k];
            for (node, mixed) in [k, k + 1].into_iter().zip(&element.mixed) {
                *data += mixed.tr_mul(&solution.nodes[node].fixed_rows::<F>(6));
            }
            let rows = &solution.inequalities[self.rows[k].clone()];
            for (row, slack) in rows.iter().zip(&element.slacks) {
                data[HALF_WIDTH] += slack * row;
            }
        }
        for (node, share, lever) in self.weights(Vector3::repeat(1.0)) {
            let Motion {
                translation,
                rotation,
            } = self.motion(node, &solution.nodes);
            let moved = translation + rotation.cross(&lever);
            response.weight -= share.component_mul(&moved);
        }
        response
    }

    /// Derivative of the least energy by the programme's data, among them the reactions.
    pub(super) fn by_change(&self) -> Direction {
        let mut by = self.unchanged();
        for (i, support, turn) in self.supports() {
            let force = self.multipliers[i].fixed_rows::<3>(0).into();
            by.supports[i] = Motion {
                translation: -support.held(&force),
                rotation: -turn.generalised_force,
            };
        }
        for (k, element) in self.elements() {
            by.elements[k] = element.first;
        }
        for (node, share, lever) in self.weights(Vector3::repeat(1.0)) {
            let at = self.point.poses[node].position + lever;
            by.weight -= share.component_mul(&at);
        }
        by
    }

    /// The change of a support's reaction moment as the support turns and the belt does not move.
    pub(super) fn own_moment(&self, support: usize, rotation: &Vector3<f64>) -> Vector3<f64> {
        let turn = &self.turns[support];
        turn.hessian * rotation + 0.5 * turn.generalised_force.cross(rotation)
    }

    /// The transpose of [`Self::own_moment`].
    pub(super) fn by_own_moment(&self, support: usize, moment: &Vector3<f64>) -> Vector3<f64> {
        let turn = &self.turns[support];
        turn.hessian * moment - 0.5 * turn.generalised_force.cross(moment)
    }

    /// The weight of the belt at its nodes: node, force, lever in world axes.
    fn weights(
        &self,
        per_length: Vector3<f64>,
    ) -> impl Iterator<Item = (usize, Vector3<f64>, Vector3<f64>)> {
        let pieces = self.program.pieces.iter().map(Piece::length).enumerate();
        pieces.flat_map(move |(k, length)| {
            let [first, second] = weight(&per_length, length);
            [(k, first), (k + 1, second)].map(|(node, load)| {
                let lever = self.point.poses[node].frame * load.lever;
                (node, load.force, lever)
            })
        })
    }

    /// Motion of a node along a step.
    pub(super) fn motion(&self, node: usize, step: &[NodeVector<N>]) -> Motion {
        motion(&self.point.poses[node], &step[node])
    }

    /// Adds a generalised force at a node, given as force and moment, to a derivative by the unknowns.
    pub(super) fn add_generalised_force(
        &self,
        node: usize,
        force: &Vector3<f64>,
        moment: &Vector3<f64>,
        into: &mut [NodeVector<N>],
    ) {
        add_generalised_force(&self.point.poses[node], force, moment, &mut into[node]);
    }
}

fn by_data<D: Density<F>, const F: usize, const N: usize>(
    program: &BeltProgram<D, F, N>,
    point: &BeltPoint<F>,
    rows: &[Range<usize>],
    multipliers: &[f64],
) -> Vec<Option<ByData<F>>> {
    let mut by_data: Vec<_> = program.pieces.iter().map(|_| None).collect();
    for (k, element) in program.elements() {
        let fields = [k, k + 1].map(|node| &point.fields[node]);
        let multipliers = &multipliers[rows[k].clone()];
        let edges = &program.edges[k];
        by_data[k] = Some(ByData::at(
            &program.model,
            element,
            edges,
            fields,
            multipliers,
        ));
    }
    by_data
}
