//! The constrained minimisation: energy of a chain of elements under the supports' conditions, Eq. (34)–(36).
//!
//! Poses are not unknowns of their own: they are carried from the start along the elements, so every point of the
//! search is a belt without a break, and the supports' conditions are the only equations left.

use crate::element::{Element, IncrementJet};
use crate::energy::EnergyModel;
use crate::lie::{Pose, hat};
use crate::solver::chain::{NodeMatrix, NodeVector, Stage};
use crate::solver::{Linearisation, Program, Rows, RowsByNode, Values};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector2, Vector3, Vector4};

/// Conditions at one node.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeSupport {
    /// Which node.
    pub node: usize,
    /// Prescribed position, Eq. (35), each component or none.
    pub position: [Option<f64>; 3],
    /// Prescribed frame, Eq. (36), or none.
    pub frame: Option<UnitQuaternion<f64>>,
    /// Whether the rib is square there, β = 0.
    pub square_rib: bool,
}

/// The programme of a belt. Lengths are in U and energies in mean R_f/U.
#[derive(Debug, Clone)]
pub struct BeltProgram {
    /// Elements in order along the spine.
    pub elements: Vec<Element>,
    /// Bending energy.
    pub model: EnergyModel,
    /// Supports by rising node.
    pub supports: Vec<NodeSupport>,
}

/// A shape of the belt.
#[derive(Debug, Clone)]
pub struct BeltPoint {
    /// Bend and rib slope at every node.
    pub fields: Vec<Vector2<f64>>,
    /// Pose of every node; the first is an unknown, the others follow from it and the fields.
    pub poses: Vec<Pose>,
}

/// What acts on a node from beyond: derivative of the supports' work by the node's position and frame.
#[derive(Debug, Clone, Copy)]
struct Adjoint {
    force: Vector3<f64>,
    moment: Vector3<f64>,
}

/// The rotation from the prescribed frame to the present one as modified Rodrigues parameters `4 tan(θ/4) axis`, with
/// derivatives by the body rotation.
///
/// Like the rotation vector near zero, and zero at no other rotation. Unlike the rotation vector and the skew part of
/// the matrix they have regular derivatives up to and at a half-turn, where the shorter of the two turns changes side.
#[derive(Debug, Clone, Copy)]
struct RotationGap {
    scalar: f64,
    vector: Vector3<f64>,
}

impl RotationGap {
    fn new(prescribed: &UnitQuaternion<f64>, frame: &Matrix3<f64>) -> Self {
        let now = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*frame));
        let gap = prescribed.conjugate() * now;
        let sign = if gap.w < 0.0 { -1.0 } else { 1.0 };
        Self {
            scalar: sign * gap.w,
            vector: sign * gap.imag(),
        }
    }

    fn value(&self) -> Vector3<f64> {
        4.0 * self.vector / (1.0 + self.scalar)
    }

    fn jacobian(&self) -> Matrix3<f64> {
        let denominator = 1.0 + self.scalar;
        let by_rotation = self.scalar * Matrix3::identity() + hat(&self.vector);
        2.0 / denominator * by_rotation
            + 2.0 / (denominator * denominator) * self.vector * self.vector.transpose()
    }

    /// Second derivative of `weights · value`.
    fn hessian(&self, weights: &Vector3<f64>) -> Matrix3<f64> {
        let denominator = 1.0 + self.scalar;
        let numerator = weights.dot(&self.vector);
        let numerator_by = 0.5 * (self.scalar * weights + weights.cross(&self.vector));
        let denominator_by = -0.5 * self.vector;
        let mixed = numerator_by * denominator_by.transpose();
        let isotropic = -0.25 * numerator / denominator
            + 0.25 * numerator * self.scalar / (denominator * denominator);
        4.0 * (isotropic * Matrix3::identity() - (mixed + mixed.transpose()) / denominator.powi(2)
            + 2.0 * numerator / denominator.powi(3) * denominator_by * denominator_by.transpose())
    }
}

impl NodeSupport {
    /// The prescribed position, where all of it is.
    pub fn point(&self) -> Option<Vector3<f64>> {
        let [x, y, z] = self.position;
        Some(Vector3::new(x?, y?, z?))
    }

    fn rotation(&self, pose: &Pose) -> Option<RotationGap> {
        self.frame
            .as_ref()
            .map(|frame| RotationGap::new(frame, &pose.frame))
    }

    fn value(&self, pose: &Pose, fields: &Vector2<f64>) -> Rows {
        let mut rows = Rows::zeros();
        for (i, held) in self.position.iter().enumerate() {
            rows[i] = held.map_or(0.0, |held| pose.position[i] - held);
        }
        if let Some(gap) = self.rotation(pose) {
            rows.fixed_rows_mut::<3>(3).copy_from(&gap.value());
        }
        if self.square_rib {
            rows[6] = fields[1];
        }
        rows
    }

    fn jacobian(&self, pose: &Pose) -> RowsByNode {
        let mut rows = RowsByNode::zeros();
        for (i, held) in self.position.iter().enumerate() {
            rows[(i, i)] = if held.is_some() { 1.0 } else { 0.0 };
        }
        if let Some(gap) = self.rotation(pose) {
            rows.fixed_view_mut::<3, 3>(3, 3).copy_from(&gap.jacobian());
        }
        if self.square_rib {
            rows[(6, 7)] = 1.0;
        }
        rows
    }

    /// Second derivative of `multipliers · value` by the node's unknowns.
    fn hessian(&self, pose: &Pose, multipliers: &Rows) -> NodeMatrix {
        let mut hessian = NodeMatrix::zeros();
        if let Some(gap) = self.rotation(pose) {
            let weights = multipliers.fixed_rows::<3>(3).into_owned();
            hessian
                .fixed_view_mut::<3, 3>(3, 3)
                .copy_from(&gap.hessian(&weights));
        }
        hessian
    }

    /// Force and moment of the support on the belt, world axes.
    fn reaction(&self, pose: &Pose, multipliers: &Rows) -> (Vector3<f64>, Vector3<f64>) {
        let pull = self.jacobian(pose).tr_mul(multipliers);
        (
            -pull.fixed_rows::<3>(0),
            -(pose.frame * pull.fixed_rows::<3>(3)),
        )
    }
}

impl BeltProgram {
    /// The four unknowns of an element.
    fn fields_of(fields: &[Vector2<f64>], element: usize) -> Vector4<f64> {
        let [a, b] = [fields[element], fields[element + 1]];
        Vector4::new(a[0], a[1], b[0], b[1])
    }

    /// Arc length of every node, in U.
    pub fn nodes(&self) -> Vec<f64> {
        let mut u = 0.0;
        let mut nodes = vec![u];
        for element in &self.elements {
            u += element.length;
            nodes.push(u);
        }
        nodes[self.elements.len()] = 1.0;
        nodes
    }

    /// Bending energy of a shape.
    pub fn energy(&self, fields: &[Vector2<f64>]) -> f64 {
        self.elements
            .iter()
            .enumerate()
            .map(|(k, element)| element.energy(self.model, &Self::fields_of(fields, k)))
            .sum()
    }

    /// Carries the poses on from the first, Eq. (3).
    pub fn carry(&self, point: &mut BeltPoint) {
        for (k, element) in self.elements.iter().enumerate() {
            let increment = element.increment(&Self::fields_of(&point.fields, k));
            point.poses[k + 1] = point.poses[k] * increment;
        }
    }

    /// Force and moment at every node, world axes: what the belt beyond does to the part before; at the last node,
    /// what its support does.
    pub fn internal(
        &self,
        point: &BeltPoint,
        multipliers: &[Rows],
    ) -> Vec<(Vector3<f64>, Vector3<f64>)> {
        let last = self.elements.len();
        let mut adjoint = Adjoint::zero();
        let mut internal = vec![(Vector3::zeros(), Vector3::zeros()); last + 1];
        for k in (0..=last).rev() {
            let frame = &point.poses[k].frame;
            if k < last {
                let increment = self.elements[k].increment(&Self::fields_of(&point.fields, k));
                adjoint = adjoint.before(frame, &increment);
                internal[k] = adjoint.on_part_before(frame);
            }
            for (support, rows) in self.supports.iter().zip(multipliers) {
                if support.node == k {
                    adjoint.add(&support.jacobian(&point.poses[k]).tr_mul(rows));
                }
            }
            if k == last {
                internal[k] = adjoint.on_part_before(frame);
            }
        }
        internal
    }

    /// Force and moment of every support on the belt, world axes, about the support's point.
    pub fn reactions(
        &self,
        point: &BeltPoint,
        multipliers: &[Rows],
    ) -> Vec<(Vector3<f64>, Vector3<f64>)> {
        self.supports
            .iter()
            .zip(multipliers)
            .map(|(support, rows)| support.reaction(&point.poses[support.node], rows))
            .collect()
    }
}

impl Adjoint {
    fn zero() -> Self {
        Self {
            force: Vector3::zeros(),
            moment: Vector3::zeros(),
        }
    }

    fn add(&mut self, by_node: &NodeVector) {
        self.force += by_node.fixed_rows::<3>(0);
        self.moment += by_node.fixed_rows::<3>(3);
    }

    /// The same derivative by the pose at the element's first node.
    fn before(&self, frame: &Matrix3<f64>, increment: &Pose) -> Self {
        let force = frame.tr_mul(&self.force);
        Self {
            force: self.force,
            moment: increment.frame * self.moment + increment.position.cross(&force),
        }
    }

    /// Force and moment in world axes on the part before the node.
    fn on_part_before(&self, frame: &Matrix3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        (-self.force, -(frame * self.moment))
    }
}

impl Program for BeltProgram {
    type Point = BeltPoint;

    fn stages(&self) -> usize {
        self.elements.len()
    }

    fn constrained_nodes(&self) -> Vec<usize> {
        self.supports.iter().map(|support| support.node).collect()
    }

    fn weights(&self) -> Vec<f64> {
        self.elements.iter().map(|element| element.length).collect()
    }

    fn evaluate(&self, point: &mut BeltPoint, values: &mut Values) -> bool {
        values.slacks.clear();
        for (k, element) in self.elements.iter().enumerate() {
            let share = element.rib_share(&Self::fields_of(&point.fields, k));
            values.slacks.push([1.0 - share, 1.0 + share]);
        }
        if !values.slacks.iter().flatten().all(|slack| *slack > 0.0) {
            return false;
        }
        self.carry(point);
        values.objective = self.energy(&point.fields);
        values.constraints.clear();
        values.constraints.extend(
            self.supports
                .iter()
                .map(|s| s.value(&point.poses[s.node], &point.fields[s.node])),
        );
        values.objective.is_finite()
    }

    fn linearise(&self, point: &BeltPoint, multipliers: &[Rows], into: &mut Linearisation) {
        for node in &mut into.gradient {
            node.fill(0.0);
        }
        let mut adjoint = Adjoint::zero();
        let mut supports = self.supports.iter().enumerate().rev().peekable();
        for k in (0..=self.elements.len()).rev() {
            if k < self.elements.len() {
                let fields = Self::fields_of(&point.fields, k);
                let jet = self.elements[k].increment_jet(&fields);
                self.linearise_stage(k, point, &jet, &adjoint, into);
                adjoint = adjoint.before(&point.poses[k].frame, &jet.value);
            }
            while let Some((i, support)) = supports.next_if(|(_, support)| support.node == k) {
                let pose = &point.poses[k];
                into.constraints[i] = support.jacobian(pose);
                let pull = into.constraints[i].tr_mul(&multipliers[i]);
                adjoint.add(&pull);
                into.gradient[k][7] += pull[7];
                into.chain.nodes[i].hessian = support.hessian(pose, &multipliers[i]);
            }
        }
        let mut start = into.gradient[0].fixed_rows_mut::<6>(0);
        start.fixed_rows_mut::<3>(0).copy_from(&adjoint.force);
        start.fixed_rows_mut::<3>(3).copy_from(&adjoint.moment);
    }

    fn retract(&self, point: &BeltPoint, step: &[NodeVector], length: f64, into: &mut BeltPoint) {
        for (k, fields) in into.fields.iter_mut().enumerate() {
            *fields = point.fields[k] + length * step[k].fixed_rows::<2>(6);
        }
        let turn = Rotation3::new(length * step[0].fixed_rows::<3>(3));
        into.poses[0] = Pose {
            position: point.poses[0].position + length * step[0].fixed_rows::<3>(0),
            frame: point.poses[0].frame * turn.matrix(),
        };
    }
}

impl BeltProgram {
    /// Derivatives of one element, with what acts on its second node from beyond.
    fn linearise_stage(
        &self,
        k: usize,
        point: &BeltPoint,
        jet: &IncrementJet,
        beyond: &Adjoint,
        into: &mut Linearisation,
    ) {
        let element = &self.elements[k];
        let fields = Self::fields_of(&point.fields, k);
        let frame = &point.poses[k].frame;
        let force = frame.tr_mul(&beyond.force);
        let energy = element.energy_jet(self.model, &fields);
        let controls = energy.hessian + element.increment_hessian(jet, &force, &beyond.moment);
        let gradient = energy.gradient
            + jet.position_by_fields.tr_mul(&force)
            + jet.rotation_by_fields.tr_mul(&beyond.moment);
        into.chain.stages[k] = carry_derivatives(frame, jet, &force, &beyond.moment, controls);
        let share = element.rib_share_gradient();
        into.slacks[k] = [-share, share];
        for (node, rows) in [(k, 0), (k + 1, 2)] {
            let mut part = into.gradient[node].fixed_rows_mut::<2>(6);
            part += gradient.fixed_rows::<2>(rows);
        }
    }
}

/// How an element carries the pose on, and the second derivatives of the work done at its second node: `force` in the
/// axes of the first node's frame, `moment` in those of the second's.
fn carry_derivatives(
    frame: &Matrix3<f64>,
    jet: &IncrementJet,
    force: &Vector3<f64>,
    moment: &Vector3<f64>,
    controls: nalgebra::Matrix4<f64>,
) -> Stage {
    let (p, turn) = (&jet.value.position, &jet.value.frame);
    let mut stage = Stage::zero();
    stage
        .state_by_state
        .fixed_view_mut::<3, 3>(0, 0)
        .fill_with_identity();
    stage
        .state_by_state
        .fixed_view_mut::<3, 3>(0, 3)
        .copy_from(&(-frame * hat(p)));
    stage
        .state_by_state
        .fixed_view_mut::<3, 3>(3, 3)
        .copy_from(&turn.transpose());
    let by_position = frame * jet.position_by_fields;
    let outer = 0.5 * (p * force.transpose() + force * p.transpose());
    stage
        .state_state
        .fixed_view_mut::<3, 3>(3, 3)
        .copy_from(&(outer - force.dot(p) * Matrix3::identity()));
    let mixed =
        -hat(force) * jet.position_by_fields - 0.5 * turn * hat(moment) * jet.rotation_by_fields;
    for (columns, carried, second) in [
        (0, &mut stage.state_by_first, &mut stage.state_first),
        (2, &mut stage.state_by_second, &mut stage.state_second),
    ] {
        carried
            .fixed_view_mut::<3, 2>(0, 0)
            .copy_from(&by_position.fixed_columns::<2>(columns));
        carried
            .fixed_view_mut::<3, 2>(3, 0)
            .copy_from(&jet.rotation_by_fields.fixed_columns::<2>(columns));
        second
            .fixed_view_mut::<3, 2>(3, 0)
            .copy_from(&mixed.fixed_columns::<2>(columns));
    }
    stage.controls = controls;
    stage
}

#[cfg(test)]
mod tests {
    use super::*;

    fn program() -> BeltProgram {
        let n = 6;
        BeltProgram {
            elements: vec![
                Element {
                    length: 1.0 / n as f64,
                    geodesic: 0.0,
                    rigidity: [1.0, 1.2],
                    half_width: 0.05
                };
                n
            ],
            model: EnergyModel::Wunderlich,
            supports: vec![
                NodeSupport {
                    node: 0,
                    position: [Some(0.0); 3],
                    frame: Some(UnitQuaternion::identity()),
                    square_rib: true,
                },
                NodeSupport {
                    node: n,
                    position: [Some(0.1), Some(0.6), Some(0.2)],
                    frame: Some(UnitQuaternion::from_scaled_axis(Vector3::new(
                        0.3, -0.4, 0.7,
                    ))),
                    square_rib: true,
                },
            ],
        }
    }

    fn point(program: &BeltProgram) -> BeltPoint {
        let n = program.elements.len();
        let mut point = BeltPoint {
            fields: (0..=n)
                .map(|k| {
                    let u = k as f64 / n as f64;
                    Vector2::new(3.0 * (7.0 * u).cos() + 1.0, 0.4 * (5.0 * u).sin() + 0.1)
                })
                .collect(),
            poses: vec![Pose::identity(); n + 1],
        };
        point.poses[0].frame = Rotation3::new(Vector3::new(0.2, 0.1, -0.3)).into_inner();
        program.carry(&mut point);
        point
    }

    fn lagrangian(program: &BeltProgram, point: &mut BeltPoint, multipliers: &[Rows]) -> f64 {
        let mut values = Values::default();
        assert!(program.evaluate(point, &mut values));
        values.objective
            + values
                .constraints
                .iter()
                .zip(multipliers)
                .map(|(c, l)| c.dot(l))
                .sum::<f64>()
    }

    fn moved(program: &BeltProgram, point: &BeltPoint, steps: &[(usize, usize, f64)]) -> BeltPoint {
        let mut step = vec![NodeVector::zeros(); program.elements.len() + 1];
        for (node, entry, size) in steps {
            step[*node][*entry] += size;
        }
        let mut into = point.clone();
        program.retract(point, &step, 1.0, &mut into);
        into
    }

    /// Unknowns: the start's state, then both fields of every node.
    fn unknowns(program: &BeltProgram) -> Vec<(usize, usize)> {
        (0..6)
            .map(|i| (0, i))
            .chain((0..=program.elements.len()).flat_map(|k| [(k, 6), (k, 7)]))
            .collect()
    }

    #[test]
    fn test_gradient_and_hessian_agree_with_finite_differences() {
        let program = program();
        let at = point(&program);
        let multipliers = [
            Rows::from_fn(|i, _| 0.7 - 0.3 * i as f64),
            Rows::from_fn(|i, _| 3.0 - 1.1 * i as f64),
        ];
        let mut linear =
            crate::solver::Linearisation::new(program.elements.len(), &[0, program.elements.len()]);
        program.linearise(&at, &multipliers, &mut linear);
        let unknowns = unknowns(&program);
        let h = 1e-4;
        let value = |steps: &[(usize, usize, f64)]| {
            lagrangian(&program, &mut moved(&program, &at, steps), &multipliers)
        };
        for a in &unknowns {
            let difference = (value(&[(a.0, a.1, h)]) - value(&[(a.0, a.1, -h)])) / (2.0 * h);
            let exact = linear.gradient[a.0][a.1];
            assert!(
                (difference - exact).abs() < 2e-6 * exact.abs().max(10.0),
                "{a:?} {difference} {exact}"
            );
            for b in &unknowns {
                let second = (value(&[(a.0, a.1, h), (b.0, b.1, h)])
                    - value(&[(a.0, a.1, h), (b.0, b.1, -h)])
                    - value(&[(a.0, a.1, -h), (b.0, b.1, h)])
                    + value(&[(a.0, a.1, -h), (b.0, b.1, -h)]))
                    / (4.0 * h * h);
                let exact = linear.chain.second_derivative(*a, *b);
                assert!(
                    (second - exact).abs() < 2e-5 * exact.abs().max(10.0),
                    "{a:?} {b:?} {second} {exact}"
                );
            }
        }
    }
}
