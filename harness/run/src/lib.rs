//! Runs engines and oracles as processes, and verifies the meshes that engines make.
//!
//! - [`engine`]: finds, starts, watches and judges programs, and reads their run reports;
//! - [`import`]: reads meshes in the formats of other programs, most of them in Python;
//! - [`python`]: the scripts in Python, among them the oracles trimesh, open3d and pyvista;
//! - [`verify`](mod@verify): runs engines on cases and checks the meshes.

/// Child processes: finds, starts and monitors programs, classifies how they end, and reads their reports. Nothing here interprets meshes.
pub mod engine {
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
}
pub mod import;
pub mod python;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
pub mod verify;
