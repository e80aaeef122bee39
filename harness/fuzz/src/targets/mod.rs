//! The targets.

mod case_file;
mod forest;
mod leaf_set;
mod stl;
mod texts;
mod tree_file;
pub(crate) mod whole_case;

use crate::Target;

/// All targets.
pub const TARGETS: [Target; 15] = [
    Target { name: "stl", run: stl::bytes },
    Target { name: "stl-grammar", run: stl::grammar },
    Target { name: "case", run: case_file::run },
    Target { name: "manifest", run: leaf_set::manifest },
    Target { name: "npy-words", run: leaf_set::words },
    Target { name: "p4est", run: forest::run },
    Target { name: "tree-file", run: tree_file::run },
    Target { name: "engine", run: texts::engine },
    Target { name: "rules", run: texts::rules },
    Target { name: "targets", run: texts::targets },
    Target { name: "catalogue", run: texts::catalogue },
    Target { name: "record", run: texts::record },
    Target { name: "history", run: texts::history },
    Target { name: "reports", run: texts::reports },
    Target { name: "whole-case", run: whole_case::run },
];
