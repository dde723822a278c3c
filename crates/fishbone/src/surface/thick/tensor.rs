//! Symmetric tensors of the board's plane: curvature and strain.

use crate::strip::shell::Curvature;
use std::ops::{Add, Mul};

/// A symmetric tensor at a point of the flat board, in its axes there: u along the spine, v across.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(in crate::surface) struct BoardTensor {
    /// Along u.
    pub(super) uu: f64,
    /// The mixed component, half of an angle if it is a strain.
    pub(super) uv: f64,
    /// Across, along v.
    pub(super) vv: f64,
}

impl BoardTensor {
    /// The curvature at a point of a rib of a slope, in axes along and across the spine.
    pub(in crate::surface) fn on_rib(b: &Curvature<f64>, slope: f64) -> Self {
        let mixed = b.mixed + slope * b.along;
        Self {
            uu: b.along,
            uv: mixed,
            vv: b.across + slope * (b.mixed + mixed),
        }
    }

    /// The principal value of larger magnitude.
    pub(in crate::surface) fn principal(&self) -> f64 {
        let mean = 0.5 * (self.uu + self.vv);
        mean + self.uv.hypot(0.5 * (self.uu - self.vv)).copysign(mean)
    }

    /// Magnitude of the principal value of larger magnitude.
    pub(in crate::surface) fn largest(&self) -> f64 {
        self.principal().abs()
    }

    /// The product of both principal values.
    pub(super) fn determinant(&self) -> f64 {
        self.uu * self.vv - self.uv * self.uv
    }

    /// The tensor in axes turned by an angle from u towards v.
    pub(super) fn turned(&self, angle: f64) -> Self {
        let (sine, cosine) = angle.sin_cos();
        let (s2, c2, sc) = (sine * sine, cosine * cosine, sine * cosine);
        Self {
            uu: c2 * self.uu + 2.0 * sc * self.uv + s2 * self.vv,
            uv: sc * (self.vv - self.uu) + (c2 - s2) * self.uv,
            vv: s2 * self.uu - 2.0 * sc * self.uv + c2 * self.vv,
        }
    }

    /// The tensor a share of the way to another.
    pub(super) fn towards(self, other: Self, share: f64) -> Self {
        self * (1.0 - share) + other * share
    }
}

impl From<BoardTensor> for [f64; 3] {
    fn from(tensor: BoardTensor) -> Self {
        [tensor.uu, tensor.uv, tensor.vv]
    }
}

impl Add for BoardTensor {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            uu: self.uu + other.uu,
            uv: self.uv + other.uv,
            vv: self.vv + other.vv,
        }
    }
}

impl Mul<f64> for BoardTensor {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self {
            uu: self.uu * factor,
            uv: self.uv * factor,
            vv: self.vv * factor,
        }
    }
}
