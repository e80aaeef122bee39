//! Statistics of the whole harness. They know nothing of meshes and files.
//!
//! - [`mod@median`]: medians with intervals that assume no distribution;
//! - [`comparison`]: candidate against baseline by a permutation test, for the gate, and the rate of false alarms among many tests;
//! - [`mod@change_points`]: steps in a history, for `harness track`, from the segments of least cost;
//! - [`sums`]: a quantity as a sum of few terms, for models that predict;
//! - [`random`]: the generator of permutations and samples.
//!
//! No crate offers these tests, and general statistics crates would add dependencies for a sort and a sum.

pub mod change_points;
pub mod comparison;
pub mod median;
pub mod random;
mod segments;
pub mod sums;

pub use median::{Median, median, median_of};
