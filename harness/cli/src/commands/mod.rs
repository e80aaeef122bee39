//! The commands, one file each with its arguments; `files`, `programs`, `selection`, `session` and `values` are shared.

pub mod audit;
pub mod bench;
pub mod completions;
pub mod diff;
pub mod export;
mod files;
pub mod gate;
pub mod geometry;
pub mod import;
pub mod leak;
pub mod man;
pub mod planted;
mod programs;
pub mod report;
mod selection;
pub mod selftest;
mod session;
pub mod shrink;
pub mod targets;
pub mod track;
mod values;
pub mod verify;
pub mod why;
