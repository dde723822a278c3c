//! Trackers: an equilibrium that is followed while some of its supports move.

use crate::boundary::{Refusal, call, copy, free, given, numbers, write, write_handle};
use crate::equilibrium::{FishboneEquilibrium, FishboneWrench, checked_support, row_major};
use crate::status::{FishboneOutcome, FishboneStatus, report};
use fishbone::analysis::tracking::{Budget, Goal, NoTracker, Tracker, Update};
use fishbone::io::stored::{NotStored, Stored};
use nalgebra::Vector3;
use std::mem::MaybeUninit;
use std::time::Duration;

/// An equilibrium and the supports that move.
pub struct FishboneTracker {
    moving: Tracker,
    /// Room for the goals of an update.
    goals: Vec<Goal>,
    /// Number of supports.
    supports: usize,
}

impl From<Tracker> for FishboneTracker {
    fn from(moving: Tracker) -> Self {
        Self {
            supports: moving.supports().len(),
            goals: Vec::new(),
            moving,
        }
    }
}

impl From<NoTracker> for Refusal {
    fn from(error: NoTracker) -> Self {
        Self::new(FishboneStatus::FishboneNoTracker, error)
    }
}

impl From<NotStored> for Refusal {
    fn from(error: NotStored) -> Self {
        Self::new(FishboneStatus::FishboneInvalidState, error)
    }
}

/// Where a support goes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FishboneGoal {
    /// The support, by its place in the scenario, from 0.
    pub support: usize,
    /// Position, world axes.
    pub position: [f64; 3],
    /// Rotation vector, world axes; that of a support that holds no frame is not read.
    pub rotation: [f64; 3],
}

impl From<&FishboneGoal> for Goal {
    fn from(goal: &FishboneGoal) -> Self {
        Self {
            support: goal.support,
            position: Some(Vector3::from(goal.position)),
            rotation: Some(Vector3::from(goal.rotation)),
        }
    }
}

/// What an update may take; 0 is no limit.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FishboneLimits {
    /// Time, in seconds: the update ends after the iteration in which it has passed.
    pub max_time: f64,
    /// Iterations.
    pub max_iterations: usize,
}

impl From<&FishboneLimits> for Budget {
    fn from(limits: &FishboneLimits) -> Self {
        let time = Some(limits.max_time).filter(|seconds| *seconds != 0.0);
        let iterations = Some(limits.max_iterations).filter(|most| *most != 0);
        // A time that is negative or no number is none at all, and one beyond all measure no limit.
        let time = time.map(|seconds| match seconds > 0.0 {
            true => Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX),
            false => Duration::ZERO,
        });
        Self::new(time, iterations)
    }
}

/// The outcome of a motion of the supports.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FishboneUpdate {
    /// Whether the belt is in equilibrium at its goals; unless converged, the tracker is at a fraction of the way.
    pub status: FishboneOutcome,
    /// Share of the way to the goals that was reached.
    pub fraction: f64,
    /// Whether the belt has no slack, so that its shape does not determine all reactions: these are not a number.
    pub taut: bool,
    /// Whether the equilibrium that was followed ceased to exist or to be stable on the way, or could not be followed, and
    /// the belt has snapped to another one.
    pub snapped: bool,
    /// Whether the belt could not be followed to the pose, so that its problem there was solved afresh.
    pub solved_afresh: bool,
    /// Iterations.
    pub iterations: usize,
    /// Largest displacement of a node in the largest snap; 0 without a snap.
    pub jump: f64,
    /// Energy released in all snaps.
    pub released: f64,
    /// Total potential of the tracker's present shape.
    pub energy: f64,
    /// Largest violation of what supports and links prescribe, lengths in belt lengths and turns in rad.
    pub residual: f64,
}

impl From<Update> for FishboneUpdate {
    fn from(update: Update) -> Self {
        Self {
            status: report(update.status, &update.message),
            fraction: update.fraction,
            taut: update.taut,
            snapped: update.snapped,
            solved_afresh: update.solved_afresh,
            iterations: update.iterations,
            jump: update.jump,
            released: update.released,
            energy: update.energy,
            residual: update.residuals.constraint,
        }
    }
}

/// Makes a tracker of an equilibrium that has converged to a minimum. The supports that are to move are named by their places
/// in the scenario, from 0, and hold a position each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fishbone_tracker_new(
    equilibrium: Option<&FishboneEquilibrium>,
    supports: *const usize,
    count: usize,
    tracker: Option<&mut MaybeUninit<*mut FishboneTracker>>,
) -> FishboneStatus {
    call(|| {
        let FishboneEquilibrium(equilibrium) = given(equilibrium, "an equilibrium")?;
        // SAFETY: the head of the header has the rule for buffers.
        let moving = Tracker::new(equilibrium, unsafe { numbers(supports, count) }?)?;
        write_handle(tracker, FishboneTracker::from(moving))
    })
}

/// Makes another tracker in the same state, which moves by itself.
#[unsafe(no_mangle)]
pub extern "C" fn fishbone_tracker_copy(
    tracker: Option<&FishboneTracker>,
    copy: Option<&mut MaybeUninit<*mut FishboneTracker>>,
) -> FishboneStatus {
    call(|| write_handle(copy, FishboneTracker::from(held(tracker)?.moving.clone())))
}

/// Moves supports to their goals, all together, and the belt with them; those without a goal stay. The limits may be null.
///
/// Goals that the belt does not reach are no failure of the call: the status of the update has the outcome, and the tracker
/// stays at the last equilibrium on the way. A pose that no scenario may hold, such as one that is not finite, is refused.
///
/// From the second update on nothing is allocated where the equilibrium is followed on its mesh and its ribs keep to the
/// edges of the board that bound them. Beyond: the mesh changes, and with it the number of nodes, where the error of the shape asks for it,
/// unless solver.elements of the scenario fixes the mesh; that of a slender belt is graded anew at every update.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fishbone_tracker_update(
    tracker: Option<&mut FishboneTracker>,
    goals: *const FishboneGoal,
    count: usize,
    limits: Option<&FishboneLimits>,
    update: Option<&mut MaybeUninit<FishboneUpdate>>,
) -> FishboneStatus {
    call(|| {
        let FishboneTracker {
            moving,
            goals: room,
            ..
        } = given(tracker, "a tracker")?;
        let place = given(update, "a place for the update")?;
        // SAFETY: the head of the header has the rule for buffers.
        let goals = unsafe { numbers(goals, count) }?;
        room.clear();
        room.extend(goals.iter().map(Goal::from));
        let mut budget = limits.map_or_else(|| Budget::new(None, None), Budget::from);
        let updated = moving.update(room, &mut || budget.proceed())?;
        place.write(updated.into());
        Ok(())
    })
}

/// Total potential of the present shape, loads included.
#[unsafe(no_mangle)]
pub extern "C" fn fishbone_tracker_energy(
    tracker: Option<&FishboneTracker>,
    energy: Option<&mut MaybeUninit<f64>>,
) -> FishboneStatus {
    call(|| write(energy, held(tracker)?.moving.energy()))
}

/// Number of nodes of the present shape.
#[unsafe(no_mangle)]
pub extern "C" fn fishbone_tracker_nodes(
    tracker: Option<&FishboneTracker>,
    nodes: Option<&mut MaybeUninit<usize>>,
) -> FishboneStatus {
    call(|| write(nodes, held(tracker)?.moving.frames().len()))
}

/// Arc lengths of the nodes, as fishbone_equilibrium_arc_lengths. Allocates.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fishbone_tracker_arc_lengths(
    tracker: Option<&FishboneTracker>,
    buffer: *mut f64,
    capacity: usize,
) -> FishboneStatus {
    call(|| {
        let arc_lengths = held(tracker)?.moving.nodes();
        // SAFETY: the head of the header has the rule for buffers.
        unsafe { copy(arc_lengths.into_iter().map(|u| [u]), buffer, capacity) }
    })
}

/// Positions of the nodes, as fishbone_equilibrium_positions. Allocates nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fishbone_tracker_positions(
    tracker: Option<&FishboneTracker>,
    buffer: *mut f64,
    capacity: usize,
) -> FishboneStatus {
    call(|| {
        let positions = held(tracker)?.moving.positions();
        // SAFETY: the head of the header has the rule for buffers.
        unsafe { copy(positions.map(Into::into), buffer, capacity) }
    })
}

/// Frames of the nodes, as fishbone_equilibrium_frames. Allocates nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fishbone_tracker_frames(
    tracker: Option<&FishboneTracker>,
    buffer: *mut f64,
    capacity: usize,
) -> FishboneStatus {
    call(|| {
        let frames = held(tracker)?.moving.frames();
        // SAFETY: the head of the header has the rule for buffers.
        unsafe { copy(frames.map(row_major), buffer, capacity) }
    })
}

/// Bend at the nodes, as fishbone_equilibrium_bend. Allocates nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fishbone_tracker_bend(
    tracker: Option<&FishboneTracker>,
    buffer: *mut f64,
    capacity: usize,
) -> FishboneStatus {
    call(|| {
        let bends = held(tracker)?.moving.bends();
        // SAFETY: the head of the header has the rule for buffers.
        unsafe { copy(bends.map(|bend| [bend]), buffer, capacity) }
    })
}

/// The reaction of a support on the belt, as fishbone_equilibrium_reaction. Allocates.
#[unsafe(no_mangle)]
pub extern "C" fn fishbone_tracker_reaction(
    tracker: Option<&FishboneTracker>,
    support: usize,
    reaction: Option<&mut MaybeUninit<FishboneWrench>>,
) -> FishboneStatus {
    call(|| {
        let FishboneTracker {
            moving, supports, ..
        } = held(tracker)?;
        let support = checked_support(support, *supports)?;
        write(reaction, moving.reaction(support).into())
    })
}

/// Saves the state of a tracker as bytes, for the same version of fishbone; a tracker of them updates as this one, to the
/// bit.
///
/// The number of bytes is written to size, also where the buffer has less room: a buffer of capacity 0, which may be null,
/// asks for it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fishbone_tracker_save(
    tracker: Option<&FishboneTracker>,
    buffer: *mut u8,
    capacity: usize,
    size: Option<&mut MaybeUninit<usize>>,
) -> FishboneStatus {
    call(|| {
        let state = held(tracker)?.moving.to_bytes()?;
        write(size, state.len())?;
        // SAFETY: the head of the header has the rule for buffers.
        unsafe { copy(state.into_iter().map(|byte| [byte]), buffer, capacity) }
    })
}

/// Makes a tracker in a state that was saved.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fishbone_tracker_restore(
    state: *const u8,
    size: usize,
    tracker: Option<&mut MaybeUninit<*mut FishboneTracker>>,
) -> FishboneStatus {
    call(|| {
        // SAFETY: the head of the header has the rule for buffers.
        let state = unsafe { numbers(state, size) }?;
        write_handle(tracker, FishboneTracker::from(Tracker::from_bytes(state)?))
    })
}

/// Frees a tracker; a null pointer is left alone.
#[unsafe(no_mangle)]
pub extern "C" fn fishbone_tracker_free(tracker: Option<Box<FishboneTracker>>) {
    free(tracker);
}

fn held(tracker: Option<&FishboneTracker>) -> Result<&FishboneTracker, Refusal> {
    given(tracker, "a tracker")
}
