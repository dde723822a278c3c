//! A cart pushed along a line, with the change of its push bounded: inequalities of stages, closed-form optima.
//!
//! The position is carried by the mean push of each stage, the pushes cost their square, and the cart starts at rest.

mod common;

use common::check::{check_derivatives, check_linear_algebra};
use nalgebra::{SMatrix, SVector};
use stagewise::{
    Layout, Linearisation, Multipliers, NodeVector, Outcome, Program, Settings, Solution, Values,
    correct, minimise,
};
use std::ops::ControlFlow;

const STAGES: usize = 8;
const SHARE: f64 = 1.0 / STAGES as f64;

struct Cart {
    goal: f64,
    steepest: f64,
    /// How the goal is asked for.
    asked: Asked,
}

#[derive(Clone, Copy, PartialEq)]
enum Asked {
    /// Of the last node.
    AtEnd,
    /// Of the distance between two nodes.
    Between([usize; 2]),
    /// Of the distance between two nodes, at least.
    AtLeastBetween([usize; 2]),
}

#[derive(Debug, Clone, PartialEq)]
struct Ride {
    position: Vec<f64>,
    push: Vec<f64>,
}

impl Cart {
    fn rate(&self, ride: &Ride, stage: usize) -> f64 {
        (ride.push[stage + 1] - ride.push[stage]) / SHARE / self.steepest
    }

    /// Force of the constraints on the position of a node.
    fn pull(&self, node: usize, multipliers: &Multipliers) -> f64 {
        let between = |[a, b]: [usize; 2]| f64::from(b == node) - f64::from(a == node);
        match self.asked {
            Asked::AtEnd if node == STAGES => multipliers.equalities[2],
            Asked::AtEnd | Asked::AtLeastBetween(_) => 0.0,
            Asked::Between(pair) => multipliers.equalities[2] * between(pair),
        }
    }
}

impl Program<1, 1, 2> for Cart {
    type Point = Ride;

    fn layout(&self) -> Layout {
        let layout = Layout::new(vec![SHARE; STAGES])
            .with_stage_inequalities([2; STAGES])
            .with_equalities_at(0, 2);
        match self.asked {
            Asked::AtEnd => layout.with_equalities_at(STAGES, 1),
            Asked::Between(pair) => layout.with_equalities_between(pair, 1),
            Asked::AtLeastBetween(pair) => layout.with_inequalities_between(pair, 1, SHARE),
        }
    }

    fn evaluate(&self, ride: &mut Ride, values: &mut Values) -> bool {
        values.objective = 0.0;
        values.slacks.clear();
        for k in 0..STAGES {
            let mean = 0.5 * (ride.push[k] + ride.push[k + 1]);
            ride.position[k + 1] = ride.position[k] + SHARE * mean;
            values.objective += 0.5 * SHARE * mean * mean;
            let rate = self.rate(ride, k);
            values.slacks.extend([1.0 - rate, 1.0 + rate]);
        }
        values.equalities = vec![ride.position[0], ride.push[0]];
        let gap = |[a, b]: [usize; 2]| ride.position[b] - ride.position[a] - self.goal;
        match self.asked {
            Asked::AtEnd => values.equalities.push(ride.position[STAGES] - self.goal),
            Asked::Between(pair) => values.equalities.push(gap(pair)),
            Asked::AtLeastBetween(pair) => values.slacks.push(gap(pair)),
        }
        values.slacks.iter().all(|slack| *slack > 0.0)
    }

    fn equality_gradients(&self, _: &Ride, into: &mut [NodeVector<2>]) {
        into[0] = NodeVector::from([1.0, 0.0]);
        into[1] = NodeVector::from([0.0, 1.0]);
        if let Some(last) = into.get_mut(2) {
            *last = NodeVector::from([1.0, 0.0]);
        }
    }

    fn linearise(&self, ride: &Ride, multipliers: &Multipliers, into: &mut Linearisation<1, 1, 2>) {
        into.gradient.fill(NodeVector::zeros());
        let mut beyond = 0.0;
        for k in (0..STAGES).rev() {
            beyond += self.pull(k + 1, multipliers);
            let mean = 0.5 * (ride.push[k] + ride.push[k + 1]);
            let stage = &mut into.chain.stages[k];
            stage.growth_by_first[(0, 0)] = 0.5 * SHARE;
            stage.growth_by_second[(0, 0)] = 0.5 * SHARE;
            let quarter = SMatrix::<f64, 1, 1>::repeat(0.25 * SHARE);
            let controls = &mut into.diagonal.controls[k];
            (controls.first, controls.mixed, controls.second) = (quarter, quarter, quarter);
            let pull = 0.5 * SHARE * (mean + beyond);
            into.gradient[k][1] += pull;
            into.gradient[k + 1][1] += pull;
            let rate = SVector::<f64, 1>::repeat(1.0 / SHARE / self.steepest);
            into.stage_slacks[2 * k] = [rate, -rate];
            into.stage_slacks[2 * k + 1] = [-rate, rate];
        }
        into.gradient[0][0] = beyond + self.pull(0, multipliers) + multipliers.equalities[0];
        into.gradient[0][1] += multipliers.equalities[1];
        self.equality_gradients(ride, &mut into.equalities_at);
        let along = NodeVector::from([1.0, 0.0]);
        let rows = into
            .equalities_between
            .iter_mut()
            .chain(&mut into.pair_slacks);
        rows.for_each(|row| *row = [-along, along]);
    }

    fn retract(&self, ride: &Ride, step: &[NodeVector<2>], length: f64, into: &mut Ride) {
        into.position[0] = ride.position[0] + length * step[0][0];
        for (k, change) in step.iter().enumerate() {
            into.push[k] = ride.push[k] + length * change[1];
        }
    }

    fn metric(&self, _: &Ride) -> Vec<SMatrix<f64, 1, 1>> {
        vec![SMatrix::repeat(SHARE); STAGES + 1]
    }
}

fn settings() -> Settings {
    Settings {
        tolerance: 1e-9,
        iterations: 100,
        barrier: 1.0,
        longest_step: f64::INFINITY,
    }
}

fn solved(cart: &Cart, push: f64) -> Solution<Ride> {
    let start = Ride {
        position: vec![0.0; STAGES + 1],
        push: (0..=STAGES).map(|k| push * k as f64).collect(),
    };
    minimise(cart, &settings(), start, &mut || ControlFlow::Continue(()))
}

fn cart(goal: f64, steepest: f64, asked: Asked) -> Cart {
    Cart {
        goal,
        steepest,
        asked,
    }
}

#[test]
fn test_derivatives_agree_with_finite_differences() {
    let ride = Ride {
        position: vec![0.1; STAGES + 1],
        push: (0..=STAGES).map(|k| 0.1 * (k as f64).sin()).collect(),
    };
    for asked in [
        Asked::AtEnd,
        Asked::Between([2, 5]),
        Asked::AtLeastBetween([3, 6]),
    ] {
        check_derivatives(&cart(-0.5, 6.0, asked), &ride);
    }
}

#[test]
fn test_bound_is_active_where_the_free_optimum_breaks_it() {
    let solution = solved(&cart(1.0, 4.0, Asked::AtEnd), 0.0);
    assert_eq!(solution.outcome, Outcome::Converged);
    assert!(solution.residuals.largest() <= 1e-9);
    // From rest the push rises as steeply as it may, to means of 1/4 and 3/4; the other six share the rest.
    let pairs = solution.at.point.push.windows(2);
    let means: Vec<f64> = pairs.map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    let expected = [0.25, 0.75].into_iter().chain([7.0 / 6.0; 6]);
    for (mean, expected) in means.iter().zip(expected) {
        assert!((mean - expected).abs() < 1e-5, "{means:?}");
    }
}

#[test]
fn test_multiplier_is_minus_the_slope_of_the_least_objective() {
    let least = |goal: f64| solved(&cart(goal, 4.0, Asked::AtEnd), 0.0);
    let (below, here, above) = (least(0.999), least(1.0), least(1.001));
    let slope = (above.values.objective - below.values.objective) / 0.002;
    let multiplier = here.at.multipliers.equalities[2];
    assert!((slope + multiplier).abs() < 1e-5 * slope.abs());
}

#[test]
fn test_equality_between_two_nodes_is_worth_the_one_that_it_replaces() {
    let held = solved(&cart(1.0, 4.0, Asked::AtEnd), 0.0);
    let tied = solved(&cart(1.0, 4.0, Asked::Between([0, STAGES])), 0.0);
    assert_eq!(tied.outcome, Outcome::Converged);
    assert!((held.values.objective - tied.values.objective).abs() < 1e-9);
    let [a, b] = [&held, &tied].map(|solution| solution.at.multipliers.equalities[2]);
    assert!((a - b).abs() < 1e-6);
}

#[test]
fn test_active_inequality_between_two_nodes_is_the_equality_and_has_its_multiplier() {
    for pair in [[0, STAGES], [3, 6]] {
        let tied = solved(&cart(0.4, 6.0, Asked::Between(pair)), 0.0);
        // From a ride that goes farther than asked for.
        let bounded = solved(&cart(0.4, 6.0, Asked::AtLeastBetween(pair)), 0.5);
        assert_eq!(bounded.outcome, Outcome::Converged);
        assert!((tied.values.objective - bounded.values.objective).abs() < 1e-6);
        let equality = tied.at.multipliers.equalities[2];
        let inequality = bounded.at.multipliers.inequalities[2 * STAGES];
        assert!(
            (equality + inequality).abs() < 1e-4,
            "{equality} {inequality}"
        );
        check_linear_algebra(&cart(0.4, 6.0, Asked::AtLeastBetween(pair)), &bounded.at);
        let inertia = bounded.inertia.unwrap();
        assert_eq!((inertia.negative, inertia.zero), (0, 0));
    }
}

#[test]
fn test_inactive_inequality_between_two_nodes_bears_nothing() {
    let solution = solved(&cart(-0.5, 6.0, Asked::AtLeastBetween([0, STAGES])), 0.1);
    assert_eq!(solution.outcome, Outcome::Converged);
    assert!(solution.values.objective < 1e-7);
    assert!(solution.at.multipliers.inequalities[2 * STAGES] < 1e-6);
}

#[test]
fn test_goal_out_of_reach_does_not_converge() {
    let solution = solved(&cart(10.0, 1.0, Asked::AtEnd), 0.0);
    assert_ne!(solution.outcome, Outcome::Converged);
    assert!(solution.residuals.constraint > 1.0);
}

#[test]
fn test_caller_may_end_it() {
    let cart = cart(1.0, 4.0, Asked::AtEnd);
    let start = Ride {
        position: vec![0.0; STAGES + 1],
        push: vec![0.0; STAGES + 1],
    };
    let solution = minimise(&cart, &settings(), start, &mut || ControlFlow::Break(()));
    assert_eq!(
        (solution.outcome, solution.iterations),
        (Outcome::Interrupted, 0)
    );
}

#[test]
fn test_same_input_gives_the_same_bits() {
    let [a, b] = [0, 1].map(|_| solved(&cart(1.0, 4.0, Asked::AtEnd), 0.0));
    assert_eq!((a.at, a.values), (b.at, b.values));
}

#[test]
fn test_one_newton_step_corrects_a_quadratic_programme_and_foretells_its_objective() {
    let cart = cart(0.4, 100.0, Asked::AtEnd);
    let solution = solved(&cart, 0.0);
    let mut near = solution.at.clone();
    let aside = 0.03;
    near.point.push[3] += aside;
    let corrected = correct(&cart, 1e-9, near).unwrap();
    assert!((corrected.objective - solution.values.objective).abs() < 1e-9);
    let pushes = corrected.point.push.iter().zip(&solution.at.point.push);
    assert!(pushes.into_iter().all(|(a, b)| (a - b).abs() < 1e-7));
    let multiplier = solution.at.multipliers.equalities[2];
    assert!((corrected.equalities[2] - multiplier).abs() < 1e-7);
    // Two stages cost ½ SHARE mean² each, and the push is half of either mean.
    let curvature = 0.5 * SHARE;
    let gain = 0.5 * curvature * aside * aside;
    assert!((corrected.gains[3] / gain - 1.0).abs() < 1e-4);
    assert!(corrected.gains[6] < 1e-6 * gain);
}
