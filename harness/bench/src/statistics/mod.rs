//! Statistics of the whole harness, free of any assumption about how noise is distributed.
//!
//! - [`mod@median`]: medians with intervals between order statistics;
//! - [`comparison`]: candidate against baseline by a permutation test, for the gate;
//! - [`mod@change_points`]: steps and drifts in a history, for `harness track`, from a [`model`] of [`segments`] that begin at
//!   [`candidates`], confirmed by [`permutations`];
//! - [`false_discovery`]: the rate of false alarms among many tests;
//! - [`mod@trimmed_mean`]: the location estimate of the comparison;
//! - [`random`]: the generator from which permutations are drawn.
//!
//! No crate offers these tests, and general statistics crates would add dependencies for a sort and a sum.

pub mod candidates;
pub mod change_points;
pub mod comparison;
pub mod false_discovery;
pub mod median;
pub mod model;
pub mod permutations;
pub mod random;
pub mod segments;
pub mod trimmed_mean;

pub use median::{Median, median, median_of};
pub use trimmed_mean::trimmed_mean;
