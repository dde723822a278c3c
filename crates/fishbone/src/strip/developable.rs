//! Bending energy of the belt per unit length of the spine: the three models, Eq. (34) and its successors.

use crate::names::named;
use crate::strip::element::Curl;
use crate::strip::ribs::{Across, Scaled};
use nalgebra::{Matrix2, Vector2};
use num_dual::DualNum;

named! {
    /// Bending energy per unit length of the spine.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
    pub enum DevelopableEnergy {
        /// The source's: R_f/2 · sqrt(1+β²) · κ₁², Eq. (34).
        Fishbone = "fishbone",
        /// Narrow limit of the developable plate: R_f/2 · κ₁².
        Sadowsky = "sadowsky",
        /// Developable plate of finite width: R_f/2 · κ₁² · artanh(y)/y with y = sV/2.
        #[default]
        Wunderlich = "wunderlich",
    }
}

/// A term of the density with its first and second derivatives by (bend, slope).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Term {
    /// Value.
    pub value: f64,
    /// Gradient.
    pub gradient: Vector2<f64>,
    /// Hessian.
    pub hessian: Matrix2<f64>,
}

impl DevelopableEnergy {
    /// The density that a search solves with where this one leads to no minimum: `wunderlich`, which keeps the ribs apart of
    /// itself, and for `wunderlich` the density that lets them come close.
    pub(crate) fn stand_in(self) -> Self {
        match self {
            Self::Wunderlich => Self::Sadowsky,
            Self::Fishbone | Self::Sadowsky => Self::Wunderlich,
        }
    }

    /// Whether the density depends on the width of the board.
    pub(crate) fn knows_width(self) -> bool {
        self == Self::Wunderlich
    }

    /// Energy per unit length at unit rigidity; the numbers may carry derivatives.
    ///
    /// With the natural bend k the energy is that of a plate whose unloaded state is a cylinder: the bracket
    /// κ₁² − 2k ω_ζ (1 + ν β²) + k², each term times its factor of the width, [`Across`]. The source's model has no plate
    /// behind it and takes the bracket times sqrt(1+β²).
    ///
    /// Source: Eq. (29), (34), in β: written in ω_η/ω_ζ it is singular where the belt is not bent.
    pub(crate) fn value<W: DualNum<Primitive = f64> + Copy, D: Scaled<W>>(
        self,
        bend: D,
        slope: D,
        curl: &Curl<W>,
        across: &Across<D>,
    ) -> D {
        let across = match self.knows_width() {
            true => *across,
            false => Across::PLAIN.map(D::from),
        };
        let square = slope * slope;
        let stretch = square + 1.0;
        let factor = match self {
            Self::Fishbone => stretch.sqrt(),
            Self::Sadowsky | Self::Wunderlich => D::one(),
        };
        let bent = bend * bend * stretch * stretch * across.bending;
        let mixed = bend * (square * curl.poisson + 1.0) * across.length * (curl.bend * -2.0);
        let natural = across.area * curl.bend.powi(2);
        (bent + mixed + natural) * factor * 0.5
    }

    /// The term in κ₁² at unit rigidity, before the width's factor.
    #[inline(always)]
    pub(crate) fn bending(self, bend: f64, slope: f64) -> Term {
        let c = self.slope_factor(slope);
        let half = 0.5 * bend * bend;
        Term {
            value: half * c[0],
            gradient: Vector2::new(bend * c[0], half * c[1]),
            hessian: Matrix2::new(c[0], bend * c[1], bend * c[1], half * c[2]),
        }
    }

    /// The term linear in the bend, −k ω_ζ (1 + ν β²), before the width's factor.
    pub(crate) fn mixed(self, bend: f64, slope: f64, curl: &Curl) -> Term {
        let [f, f1, f2] = self.stretch_factor(slope);
        let (nu, k) = (curl.poisson, -curl.bend);
        let q = 1.0 + nu * slope * slope;
        let by = q * f1 + 2.0 * nu * slope * f;
        let second = q * f2 + 4.0 * nu * slope * f1 + 2.0 * nu * f;
        Term {
            value: k * bend * q * f,
            gradient: Vector2::new(k * q * f, k * bend * by),
            hessian: Matrix2::new(0.0, k * by, k * by, k * bend * second),
        }
    }

    /// The term of the natural bend alone, k²/2, before the width's factor.
    pub(crate) fn natural(self, slope: f64, curl: &Curl) -> Term {
        let [f, f1, f2] = self.stretch_factor(slope);
        let half = 0.5 * curl.bend * curl.bend;
        Term {
            value: half * f,
            gradient: Vector2::new(0.0, half * f1),
            hessian: Matrix2::new(0.0, 0.0, 0.0, half * f2),
        }
    }

    /// The source's factor 1/cos α = sqrt(1+β²) and its first two derivatives by β; 1 in the plate models.
    fn stretch_factor(self, slope: f64) -> [f64; 3] {
        match self {
            Self::Fishbone => {
                let root = 1f64.hypot(slope);
                [root, slope / root, 1.0 / (root * root * root)]
            }
            Self::Sadowsky | Self::Wunderlich => [1.0, 0.0, 0.0],
        }
    }

    /// Power of 1+β² in the term in κ₁².
    #[inline(always)]
    pub(super) fn exponent(self) -> f64 {
        match self {
            Self::Fishbone => 2.5,
            Self::Sadowsky | Self::Wunderlich => 2.0,
        }
    }

    /// (1+β²)^p and its first two derivatives by β.
    #[inline(always)]
    fn slope_factor(self, slope: f64) -> [f64; 3] {
        let p = self.exponent();
        let t = 1.0 + slope * slope;
        let lowest = match self {
            Self::Fishbone => t.sqrt(),
            Self::Sadowsky | Self::Wunderlich => 1.0,
        };
        [
            lowest * t * t,
            2.0 * p * slope * lowest * t,
            2.0 * p * lowest * (t + 2.0 * (p - 1.0) * slope * slope),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::{Dual2SVec64, hessian};

    /// Energy models, one of each.
    const MODELS: [DevelopableEnergy; 3] = [
        DevelopableEnergy::Fishbone,
        DevelopableEnergy::Sadowsky,
        DevelopableEnergy::Wunderlich,
    ];

    #[test]
    fn test_terms_agree_with_automatic_differentiation_of_the_whole() {
        let curl = Curl {
            bend: 1.7,
            poisson: 0.34,
        };
        for model in MODELS {
            for at in [
                Vector2::new(3.0, -0.8),
                Vector2::new(-1.2, 2.5),
                Vector2::zeros(),
            ] {
                let across = match model.knows_width() {
                    true => Across {
                        bending: 1.3,
                        length: 0.9,
                        area: 0.7,
                    },
                    false => Across::PLAIN,
                };
                let value = |x: Vector2<Dual2SVec64<2>>| {
                    model.value(x[0], x[1], &curl, &across.map(Dual2SVec64::from))
                };
                let (value, gradient, second) = hessian(value, &at);
                let terms = [
                    (model.bending(at.x, at.y), across.bending),
                    (model.mixed(at.x, at.y, &curl), across.length),
                    (model.natural(at.y, &curl), across.area),
                ];
                let sum = |part: fn(&Term) -> f64| -> f64 {
                    terms.iter().map(|(term, factor)| factor * part(term)).sum()
                };
                assert!((sum(|t| t.value) - value).abs() <= 1e-13 * value.abs());
                assert!((sum(|t| t.gradient.x) - gradient.x).abs() <= 1e-12 * gradient.amax());
                assert!((sum(|t| t.gradient.y) - gradient.y).abs() <= 1e-12 * gradient.amax());
                for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    let by_hand: f64 = terms.iter().map(|(t, f)| f * t.hessian[(i, j)]).sum();
                    assert!((by_hand - second[(i, j)]).abs() <= 1e-12 * second.amax());
                }
            }
        }
    }

    fn density(model: DevelopableEnergy, bend: f64, slope: f64, curl: &Curl) -> f64 {
        model.value(bend, slope, curl, &Across::PLAIN)
    }

    #[test]
    fn test_on_a_cylinder_plate_theory_gives_half_the_squared_curvature() {
        let (angle, radius) = (0.6f64, 0.3);
        let (bend, slope) = (angle.cos().powi(2) / radius, angle.tan());
        let plate = 0.5 / radius.powi(2);
        let at = |model| density(model, bend, slope, &Curl::default());
        assert!((at(DevelopableEnergy::Sadowsky) - plate).abs() < 1e-13);
        assert!((at(DevelopableEnergy::Wunderlich) - plate).abs() < 1e-13);
        assert!((at(DevelopableEnergy::Fishbone) - plate / angle.cos()).abs() < 1e-13);
    }

    #[test]
    fn test_curled_plate_on_a_cylinder_is_an_isotropic_plate() {
        // Bending less natural bending, K = diag(κ cos² a − k, κ sin² a; κ sin a cos a): the energy of a plate is
        // ½ [ (tr K)² − 2(1 − ν) det K ], less the part of k that no shape of the belt changes.
        let (a, radius, k, nu) = (0.6f64, 0.3, 2.0, 0.34);
        let (bend, slope) = (a.cos().powi(2) / radius, a.tan());
        let along = a.cos().powi(2) / radius - k;
        let across = a.sin().powi(2) / radius;
        let shear = a.sin() * a.cos() / radius;
        let plate =
            0.5 * ((along + across).powi(2) - 2.0 * (1.0 - nu) * (along * across - shear * shear));
        let curl = Curl {
            bend: k,
            poisson: nu,
        };
        assert!((density(DevelopableEnergy::Sadowsky, bend, slope, &curl) - plate).abs() < 1e-12);
    }

    #[test]
    fn test_curled_belt_at_rest_has_no_energy() {
        let curl = Curl {
            bend: -4.0,
            poisson: 0.3,
        };
        for model in MODELS {
            assert_eq!(density(model, -4.0, 0.0, &curl), 0.0);
        }
    }
}
