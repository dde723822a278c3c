//! Steps of the fields of a node, inequalities of an element, and the fields within it.

use super::*;
use crate::strip::element::Curl;

type Fields = SVector<f64, FIELDS>;

/// Fields of nodes: bend ω_ζ, β, β', m, q, q'.
const NODES: [[f64; FIELDS]; 3] = [
    [-8.0, 0.2, 4.0, 0.5, -0.1, 1.5],
    [5.0, -0.4, -12.0, 1.2, 0.3, -6.0],
    [0.3, 0.5, 18.0, -0.4, 0.9, -9.0],
];
/// A step of them.
const STEP: [f64; FIELDS] = [0.7, -0.3, 2.0, 0.4, -0.25, 3.0];

fn shell() -> Shell {
    Shell::new(Gauge::WEAK, 6)
}

/// Curvature k, τ, δ of the spine by the axes of the board.
fn tensor(fields: &Fields) -> [f64; 3] {
    let [bend, slope, _, twist, across, _] = (*fields).into();
    let k = -bend;
    [
        k,
        twist + slope * k,
        across + 2.0 * slope * twist + slope * slope * k,
    ]
}

#[test]
fn test_steps_of_the_rib_slope_alone_keep_the_curvature() {
    for node in NODES.map(Fields::from) {
        let [k, _, _] = tensor(&node);
        let twist = node[3];
        for size in [1e-3, 0.2, -0.9] {
            // To the first order: τ = m + β k and δ = q + 2 β m + β² k are kept.
            let by_slope = [0.0, 1.0, 0.0, -k, -2.0 * twist, 0.0].map(|part| part * size);
            let moved = shell().moved(&node, &by_slope.into());
            assert_relative_eq!(moved[1], node[1] + size, epsilon = 1e-15);
            for (found, exact) in tensor(&moved).into_iter().zip(tensor(&node)) {
                assert_relative_eq!(found, exact, max_relative = 1e-13, epsilon = 1e-13);
            }
        }
    }
}

#[test]
fn test_curvature_is_linear_along_every_step() {
    for node in NODES.map(Fields::from) {
        let start = tensor(&node);
        let change = |size: f64| {
            let end = tensor(&shell().moved(&node, &(Fields::from(STEP) * size)));
            [0, 1, 2].map(|i| (end[i] - start[i]) / size)
        };
        let [one, half, back] = [1.0, 0.5, -1.0].map(change);
        for i in 0..3 {
            assert_relative_eq!(one[i], half[i], max_relative = 1e-12);
            assert_relative_eq!(one[i], back[i], max_relative = 1e-12);
        }
    }
}

#[test]
fn test_a_small_step_adds_to_the_fields() {
    for node in NODES.map(Fields::from) {
        assert_eq!(shell().moved(&node, &Fields::zeros()), node);
        let size = 1e-6;
        let moved = shell().moved(&node, &(Fields::from(STEP) * size));
        let off = moved - node - Fields::from(STEP) * size;
        assert!(off.amax() < 1e-10, "{off}");
    }
}

#[test]
fn test_the_curvature_of_steps_is_their_second_derivative_along_a_gradient() {
    let gradient = Fields::from([3.0, -2.0, 0.7, 5.0, -4.0, 1.3]);
    // Steps are cubic, and the cubic part of a centred second difference is 0: any distance will do.
    let distance = 0.5;
    for node in NODES.map(Fields::from) {
        let found = shell().curvature_of_steps(&node, || gradient).unwrap();
        for i in 0..FIELDS {
            for j in 0..FIELDS {
                let at = |a: f64, b: f64| {
                    let mut step = Fields::zeros();
                    step[i] += a * distance;
                    step[j] += b * distance;
                    gradient.dot(&shell().moved(&node, &step))
                };
                let sum = at(1.0, 1.0) - at(1.0, -1.0) - at(-1.0, 1.0) + at(-1.0, -1.0);
                let exact = sum / (4.0 * distance * distance);
                assert_relative_eq!(found[(i, j)], exact, epsilon = 1e-11);
            }
        }
    }
}

fn element(geodesic: f64) -> Element {
    Element {
        length: 0.0125,
        geodesic,
        rigidity: [1.3, 0.7],
        half_width: 0.05,
        curl: Curl {
            bend: -3.0,
            poisson: 0.34,
        },
        stretching: 12.0 * (1.0 - 0.34 * 0.34) / (7e-4f64 * 7e-4),
    }
}

/// No active edges.
const EDGES: [Option<Edge>; ACTIVE] = [None; ACTIVE];
/// In-plane curvatures κ_g, 1/U.
const BOARDS: [f64; 3] = [0.0, 1.4, -6.0];

fn slacks(element: &Element, ends: [&Fields; 2]) -> Vec<f64> {
    let mut slacks = Vec::new();
    shell().slacks(element, &EDGES, ends, &mut slacks);
    slacks
}

#[test]
fn test_slacks_keep_ribs_a_tenth_from_where_they_meet_at_the_edge() {
    // Ribs of a convergence that is the same all along a straight element.
    for y in [0.0, 0.6, -0.8] {
        let (element, rate) = (element(0.0), y / 0.05);
        let at = |u: f64| Fields::from([2.0, 0.1 + rate * u, rate, 0.3, 0.2, 0.1]);
        let slacks = slacks(&element, [&at(0.0), &at(element.length)]);
        assert_eq!(slacks.len(), shell().inequalities(&element, &EDGES));
        for pair in slacks.chunks_exact(2) {
            assert_relative_eq!(pair[0], 0.9 - y, epsilon = 1e-12);
            assert_relative_eq!(pair[1], 0.9 + y, epsilon = 1e-12);
        }
    }
    // On a curved board square ribs meet in its centre.
    let square = Fields::zeros();
    for pair in slacks(&element(6.0), [&square; 2]).chunks_exact(2) {
        assert_relative_eq!(pair[0], 0.6, epsilon = 1e-14);
    }
}

#[test]
fn test_slacks_are_linearised_as_their_differences_are() {
    for geodesic in BOARDS {
        let element = element(geodesic);
        let count = shell().inequalities(&element, &EDGES);
        let multipliers: Vec<f64> = (0..count).map(|i| 0.3 + 0.7 * i as f64).collect();
        let ends = [Fields::from(NODES[0]), Fields::from(NODES[1])];
        let mut gradients = vec![[Fields::zeros(); 2]; count];
        let mut controls = StageMatrix::zeros();
        let both = [&ends[0], &ends[1]];
        shell().linearise_slacks(
            &element,
            &EDGES,
            both,
            &multipliers,
            &mut gradients,
            &mut controls,
        );
        // Slacks are quadratic in the fields: centred differences are exact at any distance.
        let distance = 0.25;
        let at = |moves: [(usize, f64); 2]| {
            let mut ends = ends;
            for (place, by) in moves {
                ends[place / FIELDS][place % FIELDS] += by * distance;
            }
            slacks(&element, [&ends[0], &ends[1]])
        };
        let weighted = |slacks: Vec<f64>| -> f64 {
            let products = slacks.iter().zip(&multipliers).map(|(s, m)| s * m);
            products.sum()
        };
        for i in 0..2 * FIELDS {
            let [up, down] = [1.0, -1.0].map(|by| at([(i, by), (i, 0.0)]));
            for row in 0..count {
                let exact = (up[row] - down[row]) / (2.0 * distance);
                let found = gradients[row][i / FIELDS][i % FIELDS];
                assert_relative_eq!(found, exact, epsilon = 1e-11, max_relative = 1e-11);
            }
            for j in 0..2 * FIELDS {
                let part = |a: f64, b: f64| weighted(at([(i, a), (j, b)]));
                let sum = part(1.0, 1.0) - part(1.0, -1.0) - part(-1.0, 1.0) + part(-1.0, -1.0);
                let second = sum / (4.0 * distance * distance);
                let place = (i % FIELDS, j % FIELDS);
                let found = match (i / FIELDS, j / FIELDS) {
                    (0, 0) => controls.first[place],
                    (0, 1) => controls.mixed[place],
                    (1, 1) => controls.second[place],
                    _ => continue,
                };
                assert_relative_eq!(found, -second, epsilon = 1e-9, max_relative = 1e-9);
            }
        }
    }
}

#[test]
fn test_within_an_element_bend_and_twist_are_linear_and_slope_and_bend_across_are_cubic() {
    let element = element(0.0);
    let line = |u: f64| [0.4 - 7.0 * u, -7.0];
    let cubic = |u: f64| {
        [
            0.3 + u * (-2.0 + u * (40.0 + 900.0 * u)),
            -2.0 + u * (80.0 + 2700.0 * u),
            80.0 + 5400.0 * u,
        ]
    };
    let node = |u: f64| {
        let ([bend, _], [slope, rate, _]) = (line(u), cubic(u));
        [bend, slope, rate, -3.0 * bend, 2.0 * slope, 2.0 * rate]
    };
    let ends = [node(0.0), node(element.length)];
    for t in [0.0, 0.2, 0.5, 0.9, 1.0] {
        let u = t * element.length;
        let section = shell().section(&element, ends, t);
        let [_, rate, second] = cubic(u);
        let [_, bend_rate] = line(u);
        let rates = [
            bend_rate,
            rate,
            second,
            -3.0 * bend_rate,
            2.0 * rate,
            2.0 * second,
        ];
        for (found, exact) in section.fields.iter().zip(node(u)) {
            assert_relative_eq!(*found, exact, epsilon = 1e-12);
        }
        for (found, exact) in section.rates.iter().zip(rates) {
            assert_relative_eq!(*found, exact, epsilon = 1e-10);
        }
    }
}

#[test]
fn test_the_term_of_the_gauge_is_its_weights_times_slope_excess_sway_and_closeness() {
    for geodesic in BOARDS {
        let element = element(geodesic);
        let ends = [NODES[0], NODES[0].map(|field| 1.01 * field)];
        let energy = |[slopes, sway, closeness]: [f64; 3]| {
            let gauge = Gauge {
                slopes,
                sway,
                closeness,
            };
            let shell = Shell::new(gauge, 6);
            shell.value(&shell.section(&element, ends, 0.3))
        };
        let share = |t: f64| {
            let [_, slope, slope_rate, ..] = shell().section(&element, ends, t).fields;
            0.05 * (slope_rate + geodesic * (1.0 + slope * slope))
        };
        let slope = shell().section(&element, ends, 0.3).fields[1];
        let step = 1e-4;
        let rate = (share(0.3 + step) - share(0.3 - step)) / (2.0 * step * element.length);
        // ½ (D/V) (ε (w² + β²) + (ε' (V y')² + ε″ w² y²/(0.9² − y²)) h̃/V) with w = y − κ_g V/2, at D V = 1 and V = 0.1, with h̃ = √(D/(E h)).
        let y = share(0.3);
        let excess = y - 0.05 * geodesic;
        let thickness = 1.0 / (0.1 * element.stretching.sqrt());
        let by_slopes = 50.0 * (excess * excess + slope * slope);
        let by_sway = 50.0 * (0.1 * rate).powi(2) * thickness;
        let by_closeness = 50.0 * (excess * y).powi(2) / (0.81 - y * y) * thickness;
        let bare = energy([0.0; 3]);
        let close = |weights: [f64; 3], expected: f64| {
            assert_relative_eq!(energy(weights) - bare, expected, max_relative = 1e-6);
        };
        close([1e-2, 0.0, 0.0], 1e-2 * by_slopes);
        close([0.0, 0.3, 0.0], 0.3 * by_sway);
        close([0.0, 0.0, 2.0], 2.0 * by_closeness);
    }
}
