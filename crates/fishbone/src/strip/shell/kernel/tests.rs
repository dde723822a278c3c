//! The kernel against automatic differentiation.

use super::*;
use crate::geometry::exp;
use crate::strip::automatic;
use crate::strip::density::{Derivatives as _, Motions as _};
use crate::strip::element::Curl;
use crate::strip::shell::Gauge;
use approx::assert_relative_eq;
use nalgebra::{Vector3, Vector6};

fn shell() -> Shell {
    Shell::new(Gauge::WEAK, 6)
}

fn element(geodesic: f64, bend: f64) -> Element {
    Element {
        length: 0.0125,
        geodesic,
        rigidity: [1.3, 0.7],
        half_width: 0.05,
        curl: Curl {
            bend,
            poisson: 0.34,
        },
        stretching: 12.0 * (1.0 - 0.34 * 0.34) / (7e-4f64 * 7e-4),
    }
}

/// Fields of both ends of elements: hardly bent, bent, at an inflection, twisted.
const ENDS: [[[f64; FIELDS]; 2]; 4] = [
    [
        [0.01, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.02, 0.0, 0.1, 0.01, 0.0, 0.0],
    ],
    [
        [-8.0, 0.2, 4.0, 0.5, -0.1, 1.5],
        [-7.8, 0.26, 5.0, 0.4, -0.08, 1.9],
    ],
    [
        [0.3, -0.4, -10.0, 1.2, 0.3, -6.0],
        [-0.4, -0.51, -9.0, 1.4, 0.2, -9.0],
    ],
    [
        [4.3, 0.5, 15.0, -0.4, 0.1, -9.0],
        [4.0, 0.68, 14.0, -0.1, 0.0, 3.0],
    ],
];

#[test]
fn test_motions_are_those_of_the_definition() {
    let shell = shell();
    let (mut fast, mut slow) = (Motions::default(), automatic::Motions::<FIELDS>::default());
    for geodesic in [0.0, 1.4, -6.0] {
        for (lane, ends) in ENDS.iter().enumerate() {
            let [a, b] = ends.map(SVector::from);
            fast.set(lane, &element(geodesic, 0.0), [&a, &b]);
            density::Motions::<Shell, FIELDS>::set(
                &mut slow,
                lane,
                &element(geodesic, 0.0),
                [&a, &b],
            );
        }
        fast.find(&shell);
        slow.find(&shell);
        for lane in 0..ENDS.len() {
            let slow = density::Motions::<Shell, FIELDS>::at(&slow, lane);
            assert_relative_eq!(fast.at(lane).frame, slow.frame, epsilon = 1e-15);
            assert_relative_eq!(fast.at(lane).position, slow.position, epsilon = 1e-15);
        }
    }
}

#[test]
fn test_derivatives_agree_with_automatic_differentiation() {
    let shell = shell();
    for (geodesic, bend) in [(0.0, 0.0), (1.4, 3.0), (-6.0, -2.0)] {
        let element = element(geodesic, bend);
        let (mut fast, mut slow) = (
            Block::default(),
            automatic::Derivatives::<FIELDS>::default(),
        );
        for (lane, ends) in ENDS.iter().enumerate() {
            let [a, b] = ends.map(SVector::from);
            let first = Pose {
                frame: exp(&Vector3::new(0.3, -0.7, 1.1)),
                position: Vector3::new(0.2, 0.5, -0.4),
            };
            let mut motions = Motions::default();
            motions.set(0, &element, [&a, &b]);
            motions.find(&shell);
            let second = first * motions.at(0);
            let loaded = Loaded {
                element: &element,
                fields: [&a, &b],
                poses: [&first, &second],
                wrench: &Vector6::new(30.0, -70.0, 20.0, 4.0, -9.0, 6.0),
            };
            fast.set(lane, &shell, &loaded);
            slow.set(lane, &shell, &loaded);
        }
        fast.find(&shell);
        for lane in 0..ENDS.len() {
            compare(&fast, &slow, lane);
        }
    }
}

/// Compares gradients, second derivatives, growth and the second derivatives along the chain.
fn compare(fast: &Block, slow: &automatic::Derivatives<FIELDS>, lane: usize) {
    type Slow = automatic::Derivatives<FIELDS>;
    let gradients = [
        fast.gradient(lane),
        <Slow as density::Derivatives<Shell, FIELDS>>::gradient(slow, lane),
    ];
    for (a, b) in gradients[0].iter().zip(&gradients[1]) {
        assert_relative_eq!(*a, *b, max_relative = 1e-11, epsilon = 1e-11);
    }
    let hessians = [
        fast.hessian(lane),
        <Slow as density::Derivatives<Shell, FIELDS>>::hessian(slow, lane),
    ];
    let parts = |h: &StageMatrix<FIELDS>| [h.first, h.mixed, h.second];
    for (a, b) in parts(&hessians[0]).iter().zip(&parts(&hessians[1])) {
        for i in 0..FIELDS {
            for j in 0..FIELDS {
                let off = (a[(i, j)] - b[(i, j)]).abs();
                assert!(
                    off <= 1e-10 * b[(i, j)].abs() + 1e-9 * b.amax() * 1e-3,
                    "{i} {j} {a} {b}"
                );
            }
        }
    }
    let mut stages = [Stage::<FIELDS, 12>::zero(), Stage::zero()];
    fast.carry(lane, &mut stages[0]);
    <Slow as density::Derivatives<Shell, FIELDS>>::carry(slow, lane, &mut stages[1]);
    let parts = |s: &Stage<FIELDS, 12>| {
        [
            s.growth_by_first,
            s.growth_by_second,
            s.state_first,
            s.state_second,
        ]
    };
    for (a, b) in parts(&stages[0]).iter().zip(&parts(&stages[1])) {
        assert_relative_eq!(*a, *b, max_relative = 1e-10, epsilon = 1e-12);
    }
}
