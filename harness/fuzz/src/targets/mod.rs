//! The targets.

mod cases;
mod meshes;
mod texts;
pub(crate) mod whole_case;

use crate::Target;

/// All targets.
pub const TARGETS: [Target; 15] = [
    Target { name: "stl", run: cases::stl },
    Target { name: "stl-grammar", run: cases::stl_grammar },
    Target { name: "case", run: cases::case },
    Target { name: "manifest", run: meshes::manifest },
    Target { name: "npy-words", run: meshes::words },
    Target { name: "p4est", run: meshes::forest },
    Target { name: "tree-file", run: meshes::tree_file },
    Target { name: "engine", run: texts::engine },
    Target { name: "rules", run: texts::rules },
    Target { name: "targets", run: texts::targets },
    Target { name: "catalogue", run: texts::catalogue },
    Target { name: "record", run: texts::record },
    Target { name: "history", run: texts::history },
    Target { name: "reports", run: texts::reports },
    Target { name: "whole-case", run: whole_case::run },
];
