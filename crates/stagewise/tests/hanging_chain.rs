//! A chain of rigid links hung between two points above a floor: inequalities of nodes, whose multipliers are contact forces.
//!
//! The control of a node is the angle of the link that follows it; the state is the node's position.

use nalgebra::{SMatrix, Vector2};
use stagewise::{
    Layout, Linearisation, Multipliers, NodeVector, Outcome, Program, Settings, Solution, Values,
    minimise,
};
use std::ops::ControlFlow;

const LINKS: usize = 24;
const LINK: f64 = 1.0 / LINKS as f64;
/// Weight of every inner node.
const WEIGHT: f64 = LINK;

struct Chain {
    span: f64,
    /// Height of the floor, below the ends.
    floor: Option<f64>,
}

#[derive(Debug, Clone, PartialEq)]
struct Shape {
    node: Vec<Vector2<f64>>,
    angle: Vec<f64>,
}

impl Chain {
    /// The force on a node: its weight, and the contact where `contacts` counts.
    fn force(&self, node: usize, multipliers: &Multipliers, contacts: bool) -> Vector2<f64> {
        let is_inner = (1..LINKS).contains(&node);
        let mut force = Vector2::new(0.0, if is_inner { WEIGHT } else { 0.0 });
        if contacts && is_inner && self.floor.is_some() {
            force.y -= multipliers.inequalities[node - 1];
        }
        if node == LINKS {
            force += Vector2::new(multipliers.equalities[2], multipliers.equalities[3]);
        }
        force
    }
}

impl Program<2, 1, 3> for Chain {
    type Point = Shape;

    fn layout(&self) -> Layout {
        let layout = Layout::new(vec![LINK; LINKS])
            .with_equalities_at(0, 2)
            .with_equalities_at(LINKS, 2);
        match self.floor {
            None => layout,
            Some(_) => (1..LINKS).fold(layout, |layout, node| {
                layout.with_inequalities_at(node, 1, LINK)
            }),
        }
    }

    fn evaluate(&self, shape: &mut Shape, values: &mut Values) -> bool {
        for k in 0..LINKS {
            let (sine, cosine) = shape.angle[k].sin_cos();
            shape.node[k + 1] = shape.node[k] + LINK * Vector2::new(cosine, sine);
        }
        let inner = &shape.node[1..LINKS];
        values.objective = inner.iter().map(|node| WEIGHT * node.y).sum();
        let last = shape.node[LINKS] - Vector2::new(self.span, 0.0);
        values.equalities = vec![shape.node[0].x, shape.node[0].y, last.x, last.y];
        values.slacks.clear();
        if let Some(floor) = self.floor {
            values
                .slacks
                .extend(inner.iter().map(|node| node.y - floor));
        }
        values.slacks.iter().all(|slack| *slack > 0.0)
    }

    fn equality_gradients(&self, _: &Shape, into: &mut [NodeVector<3>]) {
        for (i, row) in into.iter_mut().enumerate() {
            *row = NodeVector::ith(i % 2, 1.0);
        }
    }

    fn linearise(
        &self,
        shape: &Shape,
        multipliers: &Multipliers,
        into: &mut Linearisation<2, 1, 3>,
    ) {
        into.gradient.fill(NodeVector::zeros());
        let mut beyond = Vector2::zeros();
        let mut bent_by = Vector2::zeros();
        for k in (0..LINKS).rev() {
            beyond += self.force(k + 1, multipliers, false);
            bent_by += self.force(k + 1, multipliers, true);
            let (sine, cosine) = shape.angle[k].sin_cos();
            let along = LINK * Vector2::new(-sine, cosine);
            let stage = &mut into.chain.stages[k];
            stage
                .growth_by_first
                .fixed_view_mut::<2, 1>(0, 0)
                .copy_from(&along);
            stage.free = [k + 1 < LINKS];
            into.gradient[k][2] = beyond.dot(&along);
            into.diagonal.controls[k].first[(0, 0)] =
                -LINK * bent_by.dot(&Vector2::new(cosine, sine));
        }
        let held = Vector2::new(multipliers.equalities[0], multipliers.equalities[1]);
        into.gradient[0]
            .fixed_rows_mut::<2>(0)
            .copy_from(&(beyond + held));
        self.equality_gradients(shape, &mut into.equalities_at);
        into.node_slacks.fill(NodeVector::ith(1, 1.0));
    }

    fn retract(&self, shape: &Shape, step: &[NodeVector<3>], length: f64, into: &mut Shape) {
        into.node[0] = shape.node[0] + length * step[0].fixed_rows::<2>(0);
        for (k, change) in step.iter().enumerate() {
            into.angle[k] = shape.angle[k] + length * change[2];
        }
    }

    fn metric(&self, _: &Shape) -> Vec<SMatrix<f64, 2, 2>> {
        vec![SMatrix::identity() * LINK; LINKS + 1]
    }
}

fn solved(chain: &Chain, sag: f64) -> Solution<Shape> {
    let start = Shape {
        node: vec![Vector2::zeros(); LINKS + 1],
        angle: (0..=LINKS)
            .map(|k| -sag + 2.0 * sag * k as f64 / LINKS as f64)
            .collect(),
    };
    let settings = Settings {
        tolerance: 1e-10,
        iterations: 200,
        barrier: 1e-2,
    };
    minimise(chain, &settings, start, &mut || ControlFlow::Continue(()))
}

/// Angles of a free chain under its weight, from the horizontal tension: that of every link has the same horizontal part, and
/// the vertical one grows by a node's weight from link to link.
fn free_angles(tension: f64) -> Vec<f64> {
    let vertical = |k: usize| WEIGHT * (k as f64 - 0.5 * (LINKS as f64 - 1.0));
    (0..LINKS).map(|k| (vertical(k) / tension).atan()).collect()
}

/// The horizontal tension at which a free chain spans a distance, by bisection.
fn tension_of(span: f64) -> f64 {
    let spans = |tension: f64| -> f64 { free_angles(tension).iter().map(|a| LINK * a.cos()).sum() };
    let (mut low, mut high) = (1e-6, 1e3);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if spans(middle) < span {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[test]
fn test_free_chain_hangs_as_the_balance_of_its_nodes_says() {
    let solution = solved(
        &Chain {
            span: 0.7,
            floor: None,
        },
        0.9,
    );
    assert_eq!(solution.outcome, Outcome::Converged);
    let tension = tension_of(0.7);
    for (angle, expected) in solution.at.point.angle.iter().zip(free_angles(tension)) {
        assert!((angle - expected).abs() < 1e-7, "{angle} {expected}");
    }
    let multipliers = &solution.at.multipliers.equalities;
    assert!((multipliers[0] - tension).abs() < 1e-7 && (multipliers[2] + tension).abs() < 1e-7);
    let inertia = solution.inertia.unwrap();
    assert_eq!(inertia.negative, 0);
}

#[test]
fn test_chain_rests_on_the_floor_where_it_touches_and_all_forces_balance() {
    let floor = -0.2;
    let chain = Chain {
        span: 0.7,
        floor: Some(floor),
    };
    let solution = solved(&chain, 0.25);
    assert_eq!(
        solution.outcome,
        Outcome::Converged,
        "{:?}",
        solution.residuals
    );
    let shape = &solution.at.point;
    let free = solved(
        &Chain {
            span: 0.7,
            floor: None,
        },
        0.9,
    );
    assert!(solution.values.objective > free.values.objective + 1e-3);
    let contacts = &solution.at.multipliers.inequalities;
    let touching = contacts.iter().filter(|force| **force > 1e-4).count();
    assert!(touching > 2 && touching < LINKS - 4, "{touching}");
    for (node, contact) in shape.node[1..LINKS].iter().zip(contacts) {
        assert!((node.y - floor) * contact < 1e-9);
    }
    // Contact forces and the ends bear the weight.
    let held = &solution.at.multipliers.equalities;
    let up: f64 = contacts.iter().sum::<f64>() - held[1] - held[3];
    assert!((up - WEIGHT * (LINKS as f64 - 1.0)).abs() < 1e-8, "{up}");
    // The horizontal tension is the same everywhere: vertical forces change at the nodes alone.
    let tension = held[0];
    let mut vertical = held[1];
    for k in 0..LINKS {
        if k > 0 {
            vertical += WEIGHT - contacts[k - 1];
        }
        assert!(
            (vertical / tension - shape.angle[k].tan()).abs() < 1e-5,
            "{k}"
        );
    }
}
