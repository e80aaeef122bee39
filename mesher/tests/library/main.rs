//! Tests of the library: properties, and comparisons with the reference and with serial meshes.
#![allow(missing_docs)]

#[macro_use]
#[path = "../support/mod.rs"]
mod support;

mod digest_vectors;
mod equals_reference;
mod metamorphic;
mod orders;
mod schedules;
mod stl_files;
#[path = "../support/stl_inputs.rs"]
mod stl_inputs;
