//! The mesh to be corrupted, distributed to parts.
//!
//! Invariants: intervals of equal length, in ascending order of leaves, are assigned to the parts in turn, so
//! that parts interleave and the leaf with any index is found without a search; there are at least
//! [`PARTS_MIN`] parts; files do not change after [`DistributedMesh::new`].

#[cfg(test)]
mod tests;

use super::Source;
use crate::audit::merge::merge;
use crate::selftest::SelftestCase;
use contract::case::Case;
use contract::digest::{Digest, mix};
use contract::leafset::{self, LeafDir, LeafSet};
use contract::manifest::{Manifest, Part, part_name};
use contract::npy::{self, PartFile};
use contract::octant::Octant;
use contract::word;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Approximate number of leaves of a part, which is what a trial copies.
const PART_LEAVES: u64 = 1 << 21;
/// The corruptions change the second and third part.
const PARTS_MIN: u64 = 4;
/// More parts would slow down the audit by more than they save in copying.
const PARTS_MAX: u64 = 64;
/// Maximum number of leaves of a window. Some corruptions compare all pairs of them.
const WINDOW_LEAVES: u64 = 20_000;
/// Maximum number of leaves of T0 in a window, per part of T0.
const WINDOW_BASE_LEAVES: u64 = 1 << 20;

/// A mesh, distributed to parts.
#[derive(Debug)]
pub(super) struct DistributedMesh {
    name: String,
    dir: PathBuf,
    set: LeafDir,
    base: Option<LeafDir>,
    leaves: u64,
    /// Leaves of an interval.
    interval: u64,
}

/// All leaves of an octant, which are in one part.
#[derive(Debug)]
pub(super) struct Window {
    /// Index of the part.
    pub(super) part: usize,
    /// Index of the first leaf in the part.
    pub(super) from: u64,
    /// The leaves as a separate mesh, with the manifest of the original.
    pub(super) correct: SelftestCase,
}

fn unreadable(error: leafset::ReadError) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, error.to_string())
}

impl DistributedMesh {
    /// Reads a mesh once and distributes it to parts in a new subdirectory of `place`.
    ///
    /// # Errors
    /// If the mesh cannot be read, or a part cannot be written.
    pub(super) fn new(source: &Source, place: &Path) -> io::Result<Self> {
        let given = leafset::open(&source.mesh).map_err(unreadable)?;
        let base = source.base.as_ref().map(|dir| leafset::open(dir).map_err(unreadable));
        let base = base.transpose()?;
        let leaves: u64 = given.parts.iter().map(PartFile::len).sum();
        let parts = (leaves / PART_LEAVES).clamp(PARTS_MIN, PARTS_MAX);
        // Two intervals per part, so that parts interleave.
        let interval = leaves.div_ceil(2 * parts).max(1);
        let dir = place.join("original");
        std::fs::create_dir(&dir)?;
        let mut writer = PartWriter::new(&dir, leaves, parts, interval)?;
        let mut written = Ok(());
        merge(&given.parts, &mut |_, run| {
            written = writer.write(run);
            written.is_ok()
        })
        .map_err(|(_, error)| error)?;
        written?;
        let parts = writer.finish()?;
        let manifest = Manifest { parts, hyper_tree_grid: None, ..given.manifest };
        manifest.write(&dir)?;
        let set = leafset::open(&dir).map_err(unreadable)?;
        Ok(Self { name: source.name.clone(), dir, set, base, leaves, interval })
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn dir(&self) -> &Path {
        &self.dir
    }

    pub(super) fn leaves(&self) -> u64 {
        self.leaves
    }

    pub(super) fn manifest(&self) -> &Manifest {
        &self.set.manifest
    }

    pub(super) fn parts(&self) -> &[PartFile] {
        &self.set.parts
    }

    pub(super) fn has_base(&self) -> bool {
        self.base.is_some()
    }

    /// The part of the leaf with this index in ascending order, and the leaf.
    pub(super) fn leaf(&self, index: u64) -> io::Result<(usize, u64)> {
        let (interval, within) = (index / self.interval, index % self.interval);
        let parts = self.set.parts.len() as u64;
        let (part, turn) = ((interval % parts) as usize, interval / parts);
        let mut word = [0];
        self.set.parts[part].read_at(turn * self.interval + within, &mut word)?;
        Ok((part, word[0]))
    }

    /// The window around the leaf with this index: the largest octant whose leaves are few enough and all in
    /// one part. `None` if the word at the index is not a leaf.
    pub(super) fn window(&self, index: u64) -> io::Result<Option<Window>> {
        let (part, leaf) = self.leaf(index)?;
        let Ok(leaf) = word::decode(leaf) else { return Ok(None) };
        let mut octant = leaf.octant;
        while octant.level > 0 {
            let parent = octant.ancestor(octant.level - 1);
            if !self.suits(part, &parent)? {
                break;
            }
            octant = parent;
        }
        let (from, words) = read_octant(&self.set.parts[part], &octant)?;
        let base = self.base_within(&octant)?;
        let case = self.case();
        let mesh = LeafSet { parts: thirds(&words), words, manifest: self.set.manifest.clone() };
        let of_base = self.base.as_ref().map_or(&self.set.manifest, |base| &base.manifest);
        let base = LeafSet { parts: vec![base.clone()], words: base, manifest: of_base.clone() };
        Ok(Some(Window { part, from, correct: SelftestCase { case, mesh, base } }))
    }

    /// Whether all leaves of an octant are in one part, and few enough for a window.
    fn suits(&self, part: usize, octant: &Octant) -> io::Result<bool> {
        for (i, file) in self.set.parts.iter().enumerate() {
            let (from, until) = range(file, octant)?;
            if until.saturating_sub(from) > if i == part { WINDOW_LEAVES } else { 0 } {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The leaves of T0 in an octant; empty if T0 is unknown, or if one leaf of T0 contains the octant.
    fn base_within(&self, octant: &Octant) -> io::Result<Vec<u64>> {
        let mut words = Vec::new();
        for file in self.base.iter().flat_map(|base| &base.parts) {
            let (from, until) = range(file, octant)?;
            if until.saturating_sub(from) <= WINDOW_BASE_LEAVES {
                words.extend(read_octant(file, octant)?.1);
            }
        }
        words.sort_unstable();
        Ok(words)
    }

    /// The case, as far as the manifest determines it.
    fn case(&self) -> Case {
        let m = &self.set.manifest;
        Case {
            name: self.name.clone(),
            geometry: None,
            facets: Vec::new(),
            facets_lattice: Vec::new(),
            root: m.root,
            level_surface: m.level_surface,
            layer_cells_min: m.layer_cells_min,
            keep: m.keep,
            keep_crossing: m.keep_crossing,
            boxes: m.boxes.clone(),
            seeds: m.seeds.iter().map(|&seed| m.root.to_user(seed)).collect(),
            seeds_lattice: m.seeds.clone(),
            enclosed: m.enclosed,
        }
    }
}

/// The words in three parts, because some corruptions need several.
fn thirds(words: &[u64]) -> Vec<Vec<u64>> {
    let (a, rest) = words.split_at(words.len() / 3);
    let (b, c) = rest.split_at(rest.len() / 2);
    [a, b, c].map(<[u64]>::to_vec).to_vec()
}

/// Range of the indices of an octant's leaves in a sorted part.
fn range(file: &PartFile, octant: &Octant) -> io::Result<(u64, u64)> {
    let key = word::key_of(octant.corner);
    let end = key + word::span(octant.level);
    // One past the last octant does not fit a word.
    let until = match end.checked_mul(1 << 7) {
        Some(end) => file.lower_bound(0..file.len(), end)?,
        None => file.len(),
    };
    Ok((file.lower_bound(0..file.len(), key << 7)?, until))
}

fn read_octant(file: &PartFile, octant: &Octant) -> io::Result<(u64, Vec<u64>)> {
    let (from, until) = range(file, octant)?;
    debug_assert!(from <= until, "the part is sorted");
    let mut words = vec![0; usize::try_from(until - from).expect("a window fits memory")];
    file.read_at(from, &mut words)?;
    Ok((from, words))
}

/// Writes words in ascending order to part files, in intervals by turns.
struct PartWriter {
    files: Vec<(BufWriter<File>, Part)>,
    interval: u64,
    written: u64,
}

impl PartWriter {
    fn new(dir: &Path, leaves: u64, parts: u64, interval: u64) -> io::Result<Self> {
        let open = |part: u64| -> io::Result<(BufWriter<File>, Part)> {
            // The part has the intervals part, part + parts, ... All but the last one of the mesh have full length.
            let starts = (part..).step_by(parts as usize).map(|i| i * interval);
            let leaves: u64 =
                starts.take_while(|&start| start < leaves).map(|s| interval.min(leaves - s)).sum();
            let file = part_name(part as usize);
            let mut out = BufWriter::new(File::create(dir.join(&file))?);
            out.write_all(&npy::header("<u8", &format!("({leaves},)")))?;
            Ok((out, Part { file, leaves, digest: Digest::default() }))
        };
        let files = (0..parts).map(open).collect::<io::Result<Vec<_>>>()?;
        Ok(Self { files, interval, written: 0 })
    }

    fn write(&mut self, mut run: &[u64]) -> io::Result<()> {
        while !run.is_empty() {
            let (interval, within) = (self.written / self.interval, self.written % self.interval);
            let room = usize::try_from(self.interval - within).unwrap_or(usize::MAX);
            let (now, later) = run.split_at(room.min(run.len()));
            let parts = self.files.len() as u64;
            let (out, part) = &mut self.files[(interval % parts) as usize];
            let mut sum = 0u128;
            for &w in now {
                sum = sum.wrapping_add(mix(w));
                out.write_all(&w.to_le_bytes())?;
            }
            part.digest.merge(Digest(sum));
            (self.written, run) = (self.written + now.len() as u64, later);
        }
        Ok(())
    }

    fn finish(self) -> io::Result<Vec<Part>> {
        let close = |(mut out, part): (BufWriter<File>, Part)| out.flush().map(|()| part);
        self.files.into_iter().map(close).collect()
    }
}
