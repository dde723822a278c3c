//! Derivatives of elements, several at a time: the same arithmetic in every lane of a vector.
//!
//! A motion M(w) by the four unknowns w has the derivatives of the twist X in `M(w + dw) = exp(X) M(w)`. Seen from the
//! world, about its origin, the twists of elements that follow each other add up: to first order plainly, to second order
//! with half their bracket. The loads and supports beyond an element make one wrench about the origin, the same for all
//! elements between two points where loads or supports act.

pub(in crate::strip) mod arithmetic;
pub(in crate::strip) mod lane;
#[cfg(test)]
mod tests;

use crate::geometry::{Coefficients, Pose};
use crate::strip::density::{self, LANES, Loaded};
use crate::strip::developable::DevelopableEnergy;
use crate::strip::element::Element;
use crate::strip::energy::Jet;
use crate::strip::ribs::Across;
use arithmetic::{cross, dot, triple};
use lane::{Magnus, Step, differentiate_lane};
use multiversion::multiversion;
use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3, Vector4, Vector6};
use num_dual::DualNum;
use stagewise::{Stage, StageMatrix};

/// One number for every element of a block.
pub(in crate::strip) type Lanes = [f64; LANES];
pub(in crate::strip) type Triple = [f64; 3];
/// The upper triangle of a symmetric 4×4 matrix by rows.
pub(in crate::strip) type Upper = [f64; 10];

/// The data that the motions along a block of elements depend on.
#[derive(Debug, Clone)]
pub(in crate::strip) struct Spans {
    /// The four numbers that a [`Step`] takes: bend₀, slope₀, bend₁, slope₁ of a developable element.
    pub(in crate::strip) fields: [Lanes; 4],
    pub(in crate::strip) length: Lanes,
    pub(in crate::strip) geodesic: Lanes,
}

/// The data that the derivatives of a block of elements depend on.
#[derive(Debug, Clone)]
struct Input {
    spans: Spans,
    rigidity: [Lanes; 2],
    /// Factor of the width in the energy: value, gradient and Hessian (upper triangle) by slope₀ and slope₁.
    across: [Lanes; 6],
    surroundings: Surroundings,
}

/// The poses of both nodes of every element of a block, and what pulls at its second node.
#[derive(Debug, Clone)]
pub(in crate::strip) struct Surroundings {
    /// Frame of the first node, column by column.
    frame: [Lanes; 9],
    /// Position of the first node.
    position: [Lanes; 3],
    /// Position of the second node.
    next: [Lanes; 3],
    /// Force, then moment about the origin, world axes: derivative of all work by the second node's twist.
    wrench: [Lanes; 6],
}

/// The derivatives of a block of elements by their fields.
#[derive(Debug, Clone)]
struct Output {
    /// Twist of the second node against the first.
    growth: [[Lanes; 6]; 4],
    /// Second derivative by the first node's twist and the fields.
    mixed: [[Lanes; 6]; 4],
    /// Gradient of bending energy and work.
    gradient: [Lanes; 4],
    /// Hessian of bending energy and work, upper triangle by rows.
    hessian: [Lanes; 10],
}

/// A block of elements with their derivatives, valid once `find` has run.
#[derive(Debug, Clone)]
pub struct Block {
    input: Input,
    output: Output,
    /// Energy that the natural bend adds, with its derivatives, where an element has a natural bend.
    curl: [Option<Jet>; LANES],
}

/// Zero in every lane, in the unit of its field.
pub(in crate::strip) const NOTHING: Lanes = [0.0; LANES];

impl Spans {
    /// Spans of no length, lengths in the solver's U: they fill the lanes of a block that is not full.
    pub(in crate::strip) const NONE: Self = Self {
        fields: [NOTHING; 4],
        length: NOTHING,
        geodesic: NOTHING,
    };

    pub(in crate::strip) fn set(&mut self, lane: usize, element: &Element, fields: &Vector4<f64>) {
        for (lanes, field) in self.fields.iter_mut().zip(fields) {
            lanes[lane] = *field;
        }
        (self.length[lane], self.geodesic[lane]) = (element.length, element.geodesic);
    }
}

impl Surroundings {
    /// Frames and wrenches of zeros.
    pub(in crate::strip) const NONE: Self = Self {
        frame: [NOTHING; 9],
        position: [NOTHING; 3],
        next: [NOTHING; 3],
        wrench: [NOTHING; 6],
    };

    pub(in crate::strip) fn set(
        &mut self,
        lane: usize,
        [first, second]: [&Pose; 2],
        wrench: &Vector6<f64>,
    ) {
        put(&mut self.frame, lane, first.frame.as_slice());
        put(&mut self.position, lane, first.position.as_slice());
        put(&mut self.next, lane, second.position.as_slice());
        put(&mut self.wrench, lane, wrench.as_slice());
    }
}

/// Puts numbers into a lane.
fn put(lanes: &mut [Lanes], lane: usize, values: &[f64]) {
    for (lanes, value) in lanes.iter_mut().zip(values) {
        lanes[lane] = *value;
    }
}

/// The motions along a block of elements.
#[derive(Debug, Clone)]
pub struct Motions {
    pub(in crate::strip) spans: Spans,
    /// Frames, column by column.
    frame: [Lanes; 9],
    position: [Lanes; 3],
}

impl Default for Motions {
    /// Motions along elements of no length.
    fn default() -> Self {
        Self {
            spans: Spans::NONE,
            frame: [NOTHING; 9],
            position: [NOTHING; 3],
        }
    }
}

impl Motions {
    /// Finds the motions by steps that take the four fields of the spans.
    pub(in crate::strip) fn find_by<S: Step>(&mut self) {
        find_motions::<S>(&self.spans, &mut self.frame, &mut self.position);
    }

    /// The motion of a lane.
    pub(in crate::strip) fn found(&self, lane: usize) -> Pose {
        let [x, y, z] = triple(&self.position, 0, lane);
        Pose {
            frame: Matrix3::from_iterator(self.frame.iter().map(|entry| entry[lane])),
            position: Vector3::new(x, y, z),
        }
    }
}

impl density::Density<2> for DevelopableEnergy {
    type Motions = Motions;
    type Derivatives = Block;

    fn value<T: DualNum<Primitive = f64> + Copy>(&self, section: &density::Section<'_, T, 2>) -> T {
        let [bend, slope] = section.fields;
        let slopes = section.ends.map(|end| end[1]);
        let across = match self.knows_width() {
            true => section
                .element
                .strips_of(section.stock.half_width)
                .across(slopes),
            false => Across::PLAIN.map(T::from),
        };
        DevelopableEnergy::value(*self, bend, slope, &section.stock.curl, &across)
    }

    fn energy(&self, element: &Element, [a, b]: [&Vector2<f64>; 2]) -> f64 {
        element.energy(*self, &Vector4::new(a[0], a[1], b[0], b[1]))
    }
}

impl density::Motions<DevelopableEnergy, 2> for Motions {
    fn set(&mut self, lane: usize, element: &Element, [a, b]: [&Vector2<f64>; 2]) {
        let fields = Vector4::new(a[0], a[1], b[0], b[1]);
        self.spans.set(lane, element, &fields);
    }

    fn find(&mut self, _: &DevelopableEnergy) {
        self.find_by::<Magnus>();
    }

    fn at(&self, lane: usize) -> Pose {
        self.found(lane)
    }
}

impl Default for Block {
    /// A block of elements of no length.
    fn default() -> Self {
        Self {
            input: Input {
                spans: Spans::NONE,
                rigidity: [NOTHING; 2],
                across: [NOTHING; 6],
                surroundings: Surroundings::NONE,
            },
            output: Output {
                growth: [[NOTHING; 6]; 4],
                mixed: [[NOTHING; 6]; 4],
                gradient: [NOTHING; 4],
                hessian: [NOTHING; 10],
            },
            curl: [None; LANES],
        }
    }
}

impl density::Derivatives<DevelopableEnergy, 2> for Block {
    fn set(&mut self, lane: usize, model: &DevelopableEnergy, loaded: &Loaded<'_, 2>) {
        let Loaded {
            element,
            fields: [a, b],
            poses,
            wrench,
        } = loaded;
        let fields = Vector4::new(a[0], a[1], b[0], b[1]);
        let across = element.across_jets(*model, &fields);
        self.curl[lane] =
            (element.curl.bend != 0.0).then(|| element.curl_jet(*model, &fields, &across));
        let into = &mut self.input;
        into.spans.set(lane, element, &fields);
        into.surroundings.set(lane, *poses, wrench);
        put(&mut into.rigidity, lane, &element.rigidity);
        let across = &across.bending;
        let (gradient, hessian) = (&across.gradient, &across.hessian);
        let values = [across.value, gradient[0], gradient[1]];
        put(&mut into.across, lane, &values);
        put(
            &mut into.across[3..],
            lane,
            &[hessian.m11, hessian.m12, hessian.m22],
        );
    }

    fn find(&mut self, model: &DevelopableEnergy) {
        match model {
            DevelopableEnergy::Fishbone => differentiate::<true>(&self.input, &mut self.output),
            DevelopableEnergy::Sadowsky | DevelopableEnergy::Wunderlich => {
                differentiate::<false>(&self.input, &mut self.output);
            }
        }
    }

    fn gradient(&self, lane: usize) -> [SVector<f64, 2>; 2] {
        let [a, b, c, d] = &self.output.gradient;
        let mut gradient = Vector4::new(a[lane], b[lane], c[lane], d[lane]);
        if let Some(curl) = &self.curl[lane] {
            gradient += curl.gradient;
        }
        [0, 2].map(|from| gradient.fixed_rows::<2>(from).into_owned())
    }

    fn hessian(&self, lane: usize) -> StageMatrix<2> {
        let [a, b, c, d, e, f, g, h, i, j] =
            self.output.hessian.each_ref().map(|entry| entry[lane]);
        let mut hessian = StageMatrix {
            first: SMatrix::<f64, 2, 2>::new(a, b, b, e),
            mixed: SMatrix::<f64, 2, 2>::new(c, d, f, g),
            second: SMatrix::<f64, 2, 2>::new(h, i, i, j),
        };
        if let Some(curl) = &self.curl[lane] {
            hessian.first += curl.hessian.fixed_view::<2, 2>(0, 0);
            hessian.mixed += curl.hessian.fixed_view::<2, 2>(0, 2);
            hessian.second += curl.hessian.fixed_view::<2, 2>(2, 2);
        }
        hessian
    }

    fn carry<const N: usize>(&self, lane: usize, stage: &mut Stage<2, N>) {
        let Output { growth, mixed, .. } = &self.output;
        for (column, (growth, mixed)) in growth.iter().zip(mixed).enumerate() {
            let [into_growth, into_mixed] = match column {
                0 | 1 => [&mut stage.growth_by_first, &mut stage.state_first],
                _ => [&mut stage.growth_by_second, &mut stage.state_second],
            };
            for row in 0..6 {
                into_growth[(row, column % 2)] = growth[row][lane];
                into_mixed[(row, column % 2)] = mixed[row][lane];
            }
        }
    }
}

/// Derivatives of all lanes; the source's energy where `FISHBONE`, else the plate's.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn differentiate<const FISHBONE: bool>(input: &Input, output: &mut Output) {
    let model = match FISHBONE {
        true => DevelopableEnergy::Fishbone,
        false => DevelopableEnergy::Sadowsky,
    };
    let Even { cosine, cubic, .. } = Even::of::<Magnus>(&input.spans);
    for lane in 0..LANES {
        let (cosine, cubic) = (triple(&cosine, 0, lane), triple(&cubic, 0, lane));
        differentiate_lane(model, input, cosine, cubic, lane, output);
    }
}

/// The motions of all lanes.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
pub(in crate::strip) fn find_motions<S: Step>(
    spans: &Spans,
    frame: &mut [Lanes; 9],
    position: &mut [Lanes; 3],
) {
    let even = Even::of::<S>(spans);
    for lane in 0..LANES {
        let step = S::at(spans, lane);
        let (phi, rho) = (step.rotation(), step.chord().translation());
        let [s, c, q] = [even.sine[lane], even.cosine[0][lane], even.cubic[0][lane]];
        let (square, along) = (dot(phi, phi), dot(phi, rho));
        let turned = cross(phi, rho);
        for i in 0..3 {
            position[i][lane] = (1.0 - q * square) * rho[i] + c * turned[i] + q * along * phi[i];
        }
        let [x, y, z] = phi;
        let plain = 1.0 - c * square;
        let columns = [
            [plain + c * x * x, c * x * y + s * z, c * x * z - s * y],
            [c * x * y - s * z, plain + c * y * y, c * y * z + s * x],
            [c * x * z + s * y, c * y * z - s * x, plain + c * z * z],
        ];
        for i in 0..3 {
            frame[i][lane] = columns[0][i];
            frame[3 + i][lane] = columns[1][i];
            frame[6 + i][lane] = columns[2][i];
        }
    }
}

/// The even functions of the rotation of every lane, and their derivatives: [`Coefficients`].
pub(in crate::strip) struct Even {
    sine: Lanes,
    pub(in crate::strip) cosine: [Lanes; 3],
    pub(in crate::strip) cubic: [Lanes; 3],
}

impl Even {
    #[inline(always)]
    pub(in crate::strip) fn of<S: Step>(spans: &Spans) -> Self {
        let mut even = Self {
            sine: NOTHING,
            cosine: [NOTHING; 3],
            cubic: [NOTHING; 3],
        };
        let mut square = NOTHING;
        for (lane, square) in square.iter_mut().enumerate() {
            let rotation = S::at(spans, lane).rotation();
            *square = dot(rotation, rotation);
            even.put(lane, &Coefficients::near(*square));
        }
        // The test has its own loop: a loop that carries a value from lane to lane is not vectorised.
        let mut is_wide = false;
        for square in square {
            is_wide |= square > 1.0;
        }
        if is_wide {
            even.put_exact::<S>(spans);
        }
        even
    }

    #[inline(always)]
    fn put(&mut self, lane: usize, coefficients: &Coefficients) {
        self.sine[lane] = coefficients.sine[0];
        for i in 0..3 {
            self.cosine[i][lane] = coefficients.cosine[i];
            self.cubic[i][lane] = coefficients.cubic[i];
        }
    }

    /// The even functions of lanes whose rotations are too wide for the series.
    #[cold]
    #[inline(never)]
    fn put_exact<S: Step>(&mut self, spans: &Spans) {
        for lane in 0..LANES {
            let rotation = S::at(spans, lane).rotation();
            self.put(lane, &Coefficients::at(dot(rotation, rotation)));
        }
    }
}
