//! The bend of a strip of finite thickness over its board, by points of a fine grid.

use super::curvature::{FirstForm, SecondForm, principal_curvatures};
use super::extremes::{BendRadius, SpineRadius};
use super::rib::Rib;
use crate::board::feet::Board;
use crate::strip::spine::Spine;

/// Ribs of each element, and points of each rib, a number.
const ALONG: usize = 4;
const ACROSS: usize = 48;

/// The bend around a point of the board.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bent {
    /// The radius, and its place.
    pub(super) radius: BendRadius,
    /// Area of the board around the point.
    pub(super) area: f64,
}

/// The bend around the points of the grid; none where ribs are straight.
pub(super) fn bends(spine: &Spine) -> Vec<Bent> {
    if spine.curved.is_none() {
        return Vec::new();
    }
    let board = Board::of(spine);
    let strips = spine.strips();
    strips
        .flat_map(|element| (0..ALONG).map(move |i| (element, i)))
        .flat_map(|(element, i)| on_rib(spine, &board, element, i))
        .collect()
}

/// The bend around the points of a rib of the grid.
fn on_rib(spine: &Spine, board: &Board, element: usize, i: usize) -> Vec<Bent> {
    let step = spine.element_length(element) / ALONG as f64;
    let distance = (i as f64 + 0.5) * step;
    let Some(rib) = spine.rib(element, distance) else {
        return Vec::new();
    };
    let foot = board.foot_within(spine, element, distance);
    let clipped = Rib::new(&foot, &board.ends(&foot));
    let width = (clipped.v_plus - clipped.v_minus) / ACROSS as f64;
    let geodesic = spine.pieces[element].geodesic();
    let at = |j: usize| {
        let v = clipped.v_minus + (j as f64 + 0.5) * width;
        let b = rib.curvature(geodesic, v);
        Bent {
            radius: BendRadius {
                value: radius(b.on_board(rib.slope)),
                u: foot.point.u,
                v,
            },
            area: b.area * step * width,
        }
    };
    (0..ACROSS).map(at).collect()
}

/// Radii at points of the spine.
pub(super) fn radii_on_spine(spine: &Spine) -> Vec<SpineRadius> {
    let places = |element: usize| (0..=ALONG).map(move |i| (element, i as f64 / ALONG as f64));
    let at = |(element, share): (usize, f64)| {
        let distance = share * spine.element_length(element);
        let rib = spine.rib(element, distance)?;
        Some(SpineRadius {
            value: radius(rib.curvature(0.0, 0.0).on_board(rib.slope)),
            u: spine.u[element] + distance,
        })
    };
    spine.strips().flat_map(places).filter_map(at).collect()
}

/// Radius of the larger principal curvature of a tensor b_uu, b_uv, b_vv.
fn radius([l, m, n]: [f64; 3]) -> f64 {
    let (larger, _) = principal_curvatures(&FirstForm::ON_SPINE, &SecondForm { l, m, n });
    1.0 / larger.abs()
}
