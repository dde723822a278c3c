//! A density defined outside the crate, with a third field, is solved by the programme unchanged.

use fishbone::geometry::Pose;
use fishbone::problem::program::{BeltPoint, BeltProgram, Hold, NodeSupport, Piece};
use fishbone::strip::automatic;
use fishbone::strip::density::{Density, Section};
use fishbone::strip::element::Curl;
use fishbone::strip::element::Element;
use nalgebra::{SVector, UnitQuaternion, Vector3};
use num_dual::DualNum;
use stagewise::{Linearisation, Multipliers, NodeVector, Outcome, Program, Settings, Values};
use std::ops::ControlFlow;

// A strip whose ribs need not be exact: a twist m in addition to the ribs' twist, resisted by the density's own stiffness.
#[derive(Debug, Clone, PartialEq)]
struct Relaxed {
    stiffness: f64,
}

impl Density<3> for Relaxed {
    type Motions = automatic::Motions<3>;
    type Derivatives = automatic::Derivatives<3>;

    fn value<T: DualNum<Primitive = f64> + Copy>(&self, section: &Section<'_, T, 3>) -> T {
        let [bend, slope, twist] = section.fields;
        let curvature = bend * (slope * slope + 1.0);
        let rates = section.rates;
        let smooth = rates[1] * rates[1] + rates[2] * rates[2];
        (curvature * curvature + twist * twist * self.stiffness + smooth * 1e-3) * 0.5
    }

    fn torsion_and_bend<T: DualNum<Primitive = f64> + Copy>(&self, fields: &[T; 3]) -> [T; 2] {
        let [bend, slope, twist] = *fields;
        [twist - slope * bend, bend]
    }
}

type Relax = BeltProgram<Relaxed, 3, 9>;

/// Elements of the test belt, a number.
const ELEMENTS: usize = 40;

fn program(stiffness: f64) -> Relax {
    let element = Element::straight(1.0 / ELEMENTS as f64, 0.05, Curl::default());
    let clamp = |node, position: [f64; 3], turn: f64| NodeSupport {
        node,
        position: position.map(Some),
        hold: Hold::Frame(UnitQuaternion::from_scaled_axis(turn * Vector3::x())),
        square_rib: true,
    };
    let pieces = vec![Piece::Strip(element); ELEMENTS];
    let supports = vec![
        clamp(0, [0.0; 3], 0.0),
        clamp(ELEMENTS, [0.0, 0.7, 0.0], 0.5),
    ];
    BeltProgram::new(pieces, Relaxed { stiffness }).with_supports(supports)
}

/// An arch that twists a little.
fn start(program: &Relax) -> BeltPoint<3> {
    let fields = |k: usize| {
        let u = k as f64 / ELEMENTS as f64;
        let wave = (2.0 * std::f64::consts::PI * u).cos();
        SVector::from([-6.0 * wave, 0.1 * u * (1.0 - u), 0.2 * u])
    };
    let mut point = BeltPoint {
        fields: (0..=ELEMENTS).map(fields).collect(),
        poses: vec![Pose::identity(); ELEMENTS + 1],
    };
    program.settle(&mut point);
    point
}

fn solved(stiffness: f64) -> stagewise::Solution<BeltPoint<3>> {
    let program = program(stiffness);
    let settings = Settings {
        tolerance: 1e-8,
        iterations: 200,
        barrier: 10.0,
        longest_step: f64::INFINITY,
    };
    stagewise::minimise(&program, &settings, start(&program), &mut || {
        ControlFlow::Continue(())
    })
}

#[test]
fn test_a_density_with_a_third_field_is_solved_and_softens_with_its_stiffness() {
    let energies = [1e4, 1.0, 1e-2].map(|stiffness| {
        let found = solved(stiffness);
        assert_eq!(found.outcome, Outcome::Converged, "{stiffness}");
        found.values.objective
    });
    assert!(energies[0] > energies[1] && energies[1] > energies[2]);
    let twist = |found: &stagewise::Solution<BeltPoint<3>>| {
        let fields = found.at.point.fields.iter();
        fields.map(|fields| fields[2].abs()).fold(0.0, f64::max)
    };
    assert!(twist(&solved(1e4)) < 1e-2 && twist(&solved(1e-2)) > 0.1);
}

#[test]
fn test_derivatives_of_an_outside_density_agree_with_finite_differences() {
    let program = program(1.0);
    let at = start(&program);
    let layout = program.layout();
    let multipliers = Multipliers {
        equalities: (0..layout.equalities())
            .map(|row| 0.3 * row as f64 - 1.0)
            .collect(),
        inequalities: vec![0.1; layout.inequalities()],
    };
    let mut linear = Linearisation::new(layout);
    program.linearise(&at, &multipliers, &mut linear);
    let value = |steps: &[(usize, usize, f64)]| {
        let mut step = vec![NodeVector::<9>::zeros(); ELEMENTS + 1];
        for (node, entry, size) in steps {
            step[*node][*entry] += size;
        }
        let mut moved = at.clone();
        program.retract(&at, &step, 1.0, &mut moved);
        let mut values = Values::default();
        assert!(program.evaluate(&mut moved, &mut values));
        let rows = values.equalities.iter().zip(&multipliers.equalities);
        values.objective
            + rows
                .map(|(value, multiplier)| value * multiplier)
                .sum::<f64>()
    };
    let unit = |(node, entry): (usize, usize)| {
        let mut step = vec![NodeVector::<9>::zeros(); ELEMENTS + 1];
        step[node][entry] = 1.0;
        linear.chain.carry(&mut step);
        step
    };
    let h = 1e-4;
    let unknowns = [
        (0, 4),
        (3, 6),
        (3, 7),
        (3, 8),
        (4, 8),
        (17, 7),
        (40, 6),
        (40, 8),
    ];
    for a in unknowns {
        let slope = (value(&[(a.0, a.1, h)]) - value(&[(a.0, a.1, -h)])) / (2.0 * h);
        let exact = linear.gradient[a.0][a.1];
        assert!(
            (slope - exact).abs() < 1e-6 * exact.abs().max(1.0),
            "{a:?} {slope} {exact}"
        );
        for b in unknowns {
            let at = |x: f64, y: f64| value(&[(a.0, a.1, x * h), (b.0, b.1, y * h)]);
            let second =
                (at(1.0, 1.0) - at(1.0, -1.0) - at(-1.0, 1.0) + at(-1.0, -1.0)) / (4.0 * h * h);
            let exact = linear.second_derivative(&unit(a), &unit(b));
            assert!(
                (second - exact).abs() < 1e-4 * exact.abs().max(1.0),
                "{a:?} {b:?} {second} {exact}"
            );
        }
    }
}
