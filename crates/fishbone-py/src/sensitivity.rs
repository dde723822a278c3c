//! `_core.Sensitivity`.

use crate::array::{self, Grid, Points, Scalars};
use crate::errors::raised;
use crate::exclusive::Exclusive;
use fishbone::analysis::sensitivity::{self, Change, Motion, NoSensitivity, Parameters};
use fishbone::geometry::Wrench;
use nalgebra::Vector3;
use numpy::ndarray::{ArrayView1, ArrayView2};
use numpy::{IntoPyArray, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

/// Derivatives by supports, rigidity, natural bend, [width, thickness, Poisson's ratio], gravity.
type Gradient<'py> = (Points<'py>, Scalars<'py>, Scalars<'py>, [f64; 3], [f64; 3]);

/// The factorised first-order conditions of an equilibrium.
///
/// Errors: `NoSensitivity` if the supports cannot make a motion.
#[pyclass(frozen, module = "fishbone._core")]
pub(crate) struct Sensitivity {
    inner: Exclusive<sensitivity::Sensitivity>,
    /// Supports, nodes, segments.
    shape: (usize, usize, usize),
}

impl Sensitivity {
    pub(crate) fn new(inner: sensitivity::Sensitivity) -> Self {
        Self {
            shape: (inner.supports(), inner.nodes(), inner.segments()),
            inner: Exclusive::new(inner),
        }
    }

    /// Calls the derivatives with the GIL released.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        product: impl FnOnce(&mut sensitivity::Sensitivity) -> Result<T, NoSensitivity> + Send,
    ) -> PyResult<T> {
        self.inner
            .with(py, |sensitivity, _| product(sensitivity), |_| ())?
            .map_err(|error| raised(py, &error))
    }
}

#[pymethods]
impl Sensitivity {
    /// Numbers of supports, nodes and segments.
    #[getter]
    fn shape(&self) -> (usize, usize, usize) {
        self.shape
    }

    /// (position, rotation, bend, `rib_slope`, reactions, energy).
    ///
    /// The last but one are width, thickness and Poisson's ratio.
    ///
    /// Shapes: (m, 6), (n,), (segments,), (3,), (3,) to (n, 3), (n, 3), (n,), (n,), (m, 6), 1.
    fn forward<'py>(
        &self,
        py: Python<'py>,
        supports: PyReadonlyArray2<'py, f64>,
        rigidity: PyReadonlyArray1<'py, f64>,
        natural_bend: PyReadonlyArray1<'py, f64>,
        sheet: [f64; 3],
        gravity: [f64; 3],
    ) -> PyResult<(
        Points<'py>,
        Points<'py>,
        Scalars<'py>,
        Scalars<'py>,
        Points<'py>,
        f64,
    )> {
        let supports = halves(supports.as_array());
        let [width, thickness, poisson] = sheet;
        let parameters = Parameters {
            supports: supports
                .map(|[translation, rotation]| Motion {
                    translation,
                    rotation,
                })
                .collect(),
            rigidity: rigidity.as_array().to_vec(),
            natural_bend: natural_bend.as_array().to_vec(),
            width,
            thickness,
            poisson,
            gravity: gravity.into(),
        };
        let change = self.with(py, |inner| inner.forward(&parameters))?;
        let reactions = change.reactions.iter().map(|on| [on.force, on.moment]);
        Ok((
            array::points(py, &change.position),
            array::points(py, &change.rotation),
            change.bend.into_pyarray(py),
            change.rib_slope.into_pyarray(py),
            array::doubles(py, reactions),
            change.energy,
        ))
    }

    /// (supports, rigidity, `natural_bend`, [width, thickness, Poisson's ratio], gravity).
    ///
    /// Shapes: those of `forward`, the other way round.
    #[expect(clippy::too_many_arguments, reason = "one each that may change")]
    fn adjoint<'py>(
        &self,
        py: Python<'py>,
        position: PyReadonlyArray2<'py, f64>,
        rotation: PyReadonlyArray2<'py, f64>,
        bend: PyReadonlyArray1<'py, f64>,
        rib_slope: PyReadonlyArray1<'py, f64>,
        reactions: PyReadonlyArray2<'py, f64>,
        energy: f64,
    ) -> PyResult<Gradient<'py>> {
        let reactions = halves(reactions.as_array());
        let by = Change {
            position: vectors(position.as_array()),
            rotation: vectors(rotation.as_array()),
            bend: bend.as_array().to_vec(),
            rib_slope: rib_slope.as_array().to_vec(),
            reactions: reactions
                .map(|[force, moment]| Wrench { force, moment })
                .collect(),
            energy,
        };
        let gradient = self.with(py, |inner| inner.adjoint(&by))?;
        let supports = gradient.supports.iter();
        Ok((
            array::doubles(py, supports.map(|by| [by.translation, by.rotation])),
            gradient.rigidity.into_pyarray(py),
            gradient.natural_bend.into_pyarray(py),
            [gradient.width, gradient.thickness, gradient.poisson],
            array::row(&gradient.gravity),
        ))
    }

    /// Spine positions by the motion of a support, given by its number.
    ///
    /// Shapes: (n, 3, 6).
    fn jacobian<'py>(&self, py: Python<'py>, support: usize) -> PyResult<Grid<'py>> {
        let jacobian = self.with(py, |inner| inner.jacobian(support))?;
        Ok(array::matrices(py, &jacobian))
    }
}

fn vectors(rows: ArrayView2<'_, f64>) -> Vec<Vector3<f64>> {
    rows.rows().into_iter().map(|row| vector(row, 0)).collect()
}

/// The first and the last three entries of every row.
fn halves(rows: ArrayView2<'_, f64>) -> impl Iterator<Item = [Vector3<f64>; 2]> {
    let rows: Vec<_> = rows
        .rows()
        .into_iter()
        .map(|row| [0, 3].map(|from| vector(row, from)))
        .collect();
    rows.into_iter()
}

fn vector(row: ArrayView1<'_, f64>, from: usize) -> Vector3<f64> {
    Vector3::from_fn(|i, _| row[from + i])
}
