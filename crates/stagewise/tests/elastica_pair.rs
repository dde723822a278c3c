//! The planar elastica with a constraint between two of its nodes that couples the second derivatives of both: nodes that
//! stay apart, nodes at a fixed distance, a closed ring. Optima of another solver, of a halved rod, of elliptic integrals.

mod common;

use common::check::{check_derivatives, check_linear_algebra};
use common::transcribed::{Number, Problem, Trajectory, Transcribed};
use common::{SETTINGS, go_on, solved};
use nalgebra::{SMatrix, SVector};
use stagewise::{Layout, Outcome, Response, minimise};
use std::f64::consts::{PI, TAU};

/// A rod of stiffness 1 whose curvature is linear between nodes; half the square of curvature is least.
#[derive(Debug, Clone)]
struct Elastica {
    stages: usize,
    length: f64,
    /// Place and angle of the first node.
    first: [f64; 3],
    /// Place and angle of the last node, as far as they are held.
    last: [Option<f64>; 3],
    pair: Pair,
    /// A node, and the upper bound of its x.
    wall: Option<(usize, f64)>,
    /// Whether the solver is given the second derivatives of the distance.
    gives_pair_hessians: bool,
}

/// The constraint between two nodes.
#[derive(Debug, Clone, PartialEq)]
enum Pair {
    None,
    /// Their distance is at least a length.
    Apart([usize; 2], f64),
    /// Their distance is a length.
    Rigid([usize; 2], f64),
    /// The last node is where the first is, turned by an angle.
    Closed(f64),
}

type Rod = Trajectory<3, 1>;

impl Elastica {
    fn new(stages: usize, last: [Option<f64>; 3], pair: Pair) -> Self {
        Self {
            stages,
            length: 1.0,
            first: [0.0; 3],
            last,
            pair,
            wall: None,
            gives_pair_hessians: true,
        }
    }

    fn program(&self) -> Transcribed<Self> {
        Transcribed {
            problem: self.clone(),
        }
    }

    /// With curvatures by the share of the length.
    fn bent(&self, curvature: impl Fn(f64) -> f64) -> Rod {
        let nodes = (0..=self.stages).map(|k| [curvature(k as f64 / self.stages as f64)]);
        Trajectory::new(self.first, nodes)
    }

    /// Bent like a clamped rod that has buckled.
    fn buckled(&self, by: f64) -> Rod {
        self.bent(|u| by * (TAU * u).cos())
    }

    fn step(&self) -> f64 {
        self.length / self.stages as f64
    }
}

impl Problem<3, 1, 4> for Elastica {
    fn layout(&self) -> Layout {
        let weights = vec![1.0 / self.stages as f64; self.stages];
        let held = self.last.iter().flatten().count();
        let mut layout = Layout::new(weights)
            .with_equalities_at(0, 3)
            .with_equalities_at(self.stages, held);
        if let Some((node, _)) = self.wall {
            layout = layout.with_inequalities_at(node, 1, 1.0);
        }
        match self.pair {
            Pair::None => layout,
            Pair::Apart(nodes, _) => layout.with_inequalities_between(nodes, 1, 1.0),
            Pair::Rigid(nodes, _) => layout.with_equalities_between(nodes, 1),
            Pair::Closed(_) => layout.with_equalities_between([0, self.stages], 3),
        }
    }

    fn carry<D: Number>(&self, _: usize, [x, y, angle]: [D; 3], u: [[D; 1]; 2]) -> [D; 3] {
        let h = self.step();
        let [[first], [second]] = u;
        let middle = angle + (first * 3.0 + second) * (h / 8.0);
        let end = angle + (first + second) * (h / 2.0);
        [x + middle.cos() * h, y + middle.sin() * h, end]
    }

    fn cost<D: Number>(&self, _: usize, _: [D; 3], [[first], [second]]: [[D; 1]; 2]) -> D {
        let square = first * first + first * second + second * second;
        square * (self.step() / 6.0)
    }

    fn equalities_at<D: Number>(&self, block: usize, x: [D; 3], _: [D; 1]) -> Vec<D> {
        if block == 0 {
            return (0..3).map(|i| x[i] - self.first[i]).collect();
        }
        let held = self.last.iter().zip(x);
        held.filter_map(|(held, x)| held.map(|held| x - held))
            .collect()
    }

    fn equalities_between<D: Number>(&self, _: usize, [a, b]: [[D; 3]; 2]) -> Vec<D> {
        match self.pair {
            Pair::Closed(turn) => {
                let by = [0.0, 0.0, turn];
                (0..3).map(|i| b[i] - a[i] - by[i]).collect()
            }
            Pair::Rigid(_, length) => vec![distance(a, b) - length],
            Pair::None | Pair::Apart(..) => Vec::new(),
        }
    }

    fn slacks_at<D: Number>(&self, _: usize, x: [D; 3], _: [D; 1]) -> Vec<D> {
        let wall = self.wall.iter();
        wall.map(|(_, most)| -x[0] + *most).collect()
    }

    fn slacks_between<D: Number>(&self, _: usize, [a, b]: [[D; 3]; 2]) -> Vec<D> {
        match self.pair {
            Pair::Apart(_, least) => vec![distance(a, b) - least],
            _ => Vec::new(),
        }
    }

    fn metric(&self, node: usize) -> SMatrix<f64, 3, 3> {
        let share = self.layout().node_weights()[node];
        SMatrix::from_diagonal(&SVector::from([share, share, 0.1 * share]))
    }

    fn gives_pair_hessians(&self) -> bool {
        self.gives_pair_hessians
    }
}

/// Distance of two nodes.
fn distance<D: Number>(a: [D; 3], b: [D; 3]) -> D {
    let [x, y] = [b[0] - a[0], b[1] - a[1]];
    (x * x + y * y).sqrt()
}

/// Ends that are clamped aslant to each other, so that no symmetry helps.
const ASLANT: [Option<f64>; 3] = [Some(0.2), Some(0.1), Some(0.3)];

#[test]
fn test_derivatives_agree_with_finite_differences() {
    for pair in [
        Pair::Apart([2, 5], 0.1),
        Pair::Rigid([1, 6], 0.1),
        Pair::Closed(0.3),
    ] {
        let mut rod = Elastica::new(7, [Some(0.6), None, Some(0.0)], pair);
        rod.wall = Some((3, 5.0));
        check_derivatives(&rod.program(), &rod.bent(|u| 4.0 - 7.0 * u));
    }
}

#[test]
fn test_two_nodes_that_stay_apart_do_so_at_the_energy_of_another_solver() {
    // Energy and contact force: IPOPT 3.14 (CasADi 3.8, tolerance 1e-12, bounds not relaxed) on the same discretisation.
    let symmetric = [Some(0.2), Some(0.0), Some(0.0)];
    let cases = [
        (symmetric, [2, 14], 0.1, 45.117_852_352_860, 133.168_610_306),
        (ASLANT, [2, 13], 0.2, 47.564_157_747_495, 106.254_197_224),
    ];
    for (last, nodes, least, energy, force) in cases {
        let rod = Elastica::new(16, last, Pair::Apart(nodes, least));
        let found = solved(&rod.program(), rod.buckled(6.0));
        let objective = found.values.objective;
        assert!((objective / energy - 1.0).abs() < 1e-8, "{objective}");
        let contact = found.at.multipliers.inequalities[0];
        assert!((contact / force - 1.0).abs() < 1e-6, "{contact}");
        check_linear_algebra(&rod.program(), &found.at);
    }
}

#[test]
fn test_two_nodes_at_a_fixed_distance_are_pulled_or_pushed_to_the_energy_of_another_solver() {
    // Energy and force between the nodes, both from IPOPT as above.
    let cases = [
        (0.25, 49.818_516_391_179, -135.292_641_436),
        (0.05, 51.103_373_340_895, 123.364_583_643),
    ];
    for (length, energy, force) in cases {
        let rod = Elastica::new(16, ASLANT, Pair::Rigid([4, 11], length));
        let found = solved(&rod.program(), rod.buckled(5.0));
        let objective = found.values.objective;
        assert!((objective / energy - 1.0).abs() < 1e-9, "{objective}");
        let pull = found.at.multipliers.equalities[6];
        assert!((pull / force - 1.0).abs() < 1e-7, "{pull}");
        check_linear_algebra(&rod.program(), &found.at);
    }
}

#[test]
fn test_symmetric_contact_is_that_of_half_a_rod_against_a_wall() {
    let (nodes, least) = (16, 0.1);
    let whole = Elastica::new(
        nodes,
        [Some(0.2), Some(0.0), Some(0.0)],
        Pair::Apart([2, 14], least),
    );
    let found = solved(&whole.program(), whole.buckled(6.0));
    // From the start to the middle, which slides along the line of symmetry.
    let half = Elastica {
        length: 0.5,
        wall: Some((2, 0.1 - 0.5 * least)),
        ..Elastica::new(nodes / 2, [Some(0.1), None, Some(0.0)], Pair::None)
    };
    let halved = solved(&half.program(), half.bent(|u| 20.0 * (PI * u).cos()));
    let (energy, twice) = (found.values.objective, 2.0 * halved.values.objective);
    assert!((energy / twice - 1.0).abs() < 1e-7, "{energy} {twice}");
    let forces = [&found, &halved].map(|found| found.at.multipliers.inequalities[0]);
    assert!((forces[0] / forces[1] - 1.0).abs() < 1e-5, "{forces:?}");
}

#[test]
fn test_response_with_a_fixed_distance_is_the_difference_of_two_solutions() {
    let rod = |length: f64| Elastica::new(16, ASLANT, Pair::Rigid([4, 11], length));
    let mut here = solved(&rod(0.25).program(), rod(0.25).buckled(5.0)).at;
    let [less, more] =
        [0.2499, 0.2501].map(|length| solved(&rod(length).program(), here.point.clone()).at);
    let mut response = Response::of_minimum(&rod(0.25).program(), &mut here).unwrap();
    let mut right = response.zero();
    right.equalities[6] = -1.0;
    let answer = response.solve(&right).unwrap();
    for k in 0..=16 {
        let difference = (more.point.u[k][0] - less.point.u[k][0]) / 2e-4;
        let error = (answer.nodes[k][3] - difference).abs();
        assert!(error < 1e-4 * difference.abs().max(1.0), "{k} {error}");
    }
}

#[test]
fn test_a_distance_without_its_second_derivative_converges_to_the_same_optimum_but_more_slowly() {
    for pair in [Pair::Apart([2, 13], 0.2), Pair::Rigid([4, 11], 0.25)] {
        let given = Elastica::new(16, ASLANT, pair);
        let missing = Elastica {
            gives_pair_hessians: false,
            ..given.clone()
        };
        let [given, missing] = [given, missing]
            .map(|rod| minimise(&rod.program(), &SETTINGS, rod.buckled(5.0), &mut go_on));
        assert_eq!(given.outcome, Outcome::Converged);
        assert_eq!(missing.outcome, Outcome::Converged);
        let energies = [&given, &missing].map(|found| found.values.objective);
        assert!((energies[0] / energies[1] - 1.0).abs() < 1e-8);
        assert!(3 * given.iterations < 2 * missing.iterations);
    }
}

#[test]
fn test_closed_rod_is_a_circle_or_a_figure_of_eight() {
    // A full turn: the circle of circumference 1. No turn: Euler's figure of eight, whose parameter solves 2 E = K.
    let [k, e] = elliptic(0.826_114_8);
    let eight = 32.0 * k * (e - (1.0 - 0.826_114_8) * k);
    for (turn, energy, tolerance) in [(TAU, 2.0 * PI * PI, 1e-9), (0.0, eight, 1e-5)] {
        let rod = Elastica::new(64, [None; 3], Pair::Closed(turn));
        let start = match turn {
            0.0 => rod.bent(|u| 12.0 * (TAU * u).sin()),
            _ => rod.bent(|u| 5.0 + (TAU * u).sin()),
        };
        let found = minimise(&rod.program(), &SETTINGS, start, &mut go_on);
        assert_eq!(found.outcome, Outcome::Converged);
        let objective = found.values.objective;
        assert!((objective / energy - 1.0).abs() < tolerance, "{objective}");
    }
}

/// Complete elliptic integrals K and E of a parameter, by the arithmetic-geometric mean.
fn elliptic(parameter: f64) -> [f64; 2] {
    let (mut a, mut g, mut c) = (1.0_f64, (1.0 - parameter).sqrt(), parameter.sqrt());
    let (mut sum, mut power) = (0.5 * c * c, 0.5);
    while c.abs() > 1e-16 {
        (a, g, c) = (0.5 * (a + g), (a * g).sqrt(), 0.5 * (a - g));
        power *= 2.0;
        sum += power * c * c;
    }
    let first = std::f64::consts::FRAC_PI_2 / a;
    [first, first * (1.0 - sum)]
}
