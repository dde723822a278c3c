//! The term that chooses one of the rib slopes which describe nearly the same surface, and keeps ribs apart.

use super::section::Plates;
use super::wide::Wide;
use super::{Plate, Rib};
use crate::strip::ribs::Scaled;
use num_dual::DualNum;

/// Largest share |s| V/2 of the convergence at which ribs meet at the edge, dimensionless.
pub(super) const CLOSEST: f64 = 0.9;

/// Weights of the term, dimensionless. At unit rigidity it is `(ε (w² + β²) + h̃/V (ε' (V y')² + ε″ w² y²/(0.9² − y²))) / (2 V²)`,
/// with the share `y = s V/2` of the convergence at which ribs meet, its excess `w = y − κ_g V/2` over that of square ribs, and
/// `h̃ = √(D/(E h))`. It vanishes where ribs are square.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Gauge {
    /// Weight ε of the squares of slope and excess.
    pub(crate) slopes: f64,
    /// Weight ε' of the square of the convergence's rate. Without it ribs of thick strips sway to and fro within the width.
    pub(crate) sway: f64,
    /// Weight ε″ of what grows without bound as ribs come as close as they may. Without it ribs of thick strips come so close
    /// over whole stretches, and on fine meshes there is no such minimum.
    pub(crate) closeness: f64,
}

impl Gauge {
    /// The gauge of a solve. It changes energies by less than 1e-3 of themselves.
    pub(crate) const WEAK: Self = Self {
        slopes: 3e-4,
        sway: 0.1,
        closeness: 1.0,
    };
    /// A gauge so strong that the energy has no minima with ribs that all but meet beside a clamp.
    pub(crate) const STRONG: Self = Self {
        slopes: 1e-2,
        closeness: 10.0,
        ..Self::WEAK
    };

    /// The term at a rib, at unit rigidity of the whole width; infinite where ribs come closer than they may.
    pub(super) fn energy<T, W>(self, plate: &Plate<W>, rib: &Rib<T>) -> T
    where
        T: Scaled<W>,
        W: DualNum<Primitive = f64> + Copy,
    {
        let width = plate.half_width * 2.0;
        let thickness = (width * plate.stretching.sqrt()).recip();
        let y = rib.convergence * plate.half_width;
        let excess = (rib.convergence - plate.geodesic) * plate.half_width;
        let square = y * y;
        let room = -square + CLOSEST * CLOSEST;
        if room.re() <= 0.0 {
            return T::from(f64::INFINITY);
        }
        let [_, convergence_rate, _] = rib.rates;
        let rate = convergence_rate * (width * plate.half_width);
        let slopes = (excess * excess + rib.slope * rib.slope) * self.slopes;
        let spread = rate * rate * self.sway + excess * excess * square / room * self.closeness;
        (slopes + spread * thickness) / (width * width * 2.0)
    }
}

/// The term in every lane, and its derivatives.
pub(super) struct Term {
    /// Infinite where ribs come closer than they may.
    pub(super) value: Wide,
    /// First and second derivative by the convergence.
    pub(super) by_convergence: [Wide; 2],
    /// First and second derivative by the slope.
    pub(super) by_slope: [Wide; 2],
    /// First and second derivative by the rate of the convergence.
    pub(super) by_rate: [Wide; 2],
}

impl Term {
    /// The term of a gauge at the ribs of a block, of a convergence, a slope and a rate of the convergence.
    #[inline(always)]
    pub(super) fn of(gauge: Gauge, plates: &Plates, [s, slope, rate]: [Wide; 3]) -> Self {
        let a = plates.half_width;
        let (y, excess) = (s * a, (s - plates.geodesic) * a);
        let (square, excess_square) = (y.square(), excess.square());
        let per_width = (a.square() * 8.0).recip();
        let by_thickness = per_width * (a * plates.stretching.sqrt() * 2.0).recip();
        // The function z/(c − z) of z = y², with its derivatives.
        let most = CLOSEST * CLOSEST;
        let room = (Wide::all(most) - square).recip();
        let near = square * room;
        let near_first = room.square() * most;
        let near_second = near_first * room * 2.0;
        let close = by_thickness * gauge.closeness;
        let quadratic = per_width * (2.0 * gauge.slopes);
        let sway = by_thickness * a.square().square() * (8.0 * gauge.sway);
        let squares = quadratic * (excess_square + slope.square()) + sway * rate.square();
        let value = squares * 0.5 + close * excess_square * near;
        let by_y = quadratic * excess + close * excess * (near + excess * y * near_first) * 2.0;
        let by_square = near_first * (excess_square + excess * y * 4.0);
        let curved = excess_square * square * near_second * 2.0;
        let by_y_twice = quadratic + close * (near + by_square + curved) * 2.0;
        Self {
            value: Wide::where_below(square, most, value, Wide::all(f64::INFINITY)),
            by_convergence: [by_y * a, by_y_twice * a.square()],
            by_slope: [quadratic * slope, quadratic],
            by_rate: [sway * rate, sway],
        }
    }
}
