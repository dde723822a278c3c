//! The logarithmic barrier, which keeps slacks and their multipliers positive.

use crate::layout::Layout;
use crate::program::Values;
use crate::{larger, largest};

/// A barrier on all slacks, each with its weight.
#[derive(Debug, Clone)]
pub(crate) struct Barrier {
    /// Barrier parameter, an objective per unit weight.
    pub(crate) parameter: f64,
    /// Weight of every slack.
    weights: Vec<f64>,
    /// The largest weight of a stage.
    heaviest: f64,
    /// Ranges of rows over which logarithms are summed: one range a stage, then one a row of the other inequalities.
    stages: Vec<std::ops::Range<usize>>,
}

/// Step lengths: of the unknowns, and of the inequalities' multipliers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lengths {
    pub(crate) primal: f64,
    pub(crate) dual: f64,
}

impl Barrier {
    pub(crate) fn new(parameter: f64, layout: &Layout) -> Self {
        let others = layout.inequalities_at_stages()..layout.inequalities();
        let stages = (0..layout.stages()).map(|stage| layout.stage_rows(stage));
        Self {
            parameter,
            weights: layout.row_weights().to_vec(),
            heaviest: largest(layout.stage_weights().iter().chain(layout.row_weights())),
            stages: stages.chain(others.map(|row| row..row + 1)).collect(),
        }
    }

    /// The largest weight.
    pub(crate) fn heaviest(&self) -> f64 {
        self.heaviest
    }

    /// The parameter at which a point of a residual counts as converged.
    pub(crate) fn least(&self, tolerance: f64) -> f64 {
        0.1 * tolerance / self.heaviest
    }

    /// The product of slack and multiplier on the central path.
    pub(crate) fn target(&self, row: usize) -> f64 {
        self.parameter * self.weights[row]
    }

    /// Barrier function: the objective less the weighted logarithms of the slacks.
    pub(crate) fn merit(&self, values: &Values) -> f64 {
        let of_stage = |rows: &std::ops::Range<usize>| {
            let logarithms = values.slacks[rows.clone()].iter().map(|slack| slack.ln());
            self.weights
                .get(rows.start)
                .map_or(0.0, |weight| weight * logarithms.sum::<f64>())
        };
        let logarithms: f64 = self.stages.iter().map(of_stage).sum();
        values.objective - self.parameter * logarithms
    }

    /// The largest difference of slack times multiplier from `parameter` times its weight.
    pub(crate) fn complementarity(
        &self,
        parameter: f64,
        slacks: &[f64],
        multipliers: &[f64],
    ) -> f64 {
        let rows = multipliers.iter().zip(slacks).zip(&self.weights);
        rows.fold(0.0, |most, ((multiplier, slack), weight)| {
            larger(most, (multiplier * slack - parameter * weight).abs())
        })
    }

    /// Lowers the parameter superlinearly, down to `least`.
    pub(crate) fn lower(&mut self, least: f64) {
        self.parameter = least.max((0.2 * self.parameter).min(self.parameter.powf(1.5)));
    }

    /// Step of the multipliers toward the central path, and the step lengths that keep slacks and multipliers positive.
    pub(crate) fn find_step(
        &self,
        slacks: &[f64],
        multipliers: &[f64],
        rates: &[f64],
        stiffness: &[f64],
        steps: &mut [f64],
    ) -> Lengths {
        let keep = (1.0 - self.parameter).clamp(0.99, 1.0 - 1e-9);
        let mut lengths = Lengths {
            primal: 1.0,
            dual: 1.0,
        };
        let rows = slacks.iter().zip(multipliers).zip(rates);
        let rows = rows.zip(stiffness).zip(&self.weights);
        for (step, ((((slack, multiplier), rate), stiffness), weight)) in steps.iter_mut().zip(rows)
        {
            let (slack, multiplier, rate) = (*slack, *multiplier, *rate);
            let central = self.parameter * weight / slack;
            *step = central - multiplier - stiffness * rate;
            if rate < 0.0 {
                lengths.primal = lengths.primal.min(-keep * slack / rate);
            }
            if *step < 0.0 {
                lengths.dual = lengths.dual.min(-keep * multiplier / *step);
            }
        }
        lengths
    }

    /// Moves multipliers along their step, and resets a multiplier that is too far from the central path.
    pub(crate) fn advance(
        &self,
        slacks: &[f64],
        length: f64,
        steps: &[f64],
        multipliers: &mut [f64],
    ) {
        /// Ratio of a multiplier to its value on the central path beyond which it is reset; dimensionless.
        const SPREAD: f64 = 1e10;
        let rows = slacks.iter().zip(steps).zip(&self.weights);
        for (multiplier, ((slack, step), weight)) in multipliers.iter_mut().zip(rows) {
            let central = self.parameter * weight / slack;
            *multiplier = (*multiplier + length * step).clamp(central / SPREAD, central * SPREAD);
        }
    }
}
