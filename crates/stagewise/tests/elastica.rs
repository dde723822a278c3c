//! The planar elastica: an inextensible rod whose controls are curvatures, against elliptic integrals and Euler's loads.
//!
//! A step of a node's state is a twist about the origin, so that twists of stages that follow each other add up.

mod common;

use common::check::{check_derivatives, check_linear_algebra};
use nalgebra::{Matrix2x3, SMatrix, Vector2, Vector3};
use num_dual::{DualNum, HyperDual64};
use stagewise::{
    Continuation, Distance, End, Events, Family, FollowSettings, Follower, Layout, Linearisation,
    Multipliers, NodeVector, Outcome, Pace, Program, Response, Settings, Solution, Stationary,
    Turn, Values, lowest_modes, minimise,
};
use std::f64::consts::PI;
use std::ops::ControlFlow;

const STAGES: usize = 64;
const STEP: f64 = 1.0 / STAGES as f64;

#[derive(Debug, Clone)]
struct Rod {
    /// Where the end is clamped, with its tangent along that of the start; a free end otherwise.
    end: Option<Vector2<f64>>,
    /// Dead force that pushes the end back along the start's tangent.
    load: f64,
}

#[derive(Debug, Clone, PartialEq)]
struct Shape {
    /// Position and angle of every node.
    pose: Vec<Vector3<f64>>,
    curvature: Vec<f64>,
}

impl Distance for Shape {
    fn copy_from(&mut self, other: &Self) {
        self.pose.copy_from_slice(&other.pose);
        self.curvature.copy_from_slice(&other.curvature);
    }

    fn distance(&self, other: &Self) -> f64 {
        let nodes = self.pose.iter().zip(&other.pose);
        nodes.map(|(a, b)| (a - b).xy().norm()).fold(0.0, f64::max)
    }
}

/// Where a node is led to by a stage of constant curvature.
fn led<T: DualNum<Primitive = f64> + Copy>(from: &Vector3<f64>, curvature: T) -> [T; 3] {
    let turn = curvature * STEP;
    let square = turn * turn;
    // sin φ/φ and (1 − cos φ)/φ by their series: a stage turns by little.
    let sine =
        -(square * (-(square * (1.0 / 42.0)) + 1.0) * (1.0 / 20.0) - 1.0) * square * (1.0 / 6.0);
    let along = (-sine + 1.0) * STEP;
    let aside =
        turn * (-(square * (-(square * (1.0 / 30.0)) + 1.0) * (1.0 / 12.0)) + 1.0) * (0.5 * STEP);
    let (sin, cos) = from.z.sin_cos();
    [
        along * cos - aside * sin + from.x,
        along * sin + aside * cos + from.y,
        turn + from.z,
    ]
}

/// The twist of a node from where it is to where a curvature leads it, to second order.
fn twist<T: DualNum<Primitive = f64> + Copy>(
    from: &Vector3<f64>,
    at: &Vector3<f64>,
    curvature: T,
) -> [T; 3] {
    let [x, y, angle] = led(from, curvature);
    let turn = angle - at.z;
    let half = turn * turn * 0.5;
    let shift = [
        x - at.x + turn * at.y + half * at.x,
        y - at.y - turn * at.x + half * at.y,
    ];
    [
        shift[0] + turn * shift[1] * 0.5,
        shift[1] - turn * shift[0] * 0.5,
        turn,
    ]
}

impl Rod {
    fn mean(shape: &Shape, stage: usize) -> f64 {
        0.5 * (shape.curvature[stage] + shape.curvature[stage + 1])
    }

    /// The force on a node.
    fn force(&self, node: usize, multipliers: &[f64]) -> Vector2<f64> {
        let mut force = Vector2::zeros();
        if node == 0 {
            force += Vector2::new(multipliers[0], multipliers[1]);
        }
        if node == STAGES {
            force.x += self.load;
            if self.end.is_some() {
                force += Vector2::new(multipliers[3], multipliers[4]);
            }
        }
        force
    }

    /// Force, and moment about the origin.
    fn wrench(&self, shape: &Shape, node: usize, multipliers: &[f64]) -> Vector3<f64> {
        let (force, pose) = (self.force(node, multipliers), &shape.pose[node]);
        let held = match (node, self.end) {
            (0, _) => multipliers[2],
            (STAGES, Some(_)) => multipliers[5],
            _ => 0.0,
        };
        Vector3::new(force.x, force.y, pose.x * force.y - pose.y * force.x + held)
    }
}

impl Program<3, 1, 4> for Rod {
    type Point = Shape;

    fn layout(&self) -> Layout {
        let layout = Layout::new(vec![STEP; STAGES]).with_equalities_at(0, 3);
        // A free end bears its load's second derivative at a block without rows.
        layout.with_equalities_at(STAGES, if self.end.is_some() { 3 } else { 0 })
    }

    fn evaluate(&self, shape: &mut Shape, values: &mut Values) -> bool {
        values.objective = 0.0;
        for k in 0..STAGES {
            let [a, b] = [shape.curvature[k], shape.curvature[k + 1]];
            values.objective += STEP / 6.0 * (a * a + a * b + b * b);
            shape.pose[k + 1] = Vector3::from(led(&shape.pose[k], Self::mean(shape, k)));
        }
        let (first, last) = (shape.pose[0], shape.pose[STAGES]);
        values.objective += self.load * last.x;
        values.equalities = first.as_slice().to_vec();
        if let Some(end) = self.end {
            values
                .equalities
                .extend([last.x - end.x, last.y - end.y, last.z]);
        }
        true
    }

    fn equality_gradients(&self, shape: &Shape, into: &mut [NodeVector<4>]) {
        for (i, rows) in into.chunks_exact_mut(3).enumerate() {
            let pose = &shape.pose[i * STAGES];
            rows[0] = NodeVector::from([1.0, 0.0, -pose.y, 0.0]);
            rows[1] = NodeVector::from([0.0, 1.0, pose.x, 0.0]);
            rows[2] = NodeVector::from([0.0, 0.0, 1.0, 0.0]);
        }
    }

    fn linearise(
        &self,
        shape: &Shape,
        multipliers: &Multipliers,
        into: &mut Linearisation<3, 1, 4>,
    ) {
        let rows = &multipliers.equalities;
        into.gradient.fill(NodeVector::zeros());
        let mut beyond = Vector3::zeros();
        for k in (0..STAGES).rev() {
            beyond += self.wrench(shape, k + 1, rows);
            let mut curvature = HyperDual64::from(Self::mean(shape, k));
            (curvature.eps1, curvature.eps2) = (1.0, 1.0);
            let moved = twist(&shape.pose[k], &shape.pose[k + 1], curvature);
            let growth = Vector3::from(moved.map(|entry| entry.eps1));
            let bent: f64 = (0..3).map(|i| beyond[i] * moved[i].eps1eps2).sum();
            let mixed = 0.5
                * Vector3::new(
                    -growth.z * beyond.y,
                    growth.z * beyond.x,
                    growth.x * beyond.y - growth.y * beyond.x,
                );
            let stage = &mut into.chain.stages[k];
            for i in 0..3 {
                stage.growth_by_first[(i, 0)] = 0.5 * growth[i];
                stage.growth_by_second[(i, 0)] = 0.5 * growth[i];
                stage.state_first[(i, 0)] = 0.5 * mixed[i];
                stage.state_second[(i, 0)] = 0.5 * mixed[i];
            }
            let controls = &mut into.diagonal.controls[k];
            controls.first[(0, 0)] = STEP / 3.0 + 0.25 * bent;
            controls.mixed[(0, 0)] = STEP / 6.0 + 0.25 * bent;
            controls.second[(0, 0)] = STEP / 3.0 + 0.25 * bent;
            let [a, b] = [shape.curvature[k], shape.curvature[k + 1]];
            let work = 0.5 * beyond.dot(&growth);
            into.gradient[k][3] += STEP / 6.0 * (2.0 * a + b) + work;
            into.gradient[k + 1][3] += STEP / 6.0 * (a + 2.0 * b) + work;
        }
        let all = beyond + self.wrench(shape, 0, rows);
        into.gradient[0].fixed_rows_mut::<3>(0).copy_from(&all);
        self.equality_gradients(shape, &mut into.equalities_at);
        for (block, node) in [0, STAGES].into_iter().enumerate() {
            let (force, pose) = (self.force(node, rows), &shape.pose[node]);
            let hessian = into.equality_hessian(block);
            hessian.fill(0.0);
            hessian[(2, 2)] = -(force.x * pose.x + force.y * pose.y);
            (hessian[(0, 2)], hessian[(2, 0)]) = (0.5 * force.y, 0.5 * force.y);
            (hessian[(1, 2)], hessian[(2, 1)]) = (-0.5 * force.x, -0.5 * force.x);
        }
    }

    fn retract(&self, shape: &Shape, step: &[NodeVector<4>], length: f64, into: &mut Shape) {
        // The exponential of the twist: along a circle.
        let [vx, vy, turn] = [0, 1, 2].map(|i| length * step[0][i]);
        let (from, (sin, cos)) = (&shape.pose[0], turn.sin_cos());
        let (along, aside) = match turn.abs() < 1e-6 {
            true => (1.0, 0.5 * turn),
            false => (sin / turn, (1.0 - cos) / turn),
        };
        into.pose[0] = Vector3::new(
            cos * from.x - sin * from.y + along * vx - aside * vy,
            sin * from.x + cos * from.y + aside * vx + along * vy,
            from.z + turn,
        );
        for (k, change) in step.iter().enumerate() {
            into.curvature[k] = shape.curvature[k] + length * change[3];
        }
    }

    fn metric(&self, shape: &Shape) -> Vec<SMatrix<f64, 3, 3>> {
        let of_node = |pose: &Vector3<f64>| {
            let moved = Matrix2x3::new(1.0, 0.0, -pose.y, 0.0, 1.0, pose.x);
            STEP * moved.tr_mul(&moved)
        };
        shape.pose.iter().map(of_node).collect()
    }
}

fn arch(height: f64) -> Shape {
    Shape {
        pose: vec![Vector3::zeros(); STAGES + 1],
        curvature: (0..=STAGES)
            .map(|k| height * (2.0 * PI * k as f64 * STEP).cos())
            .collect(),
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

/// From an arch of about the height that the distance of the ends leaves.
fn solved(rod: &Rod) -> Solution<Shape> {
    let distance = rod.end.map_or(1.0, |end| end.norm());
    let start = arch(4.0 * PI * (1.0 - distance).sqrt());
    minimise(rod, &settings(), start, &mut || ControlFlow::Continue(()))
}

fn clamped(distance: f64) -> Rod {
    Rod {
        end: Some(Vector2::new(distance, 0.0)),
        load: 0.0,
    }
}

/// Complete elliptic integrals K and E of a modulus, by the arithmetic–geometric mean.
fn elliptic(modulus: f64) -> (f64, f64) {
    let (mut a, mut b) = (1.0, (1.0 - modulus * modulus).sqrt());
    let (mut sum, mut power) = (0.5 * modulus * modulus, 1.0);
    for _ in 0..12 {
        let c = 0.5 * (a - b);
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
        sum += power * c * c;
        power *= 2.0;
    }
    let k = PI / (2.0 * a);
    (k, k * (1.0 - sum))
}

/// Energy of the arch between clamps at a distance: four quarter waves of θ = 2 asin(k sn).
fn energy_of(distance: f64) -> f64 {
    let (mut low, mut high) = (1e-9, 1.0 - 1e-9);
    for _ in 0..200 {
        let modulus = 0.5 * (low + high);
        let (k, e) = elliptic(modulus);
        if 2.0 * e / k - 1.0 > distance {
            low = modulus;
        } else {
            high = modulus;
        }
    }
    let modulus = 0.5 * (low + high);
    let (k, e) = elliptic(modulus);
    32.0 * k * (e - (1.0 - modulus * modulus) * k)
}

#[test]
fn test_arch_between_clamps_has_the_energy_of_elliptic_integrals() {
    for distance in [0.9, 0.6, 0.3] {
        let found = solved(&clamped(distance));
        assert_eq!(found.outcome, Outcome::Converged, "{distance}");
        let (energy, exact) = (found.values.objective, energy_of(distance));
        assert!(
            (energy / exact - 1.0).abs() < 3e-3,
            "{distance} {energy} {exact}"
        );
        check_linear_algebra(&clamped(distance), &found.at);
        let inertia = found.inertia.unwrap();
        assert_eq!((inertia.negative, inertia.zero), (0, 0));
    }
}

#[test]
fn test_derivatives_agree_with_finite_differences() {
    let rod = Rod {
        load: 3.0,
        ..clamped(0.6)
    };
    let mut at = arch(4.0);
    at.pose[0] = Vector3::new(0.2, -0.1, 0.3);
    check_derivatives(&rod, &at);
}

#[test]
fn test_response_to_a_moved_end_is_the_difference_of_two_solutions() {
    let [less, more] = [-1e-4, 1e-4].map(|by| solved(&clamped(0.6 + by)));
    let mut here = solved(&clamped(0.6));
    let mut response = Response::of_minimum(&clamped(0.6), &mut here.at).unwrap();
    let mut right = response.zero();
    right.equalities[3] = -1.0;
    let answer = response.solve(&right).unwrap();
    for k in (0..=STAGES).step_by(8) {
        let [a, b] = [&less, &more].map(|found| found.at.point.curvature[k]);
        let difference = (b - a) / 2e-4;
        assert!((answer.nodes[k][3] - difference).abs() < 1e-3 * difference.abs().max(1.0));
    }
}

#[test]
fn test_follower_arrives_where_a_solve_does() {
    let start = solved(&clamped(0.6));
    let settings = FollowSettings {
        tolerance: 1e-9,
        smallest_jump: 1e-3,
        jumps: true,
    };
    let mut follower = Follower::new(clamped(0.6), settings, &start.at).unwrap();
    let mut change = |rod: &mut Rod, share: f64| {
        rod.end = Some(Vector2::new(0.6 - 0.2 * share, 0.1 * share));
    };
    let followed = follower.follow(0.25, &mut change, &mut || ControlFlow::Continue(()));
    assert!(followed.arrived && followed.jump == 0.0);
    let rod = Rod {
        end: Some(Vector2::new(0.4, 0.1)),
        load: 0.0,
    };
    let cold = solved(&rod);
    assert!((follower.values().objective - cold.values.objective).abs() < 1e-9);
}

/// A column that is clamped at the start and pushed at its free end, by the push.
struct Column;

impl Family<3, 1, 4> for Column {
    type Point = Shape;
    type Program = Rod;

    fn at(&self, load: f64) -> Option<Rod> {
        Some(Rod { end: None, load })
    }
}

#[test]
fn test_column_loses_its_stability_at_eulers_loads() {
    let straight = Stationary {
        point: {
            let mut straight = arch(0.0);
            Rod {
                end: None,
                load: 0.0,
            }
            .evaluate(&mut straight, &mut Values::default());
            straight
        },
        multipliers: Multipliers {
            equalities: vec![0.0; 3],
            inequalities: Vec::new(),
        },
    };
    let pace = Pace {
        longest: 0.5,
        stations: 500,
        events: Events::Find,
    };
    let continuation = Continuation::new(&Column, 1e-9, [0.0, 30.0], pace);
    let start = continuation.start(&straight, 0.0, true).unwrap();
    let curve = continuation.trace(start, &mut |_| ControlFlow::<()>::Continue(()));
    assert_eq!(curve.end, End::Range);
    let loads: Vec<f64> = curve
        .events
        .iter()
        .map(|(_, event)| event.parameter)
        .collect();
    assert_eq!(loads.len(), 2, "{loads:?}");
    for (load, quarter) in loads.iter().zip([1.0, 3.0]) {
        let exact = (0.5 * PI * quarter).powi(2);
        assert!((load / exact - 1.0).abs() < 3e-3, "{load} {exact}");
    }
    assert!(
        curve
            .events
            .iter()
            .all(|(_, event)| event.turn == Turn::Bifurcation)
    );
    let last = curve.stations.last().unwrap();
    assert_eq!(last.negative, 2);
    let rod = Rod {
        end: None,
        load: 30.0,
    };
    let modes = lowest_modes(&rod, &mut last.at.clone(), 3).unwrap();
    assert!(modes[1].eigenvalue < 0.0 && modes[2].eigenvalue > 0.0);
}

#[test]
fn test_a_curve_ends_for_the_callers_own_reason() {
    #[derive(Debug, PartialEq)]
    struct Enough(usize);
    let found = solved(&clamped(0.6));
    struct Moved;
    impl Family<3, 1, 4> for Moved {
        type Point = Shape;
        type Program = Rod;

        fn at(&self, by: f64) -> Option<Rod> {
            Some(clamped(0.6 - by))
        }
    }
    let pace = Pace {
        longest: 0.02,
        stations: 100,
        events: Events::Ignore,
    };
    let continuation = Continuation::new(&Moved, 1e-9, [0.0, 0.5], pace);
    let start = continuation.start(&found.at, 0.0, true).unwrap();
    let mut steps = 0;
    let curve = continuation.trace(start, &mut |_| {
        steps += 1;
        match steps {
            4 => ControlFlow::Break(Enough(steps)),
            _ => ControlFlow::Continue(()),
        }
    });
    assert_eq!(curve.end, End::Stopped(Enough(4)));
    assert_eq!(curve.stations.len(), 4);
}
