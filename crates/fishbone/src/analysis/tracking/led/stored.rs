//! A led equilibrium as data: what its follower finds again by itself is left out.

use super::Led;
use super::way::Way;
use crate::equilibrium::Flat;
use crate::equilibrium::model::StripModel;
use crate::geometry::Pose;
use crate::problem::Problem;
use crate::problem::program::{BeltPoint, BeltProgram};
use nalgebra::SVector;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use stagewise::{NextStride, Stationary};

/// The data of a [`Led`], borrowed to be written or owned once read.
#[derive(Serialize, Deserialize)]
struct Stored<B, P, A, M, O, S, L> {
    problem: B,
    program: P,
    at: A,
    moving: M,
    poses: O,
    next_stride: NextStride,
    since_graded: f64,
    watched: f64,
    sound: S,
    flat: L,
    potential_of_origin: f64,
}

/// The data, owned.
type Owned<D, const F: usize, const N: usize> = Stored<
    Problem,
    BeltProgram<D, F, N>,
    Stationary<BeltPoint<F>>,
    Vec<usize>,
    Vec<Pose>,
    Vec<SVector<f64, F>>,
    Option<Flat>,
>;

impl<D, const F: usize, const N: usize> Serialize for Led<D, F, N>
where
    D: StripModel<F, N> + Serialize,
{
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let stored = Stored {
            problem: &self.problem,
            program: self.follower.program(),
            at: self.follower.minimum(),
            moving: &self.moving,
            poses: &self.poses,
            next_stride: self.follower.next_stride(),
            since_graded: self.since_graded,
            watched: self.watched,
            sound: &self.sound,
            flat: &self.flat,
            potential_of_origin: self.potential_of_origin,
        };
        stored.serialize(serializer)
    }
}

impl<'de, D, const F: usize, const N: usize> Deserialize<'de> for Led<D, F, N>
where
    D: StripModel<F, N> + Deserialize<'de>,
{
    fn deserialize<R: Deserializer<'de>>(deserializer: R) -> Result<Self, R::Error> {
        let stored: Owned<D, F, N> = Deserialize::deserialize(deserializer)?;
        let shape = D::shape(&stored.problem, &stored.program, &stored.at.point);
        let follower = Self::follower(&stored.problem, stored.program, &stored.at);
        let mut follower = follower.map_err(R::Error::custom)?;
        follower.set_next_stride(stored.next_stride);
        Ok(Self {
            shape,
            follower,
            is_graded_anew: D::is_graded_anew(&stored.problem),
            problem: stored.problem,
            moving: stored.moving,
            poses: stored.poses,
            since_graded: stored.since_graded,
            watched: stored.watched,
            sound: stored.sound,
            flat: stored.flat,
            potential_of_origin: stored.potential_of_origin,
            way: Way::default(),
        })
    }
}
