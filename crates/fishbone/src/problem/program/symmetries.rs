//! Symmetries: motions of the belt as a whole, and of a uniform closed belt along itself, that change nothing.

use super::{BeltPoint, BeltProgram, Piece, Tie};
use crate::geometry::{Pose, Twist, hat};
use crate::strip::bounds::ACTIVE;
use crate::strip::density::Density;
use crate::strip::element::Element;
use nalgebra::{DMatrix, DVector, RowDVector, SVector, SymmetricEigen, Vector3, Vector6};
use stagewise::NodeVector;

/// A motion of all nodes.
type Motion<const N: usize> = Vec<NodeVector<N>>;

impl<D: Density<F>, const F: usize, const N: usize> BeltProgram<D, F, N> {
    /// Motions that keep energy, supports, links and obstacles: those twists of the whole belt, with sliding along itself
    /// where it may slide, along which all conditions stay as they are to first order.
    ///
    /// Conditions whose rank is the same nearby leave a family of shapes of the same energy. Of others, as of pins on a line
    /// about which the belt may turn, a motion counts as a symmetry if all conditions stay as they are far along it.
    pub(super) fn find_symmetries(&self, point: &BeltPoint<F>) -> Vec<Motion<N>> {
        /// Largest rate of a motion that is none but for the mesh: a ring that slides along itself turns on the spot.
        const NONE: f64 = 1e-3;
        let mut kept = self.kept(point);
        if !kept.is_empty() && self.kept(&elsewhere(point)).len() != kept.len() {
            kept.retain(|parts| self.keeps_all_along(point, parts));
        }
        let sliding = self.sliding(point);
        let motion = |parts: &DVector<f64>| {
            let mut whole = NodeVector::<N>::zeros();
            whole.fixed_rows_mut::<6>(0).copy_from(&parts.rows(0, 6));
            let mut motion = vec![whole; point.poses.len()];
            for (node, slide) in motion.iter_mut().zip(sliding.iter().flatten()) {
                *node += parts[6] * slide;
            }
            motion
        };
        let is_motion = |motion: &Motion<N>| motion.iter().any(|rate| rate.amax() > NONE);
        kept.iter().map(motion).filter(is_motion).collect()
    }

    /// The half turns of a belt that slides along itself in any pose; `None` of another belt.
    pub(crate) fn slides(&self) -> Option<i32> {
        let is_held = self.supports.len() > 1;
        let slides = !is_held && self.is_uniform_and_closed() && self.seam_factors().is_some();
        self.half_turns.filter(|_| slides)
    }

    /// The programme of a belt that slides along itself with a square rib at the seam; `None` where it does not slide, or no
    /// rib need be square. The slope of the ribs changes its sign from seam to seam after an odd number of half turns.
    ///
    /// The equations and their multipliers are the same: a shape that looks the same from both sides of the square rib, as
    /// that of a Möbius band does, solves those of either programme.
    pub(crate) fn with_square_seam(&self) -> Option<Self> {
        let is_odd = self.slides()? % 2 != 0;
        is_odd.then(|| {
            let mut held = self.clone();
            held.fixed[0][1] = Some(0.0);
            held
        })
    }

    /// Combinations of the six twists and of sliding that all conditions leave.
    fn kept(&self, point: &BeltPoint<F>) -> Vec<DVector<f64>> {
        /// Square of the change of the conditions along a combination up to which it is kept; lengths in U and angles in
        /// rad, per unit of the combination.
        const KEPT: f64 = 1e-12;
        let sliding = self.sliding(point);
        let count = 6 + usize::from(sliding.is_some());
        let rows = self.conditions_along(point, sliding.as_ref());
        let mut squares = DMatrix::zeros(count, count);
        for row in rows {
            let row = RowDVector::from_row_slice(&row[..count]);
            squares += row.transpose() * &row;
        }
        let eigen = SymmetricEigen::new(squares);
        let pairs = eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter());
        let kept = pairs.filter(|(square, _)| **square <= KEPT);
        kept.map(|(_, vector)| vector.into_owned()).collect()
    }

    /// Whether supports, links, obstacles and the potential of loads stay as they are as the whole belt turns far by a twist; not
    /// known of a motion that slides along the belt too.
    fn keeps_all_along(&self, point: &BeltPoint<F>, parts: &DVector<f64>) -> bool {
        /// Amounts of the twist, of which the conditions know no period, in rad and U.
        const AMOUNTS: [f64; 3] = [0.4, 1.1, -0.7];
        /// Change of a condition by rounding; lengths in U, angles in rad and energy in mean R_f/U.
        const ROUNDING: f64 = 1e-7;
        let slides = parts.iter().skip(6).any(|part| part.abs() > ROUNDING);
        let twist = Vector6::from_column_slice(&parts.as_slice()[..6]);
        let size = 1.0 + self.total_load();
        let conditions = |point: &BeltPoint<F>| {
            let supports = self.supports.iter();
            let supports = supports.map(|support| support.value(&point.poses[support.node]));
            let links = self.links.iter().map(|link| link.value(point));
            let obstacles = self.obstacles.iter();
            let obstacles = obstacles.map(|o| o.gap(&point.poses[o.node]));
            let rows = supports.chain(links);
            let rows = rows.flat_map(|rows| rows.iter().copied().collect::<Vec<_>>());
            let potential = self.load_potential(&point.poses) / size;
            let all = rows.chain(obstacles).chain([potential]);
            all.collect::<Vec<f64>>()
        };
        let own = conditions(point);
        let is_kept = |amount: f64| {
            let by = Pose::exp(&Twist::from_vector(&(amount * twist)));
            let moved = conditions(&moved(point, by));
            let mut changes = own
                .iter()
                .zip(moved)
                .map(|(own, moved)| (own - moved).abs());
            changes.all(|change| change <= ROUNDING)
        };
        !slides && AMOUNTS.into_iter().all(is_kept)
    }

    /// Changes of the conditions along the six twists, then along sliding. Of a load the condition is that its force keeps
    /// its direction and its point's place along it: dead forces keep their potential in no other group of motions.
    fn conditions_along(&self, point: &BeltPoint<F>, sliding: Option<&Motion<N>>) -> Vec<[f64; 7]> {
        let mut rows = Vec::new();
        let mut add = |by_twist: Vector6<f64>, along_sliding: f64| {
            let mut row = [along_sliding; 7];
            row[..6].copy_from_slice(by_twist.as_slice());
            rows.push(row);
        };
        let slide = |node: usize| sliding.map_or_else(NodeVector::<N>::zeros, |s| s[node]);
        let twist = |node: usize| slide(node).fixed_rows::<6>(0).into_owned();
        for support in &self.supports {
            for row in support.jacobian(&point.poses[support.node]).row_iter() {
                let by_twist = row.transpose();
                add(by_twist, by_twist.dot(&twist(support.node)));
            }
            if let Some(by_twist) = support.turned_by_twist(&point.poses[support.node]) {
                add(by_twist, by_twist.dot(&twist(support.node)));
            }
        }
        for link in &self.links {
            let [first, second] = link.jacobian::<F, N>(point);
            let whole = first + second;
            let slid = first * slide(link.nodes[0]) + second * slide(link.nodes[1]);
            for (row, slid) in whole.row_iter().zip(&slid) {
                add(row.fixed_columns::<6>(0).transpose(), *slid);
            }
        }
        for obstacle in &self.obstacles {
            let gradient = obstacle.gradient(&point.poses[obstacle.node]);
            add(gradient, gradient.dot(&twist(obstacle.node)));
        }
        let forces = self.loads.iter().map(|load| load.load.force);
        let forces = forces
            .chain([self.weight])
            .filter(|f| *f != Vector3::zeros());
        for direction in forces.map(|force| force.normalize()) {
            let of = |by_translation: &Vector3<f64>, by_rotation: &Vector3<f64>| {
                let [a, b] = [by_translation, by_rotation].map(|v| v.as_slice());
                Vector6::from_column_slice(&[a, b].concat())
            };
            add(of(&direction, &Vector3::zeros()), 0.0);
            for row in hat(&direction).row_iter() {
                add(of(&Vector3::zeros(), &row.transpose()), 0.0);
            }
        }
        rows
    }

    /// The motion of a belt along itself by a unit of length, where it is the same belt afterwards: every node takes on the
    /// pose and the fields of the next. Two places that are held keep their distance to first order at most.
    fn sliding(&self, point: &BeltPoint<F>) -> Option<Motion<N>> {
        self.slides()?;
        let factors = self.seam_factors()?;
        let lengths: Vec<f64> = self.pieces.iter().map(Piece::length).collect();
        let last = lengths.len();
        let rate = |k: usize| {
            let [from, to] = [&point.poses[k], &point.poses[k + 1]];
            let twist = (*to * from.inverse()).log().to_vector() / lengths[k];
            let fields = (point.fields[k + 1] - point.fields[k]) / lengths[k];
            let mut rate = NodeVector::<N>::zeros();
            rate.fixed_rows_mut::<6>(0).copy_from(&twist);
            rate.fixed_rows_mut::<F>(6).copy_from(&fields);
            rate
        };
        // The rate at a node is that of a parabola through it and the nodes beside it.
        let between = |before: NodeVector<N>, after: NodeVector<N>, [a, b]: [f64; 2]| {
            (before * b + after * a) / (a + b)
        };
        let across = |mut rate: NodeVector<N>| {
            let mut fields = rate.fixed_rows_mut::<F>(6);
            fields.component_mul_assign(&factors);
            rate
        };
        let ends = [lengths[last - 1], lengths[0]];
        let at = |k: usize| match k {
            0 => between(across(rate(last - 1)), rate(0), ends),
            k if k == last => between(rate(last - 1), across(rate(0)), ends),
            k => between(rate(k - 1), rate(k), [lengths[k - 1], lengths[k]]),
        };
        Some((0..=last).map(at).collect())
    }

    /// Whether the belt is closed, and no place of it differs from another, but for supports.
    fn is_uniform_and_closed(&self) -> bool {
        let alike = |piece: &Piece| match piece {
            Piece::Strip(element) => Some(Element {
                length: 0.0,
                ..*element
            }),
            Piece::Rigid { .. } | Piece::Joint { .. } => None,
        };
        let mut pieces = self.pieces.iter().map(alike);
        let first = pieces.next().flatten();
        self.half_turns.is_some()
            && first.is_some_and(|first| {
                first.rigidity[0] == first.rigidity[1] && pieces.all(|piece| piece == Some(first))
            })
            && self.edges.iter().all(|edges| *edges == [None; ACTIVE])
            && self.fixed.iter().flatten().all(Option::is_none)
            && self.loads.is_empty()
    }

    /// The factors by which the fields go on through the seam; `None` where one need not, or where another link ties nodes.
    fn seam_factors(&self) -> Option<SVector<f64, F>> {
        let mut found = None;
        for link in &self.links {
            match link.tie {
                Tie::Offset(_) => return None,
                Tie::Pose(_) => (),
                Tie::Fields(factors) => {
                    let factors: Option<Vec<f64>> = factors[..F].iter().copied().collect();
                    found = factors.map(|factors| SVector::from_column_slice(&factors));
                }
            }
        }
        found
    }
}

/// The same shape in another pose, in general position.
fn elsewhere<const F: usize>(point: &BeltPoint<F>) -> BeltPoint<F> {
    let by = Pose::exp(&Twist {
        translation: Vector3::new(0.05, -0.03, 0.02),
        rotation: Vector3::new(0.2, -0.3, 0.1),
    });
    moved(point, by)
}

/// The same shape moved as a whole.
fn moved<const F: usize>(point: &BeltPoint<F>, by: Pose) -> BeltPoint<F> {
    BeltPoint {
        fields: point.fields.clone(),
        poses: point.poses.iter().map(|pose| by * *pose).collect(),
    }
}
