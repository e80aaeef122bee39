//! Formats that a script makes of those that are written here: CGNS of a polyMesh, MFEM's of a forest of p4est.

use crate::foam;
use crate::mesh::Mesh;
use crate::options::{Options, Summary, Write};
use crate::p8est;
use crate::selection::Selection;
use contract::failure::Failure;
use contract::files::{Staging, fill_atomically};
use std::fs::File;
use std::io;
use std::path::Path;

/// Writes the selected leaves of a mesh as polyhedra with named boundaries.
pub fn cgns(
    mesh: &Mesh,
    selection: &Selection,
    path: &Path,
    options: &Options<'_>,
) -> Result<Summary, Failure> {
    made("cgns", ("polyMesh", foam::write), (mesh, selection, path, options))
}

/// Writes a mesh with hanging nodes, in which what is not selected has an attribute of its own.
pub fn mfem(
    mesh: &Mesh,
    selection: &Selection,
    path: &Path,
    options: &Options<'_>,
) -> Result<Summary, Failure> {
    made("mfem", ("mesh.p8est", p8est::write), (mesh, selection, path, options))
}

fn made(
    format: &str,
    (name, write): (&str, Write),
    (mesh, selection, path, options): (&Mesh, &Selection, &Path, &Options<'_>),
) -> Result<Summary, Failure> {
    let failed = |error: io::Error| Failure::at(path, error);
    let place = Staging::beside(path).map_err(failed)?;
    let (source, file) = (place.path().join(name), place.path().join("made"));
    let written = write(mesh, selection, &source, options)?;
    (options.script)(format, &source, &file)?;
    let mut made = File::open(&file).map_err(failed)?;
    let copy = |draft: &mut File| io::copy(&mut made, draft).map_err(failed);
    let bytes = fill_atomically(path, failed, copy)?;
    Ok(Summary { files: 1, bytes, ..written })
}
