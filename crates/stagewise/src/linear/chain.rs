//! Linear-quadratic programme on a chain, factorised stage by stage in time linear in its length.
//!
//! The chain has one node more than it has stages. A node carries a state (`X` numbers) and controls (`U`). The state grows
//! by what the controls at both ends of a stage add to it, `state⁺ = state + B₀ controls + B₁ controls⁺`; the objective is
//! a quadratic in every stage's controls, mixed in its `(state, controls, controls⁺)`, plus a quadratic at any node.

#![expect(
    clippy::needless_range_loop,
    reason = "indices of matrices, as they stand in formulas"
)]

mod columns;
mod factor;
mod solve;
#[cfg(test)]
mod tests;

pub(crate) use factor::{Damping, Factor};

use super::pair_matrix::StageMatrix;
use columns::{add_scaled, dot_states, weighted};
use nalgebra::{SMatrix, SVector};

/// Unknowns of a node: its state, then its controls.
pub type NodeVector<const N: usize> = SVector<f64, N>;
/// A quadratic form in the unknowns of a node.
pub type NodeMatrix<const N: usize> = SMatrix<f64, N, N>;
/// One column for every control, by the unknowns of a node.
pub type ByControls<const U: usize, const N: usize> = SMatrix<f64, N, U>;

/// One stage: the growth of the state, and the second derivatives that mix state and controls.
#[derive(Debug, Clone, Copy)]
pub struct Stage<const U: usize, const N: usize> {
    /// B₀, growth of the state by the controls at the stage's first node; its last `U` rows are zero.
    pub growth_by_first: ByControls<U, N>,
    /// B₁, growth by the controls at its second node; its last `U` rows are zero.
    pub growth_by_second: ByControls<U, N>,
    /// Second derivative by the state and the first controls; its last `U` rows are zero.
    pub state_first: ByControls<U, N>,
    /// Second derivative by the state and the second controls; its last `U` rows are zero.
    pub state_second: ByControls<U, N>,
    /// How the second controls follow the first: `controls⁺ = tie · controls` plus a free part; `None` where none follows.
    pub tie: Option<SMatrix<f64, U, U>>,
    /// Which of the second controls have a free part. A control that has none and follows no other is locked.
    pub free: [bool; U],
}

impl<const U: usize, const N: usize> Stage<U, N> {
    /// Size of the state.
    const X: usize = N - U;

    /// A stage without growth and without second derivatives.
    pub fn zero() -> Self {
        Self {
            growth_by_first: ByControls::zeros(),
            growth_by_second: ByControls::zeros(),
            state_first: ByControls::zeros(),
            state_second: ByControls::zeros(),
            tie: None,
            free: [true; U],
        }
    }

    /// The unknowns of the second node, from those of the first and its own controls.
    #[inline(always)]
    fn carry(&self, node: &[f64; N], second: [f64; U]) -> [f64; N] {
        let mut next = *node;
        for j in 0..U {
            add_scaled(
                &mut next,
                node[Self::X + j],
                &self.growth_by_first.data.0[j],
            );
        }
        for j in 0..U {
            add_scaled(&mut next, second[j], &self.growth_by_second.data.0[j]);
        }
        next[Self::X..].copy_from_slice(&second);
        next
    }

    /// Adds to the second controls the part that follows the first.
    #[inline(always)]
    fn add_following(&self, first: &[f64], second: &mut [f64; U]) {
        if let Some(tie) = &self.tie {
            for i in 0..U {
                second[i] += weighted::<U>(|j| tie[(i, j)], |j| first[j]);
            }
        }
    }

    /// Adds to a gradient by the first controls that by the second ones which follow them.
    #[inline(always)]
    fn fold(&self, by_second: &[f64; U], by_first: &mut [f64]) {
        if let Some(tie) = &self.tie {
            for j in 0..U {
                by_first[j] += weighted::<U>(|i| tie[(i, j)], |i| by_second[i]);
            }
        }
    }
}

/// Second derivative by the unknowns of a single node.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NodeTerm<const N: usize> {
    /// The node.
    pub(crate) node: usize,
    /// Second derivative.
    pub(crate) hessian: NodeMatrix<N>,
}

/// Growth of the states along the chain, and the second derivatives that do not depend on the barrier.
#[derive(Debug, Clone)]
pub struct Chain<const U: usize, const N: usize> {
    /// The stages in order.
    pub stages: Vec<Stage<U, N>>,
    /// Which of the first node's controls are free.
    pub first_free: [bool; U],
}

/// Second derivatives that depend on the barrier.
#[derive(Debug, Clone)]
pub struct Diagonal<const X: usize, const U: usize, const N: usize> {
    /// Second derivative by the controls at both ends of every stage.
    pub controls: Vec<StageMatrix<U>>,
    /// Second derivative by the state of every node; empty where all are zero.
    pub states: Vec<SMatrix<f64, X, X>>,
    /// Terms at single nodes, by rising node.
    pub(crate) nodes: Vec<NodeTerm<N>>,
}

impl<const X: usize, const U: usize, const N: usize> Diagonal<X, U, N> {
    /// Subtracts a multiple of a metric from the second derivatives by the states.
    pub(super) fn shift(&mut self, metric: &[SMatrix<f64, X, X>], by: f64) {
        self.states.resize(metric.len(), SMatrix::zeros());
        for (state, metric) in self.states.iter_mut().zip(metric) {
            *state -= by * metric;
        }
    }
}
impl<const U: usize, const N: usize> Chain<U, N> {
    /// Size of the state.
    const X: usize = N - U;

    /// Turns a gradient by all controls into a gradient by the free controls: entries of tied controls move to the controls
    /// before, and entries of locked controls become zero.
    pub fn fold(&self, gradient: &mut [NodeVector<N>]) {
        for (k, stage) in self.stages.iter().enumerate().rev() {
            let by_second = std::array::from_fn(|i| gradient[k + 1][Self::X + i]);
            stage.fold(&by_second, &mut gradient[k].as_mut_slice()[Self::X..]);
            for i in 0..U {
                if !stage.free[i] {
                    gradient[k + 1][Self::X + i] = 0.0;
                }
            }
        }
        for (i, free) in self.first_free.iter().enumerate() {
            if !free {
                gradient[0][Self::X + i] = 0.0;
            }
        }
    }

    /// Turns a gradient by the states of all nodes into a gradient by the first state and the controls.
    pub fn carry_back(&self, gradient: &mut [NodeVector<N>]) {
        for (k, stage) in self.stages.iter().enumerate().rev() {
            let beyond = gradient[k + 1].data.0[0];
            for j in 0..U {
                gradient[k][Self::X + j] +=
                    dot_states::<U, N>(&stage.growth_by_first.data.0[j], &beyond);
                gradient[k + 1][Self::X + j] +=
                    dot_states::<U, N>(&stage.growth_by_second.data.0[j], &beyond);
            }
            for (row, beyond) in beyond.iter().enumerate().take(Self::X) {
                gradient[k][row] += beyond;
                gradient[k + 1][row] = 0.0;
            }
        }
    }

    /// Carries the states of a step along the chain from its first state and its controls.
    pub fn carry(&self, step: &mut [NodeVector<N>]) {
        for (k, stage) in self.stages.iter().enumerate() {
            let node = &step[k].data.0[0];
            let mut second = std::array::from_fn(|i| match stage.free[i] {
                true => step[k + 1][Self::X + i],
                false => 0.0,
            });
            stage.add_following(&node[Self::X..], &mut second);
            step[k + 1] = NodeVector::from(stage.carry(node, second));
        }
    }

    /// Second derivative of the objective along two steps whose states have been carried along.
    pub(crate) fn second_derivative<const X: usize>(
        &self,
        diagonal: &Diagonal<X, U, N>,
        a: &[NodeVector<N>],
        b: &[NodeVector<N>],
    ) -> f64 {
        let controls = |v: &[NodeVector<N>], k: usize| -> [SVector<f64, U>; 2] {
            [k, k + 1].map(|node| v[node].fixed_rows::<U>(X).into_owned())
        };
        let stages = self.stages.iter().enumerate().map(|(k, stage)| {
            let mixed = |s: &NodeVector<N>, c: &[SVector<f64, U>; 2]| {
                s.dot(&(stage.state_first * c[0])) + s.dot(&(stage.state_second * c[1]))
            };
            let own = &diagonal.controls[k];
            let (ca, cb) = (controls(a, k), controls(b, k));
            ca[0].dot(&(own.first * cb[0] + own.mixed * cb[1]))
                + ca[1].dot(&(own.mixed.tr_mul(&cb[0]) + own.second * cb[1]))
                + mixed(&a[k], &cb)
                + mixed(&b[k], &ca)
        });
        let nodes = diagonal.nodes.iter();
        let nodes = nodes.map(|term| a[term.node].dot(&(term.hessian * b[term.node])));
        let state = |v: &[NodeVector<N>], k: usize| v[k].fixed_rows::<X>(0).into_owned();
        let states = diagonal.states.iter().enumerate();
        let states = states.map(|(k, own)| state(a, k).dot(&(own * state(b, k))));
        stages.sum::<f64>() + nodes.sum::<f64>() + states.sum::<f64>()
    }
}
