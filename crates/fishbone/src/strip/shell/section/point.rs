//! A point of a rib: its curvature and the derivatives of it.

use super::*;

/// A point of the rib: the curvature there with its derivatives.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    pub(super) v: Wide,
    pub(super) area: Wide,
    /// Products of the stretch 1/J with v: v/J², v²/J², v²/J³.
    pub(super) bent: Wide,
    pub(super) square: Wide,
    pub(super) turned: Wide,
    /// v/J.
    pub(super) reach: Wide,
    pub(super) along: Wide,
    pub(super) mixed: Wide,
    pub(super) gauss: Wide,
    pub(super) by_along: Row,
    /// Derivatives of b(t,d) by s, m and g.
    pub(super) by_mixed: [Wide; 3],
    /// Second derivative of b(t,t) by s.
    pub(super) along_twice: Wide,
    /// Second derivatives of b(t,d) by s and by s, m and g.
    pub(super) mixed_twice: [Wide; 3],
}

impl Point {
    pub(super) const NONE: Self = Self {
        v: Wide::ZERO,
        area: Wide::ZERO,
        bent: Wide::ZERO,
        square: Wide::ZERO,
        turned: Wide::ZERO,
        reach: Wide::ZERO,
        along: Wide::ZERO,
        mixed: Wide::ZERO,
        gauss: Wide::ZERO,
        by_along: [Wide::ZERO; INPUTS],
        by_mixed: [Wide::ZERO; 3],
        along_twice: Wide::ZERO,
        mixed_twice: [Wide::ZERO; 3],
    };

    /// The point at a parameter from −1 to 1 of the rib; `CURVED` where a board of the block is curved in its plane.
    #[inline(always)]
    pub(super) fn at<const CURVED: bool>(x: &Row, plates: &Plates, t: f64) -> Self {
        let [k, beta, s, ds, m, dm, q, g, dg] = *x;
        let v = plates.half_width * t;
        let half = v * v * 0.5;
        let area = -(s * v) + 1.0;
        let r = area.recip();
        let r2 = r * r;
        let reach = v * r;
        let bent = reach * r;
        let square = reach * reach;
        let turned = square * r;
        // With `b(t,t) = (k − κ_g v q)/J + T/J³` and `b(t,d) = N/J²`: the first part, the second, and T's derivative by s.
        let rate = (v * dm + half * dg) * r2;
        let lever = m + v * g * 0.5;
        let (mut plain, mut rest, mut by_convergence) =
            (r * k, rate + turned * ds * lever, -(reach * rate));
        let (mut by_twist, mut by_slope, mut by_across) = (turned * ds, Wide::ZERO, Wide::ZERO);
        let mut by_growth = turned * v * ds * 0.5;
        if CURVED {
            let kappa = plates.geodesic;
            let board = turned * kappa;
            let lean = board * beta;
            let wound = g * 0.5 + s * m;
            by_across = -(kappa * reach);
            plain += by_across * q;
            rest += lean * wound;
            by_convergence += lean * m;
            by_twist += lean * s;
            by_slope = board * wound;
            by_growth += lean * 0.5;
        }
        let along = plain + rest;
        let mixed = r2 * (m + g * (v - half * s));
        let growth = r2 * (v - half * s);
        let narrow = r2 * half;
        let twice = reach * 2.0;
        let mut by_along = [Wide::ZERO; INPUTS];
        by_along[BEND] = r;
        by_along[SLOPE] = by_slope;
        by_along[CONVERGENCE] = reach * (plain + rest * 3.0) + by_convergence;
        by_along[CONVERGENCE_RATE] = turned * lever;
        by_along[TWIST] = by_twist;
        by_along[TWIST_RATE] = bent;
        by_along[ACROSS] = by_across;
        by_along[GROWTH] = by_growth;
        by_along[GROWTH_RATE] = square * 0.5;
        Self {
            v,
            area,
            bent,
            square,
            turned,
            reach,
            along,
            mixed,
            gauss: along * q - mixed * mixed,
            by_along,
            by_mixed: [twice * mixed - narrow * g, r2, growth],
            along_twice: twice * (reach * (plain + rest * 6.0) + by_convergence * 3.0),
            mixed_twice: [
                twice * (twice * mixed * 1.5 - narrow * g * 2.0),
                twice * r2,
                twice * growth - narrow,
            ],
        }
    }

    /// Derivative of the Gauss curvature.
    #[inline(always)]
    pub(super) fn by_gauss(&self, across: Wide) -> Row {
        let mut by = self.by_along;
        for entry in &mut by {
            *entry = *entry * across;
        }
        let twice = self.mixed * 2.0;
        for (place, by_mixed) in MIXED.into_iter().zip(self.by_mixed) {
            by[place] -= twice * by_mixed;
        }
        by[ACROSS] += self.along;
        by
    }
}

/// What the curvature of a rib's points is seen by: its slope, Poisson's ratio and the natural curvature.
#[derive(Clone, Copy)]
pub(super) struct View {
    pub(super) beta: Wide,
    pub(super) across: Wide,
    /// 1 + β².
    pub(super) stretch: Wide,
    /// 1 − ν.
    pub(super) shear: Wide,
    pub(super) natural: Wide,
}

impl View {
    #[inline(always)]
    pub(super) fn of(x: &Row, plates: &Plates) -> Self {
        Self {
            beta: x[SLOPE],
            across: x[ACROSS],
            stretch: x[SLOPE] * x[SLOPE] + 1.0,
            shear: -plates.poisson + 1.0,
            natural: plates.natural,
        }
    }

    /// Mean curvature less the natural one, twice; then half its derivative by the slope.
    #[inline(always)]
    pub(super) fn mean(&self, point: &Point) -> [Wide; 2] {
        let turned = self.beta * point.along + point.mixed;
        let mean = point.along + self.beta * (turned + point.mixed) + self.across - self.natural;
        [mean, turned]
    }

    /// Bending energy per area, from the mean curvature.
    #[inline(always)]
    pub(super) fn energy(&self, point: &Point, mean: Wide) -> Wide {
        let across = mean - point.along + self.natural;
        mean * mean * 0.5 - self.shear * (point.gauss - self.natural * across)
    }
}
