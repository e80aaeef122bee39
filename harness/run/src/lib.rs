//! Runs engines and oracles as processes, and verifies the meshes that engines make.
//!
//! - [`base_tree`]: base trees of a case at any level;
//! - [`engine`]: finds, starts, watches and judges programs, and reads their run reports;
//! - [`import`]: reads meshes in the formats of other programs, VTK's in Python;
//! - [`oracle`]: classifies points with trimesh, open3d and pyvista, in Python;
//! - [`progress`]: a line of progress;
//! - [`verify`](mod@verify): runs engines on cases and checks the meshes.

pub mod base_tree;
pub mod engine;
pub mod import;
pub mod oracle;
pub mod progress;
pub mod proof;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
pub mod verify;

use contract::failure::Failure;
use engine::failure::{self, End};

impl From<failure::Failure> for Failure {
    fn from(failure: failure::Failure) -> Self {
        match failure.end {
            End::Missing(_) => Self::missing(failure),
            End::Interrupted => Self::interrupted(),
            _ => Self::input(failure),
        }
    }
}
