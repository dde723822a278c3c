//! The strip of the board between two neighbouring ribs: the ends of its ribs, their crossing, the factors of its width.
//!
//! A strip is known by the rib slope β and by s = β' + κ_g (1+β²): at v it is `1 − v s` times as wide as on the spine.

use nalgebra::{Matrix2, Vector2};
use num_dual::{DualNum, HyperDual64};
use std::ops::{Div, Mul};

/// Rib convergence, the rate at which neighbouring ribs close in towards +v: s = β' + κ_g (1 + β²).
///
/// The strip between two ribs is (1 − v s) du wide at v, so ribs meet at v = 1/s. For κ_g = 0 it is the β' of the source.
///
/// Source: Eq. (33), extended to curved belts
pub(crate) fn rib_convergence(slope_rate: f64, geodesic: f64, rib_slope: f64) -> f64 {
    slope_rate + geodesic * (1.0 + rib_slope * rib_slope)
}

/// The greatest |s| for which ribs do not cross inside the width, 2/V.
///
/// Source: Eq. (33)
pub(crate) fn rib_convergence_bound(width: f64) -> f64 {
    2.0 / width
}

/// A number, with or without derivatives, that a number `W` of another type multiplies: the width is a plain number unless
/// it is differentiated by.
pub(crate) trait Scaled<W>:
    DualNum<Primitive = f64> + Copy + Mul<W, Output = Self> + Div<W, Output = Self>
{
}

impl<W, D> Scaled<W> for D where
    D: DualNum<Primitive = f64> + Copy + Mul<W, Output = D> + Div<W, Output = D>
{
}

/// Factors of the width in the density's terms: integrals over v from the rib's one end v₋ to the other v₊, divided by V.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Across<T> {
    /// ∫ dv / (1 − v s), the factor of the squared curvature.
    pub bending: T,
    /// ∫ dv, the factor of the curvature.
    pub length: T,
    /// ∫ (1 − v s) dv, the factor of the terms without curvature.
    pub area: T,
}

impl Across<f64> {
    /// Factors of the width in the narrow limit, and in every straight belt whose ribs are parallel, dimensionless.
    pub(crate) const PLAIN: Self = Self {
        bending: 1.0,
        length: 1.0,
        area: 1.0,
    };
}

impl<D: DualNum<Primitive = f64> + Copy> Across<D> {
    /// Factors of the width of a straight belt, by y = sV/2.
    pub(crate) fn straight(y: D) -> Self {
        Self {
            bending: artanh_ratio(y),
            ..Across::PLAIN.map(D::from)
        }
    }
}

impl<T: Copy> Across<T> {
    /// The factors in another type of number.
    pub(crate) fn map<U>(&self, f: impl Fn(T) -> U) -> Across<U> {
        Across {
            bending: f(self.bending),
            length: f(self.length),
            area: f(self.area),
        }
    }
}

/// A function of the rib slopes at both ends of an element, with its derivatives by these slopes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SlopeJet {
    /// Value.
    pub value: f64,
    /// Gradient.
    pub gradient: Vector2<f64>,
    /// Hessian.
    pub hessian: Matrix2<f64>,
}

impl SlopeJet {
    /// A constant.
    pub(crate) fn constant(value: f64) -> Self {
        Self {
            value,
            gradient: Vector2::zeros(),
            hessian: Matrix2::zeros(),
        }
    }

    /// A function of s·V/2 = `rate` (β₁ − β₀), from its value and derivatives by s·V/2.
    pub(super) fn of_share(rate: f64, [value, first, second]: [f64; 3]) -> Self {
        let by = Vector2::new(-rate, rate);
        Self {
            value,
            gradient: first * by,
            hessian: second * by * by.transpose(),
        }
    }
}

/// Functions of the slopes at both ends of an element, with their derivatives.
pub(super) fn slope_jets<const K: usize>(
    slopes: [f64; 2],
    functions: impl Fn([HyperDual64; 2]) -> [HyperDual64; K],
) -> [SlopeJet; K] {
    // Three times numbers that carry one second derivative each take less time than once numbers that carry all.
    let [first, mixed, second] = [[0, 0], [0, 1], [1, 1]].map(|[i, j]| {
        let mut slopes = slopes.map(HyperDual64::from);
        (slopes[i].eps1, slopes[j].eps2) = (1.0, 1.0);
        functions(slopes)
    });
    std::array::from_fn(|k| {
        let both = mixed[k].eps1eps2;
        SlopeJet {
            value: mixed[k].re,
            gradient: Vector2::new(mixed[k].eps1, mixed[k].eps2),
            hessian: Matrix2::new(first[k].eps1eps2, both, both, second[k].eps1eps2),
        }
    })
}

/// The strips of one element: of half the width, in-plane curvature κ_g, and length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Strips<W = f64> {
    /// Half the width, V/2.
    pub half_width: W,
    /// In-plane curvature κ_g of the flat board.
    pub geodesic: f64,
    /// Length along the spine.
    pub length: f64,
}

/// Greatest curvature of an arc with which its inner edge is computed, in 2/V: the true inner edge of a tighter arc is
/// trimmed.
const TIGHTEST: f64 = 0.9;

impl<W: DualNum<Primitive = f64> + Copy> Strips<W> {
    /// The mean rib slope and the rib convergence s = β' + κ_g (1+β²) there, which stand for the whole element.
    ///
    /// Source: Eq. (33), extended to curved belts
    pub(crate) fn middle<D: DualNum<Primitive = f64> + Copy>(&self, slopes: [D; 2]) -> (D, D) {
        let mean = (slopes[0] + slopes[1]) * 0.5;
        let rise = (slopes[1] - slopes[0]) / self.length;
        (mean, rise + (mean * mean + 1.0) * self.geodesic)
    }

    /// Ends v₋ and v₊ of the rib of a slope, on the edges: `v − κ_g v² (1+β²)/2 = ±V/2 − κ_g V²/8`.
    ///
    /// A rib so steep that it misses the inner edge of its own arc leaves the board farther along; there the root is
    /// continued smoothly.
    pub(crate) fn ends<D: Scaled<W>>(&self, slope: D) -> [D; 2] {
        [self.end(slope, 0), self.end(slope, 1)]
    }

    /// The end v₋ or v₊ of the rib of a slope, as [`Self::ends`].
    #[inline]
    pub(crate) fn end<D: Scaled<W>>(&self, slope: D, side: usize) -> D {
        let w = self.half_width;
        let tightest = W::from(TIGHTEST) / w;
        let geodesic = match self.geodesic.abs() < tightest.re() {
            true => W::from(self.geodesic),
            false => tightest * self.geodesic.signum(),
        };
        let stretch = slope * slope + 1.0;
        let edge = [-w, w][side];
        let offset = edge - geodesic * 0.5 * w * w;
        let root = continued_root(-stretch * (geodesic * 2.0 * offset) + 1.0);
        (root + 1.0).recip() * (offset * 2.0)
    }

    /// Factors of the width in the density's terms, by slopes at both ends of the element.
    pub(crate) fn across<D: Scaled<W>>(&self, slopes: [D; 2]) -> Across<D> {
        let (mean, s) = self.middle(slopes);
        let [minus, plus] = self.ends(mean);
        let length = (plus - minus) / (self.half_width * 2.0);
        let middle = -s * (plus + minus) * 0.5 + 1.0;
        let share = s * (plus - minus) * 0.5 / middle;
        Across {
            bending: length / middle * artanh_ratio(share),
            length,
            area: length * middle,
        }
    }
}

impl Strips {
    /// Factors of the width in the density's terms, with derivatives.
    pub(crate) fn across_jets(&self, slopes: [f64; 2]) -> Across<SlopeJet> {
        if self.geodesic == 0.0 {
            let rate = self.half_width / self.length;
            let y = rate * (slopes[1] - slopes[0]);
            return Across {
                bending: SlopeJet::of_share(rate, artanh_ratio_with_derivatives(y)),
                ..Across::PLAIN.map(SlopeJet::constant)
            };
        }
        let [bending, length, area] = slope_jets(slopes, |slopes| {
            let across = self.across(slopes);
            [across.bending, across.length, across.area]
        });
        Across {
            bending,
            length,
            area,
        }
    }
}

/// Argument t below which the square root of a rib that all but misses its inner edge is continued, dimensionless.
///
/// Such ribs may cross within the last twentieth of their length. With a smaller one, ribs that come to miss the edge do so
/// all at once, and paths fold there.
const SMALL: f64 = 0.01;

/// √t, continued below a small t by a positive function with the same value and first two derivatives: a square root would
/// end at 0.
fn continued_root<D: DualNum<Primitive = f64> + Copy>(t: D) -> D {
    if t >= SMALL {
        return t.sqrt();
    }
    let below = t / SMALL - 1.0;
    (below * 0.5 - below * below * 0.25).exp() * SMALL.sqrt()
}

/// Square y² below which artanh(y)/y comes from the series Σ y²ⁿ/(2n+1), dimensionless: its closed form cancels there.
const SERIES_BELOW: f64 = 0.04;
/// Terms of the series of artanh(y)/y, a number: exact in double precision below [`SERIES_BELOW`].
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

/// artanh(y)/y and its first two derivatives, from the series.
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

    fn strips(geodesic: f64) -> Strips {
        Strips {
            half_width: 0.05,
            geodesic,
            length: 0.0125,
        }
    }

    /// Slopes at both ends of elements whose ribs do not cross, dimensionless.
    const SLOPES: [[f64; 2]; 5] = [
        [0.0, 0.0],
        [0.3, 0.3 + 1e-9],
        [-0.5, -0.56],
        [0.9, 1.02],
        [0.05, -0.05],
    ];

    #[test]
    fn test_width_factor_is_the_mean_over_the_width_of_the_local_curvature() {
        // Across the width the curvature is κ₁/(1 − vs); dA = (1 − vs) dv du.
        for geodesic in [0.0, 1.4, -6.0] {
            let strips = strips(geodesic);
            for slopes in SLOPES {
                let (mean, s) = strips.middle(slopes);
                let [minus, plus] = strips.ends(mean);
                let n = 100_000;
                let step = (plus - minus) / f64::from(n);
                let sum = |f: &dyn Fn(f64) -> f64| -> f64 {
                    (0..n)
                        .map(|i| f(minus + (f64::from(i) + 0.5) * step) * step / 0.1)
                        .sum()
                };
                let across = strips.across(slopes);
                assert!((across.bending - sum(&|v| 1.0 / (1.0 - v * s))).abs() < 1e-7);
                assert!((across.area - sum(&|v| 1.0 - v * s)).abs() < 1e-10);
                assert!((across.length - sum(&|_| 1.0)).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn test_ribs_end_on_the_edges_of_the_arc() {
        for geodesic in [1.4, -3.0, 12.0] {
            for slope in [0.0f64, 0.2, -0.4] {
                let centre = 1.0 / geodesic;
                for (v, edge) in strips(geodesic).ends(slope).into_iter().zip([-0.05, 0.05]) {
                    let distance = (slope * v).hypot(centre - v);
                    assert!((distance - (centre - edge).abs()).abs() < 1e-14);
                }
            }
        }
    }

    #[test]
    fn test_rib_meets_the_inner_edge_beyond_half_the_width_and_the_outer_before() {
        for geodesic in [1.4, 12.0, 19.0, 300.0] {
            for slope in [0.0f64, 0.3, -0.7, 2.0, -9.0] {
                let [minus, plus] = strips(geodesic).ends(slope);
                assert!(plus >= 0.05 * (1.0 - 1e-12) && minus >= -0.05 * (1.0 + 1e-12));
                assert!(plus < 0.12 && minus < 0.0);
                let mirrored = strips(-geodesic).ends(slope);
                assert!((mirrored[0] + plus).abs() < 1e-15 && (mirrored[1] + minus).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn test_arc_of_no_curvature_is_straight() {
        for slopes in SLOPES {
            let (flat, bent) = (strips(0.0), strips(1e-9));
            for (a, b) in [
                (
                    flat.across_jets(slopes).bending,
                    bent.across_jets(slopes).bending,
                ),
                (flat.across_jets(slopes).area, bent.across_jets(slopes).area),
            ] {
                assert!((a.value - b.value).abs() < 1e-9);
                assert!((a.gradient - b.gradient).amax() < 1e-7 * a.gradient.amax().max(1.0));
                assert!((a.hessian - b.hessian).amax() < 1e-7 * a.hessian.amax().max(1.0));
            }
        }
    }

    #[test]
    fn test_derivatives_agree_with_automatic_differentiation() {
        for geodesic in [0.0, 1.4, -6.0] {
            let strips = strips(geodesic);
            for slopes in SLOPES {
                let check =
                    |jet: SlopeJet, value: &dyn Fn([Dual2SVec64<2>; 2]) -> Dual2SVec64<2>| {
                        let (value, gradient, second) =
                            hessian(|x: Vector2<_>| value([x[0], x[1]]), &Vector2::from(slopes));
                        assert!((jet.value - value).abs() <= 1e-13 * value.abs());
                        assert!(
                            (jet.gradient - gradient).amax() <= 1e-11 * gradient.amax().max(1e-3)
                        );
                        assert!((jet.hessian - second).amax() <= 1e-9 * second.amax().max(1e-3));
                    };
                let across = strips.across_jets(slopes);
                check(across.bending, &|x| strips.across(x).bending);
                check(across.length, &|x| strips.across(x).length);
                check(across.area, &|x| match geodesic == 0.0 {
                    true => Dual2SVec64::from(1.0),
                    false => strips.across(x).area,
                });
            }
        }
    }

    #[test]
    fn test_energy_grows_without_bound_where_ribs_meet_at_an_edge() {
        let factor = |y: f64| artanh_ratio(y);
        assert!(factor(0.999_999) > factor(0.99) && factor(0.99) > 2.0 * factor(0.0));
    }

    #[test]
    fn test_continued_root_has_no_corner() {
        let h = 1e-2 * SMALL;
        let root = |t: f64| continued_root(t);
        let second = |t: f64| (root(t + h) - 2.0 * root(t) + root(t - h)) / (h * h);
        let below = SMALL * (1.0 - 1e-7);
        assert!((second(below) / second(SMALL + 2.0 * h) - 1.0).abs() < 0.1);
        assert!(root(-5.0 * SMALL) > 0.0);
        assert!((root(below) - root(SMALL * (1.0 + 1e-7))).abs() < 1e-5);
    }
}
