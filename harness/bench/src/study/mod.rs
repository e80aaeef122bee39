//! `harness bench FILE`: a study, which is a file of series of runs, and of targets with the runs that they need.
//!
//! [`measure()`] executes every run once and evaluates a row as soon as its runs are complete. A verdict depends on the file
//! and on the lines of a record alone ([`judge`]), so [`judged`] reproduces it from a record at any time.
//!
//! Invariants: a result is appended to the record immediately; a failed run affects only the rows that need it.

pub mod file;
pub mod judge;
pub mod measure;
pub mod package;
mod session;

pub use file::Study;
pub use judge::judged;
pub use session::{NO_MPI, Outcome, SessionOptions, measure};
