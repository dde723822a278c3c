//! The corrector: Newton's method onto a curve of stationary points.

use super::continuation::Continuation;
use super::curve::{Station, Tangent};
use super::family::Family;
use crate::interior_point::Residuals;
use crate::larger;
use crate::linear::modes::dot;
use crate::linear::{Direction, Response};
use crate::program::{Program, Stationary};

/// The programme and the system at a point where Newton's method has converged.
pub(super) struct Arrival<P, const X: usize, const U: usize, const N: usize> {
    program: P,
    response: Response<X, U, N>,
    parameter: f64,
    residuals: Residuals,
}

impl<F: Family<X, U, N>, const X: usize, const U: usize, const N: usize>
    Continuation<'_, F, X, U, N>
{
    /// The station at a length along a direction from another station.
    pub(super) fn step(
        &self,
        from: &Station<F::Point, N>,
        along: &Tangent<N>,
        length: f64,
    ) -> Option<Station<F::Point, N>> {
        let mut at = from.at.clone();
        let arrival = self.correct(&mut at, from.parameter, Some((along, length)))?;
        self.station(at, arrival, Some(along))
    }

    /// Newton's method at a fixed parameter, or at a fixed length along a direction. The lateral distance is bounded: beyond
    /// the bound, another curve may be nearer.
    pub(super) fn correct(
        &self,
        at: &mut Stationary<F::Point>,
        mut parameter: f64,
        along: Option<(&Tangent<N>, f64)>,
    ) -> Option<Arrival<F::Program, X, U, N>> {
        /// Largest count of Newton steps of one correction; a number.
        const CORRECTIONS: usize = 20;
        /// Length of a lateral step that is rounding; in [`Scales::distance`](crate::Scales::distance).
        const ROUNDING: f64 = 1e-6;
        /// Lateral distance that a change of softness may lead to; in [`Scales::distance`](crate::Scales::distance).
        const BY_SOFTNESS: f64 = 0.02;
        let mut left = along.map_or(0.0, |(_, length)| length);
        let mut aside = 0.0;
        for _ in 0..CORRECTIONS {
            let program = self.family.at(parameter)?;
            let mut response = Response::of_stationary(&program, at).ok()?;
            let barrier = self.barrier(&program);
            let multipliers = &at.multipliers.inequalities;
            let missed = response.conditions(multipliers, barrier);
            let residuals = response.residuals(&missed, multipliers);
            let is_met = larger(residuals.stationarity, residuals.constraint) <= self.tolerance
                && response.is_centred(multipliers, barrier);
            if is_met && left == 0.0 {
                return Some(Arrival {
                    program,
                    response,
                    parameter,
                    residuals,
                });
            }
            let mut step = response.solve_nearly(&missed).ok()?;
            let mut moved = 0.0;
            let mut drift = None;
            if let Some((along, length)) = along {
                let by_parameter = self
                    .family
                    .conditions_by_parameter(&program, at, parameter)?;
                let answer = response.solve_nearly(&by_parameter).ok()?;
                moved = (left - dot(&along.force, &step.nodes))
                    / (along.parameter + dot(&along.force, &answer.nodes));
                if !moved.is_finite() {
                    return None;
                }
                step.add(moved, &answer);
                drift = Some(by_parameter);
                let force = response.force_with_slacks(&step.nodes);
                let way = dot(&force, &step.nodes) + moved * moved;
                aside += (way - left * left).max(0.0).sqrt();
                let widest = if length == 0.0 {
                    BY_SOFTNESS * self.unit
                } else {
                    length.abs().max(ROUNDING * self.unit)
                };
                if aside > widest {
                    return None;
                }
            }
            let mut rates = response.slack_rates(&step.nodes);
            if let Some(drift) = drift {
                for (rate, drift) in rates.iter_mut().zip(&drift.inequalities) {
                    *rate += moved * drift;
                }
            }
            let taken = move_along(&program, &response, at, &step, &rates);
            parameter += taken * moved;
            left *= 1.0 - taken;
        }
        None
    }

    /// The station at a point where Newton's method has converged.
    pub(super) fn station(
        &self,
        at: Stationary<F::Point>,
        mut arrival: Arrival<F::Program, X, U, N>,
        before: Option<&Tangent<N>>,
    ) -> Option<Station<F::Point, N>> {
        let parameter = arrival.parameter;
        let by_parameter = self
            .family
            .conditions_by_parameter(&arrival.program, &at, parameter)?;
        let negative = arrival.response.negative();
        let motion = arrival.response.solve_nearly(&by_parameter).ok()?;
        let mut tangent = Tangent {
            force: arrival.response.force_with_slacks(&motion.nodes),
            motion,
            parameter: 1.0,
        };
        tangent.scale(tangent.dot(&tangent).sqrt().recip());
        if before.is_some_and(|before| tangent.dot(before) < 0.0) {
            tangent.turn_round();
        }
        Some(Station {
            parameter,
            at,
            objective: arrival.response.values().objective,
            residuals: arrival.residuals,
            negative,
            tangent,
        })
    }
}

/// Moves a point and its multipliers along the share of a step that keeps slacks and multipliers positive; gives the share.
/// The rates are the slacks' changes along the whole step.
fn move_along<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
    response: &Response<X, U, N>,
    at: &mut Stationary<P::Point>,
    step: &Direction<N>,
    rates: &[f64],
) -> f64 {
    /// Share of a slack or a multiplier that one step may take off; dimensionless.
    const KEEP: f64 = 0.995;
    let slacks = &response.values().slacks;
    let mut primal = 1.0;
    for (rate, slack) in rates.iter().zip(slacks) {
        if *rate * primal < -KEEP * slack {
            primal = -KEEP * slack / *rate;
        }
    }
    let mut moved = at.point.clone();
    program.retract(&at.point, &step.nodes, primal, &mut moved);
    at.point = moved;
    for (row, step) in at.multipliers.equalities.iter_mut().zip(&step.equalities) {
        *row += primal * step;
    }
    for (row, multiplier) in at.multipliers.inequalities.iter_mut().enumerate() {
        let next = *multiplier - primal * step.inequalities[row];
        // The multiplier of an inequality that becomes inactive falls as its slack grows, and does not shorten the step.
        let let_go = *multiplier * slacks[row] / (slacks[row] + primal * rates[row]);
        let goes_on = next > (1.0 - KEEP) * *multiplier;
        *multiplier = if goes_on { next } else { let_go };
    }
    primal
}
