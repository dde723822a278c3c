//! The constrained minimisation: energy of a chain of pieces under supports, links and loads, Eq. (34)–(36).
//!
//! Poses are not unknowns of their own: they are carried from the start along the pieces. So every point of the search is a
//! belt without a break, and the conditions of supports and links are the only equations. In the same way the rib slope is
//! carried across a bend of the board, where the rib is one material line.

mod derivatives;
mod determinacy;
mod flat;
mod link;
mod load;
mod obstacle;
mod piece;
mod support;
mod symmetries;
#[cfg(test)]
mod tests;

pub(crate) use determinacy::Undetermined;
pub(crate) use flat::TwistingProgram;
pub use link::{NodeLink, Tie};
pub(crate) use load::weight;
pub use load::{DeadForce, NodeLoad};
pub use obstacle::{NodeObstacle, Obstacle};
pub use piece::Piece;
pub(crate) use support::Turn;
pub use support::{Hold, NodeSupport};

use crate::geometry::Pose;
use crate::strip::bounds::{ACTIVE, ActiveEdges, RibBounds};
use crate::strip::density::{Density, LANES, Motions};
use crate::strip::developable::DevelopableEnergy;
use crate::strip::element::Element;
use crate::strip::shell::{FIELDS, Shell};
use nalgebra::{SVector, UnitQuaternion, Vector3, Vector6};
use num_dual::DualNum;
use stagewise::{Distance, NodeVector};

/// Rows of the conditions of one support or link, a number.
pub(crate) const ROWS: usize = 6;
/// Values or multipliers of the conditions of one support or link; unused rows are zero.
pub(crate) type Rows = SVector<f64, ROWS>;

/// The multipliers of a support or link, by its place: supports first, then links.
pub(crate) fn rows_of(multipliers: &[f64], place: usize) -> Rows {
    Rows::from_column_slice(&multipliers[ROWS * place..ROWS * (place + 1)])
}

/// The programme of a belt. Lengths are in U and energies in mean R_f/U.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct BeltProgram<D = DevelopableEnergy, const F: usize = 2, const N: usize = 8> {
    /// Pieces in order along the spine.
    pub pieces: Vec<Piece>,
    /// Active edges of every piece; only strips have any.
    pub edges: Vec<ActiveEdges>,
    /// Bending energy.
    pub model: D,
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
    /// Obstacles that nodes must not enter.
    #[cfg_attr(feature = "io", serde(with = "crate::serial::none"))]
    pub obstacles: Vec<NodeObstacle>,
    /// Prescribed fields of every node.
    #[cfg_attr(feature = "io", serde(with = "crate::serial::arrays"))]
    fixed: Vec<[Option<f64>; F]>,
}

/// A shape of the belt.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct BeltPoint<const F: usize = 2> {
    /// Fields at every node: bend, rib slope, then any other fields of the density.
    pub fields: Vec<SVector<f64, F>>,
    /// Pose of every node; the first is an unknown, the others follow from it and the fields.
    pub poses: Vec<Pose>,
}

impl<const F: usize> Distance for BeltPoint<F> {
    fn copy_from(&mut self, other: &Self) {
        self.fields.copy_from_slice(&other.fields);
        self.poses.copy_from_slice(&other.poses);
    }

    /// The largest displacement of a node, in U.
    fn distance(&self, other: &Self) -> f64 {
        let poses = self.poses.iter().zip(&other.poses);
        let moves = poses.map(|(a, b)| (a.position - b.position).norm());
        moves.fold(0.0, f64::max)
    }
}

impl<D: Density<F>, const F: usize, const N: usize> BeltProgram<D, F, N> {
    /// The programme of a chain of pieces without supports, links or loads.
    pub fn new(pieces: Vec<Piece>, model: D) -> Self {
        let nodes = pieces.len() + 1;
        Self {
            edges: vec![[None; ACTIVE]; pieces.len()],
            pieces,
            model,
            supports: Vec::new(),
            links: Vec::new(),
            loads: Vec::new(),
            weight: Vector3::zeros(),
            half_turns: None,
            obstacles: Vec::new(),
            fixed: vec![[None; F]; nodes],
        }
        .with_supports(Vec::new())
    }

    /// The programme with these supports in place of its own.
    pub fn with_supports(mut self, supports: Vec<NodeSupport>) -> Self {
        let nodes = self.pieces.len() + 1;
        self.fixed = (0..nodes).map(|node| self.fixed_by_pieces(node)).collect();
        self.fix_across_seam();
        for support in supports.iter().filter(|support| support.square_rib) {
            self.hold_square(support.node);
        }
        self.supports = supports;
        self.fix_across_joints();
        self
    }

    /// The same belt with another density of the energy.
    pub(crate) fn as_shell(&self, shell: Shell) -> BeltProgram<Shell, FIELDS, 12> {
        let mut program = BeltProgram::new(self.pieces.clone(), shell);
        program.half_turns = self.half_turns;
        let mut program = program.with_supports(self.supports.clone());
        program.links = self.links.clone();
        for link in &mut program.links {
            if let Tie::Fields(factors) = &mut link.tie {
                let [bend, slope, ..] = *factors;
                // The twist does not change its sign where bend and slope do.
                let twist = slope.map(|sign| sign * sign);
                *factors = [bend, slope, slope, twist, slope, slope];
            }
        }
        program.loads = self.loads.clone();
        program.weight = self.weight;
        program.obstacles = self.obstacles.clone();
        program
    }

    /// A closed belt cut open at its seam and twisted there by an angle in place of its half turns, as between two
    /// clamps.
    pub(crate) fn cut_and_twisted(&self, angle: f64) -> Self {
        let mut cut = self.clone();
        for link in &mut cut.links {
            match &mut link.tie {
                Tie::Offset(_) => (),
                Tie::Pose(turn) => {
                    *turn = UnitQuaternion::from_scaled_axis(angle * Vector3::y());
                }
                Tie::Fields(fields) => *fields = [None; ROWS],
            }
        }
        cut
    }

    /// The programme of a belt as many times as wide, of the same rigidity.
    pub(crate) fn widened(mut self, factor: f64) -> Self {
        for piece in &mut self.pieces {
            if let Piece::Strip(element) = piece {
                element.half_width *= factor;
            }
        }
        self
    }

    /// The programme under a share of its weight, loads and moments.
    pub(crate) fn under_share_of_loads(mut self, share: f64) -> Self {
        self.weight *= share;
        for support in &mut self.supports {
            if let Hold::Hinge { moment, .. } = &mut support.hold {
                *moment *= share;
            }
        }
        for load in &mut self.loads {
            load.load.force *= share;
        }
        self
    }

    /// Sum of weight and loads, world axes, in mean R_f/U².
    pub(crate) fn total_force(&self) -> Vector3<f64> {
        let forces = self.loads.iter().map(|load| load.load.force);
        self.weight + forces.sum::<Vector3<f64>>()
    }

    /// Sum of the sizes of weight, loads and moments, in mean R_f/U².
    pub(crate) fn total_load(&self) -> f64 {
        let forces = self.loads.iter().map(|load| load.load.force.norm());
        let moments = self
            .supports
            .iter()
            .map(|support| support.hold.moment().abs());
        self.weight.norm() + forces.sum::<f64>() + moments.sum::<f64>()
    }

    /// Fields that a stiffened stretch prescribes at a node: no bend inside, square ribs at its ends too.
    fn fixed_by_pieces(&self, node: usize) -> [Option<f64>; F] {
        let beside = [node.checked_sub(1), Some(node)];
        let pieces = beside
            .into_iter()
            .flatten()
            .filter_map(|k| self.pieces.get(k));
        let is_rigid = |piece: &&Piece| matches!(piece, Piece::Rigid { .. });
        match pieces.clone().any(|piece| is_rigid(&piece)) {
            true => [Some(0.0); F],
            false => [None; F],
        }
    }

    /// Prescribes a square rib at a node.
    fn hold_square(&mut self, node: usize) {
        for (fixed, held) in self.fixed[node].iter_mut().zip(self.model.held()) {
            if held {
                fixed.get_or_insert(0.0);
            }
        }
    }

    /// Prescribes a square rib on both sides of the seam of a closed belt if a stiffener is beside it.
    fn fix_across_seam(&mut self) {
        let is_rigid = |piece: Option<&Piece>| matches!(piece, Some(Piece::Rigid { .. }));
        let beside = is_rigid(self.pieces.first()) || is_rigid(self.pieces.last());
        if self.half_turns.is_some() && beside {
            for node in [0, self.pieces.len()] {
                self.hold_square(node);
            }
        }
    }

    /// Prescribes the rib on the other side of a joint wherever it is prescribed on one side.
    fn fix_across_joints(&mut self) {
        for k in 0..self.pieces.len() {
            let Some((angle, [before, after])) = self.joint(k) else {
                continue;
            };
            let ways = [
                (k, k + 1, angle, [before, after]),
                (k + 1, k, -angle, [after, before]),
            ];
            for (from, to, angle, geodesic) in ways {
                let fixed = self.fixed[from];
                let known = fixed.map(|fixed| fixed.unwrap_or(0.0));
                let rib = fixed[1].and_then(|_| self.model.beyond(angle, geodesic, &known));
                for i in 0..F {
                    if self.model.held()[i]
                        && fixed[i].is_some()
                        && let Some(rib) = &rib
                    {
                        self.fixed[to][i].get_or_insert(rib[i]);
                    }
                }
            }
        }
    }

    /// The angle of the joint that a piece is, and the in-plane curvature of the board before and beyond.
    fn joint(&self, piece: usize) -> Option<(f64, [f64; 2])> {
        let geodesic = |k: Option<usize>| match k.and_then(|k| self.pieces.get(k)) {
            Some(Piece::Strip(element)) => element.geodesic,
            _ => 0.0,
        };
        match self.pieces[piece] {
            Piece::Joint { angle } => {
                Some((angle, [piece.checked_sub(1), Some(piece + 1)].map(geodesic)))
            }
            Piece::Strip(_) | Piece::Rigid { .. } => None,
        }
    }

    /// Whether each field of a node is an unknown: neither prescribed nor carried on from the node before.
    fn free(&self, node: usize) -> [bool; F] {
        let tied = self.tied(node);
        std::array::from_fn(|i| self.fixed[node][i].is_none() && !tied[i])
    }

    /// Whether each field of a node is carried on from the node before.
    fn tied(&self, node: usize) -> [bool; F] {
        let joint = node
            .checked_sub(1)
            .is_some_and(|k| matches!(self.pieces[k], Piece::Joint { .. }));
        let is_free = joint && self.fixed[node][1].is_none();
        self.model.carried().map(|carried| is_free && carried)
    }

    /// Whether the rib of a node is carried on from the node before.
    fn is_tied(&self, node: usize) -> bool {
        self.tied(node)[1]
    }

    /// The fields beyond the joint before a node, of which some are carried on.
    fn beyond<T: DualNum<Primitive = f64> + Copy>(
        &self,
        node: usize,
        fields: &[T; F],
    ) -> Option<[T; F]> {
        let (angle, geodesic) = self.joint(node - 1)?;
        self.model.beyond(angle, geodesic, fields)
    }

    /// Carries fields on across the joint before a node; they stay where the rib would leave through a bend of the board.
    fn carry_across(&self, point: &mut BeltPoint<F>, node: usize) {
        if self.is_tied(node)
            && let Some(beyond) = self.beyond(node, &point.fields[node - 1].data.0[0])
        {
            for (i, tied) in self.tied(node).into_iter().enumerate() {
                if tied {
                    point.fields[node][i] = beyond[i];
                }
            }
        }
    }

    /// Sets the prescribed and the carried fields of a point, and its poses.
    ///
    /// A rib that would leave through a bend of the board keeps its slope.
    pub fn settle(&self, point: &mut BeltPoint<F>) {
        for node in 0..point.fields.len() {
            for (i, fixed) in self.fixed[node].iter().enumerate() {
                if let Some(fixed) = fixed {
                    point.fields[node][i] = *fixed;
                }
            }
            self.carry_across(point, node);
        }
        self.carry(point);
    }

    /// The least slack of the ribs against crossing; negative infinity where a rib would leave through a bend.
    pub(crate) fn least_slack(&self, point: &BeltPoint<F>) -> f64 {
        if self.rib_leaves_through_bend(point) {
            return f64::NEG_INFINITY;
        }
        let mut slacks = Vec::new();
        for (k, element) in self.elements() {
            let ends = [&point.fields[k], &point.fields[k + 1]];
            self.model
                .slacks(element, &self.edges[k], ends, &mut slacks);
        }
        slacks.into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Greatest residual of a shape's supports, lengths in U and angles in rad.
    pub(crate) fn miss_of_supports(&self, point: &BeltPoint<F>) -> f64 {
        let miss = |support: &NodeSupport| support.value(&point.poses[support.node]).norm();
        self.supports.iter().map(miss).sum()
    }

    fn rib_leaves_through_bend(&self, point: &BeltPoint<F>) -> bool {
        let fields = |node: usize| point.fields[node - 1].data.0[0];
        let leaves = |node| self.is_tied(node) && self.beyond(node, &fields(node)).is_none();
        (1..point.fields.len()).any(leaves)
    }

    /// The rib slope of a node, where it is prescribed.
    pub(crate) fn fixed_slope(&self, node: usize) -> Option<f64> {
        self.fixed[node][1]
    }

    /// The flexible elements, each with its number among the pieces.
    pub(crate) fn elements(&self) -> impl Iterator<Item = (usize, &Element)> {
        self.pieces
            .iter()
            .enumerate()
            .filter_map(|(k, piece)| match piece {
                Piece::Strip(element) => Some((k, element)),
                Piece::Rigid { .. } | Piece::Joint { .. } => None,
            })
    }

    /// The inequalities that keep the ribs of an element apart; `k` is the element's number among the pieces.
    pub(crate) fn bounds(&self, k: usize, element: &Element) -> RibBounds<'_> {
        element.bounds(&self.edges[k])
    }

    /// Arc length of every node, in U.
    pub(crate) fn nodes(&self) -> Vec<f64> {
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
    pub(crate) fn elastic_energy(&self, fields: &[SVector<f64, F>]) -> f64 {
        let elements = self.elements();
        let with_fields = elements.map(|(k, element)| (element, [&fields[k], &fields[k + 1]]));
        self.model.total_energy(with_fields)
    }

    /// Potential of weight, loads and moments.
    pub(crate) fn load_potential(&self, poses: &[Pose]) -> f64 {
        let loads = self.loads.iter();
        let dead = loads.map(|load| load.load.potential(&poses[load.node]));
        let dead = dead.sum::<f64>() + self.potential_of_moments(poses);
        let weight = |(k, piece): (usize, &Piece)| {
            let ends = load::weight(&self.weight, piece.length());
            ends[0].potential(&poses[k]) + ends[1].potential(&poses[k + 1])
        };
        match self.is_weightless() {
            true => dead,
            false => dead + self.pieces.iter().enumerate().map(weight).sum::<f64>(),
        }
    }

    /// Potential of the moments of hinges: minus moment times angle. The angle is followed along the belt from the first
    /// support that holds a whole frame, or else from the first that holds a hinge's axis.
    fn potential_of_moments(&self, poses: &[Pose]) -> f64 {
        let frame = |support: &NodeSupport| {
            let frame = support.hold.frame()?.to_rotation_matrix().into_inner();
            Some((support.node, frame))
        };
        let is_whole = |support: &&NodeSupport| matches!(support.hold, Hold::Frame(_));
        let whole = self.supports.iter().find(is_whole);
        let origin = whole.or_else(|| self.supports.iter().find(|s| frame(s).is_some()));
        let Some((from, origin)) = origin.and_then(frame) else {
            return 0.0;
        };
        let potential = |support: &NodeSupport| {
            let between = &poses[from.min(support.node)..=from.max(support.node)];
            let frames = between.iter().map(|pose| &pose.frame);
            let turned = match from <= support.node {
                true => support.turned(&origin, frames),
                false => support.turned(&origin, frames.rev()),
            };
            Some(-support.hold.moment() * turned?)
        };
        self.supports.iter().filter_map(potential).sum()
    }

    /// Whether weight, dead forces or moments act.
    pub(crate) fn is_loaded(&self) -> bool {
        let bears_moment = |support: &NodeSupport| support.hold.moment() != 0.0;
        !self.is_weightless() || !self.loads.is_empty() || self.supports.iter().any(bears_moment)
    }

    fn is_weightless(&self) -> bool {
        self.weight == Vector3::zeros()
    }

    /// Carries the poses on from the first, Eq. (3).
    pub(crate) fn carry(&self, point: &mut BeltPoint<F>) {
        let mut motions = D::Motions::default();
        let mut pose = point.poses[0];
        for (pieces, from) in self.pieces.chunks(LANES).zip((0..).step_by(LANES)) {
            for (lane, piece) in pieces.iter().enumerate() {
                if let Piece::Strip(element) = piece {
                    let ends = [&point.fields[from + lane], &point.fields[from + lane + 1]];
                    motions.set(lane, element, ends);
                }
            }
            motions.find(&self.model);
            for (lane, piece) in pieces.iter().enumerate() {
                pose = pose * piece.fixed_motion().unwrap_or_else(|| motions.at(lane));
                point.poses[from + lane + 1] = pose;
            }
        }
    }

    /// Derivatives of all work by the twist of the belt from each node on: the wrench of the loads and supports at the node
    /// and beyond.
    ///
    /// A wrench about the origin changes along the belt only where loads or supports act.
    fn wrenches(&self, point: &BeltPoint<F>, multipliers: &[f64], into: &mut [NodeVector<N>]) {
        for (i, support) in self.supports.iter().enumerate() {
            let rows = rows_of(multipliers, i);
            let force = support.generalised_force(&point.poses[support.node], &rows);
            add_wrench(&mut into[support.node], &force);
        }
        for (i, link) in self.links.iter().enumerate() {
            let rows = rows_of(multipliers, self.supports.len() + i);
            for (node, by_node) in link.nodes.iter().zip(link.jacobian::<F, N>(point)) {
                into[*node] += by_node.tr_mul(&rows);
            }
        }
        let mut add = |node: usize, load: &DeadForce| {
            let mut wrench = into[node].fixed_rows_mut::<6>(0);
            wrench += load.generalised_force(&point.poses[node]);
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

    /// Internal force and moment at every node, world axes: the action of the belt beyond on the part before; at the last
    /// node, the action of its support and loads.
    pub(crate) fn internal(
        &self,
        point: &BeltPoint<F>,
        multipliers: &[f64],
    ) -> Vec<(Vector3<f64>, Vector3<f64>)> {
        let last = self.pieces.len();
        let mut wrenches = vec![NodeVector::<N>::zeros(); last + 1];
        self.wrenches(point, multipliers, &mut wrenches);
        let at = |k: usize| {
            let beyond: Vector6<f64> = match wrenches.get(k + 1) {
                Some(beyond) => beyond.fixed_rows::<6>(0) + self.force_of_weight(k, 0, point),
                None => {
                    wrenches[last].fixed_rows::<6>(0) - self.force_of_weight(last - 1, 1, point)
                }
            };
            let (force, moment) = (beyond.fixed_rows::<3>(0), beyond.fixed_rows::<3>(3));
            let about_node = moment - point.poses[k].position.cross(&force);
            (-force.into_owned(), -about_node)
        };
        (0..=last).map(at).collect()
    }

    /// Generalised force of a piece's weight at its first node, 0, or its second, 1: the gradient of its potential.
    fn force_of_weight(&self, piece: usize, end: usize, point: &BeltPoint<F>) -> Vector6<f64> {
        let shares = load::weight(&self.weight, self.pieces[piece].length());
        shares[end].generalised_force(&point.poses[piece + end])
    }

    /// Moves a support, as [`NodeSupport::move_to`].
    pub(crate) fn move_support(&mut self, support: usize, pose: &Pose) {
        self.supports[support].move_to(pose);
    }

    /// Force and moment of every support on the belt, world axes, about the support's point.
    pub fn reactions(
        &self,
        point: &BeltPoint<F>,
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
    pub(crate) fn link_forces(&self, multipliers: &[f64]) -> Vec<Vector3<f64>> {
        let links = (0..self.links.len()).map(|i| self.supports.len() + i);
        links
            .map(|place| -rows_of(multipliers, place).fixed_rows::<3>(0).into_owned())
            .collect()
    }
}

/// Adds a wrench about the origin to the derivative by a node's state.
fn add_wrench<const N: usize>(into: &mut NodeVector<N>, wrench: &Vector6<f64>) {
    let mut by_state = into.fixed_rows_mut::<6>(0);
    by_state += wrench;
}
