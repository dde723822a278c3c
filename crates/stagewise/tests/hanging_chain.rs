//! A chain of stiff links hangs by its ends, with its weight at the joints, above a floor or over a disc.

mod common;

use common::check::{check_derivatives, check_linear_algebra};
use common::transcribed::{Number, Problem, Trajectory, Transcribed};
use common::{root, solved};
use nalgebra::SVector;
use stagewise::{Layout, Solution};

/// The obstacle that joints must not enter.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Obstacle {
    Nothing,
    /// Joints stay above a height.
    Floor(f64),
    /// Joints stay outside of a disc, given by centre and radius.
    Disc([f64; 2], f64),
}

/// A chain of length 1. The control of a node is the angle of the link after it; the last node has none.
#[derive(Debug, Clone)]
struct Hanging {
    links: usize,
    ends: [[f64; 2]; 2],
    obstacle: Obstacle,
}

type Shape = Trajectory<2, 1>;

impl Hanging {
    fn program(&self) -> Transcribed<Self> {
        Transcribed {
            problem: self.clone(),
        }
    }

    fn link(&self) -> f64 {
        1.0 / self.links as f64
    }

    /// A weight of 1 in all.
    fn weight(&self) -> f64 {
        1.0 / (self.links - 1) as f64
    }

    /// Down, or up, at an angle within some links of the ends, and flat between these.
    fn start(&self, angle: f64, links: usize) -> Shape {
        let angle = |k: usize| match k {
            k if k < links => angle,
            k if k + links >= self.links => -angle,
            _ => 0.0,
        };
        Trajectory::new(self.ends[0], (0..=self.links).map(|k| [angle(k)]))
    }
}

impl Problem<2, 1, 3> for Hanging {
    fn layout(&self) -> Layout {
        let mut layout = Layout::new(vec![self.link(); self.links])
            .with_equalities_at(0, 2)
            .with_equalities_at(self.links, 2);
        if self.obstacle != Obstacle::Nothing {
            for joint in 1..self.links {
                layout = layout.with_inequalities_at(joint, 1, self.link());
            }
        }
        layout
    }

    fn free(&self, node: usize) -> [bool; 1] {
        [node < self.links]
    }

    fn carry<D: Number>(&self, _: usize, [x, y]: [D; 2], [[angle], _]: [[D; 1]; 2]) -> [D; 2] {
        let link = self.link();
        [x + angle.cos() * link, y + angle.sin() * link]
    }

    fn cost<D: Number>(&self, stage: usize, [_, y]: [D; 2], _: [[D; 1]; 2]) -> D {
        let carries = f64::from(u8::from(stage > 0));
        y * (carries * self.weight())
    }

    fn equalities_at<D: Number>(&self, block: usize, [x, y]: [D; 2], _: [D; 1]) -> Vec<D> {
        let end = self.ends[block];
        vec![x - end[0], y - end[1]]
    }

    fn slacks_at<D: Number>(&self, _: usize, [x, y]: [D; 2], _: [D; 1]) -> Vec<D> {
        match self.obstacle {
            Obstacle::Nothing => Vec::new(),
            Obstacle::Floor(height) => vec![y - height],
            Obstacle::Disc(centre, radius) => {
                let [x, y] = [x - centre[0], y - centre[1]];
                vec![(x * x + y * y).sqrt() - radius]
            }
        }
    }
}

/// Angles of the links of a chain that hangs free: the horizontal tension is the same in all, the vertical one grows by the
/// weight of a joint.
fn free_angles(links: usize, weight: f64, [horizontal, vertical]: [f64; 2]) -> Vec<f64> {
    let lift = |k: usize| vertical + k as f64 * weight;
    (0..links).map(|k| (lift(k) / horizontal).atan()).collect()
}

/// Place of the end of links of these angles.
fn end(angles: &[f64], link: f64) -> [f64; 2] {
    let sum = |of: fn(f64) -> f64| link * angles.iter().map(|angle| of(*angle)).sum::<f64>();
    [sum(f64::cos), sum(f64::sin)]
}

/// Forces of the joints on the chain, their weight and those of the obstacle, must leave every link in a tension along it.
#[track_caller]
fn check_balance(chain: &Hanging, solution: &Solution<Shape>) {
    let Shape { x, u } = &solution.at.point;
    let multipliers = &solution.at.multipliers;
    // A support holds against what its multipliers pull.
    let pull =
        |row: usize| SVector::from([multipliers.equalities[row], multipliers.equalities[row + 1]]);
    let mut tension: SVector<f64, 2> = pull(0);
    for k in 0..chain.links {
        if k > 0 {
            tension += SVector::from([0.0, chain.weight()]);
            let push = multipliers.inequalities.get(k - 1).copied().unwrap_or(0.0);
            tension -= match chain.obstacle {
                Obstacle::Nothing => SVector::zeros(),
                Obstacle::Floor(_) => SVector::from([0.0, push]),
                Obstacle::Disc(centre, radius) => (x[k] - SVector::from(centre)) * push / radius,
            };
        }
        let (sine, cosine) = u[k][0].sin_cos();
        let across = tension[1] * cosine - tension[0] * sine;
        assert!(across.abs() < 1e-7, "link {k}: {across} across it");
        assert!(tension[0] * cosine + tension[1] * sine > 0.0);
    }
    let left = tension + pull(2);
    assert!(left.norm() < 1e-7, "{left:?} at the last end");
    let slacks = solution.values.slacks.iter();
    for (slack, push) in slacks.zip(&multipliers.inequalities) {
        assert!(*slack > 0.0 && *push > 0.0 && slack * push < 1e-9);
    }
}

#[test]
fn test_derivatives_of_the_chain_are_exact() {
    for obstacle in [
        Obstacle::Nothing,
        Obstacle::Floor(-2.0),
        Obstacle::Disc([0.3, -0.4], 0.1),
    ] {
        let chain = Hanging {
            links: 6,
            ends: [[0.0, 0.1], [0.7, 0.2]],
            obstacle,
        };
        check_derivatives(&chain.program(), &chain.start(0.3, 2));
    }
}

#[test]
fn test_free_chain_hangs_in_the_discrete_catenary() {
    let chain = Hanging {
        links: 30,
        ends: [[0.0, 0.0], [0.6, 0.2]],
        obstacle: Obstacle::Nothing,
    };
    let solution = solved(&chain.program(), chain.start(-0.8, 15));
    let angles = |tension: &SVector<f64, 2>| {
        free_angles(chain.links, chain.weight(), [tension[0], tension[1]])
    };
    let tension = root([0.3, -0.5], |tension| {
        let [x, y] = end(&angles(tension), chain.link());
        SVector::from([x - 0.6, y - 0.2])
    })
    .expect("a catenary");
    for (angle, u) in angles(&tension).iter().zip(&solution.at.point.u) {
        assert!((angle - u[0]).abs() < 1e-7);
    }
    let multipliers = &solution.at.multipliers.equalities;
    assert!((multipliers[0] - tension[0]).abs() < 1e-7);
    assert!((multipliers[1] - tension[1]).abs() < 1e-7);
    check_balance(&chain, &solution);
}

#[test]
fn test_chain_rests_on_the_floor_where_it_touches() {
    let (links, span, floor) = (40, 0.8, -0.2);
    let chain = Hanging {
        links,
        ends: [[0.0, 0.0], [span, 0.0]],
        obstacle: Obstacle::Floor(floor),
    };
    let solution = solved(&chain.program(), chain.start(-1.0, 9));
    check_balance(&chain, &solution);
    // Both sides hang free down to a joint on the floor; between these the links lie flat. Which joint it is shows by its
    // push.
    let (link, weight) = (chain.link(), chain.weight());
    let hanging = |hung: usize| {
        let angles =
            |tension: &SVector<f64, 2>| free_angles(hung, weight, [tension[0], tension[1]]);
        let flat = (links / 2 - hung) as f64 * link;
        let tension = root([0.1, -0.2], |tension| {
            let [x, y] = end(&angles(tension), link);
            SVector::from([x + flat - 0.5 * span, y - floor])
        })?;
        Some((
            angles(&tension),
            weight + tension[1] + (hung - 1) as f64 * weight,
        ))
    };
    let found = (6..links / 2).find_map(|hung| {
        let (angles, push) = hanging(hung)?;
        (0.0..=weight)
            .contains(&push)
            .then_some((hung, angles, push))
    });
    let (hung, angles, push) = found.expect("a joint where the chain comes to lie");
    for (k, u) in solution.at.point.u[..links / 2].iter().enumerate() {
        let expected = angles.get(k).copied().unwrap_or(0.0);
        assert!(
            (u[0] - expected).abs() < 1e-5,
            "link {k}: {u} for {expected}"
        );
    }
    let pushes = &solution.at.multipliers.inequalities;
    for (joint, own) in (1..links).zip(pushes) {
        let from_end = joint.min(links - joint);
        let expected = match from_end.cmp(&hung) {
            std::cmp::Ordering::Less => 0.0,
            std::cmp::Ordering::Equal => push,
            std::cmp::Ordering::Greater => weight,
        };
        assert!(
            (own - expected).abs() < 1e-5,
            "joint {joint}: {own} for {expected}"
        );
    }
    // Floor and supports bear the weight.
    let supports = &solution.at.multipliers.equalities;
    let borne = pushes.iter().sum::<f64>() - supports[1] - supports[3];
    assert!((borne - 1.0).abs() < 1e-8);
}

#[test]
fn test_chain_over_a_disc_is_pushed_square_to_it() {
    let chain = Hanging {
        links: 30,
        ends: [[-0.3, -0.1], [0.35, 0.0]],
        obstacle: Obstacle::Disc([0.0, -0.1], 0.2),
    };
    let solution = solved(&chain.program(), chain.start(0.86, 15));
    check_balance(&chain, &solution);
    let pushes = &solution.at.multipliers.inequalities;
    let touching = pushes.iter().filter(|push| **push > 1e-4).count();
    assert!(touching >= 3, "{pushes:?}");
    check_linear_algebra(&chain.program(), &solution.at);
    // The derivative of the energy by the radius is the sum of the contact forces.
    let energy = |radius: f64| {
        let other = Hanging {
            obstacle: Obstacle::Disc([0.0, -0.1], radius),
            ..chain.clone()
        };
        solved(&other.program(), other.start(0.86, 15))
            .values
            .objective
    };
    let slope = (energy(0.2001) - energy(0.1999)) / 2e-4;
    assert!(
        (slope - pushes.iter().sum::<f64>()).abs() < 1e-3 * slope,
        "{slope}"
    );
}
