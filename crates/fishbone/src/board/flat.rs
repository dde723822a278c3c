//! The flat spine of the developed board: stretches of one in-plane curvature, and corners between them.

use crate::strip::spine::{Piece, Spine};
use nalgebra::Vector2;

/// A point of the flat spine with its heading.
///
/// Flat coordinates are (y, z): y along η and z along ζ of the start of the belt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlatFrame {
    /// Position (y, z).
    pub position: Vector2<f64>,
    /// Angle from the y axis to the tangent, not reduced to one turn. Units: rad.
    pub heading: f64,
}

impl FlatFrame {
    /// Flat frame at the start of the belt, in the belt's unit of length and rad.
    pub(crate) const START: Self = Self {
        position: Vector2::new(0.0, 0.0),
        heading: 0.0,
    };

    /// Unit tangent, η of the flat board.
    pub(crate) fn tangent(&self) -> Vector2<f64> {
        direction(self.heading)
    }

    /// Unit vector across, ζ of the flat board.
    pub(crate) fn across(&self) -> Vector2<f64> {
        quarter_turned(&self.tangent())
    }

    /// The frame a distance on along an arc of given curvature.
    pub(crate) fn along(&self, curvature: f64, distance: f64) -> Self {
        let half = 0.5 * curvature * distance;
        let chord = distance * if half == 0.0 { 1.0 } else { half.sin() / half };
        Self {
            position: self.position + chord * direction(self.heading + half),
            heading: self.heading + 2.0 * half,
        }
    }

    /// Coordinates of a flat point in this frame: along and across.
    pub(crate) fn local(&self, point: &Vector2<f64>) -> Vector2<f64> {
        let (offset, tangent) = (point - self.position, self.tangent());
        Vector2::new(tangent.dot(&offset), tangent.perp(&offset))
    }

    /// The flat point of given coordinates in this frame.
    pub(crate) fn global(&self, local: &Vector2<f64>) -> Vector2<f64> {
        let tangent = self.tangent();
        self.position + local.x * tangent + local.y * quarter_turned(&tangent)
    }
}

/// Unit vector at an angle from the y axis.
pub(crate) fn direction(angle: f64) -> Vector2<f64> {
    let (sine, cosine) = angle.sin_cos();
    Vector2::new(cosine, sine)
}

/// A vector turned by a right angle, from y towards z.
fn quarter_turned(vector: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-vector.y, vector.x)
}

/// A stretch of the flat spine of one in-plane curvature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Segment {
    pub(crate) start: FlatFrame,
    pub(crate) length: f64,
    pub(crate) geodesic: f64,
    /// Arc length u at its start.
    from: f64,
}

impl Segment {
    pub(crate) fn end(&self) -> FlatFrame {
        self.start.along(self.geodesic, self.length)
    }
}

/// The flat spine, laid out from the start of the belt.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FlatSpine {
    /// Stretches in order, at least one.
    pub(crate) segments: Vec<Segment>,
    /// Frame of every node.
    pub(crate) nodes: Vec<FlatFrame>,
    /// Segment in which every node lies; at a corner the one before it or after it, as the node does.
    pub(crate) owner: Vec<usize>,
}

impl FlatSpine {
    pub(crate) fn of(spine: &Spine) -> Self {
        let mut flat = Self {
            segments: Vec::new(),
            nodes: vec![FlatFrame::START],
            owner: vec![0],
        };
        for (element, piece) in spine.pieces.iter().enumerate() {
            match piece {
                Piece::Joint { angle } => flat.turn(*angle),
                Piece::Strip { .. } | Piece::Rigid => {
                    flat.extend(piece.geodesic(), [spine.u[element], spine.u[element + 1]]);
                }
            }
        }
        if flat.segments.is_empty() {
            flat.extend(0.0, [0.0; 2]);
            flat.nodes.pop();
            flat.owner.pop();
        }
        let last = flat.segments.len() - 1;
        flat.owner
            .iter_mut()
            .for_each(|owner| *owner = (*owner).min(last));
        flat
    }

    /// Frame at the end of the belt.
    pub(crate) fn end(&self) -> FlatFrame {
        self.nodes[self.nodes.len() - 1]
    }

    fn turn(&mut self, angle: f64) {
        let here = self.end();
        let at_corner = angle != 0.0 && !self.segments.is_empty();
        self.owner
            .push(self.owner[self.owner.len() - 1] + usize::from(at_corner));
        self.nodes.push(FlatFrame {
            heading: here.heading + angle,
            ..here
        });
    }

    /// Adds an element: to the last segment if that has the same curvature, for positions to come from one start and not
    /// from a sum; else as a new segment.
    fn extend(&mut self, geodesic: f64, [from, to]: [f64; 2]) {
        let here = self.end();
        let goes_on =
            |last: &&mut Segment| last.geodesic == geodesic && last.end().heading == here.heading;
        match self.segments.last_mut().filter(goes_on) {
            Some(last) => last.length = to - last.from,
            None => self.segments.push(Segment {
                start: here,
                length: to - from,
                geodesic,
                from,
            }),
        }
        let index = self.segments.len() - 1;
        self.nodes.push(self.segments[index].end());
        self.owner.push(index);
    }
}

/// The flat motion that takes one round of a closed belt to the next, as the belt is unrolled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Round {
    end: FlatFrame,
    /// −1 where the next round is the other side up, with ζ turned to −ζ.
    hand: f64,
}

impl Round {
    /// The motion of a closed belt; `None` of an open belt.
    pub(crate) fn of(spine: &Spine, flat: &FlatSpine) -> Option<Self> {
        let hand = |half_turns: i32| if half_turns % 2 == 0 { 1.0 } else { -1.0 };
        spine.half_turns.map(|half_turns| Self {
            end: flat.end(),
            hand: hand(half_turns),
        })
    }

    pub(crate) fn next(&self, point: &Vector2<f64>) -> Vector2<f64> {
        self.end.global(&Vector2::new(point.x, self.hand * point.y))
    }

    pub(crate) fn previous(&self, point: &Vector2<f64>) -> Vector2<f64> {
        let local = self.end.local(point);
        Vector2::new(local.x, self.hand * local.y)
    }

    fn next_segment(&self, segment: &Segment) -> Segment {
        self.moved(
            segment,
            self.next(&segment.start.position),
            self.end.heading,
        )
    }

    fn previous_segment(&self, segment: &Segment) -> Segment {
        let back = self.previous(&segment.start.position);
        self.moved(segment, back, -self.hand * self.end.heading)
    }

    fn moved(&self, segment: &Segment, position: Vector2<f64>, turn: f64) -> Segment {
        let heading = turn + self.hand * segment.start.heading;
        Segment {
            start: FlatFrame { position, heading },
            geodesic: self.hand * segment.geodesic,
            ..*segment
        }
    }

    /// The segments of the round before, of this round and of the next one.
    pub(crate) fn unrolled(&self, segments: &[Segment]) -> Vec<Segment> {
        let before = segments
            .iter()
            .map(|segment| self.previous_segment(segment));
        let after = segments.iter().map(|segment| self.next_segment(segment));
        before
            .chain(segments.iter().copied())
            .chain(after)
            .collect()
    }
}
