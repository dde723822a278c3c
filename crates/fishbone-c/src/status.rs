//! How calls end, how solves and updates end, and the text of an error.

use crate::boundary;
use fishbone::equilibrium::Status;
use std::ffi::c_char;

/// How a call ended.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FishboneStatus {
    /// The call has done what it does.
    FishboneOk = 0,
    /// An argument is a null pointer.
    FishboneNullPointer,
    /// A buffer has less room than is needed.
    FishboneSmallBuffer,
    /// A file cannot be read, or a text is not UTF-8.
    FishboneUnreadable,
    /// A scenario, or a pose of its support, is refused.
    FishboneInvalidScenario,
    /// The scenario has no such support, or its method finds no reactions.
    FishboneNoReaction,
    /// The equilibrium cannot be followed while the support moves.
    FishboneNoTracker,
    /// Bytes are no state of a tracker, or one of another version of fishbone.
    FishboneInvalidState,
    /// A fault of fishbone itself. The handles of the call can be freed; what they hold is not defined.
    FishboneInternal,
}

/// How a solve or an update ended.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FishboneOutcome {
    /// The belt is in equilibrium.
    FishboneConverged = 0,
    /// No shape of the belt can meet the supports.
    FishboneInfeasible,
    /// The search ended without an equilibrium.
    FishboneNotConverged,
}

impl From<Status> for FishboneOutcome {
    fn from(status: Status) -> Self {
        match status {
            Status::Converged => Self::FishboneConverged,
            Status::Infeasible => Self::FishboneInfeasible,
            Status::NotConverged => Self::FishboneNotConverged,
        }
    }
}

/// The outcome of a solve or an update. Unless it has converged its message becomes the thread's last error.
pub(crate) fn report(status: Status, message: &str) -> FishboneOutcome {
    if status != Status::Converged {
        boundary::set_last_error(message);
    }
    status.into()
}

/// One line of UTF-8: why the last call of this thread failed, or why its solve or update did not converge; empty if
/// neither.
///
/// The text is valid up to the next call of this thread. This function is no such call, nor are those that free a handle.
#[unsafe(no_mangle)]
pub extern "C" fn fishbone_last_error() -> *const c_char {
    boundary::last_error()
}
