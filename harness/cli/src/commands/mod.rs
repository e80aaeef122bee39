//! The commands, a file for each with its arguments; and what several of them share.

pub mod audit;
pub mod bench;
pub mod diff;
pub mod export;
mod files;
pub mod gate;
pub mod geometry;
mod programs;
pub mod report;
pub mod selftest;
mod session;
pub mod shrink;
pub mod targets;
pub mod track;
mod values;
pub mod verify;
