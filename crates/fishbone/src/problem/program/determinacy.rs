//! Multipliers of supports and links that the shape does not determine.
//!
//! At an equilibrium the multipliers balance the gradient of the energy along every motion of the belt. A combination of
//! multipliers that works on no motion is free: any multiple of it can be added. Motions are rigid motions of the whole belt,
//! bend and torsion. Torsion counts where the belt is flat, too: a flat belt may twist as soon as it bends, with ribs of any
//! slope, and its least energy is stationary only if no such beginning has a gradient.

use super::{BeltPoint, BeltProgram, ROWS};
use crate::geometry::Pose;
use crate::strip::density::Density;
use nalgebra::{DMatrix, SVD, Vector3, Vector6};

/// Force and moment about a point, world axes.
type Wrench = (Vector3<f64>, Vector3<f64>);
/// Whether each component of a vector is undetermined.
type Components = [bool; 3];

/// The components of forces and moments that the shape does not determine.
#[derive(Debug, Clone)]
pub(crate) struct Undetermined {
    /// Of force and moment, by support.
    reactions: Vec<[Components; 2]>,
    /// Of the force, by link.
    links: Vec<Components>,
    /// Of force and moment, by node.
    internal: Vec<[Components; 2]>,
}

impl<D: Density<F>, const F: usize, const N: usize> BeltProgram<D, F, N> {
    /// The forces and moments at a shape that its first-order conditions leave open; `None` where they determine all.
    pub(crate) fn undetermined(&self, point: &BeltPoint<F>) -> Option<Undetermined> {
        let free = self.free_multipliers(point)?;
        let none = vec![0.0; free[0].len()];
        let loads = self.internal(point, &none);
        let nodes = point.poses.len();
        let mut undetermined = Undetermined {
            reactions: vec![[[false; 3]; 2]; self.supports.len()],
            links: vec![[false; 3]; self.links.len()],
            internal: vec![[[false; 3]; 2]; nodes],
        };
        for multipliers in &free {
            let reactions = self.reactions(point, multipliers);
            let links = self.link_forces(multipliers);
            let internal = self.internal(point, multipliers).into_iter().zip(&loads);
            let internal: Vec<Wrench> = internal
                .map(|(all, loads)| (all.0 - loads.0, all.1 - loads.1))
                .collect();
            let sizes = reactions
                .iter()
                .map(|(force, moment)| force.amax().max(moment.amax()));
            let sizes = sizes.chain(links.iter().map(|force| force.amax()));
            let size = sizes.fold(0.0, f64::max);
            for (into, wrench) in undetermined.reactions.iter_mut().zip(&reactions) {
                mark_both(into, wrench, size);
            }
            for (into, force) in undetermined.links.iter_mut().zip(&links) {
                mark(into, force, size);
            }
            for (into, wrench) in undetermined.internal.iter_mut().zip(&internal) {
                mark_both(into, wrench, size);
            }
        }
        Some(undetermined)
    }

    /// A basis of the combinations of the multipliers that work on no motion of the belt; `None` where there are none, which
    /// the motions of a few elements tell of most shapes.
    fn free_multipliers(&self, point: &BeltPoint<F>) -> Option<Vec<Vec<f64>>> {
        /// Elements whose motions are tried first, a number.
        const FEW: usize = 12;
        /// Eigenvalue of the scaled compliance above which conditions are independent beyond doubt; dimensionless.
        const INDEPENDENT: f64 = 1e-4;
        /// Eigenvalue below which conditions depend on each other; dimensionless. A belt between two clamps with a slack of
        /// s lengths has some 0.1 s.
        const DEPENDENT: f64 = 1e-11;
        // A link between two of these elements would not be moved by any of them.
        let every = self.pieces.len() / FEW;
        if every > 1
            && self.links.is_empty()
            && self
                .combinations_below(INDEPENDENT, point, every)
                .is_empty()
        {
            return None;
        }
        let free = self.combinations_below(DEPENDENT, point, 1);
        (!free.is_empty()).then_some(free)
    }

    /// The combinations of the multipliers whose scaled compliance, by the motions of the whole and of one element in `every`,
    /// is below an eigenvalue.
    fn combinations_below(&self, most: f64, point: &BeltPoint<F>, every: usize) -> Vec<Vec<f64>> {
        let work = self.work_on_motions(point, every);
        let squares: Vec<f64> = work.row_iter().map(|row| row.norm_squared()).collect();
        let used: Vec<usize> = (0..squares.len())
            .filter(|row| squares[*row] > 0.0)
            .collect();
        let scaled = DMatrix::from_fn(used.len(), work.ncols(), |i, j| {
            work[(used[i], j)] / squares[used[i]].sqrt()
        });
        // The squares of singular values are the eigenvalues, without the rounding of products.
        let singular = SVD::new(scaled, true, false);
        let vectors = singular.u.expect("asked for");
        let combinations = singular.singular_values.iter().zip(vectors.column_iter());
        let free = combinations.filter(|(value, _)| *value * *value < most);
        free.map(|(_, vector)| {
            let mut multipliers = vec![0.0; squares.len()];
            for (row, part) in used.iter().zip(&vector) {
                multipliers[*row] = part / squares[*row].sqrt();
            }
            multipliers
        })
        .collect()
    }

    /// Change of every condition of supports and links, by rows, along every motion of the belt, by columns: six of the whole,
    /// then bend and torsion of one element in `every`.
    fn work_on_motions(&self, point: &BeltPoint<F>, every: usize) -> DMatrix<f64> {
        let mut motions: Vec<(usize, Vector6<f64>)> =
            (0..6).map(|i| (0, Vector6::ith(i, 1.0))).collect();
        for (k, element) in self.elements().step_by(every) {
            let [a, b] = [&point.poses[k], &point.poses[k + 1]];
            let turn = |axis: usize| {
                let along = a.frame.column(axis) + b.frame.column(axis);
                let turn = along.normalize() * element.length.sqrt();
                let middle = 0.5 * (a.position + b.position);
                let moved = middle.cross(&turn);
                Vector6::from_iterator(moved.iter().chain(&turn).copied())
            };
            motions.extend([(k + 1, turn(2)), (k + 1, turn(1))]);
        }
        let rows = ROWS * (self.supports.len() + self.links.len());
        let mut work = DMatrix::zeros(rows, motions.len());
        let supports = self.supports.iter().enumerate();
        let supports = supports.map(|(i, support)| {
            let pose: &Pose = &point.poses[support.node];
            (i, support.node, support.jacobian(pose))
        });
        let links = self.links.iter().enumerate().flat_map(|(i, link)| {
            let place = self.supports.len() + i;
            let jacobians = link.jacobian::<F, N>(point);
            let by_twist = jacobians.map(|by| by.fixed_columns::<6>(0).into_owned());
            [0, 1].map(|end| (place, link.nodes[end], by_twist[end]))
        });
        for (place, node, jacobian) in supports.chain(links) {
            for (column, (first, motion)) in motions.iter().enumerate() {
                if *first <= node {
                    let mut rows = work.fixed_view_mut::<ROWS, 1>(ROWS * place, column);
                    rows += jacobian * motion;
                }
            }
        }
        work
    }
}

fn mark(into: &mut Components, vector: &Vector3<f64>, size: f64) {
    /// Share of the largest component above which a component participates; dimensionless.
    const PARTICIPATION: f64 = 1e-4;
    for (into, part) in into.iter_mut().zip(vector) {
        *into |= part.abs() > PARTICIPATION * size;
    }
}

fn mark_both(into: &mut [Components; 2], (force, moment): &Wrench, size: f64) {
    mark(&mut into[0], force, size);
    mark(&mut into[1], moment, size);
}

impl Undetermined {
    /// Sets the undetermined components to a number: of the wrenches of supports, the forces of links, and the wrenches of
    /// nodes.
    pub(crate) fn set(
        &self,
        to: f64,
        reactions: &mut [Wrench],
        links: &mut [Vector3<f64>],
        internal: &mut [Wrench],
    ) {
        let set = |components: &Components, vector: &mut Vector3<f64>| {
            for (part, is_undetermined) in vector.iter_mut().zip(components) {
                if *is_undetermined {
                    *part = to;
                }
            }
        };
        let supports = self.reactions.iter().zip(reactions);
        for (components, wrench) in supports.chain(self.internal.iter().zip(internal)) {
            set(&components[0], &mut wrench.0);
            set(&components[1], &mut wrench.1);
        }
        for (components, force) in self.links.iter().zip(links) {
            set(components, force);
        }
    }
}
