//! The reach of the belt: whether it is long enough for its supports and links.

use super::Problem;
use crate::scenario::{BeltSpec, LinkSpec, Scenario, SupportSpec};
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
}

/// One line: the supports or the link, the missing length, and the remedy.
impl fmt::Display for OutOfReach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} are {} apart, {} more than the belt between them ({}); move them closer",
            self.held,
            number(self.distance),
            number(self.distance - self.belt),
            number(self.belt)
        )
    }
}

impl Problem {
    /// The first two points that are held too far apart for the belt between them; `None` where there are none.
    pub(crate) fn unreachable_supports(&self) -> Option<OutOfReach> {
        let too_long = Span::all(&self.scenario).find(|span| span.excess() > span.rounding)?;
        Some(OutOfReach {
            held: too_long.held,
            distance: too_long.distance,
            belt: too_long.belt,
        })
    }

    /// Whether two points are held so far apart that the belt between them is at its inextensible limit: its reactions are
    /// undetermined.
    pub(crate) fn has_no_slack(&self) -> bool {
        /// Slack of the belt between two held points below which reactions are undetermined, as a share of its length.
        const SLACK: f64 = 1e-6;
        Span::all(&self.scenario).any(|span| span.belt > 0.0 && span.excess() > -SLACK * span.belt)
    }
}

/// Two points of the belt that are held at a distance from each other.
struct Span {
    /// The supports or the link that hold the two points, and their places.
    held: String,
    distance: f64,
    /// The belt between them.
    belt: f64,
    /// Rounding error of the distance.
    rounding: f64,
}

impl Span {
    /// The spans between supports that follow each other, all round a closed belt, and between the ends of links.
    fn all(scenario: &Scenario) -> impl Iterator<Item = Self> {
        let (belt, supports) = (&scenario.belt, &scenario.supports);
        let count = supports.len();
        let pairs = match belt.closed {
            true => count,
            false => count.saturating_sub(1),
        };
        let pairs = (0..pairs).map(move |i| [i, (i + 1) % count]);
        let links = scenario.links.iter().enumerate();
        pairs
            .map(|pair| Self::between(pair, supports, belt))
            .chain(links.map(|(i, link)| Self::of_link(i, link, belt)))
    }

    /// The span between two supports, along the axes that both hold.
    fn between([i, j]: [usize; 2], supports: &[SupportSpec], belt: &BeltSpec) -> Self {
        let length = belt.length();
        let [x, x_next] = [i, j].map(|k| supports[k].components());
        let held = (0..3).filter_map(|k| x[k].zip(x_next[k]));
        let (square, size) = held.fold((0.0, 0.0), |(square, size), (a, b)| {
            (
                square + (b - a) * (b - a),
                f64::max(size, a.abs().max(b.abs())),
            )
        });
        let u = [i, j].map(|k| supports[k].at.arc_length(length));
        let [at, at_next] = u.map(number);
        Self {
            held: format!("supports[{i}] and supports[{j}], at u = {at} and u = {at_next},"),
            distance: f64::sqrt(square),
            belt: belt_between(u, belt),
            rounding: 1e-12 * length + 4.0 * f64::EPSILON * size,
        }
    }

    fn of_link(i: usize, link: &LinkSpec, belt: &BeltSpec) -> Self {
        let u = [link.from, link.to].map(|place| place.arc_length(belt.length()));
        let [from, to] = u.map(number);
        Self {
            held: format!("the ends of links[{i}], at u = {from} and u = {to},"),
            distance: Vector3::from(link.offset).norm(),
            belt: belt_between(u, belt),
            rounding: 1e-12 * belt.length(),
        }
    }

    /// Excess of the distance over the length of belt in between.
    fn excess(&self) -> f64 {
        self.distance - self.belt
    }
}

/// Length of belt between two points, of a closed one the shorter way round.
fn belt_between(u: [f64; 2], belt: &BeltSpec) -> f64 {
    let way = (u[1] - u[0]).abs();
    match belt.closed {
        true => way.min(belt.length() - way),
        false => way,
    }
}

/// A number as printed: six decimals, or an exponent where these show too few digits.
pub(crate) fn number(value: f64) -> String {
    if value == 0.0 || (1e-3..1e6).contains(&value.abs()) {
        let text = format!("{value:.6}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{value:.6e}")
    }
}
