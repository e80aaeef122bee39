//! Runs engines and oracles as processes, and verifies the meshes that engines make.
//!
//! - [`engine`]: finds, starts, watches and judges programs, and reads their run reports;
//! - [`import`]: reads meshes in the formats of other programs, most of them in Python;
//! - [`progress`]: a line of progress;
//! - [`proof`]: the proven checker;
//! - [`python`]: the scripts in Python, among them the oracles trimesh, open3d and pyvista;
//! - [`verify`](mod@verify): runs engines on cases and checks the meshes.

pub mod engine;
pub mod import;
pub mod progress;
pub mod proof;
pub mod python;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
pub mod verify;
