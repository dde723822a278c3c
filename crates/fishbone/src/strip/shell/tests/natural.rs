//! The density of a strip that is curled when it is at rest.

use super::limits::{audoly_neukirch, layers, least, plate, uniform};
use super::*;

/// Natural curvature k0, 1/U.
const NATURAL: f64 = 6.0;
/// Thickness h, U.
const THICKNESS: f64 = 7e-4;

/// Energy of straight ribs in a uniform helix with a natural curvature: what the energy tends to in thin strips.
fn developable(poisson: f64, bend: f64, torsion: f64) -> f64 {
    let across = torsion * torsion / bend;
    let curvature = bend + across;
    0.5 * (curvature * curvature - 2.0 * NATURAL * curvature + NATURAL * NATURAL)
        + (1.0 - poisson) * NATURAL * across
}

#[test]
fn test_a_rolled_strip_that_is_opened_flat_keeps_the_energy_of_its_curl() {
    let plate = plate(THICKNESS, NATURAL);
    let nu = plate.poisson;
    let free = 0.5 * (1.0 - nu * nu) * NATURAL * NATURAL;
    assert_relative_eq!(least(&plate, 0.0, 0.0, 0.0), free, max_relative = 1e-12);
    assert_relative_eq!(least(&plate, 0.0, 0.0, 0.7), free, max_relative = 1e-12);
    assert_relative_eq!(free, 15.9192, epsilon = 5e-9);
}

#[test]
fn test_a_rolled_strip_that_is_opened_flat_curves_across_by_poissons_share() {
    let plate = plate(THICKNESS, NATURAL);
    let rule = Across::gauss(6);
    let slope = |across: f64| {
        let energy = |across| uniform([0.0.into(), 0.0.into(), across], 0.0).energy(&plate, &rule);
        first_derivative(energy, across).1
    };
    assert!(slope(plate.poisson * NATURAL).abs() < 1e-12);
    assert!(slope(plate.poisson * NATURAL + 0.1) > 0.0);
}

#[test]
fn test_a_rolled_strip_that_is_held_flat_is_relieved_by_its_edges() {
    let plate = plate(THICKNESS, NATURAL);
    let found = uniform([0.0; 3], 0.0).energy(&plate, &Across::gauss(6));
    let exact = 0.5 * NATURAL * NATURAL * (1.0 - 0.3 * plate.poisson * plate.poisson);
    assert_relative_eq!(found, exact, max_relative = 1e-12);
    assert_relative_eq!(found, 17.37576, epsilon = 5e-9);
}

#[test]
fn test_a_rolled_strip_at_rest_has_no_energy_and_no_force() {
    let plate = plate(THICKNESS, NATURAL);
    let rule = Across::gauss(6);
    let rest = [NATURAL, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    for i in 0..9 {
        let energy = |x: Dual64| {
            let mut fields = rest.map(Dual64::from);
            fields[i] = x;
            rib(fields).energy(&plate, &rule)
        };
        let (value, slope) = first_derivative(energy, rest[i]);
        assert!(value.abs() < 1e-13, "{value}");
        assert!(slope.abs() < 1e-12, "{i} {slope}");
    }
}

#[test]
fn test_a_small_bend_from_rest_has_the_energy_of_an_independent_implementation() {
    let plate = plate(THICKNESS, NATURAL);
    let found = least(&plate, NATURAL + 0.1, 0.0, 0.0);
    assert_relative_eq!(found, 0.004_902_97, epsilon = 5e-9);
    let exact = audoly_neukirch(&plate, NATURAL + 0.1, 0.0);
    assert_relative_eq!(found, exact, max_relative = 1e-9);
}

/// Uniform helices of a strip with the natural curvature 6: k, τ, h, then the least energy of an independent implementation
/// over q, to its printed digits.
const HELICES: [[f64; 4]; 12] = [
    [5.0, 2.0, 7e-4, 3.1683818],
    [5.0, 2.0, 1.75e-4, 3.1781914],
    [5.0, 2.0, 4.4e-5, 3.1830817],
    [5.0, 2.0, 1.1e-6, 3.1872223],
    [3.0, 3.0, 7e-4, 11.4108677],
    [3.0, 3.0, 1.75e-4, 11.6453901],
    [3.0, 3.0, 4.4e-5, 11.7623604],
    [3.0, 3.0, 1.1e-6, 11.8613995],
    [8.0, -1.0, 7e-4, 2.7053171],
    [8.0, -1.0, 1.75e-4, 2.7290647],
    [8.0, -1.0, 4.4e-5, 2.7409047],
    [8.0, -1.0, 1.1e-6, 2.7509297],
];

#[test]
fn test_uniform_helices_of_a_rolled_strip_have_the_energy_of_an_independent_implementation() {
    for [bend, torsion, thickness, energy] in HELICES {
        let plate = plate(thickness, NATURAL);
        for slope in [0.0, torsion / bend] {
            let found = least(&plate, bend, torsion, slope);
            assert_relative_eq!(found, energy, epsilon = 5.1e-8);
            let exact = audoly_neukirch(&plate, bend, torsion);
            assert_relative_eq!(found, exact, max_relative = 1e-9);
        }
    }
}

#[test]
fn test_the_gap_of_helices_to_straight_ribs_falls_as_the_width_of_the_edge_layers() {
    for [bend, torsion, thickness, _] in HELICES {
        let plate = plate(thickness, NATURAL);
        let moment = torsion * torsion / bend + plate.poisson * (bend - NATURAL);
        let gap = developable(plate.poisson, bend, torsion) - least(&plate, bend, torsion, 0.0);
        let exact = 0.5 * moment * moment * 2.0 / layers(bend, &plate);
        // At h = 7e-4 and k = 3 the layers of both edges still meet: e^−λ is 2e-4.
        assert_relative_eq!(gap, exact, max_relative = 1e-3);
    }
}
