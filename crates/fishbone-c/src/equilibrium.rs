//! Equilibria: the outcome of a solve.

use crate::boundary::{Refusal, call, copy, free, given, write, write_handle};
use crate::scenario::FishboneScenario;
use crate::status::{FishboneOutcome, FishboneStatus, report};
use fishbone::equilibrium::Equilibrium;
use fishbone::geometry::Wrench;
use fishbone::solve::solve;
use nalgebra::Matrix3;
use std::mem::MaybeUninit;
use std::ops::ControlFlow;

/// The outcome of a solve: a shape of the belt, with its energy and its reactions.
pub struct FishboneEquilibrium(pub(crate) Equilibrium);

/// A force and a moment on the belt about the point of its support, world axes. A component is NaN where the shape does not
/// determine it.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FishboneWrench {
    /// Force.
    pub force: [f64; 3],
    /// Moment.
    pub moment: [f64; 3],
}

impl From<Wrench> for FishboneWrench {
    fn from(wrench: Wrench) -> Self {
        Self {
            force: wrench.force.into(),
            moment: wrench.moment.into(),
        }
    }
}

/// Solves a scenario. A search that finds no equilibrium is no failure of the call: fishbone_equilibrium_status has its
/// outcome.
#[unsafe(no_mangle)]
pub extern "C" fn fishbone_solve(
    scenario: Option<&FishboneScenario>,
    equilibrium: Option<&mut MaybeUninit<*mut FishboneEquilibrium>>,
) -> FishboneStatus {
    call(|| {
        let FishboneScenario(problem) = given(scenario, "a scenario")?;
        let found = solve(problem, &mut || ControlFlow::Continue(()));
        report(found.status, &found.message);
        write_handle(equilibrium, FishboneEquilibrium(found))
    })
}

/// How the solve ended.
#[unsafe(no_mangle)]
pub extern "C" fn fishbone_equilibrium_status(
    equilibrium: Option<&FishboneEquilibrium>,
    status: Option<&mut MaybeUninit<FishboneOutcome>>,
) -> FishboneStatus {
    call(|| write(status, held(equilibrium)?.status.into()))
}

/// Total potential, loads included.
#[unsafe(no_mangle)]
pub extern "C" fn fishbone_equilibrium_energy(
    equilibrium: Option<&FishboneEquilibrium>,
    energy: Option<&mut MaybeUninit<f64>>,
) -> FishboneStatus {
    call(|| write(energy, held(equilibrium)?.energy))
}

/// Number of nodes.
#[unsafe(no_mangle)]
pub extern "C" fn fishbone_equilibrium_nodes(
    equilibrium: Option<&FishboneEquilibrium>,
    nodes: Option<&mut MaybeUninit<usize>>,
) -> FishboneStatus {
    call(|| write(nodes, held(equilibrium)?.spine.u.len()))
}

/// Arc lengths of the nodes, from the start of the belt: a number each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fishbone_equilibrium_arc_lengths(
    equilibrium: Option<&FishboneEquilibrium>,
    buffer: *mut f64,
    capacity: usize,
) -> FishboneStatus {
    call(|| {
        let arc_lengths = &held(equilibrium)?.spine.u;
        // SAFETY: the head of the header has the rule for buffers.
        unsafe { copy(arc_lengths.iter().map(|u| [*u]), buffer, capacity) }
    })
}

/// Positions of the nodes, world axes: three numbers each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fishbone_equilibrium_positions(
    equilibrium: Option<&FishboneEquilibrium>,
    buffer: *mut f64,
    capacity: usize,
) -> FishboneStatus {
    call(|| {
        let poses = held(equilibrium)?.spine.pose.iter();
        // SAFETY: the head of the header has the rule for buffers.
        unsafe { copy(poses.map(|pose| pose.position.into()), buffer, capacity) }
    })
}

/// Frames of the nodes: nine numbers each, a row-major matrix whose columns are the normal, the tangent and the width
/// direction in world axes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fishbone_equilibrium_frames(
    equilibrium: Option<&FishboneEquilibrium>,
    buffer: *mut f64,
    capacity: usize,
) -> FishboneStatus {
    call(|| {
        let poses = held(equilibrium)?.spine.pose.iter();
        // SAFETY: the head of the header has the rule for buffers.
        unsafe { copy(poses.map(|pose| row_major(&pose.frame)), buffer, capacity) }
    })
}

/// Bend at the nodes, in rad per unit of length: a number each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fishbone_equilibrium_bend(
    equilibrium: Option<&FishboneEquilibrium>,
    buffer: *mut f64,
    capacity: usize,
) -> FishboneStatus {
    call(|| {
        let bend = &held(equilibrium)?.spine.bend;
        // SAFETY: the head of the header has the rule for buffers.
        unsafe { copy(bend.iter().map(|bend| [*bend]), buffer, capacity) }
    })
}

/// The reaction of a support on the belt. The support is named by its place in the scenario, from 0.
#[unsafe(no_mangle)]
pub extern "C" fn fishbone_equilibrium_reaction(
    equilibrium: Option<&FishboneEquilibrium>,
    support: usize,
    reaction: Option<&mut MaybeUninit<FishboneWrench>>,
) -> FishboneStatus {
    call(|| {
        let reactions = &held(equilibrium)?.reactions;
        let support = checked_support(support, reactions.len())?;
        write(reaction, reactions[support].wrench.into())
    })
}

/// Frees an equilibrium; a null pointer is left alone.
#[unsafe(no_mangle)]
pub extern "C" fn fishbone_equilibrium_free(equilibrium: Option<Box<FishboneEquilibrium>>) {
    free(equilibrium);
}

fn held(equilibrium: Option<&FishboneEquilibrium>) -> Result<&Equilibrium, Refusal> {
    given(equilibrium, "an equilibrium").map(|FishboneEquilibrium(held)| held)
}

/// The numbers of a frame, row by row.
pub(crate) fn row_major(frame: &Matrix3<f64>) -> [f64; 9] {
    let transposed = frame.transpose();
    std::array::from_fn(|place| transposed[place])
}

/// The place of a support that has a reaction.
pub(crate) fn checked_support(support: usize, reactions: usize) -> Result<usize, Refusal> {
    match support < reactions {
        true => Ok(support),
        false => Err(Refusal::new(
            FishboneStatus::FishboneNoReaction,
            format_args!(
                "found support {support}, allowed those before {reactions}: the supports that have a reaction"
            ),
        )),
    }
}
