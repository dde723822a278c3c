//! Fundamental forms and curvatures.

use super::rib_angle;
use super::thick::BoardTensor;
use crate::strip::element::torsion;
use crate::strip::shell::Curvature;
use crate::strip::spine::Spine;
use nalgebra::{Matrix3, Vector3};

/// Coefficients of the first fundamental form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FirstForm {
    /// E = x_u · x_u.
    pub e: f64,
    /// F = x_u · x_v.
    pub f: f64,
    /// G = x_v · x_v.
    pub g: f64,
}

impl FirstForm {
    /// First form on the spine, where x_u = η and x_v = ζ: E = 1, F = 0, G = 1, dimensionless.
    ///
    /// Sec. V of the source prints "E=1, G=0, F=1", a slip against its Sec. II-B.
    pub const ON_SPINE: Self = Self {
        e: 1.0,
        f: 0.0,
        g: 1.0,
    };

    /// The form of the tangent vectors.
    ///
    /// Source: Eq. (6)–(8)
    pub fn new(x_u: &Vector3<f64>, x_v: &Vector3<f64>) -> Self {
        Self {
            e: x_u.dot(x_u),
            f: x_u.dot(x_v),
            g: x_v.dot(x_v),
        }
    }

    /// Determinant E G − F².
    pub(crate) fn determinant(&self) -> f64 {
        self.e * self.g - self.f * self.f
    }
}

/// Coefficients of the second fundamental form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SecondForm {
    /// L = x_uu · e.
    pub l: f64,
    /// M = x_uv · e.
    pub m: f64,
    /// N = x_vv · e.
    pub n: f64,
}

impl SecondForm {
    /// The form of the second derivatives of the surface and its unit normal e.
    ///
    /// Source: Eq. (9)–(11)
    pub fn new(
        x_uu: &Vector3<f64>,
        x_uv: &Vector3<f64>,
        x_vv: &Vector3<f64>,
        normal: &Vector3<f64>,
    ) -> Self {
        Self {
            l: x_uu.dot(normal),
            m: x_uv.dot(normal),
            n: x_vv.dot(normal),
        }
    }

    /// The form on the spine of a developable belt: L = −ω_ζ, M = ω_η, N = δ.
    ///
    /// Source: Eq. (16), (17), (24)
    pub fn on_spine(bend: f64, rib_slope: f64) -> Self {
        Self {
            l: -bend,
            m: torsion(bend, rib_slope),
            n: transverse(bend, rib_slope),
        }
    }

    /// Determinant L N − M².
    pub(crate) fn determinant(&self) -> f64 {
        self.l * self.n - self.m * self.m
    }
}

/// Normal curvature in the direction d = a x_u + b x_v.
///
/// Source: Eq. (5)
pub fn normal_curvature(first: &FirstForm, second: &SecondForm, a: f64, b: f64) -> f64 {
    (second.l * a * a + 2.0 * second.m * a * b + second.n * b * b)
        / (first.e * a * a + 2.0 * first.f * a * b + first.g * b * b)
}

/// Gaussian curvature.
///
/// Source: Eq. (12)
pub fn gaussian_curvature(first: &FirstForm, second: &SecondForm) -> f64 {
    second.determinant() / first.determinant()
}

/// Mean curvature.
///
/// Source: Eq. (13)
pub fn mean_curvature(first: &FirstForm, second: &SecondForm) -> f64 {
    (first.e * second.n - 2.0 * first.f * second.m + first.g * second.l)
        / (2.0 * first.determinant())
}

/// The principal curvatures (κ₁, κ₂), the one of larger magnitude first.
///
/// The source calls κ₁ the maximum and κ₂ the minimum, but then takes κ₂ = 0 on every developable surface: it uses κ₁ as the
/// non-zero and κ₂ as the zero curvature, whatever their signs.
///
/// Source: Eq. (12), (13), solved
pub fn principal_curvatures(first: &FirstForm, second: &SecondForm) -> (f64, f64) {
    let mean = mean_curvature(first, second);
    let gaussian = gaussian_curvature(first, second);
    let half_gap = (mean * mean - gaussian).max(0.0).sqrt();
    let larger = mean + half_gap.copysign(mean);
    // The product, not the difference, keeps the digits of the smaller one.
    let smaller = if larger == 0.0 {
        0.0
    } else {
        gaussian / larger
    };
    (larger, smaller)
}

/// Gaussian curvature on the spine; 0 on a developable belt, Eq. (23).
///
/// Source: Eq. (18)
pub fn gaussian_curvature_on_spine(bend: f64, torsion: f64, transverse: f64) -> f64 {
    -bend * transverse - torsion * torsion
}

/// Mean curvature on the spine.
///
/// Source: Eq. (19)
pub fn mean_curvature_on_spine(bend: f64, transverse: f64) -> f64 {
    0.5 * (transverse - bend)
}

/// Transverse curvature δ = −ω_ζ β².
///
/// Written in β, not as −ω_η²/ω_ζ: nothing is divided by a bend that may vanish.
///
/// Source: Eq. (24)
pub(crate) fn transverse(bend: f64, rib_slope: f64) -> f64 {
    -bend * rib_slope * rib_slope
}

/// The non-zero principal curvature κ₁ = −ω_ζ (1 + β²), normal to the rib; κ₂, along it, is 0.
///
/// Source: Eq. (29), in β
pub fn curvature(bend: f64, rib_slope: f64) -> f64 {
    -bend * (1.0 + rib_slope * rib_slope)
}

/// Derivatives along u of the frame's columns `[ξ η ζ]`, for body rates ω: `R [ω]×`.
///
/// Source: Eq. (14), (15); on the spine the second and third also give ∂η/∂v = ∂ζ/∂u, where the source prints ∂ξ/∂v
pub fn frame_derivative(frame: &Matrix3<f64>, rates: &Vector3<f64>) -> Matrix3<f64> {
    frame * crate::geometry::hat(rates)
}

/// Radius of bend at the point v of a rib, `(1 − v s)/|κ₁|`; infinite where κ₁ = 0.
///
/// Ribs that gather towards one edge carry the bend of the spine into less and less length there.
pub(crate) fn bend_radius(curvature: f64, rib_convergence: f64, v: f64) -> f64 {
    if curvature == 0.0 {
        return f64::INFINITY;
    }
    (1.0 - v * rib_convergence).max(0.0) / curvature.abs()
}

impl Spine {
    /// Rib angle α = atan β at every node.
    ///
    /// Source: Eq. (31)
    pub fn rib_angle(&self) -> Vec<f64> {
        self.rib_slope.iter().copied().map(rib_angle).collect()
    }

    /// The principal curvature κ₁ of larger magnitude on the spine at every node. Where ribs are straight it is −ω_ζ (1 + β²), and
    /// the other one is 0.
    ///
    /// Source: Eq. (29)
    pub fn curvature(&self) -> Vec<f64> {
        let nodes = 0..self.bend.len();
        nodes.map(|node| self.curvature_at(node)).collect()
    }

    fn curvature_at(&self, node: usize) -> f64 {
        let (bend, slope) = (self.bend[node], self.rib_slope[node]);
        let Some(curved) = &self.curved else {
            return curvature(bend, slope);
        };
        let rib = Curvature {
            along: -bend,
            mixed: curved.twist[node],
            across: curved.across[node],
            area: 1.0,
        };
        BoardTensor::on_rib(&rib, slope).principal()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::samples::spine;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    /// Forms at (u, v) of the surface x(u) + v (ζ − βη), by central differences of its points.
    fn forms_by_differences(slope: f64, bend: f64, v: f64) -> (FirstForm, SecondForm) {
        let spine = spine(1.0, 0.1, 400, |u| bend * (1.0 + u), |u| slope + u * u);
        let (u, h) = (0.5, 1e-3);
        let x = |i: f64, j: f64| {
            let p = spine.at(u + i * h);
            let v = v + j * h;
            p.pose.transform(&Vector3::new(0.0, -v * p.rib_slope, v))
        };
        let x_u = (x(1.0, 0.0) - x(-1.0, 0.0)) / (2.0 * h);
        let x_v = (x(0.0, 1.0) - x(0.0, -1.0)) / (2.0 * h);
        let x_uu = (x(1.0, 0.0) - x(0.0, 0.0) * 2.0 + x(-1.0, 0.0)) / (h * h);
        let x_vv = (x(0.0, 1.0) - x(0.0, 0.0) * 2.0 + x(0.0, -1.0)) / (h * h);
        let x_uv = (x(1.0, 1.0) - x(1.0, -1.0) - x(-1.0, 1.0) + x(-1.0, -1.0)) / (4.0 * h * h);
        let normal = x_u.cross(&x_v).normalize();
        (
            FirstForm::new(&x_u, &x_v),
            SecondForm::new(&x_uu, &x_uv, &x_vv, &normal),
        )
    }

    proptest! {
        #[test]
        fn test_principal_curvatures_of_the_rib_surface(
            slope in -1.0..1.0f64, bend in 0.5..3.0f64, v in -0.2..0.2f64,
        ) {
            let (first, second) = forms_by_differences(slope, bend, v);
            let (bend, rib_slope) = (bend * 1.5, slope + 0.25);
            let (larger, smaller) = principal_curvatures(&first, &second);
            // s = β' = 1 at the middle of that spine.
            let radius = bend_radius(curvature(bend, rib_slope), 1.0, v);
            prop_assert!((larger.abs() * radius - 1.0).abs() < 1e-3, "{larger} {radius}");
            prop_assert!(smaller.abs() < 1e-3);
            if v == 0.0 {
                prop_assert!(larger * curvature(bend, rib_slope) > 0.0);
            }
        }

        #[test]
        fn test_curvatures_on_the_spine_agree_with_the_forms(bend in -3.0..3.0f64, slope in -2.0..2.0f64) {
            let second = SecondForm::on_spine(bend, slope);
            let (omega_eta, delta) = (torsion(bend, slope), transverse(bend, slope));
            prop_assert!(gaussian_curvature_on_spine(bend, omega_eta, delta).abs() < 1e-12);
            let mean = mean_curvature(&FirstForm::ON_SPINE, &second);
            prop_assert!((mean_curvature_on_spine(bend, delta) - mean).abs() < 1e-12);
            let (larger, smaller) = principal_curvatures(&FirstForm::ON_SPINE, &second);
            prop_assert!((larger - curvature(bend, slope)).abs() < 1e-6);
            prop_assert!(smaller.abs() < 1e-12);
        }

        #[test]
        fn test_normal_curvature_is_zero_along_and_principal_across_the_rib(
            bend in -3.0..3.0f64, slope in -2.0..2.0f64,
        ) {
            let second = SecondForm::on_spine(bend, slope);
            let along = normal_curvature(&FirstForm::ON_SPINE, &second, -slope, 1.0);
            let across = normal_curvature(&FirstForm::ON_SPINE, &second, 1.0, slope);
            prop_assert!(along.abs() < 1e-12);
            prop_assert!((across - curvature(bend, slope)).abs() < 1e-12);
        }
    }

    #[test]
    fn test_sphere_has_equal_curvatures() {
        // Radius 2, x = 2 (cos u cos v, sin u cos v, sin v) at u = v = 0, outward normal.
        let first = FirstForm::new(&(Vector3::y() * 2.0), &(Vector3::z() * 2.0));
        let (x_uu, x_vv) = (Vector3::x() * -2.0, Vector3::x() * -2.0);
        let second = SecondForm::new(&x_uu, &Vector3::zeros(), &x_vv, &Vector3::x());
        assert_eq!(gaussian_curvature(&first, &second), 0.25);
        assert_eq!(principal_curvatures(&first, &second), (-0.5, -0.5));
    }

    #[test]
    fn test_a_plane_has_no_curvature() {
        let flat = SecondForm::on_spine(0.0, 0.7);
        assert_eq!(
            principal_curvatures(&FirstForm::ON_SPINE, &flat),
            (0.0, 0.0)
        );
        assert_eq!(bend_radius(0.0, 3.0, 0.1), f64::INFINITY);
    }

    #[test]
    fn test_frame_derivative_is_that_of_the_spine() {
        let spine = spine(1.0, 0.1, 400, |u| 2.0 + u, |u| 0.5 - u);
        let h = 1e-4;
        let difference = (spine.at(0.5 + h).pose.frame - spine.at(0.5 - h).pose.frame) / (2.0 * h);
        let here = spine.at(0.5);
        let rates = crate::strip::element::strain(0.0, here.bend, here.rib_slope).rotation;
        assert_relative_eq!(
            frame_derivative(&here.pose.frame, &rates),
            difference,
            epsilon = 1e-5
        );
        let eta_rate = here.pose.frame.column(0) * -here.bend;
        assert_relative_eq!(difference.column(1).into_owned(), eta_rate, epsilon = 1e-5);
    }
}
