//! The step and the inertia of a system with constraints of every kind, against dense matrices.

use super::*;
use crate::linear::modes::Mode;
use nalgebra::{DMatrix, DVector, SMatrix, SVector, SymmetricEigen};
use proptest::prelude::*;

const STAGES: usize = 4;

type Node = NodeVector<3>;

/// A node carries two numbers of state and one control.
type Linear = Linearisation<2, 1, 3>;

fn layout() -> Layout {
    Layout::new(vec![0.25; STAGES])
        .with_equalities_at(0, 1)
        .with_equalities_between([0, 3], 1)
        .with_stage_inequalities([1; STAGES])
        .with_inequalities_at(2, 1, 0.25)
        .with_inequalities_between([1, STAGES], 2, 0.25)
        .with_inequalities_between([2, 3], 1, 0.25)
}

/// Derivatives from random numbers; `stiff` is added to the second derivative by every unknown.
fn fill(linear: &mut Linear, stiff: f64, numbers: &mut impl Iterator<Item = f64>) {
    let mut next = || numbers.next().expect("endless");
    for stage in &mut linear.chain.stages {
        for row in 0..2 {
            stage.growth_by_first[row] = next();
            stage.growth_by_second[row] = next();
            stage.state_first[row] = next();
            stage.state_second[row] = next();
        }
    }
    for controls in &mut linear.diagonal.controls {
        controls.first[0] = stiff + next();
        controls.mixed[0] = next();
        controls.second[0] = stiff + next();
    }
    let mut vector = || Node::from_fn(|_, _| next());
    linear.gradient.iter_mut().for_each(|by| *by = vector());
    for by in linear
        .equalities_at
        .iter_mut()
        .chain(&mut linear.node_slacks)
    {
        *by = vector();
    }
    let pairs = linear.equalities_between.iter_mut();
    for by in pairs.chain(&mut linear.pair_slacks) {
        *by = [vector(), vector()];
    }
    let mut matrix = || {
        let half = NodeMatrix::from_columns(&[vector(), vector(), vector()]);
        half + half.transpose()
    };
    *linear.equality_hessian(0) = matrix() + stiff * NodeMatrix::identity();
    *linear.inequality_hessian(0) = matrix();
    for block in 0..2 {
        let hessian = linear.inequality_hessian_between(block);
        (hessian.first, hessian.mixed, hessian.second) = (matrix(), matrix(), matrix());
    }
    linear.equality_hessian_between(0).mixed = matrix();
    for [first, second] in &mut linear.stage_slacks {
        (*first, *second) = (SVector::repeat(next()), SVector::repeat(next()));
    }
    // A joint whose second control follows the first, and has a free part besides.
    linear.chain.stages[1].tie = Some(SMatrix::from([[next()]]));
}

/// The system by the unknowns: the first state and all controls, then the rows of the equalities.
struct Dense {
    steps: Vec<Vec<Node>>,
    /// Second derivative with the inequalities eliminated.
    hessian: DMatrix<f64>,
    equalities: DMatrix<f64>,
}

impl Dense {
    fn of(kkt: &Kkt<2, 1, 3>) -> Self {
        let linear = &kkt.linear;
        let unknowns = [(0, 0), (0, 1)].into_iter();
        let unit = |(node, entry): (usize, usize)| {
            let mut step = vec![Node::zeros(); STAGES + 1];
            step[node][entry] = 1.0;
            linear.chain.carry(&mut step);
            step
        };
        let controls = (0..=STAGES).map(|node| (node, 2));
        let steps: Vec<_> = unknowns.chain(controls).map(unit).collect();
        let rows = |count: usize, rates: &dyn Fn(&[Node], &mut [f64])| {
            let mut columns = vec![vec![0.0; count]; steps.len()];
            for (step, column) in steps.iter().zip(&mut columns) {
                rates(step, column);
            }
            DMatrix::from_fn(count, steps.len(), |i, j| columns[j][i])
        };
        let slacks = rows(kkt.stiffness.len(), &|step, into| {
            linear.slack_rates(step, into)
        });
        let stiffness = DMatrix::from_diagonal(&DVector::from_column_slice(&kkt.stiffness));
        let second = |i: usize, j: usize| linear.second_derivative(&steps[i], &steps[j]);
        Self {
            hessian: DMatrix::from_fn(steps.len(), steps.len(), second)
                + slacks.tr_mul(&(stiffness * &slacks)),
            equalities: rows(2, &|step, into| linear.equality_rates(step, into)),
            steps,
        }
    }

    /// Adds the equality that no step works against a force.
    fn hold(&mut self, force: &[Node]) {
        let work = |step: &Vec<Node>| step.iter().zip(force).map(|(a, b)| a.dot(b)).sum();
        let row = self.steps.iter().map(work);
        let rows = self.equalities.nrows();
        let mut more = self.equalities.clone().insert_row(rows, 0.0);
        more.row_mut(rows)
            .iter_mut()
            .zip(row)
            .for_each(|(entry, work): (&mut f64, f64)| *entry = work);
        self.equalities = more;
    }

    /// Eigenvalues on the directions that the equalities leave.
    fn eigenvalues(&self) -> Vec<f64> {
        let gram = SymmetricEigen::new(self.equalities.tr_mul(&self.equalities));
        let columns = gram.eigenvectors.column_iter().zip(&gram.eigenvalues);
        let tangents = columns.filter(|(_, value)| **value < 1e-10 * gram.eigenvalues.amax());
        let basis = DMatrix::from_columns(&tangents.map(|(column, _)| column).collect::<Vec<_>>());
        let reduced = basis.tr_mul(&(&self.hessian * &basis));
        reduced.symmetric_eigenvalues().iter().copied().collect()
    }

    /// The step, and that of the equalities' multipliers.
    fn solve(&self, gradient: &[Node], targets: &[f64]) -> (Vec<Node>, Vec<f64>) {
        let (n, m) = (self.steps.len(), targets.len());
        let mut matrix = DMatrix::zeros(n + m, n + m);
        matrix.view_mut((0, 0), (n, n)).copy_from(&self.hessian);
        matrix.view_mut((n, 0), (m, n)).copy_from(&self.equalities);
        matrix
            .view_mut((0, n), (n, m))
            .copy_from(&self.equalities.transpose());
        let along = |step: &Vec<Node>| step.iter().zip(gradient).map(|(a, b)| a.dot(b)).sum();
        let forces = self.steps.iter().map(along);
        let right = -DVector::from_vec(forces.chain(targets.iter().copied()).collect::<Vec<f64>>());
        let found = matrix.lu().solve(&right).expect("a regular system");
        let mut nodes = vec![Node::zeros(); STAGES + 1];
        for (step, length) in self.steps.iter().zip(found.iter()) {
            for (node, along) in nodes.iter_mut().zip(step) {
                *node += *length * along;
            }
        }
        (nodes, found.as_slice()[n..].to_vec())
    }
}

/// A motion of unit metric; its controls have no part in the force.
fn motion_in_general_position(nodes: usize, seed: usize) -> Mode<3> {
    let at = |node: usize| {
        let part = |i: usize| ((1 + seed) as f64 * (0.7 * node as f64 + i as f64)).sin();
        Node::new(part(0), part(1), 0.0)
    };
    let motion: Vec<Node> = (0..nodes).map(at).collect();
    Mode {
        eigenvalue: 0.0,
        force: motion.clone(),
        motion,
    }
}

proptest! {
    #[test]
    fn test_step_and_inertia_are_those_of_dense_matrices(
        numbers in prop::collection::vec(-1.0..1.0f64, 400),
        stiff in 0.0..30.0f64,
    ) {
        let mut numbers = numbers.into_iter().cycle();
        let mut kkt = Kkt::<2, 1, 3>::new(layout());
        fill(&mut kkt.linear, stiff, &mut numbers);
        let mut positive = |count: usize| -> Vec<f64> {
            numbers.by_ref().take(count).map(|x| 0.1 + x.abs()).collect()
        };
        let rows = kkt.layout().inequalities();
        let (slacks, multipliers) = (positive(rows), positive(rows));
        let values = Values { slacks, ..Values::default() };
        kkt.assemble(&values, &multipliers);
        let dense = Dense::of(&kkt);
        // Equalities that all but follow from each other have no multipliers of their own.
        let gram = &dense.equalities * dense.equalities.transpose();
        prop_assume!(gram.symmetric_eigenvalues().min() > 1e-2);
        let eigenvalues = dense.eigenvalues();
        prop_assume!(eigenvalues.iter().all(|value| value.abs() > 1e-2));
        let negative = eigenvalues.iter().filter(|value| **value < 0.0).count();
        let (gradient, targets) = (kkt.linear.gradient.clone(), [0.3, -0.2]);
        let (nodes, forces) = dense.solve(&gradient, &targets);
        let size = nodes.iter().flatten().fold(1.0, |most: f64, x| most.max(x.abs()));
        let size = forces.iter().fold(size, |most, x| most.max(x.abs()));
        prop_assume!(size < 1e3);
        prop_assert_eq!(kkt.count_negative(), Ok(negative));
        prop_assert_eq!(kkt.factorise_damped(0.0).is_ok(), negative == 0);
        let is_met = |kkt: &Kkt<2, 1, 3>| {
            let mut pairs = kkt.step.iter().zip(&nodes);
            pairs.all(|(found, exact)| (found - exact).amax() < 1e-6 * size)
        };
        // A chain that is concave by itself is factorised without pivoting, and loses digits.
        let is_convex = kkt.factorise_chain() == Ok(0);
        if negative == 0 {
            prop_assert_eq!(kkt.factorise_damped(0.0), Ok(()));
            kkt.find_step(&gradient, &targets);
            prop_assert!(is_met(&kkt) || !is_convex);
            for (found, exact) in kkt.multiplier_step.iter().zip(&forces) {
                prop_assert!((found - exact).abs() < 1e-5 * size || !is_convex);
            }
        }
        // To hold two motions is to add two equalities to the dense matrices.
        let held = [0, 1].map(|i| motion_in_general_position(kkt.layout().nodes(), i));
        let mut stricter = dense;
        for mode in &held {
            stricter.hold(&mode.force);
        }
        let beside = stricter.eigenvalues();
        prop_assume!(beside.iter().all(|value| value.abs() > 1e-2));
        let negative_beside = beside.iter().filter(|value| **value < 0.0).count();
        prop_assert!(kkt.count_negative_beside(&held) == Ok(negative_beside) || !is_convex);
        // Multipliers of this factorisation are left to refinement: the springs are stiff in it too.
        prop_assert_eq!(kkt.factorise_exactly(), Ok(negative));
        kkt.find_step(&gradient, &targets);
        prop_assert!(is_met(&kkt) || !is_convex);
    }
}

#[test]
fn test_equality_that_is_stiffer_than_its_spring_is_met_by_the_rigid_step_alone() {
    // The generator is that of Lehmer, with multiplier 16807.
    let numbers = std::iter::successors(Some(1u64), |x| Some(x * 16807 % 2_147_483_647));
    let mut numbers = numbers.map(|x| 2.0 * x as f64 / 2_147_483_647.0 - 1.0);
    let mut kkt = Kkt::<2, 1, 3>::new(layout());
    fill(&mut kkt.linear, 30.0, &mut numbers);
    let scale = 1e-5;
    kkt.linear.equalities_at[0] *= scale;
    let rows = kkt.layout().inequalities();
    let values = Values {
        slacks: vec![1.0; rows],
        ..Values::default()
    };
    kkt.assemble(&values, &vec![1.0; rows]);
    let targets = [0.3 * scale, -0.2];
    let gradient = kkt.linear.gradient.clone();
    let (nodes, _) = Dense::of(&kkt).solve(&gradient, &targets);
    let missed = |kkt: &Kkt<2, 1, 3>| {
        let pairs = kkt.step.iter().zip(&nodes);
        pairs.fold(0.0, |most: f64, (found, exact)| {
            most.max((found - exact).amax())
        })
    };
    let size = nodes
        .iter()
        .flatten()
        .fold(0.0, |most: f64, x| most.max(x.abs()));
    assert_eq!(kkt.factorise_damped(0.0), Ok(()));
    kkt.find_step(&gradient, &targets);
    assert!(missed(&kkt) > 0.1 * size);
    kkt.find_rigid_step(&gradient, &targets);
    assert!(missed(&kkt) < 1e-6 * size);
}
