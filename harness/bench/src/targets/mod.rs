//! `harness targets FILE`: compares measurements with a declared table of targets.
//!
//! A file declares meshes, runs of them and rows; [`measure()`] makes the runs that rows need, each once
//! whatever number of rows asks for it, and judges a row as soon as its runs are there. A judgement is a
//! function of the declaration and of lines of a record alone ([`judge`]), so [`judged`] says the same of
//! a record of another day.
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
