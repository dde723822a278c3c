//! Headings of the spine of the flat board.

use crate::problem::program::{BeltProgram, Piece};

/// Reach of the mean heading below which a rib is square, in U.
const SHORTEST: f64 = 1e-6;

/// Headings of the spine of the flat board.
pub(super) struct Headings {
    pub(super) u: Vec<f64>,
    /// Angle from η at the start towards ζ, at every node.
    pub(super) heading: Vec<f64>,
    /// Integral of the heading from the start, at every node.
    integral: Vec<f64>,
    /// Arc lengths where the rib is held.
    held: Vec<f64>,
}

impl Headings {
    pub(super) fn of(program: &BeltProgram) -> Self {
        let u = program.nodes();
        let (mut heading, mut integral) = (vec![0.0], vec![0.0]);
        for (k, piece) in program.pieces.iter().enumerate() {
            let turn = match piece {
                Piece::Strip(element) => element.geodesic * element.length,
                Piece::Joint { angle } => *angle,
                Piece::Rigid { .. } => 0.0,
            };
            integral.push(integral[k] + piece.length() * (heading[k] + 0.5 * turn));
            heading.push(heading[k] + turn);
        }
        let held = (0..u.len()).filter(|node| program.fixed_slope(*node).is_some());
        Self {
            held: held.map(|node| u[node]).collect(),
            heading,
            integral,
            u,
        }
    }

    /// Rib slopes whose flat direction is the mean heading within a reach on either side; the reach is shorter near held
    /// ribs.
    pub(super) fn slopes(&self, reach: f64) -> Vec<f64> {
        let slope = |(u, heading): (&f64, &f64)| {
            let reach = reach.max(SHORTEST).min(self.to_held(*u));
            let mean = (self.integral_at(u + reach) - self.integral_at(u - reach)) / (2.0 * reach);
            match reach < SHORTEST {
                true => 0.0,
                false => (mean - heading).clamp(-1.5, 1.5).tan(),
            }
        };
        self.u.iter().zip(&self.heading).map(slope).collect()
    }

    /// Distance to the nearest held rib.
    pub(super) fn to_held(&self, u: f64) -> f64 {
        let ways = self.held.iter().map(|held| (held - u).abs());
        ways.fold(f64::INFINITY, f64::min)
    }

    /// Integral of the heading from the start, going on straight beyond the ends.
    fn integral_at(&self, u: f64) -> f64 {
        let last = self.u.len() - 1;
        let k = self.u.partition_point(|node| *node <= u);
        if k == 0 {
            return u * self.heading[0];
        }
        let past = u - self.u[k - 1];
        if k > last {
            return self.integral[last] + past * self.heading[last];
        }
        let length = self.u[k] - self.u[k - 1];
        let rise = self.heading[k] - self.heading[k - 1];
        self.integral[k - 1] + past * (self.heading[k - 1] + 0.5 * rise * past / length)
    }

    /// Whether the board is straight all along.
    pub(super) fn is_straight(&self) -> bool {
        self.heading.iter().all(|heading| *heading == 0.0)
    }
}
