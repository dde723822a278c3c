//! Elimination of a chain's controls, stage by stage from the last to the first.

use super::columns::{Columns, GrowthRows, add_scaled, carried, weighted};
use super::{Chain, Diagonal, NodeMatrix, NodeVector, Stage};
use crate::linear::TooConcave;
use crate::linear::pair_matrix::StageMatrix;
use crate::linear::small::{invert, invert_indefinite};
use multiversion::multiversion;
use nalgebra::{ArrayStorage, Cholesky, Const, SMatrix};

/// Elimination of one stage's second controls: the controls are −`gain`ᵀ times the first node's unknowns, less `inverse`
/// times the force on the controls.
#[derive(Debug, Clone, Copy)]
pub(super) struct Elimination<const U: usize, const N: usize> {
    pub(super) inverse: [[f64; U]; U],
    pub(super) gain: [[f64; N]; U],
}

/// The factorised second derivative by the first node's unknowns.
#[derive(Debug, Clone)]
pub(super) enum First<const N: usize> {
    Positive(Cholesky<f64, Const<N>>),
    /// Its inverse.
    Indefinite(NodeMatrix<N>),
}

/// A factorised chain, and a work array for the forces of one right-hand side.
#[derive(Debug, Clone)]
pub(crate) struct Factor<const U: usize, const N: usize> {
    pub(super) eliminations: Vec<Elimination<U, N>>,
    pub(super) first: First<N>,
    pub(super) forces: Vec<[f64; U]>,
}

impl<const U: usize, const N: usize> Factor<U, N> {
    /// Memory for a chain of a number of stages.
    pub(crate) fn new(stages: usize) -> Self {
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
    /// Factorises a matrix with at most `most` negative eigenvalues, and counts its negative eigenvalues.
    fn factorise(matrix: &NodeMatrix<N>, most: usize) -> Result<(Self, usize), TooConcave> {
        if let Some(cholesky) = Cholesky::new(*matrix) {
            return Ok((Self::Positive(cholesky), 0));
        }
        let (inverse, negative) = invert_indefinite(matrix, most)?;
        Ok((Self::Indefinite(inverse), negative))
    }

    pub(super) fn solve(&self, right: &NodeVector<N>) -> NodeVector<N> {
        match self {
            Self::Positive(cholesky) => cholesky.solve(right),
            Self::Indefinite(inverse) => inverse * right,
        }
    }
}

/// What is added to the second derivative by the unknowns: the strength to the first state, and the strength times both weights
/// to every control.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Damping<'a, const U: usize> {
    /// Second derivative per unit weight.
    pub(crate) strength: f64,
    /// Weights of the nodes.
    pub(crate) nodes: &'a [f64],
    /// Weights of a node's controls.
    pub(crate) controls: [f64; U],
}

impl<'a, const U: usize> Damping<'a, U> {
    /// No damping of nodes, which have these weights.
    pub(crate) fn none(nodes: &'a [f64]) -> Self {
        Self {
            strength: 0.0,
            nodes,
            controls: [1.0; U],
        }
    }
}

impl<const U: usize, const N: usize> Chain<U, N> {
    /// Factorises the chain with damping. Gives the number of concave directions, of `most` that are allowed.
    ///
    /// Errors: [`TooConcave`] where more directions are concave, or a direction has zero curvature.
    pub(crate) fn factorise<const X: usize>(
        &self,
        diagonal: &Diagonal<X, U, N>,
        damping: &Damping<'_, U>,
        most: usize,
        into: &mut Factor<U, N>,
    ) -> Result<usize, TooConcave> {
        let (mut first, concave) = eliminate_all(self, diagonal, damping, most, into)?;
        for i in 0..X {
            first[(i, i)] += damping.strength;
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
}

/// Eliminates the second controls of every stage, from the last to the first; gives the cost as a function of the first
/// node's unknowns, and the number of concave directions.
#[multiversion(targets("x86_64+avx2"))]
fn eliminate_all<const X: usize, const U: usize, const N: usize>(
    chain: &Chain<U, N>,
    diagonal: &Diagonal<X, U, N>,
    damping: &Damping<'_, U>,
    most: usize,
    into: &mut Factor<U, N>,
) -> Result<(NodeMatrix<N>, usize), TooConcave> {
    let mut terms = diagonal.nodes.iter().rev().peekable();
    let mut cost: Columns<N> = [[0.0; N]; N];
    let mut concave = 0;
    for k in (0..damping.nodes.len()).rev() {
        for i in 0..U {
            cost[X + i][X + i] += damping.strength * damping.nodes[k] * damping.controls[i];
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

/// Eliminates the free part of a stage's second controls: turns the cost beyond the stage into the cost before the stage, and
/// gives the number of concave directions.
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
    let [first, second] = [GrowthRows::of(first), GrowthRows::of(second)];
    let mut pivot = [[0.0; U]; U];
    for j in 0..U {
        let grown = second.products(&toward[j], j + 1);
        for i in 0..=j {
            let own = toward[j][states + i] + grown[i];
            pivot[i][j] = own + controls.second.data.0[j][i];
            pivot[j][i] = pivot[i][j];
        }
    }
    for j in 0..U {
        let own = first.products(&before[j], U);
        let next = first.products(&toward[j], U);
        add_scaled(&mut before[j], 1.0, &state_first[j]);
        add_scaled(&mut toward[j], 1.0, &state_second[j]);
        for i in 0..U {
            before[j][states + i] = controls.first.data.0[j][i] + own[i];
            toward[j][states + i] = controls.mixed.data.0[j][i] + next[i];
        }
    }
    if let Some(tie) = &stage.tie {
        follow(tie, &pivot, &mut toward, &mut before);
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

/// Turns the derivatives by the second controls into those by their free part, and adds the cost of the part that follows the
/// first controls to the cost of these.
fn follow<const U: usize, const N: usize>(
    tie: &SMatrix<f64, U, U>,
    pivot: &[[f64; U]; U],
    toward: &mut [[f64; N]; U],
    before: &mut [[f64; N]; U],
) {
    let states = N - U;
    for j in 0..U {
        for i in 0..U {
            before[j][states + i] += weighted::<U>(|l| tie[(l, i)], |l| toward[l][states + j]);
        }
    }
    for j in 0..U {
        for i in 0..U {
            toward[j][states + i] += weighted::<U>(|l| tie[(l, i)], |l| pivot[l][j]);
        }
    }
    // The derivatives as they are now: what follows acts on itself, too.
    for j in 0..U {
        for l in 0..U {
            add_scaled(&mut before[j], tie[(l, j)], &toward[l]);
        }
    }
}

/// Replaces the equation of an entry by `entry = right-hand side`.
#[inline(always)]
fn lock<const N: usize>(matrix: &mut NodeMatrix<N>, entry: usize) {
    matrix.row_mut(entry).fill(0.0);
    matrix.column_mut(entry).fill(0.0);
    matrix[(entry, entry)] = 1.0;
}
