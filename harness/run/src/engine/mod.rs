//! Child processes: finds, starts and monitors programs, classifies how they end, and reads their reports.
//! This module does not interpret meshes.

pub mod description;
pub mod failure;
pub mod interrupt;
pub mod layout;
pub mod paths;
pub mod process;
pub mod report;
pub mod runner;
pub mod service;
mod session;
pub mod templates;
