use super::*;
use crate::strip::bounds::Edge;
use crate::strip::density::slope_beyond;
use crate::strip::element::Curl;
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, SymmetricEigen, Vector2};
use stagewise::{Linearisation, Multipliers, Program, Stationary, Values, lowest_modes};
use std::sync::Arc;

type Node = NodeVector<8>;

fn element(length: f64, geodesic: f64) -> Piece {
    Piece::Strip(Element {
        length,
        geodesic,
        rigidity: [1.0, 1.2],
        half_width: 0.05,
        curl: Curl {
            bend: 0.8,
            poisson: 0.3,
        },
        stretching: f64::INFINITY,
    })
}

/// A line and an arc.
fn edges() -> ActiveEdges {
    let arc = Edge {
        direction: Vector2::x(),
        distance: 0.05,
        curvature: 4.0,
        turn: [-0.5, 0.4],
    };
    let line = Edge::line(Vector2::new(0.8, 0.6), 0.03);
    [None, Some(line), Some(arc)]
}

/// A ball that nodes must not enter.
#[derive(Debug)]
struct Ball {
    centre: Vector3<f64>,
    radius: f64,
}

impl Obstacle for Ball {
    fn gap(&self, point: &Vector3<f64>) -> f64 {
        (point - self.centre).norm() - self.radius
    }

    fn gradient(&self, point: &Vector3<f64>) -> Vector3<f64> {
        (point - self.centre).normalize()
    }

    fn hessian(&self, point: &Vector3<f64>) -> Matrix3<f64> {
        let away = self.gradient(point);
        (Matrix3::identity() - away * away.transpose()) / (point - self.centre).norm()
    }
}

/// A belt with every kind of part: a straight stretch, a bend, an arc, a stiffener, a joint, a hinge, a link, weight, a dead
/// force with a lever, an obstacle before two nodes.
fn program() -> BeltProgram {
    let pieces = vec![
        element(0.2, 0.0),
        Piece::Joint { angle: 0.6 },
        element(0.15, 1.5),
        element(0.15, 1.5),
        Piece::Joint { angle: 0.0 },
        Piece::Rigid { length: 0.1 },
        Piece::Joint { angle: 0.0 },
        element(0.2, 0.0),
        element(0.2, 0.0),
    ];
    let supports = vec![
        NodeSupport {
            node: 0,
            position: [Some(0.0); 3],
            hold: Hold::Frame(UnitQuaternion::identity()),
            square_rib: true,
        },
        NodeSupport {
            node: 3,
            position: [None, Some(0.2), None],
            hold: Hold::Hinge {
                frame: UnitQuaternion::from_scaled_axis(Vector3::new(0.4, 0.2, -0.1)),
                axis: 2,
                moment: 0.7,
            },
            square_rib: false,
        },
        NodeSupport {
            node: 9,
            position: [Some(0.1), Some(0.6), Some(0.2)],
            hold: Hold::Frame(UnitQuaternion::from_scaled_axis(Vector3::new(
                0.3, -0.4, 0.7,
            ))),
            square_rib: false,
        },
    ];
    let mut program =
        BeltProgram::new(pieces, DevelopableEnergy::Wunderlich).with_supports(supports);
    let strips: Vec<usize> = program.elements().map(|(k, _)| k).collect();
    for k in strips {
        program.edges[k] = edges();
    }
    program.links = vec![
        NodeLink {
            nodes: [1, 8],
            tie: Tie::Offset(Vector3::new(0.1, 0.2, 0.3)),
        },
        NodeLink {
            nodes: [1, 8],
            tie: Tie::Fields([Some(-1.0), None, None, None, None, None]),
        },
    ];
    program.loads = vec![NodeLoad {
        node: 4,
        load: DeadForce {
            force: Vector3::new(1.0, -2.0, 0.5),
            lever: Vector3::new(0.1, 0.2, -0.1),
        },
    }];
    program.weight = Vector3::new(2.0, 1.0, -3.0);
    let ball = Arc::new(Ball {
        centre: Vector3::new(0.5, 0.3, 1.0),
        radius: 0.2,
    });
    program.obstacles = [3, 8]
        .map(|node| NodeObstacle {
            node,
            obstacle: ball.clone(),
            weight: 0.1,
        })
        .into();
    program
}

fn point(program: &BeltProgram) -> BeltPoint {
    let nodes = program.nodes();
    let mut point = BeltPoint {
        fields: nodes
            .iter()
            .map(|u| Vector2::new(3.0 * (7.0 * u).cos() + 1.0, 0.4 * (5.0 * u).sin() + 0.1))
            .collect(),
        poses: vec![Pose::identity(); nodes.len()],
    };
    point.poses[0].frame = Rotation3::new(Vector3::new(0.2, 0.1, -0.3)).into_inner();
    program.settle(&mut point);
    point
}

/// The Lagrangian, of which the solver's linearisation is the second-order expansion.
fn lagrangian(program: &BeltProgram, point: &mut BeltPoint, multipliers: &Multipliers) -> f64 {
    let mut values = Values::default();
    assert!(program.evaluate(point, &mut values));
    let work = |values: &[f64], multipliers: &[f64]| {
        let rows = values.iter().zip(multipliers);
        rows.map(|(value, multiplier)| value * multiplier)
            .sum::<f64>()
    };
    values.objective + work(&values.equalities, &multipliers.equalities)
        - work(&values.slacks, &multipliers.inequalities)
}

/// Multipliers in general position.
fn multipliers(program: &BeltProgram, strength: f64, inequality: f64) -> Multipliers {
    let layout = program.layout();
    let equality = |row: usize| {
        let (block, row) = ((row / ROWS) as f64, (row % ROWS) as f64);
        strength * (0.7 + 0.6 * block - 0.4 * row)
    };
    Multipliers {
        equalities: (0..layout.equalities()).map(equality).collect(),
        inequalities: (0..layout.inequalities())
            .map(|row| inequality * (1.0 + 0.3 * (row % 5) as f64))
            .collect(),
    }
}

/// The step along a single unknown, its states carried along.
fn unit(linear: &Linearisation<6, 2, 8>, (node, entry): (usize, usize)) -> Vec<Node> {
    let mut step = vec![Node::zeros(); linear.gradient.len()];
    step[node][entry] = 1.0;
    linear.chain.carry(&mut step);
    step
}

fn moved(program: &BeltProgram, point: &BeltPoint, steps: &[(usize, usize, f64)]) -> BeltPoint {
    let mut step = vec![Node::zeros(); program.pieces.len() + 1];
    for (node, entry, size) in steps {
        step[*node][*entry] += size;
    }
    let mut into = point.clone();
    program.retract(point, &step, 1.0, &mut into);
    into
}

/// The start's state, then the free fields of every node.
fn unknowns(program: &BeltProgram) -> Vec<(usize, usize)> {
    let fields = (0..=program.pieces.len()).flat_map(|k| {
        let free = program.free(k);
        (0..2).filter(move |i| free[*i]).map(move |i| (k, 6 + i))
    });
    (0..6).map(|i| (0, i)).chain(fields).collect()
}

#[test]
fn test_gradient_and_hessian_agree_with_finite_differences() {
    let program = program();
    let at = point(&program);
    let multipliers = multipliers(&program, 1.0, 0.4);
    let layout = program.layout();
    let mut linear = Linearisation::new(layout.clone());
    program.linearise(&at, &multipliers, &mut linear);
    let mut gradient = linear.gradient.clone();
    for k in 0..layout.stages() {
        for row in layout.stage_rows(k) {
            for (end, by) in linear.stage_slacks[row].iter().enumerate() {
                let mut part = gradient[k + end].fixed_rows_mut::<2>(6);
                part -= multipliers.inequalities[row] * by;
            }
        }
    }
    let rows = layout.inequalities_at_stages()..layout.inequalities();
    let slacks = linear.node_slacks.iter().zip(rows);
    for ((slack, row), block) in slacks.zip(layout.inequalities_at()) {
        gradient[block.at] -= multipliers.inequalities[row] * slack;
    }
    linear.chain.carry_back(&mut gradient);
    linear.chain.fold(&mut gradient);
    let unknowns = unknowns(&program);
    let h = 1e-4;
    let value = |steps: &[(usize, usize, f64)]| {
        let mut point = moved(&program, &at, steps);
        lagrangian(&program, &mut point, &multipliers)
    };
    for a in &unknowns {
        let difference = (value(&[(a.0, a.1, h)]) - value(&[(a.0, a.1, -h)])) / (2.0 * h);
        let exact = gradient[a.0][a.1];
        assert!(
            (difference - exact).abs() < 2e-6 * exact.abs().max(10.0),
            "{a:?} {difference} {exact}"
        );
        for b in &unknowns {
            let second = (value(&[(a.0, a.1, h), (b.0, b.1, h)])
                - value(&[(a.0, a.1, h), (b.0, b.1, -h)])
                - value(&[(a.0, a.1, -h), (b.0, b.1, h)])
                + value(&[(a.0, a.1, -h), (b.0, b.1, -h)]))
                / (4.0 * h * h);
            let (along_a, along_b) = (unit(&linear, *a), unit(&linear, *b));
            let exact = linear.second_derivative(&along_a, &along_b);
            assert!(
                (second - exact).abs() < 2e-5 * exact.abs().max(10.0),
                "{a:?} {b:?} {second} {exact}"
            );
        }
    }
}

/// The lowest modes by dense matrices: of the second derivative on the null space of the constraints.
fn dense_modes(program: &BeltProgram, at: &Stationary<BeltPoint>) -> Vec<f64> {
    let mut point = at.point.clone();
    let mut values = Values::default();
    assert!(program.evaluate(&mut point, &mut values));
    let layout = program.layout();
    let mut linear = Linearisation::new(layout.clone());
    program.linearise(&point, &at.multipliers, &mut linear);
    let unknowns = unknowns(program);
    let steps: Vec<Vec<Node>> = unknowns
        .iter()
        .map(|unknown| unit(&linear, *unknown))
        .collect();
    let count = unknowns.len();
    let square = |product: &dyn Fn(usize, usize) -> f64| DMatrix::from_fn(count, count, product);
    let rate = |k: usize, row: usize, step: &[Node]| {
        let ends = linear.stage_slacks[row].iter().zip(&step[k..]);
        let rates = ends.map(|(by, node)| by.dot(&node.fixed_rows::<2>(6)));
        rates.sum::<f64>()
    };
    let second = square(&|i, j| {
        let own = linear.second_derivative(&steps[i], &steps[j]);
        let stages = 0..layout.stages();
        let rows = stages.flat_map(|k| layout.stage_rows(k).map(move |row| (k, row)));
        let touched = linear.node_slacks.iter().zip(layout.inequalities_at());
        let touched = touched.enumerate().map(|(n, (slack, block))| {
            let row = layout.inequalities_at_stages() + n;
            let stiffness = at.multipliers.inequalities[row] / values.slacks[row];
            stiffness * slack.dot(&steps[i][block.at]) * slack.dot(&steps[j][block.at])
        });
        let held = rows.map(|(k, row)| {
            let stiffness = at.multipliers.inequalities[row] / values.slacks[row];
            stiffness * rate(k, row, &steps[i]) * rate(k, row, &steps[j])
        });
        own + held.sum::<f64>() + touched.sum::<f64>()
    });
    let metric = program.metric(&point);
    let state = |step: &[Node], k: usize| step[k].fixed_rows::<6>(0).into_owned();
    let mass = square(&|i, j| {
        let of_node = |k: usize| state(&steps[i], k).dot(&(metric[k] * state(&steps[j], k)));
        (0..metric.len()).map(of_node).sum()
    });
    let rows_of = |step: &Vec<Node>| {
        let at_nodes = linear.equalities_at.iter().enumerate();
        let at_nodes = at_nodes.map(|(i, row)| row.dot(&step[program.supports[i / ROWS].node]));
        let between = linear.equalities_between.iter().enumerate();
        let between = between.map(|(i, [first, second])| {
            let [a, b] = program.links[i / ROWS].nodes;
            first.dot(&step[a]) + second.dot(&step[b])
        });
        at_nodes.chain(between).collect::<Vec<f64>>()
    };
    let columns: Vec<_> = steps
        .iter()
        .map(|step| DVector::from_vec(rows_of(step)))
        .collect();
    let jacobian = DMatrix::from_columns(&columns);
    let eigen = SymmetricEigen::new(jacobian.tr_mul(&jacobian));
    let largest = eigen.eigenvalues.amax();
    let free: Vec<_> = (0..count)
        .filter(|i| eigen.eigenvalues[*i] < 1e-12 * largest)
        .map(|i| eigen.eigenvectors.column(i).into_owned())
        .collect();
    let basis = DMatrix::from_columns(&free);
    let reduced = |matrix: &DMatrix<f64>| basis.tr_mul(&(matrix * &basis));
    let root = reduced(&mass).cholesky().unwrap().l();
    let half = root.solve_lower_triangular(&reduced(&second)).unwrap();
    let whole = root.solve_lower_triangular(&half.transpose()).unwrap();
    let mut values: Vec<f64> = whole.symmetric_eigenvalues().iter().copied().collect();
    values.sort_by(f64::total_cmp);
    values
}

#[test]
fn test_lowest_modes_are_those_of_dense_matrices() {
    // Left out is the clamp at the end, so that the belt is free to move under its constraints.
    let whole = program();
    let supports = whole.supports[..2].to_vec();
    let program = whole.with_supports(supports);
    for strength in [0.1, 3.0, 30.0] {
        let mut at = Stationary {
            point: point(&program),
            multipliers: multipliers(&program, strength, 1e-3),
        };
        let expected = dense_modes(&program, &at);
        let modes = lowest_modes(&program, &mut at, 4).unwrap();
        assert_eq!(modes.len(), 4);
        for (mode, expected) in modes.iter().zip(&expected) {
            let difference = (mode.eigenvalue - expected).abs();
            assert!(
                difference < 1e-6 * expected.abs().max(1.0),
                "{} {expected}",
                mode.eigenvalue
            );
        }
    }
}

#[test]
fn test_rib_at_a_bend_is_one_material_line() {
    for (slope, angle) in [(0.3f64, 0.5f64), (-0.2, -1.2), (1.5, 2.0)] {
        let beyond = slope_beyond(slope, angle).unwrap();
        assert!((beyond.atan() - (slope.atan() - angle)).abs() < 1e-14);
        assert!((slope_beyond(beyond, -angle).unwrap() - slope).abs() < 1e-14);
    }
    assert_eq!(slope_beyond(0.0, 1.6), None);
}

#[test]
fn test_ribs_beside_a_stiffener_are_square_and_nothing_bends_in_it() {
    let program = program();
    let point = point(&program);
    assert_eq!((point.fields[4][1], point.fields[7][1]), (0.0, 0.0));
    assert_eq!(
        (point.fields[5], point.fields[6]),
        (Vector2::zeros(), Vector2::zeros())
    );
    let along = point.poses[6].position - point.poses[5].position;
    assert!((along - 0.1 * point.poses[5].frame.column(1)).norm() < 1e-15);
}

#[test]
fn test_weight_beyond_is_carried_by_the_internal_force() {
    let program = BeltProgram {
        supports: Vec::new(),
        links: Vec::new(),
        loads: Vec::new(),
        ..program()
    };
    let point = point(&program);
    let nodes = program.nodes();
    for (u, (force, _)) in nodes.iter().zip(program.internal(&point, &[])) {
        assert!((force - (1.0 - u) * program.weight).norm() < 1e-14);
    }
}
