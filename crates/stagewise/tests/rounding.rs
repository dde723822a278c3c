//! A control whose rounding alone keeps the gradient from vanishing.

mod common;

use common::transcribed::{Number, Problem, Trajectory, Transcribed};
use common::{SETTINGS, go_on};
use stagewise::{Layout, Outcome, Solution, minimise};

/// Less than half the distance of numbers below a half.
const LITTLE: f64 = 2e-17;

/// Two controls that are to be a little less than a half, the first of them by a stiff spring: no number is so near to a half,
/// so that the least force of the spring is its stiffness times that little.
#[derive(Debug, Clone)]
struct Spring {
    stiffness: f64,
    tells_rounding: bool,
}

impl Problem<1, 1, 2> for Spring {
    fn layout(&self) -> Layout {
        Layout::new(vec![1.0])
    }

    fn carry<D: Number>(&self, _: usize, [x]: [D; 1], _: [[D; 1]; 2]) -> [D; 1] {
        [x]
    }

    fn cost<D: Number>(&self, _: usize, [x]: [D; 1], [[a], [b]]: [[D; 1]; 2]) -> D {
        let [a, b] = [a, b].map(|control| control - 0.5 + LITTLE);
        a * a * (0.5 * self.stiffness) + b * b + x * x
    }

    fn rounding(&self, [control]: [f64; 1]) -> [f64; 1] {
        let share = if self.tells_rounding {
            f64::EPSILON
        } else {
            0.0
        };
        [share * control.abs()]
    }
}

fn solved(stiffness: f64, tells_rounding: bool) -> Solution<Trajectory<1, 1>> {
    let problem = Spring {
        stiffness,
        tells_rounding,
    };
    let start = Trajectory::new([0.1], vec![[0.2]; 2]);
    let program = Transcribed { problem };
    minimise(&program, &SETTINGS, start, &mut go_on)
}

#[test]
fn test_residual_is_what_is_beyond_rounding_of_the_controls() {
    let solution = solved(1e9, true);
    assert_eq!(solution.outcome, Outcome::Converged);
    for control in &solution.at.point.u {
        assert!((control[0] - 0.5).abs() < 1e-9);
    }
    assert!((solution.at.point.u[0][0] - 0.5).abs() <= f64::EPSILON / 2.0);
}

#[test]
fn test_residual_of_controls_that_tell_no_rounding_is_all_of_it() {
    let solution = solved(1e9, false);
    assert_ne!(solution.outcome, Outcome::Converged);
    assert!(solution.residuals.stationarity > SETTINGS.tolerance);
}

#[test]
fn test_rounding_that_is_too_large_counts_for_nothing() {
    let solution = solved(1e11, true);
    assert_ne!(solution.outcome, Outcome::Converged);
    assert!(solution.residuals.stationarity > 1e-6);
}
