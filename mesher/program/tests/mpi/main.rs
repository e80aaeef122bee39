//! Tests of MPI jobs. A program of its own, which `ci/mpich` builds for another MPI.
#![allow(missing_docs)]

#[path = "../support/process.rs"]
mod process;

mod jobs;
