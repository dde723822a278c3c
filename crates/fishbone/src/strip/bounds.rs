//! The inequalities that keep the ribs of an element apart on the board.

use crate::strip::ribs::{Scaled, SlopeJet, Strips, slope_jets};
use nalgebra::Vector2;
use num_dual::DualNum;

/// Greatest count of active edges of an element, a number.
pub(crate) const ACTIVE: usize = 3;
/// Greatest count of inequalities of an element, a number: two at the edges of its own stretch, then one at each active
/// edge.
pub(crate) const BOUNDS: usize = 2 + ACTIVE;

/// Largest share |s| V/2 of the convergence at which ribs meet at the edge of their own stretch, dimensionless.
///
/// Where ribs meet, `wunderlich` has no bound, and rounding of the slopes decides its slope. This share keeps it smooth
/// to the digits of a slope, and costs 1e-5 of the width.
const CLOSEST: f64 = 1.0 - 1e-5;

/// The active edges of an element: edges of the board, other than its own stretch's two, that bound its ribs.
pub(crate) type ActiveEdges<W = f64> = [Option<Edge<W>>; ACTIVE];

/// A line or an arc of the board's outline as seen from the foot of a rib, by the tangent nearest to the foot.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct Edge<W = f64> {
    /// Direction of the nearest tangent along and across the spine at the foot, (cos δ, sin δ).
    pub direction: Vector2<f64>,
    /// Distance c of the nearest tangent from the foot, negative on the −ζ side.
    pub distance: W,
    /// Curvature, 0 of a line; towards the side on which the edge lies.
    pub curvature: W,
    /// Turns of its first and last tangent from the nearest one, rising.
    pub turn: [f64; 2],
}

impl Edge {
    /// A straight line.
    pub(crate) fn line(direction: Vector2<f64>, distance: f64) -> Self {
        Self {
            direction,
            distance,
            curvature: 0.0,
            turn: [0.0; 2],
        }
    }

    /// The same edge in other units: lengths times a factor.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        Self {
            distance: self.distance * factor,
            curvature: self.curvature / factor,
            ..*self
        }
    }
}

impl<W: DualNum<Primitive = f64> + Copy> Edge<W> {
    /// Slack of ribs against crossing before they reach the edge: the least of `cos δ + β sin δ − s c` over its tangents.
    ///
    /// A rib meets a tangent at v = c/(cos δ + β sin δ), so this is 1 − s v in other words; but it counts a rib so
    /// steep that it passes the edge by as crossing others.
    pub(crate) fn slack<D: Scaled<W>>(&self, slope: D, s: D) -> D {
        let (along, across) = (self.direction.x, self.direction.y);
        let nearest = slope * across - s * self.distance + along;
        if self.curvature.re() == 0.0 {
            return nearest;
        }
        // Over the tangents of an arc the slack is a sine of their turn.
        let quarter = slope * along - across;
        let (k, side) = (self.curvature, self.curvature.re().signum());
        let beyond = s - nearest * k;
        let lowest = (-quarter.re() * k.re().abs()).atan2(side * beyond.re());
        if (self.turn[0]..=self.turn[1]).contains(&lowest) {
            let square = beyond * beyond + quarter * quarter * (k * k);
            if square.re() == 0.0 {
                // Ribs that meet in the centre of the arc are as far from all of its tangents.
                return nearest;
            }
            let amplitude = square.sqrt();
            let squares = nearest * nearest + quarter * quarter;
            return (nearest * s * 2.0 - squares * k) * side / (s * side + amplitude);
        }
        let at = |turn: f64| {
            nearest * turn.cos() + quarter * turn.sin() + s * (2.0 * (0.5 * turn).sin().powi(2)) / k
        };
        let [first, last] = self.turn.map(at);
        if first < last { first } else { last }
    }
}

/// The active edges of a board of a larger half width.
///
/// The edges of the board are half a width off its spine. Where they end on another edge does not matter but for the
/// last tangent of an arc, which is kept.
pub(crate) fn moved_out<D: DualNum<Primitive = f64> + Copy>(
    edges: &ActiveEdges,
    more: D,
) -> ActiveEdges<D> {
    let moved = |edge: &Edge, side: f64| Edge {
        direction: edge.direction,
        distance: more * side + edge.distance,
        curvature: match edge.curvature == 0.0 {
            true => D::zero(),
            // Active edges that curve are inner ones: the wider the belt, the less their radius.
            false => (more * -side + 1.0 / edge.curvature).recip(),
        },
        turn: edge.turn,
    };
    let [minus, plus, own] = edges;
    [
        minus.as_ref().map(|edge| moved(edge, -1.0)),
        plus.as_ref().map(|edge| moved(edge, 1.0)),
        own.as_ref()
            .map(|edge| moved(edge, edge.curvature.signum())),
    ]
}

/// The inequalities of one element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RibBounds<'a, W = f64> {
    /// The strips of the element.
    pub strips: Strips<W>,
    /// Its active edges.
    pub edges: &'a ActiveEdges<W>,
}

impl<'a, W: DualNum<Primitive = f64> + Copy> RibBounds<'a, W> {
    /// Slacks of the ribs against crossing on the board, by slopes at both ends of the element; admissible where positive:
    /// 1e-5 less than `1 − s v` at the +ζ and at the −ζ edge of the stretch, then [`Edge::slack`] at the active edges, 1
    /// where there are none.
    ///
    /// On an arc v is where the rib meets the inner edge; towards the outer one, which a rib meets before V/2, it is V/2
    /// all the same, so that |s| ≤ 2/V holds everywhere.
    ///
    /// Source: Eq. (33), extended to curved belts
    pub(crate) fn slacks<D: Scaled<W> + From<W>>(&self, slopes: [D; 2]) -> [D; BOUNDS] {
        let (mean, s) = self.strips.middle(slopes);
        let w = self.strips.half_width;
        let [minus, plus] = if self.strips.geodesic == 0.0 {
            [D::from(-w), D::from(w)]
        } else if self.strips.geodesic > 0.0 {
            [D::from(-w), self.strips.end(mean, 1)]
        } else {
            [self.strips.end(mean, 0), D::from(w)]
        };
        let active = |edge: &Option<Edge<W>>| match edge {
            None => D::one(),
            Some(edge) => edge.slack(mean, s),
        };
        let [a, b, c] = self.edges.each_ref().map(active);
        [-s * plus + CLOSEST, -s * minus + CLOSEST, a, b, c]
    }

    /// Indices in [`Self::slacks`] of the element's inequalities.
    pub(crate) fn places(&self) -> impl Iterator<Item = usize> + use<W> {
        let active = self.edges.each_ref().map(Option::is_some);
        (0..BOUNDS).filter(move |place| *place < 2 || active[place - 2])
    }
}

impl RibBounds<'_> {
    /// Whether the slacks are linear in the slopes.
    pub(crate) fn are_linear(&self) -> bool {
        self.strips.geodesic == 0.0 && *self.edges == [None; ACTIVE]
    }

    /// The slacks with derivatives.
    pub(crate) fn slack_jets(&self, slopes: [f64; 2]) -> [SlopeJet; BOUNDS] {
        if self.are_linear() {
            let rate = self.strips.half_width / self.strips.length;
            let y = rate * (slopes[1] - slopes[0]);
            let [plus, minus] =
                [-1.0, 1.0].map(|sign| SlopeJet::of_share(rate, [CLOSEST + sign * y, sign, 0.0]));
            let none = SlopeJet::constant(1.0);
            return [plus, minus, none, none, none];
        }
        slope_jets(slopes, |slopes| self.slacks(slopes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::feet::Board;
    use crate::board::reach::edges_in_reach;
    use crate::board::samples::{Part, Plan};
    use num_dual::{Dual2SVec64, Dual64, hessian};

    fn bounds(geodesic: f64) -> RibBounds<'static> {
        let strips = Strips {
            half_width: 0.05,
            geodesic,
            length: 0.0125,
        };
        RibBounds {
            strips,
            edges: &[None; ACTIVE],
        }
    }

    /// Slopes at both ends of elements whose ribs do not cross, dimensionless.
    const SLOPES: [[f64; 2]; 4] = [[0.0, 0.0], [0.3, 0.3 + 1e-9], [0.9, 1.02], [0.05, -0.05]];

    #[test]
    fn test_arc_of_no_curvature_is_straight() {
        for slopes in SLOPES {
            let [flat, bent] = [0.0, 1e-9].map(|geodesic| bounds(geodesic).slack_jets(slopes));
            for (a, b) in flat.iter().zip(&bent) {
                assert!((a.value - b.value).abs() < 1e-9);
                assert!((a.gradient - b.gradient).amax() < 1e-7 * a.gradient.amax().max(1.0));
                assert!((a.hessian - b.hessian).amax() < 1e-7 * a.hessian.amax().max(1.0));
            }
        }
    }

    #[test]
    fn test_derivatives_agree_with_automatic_differentiation() {
        for geodesic in [0.0, 1.4, -6.0] {
            let bounds = bounds(geodesic);
            for slopes in SLOPES {
                for (place, jet) in bounds.slack_jets(slopes).iter().enumerate() {
                    let slack = |x: Vector2<Dual2SVec64<2>>| bounds.slacks([x[0], x[1]])[place];
                    let (value, gradient, second) = hessian(slack, &Vector2::from(slopes));
                    assert!((jet.value - value).abs() <= 1e-13 * value.abs());
                    assert!((jet.gradient - gradient).amax() <= 1e-11 * gradient.amax().max(1e-3));
                    assert!((jet.hessian - second).amax() <= 1e-9 * second.amax().max(1e-3));
                }
            }
        }
    }

    #[test]
    fn test_slack_at_an_edge_is_the_least_over_its_tangents() {
        // The expected slack comes from the arc's points and their tangents, by its centre and radius.
        for (curvature, nearest, distance) in [(4.0f64, 0.3f64, 0.05f64), (-9.0, -0.8, -0.03)] {
            let edge = Edge {
                direction: Vector2::new(nearest.cos(), nearest.sin()),
                distance,
                curvature,
                turn: [-0.6, 0.5],
            };
            let radius = 1.0 / curvature;
            let left = |angle: f64| Vector2::new(-angle.sin(), angle.cos());
            let centre = (distance + radius) * left(nearest);
            for slope in [-1.5, -0.2, 0.0, 0.7, 2.0] {
                for s in [-30.0, -12.0, -1.0, 0.0, 3.0, 15.0, 25.0] {
                    let at = |i: i32| {
                        let angle = nearest - 0.6 + 1.1 * f64::from(i) / 4000.0;
                        let point = centre - radius * left(angle);
                        let c = left(angle).dot(&point);
                        angle.cos() + slope * angle.sin() - s * c
                    };
                    let least = (0..=4000).map(at).fold(f64::INFINITY, f64::min);
                    assert!((edge.slack(slope, s) - least).abs() < 1e-5, "{slope} {s}");
                }
            }
        }
    }

    #[test]
    fn test_ribs_that_meet_in_the_centre_of_an_arc_are_as_far_from_all_of_it() {
        let edge = Edge {
            direction: Vector2::x(),
            distance: 0.05,
            curvature: 1.0 / 0.2,
            turn: [-0.3, 0.3],
        };
        let [jet] = slope_jets([0.0, 4.0], |[slope, s]| [edge.slack(slope, s)]);
        assert!((jet.value - 0.8).abs() < 1e-15 && jet.gradient.amax().is_finite());
    }

    #[test]
    fn test_active_edges_move_with_the_width_as_those_of_the_board_do() {
        let leg = Part::Straight(0.4);
        let parts = [leg, Part::Corner(1.0), leg, Part::Arc(0.2, 4.0), leg];
        let mirrored = [leg, Part::Corner(-1.0), leg, Part::Arc(0.2, -4.0), leg];
        let step = 1e-6;
        let mut seen = [0, 0];
        for parts in [parts, mirrored] {
            let mut spine = Plan::open(0.1, &parts).spine();
            let mut of_width = |width: f64| {
                spine.width = width;
                let board = Board::of(&spine);
                let edges = |element| edges_in_reach(&board, &spine, element);
                spine.strips().map(edges).collect::<Vec<_>>()
            };
            let [below, at, above] = [-step, 0.0, step].map(|by| of_width(0.1 + 2.0 * by));
            for ((below, at), above) in below.iter().zip(&at).zip(&above) {
                let wider = moved_out(at, Dual64::from(0.0).derivative());
                for (i, edge) in wider.iter().enumerate() {
                    let (Some(edge), Some(below), Some(above)) = (edge, below[i], above[i]) else {
                        continue;
                    };
                    let distance = (above.distance - below.distance) / (2.0 * step);
                    assert!((edge.distance.eps - distance).abs() < 1e-6, "{edge:?}");
                    let curvature = (above.curvature - below.curvature) / (2.0 * step);
                    assert!((edge.curvature.eps - curvature).abs() < 1e-4, "{edge:?}");
                    seen[usize::from(edge.curvature.re != 0.0)] += 1;
                }
            }
        }
        assert!(seen.iter().all(|count| *count >= 8), "{seen:?}");
    }
}
