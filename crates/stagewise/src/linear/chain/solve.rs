//! Solution of a factorised chain: forces are gathered from the last node to the first, and steps spread from there.

use super::columns::{add_scaled, dot_states, weighted};
use super::{Chain, Factor, NodeVector};
use multiversion::multiversion;

impl<const U: usize, const N: usize> Chain<U, N> {
    /// The step of least cost under a gradient by the unknowns of every node.
    ///
    /// Shapes: `gradient` and `step` have one entry a node.
    pub(crate) fn solve(
        &self,
        factor: &mut Factor<U, N>,
        gradient: &[NodeVector<N>],
        step: &mut [NodeVector<N>],
    ) {
        let mut cost = gather(self, factor, gradient);
        for (i, free) in self.first_free.iter().enumerate() {
            if !free {
                cost[Self::X + i] = 0.0;
            }
        }
        step[0] = -factor.first.solve(&cost);
        spread(self, factor, step);
    }
}

/// Gradient of the cost-to-go by the first node's unknowns; stores the force on every stage's second controls.
#[multiversion(targets("x86_64+avx2"))]
fn gather<const U: usize, const N: usize>(
    chain: &Chain<U, N>,
    factor: &mut Factor<U, N>,
    gradient: &[NodeVector<N>],
) -> NodeVector<N> {
    let states = N - U;
    let mut cost = gradient[chain.stages.len()].data.0[0];
    let stages = chain.stages.iter().zip(&factor.eliminations);
    let nodes = factor.forces.iter_mut().zip(gradient);
    for ((stage, e), (force, own)) in stages.zip(nodes).rev() {
        let [first, second] = [
            &stage.growth_by_first.data.0,
            &stage.growth_by_second.data.0,
        ];
        let mut before = own.data.0[0];
        let mut by_first = [0.0; U];
        let mut by_second = [0.0; U];
        for j in 0..U {
            by_first[j] = dot_states::<U, N>(&first[j], &cost);
            by_second[j] = cost[states + j] + dot_states::<U, N>(&second[j], &cost);
        }
        stage.fold(&by_second, &mut by_first);
        let mut toward = [0.0; U];
        for j in 0..U {
            before[states + j] += by_first[j];
            toward[j] = if stage.free[j] { by_second[j] } else { 0.0 };
        }
        for row in 0..states {
            before[row] += cost[row];
        }
        for j in 0..U {
            add_scaled(&mut before, -toward[j], &e.gain[j]);
        }
        for i in 0..U {
            force[i] = weighted::<U>(|j| e.inverse[i][j], |j| toward[j]);
        }
        cost = before;
    }
    NodeVector::from(cost)
}

/// Back substitution from the first node along the chain: controls by their elimination, states by their growth.
#[multiversion(targets("x86_64+avx2"))]
fn spread<const U: usize, const N: usize>(
    chain: &Chain<U, N>,
    factor: &Factor<U, N>,
    step: &mut [NodeVector<N>],
) {
    let states = N - U;
    let mut node = step[0].data.0[0];
    let stages = chain.stages.iter().zip(&factor.eliminations);
    let next = factor.forces.iter().zip(&mut step[1..]);
    for ((stage, e), (force, next)) in stages.zip(next) {
        let mut second = force.map(|force| -force);
        stage.add_following(&node[states..], &mut second);
        for j in 0..U {
            let gain = &e.gain[j];
            let by_controls = weighted::<U>(|i| gain[states + i], |i| node[states + i]);
            second[j] -= dot_states::<U, N>(gain, &node) + by_controls;
        }
        node = stage.carry(&node, second);
        next.data.0[0] = node;
    }
}
