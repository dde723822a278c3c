//! Stability of a belt with flat parts under stress.
//!
//! Where a belt is flat it may begin to bend and to twist in any ratio: the slope of its ribs costs nothing. The energy of
//! that beginning is no square, so that no count of negative modes decides. It has lower bounds that are squares, one for
//! every field of slopes, and it equals the bound where the belt twists along ribs of these slopes:
//!
//! - a bound with positive second variation proves that the belt is stable;
//! - a field of slopes that, held, leaves a direction in which the energy falls proves that the belt is not stable.
//!
//! The lowest eigenvalue of the bound is a concave function of its stiffnesses. The slopes along which the lowest mode twists
//! are those of the bound that raises this mode most, and a step towards them is one of the method of Frank and Wolfe (1956).
//! At the highest bound, bound and energy agree along the mode.

use super::Stability;
use crate::problem::program::{BeltPoint, BeltProgram, Piece, TwistingProgram};
use nalgebra::Vector2;
use stagewise::{Inertia, Mode, Outcome, Program, Stationary, assess, lowest_modes};

/// Count of bounds that are tried, a number.
const BOUNDS: usize = 20;

/// Stability of a stationary point with flat parts; `None` where it is undecided.
pub(super) fn decide(
    program: &BeltProgram,
    tolerance: f64,
    at: &Stationary<BeltPoint>,
) -> Option<Stability> {
    proof(program, tolerance, at).map(|proof| proof.stability)
}

/// The stationary point with flat parts with slopes of their ribs that, held, leave a direction in which the energy falls;
/// `None` of a point that is not known to be unstable.
pub(super) fn unstable_slopes(
    program: &BeltProgram,
    tolerance: f64,
    at: &Stationary<BeltPoint>,
) -> Option<Stationary<BeltPoint>> {
    proof(program, tolerance, at)?.falls_from
}

/// A proof that a stationary point with flat parts is stable, or not.
struct Proof {
    stability: Stability,
    /// The point with slopes of the ribs that, held, leave a direction in which the energy falls; `None` where it is stable.
    falls_from: Option<Stationary<BeltPoint>>,
}

fn proof(program: &BeltProgram, tolerance: f64, at: &Stationary<BeltPoint>) -> Option<Proof> {
    let inside = program.flat_nodes(&at.point);
    if curls(program, &inside) {
        return None;
    }
    let own = at.point.fields.iter().map(|fields| fields[1]);
    let mut slopes: Vec<f64> = own
        .zip(&inside)
        .map(|(own, inside)| if *inside { 0.0 } else { own })
        .collect();
    let widths = program.elements().map(|(_, element)| element.half_width);
    let half_width = widths.fold(0.0, f64::max);
    for round in 0..BOUNDS {
        let (bound, mut bounded) = program.twisting(at, &slopes);
        let found = assess(&bound, tolerance, &bounded);
        let inertia = found
            .inertia
            .filter(|_| found.outcome == Outcome::Converged)?;
        if inertia.negative + inertia.zero == 0 {
            return Some(Proof {
                stability: inertia.into(),
                falls_from: None,
            });
        }
        let modes = lowest_modes(&bound, &mut bounded, 1).ok()?;
        let along = Along::of(&bound, &slopes, modes.first()?);
        let share = 2.0 / (round as f64 + 3.0);
        let nodes = slopes.iter_mut().zip(&along.slopes).zip(&inside);
        for ((slope, along), _) in nodes.filter(|(_, inside)| **inside) {
            let square = *slope * *slope;
            *slope = (square + share * (along * along - square)).sqrt();
        }
        for reach in [half_width, f64::INFINITY] {
            let signed = along.signed(&slopes, &inside, reach);
            let Some(slanted) = slanted(program, at, &inside, &signed) else {
                continue;
            };
            let found = assess(program, tolerance, &slanted);
            // Where the parts beside bend a little, steep ribs are out of balance, and the count proves nothing.
            let is_balanced = found.outcome == Outcome::Converged;
            let falls = |inertia: &Inertia| is_balanced && inertia.negative > 0;
            if let Some(inertia) = found.inertia.filter(falls) {
                return Some(Proof {
                    stability: inertia.into(),
                    falls_from: Some(slanted),
                });
            }
        }
    }
    None
}

/// Whether a flat part has a natural bend: its energy is not even in the bend, and no square bounds it.
fn curls(program: &BeltProgram, inside: &[bool]) -> bool {
    let mut elements = program.elements();
    elements.any(|(k, element)| element.curl.bend != 0.0 && (inside[k] || inside[k + 1]))
}

/// How a mode bends and twists at every node.
struct Along {
    /// Arc length, in U.
    places: Vec<f64>,
    /// Magnitude of the slope of the ribs, |τ/ω|, as steep as ribs can gain anything.
    slopes: Vec<f64>,
    /// Product of bend and torsion.
    products: Vec<f64>,
}

impl Along {
    fn of(bound: &TwistingProgram, slopes: &[f64], mode: &Mode<9>) -> Self {
        let steepest = bound.model.model.steepest();
        let nodes = mode.motion.iter().zip(slopes);
        let rates = nodes.map(|(motion, slope)| [motion[6], motion[8] - slope * motion[6]]);
        let (slopes, products) = rates
            // Where nothing moves, NaN, the slope is as steep as can be.
            .map(|[bend, torsion]| ((torsion / bend).abs().min(steepest), bend * torsion))
            .unzip();
        Self {
            places: bound.nodes(),
            slopes,
            products,
        }
    }

    /// Slopes of given magnitudes inside flat parts, with the sign that the mode has on average within a reach: ribs cannot
    /// turn over in less than a half width.
    fn signed(&self, slopes: &[f64], inside: &[bool], reach: f64) -> Vec<f64> {
        let signed = |k: usize| {
            let is_near = |at: &f64| (at - self.places[k]).abs() <= reach;
            let around = self.places.iter().zip(&self.products);
            let around = around.filter(|(at, _)| is_near(at));
            let product: f64 = around.map(|(_, product)| product).sum();
            match inside[k] {
                true => slopes[k].copysign(-product),
                false => slopes[k],
            }
        };
        (0..slopes.len()).map(signed).collect()
    }
}

/// The stationary point with these slopes of the ribs inside flat parts, as far as ribs do not cross, their bounds without
/// forces; `None` where ribs cross in spite of that.
fn slanted(
    program: &BeltProgram,
    at: &Stationary<BeltPoint>,
    inside: &[bool],
    slopes: &[f64],
) -> Option<Stationary<BeltPoint>> {
    let mut slanted = at.clone();
    let given = |(k, fields): (usize, &Vector2<f64>)| match inside[k] {
        true => program.fixed_slope(k),
        false => Some(fields[1]),
    };
    let given: Vec<_> = at.point.fields.iter().enumerate().map(given).collect();
    let slopes = gentle(program, &given, slopes);
    for (fields, slope) in slanted.point.fields.iter_mut().zip(slopes) {
        fields[1] = slope;
    }
    program.settle(&mut slanted.point);
    let layout = program.layout();
    for (k, _) in program
        .elements()
        .filter(|(k, _)| inside[*k] || inside[k + 1])
    {
        slanted.multipliers.inequalities[layout.stage_rows(k)].fill(0.0);
    }
    (program.least_slack(&slanted.point) > 0.0).then_some(slanted)
}

/// Slopes that change no faster than ribs may converge, with some of them given: the mean of the largest such field below the
/// wanted slopes and the smallest above, as near as the given slopes allow.
fn gentle(program: &BeltProgram, given: &[Option<f64>], wanted: &[f64]) -> Vec<f64> {
    /// Convergence of ribs as a share of that at which they cross.
    const SHARE: f64 = 0.9;
    let step = |piece: &Piece| match piece {
        Piece::Strip(element) => SHARE * element.length / element.half_width,
        Piece::Rigid { .. } | Piece::Joint { .. } => f64::INFINITY,
    };
    let steps: Vec<f64> = program.pieces.iter().map(step).collect();
    let below = |mut field: Vec<f64>| {
        for (k, step) in steps.iter().enumerate() {
            field[k + 1] = field[k + 1].min(field[k] + step);
        }
        for (k, step) in steps.iter().enumerate().rev() {
            field[k] = field[k].min(field[k + 1] + step);
        }
        field
    };
    let above = |field: Vec<f64>| -> Vec<f64> {
        let negative = below(field.iter().map(|slope| -slope).collect());
        negative.into_iter().map(|slope| -slope).collect()
    };
    let or = |none: f64| given.iter().map(|slope| slope.unwrap_or(none)).collect();
    let (highest, lowest) = (below(or(f64::INFINITY)), above(or(f64::NEG_INFINITY)));
    let fields = below(wanted.to_vec())
        .into_iter()
        .zip(above(wanted.to_vec()));
    let limits = lowest.into_iter().zip(highest);
    fields
        .zip(limits)
        .map(|((low, high), (lowest, highest))| (0.5 * (low + high)).max(lowest).min(highest))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::equilibrium::guess::guess;
    use crate::problem::Problem;
    use crate::scenario::EnergyModel;
    use crate::scenario::{BeltSpec, Component, Place, Scenario, SegmentSpec, SupportSpec};
    use stagewise::{Settings, minimise};
    use std::ops::ControlFlow;

    /// Stability of a flat cantilever on edge, its rib at the clamp free, under a weight in R_f/U².
    fn on_edge(energy: EnergyModel, weight: f64) -> Option<bool> {
        let mut belt = BeltSpec::new(0.1, 1.0, vec![SegmentSpec::straight(1.0)]);
        belt.density = 1.0;
        let mut scenario = Scenario::new(belt);
        scenario.energy = Some(energy);
        let mut clamp = SupportSpec::new(Place::Start);
        clamp.position = Some([Component::Held(0.0); 3]);
        clamp.rotation = Some([0.0; 3]);
        clamp.square_rib = Some(false);
        scenario.supports = vec![clamp];
        scenario.loads.gravity = Some([0.0, 0.0, -weight]);
        let problem = Problem::new(scenario).unwrap();
        let program = problem.program(80);
        let mut flat = guess(&program, &problem.bulge());
        flat.fields.fill(Vector2::zeros());
        program.settle(&mut flat);
        let settings = Settings {
            tolerance: 1e-8,
            iterations: 100,
            barrier: 1e-6,
            longest_step: f64::INFINITY,
        };
        let found = minimise(&program, &settings, flat, &mut || ControlFlow::Continue(()));
        assert_eq!(found.outcome, Outcome::Converged);
        assert!(found.at.point.fields.iter().all(|fields| fields[0] == 0.0));
        decide(&program, 1e-8, &found.at).and_then(|stability| stability.is_stable())
    }

    #[test]
    fn test_belt_on_edge_is_stable_up_to_the_weight_at_which_it_buckles_along_slanted_ribs() {
        // 21.491 R_f/U² in the narrow limit; the other energies are no lower.
        assert_eq!(on_edge(EnergyModel::Sadowsky, 21.4), Some(true));
        assert_eq!(on_edge(EnergyModel::Sadowsky, 21.6), Some(false));
        assert_eq!(on_edge(EnergyModel::Wunderlich, 21.4), Some(true));
        assert_eq!(on_edge(EnergyModel::Wunderlich, 25.0), Some(false));
        // A bar of torsional stiffness 5/2 beside its bending stiffness 1 buckles at 12.85 √2.5 (Michell 1899).
        assert_eq!(on_edge(EnergyModel::Fishbone, 20.3), Some(true));
    }
}
