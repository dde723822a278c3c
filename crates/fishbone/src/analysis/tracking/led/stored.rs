//! A led equilibrium as data: what its follower finds again by itself is left out.

use super::Led;
use crate::equilibrium::model::StripModel;
use crate::geometry::Pose;
use crate::problem::Problem;
use crate::problem::program::{BeltPoint, BeltProgram};
use nalgebra::SVector;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use stagewise::Stationary;

/// The data of a [`Led`], borrowed to be written or owned once read.
#[derive(Serialize, Deserialize)]
struct Stored<B, P, A, S> {
    problem: B,
    program: P,
    at: A,
    support: usize,
    watched: f64,
    sound: S,
    pose: Pose,
    flat: Option<Pose>,
    potential_of_origin: f64,
}

impl<D, const F: usize, const N: usize> Serialize for Led<D, F, N>
where
    D: StripModel<F, N> + Serialize,
{
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let stored = Stored {
            problem: &self.problem,
            program: self.follower.program(),
            at: self.follower.minimum(),
            support: self.support,
            watched: self.watched,
            sound: &self.sound,
            pose: self.pose,
            flat: self.flat,
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
        let stored: Stored<
            Problem,
            BeltProgram<D, F, N>,
            Stationary<BeltPoint<F>>,
            Vec<SVector<f64, F>>,
        > = Deserialize::deserialize(deserializer)?;
        let shape = D::shape(&stored.problem, &stored.program, &stored.at.point);
        let follower = Self::follower(&stored.problem, stored.program, &stored.at);
        Ok(Self {
            shape,
            follower: follower.map_err(R::Error::custom)?,
            is_graded_anew: D::is_graded_anew(&stored.problem),
            problem: stored.problem,
            support: stored.support,
            watched: stored.watched,
            sound: stored.sound,
            pose: stored.pose,
            flat: stored.flat,
            potential_of_origin: stored.potential_of_origin,
        })
    }
}
