//! Bending energy of the belt per unit length of the spine: the three models, Eq. (34) and its successors.

use nalgebra::{Matrix3, Vector3};
use num_dual::DualNum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Bending energy per unit length of the spine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum EnergyModel {
    /// The source's: R_f/2 · sqrt(1+β²) · κ₁², Eq. (34).
    Fishbone,
    /// Narrow limit of the developable plate: R_f/2 · κ₁².
    Sadowsky,
    /// Developable plate of finite width: R_f/2 · κ₁² · artanh(y)/y with y = sV/2.
    #[default]
    Wunderlich,
}

/// A density with its first and second derivatives by (bend, slope, y).
#[derive(Debug, Clone, Copy)]
pub struct Density {
    /// Energy per unit length.
    pub value: f64,
    /// Gradient by (bend, slope, y).
    pub gradient: Vector3<f64>,
    /// Hessian by (bend, slope, y).
    pub hessian: Matrix3<f64>,
}

impl EnergyModel {
    /// Its name in scenarios and results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fishbone => "fishbone",
            Self::Sadowsky => "sadowsky",
            Self::Wunderlich => "wunderlich",
        }
    }

    /// Energy per unit length at unit rigidity, with y = sV/2 the share of the rib bound in use, |y| < 1; the numbers
    /// may carry derivatives.
    ///
    /// Source: Eq. (29), (34), in β: written in ω_η/ω_ζ it is singular where the belt is not bent.
    pub fn value<D: DualNum<Primitive = f64> + Copy>(self, bend: D, slope: D, y: D) -> D {
        let stretch = slope * slope + 1.0;
        let factor = match self {
            Self::Fishbone => stretch.sqrt(),
            Self::Sadowsky => D::one(),
            Self::Wunderlich => artanh_ratio(y),
        };
        bend * bend * stretch * stretch * factor * 0.5
    }

    /// The same with its derivatives.
    pub fn density(self, bend: f64, slope: f64, y: f64) -> Density {
        let [c, c1, c2] = self.slope_factor(slope);
        let [g, g1, g2] = self.width_factor(y);
        let half = 0.5 * bend * bend;
        Density {
            value: half * c * g,
            gradient: Vector3::new(bend * c * g, half * c1 * g, half * c * g1),
            hessian: Matrix3::new(
                c * g,
                bend * c1 * g,
                bend * c * g1,
                bend * c1 * g,
                half * c2 * g,
                half * c1 * g1,
                bend * c * g1,
                half * c1 * g1,
                half * c * g2,
            ),
        }
    }

    /// Power of 1+β² in the density.
    fn exponent(self) -> f64 {
        match self {
            Self::Fishbone => 2.5,
            Self::Sadowsky | Self::Wunderlich => 2.0,
        }
    }

    /// (1+β²)^p and its first two derivatives by β.
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

    /// The factor that accounts for the width, and its first two derivatives by y.
    fn width_factor(self, y: f64) -> [f64; 3] {
        match self {
            Self::Fishbone | Self::Sadowsky => [1.0, 0.0, 0.0],
            Self::Wunderlich => artanh_ratio_with_derivatives(y),
        }
    }
}

/// Below this y² the closed form of artanh(y)/y cancels, and the series Σ y²ⁿ/(2n+1) is exact in [`TERMS`] terms.
const SERIES_BELOW: f64 = 0.04;
const TERMS: i32 = 14;

/// artanh(y)/y.
fn artanh_ratio<D: DualNum<Primitive = f64> + Copy>(y: D) -> D {
    let square = y * y;
    if square < SERIES_BELOW {
        let term = |sum: D, n: i32| sum * square + 1.0 / f64::from(2 * n + 1);
        return (0..TERMS).rev().fold(D::zero(), term);
    }
    (y.ln_1p() - (-y).ln_1p()) / y * 0.5
}

/// artanh(y)/y and its first two derivatives.
fn artanh_ratio_with_derivatives(y: f64) -> [f64; 3] {
    let square = y * y;
    if square < SERIES_BELOW {
        return artanh_ratio_series(y);
    }
    let inverse = 1.0 / (1.0 - square);
    let g = artanh_ratio(y);
    let g1 = (inverse - g) / y;
    let g2 = 2.0 * (inverse * inverse - g1 / y);
    [g, g1, g2]
}

/// The same from the series.
fn artanh_ratio_series(y: f64) -> [f64; 3] {
    let square = y * y;
    let (mut g1, mut g2) = (0.0, 0.0);
    for n in (1..TERMS).rev() {
        let (order, coefficient) = (f64::from(2 * n), 1.0 / f64::from(2 * n + 1));
        g1 = g1 * square + order * coefficient;
        g2 = g2 * square + order * (order - 1.0) * coefficient;
    }
    [artanh_ratio(y), g1 * y, g2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::{Dual2SVec64, hessian};

    const MODELS: [EnergyModel; 3] = [
        EnergyModel::Fishbone,
        EnergyModel::Sadowsky,
        EnergyModel::Wunderlich,
    ];

    #[test]
    fn test_derivatives_agree_with_automatic_differentiation() {
        for model in MODELS {
            for y in [0.0, 1e-9, -0.01, 0.1999, -0.2001, 0.7, -0.999] {
                let at = Vector3::new(3.0, -0.8, y);
                let value = |x: Vector3<Dual2SVec64<3>>| model.value(x[0], x[1], x[2]);
                let (value, gradient, second) = hessian(value, &at);
                let density = model.density(at.x, at.y, at.z);
                assert!((density.value - value).abs() <= 1e-14 * value);
                assert!((density.gradient - gradient).amax() <= 1e-12 * gradient.amax());
                assert!((density.hessian - second).amax() <= 1e-10 * second.amax());
            }
        }
    }

    #[test]
    fn test_on_a_cylinder_plate_theory_gives_half_the_squared_curvature() {
        let (angle, radius) = (0.6f64, 0.3);
        let (bend, slope) = (angle.cos().powi(2) / radius, angle.tan());
        let plate = 0.5 / radius.powi(2);
        assert!((EnergyModel::Sadowsky.value(bend, slope, 0.0) - plate).abs() < 1e-13);
        assert!((EnergyModel::Wunderlich.value(bend, slope, 0.0) - plate).abs() < 1e-13);
        let fishbone = EnergyModel::Fishbone.value(bend, slope, 0.0);
        assert!((fishbone - plate / angle.cos()).abs() < 1e-13);
    }

    #[test]
    fn test_width_factor_is_the_mean_over_the_width_of_the_local_curvature() {
        // Across the width the curvature is κ₁/(1 − vs); dA = (1 − vs) dv du.
        for y in [0.05, 0.19, 0.21, 0.9] {
            let strips = 200_000;
            let mean: f64 = (0..strips)
                .map(|i| 1.0 / (1.0 - y * (2.0 * (f64::from(i) + 0.5) / f64::from(strips) - 1.0)))
                .sum::<f64>()
                / f64::from(strips);
            assert!((artanh_ratio(y) - mean).abs() < 1e-8);
        }
    }

    #[test]
    fn test_energy_grows_without_bound_where_ribs_meet_at_an_edge() {
        let energy = |y: f64| EnergyModel::Wunderlich.value(1.0, 0.0, y);
        assert!(energy(0.999_999) > energy(0.99) && energy(0.99) > 2.0 * energy(0.0));
    }
}
