//! Active-set corners of a curve, where an inequality becomes active or inactive.

use super::continuation::{Continuation, Step};
use super::curve::{Event, Events, Pace, Station, Turn};
use super::family::Family;
use crate::program::Distance;

impl<F: Family<X, U, N>, const X: usize, const U: usize, const N: usize>
    Continuation<'_, F, X, U, N>
{
    /// The station beyond an active-set corner, where no step along the curve leads on.
    ///
    /// With softened inequalities the curve is smooth at the corner. The softened curve is followed until it is near the
    /// original curve again.
    pub(super) fn round_corner(
        &self,
        last: &Station<F::Point, N>,
        length: &mut f64,
    ) -> Option<Step<F::Point, N>> {
        /// Ratios of softened to given complementarity that are tried in turn; dimensionless.
        const SOFTER: [f64; 4] = [1e1, 1e2, 1e3, 1e4];
        /// Distances before the corner at which the softened curve begins, as it cuts the corner; in
        /// [`Scales::distance`](crate::Scales::distance).
        const BACK: [f64; 2] = [3e-3, 1e-2];
        let mut ways = SOFTER
            .into_iter()
            .flat_map(|softness| BACK.map(|back| (softness, back * self.unit)));
        let beyond = ways.find_map(|(softness, back)| self.beyond_corner(last, softness, back))?;
        *length = 0.1 * self.pace.longest;
        let event = match self.pace.events {
            Events::Ignore => None,
            Events::Find | Events::EndAtFirst => self.event_at_corner(last, &beyond),
        };
        let [low, high] = self.range;
        Some(Step {
            length: last.distance(&beyond),
            arrived: beyond.parameter <= low || beyond.parameter >= high,
            station: beyond,
            event,
        })
    }

    /// The first station beyond a corner that the softened curve reaches.
    fn beyond_corner(
        &self,
        last: &Station<F::Point, N>,
        softness: f64,
        back: f64,
    ) -> Option<Station<F::Point, N>> {
        /// Length of the first step along the softened curve; in [`Scales::distance`](crate::Scales::distance).
        const FIRST_STEP: f64 = 1e-4;
        /// Largest count of steps along the softened curve; a number.
        const STEPS: usize = 100;
        let soft = self.softened(softness);
        let [low, high] = self.range;
        let before = self
            .step(last, &last.tangent, -back)
            .filter(|before| (low..=high).contains(&before.parameter))?;
        let mut station = soft.step(&before, &before.tangent, 0.0)?;
        let mut length = FIRST_STEP * self.unit;
        for _ in 0..STEPS {
            let step = soft.advance(&station, &mut length)?;
            station = step.station;
            let sharp = self.sharpened(&station, softness, step.arrived);
            if step.arrived {
                return sharp;
            }
            let sharp = sharp.filter(|sharp| self.leads_away(sharp, last));
            if sharp.is_some() {
                return sharp;
            }
        }
        None
    }

    /// The station of the original curve next to a station of the softened curve: orthogonal to the tangent, or at the same
    /// parameter.
    fn sharpened(
        &self,
        from: &Station<F::Point, N>,
        softness: f64,
        at_parameter: bool,
    ) -> Option<Station<F::Point, N>> {
        /// Ratio of successive softnesses on the way back to the given inequalities; dimensionless.
        const SHARPER: f64 = 0.1;
        let mut station = from.clone();
        let mut softness = softness;
        while softness > 1.0 {
            softness = (SHARPER * softness).max(1.0);
            let sharper = self.softened(softness);
            let mut at = station.at.clone();
            let square = (!at_parameter).then_some((&from.tangent, 0.0));
            let arrival = sharper.correct(&mut at, station.parameter, square)?;
            station = sharper.station(at, arrival, Some(&from.tangent))?;
        }
        Some(station)
    }

    /// Whether a step along the curve from a station increases the distance to another station.
    fn leads_away(&self, from: &Station<F::Point, N>, other: &Station<F::Point, N>) -> bool {
        /// Length of the probing step, as a share of the distance to the other station; dimensionless.
        const PROBE: f64 = 0.1;
        let way = from.at.point.distance(&other.at.point);
        let next = self.step(from, &from.tangent, (PROBE * way).max(self.shortest()));
        next.is_some_and(|next| next.at.point.distance(&other.at.point) > way)
    }

    /// The event at a corner.
    fn event_at_corner(
        &self,
        before: &Station<F::Point, N>,
        beyond: &Station<F::Point, N>,
    ) -> Option<Event<F::Point, N>> {
        let turn = match before.turn_before(beyond)? {
            Turn::Apex => Turn::Fold,
            turn => turn,
        };
        let crossing = before.negative.min(beyond.negative) + 1;
        let mode = self
            .modes(before, crossing)?
            .into_iter()
            .nth(crossing - 1)?;
        Some(Event {
            turn,
            parameter: before.parameter,
            station: before.clone(),
            negative: [before.negative, beyond.negative],
            mode,
        })
    }

    /// A continuation with softened inequalities that ignores events.
    fn softened(&self, softness: f64) -> Self {
        Self {
            family: self.family,
            softness,
            pace: Pace {
                events: Events::Ignore,
                ..self.pace
            },
            ..*self
        }
    }
}
