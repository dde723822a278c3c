//! Constraints that say the same, or the opposite, whatever the point: rank of their derivatives.

use super::border::Border;
use super::chain::Factor;
use super::{BOUNDS, Linearisation, Program, ROWS, Rows};
use nalgebra::{DMatrix, Matrix4, SymmetricEigen};

/// The constraints whose derivatives depend on each other at a point, by their places among the values: those of nodes
/// first, then those of pairs.
///
/// At a point in general position, no special one such as the straight belt, they do so everywhere.
pub fn dependent_constraints<P: Program>(program: &P, point: &P::Point) -> Vec<usize> {
    let linear = without_costs(program, point);
    let stages = program.stages();
    let mut factor = Factor::new(stages);
    let weights = vec![1.0 / stages as f64; stages + 1];
    if linear
        .chain
        .factorise(&linear.diagonal, 1.0, &weights, 0, &mut factor)
        .is_err()
    {
        return Vec::new();
    }
    let links = Border::new(program.linked_nodes(), stages + 1);
    let (mut border, rows) = links.with_nodes(&linear.diagonal.nodes, &linear);
    involved(&border.give(&linear.chain, &mut factor, &rows, 0.0))
}

/// The programme's constraints, and how its states are carried; nothing of what that costs.
fn without_costs<P: Program>(program: &P, point: &P::Point) -> Linearisation {
    let mut linear = Linearisation::new(program);
    let multipliers = vec![Rows::zeros(); linear.constraints.len() + linear.links.len()];
    let bounds = vec![[0.0; BOUNDS]; program.stages()];
    program.linearise(point, &multipliers, &bounds, &mut linear);
    linear.forget_second_derivatives();
    linear
}

impl Linearisation {
    /// Keeps of the chain how it carries states and controls on, and nothing of what that costs.
    pub(super) fn forget_second_derivatives(&mut self) {
        for stage in &mut self.chain.stages {
            stage.state_first.fill(0.0);
            stage.state_second.fill(0.0);
        }
        self.diagonal.states.clear();
        self.diagonal.controls.fill(Matrix4::zeros());
        for term in &mut self.diagonal.nodes {
            term.hessian.fill(0.0);
        }
    }
}

/// The constraints that take part in a combination of rows that gives way to nothing.
fn involved(give: &DMatrix<f64>) -> Vec<usize> {
    const NOTHING: f64 = 1e-13;
    const PART: f64 = 1e-3;
    let rows = 0..give.nrows();
    let used: Vec<usize> = rows.filter(|row| give[(*row, *row)] > 0.0).collect();
    let scale = |row: usize| 1.0 / give[(used[row], used[row])].sqrt();
    let scaled = DMatrix::from_fn(used.len(), used.len(), |i, j| {
        give[(used[i], used[j])] * scale(i) * scale(j)
    });
    let eigen = SymmetricEigen::new(scaled);
    let mut involved = Vec::new();
    for (value, vector) in eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.column_iter())
    {
        let parts = vector.iter().enumerate();
        if *value < NOTHING {
            let taking_part = parts.filter(|(_, part)| part.abs() > PART);
            involved.extend(taking_part.map(|(row, _)| used[row] / ROWS));
        }
    }
    involved.sort_unstable();
    involved.dedup();
    involved
}
