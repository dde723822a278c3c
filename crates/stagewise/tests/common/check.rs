//! Derivatives and linear algebra of a programme against finite differences and dense matrices.

use super::dense::{Dense, carried, rates, unknowns};
use nalgebra::DVector;
use stagewise::{
    Direction, Linearisation, Multipliers, NodeVector, Program, Response, Stationary, Values,
    lowest_modes,
};

/// The multipliers, in general position, with which derivatives are compared.
fn multipliers<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
) -> Multipliers {
    let layout = program.layout();
    let wave = |from: f64| move |row: usize| (from + row as f64).sin();
    Multipliers {
        equalities: (0..layout.equalities()).map(wave(0.3)).collect(),
        inequalities: (0..layout.inequalities())
            .map(wave(1.1))
            .map(f64::abs)
            .collect(),
    }
}

/// Gradient of the whole Lagrangian, slacks included, by every unknown.
fn slopes<const X: usize, const U: usize, const N: usize>(
    linear: &Linearisation<X, U, N>,
    multipliers: &Multipliers,
) -> DVector<f64> {
    let along = |unknown: (usize, usize)| {
        let step = carried(linear, unknown);
        let terms = linear.gradient.iter().zip(&step);
        let own: f64 = terms.map(|(by, step)| by.dot(step)).sum();
        let [_, slacks] = rates(linear, &step);
        let bound = slacks.iter().zip(&multipliers.inequalities);
        own - bound.map(|(a, b)| a * b).sum::<f64>()
    };
    DVector::from_vec(unknowns(linear).into_iter().map(along).collect())
}

#[track_caller]
fn assert_close(exact: f64, difference: f64, what: &str) {
    let size = exact.abs().max(difference.abs()).max(1.0);
    assert!(
        (exact - difference).abs() <= 1e-6 * size,
        "{what}: {exact}, by differences {difference}"
    );
}

/// Compares first and second derivatives of a programme with central differences, by every pair of unknowns.
///
/// Differences of gradients are symmetrised: along unknowns that do not commute, as twists, only that part is the second
/// derivative.
#[track_caller]
pub(crate) fn check_derivatives<P, const X: usize, const U: usize, const N: usize>(
    program: &P,
    point: &P::Point,
) where
    P: Program<X, U, N>,
{
    const H: f64 = 1e-5;
    let multipliers = multipliers(program);
    let mut point = point.clone();
    program.evaluate(&mut point, &mut Values::default());
    let linearised = |point: &P::Point| {
        let mut linear = Linearisation::new(program.layout());
        program.linearise(point, &multipliers, &mut linear);
        linear
    };
    let here = linearised(&point);
    let mut gradients = vec![NodeVector::zeros(); program.layout().equalities_at_nodes()];
    program.equality_gradients(&point, &mut gradients);
    assert_eq!(gradients, here.equalities_at);
    let unknowns = unknowns(&here);
    let steps: Vec<_> = unknowns
        .iter()
        .map(|unknown| carried(&here, *unknown))
        .collect();
    let gradient = slopes(&here, &multipliers);
    let mut seconds = Vec::new();
    for (i, step) in steps.iter().enumerate() {
        let [plus, minus] = [H, -H].map(|h| {
            let (mut moved, mut values) = (point.clone(), Values::default());
            program.retract(&point, step, h, &mut moved);
            program.evaluate(&mut moved, &mut values);
            (slopes(&linearised(&moved), &multipliers), values)
        });
        let lagrangian = |values: &Values| {
            let equalities = values.equalities.iter().zip(&multipliers.equalities);
            let slacks = values.slacks.iter().zip(&multipliers.inequalities);
            let work = |(a, b): (&f64, &f64)| a * b;
            values.objective + equalities.map(work).sum::<f64>() - slacks.map(work).sum::<f64>()
        };
        let by = |name: &str| format!("{name} by {:?}", unknowns[i]);
        let slope = (lagrangian(&plus.1) - lagrangian(&minus.1)) / (2.0 * H);
        assert_close(gradient[i], slope, &by("gradient"));
        let [equalities, slacks] = rates(&here, step);
        let rows = equalities
            .iter()
            .zip(&plus.1.equalities)
            .zip(&minus.1.equalities);
        let slack_rows = slacks.iter().zip(&plus.1.slacks).zip(&minus.1.slacks);
        for ((rate, plus), minus) in rows.chain(slack_rows) {
            assert_close(*rate, (plus - minus) / (2.0 * H), &by("constraint"));
        }
        seconds.push((plus.0 - minus.0) / (2.0 * H));
    }
    for (i, a) in steps.iter().enumerate() {
        for (j, b) in steps.iter().enumerate() {
            let exact = here.second_derivative(a, b);
            let difference = 0.5 * (seconds[i][j] + seconds[j][i]);
            let by = format!(
                "second derivative by {:?} and {:?}",
                unknowns[i], unknowns[j]
            );
            assert_close(exact, difference, &by);
        }
    }
}

/// Compares the answer to a right-hand side in general position, by both factorisations, and the lowest modes at a minimum
/// with those of dense matrices.
#[track_caller]
pub(crate) fn check_linear_algebra<P, const X: usize, const U: usize, const N: usize>(
    program: &P,
    at: &Stationary<P::Point>,
) where
    P: Program<X, U, N>,
{
    let mut at = at.clone();
    let dense = Dense::of(program, &at);
    let mut systems = [
        Response::of_minimum(program, &mut at).expect("a minimum"),
        Response::of_stationary(program, &mut at).expect("a regular point"),
    ];
    let mut right = systems[0].zero();
    let mut wave = (1..).map(|i| f64::from(i).sin());
    for node in &mut right.nodes {
        *node = NodeVector::from_fn(|_, _| wave.next().expect("endless"));
    }
    for row in right.equalities.iter_mut().chain(&mut right.inequalities) {
        *row = 0.1 * wave.next().expect("endless");
    }
    let expected = dense.solve(&right);
    for system in &mut systems {
        let found = system.solve(&right).expect("a solution");
        let entries = |direction: &Direction<N>| {
            let nodes: Vec<f64> = direction.nodes.iter().flatten().copied().collect();
            [
                nodes,
                direction.equalities.clone(),
                direction.inequalities.clone(),
            ]
        };
        for (found, expected) in entries(&found).iter().zip(entries(&expected)) {
            let size = expected.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
            for (found, expected) in found.iter().zip(expected) {
                let error = (found - expected).abs();
                assert!(error < 1e-6 * size, "{found} for {expected} of {size}");
            }
        }
    }
    let exact = dense.eigenvalues();
    let modes = lowest_modes(program, &mut at, 3).expect("modes");
    for (mode, exact) in modes.iter().zip(&exact) {
        let error = (mode.eigenvalue - exact).abs();
        // The stiffness of active inequalities costs dense matrices some digits.
        assert!(
            error < 1e-4 * exact.abs().max(1.0),
            "{} for {exact}",
            mode.eigenvalue
        );
    }
}
