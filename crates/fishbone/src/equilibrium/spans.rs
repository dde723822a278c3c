//! The start of a belt that is held between its ends: its spans from support to support, each found on its own.

use super::guess::{guess, inside};
use super::search::Search;
use crate::geometry::Pose;
use crate::problem::program::{BeltPoint, BeltProgram, Hold, NodeSupport, Piece};
use crate::strip::element::{Curl, Element};
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use std::ops::{ControlFlow, Range};

/// Largest residual of a span's shape, lengths in its own length and energy in mean R_f over its length: it is a start, and
/// need not be exact.
const ROUGH: f64 = 1e-3;
/// Greatest count of iterations for one span, a number.
const ITERATIONS: usize = 60;
/// Part of the tangent at a span's start across its chord from which the span bulges to that side, dimensionless.
const LEANING: f64 = 0.05;

impl Search {
    /// A start for the search for a belt held between its ends, `None` for another: the shapes of the spans between
    /// supports, one after the other, each clamped to the end of the one before.
    ///
    /// A span that a pin ends turns back at its far end by half as much as it is turned at its near end. So the spans do not
    /// amplify what one passes on to the next.
    pub(super) fn through_supports(
        &self,
        program: &BeltProgram,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<BeltPoint> {
        let spans = spans(program);
        if spans.len() < 2 || program.half_turns.is_some() {
            return None;
        }
        let mut shape: Option<BeltPoint> = None;
        for nodes in spans {
            let reached = shape.as_ref().and_then(|shape| shape.poses.last()).copied();
            let span = Span::of(program, nodes, reached);
            let found = self.shape_of(&span, proceed);
            append(&mut shape, span.to_whole(found));
        }
        Some(inside(program, shape?))
    }

    /// The shape of a span, roughly.
    fn shape_of(&self, span: &Span, proceed: &mut dyn FnMut() -> ControlFlow<()>) -> BeltPoint {
        let mut search = Self {
            bulge: span.side().unwrap_or(self.bulge),
            tolerance: ROUGH,
            settings: self.settings,
        };
        search.settings.iterations = ITERATIONS;
        let start = guess(&span.program, &search.bulge);
        if span.program.elements().next().is_none() {
            return start;
        }
        let barrier = search.settings.cold_barrier;
        search
            .minimise(&span.program, start, barrier, proceed)
            .at
            .point
    }
}

/// The nodes of the spans, from the start to the first support beyond the first held place, and on from support to support.
fn spans(program: &BeltProgram) -> Vec<Range<usize>> {
    let last = program.pieces.len();
    let holds = |support: &&NodeSupport| support.position.iter().any(Option::is_some);
    let mut ends: Vec<usize> = program
        .supports
        .iter()
        .filter(holds)
        .map(|s| s.node)
        .collect();
    ends.sort_unstable();
    ends.dedup();
    if ends.first().is_some_and(|first| *first > 0) {
        // A loose end lies as the span beyond it.
        ends[0] = 0;
    }
    if ends.last().is_some_and(|end| *end < last) {
        ends.push(last);
    }
    ends.windows(2).map(|ends| ends[0]..ends[1]).collect()
}

/// A stretch of a belt as a belt of its own, of length 1.
struct Span {
    program: BeltProgram,
    length: f64,
    /// Position of its origin in the whole belt.
    origin: Vector3<f64>,
}

impl Span {
    /// The span between two nodes; clamped to the pose that the span before has reached.
    fn of(program: &BeltProgram, nodes: Range<usize>, reached: Option<Pose>) -> Self {
        let pieces = &program.pieces[nodes.clone()];
        let length: f64 = pieces.iter().map(Piece::length).sum();
        let origin = reached.map_or(Vector3::zeros(), |pose| pose.position);
        let pieces = pieces.iter().map(|piece| scaled(piece, length)).collect();
        let hold = |hold: Hold| match hold {
            Hold::Hinge {
                frame,
                axis,
                moment,
            } => Hold::Hinge {
                frame,
                axis,
                moment: length * moment,
            },
            Hold::Free | Hold::Frame(_) => hold,
        };
        let local = |support: &NodeSupport| NodeSupport {
            node: support.node - nodes.start,
            position: [0, 1, 2].map(|i| Some((support.position[i]? - origin[i]) / length)),
            // Ribs square at both ends go on from span to span.
            square_rib: support.square_rib || support.node == nodes.end,
            hold: hold(support.hold),
        };
        let own = |support: &&NodeSupport| {
            let from = nodes.start + usize::from(reached.is_some());
            (from..=nodes.end).contains(&support.node)
        };
        let clamp = reached.map(|pose| NodeSupport {
            node: 0,
            position: [Some(0.0); 3],
            hold: Hold::Frame(UnitQuaternion::from_matrix(&pose.frame)),
            square_rib: true,
        });
        let supports = program.supports.iter().filter(own).map(local);
        Self {
            program: BeltProgram::new(pieces, program.model)
                .with_supports(clamp.into_iter().chain(supports).collect()),
            length,
            origin,
        }
    }

    /// The side of its chord on which it leaves a clamp; `None` where it leaves along the chord.
    fn side(&self) -> Option<Vector3<f64>> {
        let at = |node: usize| self.program.supports.iter().find(move |s| s.node == node);
        let tangent = at(0)?.hold.frame()? * Vector3::y();
        let chord = at(self.program.pieces.len())?.point()? - at(0)?.point()?;
        let chord = chord.try_normalize(f64::EPSILON)?;
        let side = tangent - chord * chord.dot(&tangent);
        (side.norm() > LEANING).then_some(side)
    }

    /// A shape of the span as a part of the whole belt.
    fn to_whole(&self, mut shape: BeltPoint) -> BeltPoint {
        for fields in &mut shape.fields {
            *fields = Vector2::new(fields[0] / self.length, fields[1]);
        }
        for pose in &mut shape.poses {
            pose.position = self.origin + self.length * pose.position;
        }
        shape
    }
}

/// A piece with lengths in another unit.
fn scaled(piece: &Piece, unit: f64) -> Piece {
    match *piece {
        Piece::Strip(element) => Piece::Strip(Element {
            length: element.length / unit,
            geodesic: element.geodesic * unit,
            half_width: element.half_width / unit,
            curl: Curl {
                bend: element.curl.bend * unit,
                ..element.curl
            },
            stretching: element.stretching * unit * unit,
            ..element
        }),
        Piece::Rigid { length } => Piece::Rigid {
            length: length / unit,
        },
        joint @ Piece::Joint { .. } => joint,
    }
}

/// Adds the shape of the next span. The bend at a support is the mean of the two spans'.
fn append(shape: &mut Option<BeltPoint>, next: BeltPoint) {
    let Some(shape) = shape else {
        *shape = Some(next);
        return;
    };
    if let Some(last) = shape.fields.last_mut() {
        last[0] = 0.5 * (last[0] + next.fields[0][0]);
    }
    shape.fields.extend(&next.fields[1..]);
    shape.poses.extend(&next.poses[1..]);
}
