use super::*;
use crate::geometry::{Twist, gauss_points};
use crate::strip::density::{Derivatives, Motions as _};
use crate::strip::element::{Curl, increment};
use num_dual::hessian;

type NodeVector = stagewise::NodeVector<8>;
type ByControls = stagewise::ByControls<2, 8>;

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
    let phi: [D; 3] = std::array::from_fn(|i| (a[i] + b[i]) * (0.5 * h) + commutator[i] * weight);
    let lever = cross(
        [a[0] - b[0], a[1] - b[1], a[2] - b[2]],
        [D::from(0.0), D::from(1.0), D::from(0.0)],
    );
    let mut rho: [D; 3] = std::array::from_fn(|i| lever[i] * weight);
    let rise = b[2] - a[2];
    rho[1] += D::from(h) - rise * rise * (h.powi(3) / 80.0);
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
    let mut term: [[D; 4]; 4] =
        std::array::from_fn(|i| std::array::from_fn(|j| D::from(if i == j { 1.0 } else { 0.0 })));
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
    model: DevelopableEnergy,
    w: [D; 4],
) -> D {
    let across = match model {
        DevelopableEnergy::Wunderlich => element.strips().across([w[1], w[3]]),
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
                stretching: f64::INFINITY,
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
const MODELS: [DevelopableEnergy; 3] = [
    DevelopableEnergy::Fishbone,
    DevelopableEnergy::Sadowsky,
    DevelopableEnergy::Wunderlich,
];

#[test]
fn test_increment_agrees_with_the_exponential_series() {
    for (element, w) in cases() {
        let motion = increment(element.length, element.geodesic, &w);
        let (e, p) =
            displacement_and_rotation(element.length, element.geodesic, [w[0], w[1], w[2], w[3]]);
        let mut motions = Motions::default();
        let [a, b] = ends(&w);
        motions.set(3, &element, [&a, &b]);
        motions.find(&DevelopableEnergy::Wunderlich);
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
    model: DevelopableEnergy,
    first: &Pose,
    wrench: &NodeVector,
) {
    let motion = increment(element.length, element.geodesic, w);
    let force: Vector3<f64> = wrench.fixed_rows::<3>(0).into_owned();
    let about_first = wrench.fixed_rows::<3>(3) - first.position.cross(&force);
    let (force_here, moment_here) = (first.frame.tr_mul(&force), first.frame.tr_mul(&about_first));
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
    let twist = |column: &NodeVector| Twist::from_vector(&column.fixed_rows::<6>(0).into_owned());
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
