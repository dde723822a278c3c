//! A pendulum on a cart, swung up with least effort, with limits of force and of track: optima of another solver.

mod common;

use common::check::{check_derivatives, check_linear_algebra};
use common::solved;
use common::transcribed::{Number, Problem, Trajectory, Transcribed};
use stagewise::Layout;

/// A pendulum hangs from a cart and is swung up within a time of 2, while the cart moves by 1; the square of the force is
/// least.
///
/// Sizes are those of M. Kelly, "An introduction to trajectory optimization" (2017), Appendix E. The force is linear between
/// nodes; one step of the classical Runge-Kutta method leads through a stage.
#[derive(Debug, Clone)]
struct CartPole {
    stages: usize,
    strongest: f64,
    /// Where the track begins.
    lowest: f64,
}

/// Mass of the cart and of the pendulum, its length, gravity.
const CART: f64 = 1.0;
const BOB: f64 = 0.3;
const ARM: f64 = 0.5;
const GRAVITY: f64 = 9.81;
const TIME: f64 = 2.0;

impl CartPole {
    fn program(self) -> Transcribed<Self> {
        Transcribed { problem: self }
    }

    /// Back first, then forth, then back.
    fn start(&self) -> Trajectory<4, 1> {
        let share = |k: usize| k as f64 / self.stages as f64;
        let force = (0..=self.stages).map(|k| [-0.1 * (std::f64::consts::TAU * share(k)).cos()]);
        Trajectory::new([0.0; 4], force)
    }

    fn rate<D: Number>([_, angle, v, w]: [D; 4], force: D) -> [D; 4] {
        let (sine, cosine) = (angle.sin(), angle.cos());
        let whirl = sine * w * w * (ARM * BOB);
        let mass = sine * sine * BOB + CART;
        let forward = (whirl + force + cosine * sine * (BOB * GRAVITY)) / mass;
        let around = (whirl * cosine + force * cosine + sine * ((CART + BOB) * GRAVITY)) / mass;
        [v, w, forward, around * (-1.0 / ARM)]
    }
}

impl Problem<4, 1, 5> for CartPole {
    fn layout(&self) -> Layout {
        let stages = self.stages;
        let weight = 1.0 / stages as f64;
        let rows = (0..stages).map(|k| if k + 1 == stages { 4 } else { 2 });
        let mut layout = Layout::new(vec![weight; stages])
            .with_equalities_at(0, 4)
            .with_equalities_at(stages, 4)
            .with_stage_inequalities(rows);
        for node in 1..=stages {
            layout = layout.with_inequalities_at(node, 1, weight);
        }
        layout
    }

    fn carry<D: Number>(&self, _: usize, x: [D; 4], [[a], [b]]: [[D; 1]; 2]) -> [D; 4] {
        let h = TIME / self.stages as f64;
        let along = |by: f64, rate: [D; 4]| std::array::from_fn(|i| x[i] + rate[i] * by);
        let middle = (a + b) * 0.5;
        let k1 = Self::rate(x, a);
        let k2 = Self::rate(along(h / 2.0, k1), middle);
        let k3 = Self::rate(along(h / 2.0, k2), middle);
        let k4 = Self::rate(along(h, k3), b);
        std::array::from_fn(|i| x[i] + (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * (h / 6.0))
    }

    fn cost<D: Number>(&self, _: usize, _: [D; 4], [[a], [b]]: [[D; 1]; 2]) -> D {
        (a * a + a * b + b * b) * (TIME / (3.0 * self.stages as f64))
    }

    fn equalities_at<D: Number>(&self, block: usize, x: [D; 4], _: [D; 1]) -> Vec<D> {
        let goal = [1.0, std::f64::consts::PI, 0.0, 0.0];
        (0..4).map(|i| x[i] - goal[i] * block as f64).collect()
    }

    fn stage_slacks<D: Number>(&self, stage: usize, [[a], [b]]: [[D; 1]; 2]) -> Vec<D> {
        let most = self.strongest;
        let mut slacks = vec![-a + most, a + most];
        if stage + 1 == self.stages {
            slacks.extend([-b + most, b + most]);
        }
        slacks
    }

    fn slacks_at<D: Number>(&self, _: usize, [x, ..]: [D; 4], _: [D; 1]) -> Vec<D> {
        vec![x - self.lowest]
    }
}

#[test]
fn test_derivatives_of_the_cart_pole_are_exact() {
    let cart = CartPole {
        stages: 5,
        strongest: 50.0,
        lowest: -50.0,
    };
    check_derivatives(&cart.clone().program(), &cart.start());
}

#[test]
fn test_pendulum_is_swung_up_with_the_least_effort_that_force_and_track_leave() {
    // Least efforts of the same transcription by IPOPT 3.14 (CasADi 3.8, tolerance 1e-11, bounds not relaxed), which SLSQP of
    // SciPy 1.17 confirms to ten digits.
    let cases = [
        (100.0, -9.0, 57.973_693_189_945),
        (100.0, -0.05, 58.396_994_938_955),
        (10.0, -0.05, 60.327_588_602_606),
    ];
    for (strongest, lowest, effort) in cases {
        let cart = CartPole {
            stages: 40,
            strongest,
            lowest,
        };
        let solution = solved(&cart.clone().program(), cart.start());
        let objective = solution.values.objective;
        assert!((objective / effort - 1.0).abs() < 1e-9, "{objective}");
        let places = solution.at.point.x.iter().map(|x| x[0]);
        let leftmost = places.fold(f64::INFINITY, f64::min);
        let expected = f64::max(lowest, -0.103_449_157);
        assert!((leftmost - expected).abs() < 1e-8, "{leftmost}");
        check_linear_algebra(&cart.program(), &solution.at);
        let forces = solution.at.point.u.iter().map(|u| u[0].abs());
        assert!(forces.fold(0.0, f64::max) < strongest);
        let inertia = solution.inertia.expect("bounds are clearly active or not");
        assert_eq!(
            (inertia.negative, inertia.zero, inertia.cost_free),
            (0, 0, 0)
        );
    }
}
