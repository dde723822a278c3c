//! Scales between the parameters of a scenario and the data of its programme.

use super::data::{Data, HALF_WIDTH, NATURAL_BEND, POISSON, STRETCHING};
use super::system::Direction;
use super::{Motion, Parameters};
use crate::geometry::gauss_points;
use crate::problem::program::{BeltProgram, Piece};
use crate::problem::{Problem, Units};
use crate::strip::density::Density;
use nalgebra::Vector3;

/// A linear map from parameters to the data of a programme.
#[derive(Debug)]
pub(super) struct Scales {
    /// Units of the programme.
    pub(super) units: Units,
    /// Derivative by gravity of the potential at the programme's origin.
    pub(super) origin_by_gravity: Vector3<f64>,
    /// Weight per unit of gravity.
    weight: f64,
    supports: usize,
    segments: usize,
    /// The segment to which every piece belongs.
    segment: Vec<usize>,
    /// Derivatives of the stretching stiffness of every piece over its rigidity, by thickness and by Poisson's ratio.
    stretching: Vec<[f64; 2]>,
}

impl Scales {
    pub(super) fn new<D: Density<F>, const F: usize, const N: usize>(
        problem: &Problem,
        program: &BeltProgram<D, F, N>,
    ) -> Self {
        let (belt, units) = (problem.belt(), problem.units());
        let ends = belt.segments.iter().scan(0.0, |end, segment| {
            *end += segment.length() / units.length;
            Some(*end)
        });
        let ends: Vec<f64> = ends.collect();
        let nodes = program.nodes();
        let middles = nodes.windows(2).map(|ends| 0.5 * (ends[0] + ends[1]));
        Self {
            origin_by_gravity: -belt.density * units.length * problem.origin(),
            weight: belt.density * units.length / units.force(),
            supports: problem.scenario().supports.len(),
            segments: ends.len(),
            segment: middles
                .map(|u| ends.partition_point(|end| *end < u).min(ends.len() - 1))
                .collect(),
            stretching: program.pieces.iter().map(by_sheet).collect(),
            units,
        }
    }

    pub(super) fn supports(&self) -> usize {
        self.supports
    }

    pub(super) fn segments(&self) -> usize {
        self.segments
    }

    /// The unit of rigidity.
    fn rigidity(&self) -> f64 {
        self.units.energy * self.units.length
    }

    /// The change of the programme's data by a change of the parameters.
    pub(super) fn to_program(&self, parameters: &Parameters, unchanged: Direction) -> Direction {
        let length = self.units.length;
        let mut direction = unchanged;
        for (to, motion) in direction.supports.iter_mut().zip(&parameters.supports) {
            *to = Motion {
                translation: motion.translation / length,
                rotation: motion.rotation,
            };
        }
        let nodes = parameters.rigidity.windows(2).zip(&self.segment);
        let pieces = nodes.zip(&self.stretching);
        let sheet = [parameters.thickness / length, parameters.poisson];
        for (data, ((rigidity, segment), by)) in direction.elements.iter_mut().zip(pieces) {
            for (i, t) in gauss_points().into_iter().enumerate() {
                data[i] = ((1.0 - t) * rigidity[0] + t * rigidity[1]) / self.rigidity();
            }
            data[NATURAL_BEND] = parameters.natural_bend[*segment] * length;
            data[HALF_WIDTH] = 0.5 * parameters.width / length;
            data[STRETCHING] = by[0] * sheet[0] + by[1] * sheet[1];
            data[POISSON] = sheet[1];
        }
        direction.weight = parameters.gravity * self.weight;
        direction
    }

    /// The derivative by the parameters, from the derivative by the programme's data: the transpose of [`Self::to_program`].
    pub(super) fn to_scenario(&self, by: &Direction, nodes: usize) -> Parameters {
        let length = self.units.length;
        let supports = by.supports.iter().take(self.supports);
        let mut parameters = Parameters {
            supports: supports
                .map(|motion| Motion {
                    translation: motion.translation / length,
                    rotation: motion.rotation,
                })
                .collect(),
            rigidity: vec![0.0; nodes],
            natural_bend: vec![0.0; self.segments],
            width: 0.0,
            thickness: 0.0,
            poisson: 0.0,
            gravity: by.weight * self.weight,
        };
        let pieces = self.segment.iter().zip(&self.stretching);
        for (k, (data, (segment, sheet))) in by.elements.iter().zip(pieces).enumerate() {
            let data: &Data = data;
            for (i, t) in gauss_points().into_iter().enumerate() {
                parameters.rigidity[k] += (1.0 - t) * data[i] / self.rigidity();
                parameters.rigidity[k + 1] += t * data[i] / self.rigidity();
            }
            parameters.natural_bend[*segment] += data[NATURAL_BEND] * length;
            parameters.width += 0.5 * data[HALF_WIDTH] / length;
            parameters.thickness += sheet[0] * data[STRETCHING] / length;
            parameters.poisson += sheet[1] * data[STRETCHING] + data[POISSON];
        }
        parameters
    }
}

/// Derivatives of the stretching stiffness of a sheet over its rigidity, 12(1−ν²)/h², by its thickness h and by ν; none of a
/// piece that does not stretch.
fn by_sheet(piece: &Piece) -> [f64; 2] {
    let Piece::Strip(element) = piece else {
        return [0.0; 2];
    };
    let (stretching, nu) = (element.stretching, element.curl.poisson);
    if stretching.is_infinite() {
        return [0.0; 2];
    }
    let square = 1.0 - nu * nu;
    let thickness = (12.0 * square / stretching).sqrt();
    [
        -2.0 * stretching / thickness,
        -2.0 * nu * stretching / square,
    ]
}
