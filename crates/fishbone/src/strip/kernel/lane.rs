//! The derivatives of one lane.

use super::arithmetic::{
    cross, dot, entry, four, in_world, minus, plus, seen_from, three, triple, upper,
};
use super::{Input, Lanes, Output, Spans, Surroundings, Triple, Upper};
use crate::geometry::{SHORTENING, gauss_points};
use crate::strip::developable::{DevelopableEnergy, Term};

/// The Magnus step of an element with the derivatives of its rotation and translation by four fields at the Gauss points: the
/// bend and one more at the first, then at the second.
pub(in crate::strip) trait Step: Copy {
    /// The step of a lane's element.
    fn at(spans: &Spans, lane: usize) -> Self;

    /// Rotation of the step.
    fn rotation(&self) -> Triple;

    /// Chord of the step.
    fn chord(&self) -> &Chord;

    /// Derivatives of the rotation by the four fields.
    fn rotation_by_gauss(&self) -> [Triple; 4];

    /// Second derivatives of `by_rotation · rotation`.
    fn second_derivatives(&self, by_rotation: Triple) -> Upper;
}

/// The translation of a Magnus step, by the rise of the bend from the first Gauss point to the second.
#[derive(Clone, Copy)]
pub(in crate::strip) struct Chord {
    length: f64,
    rise: f64,
    /// Weight of the commutator.
    pub(in crate::strip) weight: f64,
    shortening: f64,
}

impl Chord {
    #[inline(always)]
    pub(in crate::strip) fn of(length: f64, bend: [f64; 2]) -> Self {
        Self {
            length,
            rise: bend[1] - bend[0],
            weight: COMMUTATOR * length * length,
            shortening: SHORTENING * length * length * length,
        }
    }

    #[inline(always)]
    pub(in crate::strip) fn translation(&self) -> Triple {
        let along = self.length - self.shortening * self.rise * self.rise;
        [self.weight * self.rise, along, 0.0]
    }

    /// Derivative of the translation by the bend at the second Gauss point; that by the bend at the first is the opposite,
    /// and the other fields do not change it.
    #[inline(always)]
    fn by_rise(&self) -> Triple {
        [self.weight, -2.0 * self.shortening * self.rise, 0.0]
    }

    /// Second derivative along η of the translation by the bend at the second Gauss point.
    #[inline(always)]
    fn by_rise_twice(&self) -> f64 {
        -2.0 * self.shortening
    }
}

/// The Magnus step of a developable element, by bend and rib slope, with the parts of its derivatives: the fields at the
/// Gauss points and the weight of the sum.
#[derive(Clone, Copy)]
pub(super) struct Magnus {
    rotation: Triple,
    chord: Chord,
    bend: [f64; 2],
    slope: [f64; 2],
    geodesic: f64,
    half: f64,
}

impl Step for Magnus {
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
        let (half, chord) = (0.5 * h, Chord::of(h, bend));
        let weight = chord.weight;
        let [torsion_1, torsion_2] = [-slope[0] * bend[0], -slope[1] * bend[1]];
        Self {
            rotation: [
                h * geodesic + weight * bend[0] * bend[1] * (slope[1] - slope[0]),
                half * (torsion_1 + torsion_2) + weight * geodesic * (bend[0] - bend[1]),
                half * (bend[0] + bend[1]) + weight * geodesic * (torsion_2 - torsion_1),
            ],
            chord,
            bend,
            slope,
            geodesic,
            half,
        }
    }

    #[inline(always)]
    fn rotation(&self) -> Triple {
        self.rotation
    }

    #[inline(always)]
    fn chord(&self) -> &Chord {
        &self.chord
    }

    #[inline(always)]
    fn rotation_by_gauss(&self) -> [Triple; 4] {
        let ([b1, b2], [s1, s2]) = (self.bend, self.slope);
        let (half, w, geodesic) = (
            self.half,
            self.chord.weight,
            self.chord.weight * self.geodesic,
        );
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

    #[inline(always)]
    fn second_derivatives(&self, by_rotation: Triple) -> Upper {
        let ([b1, b2], [s1, s2]) = (self.bend, self.slope);
        let x = by_rotation[0] * self.chord.weight;
        let y = by_rotation[1] * self.half;
        let z = by_rotation[2] * self.chord.weight * self.geodesic;
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

/// Weight √3/12 of the commutator in the Magnus step, per square of the step's length, dimensionless.
const COMMUTATOR: f64 = 0.144_337_567_297_406_43;

/// Derivative of the rise of the bend, between the Gauss points, by (bend, slope) at the first, then at the second.
const RISE_BY_GAUSS: [f64; 4] = [-1.0, 0.0, 1.0, 0.0];

/// Derivatives of one lane, from the even functions of its rotation.
#[inline(always)]
pub(super) fn differentiate_lane(
    model: DevelopableEnergy,
    input: &Input,
    cosine: Triple,
    cubic: Triple,
    lane: usize,
    output: &mut Output,
) {
    let step = Magnus::at(&input.spans, lane);
    let Motion {
        twists,
        gradient,
        work,
        place,
    } = Motion::at(&step, &input.surroundings, cosine, cubic, lane);
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
    // Written out: the vectoriser would take a loop over the four columns for the loop over lanes.
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

/// The motion along an element with its derivatives by the fields at the Gauss points.
pub(in crate::strip) struct Motion {
    pub(in crate::strip) twists: Twists,
    /// Gradient of the work of all loads and supports beyond the element.
    pub(in crate::strip) gradient: [f64; 4],
    /// Second derivative of that work, upper triangle.
    pub(in crate::strip) work: Upper,
    pub(in crate::strip) place: Place,
}

impl Motion {
    /// The motion along a lane's step, from the even functions of its rotation.
    #[inline(always)]
    pub(in crate::strip) fn at<S: Step>(
        step: &S,
        surroundings: &Surroundings,
        cosine: Triple,
        cubic: Triple,
        lane: usize,
    ) -> Self {
        let frame = three(|i| triple(&surroundings.frame, 3 * i, lane));
        let position = triple(&surroundings.position, 0, lane);
        let next = triple(&surroundings.next, 0, lane);
        let force_in_world = triple(&surroundings.wrench, 0, lane);
        let moment_in_world = triple(&surroundings.wrench, 3, lane);
        // In the axes of the first node's frame; the moment is that about the second node.
        let force = seen_from(&frame, force_in_world);
        let moment = seen_from(&frame, minus(moment_in_world, cross(next, force_in_world)));
        let motion = seen_from(&frame, minus(next, position));
        let twists = Twists::of(step, cosine, cubic);
        let (gradient, work) = work(step, &twists, cosine, cubic, force, moment);
        Self {
            twists,
            gradient,
            work,
            place: Place {
                frame,
                position,
                motion,
                force: force_in_world,
                moment: moment_in_world,
            },
        }
    }
}

/// The place of an element: its first node's frame and position, the motion along it, the wrench beyond it about the origin.
pub(in crate::strip) struct Place {
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
    pub(in crate::strip) fn carry(
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
pub(in crate::strip) struct Twists {
    step: [Triple; 4],
    pub(in crate::strip) rotation: [Triple; 4],
    pub(in crate::strip) displacement: [Triple; 4],
    /// Along the step's rotation and translation.
    along: [f64; 4],
    along_translation: [f64; 4],
}

impl Twists {
    #[inline(always)]
    fn of<S: Step>(step: &S, cosine: Triple, cubic: Triple) -> Self {
        let (phi, rho) = (step.rotation(), step.chord().translation());
        let plain = 1.0 - cubic[0] * dot(phi, phi);
        let once = cross(phi, rho);
        let twice = cross(phi, once);
        let lead = three(|i| 2.0 * (cosine[1] * once[i] + cubic[1] * twice[i] - cubic[0] * rho[i]));
        let across = cubic[0] * dot(phi, rho);
        let shift = step.chord().by_rise();
        let (turned, along_shift) = (cross(phi, shift), cubic[0] * dot(phi, shift));
        let by_rise = three(|i| plain * shift[i] + cosine[0] * turned[i] + along_shift * phi[i]);
        let steps = step.rotation_by_gauss();
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
                    + by_rise[i] * RISE_BY_GAUSS[j]
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
fn work<S: Step>(
    step: &S,
    twists: &Twists,
    cosine: Triple,
    cubic: Triple,
    force: Triple,
    moment: Triple,
) -> ([f64; 4], Upper) {
    let (phi, rho) = (step.rotation(), step.chord().translation());
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
    // Second derivatives by the rise, of which only the translation depends, and the rotation φ.
    let shift = step.chord().by_rise();
    let force_once = cross(phi, force);
    let force_twice = cross(phi, force_once);
    let lead = 2.0
        * (cubic[1] * dot(force_twice, shift)
            - cosine[1] * dot(force_once, shift)
            - cubic[0] * dot(force, shift));
    let (arm, along_shift) = (cross(shift, force), dot(phi, shift));
    let steps = &twists.step;
    let along_force = four(|j| dot(force, steps[j]));
    let bent = four(|j| twofold * twists.along[j] + dot(slope, steps[j]));
    let mixed = four(|j| {
        lead * twists.along[j]
            + cosine[0] * dot(arm, steps[j])
            + cubic[0] * (phi_force * dot(shift, steps[j]) + along_shift * along_force[j])
    });
    let by_rise_twice = step.chord().by_rise_twice()
        * (force[1] - cosine[0] * force_once[1] + cubic[0] * force_twice[1]);
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
            + RISE_BY_GAUSS[i] * mixed[j]
            + RISE_BY_GAUSS[j] * mixed[i]
            + RISE_BY_GAUSS[i] * RISE_BY_GAUSS[j] * by_rise_twice
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
fn bending(model: DevelopableEnergy, step: &Magnus, rigidity: [f64; 2]) -> Bending {
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

/// Derivatives by the fields at the nodes, from derivatives by the fields at the Gauss points.
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

/// A Hessian by the fields at the nodes, from one by the fields at the Gauss points.
#[inline(always)]
fn quadratic_by_nodes(by_gauss: &Upper) -> Upper {
    let columns = four(|j| by_nodes(four(|i| entry(by_gauss, i, j))));
    let rows = four(|i| by_nodes(four(|j| columns[j][i])));
    upper(|i, j| rows[i][j])
}
