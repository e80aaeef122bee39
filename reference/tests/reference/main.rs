//! Tests of the reference: properties, comparisons with second implementations, and its command line.
#![allow(missing_docs)]

mod cli;
mod gaps;
mod input;
mod meshes;
mod octants;
mod seeds;
mod sides;
mod support;
mod vectors;
