//! The reach of the belt: whether it is long enough for its supports and links.
//!
//! No two points of an inextensible belt are farther apart in space than the length of a path between them on the flat board.
//! This is checked for the points whose places supports hold: of the spine, of both edges where a rib is held, and at the ends
//! of the stiffener that a clamp holds.

mod board;

use super::Problem;
use crate::scenario::{Axis, BeltSpec, LinkSpec, Scenario, SupportSpec};
use board::{BoardPoint, distance, stiffener_about};
use nalgebra::Vector3;
use std::fmt;

/// Two points of the belt that supports or a link hold farther apart than the belt between them is long.
#[derive(Debug, Clone, PartialEq)]
pub struct OutOfReach {
    /// The supports or the link that hold the two points, and where these are.
    pub held: String,
    /// Distance at which they are held. Units: those of the scenario.
    pub distance: f64,
    /// Length of the belt between them, of a closed belt the shorter way round. Units: those of the scenario.
    pub belt: f64,
    /// Least distance by which the supports must come closer along the line between them. Units: those of the scenario.
    pub closer: f64,
}

/// One line: the supports or the link, the missing length, and the remedy.
impl fmt::Display for OutOfReach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let excess = self.distance - self.belt;
        write!(
            f,
            "{} are {} apart, {} more than the belt between them ({}); move them closer",
            self.held,
            number(self.distance),
            number(excess),
            number(self.belt)
        )?;
        // Points beside the spine come closer by less than the supports do.
        match self.closer > excess * (1.0 + 1e-9) {
            true => write!(f, ", by {} at least", number(self.closer)),
            false => Ok(()),
        }
    }
}

impl Problem {
    /// The first two points that are held too far apart for the belt between them; `None` where there are none.
    pub(crate) fn unreachable_supports(&self) -> Option<OutOfReach> {
        let points = HeldPoint::all(&self.scenario);
        let too_long = Span::all(&points, &self.scenario).filter(Span::is_too_long);
        // The shorter the span, the nearer its name is to the fault.
        let span = too_long.min_by(|a, b| a.belt.total_cmp(&b.belt))?;
        Some(OutOfReach {
            distance: span.distance(),
            closer: span.closer(),
            belt: span.belt,
            held: span.held.to_string(),
        })
    }

    /// Whether two points are held so far apart that the belt between them is at its inextensible limit: its reactions are
    /// undetermined.
    pub(crate) fn has_no_slack(&self) -> bool {
        /// Slack of the belt between two held points below which reactions are undetermined, as a share of its length.
        const SLACK: f64 = 1e-6;
        let points = HeldPoint::all(&self.scenario);
        let mut spans = Span::all(&points, &self.scenario).filter(|span| span.belt > 0.0);
        spans.any(|span| span.excess() > -SLACK * span.belt)
    }
}

/// A point of the belt whose place a support holds.
#[derive(Clone, Copy)]
struct HeldPoint {
    /// Index of the support.
    support: usize,
    on_board: BoardPoint,
    /// Place of the spine, each component or none.
    position: [Option<f64>; 3],
    /// Offset from there: across the spine, and along a stiffener.
    across: Vector3<f64>,
}

impl HeldPoint {
    /// The points that the supports of a scenario hold.
    fn all(scenario: &Scenario) -> Vec<Self> {
        let supports = scenario.supports.iter().enumerate();
        supports
            .flat_map(|support| Self::of(support, scenario))
            .collect()
    }

    /// The points that a support holds: of the spine and, where it holds the rib, the rib's two ends; the same at the ends of
    /// the stiffener that a clamp holds.
    fn of((i, support): (usize, &SupportSpec), scenario: &Scenario) -> Vec<Self> {
        let belt = &scenario.belt;
        let u = support.at.arc_length(belt.length());
        let at = |along: f64, v: f64, across: Vector3<f64>| Self {
            support: i,
            on_board: BoardPoint { u: u + along, v },
            position: support.components(),
            across,
        };
        let holds_rib = scenario.is_square_rib(support) && !belt.closed;
        let axis_is_held = matches!(support.hinge, None | Some(Axis::Zeta));
        let frame = support.frame().filter(|_| holds_rib && axis_is_held);
        let zeta = frame.map(|frame| frame.column(2).into_owned());
        let half = 0.5 * belt.width;
        let ends = zeta.map(|zeta| [half, -half].map(|v| at(0.0, v, v * zeta)));
        let frame = support.frame().filter(|_| support.hinge.is_none());
        let stiffener = frame.zip(stiffener_about(u, belt));
        let beyond = stiffener.map(|(frame, ends)| {
            let apart = ends.map(|end| end - u).into_iter().filter(|d| *d != 0.0);
            let points = apart.flat_map(|along| [0.0, half, -half].map(|v| (along, v)));
            let points = points
                .map(|(along, v)| at(along, v, along * frame.column(1) + v * frame.column(2)));
            points.collect::<Vec<_>>()
        });
        [at(0.0, 0.0, Vector3::zeros())]
            .into_iter()
            .chain(ends.into_iter().flatten())
            .chain(beyond.into_iter().flatten())
            .collect()
    }

    fn point(&self) -> Option<Vector3<f64>> {
        let [x, y, z] = self.position;
        Some(Vector3::new(x?, y?, z?))
    }

    fn name(&self) -> String {
        format!("supports[{}]", self.support)
    }

    /// Its place on the board, for people.
    fn place(&self) -> String {
        let BoardPoint { u, v } = self.on_board;
        match v == 0.0 {
            true => format!("u = {}", number(u)),
            false => format!("u = {}, v = {}", number(u), number(v)),
        }
    }
}

/// Two points of the belt that are held at a distance from each other.
struct Span {
    held: Held,
    /// Vector between the places of the spine, along the axes on which both are held.
    chord: Vector3<f64>,
    /// Difference of the points' offsets from these places, along the same axes.
    across: Vector3<f64>,
    /// The belt between the points.
    belt: f64,
    /// Rounding error of the distance.
    rounding: f64,
}

/// What holds the two points of a span.
enum Held {
    Supports([HeldPoint; 2]),
    /// A link by its index, and the arc lengths of its ends.
    Link(usize, [f64; 2]),
    /// Two supports by way of a link, by its index.
    SupportsByLink([HeldPoint; 2], usize),
}

impl fmt::Display for Held {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Supports([a, b]) => {
                let [at_a, at_b] = [a, b].map(HeldPoint::place);
                write!(f, "{} and {}, at {at_a} and {at_b},", a.name(), b.name())
            }
            Self::Link(i, ends) => {
                let [from, to] = ends.map(number);
                write!(f, "the ends of links[{i}], at u = {from} and u = {to},")
            }
            Self::SupportsByLink([a, b], i) => {
                let (a, b) = (a.name(), b.name());
                write!(
                    f,
                    "{a} and {b}, less the offset of links[{i}] between them,"
                )
            }
        }
    }
}

impl Span {
    /// The spans between the points that supports hold, between the ends of links, and from support to support by way of a
    /// link.
    fn all<'a>(points: &'a [HeldPoint], scenario: &'a Scenario) -> impl Iterator<Item = Self> + 'a {
        let pairs = move || {
            let first = points.iter().enumerate();
            first.flat_map(|(i, a)| points[i + 1..].iter().map(move |b| [*a, *b]))
        };
        let pairs = move || pairs().filter(|[a, b]| a.support != b.support);
        let links = || scenario.links.iter().enumerate();
        let between = pairs().map(|pair| Self::between(pair, scenario));
        let of_links = links().map(|link| Self::of_link(link, scenario));
        let by_links = links().flat_map(move |link| {
            pairs().flat_map(move |pair| Self::by_way_of(link, pair, scenario))
        });
        between.chain(of_links).chain(by_links)
    }

    /// The span between two held points, along the axes that both hold.
    fn between(pair: [HeldPoint; 2], scenario: &Scenario) -> Self {
        let [a, b] = in_order(pair, &scenario.belt);
        let held = [0, 1, 2].map(|k| a.position[k].zip(b.position[k]));
        let along = |of: &dyn Fn(usize, (f64, f64)) -> f64| {
            Vector3::from_fn(|k, _| held[k].map_or(0.0, |pair| of(k, pair)))
        };
        let size = along(&|_, (a, b)| a.abs().max(b.abs())).amax();
        Self {
            held: Held::Supports([a, b]),
            chord: along(&|_, (a, b)| b - a),
            across: along(&|k, _| b.across[k] - a.across[k]),
            belt: distance([a, b].map(|point| point.on_board), &scenario.belt),
            rounding: rounding(scenario, size),
        }
    }

    /// The span between the ends of a link.
    fn of_link((i, link): (usize, &LinkSpec), scenario: &Scenario) -> Self {
        let ends = ends(link, scenario);
        Self {
            held: Held::Link(i, ends.map(|end| end.u)),
            chord: link.offset.into(),
            across: Vector3::zeros(),
            belt: distance(ends, &scenario.belt),
            rounding: rounding(scenario, 0.0),
        }
    }

    /// The spans from one support to another by way of a link, in both senses: less the link's offset they are the belt from
    /// each support to an end of the link.
    fn by_way_of(
        (i, link): (usize, &LinkSpec),
        [a, b]: [HeldPoint; 2],
        scenario: &Scenario,
    ) -> impl Iterator<Item = Self> {
        let Some((first, second)) = a.point().zip(b.point()) else {
            return None.into_iter().flatten();
        };
        let ends = ends(link, scenario);
        let offset = Vector3::from(link.offset);
        let senses = [(ends, offset), ([ends[1], ends[0]], -offset)];
        let span = |([near, far], offset): ([BoardPoint; 2], Vector3<f64>)| Self {
            held: Held::SupportsByLink([a, b], i),
            chord: second - first - offset,
            across: b.across - a.across,
            belt: distance([a.on_board, near], &scenario.belt)
                + distance([far, b.on_board], &scenario.belt),
            rounding: rounding(scenario, first.amax().max(second.amax())),
        };
        Some(senses.map(span)).into_iter().flatten()
    }

    fn distance(&self) -> f64 {
        (self.chord + self.across).norm()
    }

    /// Excess of the distance over the length of belt in between.
    fn excess(&self) -> f64 {
        self.distance() - self.belt
    }

    fn is_too_long(&self) -> bool {
        self.excess() > self.rounding
    }

    /// Least distance by which the places of the spine must come closer along their chord; the excess where that is not
    /// enough.
    fn closer(&self) -> f64 {
        let chord = self.chord.normalize();
        let along = (self.chord + self.across).dot(&chord);
        let beside = self.distance().powi(2) - along * along;
        let closer = along - (self.belt * self.belt - beside).sqrt();
        if closer.is_finite() {
            closer
        } else {
            self.excess()
        }
    }
}

/// Two points in the order in which the shorter way between them goes along the belt: on a closed belt, it may go through
/// the seam.
fn in_order([a, b]: [HeldPoint; 2], belt: &BeltSpec) -> [HeldPoint; 2] {
    let through_seam = (b.on_board.u - a.on_board.u).abs() > 0.5 * belt.length();
    match belt.closed && through_seam {
        true => [b, a],
        false => [a, b],
    }
}

/// The ends of a link on the spine.
fn ends(link: &LinkSpec, scenario: &Scenario) -> [BoardPoint; 2] {
    let length = scenario.belt.length();
    [link.from, link.to].map(|place| BoardPoint {
        u: place.arc_length(length),
        v: 0.0,
    })
}

/// Rounding error of a distance between places whose coordinates are of a size.
fn rounding(scenario: &Scenario, size: f64) -> f64 {
    1e-12 * scenario.belt.length() + 4.0 * f64::EPSILON * size
}

/// A number as printed: six decimals, or an exponent where these show too few digits.
pub(crate) fn number(value: f64) -> String {
    let trimmed = |digits: &str| {
        digits
            .trim_end_matches('0')
            .trim_end_matches('.')
            .to_owned()
    };
    if value == 0.0 || (1e-3..1e6).contains(&value.abs()) {
        return trimmed(&format!("{value:.6}"));
    }
    let text = format!("{value:.6e}");
    match text.split_once('e') {
        Some((digits, power)) => format!("{}e{power}", trimmed(digits)),
        None => text,
    }
}
