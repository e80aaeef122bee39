//! `harness targets FILE`: a table of targets, declared as data, and whether they are met.
//!
//! A file declares meshes, runs of them and rows; [`measure()`] makes the runs that rows need, each once
//! whatever number of rows asks for it, and judges a row as soon as its runs are there. A judgement is a
//! function of the declaration and of lines of a record alone ([`judge`]), so [`judged`] says the same of
//! a record of another day.
//!
//! Invariants: what a row says is appended to the record when it is known; a run that fails costs the
//! rows that need it and nothing else.

pub mod declare;
pub mod judge;
pub mod measure;
pub mod row;
mod session;

pub use declare::Targets;
pub use judge::judged;
pub use session::{Outcome, Overrides, measure};
