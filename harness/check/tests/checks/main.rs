//! Tests of the checks on meshes of the reference.

mod agreement;
mod kept;
mod no_false_alarms;
mod selftest;
mod support;
