//! From one stationary point to another of the same programme: by a push along a mode, followed until it takes none.

use super::chain::NodeVector;
use super::continuation::{Continuation, End, Events, Family, Pace};
use super::{
    Bounds, Kkt, Linearisation, Mode, Program, Rows, RowsByNode, Shape, Stationary, Values,
};
use nalgebra::Matrix6;
use std::ops::ControlFlow;

/// A programme with dead forces on its unknowns.
pub(super) struct Pushed<P> {
    program: P,
    force: Vec<NodeVector>,
}

/// The same push at any strength.
struct Push<'a, P> {
    program: &'a P,
    force: Vec<NodeVector>,
}

/// The stationary point that is reached from another by a push along a mode, or against it, of which the strength is followed
/// until it is nothing again; `None` where it never is, or only where it began.
pub fn pushed_over<P: Program + Clone>(
    program: &P,
    tolerance: f64,
    from: &Stationary<P::Point>,
    mode: &Mode,
    forth: bool,
    proceed: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Option<Stationary<P::Point>>
where
    P::Point: Shape,
{
    const PACE: Pace = Pace {
        longest: 0.05,
        stations: 80,
        events: Events::Ignore,
    };
    /// A push of strength 1 is the force of a stiff mode displaced by a length.
    const STIFF: f64 = 300.0;
    const FAR: f64 = 1e6;
    let kkt = Kkt::factorise_any(program, &mut from.clone()).ok()?;
    let mut force = kkt.zero();
    force.nodes = mode.pull.iter().map(|pull| -STIFF * pull).collect();
    kkt.fold(&mut force);
    let family = Push {
        program,
        force: force.nodes,
    };
    let range = if forth { [0.0, FAR] } else { [-FAR, 0.0] };
    let continuation = Continuation::new(&family, tolerance, range, PACE);
    let start = continuation.start(from, 0.0, forth)?;
    let curve = continuation.trace(start, proceed);
    let last = curve.stations.into_iter().next_back()?;
    (curve.end == End::Range && last.parameter == 0.0).then_some(last.at)
}

impl<P: Program + Clone> Family for Push<'_, P> {
    type Program = Pushed<P>;

    fn at(&self, strength: f64) -> Option<Pushed<P>> {
        Some(Pushed {
            program: self.program.clone(),
            force: self.force.iter().map(|force| strength * force).collect(),
        })
    }
}

impl<P: Program> Program for Pushed<P> {
    type Point = P::Point;

    fn stages(&self) -> usize {
        self.program.stages()
    }

    fn constrained_nodes(&self) -> Vec<usize> {
        self.program.constrained_nodes()
    }

    fn linked_nodes(&self) -> Vec<[usize; 2]> {
        self.program.linked_nodes()
    }

    fn bounds(&self) -> usize {
        self.program.bounds()
    }

    fn weights(&self) -> Vec<f64> {
        self.program.weights()
    }

    fn evaluate(&self, point: &mut P::Point, values: &mut Values) -> bool {
        self.program.evaluate(point, values)
    }

    fn constraint_jacobians(&self, point: &P::Point, into: &mut [RowsByNode]) {
        self.program.constraint_jacobians(point, into);
    }

    fn linearise(
        &self,
        point: &P::Point,
        multipliers: &[Rows],
        bounds: &Bounds,
        into: &mut Linearisation,
    ) {
        self.program.linearise(point, multipliers, bounds, into);
        for (gradient, force) in into.gradient.iter_mut().zip(&self.force) {
            *gradient += force;
        }
    }

    fn retract(&self, point: &P::Point, step: &[NodeVector], length: f64, into: &mut P::Point) {
        self.program.retract(point, step, length, into);
    }

    fn metric(&self, point: &P::Point) -> Vec<Matrix6<f64>> {
        self.program.metric(point)
    }
}
