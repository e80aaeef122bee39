//! Statistics of the whole harness, free of any assumption about how noise is distributed.
//!
//! - [`mod@median`]: medians with intervals between order statistics;
//! - [`comparison`]: candidate against baseline by a permutation test, for the gate;
//! - [`mod@change_points`]: changes in a history by E-divisive, for `harness track`;
//! - [`mod@trimmed_mean`]: the location estimate of the comparison;
//! - [`random`]: the generator from which permutations are drawn.
//!
//! No crate offers these tests, and general statistics crates would add dependencies for a sort and a sum.

pub mod change_points;
pub mod comparison;
pub mod median;
pub mod random;
pub mod trimmed_mean;

pub use median::{Median, median, median_of};
pub use trimmed_mean::trimmed_mean;
