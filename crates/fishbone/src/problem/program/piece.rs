//! Pieces of the belt between a node of the spine and the next.

use crate::geometry::Pose;
use crate::strip::element::Element;
use crate::strip::spine::turn;
use nalgebra::Vector3;

/// A piece of the belt between a node and the next.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub enum Piece {
    /// A flexible element.
    Strip(Element),
    /// A stiffened stretch.
    Rigid {
        /// Length along the spine.
        length: f64,
    },
    /// A place of no length where the bend may jump, and the board turn.
    Joint {
        /// Angle χ by which the board turns, from η towards ζ.
        angle: f64,
    },
}

impl Piece {
    /// Length along the spine.
    pub(crate) fn length(&self) -> f64 {
        match self {
            Self::Strip(element) => element.length,
            Self::Rigid { length } => *length,
            Self::Joint { .. } => 0.0,
        }
    }

    /// The motion along a piece, where it does not depend on the shape.
    pub(super) fn fixed_motion(&self) -> Option<Pose> {
        match self {
            Self::Strip(_) => None,
            Self::Rigid { length } => Some(Pose {
                position: Vector3::y() * *length,
                ..Pose::identity()
            }),
            Self::Joint { angle } => Some(turn(*angle)),
        }
    }
}
