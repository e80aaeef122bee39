//! Mesh output: one `.npy` file of leaf words per rank, the tree in a file for VTK, and the [manifest](crate::output::leaves).
//!
//! Invariants of the output directory:
//! - one run alone writes to it ([`Claim`]);
//! - a file that has its final name is complete: it is written under a temporary name, synchronised and renamed ([`Draft`]);
//! - the manifest is written last, so all files that it names exist;
//! - after an error or an interrupt, none of the mesh's files remains.

use crate::error::{Error, agree};
use files::{Claim, Draft};
use ranks::{Comm, uncounted};
use serde::Serialize;
use std::fmt::Display;
use std::io::{self, BufWriter, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// File name of the manifest.
pub const MANIFEST: &str = "mesh.json";

/// File name of the tree.
pub const TREE: &str = "mesh.vtkhdf";

/// What to write, and where.
#[derive(Clone, Debug)]
pub struct Output {
    /// The directory.
    pub directory: PathBuf,
    /// Whether to write leaf words, a part per rank.
    pub words: bool,
    /// Whether to write the tree.
    pub tree: bool,
}

/// File name of a rank's part.
pub fn part_name(rank: usize) -> String {
    format!("leaves-{rank:05}.npy")
}

/// The names of all files of a rank. They are removed if the run fails.
fn names(rank: usize) -> impl Iterator<Item = String> {
    [part_name(rank)].into_iter().chain((rank == 0).then(|| TREE.to_owned()))
}

/// The directory that a mesh is written to. Its files are removed, unless its claim is kept: on all ranks, after the
/// [manifest](Self::manifest).
pub struct OutDir {
    /// The files that it gets.
    pub output: Output,
    pub(crate) claim: Claim,
}

fn output(path: &Path, e: impl Display) -> Error {
    let advice = "no mesh was written there; choose another --out, free disk space or raise ulimit";
    Error::output(format!("{e}: {advice}")).at(path)
}

impl OutDir {
    /// Claims the directory for this run: one that does not exist, or an empty one. Collective.
    ///
    /// # Errors
    /// If the directory cannot be created or written to, is not empty, or another run has claimed it.
    pub fn claim(files: &Output, comm: &dyn Comm) -> Result<Self, Error> {
        let path = &files.directory;
        let all = || (0..comm.size()).flat_map(names).collect();
        let rank = comm.rank();
        let failed = |e: io::Error| match e.kind() {
            ErrorKind::DirectoryNotEmpty => {
                Error::input(format!("{e}: choose another --out")).at(path)
            }
            // The directory lies on a disk of rank 0's machine alone.
            ErrorKind::NotFound if rank > 0 => {
                let advice = "choose an --out on a disk that all ranks share";
                let why = "does not find the directory that rank 0 has made";
                Error::output(format!("rank {rank} {why}: {advice}")).at(path)
            }
            _ => output(path, e),
        };
        let created = (rank == 0).then(|| Claim::create(path, MANIFEST, all())).transpose();
        let created = agree(comm, created.map_err(failed))?;
        let is_new = u64::from(created.as_ref().is_some_and(|claim| claim.is_new));
        let is_new = uncounted(comm, || comm.sum(is_new));
        // A rank that was killed could not remove its files. If it was the first, the others remove them.
        let mine = [0, rank].into_iter().flat_map(names).collect();
        let join = || Claim::join(path, MANIFEST, mine, is_new == 1).map_err(failed);
        Ok(Self { output: files.clone(), claim: agree(comm, created.map_or_else(join, Ok))? })
    }

    /// Begins a file of the mesh.
    ///
    /// # Errors
    /// If it cannot be created.
    pub fn file(&self, name: &str) -> io::Result<BufWriter<Draft>> {
        Ok(BufWriter::with_capacity(1 << 20, self.claim.draft(name)?))
    }

    /// What to report of a file of the mesh that cannot be written.
    pub fn failed(&self, name: &str) -> impl Fn(io::Error) -> Error {
        let path = self.output.directory.join(name);
        move |e| output(&path, e)
    }

    /// Writes the manifest. On one rank only, after all ranks have finished their parts.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn manifest(&self, manifest: &impl Serialize) -> Result<(), Error> {
        let write = |to: &mut dyn Write| write_json(to, manifest);
        self.claim.commit(write).map_err(|e| output(&self.output.directory, e))
    }
}

/// Writes `value` as JSON with a final newline.
///
/// # Errors
/// If that fails.
pub fn write_json(mut to: &mut dyn Write, value: &impl Serialize) -> io::Result<()> {
    serde_json::to_writer_pretty(&mut to, value)?;
    to.write_all(b"\n")
}

/// A rank's leaf words while they are being written.
pub struct Part(BufWriter<Draft>);

impl Part {
    /// Begins a file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn new(mut file: BufWriter<Draft>) -> io::Result<Self> {
        file.write_all(&header(u64::MAX))?;
        Ok(Self(file))
    }

    /// Appends words.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn add(&mut self, words: &[u64]) -> io::Result<()> {
        // The words' bytes in memory: to write word by word takes longer than meshing.
        const { assert!(cfg!(target_endian = "little"), "words are written as they are in memory") };
        self.0.write_all(bytemuck::cast_slice(words))
    }

    /// Completes the file of `leaves` words and gives it its final name.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(self, leaves: u64) -> io::Result<()> {
        let mut file = self.0.into_inner()?;
        file.seek(SeekFrom::Start(0))?;
        file.write_all(&header(leaves))?;
        file.publish()
    }
}

/// The header of a `.npy` file of `leaves` words, in format 1.0. Padded with spaces to the same length for any number, so that it can be
/// overwritten when the number is known.
fn header(leaves: u64) -> Vec<u8> {
    let text = format!("{{'descr': '<u8', 'fortran_order': False, 'shape': ({leaves}, ), }}");
    // The last two of the bytes before the text are its length.
    [&b"\x93NUMPY\x01\x00\x76\x00"[..], format!("{text:<117}\n").as_bytes()].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::npy::PartFile;
    use ranks::Solo;

    #[test]
    fn parts_of_any_length_are_read_back() {
        let root = tempfile::tempdir().unwrap();
        for n in [0usize, 1, 9, 10, 4097, 1_000_000] {
            let directory = root.path().join(n.to_string());
            let files = Output { directory, words: true, tree: false };
            let out = OutDir::claim(&files, &Solo).unwrap();
            let words: Vec<u64> = (0..n as u64).map(|i| i << 7).collect();
            let mut part = Part::new(out.file(&part_name(3)).unwrap()).unwrap();
            words.chunks(1000).for_each(|c| part.add(c).unwrap());
            part.finish(n as u64).unwrap();
            let bytes = std::fs::read(out.output.directory.join(part_name(3))).unwrap();
            let part = PartFile::open(&out.output.directory.join(part_name(3))).unwrap();
            assert_eq!(part.read_all().unwrap(), words);
            assert_eq!((bytes.len() - 8 * n) % 16, 0, "words are aligned");
        }
    }
}
