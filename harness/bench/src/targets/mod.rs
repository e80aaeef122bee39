//! `harness targets FILE`: compares measurements with a declared table of targets.
//!
//! A file declares meshes, their runs and rows. [`measure()`] executes every run that a row needs, each once, and
//! evaluates a row as soon as its runs are complete. A verdict depends on the declaration and on the lines of a record
//! alone ([`judge`]), so [`judged`] reproduces it from a record at any time.
//!
//! Invariants: a row's result is appended to the record immediately; a failed run affects only the rows that need it.

pub mod declare;
pub mod judge;
pub mod measure;
pub mod row;
mod session;

pub use declare::Targets;
pub use judge::judged;
pub use session::{Outcome, Overrides, measure};
