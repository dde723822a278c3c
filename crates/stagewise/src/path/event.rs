//! Events between two stations, where the second variation becomes singular.

use super::continuation::Continuation;
use super::curve::{Event, Events, Station, Turn};
use super::family::Family;

impl<F: Family<X, U, N>, const X: usize, const U: usize, const N: usize>
    Continuation<'_, F, X, U, N>
{
    /// The event on a step of a length from a station to the next, unless events are ignored.
    pub(super) fn event_on(
        &self,
        from: &Station<F::Point, N>,
        to: &Station<F::Point, N>,
        length: f64,
    ) -> Option<Event<F::Point, N>> {
        match self.pace.events {
            Events::Ignore => None,
            Events::Find | Events::EndAtFirst => self.event_between(from, to, length),
        }
    }

    /// The event between two stations.
    ///
    /// A bracket of the event is narrowed by the secant method (Illinois). Next to the event the system is nearly singular,
    /// and steps may fail; the function is smooth, so that the last secant extrapolates.
    fn event_between(
        &self,
        from: &Station<F::Point, N>,
        to: &Station<F::Point, N>,
        length: f64,
    ) -> Option<Event<F::Point, N>> {
        /// Largest count of secant steps; a number.
        const ITERATIONS: usize = 30;
        /// Distance in the parameter at which the bracket has converged; in [`Scales::distance`](crate::Scales::distance).
        const CONVERGED: f64 = 1e-9;
        /// Width of the bracket in the parameter below which the function is smooth between its ends; in
        /// [`Scales::distance`](crate::Scales::distance).
        const SMOOTH: f64 = 1e-5;
        /// Shares of the bracket that are tried where no step leads to the secant's place; dimensionless.
        const FALLBACK_SHARES: [f64; 5] = [0.5, 0.25, 0.75, 0.1, 0.9];
        let turn = from.turn_before(to)?;
        let crossing = from.negative.min(to.negative) + 1;
        // The function that changes its sign at the event.
        let place = |length: f64, station: Station<F::Point, N>| {
            let value = match turn {
                Turn::Fold | Turn::Apex => station.tangent.parameter,
                Turn::Bifurcation => {
                    let modes = self.modes(&station, crossing)?;
                    let size = modes.get(crossing - 1)?.eigenvalue.abs();
                    if station.negative < crossing {
                        size
                    } else {
                        -size
                    }
                }
            };
            Some(Place {
                length,
                value,
                station,
            })
        };
        let mut low = place(0.0, from.clone())?;
        let mut high = place(length, to.clone())?;
        let (mut weights, mut stays) = ([1.0, 1.0], None);
        for _ in 0..ITERATIONS {
            let (a, b) = (weights[0] * low.value, weights[1] * high.value);
            let next = low.length - a * (high.length - low.length) / (b - a);
            let is_close = match turn {
                Turn::Fold | Turn::Apex => {
                    low.value.abs().min(high.value.abs()) * (high.length - low.length)
                }
                Turn::Bifurcation => (high.station.parameter - low.station.parameter).abs(),
            };
            if is_close < CONVERGED * self.unit {
                break;
            }
            let aside =
                FALLBACK_SHARES.map(|share| low.length + share * (high.length - low.length));
            let mut nexts = std::iter::once(next).chain(aside);
            let next = nexts.find_map(|next| {
                let station = self.step(from, &from.tangent, next)?;
                place(next, station)
            });
            let Some(next) = next else {
                break;
            };
            // Illinois: an end of the bracket that stays twice is weighted by one half.
            let is_low = (next.value < 0.0) == (low.value < 0.0);
            weights = match (is_low, stays) {
                (true, Some(true)) => [1.0, 0.5 * weights[1]],
                (false, Some(false)) => [0.5 * weights[0], 1.0],
                _ => [1.0, 1.0],
            };
            stays = Some(is_low);
            match is_low {
                true => low = next,
                false => high = next,
            }
        }
        let share = low.value / (low.value - high.value);
        let [a, b] = [&low, &high].map(|place| place.station.parameter);
        let nearest = if share < 0.5 { low } else { high };
        let is_smooth = (b - a).abs() < SMOOTH * self.unit;
        let parameter = match turn {
            Turn::Bifurcation if is_smooth => a + share * (b - a),
            _ => nearest.station.parameter,
        };
        let mode = self.modes(&nearest.station, crossing)?;
        let mode = mode.into_iter().nth(crossing - 1)?;
        Some(Event {
            turn,
            parameter,
            negative: [from.negative, to.negative],
            mode,
            station: nearest.station,
        })
    }
}

/// A station at a length along a step, and the value of the function that is zero at an event.
struct Place<P, const N: usize> {
    length: f64,
    value: f64,
    station: Station<P, N>,
}
