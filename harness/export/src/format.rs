//! The formats of an export. The name of the file decides. Scripts make CGNS of a polyMesh, and MFEM's format of a forest of p4est.

use std::fs::File;
use std::io;
use std::path::Path;

use crate::options::{Export, Summary, Write};
use crate::{foam, front, htg, p8est, vtu};
use contract::failure::{Failure, Result};
use contract::files::{Staging, fill_atomically};

/// A format of mesh files.
#[derive(Debug)]
pub struct Format {
    /// How names of its files end.
    pub ending: &'static str,
    /// What it contains and which programs read it, for the user.
    pub purpose: &'static str,
    /// Writes the selected leaves of a mesh.
    pub write: Write,
}

/// All formats.
pub const FORMATS: &[Format] = &[
    Format { ending: ".vtu", purpose: "cells for ParaView, VisIt and pyvista", write: vtu::write },
    Format { ending: ".p8est", purpose: "a forest for p8est_load of p4est", write: p8est::write },
    Format {
        ending: "/polyMesh",
        purpose: "polyhedra for OpenFOAM, a directory: CASE/constant/polyMesh",
        write: foam::write,
    },
    Format {
        ending: ".cgns",
        purpose: "the same polyhedra with named boundaries in CGNS, for solvers and pre-processors; needs Python with h5py",
        write: |export, path| made("cgns", ("polyMesh", foam::write), export, path),
    },
    Format {
        ending: ".mfem",
        purpose: "a mesh with hanging nodes for MFEM; needs Python with NumPy",
        write: |export, path| {
            let mut written = made("mfem", ("mesh.p8est", p8est::write), export, path)?;
            // The others are of the forest that it was made of.
            written.notes.truncate(1);
            Ok(written)
        },
    },
    Format {
        ending: ".vtkhdf",
        purpose: "the tree, a hyper-tree grid of 0.05 bytes per cell, for ParaView and VTK; other leaves are masked",
        write: htg::write,
    },
    Format {
        ending: ".vtp",
        purpose: "the surface towards the body, for a near-body mesher: polygons for VTK",
        write: front::vtp,
    },
    Format { ending: ".stl", purpose: "the same surface as triangles", write: front::stl },
];

/// Writes the selected leaves of a mesh in another format, whose file has this name, and has the script make this format of it.
///
/// # Errors
/// As the other format, and if the script fails.
fn made(kind: &str, (name, write): (&str, Write), export: &Export, path: &Path) -> Result<Summary> {
    let failed = |error: io::Error| Failure::at(path, error);
    let place = Staging::beside(path).map_err(failed)?;
    let (source, file) = (place.path().join(name), place.path().join("made"));
    let of_path = |Failure { code, why }| Failure {
        code,
        why: why.replace(&*source.to_string_lossy(), &path.to_string_lossy()),
    };
    let written = write(export, &source).map_err(of_path)?;
    (export.script)(kind, &source, &file)?;
    let mut made = File::open(&file).map_err(failed)?;
    let copy = |draft: &mut File| io::copy(&mut made, draft).map(|_| ()).map_err(failed);
    Ok(Summary { bytes: fill_atomically(path, copy)?, ..written })
}

/// The format of a file with this name.
///
/// # Errors
/// If no format has such names.
pub fn of(path: &Path) -> Result<&'static Format> {
    let fits = |format: &&Format| match format.ending.strip_prefix('.') {
        Some(extension) => path.extension().is_some_and(|of_path| of_path == extension),
        None => path.ends_with("polyMesh") && path.components().count() > 1,
    };
    FORMATS.iter().find(fits).ok_or_else(|| {
        let endings: Vec<_> = FORMATS.iter().map(|format| format.ending).collect();
        let why = "no format has such a name: choose one that ends in";
        Failure::about(path, format_args!("{why} {}", endings.join(", ")))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{in_root, on_disk, whole};
    use contract::lattice::Root;
    use contract::testing::words_of;

    #[test]
    fn an_error_names_the_file_and_not_what_it_is_made_of() {
        let (dir, mesh) = on_disk(&words_of(|o| o.level < 1), 1, |_| 0);
        let full: Write = |_, path| Err(Failure::at(path, io::Error::other("disk full")));
        let path = dir.path().join("a.cgns");
        let error = made("cgns", ("polyMesh", full), &whole(&mesh), &path).unwrap_err();
        assert_eq!(error.why, format!("{}: disk full", path.display()));
    }

    #[test]
    fn cells_that_coordinates_do_not_resolve_are_refused_where_they_are_written() {
        let words = words_of(|o| o.level < 5 && o.corner == [0; 3]);
        for (x, is_resolved) in [(1e11, true), (1e14, false)] {
            let root = Root { origin: [0.0, -x, 0.0], edge: 1.0 };
            let (dir, mesh) = in_root(&words, 1, |_| 0, root);
            for (name, write) in [("a.vtu", vtu::write as Write), ("b/polyMesh", foam::write)] {
                let written = write(&whole(&mesh), &dir.path().join(name));
                assert_eq!(written.is_ok(), is_resolved, "{name} {x}");
                let why = written.map_or_else(|error| error.why, |_| "do not resolve".to_owned());
                assert!(why.contains("do not resolve"), "{why}");
            }
            let forest = p8est::write(&whole(&mesh), &dir.path().join("c.p8est"));
            assert!(forest.is_ok(), "{forest:?}");
        }
    }

    #[test]
    fn the_name_of_the_file_decides() {
        assert_eq!(of(Path::new("a/mesh.vtu")).unwrap().ending, ".vtu");
        for name in ["constant/polyMesh", "case/constant/polyMesh/"] {
            assert_eq!(of(Path::new(name)).unwrap().ending, "/polyMesh");
        }
        for name in
            ["mesh.png", "mesh", "a.vtu/mesh", "a/.vtu", ".vtu", "vtu", "mesh.VTU", "polyMesh", ""]
        {
            let error = of(Path::new(name)).unwrap_err().to_string();
            assert!(error.contains(".vtu, .p8est"), "{name}: {error}");
        }
    }
}
