//! Calls as C makes them: what they return, what they refuse, what they allocate.

use crate::boundary::{Refusal, call};
use crate::equilibrium::*;
use crate::scenario::*;
use crate::status::*;
use crate::tracker::*;
use FishboneStatus::*;
use std::ffi::{CStr, CString, c_char};
use std::mem::MaybeUninit;
use std::path::Path;
use std::ptr::null;

/// The failure of a call and its text.
type Failed = (FishboneStatus, String);

/// A belt of 80 elements between clamps.
const BELT: &str = "
    belt = { width = 0.1, rigidity = 1.0, segments = [{ kind = 'straight', length = 1.0 }] }
    supports = [
      { at = 'start', position = [0, 0, 0], rotation = [0, 0, 0] },
      { at = 'end', position = [0, 0.5, 0.1], rotation = [0, 0, 0] },
    ]
    solver = { elements = 80 }";

/// Number of its nodes.
const NODES: usize = 81;

fn last_error() -> String {
    // SAFETY: the text is valid up to the next call.
    let text = unsafe { CStr::from_ptr(fishbone_last_error()) };
    text.to_str().unwrap().to_owned()
}

/// What a call writes to its place, or how it failed.
fn written<T>(
    call: impl FnOnce(Option<&mut MaybeUninit<T>>) -> FishboneStatus,
) -> Result<T, Failed> {
    let mut place = MaybeUninit::uninit();
    match call(Some(&mut place)) {
        // SAFETY: a call that succeeds has written.
        FishboneOk => Ok(unsafe { place.assume_init() }),
        status => Err((status, last_error())),
    }
}

/// The handle that a call makes, or how it failed.
fn made<T>(
    call: impl FnOnce(Option<&mut MaybeUninit<*mut T>>) -> FishboneStatus,
) -> Result<Box<T>, Failed> {
    // SAFETY: handles are pointers of boxes.
    written(call).map(|handle| unsafe { Box::from_raw(handle) })
}

/// The numbers that a call copies into a buffer with room for them and one more.
fn copied<T: Copy + Default + PartialEq + std::fmt::Debug>(
    call: impl Fn(*mut T, usize) -> FishboneStatus,
    needed: usize,
) -> Vec<T> {
    let mut small = vec![T::default(); needed - 1];
    assert_eq!(call(small.as_mut_ptr(), needed - 1), FishboneSmallBuffer);
    assert_eq!(
        last_error(),
        format!(
            "found a buffer for {} numbers, allowed one for {needed} or more",
            needed - 1
        )
    );
    assert_eq!(small, vec![T::default(); needed - 1]);
    assert_eq!(call(std::ptr::null_mut(), needed), FishboneNullPointer);
    let mut numbers = vec![T::default(); needed + 1];
    assert_eq!(call(numbers.as_mut_ptr(), needed + 1), FishboneOk);
    assert_eq!(numbers.pop(), Some(T::default()));
    numbers
}

type Reader = unsafe extern "C" fn(
    *const c_char,
    Option<&mut MaybeUninit<*mut FishboneScenario>>,
) -> FishboneStatus;

fn scenario(read: Reader, text: &str) -> Result<Box<FishboneScenario>, Failed> {
    let text = CString::new(text).unwrap();
    // SAFETY: the text ends with 0.
    made(|place| unsafe { read(text.as_ptr(), place) })
}

fn solved(toml: &str) -> Box<FishboneEquilibrium> {
    let scenario = scenario(fishbone_scenario_from_toml, toml).unwrap();
    made(|place| fishbone_solve(Some(&scenario), place)).unwrap()
}

fn tracker_of(
    equilibrium: Option<&FishboneEquilibrium>,
    moving: &[usize],
) -> Result<Box<FishboneTracker>, Failed> {
    // SAFETY: the numbers are as many.
    made(|place| unsafe { fishbone_tracker_new(equilibrium, moving.as_ptr(), moving.len(), place) })
}

fn tracker() -> Box<FishboneTracker> {
    tracker_of(Some(&solved(BELT)), &[1]).unwrap()
}

fn update(
    tracker: &mut FishboneTracker,
    position: [f64; 3],
    angle: f64,
) -> Result<FishboneUpdate, Failed> {
    limited(tracker, position, angle, None)
}

fn limited(
    tracker: &mut FishboneTracker,
    position: [f64; 3],
    angle: f64,
    limits: Option<&FishboneLimits>,
) -> Result<FishboneUpdate, Failed> {
    let goal = FishboneGoal {
        support: 1,
        position,
        rotation: [0.0, 0.0, angle],
    };
    // SAFETY: it is one goal.
    written(|place| unsafe {
        fishbone_tracker_update(Some(tracker), &raw const goal, 1, limits, place)
    })
}

fn positions(tracker: &FishboneTracker) -> Vec<f64> {
    let read = |buffer, capacity| {
        // SAFETY: the buffer has the capacity.
        unsafe { fishbone_tracker_positions(Some(tracker), buffer, capacity) }
    };
    copied(read, 3 * NODES)
}

fn state(tracker: &FishboneTracker) -> Vec<u8> {
    let save = |buffer, capacity| {
        let mut size = MaybeUninit::uninit();
        // SAFETY: the buffer has the capacity.
        unsafe { fishbone_tracker_save(Some(tracker), buffer, capacity, Some(&mut size)) }
    };
    let mut size = MaybeUninit::uninit();
    // SAFETY: no room is promised.
    let asked =
        unsafe { fishbone_tracker_save(Some(tracker), std::ptr::null_mut(), 0, Some(&mut size)) };
    assert_eq!(asked, FishboneSmallBuffer);
    // SAFETY: the size is written in any case.
    copied(save, unsafe { size.assume_init() })
}

fn restored(state: &[u8]) -> Result<Box<FishboneTracker>, Failed> {
    // SAFETY: the bytes are as many.
    made(|place| unsafe { fishbone_tracker_restore(state.as_ptr(), state.len(), place) })
}

#[test]
fn test_an_equilibrium_is_read_as_the_core_has_it() {
    let equilibrium = solved(BELT);
    let (core, held) = (&equilibrium.0, Some(&*equilibrium));
    assert_eq!(
        written(|place| fishbone_equilibrium_status(held, place)),
        Ok(FishboneOutcome::FishboneConverged)
    );
    assert_eq!(
        written(|place| fishbone_equilibrium_energy(held, place)),
        Ok(core.energy)
    );
    assert_eq!(
        written(|place| fishbone_equilibrium_nodes(held, place)),
        Ok(NODES)
    );
    // SAFETY: buffers have their capacities.
    let read = |function: unsafe extern "C" fn(_, _, _) -> _, width| {
        copied(
            |buffer, capacity| unsafe { function(held, buffer, capacity) },
            width * NODES,
        )
    };
    assert_eq!(read(fishbone_equilibrium_arc_lengths, 1), core.spine.u);
    assert_eq!(read(fishbone_equilibrium_bend, 1), core.spine.bend);
    let positions = read(fishbone_equilibrium_positions, 3);
    let frames = read(fishbone_equilibrium_frames, 9);
    for (node, pose) in core.spine.pose.iter().enumerate() {
        assert_eq!(positions[3 * node..][..3], *pose.position.as_slice());
        let rows = (0..9).map(|k| pose.frame[(k / 3, k % 3)]);
        assert_eq!(frames[9 * node..][..9], *rows.collect::<Vec<_>>());
    }
    let reaction = written(|place| fishbone_equilibrium_reaction(held, 1, place));
    assert_eq!(reaction, Ok(core.reactions[1].wrench.into()));
}

#[test]
fn test_a_tracker_goes_where_a_solve_does() {
    let mut tracker = tracker();
    for step in 1..=20 {
        let followed =
            update(&mut tracker, [0.0, 0.5 + 0.005 * f64::from(step), 0.1], 0.0).unwrap();
        assert_eq!(followed.status, FishboneOutcome::FishboneConverged);
        assert!(!followed.snapped && followed.residual < 1e-8);
        assert_eq!(
            written(|place| fishbone_tracker_energy(Some(&tracker), place)),
            Ok(followed.energy)
        );
    }
    let afresh = solved(&BELT.replace("0.5, 0.1", "0.6, 0.1"));
    let energy = written(|place| fishbone_equilibrium_energy(Some(&afresh), place)).unwrap();
    assert!(
        (written(|place| fishbone_tracker_energy(Some(&tracker), place)).unwrap() / energy - 1.0)
            .abs()
            < 1e-6
    );
    // SAFETY: buffers have their capacities.
    let read = |function: unsafe extern "C" fn(_, _, _) -> _, width| {
        copied(
            |buffer, capacity| unsafe { function(Some(&*tracker), buffer, capacity) },
            width * NODES,
        )
    };
    let same = |function: unsafe extern "C" fn(_, _, _) -> _, width| {
        copied(
            |buffer, capacity| unsafe { function(Some(&*afresh), buffer, capacity) },
            width * NODES,
        )
    };
    let near = |a: &[f64], b: &[f64], off: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() < off);
    assert!(near(
        &read(fishbone_tracker_arc_lengths, 1),
        &same(fishbone_equilibrium_arc_lengths, 1),
        1e-12
    ));
    assert!(near(
        &read(fishbone_tracker_positions, 3),
        &same(fishbone_equilibrium_positions, 3),
        1e-6
    ));
    assert!(near(
        &read(fishbone_tracker_frames, 9),
        &same(fishbone_equilibrium_frames, 9),
        1e-5
    ));
    assert!(near(
        &read(fishbone_tracker_bend, 1),
        &same(fishbone_equilibrium_bend, 1),
        1e-3
    ));
    let [led, found] = [
        written(|place| fishbone_tracker_reaction(Some(&tracker), 1, place)).unwrap(),
        written(|place| fishbone_equilibrium_reaction(Some(&afresh), 1, place)).unwrap(),
    ];
    assert!(near(&led.force, &found.force, 1e-3) && near(&led.moment, &found.moment, 1e-3));
}

#[test]
fn test_null_pointers_are_refused() {
    let (equilibrium, mut tracker) = (solved(BELT), tracker());
    let toml = c"belt = 1".as_ptr();
    let mut outcome = MaybeUninit::uninit();
    // SAFETY: null pointers, which are refused, and vectors of three numbers.
    let refused = unsafe {
        let goal = FishboneGoal {
            support: 1,
            position: [0.0, 0.5, 0.1],
            rotation: [0.0; 3],
        };
        let (end, goal) = (&raw const goal.support, &raw const goal);
        [
            fishbone_scenario_load(null(), None),
            fishbone_scenario_from_toml(null(), None),
            fishbone_scenario_from_json(null(), None),
            fishbone_solve(None, None),
            fishbone_equilibrium_status(None, None),
            fishbone_equilibrium_status(Some(&equilibrium), None),
            fishbone_equilibrium_energy(None, None),
            fishbone_equilibrium_nodes(None, None),
            fishbone_equilibrium_arc_lengths(None, std::ptr::null_mut(), 0),
            fishbone_equilibrium_positions(None, std::ptr::null_mut(), 0),
            fishbone_equilibrium_frames(None, std::ptr::null_mut(), 0),
            fishbone_equilibrium_bend(None, std::ptr::null_mut(), 0),
            fishbone_equilibrium_reaction(None, 0, None),
            fishbone_equilibrium_reaction(Some(&equilibrium), 0, None),
            fishbone_tracker_new(None, end, 1, None),
            fishbone_tracker_new(Some(&equilibrium), null(), 1, None),
            fishbone_tracker_new(Some(&equilibrium), end, 1, None),
            fishbone_tracker_copy(None, None),
            fishbone_tracker_copy(Some(&tracker), None),
            fishbone_tracker_update(None, goal, 1, None, Some(&mut outcome)),
            fishbone_tracker_update(Some(&mut tracker), null(), 1, None, Some(&mut outcome)),
            fishbone_tracker_update(Some(&mut tracker), goal, 1, None, None),
            fishbone_tracker_energy(None, None),
            fishbone_tracker_nodes(None, None),
            fishbone_tracker_arc_lengths(None, std::ptr::null_mut(), 0),
            fishbone_tracker_positions(None, std::ptr::null_mut(), 0),
            fishbone_tracker_frames(None, std::ptr::null_mut(), 0),
            fishbone_tracker_bend(None, std::ptr::null_mut(), 0),
            fishbone_tracker_reaction(None, 0, None),
            fishbone_tracker_save(None, std::ptr::null_mut(), 0, None),
            fishbone_tracker_save(Some(&tracker), std::ptr::null_mut(), 0, None),
            fishbone_tracker_restore(null(), 8, None),
        ]
    };
    assert_eq!(refused, [FishboneNullPointer; 32]);
    assert!(last_error().starts_with("found a null pointer, allowed "));
    // SAFETY: a text that ends with 0.
    assert_eq!(
        unsafe { fishbone_scenario_from_toml(toml, None) },
        FishboneInvalidScenario
    );
    fishbone_scenario_free(None);
    fishbone_equilibrium_free(None);
    fishbone_tracker_free(None);
}

#[test]
fn test_a_file_that_is_no_scenario_is_refused_by_its_name() {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let example = examples.join("example1.toml");
    assert!(scenario(fishbone_scenario_load, example.to_str().unwrap()).is_ok());
    let refusal = |read, text: &str| scenario(read, text).err().unwrap();
    let (status, message) = refusal(fishbone_scenario_load, "nowhere.toml");
    assert_eq!(status, FishboneUnreadable);
    assert!(
        message.starts_with("nowhere.toml: ") && !message.contains('\n'),
        "{message}"
    );
    let another = refusal(fishbone_scenario_load, "belt.yaml");
    assert_eq!(
        another,
        (
            FishboneUnreadable,
            "belt.yaml: found another suffix, allowed .toml or .json".to_owned()
        )
    );
    let (status, message) = refusal(
        fishbone_scenario_from_toml,
        &BELT.replace("width = 0.1", "width = -0.1"),
    );
    assert_eq!(status, FishboneInvalidScenario);
    assert_eq!(
        message,
        "belt.width: found -0.1, must be a positive finite number"
    );
    let (status, message) = refusal(fishbone_scenario_from_toml, "belt = {\n");
    assert!(
        status == FishboneInvalidScenario
            && message.starts_with("line 1, ")
            && !message.contains('\n')
    );
    assert_eq!(
        refusal(fishbone_scenario_from_json, "[]").0,
        FishboneInvalidScenario
    );
    // SAFETY: a text that ends with 0.
    let latin =
        made(|place| unsafe { fishbone_scenario_from_toml(c"name = '\xe9'".as_ptr(), place) });
    let message = "found a byte at 8 that is not UTF-8, allowed UTF-8".to_owned();
    assert_eq!(latin.err(), Some((FishboneUnreadable, message)));
}

#[test]
fn test_a_belt_that_is_too_short_is_an_outcome_and_cannot_be_followed() {
    let short = solved(&BELT.replace("0.5, 0.1", "1.5, 0.1"));
    assert!(last_error().contains("supports"), "{}", last_error());
    let outcome = written(|place| fishbone_equilibrium_status(Some(&short), place));
    assert_eq!(outcome, Ok(FishboneOutcome::FishboneInfeasible));
    assert_eq!(last_error(), "");
    let refused = tracker_of(Some(&short), &[1]).err().unwrap();
    assert_eq!(refused.0, FishboneNoTracker);
    let nowhere = tracker_of(Some(&solved(BELT)), &[7]).err().unwrap();
    assert_eq!(
        nowhere,
        (
            FishboneNoTracker,
            "the scenario has no supports[7] that could move".to_owned()
        )
    );
}

#[test]
fn test_a_pose_that_is_not_reached_leaves_the_tracker_where_it_is() {
    let mut tracker = tracker();
    update(&mut tracker, [0.0, 0.51, 0.1], 0.1).unwrap();
    let before = positions(&tracker);
    let far = update(&mut tracker, [0.0, 1.2, 0.1], 0.1).unwrap();
    assert_eq!(far.status, FishboneOutcome::FishboneInfeasible);
    assert!(!last_error().is_empty());
    assert_eq!(positions(&tracker), before);
    let nan = update(&mut tracker, [f64::NAN, 0.5, 0.1], 0.1).unwrap_err();
    assert_eq!(nan.0, FishboneInvalidScenario);
    assert!(
        nan.1.starts_with("supports[1].position[0]: found nan"),
        "{}",
        nan.1
    );
    assert_eq!(positions(&tracker), before);
}

#[test]
fn test_an_update_that_its_limits_end_goes_on_with_the_next_one() {
    let (mut tracker, mut at_once) = (tracker(), tracker());
    let (position, angle) = ([0.05, 0.6, 0.05], 0.3);
    let whole = update(&mut at_once, position, angle).unwrap();
    let limits = FishboneLimits {
        max_time: 0.0,
        max_iterations: 10,
    };
    let mut fractions = Vec::new();
    while fractions.last() != Some(&1.0) && fractions.len() < 100 {
        let part = limited(&mut tracker, position, angle, Some(&limits)).unwrap();
        fractions.push(part.fraction);
        assert!(part.iterations <= 11);
    }
    assert!((2..100).contains(&fractions.len()), "{fractions:?}");
    let mut energy = MaybeUninit::uninit();
    assert_eq!(
        fishbone_tracker_energy(Some(&tracker), Some(&mut energy)),
        FishboneOk
    );
    // SAFETY: the call has succeeded.
    assert!((unsafe { energy.assume_init() } / whole.energy - 1.0).abs() < 1e-9);
    for max_time in [-1.0, f64::NAN, 1e-12] {
        let none = FishboneLimits {
            max_time,
            max_iterations: 0,
        };
        let stopped = limited(&mut tracker, [0.0, 0.5, 0.1], 0.0, Some(&none)).unwrap();
        assert_eq!(
            (stopped.status, stopped.fraction),
            (FishboneOutcome::FishboneNotConverged, 0.0)
        );
    }
    let long = FishboneLimits {
        max_time: f64::INFINITY,
        max_iterations: 0,
    };
    let back = limited(&mut tracker, [0.0, 0.5, 0.1], 0.0, Some(&long)).unwrap();
    assert_eq!(back.status, FishboneOutcome::FishboneConverged);
}

#[test]
fn test_copies_and_saved_trackers_update_as_the_original() {
    let mut tracker = tracker();
    update(&mut tracker, [0.0, 0.52, 0.1], 0.05).unwrap();
    let mut copy = made(|place| fishbone_tracker_copy(Some(&tracker), place)).unwrap();
    let state = state(&tracker);
    let mut again = restored(&state).unwrap();
    let ahead = |tracker: &mut FishboneTracker| update(tracker, [0.01, 0.53, 0.1], 0.1).unwrap();
    let moved = ahead(&mut tracker);
    assert_eq!([ahead(&mut copy), ahead(&mut again)], [moved; 2]);
    assert_eq!(
        [positions(&copy), positions(&again)],
        [positions(&tracker), positions(&tracker)]
    );
    let mut damaged = state.clone();
    *damaged.last_mut().unwrap() ^= 1;
    for bytes in [&damaged[..], &state[..state.len() - 1], b"fishbone"] {
        let refused = restored(bytes).err().unwrap();
        assert_eq!(
            refused,
            (
                FishboneInvalidState,
                "found bytes that hold no tracker, allowed those of a stored one".to_owned()
            )
        );
    }
}

#[test]
fn test_only_supports_of_the_scenario_have_reactions() {
    let (equilibrium, tracker) = (solved(BELT), tracker());
    let refused = [
        written(|place| fishbone_equilibrium_reaction(Some(&equilibrium), 2, place)),
        written(|place| fishbone_tracker_reaction(Some(&tracker), usize::MAX, place)),
    ];
    for (refused, found) in refused.into_iter().zip([2, usize::MAX]) {
        let message = format!(
            "found support {found}, allowed those before 2: the supports that have a reaction"
        );
        assert_eq!(refused, Err((FishboneNoReaction, message)));
    }
}

#[test]
fn test_a_panic_is_a_status_and_the_next_call_works() {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| ()));
    let panicked = call(|| panic!("a sum\nof {}", 1 + 1));
    std::panic::set_hook(hook);
    assert_eq!(panicked, FishboneInternal);
    assert_eq!(last_error(), "a fault of fishbone itself: a sum of 2");
    assert_eq!(call(|| Ok(())), FishboneOk);
    assert_eq!(last_error(), "");
}

#[test]
fn test_each_thread_has_its_own_last_error() {
    assert_eq!(
        call(|| Err(Refusal::new(FishboneNoTracker, "here"))),
        FishboneNoTracker
    );
    let other = std::thread::spawn(|| {
        let before = last_error();
        call(|| Err(Refusal::new(FishboneNoTracker, "there")));
        (before, last_error())
    });
    assert_eq!(other.join().unwrap(), (String::new(), "there".to_owned()));
    assert_eq!(last_error(), "here");
}

#[test]
fn test_a_handle_goes_to_another_thread() {
    let (equilibrium, mut tracker) = (solved(BELT), tracker());
    let other = std::thread::spawn(move || {
        drop(equilibrium);
        update(&mut tracker, [0.0, 0.51, 0.1], 0.0).map(|update| update.status)
    });
    assert_eq!(
        other.join().unwrap(),
        Ok(FishboneOutcome::FishboneConverged)
    );
}

#[test]
fn test_an_update_and_the_reading_of_its_shape_allocate_nothing() {
    let mut tracker = tracker();
    let mut buffer = [0.0; 9 * NODES];
    update(&mut tracker, [0.0, 0.501, 0.1], 0.001).unwrap();
    let allocated = allocation_counter::measure(|| {
        for step in 2..100 {
            let share = f64::from(step) * 1e-3;
            update(&mut tracker, [0.0, 0.5 + share, 0.1], share).unwrap();
            written(|place| fishbone_tracker_energy(Some(&tracker), place)).unwrap();
            written(|place| fishbone_tracker_nodes(Some(&tracker), place)).unwrap();
            for read in [
                fishbone_tracker_positions,
                fishbone_tracker_frames,
                fishbone_tracker_bend,
            ] {
                // SAFETY: the buffer has the room.
                assert_eq!(
                    unsafe { read(Some(&tracker), buffer.as_mut_ptr(), buffer.len()) },
                    FishboneOk
                );
            }
        }
    });
    assert_eq!(allocated.count_total, 0);
}
