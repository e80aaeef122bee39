//! Tests of the checks on meshes of the reference.

mod agreement;
mod kept;
mod many_parts;
mod no_false_alarms;
mod promises;
mod selftest;
mod support;
