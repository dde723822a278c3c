//! Strips that are flat: they may begin to bend and to twist in any ratio, by the slope of ribs that costs nothing so far.
//!
//! A strip of bend ω and torsion τ has ribs of the slope β = −τ/ω, and at unit rigidity at least the energy
//! w(τ²/ω²) ω²/2 with w(t) = (1+t)^p. As w is convex, its tangent at any slope β bounds the energy from below by a square:
//!
//! ```text
//! w(τ²/ω²) ω² ≥ (w(β²) − β² w'(β²)) ω² + w'(β²) τ²,   equal where τ² = β² ω²
//! ```
//!
//! At β = 0 the strip of the square has the bending stiffness 1 and the torsional stiffness p.

use super::automatic;
use super::density::{Density, Section};
use super::developable::DevelopableEnergy;
use num_dual::DualNum;

/// Bend up to which a node is flat, in 1/U.
pub(crate) const FLAT: f64 = 1e-8;

/// A density of bend, rib slope and excess torsion: the torsion is that of the ribs, −β ω_ζ, plus the excess.
///
/// An element whose two nodes are flat has the square of its slope, a lower bound of the energy for every torsion and equal
/// to the energy where the torsion is that of the ribs. Other elements have the density of a developable belt; there is no
/// excess.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FreeTorsion {
    /// The density of a developable belt.
    pub(crate) model: DevelopableEnergy,
}

impl Density<3> for FreeTorsion {
    type Motions = automatic::Motions<3>;
    type Derivatives = automatic::Derivatives<3>;

    fn value<T: DualNum<Primitive = f64> + Copy>(&self, section: &Section<'_, T, 3>) -> T {
        let is_flat = section.ends.iter().all(|end| end[0].re().abs() <= FLAT);
        let [bend, slope, _] = section.fields;
        if is_flat {
            let [torsion, _] = self.torsion_and_bend(&section.fields);
            let [bending, twisting] = self.model.stiffnesses(slope);
            return (bending * bend * bend + twisting * torsion * torsion) * 0.5;
        }
        let two = |fields: &[T; 3]| [fields[0], fields[1]];
        Density::<2>::value(
            &self.model,
            &Section {
                fields: two(&section.fields),
                rates: two(&section.rates),
                ends: [two(&section.ends[0]), two(&section.ends[1])],
                element: section.element,
                stock: section.stock,
            },
        )
    }

    fn torsion_and_bend<T: DualNum<Primitive = f64> + Copy>(&self, fields: &[T; 3]) -> [T; 2] {
        let [bend, slope, excess] = *fields;
        [excess - slope * bend, bend]
    }
}

impl DevelopableEnergy {
    /// Bending and torsional stiffness, at unit rigidity, of the square that bounds the energy from below and touches it
    /// where ribs have a slope. The bending stiffness is not negative up to [`Self::steepest`].
    fn stiffnesses<T: DualNum<Primitive = f64> + Copy>(self, slope: T) -> [T; 2] {
        let square = slope * slope;
        let stretch = square + 1.0;
        let p = self.exponent();
        let factor = match self {
            Self::Fishbone => stretch * stretch.sqrt(),
            Self::Sadowsky | Self::Wunderlich => stretch,
        };
        [factor * (square * (1.0 - p) + 1.0), factor * p]
    }

    /// Slope of the ribs beyond which a strip that begins to twist gains nothing: its bound is that of torsion alone.
    pub(crate) fn steepest(self) -> f64 {
        (self.exponent() - 1.0).recip().sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strip::element::{Curl, Element};
    use proptest::prelude::*;

    const MODELS: [DevelopableEnergy; 3] = [
        DevelopableEnergy::Fishbone,
        DevelopableEnergy::Sadowsky,
        DevelopableEnergy::Wunderlich,
    ];

    /// Energy of an element of uniform bend and rib slopes at its ends.
    fn energy(model: DevelopableEnergy, geodesic: f64, bend: f64, slopes: [f64; 2]) -> f64 {
        let element = Element {
            geodesic,
            ..Element::straight(0.1, 0.05, Curl::default())
        };
        let ends = slopes.map(|slope| nalgebra::Vector2::new(bend, slope));
        Density::<2>::energy(&model, &element, [&ends[0], &ends[1]])
    }

    proptest! {
        #[test]
        fn test_square_is_no_more_than_the_energy_for_any_torsion_and_touches_it(
            bend in 0.1f64..2.0, slope in -3f64..3.0, touching in 0f64..1.0,
        ) {
            for model in MODELS {
                let touching = touching * model.steepest();
                let square = |at: f64, slope: f64| {
                    let [a, b]: [f64; 2] = model.stiffnesses(at);
                    prop_assert!(a >= -1e-12);
                    Ok(0.05 * bend * bend * (a + b * slope * slope))
                };
                let energy = energy(model, 0.0, bend, [slope; 2]);
                prop_assert!(square(touching, slope)? <= energy * (1.0 + 1e-12));
                let touched = slope.abs().min(model.steepest());
                let own = self::energy(model, 0.0, bend, [touched; 2]);
                prop_assert!((square(touched, touched)? - own).abs() <= 1e-12 * own);
            }
        }

        #[test]
        fn test_softened_square_is_no_more_than_the_energy_of_an_arc(
            geodesic in -8f64..8.0, slope in -0.9f64..0.9, touching in 0f64..1.0,
        ) {
            let softened = 1.0 / (1.0 + geodesic.abs() * 0.05);
            for model in MODELS {
                let [a, b]: [f64; 2] = model.stiffnesses(touching * model.steepest());
                let square = 0.05 * softened * (a + b * slope * slope);
                let energy = energy(model, geodesic, 1.0, [slope; 2]);
                // Ribs that cross before the edge have none.
                prop_assume!(energy.is_finite());
                prop_assert!(square <= energy);
            }
        }
    }
}
