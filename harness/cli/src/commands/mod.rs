//! The commands, one file each with its arguments; `files`, `meshed`, `paper`, `programs`, `selection` and `values` are shared.

pub mod archive;
pub mod audit;
pub mod bench;
pub mod diff;
pub mod export;
mod files;
pub mod gate;
pub mod geometry;
pub mod import;
pub mod leak;
mod meshed;
mod paper;
pub mod picture;
pub mod planted;
mod programs;
pub mod replay;
pub mod report;
mod selection;
pub mod selftest;
pub mod shrink;
pub mod track;
mod values;
pub mod verify;
pub mod why;
