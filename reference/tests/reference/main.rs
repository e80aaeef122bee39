//! Tests of the reference: properties, comparisons with second implementations, and its command line.
#![allow(missing_docs)]

mod case_file;
mod cli;
mod crossing;
mod enclosed;
mod gaps;
mod octants;
mod properties;
mod rays;
mod refusals;
mod seeds;
mod sides;
mod stl;
mod support;
mod tiny;
mod vectors;
