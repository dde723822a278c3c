//! The Newton system of a barrier problem: bounds eliminated, inertia controlled, constraints met exactly.

use super::border::Border;
use super::chain::{Diagonal, Factor, NodeVector, TooConcave};
use super::{BOUNDS, Bounds, Linearisation, Rows, RowsByNode, Values, larger};

/// Compliance lent to the constraints so that the chain can be factorised without them; refinement takes it back.
const COMPLIANCE: f64 = 1e-7;
const REFINEMENTS: usize = 2;
/// What a step may miss of its targets, far below any tolerance.
const EXACT: f64 = 1e-12;

/// The factorised Newton system and its solution, with the room it needs.
#[derive(Debug, Clone)]
pub(super) struct Newton {
    pub(super) diagonal: Diagonal,
    /// What every bound resists with: multiplier over slack as they were assembled.
    stiffness: Bounds,
    pub(super) factor: Factor,
    border: Border,
    /// All constraints as rows of a border, where they are so.
    rigid: Option<(Border, Vec<[RowsByNode; 2]>)>,
    weights: Vec<f64>,
    bounds: usize,
    node_weights: Vec<f64>,
    damping: f64,
    right: Vec<NodeVector>,
    correction: Vec<NodeVector>,
    /// Step of the unknowns.
    pub(super) step: Vec<NodeVector>,
    /// Step of the constraints' multipliers.
    pub(super) multiplier_step: Vec<Rows>,
}

impl Newton {
    pub(super) fn new(
        linear: &Linearisation,
        pairs: Vec<[usize; 2]>,
        weights: &[f64],
        bounds: usize,
    ) -> Self {
        let nodes = weights.len() + 1;
        let half = |k: Option<usize>| k.and_then(|k| weights.get(k)).map_or(0.0, |w| 0.5 * w);
        let zeros = vec![NodeVector::zeros(); nodes];
        Self {
            diagonal: linear.diagonal.clone(),
            stiffness: vec![[0.0; BOUNDS]; weights.len()],
            factor: Factor::new(weights.len()),
            multiplier_step: vec![Rows::zeros(); linear.constraints.len() + pairs.len()],
            border: Border::new(pairs, nodes),
            rigid: None,
            node_weights: (0..nodes)
                .map(|k| half(k.checked_sub(1)) + half(Some(k)))
                .collect(),
            weights: weights.to_vec(),
            bounds,
            damping: 0.0,
            right: zeros.clone(),
            correction: zeros.clone(),
            step: zeros,
        }
    }

    /// Takes over second derivatives, with the bounds eliminated and the constraints as stiff springs.
    pub(super) fn assemble(&mut self, linear: &Linearisation, values: &Values, bounds: &Bounds) {
        self.assemble_where(linear, values, bounds, |_, _| true);
    }

    /// The same with the bounds of which `counts(slack, multiplier per weight)` is false left out.
    pub(super) fn assemble_where(
        &mut self,
        linear: &Linearisation,
        values: &Values,
        bounds: &Bounds,
        counts: impl Fn(f64, f64) -> bool,
    ) {
        self.diagonal
            .controls
            .copy_from_slice(&linear.diagonal.controls);
        self.diagonal.states.clone_from(&linear.diagonal.states);
        for (k, controls) in self.diagonal.controls.iter_mut().enumerate() {
            for (b, gradient) in linear.slacks[k].iter().enumerate().take(self.bounds) {
                let (slack, multiplier) = (values.slacks[k][b], bounds[k][b]);
                let counted = counts(slack, multiplier / self.weights[k]);
                let stiffness = if counted { multiplier / slack } else { 0.0 };
                *controls += stiffness * gradient * gradient.transpose();
                self.stiffness[k][b] = stiffness;
            }
        }
        for (i, term) in self.diagonal.nodes.iter_mut().enumerate() {
            let jacobian = &linear.constraints[i];
            term.hessian =
                linear.diagonal.nodes[i].hessian + jacobian.tr_mul(jacobian) / COMPLIANCE;
        }
    }

    /// Factorises with just enough damping to be convex on the tangent space of the constraints.
    pub(super) fn factorise(&mut self, linear: &Linearisation) -> Result<(), TooConcave> {
        const FIRST: f64 = 1e-4;
        const MOST: f64 = 1e12;
        if self.factorise_damped(linear, 0.0).is_ok() {
            return Ok(());
        }
        let known = self.damping > 0.0;
        let mut damping = if known { self.damping / 3.0 } else { FIRST };
        while damping < MOST {
            if self.factorise_damped(linear, damping).is_ok() {
                self.damping = damping;
                return Ok(());
            }
            damping *= if known { 8.0 } else { 100.0 };
        }
        Err(TooConcave)
    }

    /// Factorises with a given damping of the controls per unit weight.
    ///
    /// Errors: [`TooConcave`] where it is concave in any direction that the constraints leave.
    pub(super) fn factorise_damped(
        &mut self,
        linear: &Linearisation,
        damping: f64,
    ) -> Result<(), TooConcave> {
        self.rigid = None;
        let (chain, factor, most) = (&linear.chain, &mut self.factor, self.border.rows());
        let concave = chain.factorise(&self.diagonal, damping, &self.node_weights, most, factor)?;
        let held = self
            .border
            .factorise(chain, factor, &linear.links, COMPLIANCE)?;
        match concave == held {
            true => Ok(()),
            false => Err(TooConcave),
        }
    }

    /// Factorises, however concave; in how many of the directions that the constraints leave it is negative.
    ///
    /// The springs that stand for the constraints could not be made rigid by pulling again where the second derivative all
    /// but vanishes in some direction. So the constraints are rows of the border here.
    ///
    /// Errors: [`TooConcave`] where the chain has a direction of no curvature.
    pub(super) fn factorise_any(&mut self, linear: &Linearisation) -> Result<usize, TooConcave> {
        let (chain, factor) = (&linear.chain, &mut self.factor);
        let most = usize::MAX;
        let concave = chain.factorise(&self.diagonal, 0.0, &self.node_weights, most, factor)?;
        let (mut border, rows) = self.border.with_nodes(&self.diagonal.nodes, linear);
        let held = border.factorise(chain, factor, &rows, 0.0)?;
        self.rigid = Some((border, rows));
        Ok(concave.saturating_sub(held))
    }

    /// In how many of the directions that the constraints leave the second derivative as assembled is negative.
    ///
    /// With the constraints as springs the count can only be too large: what they hold in truth, as they give way to
    /// nothing, is taken off.
    ///
    /// Errors: [`TooConcave`] where there is a direction of no curvature.
    pub(super) fn count_negative(&mut self, linear: &Linearisation) -> Result<usize, TooConcave> {
        let (chain, factor) = (&linear.chain, &mut self.factor);
        let most = usize::MAX;
        let concave = chain.factorise(&self.diagonal, 0.0, &self.node_weights, most, factor)?;
        if concave == 0 {
            return Ok(0);
        }
        let (mut border, rows) = self.border.with_nodes(&self.diagonal.nodes, linear);
        Ok(concave.saturating_sub(border.factorise(chain, factor, &rows, 0.0)?))
    }

    /// Finds the step of least cost whose constraints change by `−targets`, and the multipliers' step.
    ///
    /// The springs that stand for the constraints give way a little; pulling again by what is still missing (the
    /// method of multipliers on the quadratic programme) makes them rigid.
    pub(super) fn solve(
        &mut self,
        linear: &Linearisation,
        gradient: &[NodeVector],
        targets: &[Rows],
    ) {
        if let Some((border, rows)) = self.rigid.take() {
            self.solve_rigidly(linear, &border, &rows, gradient, targets);
            self.rigid = Some((border, rows));
            return;
        }
        let (at_nodes, between) = targets.split_at(linear.constraints.len());
        self.right.copy_from_slice(gradient);
        self.step.fill(NodeVector::zeros());
        self.multiplier_step.fill(Rows::zeros());
        for _ in 0..=REFINEMENTS {
            for (i, target) in at_nodes.iter().enumerate() {
                let pull =
                    linear.constraints[i].tr_mul(&self.missing(linear, i, target)) / COMPLIANCE;
                self.right[self.diagonal.nodes[i].node] += pull;
            }
            linear
                .chain
                .solve(&mut self.factor, &self.right, &mut self.correction);
            self.correct_links(linear, between);
            for (step, correction) in self.step.iter_mut().zip(&self.correction) {
                *step += correction;
            }
            let mut most: f64 = 0.0;
            for (i, target) in at_nodes.iter().enumerate() {
                let missing = self.missing(linear, i, target);
                self.multiplier_step[i] += missing / COMPLIANCE;
                most = larger(most, missing.amax());
            }
            if most <= EXACT && between.is_empty() {
                break;
            }
            self.right.fill(NodeVector::zeros());
        }
    }

    /// The same where all constraints are rows of a border.
    fn solve_rigidly(
        &mut self,
        linear: &Linearisation,
        border: &Border,
        rows: &[[RowsByNode; 2]],
        gradient: &[NodeVector],
        targets: &[Rows],
    ) {
        self.right.copy_from_slice(gradient);
        for (i, target) in targets.iter().enumerate().take(linear.constraints.len()) {
            let pull = linear.constraints[i].tr_mul(target) / COMPLIANCE;
            self.right[self.diagonal.nodes[i].node] += pull;
        }
        let (chain, factor) = (&linear.chain, &mut self.factor);
        chain.solve(factor, &self.right, &mut self.step);
        let forces = border.correct(rows, targets, &mut self.step);
        self.multiplier_step.copy_from_slice(&forces);
        for (i, target) in targets.iter().enumerate().take(linear.constraints.len()) {
            let missing = self.missing(linear, i, target);
            self.multiplier_step[i] += missing / COMPLIANCE;
        }
    }

    /// Bends the correction to the links.
    fn correct_links(&mut self, linear: &Linearisation, targets: &[Rows]) {
        if targets.is_empty() {
            return;
        }
        let mut missing = self.border.changes(&linear.links, &self.step);
        for (missing, target) in missing.iter_mut().zip(targets) {
            *missing += target;
        }
        let forces = self
            .border
            .correct(&linear.links, &missing, &mut self.correction);
        for (step, force) in self.multiplier_step[linear.constraints.len()..]
            .iter_mut()
            .zip(forces)
        {
            *step += force;
        }
    }

    /// Takes the pull of the constraints' multipliers off a gradient by the unknowns.
    pub(super) fn take_off_pulls(
        &mut self,
        linear: &Linearisation,
        multipliers: &[Rows],
        gradient: &mut [NodeVector],
    ) {
        let (at_nodes, between) = multipliers.split_at(linear.constraints.len());
        self.right.fill(NodeVector::zeros());
        for (i, rows) in at_nodes.iter().enumerate() {
            self.right[self.diagonal.nodes[i].node] += linear.constraints[i].tr_mul(rows);
        }
        self.border
            .add_pulls(&linear.links, between, &mut self.right);
        linear.chain.carry_back(&mut self.right);
        for (gradient, pull) in gradient.iter_mut().zip(&self.right) {
            *gradient -= pull;
        }
    }

    /// What the step still misses of a target at a node.
    fn missing(&self, linear: &Linearisation, i: usize, target: &Rows) -> Rows {
        linear.constraints[i] * self.step[self.diagonal.nodes[i].node] + target
    }

    /// What a bound's multiplier gives way by along the step.
    pub(super) fn yielding(&self, stage: usize, bound: usize, rate: f64) -> f64 {
        self.stiffness[stage][bound] * rate
    }

    /// Change of a slack along the step, to first order.
    pub(super) fn slack_rate(&self, linear: &Linearisation, stage: usize, bound: usize) -> f64 {
        let by = &linear.slacks[stage][bound];
        let (first, second) = (&self.step[stage], &self.step[stage + 1]);
        by[0] * first[6] + by[1] * first[7] + by[2] * second[6] + by[3] * second[7]
    }

    /// Change of the multipliers' work on the constraints along the step, to first order.
    pub(super) fn constraint_work(&self, linear: &Linearisation, multipliers: &[Rows]) -> f64 {
        let at_node =
            |(i, rows): (usize, &RowsByNode)| rows * self.step[self.diagonal.nodes[i].node];
        linear
            .constraints
            .iter()
            .enumerate()
            .map(at_node)
            .chain(self.border.changes(&linear.links, &self.step))
            .zip(multipliers)
            .map(|(change, multipliers)| multipliers.dot(&change))
            .sum()
    }
}
