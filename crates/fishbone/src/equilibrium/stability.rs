//! Stability of an equilibrium by the second variation of the energy.

use super::{Equilibrium, flat};
use crate::problem::Problem;
use crate::problem::program::{BeltPoint, BeltProgram, ROWS};
use crate::strip::density::Density;
use nalgebra::{Vector2, Vector3};
use stagewise::{Inertia, Outcome, Solution, Stationary, assess};

/// The inertia of the second variation of the energy at an equilibrium, on the shapes that its supports and its active rib
/// bounds leave free.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct Stability {
    /// Number of independent directions in which the energy falls.
    pub negative_modes: usize,
    /// Number of independent directions in which the energy is constant to second order.
    pub zero_modes: usize,
    /// Number of zero modes that change nothing at any order: motions of the whole belt that its supports leave, and of a
    /// uniform closed belt along itself.
    pub symmetries: usize,
}

impl Stability {
    /// Whether the equilibrium is a local minimum but for its symmetries; `None` where another direction of zero second
    /// variation leaves the answer open.
    pub(crate) fn is_stable(&self) -> Option<bool> {
        match (self.negative_modes, self.zero_modes - self.symmetries) {
            (0, 0) => Some(true),
            (0, _) => None,
            _ => Some(false),
        }
    }
}

impl Equilibrium {
    /// Whether the equilibrium is a local minimum; `None` where this is undecided.
    pub fn stable(&self) -> Option<bool> {
        self.stability?.is_stable()
    }
}

/// A solution without any bend and with square ribs in place of its own where the belt is flat all along but for rounding: the
/// slope of these ribs costs nothing, and bends across slanted ribs are stiffer than across square ones. Their bounds bear no
/// force, and count with none, but keep the multipliers of the last barrier, from which a search may begin.
pub(super) fn with_square_ribs(
    problem: &Problem,
    program: &BeltProgram,
    solution: Solution<BeltPoint>,
) -> Solution<BeltPoint> {
    let mut at = solution.at.clone();
    let is_flat = at.point.is_flat() && !program.is_curled();
    if !is_flat || solution.outcome != Outcome::Converged {
        return solution;
    }
    at.point.fields.fill(Vector2::zeros());
    at.multipliers.inequalities.fill(0.0);
    program.settle(&mut at.point);
    if program.least_slack(&at.point) <= 0.0 {
        return solution;
    }
    let mut square = assess(program, problem.tolerance(), &at).after(solution.iterations);
    if square.outcome != Outcome::Converged {
        return solution;
    }
    square.at.multipliers.inequalities = solution.at.multipliers.inequalities;
    square.residuals.complementarity = solution.residuals.complementarity;
    square
}

/// Stability of a solution by its second variation, on all motions that its scenario leaves; `None` where it is undecided.
///
/// Where a part of the belt is flat, every slope of its ribs costs the same. With these slopes held the second variation shows
/// whether a belt without stress is stable. Under stress it can only show that the belt is not stable, and
/// [`flat::decide`] goes on.
pub(super) fn decide(
    problem: &Problem,
    program: &BeltProgram,
    solution: &Solution<BeltPoint>,
    internal: &[(Vector3<f64>, Vector3<f64>)],
) -> Option<Stability> {
    /// Internal force and moment up to which a belt counts as unstressed, in mean R_f/U² and mean R_f/U.
    const UNSTRESSED: f64 = 1e-6;
    let free = left_free(problem, program, &solution.at);
    let inertia = match &free {
        Some((program, at)) => assess(program, problem.tolerance(), at).inertia,
        None => solution.inertia,
    }?;
    let stress = |(force, moment): &(Vector3<f64>, Vector3<f64>)| force.amax().max(moment.amax());
    let is_stressed = internal.iter().any(|wrench| stress(wrench) > UNSTRESSED);
    let is_open = inertia.cost_free > 0 && is_stressed && inertia.negative == 0;
    match is_open {
        true => flat::decide(program, problem.tolerance(), &solution.at),
        // The bend of a belt at its inextensible limit is what rounding of its length leaves, and so are its modes.
        false if inertia.negative > 0 && problem.has_no_slack() => None,
        // Negative modes of a shape without energy are those of rounding: no motion lowers it.
        false if program.is_at_rest(&solution.at.point) => Some(Stability {
            negative_modes: 0,
            ..inertia.into()
        }),
        false => Some(inertia.into()),
    }
}

impl From<Inertia> for Stability {
    fn from(inertia: Inertia) -> Self {
        Self {
            negative_modes: inertia.negative,
            zero_modes: inertia.zero + inertia.symmetries,
            symmetries: inertia.symmetries,
        }
    }
}

/// The programme and its solution without the support at rest, if nothing else holds or loads the belt: that support only
/// chooses one of equal poses, and bears nothing.
pub(crate) fn left_free<D: Density<F>, const F: usize, const N: usize>(
    problem: &Problem,
    program: &BeltProgram<D, F, N>,
    at: &Stationary<BeltPoint<F>>,
) -> Option<(BeltProgram<D, F, N>, Stationary<BeltPoint<F>>)> {
    let scenario = problem.scenario();
    let is_held = !scenario.supports.is_empty() || !scenario.links.is_empty();
    if is_held || program.is_loaded() {
        return None;
    }
    let mut at = at.clone();
    at.multipliers.equalities.drain(..ROWS);
    Some((program.clone().with_supports(Vec::new()), at))
}
