//! The Magnus step of an element whose torsion is not bound to its bend by the rib slope.

use crate::strip::kernel::lane::{Chord, Step};
use crate::strip::kernel::{Spans, Triple, Upper};

/// The Magnus step by bend and torsion at the first Gauss point, then at the second.
#[derive(Clone, Copy)]
pub(super) struct Twisted {
    rotation: Triple,
    chord: Chord,
    bend: [f64; 2],
    torsion: [f64; 2],
    geodesic: f64,
    half: f64,
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
        let (half, chord) = (0.5 * h, Chord::of(h, bend));
        let weight = chord.weight;
        Self {
            rotation: [
                h * geodesic + weight * (torsion[0] * bend[1] - bend[0] * torsion[1]),
                half * (torsion[0] + torsion[1]) - weight * geodesic * (bend[1] - bend[0]),
                half * (bend[0] + bend[1]) + weight * geodesic * (torsion[1] - torsion[0]),
            ],
            chord,
            bend,
            torsion,
            geodesic,
            half,
        }
    }

    #[inline(always)]
    fn rotation(&self) -> Triple {
        self.rotation
    }

    #[inline(always)]
    fn chord(&self) -> &Chord {
        &self.chord
    }

    #[inline(always)]
    fn rotation_by_gauss(&self) -> [Triple; 4] {
        let ([b1, b2], [t1, t2]) = (self.bend, self.torsion);
        let (half, w, geodesic) = (
            self.half,
            self.chord.weight,
            self.chord.weight * self.geodesic,
        );
        [
            [-w * t2, geodesic, half],
            [w * b2, half, -geodesic],
            [w * t1, -geodesic, half],
            [-w * b1, half, geodesic],
        ]
    }

    #[inline(always)]
    fn second_derivatives(&self, by_rotation: Triple) -> Upper {
        let x = by_rotation[0] * self.chord.weight;
        [0.0, 0.0, 0.0, -x, 0.0, x, 0.0, 0.0, 0.0, 0.0]
    }
}
