//! Derivatives of elements, several at a time: the same arithmetic in every lane of a vector.
//!
//! A motion M(w) by the four unknowns w has the derivatives of the twist X in `M(w + dw) = exp(X) M(w)`. Seen from the
//! world, about its origin, the twists of elements that follow each other add up: to first order as they are, to second
//! order with half their bracket. What acts on the belt beyond is one wrench about the origin, the same for all elements
//! between two points where something acts.

use crate::geometry::{Coefficients, Pose, gauss_points};
use crate::strip::density::{self, LANES, Loaded};
use crate::strip::developable::{EnergyModel, Term};
use crate::strip::element::{Element, Jet};
use multiversion::multiversion;
use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3, Vector4};
use stagewise::{Stage, StageMatrix};

/// One number for every element of a block.
type Lanes = [f64; LANES];
type Triple = [f64; 3];
/// The upper triangle of a symmetric 4×4 matrix by rows.
type Upper = [f64; 10];

/// What the motions along a block of elements depend on.
#[derive(Debug, Clone)]
struct Spans {
    /// bend₀, slope₀, bend₁, slope₁.
    fields: [Lanes; 4],
    length: Lanes,
    geodesic: Lanes,
}

/// What the derivatives of a block of elements depend on.
#[derive(Debug, Clone)]
struct Input {
    spans: Spans,
    rigidity: [Lanes; 2],
    /// What the width makes of the energy: value, gradient and Hessian (upper triangle) by slope₀ and slope₁.
    across: [Lanes; 6],
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
    /// Their Hessian, upper triangle by rows.
    hessian: [Lanes; 10],
}

/// A block of elements, their derivatives once they have been found.
#[derive(Debug, Clone)]
pub struct Block {
    input: Input,
    output: Output,
    /// What the natural bend adds, where an element has one.
    curl: [Option<Jet>; LANES],
}

const NOTHING: Lanes = [0.0; LANES];

impl Spans {
    /// Elements of no length, which do no harm where a block is not full.
    const NONE: Self = Self {
        fields: [NOTHING; 4],
        length: NOTHING,
        geodesic: NOTHING,
    };

    fn set(&mut self, lane: usize, element: &Element, fields: &Vector4<f64>) {
        for (lanes, field) in self.fields.iter_mut().zip(fields) {
            lanes[lane] = *field;
        }
        (self.length[lane], self.geodesic[lane]) = (element.length, element.geodesic);
    }
}

/// The motions along a block of elements.
#[derive(Debug, Clone)]
pub struct Motions {
    spans: Spans,
    /// Frames, column by column.
    frame: [Lanes; 9],
    position: [Lanes; 3],
}

impl Default for Motions {
    /// Those along elements of no length.
    fn default() -> Self {
        Self {
            spans: Spans::NONE,
            frame: [NOTHING; 9],
            position: [NOTHING; 3],
        }
    }
}

impl density::Motions<EnergyModel, 2> for Motions {
    fn set(&mut self, lane: usize, element: &Element, [a, b]: [&Vector2<f64>; 2]) {
        let fields = Vector4::new(a[0], a[1], b[0], b[1]);
        self.spans.set(lane, element, &fields);
    }

    fn find(&mut self, _: &EnergyModel) {
        find_motions(&self.spans, &mut self.frame, &mut self.position);
    }

    fn at(&self, lane: usize) -> Pose {
        let [x, y, z] = triple(&self.position, 0, lane);
        Pose {
            frame: Matrix3::from_iterator(self.frame.iter().map(|entry| entry[lane])),
            position: Vector3::new(x, y, z),
        }
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
                frame: [NOTHING; 9],
                position: [NOTHING; 3],
                next: [NOTHING; 3],
                wrench: [NOTHING; 6],
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

impl density::Derivatives<EnergyModel, 2> for Block {
    fn set(&mut self, lane: usize, model: &EnergyModel, loaded: &Loaded<'_, 2>) {
        let Loaded {
            element,
            fields: [a, b],
            poses: [first, second],
            wrench,
        } = loaded;
        let fields = Vector4::new(a[0], a[1], b[0], b[1]);
        let across = element.across_jets(*model, &fields);
        self.curl[lane] =
            (element.curl.bend != 0.0).then(|| element.curl_jet(*model, &fields, &across));
        let into = &mut self.input;
        let put = |lanes: &mut [Lanes], values: &[f64]| {
            for (lanes, value) in lanes.iter_mut().zip(values) {
                lanes[lane] = *value;
            }
        };
        into.spans.set(lane, element, &fields);
        put(&mut into.rigidity, &element.rigidity);
        put(&mut into.frame, first.frame.as_slice());
        put(&mut into.position, first.position.as_slice());
        put(&mut into.next, second.position.as_slice());
        put(&mut into.wrench, wrench.as_slice());
        let across = &across.bending;
        let (gradient, hessian) = (&across.gradient, &across.hessian);
        put(&mut into.across, &[across.value, gradient[0], gradient[1]]);
        put(
            &mut into.across[3..],
            &[hessian.m11, hessian.m12, hessian.m22],
        );
    }

    fn find(&mut self, model: &EnergyModel) {
        match model {
            EnergyModel::Fishbone => differentiate::<true>(&self.input, &mut self.output),
            EnergyModel::Sadowsky | EnergyModel::Wunderlich => {
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
        true => EnergyModel::Fishbone,
        false => EnergyModel::Sadowsky,
    };
    let Even { cosine, cubic, .. } = Even::of(&input.spans);
    for lane in 0..LANES {
        let (cosine, cubic) = (triple(&cosine, 0, lane), triple(&cubic, 0, lane));
        differentiate_lane(model, input, cosine, cubic, lane, output);
    }
}

/// The motions of all lanes.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn find_motions(spans: &Spans, frame: &mut [Lanes; 9], position: &mut [Lanes; 3]) {
    let even = Even::of(spans);
    for lane in 0..LANES {
        let step = Magnus::at(spans, lane);
        let (phi, rho) = (step.rotation, step.translation);
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
struct Even {
    sine: Lanes,
    cosine: [Lanes; 3],
    cubic: [Lanes; 3],
}

impl Even {
    #[inline(always)]
    fn of(spans: &Spans) -> Self {
        let mut even = Self {
            sine: NOTHING,
            cosine: [NOTHING; 3],
            cubic: [NOTHING; 3],
        };
        let mut square = NOTHING;
        for (lane, square) in square.iter_mut().enumerate() {
            let rotation = Magnus::at(spans, lane).rotation;
            *square = dot(rotation, rotation);
            even.put(lane, &Coefficients::near(*square));
        }
        // Asked in a loop of its own: a loop that carries something from lane to lane is not vectorised.
        let mut is_wide = false;
        for square in square {
            is_wide |= square > 1.0;
        }
        if is_wide {
            even.put_exact(spans);
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

    /// The same where rotations are too wide for the series.
    #[cold]
    #[inline(never)]
    fn put_exact(&mut self, spans: &Spans) {
        for lane in 0..LANES {
            let rotation = Magnus::at(spans, lane).rotation;
            self.put(lane, &Coefficients::at(dot(rotation, rotation)));
        }
    }
}

/// The Magnus step of an element and what its derivatives are made of: the fields at the Gauss points, the weights of the
/// sum and of the commutator.
#[derive(Clone, Copy)]
struct Magnus {
    rotation: Triple,
    translation: Triple,
    bend: [f64; 2],
    slope: [f64; 2],
    geodesic: f64,
    half: f64,
    weight: f64,
}

impl Magnus {
    #[inline(always)]
    fn at(spans: &Spans, lane: usize) -> Self {
        let [less, more] = gauss_points();
        let [b0, s0, b1, s1] = [
            spans.fields[0][lane],
            spans.fields[1][lane],
            spans.fields[2][lane],
            spans.fields[3][lane],
        ];
        let bend = [more * b0 + less * b1, less * b0 + more * b1];
        let slope = [more * s0 + less * s1, less * s0 + more * s1];
        let (h, geodesic) = (spans.length[lane], spans.geodesic[lane]);
        let (half, weight) = (0.5 * h, COMMUTATOR * h * h);
        let [torsion_1, torsion_2] = [-slope[0] * bend[0], -slope[1] * bend[1]];
        Self {
            rotation: [
                h * geodesic + weight * bend[0] * bend[1] * (slope[1] - slope[0]),
                half * (torsion_1 + torsion_2) + weight * geodesic * (bend[0] - bend[1]),
                half * (bend[0] + bend[1]) + weight * geodesic * (torsion_2 - torsion_1),
            ],
            translation: [weight * (bend[1] - bend[0]), h, 0.0],
            bend,
            slope,
            geodesic,
            half,
            weight,
        }
    }

    /// Derivatives of the rotation by (bend, slope) at the first Gauss point, then at the second.
    #[inline(always)]
    fn rotation_by_gauss(&self) -> [Triple; 4] {
        let ([b1, b2], [s1, s2]) = (self.bend, self.slope);
        let (half, w, geodesic) = (self.half, self.weight, self.weight * self.geodesic);
        [
            [
                w * b2 * (s2 - s1),
                geodesic - half * s1,
                half + geodesic * s1,
            ],
            [-w * b1 * b2, -half * b1, geodesic * b1],
            [
                w * b1 * (s2 - s1),
                -half * s2 - geodesic,
                half - geodesic * s2,
            ],
            [w * b1 * b2, -half * b2, -geodesic * b2],
        ]
    }

    /// Derivatives of the translation, which is along ξ, by the same.
    #[inline(always)]
    fn translation_by_gauss(&self) -> [f64; 4] {
        [-self.weight, 0.0, self.weight, 0.0]
    }

    /// Second derivatives of `by_rotation · rotation`.
    #[inline(always)]
    fn second_derivatives(&self, by_rotation: Triple) -> Upper {
        let ([b1, b2], [s1, s2]) = (self.bend, self.slope);
        let x = by_rotation[0] * self.weight;
        let y = by_rotation[1] * self.half;
        let z = by_rotation[2] * self.weight * self.geodesic;
        let bends = x * (s2 - s1);
        let [own_1, own_2] = [z - y - x * b2, x * b1 - y - z];
        [
            0.0,
            own_1,
            bends,
            x * b2,
            0.0,
            -x * b1,
            0.0,
            0.0,
            own_2,
            0.0,
        ]
    }
}

/// Weight of the commutator in the Magnus step, of the square of its length.
const COMMUTATOR: f64 = 0.144_337_567_297_406_43;

/// Derivatives of one lane, from the even functions of its rotation.
#[inline(always)]
fn differentiate_lane(
    model: EnergyModel,
    input: &Input,
    cosine: Triple,
    cubic: Triple,
    lane: usize,
    output: &mut Output,
) {
    let step = Magnus::at(&input.spans, lane);
    let frame = three(|i| triple(&input.frame, 3 * i, lane));
    let position = triple(&input.position, 0, lane);
    let next = triple(&input.next, 0, lane);
    let force_in_world = triple(&input.wrench, 0, lane);
    let moment_in_world = triple(&input.wrench, 3, lane);
    // In the axes of the first node's frame; the moment is that about the second node.
    let force = seen_from(&frame, force_in_world);
    let moment = seen_from(&frame, minus(moment_in_world, cross(next, force_in_world)));
    let motion = seen_from(&frame, minus(next, position));

    let twists = Twists::of(&step, cosine, cubic);
    let (gradient, work) = work(&step, &twists, cosine, cubic, force, moment);
    let rigidity = [input.rigidity[0][lane], input.rigidity[1][lane]];
    let energy = bending(model, &step, rigidity);
    let [factor, rise_0, rise_1] = triple(&input.across, 0, lane);
    let bent = triple(&input.across, 3, lane);
    let [[a, b, c], [d, e, f]] = energy.hessian;
    let own = [a, b, 0.0, 0.0, c, 0.0, 0.0, d, e, f];
    let hessian = quadratic_by_nodes(&upper(|i, j| {
        entry(&work, i, j) + factor * entry(&own, i, j)
    }));
    let by_energy = by_nodes(energy.gradient);
    let by_work = by_nodes(gradient);
    let by_width = [0.0, rise_0, 0.0, rise_1];
    let width = [0.0, 0.0, 0.0, 0.0, bent[0], 0.0, bent[1], 0.0, 0.0, bent[2]];
    let hessian = upper(|i, j| {
        entry(&hessian, i, j)
            + by_energy[i] * by_width[j]
            + by_width[i] * by_energy[j]
            + energy.value * entry(&width, i, j)
    });
    for i in 0..4 {
        output.gradient[i][lane] = by_work[i] + factor * by_energy[i] + energy.value * by_width[i];
    }
    for (into, value) in output.hessian.iter_mut().zip(hessian) {
        into[lane] = value;
    }

    let turns = triples_by_nodes(&twists.rotation);
    let shifts = triples_by_nodes(&twists.displacement);
    let place = Place {
        frame,
        position,
        motion,
        force: force_in_world,
        moment: moment_in_world,
    };
    // A loop over these would be taken for the one to run in lanes.
    place.carry(
        turns[0],
        shifts[0],
        lane,
        &mut output.growth[0],
        &mut output.mixed[0],
    );
    place.carry(
        turns[1],
        shifts[1],
        lane,
        &mut output.growth[1],
        &mut output.mixed[1],
    );
    place.carry(
        turns[2],
        shifts[2],
        lane,
        &mut output.growth[2],
        &mut output.mixed[2],
    );
    place.carry(
        turns[3],
        shifts[3],
        lane,
        &mut output.growth[3],
        &mut output.mixed[3],
    );
}

/// Where an element is, how far it leads, and the wrench beyond it about the origin.
struct Place {
    frame: [Triple; 3],
    position: Triple,
    motion: Triple,
    force: Triple,
    moment: Triple,
}

impl Place {
    /// The twist by one field, from its turn and shift seen from the first node, and half its bracket with any other in the
    /// wrench's work.
    #[inline(always)]
    fn carry(
        &self,
        turn: Triple,
        shift: Triple,
        lane: usize,
        growth: &mut [Lanes; 6],
        mixed: &mut [Lanes; 6],
    ) {
        let at_first = in_world(&self.frame, minus(shift, cross(turn, self.motion)));
        let turn = in_world(&self.frame, turn);
        let shift = plus(at_first, cross(self.position, turn));
        let by_shift = cross(turn, self.force);
        let by_turn = plus(cross(shift, self.force), cross(turn, self.moment));
        for i in 0..3 {
            growth[i][lane] = shift[i];
            growth[3 + i][lane] = turn[i];
            mixed[i][lane] = 0.5 * by_shift[i];
            mixed[3 + i][lane] = 0.5 * by_turn[i];
        }
    }
}

/// Derivatives of the motion by the fields at the Gauss points: rotation from the left, and displacement.
struct Twists {
    step: [Triple; 4],
    rotation: [Triple; 4],
    displacement: [Triple; 4],
    /// Along the step's rotation and translation.
    along: [f64; 4],
    along_translation: [f64; 4],
}

impl Twists {
    #[inline(always)]
    fn of(step: &Magnus, cosine: Triple, cubic: Triple) -> Self {
        let (phi, rho) = (step.rotation, step.translation);
        let plain = 1.0 - cubic[0] * dot(phi, phi);
        let once = cross(phi, rho);
        let twice = cross(phi, once);
        let lead = three(|i| 2.0 * (cosine[1] * once[i] + cubic[1] * twice[i] - cubic[0] * rho[i]));
        let across = cubic[0] * dot(phi, rho);
        let by_shift = [
            plain + cubic[0] * phi[0] * phi[0],
            cosine[0] * phi[2] + cubic[0] * phi[0] * phi[1],
            cubic[0] * phi[0] * phi[2] - cosine[0] * phi[1],
        ];
        let steps = step.rotation_by_gauss();
        let shifts = step.translation_by_gauss();
        let along = four(|j| dot(phi, steps[j]));
        let along_translation = four(|j| dot(rho, steps[j]));
        let rotation = four(|j| {
            let turned = cross(phi, steps[j]);
            three(|i| plain * steps[j][i] + cosine[0] * turned[i] + cubic[0] * along[j] * phi[i])
        });
        let displacement = four(|j| {
            let turned = cross(steps[j], rho);
            three(|i| {
                lead[i] * along[j]
                    + cosine[0] * turned[i]
                    + across * steps[j][i]
                    + cubic[0] * along_translation[j] * phi[i]
                    + by_shift[i] * shifts[j]
            })
        });
        Self {
            step: steps,
            rotation,
            displacement,
            along,
            along_translation,
        }
    }
}

/// Gradient of the work, and second derivative of `force` and `moment` on the twist of the motion, by the fields at the
/// Gauss points (upper triangle).
#[inline(always)]
fn work(
    step: &Magnus,
    twists: &Twists,
    cosine: Triple,
    cubic: Triple,
    force: Triple,
    moment: Triple,
) -> ([f64; 4], Upper) {
    let (phi, rho) = (step.rotation, step.translation);
    let square = dot(phi, phi);
    let (phi_force, phi_rho) = (dot(phi, force), dot(phi, rho));
    let force_rho = dot(force, rho);
    // The displacement V(φ) ρ, V = I + c [φ]× + q [φ]×², bends with φ as φ·linear and φ·form·φ do.
    let linear = cross(rho, force);
    let image = three(|i| 0.5 * (force[i] * phi_rho + rho[i] * phi_force) - force_rho * phi[i]);
    let (first, second) = (dot(phi, linear), dot(phi, image));
    let once = cross(phi, moment);
    let twice = cross(phi, once);
    let twofold = 2.0 * (cosine[2] * first + cubic[2] * second);
    let isotropic = 2.0 * (cosine[1] * first + cubic[1] * second) - 2.0 * cubic[0] * force_rho
        + cubic[0] * dot(phi, moment);
    let slope = three(|i| {
        2.0 * (cosine[1] * linear[i] + 2.0 * cubic[1] * image[i]) + cubic[1] * twice[i]
            - cosine[1] * once[i]
            - 0.5 * cubic[0] * moment[i]
    });
    // By the translation along ξ, and by that and φ.
    let force_once = cross(phi, force);
    let force_twice = cross(phi, force_once);
    let lead = 2.0 * (cubic[1] * force_twice[0] - cosine[1] * force_once[0] - cubic[0] * force[0]);
    let steps = &twists.step;
    let shifts = step.translation_by_gauss();
    let along_force = four(|j| dot(force, steps[j]));
    let bent = four(|j| twofold * twists.along[j] + dot(slope, steps[j]));
    let mixed = four(|j| {
        let a = steps[j];
        lead * twists.along[j]
            + cosine[0] * (force[1] * a[2] - force[2] * a[1])
            + cubic[0] * (phi_force * a[0] + phi[0] * along_force[j])
    });
    let lever = four(|j| cross(force, twists.rotation[j]));
    let plain = 1.0 - cubic[0] * square;
    let shift_once = cross(phi, rho);
    let shift_twice = cross(phi, shift_once);
    let by_axis = 2.0
        * (cosine[1] * dot(shift_once, force) + cubic[1] * dot(shift_twice, force)
            - cubic[0] * force_rho)
        + cubic[0] * dot(phi, moment);
    let by_rotation = three(|i| {
        by_axis * phi[i]
            + cosine[0] * (linear[i] - once[i])
            + cubic[0] * (phi_rho * force[i] + phi_force * rho[i])
            + plain * moment[i]
    });
    let own = step.second_derivatives(by_rotation);
    let along = &twists.along;
    let along_translation = &twists.along_translation;
    let both = upper(|i, j| {
        let correction =
            dot(lever[i], twists.displacement[j]) + dot(lever[j], twists.displacement[i]);
        isotropic * dot(steps[i], steps[j])
            + along[i] * bent[j]
            + along[j] * bent[i]
            + cubic[0]
                * (along_force[i] * along_translation[j] + along_force[j] * along_translation[i])
            + shifts[i] * mixed[j]
            + shifts[j] * mixed[i]
            - 0.5 * correction
    });
    let gradient = four(|j| dot(force, twists.displacement[j]) + dot(moment, twists.rotation[j]));
    (
        gradient,
        upper(|i, j| entry(&own, i, j) + entry(&both, i, j)),
    )
}

/// Bending energy before the width's factor, with derivatives by the fields at the Gauss points: the Hessian as
/// (bend, bend), (bend, slope), (slope, slope) at either.
struct Bending {
    value: f64,
    gradient: [f64; 4],
    hessian: [Triple; 2],
}

#[inline(always)]
fn bending(model: EnergyModel, step: &Magnus, rigidity: [f64; 2]) -> Bending {
    let at = |i: usize| {
        let weight = step.half * rigidity[i];
        let Term {
            value,
            gradient: g,
            hessian: h,
        } = model.bending(step.bend[i], step.slope[i]);
        (
            weight * value,
            [weight * g.x, weight * g.y],
            [weight * h.m11, weight * h.m12, weight * h.m22],
        )
    };
    let (first, [a, b], hessian_1) = at(0);
    let (second, [c, d], hessian_2) = at(1);
    Bending {
        value: first + second,
        gradient: [a, b, c, d],
        hessian: [hessian_1, hessian_2],
    }
}

/// From derivatives by the fields at the Gauss points to those at the nodes.
#[inline(always)]
fn by_nodes([b1, s1, b2, s2]: [f64; 4]) -> [f64; 4] {
    let [less, more] = gauss_points();
    [
        more * b1 + less * b2,
        more * s1 + less * s2,
        less * b1 + more * b2,
        less * s1 + more * s2,
    ]
}

#[inline(always)]
fn triples_by_nodes(by_gauss: &[Triple; 4]) -> [Triple; 4] {
    let [x, y, z] = three(|i| by_nodes(four(|j| by_gauss[j][i])));
    four(|j| [x[j], y[j], z[j]])
}

/// The same for a Hessian.
#[inline(always)]
fn quadratic_by_nodes(by_gauss: &Upper) -> Upper {
    let columns = four(|j| by_nodes(four(|i| entry(by_gauss, i, j))));
    let rows = four(|i| by_nodes(four(|j| columns[j][i])));
    upper(|i, j| rows[i][j])
}

/// An entry of a symmetric matrix.
#[inline(always)]
fn entry(matrix: &Upper, i: usize, j: usize) -> f64 {
    const AT: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]];
    matrix[AT[i][j]]
}

/// An array by index, written out: `array::map` is not inlined into code for other targets.
#[inline(always)]
fn three<T>(at: impl Fn(usize) -> T) -> [T; 3] {
    [at(0), at(1), at(2)]
}

/// The upper triangle of a 4×4 matrix by rows.
#[inline(always)]
fn upper(at: impl Fn(usize, usize) -> f64) -> Upper {
    let (a, b) = (four(|j| at(0, j)), three(|j| at(1, 1 + j)));
    let [c, d] = [at(2, 2), at(2, 3)];
    [a[0], a[1], a[2], a[3], b[0], b[1], b[2], c, d, at(3, 3)]
}

#[inline(always)]
fn four<T>(at: impl Fn(usize) -> T) -> [T; 4] {
    [at(0), at(1), at(2), at(3)]
}

#[inline(always)]
fn triple(lanes: &[Lanes], from: usize, lane: usize) -> Triple {
    [
        lanes[from][lane],
        lanes[from + 1][lane],
        lanes[from + 2][lane],
    ]
}

#[inline(always)]
fn dot(a: Triple, b: Triple) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: Triple, b: Triple) -> Triple {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline(always)]
fn plus(a: Triple, b: Triple) -> Triple {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
fn minus(a: Triple, b: Triple) -> Triple {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// A vector of the world, in the axes of a frame.
#[inline(always)]
fn seen_from(frame: &[Triple; 3], a: Triple) -> Triple {
    [dot(frame[0], a), dot(frame[1], a), dot(frame[2], a)]
}

/// The inverse of that.
#[inline(always)]
fn in_world(frame: &[Triple; 3], a: Triple) -> Triple {
    three(|i| frame[0][i] * a[0] + frame[1][i] * a[1] + frame[2][i] * a[2])
}
