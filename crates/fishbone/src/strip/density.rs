//! The energy of the bent belt as the programme takes it: a density per unit length of the spine, with its derivatives.
//!
//! A density is a function of fields along the spine and of their rates. The first two fields are the bend ω_ζ and the rib
//! slope β; a density may have more. Fields are linear within an element. The pose increment and the energy are both taken
//! at the element's two Gauss points.

use crate::geometry::{Pose, gauss_points};
use crate::strip::element::{Curl, Element};
use nalgebra::{SVector, Vector6};
use num_dual::DualNum;
use stagewise::{Stage, StageMatrix};

/// Elements whose motions and derivatives are found at a time, a number.
pub const LANES: usize = 8;

/// A place of the belt at which a density is asked for.
#[derive(Debug, Clone, Copy)]
pub struct Section<'a, T, const F: usize> {
    /// Fields at the place, of which the first two are bend and rib slope.
    pub fields: [T; F],
    /// Derivatives of the fields by u.
    pub rates: [T; F],
    /// Fields at both ends of the element.
    pub ends: [[T; F]; 2],
    /// The element: its length, in-plane curvature, half width.
    pub element: &'a Element,
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

    /// Energy of an element, from its fields at both ends.
    fn energy(&self, element: &Element, ends: [&SVector<f64, F>; 2]) -> f64 {
        element_energy(self, element, ends.map(|end| end.data.0[0]))
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

/// Energy of an element by its definition: the density at the two Gauss points.
pub(super) fn element_energy<D, T, const F: usize>(
    density: &D,
    element: &Element,
    ends: [[T; F]; 2],
) -> T
where
    D: Density<F>,
    T: DualNum<Primitive = f64> + Copy,
{
    let rates = std::array::from_fn(|i| (ends[1][i] - ends[0][i]) / element.length);
    let at = |t: f64, rigidity: f64| {
        let section = Section {
            fields: between(&ends, t),
            rates,
            ends,
            element,
        };
        density.value(&section) * (0.5 * element.length * rigidity)
    };
    let [first, second] = gauss_points();
    at(first, element.rigidity[0]) + at(second, element.rigidity[1])
}

/// The fields at parameter t of an element.
pub(super) fn between<T, const F: usize>(ends: &[[T; F]; 2], t: f64) -> [T; F]
where
    T: DualNum<Primitive = f64> + Copy,
{
    std::array::from_fn(|i| ends[0][i] * (1.0 - t) + ends[1][i] * t)
}

impl<T: DualNum<Primitive = f64> + Copy, const F: usize> Section<'_, T, F> {
    /// Natural bend of the element.
    pub(crate) fn curl(&self) -> &Curl {
        &self.element.curl
    }
}
