//! Linear-quadratic programme on a chain, factorised stage by stage in time linear in its length.
//!
//! The chain has one node more than it has stages. A node carries a state (`X` numbers) and controls (`U`). The state grows
//! by what the controls at both ends of a stage add to it, `state⁺ = state + B₀ controls + B₁ controls⁺`; the objective is
//! a quadratic in every stage's controls, mixed in its `(state, controls, controls⁺)`, plus a quadratic at any node.
//! Controls need not be free: one may be locked, or follow the one before.

#![expect(
    clippy::needless_range_loop,
    reason = "indices of matrices, as they stand in formulas"
)]

use super::TooConcave;
use super::small::{invert, invert_indefinite};
use multiversion::multiversion;
use nalgebra::{ArrayStorage, Cholesky, Const, SMatrix, SVector};

/// Unknowns of a node: its state, then its controls.
pub type NodeVector<const N: usize> = SVector<f64, N>;
/// A quadratic form in the unknowns of a node.
pub type NodeMatrix<const N: usize> = SMatrix<f64, N, N>;
/// One column for every control, by the unknowns of a node.
pub type ByControls<const U: usize, const N: usize> = SMatrix<f64, N, U>;

/// One stage: what it adds to the state, and how that bends the objective.
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
    /// How the second controls follow the first, one by one: `control⁺ = tie · control` plus a free part.
    pub tie: [f64; U],
    /// Which of the second controls have a free part; without a tie either, a control is locked.
    pub free: [bool; U],
}

impl<const U: usize, const N: usize> Stage<U, N> {
    /// Size of the state.
    const X: usize = N - U;

    /// A stage that adds nothing and costs nothing.
    pub fn zero() -> Self {
        Self {
            growth_by_first: ByControls::zeros(),
            growth_by_second: ByControls::zeros(),
            state_first: ByControls::zeros(),
            state_second: ByControls::zeros(),
            tie: [0.0; U],
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
}

/// A quadratic form in the controls at both ends of a stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageMatrix<const U: usize> {
    /// Second derivative by the first controls.
    pub first: SMatrix<f64, U, U>,
    /// By the first controls (rows) and the second ones (columns).
    pub mixed: SMatrix<f64, U, U>,
    /// By the second controls.
    pub second: SMatrix<f64, U, U>,
}

impl<const U: usize> StageMatrix<U> {
    /// A form that is zero.
    pub fn zeros() -> Self {
        Self {
            first: SMatrix::zeros(),
            mixed: SMatrix::zeros(),
            second: SMatrix::zeros(),
        }
    }

    /// Adds a factor times the square of a linear form.
    #[inline(always)]
    pub fn add_square(&mut self, factor: f64, [first, second]: &[SVector<f64, U>; 2]) {
        let (by_first, by_second) = (factor * first, factor * second);
        self.first += by_first * first.transpose();
        self.mixed += by_first * second.transpose();
        self.second += by_second * second.transpose();
    }
}

/// What a node adds of its own: second derivative by its unknowns.
#[derive(Debug, Clone, Copy)]
pub struct NodeTerm<const N: usize> {
    /// Which node.
    pub node: usize,
    /// Second derivative.
    pub hessian: NodeMatrix<N>,
}

/// The part of the second derivatives that does not change with the barrier.
#[derive(Debug, Clone)]
pub struct Chain<const U: usize, const N: usize> {
    /// The stages in order.
    pub stages: Vec<Stage<U, N>>,
    /// Which of the first node's controls are free.
    pub first_free: [bool; U],
}

/// The rest of them.
#[derive(Debug, Clone)]
pub struct Diagonal<const X: usize, const U: usize, const N: usize> {
    /// Second derivative by the controls at both ends of every stage.
    pub controls: Vec<StageMatrix<U>>,
    /// Second derivative by the state of every node; empty where there is none.
    pub states: Vec<SMatrix<f64, X, X>>,
    /// Terms at single nodes, by rising node.
    pub nodes: Vec<NodeTerm<N>>,
}

impl<const X: usize, const U: usize, const N: usize> Diagonal<X, U, N> {
    /// Takes a multiple of a metric off.
    pub(super) fn shift(&mut self, metric: &[SMatrix<f64, X, X>], by: f64) {
        self.states.resize(metric.len(), SMatrix::zeros());
        for (state, metric) in self.states.iter_mut().zip(metric) {
            *state -= by * metric;
        }
    }
}

/// What the elimination of one stage's second controls leaves behind: they are −`gain`ᵀ times the node's unknowns, less
/// `inverse` times the force on them.
#[derive(Debug, Clone, Copy)]
struct Elimination<const U: usize, const N: usize> {
    inverse: [[f64; U]; U],
    gain: [[f64; N]; U],
}

/// The factorised second derivative by the first node's unknowns.
#[derive(Debug, Clone)]
enum First<const N: usize> {
    Positive(Cholesky<f64, Const<N>>),
    /// Its inverse.
    Indefinite(NodeMatrix<N>),
}

/// A factorised chain, and room for the forces of one right-hand side.
#[derive(Debug, Clone)]
pub struct Factor<const U: usize, const N: usize> {
    eliminations: Vec<Elimination<U, N>>,
    first: First<N>,
    forces: Vec<[f64; U]>,
}

impl<const U: usize, const N: usize> Factor<U, N> {
    /// Room for a chain of so many stages.
    pub fn new(stages: usize) -> Self {
        let nothing = Elimination {
            inverse: [[0.0; U]; U],
            gain: [[0.0; N]; U],
        };
        Self {
            eliminations: vec![nothing; stages],
            first: First::Indefinite(NodeMatrix::identity()),
            forces: vec![[0.0; U]; stages],
        }
    }
}

impl<const N: usize> First<N> {
    /// Factorises a matrix with at most so many negative eigenvalues, and counts them.
    fn factorise(matrix: &NodeMatrix<N>, most: usize) -> Result<(Self, usize), TooConcave> {
        if let Some(cholesky) = Cholesky::new(*matrix) {
            return Ok((Self::Positive(cholesky), 0));
        }
        let (inverse, negative) = invert_indefinite(matrix, most)?;
        Ok((Self::Indefinite(inverse), negative))
    }

    fn solve(&self, right: &NodeVector<N>) -> NodeVector<N> {
        match self {
            Self::Positive(cholesky) => cholesky.solve(right),
            Self::Indefinite(inverse) => inverse * right,
        }
    }
}

impl<const U: usize, const N: usize> Chain<U, N> {
    /// Size of the state.
    const X: usize = N - U;

    /// Factorises the chain with `damping` added to the second derivative by the unknowns: the first state, and every
    /// control times the node's weight. Gives the number of concave directions, of `most` that are allowed.
    ///
    /// Errors: [`TooConcave`] where there are more, or a direction of no curvature.
    pub fn factorise<const X: usize>(
        &self,
        diagonal: &Diagonal<X, U, N>,
        damping: f64,
        weights: &[f64],
        most: usize,
        into: &mut Factor<U, N>,
    ) -> Result<usize, TooConcave> {
        let (mut first, concave) = eliminate_all(self, diagonal, damping, weights, most, into)?;
        for i in 0..X {
            first[(i, i)] += damping;
        }
        for (i, free) in self.first_free.iter().enumerate() {
            if !free {
                lock(&mut first, X + i);
            }
        }
        let negative;
        (into.first, negative) = First::factorise(&first, most - concave)?;
        Ok(concave + negative)
    }

    /// Moves the gradient by controls that follow the one before to that one, and drops it where they are locked: the rest
    /// is the gradient by the unknowns.
    pub fn fold(&self, gradient: &mut [NodeVector<N>]) {
        for (k, stage) in self.stages.iter().enumerate().rev() {
            for i in 0..U {
                let by_second = gradient[k + 1][Self::X + i];
                gradient[k][Self::X + i] += stage.tie[i] * by_second;
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

    /// Moves a gradient by the states of all nodes to the controls that they grow by and the first state.
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

    /// The step of least cost under a gradient by the unknowns of every node.
    ///
    /// Shapes: `gradient` and `step` have one entry a node.
    pub fn solve(
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

    /// Carries the states of a step along the chain from its first state and its controls.
    pub fn carry(&self, step: &mut [NodeVector<N>]) {
        for (k, stage) in self.stages.iter().enumerate() {
            let second = std::array::from_fn(|i| {
                let free = if stage.free[i] {
                    step[k + 1][Self::X + i]
                } else {
                    0.0
                };
                stage.tie[i] * step[k][Self::X + i] + free
            });
            step[k + 1] = NodeVector::from(stage.carry(&step[k].data.0[0], second));
        }
    }

    /// Second derivative of the objective along two steps whose states have been carried along.
    pub fn second_derivative<const X: usize>(
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

/// The columns of a quadratic form in the unknowns of a node.
type Columns<const N: usize> = [[f64; N]; N];

/// Eliminates the second controls of every stage, from the last to the first; the cost as a function of the first node's
/// unknowns, and in how many directions it was concave.
#[multiversion(targets("x86_64+avx2"))]
fn eliminate_all<const X: usize, const U: usize, const N: usize>(
    chain: &Chain<U, N>,
    diagonal: &Diagonal<X, U, N>,
    damping: f64,
    weights: &[f64],
    most: usize,
    into: &mut Factor<U, N>,
) -> Result<(NodeMatrix<N>, usize), TooConcave> {
    let mut terms = diagonal.nodes.iter().rev().peekable();
    let mut cost: Columns<N> = [[0.0; N]; N];
    let mut concave = 0;
    for k in (0..weights.len()).rev() {
        for i in X..N {
            cost[i][i] += damping * weights[k];
        }
        if let Some(state) = diagonal.states.get(k) {
            for (column, own) in cost.iter_mut().zip(&state.data.0) {
                for row in 0..X {
                    column[row] += own[row];
                }
            }
        }
        while let Some(term) = terms.next_if(|term| term.node == k) {
            for (column, own) in cost.iter_mut().zip(&term.hessian.data.0) {
                add_scaled(column, 1.0, own);
            }
        }
        if k > 0 {
            let (stage, controls) = (&chain.stages[k - 1], &diagonal.controls[k - 1]);
            let elimination = &mut into.eliminations[k - 1];
            concave += eliminate(stage, controls, most - concave, &mut cost, elimination)?;
        }
    }
    Ok((NodeMatrix::from_array_storage(ArrayStorage(cost)), concave))
}

/// Eliminates the free part of a stage's second controls from the cost beyond it, which becomes the cost before it; gives
/// the number of directions in which that was concave.
#[inline(always)]
fn eliminate<const U: usize, const N: usize>(
    stage: &Stage<U, N>,
    controls: &StageMatrix<U>,
    most: usize,
    cost: &mut Columns<N>,
    into: &mut Elimination<U, N>,
) -> Result<usize, TooConcave> {
    let states = N - U;
    let [first, second] = [
        &stage.growth_by_first.data.0,
        &stage.growth_by_second.data.0,
    ];
    let [state_first, state_second] = [&stage.state_first.data.0, &stage.state_second.data.0];
    // The cost's derivative by the unknowns beyond, as the second controls or the first move these.
    let mut toward = [[0.0; N]; U];
    let mut before = [[0.0; N]; U];
    for j in 0..U {
        toward[j] = carried(cost[states + j], &second[j], cost, states);
        before[j] = carried([0.0; N], &first[j], cost, states);
    }
    let mut pivot = [[0.0; U]; U];
    for j in 0..U {
        for i in 0..=j {
            let own = toward[j][states + i] + dot_states::<U, N>(&second[i], &toward[j]);
            pivot[i][j] = own + controls.second.data.0[j][i];
            pivot[j][i] = pivot[i][j];
        }
    }
    for j in 0..U {
        let own: [f64; U] = std::array::from_fn(|i| dot_states::<U, N>(&first[i], &before[j]));
        let next: [f64; U] = std::array::from_fn(|i| dot_states::<U, N>(&first[i], &toward[j]));
        add_scaled(&mut before[j], 1.0, &state_first[j]);
        add_scaled(&mut toward[j], 1.0, &state_second[j]);
        for i in 0..U {
            before[j][states + i] = controls.first.data.0[j][i] + own[i];
            toward[j][states + i] = controls.mixed.data.0[j][i] + next[i];
        }
    }
    if stage.tie != [0.0; U] {
        follow(stage, &pivot, &mut toward, &mut before);
    }
    for row in 0..states {
        for j in 0..U {
            cost[row][states + j] = before[j][row];
        }
    }
    cost[states..].copy_from_slice(&before);
    for i in 0..U {
        if !stage.free[i] {
            for j in 0..U {
                (pivot[i][j], pivot[j][i]) = (0.0, 0.0);
            }
            (pivot[i][i], toward[i]) = (1.0, [0.0; N]);
        }
    }
    let (inverse, concave) = invert(&pivot, most)?;
    let mut gain = [[0.0; N]; U];
    for i in 0..U {
        for row in 0..N {
            gain[i][row] = weighted::<U>(|j| toward[j][row], |j| inverse[i][j]);
        }
    }
    for column in 0..N {
        for row in 0..N {
            cost[column][row] -= weighted::<U>(|j| gain[j][row], |j| toward[j][column]);
        }
    }
    into.inverse = inverse;
    into.gain = gain;
    Ok(concave)
}

/// A column, and to it the columns of the cost by the states, each times the growth of its state.
#[inline(always)]
fn carried<const N: usize>(
    mut column: [f64; N],
    growth: &[f64; N],
    cost: &Columns<N>,
    states: usize,
) -> [f64; N] {
    for i in 0..states {
        add_scaled(&mut column, growth[i], &cost[i]);
    }
    column
}

/// Lets the first controls bear what the second cost that follow them.
fn follow<const U: usize, const N: usize>(
    stage: &Stage<U, N>,
    pivot: &[[f64; U]; U],
    toward: &mut [[f64; N]; U],
    before: &mut [[f64; N]; U],
) {
    let states = N - U;
    let tie = stage.tie;
    for j in 0..U {
        add_scaled(&mut before[j], tie[j], &toward[j]);
        for i in 0..U {
            before[j][states + i] += tie[i] * (toward[i][states + j] + pivot[i][j] * tie[j]);
        }
    }
    for j in 0..U {
        for i in 0..U {
            toward[j][states + i] += tie[i] * pivot[i][j];
        }
    }
}

/// Gradient of the cost-to-go by the first node's unknowns; leaves the force on every stage's second controls behind.
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
        let mut toward = [0.0; U];
        for j in 0..U {
            let by_second = cost[states + j] + dot_states::<U, N>(&second[j], &cost);
            before[states + j] += dot_states::<U, N>(&first[j], &cost) + stage.tie[j] * by_second;
            toward[j] = if stage.free[j] { by_second } else { 0.0 };
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

/// Carries a step on from the first node along the chain, all controls as they were eliminated.
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
        let mut second = [0.0; U];
        for j in 0..U {
            let gain = &e.gain[j];
            let by_controls = weighted::<U>(|i| gain[states + i], |i| node[states + i]);
            let own = dot_states::<U, N>(gain, &node) + by_controls;
            second[j] = stage.tie[j] * node[states + j] - force[j] - own;
        }
        node = stage.carry(&node, second);
        next.data.0[0] = node;
    }
}

/// Adds a multiple of a column.
#[inline(always)]
fn add_scaled<const N: usize>(into: &mut [f64; N], by: f64, column: &[f64; N]) {
    for row in 0..N {
        into[row] += by * column[row];
    }
}

/// Scalar product of two states, by pairs of entries so that the additions need not wait for each other.
#[inline(always)]
fn dot_states<const U: usize, const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let states = N - U;
    if states == 1 {
        return a[0] * b[0];
    }
    let mut sum = a[0] * b[0] + a[1] * b[1];
    let mut i = 2;
    while i + 1 < states {
        sum += a[i] * b[i] + a[i + 1] * b[i + 1];
        i += 2;
    }
    if i < states {
        sum += a[i] * b[i];
    }
    sum
}

/// A sum of products, one a control, in order.
#[inline(always)]
fn weighted<const U: usize>(a: impl Fn(usize) -> f64, b: impl Fn(usize) -> f64) -> f64 {
    let mut sum = a(0) * b(0);
    for j in 1..U {
        sum += a(j) * b(j);
    }
    sum
}

/// Makes an entry of the unknowns its own, unit, equation.
#[inline(always)]
fn lock<const N: usize>(matrix: &mut NodeMatrix<N>, entry: usize) {
    matrix.row_mut(entry).fill(0.0);
    matrix.column_mut(entry).fill(0.0);
    matrix[(entry, entry)] = 1.0;
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    type Node = NodeVector<8>;
    use proptest::prelude::*;

    const STAGES: usize = 5;

    fn matrix<const R: usize, const C: usize>(
        numbers: &mut impl Iterator<Item = f64>,
    ) -> SMatrix<f64, R, C> {
        SMatrix::from_fn(|_, _| numbers.next().unwrap())
    }

    fn positive<const N: usize>(numbers: &mut impl Iterator<Item = f64>) -> SMatrix<f64, N, N> {
        let root = matrix::<N, N>(numbers);
        root * root.transpose() + SMatrix::identity() * 0.1
    }

    fn column(numbers: &mut impl Iterator<Item = f64>) -> ByControls<2, 8> {
        let mut column = matrix::<8, 2>(numbers);
        column.fixed_rows_mut::<2>(6).fill(0.0);
        column
    }

    /// A chain from random numbers, positive if the states are stiff enough.
    fn chain(numbers: &mut impl Iterator<Item = f64>) -> (Chain<2, 8>, Diagonal<6, 2, 8>) {
        const STIFF: f64 = 4.0;
        let stage = |numbers: &mut _| Stage {
            growth_by_first: column(numbers),
            growth_by_second: column(numbers),
            state_first: column(numbers),
            state_second: column(numbers),
            ..Stage::zero()
        };
        let term = |node, numbers: &mut _| NodeTerm {
            node,
            hessian: positive(numbers),
        };
        let mut stages: Vec<Stage<2, 8>> = (0..STAGES).map(|_| stage(numbers)).collect();
        // Stage 1 is a joint: its second control is half tied, half free.
        (stages[1].tie, stages[1].free) = ([0.0, 0.7], [true, false]);
        stages[3].free = [false, true];
        let stiff =
            |numbers: &mut _| positive::<6>(numbers) + SMatrix::<f64, 6, 6>::identity() * STIFF;
        let states = (0..=STAGES).map(|_| stiff(numbers)).collect();
        let chain = Chain {
            stages,
            first_free: [true, false],
        };
        let controls = |_| {
            let whole = positive::<4>(numbers) + SMatrix::<f64, 4, 4>::identity() * STIFF;
            StageMatrix {
                first: whole.fixed_view::<2, 2>(0, 0).into_owned(),
                mixed: whole.fixed_view::<2, 2>(0, 2).into_owned(),
                second: whole.fixed_view::<2, 2>(2, 2).into_owned(),
            }
        };
        let diagonal = Diagonal {
            controls: (0..STAGES).map(controls).collect(),
            states,
            nodes: vec![term(0, numbers), term(3, numbers), term(STAGES, numbers)],
        };
        (chain, diagonal)
    }

    fn unknowns() -> Vec<(usize, usize)> {
        let controls = (0..=STAGES).flat_map(|node| [(node, 6), (node, 7)]);
        let locked = [(0, 7), (2, 7), (4, 6)];
        (0..6)
            .map(|entry| (0, entry))
            .chain(controls.filter(|unknown| !locked.contains(unknown)))
            .collect()
    }

    fn dense((chain, diagonal): &(Chain<2, 8>, Diagonal<6, 2, 8>)) -> DMatrix<f64> {
        let unknowns = unknowns();
        DMatrix::from_fn(unknowns.len(), unknowns.len(), |i, j| {
            let unit = |(node, entry): (usize, usize)| {
                let mut step = vec![Node::zeros(); STAGES + 1];
                step[node][entry] = 1.0;
                chain.carry(&mut step);
                step
            };
            chain.second_derivative(diagonal, &unit(unknowns[i]), &unit(unknowns[j]))
        })
    }

    /// Gradient by the unknowns, of a gradient by all nodes' states and controls.
    fn condensed(chain: &Chain<2, 8>, gradient: &[Node]) -> DVector<f64> {
        let along = |(node, entry): (usize, usize)| {
            let mut step = vec![Node::zeros(); STAGES + 1];
            step[node][entry] = 1.0;
            chain.carry(&mut step);
            step.iter()
                .zip(gradient)
                .map(|(s, g)| s.dot(g))
                .sum::<f64>()
        };
        DVector::from_iterator(unknowns().len(), unknowns().into_iter().map(along))
    }

    proptest! {
        #[test]
        fn test_step_is_that_of_dense_elimination(numbers in prop::collection::vec(-1.0..1.0f64, 2000)) {
            let mut numbers = numbers.into_iter().cycle();
            let both = chain(&mut numbers);
            let (chain, diagonal) = &both;
            let gradient: Vec<Node> = (0..=STAGES).map(|_| matrix(&mut numbers)).collect();
            let expected = -dense(&both).cholesky().unwrap().solve(&condensed(chain, &gradient));
            let mut factor = Factor::new(STAGES);
            prop_assert_eq!(chain.factorise(diagonal, 0.0, &[1.0; STAGES + 1], 0, &mut factor), Ok(0));
            let mut step = vec![Node::zeros(); STAGES + 1];
            chain.solve(&mut factor, &gradient, &mut step);
            for (unknown, value) in unknowns().into_iter().zip(expected.iter()) {
                prop_assert!((step[unknown.0][unknown.1] - value).abs() < 1e-8 * expected.amax().max(1.0));
            }
            let mut carried = step.clone();
            chain.carry(&mut carried);
            for (a, b) in step.iter().zip(&carried) {
                prop_assert!((a - b).amax() < 1e-9 * a.amax().max(1.0));
            }
        }

        #[test]
        fn test_chain_is_convex_where_its_dense_hessian_is(
            numbers in prop::collection::vec(-1.0..1.0f64, 2000),
            shift in -3.0..3.0f64,
        ) {
            let mut both = chain(&mut numbers.into_iter().cycle());
            both.1.controls[2].first[(1, 1)] += shift;
            let eigenvalues = dense(&both).symmetric_eigenvalues();
            prop_assume!(eigenvalues.iter().all(|value| value.abs() > 1e-6));
            let negative = eigenvalues.iter().filter(|value| **value < 0.0).count();
            let (chain, diagonal) = &both;
            let factorise =
                |most| chain.factorise(diagonal, 0.0, &[1.0; STAGES + 1], most, &mut Factor::new(STAGES));
            prop_assert_eq!(factorise(0).is_ok(), negative == 0);
            prop_assert_eq!(factorise(9), Ok(negative));
        }

        #[test]
        fn test_step_of_a_concave_chain_is_stationary(numbers in prop::collection::vec(-1.0..1.0f64, 2000)) {
            let mut numbers = numbers.into_iter().cycle();
            let mut both = chain(&mut numbers);
            both.1.nodes[0].hessian[(2, 2)] -= 1e3;
            both.1.controls[3].first[(1, 1)] -= 30.0;
            let (chain, diagonal) = &both;
            let gradient: Vec<Node> = (0..=STAGES).map(|_| matrix(&mut numbers)).collect();
            let mut factor = Factor::new(STAGES);
            let concave = chain.factorise(diagonal, 0.0, &[1.0; STAGES + 1], 9, &mut factor);
            prop_assume!(concave.is_ok_and(|count| count > 0));
            let mut step = vec![Node::zeros(); STAGES + 1];
            chain.solve(&mut factor, &gradient, &mut step);
            let by_unknowns = dense(&both)
                * DVector::from_iterator(unknowns().len(), unknowns().into_iter().map(|(k, i)| step[k][i]));
            let expected = -condensed(chain, &gradient);
            prop_assert!((by_unknowns - &expected).amax() < 1e-5 * expected.amax().max(1.0));
        }

        #[test]
        fn test_folded_gradient_is_that_by_the_unknowns(numbers in prop::collection::vec(-1.0..1.0f64, 2000)) {
            let mut numbers = numbers.into_iter().cycle();
            let (chain, _) = chain(&mut numbers);
            let controls = |_| { let mut g: Node = matrix(&mut numbers); g.fixed_rows_mut::<6>(0).fill(0.0); g };
            let gradient: Vec<Node> = (0..=STAGES).map(controls).collect();
            let expected = condensed(&chain, &gradient);
            let mut folded = gradient;
            chain.fold(&mut folded);
            for ((node, entry), value) in unknowns().into_iter().zip(expected.iter()) {
                prop_assert!((folded[node][entry] - value).abs() < 1e-12);
            }
            prop_assert_eq!((folded[0][7], folded[2][7], folded[4][6]), (0.0, 0.0, 0.0));
        }
    }

    #[test]
    fn test_damping_makes_a_concave_chain_convex() {
        let mut numbers = (1..).map(|i| f64::from(i).sin());
        let (chain, mut diagonal) = chain(&mut numbers);
        let concave = SMatrix::<f64, 2, 2>::identity() * 50.0;
        diagonal.controls[2].first -= concave;
        diagonal.controls[2].second -= concave;
        let mut factor = Factor::new(STAGES);
        let weights = [1.0; STAGES + 1];
        assert_eq!(
            chain.factorise(&diagonal, 0.0, &weights, 0, &mut factor),
            Err(TooConcave)
        );
        assert_eq!(
            chain.factorise(&diagonal, 100.0, &weights, 0, &mut factor),
            Ok(0)
        );
    }
}
