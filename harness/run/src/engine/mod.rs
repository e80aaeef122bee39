//! Child processes: finds, starts and monitors programs, classifies how they end, and reads their reports.
//! This module does not interpret meshes.

mod command;
pub mod description;
pub mod failure;
pub mod interrupt;
pub mod lacks;
pub mod launcher;
pub mod layout;
mod memory;
pub mod options;
mod output;
pub mod p4est;
pub mod paths;
pub mod placeholders;
pub mod process;
pub mod programs;
pub mod python;
mod reap;
pub mod report;
pub mod runner;
pub mod service;
mod session;
pub mod takes;
pub mod templates;
mod written;
