//! The formats of an export. The name of the file decides.

use std::path::Path;

use crate::foam;
use crate::htg;
use crate::options::Write;
use crate::scripted;
use crate::{p8est, vtu};
use contract::failure::Failure;

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
    Format {
        ending: ".vtu",
        purpose: "cells for ParaView, VisIt and pyvista, in one file",
        write: vtu::write_file,
    },
    Format {
        ending: ".pvtu",
        purpose: "the same in files of some million cells each, which many processes can read",
        write: vtu::write_files,
    },
    Format {
        ending: ".p8est",
        purpose: "a forest for p8est_load of p4est, deal.II, t8code and ForestClaw",
        write: p8est::write,
    },
    Format {
        ending: "/polyMesh",
        purpose: "polyhedra for OpenFOAM, a directory: CASE/constant/polyMesh",
        write: foam::write,
    },
    Format {
        ending: ".cgns",
        purpose: "the same polyhedra with named boundaries in CGNS, for solvers and pre-processors; needs Python with h5py",
        write: scripted::cgns,
    },
    Format {
        ending: ".mfem",
        purpose: "a mesh with hanging nodes for MFEM; needs Python with NumPy",
        write: scripted::mfem,
    },
    Format {
        ending: ".vtkhdf",
        purpose: "the tree, a hyper-tree grid of 0.05 bytes per cell, for ParaView and VTK; other leaves are masked",
        write: htg::write,
    },
];

/// The format of a file with this name.
///
/// # Errors
/// If no format has such names.
pub fn of(path: &Path) -> Result<&'static Format, Failure> {
    let name = path.to_string_lossy();
    // A shell completes the name of a directory with a slash.
    let name = name.trim_end_matches('/');
    // A dot that begins the name is no extension.
    let stem = |format: &Format| name.strip_suffix(format.ending).unwrap_or_default();
    let fits = |format: &&Format| !matches!(stem(format).chars().last(), None | Some('/'));
    FORMATS.iter().find(fits).ok_or_else(|| {
        let endings: Vec<_> = FORMATS.iter().map(|format| format.ending).collect();
        Failure::input(format!(
            "{name}: no format has such a name: choose one that ends in {}",
            endings.join(", ")
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_the_file_decides() {
        assert_eq!(of(Path::new("a/mesh.vtu")).unwrap().ending, ".vtu");
        assert_eq!(of(Path::new("mesh.pvtu")).unwrap().ending, ".pvtu");
        for name in ["constant/polyMesh", "case/constant/polyMesh/"] {
            assert_eq!(of(Path::new(name)).unwrap().ending, "/polyMesh");
        }
        for name in
            ["mesh.png", "mesh", "a.vtu/mesh", "a/.vtu", ".pvtu", "vtu", "mesh.VTU", "polyMesh", ""]
        {
            let error = of(Path::new(name)).unwrap_err().to_string();
            assert!(error.contains(".vtu, .pvtu, .p8est"), "{name}: {error}");
        }
    }
}
