//! The programme's values and derivatives, for the solver.

use super::{BeltPoint, BeltProgram, DeadForce, Piece, ROWS, add_wrench, rows_of};
use crate::geometry::{Pose, Twist, hat};
use crate::strip::density::{Density, Derivatives, LANES, Loaded};
use crate::strip::element::Element;
use nalgebra::{Matrix3, Matrix3x6, Matrix6, SMatrix, SVector, Vector6};
use num_dual::{Dual64, HyperDual64};
use stagewise::{
    Layout, Linearisation, Multipliers, NodeVector, Program, Residuals, StageMatrix, Values,
};

impl<D: Density<F>, const F: usize, const N: usize> Program<6, F, N> for BeltProgram<D, F, N> {
    type Point = BeltPoint<F>;

    fn layout(&self) -> Layout {
        let weight = |piece: &Piece| match piece {
            Piece::Strip(element) => element.length,
            Piece::Rigid { .. } | Piece::Joint { .. } => 0.0,
        };
        let bounds = |(k, piece): (usize, &Piece)| match piece {
            Piece::Strip(element) => self.model.inequalities(element, &self.edges[k]),
            Piece::Rigid { .. } | Piece::Joint { .. } => 0,
        };
        let half_width = self.elements().map(|(_, element)| element.half_width);
        let controls = self.model.weights(half_width.fold(0.0, f64::max));
        let layout = Layout::new(self.pieces.iter().map(weight).collect())
            .with_control_weights(controls.into())
            .with_stage_inequalities(self.pieces.iter().enumerate().map(bounds));
        let supports = self.supports.iter();
        let layout = supports.fold(layout, |layout, support| {
            layout.with_equalities_at(support.node, ROWS)
        });
        let links = self.links.iter();
        let layout = links.fold(layout, |layout, link| {
            layout.with_equalities_between(link.nodes, ROWS)
        });
        let obstacles = self.obstacles.iter();
        obstacles.fold(layout, |layout, contact| {
            layout.with_inequalities_at(contact.node, 1, contact.weight)
        })
    }

    /// The elastic energy: for given supports the square of how far a belt bends. Zero of a flat belt without a natural bend.
    fn size(&self, point: &Self::Point) -> f64 {
        match point.is_flat() && !self.is_curled() {
            true => 0.0,
            false => self.elastic_energy(&point.fields).min(1.0),
        }
    }

    fn evaluate(&self, point: &mut BeltPoint<F>, values: &mut Values) -> bool {
        values.slacks.clear();
        for (k, element) in self.elements() {
            let ends = [&point.fields[k], &point.fields[k + 1]];
            let slacks = &mut values.slacks;
            self.model.slacks(element, &self.edges[k], ends, slacks);
        }
        values.equalities.clear();
        if self.rib_leaves_through_bend(point) {
            return false;
        }
        self.carry(point);
        for support in &self.supports {
            let rows = support.value(&point.poses[support.node]);
            values.equalities.extend(&rows);
        }
        for link in &self.links {
            values.equalities.extend(&link.value(point));
        }
        for contact in &self.obstacles {
            values.slacks.push(contact.gap(&point.poses[contact.node]));
        }
        let admissible = values.slacks.iter().all(|slack| *slack > 0.0);
        if admissible {
            values.objective =
                self.elastic_energy(&point.fields) + self.load_potential(&point.poses);
        }
        admissible && values.objective.is_finite()
    }

    fn equality_gradients(&self, point: &BeltPoint<F>, into: &mut [NodeVector<N>]) {
        for (support, rows) in self.supports.iter().zip(into.chunks_exact_mut(ROWS)) {
            let jacobian = support.jacobian(&point.poses[support.node]);
            for (row, gradient) in rows.iter_mut().zip(jacobian.row_iter()) {
                row.fill(0.0);
                row.fixed_rows_mut::<6>(0).tr_copy_from(&gradient);
            }
        }
    }

    fn linearise(
        &self,
        point: &BeltPoint<F>,
        multipliers: &Multipliers,
        into: &mut Linearisation<6, F, N>,
    ) {
        let (multipliers, bounds) = (&multipliers.equalities, &multipliers.inequalities);
        into.gradient.fill(NodeVector::zeros());
        self.wrenches(point, multipliers, &mut into.gradient);
        let contacts = self.linearise_obstacles(point, bounds, into);
        into.chain.first_free = self.free(0);
        self.linearise_elements(point, bounds, into);
        for k in (0..self.pieces.len()).rev() {
            into.chain.stages[k].free = self.free(k + 1);
            if self.is_tied(k + 1) {
                self.linearise_tie(k, point, bounds, into);
            }
        }
        self.linearise_steps(point, bounds, into);
        for by_node in &mut into.gradient[1..] {
            by_node.fixed_rows_mut::<6>(0).fill(0.0);
        }
        self.linearise_conditions(point, multipliers, into);
        if !self.obstacles.is_empty() {
            self.leave_out(contacts, into);
        }
    }

    fn retract(
        &self,
        point: &BeltPoint<F>,
        step: &[NodeVector<N>],
        length: f64,
        into: &mut BeltPoint<F>,
    ) {
        for (k, step) in step.iter().enumerate() {
            let step = length * step.fixed_rows::<F>(6);
            into.fields[k] = self.model.moved(&point.fields[k], &step);
            self.carry_across(into, k);
        }
        let twist = Twist::from_vector(&(length * step[0].fixed_rows::<6>(0)));
        into.poses[0] = Pose::exp(&twist) * point.poses[0];
    }

    fn rounding(&self, point: &BeltPoint<F>, node: usize) -> SVector<f64, F> {
        point.fields[node].abs() * f64::EPSILON
    }

    /// Under large forces rounding of the poses turns into moments: no search makes stationarity smaller.
    fn judged(&self, residuals: Residuals, multipliers: &Multipliers) -> Residuals {
        /// Force from which its rounding counts, in mean R_f/U².
        const LARGE: f64 = 1e6;
        /// Rounding of stationarity as a share of the largest force, dimensionless.
        const ROUNDING: f64 = 20.0 * f64::EPSILON;
        /// Most that counts as rounding, in mean R_f/U: multipliers grow without bound where a search goes astray.
        const MOST: f64 = 1e-3;
        let forces = multipliers.equalities.iter().map(|force| force.abs());
        let largest = forces.fold(self.total_load(), f64::max);
        let rounding = match largest > LARGE {
            true => MOST.min(ROUNDING * largest),
            false => 0.0,
        };
        // NaN stays NaN.
        let stationarity = match residuals.stationarity <= rounding {
            true => 0.0,
            false => residuals.stationarity - rounding,
        };
        Residuals {
            stationarity,
            ..residuals
        }
    }

    /// The mean square displacement of the board, in U², of uniform weight: a node carries half of both pieces beside it, as
    /// a strip across the spine that turns with the frame.
    fn metric(&self, point: &BeltPoint<F>) -> Vec<Matrix6<f64>> {
        let half_width = self.elements().map(|(_, element)| element.half_width);
        let across = half_width.fold(0.0, f64::max).powi(2) / 3.0;
        let length = |k: Option<usize>| {
            k.and_then(|k| self.pieces.get(k))
                .map_or(0.0, Piece::length)
        };
        let of_node = |(k, pose): (usize, &Pose)| {
            let share = 0.5 * (length(k.checked_sub(1)) + length(Some(k)));
            let mut moved = Matrix3x6::identity();
            moved
                .fixed_columns_mut::<3>(3)
                .copy_from(&-hat(&pose.position));
            let mut metric = moved.tr_mul(&moved);
            let along_rib = pose.frame.column(2);
            let mut turns = metric.fixed_view_mut::<3, 3>(3, 3);
            turns += across * (Matrix3::identity() - along_rib * along_rib.transpose());
            share * metric
        };
        point.poses.iter().enumerate().map(of_node).collect()
    }

    fn symmetries(&self, point: &BeltPoint<F>) -> Vec<Vec<NodeVector<N>>> {
        self.find_symmetries(point)
    }
}

impl<D: Density<F>, const F: usize, const N: usize> BeltProgram<D, F, N> {
    /// Derivatives of the elements, block by block; the gradient holds the wrench at every node.
    fn linearise_elements(
        &self,
        point: &BeltPoint<F>,
        bounds: &[f64],
        into: &mut Linearisation<6, F, N>,
    ) {
        let mut derivatives = D::Derivatives::default();
        for (pieces, from) in self.pieces.chunks(LANES).zip((0..).step_by(LANES)) {
            for (lane, piece) in pieces.iter().enumerate() {
                let k = from + lane;
                if let Piece::Strip(element) = piece {
                    let wrench = into.gradient[k + 1].fixed_rows::<6>(0).into_owned();
                    let loaded = Loaded {
                        element,
                        fields: [&point.fields[k], &point.fields[k + 1]],
                        poses: [&point.poses[k], &point.poses[k + 1]],
                        wrench: &wrench,
                    };
                    derivatives.set(lane, &self.model, &loaded);
                }
            }
            derivatives.find(&self.model);
            for (lane, piece) in pieces.iter().enumerate() {
                if let Piece::Strip(element) = piece {
                    let k = from + lane;
                    let [first, second] = derivatives.gradient(lane);
                    let mut controls = derivatives.hessian(lane);
                    self.linearise_bounds(k, element, point, bounds, &mut controls, into);
                    into.diagonal.controls[k] = controls;
                    derivatives.carry(lane, &mut into.chain.stages[k]);
                    for (node, gradient) in [(k, first), (k + 1, second)] {
                        let mut part = into.gradient[node].fixed_rows_mut::<F>(6);
                        part += gradient;
                    }
                }
            }
        }
    }

    /// Second derivatives of the curves along which the fields of nodes move.
    fn linearise_steps(
        &self,
        point: &BeltPoint<F>,
        bounds: &[f64],
        into: &mut Linearisation<6, F, N>,
    ) {
        let last = self.pieces.len();
        for (node, fields) in point.fields.iter().enumerate() {
            if self.is_tied(node) {
                continue;
            }
            let gradient = || {
                let own = by_fields(node, bounds, into);
                match into.chain.stages.get(node).and_then(|stage| stage.tie) {
                    Some(tie) => own + tie.tr_mul(&by_fields(node + 1, bounds, into)),
                    None => own,
                }
            };
            if let Some(second) = self.model.curvature_of_steps(fields, gradient) {
                let own = match node == last {
                    true => &mut into.diagonal.controls[node - 1].second,
                    false => &mut into.diagonal.controls[node].first,
                };
                *own += second;
            }
        }
    }

    /// Gradients of the bounds of an element's ribs; subtracts their second derivatives from the Hessian by the element's
    /// fields.
    fn linearise_bounds(
        &self,
        k: usize,
        element: &Element,
        point: &BeltPoint<F>,
        multipliers: &[f64],
        controls: &mut StageMatrix<F>,
        into: &mut Linearisation<6, F, N>,
    ) {
        let rows = into.layout().stage_rows(k);
        let ends = [&point.fields[k], &point.fields[k + 1]];
        self.model.linearise_slacks(
            element,
            &self.edges[k],
            ends,
            &multipliers[rows.clone()],
            &mut into.stage_slacks[rows],
            controls,
        );
    }

    /// Gradients and second derivatives of the obstacles' gaps. The contacts' wrench is added to the gradient of the
    /// programme, for the second derivatives along the chain; the contacts' own share of the gradient is returned.
    fn linearise_obstacles(
        &self,
        point: &BeltPoint<F>,
        bounds: &[f64],
        into: &mut Linearisation<6, F, N>,
    ) -> Vec<NodeVector<N>> {
        let mut contacts = Vec::new();
        if self.obstacles.is_empty() {
            return contacts;
        }
        contacts.resize(point.poses.len(), NodeVector::zeros());
        let first = into.layout().inequalities_at_stages();
        for (i, contact) in self.obstacles.iter().enumerate() {
            let (pose, multiplier) = (&point.poses[contact.node], bounds[first + i]);
            let gradient = contact.gradient(pose);
            into.node_slacks[i].fill(0.0);
            into.node_slacks[i]
                .fixed_rows_mut::<6>(0)
                .copy_from(&gradient);
            let hessian = into.inequality_hessian(i);
            hessian.fill(0.0);
            hessian
                .fixed_view_mut::<6, 6>(0, 0)
                .copy_from(&(-multiplier * contact.hessian(pose)));
            add_wrench(&mut contacts[contact.node], &(-multiplier * gradient));
        }
        let mut beyond = Vector6::zeros();
        for (wrench, own) in into.gradient.iter_mut().zip(&contacts).rev() {
            beyond += own.fixed_rows::<6>(0);
            add_wrench(wrench, &beyond);
        }
        contacts
    }

    /// Subtracts the first-order part of the contacts from the gradient again: the solver adds it itself.
    fn leave_out(&self, mut contacts: Vec<NodeVector<N>>, into: &mut Linearisation<6, F, N>) {
        into.chain.carry_back(&mut contacts);
        for (gradient, contact) in into.gradient.iter_mut().zip(&contacts) {
            *gradient -= contact;
        }
    }

    /// The fields carried on across a joint: their derivatives, and the second derivative that they add.
    fn linearise_tie(
        &self,
        k: usize,
        point: &BeltPoint<F>,
        bounds: &[f64],
        into: &mut Linearisation<6, F, N>,
    ) {
        let (fields, tied) = (point.fields[k].data.0[0], self.tied(k + 1));
        let forces = by_fields(k + 1, bounds, into);
        let tie = into.chain.stages[k].tie.insert(SMatrix::zeros());
        let own = &mut into.diagonal.controls[k];
        *own = StageMatrix::zeros();
        for a in 0..F {
            let mut seeded = fields.map(Dual64::from);
            seeded[a].eps = 1.0;
            let Some(beyond) = self.beyond(k + 1, &seeded) else {
                return;
            };
            for i in 0..F {
                tie[(i, a)] = if tied[i] { beyond[i].eps } else { 0.0 };
            }
            for b in 0..F {
                let mut seeded = fields.map(HyperDual64::from);
                (seeded[a].eps1, seeded[b].eps2) = (1.0, 1.0);
                let beyond = self.beyond(k + 1, &seeded);
                let terms = beyond.into_iter().flatten().zip(&forces).zip(tied);
                let second = terms.map(|((beyond, force), tied)| match tied {
                    true => beyond.eps1eps2 * force,
                    false => 0.0,
                });
                own.first[(a, b)] = second.sum();
            }
        }
    }

    /// Derivatives of supports, links and loads at their nodes; second derivatives by the nodes' states.
    fn linearise_conditions(
        &self,
        point: &BeltPoint<F>,
        multipliers: &[f64],
        into: &mut Linearisation<6, F, N>,
    ) {
        self.equality_gradients(point, &mut into.equalities_at);
        for (i, support) in self.supports.iter().enumerate() {
            let pose = &point.poses[support.node];
            let hessian = into.equality_hessian(i);
            hessian.fill(0.0);
            hessian
                .fixed_view_mut::<6, 6>(0, 0)
                .copy_from(&support.hessian(pose, &rows_of(multipliers, i)));
        }
        let rows = into.equalities_between.chunks_exact_mut(ROWS);
        for (link, rows) in self.links.iter().zip(rows) {
            let jacobian = link.jacobian::<F, N>(point);
            for (i, row) in rows.iter_mut().enumerate() {
                for (row, by_node) in row.iter_mut().zip(&jacobian) {
                    row.tr_copy_from(&by_node.row(i));
                }
            }
        }
        let states = &mut into.diagonal.states;
        states.clear();
        if self.is_loaded() || !self.links.is_empty() {
            states.resize(point.poses.len(), Matrix6::zeros());
            let mut add = |node: usize, load: &DeadForce| {
                states[node] += load.hessian(&point.poses[node]);
            };
            self.for_each_load(&mut add);
            for (i, link) in self.links.iter().enumerate() {
                let rows = rows_of(multipliers, self.supports.len() + i);
                for (node, hessian) in link.nodes.iter().zip(link.hessians(point, &rows)) {
                    states[*node] += hessian;
                }
            }
        }
    }
}

/// Gradient by the fields of a node, with the inequalities of the pieces beside it.
fn by_fields<const F: usize, const N: usize>(
    node: usize,
    bounds: &[f64],
    into: &Linearisation<6, F, N>,
) -> SVector<f64, F> {
    let mut gradient = into.gradient[node].fixed_rows::<F>(6).into_owned();
    for (stage, end) in [(node.checked_sub(1), 1), (Some(node), 0)] {
        if let Some(stage) = stage.filter(|stage| *stage < into.layout().stages()) {
            for row in into.layout().stage_rows(stage) {
                gradient -= bounds[row] * into.stage_slacks[row][end];
            }
        }
    }
    gradient
}
