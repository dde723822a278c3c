//! The strain of a board and of its layers.

use super::ThickBoard;
use super::tensor::BoardTensor;
use crate::strip::spine::{Sheet, Spine};
use crate::surface::Extreme;

/// Shares of the area on which a quantile is exceeded.
const SHARES: [f64; 3] = [0.001, 0.01, 0.05];

/// The strain of the board of a strip of finite thickness, each at a point the larger magnitude of both principal strains.
#[derive(Debug, Clone, PartialEq)]
pub struct Strain {
    /// Strain of the middle plane; of laminates that of the neutral surface.
    pub membrane: StrainExtremes,
    /// Strain of every layer, from bottom (−ξ) to top: the larger one of its two faces.
    pub layers: Vec<StrainExtremes>,
}

/// A strain over the area of the board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StrainExtremes {
    /// The largest with its place, as far from clamps as [`least_bend_radius`](crate::surface::least_bend_radius); `None` where
    /// no part of the board is so far from them.
    pub largest: Option<Extreme>,
    /// Strains not exceeded on 99.9, 99 and 95 % of the board's area, stiffeners included.
    pub area: [f64; 3],
}

/// Curvature and strain at a point of the board, as components along u, mixed, and across, along v.
#[derive(Debug, Clone, PartialEq)]
pub struct PointStrain {
    /// Curvature of the surface: its second fundamental form by the normal ξ, −ω_ζ along a straight spine.
    pub curvature: [f64; 3],
    /// Strain of the middle plane; the mixed component is half of the angle.
    pub membrane: [f64; 3],
    /// Largest magnitude of a principal strain on both faces of every layer, from bottom to top.
    pub layers: Vec<f64>,
}

/// The strain of a strip of finite thickness; `None` of any other belt.
pub fn strain(spine: &Spine) -> Option<Strain> {
    let board = ThickBoard::of(spine)?;
    let layer = |faces: &[f64]| board.extremes(|sheet, b, e| on_faces(faces, sheet, b, e));
    Some(Strain {
        membrane: board.extremes(|_, _, membrane| membrane.largest()),
        layers: board.faces.windows(2).map(layer).collect(),
    })
}

/// Curvature and strain at points (u, v) of the flat board of a strip of finite thickness, u along its spine and v square to it;
/// `None` of any other belt. Stiffeners have none; NaN off the board.
pub fn strain_at(spine: &Spine, points: &[[f64; 2]]) -> Option<Vec<PointStrain>> {
    let board = ThickBoard::of(spine)?;
    let off_board = PointStrain {
        curvature: [f64::NAN; 3],
        membrane: [f64::NAN; 3],
        layers: vec![f64::NAN; board.faces.len() - 1],
    };
    let at = |&[u, v]: &[f64; 2]| {
        let (sheet, b, membrane) = board.at(u, v)?;
        let layer = |faces: &[f64]| on_faces(faces, sheet, &b, &membrane);
        Some(PointStrain {
            curvature: b.into(),
            membrane: membrane.into(),
            layers: board.faces.windows(2).map(layer).collect(),
        })
    };
    let at = |point| at(point).unwrap_or_else(|| off_board.clone());
    Some(points.iter().map(at).collect())
}

impl ThickBoard {
    fn extremes(
        &self,
        strain: impl Fn(&Sheet, &BoardTensor, &BoardTensor) -> f64,
    ) -> StrainExtremes {
        let shares = self.shares(&strain);
        StrainExtremes {
            largest: self.peak(&strain),
            area: SHARES.map(|share| shares.exceeded_on(share * self.area)),
        }
    }
}

/// Largest magnitude of a principal strain at given heights above the neutral surface: what lies outside of a bend is stretched.
fn on_faces(faces: &[f64], sheet: &Sheet, b: &BoardTensor, membrane: &BoardTensor) -> f64 {
    let bending = BoardTensor {
        uu: b.uu - sheet.natural,
        ..*b
    };
    let at = |height: &f64| (*membrane + bending * -height).largest();
    faces.iter().map(at).fold(0.0, f64::max)
}
