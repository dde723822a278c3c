//! Problems of optimal control written once, as plain formulas, and made into programmes with exact derivatives.
//!
//! States may be carried along by any smooth map whose derivative by the state is regular. The library lets a state grow by
//! what controls add; so a change of state is measured here as the change of the first state that would have led to it.

pub(crate) use super::jets::Number;
use super::jets::{Jet, W, congruent, gradient, hessian, jets, padded, weighted};
use nalgebra::{SMatrix, SVector};
use stagewise::{
    Layout, Linearisation, Multipliers, NodeMatrix, NodeVector, PairMatrix, Program, Values,
};

/// A problem of optimal control on a chain. Rows of constraints come block by block, as the layout has them.
pub(crate) trait Problem<const X: usize, const U: usize, const N: usize>: Clone {
    fn layout(&self) -> Layout;

    /// The state at the end of a stage, from that at its begin and the controls at both ends.
    fn carry<D: Number>(&self, stage: usize, x: [D; X], u: [[D; U]; 2]) -> [D; X];

    /// What a stage costs.
    fn cost<D: Number>(&self, stage: usize, x: [D; X], u: [[D; U]; 2]) -> D;

    fn equalities_at<D: Number>(&self, _block: usize, _x: [D; X], _u: [D; U]) -> Vec<D> {
        Vec::new()
    }

    fn equalities_between<D: Number>(&self, _block: usize, _x: [[D; X]; 2]) -> Vec<D> {
        Vec::new()
    }

    fn stage_slacks<D: Number>(&self, _stage: usize, _u: [[D; U]; 2]) -> Vec<D> {
        Vec::new()
    }

    fn slacks_at<D: Number>(&self, _block: usize, _x: [D; X], _u: [D; U]) -> Vec<D> {
        Vec::new()
    }

    fn slacks_between<D: Number>(&self, _block: usize, _x: [[D; X]; 2]) -> Vec<D> {
        Vec::new()
    }

    /// Which controls of a node are free.
    fn free(&self, _node: usize) -> [bool; U] {
        [true; U]
    }

    /// Metric of a node: squared length of a change of its state, times the node's share in the whole.
    fn metric(&self, node: usize) -> SMatrix<f64, X, X> {
        SMatrix::identity() * Problem::layout(self).node_weights()[node]
    }

    /// Rounding of the controls of a node.
    fn rounding(&self, _u: [f64; U]) -> [f64; U] {
        [0.0; U]
    }

    /// Whether the second derivatives of constraints between pairs are given to the solver.
    fn gives_pair_hessians(&self) -> bool {
        true
    }
}

/// A problem as a programme of the library.
#[derive(Debug, Clone)]
pub(crate) struct Transcribed<P> {
    pub(crate) problem: P,
}

/// States and controls of all nodes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Trajectory<const X: usize, const U: usize> {
    pub(crate) x: Vec<SVector<f64, X>>,
    pub(crate) u: Vec<SVector<f64, U>>,
}

impl<const X: usize, const U: usize> Trajectory<X, U> {
    /// From a first state; the other states are carried along when it is evaluated.
    pub(crate) fn new(first: [f64; X], controls: impl IntoIterator<Item = [f64; U]>) -> Self {
        let u: Vec<_> = controls.into_iter().map(SVector::from).collect();
        Self {
            x: vec![SVector::from(first); u.len()],
            u,
        }
    }
}

/// A block of rows at one node or between two, with derivatives.
struct Rows {
    nodes: Vec<usize>,
    rows: Vec<Jet>,
}

impl<P> Transcribed<P> {
    fn ends<const X: usize, const U: usize>(
        point: &Trajectory<X, U>,
        stage: usize,
    ) -> ([f64; X], [[f64; U]; 2]) {
        let u = [stage, stage + 1].map(|node| point.u[node].data.0[0]);
        (point.x[stage].data.0[0], u)
    }

    fn equality_rows<const X: usize, const U: usize, const N: usize>(
        &self,
        point: &Trajectory<X, U>,
    ) -> Vec<Rows>
    where
        P: Problem<X, U, N>,
    {
        let layout = self.problem.layout();
        let at = layout.equalities_at().iter().enumerate();
        let at = at.map(|(i, block)| {
            let (x, u) = (jets(&point.x[block.at], 0), jets(&point.u[block.at], X));
            Rows {
                nodes: vec![block.at],
                rows: self.problem.equalities_at(i, x, u),
            }
        });
        let between = layout.equalities_between().iter().enumerate();
        let between = between.map(|(i, block)| {
            let [a, b] = block.at;
            let x = [jets(&point.x[a], 0), jets(&point.x[b], X)];
            Rows {
                nodes: block.at.to_vec(),
                rows: self.problem.equalities_between(i, x),
            }
        });
        at.chain(between).collect()
    }

    fn slack_rows<const X: usize, const U: usize, const N: usize>(
        &self,
        point: &Trajectory<X, U>,
    ) -> Vec<Rows>
    where
        P: Problem<X, U, N>,
    {
        let layout = self.problem.layout();
        let at = layout.inequalities_at().iter().enumerate();
        let at = at.map(|(i, block)| {
            let (x, u) = (jets(&point.x[block.at], 0), jets(&point.u[block.at], X));
            Rows {
                nodes: vec![block.at],
                rows: self.problem.slacks_at(i, x, u),
            }
        });
        let between = layout.inequalities_between().iter().enumerate();
        let between = between.map(|(i, block)| {
            let [a, b] = block.at;
            let x = [jets(&point.x[a], 0), jets(&point.x[b], X)];
            Rows {
                nodes: block.at.to_vec(),
                rows: self.problem.slacks_between(i, x),
            }
        });
        at.chain(between).collect()
    }
}

/// Gradient of a row by the unknowns of one of its nodes, with the state's change measured at the first node.
fn by_node<const X: usize, const U: usize, const N: usize>(
    rows: &Rows,
    row: &Jet,
    end: usize,
    transport: &[SMatrix<f64, X, X>],
) -> NodeVector<N> {
    let mut by = NodeVector::<N>::zeros();
    let by_state: SVector<f64, X> = gradient(row, end * X);
    let carried = transport[rows.nodes[end]].tr_mul(&by_state);
    by.fixed_rows_mut::<X>(0).copy_from(&carried);
    if rows.nodes.len() == 1 {
        by.fixed_rows_mut::<U>(X).copy_from(&gradient::<U>(row, X));
    }
    by
}

impl<P: Problem<X, U, N>, const X: usize, const U: usize, const N: usize> Program<X, U, N>
    for Transcribed<P>
{
    type Point = Trajectory<X, U>;

    fn layout(&self) -> Layout {
        self.problem.layout()
    }

    fn rounding(&self, point: &Self::Point, node: usize) -> SVector<f64, U> {
        let u = point.u[node].data.0[0];
        SVector::from(self.problem.rounding(u))
    }

    fn evaluate(&self, point: &mut Self::Point, values: &mut Values) -> bool {
        let layout = self.problem.layout();
        let stages = layout.stages();
        let bare =
            |node: usize, point: &Self::Point| (point.x[node].data.0[0], point.u[node].data.0[0]);
        values.objective = 0.0;
        values.equalities.clear();
        values.slacks.clear();
        for k in 0..stages {
            let (x, u) = Self::ends(point, k);
            values.objective += self.problem.cost(k, x, u);
            values.slacks.extend(self.problem.stage_slacks(k, u));
            point.x[k + 1] = SVector::from(self.problem.carry(k, x, u));
        }
        for (i, block) in layout.equalities_at().iter().enumerate() {
            let (x, u) = bare(block.at, point);
            values
                .equalities
                .extend(self.problem.equalities_at(i, x, u));
        }
        for (i, block) in layout.equalities_between().iter().enumerate() {
            let x = block.at.map(|node| bare(node, point).0);
            let rows = self.problem.equalities_between(i, x);
            values.equalities.extend(rows);
        }
        for (i, block) in layout.inequalities_at().iter().enumerate() {
            let (x, u) = bare(block.at, point);
            values.slacks.extend(self.problem.slacks_at(i, x, u));
        }
        for (i, block) in layout.inequalities_between().iter().enumerate() {
            let x = block.at.map(|node| bare(node, point).0);
            values.slacks.extend(self.problem.slacks_between(i, x));
        }
        values.objective.is_finite() && values.slacks.iter().all(|slack| *slack > 0.0)
    }

    fn equality_gradients(&self, point: &Self::Point, into: &mut [NodeVector<N>]) {
        let transport = self.transport::<X, U, N>(point);
        let blocks = self.equality_rows::<X, U, N>(point);
        let at_nodes = blocks.iter().filter(|block| block.nodes.len() == 1);
        let gradients = at_nodes.flat_map(|block| {
            let transport = &transport;
            let rows = block.rows.iter();
            rows.map(move |row| by_node::<X, U, N>(block, row, 0, transport))
        });
        for (into, by) in into.iter_mut().zip(gradients) {
            *into = by;
        }
    }

    fn linearise(
        &self,
        point: &Self::Point,
        multipliers: &Multipliers,
        into: &mut Linearisation<X, U, N>,
    ) {
        let stages = self.problem.layout().stages();
        let transport = self.transport::<X, U, N>(point);
        into.gradient.fill(NodeVector::zeros());
        into.diagonal.states = vec![SMatrix::zeros(); stages + 1];
        into.chain.first_free = self.problem.free(0);
        // Pull on every state: of objective and equalities, then with the slacks taken off.
        let mut pulls = vec![[SVector::<f64, X>::zeros(); 2]; stages + 1];
        self.linearise_equalities(point, multipliers, &transport, &mut pulls, into);
        self.linearise_slacks(point, multipliers, &transport, &mut pulls, into);
        let mut row = self.problem.layout().inequalities_at_stages();
        for k in (0..stages).rev() {
            let x = jets(&point.x[k], 0);
            let u = [jets(&point.u[k], X), jets(&point.u[k + 1], X + U)];
            let next = self.problem.carry(k, x, u);
            let cost = self.problem.cost(k, x, u);
            let [pull, with_slacks] = pulls[k + 1];
            let of_equalities = cost + weighted(&next, pull.iter().copied());
            let slacks = self.problem.stage_slacks(k, u);
            row -= slacks.len();
            let held = multipliers.inequalities[row..].iter().map(|by| -by);
            let whole =
                cost + weighted(&next, with_slacks.iter().copied()) + weighted(&slacks, held);
            for (i, slack) in slacks.iter().enumerate() {
                into.stage_slacks[row + i] = [gradient(slack, X), gradient(slack, X + U)];
            }
            pulls[k][0] += gradient::<X>(&of_equalities, 0);
            let of_objective_and_slacks = cost + weighted(&next, with_slacks.iter().copied());
            pulls[k][1] += gradient::<X>(&of_objective_and_slacks, 0);
            for (end, from) in [(0, X), (1, X + U)] {
                let mut part = into.gradient[k + end].fixed_rows_mut::<U>(X);
                part += gradient::<U>(&of_equalities, from);
            }
            let back = transport[k + 1]
                .try_inverse()
                .expect("a regular transition");
            let stage = &mut into.chain.stages[k];
            let growth = |from: usize| {
                let by: SMatrix<f64, X, U> =
                    SMatrix::from_fn(|i, j| gradient::<W>(&next[i], 0)[from + j]);
                padded::<X, U, N>(&(back * by))
            };
            stage.growth_by_first = growth(X);
            stage.growth_by_second = growth(X + U);
            let to_first = transport[k].transpose();
            stage.state_first = padded(&(to_first * hessian::<X, U>(&whole, [0, X])));
            stage.state_second = padded(&(to_first * hessian::<X, U>(&whole, [0, X + U])));
            stage.free = self.problem.free(k + 1);
            into.diagonal.states[k] += congruent(&transport[k], &hessian(&whole, [0, 0]));
            let controls = &mut into.diagonal.controls[k];
            controls.first = hessian(&whole, [X, X]);
            controls.mixed = hessian(&whole, [X, X + U]);
            controls.second = hessian(&whole, [X + U, X + U]);
        }
        let mut first = into.gradient[0].fixed_rows_mut::<X>(0);
        first += pulls[0][0];
    }

    fn retract(
        &self,
        point: &Self::Point,
        step: &[NodeVector<N>],
        length: f64,
        into: &mut Self::Point,
    ) {
        into.x[0] = point.x[0] + length * step[0].fixed_rows::<X>(0);
        for (k, step) in step.iter().enumerate() {
            into.u[k] = point.u[k] + length * step.fixed_rows::<U>(X);
        }
    }

    fn metric(&self, point: &Self::Point) -> Vec<SMatrix<f64, X, X>> {
        let transport = self.transport::<X, U, N>(point).into_iter().enumerate();
        let metric = transport.map(|(k, by)| congruent(&by, &self.problem.metric(k)));
        metric.collect()
    }
}

impl<P> Transcribed<P> {
    /// Derivative of every node's state by the first one.
    fn transport<const X: usize, const U: usize, const N: usize>(
        &self,
        point: &Trajectory<X, U>,
    ) -> Vec<SMatrix<f64, X, X>>
    where
        P: Problem<X, U, N>,
    {
        let mut transport = vec![SMatrix::<f64, X, X>::identity(); point.x.len()];
        for k in 0..point.x.len() - 1 {
            let u = [k, k + 1].map(|node| jets(&point.u[node], X));
            let next = self.problem.carry(k, jets(&point.x[k], 0), u);
            let by: SMatrix<f64, X, X> = SMatrix::from_fn(|i, j| gradient::<W>(&next[i], 0)[j]);
            transport[k + 1] = by * transport[k];
        }
        transport
    }

    fn linearise_equalities<const X: usize, const U: usize, const N: usize>(
        &self,
        point: &Trajectory<X, U>,
        multipliers: &Multipliers,
        transport: &[SMatrix<f64, X, X>],
        pulls: &mut [[SVector<f64, X>; 2]],
        into: &mut Linearisation<X, U, N>,
    ) where
        P: Problem<X, U, N>,
    {
        let at_nodes = self.problem.layout().equalities_at().len();
        let mut multipliers = multipliers.equalities.iter().copied();
        let (mut at, mut between) = (0, 0);
        for (i, block) in self.equality_rows::<X, U, N>(point).iter().enumerate() {
            let own: Vec<f64> = multipliers.by_ref().take(block.rows.len()).collect();
            let work = weighted(&block.rows, own);
            for row in &block.rows {
                if block.nodes.len() == 1 {
                    into.equalities_at[at] = by_node::<X, U, N>(block, row, 0, transport);
                    at += 1;
                } else {
                    into.equalities_between[between] =
                        [0, 1].map(|end| by_node::<X, U, N>(block, row, end, transport));
                    between += 1;
                }
            }
            if block.nodes.len() == 1 {
                let mut part = into.gradient[block.nodes[0]].fixed_rows_mut::<U>(X);
                part += gradient::<U>(&work, X);
                *into.equality_hessian(i) =
                    node_hessian::<X, U, N>(&work, &transport[block.nodes[0]]);
            } else if self.problem.gives_pair_hessians() {
                let transport = [0, 1].map(|end| &transport[block.nodes[end]]);
                *into.equality_hessian_between(i - at_nodes) = pair_hessian(&work, transport);
            }
            Self::pull(block, &work, pulls, false);
        }
    }

    fn linearise_slacks<const X: usize, const U: usize, const N: usize>(
        &self,
        point: &Trajectory<X, U>,
        multipliers: &Multipliers,
        transport: &[SMatrix<f64, X, X>],
        pulls: &mut [[SVector<f64, X>; 2]],
        into: &mut Linearisation<X, U, N>,
    ) where
        P: Problem<X, U, N>,
    {
        let at_nodes = self.problem.layout().inequalities_at().len();
        let at_stages = self.problem.layout().inequalities_at_stages();
        let mut multipliers = multipliers.inequalities[at_stages..].iter();
        let (mut at, mut between) = (0, 0);
        for (i, block) in self.slack_rows::<X, U, N>(point).iter().enumerate() {
            let own: Vec<f64> = multipliers
                .by_ref()
                .take(block.rows.len())
                .map(|by| -by)
                .collect();
            let work = weighted(&block.rows, own);
            for row in &block.rows {
                if block.nodes.len() == 1 {
                    into.node_slacks[at] = by_node::<X, U, N>(block, row, 0, transport);
                    at += 1;
                } else {
                    into.pair_slacks[between] =
                        [0, 1].map(|end| by_node::<X, U, N>(block, row, end, transport));
                    between += 1;
                }
            }
            if block.nodes.len() == 1 {
                *into.inequality_hessian(i) =
                    node_hessian::<X, U, N>(&work, &transport[block.nodes[0]]);
            } else if self.problem.gives_pair_hessians() {
                let transport = [0, 1].map(|end| &transport[block.nodes[end]]);
                *into.inequality_hessian_between(i - at_nodes) = pair_hessian(&work, transport);
            }
            Self::pull(block, &work, pulls, true);
        }
    }

    /// Adds the pull of a block on the states that it touches.
    fn pull<const X: usize>(
        block: &Rows,
        work: &Jet,
        pulls: &mut [[SVector<f64, X>; 2]],
        with_slacks_only: bool,
    ) {
        for (end, node) in block.nodes.iter().enumerate() {
            let by = gradient::<X>(work, end * X);
            pulls[*node][1] += by;
            if !with_slacks_only {
                pulls[*node][0] += by;
            }
        }
    }
}

/// Second derivative of rows between two nodes, by the unknowns of both.
fn pair_hessian<const X: usize, const N: usize>(
    work: &Jet,
    transport: [&SMatrix<f64, X, X>; 2],
) -> PairMatrix<N> {
    let part = |i: usize, j: usize| {
        let states =
            transport[i].transpose() * hessian::<X, X>(work, [i * X, j * X]) * transport[j];
        let mut all = NodeMatrix::<N>::zeros();
        all.fixed_view_mut::<X, X>(0, 0).copy_from(&states);
        all
    };
    PairMatrix {
        first: part(0, 0),
        mixed: part(0, 1),
        second: part(1, 1),
    }
}

/// Second derivative of a row at one node, by its unknowns.
fn node_hessian<const X: usize, const U: usize, const N: usize>(
    work: &Jet,
    transport: &SMatrix<f64, X, X>,
) -> NodeMatrix<N> {
    let mut to = NodeMatrix::<N>::identity();
    to.fixed_view_mut::<X, X>(0, 0).copy_from(transport);
    to.transpose() * hessian::<N, N>(work, [0, 0]) * to
}
