//! Phases 9 and 10: the leaves in order, files, manifest and report.

pub mod htg;
pub mod leaves;
pub mod manifest;
pub mod report;
pub mod stream;
pub(crate) mod warnings;
pub mod write;
