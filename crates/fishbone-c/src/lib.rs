//! The C interface of fishbone.
//!
//! The header `include/fishbone.h` is made of the public items of this crate and of their documentation, by a test. Its head
//! has the rules for callers, once for all functions: pointers, threads, errors.
//!
//! Functions convert and call the core; `boundary` is what they share.

#![expect(
    unsafe_code,
    reason = "C finds functions by plain names, and passes numbers and texts by pointers that nobody can check"
)]
#![expect(
    clippy::missing_safety_doc,
    reason = "the rules for pointers are the same for all functions: the head of the header has them"
)]

mod boundary;
pub mod equilibrium;
pub mod scenario;
pub mod status;
pub mod tracker;

#[cfg(test)]
mod tests;
