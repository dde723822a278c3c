//! One Newton step toward a stationary point, and what single nodes could gain.

use super::PrimalDual;
use crate::linear::chain::NodeVector;
use crate::program::{Multipliers, Program, Stationary};
use crate::scaled::Scaled;
use nalgebra::{SMatrix, SVector};

/// What one Newton step makes of a point near to a stationary point.
#[derive(Debug, Clone, PartialEq)]
pub struct Correction<P> {
    /// The corrected point; it may violate inequalities.
    pub point: P,
    /// Multipliers of the equalities there.
    pub equalities: Vec<f64>,
    /// Objective of the stationary point, to second order.
    pub objective: f64,
    /// By how much the controls of every node alone can lower the objective, to second order, where all other controls and
    /// all multipliers are held; not negative.
    ///
    /// Where stages of a solved programme are split in two, the gains of the new nodes estimate by stage what the solved
    /// programme has missed.
    ///
    /// Source: R. E. Bank and R. K. Smith, "A posteriori error estimates based on hierarchical bases" (1993)
    pub gains: Vec<f64>,
}

/// One Newton step from a point near to a stationary point, minimum or not; `None` where the system is singular or the
/// step leaves the domain.
///
/// `tolerance` is the residual of a converged point, which sets the barrier.
pub fn correct<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
    tolerance: f64,
    near: Stationary<P::Point>,
) -> Option<Correction<P::Point>> {
    let Some(scaled) = Scaled::of(program, &near.point) else {
        return corrected(program, tolerance, near);
    };
    let own = corrected(&scaled, tolerance, scaled.own(&near))?;
    let gains = own.gains.iter();
    let multipliers = Multipliers {
        equalities: own.equalities,
        inequalities: Vec::new(),
    };
    Some(Correction {
        point: own.point,
        equalities: scaled.multipliers_of_original(&multipliers).equalities,
        objective: scaled.objective_of_original(own.objective),
        gains: gains
            .map(|gain| scaled.objective_of_original(*gain))
            .collect(),
    })
}

/// One Newton step from a point near to a stationary point, in the units of a programme.
fn corrected<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    program: &P,
    tolerance: f64,
    near: Stationary<P::Point>,
) -> Option<Correction<P::Point>> {
    /// Damping of directions that cost nothing, along which the gradient has no part; second derivative per unit weight.
    const FREE: f64 = 1e-6;
    let (mut iterate, _) = PrimalDual::new(program, 0.0, near.point);
    iterate.multipliers = near.multipliers;
    iterate.set_barrier(tolerance);
    iterate.linearise();
    iterate.residuals();
    iterate.assemble();
    let curvatures = iterate.kkt.control_curvatures();
    let nodes = iterate.gradient.iter().zip(&curvatures);
    let gains = nodes.map(|(gradient, curvature)| gain::<X, U, N>(gradient, curvature));
    let gains = gains.collect();
    let kkt = &mut iterate.kkt;
    if kkt.factorise_damped(0.0).is_err() && kkt.factorise_exactly().is_err() {
        kkt.factorise_damped(FREE).ok()?;
    }
    let stationarity = iterate.gradient.clone();
    iterate.find_step();
    let objective = predicted(&iterate, &stationarity);
    // A step along which inequalities are violated tells as much.
    let is_inside = iterate.try_step(1.0);
    if !is_inside && iterate.trial_values.equalities.len() < iterate.values.equalities.len() {
        return None;
    }
    iterate.take_trial();
    let multipliers = iterate.multipliers.equalities.iter();
    let equalities = multipliers.zip(&iterate.kkt.multiplier_step);
    Some(Correction {
        objective,
        equalities: equalities.map(|(own, step)| own + step).collect(),
        point: iterate.point,
        gains,
    })
}

/// The objective where the step ends, by the quadratic model: f + ½ (g·p + (2λ + Δλ)·c) along a step p, Δλ, from a point of
/// objective f, equalities c and Lagrangian gradient g.
fn predicted<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize>(
    iterate: &PrimalDual<P, X, U, N>,
    stationarity: &[NodeVector<N>],
) -> f64 {
    let steps = stationarity.iter().zip(&iterate.kkt.step);
    let along: f64 = steps.map(|(gradient, step)| gradient.dot(step)).sum();
    let multipliers = iterate.multipliers.equalities.iter();
    let rows = multipliers.zip(&iterate.kkt.multiplier_step);
    let rows = rows.zip(&iterate.values.equalities);
    let missed = rows.map(|((multiplier, step), row)| (2.0 * multiplier + step) * row);
    iterate.values.objective + 0.5 * (along + missed.sum::<f64>())
}

/// Half of a gradient by controls times the Newton step; of concave controls, of each of the others alone.
fn gain<const X: usize, const U: usize, const N: usize>(
    gradient: &NodeVector<N>,
    curvature: &SMatrix<f64, U, U>,
) -> f64 {
    let gradient: SVector<f64, U> = gradient.fixed_rows::<U>(X).into_owned();
    let gain = match curvature.cholesky() {
        Some(factor) => gradient.dot(&factor.solve(&gradient)),
        None => (0..U)
            .filter(|i| curvature[(*i, *i)] > 0.0)
            .map(|i| gradient[i] * gradient[i] / curvature[(i, i)])
            .sum(),
    };
    0.5 * gain
}
