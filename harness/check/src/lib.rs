//! Checks on oct-tree meshes. Nothing here shares an algorithm with the programs it judges, and nothing starts a process.
//!
//! - [`checks`]: a file per promise; [`audit`](mod@audit): those that need no more than the leaves, at any size;
//! - [`diff`](mod@diff): where two meshes differ;
//! - [`geometry`]: diagnosis of a geometry before it is meshed;
//! - [`oracle`]: which points other programs are asked about, and how their answers are counted;
//! - [`selftest`]: corruptions that the checks must catch.

pub mod audit;
pub mod checks;
pub mod diff;
pub mod geometry;
pub mod oracle;
pub mod selftest;
