//! The units of a programme.

use crate::geometry::Wrench;
use crate::problem::belt::Belt;
use nalgebra::Vector3;

/// Units of length and energy of a programme, in the units of its scenario.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Units {
    /// The length U of the belt.
    pub length: f64,
    /// The mean of the rigidity R_f over the flexible strips, over U.
    pub energy: f64,
}

impl Units {
    /// The units of the programmes of a belt.
    pub(super) fn of(belt: &Belt) -> Self {
        Self {
            length: belt.length(),
            energy: belt.mean_rigidity() / belt.length(),
        }
    }

    /// The unit of force: energy over length.
    pub(crate) fn force(&self) -> f64 {
        self.energy / self.length
    }

    /// A force and a moment of the programme in the units of the scenario.
    pub(crate) fn wrench(&self, (force, moment): (Vector3<f64>, Vector3<f64>)) -> Wrench {
        Wrench {
            force: force * self.force(),
            moment: moment * self.energy,
        }
    }
}
