//! CGNS: polyhedra with named boundaries, which a script makes of a polyMesh.

use crate::foam;
use crate::mesh::Mesh;
use crate::options::{Options, Summary};
use crate::selection::Selection;
use contract::failure::Failure;
use contract::files::{Staging, fill_atomically};
use std::fs::File;
use std::io;
use std::path::Path;

/// Writes the selected leaves of a mesh.
pub fn write(
    mesh: &Mesh,
    selection: &Selection,
    path: &Path,
    options: &Options<'_>,
) -> Result<Summary, Failure> {
    let failed = |error: io::Error| Failure::at(path, error);
    let place = Staging::beside(path).map_err(failed)?;
    let (directory, file) = (place.path().join("polyMesh"), place.path().join("mesh.cgns"));
    let polyhedra = foam::write(mesh, selection, &directory, options)?;
    (options.cgns)(&directory, &file)?;
    let mut made = File::open(&file).map_err(failed)?;
    let copy = |draft: &mut File| io::copy(&mut made, draft).map_err(failed);
    let bytes = fill_atomically(path, failed, copy)?;
    Ok(Summary { files: 1, bytes, ..polyhedra })
}
