//! The lines along the board on which its strain is found, and the rule that integrates across them.

use std::f64::consts::PI;

/// Lines along the board, both edges among them, a number: the edge layers of thin sheets take some of them.
pub(super) const ROWS: usize = 41;
/// The line of the spine, an index.
pub(super) const SPINE: usize = ROWS / 2;
/// Intervals between the lines, a number.
const INTERVALS: usize = ROWS - 1;

/// The rule of Clenshaw and Curtis on [−1, 1]: it holds both ends, its places crowd there, and all its weights are positive.
#[derive(Debug, Clone)]
pub(super) struct Rows {
    /// Places t = v/(V/2), rising.
    pub(super) t: [f64; ROWS],
    /// Weights; they sum to 2.
    pub(super) weight: [f64; ROWS],
}

impl Rows {
    pub(super) fn new() -> Self {
        Self {
            t: std::array::from_fn(place),
            weight: std::array::from_fn(weight),
        }
    }

    /// The row below a place, and the share of the way from it to the next.
    pub(super) fn around(&self, t: f64) -> (usize, f64) {
        let above = self.t.partition_point(|&row| row <= t);
        let below = above.clamp(1, INTERVALS) - 1;
        let share = (t - self.t[below]) / (self.t[below + 1] - self.t[below]);
        (below, share.clamp(0.0, 1.0))
    }
}

fn place(row: usize) -> f64 {
    // The sine is odd about the spine, to the last digit.
    let turn = row as f64 - SPINE as f64;
    (PI * turn / INTERVALS as f64).sin()
}

fn weight(row: usize) -> f64 {
    let angle = PI * row as f64 / INTERVALS as f64;
    let terms = (1..=SPINE).map(|k| {
        let n = 2.0 * k as f64;
        let share = if k == SPINE { 1.0 } else { 2.0 };
        share * (n * angle).cos() / (n * n - 1.0)
    });
    let whole = 2.0 / INTERVALS as f64 * (1.0 - terms.sum::<f64>());
    match row {
        0 | INTERVALS => 0.5 * whole,
        _ => whole,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn test_rows_integrate_powers() {
        let rows = Rows::new();
        for power in 0..=INTERVALS as i32 {
            let terms = (0..ROWS).map(|row| rows.weight[row] * rows.t[row].powi(power));
            let exact = if power % 2 == 0 {
                2.0 / f64::from(power + 1)
            } else {
                0.0
            };
            assert_relative_eq!(terms.sum::<f64>(), exact, epsilon = 1e-14);
        }
    }

    #[test]
    fn test_places_lie_between_the_rows_around_them() {
        let rows = Rows::new();
        assert_eq!(
            (rows.t[0], rows.t[SPINE], rows.t[ROWS - 1]),
            (-1.0, 0.0, 1.0)
        );
        for t in [-1.0, -0.3, 0.0, 0.77, 1.0] {
            let (below, share) = rows.around(t);
            let found = rows.t[below] * (1.0 - share) + rows.t[below + 1] * share;
            assert_relative_eq!(found, t, epsilon = 1e-15);
        }
    }
}
