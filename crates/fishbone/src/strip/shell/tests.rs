//! The density against reference values and limits.

mod curve;
mod joints;
mod limits;
mod natural;
mod steps;
mod tensor;

use super::*;
use approx::assert_relative_eq;
use num_dual::{Dual64, first_derivative};

/// A point of the reference: (V, h, ν, k0), (k m β q s g), rates of (m, s, g), κ_g, points across; then density and gradient by
/// (k m β q s g | m' s' g').
struct Reference {
    name: &'static str,
    belt: [f64; 4],
    rib: [f64; 9],
    geodesic: f64,
    points: usize,
    value: f64,
    gradient: [f64; 9],
}

impl Reference {
    fn plate(&self) -> Plate {
        let [width, thickness, poisson, natural] = self.belt;
        Plate {
            half_width: 0.5 * width,
            geodesic: self.geodesic,
            natural,
            poisson,
            stretching: 12.0 * (1.0 - poisson * poisson) / (thickness * thickness),
        }
    }
}

/// No term that chooses a rib slope.
const NO_GAUGE: Gauge = Gauge {
    slopes: 0.0,
    sway: 0.0,
    closeness: 0.0,
};

/// Reference values of an independent implementation by automatic differentiation. They include the term of the gauge of
/// weight 3e-4.
const REFERENCES: [Reference; 8] = [
    Reference {
        name: "A",
        belt: [0.1, 0.0007, 0.34, 0.0],
        rib: [8.0, 0.5, 0.2, -0.1, 4.0, 1.5, -6.0, 30.0, 12.0],
        geodesic: 0.0,
        points: 6,
        value: 37.55993341170095,
        gradient: [
            9.119688922970573,
            7.713983559665915,
            34.19319912033234,
            -22.869629611870106,
            0.226377879396928,
            0.04533138874329134,
            0.05839803546890166,
            0.004375090038218444,
            0.003989901178653062,
        ],
    },
    Reference {
        name: "B",
        belt: [0.1, 0.0007, 0.34, 0.0],
        rib: [-5.0, 1.2, -0.4, 0.3, -12.0, -6.0, 15.0, -150.0, 80.0],
        geodesic: 0.0,
        points: 6,
        value: 70.69238929781662,
        gradient: [
            -14.318084704723313,
            76.72979036447504,
            -80.28652204242046,
            59.88421442139484,
            -9.704432640733657,
            -1.3557796878043962,
            0.49558147790670515,
            -0.059681015842449774,
            -0.011604771928749709,
        ],
    },
    Reference {
        name: "C",
        belt: [0.1, 0.0007, 0.34, 0.0],
        rib: [0.3, 2.0, 0.1, 0.02, 2.0, 0.5, 10.0, 20.0, -30.0],
        geodesic: 0.0,
        points: 6,
        value: 27.645366935828154,
        gradient: [
            0.48298025053073107,
            52.146734199683515,
            2.689942715007131,
            -3.5685588351160713,
            0.699571743419176,
            0.1504951709218293,
            0.011924379935444393,
            0.001369138708862874,
            0.0003203877979129549,
        ],
    },
    Reference {
        name: "D",
        belt: [0.1, 0.0007, 0.34, 0.0],
        rib: [0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 5.0, 0.0, 0.0],
        geodesic: 0.0,
        points: 6,
        value: 2.1744982993197315,
        gradient: [
            0.0,
            7.336326530612259,
            0.0,
            0.0,
            0.0,
            0.0,
            0.004166666666666666,
            0.0,
            0.0,
        ],
    },
    Reference {
        name: "E",
        belt: [0.1, 0.000175, 0.34, 0.0],
        rib: [8.0, 0.2, 0.6, 0.05, 16.0, 1.0, -6.0, -60.0, 20.0],
        geodesic: 0.0,
        points: 6,
        value: 80.49592806517452,
        gradient: [
            20.43253405317239,
            16.109531357255477,
            142.6203367429291,
            90.96758908390714,
            3.4401832723047563,
            0.35083880733418693,
            1.214899912167969,
            0.04101373639652561,
            0.027909303023424117,
        ],
    },
    Reference {
        name: "F",
        belt: [0.1, 0.0007, 0.34, 0.0],
        rib: [-4.3, 0.4, 0.5, 0.1, 18.0, -9.0, 30.0, -60.0, -500.0],
        geodesic: 1.4,
        points: 6,
        value: 11.215340637622827,
        gradient: [
            -4.79037256319048,
            4.749289180822079,
            14.14941925106748,
            4.796262574566076,
            1.5100786117047125,
            0.19209417463723558,
            0.12486541349814201,
            0.010081485562762558,
            0.002746297617630123,
        ],
    },
    Reference {
        name: "G",
        belt: [0.1, 0.0007, 0.34, 6.0],
        rib: [8.0, 0.5, 0.2, -0.1, 4.0, 1.5, -6.0, 30.0, 12.0],
        geodesic: 0.0,
        points: 6,
        value: 7.323248256792571,
        gradient: [
            3.112929502045348,
            6.839815711203406,
            26.811636655250442,
            -24.618347529199273,
            0.25187155627394825,
            0.04297087472366661,
            0.03762515955238918,
            0.001601213449080976,
            0.0013932916890890055,
        ],
    },
    Reference {
        name: "H",
        belt: [0.05, 0.001, 0.3, 0.0],
        rib: [12.0, -1.0, 0.3, -0.4, -10.0, 3.0, 8.0, 100.0, -40.0],
        geodesic: 8.72665,
        points: 4,
        value: 77.56783624530446,
        gradient: [
            13.538035794126733,
            4.542876534344657,
            57.72787924602038,
            -3.658653122606599,
            -0.23638816419886494,
            -0.0059519158955960065,
            -0.05518990246218886,
            -0.0034896233274899846,
            0.001548471428147213,
        ],
    },
];

/// Weight of the gauge in the reference values.
const GAUGE: f64 = 3e-4;

fn rib<T: DualNum<Primitive = f64> + Copy>(x: [T; 9]) -> Rib<T> {
    let [bend, twist, slope, across, convergence, growth, a, b, c] = x;
    Rib {
        bend,
        twist,
        slope,
        across,
        convergence,
        growth,
        rates: [a, b, c],
    }
}

#[test]
fn test_density_and_gradient_are_those_of_an_independent_implementation() {
    for case in &REFERENCES {
        let (plate, rule) = (case.plate(), Across::gauss(case.points));
        let width = 2.0 * plate.half_width;
        for i in 0..9 {
            let energy = |x: Dual64| {
                let mut fields = case.rib.map(Dual64::from);
                fields[i] = x;
                let rib = rib(fields);
                let y = rib.convergence * plate.half_width;
                let gauge = (y * y + rib.slope * rib.slope) * (0.5 * GAUGE / (width * width));
                rib.energy(&plate, &rule) + gauge
            };
            let (value, slope) = first_derivative(energy, case.rib[i]);
            assert_relative_eq!(value, case.value, max_relative = 1e-12);
            let exact = case.gradient[i];
            let off = (slope - exact).abs();
            assert!(
                off <= 1e-11 * exact.abs() + 1e-12,
                "{} {i} {slope} {exact}",
                case.name
            );
        }
    }
}
