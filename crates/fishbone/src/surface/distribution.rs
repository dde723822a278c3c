//! The distribution of the bend radius over the area of the board.
//!
//! The least radius over the width is no property of the belt: it falls with the mesh, on an area that vanishes. The radius
//! exceeded on a given share of the area converges.

use super::curvature::curvature;
use super::extremes::{Part, smooth_parts};
use super::thick::{Shares, ThickBoard};
use crate::board::feet::Board;
use crate::board::outline::outline;
use crate::strip::flat::FLAT;
use crate::strip::spine::Spine;

/// Cells in each smooth part of an element, a number: within a cell the curvature of the spine is taken as linear.
const CELLS: usize = 8;

/// Radii between which quantiles are sought, in widths; a belt of larger radius is flat.
const RADII: [f64; 2] = [1e-12, 1e12];

/// The area of the board by its bend radius, stiffeners and corners that no rib reaches included: their radius is infinite.
#[derive(Debug, Clone)]
pub struct BendDistribution {
    cells: Vec<Cell>,
    /// Bends of a strip of finite thickness, in place of cells.
    bends: Option<Shares>,
    /// Area of the board.
    area: f64,
    /// Width of the board.
    width: f64,
}

impl BendDistribution {
    /// The distribution of a belt.
    ///
    /// # Panics
    ///
    /// If the spine has no nodes.
    pub fn of(spine: &Spine) -> Self {
        let board = Board::of(spine);
        let straight = spine.strips().filter(|_| spine.curved.is_none());
        let parts = straight
            .flat_map(|element| smooth_parts(spine, &board, element))
            .flat_map(|part| parts_of_one_sign(spine, part));
        Self {
            cells: parts.flat_map(|part| cells(spine, &board, part)).collect(),
            bends: ThickBoard::of(spine).map(|board| board.bends()),
            area: outline(spine).area(),
            width: spine.width,
        }
    }

    /// Share of the board's area with a bend radius below a finite one.
    pub fn share_below(&self, radius: f64) -> f64 {
        let areas = self.cells.iter().map(|cell| cell.area_below(radius));
        let bends = self.bends.as_ref();
        let bent = bends.map_or(0.0, |bends| bends.area_above(1.0 / radius));
        (areas.sum::<f64>() + bent) / self.area
    }

    /// Radii exceeded on 99.9, 99 and 95 % of the board's area.
    pub fn quantiles(&self) -> [f64; 3] {
        [0.999, 0.99, 0.95].map(|share| self.radius_exceeded_on(share))
    }

    /// Radius exceeded on a given share of the board's area; infinite where more than the rest of the board is flat.
    fn radius_exceeded_on(&self, share: f64) -> f64 {
        /// Halvings of the logarithm's range: to 1e-12 of the radius.
        const HALVINGS: usize = 46;
        let tighter = 1.0 - share;
        let [mut low, mut high] = RADII.map(|radius| (radius * self.width).ln());
        if self.share_below(high.exp()) <= tighter {
            return f64::INFINITY;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            match self.share_below(middle.exp()) <= tighter {
                true => low = middle,
                false => high = middle,
            }
        }
        (0.5 * (low + high)).exp()
    }
}

/// A part of an element, cut where its bend changes sign.
fn parts_of_one_sign(spine: &Spine, part: Part) -> Vec<Part> {
    let Part { element, from, to } = part;
    let (first, last) = (spine.fields(element, from).0, spine.fields(element, to).0);
    if first * last >= 0.0 {
        return vec![part];
    }
    let inflection = from + (to - from) * first / (first - last);
    let cuts = [from, inflection, to];
    let parts = cuts.windows(2).map(|cut| Part {
        element,
        from: cut[0],
        to: cut[1],
    });
    parts.collect()
}

/// The strips of equal length of a part of an element.
fn cells(spine: &Spine, board: &Board, part: Part) -> impl Iterator<Item = Cell> {
    let step = (part.to - part.from) / CELLS as f64;
    (0..CELLS).map(move |index| {
        let start = part.from + index as f64 * step;
        Cell::of(spine, board, part.element, [start, start + step])
    })
}

/// The strip of the board between two near ribs.
///
/// At v it is 1 − v s times as wide as on the spine, and its radius is (1 − v s)/|κ₁|. Across the strip the width ratio
/// w = 1 − v s is linear in v, along it the curvature is taken as linear in u.
#[derive(Debug, Clone, Copy)]
struct Cell {
    /// Length along the spine times length of the ribs.
    extent: f64,
    /// Least and greatest width ratio, at the ends of the ribs.
    ratio: [f64; 2],
    /// Magnitude of the curvature on the spine at the two ribs, rising.
    curvature: [f64; 2],
}

impl Cell {
    fn of(spine: &Spine, board: &Board, element: usize, [from, to]: [f64; 2]) -> Self {
        let middle = 0.5 * (from + to);
        let [minus, plus] = board.ends(&board.rib_within(spine, element, middle));
        let s = spine.convergence(element, spine.fields(element, middle).1);
        let [a, b] = [minus.v, plus.v].map(|v| (1.0 - v * s).max(0.0));
        let [c, d] = [from, to].map(|distance| {
            let (bend, slope) = spine.fields(element, distance);
            let curvature = curvature(bend, slope).abs();
            // Less is rounding of a solve.
            match curvature * spine.length() > FLAT {
                true => curvature,
                false => 0.0,
            }
        });
        Self {
            extent: (to - from) * (plus.v - minus.v),
            ratio: [a.min(b), a.max(b)],
            curvature: [c.min(d), c.max(d)],
        }
    }

    /// Area of the cell with a radius below a finite one: where w < q, q = r |κ₁|, as a mean over q.
    fn area_below(&self, radius: f64) -> f64 {
        /// Relative range of the curvature below which it counts as constant: far below the error of the mesh.
        const CONSTANT: f64 = 1e-7;
        let [a, b] = self.curvature.map(|curvature| radius * curvature);
        let mean = match b - a > CONSTANT * b {
            true => (self.integral(b) - self.integral(a)) / (b - a),
            false => self.share(0.5 * (a + b)),
        };
        self.extent * mean
    }

    /// ∫ w dv over the part of the ribs with w < q, divided by the length of the ribs.
    fn share(&self, q: f64) -> f64 {
        let [low, _] = self.ratio;
        let (within, reached) = self.reached(q);
        0.5 * within * (reached + low)
    }

    /// ∫ share dq from the least width ratio to q.
    fn integral(&self, q: f64) -> f64 {
        let [low, high] = self.ratio;
        let (within, reached) = self.reached(q);
        let inside = within * (reached - low) * (reached + 2.0 * low) / 6.0;
        let beyond = 0.5 * (q - reached).max(0.0) * (low + high);
        inside + beyond
    }

    /// Share of the ribs' length with w < q, and the greatest w there.
    fn reached(&self, q: f64) -> (f64, f64) {
        let [low, high] = self.ratio;
        if q <= low {
            (0.0, low)
        } else if q >= high {
            (1.0, high)
        } else {
            ((q - low) / (high - low), q)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::samples::{Part as Stretch, Plan, spine, waves};
    use crate::geometry::Pose;
    use crate::strip::spine::Piece;
    use crate::surface::{bend_radius, rib_foot};
    use approx::assert_relative_eq;
    use nalgebra::Vector2;
    use proptest::prelude::*;

    fn quantiles(spine: &Spine) -> [f64; 3] {
        BendDistribution::of(spine).quantiles()
    }

    #[test]
    fn test_wrap_has_the_radius_of_its_cylinder_wherever_a_rib_reaches() {
        let (a, radius) = (0.6f64, 0.25);
        let wrap = spine(1.0, 0.1, 20, |_| a.cos().powi(2) / radius, |_| a.tan());
        for found in quantiles(&wrap) {
            assert_relative_eq!(found, radius, max_relative = 1e-10);
        }
        // Two corners are flat: triangles of legs V/2 and V tan(a)/2.
        let flat = 2.0 * 0.5 * 0.05 * 0.05 * a.tan() / 0.1;
        let distribution = BendDistribution::of(&wrap);
        assert_eq!(distribution.share_below(radius * (1.0 - 1e-9)), 0.0);
        let share = distribution.share_below(radius * (1.0 + 1e-9));
        assert_relative_eq!(share, 1.0 - flat, epsilon = 1e-12);
    }

    #[test]
    fn test_square_ribs_of_linear_bend_have_the_radii_of_their_places() {
        let ramp = spine(1.0, 0.1, 7, |u| 1.0 + 2.0 * u, |_| 0.0);
        let distribution = BendDistribution::of(&ramp);
        for share in [0.999, 0.99, 0.95, 0.3] {
            let found = distribution.radius_exceeded_on(share);
            assert_relative_eq!(found, 1.0 / (1.0 + 2.0 * share), max_relative = 1e-10);
            assert_relative_eq!(
                distribution.share_below(found),
                1.0 - share,
                epsilon = 1e-10
            );
        }
        let swung = spine(1.0, 0.1, 3, |u| 2.0 * u - 0.8, |_| 0.0);
        let below = BendDistribution::of(&swung).share_below(1.0 / 0.6);
        assert_relative_eq!(below, 0.3 + 0.1, epsilon = 1e-12);
    }

    #[test]
    fn test_area_of_a_cone_below_a_radius_is_that_near_its_apex() {
        // Ribs through (y, z) = (0.5, 0.2) from there: the radius is the distance from the apex over 0.4.
        let cone = |u: f64| 2.0 / (1.0 + ((u - 0.5) / 0.2).powi(2)).powf(1.5);
        let belt = spine(1.0, 0.1, 2000, cone, |u| (u - 0.5) / 0.2);
        let distribution = BendDistribution::of(&belt);
        let disc = |distance: f64, z: f64| {
            let chord = (distance * distance - z * z).sqrt();
            z * chord + distance * distance * (z / distance).asin()
        };
        for distance in [0.151f64, 0.17, 0.2, 0.24] {
            let far = distance.min(0.25);
            let share = (disc(distance, far) - disc(distance, 0.15)) / 0.1;
            let found = distribution.share_below(distance / 0.4);
            assert_relative_eq!(found, share, max_relative = 1e-4, epsilon = 1e-6);
            let radius = distribution.radius_exceeded_on(1.0 - share);
            assert_relative_eq!(radius, distance / 0.4, max_relative = 1e-5);
        }
    }

    #[test]
    fn test_square_ribs_of_an_arc_are_tighter_on_its_inside() {
        // Curvature 4, width 0.1: the radius at v is (1 − 4 v)/2, and the area inside it that of a ring's sector.
        let u: Vec<f64> = (0..=20).map(|i| 0.4 * f64::from(i) / 20.0).collect();
        let pieces = vec![Piece::Strip { geodesic: 4.0 }; 20];
        let (bend, slope) = (vec![2.0; 21], vec![0.0; 21]);
        let arc = Spine::from_fields(0.1, Pose::identity(), pieces, u, bend, slope);
        let distribution = BendDistribution::of(&arc);
        for v in [-0.04, -0.01, 0.0, 0.03f64] {
            let share = ((0.25 - v).powi(2) - 0.2f64.powi(2)) / (0.3f64.powi(2) - 0.2f64.powi(2));
            let radius = (1.0 - 4.0 * v) / 2.0;
            assert_relative_eq!(distribution.share_below(radius), share, epsilon = 1e-10);
            let found = distribution.radius_exceeded_on(1.0 - share);
            assert_relative_eq!(found, radius, max_relative = 1e-10);
        }
    }

    #[test]
    fn test_stiffeners_count_as_flat() {
        let pieces = vec![
            Piece::Strip { geodesic: 0.0 },
            Piece::Joint { angle: 0.0 },
            Piece::Rigid,
        ];
        let (u, bend) = (vec![0.0, 0.03, 0.03, 1.0], vec![5.0, 5.0, 0.0, 0.0]);
        let belt = Spine::from_fields(0.1, Pose::identity(), pieces, u, bend, vec![0.0; 4]);
        let [p999, p99, p95] = quantiles(&belt);
        assert_relative_eq!(p999, 0.2, max_relative = 1e-10);
        assert_relative_eq!(p99, 0.2, max_relative = 1e-10);
        assert_eq!(p95, f64::INFINITY);
        let share = BendDistribution::of(&belt).share_below(1.0);
        assert_relative_eq!(share, 0.03, epsilon = 1e-12);
    }

    #[test]
    fn test_flat_belt_has_infinite_radii() {
        let flat = spine(1.0, 0.1, 9, |_| 0.0, |u| u);
        assert_eq!(quantiles(&flat), [f64::INFINITY; 3]);
        assert_eq!(BendDistribution::of(&flat).share_below(1e9), 0.0);
    }

    /// Share of the points of a flat grid at which the bent belt has a radius below a given one.
    fn share_of_grid(spine: &Spine, radius: f64) -> f64 {
        let step = spine.width / 29.0;
        let ribs = crate::surface::ribs(spine);
        let corners = ribs
            .iter()
            .flat_map(|rib| [rib.flat_point(rib.v_minus), rib.flat_point(rib.v_plus)]);
        let corners: Vec<Vector2<f64>> = corners.collect();
        let low = corners
            .iter()
            .fold(corners[0], |low, corner| low.inf(corner));
        let high = corners
            .iter()
            .fold(corners[0], |high, corner| high.sup(corner));
        let counts = (high - low).map(|side| (side / step).ceil() as usize);
        let board = Board::of(spine);
        let (mut on_board, mut below) = (0.0, 0.0);
        for i in 0..counts.x * counts.y {
            let cell = Vector2::new((i % counts.x) as f64 + 0.5, (i / counts.x) as f64 + 0.5);
            let point = low + step * cell;
            let Some(u) = rib_foot(spine, point.x, point.y) else {
                continue;
            };
            on_board += 1.0;
            let foot = board.foot_at(spine, u);
            let element = spine.u.partition_point(|&node| node < u).max(1) - 1;
            let is_on_rib = foot.rib.excess(&point).abs() < 1e-6 * spine.width;
            if matches!(spine.pieces[element], Piece::Strip { .. }) && is_on_rib {
                let s = spine.convergence(element, foot.point.rib_slope);
                let bend = curvature(foot.point.bend, foot.point.rib_slope);
                let v = foot.rib.foot.local(&point).y;
                below += f64::from(u8::from(bend_radius(bend, s, v) < radius));
            }
        }
        below / on_board
    }

    #[test]
    fn test_area_below_a_radius_is_that_of_the_points_of_the_flat_board() {
        let parts = [
            Stretch::Straight(0.4),
            Stretch::Corner(0.8),
            Stretch::Straight(0.3),
            Stretch::Arc(0.3, -4.0),
            Stretch::Straight(0.2),
            Stretch::Rigid(0.2),
        ];
        let mut plan = Plan::open(0.1, &parts);
        plan.wave = (0.2, 3.0);
        let belt = plan.spine();
        let distribution = BendDistribution::of(&belt);
        for share in [0.9, 0.7, 0.5] {
            let radius = distribution.radius_exceeded_on(share);
            let below = share_of_grid(&belt, radius);
            assert!((below - (1.0 - share)).abs() < 4e-3, "{share} {below}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn test_area_below_a_radius_is_that_of_sampled_points((bend, slope) in waves(15.0)) {
            let belt = spine(1.0, 0.1, 40, |u| bend.at(u), |u| slope.at(u));
            let distribution = BendDistribution::of(&belt);
            let radius = distribution.radius_exceeded_on(0.8);
            prop_assume!(radius.is_finite());
            prop_assert!((share_of_grid(&belt, radius) - 0.2).abs() < 8e-3);
        }
    }
}
