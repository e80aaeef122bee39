//! The programs under test and those they are tested against, as child processes: how they are found,
//! started, watched and read. What their results mean is no business of this module.

pub mod description;
pub mod interrupt;
pub mod memory;
pub mod mesher;
pub mod mpi;
pub mod p4est;
pub mod paths;
pub mod process;
pub mod programs;
pub mod runner;
mod session;
