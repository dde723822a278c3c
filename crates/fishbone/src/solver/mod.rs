//! Primal–dual interior-point minimisation on a chain of nodes.
//!
//! A numerical library of its own: it knows nodes, the stages between them, constraints at nodes and between pairs of
//! nodes, inequalities at stages, and nothing of belts. Every iteration costs time linear in the length of the chain. The algorithm is that
//! of A. Wächter and L. T. Biegler, "On the implementation of an interior-point filter line-search algorithm for
//! large-scale nonlinear programming" (2006), on the stage-wise linear algebra of [`chain`].

mod border;
pub mod chain;
mod continuation;
mod filter;
mod follow;
mod inertia;
mod interior_point;
mod kkt;
mod modes;
mod newton;
mod push;
mod rank;

pub use continuation::{
    Continuation, Curve, End, Event, Events, Family, Pace, Station, Turn, settle,
};
pub use follow::{Followed, Follower, Shape};
pub use inertia::Inertia;
pub use interior_point::{assess, minimise};
pub use kkt::{Kkt, KktVector, Singular};
pub use modes::{Mode, lowest_modes, moved};
pub use push::pushed_over;
pub use rank::dependent_constraints;

use chain::{Chain, Diagonal, NodeMatrix, NodeTerm, NodeVector, Stage};
use nalgebra::{Matrix4, Matrix6, SMatrix, SVector, Vector4};

/// Most equality constraints at one node, or between one pair of nodes.
pub const ROWS: usize = 6;
/// Most inequalities at one stage.
pub const BOUNDS: usize = 5;

/// Values or multipliers of the constraints of one node or pair; unused rows are zero.
pub type Rows = SVector<f64, ROWS>;
/// Derivative of the constraints of one node or pair by a node's unknowns; unused rows are zero.
pub type RowsByNode = SMatrix<f64, ROWS, 8>;
/// Multipliers of the inequalities, or any other number for each of them, stage by stage.
pub type Bounds = Vec<[f64; BOUNDS]>;

/// What a programme is worth at a point.
#[derive(Debug, Clone, Default)]
pub struct Values {
    /// Objective.
    pub objective: f64,
    /// Constraint values, one entry a constrained node, then one a linked pair.
    pub constraints: Vec<Rows>,
    /// Inequalities of every stage: admissible where positive.
    pub slacks: Bounds,
}

/// A programme to second order at a point.
#[derive(Debug, Clone)]
pub struct Linearisation {
    /// Second derivatives of the Lagrangian of equalities and inequalities.
    pub chain: Chain,
    /// Those by controls, and at constrained nodes.
    pub diagonal: Diagonal,
    /// Gradient of the Lagrangian of the equalities, by the unknowns of every node.
    pub gradient: Vec<NodeVector>,
    /// Derivatives of the constraints at nodes, one entry a constrained node.
    pub constraints: Vec<RowsByNode>,
    /// Derivatives of the constraints between pairs, by either node.
    pub links: Vec<[RowsByNode; 2]>,
    /// Derivatives of the inequalities by both controls of their stage.
    pub slacks: Vec<[Vector4<f64>; BOUNDS]>,
}

/// What the solver needs to know of a programme.
///
/// The state of a node is not an unknown: it is carried along the chain from the first one, so that a point is always
/// consistent. The unknowns are the state of the first node and the controls of all.
pub trait Program {
    /// A point of the search space, which need not be a vector space.
    type Point: Clone;

    /// Number of stages.
    fn stages(&self) -> usize;

    /// The constrained nodes, rising.
    fn constrained_nodes(&self) -> Vec<usize>;

    /// The pairs of nodes that linear constraints tie together.
    fn linked_nodes(&self) -> Vec<[usize; 2]>;

    /// Number of inequalities at every stage, the first of [`BOUNDS`].
    fn bounds(&self) -> usize;

    /// The share of each stage in the whole, its weight in barrier and damping.
    fn weights(&self) -> Vec<f64>;

    /// Carries the states of a point along the chain and evaluates it; false outside the domain. Outside the bounds alone
    /// it still gives slacks and constraints.
    fn evaluate(&self, point: &mut Self::Point, values: &mut Values) -> bool;

    /// Derivatives of the constraints at nodes.
    fn constraint_jacobians(&self, point: &Self::Point, into: &mut [RowsByNode]);

    /// Derivatives at a point that has been evaluated, of the objective plus multipliers times constraints; the second
    /// ones with `bounds` times the inequalities taken off.
    fn linearise(
        &self,
        point: &Self::Point,
        multipliers: &[Rows],
        bounds: &Bounds,
        into: &mut Linearisation,
    );

    /// Moves the unknowns of a point along a step; the states still have to be carried on.
    fn retract(
        &self,
        point: &Self::Point,
        step: &[NodeVector],
        length: f64,
        into: &mut Self::Point,
    );

    /// The square of how far a change of its state moves each node, with its share in the whole: by this the eigenvalues of
    /// the second variation are measured.
    fn metric(&self, point: &Self::Point) -> Vec<Matrix6<f64>>;
}

impl<P: Program> Program for &P {
    type Point = P::Point;

    fn stages(&self) -> usize {
        (*self).stages()
    }

    fn constrained_nodes(&self) -> Vec<usize> {
        (*self).constrained_nodes()
    }

    fn linked_nodes(&self) -> Vec<[usize; 2]> {
        (*self).linked_nodes()
    }

    fn bounds(&self) -> usize {
        (*self).bounds()
    }

    fn weights(&self) -> Vec<f64> {
        (*self).weights()
    }

    fn evaluate(&self, point: &mut Self::Point, values: &mut Values) -> bool {
        (*self).evaluate(point, values)
    }

    fn constraint_jacobians(&self, point: &Self::Point, into: &mut [RowsByNode]) {
        (*self).constraint_jacobians(point, into);
    }

    fn linearise(
        &self,
        point: &Self::Point,
        multipliers: &[Rows],
        bounds: &Bounds,
        into: &mut Linearisation,
    ) {
        (*self).linearise(point, multipliers, bounds, into);
    }

    fn retract(
        &self,
        point: &Self::Point,
        step: &[NodeVector],
        length: f64,
        into: &mut Self::Point,
    ) {
        (*self).retract(point, step, length, into);
    }

    fn metric(&self, point: &Self::Point) -> Vec<Matrix6<f64>> {
        (*self).metric(point)
    }
}

/// Settings of the minimisation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Largest residual of a converged point.
    pub tolerance: f64,
    /// Most iterations.
    pub iterations: usize,
    /// First barrier parameter, an objective per unit weight.
    pub barrier: f64,
}

/// Why the minimisation ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// All residuals are within the tolerance.
    Converged,
    /// The iteration limit was reached.
    IterationLimit,
    /// The violation of the constraints cannot be lowered any further.
    LocallyInfeasible,
    /// The constraints hold, and no step lowers the objective by more than rounding.
    Stalled,
    /// The objective is not bounded below, or not finite.
    Unbounded,
    /// The start is outside the domain.
    Inadmissible,
    /// The caller asked to end.
    Interrupted,
}

/// Residuals of the first-order conditions, max-norms.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Residuals {
    /// Gradient of the Lagrangian by the unknowns.
    pub stationarity: f64,
    /// Violation of the constraints.
    pub constraint: f64,
    /// Products of slacks and their multipliers.
    pub complementarity: f64,
}

impl Residuals {
    /// The largest of the three; NaN where one of them is.
    pub fn largest(&self) -> f64 {
        [self.stationarity, self.constraint, self.complementarity]
            .into_iter()
            .fold(0.0, larger)
    }
}

/// The larger of two numbers; NaN where one of them is, so that no residual hides one.
fn larger(a: f64, b: f64) -> f64 {
    if b <= a { a } else { b }
}

/// A point where the first-order conditions hold, or are meant to, with the multipliers that they take.
#[derive(Debug, Clone, PartialEq)]
pub struct Stationary<P> {
    /// The point.
    pub point: P,
    /// Multipliers of the constraints, in the order of their values.
    pub multipliers: Vec<Rows>,
    /// Multipliers of the inequalities.
    pub bound_multipliers: Bounds,
}

/// Where the minimisation ended.
#[derive(Debug, Clone)]
pub struct Solution<P> {
    /// The last point, with its multipliers.
    pub at: Stationary<P>,
    /// Its values.
    pub values: Values,
    /// Residuals there.
    pub residuals: Residuals,
    /// Iterations taken.
    pub iterations: usize,
    /// Why it ended.
    pub outcome: Outcome,
    /// Inertia of the second variation there; `None` where it cannot be decided.
    pub inertia: Option<Inertia>,
}

impl<P> Solution<P> {
    /// Whether it is a minimum, or not told from one.
    pub fn is_minimum(&self) -> bool {
        let descends = self.inertia.is_some_and(|inertia| inertia.negative > 0);
        self.outcome == Outcome::Converged && !descends
    }

    /// The same with the iterations of what went before counted in.
    pub fn after(self, iterations: usize) -> Self {
        Self {
            iterations: self.iterations + iterations,
            ..self
        }
    }
}

impl Linearisation {
    /// Room for the derivatives of a programme.
    pub fn new<P: Program>(program: &P) -> Self {
        let term = |node| NodeTerm {
            node,
            hessian: NodeMatrix::zeros(),
        };
        let stages = program.stages();
        let nodes: Vec<_> = program.constrained_nodes().into_iter().map(term).collect();
        Self {
            constraints: vec![RowsByNode::zeros(); nodes.len()],
            links: vec![[RowsByNode::zeros(); 2]; program.linked_nodes().len()],
            chain: Chain {
                stages: vec![Stage::zero(); stages],
                first_free: [true; 2],
            },
            diagonal: Diagonal {
                controls: vec![Matrix4::zeros(); stages],
                states: Vec::new(),
                nodes,
            },
            gradient: vec![NodeVector::zeros(); stages + 1],
            slacks: vec![[Vector4::zeros(); BOUNDS]; stages],
        }
    }
}

/// Adds a derivative by both controls of a stage to the gradient.
fn add_controls(gradient: &mut [NodeVector], stage: usize, by_controls: &Vector4<f64>) {
    for (node, row) in [(stage, 0), (stage + 1, 2)] {
        gradient[node][6] += by_controls[row];
        gradient[node][7] += by_controls[row + 1];
    }
}
