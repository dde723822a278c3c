//! What is written: results as JSON.

pub mod result;
