//! The strip of finite width and thickness: its curvature along every rib, what its Gauss curvature costs in stretching, and
//! the layers along its free edges.
//!
//! Along a rib the potential of the curvature is quadratic in the distance v from the spine. The fields of a node are the bend
//! ω_ζ, the rib slope β and its rate, the twist m along the rib, the bend q of the rib and its rate. Within an element ω_ζ and
//! m are linear; β and q are cubic, with their rates at both ends. With `d = n − β t` the direction of a rib in the flat
//! board, t along and n across the spine, the curvature on the spine is `b(t,t) = k = −ω_ζ`, `b(t,d) = m`, `b(d,d) = q`.
//!
//! Where m and q vanish the ribs are straight and the strip is developable, as in [`super::developable`].

pub(crate) mod across;
pub(crate) mod edge_layer;
mod gauge;
mod kernel;
mod section;
mod share;
mod step;
mod wide;

use super::bounds::{ACTIVE, Edge};
use super::density::{Density, Section, slope_beyond};
use super::element::{Element, Stock};
use super::ribs::Scaled;
use crate::geometry::{Pose, Twist, gauss_points, magnus};
use across::Across;
use edge_layer::psi;
use gauge::CLOSEST;
pub(crate) use gauge::Gauge;
use nalgebra::{SMatrix, SVector, Vector3};
use num_dual::DualNum;
use share::Share;
use stagewise::StageMatrix;
use std::ops::{Add, Neg, Sub};

/// Fields of a node, a number.
pub(crate) const FIELDS: usize = 6;

/// Energy of a strip of finite width and thickness.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Shell {
    /// The term that chooses one of the rib slopes which describe nearly the same surface.
    gauge: Gauge,
    /// Rule of the integrals across the width.
    across: Across,
}

impl Shell {
    /// The strip with a gauge and a number of points across the width, from 2 to 12.
    pub(crate) fn new(gauge: Gauge, points: usize) -> Self {
        Self {
            gauge,
            across: Across::gauss(points),
        }
    }

    /// The same strip with another number of points across the width.
    pub(crate) fn with_points(&self, points: usize) -> Self {
        Self::new(self.gauge, points)
    }
}

/// The plate that a strip is cut from, at a place of the spine. Lengths in U.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plate<W = f64> {
    /// Half the width.
    pub(crate) half_width: W,
    /// In-plane curvature κ_g of the spine.
    pub(crate) geodesic: f64,
    /// Natural curvature along the spine, the b(t,t) of the unloaded strip.
    pub(crate) natural: W,
    /// Poisson's ratio.
    pub(crate) poisson: W,
    /// Stretching stiffness E h over the plate's rigidity D.
    pub(crate) stretching: W,
}

/// What the curvature along a rib depends on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rib<T> {
    /// Curvature k along the spine, b(t,t).
    pub(crate) bend: T,
    /// Twist m, b(t,d).
    pub(crate) twist: T,
    /// Slope β of the rib.
    pub(crate) slope: T,
    /// Bend q of the rib, b(d,d).
    pub(crate) across: T,
    /// Convergence s of the ribs, `β' + κ_g (1+β²)`.
    pub(crate) convergence: T,
    /// Growth of q along the spine seen from the rib, `q' + 2 β κ_g q`.
    pub(crate) growth: T,
    /// Rates of m, s and q's growth.
    pub(crate) rates: [T; 3],
}

/// The step of a node's fields that changes the rib slope and its rate and leaves curvature and torsion of the spine as they
/// are.
pub(crate) fn slope_step(
    fields: &SVector<f64, FIELDS>,
    slope: f64,
    rate: f64,
) -> SVector<f64, FIELDS> {
    let [bend, _, slope_rate, twist, _, _] = (*fields).into();
    let by_twist = bend * slope;
    let by_across_rate = -2.0 * (twist * rate + slope_rate * by_twist);
    SVector::from([
        0.0,
        slope,
        rate,
        by_twist,
        -2.0 * twist * slope,
        by_across_rate,
    ])
}

/// What the shape of a rib depends on, besides its slope.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RibCurve {
    /// Twist m, b(t,d).
    pub(crate) twist: f64,
    /// Bend q of the rib, b(d,d).
    pub(crate) across: f64,
    /// Convergence s of the ribs.
    pub(crate) convergence: f64,
    /// Growth of q along the spine, seen from the rib.
    pub(crate) growth: f64,
}

impl RibCurve {
    /// The motion of the surface's frame along the rib from its foot to a distance v: the frame turns by b(d,t) and b(d,n), and
    /// moves along the rib of a slope.
    pub(crate) fn motion(&self, slope: f64, v: f64) -> Pose {
        /// Magnus steps of fourth order along a rib, a number.
        const STEPS: usize = 4;
        let length = v / STEPS as f64;
        let twist = |v: f64| {
            let area = 1.0 - self.convergence * v;
            let along = self.twist + self.growth * v * (1.0 - 0.5 * self.convergence * v);
            let mixed = along / (area * area);
            Twist {
                translation: Vector3::new(0.0, -slope, 1.0),
                rotation: Vector3::new(0.0, self.across + slope * mixed, -mixed),
            }
        };
        let step = |i: usize| {
            let [a, b] = gauss_points().map(|t| twist((i as f64 + t) * length));
            Pose::exp(&magnus(&a, &b, length))
        };
        (0..STEPS).fold(Pose::identity(), |pose, i| pose * step(i))
    }
}

/// The curvature at a point of a rib by the basis (t, d) of the flat board.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Curvature<T> {
    /// b(t,t).
    pub(crate) along: T,
    /// b(t,d).
    pub(crate) mixed: T,
    /// b(d,d).
    pub(crate) across: T,
    /// Area of the board per unit of spine and of v: `1 − s v`.
    pub(crate) area: T,
}

impl<W: Copy + Neg<Output = W>> Plate<W> {
    pub(crate) fn of(geodesic: f64, stock: &Stock<W>) -> Self {
        Self {
            half_width: stock.half_width,
            geodesic,
            natural: -stock.curl.bend,
            poisson: stock.curl.poisson,
            stretching: stock.stretching,
        }
    }
}

impl<T: DualNum<Primitive = f64> + Copy> Rib<T> {
    /// The rib at a place, from the fields there and their rates.
    pub(crate) fn of(fields: &[T; FIELDS], rates: &[T; FIELDS], geodesic: f64) -> Self {
        let [bend, slope, slope_rate, twist, across, across_rate] = *fields;
        let [_, _, slope_second, twist_rate, _, across_second] = *rates;
        let twice = 2.0 * geodesic;
        Self {
            bend: -bend,
            twist,
            slope,
            across,
            convergence: slope_rate + (slope * slope + 1.0) * geodesic,
            growth: across_rate + slope * across * twice,
            rates: [
                twist_rate,
                slope_second + slope * slope_rate * twice,
                across_second + (slope_rate * across + slope * across_rate) * twice,
            ],
        }
    }

    /// Torsion ω_η of the spine.
    pub(crate) fn torsion(&self) -> T {
        self.twist + self.slope * self.bend
    }

    /// The curvature at a distance v from the spine, measured across it.
    pub(crate) fn curvature<W>(&self, geodesic: f64, v: W) -> Curvature<T>
    where
        T: Scaled<W>,
        W: DualNum<Primitive = f64> + Copy,
    {
        let [twist_rate, convergence_rate, growth_rate] = self.rates;
        let (m, s, g) = (self.twist, self.convergence, self.growth);
        let area = -s * v + 1.0;
        let stretch = area.recip();
        let square = stretch * stretch;
        // The potential's derivative along the rib is (v m + v² g/2)/(1 − s v); b(t,d) and b(t,t) are its derivatives by v
        // and by u.
        let mixed = m + g * v - s * g * (v * 0.5 * v);
        let rate = twist_rate * v + growth_rate * (v * 0.5 * v);
        let turned = convergence_rate * (m + g * (v * 0.5)) * (v * v);
        let board = self.slope * (g * 0.5 + s * m) * (v * geodesic * v);
        let along = self.bend - self.across * (v * geodesic);
        Curvature {
            along: stretch * along + stretch * square * (rate * area + turned + board),
            mixed: square * mixed,
            across: self.across,
            area,
        }
    }

    /// Energy per unit length of the spine at unit rigidity of the whole width, without the term of the gauge.
    ///
    /// Infinite where ribs meet within the width.
    pub(crate) fn energy<W>(&self, plate: &Plate<W>, rule: &Across) -> T
    where
        T: Scaled<W> + Sub<W, Output = T> + Add<W, Output = T>,
        W: DualNum<Primitive = f64> + Copy,
    {
        if self.convergence.re().abs() * plate.half_width.re() >= 1.0 {
            return T::from(f64::INFINITY);
        }
        let (nu, k0, a) = (plate.poisson, plate.natural, plate.half_width);
        let slope = self.slope;
        let (mut bending, mut gauss) = (T::zero(), [T::zero(); across::MOST]);
        let mut weights = [T::zero(); across::MOST];
        for i in 0..rule.points {
            let b = self.curvature(plate.geodesic, a * rule.t[i]);
            let b_vv = b.across + slope * b.mixed * 2.0 + slope * slope * b.along;
            let mean = b.along + b_vv - k0;
            gauss[i] = b.along * b.across - b.mixed * b.mixed;
            weights[i] = b.area * rule.weight[i];
            let plate = mean * mean - (gauss[i] - b_vv * k0) * ((-nu + 1.0) * 2.0);
            bending += weights[i] * plate;
        }
        let stretching = strain_square(&gauss, &weights, rule) * (plate.stretching * a.powi(4));
        let moment =
            (slope * slope + nu) * self.bend + slope * self.twist * 2.0 + self.across - nu * k0;
        let layers = moment * moment * psi(self.layer(plate));
        (bending + stretching) * 0.25 - layers * 0.5
    }

    /// The number z of the edge layers.
    fn layer<W>(&self, plate: &Plate<W>) -> T
    where
        T: Scaled<W>,
        W: DualNum<Primitive = f64> + Copy,
    {
        self.bend * self.bend * (plate.stretching * 4.0 * plate.half_width.powi(4))
    }
}

/// Integral over the section of the square of the strain along it whose second derivative is minus the Gauss curvature, and
/// that has neither a resultant force nor a moment; per square of the half width's square.
fn strain_square<T: DualNum<Primitive = f64> + Copy>(
    gauss: &[T; across::MOST],
    weights: &[T; across::MOST],
    rule: &Across,
) -> T {
    let points = 0..rule.points;
    let sum = |terms: &dyn Fn(usize) -> T| points.clone().fold(T::zero(), |sum, i| sum + terms(i));
    let mut strain = [T::zero(); across::MOST];
    for i in points.clone() {
        strain[i] = -sum(&|j| gauss[j] * rule.twice[i][j]);
    }
    let moments = [0, 1, 2].map(|power| sum(&|i| weights[i] * rule.t[i].powi(power)));
    let [force, moment] =
        [0, 1].map(|power| sum(&|i| weights[i] * strain[i] * rule.t[i].powi(power)));
    let determinant = moments[0] * moments[2] - moments[1] * moments[1];
    let mean = (moments[2] * force - moments[1] * moment) / determinant;
    let slope = (moments[0] * moment - moments[1] * force) / determinant;
    sum(&|i| {
        let rest = strain[i] - mean - slope * rule.t[i];
        weights[i] * rest * rest
    })
}

/// Parameters and weights of Gauss's rule of four points from 0 to 1, dimensionless.
const GAUSS_4: [[f64; 2]; 4] = [
    [0.069_431_844_202_973_71, 0.173_927_422_568_726_93],
    [0.330_009_478_207_571_87, 0.326_072_577_431_273_07],
    [0.669_990_521_792_428_1, 0.326_072_577_431_273_07],
    [0.930_568_155_797_026_3, 0.173_927_422_568_726_93],
];

impl Density<FIELDS> for Shell {
    type Motions = kernel::Motions;
    type Derivatives = kernel::Block;

    fn value<T: DualNum<Primitive = f64> + Copy>(&self, section: &Section<'_, T, FIELDS>) -> T {
        let plate = Plate::of(section.element.geodesic, &section.stock);
        let rib = Rib::of(&section.fields, &section.rates, plate.geodesic);
        rib.energy(&plate, &self.across) + self.gauge.energy(&plate, &rib)
    }

    /// The torsion is that of the ribs and their twist: ω_η = m − β ω_ζ.
    fn torsion_and_bend<T: DualNum<Primitive = f64> + Copy>(&self, fields: &[T; FIELDS]) -> [T; 2] {
        let [bend, slope, _, twist, ..] = *fields;
        [twist - slope * bend, bend]
    }

    fn curved(&self, fields: &[SVector<f64, FIELDS>], length: f64) -> Option<[Vec<f64>; 4]> {
        let field = |i: usize, unit: f64| fields.iter().map(|f| f[i] / unit).collect();
        Some([
            field(2, length),
            field(3, length),
            field(4, length),
            field(5, length * length),
        ])
    }

    /// Curvatures count by the width, and rates by half of it.
    fn weights(&self, half_width: f64) -> [f64; FIELDS] {
        let rate = half_width * half_width;
        let bend = 4.0 * rate;
        [bend, 1.0, rate, bend, bend, bend * rate]
    }

    fn held(&self) -> [bool; FIELDS] {
        [false, true, false, true, true, true]
    }

    fn carried(&self) -> [bool; FIELDS] {
        [false, true, true, true, true, true]
    }

    /// The surface and its tangent plane are continuous all along the rib, one material line: s/√(1+β²), q/(1+β²), the twist
    /// about the rib, m + β q/(1+β²), and with the growth g of q, (g − 2 β s q/(1+β²))/√(1+β²), are the same on both sides.
    fn beyond<T: DualNum<Primitive = f64> + Copy>(
        &self,
        angle: f64,
        geodesic: [f64; 2],
        fields: &[T; FIELDS],
    ) -> Option<[T; FIELDS]> {
        let [bend, slope, slope_rate, twist, across, across_rate] = *fields;
        let [before, after] = geodesic;
        let beyond = slope_beyond(slope, angle)?;
        let [square, square_beyond] = [slope, beyond].map(|slope| slope * slope + 1.0);
        let shrinks = square_beyond / square;
        let root = shrinks.sqrt();
        let across_beyond = across * shrinks;
        let convergence = slope_rate + square * before;
        let growth = across_rate + slope * across * (2.0 * before);
        let turned = (beyond - slope) * convergence * across / square;
        let growth_beyond = growth + turned * 2.0;
        let twist_of_rib = twist + slope * across / square;
        Some([
            bend,
            beyond,
            convergence * root - square_beyond * after,
            twist_of_rib - beyond * across_beyond / square_beyond,
            across_beyond,
            growth_beyond * root - beyond * across_beyond * (2.0 * after),
        ])
    }

    fn moved(
        &self,
        fields: &SVector<f64, FIELDS>,
        step: &SVector<f64, FIELDS>,
    ) -> SVector<f64, FIELDS> {
        let [bend, slope, slope_rate, twist, _, _] = (*step).into();
        let turned = slope * bend;
        let mut moved = fields + step;
        moved[3] += turned;
        moved[4] += slope * (slope * (fields[0] - bend) - 2.0 * twist);
        moved[5] -= 2.0 * (slope_rate * twist + moved[2] * turned);
        moved
    }

    fn curvature_of_steps(
        &self,
        fields: &SVector<f64, FIELDS>,
        gradient: impl FnOnce() -> SVector<f64, FIELDS>,
    ) -> Option<SMatrix<f64, FIELDS, FIELDS>> {
        let gradient = gradient();
        let mut into = SMatrix::zeros();
        let mut add = |i: usize, j: usize, value: f64| {
            into[(i, j)] += value;
            into[(j, i)] += value;
        };
        add(0, 1, gradient[3] - 2.0 * fields[2] * gradient[5]);
        add(1, 1, fields[0] * gradient[4]);
        add(1, 3, -2.0 * gradient[4]);
        add(2, 3, -2.0 * gradient[5]);
        Some(into)
    }

    fn inequalities(&self, _: &Element, _: &[Option<Edge>; ACTIVE]) -> usize {
        2 * Share::PLACES.len()
    }

    /// At both ends and wherever the energy is taken the ribs of an element keep a tenth of the way to where they meet at
    /// an edge: on coarse meshes they come closer beside clamps and inflections without need.
    fn slacks(
        &self,
        element: &Element,
        _: &[Option<Edge>; ACTIVE],
        ends: [&SVector<f64, FIELDS>; 2],
        into: &mut Vec<f64>,
    ) {
        for t in Share::PLACES {
            let share = Share::at(element, ends, t).value;
            into.extend([CLOSEST - share, CLOSEST + share]);
        }
    }

    fn linearise_slacks(
        &self,
        element: &Element,
        _: &[Option<Edge>; ACTIVE],
        ends: [&SVector<f64, FIELDS>; 2],
        multipliers: &[f64],
        gradients: &mut [[SVector<f64, FIELDS>; 2]],
        controls: &mut StageMatrix<FIELDS>,
    ) {
        let rows = gradients
            .chunks_exact_mut(2)
            .zip(multipliers.chunks_exact(2));
        for ((rows, multipliers), t) in rows.zip(Share::PLACES) {
            let share = Share::at(element, ends, t);
            let gradient = share.gradient();
            rows[0] = gradient.map(|end| -end);
            rows[1] = gradient;
            if element.geodesic != 0.0 {
                share.add_hessian(multipliers[0] - multipliers[1], controls);
            }
        }
    }

    fn total_energy<'a>(
        &self,
        elements: impl Iterator<Item = (&'a Element, [&'a SVector<f64, FIELDS>; 2])>,
    ) -> f64 {
        let (mut block, mut sum) = (kernel::Energies::NONE, 0.0);
        for (element, ends) in elements {
            if block.put(element, ends) {
                sum += block.take_sum(self);
            }
        }
        sum + block.take_sum(self)
    }

    /// At two places a coarse mesh would hide energy beside the clamps.
    fn places(&self) -> &'static [[f64; 2]] {
        &GAUSS_4
    }

    fn section<'a, T: DualNum<Primitive = f64> + Copy>(
        &self,
        element: &'a Element,
        ends: [[T; FIELDS]; 2],
        t: f64,
    ) -> Section<'a, T, FIELDS> {
        let (fields, rates) = interpolated(ends, element.length, t);
        Section {
            fields,
            rates,
            ends,
            element,
            stock: element.stock().map(T::from),
        }
    }

    fn slacks_of_width<T: DualNum<Primitive = f64> + Copy>(
        &self,
        element: &Element,
        _: &[Option<Edge>; ACTIVE],
        ends: &[[T; FIELDS]; 2],
        half_width: T,
    ) -> Vec<T> {
        let shares = Share::PLACES.map(|t| {
            let (fields, rates) = interpolated(*ends, element.length, t);
            Rib::of(&fields, &rates, element.geodesic).convergence * half_width
        });
        let slacks = |share: T| [-share + CLOSEST, share + CLOSEST];
        shares.into_iter().flat_map(slacks).collect()
    }
}

/// The fields and their rates at parameter t of an element of a length, from the fields at both ends.
pub(crate) fn interpolated<T: DualNum<Primitive = f64> + Copy>(
    ends: [[T; FIELDS]; 2],
    length: f64,
    t: f64,
) -> ([T; FIELDS], [T; FIELDS]) {
    let linear = |i: usize| {
        let [a, b] = [ends[0][i], ends[1][i]];
        [a * (1.0 - t) + b * t, (b - a) / length]
    };
    let shape = hermite(t);
    let cubic = |i: usize| {
        [0, 1, 2].map(|order| {
            let [a, ra, b, rb] = shape[order];
            let rates = ends[0][i + 1] * ra + ends[1][i + 1] * rb;
            (ends[0][i] * a + ends[1][i] * b + rates * length) * length.powi(-(order as i32))
        })
    };
    let [bend, bend_rate] = linear(0);
    let [slope, slope_rate, slope_second] = cubic(1);
    let [twist, twist_rate] = linear(3);
    let [across, across_rate, across_second] = cubic(4);
    (
        [bend, slope, slope_rate, twist, across, across_rate],
        [
            bend_rate,
            slope_rate,
            slope_second,
            twist_rate,
            across_rate,
            across_second,
        ],
    )
}

/// Hermite's cubics at a parameter, and their first and second derivatives: by value and rate at the start, by value and rate
/// at the end.
pub(crate) fn hermite(t: f64) -> [[f64; 4]; 3] {
    let (s, t2) = (1.0 - t, t * t);
    [
        [
            s * s * (1.0 + 2.0 * t),
            t * s * s,
            t2 * (3.0 - 2.0 * t),
            -t2 * s,
        ],
        [
            -6.0 * t * s,
            s * (1.0 - 3.0 * t),
            6.0 * t * s,
            t * (3.0 * t - 2.0),
        ],
        [12.0 * t - 6.0, 6.0 * t - 4.0, 6.0 - 12.0 * t, 6.0 * t - 2.0],
    ]
}

#[cfg(test)]
mod tests;
