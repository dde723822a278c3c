//! The layers along the free edges, in which the cross-section curls until no moment acts across the edge.

use super::cells::{Cells, Field};
use super::rows::{ROWS, Rows, SPINE};
use super::tensor::BoardTensor;
use crate::strip::shell::edge_layer::psi;
use crate::strip::spine::Sheet;

/// Takes out the bend across with which the model's ribs imitate the layers in the mean.
pub(super) fn take_out_of_ribs(curvature: &mut Field, sheets: &[Sheet], width: f64) {
    for (cell, sheet) in sheets.iter().enumerate() {
        let spine = curvature.at(cell, SPINE);
        let number = sheet.stretching * (spine.uu * width * width).powi(2) / 4.0;
        let share = (1.0 - psi(number)) / (1.0 + number / 180.0);
        let curl = share * moment(sheet, &spine);
        for row in 0..ROWS {
            curvature.at_mut(cell, row).vv += curl;
        }
    }
}

/// Moment across the board over the rigidity D.
fn moment(sheet: &Sheet, b: &BoardTensor) -> f64 {
    b.vv + sheet.poisson * (b.uu - sheet.natural)
}

/// Length in which a layer along an edge of a bend decays; infinite along a straight edge.
fn decay_length(sheet: &Sheet, bend: f64) -> f64 {
    (4.0 / (sheet.stretching * bend * bend)).sqrt().sqrt()
}

/// The layer of an edge at one cell: the deflection `e^{−X} (A cos X + B sin X)` at X lengths from the edge, on the foundation
/// that the bend along the edge makes of the sheet.
#[derive(Debug, Clone, Copy)]
struct Layer {
    /// Bend along the edge.
    bend: f64,
    /// Length of decay.
    length: f64,
    /// Factors A and B.
    factors: [f64; 2],
    poisson: f64,
}

impl Layer {
    /// The layer that balances the moment across the edge, `F = b_vv + ν b_uu`, and its shear force Q, both over D.
    fn of(sheet: &Sheet, edge: &BoardTensor, shear: f64, width: f64) -> Self {
        let (bend, moment) = (edge.uu, moment(sheet, edge));
        let length = decay_length(sheet, bend).min(0.25 * width);
        // Where the bend all but vanishes the layers are wider than the theory of them holds.
        let shear = (shear * length).clamp(-bend.abs(), bend.abs());
        let square = length * length;
        Self {
            bend,
            length,
            factors: [0.5 * square * (shear - moment), 0.5 * square * moment],
            poisson: sheet.poisson,
        }
    }

    /// Curvature and membrane strain at a distance from the edge.
    fn at(&self, distance: f64) -> [BoardTensor; 2] {
        let place = distance / self.length;
        let (decay, (sine, cosine)) = ((-place).exp(), place.sin_cos());
        let [a, b] = self.factors;
        let deflection = decay * (a * cosine + b * sine);
        let curl = 2.0 * decay * (a * sine - b * cosine) / (self.length * self.length);
        let strain = self.bend * deflection;
        [
            BoardTensor {
                vv: curl,
                ..BoardTensor::default()
            },
            BoardTensor {
                uu: -strain,
                vv: self.poisson * strain,
                ..BoardTensor::default()
            },
        ]
    }
}

/// Adds the layers of both edges to curvature and membrane strain, each edge by itself.
pub(super) fn add(curvature: &mut Field, membrane: &mut Field, plan: &Plan<'_>) {
    let layers = [Side::Minus, Side::Plus].map(|side| plan.layers(curvature, side));
    let half_width = 0.5 * plan.width;
    for row in 0..ROWS {
        let t = plan.rows.t[row];
        for (layers, distance) in layers.iter().zip([1.0 + t, 1.0 - t]) {
            for (cell, layer) in layers.iter().enumerate() {
                let [curl, strain] = layer.at(distance * half_width);
                let (b, e) = (curvature.at_mut(cell, row), membrane.at_mut(cell, row));
                (*b, *e) = (*b + curl, *e + strain);
            }
        }
    }
}

/// A free edge of the board.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Side {
    /// v = −V/2.
    Minus,
    /// v = V/2.
    Plus,
}

impl Side {
    /// Rows of the edge, and of the two next to it.
    fn rows(self) -> [usize; 3] {
        match self {
            Self::Minus => [0, 1, 2],
            Self::Plus => [ROWS - 1, ROWS - 2, ROWS - 3],
        }
    }

    /// Sign of v.
    fn sign(self) -> f64 {
        match self {
            Self::Minus => -1.0,
            Self::Plus => 1.0,
        }
    }
}

/// What the layers of a stretch depend on besides its curvature.
pub(super) struct Plan<'a> {
    pub(super) cells: &'a Cells,
    pub(super) rows: &'a Rows,
    /// Sheet of every cell.
    pub(super) sheets: &'a [Sheet],
    /// In-plane curvature of every cell.
    pub(super) geodesic: &'a [f64],
    pub(super) width: f64,
}

impl Plan<'_> {
    /// The layers along an edge.
    fn layers(&self, curvature: &Field, side: Side) -> Vec<Layer> {
        let layer = |(cell, sheet): (usize, &Sheet)| {
            let edge = curvature.at(cell, side.rows()[0]);
            Layer::of(sheet, &edge, self.shear(curvature, side, cell), self.width)
        };
        self.sheets.iter().enumerate().map(layer).collect()
    }

    /// Shear force of the bulk at an edge over D, `∂_out b_vv + (2−ν) ∂_out b_uu`; by Codazzi ∂_v b_uu is ∂_u b_uv.
    fn shear(&self, curvature: &Field, side: Side, cell: usize) -> f64 {
        let half_width = 0.5 * self.width;
        let rows = side.rows();
        // The slope at the edge of the parabola through three rows.
        let [x, y] =
            [1, 2].map(|i| half_width * (self.rows.t[rows[i]] - self.rows.t[rows[0]]).abs());
        let [here, near, far] = rows.map(|row| curvature.at(cell, row).vv);
        let inwards = ((near - here) * y / x - (far - here) * x / y) / (y - x);
        let [before, after] = [
            cell.saturating_sub(1),
            (cell + 1).min(self.cells.count() - 1),
        ];
        let rise = curvature.at(after, rows[0]).uv - curvature.at(before, rows[0]).uv;
        let length = (after - before) as f64 * self.cells.length;
        let stretch = 1.0 - side.sign() * half_width * self.geodesic[cell];
        let outwards = side.sign() * rise / (length * stretch);
        (2.0 - self.sheets[cell].poisson) * outwards - inwards
    }
}
