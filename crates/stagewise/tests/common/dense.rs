//! A programme's first-order conditions with dense matrices, to compare the solver's linear algebra with.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use stagewise::{Direction, Linearisation, NodeVector, Program, Stationary, Values};

/// The unknowns of a programme: node and entry.
pub(crate) fn unknowns<const X: usize, const U: usize, const N: usize>(
    linear: &Linearisation<X, U, N>,
) -> Vec<(usize, usize)> {
    let free = |node: usize, i: usize| match node {
        0 => linear.chain.first_free[i],
        _ => linear.chain.stages[node - 1].free[i],
    };
    let nodes = 0..linear.layout().nodes();
    let controls = nodes.flat_map(|node| (0..U).map(move |i| (node, i)));
    let controls = controls.filter(|(node, i)| free(*node, *i));
    (0..X)
        .map(|entry| (0, entry))
        .chain(controls.map(|(node, i)| (node, X + i)))
        .collect()
}

/// The step along one unknown, carried along the chain.
pub(crate) fn carried<const X: usize, const U: usize, const N: usize>(
    linear: &Linearisation<X, U, N>,
    (node, entry): (usize, usize),
) -> Vec<NodeVector<N>> {
    let mut step = vec![NodeVector::zeros(); linear.layout().nodes()];
    step[node][entry] = 1.0;
    linear.chain.carry(&mut step);
    step
}

/// Changes of equalities and of slacks along a step that has been carried.
pub(crate) fn rates<const X: usize, const U: usize, const N: usize>(
    linear: &Linearisation<X, U, N>,
    step: &[NodeVector<N>],
) -> [Vec<f64>; 2] {
    let layout = linear.layout();
    let controls = |node: usize| step[node].fixed_rows::<U>(X).into_owned();
    let [mut equalities, mut slacks] = [Vec::new(), Vec::new()];
    for stage in 0..layout.stages() {
        for row in layout.stage_rows(stage) {
            let [first, second] = &linear.stage_slacks[row];
            slacks.push(first.dot(&controls(stage)) + second.dot(&controls(stage + 1)));
        }
    }
    let at = [
        (
            &mut equalities,
            &linear.equalities_at,
            layout.equalities_at(),
        ),
        (&mut slacks, &linear.node_slacks, layout.inequalities_at()),
    ];
    for (into, rows, blocks) in at {
        let nodes = blocks.iter().flat_map(|block| vec![block.at; block.rows]);
        into.extend(
            rows.iter()
                .zip(nodes)
                .map(|(row, node)| row.dot(&step[node])),
        );
    }
    let between = [
        (
            &mut equalities,
            &linear.equalities_between,
            layout.equalities_between(),
        ),
        (
            &mut slacks,
            &linear.pair_slacks,
            layout.inequalities_between(),
        ),
    ];
    for (into, rows, blocks) in between {
        let pairs = blocks.iter().flat_map(|block| vec![block.at; block.rows]);
        let rows = rows.iter().zip(pairs);
        into.extend(
            rows.map(|([a, b], [first, second])| a.dot(&step[first]) + b.dot(&step[second])),
        );
    }
    [equalities, slacks]
}

/// The system of the first-order conditions at a point, by unknowns, equalities and inequalities.
pub(crate) struct Dense<const N: usize> {
    /// One step along every unknown.
    steps: Vec<Vec<NodeVector<N>>>,
    /// Second derivative of the Lagrangian.
    hessian: DMatrix<f64>,
    /// Gradients of the equalities, a row each.
    equalities: DMatrix<f64>,
    /// Gradients of the slacks, a row each.
    slacks: DMatrix<f64>,
    /// Slack over multiplier of every inequality.
    compliance: DVector<f64>,
    /// The metric.
    mass: DMatrix<f64>,
}

impl<const N: usize> Dense<N> {
    pub(crate) fn of<P: Program<X, U, N>, const X: usize, const U: usize>(
        program: &P,
        at: &Stationary<P::Point>,
    ) -> Self {
        let (mut point, mut values) = (at.point.clone(), Values::default());
        assert!(program.evaluate(&mut point, &mut values));
        let mut linear = Linearisation::new(program.layout());
        program.linearise(&point, &at.multipliers, &mut linear);
        let metric = program.metric(&point);
        let unknowns = unknowns(&linear).into_iter();
        let steps: Vec<_> = unknowns.map(|unknown| carried(&linear, unknown)).collect();
        let count = steps.len();
        let state = |i: usize, k: usize| steps[i][k].fixed_rows::<X>(0).into_owned();
        let weighed = |i: usize, j: usize| {
            let terms = metric.iter().enumerate();
            terms
                .map(|(k, m)| state(i, k).dot(&(m * state(j, k))))
                .sum()
        };
        let columns: Vec<_> = steps.iter().map(|step| rates(&linear, step)).collect();
        let rows = |which: usize| {
            DMatrix::from_fn(columns[0][which].len(), count, |i, j| columns[j][which][i])
        };
        let inequalities = values.slacks.iter().zip(&at.multipliers.inequalities);
        Self {
            hessian: DMatrix::from_fn(count, count, |i, j| {
                linear.second_derivative(&steps[i], &steps[j])
            }),
            equalities: rows(0),
            slacks: rows(1),
            compliance: DVector::from_vec(inequalities.map(|(s, m)| s / m).collect()),
            mass: DMatrix::from_fn(count, count, weighed),
            steps,
        }
    }

    /// The solution of the system that [`Response`](stagewise::Response) solves: its nodes, equalities and inequalities.
    pub(crate) fn solve(&self, right: &Direction<N>) -> Direction<N> {
        let (n, m, s) = (
            self.steps.len(),
            self.equalities.nrows(),
            self.slacks.nrows(),
        );
        let mut matrix = DMatrix::zeros(n + m + s, n + m + s);
        matrix.view_mut((0, 0), (n, n)).copy_from(&self.hessian);
        for (from, rows) in [(n, &self.equalities), (n + m, &self.slacks)] {
            matrix.view_mut((from, 0), rows.shape()).copy_from(rows);
            let columns = rows.transpose();
            matrix
                .view_mut((0, from), columns.shape())
                .copy_from(&columns);
        }
        for (row, compliance) in self.compliance.iter().enumerate() {
            matrix[(n + m + row, n + m + row)] = -compliance;
        }
        let forces = self.steps.iter().map(|step| {
            let nodes = right.nodes.iter().zip(step);
            nodes.map(|(force, node)| force.dot(node)).sum::<f64>()
        });
        let rows = right.equalities.iter().chain(&right.inequalities).copied();
        let right = -DVector::from_vec(forces.chain(rows).collect());
        let found = matrix.lu().solve(&right).expect("a regular system");
        let mut nodes = vec![NodeVector::zeros(); self.steps[0].len()];
        for (step, length) in self.steps.iter().zip(found.iter()) {
            for (node, along) in nodes.iter_mut().zip(step) {
                *node += *length * along;
            }
        }
        Direction {
            nodes,
            equalities: found.as_slice()[n..n + m].to_vec(),
            inequalities: found.as_slice()[n + m..].to_vec(),
        }
    }

    /// Eigenvalues, rising, of the second derivative with the inequalities eliminated, on the directions that the equalities
    /// leave, measured by the metric; motions of no metric are left out.
    pub(crate) fn eigenvalues(&self) -> Vec<f64> {
        let gram = SymmetricEigen::new(self.equalities.tr_mul(&self.equalities));
        let least = 1e-10 * gram.eigenvalues.amax();
        let columns = gram.eigenvectors.column_iter().zip(&gram.eigenvalues);
        let tangents = columns.filter(|(_, value)| **value < least);
        let basis = DMatrix::from_columns(&tangents.map(|(column, _)| column).collect::<Vec<_>>());
        let stiffness = DMatrix::from_diagonal(&self.compliance.map(f64::recip));
        let whole = &self.hessian + self.slacks.tr_mul(&(stiffness * &self.slacks));
        let hessian = basis.tr_mul(&(whole * &basis));
        let mass = basis.tr_mul(&(&self.mass * &basis));
        // Multiples of the metric over the second derivative, shifted until it is positive: the largest are the lowest.
        let mut shift = 1.0;
        let root = loop {
            if let Some(cholesky) = (&hessian + shift * &mass).cholesky() {
                break cholesky.l();
            }
            shift *= 4.0;
        };
        let inverse = root.try_inverse().expect("a regular factor");
        let eigen = SymmetricEigen::new(&inverse * mass * inverse.transpose());
        let least = 1e-12 * eigen.eigenvalues.amax();
        let seen = eigen.eigenvalues.iter().filter(|value| **value > least);
        let mut values: Vec<f64> = seen.map(|value| value.recip() - shift).collect();
        values.sort_by(f64::total_cmp);
        values
    }
}
