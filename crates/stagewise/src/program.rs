//! The interface between a programme and the solver: values, derivatives, multipliers, points.

use crate::interior_point::Residuals;
use crate::layout::Layout;
use crate::linear::chain::NodeVector;
use crate::linearisation::Linearisation;
use nalgebra::{SMatrix, SVector};

/// Objective and constraints of a programme at a point.
#[derive(Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Values {
    /// Objective.
    pub objective: f64,
    /// Equality constraints, in the order of the [`Layout`]; met where zero.
    pub equalities: Vec<f64>,
    /// Slacks of the inequalities, in the order of the [`Layout`]; admissible where positive.
    pub slacks: Vec<f64>,
}

/// Multipliers of a programme's constraints, in the order of the [`Layout`].
#[derive(Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Multipliers {
    /// Multipliers of the equalities.
    pub equalities: Vec<f64>,
    /// Multipliers of the inequalities, not negative.
    pub inequalities: Vec<f64>,
}

impl Multipliers {
    /// A multiplier of zero for every constraint.
    pub fn zero(layout: &Layout) -> Self {
        Self {
            equalities: vec![0.0; layout.equalities()],
            inequalities: vec![0.0; layout.inequalities()],
        }
    }

    /// Copies multipliers of the same layout, without allocating.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.equalities.copy_from_slice(&other.equalities);
        self.inequalities.copy_from_slice(&other.inequalities);
    }
}

/// Units in which the numbers of a programme are of order one. The solver's tolerances are in these units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales {
    /// Unit of the objective.
    pub objective: f64,
    /// Unit of the distance between points: of [`Distance`] and of the square root of the metric.
    pub distance: f64,
}

impl Default for Scales {
    fn default() -> Self {
        Self {
            objective: 1.0,
            distance: 1.0,
        }
    }
}

impl Scales {
    /// Unit of the eigenvalues of the second variation: objective over squared distance.
    pub(crate) fn eigenvalue(&self) -> f64 {
        self.objective / (self.distance * self.distance)
    }
}

/// A nonlinear programme on a chain of nodes, of which each carries a state (`X` numbers) and controls (`U`); `N = X + U`.
///
/// The state of a node is not an unknown: it is carried along the chain from the first one, so that a point is always
/// consistent. The unknowns are the state of the first node and the controls of all.
pub trait Program<const X: usize, const U: usize, const N: usize> {
    /// A point of the search space, which need not be a vector space.
    type Point: Clone;

    /// Number of stages, and the nodes of every constraint. The layout stays the same while a programme is being solved.
    fn layout(&self) -> Layout;

    /// Units in which the numbers of the programme are of order one.
    fn scales(&self) -> Scales {
        Scales::default()
    }

    /// How large the objective is at a point, as its gradients and second derivatives tell, not beyond [`Scales::objective`];
    /// not negative. Residuals are to be small beside it. Zero where the objective vanishes but for rounding.
    ///
    /// By default [`Scales::objective`].
    fn size(&self, _point: &Self::Point) -> f64 {
        self.scales().objective
    }

    /// Carries the states of a point along the chain and evaluates the programme there; false outside the domain. Slacks and
    /// equalities are given also where inequalities alone are violated.
    fn evaluate(&self, point: &mut Self::Point, values: &mut Values) -> bool;

    /// Gradients of the equalities at nodes.
    fn equality_gradients(&self, point: &Self::Point, into: &mut [NodeVector<N>]);

    /// Derivatives at a point that has been evaluated. The gradient is that of the objective plus multipliers times
    /// equalities, by the unknowns: its entries by states beyond the first are zero. Gradients of slacks are given apart, and
    /// the solver adds them to the gradient. Second derivatives are those of the objective plus multipliers times equalities
    /// minus multipliers times slacks.
    ///
    /// Second derivatives of constraints between pairs belong into [`Linearisation::equality_hessian_between`] and
    /// [`Linearisation::inequality_hessian_between`]; the parts by the states of a single node may be in the [`Diagonal`]
    /// instead. Where a part is missing, [`minimise`] converges to the same points, as their first-order conditions are
    /// exact, but linearly; [`Inertia`], [`lowest_modes`], [`Response`] and [`Continuation`] are wrong by the missing part.
    ///
    /// [`Diagonal`]: crate::Diagonal
    /// [`minimise`]: crate::minimise
    /// [`Inertia`]: crate::Inertia
    /// [`lowest_modes`]: crate::lowest_modes
    /// [`Response`]: crate::Response
    /// [`Continuation`]: crate::Continuation
    fn linearise(
        &self,
        point: &Self::Point,
        multipliers: &Multipliers,
        into: &mut Linearisation<X, U, N>,
    );

    /// Moves the unknowns of a point along a step; the next evaluation carries the states along.
    fn retract(
        &self,
        point: &Self::Point,
        step: &[NodeVector<N>],
        length: f64,
        into: &mut Self::Point,
    );

    /// The metric of every node: the squared length of a change of its state, times the node's share in the whole.
    /// Eigenvalues of the second variation are relative to this metric.
    fn metric(&self, point: &Self::Point) -> Vec<SMatrix<f64, X, X>>;

    /// Motions of all nodes, states and controls, along which the programme is known to stay the same, dependent ones among
    /// them or not: the generators of its symmetries. On the mesh a symmetry of the whole may hold within the error of the
    /// mesh only; [`Inertia`] and [`lowest_modes`] take it as exact.
    ///
    /// By default none.
    ///
    /// [`Inertia`]: crate::Inertia
    /// [`lowest_modes`]: crate::lowest_modes
    fn symmetries(&self, _point: &Self::Point) -> Vec<Vec<NodeVector<N>>> {
        Vec::new()
    }

    /// Rounding of the controls of a node: how far they may be from the nearest numbers. The gradient at a point is known no
    /// better than the second derivative times this.
    ///
    /// By default none.
    fn rounding(&self, _point: &Self::Point, _node: usize) -> SVector<f64, U> {
        SVector::zeros()
    }

    /// Residuals with given multipliers as the tolerance counts them.
    ///
    /// By default as they are.
    fn judged(&self, residuals: Residuals, _multipliers: &Multipliers) -> Residuals {
        residuals
    }
}

impl<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize> Program<X, U, N> for &P {
    type Point = P::Point;

    fn layout(&self) -> Layout {
        (*self).layout()
    }

    fn scales(&self) -> Scales {
        (*self).scales()
    }

    fn size(&self, point: &Self::Point) -> f64 {
        (*self).size(point)
    }

    fn evaluate(&self, point: &mut Self::Point, values: &mut Values) -> bool {
        (*self).evaluate(point, values)
    }

    fn equality_gradients(&self, point: &Self::Point, into: &mut [NodeVector<N>]) {
        (*self).equality_gradients(point, into);
    }

    fn linearise(
        &self,
        point: &Self::Point,
        multipliers: &Multipliers,
        into: &mut Linearisation<X, U, N>,
    ) {
        (*self).linearise(point, multipliers, into);
    }

    fn retract(
        &self,
        point: &Self::Point,
        step: &[NodeVector<N>],
        length: f64,
        into: &mut Self::Point,
    ) {
        (*self).retract(point, step, length, into);
    }

    fn metric(&self, point: &Self::Point) -> Vec<SMatrix<f64, X, X>> {
        (*self).metric(point)
    }

    fn symmetries(&self, point: &Self::Point) -> Vec<Vec<NodeVector<N>>> {
        (*self).symmetries(point)
    }

    fn rounding(&self, point: &Self::Point, node: usize) -> SVector<f64, U> {
        (*self).rounding(point, node)
    }

    fn judged(&self, residuals: Residuals, multipliers: &Multipliers) -> Residuals {
        (*self).judged(residuals, multipliers)
    }
}

/// Points that can be copied and compared.
pub trait Distance: Clone {
    /// Copies a point of the same size, without allocating.
    fn copy_from(&mut self, other: &Self);

    /// Distance of two points, in the unit of [`Scales::distance`].
    fn distance(&self, other: &Self) -> f64;
}

/// A stationary point, or an approximation of one, with the multipliers of its first-order conditions.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Stationary<P> {
    /// The point.
    pub point: P,
    /// The multipliers.
    pub multipliers: Multipliers,
}

impl<P: Distance> Stationary<P> {
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.point.copy_from(&other.point);
        self.multipliers.copy_from(&other.multipliers);
    }
}
