//! Checks of oct-tree meshes. This crate shares no algorithm with the programs that it checks, and starts no
//! process.
//!
//! - [`checks`]: one file per property; [`audit`](mod@audit): all of them on a mesh on disk, of any size;
//! - [`diff`](mod@diff): where two meshes differ, and which is right;
//! - [`forest`]: both for forests of p4est with many trees;
//! - [`promises`]: what an engine guarantees, and so what is checked;
//! - [`oracle`]: the sample points of the oracles, and the evaluation of their answers;
//! - [`selftest`]: corrupted meshes that the checks must detect;
//! - [`why`]: the cause of every split, and splits without one.

// For the helpers of the integration tests, which unit tests share.
#[cfg(test)]
extern crate self as check;

pub mod audit;
pub mod checks;
pub mod diff;
pub mod forest;
pub mod oracle;
pub mod promises;
pub mod selftest;
pub mod why;
