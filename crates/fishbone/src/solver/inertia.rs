//! The second variation at a solution: in how many directions it is negative, and in how many it vanishes.
//!
//! Of the directions that the equality constraints and the active inequalities leave. It is counted, not sampled: the
//! factorisation of a symmetric matrix has as many negative pivots as the matrix has negative eigenvalues.

use super::chain::TooConcave;
use super::newton::Newton;
use super::{Bounds, Linearisation, Values};
use nalgebra::{Matrix6, Vector2};

/// Eigenvalues below this, in the unit of the objective over that of the metric, are not told from zero.
pub(super) const ZERO: f64 = 1e-2;
/// A bound holds where its multiplier per weight is so many times its slack, and is free the other way round.
const CLEAR: f64 = 100.0;

/// Numbers of eigenvalues of the second variation by their sign.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Inertia {
    /// Negative ones.
    pub negative: usize,
    /// Those that are not told from zero.
    pub zero: usize,
    /// Controls that neither move nor cost anything, and are in neither number.
    pub idle: usize,
}

impl Newton {
    /// Inertia of the second variation; `None` where it depends on bounds that neither clearly hold nor clearly do not.
    pub(super) fn inertia(
        &mut self,
        linear: &mut Linearisation,
        values: &Values,
        bounds: &Bounds,
        metric: &[Matrix6<f64>],
    ) -> Option<Inertia> {
        let idle = linear.hold_idle_controls();
        let clear = |slack: f64, multiplier: f64| multiplier > CLEAR * slack;
        let doubtful = |slack: f64, multiplier: f64| CLEAR * multiplier > slack;
        let mut below = |shift: f64, held: fn(f64, f64) -> bool| {
            self.assemble_where(linear, values, bounds, held);
            self.shift(metric, shift);
            self.count_negative(linear)
        };
        let count = |counted: Result<usize, TooConcave>| counted.ok();
        let not_positive = count(below(ZERO, clear))?;
        let negative = match not_positive {
            0 => 0,
            _ => count(below(-ZERO, clear))?,
        };
        let is_in_doubt = not_positive > 0 && count(below(-ZERO, doubtful))? != negative;
        (!is_in_doubt).then_some(Inertia {
            negative,
            zero: not_positive - negative,
            idle,
        })
    }

    /// Takes a multiple of the metric off the second derivatives.
    pub(super) fn shift(&mut self, metric: &[Matrix6<f64>], by: f64) {
        self.diagonal.shift(metric, by);
    }
}

impl super::chain::Diagonal {
    /// Takes a multiple of the metric off.
    pub(super) fn shift(&mut self, metric: &[Matrix6<f64>], by: f64) {
        self.states.resize(metric.len(), Matrix6::zeros());
        for (state, metric) in self.states.iter_mut().zip(metric) {
            *state -= by * metric;
        }
    }
}

impl Linearisation {
    /// Holds the controls that neither move anything nor cost anything to second order, and counts them.
    pub(super) fn hold_idle_controls(&mut self) -> usize {
        let mut idle = self.idle_controls();
        for (k, stage) in self.chain.stages.iter().enumerate().rev() {
            let next = idle[k + 1];
            for (i, idle) in idle[k].iter_mut().enumerate() {
                *idle &= stage.tie[i] == 0.0 || next[i];
            }
        }
        let mut held = 0;
        let stages = self.chain.stages.iter_mut().map(|stage| &mut stage.free);
        let free = std::iter::once(&mut self.chain.first_free).chain(stages);
        for (free, idle) in free.zip(idle) {
            for i in 0..2 {
                held += usize::from(free[i] && idle[i]);
                free[i] &= !idle[i];
            }
        }
        held
    }

    /// Of every node, which components of the control have derivatives far below those of a stage that bends.
    fn idle_controls(&self) -> Vec<[bool; 2]> {
        const NOTHING: f64 = 1e-8;
        let stages = self.chain.stages.iter().zip(&self.diagonal.controls);
        let mut most = vec![Vector2::zeros(); self.chain.stages.len() + 1];
        let mut largest: f64 = 0.0;
        for (k, (stage, controls)) in stages.enumerate() {
            let columns = [
                [&stage.growth_by_first, &stage.state_first],
                [&stage.growth_by_second, &stage.state_second],
            ];
            for (end, columns) in columns.into_iter().enumerate() {
                for i in 0..2 {
                    let column = |of: &super::chain::ByControl| of.column(i).amax();
                    let costs = controls.column(2 * end + i).amax();
                    let all = columns.map(column).into_iter().fold(costs, f64::max);
                    let most = &mut most[k + end][i];
                    *most = f64::max(*most, all);
                    largest = largest.max(all);
                }
            }
        }
        for term in &self.diagonal.nodes {
            for i in 0..2 {
                let own = term.hessian.column(6 + i).amax();
                let most = &mut most[term.node][i];
                *most = f64::max(*most, own);
            }
        }
        let is_idle = |most: &f64| *most <= NOTHING * largest;
        most.iter()
            .map(|most| [is_idle(&most[0]), is_idle(&most[1])])
            .collect()
    }
}
