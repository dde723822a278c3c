//! A programme in the units of what its objective is at a point.

use crate::interior_point::Residuals;
use crate::largest;
use crate::layout::Layout;
use crate::linear::PairMatrix;
use crate::linear::chain::NodeVector;
use crate::linearisation::Linearisation;
use crate::program::{Multipliers, Program, Scales, Stationary, Values};
use nalgebra::{SMatrix, SVector};

/// A programme whose objective is near to zero, in units in which its numbers are of order one: in the unit ε of the objective,
/// and with equalities in √ε, as an objective that is a square falls with the square of what the equalities ask for.
///
/// The residuals of the programme itself are small however far off its unknowns are, and its barrier is high. Where the
/// unknowns change equalities by their squares alone, these are of the order of ε: so the residual of the equalities is in ε.
/// Residuals are those beyond rounding.
#[derive(Debug, Clone)]
pub(crate) struct Scaled<P> {
    program: P,
    /// One over the unit of the objective, over the programme's.
    objective: f64,
    /// One over the unit of the equalities, over the programme's.
    equality: f64,
}

impl<P> Scaled<P> {
    /// The programme in the units of its size at a point; `None` where its own units do.
    pub(crate) fn of<const X: usize, const U: usize, const N: usize>(
        program: P,
        at: &P::Point,
    ) -> Option<Self>
    where
        P: Program<X, U, N>,
    {
        /// Unit of the objective, in the programme's, above which the programme's own do.
        const SMALL: f64 = 0.1;
        /// Size up to which an objective is nothing but rounding, in the programme's unit.
        const NOTHING: f64 = 1e-20;
        let size = program.size(at) / program.scales().objective;
        // A power of four, the root of which is exact: scaling does not round.
        let exponent = (0.5 * size.log2()).round();
        let is_small = size > NOTHING && size < SMALL;
        is_small.then(|| Self {
            objective: (-2.0 * exponent).exp2(),
            equality: (-exponent).exp2(),
            program,
        })
    }

    /// Multipliers of this programme as those of the programme itself.
    pub(crate) fn multipliers_of_original(&self, own: &Multipliers) -> Multipliers {
        let times = |factor: f64, own: &[f64]| own.iter().map(|own| factor * own).collect();
        Multipliers {
            equalities: times(self.equality / self.objective, &own.equalities),
            inequalities: times(self.objective.recip(), &own.inequalities),
        }
    }

    /// A point with multipliers of the programme itself as one of this programme.
    pub(crate) fn own<Q: Clone>(&self, at: &Stationary<Q>) -> Stationary<Q> {
        let times = |factor: f64, own: &[f64]| own.iter().map(|own| factor * own).collect();
        let Multipliers {
            equalities,
            inequalities,
        } = &at.multipliers;
        Stationary {
            point: at.point.clone(),
            multipliers: Multipliers {
                equalities: times(self.objective / self.equality, equalities),
                inequalities: times(self.objective, inequalities),
            },
        }
    }

    /// An objective of this programme as one of the programme itself.
    pub(crate) fn objective_of_original(&self, own: f64) -> f64 {
        own / self.objective
    }

    /// An amount of objective of the programme itself in this programme.
    pub(crate) fn own_objective(&self, original: f64) -> f64 {
        self.objective * original
    }
}

impl<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize> Program<X, U, N>
    for Scaled<P>
{
    type Point = P::Point;

    fn layout(&self) -> Layout {
        self.program.layout()
    }

    fn scales(&self) -> Scales {
        let scales = self.program.scales();
        Scales {
            objective: self.own_objective(scales.objective),
            ..scales
        }
    }

    fn size(&self, point: &Self::Point) -> f64 {
        self.own_objective(self.program.size(point))
    }

    fn evaluate(&self, point: &mut Self::Point, values: &mut Values) -> bool {
        let is_inside = self.program.evaluate(point, values);
        values.objective *= self.objective;
        for equality in &mut values.equalities {
            *equality *= self.equality;
        }
        is_inside
    }

    fn equality_gradients(&self, point: &Self::Point, into: &mut [NodeVector<N>]) {
        self.program.equality_gradients(point, into);
        for gradient in into {
            *gradient *= self.equality;
        }
    }

    fn linearise(
        &self,
        point: &Self::Point,
        multipliers: &Multipliers,
        into: &mut Linearisation<X, U, N>,
    ) {
        let multipliers = self.multipliers_of_original(multipliers);
        self.program.linearise(point, &multipliers, into);
        into.scale(self.objective, self.equality);
    }

    fn retract(
        &self,
        point: &Self::Point,
        step: &[NodeVector<N>],
        length: f64,
        into: &mut Self::Point,
    ) {
        self.program.retract(point, step, length, into);
    }

    fn metric(&self, point: &Self::Point) -> Vec<SMatrix<f64, X, X>> {
        self.program.metric(point)
    }

    fn symmetries(&self, point: &Self::Point) -> Vec<Vec<NodeVector<N>>> {
        self.program.symmetries(point)
    }

    fn rounding(&self, point: &Self::Point, node: usize) -> SVector<f64, U> {
        self.program.rounding(point, node)
    }

    fn judged(&self, residuals: Residuals, multipliers: &Multipliers) -> Residuals {
        /// Rounding of gradients as a share of the largest multiplier.
        const ROUNDING: f64 = 10.0 * f64::EPSILON;
        /// Rounding of equalities of the programme itself, over the square root of the count of stages along which states are
        /// carried.
        const OF_STAGES: f64 = 2.0 * f64::EPSILON;
        let stages = self.layout().stages() as f64;
        let multiplier = largest(multipliers.equalities.iter());
        let beyond = |residual: f64, rounding: f64| match residual <= rounding {
            true => 0.0,
            false => residual - rounding,
        };
        let missed = beyond(
            residuals.constraint,
            OF_STAGES * stages.sqrt() * self.equality,
        );
        Residuals {
            stationarity: beyond(
                residuals.stationarity,
                ROUNDING * multiplier * self.equality,
            ),
            constraint: missed * self.objective / self.equality,
            ..residuals
        }
    }
}

impl<const X: usize, const U: usize, const N: usize> Linearisation<X, U, N> {
    /// Scales the derivatives of the Lagrangian, and the gradients of the equalities.
    fn scale(&mut self, lagrangian: f64, equality: f64) {
        for stage in &mut self.chain.stages {
            stage.state_first *= lagrangian;
            stage.state_second *= lagrangian;
        }
        self.diagonal.controls.iter_mut().for_each(|controls| {
            scale_pair(controls, lagrangian);
        });
        for state in &mut self.diagonal.states {
            *state *= lagrangian;
        }
        for term in &mut self.diagonal.nodes {
            term.hessian *= lagrangian;
        }
        for hessian in self.pair_hessians_mut() {
            scale_pair(hessian, lagrangian);
        }
        for gradient in &mut self.gradient {
            *gradient *= lagrangian;
        }
        let pairs = self.equalities_between.iter_mut().flatten();
        for gradient in self.equalities_at.iter_mut().chain(pairs) {
            *gradient *= equality;
        }
    }
}

fn scale_pair<const M: usize>(matrix: &mut PairMatrix<M>, factor: f64) {
    matrix.first *= factor;
    matrix.mixed *= factor;
    matrix.second *= factor;
}
