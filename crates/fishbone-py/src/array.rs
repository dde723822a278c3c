//! NumPy arrays of the core's vectors: float64, C order, one row a node.

use nalgebra::{Matrix3, Matrix3x6, Matrix6, Vector2, Vector3};
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

pub(crate) type Scalars<'py> = Bound<'py, PyArray1<f64>>;
pub(crate) type Points<'py> = Bound<'py, PyArray2<f64>>;
pub(crate) type Triangles<'py> = Bound<'py, PyArray2<i64>>;
pub(crate) type Grid<'py> = Bound<'py, PyArray3<f64>>;

/// A vector as a row of numbers.
pub(crate) fn row(vector: &Vector3<f64>) -> [f64; 3] {
    [vector.x, vector.y, vector.z]
}

/// Shapes: (n, 3).
pub(crate) fn points<'a, 'py>(
    py: Python<'py>,
    vectors: impl IntoIterator<Item = &'a Vector3<f64>>,
) -> Points<'py> {
    let rows: Vec<[f64; 3]> = vectors.into_iter().map(row).collect();
    Array2::from(rows).into_pyarray(py)
}

/// Shapes: (n, 6).
pub(crate) fn doubles(
    py: Python<'_>,
    pairs: impl IntoIterator<Item = [Vector3<f64>; 2]>,
) -> Points<'_> {
    let rows: Vec<[f64; 6]> = pairs
        .into_iter()
        .map(|[a, b]| [a.x, a.y, a.z, b.x, b.y, b.z])
        .collect();
    Array2::from(rows).into_pyarray(py)
}

/// Shapes: (n, 2).
pub(crate) fn flat_points(
    py: Python<'_>,
    vectors: impl IntoIterator<Item = Vector2<f64>>,
) -> Points<'_> {
    let rows: Vec<[f64; 2]> = vectors.into_iter().map(Into::into).collect();
    Array2::from(rows).into_pyarray(py)
}

/// Rows of one length.
///
/// Shapes: (n, length).
pub(crate) fn rows<'a, 'py>(
    py: Python<'py>,
    rows: impl ExactSizeIterator<Item = &'a [f64]>,
) -> PyResult<Points<'py>> {
    let count = rows.len();
    let flat: Vec<f64> = rows.flatten().copied().collect();
    let shape = (count, flat.len().checked_div(count).unwrap_or(0));
    let array = Array2::from_shape_vec(shape, flat)
        .map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
    Ok(array.into_pyarray(py))
}

/// Shapes: (6, 6).
pub(crate) fn square<'py>(py: Python<'py>, matrix: &Matrix6<f64>) -> Points<'py> {
    let rows: Vec<[f64; 6]> = matrix
        .row_iter()
        .map(|row| row.transpose().into())
        .collect();
    Array2::from(rows).into_pyarray(py)
}

/// Shapes: (n, 2, 2).
pub(crate) fn pairs(py: Python<'_>, rows: Vec<[[f64; 2]; 2]>) -> Grid<'_> {
    Array3::from(rows).into_pyarray(py)
}

/// Shapes: (n, 3, 3), row-major.
pub(crate) fn frames<'a, 'py>(
    py: Python<'py>,
    frames: impl IntoIterator<Item = &'a Matrix3<f64>>,
) -> Grid<'py> {
    let rows: Vec<[[f64; 3]; 3]> = frames
        .into_iter()
        .map(|frame| frame.transpose().into())
        .collect();
    Array3::from(rows).into_pyarray(py)
}

/// Shapes: (n, 3, 6).
pub(crate) fn matrices<'py>(py: Python<'py>, matrices: &[Matrix3x6<f64>]) -> Grid<'py> {
    let rows: Vec<[[f64; 6]; 3]> = matrices
        .iter()
        .map(|matrix| matrix.transpose().into())
        .collect();
    Array3::from(rows).into_pyarray(py)
}

/// Shapes: (n, `n_across`, 3).
pub(crate) fn grid<'py>(
    py: Python<'py>,
    n_across: usize,
    vectors: impl Iterator<Item = Vector3<f64>>,
) -> PyResult<Grid<'py>> {
    let flat: Vec<f64> = vectors.flat_map(|vector| row(&vector)).collect();
    let rows = flat.len().checked_div(3 * n_across).unwrap_or(0);
    let shape = (rows, n_across, 3);
    let array = Array3::from_shape_vec(shape, flat)
        .map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
    Ok(array.into_pyarray(py))
}

/// Shapes: (m, 3), indices of vertices.
pub(crate) fn triangles<'py>(py: Python<'py>, corners: &[[u32; 3]]) -> Triangles<'py> {
    let rows: Vec<[i64; 3]> = corners.iter().map(|corner| corner.map(i64::from)).collect();
    Array2::from(rows).into_pyarray(py)
}
