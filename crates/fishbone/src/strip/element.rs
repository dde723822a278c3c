//! One element of the belt: its data, and the pose increment along it.
//!
//! An element joins two nodes; its four unknowns are `(bend₀, slope₀, bend₁, slope₁)`, linear in between. Pose and energy are
//! taken at the same two Gauss points: at different ones, a node-to-node zigzag of the unknowns would cost one of them nothing.

use crate::geometry::{Pose, SHORTENING, Twist, gauss_points, magnus};
use crate::strip::bounds::{ActiveEdges, RibBounds};
use crate::strip::ribs::Strips;
use nalgebra::{Vector3, Vector4};

/// Torsion ω_η = −β ω_ζ.
///
/// Source: Eq. (32)
pub(crate) fn torsion(bend: f64, rib_slope: f64) -> f64 {
    -rib_slope * bend
}

/// The twist of the pose per unit u, body axes: along η, and by the rates (κ_g, −β ω_ζ, ω_ζ).
///
/// Source: Eq. (3), (4), (25), (32)
pub(crate) fn strain(geodesic: f64, bend: f64, rib_slope: f64) -> Twist {
    Twist {
        translation: Vector3::y(),
        rotation: Vector3::new(geodesic, torsion(bend, rib_slope), bend),
    }
}

/// The motion along a piece of the spine, by a fourth-order Magnus step from the fields at its two ends.
pub(crate) fn increment(length: f64, geodesic: f64, fields: &Vector4<f64>) -> Pose {
    let gauss = GaussFields::at(fields);
    Pose::exp(&gauss.step(length, geodesic))
}

/// The motion along a piece of the spine, by a fourth-order Magnus step from bend and torsion at its two Gauss points.
pub(crate) fn increment_of(length: f64, geodesic: f64, rates: [[f64; 2]; 2]) -> Pose {
    let [first, second] = rates.map(|[bend, torsion]| Twist {
        translation: Vector3::y(),
        rotation: Vector3::new(geodesic, torsion, bend),
    });
    Pose::exp(&step(&first, &second, length))
}

/// The Magnus step by twists per unit length at the two Gauss points, no longer than its arc.
fn step(first: &Twist, second: &Twist, length: f64) -> Twist {
    let rise = second.rotation.z - first.rotation.z;
    let mut step = magnus(first, second, length);
    step.translation.y -= SHORTENING * rise * rise * length.powi(3);
    step
}

/// The natural bend of a belt, with its Poisson's ratio.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct Curl<W = f64> {
    /// Natural bend k, the ω_ζ of the unloaded belt.
    pub bend: W,
    /// Poisson's ratio ν: bending along the curl bends the plate across it by ν as much.
    pub poisson: W,
}

/// What an element is made of, as its density depends on it; a density may be differentiated by it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stock<W = f64> {
    /// Half the width, V/2.
    pub half_width: W,
    /// Natural bend, and Poisson's ratio.
    pub curl: Curl<W>,
    /// Stretching stiffness over the plate's rigidity, as that of the [`Element`].
    pub stretching: W,
}

impl Stock {
    /// The same numbers in another type.
    pub(crate) fn map<W>(&self, f: impl Fn(f64) -> W) -> Stock<W> {
        Stock {
            half_width: f(self.half_width),
            curl: Curl {
                bend: f(self.curl.bend),
                poisson: f(self.curl.poisson),
            },
            stretching: f(self.stretching),
        }
    }
}

/// The data of one element.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct Element {
    /// Length h along the spine.
    pub length: f64,
    /// In-plane curvature κ_g of the flat board.
    pub geodesic: f64,
    /// Rigidity R_f at the two Gauss points.
    pub rigidity: [f64; 2],
    /// Half the width, V/2.
    pub half_width: f64,
    /// Natural bend of the element.
    pub curl: Curl,
    /// Stretching stiffness E h over the plate's rigidity D, in 1/U²: 12(1−ν²)/h² of a sheet of the thickness h. Infinite of
    /// a belt that does not stretch.
    pub stretching: f64,
}

/// Bend and slope at the two Gauss points.
#[derive(Debug, Clone, Copy)]
pub(super) struct GaussFields {
    pub(super) bend: [f64; 2],
    pub(super) slope: [f64; 2],
}

impl GaussFields {
    pub(super) fn at(fields: &Vector4<f64>) -> Self {
        let between = |a: f64, b: f64| gauss_points().map(|t| (1.0 - t) * a + t * b);
        Self {
            bend: between(fields[0], fields[2]),
            slope: between(fields[1], fields[3]),
        }
    }

    /// Twists per unit length at the two Gauss points.
    fn strains(&self, geodesic: f64) -> [Twist; 2] {
        [0, 1].map(|i| strain(geodesic, self.bend[i], self.slope[i]))
    }

    /// The Magnus step.
    fn step(&self, length: f64, geodesic: f64) -> Twist {
        let [first, second] = self.strains(geodesic);
        step(&first, &second, length)
    }
}

impl Element {
    /// An element of a straight board of rigidity 1.
    pub fn straight(length: f64, half_width: f64, curl: Curl) -> Self {
        Self {
            length,
            geodesic: 0.0,
            rigidity: [1.0; 2],
            half_width,
            curl,
            stretching: f64::INFINITY,
        }
    }

    /// Rigidity at parameter t of the element, of which it is a linear function.
    pub(crate) fn rigidity_at(&self, t: f64) -> f64 {
        let [a, b] = gauss_points();
        let [first, second] = self.rigidity;
        first + (second - first) * ((t - a) / (b - a))
    }

    /// The shares of both numbers of the rigidity in that at parameter t.
    pub(crate) fn rigidity_shares(t: f64) -> [f64; 2] {
        let [a, b] = gauss_points();
        let second = (t - a) / (b - a);
        [1.0 - second, second]
    }

    /// What it is made of.
    pub(crate) fn stock(&self) -> Stock {
        Stock {
            half_width: self.half_width,
            curl: self.curl,
            stretching: self.stretching,
        }
    }

    /// The inequalities that keep its ribs apart.
    pub(crate) fn bounds<'a>(&self, edges: &'a ActiveEdges) -> RibBounds<'a> {
        RibBounds {
            strips: self.strips(),
            edges,
        }
    }

    /// The strips between its ribs.
    pub(crate) fn strips(&self) -> Strips {
        self.strips_of(self.half_width)
    }

    /// The strips between its ribs, of another width.
    pub(crate) fn strips_of<W>(&self, half_width: W) -> Strips<W> {
        Strips {
            half_width,
            geodesic: self.geodesic,
            length: self.length,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chord of a plane arc along which the bend falls evenly from `bend` to its opposite: Fresnel's integrals, by the
    /// midpoint rule.
    fn chord(length: f64, bend: f64) -> f64 {
        let pieces = 20_000;
        let tangents = (0..pieces).map(|i| {
            let u = (f64::from(i) + 0.5) / f64::from(pieces);
            let angle = bend * length * u * (1.0 - u);
            [angle.cos(), angle.sin()]
        });
        let [along, across] = tangents.fold([0.0, 0.0], |sum, t| [sum[0] + t[0], sum[1] + t[1]]);
        along.hypot(across) * length / f64::from(pieces)
    }

    #[test]
    fn test_zigzag_of_the_bend_shortens_the_chord_as_it_does_the_arc() {
        for (length, bend) in [(0.1, 1.0), (0.1, 5.0), (1e-3, 400.0), (0.5, 2.0)] {
            let fields = Vector4::new(bend, 0.0, -bend, 0.0);
            let chord = [
                increment(length, 0.0, &fields).position.norm(),
                chord(length, bend),
            ];
            let [own, true_one] = chord.map(|chord| 1.0 - chord / length);
            assert!(
                own > 0.0 && (own / true_one - 1.0).abs() < 0.05,
                "{own} {true_one}"
            );
        }
    }

    #[test]
    fn test_chord_is_no_longer_than_the_arc() {
        for bends in [[30.0, -30.0], [8.0, -20.0], [1.0, -1.0], [10.0, -9.0]] {
            for slopes in [[0.0, 0.0], [1.0, 0.7], [-0.5, 0.5]] {
                for geodesic in [0.0, 3.0] {
                    let fields = Vector4::new(bends[0], slopes[0], bends[1], slopes[1]);
                    let chord = increment(0.05, geodesic, &fields).position.norm();
                    assert!(chord <= 0.05, "{chord} {bends:?} {slopes:?}");
                }
            }
        }
    }
}
