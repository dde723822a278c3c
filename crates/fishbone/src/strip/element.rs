//! One element of the belt: pose increment and energy, from the same two Gauss points, with derivatives.
//!
//! An element joins two nodes; its four unknowns are `(bend₀, slope₀, bend₁, slope₁)`, linear in between. Were pose
//! and energy taken at different points, a node-to-node zigzag of the unknowns would cost one of them nothing.

use crate::geometry::{Pose, Twist, gauss_points, magnus};
use crate::strip::developable::{Curl, EnergyModel, Term};
use crate::strip::ribs::{Across, SlopeJet, Strips};
use nalgebra::{Matrix2, Matrix2x4, Matrix4, Vector3, Vector4};

/// Torsion ω_η = −β ω_ζ.
///
/// Source: Eq. (32)
pub(crate) fn torsion(bend: f64, rib_slope: f64) -> f64 {
    -rib_slope * bend
}

/// The twist of the pose per unit u, body axes: along η, and by the rates (κ_g, −β ω_ζ, ω_ζ).
///
/// Source: Eq. (3), (4), (25), (32)
pub(crate) fn strain(geodesic: f64, bend: f64, rib_slope: f64) -> Twist {
    Twist {
        translation: Vector3::y(),
        rotation: Vector3::new(geodesic, torsion(bend, rib_slope), bend),
    }
}

/// The motion along a piece of the spine, by a fourth-order Magnus step from the fields at its two ends.
pub(crate) fn increment(length: f64, geodesic: f64, fields: &Vector4<f64>) -> Pose {
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
    /// Natural bend of the element.
    pub curl: Curl,
}

/// A function of the four unknowns with its derivatives.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Jet {
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

    /// Twists per unit length at the two Gauss points.
    fn strains(&self, geodesic: f64) -> [Twist; 2] {
        [0, 1].map(|i| strain(geodesic, self.bend[i], self.slope[i]))
    }

    /// The Magnus step.
    fn step(&self, length: f64, geodesic: f64) -> Twist {
        let [first, second] = self.strains(geodesic);
        magnus(&first, &second, length)
    }
}

impl Element {
    /// An element of a straight board of rigidity 1.
    pub fn straight(length: f64, half_width: f64, curl: Curl) -> Self {
        Self {
            length,
            geodesic: 0.0,
            rigidity: [1.0; 2],
            half_width,
            curl,
        }
    }

    /// The strips between its ribs.
    pub(crate) fn strips(&self) -> Strips {
        Strips {
            half_width: self.half_width,
            geodesic: self.geodesic,
            length: self.length,
        }
    }

    /// Energy, without derivatives.
    pub(crate) fn energy(&self, model: EnergyModel, fields: &Vector4<f64>) -> f64 {
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

    /// Factors of the width in the terms of the energy, with derivatives.
    pub(crate) fn across_jets(
        &self,
        model: EnergyModel,
        fields: &Vector4<f64>,
    ) -> Across<SlopeJet> {
        match model.knows_width() {
            true => self.strips().across_jets([fields[1], fields[3]]),
            false => Across::PLAIN.map(SlopeJet::constant),
        }
    }

    /// The part of the energy that the natural bend adds, with its derivatives.
    pub(crate) fn curl_jet(
        &self,
        model: EnergyModel,
        fields: &Vector4<f64>,
        across: &Across<SlopeJet>,
    ) -> Jet {
        let gauss = GaussFields::at(fields);
        let mixed = self.integral(&gauss, |bend, slope| model.mixed(bend, slope, &self.curl));
        let natural = self.integral(&gauss, |_, slope| model.natural(slope, &self.curl));
        let mut sum = mixed.times(&Jet::from(across.length));
        sum.add(&natural.times(&Jet::from(across.area)));
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
}

/// Derivative of (bend, slope) at parameter t of an element by the nodal unknowns.
fn fields_by_nodes(t: f64) -> Matrix2x4<f64> {
    let (own, next) = (Matrix2::identity() * (1.0 - t), Matrix2::identity() * t);
    Matrix2x4::from_columns(&[own.column(0), own.column(1), next.column(0), next.column(1)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strip::density::{Derivatives, LANES, Loaded, Motions as _};
    use crate::strip::kernel::{Block, Motions};
    use stagewise::Stage;

    type NodeVector = stagewise::NodeVector<8>;
    type ByControls = stagewise::ByControls<2, 8>;
    use nalgebra::{Matrix3, SMatrix, SVector, Vector2};
    use num_dual::{DualNum, hessian};

    /// Displacement and rotation along the element in any scalar, by truncated exponential series instead of closed forms.
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

    /// `force` and `moment` on the twist X of `M(w) = exp(X) M(w₀)`, to second order in w − w₀.
    fn work<D: DualNum<Primitive = f64> + Copy>(
        element: &Element,
        w: [D; 4],
        at: &Pose,
        force: &Vector3<f64>,
        moment: &Vector3<f64>,
    ) -> D {
        let (e, p) = displacement_and_rotation(element.length, element.geodesic, w);
        let turned =
            |i: usize, j: usize| (0..3).fold(D::from(0.0), |s, k| s + e[i][k] * at.frame[(j, k)]);
        let turn = [
            (turned(2, 1) - turned(1, 2)) * 0.5,
            (turned(0, 2) - turned(2, 0)) * 0.5,
            (turned(1, 0) - turned(0, 1)) * 0.5,
        ];
        let shift: [D; 3] = std::array::from_fn(|i| {
            p[i] - (0..3).fold(D::from(0.0), |s, j| s + turned(i, j) * at.position[j])
        });
        let back = [
            turn[1] * shift[2] - turn[2] * shift[1],
            turn[2] * shift[0] - turn[0] * shift[2],
            turn[0] * shift[1] - turn[1] * shift[0],
        ];
        (0..3).fold(D::from(0.0), |s, i| {
            s + (shift[i] - back[i] * 0.5) * force[i] + turn[i] * moment[i]
        })
    }

    /// Bending energy by its definition, in any scalar.
    fn energy<D: DualNum<Primitive = f64> + Copy>(
        element: &Element,
        model: EnergyModel,
        w: [D; 4],
    ) -> D {
        let across = match model {
            EnergyModel::Wunderlich => element.strips().across([w[1], w[3]]),
            _ => Across::PLAIN.map(D::from),
        };
        let mut sum = D::from(0.0);
        for (t, r) in gauss_points().into_iter().zip(element.rigidity) {
            let bend = w[0] * (1.0 - t) + w[2] * t;
            let slope = w[1] * (1.0 - t) + w[3] * t;
            sum += model.value(bend, slope, &element.curl, &across) * (0.5 * element.length * r);
        }
        sum
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

    /// Energy models, one of each.
    const MODELS: [EnergyModel; 3] = [
        EnergyModel::Fishbone,
        EnergyModel::Sadowsky,
        EnergyModel::Wunderlich,
    ];

    #[test]
    fn test_increment_agrees_with_the_exponential_series() {
        for (element, w) in cases() {
            let motion = increment(element.length, element.geodesic, &w);
            let (e, p) = displacement_and_rotation(
                element.length,
                element.geodesic,
                [w[0], w[1], w[2], w[3]],
            );
            let mut motions = Motions::default();
            let [a, b] = ends(&w);
            motions.set(3, &element, [&a, &b]);
            motions.find(&EnergyModel::Wunderlich);
            for motion in [motion, motions.at(3)] {
                assert_close(motion.position, Vector3::from(p), 1e-14);
                assert_close(motion.frame, Matrix3::from_fn(|i, j| e[i][j]), 1e-14);
            }
        }
    }

    /// A full block of cases, each at a pose and under a wrench of its own.
    #[test]
    fn test_derivatives_agree_with_automatic_differentiation() {
        let first = Pose {
            frame: crate::geometry::exp(&Vector3::new(0.3, -0.8, 1.1)),
            position: Vector3::new(0.4, -0.2, 0.7),
        };
        let wrench = NodeVector::from_column_slice(&[3.0, -2.0, 1.0, 0.5, 1.5, -0.7, 0.0, 0.0]);
        for model in MODELS {
            for some in cases().chunks(LANES) {
                let mut block = Block::default();
                for (lane, (element, w)) in some.iter().enumerate() {
                    let second = first * increment(element.length, element.geodesic, w);
                    let [a, b] = ends(w);
                    let loaded = Loaded {
                        element,
                        fields: [&a, &b],
                        poses: [&first, &second],
                        wrench: &wrench.fixed_rows::<6>(0).into_owned(),
                    };
                    block.set(lane, &model, &loaded);
                }
                block.find(&model);
                for (lane, (element, w)) in some.iter().enumerate() {
                    check_lane(&block, lane, element, w, model, &first, &wrench);
                }
            }
        }
    }

    fn ends(w: &Vector4<f64>) -> [Vector2<f64>; 2] {
        [0, 2].map(|from| w.fixed_rows::<2>(from).into_owned())
    }

    fn check_lane(
        block: &Block,
        lane: usize,
        element: &Element,
        w: &Vector4<f64>,
        model: EnergyModel,
        first: &Pose,
        wrench: &NodeVector,
    ) {
        let motion = increment(element.length, element.geodesic, w);
        let force: Vector3<f64> = wrench.fixed_rows::<3>(0).into_owned();
        let about_first = wrench.fixed_rows::<3>(3) - first.position.cross(&force);
        let (force_here, moment_here) =
            (first.frame.tr_mul(&force), first.frame.tr_mul(&about_first));
        let (_, gradient, second) = hessian(
            |x: SVector<num_dual::Dual2SVec64<4>, 4>| {
                let x = [x[0], x[1], x[2], x[3]];
                work(element, x, &motion, &force_here, &moment_here) + energy(element, model, x)
            },
            w,
        );
        let [a, b] = block.gradient(lane);
        assert_close(Vector4::new(a[0], a[1], b[0], b[1]), gradient, 1e-11);
        let own = block.hessian(lane);
        assert_close(
            own.first,
            second.fixed_view::<2, 2>(0, 0).into_owned(),
            1e-10,
        );
        assert_close(
            own.mixed,
            second.fixed_view::<2, 2>(0, 2).into_owned(),
            1e-10,
        );
        assert_close(
            own.second,
            second.fixed_view::<2, 2>(2, 2).into_owned(),
            1e-10,
        );
        let mut stage = Stage::zero();
        block.carry(lane, &mut stage);
        for i in 0..3 {
            // The twist by a unit of each field is the gradient of the work of a unit force or moment.
            for (row, force, moment) in [
                (i, Vector3::ith(i, 1.0), Vector3::zeros()),
                (3 + i, Vector3::zeros(), Vector3::ith(i, 1.0)),
            ] {
                let about_first = moment - first.position.cross(&force);
                let seen = [force, about_first].map(|a| first.frame.tr_mul(&a));
                let (_, by_fields) = num_dual::gradient(
                    |x: SVector<num_dual::DualSVec64<4>, 4>| {
                        work(
                            element,
                            [x[0], x[1], x[2], x[3]],
                            &motion,
                            &seen[0],
                            &seen[1],
                        )
                    },
                    w,
                );
                for (column, expected) in by_fields.iter().enumerate() {
                    let by = match column {
                        0 | 1 => &stage.growth_by_first,
                        _ => &stage.growth_by_second,
                    };
                    assert!((by[(row, column % 2)] - expected).abs() < 1e-12);
                }
            }
        }
        assert_close(
            mixed_by_bracket(&stage.growth_by_first, wrench),
            stage.state_first,
            1e-12,
        );
        assert_close(
            mixed_by_bracket(&stage.growth_by_second, wrench),
            stage.state_second,
            1e-12,
        );
    }

    /// Half the work of the wrench on the bracket of a unit twist and each column.
    fn mixed_by_bracket(growth: &ByControls, wrench: &NodeVector) -> ByControls {
        let twist =
            |column: &NodeVector| Twist::from_vector(&column.fixed_rows::<6>(0).into_owned());
        ByControls::from_fn(|row, column| match row {
            0..6 => {
                let grown = twist(&growth.column(column).into_owned());
                let unit = twist(&NodeVector::ith(row, 1.0));
                let bracket = crate::geometry::bracket(&unit, &grown).to_vector();
                0.5 * bracket.dot(&wrench.fixed_rows::<6>(0))
            }
            _ => 0.0,
        })
    }

    #[test]
    fn test_energy_of_a_curled_element_agrees_with_automatic_differentiation() {
        for model in MODELS {
            for (element, w) in cases() {
                let uncurled = Element {
                    curl: Curl::default(),
                    ..element
                };
                let (value, gradient, second) = hessian(
                    |x: SVector<num_dual::Dual2SVec64<4>, 4>| {
                        let x = [x[0], x[1], x[2], x[3]];
                        energy(&element, model, x) - energy(&uncurled, model, x)
                    },
                    &w,
                );
                let jet = element.curl_jet(model, &w, &element.across_jets(model, &w));
                assert!((jet.value - value).abs() <= 1e-12 * value.abs().max(1e-3));
                assert_close(jet.gradient, gradient, 1e-11);
                assert_close(jet.hessian, second, 1e-10);
                let whole = energy(&element, model, [w[0], w[1], w[2], w[3]]);
                assert!((element.energy(model, &w) - whole).abs() <= 1e-13 * whole.abs());
            }
        }
    }
}
