//! Programs as processes: engines and oracles, their limits and results, and verification.
//!
//! - [`engine`]: how programs are found, started, watched and read;
//! - [`oracle`]: trimesh, open3d and pyvista, asked by Python;
//! - [`verify`](mod@verify): runs engines on cases and checks the meshes.

pub mod engine;
pub mod oracle;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
pub mod verify;
