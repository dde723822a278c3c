//! The boundary to C: no panic crosses it, null pointers and small buffers are refused.

use crate::status::FishboneStatus;
use fishbone::scenario::error::ScenarioError;
use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CStr, c_char};
use std::fmt::Display;
use std::mem::MaybeUninit;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::slice;

thread_local! {
    /// Text of the last error of the thread with its final 0; empty without an error, so that success allocates nothing.
    static LAST_ERROR: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// The reason why a call fails.
#[derive(Debug)]
pub(crate) struct Refusal {
    status: FishboneStatus,
    message: String,
}

impl Refusal {
    pub(crate) fn new(status: FishboneStatus, message: impl Display) -> Self {
        let message = message.to_string();
        Self { status, message }
    }

    /// The same of a file, which its message names.
    pub(crate) fn of(self, file: &str) -> Self {
        let message = format!("{file}: {}", self.message);
        Self { message, ..self }
    }

    fn null_pointer(allowed: &str) -> Self {
        Self::new(
            FishboneStatus::FishboneNullPointer,
            format_args!("found a null pointer, allowed {allowed}"),
        )
    }

    fn panicked(panic: &(dyn Any + Send)) -> Self {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
        Self::new(
            FishboneStatus::FishboneInternal,
            format_args!("a fault of fishbone itself: {}", text.unwrap_or("a panic")),
        )
    }
}

impl From<ScenarioError> for Refusal {
    fn from(error: ScenarioError) -> Self {
        Self::new(FishboneStatus::FishboneInvalidScenario, error)
    }
}

/// Makes a call from C: its refusal, or its panic, becomes a status and the thread's last error.
pub(crate) fn call(body: impl FnOnce() -> Result<(), Refusal>) -> FishboneStatus {
    set_last_error("");
    // A handle that a panic has left half changed is memory-safe, and the status warns of it.
    let done = catch_unwind(AssertUnwindSafe(body));
    match done.unwrap_or_else(|panic| Err(Refusal::panicked(&*panic))) {
        Ok(()) => FishboneStatus::FishboneOk,
        Err(Refusal { status, message }) => {
            set_last_error(&message);
            status
        }
    }
}

/// Drops what a handle holds.
pub(crate) fn free<T>(handle: Option<Box<T>>) {
    // A drop that panics leaves a leak behind, and C has no use for its status.
    let _ = catch_unwind(AssertUnwindSafe(|| drop(handle)));
}

/// Sets the thread's last error, on one line.
pub(crate) fn set_last_error(text: &str) {
    // A thread that is ending has no such text any more.
    let _ = LAST_ERROR.try_with(|last| {
        let mut last = last.borrow_mut();
        last.clear();
        for word in text.split(|c: char| c.is_whitespace() || c == '\0') {
            if !word.is_empty() {
                last.extend(word.bytes());
                last.push(b' ');
            }
        }
        if let Some(end) = last.last_mut() {
            *end = 0;
        }
    });
}

/// As [`fishbone_last_error`](crate::status::fishbone_last_error).
pub(crate) fn last_error() -> *const c_char {
    let text = LAST_ERROR.try_with(|last| {
        last.borrow()
            .first()
            .map(|first| (&raw const *first).cast())
    });
    text.ok().flatten().unwrap_or(c"".as_ptr())
}

/// A pointer that must not be null, named for people.
pub(crate) fn given<T>(pointer: Option<T>, name: &str) -> Result<T, Refusal> {
    pointer.ok_or_else(|| Refusal::null_pointer(name))
}

/// Writes a result to its place.
pub(crate) fn write<T>(place: Option<&mut MaybeUninit<T>>, result: T) -> Result<(), Refusal> {
    given(place, "a place for the result")?.write(result);
    Ok(())
}

/// Writes a new handle to its place.
pub(crate) fn write_handle<T>(
    place: Option<&mut MaybeUninit<*mut T>>,
    held: T,
) -> Result<(), Refusal> {
    let place = given(place, "a place for the handle")?;
    place.write(Box::into_raw(Box::new(held)));
    Ok(())
}

/// A text of the caller.
///
/// # Safety
///
/// The pointer is null, or leads to a text that ends with 0 and stays as it is as long as the result is used.
pub(crate) unsafe fn text<'a>(text: *const c_char) -> Result<&'a str, Refusal> {
    if text.is_null() {
        return Err(Refusal::null_pointer("a text"));
    }
    // SAFETY: not null, and the rest is promised.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map_err(|error| {
        let found = format_args!(
            "found a byte at {} that is not UTF-8, allowed UTF-8",
            error.valid_up_to()
        );
        Refusal::new(FishboneStatus::FishboneUnreadable, found)
    })
}

/// Numbers of the caller.
///
/// # Safety
///
/// The pointer is null, or that to the first of `count` numbers that stay as they are as long as the result is used.
pub(crate) unsafe fn numbers<'a, T>(first: *const T, count: usize) -> Result<&'a [T], Refusal> {
    if first.is_null() {
        return Err(Refusal::null_pointer("numbers"));
    }
    // SAFETY: not null, and the rest is promised.
    Ok(unsafe { slice::from_raw_parts(first, count) })
}

/// Copies rows of numbers, one a node, into a buffer of the caller.
///
/// # Safety
///
/// The pointer is null, or that to the first of `capacity` numbers that may be written.
pub(crate) unsafe fn copy<T: Copy, const N: usize>(
    rows: impl ExactSizeIterator<Item = [T; N]>,
    buffer: *mut T,
    capacity: usize,
) -> Result<(), Refusal> {
    let needed = N * rows.len();
    if capacity < needed {
        return Err(Refusal::new(
            FishboneStatus::FishboneSmallBuffer,
            format_args!("found a buffer for {capacity} numbers, allowed one for {needed} or more"),
        ));
    }
    if buffer.is_null() {
        return Err(Refusal::null_pointer("a buffer"));
    }
    // SAFETY: not null, and the room that is needed is there, as is promised.
    let buffer = unsafe { slice::from_raw_parts_mut(buffer.cast::<MaybeUninit<T>>(), needed) };
    for (place, number) in buffer.iter_mut().zip(rows.flatten()) {
        place.write(number);
    }
    Ok(())
}
