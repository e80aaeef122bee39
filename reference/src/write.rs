//! Writer of leaf-set directories: one file of leaf words and the manifest. A reader never sees an
//! incomplete file.
use crate::Mesh;
use crate::case_file::{Case, Enclosed, Keep, Root};
use crate::error::Error;
use crate::leaks::Leak;
use crate::leaves::{Geometry, Tally, hex};
use crate::sides::Components;
use files::{Claim, write_atomically};
use serde::Serialize;
use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Name and version of this program, for manifests.
pub const PROGRAM: &str = concat!("reference ", env!("CARGO_PKG_VERSION"));

const LEAF_FILE: &str = "leaves-00000.npy";
const MANIFEST_FILE: &str = "mesh.json";

/// The tree whose leaves a leaf set contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Which {
    /// The base tree: all leaves with their sides.
    Base,
    /// The final mesh.
    Final,
}

#[derive(Serialize)]
struct Manifest {
    schema: &'static str,
    program: &'static str,
    tree: Which,
    root: Root,
    level_surface: u32,
    layer_cells_min: u32,
    keep: Keep,
    keep_crossing: bool,
    boxes: Vec<ManifestBox>,
    seeds: Vec<[i64; 3]>,
    enclosed: Enclosed,
    geometry: Geometry,
    leaks: Vec<Leak>,
    leaves: u64,
    leaves_by_level: [u64; 20],
    leaves_by_side: BySide,
    components: Components,
    components_ambiguous: AmbiguousCount,
    digest: String,
    octant_digests: Vec<String>,
    parts: [Part; 1],
}

#[derive(Serialize)]
struct ManifestBox {
    min: [i64; 3],
    max: [i64; 3],
    level: u32,
}

#[derive(Serialize)]
struct BySide {
    outside: u64,
    inside: u64,
    crossing: u64,
}

/// The number of ambiguous components and the location of one of them, as written to JSON.
#[derive(Serialize)]
pub struct AmbiguousCount {
    count: u64,
    example: Option<[f64; 3]>,
}

impl AmbiguousCount {
    /// The ambiguous components of a mesh.
    #[must_use]
    pub fn of(mesh: &Mesh) -> Self {
        let ambiguous = mesh.ambiguous.as_ref();
        Self { count: ambiguous.map_or(0, |a| a.components), example: ambiguous.map(|a| a.example) }
    }
}

#[derive(Serialize)]
struct Part {
    file: &'static str,
    leaves: u64,
    digest: String,
}

impl Manifest {
    fn new(which: Which, case: &Case, mesh: &Mesh) -> Self {
        let tally = Tally::of(&mesh.words);
        let leaves = mesh.words.len() as u64;
        let digest = hex(tally.digest);
        let [outside, inside, crossing] = tally.leaves_by_side;
        let boxes = mesh.boxes.iter();
        Self {
            schema: "octree-leaf-set/1",
            program: PROGRAM,
            tree: which,
            root: case.root,
            level_surface: mesh.level_surface,
            layer_cells_min: case.layer_cells_min,
            keep: case.keep,
            keep_crossing: case.keep_crossing,
            boxes: boxes
                .map(|b| ManifestBox { min: b.extent.min, max: b.extent.max, level: b.level })
                .collect(),
            seeds: mesh.seeds.iter().map(|seed| seed.point).collect(),
            enclosed: case.enclosed,
            geometry: mesh.geometry.clone(),
            leaks: mesh.leaks.clone(),
            leaves,
            leaves_by_level: tally.leaves_by_level,
            leaves_by_side: BySide { outside, inside, crossing },
            components: mesh.components.clone(),
            components_ambiguous: AmbiguousCount::of(mesh),
            digest: digest.clone(),
            octant_digests: tally.octant_digests.into_iter().map(hex).collect(),
            parts: [Part { file: LEAF_FILE, leaves, digest }],
        }
    }
}

/// Claims `directory`, which does not exist or is empty, for a leaf set. Creates its parents.
///
/// # Errors
/// The directory is not empty, another run writes to it, or it cannot be created.
pub fn claim(directory: &Path) -> Result<Claim, Error> {
    let write = |source| Error::Write { path: directory.to_owned(), source };
    directory.parent().map_or(Ok(()), fs::create_dir_all).map_err(write)?;
    Claim::create(directory, MANIFEST_FILE, vec![LEAF_FILE.to_owned()]).map_err(|e| {
        match e.kind() {
            io::ErrorKind::DirectoryNotEmpty => {
                Error::OutputTaken { path: directory.to_owned(), source: e }
            }
            _ => write(e),
        }
    })
}

/// Writes a mesh to a claimed directory, the manifest last: a directory with a manifest is complete.
///
/// # Errors
/// A file cannot be written. Then none remains.
pub fn leaf_set(
    claim: Claim,
    directory: &Path,
    which: Which,
    case: &Case,
    mesh: &Mesh,
) -> Result<(), Error> {
    let written = (|| {
        let mut to = BufWriter::new(claim.draft(LEAF_FILE)?);
        npy(&mut to, &mesh.words)?;
        to.into_inner()?.publish()?;
        claim.commit(|to| json_to(to, &Manifest::new(which, case, mesh)))
    })();
    written.map_err(|source| Error::Write { path: directory.to_owned(), source })?;
    claim.keep();
    Ok(())
}

/// Writes `value` to a JSON file.
///
/// # Errors
/// The file cannot be written.
pub fn json(path: &Path, value: &impl Serialize) -> Result<(), Error> {
    write_atomically(path, |to| json_to(to, value))
        .map_err(|source| Error::Write { path: path.to_owned(), source })
}

fn json_to(to: &mut dyn Write, value: &impl Serialize) -> io::Result<()> {
    serde_json::to_writer_pretty(&mut *to, value)?;
    to.write_all(b"\n")
}

/// Writes NumPy's format, version 1.0: a header whose length is a multiple of 64 bytes, then the
/// words.
fn npy(to: &mut dyn Write, words: &[u64]) -> io::Result<()> {
    const MAGIC: &[u8] = b"\x93NUMPY\x01\x00";
    let mut header =
        format!("{{'descr': '<u8', 'fortran_order': False, 'shape': ({},), }}", words.len());
    while !(MAGIC.len() + 2 + header.len() + 1).is_multiple_of(64) {
        header.push(' ');
    }
    header.push('\n');
    to.write_all(MAGIC)?;
    to.write_all(&u16::try_from(header.len()).expect("a short header").to_le_bytes())?;
    to.write_all(header.as_bytes())?;
    words.iter().try_for_each(|word| to.write_all(&word.to_le_bytes()))
}
