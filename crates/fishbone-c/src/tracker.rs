//! Trackers: an equilibrium that is followed while one of its supports moves.

use crate::boundary::{Refusal, call, copy, free, given, numbers, write, write_handle};
use crate::equilibrium::{FishboneEquilibrium, FishboneWrench, checked_support, row_major};
use crate::status::{FishboneOutcome, FishboneStatus, report};
use fishbone::analysis::tracking::{NoTracker, Tracker, Update};
use fishbone::io::stored::{NotStored, Stored};
use nalgebra::Vector3;
use std::mem::MaybeUninit;
use std::ops::ControlFlow;

/// An equilibrium and the support that moves.
pub struct FishboneTracker {
    moving: Tracker,
    /// Number of supports.
    supports: usize,
}

impl From<Tracker> for FishboneTracker {
    fn from(moving: Tracker) -> Self {
        Self {
            supports: moving.supports().len(),
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

/// The outcome of a motion of the support.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FishboneUpdate {
    /// Whether the belt is in equilibrium under the new pose; unless converged, the tracker keeps its last pose.
    pub status: FishboneOutcome,
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

/// Makes a tracker of an equilibrium that has converged to a minimum. The support that is to move is named by its place in
/// the scenario, from 0, and holds a position and a rotation.
#[unsafe(no_mangle)]
pub extern "C" fn fishbone_tracker_new(
    equilibrium: Option<&FishboneEquilibrium>,
    support: usize,
    tracker: Option<&mut MaybeUninit<*mut FishboneTracker>>,
) -> FishboneStatus {
    call(|| {
        let FishboneEquilibrium(equilibrium) = given(equilibrium, "an equilibrium")?;
        let moving = Tracker::new(equilibrium, support)?;
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

/// Moves the support to a position and a rotation vector, three numbers each in world axes, and the belt with it.
///
/// A pose that the belt does not reach is no failure of the call: the status of the update has the outcome, and the tracker
/// keeps its last pose. A pose that no scenario may hold, such as one that is not finite, is refused.
///
/// From the second update on nothing is allocated where the equilibrium is followed on its mesh and the board has neither
/// links nor bends. Beyond: the mesh changes, and with it the number of nodes, where the error of the shape asks for it,
/// unless solver.elements of the scenario fixes the mesh; that of a slender belt is graded anew at every update.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fishbone_tracker_update(
    tracker: Option<&mut FishboneTracker>,
    position: *const f64,
    rotation: *const f64,
    update: Option<&mut MaybeUninit<FishboneUpdate>>,
) -> FishboneStatus {
    call(|| {
        let FishboneTracker { moving, .. } = given(tracker, "a tracker")?;
        // SAFETY: the head of the header has the rule for vectors.
        let [position, rotation] = unsafe { [vector(position)?, vector(rotation)?] };
        let place = given(update, "a place for the update")?;
        let updated = moving.update(&position, &rotation, &mut || ControlFlow::Continue(()))?;
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
        let FishboneTracker { moving, supports } = held(tracker)?;
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

/// A vector of the caller.
///
/// # Safety
///
/// The pointer is null, or that to the first of three numbers.
unsafe fn vector(first: *const f64) -> Result<Vector3<f64>, Refusal> {
    // SAFETY: as is promised.
    let numbers = unsafe { numbers(first, 3) }?;
    Ok(Vector3::from_column_slice(numbers))
}
