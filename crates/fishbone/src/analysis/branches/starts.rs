//! Starts of the search for all equilibria.

use super::{SearchSettings, Wave};
use crate::equilibrium::guess::{guess, waved};
use crate::problem::Problem;
use crate::problem::program::BeltPoint;
use nalgebra::Vector2;
use std::f64::consts::PI;
use std::ops::Range;

/// Shapes from which to search first: arches to both sides and the straight belt with waves of bend and of rib slope over
/// them.
pub(super) fn arches(problem: &Problem, settings: &SearchSettings) -> Vec<BeltPoint> {
    let program = problem.program(problem.elements());
    let bulge = problem.bulge();
    let [up, down] = [bulge, -bulge].map(|bulge| guess(&program, &bulge));
    let mut starts = Vec::new();
    for (base, kept) in [(&up, 1.0), (&down, 1.0), (&up, 0.0)] {
        for bend in &settings.bend_waves {
            for slope in &settings.slope_waves {
                starts.push(waved(&program, base, kept, &|u| {
                    Vector2::new(bend.even_at(u), slope.odd_at(u))
                }));
            }
        }
    }
    starts
}

/// Shapes from which to search then, some of a sequence: sums of waves that cover their space evenly.
pub(super) fn sums(problem: &Problem, which: Range<usize>) -> Vec<BeltPoint> {
    let program = problem.program(problem.elements());
    let straight = guess(&program, &problem.bulge());
    let start = |i| {
        let sum = Sum::new(i);
        waved(&program, &straight, 0.0, &|u| sum.at(u))
    };
    which.map(start).collect()
}

impl Wave {
    /// The wave with its crest at the start.
    fn even_at(&self, u: f64) -> f64 {
        self.amplitude * (PI * self.half_waves * u).cos()
    }

    /// The wave that is zero at the start.
    fn odd_at(&self, u: f64) -> f64 {
        self.amplitude * (PI * self.half_waves * u).sin()
    }
}

/// Waves of bend in a sum, and of rib slope, a number.
const WAVES: usize = 5;

/// Sums of waves of bend and rib slope.
struct Sum {
    /// Amplitude and phase of every wave of bend, then of slope.
    waves: [[(f64, f64); WAVES]; 2],
}

impl Sum {
    /// The i-th of a sequence that covers all sums evenly: bends up to four times that of a ring and slopes up to 1.5, root mean
    /// square.
    ///
    /// Source: M. Roberts, "The unreasonable effectiveness of quasirandom sequences" (2018).
    fn new(i: usize) -> Self {
        /// Dimensions of the space of sums, a number.
        const NUMBERS: usize = 2 + 4 * WAVES;
        // The root of x^(d+1) = x + 1, d the number of dimensions.
        let mut root: f64 = 1.0;
        for _ in 0..50 {
            root = (1.0 + root).powf(1.0 / (NUMBERS as f64 + 1.0));
        }
        let mut ratio = 1.0;
        let mut next = || {
            ratio /= root;
            (0.5 + (i as f64 + 1.0) * ratio).fract()
        };
        let sizes = [8.0 * PI * next(), 1.5 * next()];
        let waves = sizes.map(|size| {
            let mut waves = [(0.0, 0.0); WAVES];
            for wave in &mut waves {
                *wave = (2.0 * next() - 1.0, 2.0 * PI * next());
            }
            let norm = waves.iter().map(|wave| wave.0 * wave.0).sum::<f64>().sqrt();
            waves.map(|(amplitude, phase)| (size * 2f64.sqrt() * amplitude / norm, phase))
        });
        Self { waves }
    }

    fn at(&self, u: f64) -> Vector2<f64> {
        let [bend, slope] = self.waves.map(|waves| {
            let wave = |(k, (amplitude, phase)): (usize, &(f64, f64))| {
                amplitude * (PI * k as f64 * u + phase).cos()
            };
            waves.iter().enumerate().map(wave).sum()
        });
        Vector2::new(bend, slope)
    }
}
