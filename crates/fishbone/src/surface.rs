//! The deformed surface: fundamental forms, curvatures, ribs, edges and meshes, Eq. (5)–(31).
//!
//! The rib through P(u) is the straight line `x(u) + v (ζ − β η)`; in the flat board it is the line `p(u) + v (n − β t)`,
//! where p is the flat spine with its tangent t and its normal n. Both are known once a [`Rib`] is. The flat spine is
//! made of lines, arcs and corners, and so is the [`Outline`] of the board.

mod board;
mod curvature;
mod curve;
mod extremes;
mod flat;
mod locate;
mod mesh;
mod outline;
mod patch;
mod rib;

pub use curvature::*;
pub use curve::*;
pub use extremes::*;
pub use flat::*;
pub use mesh::*;
pub use outline::*;
pub use rib::*;

#[cfg(test)]
pub(crate) mod samples {
    //! Spines to test on.

    use crate::lie::{Pose, Twist};
    use crate::spine::Spine;
    use nalgebra::Vector3;
    use proptest::prelude::*;

    /// A spine with `n` equal elements and fields given as functions of u.
    pub(crate) fn spine(
        length: f64,
        width: f64,
        n: usize,
        bend: impl Fn(f64) -> f64,
        slope: impl Fn(f64) -> f64,
    ) -> Spine {
        let u: Vec<f64> = (0..=n).map(|i| length * i as f64 / n as f64).collect();
        let bend = u.iter().copied().map(bend).collect();
        let slope = u.iter().copied().map(slope).collect();
        let start = Pose::exp(&Twist {
            translation: Vector3::new(0.1, -0.2, 0.3),
            rotation: Vector3::new(0.5, 0.3, -0.8),
        });
        Spine::straight(width, start, u, bend, slope)
    }

    /// A wave `c0 + c1 cos(k u) + c2 sin(k u)`.
    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Wave(pub(crate) [f64; 3], pub(crate) f64);

    impl Wave {
        pub(crate) fn at(&self, u: f64) -> f64 {
            let (s, c) = (self.1 * u).sin_cos();
            self.0[0] + self.0[1] * c + self.0[2] * s
        }
    }

    /// Fields of smooth belts of length 1 with |β'| below `steepness`, sloping ribs at the ends.
    pub(crate) fn waves(steepness: f64) -> impl Strategy<Value = (Wave, Wave)> {
        let amplitude = -1.0..1.0f64;
        let bend = (
            [amplitude.clone(), amplitude.clone(), amplitude.clone()],
            1.0..6.0f64,
        )
            .prop_map(|(c, k)| Wave(c.map(|x| 4.0 * x), k));
        let slope = (
            [amplitude.clone(), amplitude.clone(), amplitude],
            1.0..6.0f64,
        )
            .prop_map(move |(c, k)| {
                Wave(
                    [c[0], steepness * c[1] / k / 1.5, steepness * c[2] / k / 1.5],
                    k,
                )
            });
        (bend, slope)
    }
}
