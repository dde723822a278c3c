//! The density where its value is known: twist, cylinders, ribs without bend, uniform strips.

use super::super::edge_layer::psi;
use super::super::{Plate, Rib};
use super::*;
use num_dual::{DualNum, first_derivative, second_derivative};

/// Width V of the strips, U.
const WIDTH: f64 = 0.1;
/// Poisson's ratio ν of the strips, dimensionless.
const POISSON: f64 = 0.34;
/// Thickness h of the strips that are not named otherwise, U.
const THICKNESS: f64 = 7e-4;

/// A strip of a thickness h and a natural curvature k0.
pub(super) fn plate(thickness: f64, natural: f64) -> Plate {
    Plate {
        half_width: 0.5 * WIDTH,
        geodesic: 0.0,
        natural,
        poisson: POISSON,
        stretching: 12.0 * (1.0 - POISSON * POISSON) / (thickness * thickness),
    }
}

/// The rib of a slope β in a strip of the uniform curvature k, τ, δ along, between and across its axes.
pub(super) fn uniform<T>([bend, torsion, transverse]: [T; 3], slope: f64) -> Rib<T>
where
    T: DualNum<Primitive = f64> + Copy,
{
    let twist = torsion - bend * slope;
    Rib {
        bend,
        twist,
        slope: T::from(slope),
        across: transverse - twist * (2.0 * slope) - bend * (slope * slope),
        convergence: T::zero(),
        growth: T::zero(),
        rates: [T::zero(); 3],
    }
}

/// λ, the width of a strip of the bend k by that of its edge layers.
pub(super) fn layers(bend: f64, plate: &Plate) -> f64 {
    let width = 2.0 * plate.half_width;
    (0.25 * plate.stretching * bend * bend * width.powi(4)).powf(0.25)
}

/// Energy of a rib without what the layers along the edges relieve, from b(t,t) and b(n,n) at the spine.
fn without_layers(
    rib: &Rib<f64>,
    plate: &Plate,
    points: usize,
    [bend, transverse]: [f64; 2],
) -> f64 {
    let moment = transverse + plate.poisson * (bend - plate.natural);
    let share = psi(layers(bend, plate).powi(4));
    rib.energy(plate, &Across::gauss(points)) + 0.5 * moment * moment * share
}

/// Least energy of a uniform strip of k and τ over its transverse curvature, by ribs of a slope: the energy is a parabola.
pub(super) fn least(plate: &Plate, bend: f64, torsion: f64, slope: f64) -> f64 {
    let rule = Across::gauss(6);
    let developable = if bend == 0.0 {
        0.0
    } else {
        torsion * torsion / bend
    };
    let (_, first, second) = second_derivative(
        |transverse| uniform([bend.into(), torsion.into(), transverse], slope).energy(plate, &rule),
        developable,
    );
    let transverse = developable - first / second;
    uniform([bend, torsion, transverse], slope).energy(plate, &rule)
}

/// Energy of Audoly and Neukirch of a ribbon with the natural curvature of its plate.
pub(super) fn audoly_neukirch(plate: &Plate, bend: f64, torsion: f64) -> f64 {
    let lambda = layers(bend, plate);
    // Beyond λ = 300 the hyperbolic functions overflow; their quotient is 1 there.
    let quotient = match lambda < 300.0 {
        true => (lambda.cosh() - lambda.cos()) / (lambda.sinh() + lambda.sin()),
        false => 1.0,
    };
    let phi = 2.0 / lambda * quotient;
    let (nu, change) = (plate.poisson, bend - plate.natural);
    let across = torsion * torsion / bend;
    let moment = across + nu * change;
    let plain = change * change
        + across * across
        + 2.0 * nu * change * across
        + 2.0 * (1.0 - nu) * torsion * torsion;
    0.5 * (plain - moment * moment * phi)
}

#[test]
fn test_a_flat_strip_that_is_twisted_costs_torsion_and_stretching() {
    for thickness in [7e-3, THICKNESS, 1.75e-4] {
        let plate = plate(thickness, 0.0);
        for torsion in [0.1, -1.0, 4.0] {
            let exact = (1.0 - POISSON) * torsion.powi(2)
                + plate.stretching * WIDTH.powi(4) * torsion.powi(4) / 1440.0;
            for slope in [0.0, 0.3, -0.8] {
                for points in 4..=8 {
                    let rib = uniform([0.0, torsion, 0.0], slope);
                    let found = rib.energy(&plate, &Across::gauss(points));
                    assert_relative_eq!(found, exact, max_relative = 1e-11);
                }
            }
        }
    }
}

#[test]
fn test_a_cylinder_has_the_same_energy_at_every_winding_angle_and_rib_slope() {
    let plate = plate(THICKNESS, 0.0);
    for radius in [0.15, -0.6] {
        for angle in [0.0f64, 0.4, -1.1] {
            let (s, c) = angle.sin_cos();
            let tensor = [c * c / radius, s * c / radius, s * s / radius];
            for slope in [0.0, angle.tan(), 0.7, -0.5] {
                let rib = uniform(tensor, slope);
                let found = without_layers(&rib, &plate, 6, [tensor[0], tensor[2]]);
                assert_relative_eq!(found, 0.5 / radius.powi(2), max_relative = 1e-11);
            }
        }
    }
}

/// The rib of a cylinder that a board of in-plane curvature κ_g is wound on, where its ribs turn along the spine.
///
/// The cylinder's curvature is the same all over the board; seen from the spine its direction turns by −κ_g.
fn wound(radius: f64, geodesic: f64, u: f64) -> (Rib<f64>, [f64; 2]) {
    fn fields<T: DualNum<Primitive = f64> + Copy>(radius: f64, geodesic: f64, u: T) -> [T; 6] {
        let (s, c) = (-u * geodesic + 0.5).sin_cos();
        let [bend, torsion, transverse] = [c * c, s * c, s * s].map(|part| part / radius);
        let slope = u * u * 9.0 - u * 4.0 + 0.3;
        let twist = torsion - slope * bend;
        let across = transverse - slope * twist * 2.0 - slope * slope * bend;
        let slope_rate = u * 18.0 - 4.0;
        // The sixth place is b(n,n).
        [-bend, slope, slope_rate, twist, across, transverse]
    }
    let at = |i: usize| second_derivative(|u| fields(radius, geodesic, u)[i], u);
    let (across, across_rate, across_second) = at(4);
    let values = [at(0).0, at(1).0, at(2).0, at(3).0, across, across_rate];
    let rates = [
        at(0).1,
        at(1).1,
        at(2).1,
        at(3).1,
        across_rate,
        across_second,
    ];
    let rib = Rib::of(&values, &rates, geodesic);
    (rib, [rib.bend, at(5).0])
}

#[test]
fn test_a_cylinder_of_a_curved_board_has_the_same_energy_where_its_ribs_turn() {
    for geodesic in [0.0, 1.4, -6.0] {
        let plate = Plate {
            geodesic,
            ..plate(THICKNESS, 0.0)
        };
        for u in [0.0, 0.1, 0.3] {
            let (rib, tensor) = wound(0.2, geodesic, u);
            assert!(rib.convergence.abs() * plate.half_width < 0.6);
            let found = without_layers(&rib, &plate, 8, tensor);
            assert_relative_eq!(found, 12.5, max_relative = 1e-11);
        }
    }
}

#[test]
fn test_straight_ribs_have_the_energy_of_a_developable_strip() {
    // The share y at the edge, then the bound of the error: that of the rule of eight points across.
    for (y, bound) in [(0.0, 1e-13), (0.1, 1e-13), (-0.5, 1e-8), (0.9, 1e-3)] {
        for (natural, geodesic) in [(0.0, 0.0), (0.0, 2.0), (6.0, 0.0), (-3.0, -1.0)] {
            let plate = Plate {
                geodesic,
                ..plate(THICKNESS, natural)
            };
            for (k, slope) in [(8.0, 0.0), (-5.0, 0.4), (0.3, -1.2)] {
                let rib = Rib {
                    bend: k,
                    twist: 0.0,
                    slope,
                    across: 0.0,
                    convergence: y / plate.half_width,
                    growth: 0.0,
                    rates: [0.0, 30.0, 0.0],
                };
                let share = if y == 0.0 { 1.0 } else { f64::atanh(y) / y };
                let square = 1.0 + slope * slope;
                let exact = 0.5 * (k * square).powi(2) * share - natural * square * k
                    + 0.5 * natural * natural
                    + (1.0 - POISSON) * natural * slope * slope * k;
                let found = without_layers(&rib, &plate, 8, [k, slope * slope * k]);
                let scale = 0.5 * (k * square).powi(2) * share + 0.5 * natural * natural;
                assert!(
                    (found - exact).abs() <= bound * scale,
                    "{y} {natural} {k} {slope}: {found} {exact}"
                );
            }
        }
    }
}

#[test]
fn test_the_least_energy_across_a_uniform_strip_is_that_of_audoly_and_neukirch() {
    let plate = plate(THICKNESS, 0.0);
    // k of one unit of λ².
    let unit = 1.0 / layers(1.0, &plate).powi(2);
    for lambda in [0.1f64, 0.5, 1.0, 1.5, 1.9, 3.0, 6.0, 13.6, 60.0, 250.0] {
        for sign in [1.0, -1.0] {
            let bend = sign * unit * lambda * lambda;
            for torsion in [0.0, 0.3 * bend, -1.2 * bend] {
                let exact = audoly_neukirch(&plate, bend, torsion);
                for slope in [0.0, 0.4, torsion / bend] {
                    let found = least(&plate, bend, torsion, slope);
                    assert_relative_eq!(found, exact, max_relative = 1e-9);
                }
            }
        }
    }
}

#[test]
fn test_a_strip_that_is_much_bent_for_its_thickness_tends_to_ribs_without_bend() {
    let (bend, torsion) = (5.0f64, 2.0f64);
    let developable = 0.5 * (bend + torsion * torsion / bend).powi(2);
    let moment = torsion * torsion / bend + POISSON * bend;
    for thickness in [THICKNESS, 1.75e-4, 4.4e-5, 1.1e-6] {
        let plate = plate(thickness, 0.0);
        let gap = developable - least(&plate, bend, torsion, torsion / bend);
        let exact = 0.5 * moment * moment * 2.0 / layers(bend, &plate);
        assert_relative_eq!(gap, exact, max_relative = 1e-4);
    }
}

#[test]
fn test_ribs_that_meet_within_the_width_have_no_finite_energy() {
    let plate = plate(THICKNESS, 0.0);
    for convergence in [20.0, -20.1] {
        let mut rib = uniform([8.0, 0.5, 0.1], 0.2);
        rib.convergence = convergence;
        assert_eq!(rib.energy(&plate, &Across::gauss(6)), f64::INFINITY);
    }
}

#[test]
fn test_the_energy_of_small_bends_has_the_stiffness_of_a_rod_along_and_of_a_plate_across() {
    let plate = plate(THICKNESS, 0.0);
    let rule = Across::gauss(6);
    // With its edges free the strip bends as a rod: (1 − ν²) k²/2.
    let bend = 1e-4;
    let exact = 0.5 * (1.0 - POISSON * POISSON) * bend * bend;
    assert_relative_eq!(least(&plate, bend, 0.0, 0.0), exact, max_relative = 1e-8);
    // Bent across alone, a share of 0.3 of the moment is relieved by its edges: 0.7 δ²/2, and no slope at rest.
    let across =
        |transverse| uniform([0.0.into(), 0.0.into(), transverse], 0.0).energy(&plate, &rule);
    let (value, slope) = first_derivative(across, 2.0);
    assert_relative_eq!(value, 0.7 * 2.0, max_relative = 1e-12);
    assert_relative_eq!(slope, 0.7 * 2.0, max_relative = 1e-12);
}
