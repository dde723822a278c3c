//! The board the belt is cut from: a chain of segments along the spine.

use crate::element::Element;
use crate::scenario::BeltSpec;

/// A belt in the units of its scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Belt {
    /// Width V.
    pub width: f64,
    /// Segments in order along the spine.
    pub segments: Vec<Segment>,
}

/// A piece of the belt along which the spine's in-plane curvature and the rigidity are constant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Length along the spine.
    pub length: f64,
    /// In-plane curvature κ_g of the flat board.
    pub geodesic: f64,
    /// Rigidity R_f of the whole width.
    pub rigidity: f64,
}

impl Belt {
    /// The belt of a validated specification; `None` where it asks for what [`crate::scenario::Scenario::validate`]
    /// refuses.
    pub fn new(spec: &BeltSpec) -> Option<Self> {
        let rigidity = spec.rigidity_value()?;
        let segment = |length| Segment {
            length,
            geodesic: 0.0,
            rigidity,
        };
        Some(Self {
            width: spec.width,
            segments: spec.segments.iter().map(|s| segment(s.length())).collect(),
        })
    }

    /// Length U of the spine.
    pub fn length(&self) -> f64 {
        self.segments.iter().map(|segment| segment.length).sum()
    }

    /// Mean rigidity over the length, the scale of energies.
    pub fn mean_rigidity(&self) -> f64 {
        let sum: f64 = self.segments.iter().map(|s| s.length * s.rigidity).sum();
        sum / self.length()
    }

    /// `count` elements, shared out by length with at least one a segment; lengths in U, rigidity in its mean.
    pub fn elements(&self, count: usize) -> Vec<Element> {
        let (length, rigidity) = (self.length(), self.mean_rigidity());
        let shares = share_out(count, self.segments.iter().map(|s| s.length / length));
        let elements = |(segment, share): (&Segment, usize)| {
            let element = Element {
                length: segment.length / length / share as f64,
                geodesic: segment.geodesic * length,
                rigidity: [segment.rigidity / rigidity; 2],
                half_width: 0.5 * self.width / length,
            };
            std::iter::repeat_n(element, share)
        };
        self.segments
            .iter()
            .zip(shares)
            .flat_map(elements)
            .collect()
    }
}

/// Shares a count out by weight, which sum to 1: at each boundary the share so far is the nearest whole number, and at
/// least one each.
fn share_out(count: usize, weights: impl Iterator<Item = f64>) -> Vec<usize> {
    let (mut sum, mut given) = (0.0, 0);
    weights
        .map(|weight| {
            sum += weight;
            let due = (sum * count as f64).round() as usize;
            let share = due.saturating_sub(given).max(1);
            given += share;
            share
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn belt(lengths: &[f64]) -> Belt {
        let segment = |length: &f64| Segment {
            length: *length,
            geodesic: 0.0,
            rigidity: 2.0,
        };
        Belt {
            width: 0.1,
            segments: lengths.iter().map(segment).collect(),
        }
    }

    #[test]
    fn test_elements_are_shared_out_by_length() {
        assert_eq!(share_out(10, [0.25, 0.25, 0.5].into_iter()), [3, 2, 5]);
        assert_eq!(share_out(4, [0.999, 0.0005, 0.0005].into_iter()), [4, 1, 1]);
    }

    #[test]
    fn test_elements_are_in_units_of_length_and_mean_rigidity() {
        let elements = belt(&[1.5, 0.5]).elements(8);
        assert_eq!(elements.len(), 8);
        for element in elements {
            assert!((element.length - 0.125).abs() < 1e-15);
            assert_eq!(element.rigidity, [1.0; 2]);
            assert!((element.half_width - 0.025).abs() < 1e-15);
        }
    }
}
