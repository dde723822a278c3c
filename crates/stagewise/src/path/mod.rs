//! Paths of stationary points: minima that are followed while a programme changes, and curves of stationary points, minima or
//! not.

mod continuation;
mod corner;
mod corrector;
mod curve;
mod descent;
mod event;
mod family;
mod follow;
mod modal_load;

pub use continuation::{Continuation, settle};
pub use curve::{Curve, End, Event, Events, Pace, Station, Turn};
pub use family::{Family, by_differences};
pub use follow::{FollowSettings, Followed, Follower, NextStride};
pub use modal_load::over_modal_load;
