//! One element of the belt: its data, and the pose increment along it.
//!
//! An element joins two nodes; its four unknowns are `(bend₀, slope₀, bend₁, slope₁)`, linear in between. Pose and energy are
//! taken at the same two Gauss points: at different ones, a node-to-node zigzag of the unknowns would cost one of them nothing.

use crate::geometry::{Pose, Twist, gauss_points, magnus};
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

/// The natural bend of a belt, with its Poisson's ratio.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Curl<W = f64> {
    /// Natural bend k, the ω_ζ of the unloaded belt.
    pub bend: W,
    /// Poisson's ratio ν: bending along the curl bends the plate across it by ν as much.
    pub poisson: f64,
}

/// The data of one element.
#[derive(Debug, Clone, Copy, PartialEq)]
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
        magnus(&first, &second, length)
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
        }
    }

    /// The strips between its ribs.
    pub(crate) fn strips(&self) -> Strips {
        Strips {
            half_width: self.half_width,
            geodesic: self.geodesic,
            length: self.length,
        }
    }
}
