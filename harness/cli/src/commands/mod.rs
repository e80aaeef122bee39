//! The commands, each with its arguments in a file of its own, and what several of them share.

pub mod audit;
pub mod bench;
pub mod completions;
pub mod diff;
pub mod export;
mod files;
pub mod gate;
pub mod geometry;
pub mod man;
mod programs;
pub mod report;
pub mod selftest;
mod session;
pub mod shrink;
pub mod targets;
pub mod track;
mod values;
pub mod verify;
