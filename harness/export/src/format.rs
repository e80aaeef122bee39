//! The formats of an export. The name of the file decides.

use std::path::Path;

use crate::foam;
use crate::front;
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
    /// Those of the options `--case`, `--label` and `--regions` that have an effect.
    pub options: &'static [&'static str],
    /// Writes the selected leaves of a mesh.
    pub write: Write,
}

impl Format {
    /// Whether it has the faces towards the body, not cells.
    pub fn is_surface(&self) -> bool {
        [".vtp", ".stl"].contains(&self.ending)
    }
}

/// All formats.
pub const FORMATS: &[Format] = &[
    Format {
        ending: ".vtu",
        purpose: "cells for ParaView, VisIt and pyvista",
        options: &[],
        write: vtu::write,
    },
    Format {
        ending: ".p8est",
        purpose: "a forest for p8est_load of p4est, deal.II, t8code and ForestClaw",
        options: &[],
        write: p8est::write,
    },
    Format {
        ending: "/polyMesh",
        purpose: "polyhedra for OpenFOAM, a directory: CASE/constant/polyMesh",
        options: &["--case", "--label", "--regions"],
        write: foam::write,
    },
    Format {
        ending: ".cgns",
        purpose: "the same polyhedra with named boundaries in CGNS, for solvers and pre-processors; needs Python with h5py",
        options: &["--case", "--regions"],
        write: scripted::cgns,
    },
    Format {
        ending: ".mfem",
        purpose: "a mesh with hanging nodes for MFEM; needs Python with NumPy",
        options: &[],
        write: scripted::mfem,
    },
    Format {
        ending: ".vtkhdf",
        purpose: "the tree, a hyper-tree grid of 0.05 bytes per cell, for ParaView and VTK; other leaves are masked",
        options: &[],
        write: htg::write,
    },
    Format {
        ending: ".vtp",
        purpose: "the surface towards the body, for a near-body mesher: polygons for VTK, with --case the gap to the wall",
        options: &["--case"],
        write: front::vtp,
    },
    Format {
        ending: ".stl",
        purpose: "the same surface as triangles",
        options: &[],
        write: front::stl,
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
