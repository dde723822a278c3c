//! One element of the belt: pose increment and energy, from the same two Gauss points, with derivatives.
//!
//! An element joins two nodes; its four unknowns are `(bend₀, slope₀, bend₁, slope₁)`, linear in between. Were pose
//! and energy taken at different points, a node-to-node zigzag of the unknowns would cost one of them nothing.

use crate::energy::{Curl, EnergyModel, Term};
use crate::lie::{Coefficients, Pose, Twist, gauss_points, hat, magnus};
use crate::solver::BOUNDS;
use crate::strip::{Across, Edge, FURTHER, SlopeJet, Strips};
use nalgebra::{Matrix2, Matrix2x4, Matrix3, Matrix3x4, Matrix4, Vector3, Vector4};

/// Torsion ω_η = −β ω_ζ.
///
/// Source: Eq. (32)
pub fn torsion(bend: f64, rib_slope: f64) -> f64 {
    -rib_slope * bend
}

/// The twist of the pose per unit u, body axes: along η, and by the rates (κ_g, −β ω_ζ, ω_ζ).
///
/// Source: Eq. (3), (4), (25), (32)
pub fn strain(geodesic: f64, bend: f64, rib_slope: f64) -> Twist {
    Twist {
        translation: Vector3::y(),
        rotation: Vector3::new(geodesic, torsion(bend, rib_slope), bend),
    }
}

/// The motion along a piece of the spine, by a fourth-order Magnus step from the fields at its two ends.
pub fn increment(length: f64, geodesic: f64, fields: &Vector4<f64>) -> Pose {
    let gauss = GaussFields::at(fields);
    Pose::exp(&gauss.step(length, geodesic))
}

/// The data of one element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Element {
    /// Length h along the spine.
    pub length: f64,
    /// In-plane curvature κ_g of the flat board.
    pub geodesic: f64,
    /// Rigidity R_f at the two Gauss points.
    pub rigidity: [f64; 2],
    /// Half the width, V/2.
    pub half_width: f64,
    /// What the element is bent to when nothing acts on it.
    pub curl: Curl,
    /// Edges of the board, besides those of its own stretch, before which its ribs must not cross either.
    pub further: [Option<Edge>; FURTHER],
}

/// An increment with its derivatives by the four unknowns.
#[derive(Debug, Clone, Copy)]
pub struct IncrementJet {
    /// The increment itself.
    pub value: Pose,
    /// Derivative of the displacement, 3×4.
    pub position_by_fields: Matrix3x4<f64>,
    /// Derivative of the rotation as body twist at the second node, 3×4.
    pub rotation_by_fields: Matrix3x4<f64>,
    gauss: GaussFields,
    step: Twist,
    rotation_by_gauss: Matrix3x4<f64>,
    coefficients: Coefficients,
}

/// A function of the four unknowns with its derivatives.
#[derive(Debug, Clone, Copy)]
pub struct Jet {
    /// Value.
    pub value: f64,
    /// Gradient.
    pub gradient: Vector4<f64>,
    /// Hessian.
    pub hessian: Matrix4<f64>,
}

impl Jet {
    fn zero() -> Self {
        Self {
            value: 0.0,
            gradient: Vector4::zeros(),
            hessian: Matrix4::zeros(),
        }
    }

    fn add(&mut self, other: &Self) {
        self.value += other.value;
        self.gradient += other.gradient;
        self.hessian += other.hessian;
    }

    /// Adds a term of the density at parameter t of the element.
    fn add_term(&mut self, weight: f64, term: &Term, t: f64) {
        let inputs = fields_by_nodes(t);
        self.value += weight * term.value;
        self.gradient += weight * inputs.tr_mul(&term.gradient);
        self.hessian += weight * inputs.tr_mul(&(term.hessian * inputs));
    }

    fn times(&self, factor: &Self) -> Self {
        let mixed = self.gradient * factor.gradient.transpose();
        Self {
            value: self.value * factor.value,
            gradient: self.value * factor.gradient + factor.value * self.gradient,
            hessian: self.value * factor.hessian
                + factor.value * self.hessian
                + mixed
                + mixed.transpose(),
        }
    }
}

impl From<SlopeJet> for Jet {
    fn from(jet: SlopeJet) -> Self {
        let (g, h) = (jet.gradient, jet.hessian);
        let mut hessian = Matrix4::zeros();
        for (i, row) in [1, 3].into_iter().enumerate() {
            for (j, column) in [1, 3].into_iter().enumerate() {
                hessian[(row, column)] = h[(i, j)];
            }
        }
        Self {
            value: jet.value,
            gradient: Vector4::new(0.0, g[0], 0.0, g[1]),
            hessian,
        }
    }
}

/// Bend and slope at the two Gauss points.
#[derive(Debug, Clone, Copy)]
struct GaussFields {
    bend: [f64; 2],
    slope: [f64; 2],
}

impl GaussFields {
    fn at(fields: &Vector4<f64>) -> Self {
        let between = |a: f64, b: f64| gauss_points().map(|t| (1.0 - t) * a + t * b);
        Self {
            bend: between(fields[0], fields[2]),
            slope: between(fields[1], fields[3]),
        }
    }

    /// Derivative of (bend₁, slope₁, bend₂, slope₂) at the Gauss points by the nodal unknowns.
    fn by_nodes() -> Matrix4<f64> {
        let [first, second] = gauss_points().map(fields_by_nodes);
        let mut both = Matrix4::zeros();
        both.fixed_rows_mut::<2>(0).copy_from(&first);
        both.fixed_rows_mut::<2>(2).copy_from(&second);
        both
    }

    /// Twists per unit length at the two Gauss points.
    fn strains(&self, geodesic: f64) -> [Twist; 2] {
        [0, 1].map(|i| strain(geodesic, self.bend[i], self.slope[i]))
    }

    /// The Magnus step.
    fn step(&self, length: f64, geodesic: f64) -> Twist {
        let [first, second] = self.strains(geodesic);
        magnus(&first, &second, length)
    }

    /// Derivative of the body rates at Gauss point `i` by the bend and by the slope there.
    fn rates_by_own(&self, i: usize) -> [Vector3<f64>; 2] {
        [
            Vector3::new(0.0, -self.slope[i], 1.0),
            Vector3::new(0.0, -self.bend[i], 0.0),
        ]
    }
}

impl Element {
    /// The strips between its ribs.
    pub fn strips(&self) -> Strips {
        Strips {
            half_width: self.half_width,
            geodesic: self.geodesic,
            length: self.length,
            further: self.further,
        }
    }

    /// How far the ribs are from crossing at the edges, as [`Strips::slacks`]; admissible where positive.
    ///
    /// Source: Eq. (33), extended to curved belts
    pub fn slacks(&self, fields: &Vector4<f64>) -> [f64; BOUNDS] {
        self.strips().slacks([fields[1], fields[3]])
    }

    /// The same with derivatives.
    pub fn slack_jets(&self, fields: &Vector4<f64>) -> [Jet; BOUNDS] {
        self.strips()
            .slack_jets([fields[1], fields[3]])
            .map(Jet::from)
    }

    /// Pose increment by a fourth-order Magnus step.
    pub fn increment(&self, fields: &Vector4<f64>) -> Pose {
        increment(self.length, self.geodesic, fields)
    }

    /// Pose increment with its derivatives.
    pub fn increment_jet(&self, fields: &Vector4<f64>) -> IncrementJet {
        let gauss = GaussFields::at(fields);
        let step = gauss.step(self.length, self.geodesic);
        let (phi, rho) = (&step.rotation, &step.translation);
        let c = Coefficients::at(phi.norm_squared());
        let rotation_by_gauss = self.rotation_by_gauss(&gauss);
        let rotation_by_fields = rotation_by_gauss * GaussFields::by_nodes();
        let jacobian = c.left_jacobian(phi);
        IncrementJet {
            value: Pose {
                position: left_jacobian_times(&c, phi, rho),
                frame: c.exp(phi),
            },
            position_by_fields: left_jacobian_derivative(&c, phi, rho) * rotation_by_fields
                + jacobian * self.translation_by_gauss() * GaussFields::by_nodes(),
            rotation_by_fields: jacobian.tr_mul(&rotation_by_fields),
            gauss,
            step,
            rotation_by_gauss,
            coefficients: c,
        }
    }

    /// Second derivative, by the four unknowns, of `force · displacement + moment · rotation`, where the rotation is
    /// the rotation vector from the present second frame.
    pub fn increment_hessian(
        &self,
        jet: &IncrementJet,
        force: &Vector3<f64>,
        moment: &Vector3<f64>,
    ) -> Matrix4<f64> {
        let (c, phi, rho) = (&jet.coefficients, &jet.step.rotation, &jet.step.translation);
        let by_rotation = left_jacobian_times(c, phi, moment)
            + left_jacobian_derivative(c, phi, rho).transpose() * force;
        let curvature = symmetric_part(&left_jacobian_derivative(c, phi, moment))
            + displacement_curvature(c, phi, rho, force);
        let mixed = -left_jacobian_derivative(c, &-phi, force);
        let jacobian = &jet.rotation_by_gauss;
        let to_nodes = GaussFields::by_nodes();
        let mut hessian = jacobian.transpose() * curvature * jacobian;
        let cross = jacobian.transpose() * mixed.transpose() * self.translation_by_gauss();
        hessian += cross + cross.transpose();
        hessian += self.rotation_hessian(&jet.gauss, &by_rotation);
        to_nodes.transpose() * hessian * to_nodes
    }

    /// Energy, without derivatives.
    pub fn energy(&self, model: EnergyModel, fields: &Vector4<f64>) -> f64 {
        let gauss = GaussFields::at(fields);
        let across = if model.knows_width() {
            self.strips().across([fields[1], fields[3]])
        } else {
            Across::PLAIN
        };
        let at = |i: usize| {
            let density = model.value(gauss.bend[i], gauss.slope[i], &self.curl, &across);
            0.5 * self.length * self.rigidity[i] * density
        };
        at(0) + at(1)
    }

    /// Energy with its derivatives.
    pub fn energy_jet(&self, model: EnergyModel, fields: &Vector4<f64>) -> Jet {
        let gauss = GaussFields::at(fields);
        let bending = self.integral(&gauss, |bend, slope| model.bending(bend, slope));
        let across = model.knows_width().then(|| {
            self.strips()
                .across_jets([fields[1], fields[3]])
                .map(Jet::from)
        });
        let mut sum = match &across {
            Some(across) => bending.times(&across.bending),
            None => bending,
        };
        if self.curl.bend != 0.0 {
            let mixed = self.integral(&gauss, |bend, slope| model.mixed(bend, slope, &self.curl));
            let natural = self.integral(&gauss, |_, slope| model.natural(slope, &self.curl));
            for (term, factor) in [
                (mixed, across.map(|across| across.length)),
                (natural, across.map(|across| across.area)),
            ] {
                sum.add(&factor.map_or(term, |factor| term.times(&factor)));
            }
        }
        sum
    }

    /// Integral of R_f times a term of the density.
    fn integral(&self, gauss: &GaussFields, term: impl Fn(f64, f64) -> Term) -> Jet {
        let mut sum = Jet::zero();
        for (i, t) in gauss_points().into_iter().enumerate() {
            let weight = 0.5 * self.length * self.rigidity[i];
            sum.add_term(weight, &term(gauss.bend[i], gauss.slope[i]), t);
        }
        sum
    }

    /// Weight of the sum and of the commutator in the Magnus step.
    fn magnus_weights(&self) -> (f64, f64) {
        (
            0.5 * self.length,
            3f64.sqrt() / 12.0 * self.length * self.length,
        )
    }

    /// Derivative of the rotation vector by the unknowns at the Gauss points.
    fn rotation_by_gauss(&self, gauss: &GaussFields) -> Matrix3x4<f64> {
        let [first, second] = gauss.strains(self.geodesic).map(|twist| twist.rotation);
        let (half, weight) = self.magnus_weights();
        let [a, b] = gauss
            .rates_by_own(0)
            .map(|d| half * d + weight * d.cross(&second));
        let [c, d] = gauss
            .rates_by_own(1)
            .map(|d| half * d + weight * first.cross(&d));
        Matrix3x4::from_columns(&[a, b, c, d])
    }

    /// Second derivative of `by_rotation · rotation` by the unknowns at the Gauss points.
    fn rotation_hessian(&self, gauss: &GaussFields, by_rotation: &Vector3<f64>) -> Matrix4<f64> {
        let [first, second] = gauss.strains(self.geodesic).map(|twist| twist.rotation);
        let (half, weight) = self.magnus_weights();
        let bilinear = -Vector3::y();
        let mut hessian = Matrix4::zeros();
        let mut set = |i: usize, j: usize, value: Vector3<f64>| {
            hessian[(i, j)] = by_rotation.dot(&value);
            hessian[(j, i)] = hessian[(i, j)];
        };
        set(0, 1, half * bilinear + weight * bilinear.cross(&second));
        set(2, 3, half * bilinear + weight * first.cross(&bilinear));
        for (i, left) in gauss.rates_by_own(0).iter().enumerate() {
            for (j, right) in gauss.rates_by_own(1).iter().enumerate() {
                set(i, 2 + j, weight * left.cross(right));
            }
        }
        hessian
    }

    /// Derivative of the translation part of the Magnus step by the unknowns at the Gauss points: only the
    /// difference of the bends enters.
    fn translation_by_gauss(&self) -> Matrix3x4<f64> {
        let (_, weight) = self.magnus_weights();
        let mut derivative = Matrix3x4::zeros();
        derivative[(0, 0)] = -weight;
        derivative[(0, 2)] = weight;
        derivative
    }
}

/// Derivative of (bend, slope) at parameter t of an element by the nodal unknowns.
fn fields_by_nodes(t: f64) -> Matrix2x4<f64> {
    let (own, next) = (Matrix2::identity() * (1.0 - t), Matrix2::identity() * t);
    Matrix2x4::from_columns(&[own.column(0), own.column(1), next.column(0), next.column(1)])
}

/// V(φ) a, with the left Jacobian V of SO(3).
fn left_jacobian_times(c: &Coefficients, phi: &Vector3<f64>, a: &Vector3<f64>) -> Vector3<f64> {
    let once = phi.cross(a);
    a + c.cosine[0] * once + c.cubic[0] * phi.cross(&once)
}

/// Derivative of V(φ) a by φ.
fn left_jacobian_derivative(
    c: &Coefficients,
    phi: &Vector3<f64>,
    a: &Vector3<f64>,
) -> Matrix3<f64> {
    let once = phi.cross(a);
    let twice = phi.cross(&once);
    2.0 * (c.cosine[1] * once + c.cubic[1] * twice) * phi.transpose() - c.cosine[0] * hat(a)
        + c.cubic[0]
            * (phi.dot(a) * Matrix3::identity() + phi * a.transpose() - 2.0 * a * phi.transpose())
}

/// Second derivative of `force · V(φ) ρ` by φ.
fn displacement_curvature(
    c: &Coefficients,
    phi: &Vector3<f64>,
    rho: &Vector3<f64>,
    force: &Vector3<f64>,
) -> Matrix3<f64> {
    let linear = rho.cross(force);
    let form = symmetric_part(&(force * rho.transpose())) - force.dot(rho) * Matrix3::identity();
    let image = form * phi;
    let (first, second) = (phi.dot(&linear), phi.dot(&image));
    let slope = 2.0 * (c.cosine[1] * linear + 2.0 * c.cubic[1] * image);
    4.0 * (c.cosine[2] * first + c.cubic[2] * second) * phi * phi.transpose()
        + 2.0 * (c.cosine[1] * first + c.cubic[1] * second) * Matrix3::identity()
        + phi * slope.transpose()
        + slope * phi.transpose()
        + 2.0 * c.cubic[0] * form
}

/// ½ (M + Mᵀ).
fn symmetric_part(m: &Matrix3<f64>) -> Matrix3<f64> {
    0.5 * (m + m.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{SMatrix, SVector};
    use num_dual::{DualNum, hessian};

    /// The element over again in any scalar: truncated exponential series instead of closed forms.
    fn displacement_and_rotation<D: DualNum<Primitive = f64> + Copy>(
        h: f64,
        geodesic: f64,
        w: [D; 4],
    ) -> ([[D; 3]; 3], [D; 3]) {
        let rates = |t: f64| {
            let bend = w[0] * (1.0 - t) + w[2] * t;
            let slope = w[1] * (1.0 - t) + w[3] * t;
            [D::from(geodesic), -slope * bend, bend]
        };
        let [a, b] = gauss_points().map(rates);
        let cross = |a: [D; 3], b: [D; 3]| {
            [
                a[1] * b[2] - a[2] * b[1],
                a[2] * b[0] - a[0] * b[2],
                a[0] * b[1] - a[1] * b[0],
            ]
        };
        let weight = 3f64.sqrt() / 12.0 * h * h;
        let commutator = cross(a, b);
        let phi: [D; 3] =
            std::array::from_fn(|i| (a[i] + b[i]) * (0.5 * h) + commutator[i] * weight);
        let lever = cross(
            [a[0] - b[0], a[1] - b[1], a[2] - b[2]],
            [D::from(0.0), D::from(1.0), D::from(0.0)],
        );
        let mut rho: [D; 3] = std::array::from_fn(|i| lever[i] * weight);
        rho[1] += D::from(h);
        let mut twist = [[D::from(0.0); 4]; 4];
        for i in 0..3 {
            twist[i][3] = rho[i];
        }
        (twist[0][1], twist[0][2], twist[1][2]) = (-phi[2], phi[1], -phi[0]);
        (twist[1][0], twist[2][0], twist[2][1]) = (phi[2], -phi[1], phi[0]);
        let product = |a: [[D; 4]; 4], b: [[D; 4]; 4]| -> [[D; 4]; 4] {
            std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    (0..4)
                        .map(|k| a[i][k] * b[k][j])
                        .fold(D::from(0.0), |s, x| s + x)
                })
            })
        };
        let mut term: [[D; 4]; 4] = std::array::from_fn(|i| {
            std::array::from_fn(|j| D::from(if i == j { 1.0 } else { 0.0 }))
        });
        let mut sum = term;
        for n in 1..25 {
            term = product(term, twist);
            for row in &mut term {
                for x in row.iter_mut() {
                    *x /= f64::from(n);
                }
            }
            for i in 0..4 {
                for j in 0..4 {
                    sum[i][j] += term[i][j];
                }
            }
        }
        (
            std::array::from_fn(|i| std::array::from_fn(|j| sum[i][j])),
            std::array::from_fn(|i| sum[i][3]),
        )
    }

    /// force · p(w) + moment · log(E(w₀)ᵀ E(w)), the logarithm to second order in w − w₀ by the skew part.
    fn work<D: DualNum<Primitive = f64> + Copy>(
        h: f64,
        geodesic: f64,
        w: [D; 4],
        at: &Matrix3<f64>,
        force: &Vector3<f64>,
        moment: &Vector3<f64>,
    ) -> D {
        let (e, p) = displacement_and_rotation(h, geodesic, w);
        let relative =
            |i: usize, j: usize| (0..3).fold(D::from(0.0), |s, k| s + e[k][j] * at[(k, i)]);
        let skew = [
            (relative(2, 1) - relative(1, 2)) * 0.5,
            (relative(0, 2) - relative(2, 0)) * 0.5,
            (relative(1, 0) - relative(0, 1)) * 0.5,
        ];
        (0..3).fold(D::from(0.0), |s, i| {
            s + p[i] * force[i] + skew[i] * moment[i]
        })
    }

    fn cases() -> Vec<(Element, Vector4<f64>)> {
        let mut cases = Vec::new();
        for (length, scale) in [(0.0125, 10.0), (0.1, 8.0), (0.25, 6.0), (1e-4, 1e-6)] {
            for geodesic in [0.0, 1.4] {
                let element = Element {
                    length,
                    geodesic,
                    rigidity: [1.3, 0.7],
                    half_width: 0.05,
                    curl: Curl {
                        bend: 2.0 * geodesic,
                        poisson: 0.34,
                    },
                    further: [None; FURTHER],
                };
                cases.push((
                    element,
                    Vector4::new(scale, 0.3, 0.4 * scale, 0.3 + 10.0 * length),
                ));
                cases.push((
                    element,
                    Vector4::new(-0.2 * scale, -0.9, 0.5 * scale, -0.9 - 15.0 * length),
                ));
            }
        }
        cases
    }

    fn assert_close<const R: usize, const C: usize>(
        a: SMatrix<f64, R, C>,
        b: SMatrix<f64, R, C>,
        tolerance: f64,
    ) {
        let scale = 1.0f64.max(b.amax());
        assert!((a - b).amax() <= tolerance * scale, "{a}{b}");
    }

    #[test]
    fn test_increment_and_its_derivatives_agree_with_automatic_differentiation() {
        let (force, moment) = (Vector3::new(3.0, -2.0, 1.0), Vector3::new(0.5, 1.5, -0.7));
        for (element, w) in cases() {
            let jet = element.increment_jet(&w);
            let (e, p) = displacement_and_rotation(
                element.length,
                element.geodesic,
                [w[0], w[1], w[2], w[3]],
            );
            assert_close(jet.value.position, Vector3::from(p), 1e-14);
            assert_close(jet.value.frame, Matrix3::from_fn(|i, j| e[i][j]), 1e-14);
            let at = jet.value.frame;
            let (_, gradient, second) = hessian(
                |x: SVector<num_dual::Dual2SVec64<4>, 4>| {
                    work(
                        element.length,
                        element.geodesic,
                        [x[0], x[1], x[2], x[3]],
                        &at,
                        &force,
                        &moment,
                    )
                },
                &w,
            );
            let by_hand = jet.position_by_fields.transpose() * force
                + jet.rotation_by_fields.transpose() * moment;
            assert_close(by_hand, gradient, 1e-12);
            assert_close(
                element.increment_hessian(&jet, &force, &moment),
                second,
                1e-12,
            );
        }
    }

    #[test]
    fn test_energy_derivatives_agree_with_automatic_differentiation() {
        for model in [
            EnergyModel::Fishbone,
            EnergyModel::Sadowsky,
            EnergyModel::Wunderlich,
        ] {
            for (element, w) in cases() {
                let (value, gradient, second) = hessian(
                    |x: SVector<num_dual::Dual2SVec64<4>, 4>| {
                        let across = match model {
                            EnergyModel::Wunderlich => element.strips().across([x[1], x[3]]),
                            _ => Across::PLAIN.map(num_dual::Dual2SVec64::from),
                        };
                        let mut sum = x[0] * 0.0;
                        for (t, r) in gauss_points().into_iter().zip(element.rigidity) {
                            let bend = x[0] * (1.0 - t) + x[2] * t;
                            let slope = x[1] * (1.0 - t) + x[3] * t;
                            sum += model.value(bend, slope, &element.curl, &across)
                                * (0.5 * element.length * r);
                        }
                        sum
                    },
                    &w,
                );
                let jet = element.energy_jet(model, &w);
                assert!((jet.value - value).abs() <= 1e-13 * value.abs());
                assert_close(jet.gradient, gradient, 1e-11);
                assert_close(jet.hessian, second, 1e-10);
                assert!((element.energy(model, &w) - value).abs() <= 1e-13 * value.abs());
            }
        }
    }
}
