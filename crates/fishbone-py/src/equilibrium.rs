//! `_core.Equilibrium`.

use crate::array::{self, Grid, Points, Scalars, Triangles};
use crate::errors::raised;
use crate::scenario::Scenario;
use crate::sensitivity::Sensitivity;
use crate::signals::Signals;
use crate::stored::{self, Reduced};
use fishbone::analysis::margin::MarginSettings;
use fishbone::board::curve::Curve;
use fishbone::equilibrium::{self, MeshError};
use fishbone::geometry::Wrench;
use fishbone::names::Named;
use fishbone::problem::Problem;
use fishbone::strip::spine::Piece;
use fishbone::surface::{self, PointStrain, Rib};
use nalgebra::{Vector2, Vector3, Vector6};
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyType};
use std::convert::Infallible;
use std::ops::ControlFlow;
use std::time::Instant;

impl Equilibrium {
    /// Solves, with the time of the solve.
    pub(crate) fn timed(problem: &Problem, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> Self {
        Self::of(|| fishbone::solve::solve(problem, proceed))
    }

    /// The equilibrium found.
    pub(crate) fn core(&self) -> &equilibrium::Equilibrium {
        &self.solved
    }

    /// The equilibrium of a search, with the time of the search.
    pub(crate) fn of(find: impl FnOnce() -> equilibrium::Equilibrium) -> Self {
        let Ok(found) = Self::try_of(|| Ok::<_, Infallible>(find()));
        found
    }

    /// The equilibrium of a search that may fail, with the time of the search.
    pub(crate) fn try_of<E>(
        find: impl FnOnce() -> Result<equilibrium::Equilibrium, E>,
    ) -> Result<Self, E> {
        let start = Instant::now();
        let solved = find()?;
        Ok(Self {
            solved,
            solve_time: start.elapsed().as_secs_f64(),
        })
    }
}

impl Equilibrium {
    /// The error by the mesh, which the core keeps once it is known, estimated with the GIL released.
    ///
    /// Errors: those that a signal handler raises.
    fn estimate(&self, py: Python<'_>) -> PyResult<Option<MeshError>> {
        let mut signals = Signals::new();
        let error = py.detach(|| self.solved.error_while(&mut || signals.proceed()));
        signals.raised.map_or(Ok(error), Err)
    }
}

/// Distance, direction, whether it is a fold, position and rotation vector.
type Margin = (f64, [f64; 6], bool, [f64; 3], [f64; 3], bool);

/// Eigenvalue, translation, rotation, bend and rib slope.
type Mode<'py> = (f64, Points<'py>, Points<'py>, Scalars<'py>, Scalars<'py>);

/// (value, u, v) of the largest strain, NaN where there is none, and the strains not exceeded on 99.9, 99 and 95 % of the area.
type StrainExtremes = ([f64; 3], [f64; 3]);

fn extremes(strain: &surface::StrainExtremes) -> StrainExtremes {
    let largest = strain.largest;
    let largest = largest.map_or([f64::NAN; 3], |at| [at.value, at.u, at.v]);
    (largest, strain.area)
}

/// The outcome of a solve.
#[pyclass(frozen, module = "fishbone._core")]
pub(crate) struct Equilibrium {
    solved: equilibrium::Equilibrium,
    solve_time: f64,
}

#[pymethods]
impl Equilibrium {
    /// The result of its bytes, with the time of its solve.
    ///
    /// Errors: `InvalidArgument` of other bytes.
    #[classmethod]
    fn from_bytes(
        _class: &Bound<'_, PyType>,
        py: Python<'_>,
        content: &[u8],
        solve_time: f64,
    ) -> PyResult<Self> {
        let solved = stored::from_bytes(py, content)?;
        Ok(Self { solved, solve_time })
    }

    /// What `pickle` and `copy` make it anew of.
    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<Reduced<'py, (Bound<'py, PyBytes>, f64)>> {
        let of = slf.get();
        let bytes = stored::to_bytes(slf.py(), &of.solved)?;
        Ok((
            slf.get_type().getattr("from_bytes")?,
            (bytes, of.solve_time),
        ))
    }

    #[getter]
    fn status(&self) -> &'static str {
        self.solved.status.name()
    }

    #[getter]
    fn message(&self) -> &str {
        &self.solved.message
    }

    /// Errors: as `error`.
    #[getter]
    fn warnings(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.estimate(py)?;
        Ok(self.solved.warnings())
    }

    #[getter]
    fn energy(&self) -> f64 {
        self.solved.energy
    }

    #[getter]
    fn elastic_energy(&self) -> f64 {
        self.solved.elastic_energy
    }

    /// The length U of the belt, and its mean rigidity R_f over U.
    #[getter]
    fn scales(&self) -> (f64, f64) {
        let units = self.solved.problem().units();
        (units.length, units.energy)
    }

    #[getter]
    fn energy_model(&self) -> &'static str {
        self.solved.scenario().energy_model().name()
    }

    /// Units: rad.
    #[getter]
    fn twist(&self) -> f64 {
        self.solved.spine.twist()
    }

    #[getter]
    fn stable(&self) -> Option<bool> {
        self.solved.stable()
    }

    #[getter]
    fn negative_modes(&self) -> Option<usize> {
        Some(self.solved.stability?.negative_modes)
    }

    #[getter]
    fn zero_modes(&self) -> Option<usize> {
        Some(self.solved.stability?.zero_modes)
    }

    #[getter]
    fn iterations(&self) -> usize {
        self.solved.iterations
    }

    #[getter]
    fn solve_time(&self) -> f64 {
        self.solve_time
    }

    /// (stationarity, constraint, complementarity).
    #[getter]
    fn residuals(&self) -> (f64, f64, f64) {
        let residuals = &self.solved.residuals;
        (
            residuals.stationarity,
            residuals.constraint,
            residuals.complementarity,
        )
    }

    /// (energy, position, force, radius), estimated with the GIL released; None where there is no estimate.
    ///
    /// Errors: those that a signal handler raises.
    #[getter]
    fn error(&self, py: Python<'_>) -> PyResult<Option<(f64, f64, f64, f64)>> {
        let error = self.estimate(py)?;
        Ok(error.map(|error| (error.energy, error.position, error.force, error.radius)))
    }

    /// Shapes: (n,).
    #[getter]
    fn u<'py>(&self, py: Python<'py>) -> Scalars<'py> {
        self.solved.spine.u.clone().into_pyarray(py)
    }

    /// Shapes: (n, 3).
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Points<'py> {
        array::points(py, self.solved.spine.pose.iter().map(|pose| &pose.position))
    }

    /// Shapes: (n, 3, 3).
    #[getter]
    fn frame<'py>(&self, py: Python<'py>) -> Grid<'py> {
        array::frames(py, self.solved.spine.pose.iter().map(|pose| &pose.frame))
    }

    /// Shapes: (n,).
    #[getter]
    fn bend<'py>(&self, py: Python<'py>) -> Scalars<'py> {
        self.solved.spine.bend.clone().into_pyarray(py)
    }

    /// Shapes: (n,).
    #[getter]
    fn rib_slope<'py>(&self, py: Python<'py>) -> Scalars<'py> {
        self.solved.spine.rib_slope.clone().into_pyarray(py)
    }

    /// Shapes: (n,).
    #[getter]
    fn torsion<'py>(&self, py: Python<'py>) -> Scalars<'py> {
        self.solved.torsion.clone().into_pyarray(py)
    }

    /// Shapes: (n,).
    #[getter]
    fn rib_angle<'py>(&self, py: Python<'py>) -> Scalars<'py> {
        self.solved.spine.rib_angle().into_pyarray(py)
    }

    /// Shapes: (n,).
    #[getter]
    fn curvature<'py>(&self, py: Python<'py>) -> Scalars<'py> {
        self.solved.spine.curvature().into_pyarray(py)
    }

    /// Shapes: (n, 3).
    #[getter]
    fn internal_force<'py>(&self, py: Python<'py>) -> Points<'py> {
        array::points(py, self.solved.internal.iter().map(|on| &on.force))
    }

    /// Shapes: (n, 3).
    #[getter]
    fn internal_moment<'py>(&self, py: Python<'py>) -> Points<'py> {
        array::points(py, self.solved.internal.iter().map(|on| &on.moment))
    }

    /// (minus, plus), the ribs' ends on the −ζ and the +ζ side.
    ///
    /// Shapes: (n, 3) each.
    #[getter]
    fn edges<'py>(&self, py: Python<'py>) -> (Points<'py>, Points<'py>) {
        let edges = surface::edges(&self.solved.spine);
        (
            array::points(py, &edges.minus),
            array::points(py, &edges.plus),
        )
    }

    /// (at, force, moment) of every support, in the order of the scenario.
    #[getter]
    fn reactions(&self) -> Vec<(f64, [f64; 3], [f64; 3])> {
        let reactions = self.solved.reactions.iter();
        reactions
            .map(|on| {
                let Wrench { force, moment } = &on.wrench;
                (on.at, array::row(force), array::row(moment))
            })
            .collect()
    }

    /// Force of every link on the belt at its second point, in the order of the scenario.
    #[getter]
    fn links(&self) -> Vec<[f64; 3]> {
        let links = self.solved.links.iter();
        links.map(|link| array::row(&link.force)).collect()
    }

    #[getter]
    fn half_turns(&self) -> Option<i32> {
        self.solved.half_turns
    }

    /// 1, 0 or −1.
    #[getter]
    fn side(&self) -> i8 {
        self.solved.side()
    }

    /// (u, position).
    #[getter]
    fn highest_point(&self) -> (f64, [f64; 3]) {
        let highest = self.solved.highest_point();
        (highest.u, array::row(&highest.position))
    }

    /// (value, u, v), or None of a flat belt.
    #[getter]
    fn least_bend_radius(&self) -> Option<(f64, f64, f64)> {
        let least = surface::least_bend_radius(&self.solved.spine)?;
        Some((least.value, least.u, least.v))
    }

    /// (value, u), or None of a flat belt.
    #[getter]
    fn least_spine_radius(&self) -> Option<(f64, f64)> {
        let least = surface::least_spine_radius(&self.solved.spine)?;
        Some((least.value, least.u))
    }

    /// Radii exceeded on 99.9, 99 and 95 % of the area.
    #[getter]
    fn area_radii(&self) -> [f64; 3] {
        surface::BendDistribution::of(&self.solved.spine).quantiles()
    }

    /// Share of the area with a radius below a finite one.
    fn area_below(&self, radius: f64) -> f64 {
        surface::BendDistribution::of(&self.solved.spine).share_below(radius)
    }

    /// Of the middle plane and of every layer; None of a belt of no thickness. Found with the GIL released.
    #[getter]
    fn strain(&self, py: Python<'_>) -> Option<(StrainExtremes, Vec<StrainExtremes>)> {
        let strain = py.detach(|| surface::strain(&self.solved.spine))?;
        let layers = strain.layers.iter().map(extremes);
        Some((extremes(&strain.membrane), layers.collect()))
    }

    /// Curvature and strain of the middle plane (uu, uv, vv), and strain of the layers, at points (u, v) of the board; NaN off
    /// the board, None of a belt of no thickness.
    ///
    /// Shapes: (m, 2) to (m, 3), (m, 3), (m, layers).
    fn strain_at<'py>(
        &self,
        py: Python<'py>,
        points: Vec<[f64; 2]>,
    ) -> PyResult<Option<[Points<'py>; 3]>> {
        /// Points between looks for signals, a number.
        const AT_ONCE: usize = 1000;
        let parts: Vec<&[[f64; 2]]> = points.chunks(AT_ONCE).collect();
        let spine = &self.solved.spine;
        let found = each(py, &parts, |points| surface::strain_at(spine, points))?;
        let Some(found) = found.into_iter().collect::<Option<Vec<_>>>() else {
            return Ok(None);
        };
        let found = found.concat();
        let tensors = |tensor: fn(&PointStrain) -> [f64; 3]| {
            let rows: Vec<Vector3<f64>> = found.iter().map(|at| tensor(at).into()).collect();
            array::points(py, &rows)
        };
        Ok(Some([
            tensors(|at| at.curvature),
            tensors(|at| at.membrane),
            array::rows(py, found.iter().map(|at| &at.layers[..]))?,
        ]))
    }

    /// (value, u).
    #[getter]
    fn rib_margin(&self) -> (f64, f64) {
        let margin = surface::rib_margin(&self.solved.spine);
        (margin.value, margin.u)
    }

    /// (u, u) of the first two places that pass through each other, or None if there are none.
    #[getter]
    fn crosses_itself(&self) -> Option<(f64, f64)> {
        surface::crosses_itself(&self.solved.spine).map(<(f64, f64)>::from)
    }

    /// Points of the surface.
    ///
    /// Shapes: (n, `n_across`, 3).
    fn surface<'py>(&self, py: Python<'py>, n_across: usize) -> PyResult<Grid<'py>> {
        let points = surface::points(&self.solved.spine, n_across);
        array::grid(py, n_across, points.into_iter().flatten())
    }

    /// (vertices, triangles).
    ///
    /// Shapes: (p, 3), (m, 3).
    fn mesh<'py>(&self, py: Python<'py>, n_across: usize) -> (Points<'py>, Triangles<'py>) {
        let mesh = surface::mesh(&self.solved.spine, n_across);
        (
            array::points(py, &mesh.vertices),
            array::triangles(py, &mesh.triangles),
        )
    }

    /// (minus, plus, loops), polylines of the flat board's outline.
    ///
    /// Shapes: (m, 2) each.
    fn outline<'py>(
        &self,
        py: Python<'py>,
        tolerance: f64,
    ) -> (Points<'py>, Points<'py>, Vec<Points<'py>>) {
        let outline = fishbone::board::outline::outline(&self.solved.spine);
        let [minus, plus] = [&outline.minus, &outline.plus]
            .map(|edge| array::flat_points(py, polyline(edge, tolerance)));
        let loops = outline.lines(tolerance).into_iter();
        let loops = loops.map(|line| array::flat_points(py, line));
        (minus, plus, loops.collect())
    }

    /// The spine of the flat board at every node.
    ///
    /// Shapes: (n, 2).
    fn flat_spine<'py>(&self, py: Python<'py>) -> Points<'py> {
        let ribs = surface::ribs(&self.solved.spine);
        array::flat_points(py, ribs.iter().map(|rib| rib.flat.position))
    }

    /// The ends of the flat board's ribs on the −ζ and the +ζ side.
    ///
    /// Shapes: (n, 2, 2).
    fn flat_ribs<'py>(&self, py: Python<'py>) -> Grid<'py> {
        let ribs = surface::ribs(&self.solved.spine);
        let ends = |rib: &Rib| [rib.v_minus, rib.v_plus].map(|v| rib.flat_point(v).into());
        array::pairs(py, ribs.iter().map(ends).collect())
    }

    /// (vertices, triangles) of the mesh in the flat board.
    ///
    /// Shapes: (p, 2), (m, 3).
    fn flat_mesh<'py>(&self, py: Python<'py>, n_across: usize) -> (Points<'py>, Triangles<'py>) {
        let mesh = surface::mesh(&self.solved.spine, n_across);
        (
            array::flat_points(py, mesh.flat),
            array::triangles(py, &mesh.flat_triangles),
        )
    }

    /// The surface's points of points of the flat board; NaN off the board.
    ///
    /// Shapes: (m, 2) to (m, 3).
    /// Errors: those that a signal handler raises.
    fn material_points<'py>(&self, py: Python<'py>, flat: Vec<[f64; 2]>) -> PyResult<Points<'py>> {
        let off_board = Vector3::repeat(f64::NAN);
        let spine = &self.solved.spine;
        let point = |[y, z]: &[f64; 2]| surface::material_point(spine, *y, *z);
        let points = each(py, &flat, |at| point(at).unwrap_or(off_board))?;
        Ok(array::points(py, &points))
    }

    /// Arc lengths of the feet of the ribs through points of the flat board; NaN off the board.
    ///
    /// Shapes: (m, 2) to (m,).
    /// Errors: those that a signal handler raises.
    fn rib_feet<'py>(&self, py: Python<'py>, flat: Vec<[f64; 2]>) -> PyResult<Scalars<'py>> {
        let spine = &self.solved.spine;
        let foot = |[y, z]: &[f64; 2]| surface::rib_foot(spine, *y, *z);
        let feet = each(py, &flat, |at| foot(at).unwrap_or(f64::NAN))?;
        Ok(feet.into_pyarray(py))
    }

    /// (from, to), the arc lengths of the ends of every stiffened stretch.
    #[getter]
    fn stiffeners(&self) -> Vec<(f64, f64)> {
        let spine = &self.solved.spine;
        let pieces = spine.pieces.iter().enumerate();
        pieces
            .filter(|(_, piece)| matches!(piece, Piece::Rigid))
            .map(|(element, _)| (spine.u[element], spine.u[element + 1]))
            .collect()
    }

    /// The scenario with another number of elements and its equilibrium next to this one; None if there is none.
    ///
    /// Errors: those that a signal handler raises, `KeyboardInterrupt` first of all.
    fn refined(&self, py: Python<'_>, elements: usize) -> PyResult<Option<(Scenario, Self)>> {
        let mut signals = Signals::new();
        let start = Instant::now();
        let found = py.detach(|| self.solved.refined(elements, &mut || signals.proceed()));
        let solve_time = start.elapsed().as_secs_f64();
        match signals.raised {
            Some(error) => Err(error),
            None => Ok(found.map(|solved| {
                let scenario = Scenario(solved.problem().clone());
                (scenario, Self { solved, solve_time })
            })),
        }
    }

    /// (distance, direction, whether it is a fold, position, rotation vector, whether a finer mesh confirms it) of the nearest
    /// loss of stability, along a given direction or along any; None if there is none within reach.
    ///
    /// Errors: `NoMargin`; those that a signal handler raises.
    #[pyo3(signature = (support, direction, reach))]
    fn margin(
        &self,
        py: Python<'_>,
        support: usize,
        direction: Option<[f64; 6]>,
        reach: f64,
    ) -> PyResult<Option<Margin>> {
        let mut signals = Signals::new();
        let margin = py.detach(|| {
            let (solved, settings) = (&self.solved, MarginSettings::default());
            let proceed = &mut || signals.proceed();
            match direction.map(Vector6::from) {
                Some(along) => solved.margin_along(support, &along, reach, &settings, proceed),
                None => solved.margin(support, reach, &settings, proceed),
            }
        });
        if let Some(error) = signals.raised {
            return Err(error);
        }
        let margin = margin.map_err(|error| raised(py, &error))?;
        Ok(margin.map(|margin| {
            (
                margin.distance,
                margin.direction.into(),
                margin.is_fold,
                array::row(&margin.position),
                array::row(&margin.rotation),
                margin.confirmed,
            )
        }))
    }

    /// (eigenvalue, translation, rotation, bend, rib slope) of the lowest modes, found with the GIL released.
    ///
    /// Shapes: (n, 3), (n, 3), (n,), (n,).
    /// Errors: `NoModes`; those that a signal handler raises.
    fn modes<'py>(&self, py: Python<'py>, count: usize) -> PyResult<Vec<Mode<'py>>> {
        let mut signals = Signals::new();
        let modes = py.detach(|| self.solved.modes(count, &mut || signals.proceed()));
        if let Some(error) = signals.raised {
            return Err(error);
        }
        let modes = modes.map_err(|error| raised(py, &error))?;
        let mode = |mode: fishbone::analysis::modes::Mode| {
            (
                mode.eigenvalue,
                array::points(py, mode.motion.iter().map(|motion| &motion.translation)),
                array::points(py, mode.motion.iter().map(|motion| &motion.rotation)),
                mode.bend.into_pyarray(py),
                mode.rib_slope.into_pyarray(py),
            )
        };
        Ok(modes.into_iter().map(mode).collect())
    }

    /// The first-order conditions of the equilibrium, factorised with the GIL released.
    ///
    /// Errors: `NoSensitivity`.
    fn sensitivity(&self, py: Python<'_>) -> PyResult<Sensitivity> {
        let sensitivity = py.detach(|| self.solved.sensitivity());
        sensitivity
            .map(Sensitivity::new)
            .map_err(|error| raised(py, &error))
    }

    /// The result schema as JSON, without `solve_time`.
    ///
    /// Errors: as `error`.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        self.estimate(py)?;
        Ok(py.detach(|| self.solved.to_json()))
    }
}

/// Points along an edge, no chord farther from it than a tolerance.
fn polyline(edge: &[Curve], tolerance: f64) -> Vec<Vector2<f64>> {
    let first = edge.first().map(Curve::first);
    let others = edge
        .iter()
        .flat_map(|curve| curve.points(tolerance).into_iter().skip(1));
    first.into_iter().chain(others).collect()
}

/// The values of a function, with the GIL released; the signals are asked between them.
///
/// Errors: those that a signal handler raises.
fn each<A: Sync, V: Send>(
    py: Python<'_>,
    of: &[A],
    function: impl Fn(&A) -> V + Send,
) -> PyResult<Vec<V>> {
    let mut signals = Signals::new();
    let values = py.detach(|| {
        let going = of.iter().take_while(|_| signals.proceed().is_continue());
        going.map(function).collect()
    });
    signals.raised.map_or(Ok(values), Err)
}
