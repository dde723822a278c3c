//! Lines and circular arcs in the plane of the flat board.

use crate::board::flat::FlatFrame;
use nalgebra::Vector2;
use std::f64::consts::TAU;

/// An exact piece of an outline: a line or an arc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Curve {
    /// A straight line.
    Line {
        /// First point.
        from: Vector2<f64>,
        /// Last point.
        to: Vector2<f64>,
    },
    /// A circular arc, by its start and curvature: nothing is lost where it is almost straight.
    Arc {
        /// First point, and the direction in which the arc leaves it.
        start: FlatFrame,
        /// Length.
        length: f64,
        /// Signed curvature, not 0; positive turns from y towards z.
        curvature: f64,
    },
}

impl Curve {
    /// The curve at a distance to the +ζ side of an arc of the spine; `None` where the arc is too tight to have one.
    pub(crate) fn offset(
        start: &FlatFrame,
        curvature: f64,
        length: f64,
        distance: f64,
    ) -> Option<Self> {
        let position = start.position + distance * start.across();
        let scale = 1.0 - curvature * distance;
        if curvature == 0.0 {
            return Some(Self::Line {
                from: position,
                to: position + length * start.tangent(),
            });
        }
        (scale > 1e-9).then(|| Self::Arc {
            start: FlatFrame {
                position,
                heading: start.heading,
            },
            length: length * scale,
            curvature: curvature / scale,
        })
    }

    /// First point.
    pub fn first(&self) -> Vector2<f64> {
        match self {
            Self::Line { from, .. } => *from,
            Self::Arc { start, .. } => start.position,
        }
    }

    /// Last point.
    pub(crate) fn last(&self) -> Vector2<f64> {
        self.point(1.0)
    }

    /// The point at a fraction of the length.
    pub(crate) fn point(&self, fraction: f64) -> Vector2<f64> {
        match self {
            Self::Line { from, to } => match fraction == 1.0 {
                true => *to,
                false => from + fraction * (to - from),
            },
            Self::Arc {
                start,
                length,
                curvature,
            } => start.along(*curvature, fraction * length).position,
        }
    }

    /// Length.
    pub(crate) fn length(&self) -> f64 {
        match self {
            Self::Line { from, to } => (to - from).norm(),
            Self::Arc { length, .. } => *length,
        }
    }

    /// Signed angle by which the direction turns from the first point to the last.
    ///
    /// Units: rad
    pub(crate) fn turn(&self) -> f64 {
        match self {
            Self::Line { .. } => 0.0,
            Self::Arc {
                length, curvature, ..
            } => length * curvature,
        }
    }

    /// Centre and radius of an arc; `None` of a line.
    pub(crate) fn circle(&self) -> Option<(Vector2<f64>, f64)> {
        match self {
            Self::Line { .. } => None,
            Self::Arc {
                start, curvature, ..
            } => {
                let centre = start.position + start.across() / *curvature;
                Some((centre, 1.0 / curvature.abs()))
            }
        }
    }

    /// The part between two fractions of the length.
    pub(crate) fn part(&self, from: f64, to: f64) -> Self {
        match self {
            Self::Line { .. } => Self::Line {
                from: self.point(from),
                to: self.point(to),
            },
            Self::Arc {
                start,
                length,
                curvature,
            } => Self::Arc {
                start: start.along(*curvature, from * length),
                length: (to - from) * length,
                curvature: *curvature,
            },
        }
    }

    /// Points along the curve, the first and the last among them, no chord farther from it than a tolerance.
    ///
    /// A tolerance of 0 or less counts as a thousandth of the radius.
    pub fn points(&self, tolerance: f64) -> Vec<Vector2<f64>> {
        let count = self.chords(tolerance);
        let fractions = (0..=count).map(|i| i as f64 / count as f64);
        fractions.map(|fraction| self.point(fraction)).collect()
    }

    /// Number of equal chords that keep to a tolerance: the sagitta of one is 2 r sin²(turn/4).
    fn chords(&self, tolerance: f64) -> usize {
        let Some((_, radius)) = self.circle() else {
            return 1;
        };
        let share = match tolerance > 0.0 {
            true => (tolerance / radius).min(1.0),
            false => 1e-3,
        };
        let widest = 4.0 * (0.5 * share).sqrt().asin();
        (self.turn().abs() / widest).ceil().clamp(1.0, 1e5) as usize
    }

    /// ½ ∫ (y dz − z dy): summed around a loop, its area.
    pub(crate) fn swept_area(&self) -> f64 {
        let (turn, length) = (self.turn(), self.length());
        // (φ − sin φ)/φ² by the coefficients: its difference leaves no digits for small φ.
        let bulge = match turn.abs() < 1e-2 {
            true => turn / 6.0 * (1.0 - turn * turn / 20.0),
            false => (turn - turn.sin()) / (turn * turn),
        };
        0.5 * self.first().perp(&self.last()) + 0.5 * length * length * bulge
    }

    /// The places where two curves cross, as fractions of the length of each.
    pub(crate) fn crossings(&self, other: &Self) -> Vec<[f64; 2]> {
        let points = match (self.circle(), other.circle()) {
            (None, None) => line_and_line(self, other),
            (None, Some(circle)) => line_and_circle(self, circle),
            (Some(circle), None) => line_and_circle(other, circle),
            (Some(circle), Some(another)) => circle_and_circle(circle, another),
        };
        let pairs = |point: Vector2<f64>| {
            let (own, theirs) = (self.fractions_at(&point), other.fractions_at(&point));
            own.into_iter()
                .flat_map(move |a| theirs.clone().into_iter().map(move |b| [a, b]))
        };
        points.into_iter().flat_map(pairs).collect()
    }

    /// Fractions of the length at which the curve passes a point of its line or circle, if it does.
    fn fractions_at(&self, point: &Vector2<f64>) -> Vec<f64> {
        match self {
            Self::Line { from, to } => {
                let along = to - from;
                let fraction = along.dot(&(point - from)) / along.norm_squared();
                Vec::from_iter(held(fraction))
            }
            Self::Arc { start, .. } => {
                let (turn, chord) = (self.turn(), point - start.position);
                // A chord turns by half the angle of its arc.
                let half = start
                    .tangent()
                    .perp(&chord)
                    .atan2(start.tangent().dot(&chord));
                let once = (2.0 * half * turn.signum()).rem_euclid(TAU);
                let rounds = (turn.abs() / TAU).ceil() as usize;
                let angles = (0..=rounds + 1).map(|round| once + TAU * (round as f64 - 1.0));
                angles
                    .filter_map(|angle| held(angle / turn.abs()))
                    .collect()
            }
        }
    }
}

/// A fraction of a length, clamped to [0, 1] where rounding alone has carried it outside; `None` farther outside.
fn held(fraction: f64) -> Option<f64> {
    (-1e-9..=1.0 + 1e-9)
        .contains(&fraction)
        .then(|| fraction.clamp(0.0, 1.0))
}

fn line_and_line(a: &Curve, b: &Curve) -> Vec<Vector2<f64>> {
    let (along, other) = (a.last() - a.first(), b.last() - b.first());
    let cross = along.perp(&other);
    if cross.abs() <= 1e-12 * along.norm() * other.norm() {
        return Vec::new();
    }
    let fraction = (b.first() - a.first()).perp(&other) / cross;
    vec![a.first() + fraction * along]
}

fn line_and_circle(line: &Curve, (centre, radius): (Vector2<f64>, f64)) -> Vec<Vector2<f64>> {
    let along = (line.last() - line.first()).normalize();
    let foot = line.first() + along.dot(&(centre - line.first())) * along;
    let square = radius * radius - (centre - foot).norm_squared();
    if square.is_nan() || square < 0.0 {
        return Vec::new();
    }
    vec![foot - square.sqrt() * along, foot + square.sqrt() * along]
}

fn circle_and_circle(
    (centre, radius): (Vector2<f64>, f64),
    (other, other_radius): (Vector2<f64>, f64),
) -> Vec<Vector2<f64>> {
    let between = other - centre;
    let distance = between.norm();
    if distance <= 1e-12 * radius {
        return Vec::new();
    }
    let along = between / distance;
    let reach = 0.5 * (distance + (radius - other_radius) * (radius + other_radius) / distance);
    let square = radius * radius - reach * reach;
    if square < 0.0 {
        return Vec::new();
    }
    let side = square.sqrt() * Vector2::new(-along.y, along.x);
    let middle = centre + reach * along;
    vec![middle - side, middle + side]
}
