//! Rotations as they are written, as rotation vectors.

use crate::array;
use fishbone::geometry::log;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion};
use pyo3::prelude::*;

/// The rotation vector of a quaternion [w, x, y, z] that is not zero.
#[pyfunction]
pub(crate) fn rotation_of_quaternion(quaternion: [f64; 4]) -> [f64; 3] {
    let [w, x, y, z] = quaternion;
    let quaternion = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    array::row(&log(quaternion.to_rotation_matrix().matrix()))
}

/// The rotation vector of a rotation matrix, given by its rows.
#[pyfunction]
pub(crate) fn rotation_of_matrix(rows: [[f64; 3]; 3]) -> [f64; 3] {
    array::row(&log(&Matrix3::from_fn(|i, j| rows[i][j])))
}
