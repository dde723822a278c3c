//! How close the ribs of an element come, with derivatives.

use super::{FIELDS, GAUSS_4, hermite};
use crate::strip::element::Element;
use nalgebra::SVector;
use stagewise::StageMatrix;

/// The share y = s V/2 of the convergence at which ribs meet at the edge, at a parameter of an element.
pub(super) struct Share {
    pub(super) value: f64,
    half_width: f64,
    /// Twice the in-plane curvature.
    twice: f64,
    slope: f64,
    /// Derivatives of the slope and of its rate by slope and rate at the start, then at the end.
    by: [[f64; 4]; 2],
}

impl Share {
    /// Parameters at which the ribs of an element are bounded, dimensionless.
    pub(super) const PLACES: [f64; 6] = [
        0.0,
        GAUSS_4[0][0],
        GAUSS_4[1][0],
        GAUSS_4[2][0],
        GAUSS_4[3][0],
        1.0,
    ];

    pub(super) fn at(element: &Element, [a, b]: [&SVector<f64, FIELDS>; 2], t: f64) -> Self {
        let h = element.length;
        let [value, first, _] = hermite(t);
        let by = [
            [value[0], h * value[1], value[2], h * value[3]],
            [first[0] / h, first[1], first[2] / h, first[3]],
        ];
        let [slope, rate] = by.map(|by| by[0] * a[1] + by[1] * a[2] + by[2] * b[1] + by[3] * b[2]);
        Self {
            value: element.half_width * (rate + element.geodesic * (1.0 + slope * slope)),
            half_width: element.half_width,
            twice: 2.0 * element.geodesic,
            slope,
            by,
        }
    }

    /// Gradient by the fields at both ends.
    pub(super) fn gradient(&self) -> [SVector<f64, FIELDS>; 2] {
        let [slope, rate] = self.by;
        let at = |i: usize| self.half_width * (rate[i] + self.twice * self.slope * slope[i]);
        [0, 2].map(|from| SVector::from([0.0, at(from), at(from + 1), 0.0, 0.0, 0.0]))
    }

    /// Adds a multiple of the second derivative.
    pub(super) fn add_hessian(&self, factor: f64, controls: &mut StageMatrix<FIELDS>) {
        let [slope, _] = self.by;
        let factor = factor * self.half_width * self.twice;
        for i in 0..2 {
            for j in 0..2 {
                controls.first[(1 + i, 1 + j)] += factor * slope[i] * slope[j];
                controls.mixed[(1 + i, 1 + j)] += factor * slope[i] * slope[2 + j];
                controls.second[(1 + i, 1 + j)] += factor * slope[2 + i] * slope[2 + j];
            }
        }
    }
}
