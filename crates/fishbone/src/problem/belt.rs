//! The board the belt is cut from: a chain of segments along the spine, and its mesh.

use crate::geometry::gauss_points;
use crate::problem::program::Piece;
use crate::scenario::error::ScenarioError;
use crate::scenario::{BeltSpec, Rigidity, SAME_PLACE, SegmentSpec};
use crate::strip::element::Curl;
use crate::strip::element::Element;

/// A belt in the units of its scenario.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Belt {
    /// Width V.
    pub width: f64,
    /// Segments in order along the spine.
    pub segments: Vec<Segment>,
    /// Signed half turns after which the end of a closed belt joins its start.
    pub half_turns: Option<i32>,
    /// Mass per length.
    pub density: f64,
}

/// A piece of the belt of one kind.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Segment {
    /// A flexible strip.
    Strip(Strip),
    /// A stiffener.
    Rigid {
        /// Length along the spine.
        length: f64,
    },
    /// A bend of the board at a point.
    Corner {
        /// Angle from η towards ζ.
        angle: f64,
    },
}

/// A flexible strip of constant in-plane curvature.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Strip {
    /// Length along the spine.
    pub length: f64,
    /// In-plane curvature κ_g of the flat board.
    pub geodesic: f64,
    /// Rigidity R_f of the whole width.
    pub rigidity: Rigidity,
    /// Natural bend.
    pub curl: Curl,
    /// Stretching stiffness over bending stiffness; infinite where no thickness is known.
    pub stretching: f64,
}

/// A place that must be a node of the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Break {
    /// Arc length.
    pub u: f64,
    /// Whether a moment may act there, so that the bend jumps.
    pub jump: bool,
}

/// The lengths of the elements of a stretch, as shares of its length; of a stiffened stretch, which is one piece, none.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Division(pub Vec<f64>);

impl Division {
    /// Elements of equal length.
    pub(crate) fn equal(count: usize) -> Self {
        Self(vec![1.0 / count as f64; count])
    }

    /// Every element's start and length, in shares.
    pub(crate) fn places(&self) -> impl Iterator<Item = [f64; 2]> {
        self.0.iter().scan(0.0, |start, share| {
            let from = *start;
            *start += share;
            Some([from, *share])
        })
    }
}

/// A stretch of a segment between two breaks.
struct Stretch<'a> {
    segment: &'a Segment,
    /// First arc length, from the start of the segment.
    from: f64,
    to: f64,
    /// The joint before the stretch, if any.
    joint: Option<Piece>,
}

impl Stretch<'_> {
    fn length(&self) -> f64 {
        self.to - self.from
    }

    /// Least number of elements that the stretch needs where its rigidity changes along it: bend goes with the inverse of
    /// rigidity.
    fn fewest(&self) -> usize {
        /// Elements for each factor e of rigidity along a stretch, a number.
        const PER_FACTOR_E: f64 = 8.0;
        let Segment::Strip(strip) = self.segment else {
            return 1;
        };
        let [a, b] = [self.from, self.to].map(|u| strip.rigidity_at(u).ln());
        (PER_FACTOR_E * (b - a).abs()).ceil() as usize
    }
}

impl Strip {
    fn rigidity_at(&self, u: f64) -> f64 {
        match &self.rigidity {
            Rigidity::Constant(value) => *value,
            Rigidity::Table(table) => table.at(u),
        }
    }

    /// Integral of the rigidity, exact for a rigidity linear between entries.
    fn total_rigidity(&self) -> f64 {
        let mut places = vec![0.0, self.length];
        if let Rigidity::Table(table) = &self.rigidity {
            places.extend(table.u.iter().filter(|u| **u < self.length));
            places.sort_by(f64::total_cmp);
        }
        places
            .windows(2)
            .map(|w| 0.5 * (w[1] - w[0]) * (self.rigidity_at(w[0]) + self.rigidity_at(w[1])))
            .sum()
    }

    /// Whether the fields are continuous from this strip to another.
    fn goes_on_to(&self, next: &Self) -> bool {
        self.geodesic == next.geodesic
            && self.curl == next.curl
            && self.stretching == next.stretching
            && self.rigidity_at(self.length) == next.rigidity_at(0.0)
    }
}

impl Segment {
    fn new(segment: &SegmentSpec, belt: &BeltSpec) -> Option<Self> {
        let strip = |length, geodesic| {
            Some(Self::Strip(Strip {
                length,
                geodesic,
                rigidity: match segment.rigidity() {
                    Some(rigidity) => rigidity.clone(),
                    None => Rigidity::Constant(belt.own_rigidity()?),
                },
                curl: Curl {
                    bend: belt.natural_bend_of(segment),
                    poisson: belt.poisson_value(),
                },
                stretching: belt.stretching().unwrap_or(f64::INFINITY),
            }))
        };
        match *segment {
            SegmentSpec::Straight { length, .. } => strip(length, 0.0),
            SegmentSpec::Arc {
                length, curvature, ..
            } => strip(length, curvature),
            SegmentSpec::Corner { angle } => Some(Self::Corner { angle }),
            SegmentSpec::Rigid { length } => Some(Self::Rigid { length }),
        }
    }

    /// Length along the spine.
    pub(crate) fn length(&self) -> f64 {
        match self {
            Self::Strip(strip) => strip.length,
            Self::Rigid { length } => *length,
            Self::Corner { .. } => 0.0,
        }
    }

    /// Arc lengths inside the segment where its rigidity has a corner.
    fn table_entries(&self, same: f64) -> Vec<f64> {
        let Self::Strip(Strip {
            rigidity: Rigidity::Table(table),
            length,
            ..
        }) = self
        else {
            return Vec::new();
        };
        let inside = table.u.iter().filter(|u| **u > same && **u < length - same);
        inside.copied().collect()
    }

    fn goes_on_to(&self, next: &Self) -> bool {
        match (self, next) {
            (Self::Strip(a), Self::Strip(b)) => a.goes_on_to(b),
            (Self::Rigid { .. }, Self::Rigid { .. }) => true,
            _ => false,
        }
    }

    fn strip(&self) -> Option<&Strip> {
        match self {
            Self::Strip(strip) => Some(strip),
            Self::Rigid { .. } | Self::Corner { .. } => None,
        }
    }
}

impl Belt {
    /// The belt of a specification that [`Scenario::validate`](crate::scenario::Scenario::validate) passes.
    ///
    /// # Errors
    ///
    /// [`ScenarioError`] where a segment that bends has no rigidity.
    pub(crate) fn new(spec: &BeltSpec) -> Result<Self, ScenarioError> {
        let segments = spec.segments.iter();
        let segments: Option<_> = segments
            .map(|segment| Segment::new(segment, spec))
            .collect();
        let no_rigidity = || {
            let allowed = "given one of rigidity, material, layers";
            ScenarioError::invalid("belt", "no rigidity", allowed)
        };
        Ok(Self {
            width: spec.width,
            segments: segments.ok_or_else(no_rigidity)?,
            half_turns: spec.closed.then(|| spec.half_turns.unwrap_or(0)),
            density: spec.density_value(),
        })
    }

    /// Length U of the spine.
    pub(crate) fn length(&self) -> f64 {
        self.segments.iter().map(Segment::length).sum()
    }

    /// Mean rigidity over the flexible strips, the scale of energies.
    pub(crate) fn mean_rigidity(&self) -> f64 {
        let strips = || self.segments.iter().filter_map(Segment::strip);
        let length: f64 = strips().map(|strip| strip.length).sum();
        strips().map(Strip::total_rigidity).sum::<f64>() / length
    }

    /// Whether bend and slope are continuous through the seam of a closed belt, up to the sign that an odd number of half
    /// turns gives them; the slope is, except at a stiffener.
    pub(crate) fn goes_on_through_seam(&self) -> [bool; 2] {
        let (Some(Segment::Strip(last)), Some(Segment::Strip(first))) =
            (self.segments.last(), self.segments.first())
        else {
            return [false; 2];
        };
        let sign = self.seam_sign();
        let beyond = Strip {
            geodesic: sign * first.geodesic,
            curl: Curl {
                bend: sign * first.curl.bend,
                ..first.curl
            },
            ..first.clone()
        };
        [last.goes_on_to(&beyond), true]
    }

    /// The sign that bend, slope and in-plane curvature take on across the seam.
    pub(crate) fn seam_sign(&self) -> f64 {
        match self.half_turns.unwrap_or(0) % 2 {
            0 => 1.0,
            _ => -1.0,
        }
    }

    /// Every stretch of the belt divided into elements of equal length, of about `count` in all, shared out by length. There
    /// are more where a share is not whole, between two breaks, ends of segments or entries of a table of rigidity.
    pub(crate) fn divided(&self, count: usize, breaks: &[Break]) -> Vec<Division> {
        let length = self.length();
        let of_length = |stretch: &Stretch| stretch.length() / length;
        let divided = |stretch: &Stretch| {
            Division::equal(match stretch.segment {
                Segment::Strip(_) => share(count, of_length(stretch)).max(stretch.fewest()),
                Segment::Rigid { .. } | Segment::Corner { .. } => 0,
            })
        };
        self.stretches(breaks).iter().map(divided).collect()
    }

    /// The division of every stretch into the given pieces.
    pub(crate) fn division_of(&self, pieces: &[Piece], breaks: &[Break]) -> Vec<Division> {
        let mut pieces = pieces
            .iter()
            .filter(|piece| !matches!(piece, Piece::Joint { .. }));
        let length = self.length();
        let divided = |stretch: &Stretch| {
            let whole = stretch.length() / length;
            let (mut done, mut shares) = (0.0, Vec::new());
            while done < whole - SAME_PLACE
                && let Some(piece) = pieces.next()
            {
                done += piece.length();
                if let Piece::Strip(element) = piece {
                    shares.push(element.length / whole);
                }
            }
            Division(shares)
        };
        self.stretches(breaks).iter().map(divided).collect()
    }

    /// The pieces of a mesh; `None` where the belt has another number of stretches. A stiffened stretch is one piece.
    ///
    /// Units: lengths in U, rigidity in its mean.
    pub(crate) fn pieces(&self, mesh: &[Division], breaks: &[Break]) -> Option<Vec<Piece>> {
        let (length, rigidity) = (self.length(), self.mean_rigidity());
        let stretches = self.stretches(breaks);
        if stretches.len() != mesh.len() {
            return None;
        }
        let mut pieces = Vec::new();
        for (stretch, division) in stretches.iter().zip(mesh) {
            pieces.extend(stretch.joint);
            match stretch.segment {
                Segment::Strip(strip) => {
                    pieces.extend(self.elements(strip, stretch, division, [length, rigidity]));
                }
                Segment::Rigid { .. } | Segment::Corner { .. } => pieces.push(Piece::Rigid {
                    length: stretch.length() / length,
                }),
            }
        }
        Some(pieces)
    }

    /// Lengths of the stretches between breaks, ends of segments and entries of tables, in U.
    pub(crate) fn lengths_of_stretches(&self, breaks: &[Break]) -> Vec<f64> {
        let whole = self.length();
        let stretches = self.stretches(breaks);
        stretches
            .iter()
            .map(|stretch| stretch.length() / whole)
            .collect()
    }

    fn stretches(&self, breaks: &[Break]) -> Vec<Stretch<'_>> {
        let same = SAME_PLACE * self.length();
        let near = |u: f64| breaks.iter().filter(move |b| (b.u - u).abs() <= same);
        let mut stretches: Vec<Stretch> = Vec::new();
        let (mut u, mut angle) = (0.0, 0.0);
        for segment in &self.segments {
            if let Segment::Corner { angle: more } = segment {
                angle += more;
                continue;
            }
            let mut cuts: Vec<f64> = breaks.iter().map(|b| b.u - u).collect();
            cuts.retain(|cut| *cut > same && *cut < segment.length() - same);
            cuts.extend([0.0, segment.length()]);
            cuts.extend(segment.table_entries(same));
            cuts.sort_by(f64::total_cmp);
            cuts.dedup_by(|b, a| *b - *a <= same);
            for cut in cuts.windows(2) {
                let goes_on = stretches
                    .last()
                    .is_none_or(|before| before.segment.goes_on_to(segment) || cut[0] > 0.0);
                let jump = near(u + cut[0]).any(|b| b.jump);
                let turns = angle != 0.0;
                let joined = !stretches.is_empty() && (turns || !goes_on || jump);
                stretches.push(Stretch {
                    segment,
                    from: cut[0],
                    to: cut[1],
                    joint: joined.then_some(Piece::Joint { angle }),
                });
                angle = 0.0;
            }
            u += segment.length();
        }
        stretches
    }

    /// The elements of one stretch of a strip, in units of length and rigidity.
    fn elements(
        &self,
        strip: &Strip,
        stretch: &Stretch,
        division: &Division,
        [length, rigidity]: [f64; 2],
    ) -> impl Iterator<Item = Piece> {
        let (from, whole) = (stretch.from, stretch.length());
        division.places().map(move |[start, share]| {
            let at = |t: f64| strip.rigidity_at(from + (start + t * share) * whole) / rigidity;
            Piece::Strip(Element {
                length: share * whole / length,
                geodesic: strip.geodesic * length,
                rigidity: gauss_points().map(at),
                half_width: 0.5 * self.width / length,
                curl: Curl {
                    bend: strip.curl.bend * length,
                    ..strip.curl
                },
                stretching: strip.stretching * length * length,
            })
        })
    }
}

/// The share of a count by weight, out of 1, rounded up: no element is longer than if all were alike.
fn share(count: usize, weight: f64) -> usize {
    /// Rounding error of a share, in elements: a share above a whole number by less is that number.
    const ROUNDING: f64 = 1e-9;
    let due = weight * count as f64;
    ((due - ROUNDING).ceil() as usize).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::RigidityTable;

    fn strip(length: f64, geodesic: f64, rigidity: f64) -> Segment {
        Segment::Strip(Strip {
            length,
            geodesic,
            rigidity: Rigidity::Constant(rigidity),
            curl: Curl::default(),
            stretching: f64::INFINITY,
        })
    }

    fn belt(segments: Vec<Segment>) -> Belt {
        Belt {
            width: 0.1,
            segments,
            half_turns: None,
            density: 0.0,
        }
    }

    fn pieces_of(belt: &Belt, count: usize, breaks: &[Break]) -> Vec<Piece> {
        let mesh = belt.divided(count, breaks);
        let pieces = belt.pieces(&mesh, breaks).unwrap();
        let close = |(a, b): (&Division, &Division)| {
            a.0.len() == b.0.len() && a.0.iter().zip(&b.0).all(|(a, b)| (a - b).abs() < 1e-12)
        };
        assert!(
            belt.division_of(&pieces, breaks)
                .iter()
                .zip(&mesh)
                .all(close)
        );
        pieces
    }

    fn kinds(pieces: &[Piece]) -> String {
        let kind = |piece: &Piece| match piece {
            Piece::Strip(_) => 's',
            Piece::Rigid { .. } => 'r',
            Piece::Joint { .. } => 'j',
        };
        pieces.iter().map(kind).collect()
    }

    #[test]
    fn test_elements_are_shared_out_by_length() {
        assert_eq!([0.25, 0.26, 0.5].map(|weight| share(10, weight)), [3, 3, 5]);
        assert_eq!([0.999, 1e-12].map(|weight| share(4, weight)), [4, 1]);
        assert_eq!(share(80, 0.1 + 0.2), 24);
    }

    #[test]
    fn test_elements_are_in_units_of_length_and_mean_rigidity() {
        let belt = belt(vec![strip(1.5, 0.0, 2.0), strip(0.5, 0.0, 2.0)]);
        let pieces = pieces_of(&belt, 8, &[]);
        assert_eq!(kinds(&pieces), "ssssssss");
        for piece in pieces {
            let Piece::Strip(element) = piece else {
                unreachable!()
            };
            assert!((element.length - 0.125).abs() < 1e-15);
            assert_eq!(element.rigidity, [1.0; 2]);
            assert!((element.half_width - 0.025).abs() < 1e-15);
        }
    }

    #[test]
    fn test_fields_may_jump_where_the_board_changes() {
        let segments = vec![
            strip(1.0, 0.0, 1.0),
            Segment::Corner { angle: 0.5 },
            Segment::Corner { angle: 0.25 },
            strip(1.0, 0.0, 1.0),
            strip(1.0, 2.0, 1.0),
            strip(1.0, 2.0, 3.0),
            Segment::Rigid { length: 1.0 },
            strip(1.0, 0.0, 1.0),
        ];
        let pieces = pieces_of(&belt(segments), 6, &[]);
        assert_eq!(kinds(&pieces), "sjsjsjsjrjs");
        assert_eq!(pieces[1], Piece::Joint { angle: 0.75 });
        assert_eq!(pieces[3], Piece::Joint { angle: 0.0 });
    }

    #[test]
    fn test_breaks_become_nodes_and_joints_where_moments_act() {
        let at = |u, jump| Break { u, jump };
        let breaks = [
            at(0.0, true),
            at(0.3, false),
            at(0.5, true),
            at(0.5 + 1e-12, false),
        ];
        let pieces = pieces_of(&belt(vec![strip(1.0, 0.0, 1.0)]), 10, &breaks);
        assert_eq!(kinds(&pieces), "sssssjsssss");
        let lengths: f64 = pieces[..3].iter().map(Piece::length).sum();
        assert!((lengths - 0.3).abs() < 1e-12);
    }

    #[test]
    fn test_table_of_rigidity_is_taken_at_the_gauss_points() {
        let table = RigidityTable {
            u: vec![0.0, 1.0],
            value: vec![1.0, 3.0],
        };
        let belt = belt(vec![Segment::Strip(Strip {
            length: 1.0,
            geodesic: 0.0,
            rigidity: Rigidity::Table(table),
            curl: Curl::default(),
            stretching: f64::INFINITY,
        })]);
        assert!((belt.mean_rigidity() - 2.0).abs() < 1e-15);
        let pieces = pieces_of(&belt, 20, &[]);
        let Piece::Strip(element) = pieces[0] else {
            unreachable!()
        };
        let [a, b] = gauss_points().map(|t| 0.5 + t / 20.0);
        assert!((element.rigidity[0] - a).abs() < 1e-15 && (element.rigidity[1] - b).abs() < 1e-15);
    }
}
