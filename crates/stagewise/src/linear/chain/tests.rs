//! A chain against dense matrices.

use super::*;
use crate::linear::TooConcave;
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

type Node = NodeVector<8>;

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
    // Stage 1 is a joint: both second controls follow both first ones, and one of them has a free part besides.
    (stages[1].tie, stages[1].free) = (Some(matrix(numbers)), [true, false]);
    stages[3].free = [false, true];
    let stiff = |numbers: &mut _| positive::<6>(numbers) + SMatrix::<f64, 6, 6>::identity() * STIFF;
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

/// The step along every unknown, carried along the chain.
fn units(chain: &Chain<2, 8>) -> Vec<Vec<Node>> {
    let unit = |(node, entry): (usize, usize)| {
        let mut step = vec![Node::zeros(); STAGES + 1];
        step[node][entry] = 1.0;
        chain.carry(&mut step);
        step
    };
    unknowns().into_iter().map(unit).collect()
}

fn dense((chain, diagonal): &(Chain<2, 8>, Diagonal<6, 2, 8>)) -> DMatrix<f64> {
    let units = units(chain);
    DMatrix::from_fn(units.len(), units.len(), |i, j| {
        chain.second_derivative(diagonal, &units[i], &units[j])
    })
}

/// Gradient by the unknowns, of a gradient by all nodes' states and controls.
fn condensed(chain: &Chain<2, 8>, gradient: &[Node]) -> DVector<f64> {
    let along = |step: Vec<Node>| step.iter().zip(gradient).map(|(s, g)| s.dot(g)).sum();
    let along = units(chain).into_iter().map(along);
    DVector::from_vec(along.collect())
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
        prop_assert_eq!(chain.factorise(diagonal, &Damping::none(&[1.0; STAGES + 1]), 0, &mut factor), Ok(0));
        let mut step = vec![Node::zeros(); STAGES + 1];
        chain.solve(&mut factor, &gradient, &mut step);
        let mut exact = vec![Node::zeros(); STAGES + 1];
        for (unit, length) in units(chain).iter().zip(&expected) {
            exact.iter_mut().zip(unit).for_each(|(node, along)| *node += *length * along);
        }
        let size = exact.iter().fold(1.0, |most: f64, node| most.max(node.amax()));
        for (found, exact) in step.iter().zip(&exact) {
            prop_assert!((found - exact).amax() < 1e-8 * size);
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
            |most| chain.factorise(diagonal, &Damping::none(&[1.0; STAGES + 1]), most, &mut Factor::new(STAGES));
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
        let concave = chain.factorise(diagonal, &Damping::none(&[1.0; STAGES + 1]), 9, &mut factor);
        prop_assume!(concave.is_ok_and(|count| count > 0));
        let mut step = vec![Node::zeros(); STAGES + 1];
        chain.solve(&mut factor, &gradient, &mut step);
        let force = condensed(chain, &gradient);
        let size = force.amax().max(1.0);
        for (unit, force) in units(chain).iter().zip(&force) {
            let missed = chain.second_derivative(diagonal, unit, &step) + force;
            prop_assert!(missed.abs() < 1e-5 * size);
        }
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
    let mut factorised = |strength: f64, controls: [f64; 2]| {
        let damping = Damping {
            strength,
            nodes: &weights,
            controls,
        };
        chain.factorise(&diagonal, &damping, 0, &mut factor)
    };
    assert_eq!(factorised(0.0, [1.0; 2]), Err(TooConcave));
    assert_eq!(factorised(100.0, [1.0; 2]), Ok(0));
    assert_eq!(factorised(100.0, [0.0; 2]), Err(TooConcave));
    assert_eq!(factorised(1.0, [100.0; 2]), Ok(0));
}
