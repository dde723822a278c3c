//! Rib slopes far from crossing, for a start.

use super::headings::Headings;
use crate::geometry::Pose;
use crate::problem::program::{BeltPoint, BeltProgram, Piece};
use nalgebra::Vector2;

/// Reaches over which ribs turn with the spine, tried in turn, in V.
const REACHES: [f64; 7] = [0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0];
/// Slack 1 − s v of ribs from which no longer reach is tried, dimensionless.
const CALM: f64 = 0.3;

/// Rib slopes far from crossing, square where ribs are held square: the best of several in which the ribs turn with the
/// spine, more gently the longer the reach.
///
/// Parallel ribs never cross, whatever the spine does; ribs square to the spine cross at every bend of the board.
pub(super) fn calm_slopes(program: &BeltProgram) -> Vec<f64> {
    let board = Headings::of(program);
    let width = program
        .elements()
        .map(|(_, element)| 2.0 * element.half_width)
        .fold(0.0, f64::max);
    let mut best = (f64::NEG_INFINITY, vec![0.0; board.u.len()]);
    let smooth = REACHES.iter().map(|widths| board.slopes(widths * width));
    let mitred = REACHES
        .iter()
        .map(|widths| mitred_slopes(program, widths * width));
    for slopes in smooth.chain(mitred) {
        let mut point = BeltPoint {
            fields: slopes
                .iter()
                .map(|slope| Vector2::new(0.0, *slope))
                .collect(),
            poses: vec![Pose::identity(); slopes.len()],
        };
        program.settle(&mut point);
        let slack = program.least_slack(&point);
        if slack > best.0 {
            best = (slack, point.fields.iter().map(|fields| fields[1]).collect());
        }
        if best.0 >= CALM {
            break;
        }
    }
    best.1
}

/// Rib slopes along the mitre at every bend, square where ribs are held square, linear in between and square beyond a reach
/// of both.
fn mitred_slopes(program: &BeltProgram, reach: f64) -> Vec<f64> {
    let u = program.nodes();
    let mut anchors: Vec<(f64, f64)> = Vec::new();
    let mut anchor = |u: f64, slope: f64| {
        if let Some((before, _)) = anchors.last().copied()
            && u - before > 2.0 * reach
        {
            anchors.extend([(before + reach, 0.0), (u - reach, 0.0)]);
        }
        anchors.push((u, slope));
    };
    anchor(u[0], 0.0);
    for (k, piece) in program.pieces.iter().enumerate() {
        let mitre = match piece {
            Piece::Joint { angle } => (0.5 * angle).tan(),
            Piece::Strip(_) | Piece::Rigid { .. } => 0.0,
        };
        if mitre != 0.0 || program.fixed_slope(k).is_some() {
            anchor(u[k], program.fixed_slope(k).unwrap_or(mitre));
        }
        if mitre != 0.0 {
            anchor(u[k + 1], program.fixed_slope(k + 1).unwrap_or(-mitre));
        }
    }
    anchor(u[u.len() - 1], 0.0);
    let at = |(node, u): (usize, &f64)| {
        let after_joint = node > 0 && matches!(program.pieces[node - 1], Piece::Joint { .. });
        let next = anchors.partition_point(|(place, _)| place < u || (after_joint && place == u));
        let next = next.clamp(1, anchors.len() - 1);
        let ((a, left), (b, right)) = (anchors[next - 1], anchors[next]);
        let share = if b > a { (u - a) / (b - a) } else { 1.0 };
        left + share.clamp(0.0, 1.0) * (right - left)
    };
    u.iter().enumerate().map(at).collect()
}
