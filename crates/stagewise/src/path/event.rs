//! Where between two stations the second variation becomes singular.

use super::continuation::Continuation;
use super::curve::{Event, Station, Turn};
use super::family::Family;

impl<F: Family<X, U, N>, const X: usize, const U: usize, const N: usize>
    Continuation<'_, F, X, U, N>
{
    /// What happens between two stations, and where.
    ///
    /// The place is bracketed and closed in on by the secant. Very near to it the system is all but singular, and no step may
    /// lead there any more; what is sought is smooth, so that the last secant tells the rest.
    pub(super) fn event_between(
        &self,
        from: &Station<F::Point, N>,
        to: &Station<F::Point, N>,
        length: f64,
    ) -> Option<Event<F::Point, N>> {
        const ITERATIONS: usize = 30;
        /// As close in the parameter as is worth while, in the unit of distance.
        const CLOSE: f64 = 1e-9;
        /// Where the last steps lead no nearer than this, in the unit of distance, the value need not be smooth in between.
        const SHARP: f64 = 1e-5;
        /// Where to look instead, between the two, where no step leads to the place.
        const SHARES: [f64; 5] = [0.5, 0.25, 0.75, 0.1, 0.9];
        let turn = from.turn_before(to)?;
        let crossing = from.negative.min(to.negative) + 1;
        // What changes its sign.
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
            if is_close < CLOSE * self.unit {
                break;
            }
            let aside = SHARES.map(|share| low.length + share * (high.length - low.length));
            let mut nexts = std::iter::once(next).chain(aside);
            let next = nexts.find_map(|next| {
                let station = self.step(from, &from.tangent, next)?;
                place(next, station)
            });
            let Some(next) = next else {
                break;
            };
            // The end that stays a second time counts for less, lest it stay for ever.
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
        let is_sharp = (b - a).abs() < SHARP * self.unit;
        let parameter = match turn {
            Turn::Bifurcation if is_sharp => a + share * (b - a),
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

/// A station so far along a step, and the value there of what is zero at an event.
struct Place<P, const N: usize> {
    length: f64,
    value: f64,
    station: Station<P, N>,
}
