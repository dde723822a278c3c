//! The energy of the bent belt as the programme takes it: a density per unit length of the spine, with its derivatives.
//!
//! A density is a function of fields along the spine and of their rates. The first two fields are the bend ω_ζ and the rib
//! slope β; a density may have more. Unless a density defines them otherwise, fields are linear within an element and the
//! energy is taken at the element's two Gauss points. The pose increment is always taken there.

use crate::geometry::Pose;
use crate::strip::bounds::{ACTIVE, Edge, RibBounds, moved_out};
use crate::strip::element::{Element, Stock};
use nalgebra::{SMatrix, SVector, Vector6};
use num_dual::DualNum;
use stagewise::{Stage, StageMatrix};

/// Elements whose motions and derivatives are found at a time, a number.
pub const LANES: usize = 8;

/// Parameters and weights of Gauss's rule of two points from 0 to 1, dimensionless.
const GAUSS_2: [[f64; 2]; 2] = [
    [0.211_324_865_405_187_1, 0.5],
    [0.788_675_134_594_812_9, 0.5],
];

/// A place of the belt at which a density is asked for.
#[derive(Debug, Clone, Copy)]
pub struct Section<'a, T, const F: usize> {
    /// Fields at the place, of which the first two are bend and rib slope.
    pub fields: [T; F],
    /// Derivatives of the fields by u.
    pub rates: [T; F],
    /// Fields at both ends of the element.
    pub ends: [[T; F]; 2],
    /// The element: its length and in-plane curvature.
    pub element: &'a Element,
    /// What the element is made of.
    pub stock: Stock<T>,
}

/// The rib slope beyond a bend of the board by χ; `None` where the rib would leave through the bend: a rib there is one
/// material line, α⁺ = α⁻ − χ.
pub(crate) fn slope_beyond<T: DualNum<Primitive = f64> + Copy>(slope: T, angle: f64) -> Option<T> {
    let (sine, cosine) = angle.sin_cos();
    let denominator = slope * sine + cosine;
    (denominator.re() > 0.0).then(|| (slope * cosine - sine) / denominator)
}

/// Energy of the bent belt per unit length of the spine at unit rigidity, by `F` fields along it.
pub trait Density<const F: usize>: Clone {
    /// Motions of elements, several at a time; [`crate::strip::automatic::Motions`] unless a kernel is faster.
    type Motions: Motions<Self, F>;
    /// Derivatives of elements, several at a time; [`crate::strip::automatic::Derivatives`] unless a kernel is faster.
    type Derivatives: Derivatives<Self, F>;

    /// The density. The numbers may carry derivatives.
    fn value<T: DualNum<Primitive = f64> + Copy>(&self, section: &Section<'_, T, F>) -> T;

    /// Torsion ω_η and bend ω_ζ of the spine: its frame turns by (κ_g, ω_η, ω_ζ) per unit length. Unless a density defines
    /// them otherwise the ribs are exact, ω_η = −β ω_ζ.
    ///
    /// Source: Eq. (32)
    fn torsion_and_bend<T: DualNum<Primitive = f64> + Copy>(&self, fields: &[T; F]) -> [T; 2] {
        [-fields[1] * fields[0], fields[0]]
    }

    /// Places of an element at which its energy is taken, parameters from 0 to 1, each with its weight; weights sum to 1.
    fn places(&self) -> &'static [[f64; 2]] {
        &GAUSS_2
    }

    /// The fields and their rates at parameter t of an element, from the fields at both ends.
    fn section<'a, T: DualNum<Primitive = f64> + Copy>(
        &self,
        element: &'a Element,
        ends: [[T; F]; 2],
        t: f64,
    ) -> Section<'a, T, F> {
        Section {
            fields: std::array::from_fn(|i| ends[0][i] * (1.0 - t) + ends[1][i] * t),
            rates: std::array::from_fn(|i| (ends[1][i] - ends[0][i]) / element.length),
            ends,
            element,
            stock: element.stock().map(T::from),
        }
    }

    /// The fields that curve the ribs, with a unit of length: of every node the rate of the rib slope, the twist along the rib, the
    /// bend of the rib and its rate; `None` where ribs are straight.
    fn curved(&self, _fields: &[SVector<f64, F>], _length: f64) -> Option<[Vec<f64>; 4]> {
        None
    }

    /// Weights of the fields where steps are damped, of a belt of a half width in U: alike, unless a density has fields of many
    /// sizes.
    fn weights(&self, _half_width: f64) -> [f64; F] {
        [1.0; F]
    }

    /// Fields that vanish where a rib is held square, at a clamp or beside a stiffener: the rib slope, unless a density has
    /// more.
    fn held(&self) -> [bool; F] {
        std::array::from_fn(|i| i == 1)
    }

    /// Fields that are carried on across a joint: the rib slope, unless a density has more.
    fn carried(&self) -> [bool; F] {
        std::array::from_fn(|i| i == 1)
    }

    /// The fields beyond a joint where the board bends by an angle, from η towards ζ, with its in-plane curvature before and
    /// beyond. Fields that are not carried on are left as they are; `None` where the rib would leave through the bend.
    fn beyond<T: DualNum<Primitive = f64> + Copy>(
        &self,
        angle: f64,
        _geodesic: [f64; 2],
        fields: &[T; F],
    ) -> Option<[T; F]> {
        let mut beyond = *fields;
        beyond[1] = slope_beyond(fields[1], angle)?;
        Some(beyond)
    }

    /// The fields of a node after a step: their sum, unless a density has fields that trade places along a curve.
    fn moved(&self, fields: &SVector<f64, F>, step: &SVector<f64, F>) -> SVector<f64, F> {
        fields + step
    }

    /// Second derivative of [`Self::moved`] along a gradient by the fields; `None` where a step is added.
    fn curvature_of_steps(
        &self,
        _fields: &SVector<f64, F>,
        _gradient: impl FnOnce() -> SVector<f64, F>,
    ) -> Option<SMatrix<f64, F, F>> {
        None
    }

    /// Number of inequalities of an element.
    fn inequalities(&self, element: &Element, edges: &[Option<Edge>; ACTIVE]) -> usize {
        element.bounds(edges).places().count()
    }

    /// Slacks of an element's inequalities, admissible where positive: those that keep its ribs apart on the board, unless a
    /// density has others.
    fn slacks(
        &self,
        element: &Element,
        edges: &[Option<Edge>; ACTIVE],
        ends: [&SVector<f64, F>; 2],
        into: &mut Vec<f64>,
    ) {
        let [plus, minus, active @ ..] = element.bounds(edges).slacks(ends.map(|end| end[1]));
        into.extend([plus, minus]);
        for (slack, edge) in active.into_iter().zip(edges) {
            if edge.is_some() {
                into.push(slack);
            }
        }
    }

    /// Gradients of an element's slacks; subtracts their second derivatives, each times its multiplier.
    fn linearise_slacks(
        &self,
        element: &Element,
        edges: &[Option<Edge>; ACTIVE],
        ends: [&SVector<f64, F>; 2],
        multipliers: &[f64],
        gradients: &mut [[SVector<f64, F>; 2]],
        controls: &mut StageMatrix<F>,
    ) {
        let bounds = element.bounds(edges);
        let slacks = bounds.slack_jets(ends.map(|end| end[1]));
        let are_linear = bounds.are_linear();
        let rows = gradients.iter_mut().zip(multipliers);
        for ((gradient, multiplier), place) in rows.zip(bounds.places()) {
            let slack = &slacks[place];
            if !are_linear {
                controls.first[(1, 1)] -= multiplier * slack.hessian[(0, 0)];
                controls.mixed[(1, 1)] -= multiplier * slack.hessian[(0, 1)];
                controls.second[(1, 1)] -= multiplier * slack.hessian[(1, 1)];
            }
            gradient[0].fill(0.0);
            gradient[1].fill(0.0);
            (gradient[0][1], gradient[1][1]) = (slack.gradient[0], slack.gradient[1]);
        }
    }

    /// As [`Self::slacks`], of a belt of a half width; the numbers may carry derivatives.
    fn slacks_of_width<T: DualNum<Primitive = f64> + Copy>(
        &self,
        element: &Element,
        edges: &[Option<Edge>; ACTIVE],
        ends: &[[T; F]; 2],
        half_width: T,
    ) -> Vec<T> {
        let bounds = RibBounds {
            strips: element.strips_of(half_width),
            edges: &moved_out(edges, half_width - element.half_width),
        };
        let slacks = bounds.slacks([ends[0][1], ends[1][1]]);
        bounds.places().map(|place| slacks[place]).collect()
    }

    /// Energy of an element, from its fields at both ends.
    fn energy(&self, element: &Element, ends: [&SVector<f64, F>; 2]) -> f64 {
        element_energy(self, element, ends.map(|end| end.data.0[0]))
    }

    /// Energy of elements together, each with its fields at both ends.
    fn total_energy<'a>(
        &self,
        elements: impl Iterator<Item = (&'a Element, [&'a SVector<f64, F>; 2])>,
    ) -> f64 {
        elements
            .map(|(element, ends)| self.energy(element, ends))
            .sum()
    }
}

/// An element with the data that its derivatives depend on.
#[derive(Debug, Clone, Copy)]
pub struct Loaded<'a, const F: usize> {
    /// The element.
    pub element: &'a Element,
    /// Fields at both ends.
    pub fields: [&'a SVector<f64, F>; 2],
    /// Poses of both nodes.
    pub poses: [&'a Pose; 2],
    /// Derivative of all work by a twist of the belt from the second node on: force, then moment about the origin, world
    /// axes.
    pub wrench: &'a Vector6<f64>,
}

/// The motions along up to [`LANES`] elements.
pub trait Motions<D, const F: usize>: Default {
    /// Puts an element into a lane, with its fields at both ends.
    fn set(&mut self, lane: usize, element: &Element, ends: [&SVector<f64, F>; 2]);

    /// Finds the motions of all lanes: fourth-order Magnus steps.
    fn find(&mut self, density: &D);

    /// The motion of a lane.
    fn at(&self, lane: usize) -> Pose;
}

/// The derivatives of up to [`LANES`] elements.
pub trait Derivatives<D, const F: usize>: Default {
    /// Puts an element into a lane.
    fn set(&mut self, lane: usize, density: &D, loaded: &Loaded<'_, F>);

    /// Finds the derivatives of all lanes.
    fn find(&mut self, density: &D);

    /// Gradient of energy and work by the fields at both ends of a lane's element.
    fn gradient(&self, lane: usize) -> [SVector<f64, F>; 2];

    /// Second derivatives of energy and work by the fields at both ends of a lane's element.
    fn hessian(&self, lane: usize) -> StageMatrix<F>;

    /// Writes the derivatives of a lane's element along the chain: the twist of its second node by its first node's twist
    /// and the fields, and second derivatives by that twist and the fields.
    fn carry<const N: usize>(&self, lane: usize, stage: &mut Stage<F, N>);
}

/// Energy of an element by its definition: the density at the places of the rule.
pub(super) fn element_energy<D, T, const F: usize>(
    density: &D,
    element: &Element,
    ends: [[T; F]; 2],
) -> T
where
    D: Density<F>,
    T: DualNum<Primitive = f64> + Copy,
{
    let at = |[t, weight]: &[f64; 2]| {
        let value = density.value(&density.section(element, ends, *t));
        value * (weight * element.length * element.rigidity_at(*t))
    };
    let places = density.places().iter();
    places.map(at).fold(T::zero(), |sum, part| sum + part)
}
