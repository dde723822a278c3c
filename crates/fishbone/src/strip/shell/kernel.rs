//! Motions and derivatives of elements of finite thickness, several at a time.

#![expect(
    clippy::needless_range_loop,
    reason = "indices of matrices, as they stand in formulas"
)]

mod interpolation;

use super::section::{
    ACROSS, BEND, CONVERGENCE, CONVERGENCE_RATE, GROWTH, GROWTH_RATE, INPUTS, Jet, Plates, SLOPE,
    TWIST, Work, density, differentiate,
};
use super::step::Twisted;
use super::wide::Wide;
use super::{FIELDS, GAUSS_4, Shell, hermite};
use crate::geometry::{Pose, gauss_points};
use crate::strip::density::{self, LANES, Loaded};
use crate::strip::element::Element;
use crate::strip::kernel::arithmetic::{entry, triple};
use crate::strip::kernel::lane::{Motion, Step};
use crate::strip::kernel::{self, Even, NOTHING, Spans, Surroundings};
use interpolation::Interpolation;
use multiversion::multiversion;
use nalgebra::{SMatrix, SVector, Vector4};
use stagewise::{Stage, StageMatrix};

/// Unknowns of an element: for every field the unknowns at the first node, then at the second.
const UNKNOWNS: usize = 2 * FIELDS;
/// Unknowns that the motion of an element depends on: all but the bend of the ribs.
const MOVING: usize = 8;
/// Place among the unknowns of every field of the first node, then of the second.
const PLACES: [[usize; FIELDS]; 2] = [[0, 2, 3, 6, 8, 9], [1, 4, 5, 7, 10, 11]];

/// Places in the second derivative, row by row, of the entries of a stage's matrices, column by column: of the first node, of
/// both, of the second.
const ENTRIES: [[usize; FIELDS * FIELDS]; 3] = [
    entries(PLACES[0], PLACES[0]),
    entries(PLACES[0], PLACES[1]),
    entries(PLACES[1], PLACES[1]),
];

const fn entries(rows: [usize; FIELDS], columns: [usize; FIELDS]) -> [usize; FIELDS * FIELDS] {
    let (mut out, mut at) = ([0; FIELDS * FIELDS], 0);
    while at < FIELDS * FIELDS {
        let (row, column) = (rows[at % FIELDS], columns[at / FIELDS]);
        // The second derivative is valid on the diagonal and right of it.
        out[at] = match row < column {
            true => row * UNKNOWNS + column,
            false => column * UNKNOWNS + row,
        };
        at += 1;
    }
    out
}

/// The motions along a block of elements.
#[derive(Debug, Clone, Default)]
pub(crate) struct Motions(kernel::Motions);

impl density::Motions<Shell, FIELDS> for Motions {
    fn set(&mut self, lane: usize, element: &Element, ends: [&SVector<f64, FIELDS>; 2]) {
        let fields = PosePoints::of(element, ends).rates();
        self.0.spans.set(lane, element, &fields);
    }

    fn find(&mut self, _: &Shell) {
        self.0.find_by::<Twisted>();
    }

    fn at(&self, lane: usize) -> Pose {
        self.0.found(lane)
    }
}

/// Bend, rib slope and twist of an element at the two Gauss points of the pose.
struct PosePoints {
    bend: [f64; 2],
    slope: [f64; 2],
    twist: [f64; 2],
}

impl PosePoints {
    fn of(element: &Element, [a, b]: [&SVector<f64, FIELDS>; 2]) -> Self {
        let linear = |i: usize| gauss_points().map(|t| a[i] * (1.0 - t) + b[i] * t);
        let slope = gauss_points().map(|t| {
            let [value, _, _] = hermite(t);
            let rates = a[2] * value[1] + b[2] * value[3];
            a[1] * value[0] + b[1] * value[2] + rates * element.length
        });
        Self {
            bend: linear(0),
            slope,
            twist: linear(3),
        }
    }

    /// Bend and torsion at the first point, then at the second.
    fn rates(&self) -> Vector4<f64> {
        let torsion = [0, 1].map(|i| self.twist[i] - self.slope[i] * self.bend[i]);
        Vector4::new(self.bend[0], torsion[0], self.bend[1], torsion[1])
    }
}

/// A block of elements with their derivatives, valid once `find` has run.
#[derive(Debug, Clone)]
pub(crate) struct Block {
    input: Input,
    output: Output,
    work: Work,
}

/// The data that the energy of a block depends on.
#[derive(Debug, Clone)]
struct Ribs {
    unknowns: [Wide; UNKNOWNS],
    length: Wide,
    /// Weight of every place of the energy: its share of the length times the rigidity there.
    weight: [Wide; 4],
    plates: Plates,
}

/// The data that the derivatives of a block depend on.
#[derive(Debug, Clone)]
struct Input {
    ribs: Ribs,
    spans: Spans,
    /// Bend and rib slope at the two Gauss points of the pose.
    bend: [Wide; 2],
    slope: [Wide; 2],
    surroundings: Surroundings,
}

/// The derivatives of a block by the unknowns of its elements.
#[derive(Debug, Clone)]
struct Output {
    gradient: [Wide; UNKNOWNS],
    /// Valid on the diagonal and right of it.
    hessian: [[Wide; UNKNOWNS]; UNKNOWNS],
    /// Twist of the second node by the unknowns that move it.
    growth: [[Wide; 6]; MOVING],
    /// Second derivative by the first node's twist and the same unknowns.
    mixed: [[Wide; 6]; MOVING],
}

impl Ribs {
    /// Elements of no energy.
    const NONE: Self = Self {
        unknowns: [Wide::ZERO; UNKNOWNS],
        length: Wide([1.0; LANES]),
        weight: [Wide::ZERO; 4],
        plates: Plates {
            half_width: Wide([1.0; LANES]),
            geodesic: Wide::ZERO,
            natural: Wide::ZERO,
            poisson: Wide::ZERO,
            stretching: Wide([1.0; LANES]),
        },
    };

    fn set(&mut self, lane: usize, element: &Element, fields: [&SVector<f64, FIELDS>; 2]) {
        for (end, places) in fields.into_iter().zip(PLACES) {
            for (field, place) in end.iter().zip(places) {
                self.unknowns[place].0[lane] = *field;
            }
        }
        self.length.0[lane] = element.length;
        for (weight, [t, share]) in self.weight.iter_mut().zip(GAUSS_4) {
            weight.0[lane] = share * element.length * element.rigidity_at(t);
        }
        self.plates
            .set(lane, &super::Plate::of(element.geodesic, &element.stock()));
    }
}

/// The energies of a block of elements.
#[derive(Debug, Clone)]
pub(super) struct Energies {
    ribs: Ribs,
    /// Number of elements in the block.
    count: usize,
}

impl Energies {
    /// A block without elements.
    pub(super) const NONE: Self = Self {
        ribs: Ribs::NONE,
        count: 0,
    };

    /// Puts one more element into the block; gives whether the block is full.
    pub(super) fn put(&mut self, element: &Element, ends: [&SVector<f64, FIELDS>; 2]) -> bool {
        self.ribs.set(self.count, element, ends);
        self.count += 1;
        self.count == LANES
    }

    /// The sum of the energies; empties the block.
    pub(super) fn take_sum(&mut self, shell: &Shell) -> f64 {
        let count = std::mem::take(&mut self.count);
        find_energies(shell, &self.ribs).0[..count].iter().sum()
    }
}

impl Default for Block {
    /// A block of elements of no energy.
    fn default() -> Self {
        Self {
            input: Input {
                ribs: Ribs::NONE,
                spans: Spans::NONE,
                bend: [Wide::ZERO; 2],
                slope: [Wide::ZERO; 2],
                surroundings: Surroundings::NONE,
            },
            output: Output {
                gradient: [Wide::ZERO; UNKNOWNS],
                hessian: [[Wide::ZERO; UNKNOWNS]; UNKNOWNS],
                growth: [[Wide::ZERO; 6]; MOVING],
                mixed: [[Wide::ZERO; 6]; MOVING],
            },
            work: Work::EMPTY,
        }
    }
}

impl density::Derivatives<Shell, FIELDS> for Block {
    fn set(&mut self, lane: usize, _: &Shell, loaded: &Loaded<'_, FIELDS>) {
        let Loaded {
            element,
            fields,
            poses,
            wrench,
        } = loaded;
        let into = &mut self.input;
        into.ribs.set(lane, element, *fields);
        let points = PosePoints::of(element, *fields);
        into.spans.set(lane, element, &points.rates());
        for i in 0..2 {
            into.bend[i].0[lane] = points.bend[i];
            into.slope[i].0[lane] = points.slope[i];
        }
        into.surroundings.set(lane, *poses, wrench);
    }

    fn find(&mut self, shell: &Shell) {
        let Self {
            input,
            output,
            work,
        } = self;
        let mut geodesic = input.ribs.plates.geodesic.0.iter();
        match geodesic.any(|geodesic| *geodesic != 0.0) {
            true => find::<true>(shell, input, work, output),
            false => find::<false>(shell, input, work, output),
        }
    }

    fn gradient(&self, lane: usize) -> [SVector<f64, FIELDS>; 2] {
        let gradient = &self.output.gradient;
        PLACES.map(|places| SVector::from(places.map(|place| gradient[place].0[lane])))
    }

    fn hessian(&self, lane: usize) -> StageMatrix<FIELDS> {
        let entries = self.output.hessian.as_flattened();
        let matrix = |places: &[usize; FIELDS * FIELDS]| {
            SMatrix::from_iterator(places.iter().map(|place| entries[*place].0[lane]))
        };
        let [first, mixed, second] = &ENTRIES;
        StageMatrix {
            first: matrix(first),
            mixed: matrix(mixed),
            second: matrix(second),
        }
    }

    fn carry<const N: usize>(&self, lane: usize, stage: &mut Stage<FIELDS, N>) {
        let Output { growth, mixed, .. } = &self.output;
        let [first, second] = PLACES;
        for field in 0..FIELDS {
            for (place, into_growth, into_mixed) in [
                (
                    first[field],
                    &mut stage.growth_by_first,
                    &mut stage.state_first,
                ),
                (
                    second[field],
                    &mut stage.growth_by_second,
                    &mut stage.state_second,
                ),
            ] {
                if place < MOVING {
                    for row in 0..6 {
                        into_growth[(row, field)] = growth[place][row].0[lane];
                        into_mixed[(row, field)] = mixed[place][row].0[lane];
                    }
                }
            }
        }
    }
}

impl Plates {
    fn set(&mut self, lane: usize, plate: &super::Plate) {
        self.half_width.0[lane] = plate.half_width;
        self.geodesic.0[lane] = plate.geodesic;
        self.natural.0[lane] = plate.natural;
        self.poisson.0[lane] = plate.poisson;
        self.stretching.0[lane] = plate.stretching;
    }
}

/// Energies of all lanes.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn find_energies(shell: &Shell, ribs: &Ribs) -> Wide {
    let mut sum = Wide::ZERO;
    for (place, [t, _]) in GAUSS_4.into_iter().enumerate() {
        let fields = Interpolation::at(t, ribs.length).fields(&ribs.unknowns);
        let x = inputs(&fields, ribs.plates.geodesic);
        let density = density(&x, &ribs.plates, &shell.across, shell.gauge);
        sum += density * ribs.weight[place];
    }
    sum
}

/// Derivatives of all lanes; `CURVED` where a board of the block is curved in its plane.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn find<const CURVED: bool>(shell: &Shell, input: &Input, work: &mut Work, output: &mut Output) {
    let ribs = &input.ribs;
    let geodesic = ribs.plates.geodesic;
    let mut jet = Jet::ZERO;
    output.gradient = [Wide::ZERO; UNKNOWNS];
    output.hessian = [[Wide::ZERO; UNKNOWNS]; UNKNOWNS];
    for (place, [t, _]) in GAUSS_4.into_iter().enumerate() {
        let interpolation = Interpolation::at(t, ribs.length);
        let fields = interpolation.fields(&ribs.unknowns);
        let x = if CURVED {
            inputs(&fields, geodesic)
        } else {
            fields
        };
        let (across, gauge) = (&shell.across, shell.gauge);
        differentiate::<CURVED>(&x, &ribs.plates, across, gauge, work, &mut jet);
        if CURVED {
            by_fields(&fields, geodesic, &mut jet);
        }
        interpolation
            .weighed(ribs.weight[place])
            .add(&interpolation, &jet, output);
    }
    add_motion(input, output);
}

/// The numbers of a rib from the fields k, β, β', β'', m, m', q, q', q'', which take the places of the rib's numbers.
#[inline(always)]
fn inputs(fields: &[Wide; INPUTS], geodesic: Wide) -> [Wide; INPUTS] {
    let mut x = *fields;
    let twice = geodesic * 2.0;
    let (slope, across) = (fields[SLOPE], fields[ACROSS]);
    let (slope_rate, across_rate) = (fields[CONVERGENCE], fields[GROWTH]);
    x[CONVERGENCE] += geodesic * (slope * slope + 1.0);
    x[GROWTH] += twice * slope * across;
    x[CONVERGENCE_RATE] += twice * slope * slope_rate;
    x[GROWTH_RATE] += twice * (slope_rate * across + slope * across_rate);
    x
}

/// Turns derivatives by the numbers of a rib into derivatives by the fields.
#[inline(always)]
fn by_fields(fields: &[Wide; INPUTS], geodesic: Wide, jet: &mut Jet) {
    let twice = geodesic * 2.0;
    let lean = twice * fields[SLOPE];
    let across = twice * fields[ACROSS];
    let slope_rate = twice * fields[CONVERGENCE];
    let across_rate = twice * fields[GROWTH];
    let own = [
        (SLOPE, SLOPE, CONVERGENCE),
        (SLOPE, CONVERGENCE, CONVERGENCE_RATE),
        (SLOPE, ACROSS, GROWTH),
        (CONVERGENCE, ACROSS, GROWTH_RATE),
        (SLOPE, GROWTH, GROWTH_RATE),
    ];
    // A number's derivative by a field is added before the field's own place takes on others.
    let columns: [(usize, &[(usize, Wide)]); 4] = [
        (
            SLOPE,
            &[
                (CONVERGENCE, lean),
                (CONVERGENCE_RATE, slope_rate),
                (GROWTH, across),
                (GROWTH_RATE, across_rate),
            ],
        ),
        (ACROSS, &[(GROWTH, lean), (GROWTH_RATE, slope_rate)]),
        (
            CONVERGENCE,
            &[(CONVERGENCE_RATE, lean), (GROWTH_RATE, across)],
        ),
        (GROWTH, &[(GROWTH_RATE, lean)]),
    ];
    let second = own.map(|(i, j, of)| (i, j, twice * jet.gradient[of]));
    for (field, parts) in columns {
        // Rows and columns of the second derivative: the field's own with what the numbers add.
        let mut column = [Wide::ZERO; INPUTS];
        for (row, entry) in column.iter_mut().enumerate() {
            for (number, factor) in parts {
                *entry += jet.second(row, *number) * *factor;
            }
        }
        let mut own = Wide::ZERO;
        for (number, factor) in parts {
            own += column[*number] * *factor;
            let by_number = jet.gradient[*number];
            jet.gradient[field] += by_number * *factor;
        }
        for (row, entry) in column.iter().enumerate() {
            let factor = if row == field { 2.0 } else { 1.0 };
            jet.add(row, field, *entry * factor);
        }
        jet.add(field, field, own);
    }
    for (i, j, value) in second {
        jet.add(i, j, value);
    }
}

/// Adds the derivatives of the work of what pulls beyond the elements, and finds the growth of their motions.
#[inline(always)]
fn add_motion(input: &Input, output: &mut Output) {
    let Even { cosine, cubic, .. } = Even::of::<Twisted>(&input.spans);
    let (mut gradient, mut work) = ([Wide::ZERO; 4], [Wide::ZERO; 10]);
    let (mut growth, mut mixed) = ([[NOTHING; 6]; 4], [[NOTHING; 6]; 4]);
    for lane in 0..LANES {
        let step = Twisted::at(&input.spans, lane);
        let (cosine, cubic) = (triple(&cosine, 0, lane), triple(&cubic, 0, lane));
        let motion = Motion::at(&step, &input.surroundings, cosine, cubic, lane);
        for (into, value) in gradient.iter_mut().zip(motion.gradient) {
            into.0[lane] = value;
        }
        for (into, value) in work.iter_mut().zip(motion.work) {
            into.0[lane] = value;
        }
        let (place, turns, shifts) = (
            &motion.place,
            &motion.twists.rotation,
            &motion.twists.displacement,
        );
        // Written out: the vectoriser would take a loop over the four columns for the loop over lanes.
        place.carry(turns[0], shifts[0], lane, &mut growth[0], &mut mixed[0]);
        place.carry(turns[1], shifts[1], lane, &mut growth[1], &mut mixed[1]);
        place.carry(turns[2], shifts[2], lane, &mut growth[2], &mut mixed[2]);
        place.carry(turns[3], shifts[3], lane, &mut growth[3], &mut mixed[3]);
    }
    let columns = by_pose_points(input);
    for (unknown, by) in columns.iter().enumerate() {
        for row in 0..6 {
            let (mut grows, mut mixes) = (Wide::ZERO, Wide::ZERO);
            for i in 0..4 {
                grows += by[i] * Wide(growth[i][row]);
                mixes += by[i] * Wide(mixed[i][row]);
            }
            output.growth[unknown][row] = grows;
            output.mixed[unknown][row] = mixes;
        }
    }
    add_work(&columns, &gradient, &work, output);
    add_torsion(input, [gradient[1], gradient[3]], output);
}

/// Derivatives of bend and torsion at the two Gauss points of the pose, by every unknown.
#[inline(always)]
fn by_pose_points(input: &Input) -> [[Wide; 4]; MOVING] {
    let mut by = [[Wide::ZERO; 4]; MOVING];
    for (i, t) in gauss_points().into_iter().enumerate() {
        let [value, _, _] = hermite(t);
        let (bend, torsion) = (2 * i, 2 * i + 1);
        for (end, share) in [1.0 - t, t].into_iter().enumerate() {
            by[end][bend] = Wide::all(share);
            by[end][torsion] = -(input.slope[i] * share);
            let turned = -input.bend[i];
            by[2 + 2 * end][torsion] = turned * value[2 * end];
            by[3 + 2 * end][torsion] = turned * value[2 * end + 1] * input.ribs.length;
            by[6 + end][torsion] = Wide::all(share);
        }
    }
    by
}

/// Adds the derivatives of the work by the unknowns, from those by bend and torsion at the Gauss points.
#[inline(always)]
fn add_work(
    columns: &[[Wide; 4]; MOVING],
    slopes: &[Wide; 4],
    upper: &[Wide; 10],
    output: &mut Output,
) {
    for (i, by) in columns.iter().enumerate() {
        let mut image = [Wide::ZERO; 4];
        for (row, image) in image.iter_mut().enumerate() {
            for (column, factor) in by.iter().enumerate() {
                *image += entry(upper, row, column) * *factor;
            }
        }
        for k in 0..4 {
            output.gradient[i] += slopes[k] * by[k];
        }
        for j in i..MOVING {
            let mut sum = output.hessian[i][j];
            for k in 0..4 {
                sum += image[k] * columns[j][k];
            }
            output.hessian[i][j] = sum;
        }
    }
}

/// Adds the second derivatives of the torsion m − β ω_ζ, which is −1 by rib slope and bend, times the work of the torsions at
/// the two Gauss points.
#[inline(always)]
fn add_torsion(input: &Input, by_torsion: [Wide; 2], output: &mut Output) {
    for (t, by_torsion) in gauss_points().into_iter().zip(by_torsion) {
        let [value, _, _] = hermite(t);
        for (end, share) in [1.0 - t, t].into_iter().enumerate() {
            let pull = -(by_torsion * share);
            let bends = &mut output.hessian[end];
            for other in 0..2 {
                let slope = 2 + 2 * other;
                let rate = pull * value[2 * other + 1] * input.ribs.length;
                bends[slope] += pull * value[2 * other];
                bends[slope + 1] += rate;
            }
        }
    }
}

#[cfg(test)]
mod tests;
