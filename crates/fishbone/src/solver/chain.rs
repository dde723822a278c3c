//! Linear-quadratic programme on a chain, factorised stage by stage in time linear in its length.
//!
//! The chain has `N + 1` nodes joined by `N` stages. A node carries a state (6) and a control (2). The state grows by
//! what the controls at both ends of a stage add to it, `state⁺ = state + B₀ control + B₁ control⁺`; the objective is a
//! quadratic in every stage's controls, mixed in its `(state, control, control⁺)`, plus a quadratic at any node. A control
//! need not be free: it may be locked, or follow the one before.

use multiversion::multiversion;
use nalgebra::{
    ArrayStorage, Cholesky, Const, Matrix2, Matrix4, Matrix6, SMatrix, SVector, SymmetricEigen,
    Vector2,
};

/// Unknowns of a node: its state, then its control.
pub type NodeVector = SVector<f64, 8>;
/// A quadratic form in the unknowns of a node.
pub type NodeMatrix = SMatrix<f64, 8, 8>;
/// One column for either component of a control, by the unknowns of a node.
pub type ByControl = SMatrix<f64, 8, 2>;

/// One stage: what it adds to the state, and how that bends the objective.
#[derive(Debug, Clone, Copy)]
pub struct Stage {
    /// B₀, growth of the state by the control at the stage's first node; its last two rows are zero.
    pub growth_by_first: ByControl,
    /// B₁, growth by the control at its second node; its last two rows are zero.
    pub growth_by_second: ByControl,
    /// Second derivative by the state and the first control; its last two rows are zero.
    pub state_first: ByControl,
    /// Second derivative by the state and the second control; its last two rows are zero.
    pub state_second: ByControl,
    /// How the second control follows the first, component by component: `control⁺ = tie · control` plus a free part.
    pub tie: Vector2<f64>,
    /// Which components of the second control have a free part; without a tie either, a component is locked.
    pub free: [bool; 2],
}

impl Stage {
    /// A stage that adds nothing and costs nothing.
    pub fn zero() -> Self {
        Self {
            growth_by_first: ByControl::zeros(),
            growth_by_second: ByControl::zeros(),
            state_first: ByControl::zeros(),
            state_second: ByControl::zeros(),
            tie: Vector2::zeros(),
            free: [true; 2],
        }
    }

    /// The unknowns of the second node, from those of the first and its own control.
    #[inline(always)]
    fn carry(&self, node: &Column, second: [f64; 2]) -> Column {
        let mut next = *node;
        add_scaled(&mut next, node[6], &self.growth_by_first.data.0[0]);
        add_scaled(&mut next, node[7], &self.growth_by_first.data.0[1]);
        add_scaled(&mut next, second[0], &self.growth_by_second.data.0[0]);
        add_scaled(&mut next, second[1], &self.growth_by_second.data.0[1]);
        [next[6], next[7]] = second;
        next
    }
}

/// What a node adds of its own: second derivative by its unknowns.
#[derive(Debug, Clone, Copy)]
pub struct NodeTerm {
    /// Which node.
    pub node: usize,
    /// Second derivative.
    pub hessian: NodeMatrix,
}

/// What of the second-order part does not change with the barrier.
#[derive(Debug, Clone)]
pub struct Chain {
    /// The stages in order.
    pub stages: Vec<Stage>,
    /// Which components of the first control are free.
    pub first_free: [bool; 2],
}

/// The rest of it.
#[derive(Debug, Clone)]
pub struct Diagonal {
    /// Second derivative by both controls of every stage, first then second.
    pub controls: Vec<Matrix4<f64>>,
    /// Second derivative by the state of every node; empty where there is none.
    pub states: Vec<Matrix6<f64>>,
    /// Terms at single nodes, by rising node.
    pub nodes: Vec<NodeTerm>,
}

/// What the elimination of one stage's second control leaves behind: it is −`gain`ᵀ times the node's unknowns, less
/// `inverse` times what pulls at it.
#[derive(Debug, Clone, Copy)]
struct Elimination {
    inverse: Matrix2<f64>,
    gain: ByControl,
}

/// The factorised second derivative by the first node's unknowns.
#[derive(Debug, Clone)]
enum First {
    Positive(Cholesky<f64, Const<8>>),
    /// Its inverse.
    Indefinite(NodeMatrix),
}

/// A factorised chain, and room for the forces of one right-hand side.
#[derive(Debug, Clone)]
pub struct Factor {
    eliminations: Vec<Elimination>,
    first: First,
    pulls: Vec<Vector2<f64>>,
}

impl Factor {
    /// Room for a chain of so many stages.
    pub fn new(stages: usize) -> Self {
        let nothing = Elimination {
            inverse: Matrix2::zeros(),
            gain: ByControl::zeros(),
        };
        Self {
            eliminations: vec![nothing; stages],
            first: First::Indefinite(NodeMatrix::identity()),
            pulls: vec![Vector2::zeros(); stages],
        }
    }
}

impl First {
    /// Factorises a matrix with at most so many negative eigenvalues, and counts them.
    fn factorise(matrix: &NodeMatrix, most: usize) -> Result<(Self, usize), TooConcave> {
        if let Some(cholesky) = Cholesky::new(*matrix) {
            return Ok((Self::Positive(cholesky), 0));
        }
        if most == 0 {
            return Err(TooConcave);
        }
        // Each unknown in a unit of its own: that of a stiff support is not that of a slack rib.
        let scale = NodeVector::from_fn(|i, _| matrix.row(i).amax().sqrt().recip());
        let scaled = matrix.component_mul(&(scale * scale.transpose()));
        let eigen = SymmetricEigen::new(0.5 * (scaled + scaled.transpose()));
        let negative = eigen
            .eigenvalues
            .iter()
            .filter(|value| **value < 0.0)
            .count();
        let floor = f64::EPSILON * eigen.eigenvalues.amax();
        // The comparison is false for a NaN.
        let regular = eigen.eigenvalues.iter().all(|value| value.abs() > floor);
        if negative > most || !regular {
            return Err(TooConcave);
        }
        let inverse = eigen.eigenvectors
            * NodeMatrix::from_diagonal(&eigen.eigenvalues.map(|value| 1.0 / value))
            * eigen.eigenvectors.transpose();
        let inverse = inverse.component_mul(&(scale * scale.transpose()));
        Ok((Self::Indefinite(inverse), negative))
    }

    fn solve(&self, right: &NodeVector) -> NodeVector {
        match self {
            Self::Positive(cholesky) => cholesky.solve(right),
            Self::Indefinite(inverse) => inverse * right,
        }
    }
}

/// The objective has more directions of negative curvature than allowed, or one of none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TooConcave;

impl Chain {
    /// Factorises the chain with `damping` added to the second derivative by the unknowns: the first state, and every
    /// control times the node's weight. Says in how many directions, of `most` that are allowed, it is concave.
    ///
    /// Errors: [`TooConcave`] where there are more, or a direction of no curvature.
    pub fn factorise(
        &self,
        diagonal: &Diagonal,
        damping: f64,
        weights: &[f64],
        most: usize,
        into: &mut Factor,
    ) -> Result<usize, TooConcave> {
        let (mut first, concave) = eliminate_all(self, diagonal, damping, weights, most, into)?;
        for i in 0..6 {
            first[(i, i)] += damping;
        }
        for (i, free) in self.first_free.iter().enumerate() {
            if !free {
                lock(&mut first, 6 + i);
            }
        }
        let negative;
        (into.first, negative) = First::factorise(&first, most - concave)?;
        Ok(concave + negative)
    }

    /// Moves the gradient by controls that follow the one before to that one, and drops it where they are locked: what
    /// is left is the gradient by the unknowns.
    pub fn fold(&self, gradient: &mut [NodeVector]) {
        for (k, stage) in self.stages.iter().enumerate().rev() {
            for i in 0..2 {
                let by_second = gradient[k + 1][6 + i];
                gradient[k][6 + i] += stage.tie[i] * by_second;
                if !stage.free[i] {
                    gradient[k + 1][6 + i] = 0.0;
                }
            }
        }
        for (i, free) in self.first_free.iter().enumerate() {
            if !free {
                gradient[0][6 + i] = 0.0;
            }
        }
    }

    /// Moves a gradient by the states of all nodes to the controls that they grow by and the first state.
    pub fn carry_back(&self, gradient: &mut [NodeVector]) {
        for (k, stage) in self.stages.iter().enumerate().rev() {
            let beyond = gradient[k + 1].data.0[0];
            for j in 0..2 {
                gradient[k][6 + j] += dot(&stage.growth_by_first.data.0[j], &beyond);
                gradient[k + 1][6 + j] += dot(&stage.growth_by_second.data.0[j], &beyond);
            }
            for row in 0..6 {
                gradient[k][row] += beyond[row];
                gradient[k + 1][row] = 0.0;
            }
        }
    }

    /// The step of least cost under a gradient by the unknowns of every node.
    ///
    /// Shapes: `gradient` and `step` have one entry a node.
    pub fn solve(&self, factor: &mut Factor, gradient: &[NodeVector], step: &mut [NodeVector]) {
        let mut cost = gather(self, factor, gradient);
        for (i, free) in self.first_free.iter().enumerate() {
            if !free {
                cost[6 + i] = 0.0;
            }
        }
        step[0] = -factor.first.solve(&cost);
        spread(self, factor, step);
    }
}

/// The columns of a quadratic form in the unknowns of a node.
type Columns = [Column; 8];
type Column = [f64; 8];

/// Eliminates the second control of every stage, from the last to the first; the cost as a function of the first node's
/// unknowns, and in how many directions it was concave.
#[multiversion(targets("x86_64+avx2"))]
fn eliminate_all(
    chain: &Chain,
    diagonal: &Diagonal,
    damping: f64,
    weights: &[f64],
    most: usize,
    into: &mut Factor,
) -> Result<(NodeMatrix, usize), TooConcave> {
    let mut terms = diagonal.nodes.iter().rev().peekable();
    let mut cost: Columns = [[0.0; 8]; 8];
    let mut concave = 0;
    for k in (0..weights.len()).rev() {
        cost[6][6] += damping * weights[k];
        cost[7][7] += damping * weights[k];
        if let Some(state) = diagonal.states.get(k) {
            for (column, own) in cost.iter_mut().zip(&state.data.0) {
                for row in 0..6 {
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

/// Eliminates the free part of a stage's second control from the cost beyond it, which becomes that before it; says in how
/// many directions it was concave.
#[inline(always)]
fn eliminate(
    stage: &Stage,
    controls: &Matrix4<f64>,
    most: usize,
    cost: &mut Columns,
    into: &mut Elimination,
) -> Result<usize, TooConcave> {
    let [first, second] = [
        &stage.growth_by_first.data.0,
        &stage.growth_by_second.data.0,
    ];
    let [state_first, state_second] = [&stage.state_first.data.0, &stage.state_second.data.0];
    let c = &controls.data.0;
    // The cost's derivative by the unknowns beyond, as the second control or the first moves these.
    let mut toward = [cost[6], cost[7]];
    let mut before = [[0.0; 8]; 2];
    for i in 0..6 {
        add_scaled(&mut toward[0], second[0][i], &cost[i]);
        add_scaled(&mut toward[1], second[1][i], &cost[i]);
        add_scaled(&mut before[0], first[0][i], &cost[i]);
        add_scaled(&mut before[1], first[1][i], &cost[i]);
    }
    let mixed = toward[1][6] + dot(&second[0], &toward[1]);
    let mut pivot = [
        toward[0][6] + dot(&second[0], &toward[0]) + c[2][2],
        mixed + c[3][2],
        toward[1][7] + dot(&second[1], &toward[1]) + c[3][3],
    ];
    for j in 0..2 {
        let own = [dot(&first[0], &before[j]), dot(&first[1], &before[j])];
        let next = [dot(&first[0], &toward[j]), dot(&first[1], &toward[j])];
        add_scaled(&mut before[j], 1.0, &state_first[j]);
        add_scaled(&mut toward[j], 1.0, &state_second[j]);
        [before[j][6], before[j][7]] = [c[j][0] + own[0], c[j][1] + own[1]];
        [toward[j][6], toward[j][7]] = [c[2 + j][0] + next[0], c[2 + j][1] + next[1]];
    }
    if stage.tie != Vector2::zeros() {
        follow(stage, &pivot, &mut toward, &mut before);
    }
    for row in 0..6 {
        cost[row][6] = before[0][row];
        cost[row][7] = before[1][row];
    }
    [cost[6], cost[7]] = before;
    if !stage.free[0] {
        (pivot[0], pivot[1], toward[0]) = (1.0, 0.0, [0.0; 8]);
    }
    if !stage.free[1] {
        (pivot[2], pivot[1], toward[1]) = (1.0, 0.0, [0.0; 8]);
    }
    let ([a, b, d], concave) = invert(pivot, most)?;
    let mut gain = [[0.0; 8]; 2];
    for row in 0..8 {
        gain[0][row] = toward[0][row] * a + toward[1][row] * b;
        gain[1][row] = toward[0][row] * b + toward[1][row] * d;
    }
    for column in 0..8 {
        for row in 0..8 {
            cost[column][row] -=
                gain[0][row] * toward[0][column] + gain[1][row] * toward[1][column];
        }
    }
    into.inverse = Matrix2::new(a, b, b, d);
    into.gain.data.0 = gain;
    Ok(concave)
}

/// Lets what the second control costs be borne by the first, which it follows.
fn follow(stage: &Stage, pivot: &[f64; 3], toward: &mut [Column; 2], before: &mut [Column; 2]) {
    let full = [[pivot[0], pivot[1]], [pivot[1], pivot[2]]];
    let tie = [stage.tie[0], stage.tie[1]];
    for j in 0..2 {
        add_scaled(&mut before[j], tie[j], &toward[j]);
        for i in 0..2 {
            before[j][6 + i] += tie[i] * (toward[i][6 + j] + full[i][j] * tie[j]);
        }
    }
    for j in 0..2 {
        for i in 0..2 {
            toward[j][6 + i] += tie[i] * full[i][j];
        }
    }
}

/// Gradient of the cost-to-go by the first node's unknowns; leaves every stage's pull behind.
#[multiversion(targets("x86_64+avx2"))]
fn gather(chain: &Chain, factor: &mut Factor, gradient: &[NodeVector]) -> NodeVector {
    let mut cost = gradient[chain.stages.len()].data.0[0];
    let stages = chain.stages.iter().zip(&factor.eliminations);
    let nodes = factor.pulls.iter_mut().zip(gradient);
    for ((stage, e), (pull, own)) in stages.zip(nodes).rev() {
        let [first, second] = [
            &stage.growth_by_first.data.0,
            &stage.growth_by_second.data.0,
        ];
        let mut before = own.data.0[0];
        let mut toward = [0.0; 2];
        for j in 0..2 {
            let by_second = cost[6 + j] + dot(&second[j], &cost);
            before[6 + j] += dot(&first[j], &cost) + stage.tie[j] * by_second;
            toward[j] = if stage.free[j] { by_second } else { 0.0 };
        }
        for row in 0..6 {
            before[row] += cost[row];
        }
        add_scaled(&mut before, -toward[0], &e.gain.data.0[0]);
        add_scaled(&mut before, -toward[1], &e.gain.data.0[1]);
        *pull = e.inverse * Vector2::from(toward);
        cost = before;
    }
    NodeVector::from(cost)
}

/// Carries a step on from the first node along the chain, every control as it was eliminated.
#[multiversion(targets("x86_64+avx2"))]
fn spread(chain: &Chain, factor: &Factor, step: &mut [NodeVector]) {
    let mut node = step[0].data.0[0];
    let stages = chain.stages.iter().zip(&factor.eliminations);
    let next = factor.pulls.iter().zip(&mut step[1..]);
    for ((stage, e), (pull, next)) in stages.zip(next) {
        let mut second = [0.0; 2];
        for j in 0..2 {
            let gain = &e.gain.data.0[j];
            let own = dot(gain, &node) + (gain[6] * node[6] + gain[7] * node[7]);
            second[j] = stage.tie[j] * node[6 + j] - pull[j] - own;
        }
        node = stage.carry(&node, second);
        next.data.0[0] = node;
    }
}

/// Adds a multiple of a column.
#[inline(always)]
fn add_scaled(into: &mut Column, by: f64, column: &Column) {
    for row in 0..8 {
        into[row] += by * column[row];
    }
}

/// Scalar product of two states.
#[inline(always)]
fn dot(a: &Column, b: &Column) -> f64 {
    (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]) + (a[4] * b[4] + a[5] * b[5])
}

/// Makes an entry of the unknowns its own, unit, equation.
#[inline(always)]
fn lock<const N: usize>(matrix: &mut SMatrix<f64, N, N>, entry: usize) {
    matrix.row_mut(entry).fill(0.0);
    matrix.column_mut(entry).fill(0.0);
    matrix[(entry, entry)] = 1.0;
}

/// Inverse of a symmetric 2×2 matrix, by its entries (0, 0), (0, 1) and (1, 1), with at most so many negative
/// eigenvalues, and their number.
#[inline(always)]
fn invert([a, b, d]: [f64; 3], most: usize) -> Result<([f64; 3], usize), TooConcave> {
    let determinant = a * d - b * b;
    let floor = f64::EPSILON * (a * d).abs().max(b * b);
    let negative = if determinant < 0.0 {
        1
    } else if a < 0.0 {
        2
    } else {
        0
    };
    // The comparison is false for a NaN.
    let regular = determinant.abs() > floor;
    if !regular || negative > most {
        return Err(TooConcave);
    }
    let inverse = 1.0 / determinant;
    Ok(([d * inverse, -b * inverse, a * inverse], negative))
}

#[cfg(test)]
impl Chain {
    /// Second derivative of the objective by two unknowns, each a node and its entry, with the states carried along:
    /// what the factorisation must agree with.
    pub(crate) fn second_derivative(
        &self,
        diagonal: &Diagonal,
        a: (usize, usize),
        b: (usize, usize),
    ) -> f64 {
        let unit = |(node, entry): (usize, usize)| {
            let mut step = vec![NodeVector::zeros(); self.stages.len() + 1];
            step[node][entry] = 1.0;
            self.carry(&mut step);
            step
        };
        self.bilinear(diagonal, &unit(a), &unit(b))
    }

    /// Carries the states of a step along the chain from its first state and its controls.
    pub(crate) fn carry(&self, step: &mut [NodeVector]) {
        for (k, stage) in self.stages.iter().enumerate() {
            let second = [0, 1].map(|i| {
                let free = if stage.free[i] {
                    step[k + 1][6 + i]
                } else {
                    0.0
                };
                stage.tie[i] * step[k][6 + i] + free
            });
            step[k + 1] = NodeVector::from(stage.carry(&step[k].data.0[0], second));
        }
    }

    fn bilinear(&self, diagonal: &Diagonal, x: &[NodeVector], y: &[NodeVector]) -> f64 {
        let controls = |v: &[NodeVector], k: usize| {
            nalgebra::Vector4::new(v[k][6], v[k][7], v[k + 1][6], v[k + 1][7])
        };
        let stages = self.stages.iter().enumerate().map(|(k, stage)| {
            let mixed = |s: &NodeVector, c: &nalgebra::Vector4<f64>| {
                s.dot(&(stage.state_first * c.fixed_rows::<2>(0)))
                    + s.dot(&(stage.state_second * c.fixed_rows::<2>(2)))
            };
            let (cx, cy) = (controls(x, k), controls(y, k));
            cx.dot(&(diagonal.controls[k] * cy)) + mixed(&x[k], &cy) + mixed(&y[k], &cx)
        });
        let nodes = diagonal
            .nodes
            .iter()
            .map(|term| x[term.node].dot(&(term.hessian * y[term.node])));
        let state = |v: &[NodeVector], k: usize| v[k].fixed_rows::<6>(0).into_owned();
        let states = diagonal.states.iter().enumerate();
        let states = states.map(|(k, own)| state(x, k).dot(&(own * state(y, k))));
        stages.sum::<f64>() + nodes.sum::<f64>() + states.sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
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

    fn column(numbers: &mut impl Iterator<Item = f64>) -> ByControl {
        let mut column = matrix::<8, 2>(numbers);
        column.fixed_rows_mut::<2>(6).fill(0.0);
        column
    }

    /// A chain from random numbers, positive if the states are stiff enough.
    fn chain(numbers: &mut impl Iterator<Item = f64>) -> (Chain, Diagonal) {
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
        let mut stages: Vec<Stage> = (0..STAGES).map(|_| stage(numbers)).collect();
        // Stage 1 is a joint: its second control is half tied, half free.
        (stages[1].tie, stages[1].free) = (Vector2::new(0.0, 0.7), [true, false]);
        stages[3].free = [false, true];
        let stiff = |numbers: &mut _| positive::<6>(numbers) + Matrix6::identity() * STIFF;
        let states = (0..=STAGES).map(|_| stiff(numbers)).collect();
        let chain = Chain {
            stages,
            first_free: [true, false],
        };
        let controls = |_| positive::<4>(numbers) + Matrix4::identity() * STIFF;
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

    fn dense((chain, diagonal): &(Chain, Diagonal)) -> DMatrix<f64> {
        let unknowns = unknowns();
        DMatrix::from_fn(unknowns.len(), unknowns.len(), |i, j| {
            chain.second_derivative(diagonal, unknowns[i], unknowns[j])
        })
    }

    /// Gradient by the unknowns, of a gradient by all nodes' states and controls.
    fn condensed(chain: &Chain, gradient: &[NodeVector]) -> DVector<f64> {
        let along = |(node, entry): (usize, usize)| {
            let mut step = vec![NodeVector::zeros(); STAGES + 1];
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
            let gradient: Vec<NodeVector> = (0..=STAGES).map(|_| matrix(&mut numbers)).collect();
            let expected = -dense(&both).cholesky().unwrap().solve(&condensed(chain, &gradient));
            let mut factor = Factor::new(STAGES);
            prop_assert_eq!(chain.factorise(diagonal, 0.0, &[1.0; STAGES + 1], 0, &mut factor), Ok(0));
            let mut step = vec![NodeVector::zeros(); STAGES + 1];
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
            both.1.controls[2][(1, 1)] += shift;
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
            both.1.controls[3][(1, 1)] -= 30.0;
            let (chain, diagonal) = &both;
            let gradient: Vec<NodeVector> = (0..=STAGES).map(|_| matrix(&mut numbers)).collect();
            let mut factor = Factor::new(STAGES);
            let concave = chain.factorise(diagonal, 0.0, &[1.0; STAGES + 1], 9, &mut factor);
            prop_assume!(concave.is_ok_and(|count| count > 0));
            let mut step = vec![NodeVector::zeros(); STAGES + 1];
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
            let controls = |_| { let mut g: NodeVector = matrix(&mut numbers); g.fixed_rows_mut::<6>(0).fill(0.0); g };
            let gradient: Vec<NodeVector> = (0..=STAGES).map(controls).collect();
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
        diagonal.controls[2] -= Matrix4::identity() * 50.0;
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
