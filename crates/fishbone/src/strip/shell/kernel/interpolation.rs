//! Fields at a place of an element by its unknowns.

use super::*;

/// Factors of the unknowns of an element in the fields at a place.
pub(super) struct Interpolation {
    /// Of k by its unknowns.
    pub(super) bend: [[Wide; 1]; 2],
    /// Of m and m' by those of m.
    pub(super) linear: [[Wide; 2]; 2],
    /// Of β or q and its first two rates by value and rate at the start, then at the end.
    pub(super) cubic: [[Wide; 3]; 4],
}

impl Interpolation {
    #[inline(always)]
    pub(super) fn at(t: f64, length: Wide) -> Self {
        let per_length = length.recip();
        let [value, first, second] = hermite(t);
        let mut cubic = [[Wide::ZERO; 3]; 4];
        for i in 0..4 {
            let unit = if i % 2 == 0 { Wide::all(1.0) } else { length };
            let rate = unit * per_length;
            cubic[i] = [
                unit * value[i],
                rate * first[i],
                rate * per_length * second[i],
            ];
        }
        let [start, end] = [Wide::all(1.0 - t), Wide::all(t)];
        Self {
            bend: [[-start], [-end]],
            linear: [[start, -per_length], [end, per_length]],
            cubic,
        }
    }

    /// The factors times a weight.
    #[inline(always)]
    pub(super) fn weighed(&self, weight: Wide) -> Self {
        Self {
            bend: weighed(&self.bend, weight),
            linear: weighed(&self.linear, weight),
            cubic: weighed(&self.cubic, weight),
        }
    }

    #[inline(always)]
    pub(super) fn fields(&self, unknowns: &[Wide; UNKNOWNS]) -> [Wide; INPUTS] {
        let mut fields = [Wide::ZERO; INPUTS];
        interpolate(&self.bend, BEND, unknowns, 0, &mut fields);
        interpolate(&self.cubic, SLOPE, unknowns, 2, &mut fields);
        interpolate(&self.linear, TWIST, unknowns, 6, &mut fields);
        interpolate(&self.cubic, ACROSS, unknowns, 8, &mut fields);
        fields
    }

    /// Adds derivatives by the fields to those by the unknowns, with the factors of rows from here and those of columns from
    /// another.
    #[inline(always)]
    pub(super) fn add(&self, other: &Self, jet: &Jet, into: &mut Output) {
        let bend = (&self.bend, BEND, 0);
        let slope = (&self.cubic, SLOPE, 2);
        let twist = (&self.linear, TWIST, 6);
        let across = (&self.cubic, ACROSS, 8);
        add_gradient(bend, jet, into);
        add_gradient(slope, jet, into);
        add_gradient(twist, jet, into);
        add_gradient(across, jet, into);
        add_block(bend, (&other.bend, BEND, 0), jet, into);
        add_block(bend, (&other.cubic, SLOPE, 2), jet, into);
        add_block(bend, (&other.linear, TWIST, 6), jet, into);
        add_block(bend, (&other.cubic, ACROSS, 8), jet, into);
        add_block(slope, (&other.cubic, SLOPE, 2), jet, into);
        add_block(slope, (&other.linear, TWIST, 6), jet, into);
        add_block(slope, (&other.cubic, ACROSS, 8), jet, into);
        add_block(twist, (&other.linear, TWIST, 6), jet, into);
        add_block(twist, (&other.cubic, ACROSS, 8), jet, into);
        add_block(across, (&other.cubic, ACROSS, 8), jet, into);
    }
}

/// Factors of some unknowns in a field and its rates, the place of the field, and that of its first unknown.
type Part<'a, const RATES: usize, const OF: usize> = (&'a [[Wide; RATES]; OF], usize, usize);

#[inline(always)]
pub(super) fn weighed<const RATES: usize, const OF: usize>(
    factors: &[[Wide; RATES]; OF],
    weight: Wide,
) -> [[Wide; RATES]; OF] {
    let mut out = *factors;
    for factor in out.as_flattened_mut() {
        *factor = *factor * weight;
    }
    out
}

/// Finds a field and its rates.
#[inline(always)]
pub(super) fn interpolate<const RATES: usize, const OF: usize>(
    factors: &[[Wide; RATES]; OF],
    place: usize,
    unknowns: &[Wide; UNKNOWNS],
    from: usize,
    into: &mut [Wide; INPUTS],
) {
    for (i, factors) in factors.iter().enumerate() {
        for (rate, factor) in factors.iter().enumerate() {
            into[place + rate] += *factor * unknowns[from + i];
        }
    }
}

/// Adds the gradient by some unknowns.
#[inline(always)]
pub(super) fn add_gradient<const RATES: usize, const OF: usize>(
    (factors, place, from): Part<'_, RATES, OF>,
    jet: &Jet,
    into: &mut Output,
) {
    for (i, factors) in factors.iter().enumerate() {
        for (rate, factor) in factors.iter().enumerate() {
            into.gradient[from + i] += *factor * jet.gradient[place + rate];
        }
    }
}

/// Adds the second derivatives by some unknowns and others that do not come before.
#[inline(always)]
pub(super) fn add_block<const ROWS: usize, const I: usize, const COLUMNS: usize, const J: usize>(
    (rows, row, first): Part<'_, ROWS, I>,
    (columns, column, second): Part<'_, COLUMNS, J>,
    jet: &Jet,
    into: &mut Output,
) {
    for (j, factors) in columns.iter().enumerate() {
        let mut image = [Wide::ZERO; ROWS];
        for (a, image) in image.iter_mut().enumerate() {
            for (b, factor) in factors.iter().enumerate() {
                *image += jet.second(row + a, column + b) * *factor;
            }
        }
        for (i, factors) in rows.iter().enumerate() {
            if first + i <= second + j {
                let mut sum = into.hessian[first + i][second + j];
                for (factor, image) in factors.iter().zip(image) {
                    sum += *factor * image;
                }
                into.hessian[first + i][second + j] = sum;
            }
        }
    }
}
