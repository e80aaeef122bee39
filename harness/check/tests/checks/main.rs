//! The checks on meshes that the reference makes, and the contract that all programs share.

mod agreement;
mod no_false_alarms;
mod selftest;
mod selftest_at_scale;
mod support;
