//! Modal load homotopy, from one stationary point of a programme to another: a load along a mode grows, and the curve is
//! followed until the load is zero again.

use super::continuation::Continuation;
use super::curve::{End, Events, Pace};
use super::family::Family;
use crate::layout::Layout;
use crate::linear::chain::NodeVector;
use crate::linear::{Mode, Response};
use crate::linearisation::Linearisation;
use crate::program::{Distance, Multipliers, Program, Scales, Stationary, Values};
use nalgebra::SMatrix;
use std::ops::ControlFlow;

/// A programme with dead forces on its unknowns.
struct Loaded<P, const N: usize> {
    program: P,
    force: Vec<NodeVector<N>>,
}

/// The family of programmes by the strength of a modal load.
struct ModalLoad<'a, P, const N: usize> {
    program: &'a P,
    force: Vec<NodeVector<N>>,
}

/// The stationary point at the end of a modal load homotopy: continuation in a dead force along a mode, or against the mode,
/// from zero load to zero load. `None` where the load does not return to zero.
pub fn over_modal_load<P, const X: usize, const U: usize, const N: usize>(
    program: &P,
    tolerance: f64,
    from: &Stationary<P::Point>,
    mode: &Mode<N>,
    forth: bool,
    proceed: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Option<Stationary<P::Point>>
where
    P: Program<X, U, N> + Clone,
    P::Point: Distance,
{
    /// Length of the longest step along the curve; in [`Scales::distance`].
    const LONGEST: f64 = 0.05;
    /// Largest count of stations of the curve; a number.
    const STATIONS: usize = 60;
    /// Stiffness of a stiff mode, so that a load of strength 1 displaces it by 1; in [`Scales::eigenvalue`].
    const STIFF: f64 = 300.0;
    /// Strength of the largest load; in [`Scales::distance`].
    const FAR: f64 = 1e6;
    let scales = program.scales();
    let pace = Pace {
        longest: LONGEST * scales.distance,
        stations: STATIONS,
        events: Events::Ignore,
    };
    let response = Response::of_stationary(program, &mut from.clone()).ok()?;
    let stiffness = STIFF * scales.eigenvalue();
    let mut load = response.zero();
    load.nodes = mode.force.iter().map(|force| -stiffness * force).collect();
    response.fold(&mut load);
    let family = ModalLoad {
        program,
        force: load.nodes,
    };
    let far = FAR * scales.distance;
    let range = if forth { [0.0, far] } else { [-far, 0.0] };
    let continuation = Continuation::new(&family, tolerance, range, pace);
    let start = continuation.start(from, 0.0, forth)?;
    let curve = continuation.trace(start, &mut |station| proceed(station.parameter));
    let last = curve.stations.into_iter().next_back()?;
    (curve.end == End::Range && last.parameter == 0.0).then_some(last.at)
}

impl<P, const X: usize, const U: usize, const N: usize> Family<X, U, N> for ModalLoad<'_, P, N>
where
    P: Program<X, U, N> + Clone,
    P::Point: Distance,
{
    type Point = P::Point;
    type Program = Loaded<P, N>;

    fn at(&self, strength: f64) -> Option<Loaded<P, N>> {
        Some(Loaded {
            program: self.program.clone(),
            force: self.force.iter().map(|force| strength * force).collect(),
        })
    }

    fn scales(&self) -> Scales {
        self.program.scales()
    }
}

impl<P: Program<X, U, N>, const X: usize, const U: usize, const N: usize> Program<X, U, N>
    for Loaded<P, N>
{
    type Point = P::Point;

    fn layout(&self) -> Layout {
        self.program.layout()
    }

    fn scales(&self) -> Scales {
        self.program.scales()
    }

    fn evaluate(&self, point: &mut P::Point, values: &mut Values) -> bool {
        self.program.evaluate(point, values)
    }

    fn equality_gradients(&self, point: &P::Point, into: &mut [NodeVector<N>]) {
        self.program.equality_gradients(point, into);
    }

    fn linearise(
        &self,
        point: &P::Point,
        multipliers: &Multipliers,
        into: &mut Linearisation<X, U, N>,
    ) {
        self.program.linearise(point, multipliers, into);
        for (gradient, force) in into.gradient.iter_mut().zip(&self.force) {
            *gradient += force;
        }
    }

    fn retract(&self, point: &P::Point, step: &[NodeVector<N>], length: f64, into: &mut P::Point) {
        self.program.retract(point, step, length, into);
    }

    fn metric(&self, point: &P::Point) -> Vec<SMatrix<f64, X, X>> {
        self.program.metric(point)
    }
}
