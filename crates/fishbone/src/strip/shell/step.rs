//! The Magnus step of an element whose torsion is not bound to its bend by the rib slope.

use crate::geometry::SHORTENING;
use crate::strip::kernel::lane::{COMMUTATOR, Step};
use crate::strip::kernel::{Spans, Triple, Upper};

/// The Magnus step by bend and torsion at the first Gauss point, then at the second.
#[derive(Clone, Copy)]
pub(super) struct Twisted {
    rotation: Triple,
    translation: Triple,
    bend: [f64; 2],
    torsion: [f64; 2],
    geodesic: f64,
    half: f64,
    weight: f64,
    shortening: f64,
}

impl Step for Twisted {
    #[inline(always)]
    fn at(spans: &Spans, lane: usize) -> Self {
        // Written out: `array::map` is not inlined into code for other targets.
        let fields = &spans.fields;
        let (bend, torsion) = (
            [fields[0][lane], fields[2][lane]],
            [fields[1][lane], fields[3][lane]],
        );
        let (h, geodesic) = (spans.length[lane], spans.geodesic[lane]);
        let (half, weight) = (0.5 * h, COMMUTATOR * h * h);
        let (rise, shortening) = (bend[1] - bend[0], SHORTENING * h * h * h);
        Self {
            rotation: [
                h * geodesic + weight * (torsion[0] * bend[1] - bend[0] * torsion[1]),
                half * (torsion[0] + torsion[1]) - weight * geodesic * rise,
                half * (bend[0] + bend[1]) + weight * geodesic * (torsion[1] - torsion[0]),
            ],
            translation: [weight * rise, h - shortening * rise * rise, 0.0],
            bend,
            torsion,
            geodesic,
            half,
            weight,
            shortening,
        }
    }

    #[inline(always)]
    fn rotation(&self) -> Triple {
        self.rotation
    }

    #[inline(always)]
    fn translation(&self) -> Triple {
        self.translation
    }

    #[inline(always)]
    fn rotation_by_gauss(&self) -> [Triple; 4] {
        let ([b1, b2], [t1, t2]) = (self.bend, self.torsion);
        let (half, w, geodesic) = (self.half, self.weight, self.weight * self.geodesic);
        [
            [-w * t2, geodesic, half],
            [w * b2, half, -geodesic],
            [w * t1, -geodesic, half],
            [-w * b1, half, geodesic],
        ]
    }

    #[inline(always)]
    fn translation_by_rise(&self) -> Triple {
        let rise = self.bend[1] - self.bend[0];
        [self.weight, -2.0 * self.shortening * rise, 0.0]
    }

    #[inline(always)]
    fn translation_by_rise_twice(&self) -> f64 {
        -2.0 * self.shortening
    }

    #[inline(always)]
    fn second_derivatives(&self, by_rotation: Triple) -> Upper {
        let x = by_rotation[0] * self.weight;
        [0.0, 0.0, 0.0, -x, 0.0, x, 0.0, 0.0, 0.0, 0.0]
    }
}
