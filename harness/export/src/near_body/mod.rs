//! The surface that an off-body mesh hands over to a near-body mesher: the faces exposed by deleted crossing leaves.

//!
//! - [`front`]: the faces; [`polygons`]: polygons that fit together; [`gap`]: the distance of each face from the wall;
//! - [`report`]: statistics; [`files`]: STL and VTK.
//!
//! All of it is held in memory: about 100 bytes per face, and 100 more while a file is written.

pub mod files;
pub mod front;
pub mod gap;
pub mod polygons;
pub mod report;

use contract::case::Case;

use crate::error::ExportError;
use crate::mesh::Mesh;

/// Whether a mesh can be one of a case, by its root and its surface level.
///
/// # Errors
/// If it cannot.
pub fn of_case(mesh: &Mesh, case: &Case) -> Result<(), ExportError> {
    let stated = |root, level| format!("root {root:?} and surface level {level}");
    let of_mesh = stated(mesh.manifest.root, mesh.manifest.level_surface);
    let of_case = stated(case.root, case.level_surface);
    if of_mesh == of_case {
        return Ok(());
    }
    Err(ExportError::Request(format!(
        "the mesh is not of the case {}: the mesh has {of_mesh}, the case {of_case}; give the case that was meshed",
        case.name
    )))
}
