//! Linear-quadratic programme on a chain, factorised stage by stage in time linear in its length.
//!
//! The chain has `N + 1` nodes joined by `N` stages. A node carries a state (6) and a control (2). The states obey
//! `state⁺ = A state + B₀ control + B₁ control⁺`; the objective is a quadratic in every stage's
//! `(state, control, control⁺)` plus a quadratic at any node. A control need not be free: it may be locked, or follow
//! the one before.

use nalgebra::{
    Cholesky, Const, Matrix2, Matrix4, Matrix6, Matrix6x2, SMatrix, SVector, SymmetricEigen,
    Vector2, Vector6,
};

/// Unknowns of a node: its state, then its control.
pub type NodeVector = SVector<f64, 8>;
/// A quadratic form in the unknowns of a node.
pub type NodeMatrix = SMatrix<f64, 8, 8>;

/// One stage: how it carries the state on, and its second derivatives.
#[derive(Debug, Clone, Copy)]
pub struct Stage {
    /// A, the state's own part.
    pub state_by_state: Matrix6<f64>,
    /// B₀, by the control at the stage's first node.
    pub state_by_first: Matrix6x2<f64>,
    /// B₁, by the control at its second node.
    pub state_by_second: Matrix6x2<f64>,
    /// Second derivative by the state, twice.
    pub state_state: Matrix6<f64>,
    /// Second derivative by the state and the first control.
    pub state_first: Matrix6x2<f64>,
    /// Second derivative by the state and the second control.
    pub state_second: Matrix6x2<f64>,
    /// Second derivative by both controls, first then second.
    pub controls: Matrix4<f64>,
    /// How the second control follows the first, component by component: `control⁺ = tie · control` plus a free part.
    pub tie: Vector2<f64>,
    /// Which components of the second control have a free part; without a tie either, a component is locked.
    pub free: [bool; 2],
}

impl Stage {
    /// A stage that carries nothing on and costs nothing.
    pub fn zero() -> Self {
        Self {
            state_by_state: Matrix6::zeros(),
            state_by_first: Matrix6x2::zeros(),
            state_by_second: Matrix6x2::zeros(),
            state_state: Matrix6::zeros(),
            state_first: Matrix6x2::zeros(),
            state_second: Matrix6x2::zeros(),
            controls: Matrix4::zeros(),
            tie: Vector2::zeros(),
            free: [true; 2],
        }
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

/// The second-order part of the programme.
#[derive(Debug, Clone)]
pub struct Chain {
    /// The stages in order.
    pub stages: Vec<Stage>,
    /// Terms at single nodes, by rising node.
    pub nodes: Vec<NodeTerm>,
    /// Second derivative by the state of the last node, from which no stage starts.
    pub last_state: Matrix6<f64>,
    /// Which components of the first control are free.
    pub first_free: [bool; 2],
}

/// What the elimination of one stage's second control leaves behind.
#[derive(Debug, Clone, Copy)]
struct Elimination {
    inverse: Matrix2<f64>,
    by_state: Matrix6x2<f64>,
    by_first: Matrix2<f64>,
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
            by_state: Matrix6x2::zeros(),
            by_first: Matrix2::zeros(),
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
        let eigen = SymmetricEigen::new(0.5 * (matrix + matrix.transpose()));
        let negative = eigen
            .eigenvalues
            .iter()
            .filter(|value| **value < 0.0)
            .count();
        let floor = f64::EPSILON * eigen.eigenvalues.amax();
        if negative > most || eigen.eigenvalues.iter().any(|value| value.abs() <= floor) {
            return Err(TooConcave);
        }
        let inverse = eigen.eigenvectors
            * NodeMatrix::from_diagonal(&eigen.eigenvalues.map(|value| 1.0 / value))
            * eigen.eigenvectors.transpose();
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

/// Least remaining cost as a function of a node's unknowns.
#[derive(Clone, Copy)]
struct CostToGo {
    state: Matrix6<f64>,
    mixed: Matrix6x2<f64>,
    control: Matrix2<f64>,
}

impl CostToGo {
    fn zero() -> Self {
        Self {
            state: Matrix6::zeros(),
            mixed: Matrix6x2::zeros(),
            control: Matrix2::zeros(),
        }
    }

    fn add(&mut self, term: &NodeMatrix) {
        self.state += term.fixed_view::<6, 6>(0, 0);
        self.mixed += term.fixed_view::<6, 2>(0, 6);
        self.control += term.fixed_view::<2, 2>(6, 6);
    }

    fn matrix(&self) -> NodeMatrix {
        let mut whole = NodeMatrix::zeros();
        whole.fixed_view_mut::<6, 6>(0, 0).copy_from(&self.state);
        whole.fixed_view_mut::<6, 2>(0, 6).copy_from(&self.mixed);
        whole
            .fixed_view_mut::<2, 6>(6, 0)
            .copy_from(&self.mixed.transpose());
        whole.fixed_view_mut::<2, 2>(6, 6).copy_from(&self.control);
        whole
    }
}

impl Chain {
    /// Factorises the chain with `damping` added to the second derivative by the unknowns: the first state, and every
    /// control times the node's weight. Says in how many directions, of `most` that are allowed, it is concave.
    ///
    /// Errors: [`TooConcave`] where there are more, or a direction of no curvature.
    pub fn factorise(
        &self,
        damping: f64,
        weights: &[f64],
        most: usize,
        into: &mut Factor,
    ) -> Result<usize, TooConcave> {
        let mut terms = self.nodes.iter().rev().peekable();
        let mut cost = CostToGo::zero();
        cost.state = self.last_state;
        let mut concave = 0;
        for k in (0..weights.len()).rev() {
            cost.control += Matrix2::identity() * (damping * weights[k]);
            while let Some(term) = terms.next_if(|term| term.node == k) {
                cost.add(&term.hessian);
            }
            if k > 0 {
                let negative;
                (into.eliminations[k - 1], cost, negative) =
                    eliminate(&self.stages[k - 1], &cost, most - concave)?;
                concave += negative;
            }
        }
        cost.state += Matrix6::identity() * damping;
        let mut first = cost.matrix();
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

    /// The step of least cost under a gradient by the unknowns of every node.
    ///
    /// Shapes: `gradient` and `step` have one entry a node.
    pub fn solve(&self, factor: &mut Factor, gradient: &[NodeVector], step: &mut [NodeVector]) {
        let mut cost = self.gather(factor, gradient);
        for (i, free) in self.first_free.iter().enumerate() {
            if !free {
                cost[6 + i] = 0.0;
            }
        }
        step[0] = -factor.first.solve(&cost);
        for (k, stage) in self.stages.iter().enumerate() {
            let e = &factor.eliminations[k];
            let state = step[k].fixed_rows::<6>(0);
            let first = step[k].fixed_rows::<2>(6);
            let second = stage.tie.component_mul(&first)
                - factor.pulls[k]
                - e.inverse * (e.by_state.tr_mul(&state) + e.by_first.tr_mul(&first));
            let next = stage.state_by_state * state
                + stage.state_by_first * first
                + stage.state_by_second * second;
            step[k + 1].fixed_rows_mut::<6>(0).copy_from(&next);
            step[k + 1].fixed_rows_mut::<2>(6).copy_from(&second);
        }
    }

    /// Gradient of the cost-to-go by the first node's unknowns; leaves every stage's pull behind.
    fn gather(&self, factor: &mut Factor, gradient: &[NodeVector]) -> NodeVector {
        let mut cost = gradient[self.stages.len()];
        for (k, stage) in self.stages.iter().enumerate().rev() {
            let e = &factor.eliminations[k];
            let state: Vector6<f64> = cost.fixed_rows::<6>(0).into_owned();
            let second = stage.state_by_second.tr_mul(&state) + cost.fixed_rows::<2>(6);
            let pull = e.inverse * stage.unlocked(&second);
            cost = gradient[k];
            let mut by_state = cost.fixed_rows_mut::<6>(0);
            by_state += stage.state_by_state.tr_mul(&state) - e.by_state * pull;
            let mut by_first = cost.fixed_rows_mut::<2>(6);
            by_first += stage.state_by_first.tr_mul(&state) + stage.tie.component_mul(&second)
                - e.by_first * pull;
            factor.pulls[k] = pull;
        }
        cost
    }
}

impl Stage {
    /// The components of a vector in which the second control is free.
    fn unlocked(&self, vector: &Vector2<f64>) -> Vector2<f64> {
        Vector2::from_fn(|i, _| if self.free[i] { vector[i] } else { 0.0 })
    }
}

/// Makes an entry of the unknowns its own, unit, equation.
fn lock<const N: usize>(matrix: &mut SMatrix<f64, N, N>, entry: usize) {
    matrix.row_mut(entry).fill(0.0);
    matrix.column_mut(entry).fill(0.0);
    matrix[(entry, entry)] = 1.0;
}

/// Eliminates the free part of a stage's second control from the cost beyond it; says in how many directions that was
/// concave.
fn eliminate(
    stage: &Stage,
    beyond: &CostToGo,
    most: usize,
) -> Result<(Elimination, CostToGo, usize), TooConcave> {
    let cost_by_state = beyond.state * stage.state_by_state;
    let cost_by_first = beyond.state * stage.state_by_first;
    let cost_by_second = beyond.state * stage.state_by_second;
    let toward_second = cost_by_second + beyond.mixed;
    let cross = stage.state_by_second.tr_mul(&beyond.mixed);
    let mut pivot = beyond.control
        + stage.controls.fixed_view::<2, 2>(2, 2)
        + stage.state_by_second.tr_mul(&cost_by_second)
        + cross
        + cross.transpose();
    let mut by_state = stage.state_second + stage.state_by_state.tr_mul(&toward_second);
    let mut by_first =
        stage.controls.fixed_view::<2, 2>(0, 2) + stage.state_by_first.tr_mul(&toward_second);
    let mut before = CostToGo {
        state: stage.state_state + stage.state_by_state.tr_mul(&cost_by_state),
        mixed: stage.state_first + stage.state_by_state.tr_mul(&cost_by_first),
        control: stage.controls.fixed_view::<2, 2>(0, 0)
            + stage.state_by_first.tr_mul(&cost_by_first),
    };
    if stage.tie != Vector2::zeros() {
        let tie = Matrix2::from_diagonal(&stage.tie);
        let through = by_first * tie;
        before.mixed += by_state * tie;
        before.control += through + through.transpose() + tie * pivot * tie;
        by_first += tie * pivot;
    }
    for (i, free) in stage.free.iter().enumerate() {
        if !free {
            lock(&mut pivot, i);
            by_state.column_mut(i).fill(0.0);
            by_first.column_mut(i).fill(0.0);
        }
    }
    let (inverse, concave) = invert(&pivot, most)?;
    let gain_state = by_state * inverse;
    before.state -= gain_state * by_state.transpose();
    before.mixed -= gain_state * by_first.transpose();
    before.control -= by_first * inverse * by_first.transpose();
    let elimination = Elimination {
        inverse,
        by_state,
        by_first,
    };
    Ok((elimination, before, concave))
}

/// Inverse of a symmetric 2×2 matrix with at most so many negative eigenvalues, and their number.
fn invert(m: &Matrix2<f64>, most: usize) -> Result<(Matrix2<f64>, usize), TooConcave> {
    let (a, b, d) = (m[(0, 0)], 0.5 * (m[(0, 1)] + m[(1, 0)]), m[(1, 1)]);
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
    Ok((Matrix2::new(d, -b, -b, a) / determinant, negative))
}

#[cfg(test)]
impl Chain {
    /// Second derivative of the objective by two unknowns, each a node and its entry, with the states carried along:
    /// what the factorisation must agree with.
    pub(crate) fn second_derivative(&self, a: (usize, usize), b: (usize, usize)) -> f64 {
        let unit = |(node, entry): (usize, usize)| {
            let mut step = vec![NodeVector::zeros(); self.stages.len() + 1];
            step[node][entry] = 1.0;
            self.carry(&mut step);
            step
        };
        self.bilinear(&unit(a), &unit(b))
    }

    /// Carries the states of a step along the chain from its first state and its controls.
    pub(crate) fn carry(&self, step: &mut [NodeVector]) {
        for (k, stage) in self.stages.iter().enumerate() {
            for i in 0..2 {
                let free = if stage.free[i] {
                    step[k + 1][6 + i]
                } else {
                    0.0
                };
                step[k + 1][6 + i] = stage.tie[i] * step[k][6 + i] + free;
            }
            let next = stage.state_by_state * step[k].fixed_rows::<6>(0)
                + stage.state_by_first * step[k].fixed_rows::<2>(6)
                + stage.state_by_second * step[k + 1].fixed_rows::<2>(6);
            step[k + 1].fixed_rows_mut::<6>(0).copy_from(&next);
        }
    }

    fn bilinear(&self, x: &[NodeVector], y: &[NodeVector]) -> f64 {
        let controls = |v: &[NodeVector], k: usize| {
            nalgebra::Vector4::new(v[k][6], v[k][7], v[k + 1][6], v[k + 1][7])
        };
        let stages = self.stages.iter().enumerate().map(|(k, stage)| {
            let mixed = |s: &NodeVector, c: &nalgebra::Vector4<f64>| {
                let state = s.fixed_rows::<6>(0);
                state.dot(&(stage.state_first * c.fixed_rows::<2>(0)))
                    + state.dot(&(stage.state_second * c.fixed_rows::<2>(2)))
            };
            let (cx, cy) = (controls(x, k), controls(y, k));
            x[k].fixed_rows::<6>(0)
                .dot(&(stage.state_state * y[k].fixed_rows::<6>(0)))
                + cx.dot(&(stage.controls * cy))
                + mixed(&x[k], &cy)
                + mixed(&y[k], &cx)
        });
        let nodes = self
            .nodes
            .iter()
            .map(|term| x[term.node].dot(&(term.hessian * y[term.node])));
        let last = self.stages.len();
        let state = |v: &[NodeVector]| v[last].fixed_rows::<6>(0).into_owned();
        stages.sum::<f64>() + nodes.sum::<f64>() + state(x).dot(&(self.last_state * state(y)))
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

    /// A chain with positive stages, from random numbers.
    fn chain(numbers: &mut impl Iterator<Item = f64>) -> Chain {
        let stage = |numbers: &mut _| {
            let whole = positive::<10>(numbers);
            Stage {
                state_by_state: matrix(numbers),
                state_by_first: matrix(numbers),
                state_by_second: matrix(numbers),
                state_state: whole.fixed_view::<6, 6>(0, 0).into_owned(),
                state_first: whole.fixed_view::<6, 2>(0, 6).into_owned(),
                state_second: whole.fixed_view::<6, 2>(0, 8).into_owned(),
                controls: whole.fixed_view::<4, 4>(6, 6).into_owned(),
                ..Stage::zero()
            }
        };
        let term = |node, numbers: &mut _| NodeTerm {
            node,
            hessian: positive(numbers),
        };
        let mut stages: Vec<Stage> = (0..STAGES).map(|_| stage(numbers)).collect();
        // Stage 1 is a joint: its second control is half tied, half free.
        (stages[1].tie, stages[1].free) = (Vector2::new(0.0, 0.7), [true, false]);
        stages[3].free = [false, true];
        Chain {
            stages,
            nodes: vec![term(0, numbers), term(3, numbers), term(STAGES, numbers)],
            last_state: positive(numbers),
            first_free: [true, false],
        }
    }

    fn unknowns() -> Vec<(usize, usize)> {
        let controls = (0..=STAGES).flat_map(|node| [(node, 6), (node, 7)]);
        let locked = [(0, 7), (2, 7), (4, 6)];
        (0..6)
            .map(|entry| (0, entry))
            .chain(controls.filter(|unknown| !locked.contains(unknown)))
            .collect()
    }

    fn dense(chain: &Chain) -> DMatrix<f64> {
        let unknowns = unknowns();
        DMatrix::from_fn(unknowns.len(), unknowns.len(), |i, j| {
            chain.second_derivative(unknowns[i], unknowns[j])
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
            let chain = chain(&mut numbers);
            let gradient: Vec<NodeVector> = (0..=STAGES).map(|_| matrix(&mut numbers)).collect();
            let expected = -dense(&chain).cholesky().unwrap().solve(&condensed(&chain, &gradient));
            let mut factor = Factor::new(STAGES);
            prop_assert_eq!(chain.factorise(0.0, &[1.0; STAGES + 1], 0, &mut factor), Ok(0));
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
            let mut chain = chain(&mut numbers.into_iter().cycle());
            chain.stages[2].controls[(1, 1)] += shift;
            let eigenvalues = dense(&chain).symmetric_eigenvalues();
            prop_assume!(eigenvalues.iter().all(|value| value.abs() > 1e-6));
            let negative = eigenvalues.iter().filter(|value| **value < 0.0).count();
            let factorise = |most| chain.factorise(0.0, &[1.0; STAGES + 1], most, &mut Factor::new(STAGES));
            prop_assert_eq!(factorise(0).is_ok(), negative == 0);
            prop_assert_eq!(factorise(9), Ok(negative));
        }

        #[test]
        fn test_step_of_a_concave_chain_is_stationary(numbers in prop::collection::vec(-1.0..1.0f64, 2000)) {
            let mut numbers = numbers.into_iter().cycle();
            let mut chain = chain(&mut numbers);
            chain.nodes[0].hessian[(2, 2)] -= 1e3;
            chain.stages[3].controls[(1, 1)] -= 30.0;
            let gradient: Vec<NodeVector> = (0..=STAGES).map(|_| matrix(&mut numbers)).collect();
            let mut factor = Factor::new(STAGES);
            let concave = chain.factorise(0.0, &[1.0; STAGES + 1], 9, &mut factor);
            prop_assume!(concave.is_ok_and(|count| count > 0));
            let mut step = vec![NodeVector::zeros(); STAGES + 1];
            chain.solve(&mut factor, &gradient, &mut step);
            let by_unknowns = dense(&chain)
                * DVector::from_iterator(unknowns().len(), unknowns().into_iter().map(|(k, i)| step[k][i]));
            let expected = -condensed(&chain, &gradient);
            prop_assert!((by_unknowns - &expected).amax() < 1e-5 * expected.amax().max(1.0));
        }

        #[test]
        fn test_folded_gradient_is_that_by_the_unknowns(numbers in prop::collection::vec(-1.0..1.0f64, 2000)) {
            let mut numbers = numbers.into_iter().cycle();
            let chain = chain(&mut numbers);
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
        let mut chain = chain(&mut numbers);
        chain.stages[2].controls -= Matrix4::identity() * 50.0;
        let mut factor = Factor::new(STAGES);
        let weights = [1.0; STAGES + 1];
        assert_eq!(
            chain.factorise(0.0, &weights, 0, &mut factor),
            Err(TooConcave)
        );
        assert_eq!(chain.factorise(100.0, &weights, 0, &mut factor), Ok(0));
    }
}
