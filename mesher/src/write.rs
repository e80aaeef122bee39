//! Writing a mesh: one `.npy` file of leaf words per rank, and the manifest.
//!
//! Nothing half-written ever has its final name: files are written beside it, synced and renamed,
//! the manifest last. After an error nothing is left behind.

use crate::comm::Comm;
use crate::digest::{Digests, hex};
use crate::error::Error;
use crate::lattice::{Keep, Rules};
use crate::octant::LEVEL_MAX;
use crate::sides::Ambiguous;
use crate::stream::Counts;
use npyz::WriterBuilder;
use serde::Serialize;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Name of the manifest.
pub const MANIFEST: &str = "mesh.json";

/// Name of a rank's part.
pub fn part_name(rank: usize) -> String {
    format!("leaves-{rank:05}.npy")
}

/// A directory that a mesh is written to.
#[derive(Debug)]
pub struct OutDir {
    path: PathBuf,
    /// Whether it was made for this mesh, and so is removed after an error.
    made: bool,
}

fn output(path: &Path, e: &dyn std::fmt::Display) -> Error {
    Error::output(format!(
        "{}: {e}: nothing was written there; choose another --out or make room",
        path.display()
    ))
}

impl OutDir {
    /// Makes the directory, or takes an empty one. On one rank.
    pub fn make(path: &Path) -> Result<Self, Error> {
        match std::fs::read_dir(path) {
            Ok(mut entries) => {
                if entries.next().is_some() {
                    return Err(output(path, &"the directory is not empty"));
                }
                // Found out now rather than after the meshing.
                NamedTempFile::new_in(path).map_err(|e| output(path, &e))?;
                Ok(Self { path: path.to_owned(), made: false })
            }
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                std::fs::create_dir(path).map_err(|e| output(path, &e))?;
                Ok(Self { path: path.to_owned(), made: true })
            }
            Err(e) => Err(output(path, &e)),
        }
    }

    /// The same directory as another rank sees it.
    pub fn join(path: &Path) -> Self {
        Self { path: path.to_owned(), made: false }
    }

    /// Starts this rank's part.
    pub fn part(&self, rank: usize) -> Result<Part, Error> {
        let file = NamedTempFile::new_in(&self.path).map_err(|e| output(&self.path, &e))?;
        let (file, temporary) = file.into_parts();
        let mut file = BufWriter::with_capacity(1 << 20, file);
        let begin = header(u64::MAX).and_then(|room| file.write_all(&room));
        begin.map_err(|e| output(&self.path, &e))?;
        let path = self.path.join(part_name(rank));
        Ok(Part { path, file, temporary, digests: Digests::default(), leaves: 0 })
    }

    /// Removes what was written, after an error on any rank.
    pub fn discard(&self, rank: usize) {
        let _ = std::fs::remove_file(self.path.join(part_name(rank)));
        if rank == 0 {
            let _ = std::fs::remove_file(self.path.join(MANIFEST));
        }
        if self.made {
            // The other ranks' parts may still be there; they are the mesher's too.
            for entry in std::fs::read_dir(&self.path).into_iter().flatten().flatten() {
                let name = entry.file_name();
                let name = name.to_string_lossy();
                if name.starts_with("leaves-") || name.starts_with(".tmp") || name == MANIFEST {
                    let _ = std::fs::remove_file(entry.path());
                }
            }
            let _ = std::fs::remove_dir(&self.path);
        }
    }

    /// Writes the manifest. On one rank, after all parts are finished.
    pub fn manifest(&self, manifest: &Manifest) -> Result<(), Error> {
        let write = || -> io::Result<()> {
            let mut file = NamedTempFile::new_in(&self.path)?;
            serde_json::to_writer_pretty(&mut file, manifest)?;
            file.write_all(b"\n")?;
            publish(file.as_file(), || file.path().to_owned(), &self.path.join(MANIFEST))?;
            let _ = file.into_temp_path().keep();
            File::open(&self.path)?.sync_all()
        };
        write().map_err(|e| output(&self.path, &e))
    }
}

/// Syncs a file and gives it its final name, with the permissions of a file made in the ordinary way.
fn publish(file: &File, temporary: impl Fn() -> PathBuf, to: &Path) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))?;
    file.sync_all()?;
    std::fs::rename(temporary(), to)
}

/// A rank's part while it is written.
pub struct Part {
    path: PathBuf,
    file: BufWriter<File>,
    temporary: tempfile::TempPath,
    digests: Digests,
    leaves: u64,
}

/// What a part holds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// Number of leaves.
    pub leaves: u64,
    /// Their digests.
    pub digests: Digests,
}

impl Part {
    /// Appends words.
    pub fn add(&mut self, words: &[u64]) -> Result<(), Error> {
        self.digests.add(words);
        self.leaves += words.len() as u64;
        // As they are in memory: word by word, a library's writer takes longer than the mesh.
        let written = match cfg!(target_endian = "little") {
            true => self.file.write_all(bytemuck::cast_slice(words)),
            false => words.iter().try_for_each(|w| self.file.write_all(&w.to_le_bytes())),
        };
        written.map_err(|e| output(&self.path, &e))
    }

    /// Completes the file and gives it its name.
    pub fn finish(self) -> Result<Written, Error> {
        let Self { path, file, temporary, digests, leaves } = self;
        let close = || -> io::Result<()> {
            let mut file = file.into_inner()?;
            file.seek(SeekFrom::Start(0))?;
            file.write_all(&header(leaves)?)?;
            publish(&file, || temporary.to_path_buf(), &path)?;
            let _ = temporary.keep();
            Ok(())
        };
        close().map_err(|e| output(&path, &e))?;
        Ok(Written { leaves, digests })
    }
}

/// The head of a `.npy` file of `leaves` words, as long for any number of them, so that it can be written
/// again when the number is known: its text is padded with spaces.
fn header(leaves: u64) -> io::Result<Vec<u8>> {
    /// Bytes before the text: magic, version, and the text's length in the last two (format 1.0).
    const BEFORE: usize = 10;
    let of = |leaves: u64| {
        let head = npyz::WriteOptions::<u64>::new().default_dtype().shape(&[leaves]);
        head.writer(Vec::new()).write_header_only()
    };
    let (mut head, length) = (of(leaves)?, of(u64::MAX)?.len());
    let newline = head.pop();
    head.resize(length - 1, b' ');
    head.extend(newline);
    head[BEFORE - 2..BEFORE].copy_from_slice(&((length - BEFORE) as u16).to_le_bytes());
    Ok(head)
}

/// What `mesh.json` says. Lengths of the boxes are in lattice units, of the root in the geometry's.
#[derive(Clone, Debug, Serialize)]
pub struct Manifest {
    schema: &'static str,
    program: String,
    tree: &'static str,
    root: RootEntry,
    level_surface: u32,
    layer_cells_min: u32,
    keep: Keep,
    keep_crossing: bool,
    boxes: Vec<BoxEntry>,
    leaves: u64,
    leaves_by_level: Vec<u64>,
    leaves_by_side: SideEntry,
    components_ambiguous: AmbiguousEntry,
    digest: String,
    octant_digests: Vec<String>,
    parts: Vec<PartEntry>,
}

#[derive(Clone, Debug, Serialize)]
struct RootEntry {
    origin: [f64; 3],
    edge: f64,
}

#[derive(Clone, Debug, Serialize)]
struct BoxEntry {
    min: [i64; 3],
    max: [i64; 3],
    level: u32,
}

#[derive(Clone, Debug, Serialize)]
struct SideEntry {
    outside: u64,
    inside: u64,
    crossing: u64,
}

#[derive(Clone, Debug, Serialize)]
struct AmbiguousEntry {
    count: u64,
    example: Option<[f64; 3]>,
}

#[derive(Clone, Debug, Serialize)]
struct PartEntry {
    file: String,
    leaves: u64,
    digest: String,
}

/// One entry of a part: its leaves and the two halves of its digest.
type PartWords = [u64; 3];

/// The mesh's digests and parts, gathered from all ranks. Collective.
pub fn gather(mine: &Written, comm: &dyn Comm) -> (Digests, Vec<PartWords>) {
    let split = |d: u128| [(d >> 64) as u64, d as u64];
    let whole = split(mine.digests.whole());
    let mut words = vec![mine.leaves, whole[0], whole[1]];
    // A rank's leaves are in few of the octants.
    let octants = (0..).zip(&mine.digests.octants).filter(|(_, d)| **d != 0);
    words.extend(octants.flat_map(|(i, &d)| [i, split(d)[0], split(d)[1]]));
    let mut digests = Digests::default();
    let mut parts = Vec::new();
    for (_, theirs) in comm.all_gather(&words).messages() {
        let (whole, octants) = theirs.split_at(3);
        parts.push([whole[0], whole[1], whole[2]]);
        let octants = octants.chunks_exact(3);
        digests.merge(octants.map(|w| (w[0] as usize, u128::from(w[1]) << 64 | u128::from(w[2]))));
    }
    (digests, parts)
}

impl Manifest {
    /// The manifest of a mesh with these leaves, digests and parts.
    pub fn new(
        rules: &Rules,
        base: bool,
        counts: &Counts,
        ambiguous: Option<Ambiguous>,
        digests: &Digests,
        parts: &[PartWords],
    ) -> Self {
        let side = |s: usize| counts.by_level.iter().map(|l| l[s]).sum();
        let entry = |(i, p): (usize, &PartWords)| PartEntry {
            file: part_name(i),
            leaves: p[0],
            digest: hex(u128::from(p[1]) << 64 | u128::from(p[2])),
        };
        Self {
            schema: "octree-leaf-set/1",
            program: concat!("mesher ", env!("CARGO_PKG_VERSION")).into(),
            tree: if base { "base" } else { "final" },
            root: RootEntry { origin: rules.root.origin, edge: rules.root.edge },
            level_surface: rules.level_surface,
            layer_cells_min: rules.layer_cells_min,
            keep: rules.keep,
            keep_crossing: rules.keep_crossing,
            boxes: rules
                .boxes
                .iter()
                .map(|b| BoxEntry { min: b.min, max: b.max, level: b.level })
                .collect(),
            leaves: counts.total(),
            leaves_by_level: counts.by_level[..=LEVEL_MAX as usize]
                .iter()
                .map(|l| l.iter().sum())
                .collect(),
            leaves_by_side: SideEntry { outside: side(0), inside: side(1), crossing: side(2) },
            components_ambiguous: AmbiguousEntry {
                count: ambiguous.map_or(0, |a| a.count),
                example: ambiguous.map(|a| rules.root.locate(a.example)),
            },
            digest: hex(digests.whole()),
            octant_digests: digests.octants.iter().map(|&d| hex(d)).collect(),
            parts: parts.iter().enumerate().map(entry).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_read_back_whatever_their_length() {
        let root = tempfile::tempdir().unwrap();
        for n in [0usize, 1, 9, 10, 4097, 1_000_000] {
            let out = OutDir::make(&root.path().join(n.to_string())).unwrap();
            let words: Vec<u64> = (0..n as u64).map(|i| i << 7).collect();
            let mut part = out.part(3).unwrap();
            words.chunks(1000).for_each(|c| part.add(c).unwrap());
            assert_eq!(part.finish().unwrap().leaves, n as u64);
            let bytes = std::fs::read(out.path.join(part_name(3))).unwrap();
            let file = npyz::NpyFile::new(&bytes[..]).unwrap();
            assert_eq!(file.shape(), [n as u64]);
            assert_eq!(file.into_vec::<u64>().unwrap(), words);
            assert_eq!((bytes.len() - 8 * n) % 16, 0, "words are aligned");
        }
    }
}
