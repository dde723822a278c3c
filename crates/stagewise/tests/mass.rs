//! A mass moved with least effort from rest to rest, with limits of force and speed: closed-form optima.

mod common;

use common::check::{check_derivatives, check_linear_algebra};
use common::solved;
use common::transcribed::{Number, Problem, Trajectory, Transcribed};
use stagewise::Layout;

/// A mass is moved by 1 within a time of 1, from rest to rest; half the square of the force is least.
///
/// The force is linear between nodes, and motion and cost are exact for it.
#[derive(Debug, Clone)]
struct Mass {
    stages: usize,
    strongest: Option<f64>,
    fastest: Option<f64>,
}

const FREE: Mass = Mass {
    stages: 40,
    strongest: None,
    fastest: None,
};

impl Mass {
    fn program(self) -> Transcribed<Self> {
        Transcribed { problem: self }
    }

    fn start(&self) -> Trajectory<2, 1> {
        Trajectory::new([0.0; 2], vec![[0.0]; self.stages + 1])
    }
}

impl Problem<2, 1, 3> for Mass {
    fn layout(&self) -> Layout {
        let stages = self.stages;
        let weight = 1.0 / stages as f64;
        let mut layout = Layout::new(vec![weight; stages])
            .with_equalities_at(0, 2)
            .with_equalities_at(stages, 2);
        if self.strongest.is_some() {
            // Every stage bounds its first force, the last one its second as well.
            let rows = (0..stages).map(|k| if k + 1 == stages { 4 } else { 2 });
            layout = layout.with_stage_inequalities(rows);
        }
        if self.fastest.is_some() {
            for node in 0..=stages {
                layout = layout.with_inequalities_at(node, 1, weight);
            }
        }
        layout
    }

    fn carry<D: Number>(&self, _: usize, [x, v]: [D; 2], [[a], [b]]: [[D; 1]; 2]) -> [D; 2] {
        let h = 1.0 / self.stages as f64;
        let by_force = (a * 2.0 + b) * (h * h / 6.0);
        [x + v * h + by_force, v + (a + b) * (h / 2.0)]
    }

    fn cost<D: Number>(&self, _: usize, _: [D; 2], [[a], [b]]: [[D; 1]; 2]) -> D {
        (a * a + a * b + b * b) * (1.0 / (6.0 * self.stages as f64))
    }

    fn equalities_at<D: Number>(&self, block: usize, [x, v]: [D; 2], _: [D; 1]) -> Vec<D> {
        vec![x - block as f64, v]
    }

    fn stage_slacks<D: Number>(&self, stage: usize, [[a], [b]]: [[D; 1]; 2]) -> Vec<D> {
        let Some(most) = self.strongest else {
            return Vec::new();
        };
        let mut slacks = vec![-a + most, a + most];
        if stage + 1 == self.stages {
            slacks.extend([-b + most, b + most]);
        }
        slacks
    }

    fn slacks_at<D: Number>(&self, _: usize, [_, v]: [D; 2], _: [D; 1]) -> Vec<D> {
        self.fastest.iter().map(|most| -v + *most).collect()
    }
}

#[test]
fn test_derivatives_of_the_mass_are_exact() {
    let mass = Mass {
        stages: 4,
        strongest: Some(9.0),
        fastest: Some(9.0),
    };
    let point = Trajectory::new([0.1, -0.2], (0..5).map(|k| [f64::from(k).sin()]));
    check_derivatives(&mass.program(), &point);
}

#[test]
fn test_free_mass_is_pushed_by_a_linear_force() {
    let solution = solved(&FREE.program(), FREE.start());
    // u = 6 − 12 t, at a cost of ∫ u²/2 = 6.
    for (k, u) in solution.at.point.u.iter().enumerate() {
        assert!((u[0] - (6.0 - 12.0 * k as f64 / 40.0)).abs() < 1e-7);
    }
    assert!((solution.values.objective - 6.0).abs() < 1e-9);
    // The multipliers are minus the slopes of the cost: 6 D²/T³ by the distance, −6 D/T² by the last speed.
    let multipliers = &solution.at.multipliers.equalities;
    assert!((multipliers[2] + 12.0).abs() < 1e-6, "{multipliers:?}");
    assert!((multipliers[3] - 6.0).abs() < 1e-6, "{multipliers:?}");
}

#[test]
fn test_limited_force_saturates_at_both_ends() {
    let most: f64 = 4.5;
    let mass = Mass {
        strongest: Some(most),
        ..FREE
    };
    let solution = solved(&mass.clone().program(), mass.start());
    // Saturated but for a linear part of half-width τ in the middle, with most (1/4 − τ²/3) = 1.
    let width = (3.0 * (0.25 - 1.0 / most)).sqrt();
    let cost = most * most * (0.5 - 2.0 / 3.0 * width);
    assert!((solution.values.objective / cost - 1.0).abs() < 1e-4);
    for (k, u) in solution.at.point.u.iter().enumerate() {
        let linear = most * (0.5 - k as f64 / 40.0) / width;
        let error = (u[0] - linear.clamp(-most, most)).abs();
        assert!(error < 0.06, "{k}: {error}");
    }
}

#[test]
fn test_limited_speed_is_held_between_two_parabolas() {
    let most: f64 = 1.2;
    // Up to speed within 3/2 (1 − 1/most) by a force that falls linearly to none.
    let rise = 1.5 * (1.0 - 1.0 / most);
    let cost = 4.0 / 3.0 * most * most / rise;
    let errors = [40, 80].map(|stages| {
        let mass = Mass {
            stages,
            fastest: Some(most),
            ..FREE
        };
        let solution = solved(&mass.clone().program(), mass.start());
        check_linear_algebra(&mass.program(), &solution.at);
        let speeds = solution.at.point.x.iter().map(|x| x[1]);
        assert!(speeds.fold(0.0, f64::max) <= most);
        let on_the_way = |k: usize| {
            let t = (k as f64 / stages as f64).min(1.0 - k as f64 / stages as f64);
            most * (1.0 - (1.0 - t / rise).max(0.0).powi(2))
        };
        for (k, x) in solution.at.point.x.iter().enumerate() {
            assert!((x[1] - on_the_way(k)).abs() < 1e-3);
        }
        // The sum of the limit's multipliers is minus the derivative of the cost by the limit.
        let slope = 4.0 / 3.0 * (2.0 * most / rise - 1.5 / rise.powi(2));
        let sum: f64 = solution.at.multipliers.inequalities.iter().sum();
        assert!((sum + slope).abs() < 1e-5);
        (solution.values.objective - cost).abs()
    });
    // The optimal force is zero where the limit holds, and linear before and after: its corners are at nodes.
    assert!(errors.iter().all(|error| *error < 1e-7), "{errors:?}");
}
