//! Meshes in the formats of other programs, as leaf sets.
//!
//! - [`words`](mod@words), [`p4est`]: the formats that are read here, as cubes; [`forest`]: the files of p4est as they are. VTK, tables, discretize and OpenFOAM are read in Python,
//!   which the crate `run` starts;
//! - [`cells`]: cubes as leaf words, verified cell by cell, and the root, if the file states none;
//! - [`leaf_set()`]: the mesh with its manifest; [`ImportedTree`]: that of a tree that this repository wrote in VTKHDF, of any size.
//!
//! No reader allocates memory for a count before the file has been seen to be long enough for it.

pub mod cells;
pub mod forest;
mod leaf_set;
pub mod p4est;
pub mod words;

use crate::failure::{Failure, Result};
use crate::lattice::Root;
use crate::manifest;
use crate::word::Side;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

pub use leaf_set::{ImportedTree, leaf_set};

/// Greatest distance of a corner from its place in the oct-tree, and greatest difference of an edge, in edges of the
/// cell. Coordinates in single precision need more than rounding errors of double precision.
pub const TOLERANCE: f64 = 0.01;

/// A format of mesh files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// Leaf words in one .npy file, or in the parts of a directory without a manifest
    LeafWords,
    /// x, y, z and level or edge: a NumPy array, or lines with or without a header
    Table,
    /// VTK: legacy .vtk, .vtu, .pvtu, .htg, and VTKHDF with a hyper-tree grid or unstructured grid
    Vtk,
    /// A forest that p4est wrote with p4est_save or p8est_save
    P4est,
    /// A discretize TreeMesh: UBC text, or JSON
    Discretize,
    /// An OpenFOAM polyMesh, ASCII or binary
    Openfoam,
}

/// The place of a cell that x, y and z give in a table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Position {
    /// The minimum corner, in the units of the geometry
    #[default]
    Corner,
    /// The centre, in the units of the geometry
    Centre,
    /// The number of cells of its own level from the minimum corner of the root
    Index,
}

/// What a reader needs besides the file.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Request {
    /// Name of the cell array that holds the sides.
    pub sides: Option<String>,
    /// The root, if it is not that of the file.
    pub root: Option<Root>,
    /// Whether the root is that of a case. A forest that states another one than the unit cube is then not moved.
    #[serde(skip)]
    pub is_root_of_case: bool,
    /// The meaning of x, y and z in a table.
    pub position: Position,
}

/// The format of a file or directory, from its content.
///
/// # Errors
/// If it cannot be read, or has none of the formats. Parts of a leaf set without a manifest must be requested by their
/// format: a program that writes manifests did not finish such a directory.
pub fn guess(path: &Path) -> Result<Format> {
    let is_directory = fs::metadata(path).map_err(Failure::unreadable)?.is_dir();
    refuse_leaf_set(path)?;
    let unknown = "its format was not recognised: choose one with --format (see --help)";
    let format = if is_directory {
        let why = "has parts and no mesh.json, so the program that wrote them may not have finished: if it writes none, choose \
             --format leaf-words";
        Failure::unless(!path.join(manifest::part_name(0)).is_file(), why)?;
        poly_mesh(path).map(|_| Format::Openfoam)
    } else if let Some("toml" | "stl" | "STL") = path.extension().and_then(|e| e.to_str()) {
        return Err(Failure::input("is a case file or a geometry by its name: give a mesh"));
    } else {
        let mut head = Vec::new();
        let read = ::files::open(path).and_then(|file| file.take(4096).read_to_end(&mut head));
        read.map_err(Failure::unreadable)?;
        // A mesh of discretize may have this name.
        let is_mesh = !path.ends_with(manifest::FILE) || head.windows(8).any(|w| w == b"TreeMesh");
        Failure::unless(is_mesh, "is the manifest of a leaf set: give its directory")?;
        of_content(&head)
    };
    format.ok_or_else(|| Failure::input(unknown))
}

/// Refuses a directory that is a leaf set already.
fn refuse_leaf_set(path: &Path) -> Result<()> {
    let why = "has a manifest mesh.json, so it needs no import: `harness audit` shows whether it is complete";
    Failure::unless(!path.join(manifest::FILE).exists(), why)
}

fn of_content(head: &[u8]) -> Option<Format> {
    let starts = |with: &[u8]| head.starts_with(with);
    if starts(b"\x93NUMPY") {
        let text = String::from_utf8_lossy(head);
        let is_words =
            ["<u8", ">u8"].iter().any(|kind| text.contains(&format!("'descr': '{kind}'")))
                && text.replace(' ', "").contains(",),");
        return Some(if is_words { Format::LeafWords } else { Format::Table });
    }
    // Binary data may follow XML in the same file.
    let is_xml = || head.windows(8).any(|bytes| bytes == b"<VTKFile");
    if starts(b"p4est\0\0\0") || starts(b"p8est\0\0\0") {
        return Some(Format::P4est);
    }
    if starts(b"# vtk DataFile") || starts(b"\x89HDF\r\n\x1a\n") || is_xml() {
        return Some(Format::Vtk);
    }
    let text = match std::str::from_utf8(head) {
        // The head may end within a character.
        Err(cut) if cut.error_len().is_none() => std::str::from_utf8(&head[..cut.valid_up_to()]),
        text => text,
    };
    let text = text.ok()?;
    if text.trim_start().starts_with('{') {
        return Some(Format::Discretize);
    }
    let mut lines = text.lines().map(str::trim);
    let first = lines.find(|line| !line.is_empty() && !line.starts_with(['#', '!']))?;
    let separator = |c: char| c == ',' || c == ';' || c.is_whitespace();
    match first.split(separator).filter(|field| !field.trim_matches('"').is_empty()).count() {
        3 => Some(Format::Discretize),
        n if n > 3 => Some(Format::Table),
        _ => None,
    }
}

/// The directory with an OpenFOAM mesh: the given one, or the one below it in a case or in `constant`.
pub fn poly_mesh(path: &Path) -> Option<PathBuf> {
    let below = ["", "polyMesh", "constant/polyMesh"].map(|place| path.join(place));
    let has_points =
        |place: &PathBuf| ["points", "points.gz"].iter().any(|name| place.join(name).is_file());
    below.into_iter().find(has_points)
}

/// The side with this code in a cell array.
///
/// # Errors
/// If there is none.
pub fn side(code: f64, cell: usize) -> Result<Side> {
    Side::ALL.into_iter().find(|&side| f64::from(side as u8) == code).ok_or_else(|| {
        Failure::input(format!(
            "cell {cell} has the side {code}, and the sides are 0 (outside), 1 (inside) and 2 (crossing)"
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_manifest_and_a_case_file_are_no_meshes() {
        let place = tempfile::tempdir().unwrap();
        for (name, why) in [
            ("a.toml", "case file"),
            ("a.stl", "geometry by its name"),
            (manifest::FILE, "give its directory"),
        ] {
            let path = place.path().join(name);
            fs::write(&path, "{}").unwrap();
            assert!(guess(&path).unwrap_err().to_string().contains(why), "{name}");
        }
        let path = place.path().join(manifest::FILE);
        fs::write(&path, "{\"__module__\": \"discretize.tree_mesh\", \"__class__\": \"TreeMesh\"")
            .unwrap();
        assert_eq!(guess(&path).unwrap(), Format::Discretize);
    }

    #[test]
    fn formats_are_recognised_by_content() {
        let words = crate::npy::header("<u8", "(5,)");
        let rows = crate::npy::header("<f8", "(5, 4)");
        let cases: [(&[u8], Option<Format>); 15] = [
            (b"<VTKFile type=\"UnstructuredGrid\">\n<AppendedData>_\xff\xfe", Some(Format::Vtk)),
            (&words, Some(Format::LeafWords)),
            (&rows, Some(Format::Table)),
            (&crate::npy::header("<u8", "(5, 4)"), Some(Format::Table)),
            (b"# vtk DataFile Version 3.0\n", Some(Format::Vtk)),
            (b"<?xml version=\"1.0\"?>\n<VTKFile type=\"HyperTreeGrid\">", Some(Format::Vtk)),
            (b"\x89HDF\r\n\x1a\n\0\0", Some(Format::Vtk)),
            (b"p8est\0\0\x002.2", Some(Format::P4est)),
            (b"{\"h\": [[1.0", Some(Format::Discretize)),
            (b"! octree\n16 16 16\n0 0 8\n", Some(Format::Discretize)),
            (b"# made by hand\nx,y,z,level\n0,0,0,1\n", Some(Format::Table)),
            (b"0 0 0 1\n", Some(Format::Table)),
            (b"p4est\0\0\0", Some(Format::P4est)),
            (b"", None),
            (b"solid body\n", None),
        ];
        for (content, expected) in cases {
            assert_eq!(of_content(content), expected, "{}", String::from_utf8_lossy(content));
        }
    }

    /// The head of a file may end within a character.
    #[test]
    fn a_character_that_is_cut_off_does_not_hide_the_format() {
        for cut in [&b"\xc3"[..], b"\xe2\x82", b"\xf0\x9f\x98"] {
            assert_eq!(of_content(&[b"0 0 0 1\n", cut].concat()), Some(Format::Table));
            assert_eq!(of_content(&[b"0 0 0 1\n", cut, b" "].concat()), None);
        }
    }

    #[test]
    fn a_path_that_is_no_mesh_is_an_error() {
        let empty = tempfile::tempdir().unwrap();
        assert!(guess(empty.path()).unwrap_err().to_string().contains("--format"));
        assert!(
            guess(&empty.path().join("absent")).unwrap_err().to_string().contains("cannot be read")
        );
        assert!(guess(Path::new("/dev/zero")).unwrap_err().to_string().contains("a device"));
    }
}
