//! The curvature along a rib against second derivatives of a potential over the flat board.

use super::*;
use nalgebra::{Matrix2, Vector2};
use num_dual::{second_derivative, second_partial_derivative};

/// Coefficients of a polynomial of u, by rising powers; lengths in U.
type Polynomial = [f64; 5];

/// A derivative of a polynomial.
fn derivative<T>(coefficients: &Polynomial, order: usize, u: T) -> T
where
    T: DualNum<Primitive = f64> + Copy,
{
    let mut sum = T::zero();
    for n in (order..coefficients.len()).rev() {
        let factor: usize = (n + 1 - order..=n).product();
        sum = sum * u + coefficients[n] * factor as f64;
    }
    sum
}

/// A potential φ that is quadratic in v along the ribs p(u) + v d(u) of a board: on the spine its value, its derivative
/// across the spine, and its second derivative along the rib are polynomials of u, and so is the rib slope.
struct Potential {
    geodesic: f64,
    value: Polynomial,
    across: Polynomial,
    bend: Polynomial,
    slope: Polynomial,
}

impl Potential {
    fn new(geodesic: f64) -> Self {
        Self {
            geodesic,
            value: [0.2, -0.6, 2.5, -3.1, 4.7],
            across: [0.3, 1.3, -2.2, 3.4, -1.6],
            bend: [0.8, -2.7, 5.1, 6.3, -7.4],
            slope: [0.25, -1.1, 1.7, 2.3, -3.3],
        }
    }

    /// Place on the spine, and the directions t and n there.
    fn spine<T: DualNum<Primitive = f64> + Copy>(&self, u: T) -> [[T; 2]; 3] {
        let (s, c) = (u * self.geodesic).sin_cos();
        let place = match self.geodesic == 0.0 {
            true => [u, T::zero()],
            false => [s / self.geodesic, (-c + 1.0) / self.geodesic],
        };
        [place, [c, s], [-s, c]]
    }

    /// Both coordinates on the board and φ, at a place of a rib.
    fn at<T: DualNum<Primitive = f64> + Copy>(&self, u: T, v: T) -> [T; 3] {
        let [place, t, n] = self.spine(u);
        let slope = derivative(&self.slope, 0, u);
        let first = derivative(&self.across, 0, u) - slope * derivative(&self.value, 1, u);
        let second = derivative(&self.bend, 0, u);
        let point = [0, 1].map(|i| place[i] + v * (n[i] - slope * t[i]));
        let value = derivative(&self.value, 0, u) + v * first + v * v * second * 0.5;
        [point[0], point[1], value]
    }

    /// The second derivative of φ by the coordinates of the board, and the area of the board per unit of u and of v.
    fn hessian(&self, u: f64, v: f64) -> (Matrix2<f64>, f64) {
        let jets = [0, 1, 2].map(|i| {
            let (_, by_u, by_uu) = second_derivative(|u| self.at(u, v.into())[i], u);
            let (_, by_v, by_vv) = second_derivative(|v| self.at(u.into(), v)[i], v);
            let (_, _, _, by_uv) = second_partial_derivative(|(u, v)| self.at(u, v)[i], (u, v));
            (
                Vector2::new(by_u, by_v),
                Matrix2::new(by_uu, by_uv, by_uv, by_vv),
            )
        });
        let [(x, x_second), (y, y_second), (value, second)] = jets;
        let map = Matrix2::from_columns(&[x, y]);
        let inverse = map.try_inverse().unwrap();
        let gradient = inverse * value;
        let rest = second - x_second * gradient.x - y_second * gradient.y;
        (inverse * rest * inverse.transpose(), map.determinant())
    }

    /// Bend k of the spine: the gradient of φ turns with the spine's axes.
    fn bend<T: DualNum<Primitive = f64> + Copy>(&self, u: T) -> T {
        derivative(&self.value, 2, u) - derivative(&self.across, 0, u) * self.geodesic
    }

    /// Torsion τ of the spine.
    fn torsion<T: DualNum<Primitive = f64> + Copy>(&self, u: T) -> T {
        derivative(&self.across, 1, u) + derivative(&self.value, 1, u) * self.geodesic
    }

    /// The fields of a node at u, and their rates.
    fn fields(&self, u: f64) -> [[f64; FIELDS]; 2] {
        let (bend, bend_rate) = first_derivative(|u: Dual64| -self.bend(u), u);
        let (twist, twist_rate) = first_derivative(
            |u: Dual64| self.torsion(u) - derivative(&self.slope, 0, u) * self.bend(u),
            u,
        );
        let slope = [0, 1, 2].map(|order| derivative(&self.slope, order, u));
        let across = [0, 1, 2].map(|order| derivative(&self.bend, order, u));
        [
            [bend, slope[0], slope[1], twist, across[0], across[1]],
            [
                bend_rate, slope[1], slope[2], twist_rate, across[1], across[2],
            ],
        ]
    }
}

/// In-plane curvatures κ_g of the boards, 1/U.
const BOARDS: [f64; 3] = [0.0, 1.4, -0.9];
/// Places on the spine, U.
const PLACES: [f64; 3] = [-0.3, 0.0, 0.4];

#[test]
fn test_the_curvature_along_a_rib_is_the_second_derivative_of_a_potential() {
    for geodesic in BOARDS {
        let potential = Potential::new(geodesic);
        for u in PLACES {
            let [fields, rates] = potential.fields(u);
            let rib = Rib::of(&fields, &rates, geodesic);
            let [_, t, n] = potential.spine(u).map(Vector2::from);
            let d = n - t * fields[1];
            for v in [-0.25, -0.05, 0.0, 0.1, 0.3] {
                let (hessian, area) = potential.hessian(u, v);
                let found = rib.curvature(geodesic, v);
                let pairs = [
                    (found.along, t.dot(&(hessian * t))),
                    (found.mixed, t.dot(&(hessian * d))),
                    (found.across, d.dot(&(hessian * d))),
                    (found.area, area),
                ];
                for (found, exact) in pairs {
                    let off = (found - exact).abs();
                    assert!(off < 1e-9 * (1.0 + exact.abs()), "{u} {v} {found} {exact}");
                }
            }
        }
    }
}

#[test]
fn test_the_curvature_on_the_spine_is_that_of_the_fields() {
    for geodesic in BOARDS {
        let potential = Potential::new(geodesic);
        for u in PLACES {
            let [fields, rates] = potential.fields(u);
            let rib = Rib::of(&fields, &rates, geodesic);
            let [_, t, n] = potential.spine(u).map(Vector2::from);
            let (hessian, _) = potential.hessian(u, 0.0);
            let b = |x: &Vector2<f64>, y: &Vector2<f64>| x.dot(&(hessian * y));
            assert_relative_eq!(-fields[0], b(&t, &t), max_relative = 1e-11);
            assert_relative_eq!(
                rib.torsion(),
                b(&t, &n),
                max_relative = 1e-11,
                epsilon = 1e-11
            );
            let shell = Shell::new(NO_GAUGE, 6);
            let [torsion, bend] = shell.torsion_and_bend(&fields);
            assert_relative_eq!(torsion, b(&t, &n), max_relative = 1e-11, epsilon = 1e-11);
            assert_relative_eq!(bend, -b(&t, &t), max_relative = 1e-11);
        }
    }
}
