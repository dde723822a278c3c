//! The constrained minimisation: energy of a chain of pieces under supports, links and loads, Eq. (34)–(36).
//!
//! Poses are not unknowns of their own: they are carried from the start along the pieces, so every point of the
//! search is a belt without a break, and the conditions of supports and links are the only equations left. In the same
//! way the rib slope is carried across a bend of the board, where the rib is one material line.

mod link;
mod load;
mod support;

pub use link::{NodeLink, Tie};
pub(crate) use load::weight;
pub use load::{DeadForce, NodeLoad};
pub(crate) use support::Turn;
pub use support::{Hold, NodeSupport};

use crate::geometry::{Pose, Twist, hat};
use crate::strip::density::EnergyModel;
use crate::strip::element::Element;
use crate::strip::kernel::{Block, LANES, Motions};
use crate::strip::spine::turn;
use nalgebra::{
    Matrix3, Matrix3x6, Matrix6, Rotation3, SMatrix, SVector, UnitQuaternion, Vector2, Vector3,
    Vector4, Vector6,
};
use stagewise::{Distance, Layout, Linearisation, Multipliers, Program, StageMatrix, Values};

/// Unknowns of a node: a twist of the pose in world axes about the origin, then bend and rib slope.
pub type NodeVector = stagewise::NodeVector<8>;
/// A quadratic form in the unknowns of a node.
pub type NodeMatrix = stagewise::NodeMatrix<8>;

/// Rows of the conditions of one support or link.
pub const ROWS: usize = 6;
/// Values or multipliers of the conditions of one support or link; unused rows are zero.
pub type Rows = SVector<f64, ROWS>;
/// Derivative of the conditions of one support or link by a node's unknowns; unused rows are zero.
pub type RowsByNode = SMatrix<f64, ROWS, 8>;

/// The multipliers of a support or link, by its place: supports first, then links.
pub fn rows_of(multipliers: &[f64], place: usize) -> Rows {
    Rows::from_column_slice(&multipliers[ROWS * place..ROWS * (place + 1)])
}

/// What joins a node to the next.
#[expect(
    clippy::large_enum_variant,
    reason = "nearly all pieces are strips, read one after the other"
)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Piece {
    /// A flexible element.
    Strip(Element),
    /// A stiffened stretch.
    Rigid {
        /// Length along the spine.
        length: f64,
    },
    /// A place of no length where the bend may jump, and the board turn.
    Joint {
        /// Angle χ by which the board turns, from η towards ζ.
        angle: f64,
    },
}

/// The programme of a belt. Lengths are in U and energies in mean R_f/U.
#[derive(Debug, Clone, PartialEq)]
pub struct BeltProgram {
    /// Pieces in order along the spine.
    pub pieces: Vec<Piece>,
    /// Bending energy.
    pub model: EnergyModel,
    /// Supports.
    pub supports: Vec<NodeSupport>,
    /// Links.
    pub links: Vec<NodeLink>,
    /// Dead forces at nodes.
    pub loads: Vec<NodeLoad>,
    /// Weight per unit length, world axes.
    pub weight: Vector3<f64>,
    /// Signed half turns after which the end of a closed belt joins its start; the ties of its seam are among the links.
    pub half_turns: Option<i32>,
    /// Bend and rib slope of every node where they are prescribed.
    fixed: Vec<[Option<f64>; 2]>,
}

/// A shape of the belt.
#[derive(Debug, Clone, PartialEq)]
pub struct BeltPoint {
    /// Bend and rib slope at every node.
    pub fields: Vec<Vector2<f64>>,
    /// Pose of every node; the first is an unknown, the others follow from it and the fields.
    pub poses: Vec<Pose>,
}

impl Distance for BeltPoint {
    fn copy_from(&mut self, other: &Self) {
        self.fields.copy_from_slice(&other.fields);
        self.poses.copy_from_slice(&other.poses);
    }

    /// The longest way that a node is displaced, in U.
    fn distance(&self, other: &Self) -> f64 {
        let poses = self.poses.iter().zip(&other.poses);
        let moves = poses.map(|(a, b)| (a.position - b.position).norm());
        moves.fold(0.0, f64::max)
    }
}

impl Piece {
    /// Length along the spine.
    pub fn length(&self) -> f64 {
        match self {
            Self::Strip(element) => element.length,
            Self::Rigid { length } => *length,
            Self::Joint { .. } => 0.0,
        }
    }

    /// The motion along it.
    fn motion(&self, fields: &Vector4<f64>) -> Pose {
        match self {
            Self::Strip(element) => element.increment(fields),
            Self::Rigid { length } => Pose {
                position: Vector3::y() * *length,
                ..Pose::identity()
            },
            Self::Joint { angle } => turn(*angle),
        }
    }
}

/// The rib slope beyond a bend of the board by χ, with two derivatives; `None` where the rib would leave through the
/// bend: a rib there is one material line, α⁺ = α⁻ − χ.
pub fn slope_beyond(slope: f64, angle: f64) -> Option<[f64; 3]> {
    let (sine, cosine) = angle.sin_cos();
    let denominator = cosine + slope * sine;
    (denominator > 0.0).then(|| {
        [
            (slope * cosine - sine) / denominator,
            denominator.powi(-2),
            -2.0 * sine * denominator.powi(-3),
        ]
    })
}

impl BeltProgram {
    /// The programme of a chain of pieces that nothing holds or loads.
    pub fn new(pieces: Vec<Piece>, model: EnergyModel) -> Self {
        let nodes = pieces.len() + 1;
        Self {
            pieces,
            model,
            supports: Vec::new(),
            links: Vec::new(),
            loads: Vec::new(),
            weight: Vector3::zeros(),
            half_turns: None,
            fixed: vec![[None; 2]; nodes],
        }
        .with_supports(Vec::new())
    }

    /// The same with these supports in place of its own.
    pub fn with_supports(mut self, supports: Vec<NodeSupport>) -> Self {
        let nodes = self.pieces.len() + 1;
        self.fixed = (0..nodes).map(|node| self.fixed_by_pieces(node)).collect();
        self.fix_across_seam();
        for support in supports.iter().filter(|support| support.square_rib) {
            self.fixed[support.node][1].get_or_insert(0.0);
        }
        self.supports = supports;
        self.fix_across_joints();
        self
    }

    /// A closed belt cut open at its seam and twisted there by an angle in place of its half turns, as between two
    /// clamps.
    pub fn cut_and_twisted(&self, angle: f64) -> Self {
        let mut cut = self.clone();
        for link in &mut cut.links {
            match &mut link.tie {
                Tie::Offset(_) => (),
                Tie::Pose(turn) => {
                    *turn = UnitQuaternion::from_scaled_axis(angle * Vector3::y());
                }
                Tie::Fields(fields) => *fields = [None; 2],
            }
        }
        cut
    }

    /// What a stiffened stretch prescribes at a node: no bend inside, square ribs at its ends too.
    fn fixed_by_pieces(&self, node: usize) -> [Option<f64>; 2] {
        let beside = [node.checked_sub(1), Some(node)];
        let pieces = beside
            .into_iter()
            .flatten()
            .filter_map(|k| self.pieces.get(k));
        let is_rigid = |piece: &&Piece| matches!(piece, Piece::Rigid { .. });
        match pieces.clone().any(|piece| is_rigid(&piece)) {
            true => [Some(0.0); 2],
            false => [None; 2],
        }
    }

    /// Beside a stiffener at the seam of a closed belt the rib is square on both sides of the seam.
    fn fix_across_seam(&mut self) {
        let is_rigid = |piece: Option<&Piece>| matches!(piece, Some(Piece::Rigid { .. }));
        let beside = is_rigid(self.pieces.first()) || is_rigid(self.pieces.last());
        if self.half_turns.is_some() && beside {
            for node in [0, self.pieces.len()] {
                self.fixed[node][1] = Some(0.0);
            }
        }
    }

    /// Where the rib is prescribed on one side of a joint, so it is on the other.
    fn fix_across_joints(&mut self) {
        for (k, piece) in self.pieces.iter().enumerate() {
            let Piece::Joint { angle } = *piece else {
                continue;
            };
            let across = |slope: Option<f64>, angle| Some(slope_beyond(slope?, angle)?[0]);
            let [before, after] = [self.fixed[k][1], self.fixed[k + 1][1]];
            self.fixed[k][1] = before.or(across(after, -angle));
            self.fixed[k + 1][1] = after.or(across(before, angle));
        }
    }

    /// Whether bend and slope of a node are unknowns, and not prescribed or carried on from the node before.
    fn free(&self, node: usize) -> [bool; 2] {
        let [bend, slope] = self.fixed[node].map(|fixed| fixed.is_none());
        [bend, slope && !self.is_tied(node)]
    }

    /// Whether the slope of a node is carried on from the node before.
    fn is_tied(&self, node: usize) -> bool {
        let joint = node
            .checked_sub(1)
            .is_some_and(|k| matches!(self.pieces[k], Piece::Joint { .. }));
        joint && self.fixed[node][1].is_none()
    }

    /// The slope carried on to a node across a joint, with derivatives.
    fn carried_slope(&self, point: &BeltPoint, node: usize) -> Option<[f64; 3]> {
        match self.pieces[node - 1] {
            Piece::Joint { angle } => slope_beyond(point.fields[node - 1][1], angle),
            Piece::Strip(_) | Piece::Rigid { .. } => None,
        }
    }

    /// Gives a point the fields that are prescribed or carried on, and its poses.
    ///
    /// A rib that would leave through a bend of the board is left as it is.
    pub fn settle(&self, point: &mut BeltPoint) {
        for node in 0..point.fields.len() {
            for (i, fixed) in self.fixed[node].iter().enumerate() {
                if let Some(fixed) = fixed {
                    point.fields[node][i] = *fixed;
                }
            }
            if self.is_tied(node)
                && let Some([slope, ..]) = self.carried_slope(point, node)
            {
                point.fields[node][1] = slope;
            }
        }
        self.carry(point);
    }

    /// The least of how far the ribs are from crossing; negative infinity where one would leave through a bend.
    pub fn least_slack(&self, point: &BeltPoint) -> f64 {
        if self.rib_leaves_through_bend(point) {
            return f64::NEG_INFINITY;
        }
        self.elements()
            .flat_map(|(k, element)| element.slacks(&Self::fields_of(&point.fields, k)))
            .fold(f64::INFINITY, f64::min)
    }

    /// By how much a shape misses its supports, lengths in U and angles in rad.
    pub fn miss_of_supports(&self, point: &BeltPoint) -> f64 {
        let miss = |support: &NodeSupport| support.value(&point.poses[support.node]).norm();
        self.supports.iter().map(miss).sum()
    }

    fn rib_leaves_through_bend(&self, point: &BeltPoint) -> bool {
        let leaves = |node| self.is_tied(node) && self.carried_slope(point, node).is_none();
        (1..point.fields.len()).any(leaves)
    }

    /// The rib slope of a node, where it is prescribed.
    pub fn fixed_slope(&self, node: usize) -> Option<f64> {
        self.fixed[node][1]
    }

    /// The elements that bend, each with its number among the pieces.
    pub fn elements(&self) -> impl Iterator<Item = (usize, &Element)> {
        self.pieces
            .iter()
            .enumerate()
            .filter_map(|(k, piece)| match piece {
                Piece::Strip(element) => Some((k, element)),
                Piece::Rigid { .. } | Piece::Joint { .. } => None,
            })
    }

    /// The four unknowns of a piece.
    fn fields_of(fields: &[Vector2<f64>], piece: usize) -> Vector4<f64> {
        let [a, b] = [fields[piece], fields[piece + 1]];
        Vector4::new(a[0], a[1], b[0], b[1])
    }

    /// Arc length of every node, in U.
    pub fn nodes(&self) -> Vec<f64> {
        let mut u = 0.0;
        let mut nodes = vec![u];
        for piece in &self.pieces {
            u += piece.length();
            nodes.push(u);
        }
        nodes[self.pieces.len()] = 1.0;
        nodes
    }

    /// Bending energy of a shape.
    pub fn elastic_energy(&self, fields: &[Vector2<f64>]) -> f64 {
        self.elements()
            .map(|(k, element)| element.energy(self.model, &Self::fields_of(fields, k)))
            .sum()
    }

    /// Potential of weight and loads.
    pub fn load_potential(&self, poses: &[Pose]) -> f64 {
        let loads = self.loads.iter();
        let dead: f64 = loads
            .map(|load| load.load.potential(&poses[load.node]))
            .sum();
        let weight = |(k, piece): (usize, &Piece)| {
            let ends = load::weight(&self.weight, piece.length());
            ends[0].potential(&poses[k]) + ends[1].potential(&poses[k + 1])
        };
        match self.is_weightless() {
            true => dead,
            false => dead + self.pieces.iter().enumerate().map(weight).sum::<f64>(),
        }
    }

    /// Whether weight or dead forces act.
    pub fn is_loaded(&self) -> bool {
        !self.is_weightless() || !self.loads.is_empty()
    }

    fn is_weightless(&self) -> bool {
        self.weight == Vector3::zeros()
    }

    /// Carries the poses on from the first, Eq. (3).
    pub fn carry(&self, point: &mut BeltPoint) {
        let mut motions = Motions::default();
        let mut pose = point.poses[0];
        for (pieces, from) in self.pieces.chunks(LANES).zip((0..).step_by(LANES)) {
            for (lane, piece) in pieces.iter().enumerate() {
                if let Piece::Strip(element) = piece {
                    motions.set(lane, element, &Self::fields_of(&point.fields, from + lane));
                }
            }
            motions.find();
            for (lane, piece) in pieces.iter().enumerate() {
                let motion = match piece {
                    Piece::Strip(_) => motions.at(lane),
                    Piece::Rigid { .. } | Piece::Joint { .. } => piece.motion(&Vector4::zeros()),
                };
                pose = pose * motion;
                point.poses[from + lane + 1] = pose;
            }
        }
    }

    /// Derivatives of all work by the twist of the belt from each node on: what acts at it and beyond.
    ///
    /// A wrench about the origin is the same all along the belt but where something acts.
    fn wrenches(&self, point: &BeltPoint, multipliers: &[f64], into: &mut [NodeVector]) {
        for (i, support) in self.supports.iter().enumerate() {
            let rows = rows_of(multipliers, i);
            into[support.node] += support.jacobian(&point.poses[support.node]).tr_mul(&rows);
        }
        for (i, link) in self.links.iter().enumerate() {
            let rows = rows_of(multipliers, self.supports.len() + i);
            for (node, by_node) in link.nodes.iter().zip(link.jacobian(point)) {
                into[*node] += by_node.tr_mul(&rows);
            }
        }
        let mut add = |node: usize, load: &DeadForce| {
            let mut wrench = into[node].fixed_rows_mut::<6>(0);
            wrench += load.pull(&point.poses[node]);
        };
        self.for_each_load(&mut add);
        for k in (0..self.pieces.len()).rev() {
            let beyond: Vector6<f64> = into[k + 1].fixed_rows::<6>(0).into_owned();
            let mut wrench = into[k].fixed_rows_mut::<6>(0);
            wrench += beyond;
        }
    }

    /// Dead forces and the weight of the pieces, each with its node.
    fn for_each_load(&self, act: &mut dyn FnMut(usize, &DeadForce)) {
        for NodeLoad { node, load } in &self.loads {
            act(*node, load);
        }
        if !self.is_weightless() {
            for (k, piece) in self.pieces.iter().enumerate() {
                let [first, second] = load::weight(&self.weight, piece.length());
                act(k, &first);
                act(k + 1, &second);
            }
        }
    }

    /// Force and moment at every node, world axes: what the belt beyond does to the part before; at the last node,
    /// what holds and loads it.
    pub fn internal(
        &self,
        point: &BeltPoint,
        multipliers: &[f64],
    ) -> Vec<(Vector3<f64>, Vector3<f64>)> {
        let last = self.pieces.len();
        let mut wrenches = vec![NodeVector::zeros(); last + 1];
        self.wrenches(point, multipliers, &mut wrenches);
        let at = |k: usize| {
            let beyond: Vector6<f64> = match wrenches.get(k + 1) {
                Some(beyond) => beyond.fixed_rows::<6>(0) + self.pull_of_weight(k, 0, point),
                None => wrenches[last].fixed_rows::<6>(0) - self.pull_of_weight(last - 1, 1, point),
            };
            let (force, moment) = (beyond.fixed_rows::<3>(0), beyond.fixed_rows::<3>(3));
            let about_node = moment - point.poses[k].position.cross(&force);
            (-force.into_owned(), -about_node)
        };
        (0..=last).map(at).collect()
    }

    /// Pull of the share of a piece's weight that acts at its first node, 0, or its second, 1.
    fn pull_of_weight(&self, piece: usize, end: usize, point: &BeltPoint) -> Vector6<f64> {
        let shares = load::weight(&self.weight, self.pieces[piece].length());
        shares[end].pull(&point.poses[piece + end])
    }

    /// Moves a support that holds a node by position and frame.
    pub fn move_support(&mut self, support: usize, pose: &Pose) {
        let [x, y, z] = pose.position.into();
        let frame =
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(pose.frame));
        let support = &mut self.supports[support];
        support.position = [Some(x), Some(y), Some(z)];
        support.hold = Hold::Frame(frame);
    }

    /// Force and moment of every support on the belt, world axes, about the support's point.
    pub fn reactions(
        &self,
        point: &BeltPoint,
        multipliers: &[f64],
    ) -> Vec<(Vector3<f64>, Vector3<f64>)> {
        let supports = self.supports.iter().enumerate();
        supports
            .map(|(i, support)| {
                support.reaction(&point.poses[support.node], &rows_of(multipliers, i))
            })
            .collect()
    }

    /// Force of every link on its second node, world axes; on the first it is the opposite.
    pub fn link_forces(&self, multipliers: &[f64]) -> Vec<Vector3<f64>> {
        let links = (0..self.links.len()).map(|i| self.supports.len() + i);
        links
            .map(|place| -rows_of(multipliers, place).fixed_rows::<3>(0).into_owned())
            .collect()
    }
}

impl Program<6, 2, 8> for BeltProgram {
    type Point = BeltPoint;

    fn layout(&self) -> Layout {
        let weight = |piece: &Piece| match piece {
            Piece::Strip(element) => element.length,
            Piece::Rigid { .. } | Piece::Joint { .. } => 0.0,
        };
        let bounds = |piece: &Piece| match piece {
            Piece::Strip(element) => element.strips().bounds().count(),
            Piece::Rigid { .. } | Piece::Joint { .. } => 0,
        };
        let layout = Layout::new(self.pieces.iter().map(weight).collect())
            .with_stage_inequalities(self.pieces.iter().map(bounds));
        let supports = self.supports.iter();
        let layout = supports.fold(layout, |layout, support| {
            layout.with_equalities_at(support.node, ROWS)
        });
        let links = self.links.iter();
        links.fold(layout, |layout, link| {
            layout.with_equalities_between(link.nodes, ROWS)
        })
    }

    fn evaluate(&self, point: &mut BeltPoint, values: &mut Values) -> bool {
        values.slacks.clear();
        for (k, element) in self.elements() {
            let slacks = element.slacks(&Self::fields_of(&point.fields, k));
            let bounds = element.strips().bounds();
            values.slacks.extend(bounds.map(|bound| slacks[bound]));
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
        let admissible = values.slacks.iter().all(|slack| *slack > 0.0);
        if admissible {
            values.objective =
                self.elastic_energy(&point.fields) + self.load_potential(&point.poses);
        }
        admissible && values.objective.is_finite()
    }

    fn equality_gradients(&self, point: &BeltPoint, into: &mut [NodeVector]) {
        for (support, rows) in self.supports.iter().zip(into.chunks_exact_mut(ROWS)) {
            let jacobian = support.jacobian(&point.poses[support.node]);
            for (row, gradient) in rows.iter_mut().zip(jacobian.row_iter()) {
                row.tr_copy_from(&gradient);
            }
        }
    }

    fn linearise(
        &self,
        point: &BeltPoint,
        multipliers: &Multipliers,
        into: &mut Linearisation<6, 2, 8>,
    ) {
        let (multipliers, bounds) = (&multipliers.equalities, &multipliers.inequalities);
        into.gradient.fill(NodeVector::zeros());
        self.wrenches(point, multipliers, &mut into.gradient);
        into.chain.first_free = self.free(0);
        self.linearise_elements(point, bounds, into);
        for k in (0..self.pieces.len()).rev() {
            into.chain.stages[k].free = self.free(k + 1);
            if self.is_tied(k + 1) {
                self.linearise_tie(k, point, bounds, into);
            }
        }
        for by_node in &mut into.gradient[1..] {
            by_node.fixed_rows_mut::<6>(0).fill(0.0);
        }
        self.linearise_conditions(point, multipliers, into);
    }

    fn retract(&self, point: &BeltPoint, step: &[NodeVector], length: f64, into: &mut BeltPoint) {
        for (k, step) in step.iter().enumerate() {
            into.fields[k] = point.fields[k] + length * step.fixed_rows::<2>(6);
            if self.is_tied(k)
                && let Some([slope, ..]) = self.carried_slope(into, k)
            {
                into.fields[k][1] = slope;
            }
        }
        let twist = Twist::from_vector(&(length * step[0].fixed_rows::<6>(0)));
        into.poses[0] = Pose::exp(&twist) * point.poses[0];
    }

    /// The mean square over the board of how far it moves, in U², all of it weighing alike: a node carries half of both
    /// pieces beside it, as a strip across the spine that turns with the frame.
    fn metric(&self, point: &BeltPoint) -> Vec<Matrix6<f64>> {
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
}

impl BeltProgram {
    /// Derivatives of the elements, block by block; the gradient holds the wrench at every node.
    fn linearise_elements(
        &self,
        point: &BeltPoint,
        bounds: &[f64],
        into: &mut Linearisation<6, 2, 8>,
    ) {
        let mut block = Block::default();
        for (pieces, from) in self.pieces.chunks(LANES).zip((0..).step_by(LANES)) {
            for (lane, piece) in pieces.iter().enumerate() {
                let k = from + lane;
                if let Piece::Strip(element) = piece {
                    let fields = Self::fields_of(&point.fields, k);
                    let across = element.across_jets(self.model, &fields).bending;
                    let poses = [&point.poses[k], &point.poses[k + 1]];
                    block.set(
                        lane,
                        element,
                        &fields,
                        &across,
                        poses,
                        &into.gradient[k + 1],
                    );
                }
            }
            block.differentiate(self.model);
            for (lane, piece) in pieces.iter().enumerate() {
                if let Piece::Strip(element) = piece {
                    self.take_element(from + lane, element, &block, lane, point, bounds, into);
                }
            }
        }
    }

    /// Takes the derivatives of one element over from its lane, with what its natural bend and its bounds add.
    #[expect(clippy::too_many_arguments, reason = "the parts of one loop")]
    fn take_element(
        &self,
        k: usize,
        element: &Element,
        block: &Block,
        lane: usize,
        point: &BeltPoint,
        bounds: &[f64],
        into: &mut Linearisation<6, 2, 8>,
    ) {
        let fields = Self::fields_of(&point.fields, k);
        let (mut gradient, mut controls) = (block.gradient(lane), block.hessian(lane));
        if element.curl.bend != 0.0 {
            let across = element.across_jets(self.model, &fields);
            let curl = element.curl_jet(self.model, &fields, &across);
            gradient += curl.gradient;
            controls += curl.hessian;
        }
        let slacks = element.slack_jets(&fields);
        let is_linear = element.strips().has_linear_bounds();
        let rows = into.layout().stage_rows(k);
        for (row, bound) in rows.zip(element.strips().bounds()) {
            let slack = &slacks[bound];
            if !is_linear {
                controls -= bounds[row] * slack.hessian;
            }
            into.stage_slacks[row] = halves(&slack.gradient);
        }
        into.diagonal.controls[k] = StageMatrix {
            first: controls.fixed_view::<2, 2>(0, 0).into_owned(),
            mixed: controls.fixed_view::<2, 2>(0, 2).into_owned(),
            second: controls.fixed_view::<2, 2>(2, 2).into_owned(),
        };
        block.carry(lane, &mut into.chain.stages[k]);
        for (node, rows) in [(k, 0), (k + 1, 2)] {
            let mut part = into.gradient[node].fixed_rows_mut::<2>(6);
            part += gradient.fixed_rows::<2>(rows);
        }
    }

    /// How the slope is carried on across a joint, and what that bends of all that depends on it.
    fn linearise_tie(
        &self,
        k: usize,
        point: &BeltPoint,
        bounds: &[f64],
        into: &mut Linearisation<6, 2, 8>,
    ) {
        let Some([_, first, second]) = self.carried_slope(point, k + 1) else {
            return;
        };
        let mut pull = into.gradient[k + 1][7];
        if k + 1 < self.pieces.len() {
            for row in into.layout().stage_rows(k + 1) {
                pull -= bounds[row] * into.stage_slacks[row][0][1];
            }
        }
        into.chain.stages[k].tie = [0.0, first];
        into.diagonal.controls[k] = StageMatrix::zeros();
        into.diagonal.controls[k].first[(1, 1)] = second * pull;
    }

    /// Derivatives of supports, links and loads at their nodes, second ones by their states.
    fn linearise_conditions(
        &self,
        point: &BeltPoint,
        multipliers: &[f64],
        into: &mut Linearisation<6, 2, 8>,
    ) {
        self.equality_gradients(point, &mut into.equalities_at);
        for (i, support) in self.supports.iter().enumerate() {
            let pose = &point.poses[support.node];
            *into.equality_hessian(i) = support.hessian(pose, &rows_of(multipliers, i));
        }
        let rows = into.equalities_between.chunks_exact_mut(ROWS);
        for (link, rows) in self.links.iter().zip(rows) {
            let jacobian = link.jacobian(point);
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

/// The two halves of a derivative by the fields at both ends of an element.
fn halves(by_fields: &Vector4<f64>) -> [Vector2<f64>; 2] {
    [0, 2].map(|from| by_fields.fixed_rows::<2>(from).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strip::density::Curl;
    use crate::strip::ribs::Edge;
    use nalgebra::{DMatrix, DVector, Rotation3, SymmetricEigen};
    use stagewise::{Stationary, lowest_modes};

    fn element(length: f64, geodesic: f64) -> Piece {
        Piece::Strip(Element {
            length,
            geodesic,
            rigidity: [1.0, 1.2],
            half_width: 0.05,
            curl: Curl {
                bend: 0.8,
                poisson: 0.3,
            },
            further: [
                None,
                Some(Edge::line(Vector2::new(0.8, 0.6), 0.03)),
                Some(Edge {
                    direction: Vector2::x(),
                    distance: 0.05,
                    curvature: 4.0,
                    turn: [-0.5, 0.4],
                }),
            ],
        })
    }

    /// A belt with one of everything: a straight stretch, a bend, an arc, a stiffener, a joint, a hinge, a link, weight
    /// and a dead force with a lever.
    fn program() -> BeltProgram {
        let pieces = vec![
            element(0.2, 0.0),
            Piece::Joint { angle: 0.6 },
            element(0.15, 1.5),
            element(0.15, 1.5),
            Piece::Joint { angle: 0.0 },
            Piece::Rigid { length: 0.1 },
            Piece::Joint { angle: 0.0 },
            element(0.2, 0.0),
            element(0.2, 0.0),
        ];
        let supports = vec![
            NodeSupport {
                node: 0,
                position: [Some(0.0); 3],
                hold: Hold::Frame(UnitQuaternion::identity()),
                square_rib: true,
            },
            NodeSupport {
                node: 3,
                position: [None, Some(0.2), None],
                hold: Hold::Hinge {
                    frame: UnitQuaternion::from_scaled_axis(Vector3::new(0.4, 0.2, -0.1)),
                    axis: 2,
                },
                square_rib: false,
            },
            NodeSupport {
                node: 9,
                position: [Some(0.1), Some(0.6), Some(0.2)],
                hold: Hold::Frame(UnitQuaternion::from_scaled_axis(Vector3::new(
                    0.3, -0.4, 0.7,
                ))),
                square_rib: false,
            },
        ];
        let mut program = BeltProgram::new(pieces, EnergyModel::Wunderlich).with_supports(supports);
        program.links = vec![
            NodeLink {
                nodes: [1, 8],
                tie: Tie::Offset(Vector3::new(0.1, 0.2, 0.3)),
            },
            NodeLink {
                nodes: [1, 8],
                tie: Tie::Fields([Some(-1.0), None]),
            },
        ];
        program.loads = vec![NodeLoad {
            node: 4,
            load: DeadForce {
                force: Vector3::new(1.0, -2.0, 0.5),
                lever: Vector3::new(0.1, 0.2, -0.1),
            },
        }];
        program.weight = Vector3::new(2.0, 1.0, -3.0);
        program
    }

    fn point(program: &BeltProgram) -> BeltPoint {
        let nodes = program.nodes();
        let mut point = BeltPoint {
            fields: nodes
                .iter()
                .map(|u| Vector2::new(3.0 * (7.0 * u).cos() + 1.0, 0.4 * (5.0 * u).sin() + 0.1))
                .collect(),
            poses: vec![Pose::identity(); nodes.len()],
        };
        point.poses[0].frame = Rotation3::new(Vector3::new(0.2, 0.1, -0.3)).into_inner();
        program.settle(&mut point);
        point
    }

    /// What the solver's linearisation is the second-order expansion of.
    fn lagrangian(program: &BeltProgram, point: &mut BeltPoint, multipliers: &Multipliers) -> f64 {
        let mut values = Values::default();
        assert!(program.evaluate(point, &mut values));
        let work = |values: &[f64], multipliers: &[f64]| {
            let rows = values.iter().zip(multipliers);
            rows.map(|(value, multiplier)| value * multiplier)
                .sum::<f64>()
        };
        values.objective + work(&values.equalities, &multipliers.equalities)
            - work(&values.slacks, &multipliers.inequalities)
    }

    /// Multipliers in general position.
    fn multipliers(program: &BeltProgram, strength: f64, inequality: f64) -> Multipliers {
        let layout = program.layout();
        let equality = |row: usize| {
            let (block, row) = ((row / ROWS) as f64, (row % ROWS) as f64);
            strength * (0.7 + 0.6 * block - 0.4 * row)
        };
        Multipliers {
            equalities: (0..layout.equalities()).map(equality).collect(),
            inequalities: (0..layout.inequalities())
                .map(|row| inequality * (1.0 + 0.3 * (row % 5) as f64))
                .collect(),
        }
    }

    /// The step along a single unknown, its states carried along.
    fn unit(linear: &Linearisation<6, 2, 8>, (node, entry): (usize, usize)) -> Vec<NodeVector> {
        let mut step = vec![NodeVector::zeros(); linear.gradient.len()];
        step[node][entry] = 1.0;
        linear.chain.carry(&mut step);
        step
    }

    fn moved(program: &BeltProgram, point: &BeltPoint, steps: &[(usize, usize, f64)]) -> BeltPoint {
        let mut step = vec![NodeVector::zeros(); program.pieces.len() + 1];
        for (node, entry, size) in steps {
            step[*node][*entry] += size;
        }
        let mut into = point.clone();
        program.retract(point, &step, 1.0, &mut into);
        into
    }

    /// The start's state, then the free fields of every node.
    fn unknowns(program: &BeltProgram) -> Vec<(usize, usize)> {
        let fields = (0..=program.pieces.len()).flat_map(|k| {
            let free = program.free(k);
            (0..2).filter(move |i| free[*i]).map(move |i| (k, 6 + i))
        });
        (0..6).map(|i| (0, i)).chain(fields).collect()
    }

    #[test]
    fn test_gradient_and_hessian_agree_with_finite_differences() {
        let program = program();
        let at = point(&program);
        let multipliers = multipliers(&program, 1.0, 0.4);
        let layout = program.layout();
        let mut linear = Linearisation::new(layout.clone());
        program.linearise(&at, &multipliers, &mut linear);
        let mut gradient = linear.gradient.clone();
        for k in 0..layout.stages() {
            for row in layout.stage_rows(k) {
                for (end, by) in linear.stage_slacks[row].iter().enumerate() {
                    let mut part = gradient[k + end].fixed_rows_mut::<2>(6);
                    part -= multipliers.inequalities[row] * by;
                }
            }
        }
        linear.chain.fold(&mut gradient);
        let unknowns = unknowns(&program);
        let h = 1e-4;
        let value = |steps: &[(usize, usize, f64)]| {
            let mut point = moved(&program, &at, steps);
            lagrangian(&program, &mut point, &multipliers)
        };
        for a in &unknowns {
            let difference = (value(&[(a.0, a.1, h)]) - value(&[(a.0, a.1, -h)])) / (2.0 * h);
            let exact = gradient[a.0][a.1];
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
                let (along_a, along_b) = (unit(&linear, *a), unit(&linear, *b));
                let exact = linear
                    .chain
                    .second_derivative(&linear.diagonal, &along_a, &along_b);
                assert!(
                    (second - exact).abs() < 2e-5 * exact.abs().max(10.0),
                    "{a:?} {b:?} {second} {exact}"
                );
            }
        }
    }

    /// The lowest modes by dense matrices: of the second derivative on the null space of the constraints.
    fn dense_modes(program: &BeltProgram, at: &Stationary<BeltPoint>) -> Vec<f64> {
        let mut point = at.point.clone();
        let mut values = Values::default();
        assert!(program.evaluate(&mut point, &mut values));
        let layout = program.layout();
        let mut linear = Linearisation::new(layout.clone());
        program.linearise(&point, &at.multipliers, &mut linear);
        let unknowns = unknowns(program);
        let steps: Vec<Vec<NodeVector>> = unknowns
            .iter()
            .map(|unknown| unit(&linear, *unknown))
            .collect();
        let count = unknowns.len();
        let square =
            |product: &dyn Fn(usize, usize) -> f64| DMatrix::from_fn(count, count, product);
        let rate = |k: usize, row: usize, step: &[NodeVector]| {
            let ends = linear.stage_slacks[row].iter().zip(&step[k..]);
            let rates = ends.map(|(by, node)| by.dot(&node.fixed_rows::<2>(6)));
            rates.sum::<f64>()
        };
        let second = square(&|i, j| {
            let own = linear
                .chain
                .second_derivative(&linear.diagonal, &steps[i], &steps[j]);
            let stages = 0..layout.stages();
            let rows = stages.flat_map(|k| layout.stage_rows(k).map(move |row| (k, row)));
            let held = rows.map(|(k, row)| {
                let stiffness = at.multipliers.inequalities[row] / values.slacks[row];
                stiffness * rate(k, row, &steps[i]) * rate(k, row, &steps[j])
            });
            own + held.sum::<f64>()
        });
        let metric = program.metric(&point);
        let state = |step: &[NodeVector], k: usize| step[k].fixed_rows::<6>(0).into_owned();
        let mass = square(&|i, j| {
            let of_node = |k: usize| state(&steps[i], k).dot(&(metric[k] * state(&steps[j], k)));
            (0..metric.len()).map(of_node).sum()
        });
        let rows_of = |step: &Vec<NodeVector>| {
            let at_nodes = linear.equalities_at.iter().enumerate();
            let at_nodes = at_nodes.map(|(i, row)| row.dot(&step[program.supports[i / ROWS].node]));
            let between = linear.equalities_between.iter().enumerate();
            let between = between.map(|(i, [first, second])| {
                let [a, b] = program.links[i / ROWS].nodes;
                first.dot(&step[a]) + second.dot(&step[b])
            });
            at_nodes.chain(between).collect::<Vec<f64>>()
        };
        let columns: Vec<_> = steps
            .iter()
            .map(|step| DVector::from_vec(rows_of(step)))
            .collect();
        let jacobian = DMatrix::from_columns(&columns);
        let eigen = SymmetricEigen::new(jacobian.tr_mul(&jacobian));
        let largest = eigen.eigenvalues.amax();
        let free: Vec<_> = (0..count)
            .filter(|i| eigen.eigenvalues[*i] < 1e-12 * largest)
            .map(|i| eigen.eigenvectors.column(i).into_owned())
            .collect();
        let basis = DMatrix::from_columns(&free);
        let reduced = |matrix: &DMatrix<f64>| basis.tr_mul(&(matrix * &basis));
        let root = reduced(&mass).cholesky().unwrap().l();
        let half = root.solve_lower_triangular(&reduced(&second)).unwrap();
        let whole = root.solve_lower_triangular(&half.transpose()).unwrap();
        let mut values: Vec<f64> = whole.symmetric_eigenvalues().iter().copied().collect();
        values.sort_by(f64::total_cmp);
        values
    }

    #[test]
    fn test_lowest_modes_are_those_of_dense_matrices() {
        // Without the clamp at the end, so that the constraints leave it free to move.
        let whole = program();
        let supports = whole.supports[..2].to_vec();
        let program = whole.with_supports(supports);
        for strength in [0.1, 3.0, 30.0] {
            let mut at = Stationary {
                point: point(&program),
                multipliers: multipliers(&program, strength, 1e-3),
            };
            let expected = dense_modes(&program, &at);
            let modes = lowest_modes(&program, &mut at, 4).unwrap();
            assert_eq!(modes.len(), 4);
            for (mode, expected) in modes.iter().zip(&expected) {
                let difference = (mode.eigenvalue - expected).abs();
                assert!(
                    difference < 1e-6 * expected.abs().max(1.0),
                    "{} {expected}",
                    mode.eigenvalue
                );
            }
        }
    }

    #[test]
    fn test_rib_at_a_bend_is_one_material_line() {
        for (slope, angle) in [(0.3f64, 0.5f64), (-0.2, -1.2), (1.5, 2.0)] {
            let [beyond, first, _] = slope_beyond(slope, angle).unwrap();
            assert!((beyond.atan() - (slope.atan() - angle)).abs() < 1e-14);
            assert!((slope_beyond(beyond, -angle).unwrap()[0] - slope).abs() < 1e-14);
            let h = 1e-6;
            let at = |by: f64| slope_beyond(slope + by, angle).unwrap();
            assert!(((at(h)[0] - at(-h)[0]) / (2.0 * h) - first).abs() < 1e-6 * first);
            assert!(((at(h)[1] - at(-h)[1]) / (2.0 * h) - at(0.0)[2]).abs() < 1e-5 * first.powi(2));
        }
        assert_eq!(slope_beyond(0.0, 1.6), None);
    }

    #[test]
    fn test_ribs_beside_a_stiffener_are_square_and_nothing_bends_in_it() {
        let program = program();
        let point = point(&program);
        assert_eq!((point.fields[4][1], point.fields[7][1]), (0.0, 0.0));
        assert_eq!(
            (point.fields[5], point.fields[6]),
            (Vector2::zeros(), Vector2::zeros())
        );
        let along = point.poses[6].position - point.poses[5].position;
        assert!((along - 0.1 * point.poses[5].frame.column(1)).norm() < 1e-15);
    }

    #[test]
    fn test_weight_beyond_is_carried_by_the_internal_force() {
        let program = BeltProgram {
            supports: Vec::new(),
            links: Vec::new(),
            loads: Vec::new(),
            ..program()
        };
        let point = point(&program);
        let nodes = program.nodes();
        for (u, (force, _)) in nodes.iter().zip(program.internal(&point, &[])) {
            assert!((force - (1.0 - u) * program.weight).norm() < 1e-14);
        }
    }
}
