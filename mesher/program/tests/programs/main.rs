//! Tests of the program, each run in a directory of its own.
#![allow(missing_docs)]

#[macro_use]
#[path = "../../../tests/support/mod.rs"]
mod support;

mod bad_input;
mod bad_output;
mod balance;
mod command_line;
mod interrupts;
mod leaf_set;
mod memory;
#[path = "../support/process.rs"]
mod process;
mod regions;
