//! The mesh to be corrupted: dealt to parts, and read by places.
//!
//! Invariants: stretches of equal length, in ascending order of leaves, go to the parts in turn, so that
//! parts interleave and the leaf of any index is found without a search; at least [`PARTS_MIN`] parts;
//! files are never written to after [`Whole::deal`].

use super::Source;
use crate::audit::merge::merge;
use crate::selftest::Specimen;
use contract::case::Case;
use contract::digest::{Digest, mix};
use contract::leafset::{self, LeafDir, LeafSet};
use contract::manifest::{self, Manifest, Part};
use contract::npy::{self, PartFile};
use contract::octant::Octant;
use contract::word;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Parts have about so many leaves: what a trial copies.
const PART_LEAVES: u64 = 1 << 21;
/// The catalogue corrupts the second and third.
const PARTS_MIN: u64 = 4;
/// More would cost the audit more than they save.
const PARTS_MAX: u64 = 64;
/// Most leaves of a window: the catalogue looks at all pairs of some.
const WINDOW_LEAVES: u64 = 20_000;
/// Most leaves of T0 in one.
const WINDOW_BASE_LEAVES: u64 = 1 << 20;

/// A mesh, dealt.
#[derive(Debug)]
pub(super) struct Whole {
    name: String,
    dir: PathBuf,
    set: LeafDir,
    base: Option<LeafDir>,
    leaves: u64,
    stretch: u64,
}

/// The leaves of an octant, all of which one part has.
#[derive(Debug)]
pub(super) struct Window {
    /// That part.
    pub(super) part: usize,
    /// Index of the first of them in it.
    pub(super) from: u64,
    /// The leaves as a mesh by itself, with the manifest of the whole.
    pub(super) specimen: Specimen,
}

fn unreadable(error: leafset::ReadError) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, error.to_string())
}

impl Whole {
    /// Reads a mesh once and deals it to parts below `place`.
    pub(super) fn deal(source: &Source, place: &Path) -> io::Result<Self> {
        let given = leafset::open(&source.mesh).map_err(unreadable)?;
        let base = source.base.as_ref().map(|dir| leafset::open(dir).map_err(unreadable));
        let base = base.transpose()?;
        let leaves: u64 = given.parts.iter().map(PartFile::len).sum();
        let parts = (leaves / PART_LEAVES).clamp(PARTS_MIN, PARTS_MAX);
        // Two stretches each, so that parts interleave.
        let stretch = leaves.div_ceil(2 * parts).max(1);
        let dir = place.join("whole");
        std::fs::create_dir(&dir)?;
        let mut dealer = Dealer::new(&dir, leaves, parts, stretch)?;
        let mut failed = Ok(());
        merge(&given.parts, &mut |_, run| {
            failed = dealer.take(run);
            failed.is_ok()
        })
        .map_err(|(_, error)| error)?;
        failed?;
        let manifest = Manifest { parts: dealer.finish()?, ..given.manifest };
        write_manifest(&dir, &manifest)?;
        let set = leafset::open(&dir).map_err(unreadable)?;
        Ok(Self { name: source.name.clone(), dir, set, base, leaves, stretch })
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

    /// The leaf of this index in ascending order, and its part.
    pub(super) fn leaf(&self, index: u64) -> io::Result<(usize, u64)> {
        let (stretch, within) = (index / self.stretch, index % self.stretch);
        let parts = self.set.parts.len() as u64;
        let (part, turn) = ((stretch % parts) as usize, stretch / parts);
        let mut word = [0];
        self.set.parts[part].read_at(turn * self.stretch + within, &mut word)?;
        Ok((part, word[0]))
    }

    /// The window around a leaf: the largest octant whose leaves are few enough and in one part.
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
        Ok(Some(Window { part, from, specimen: Specimen { case, mesh, base } }))
    }

    fn suits(&self, part: usize, octant: &Octant) -> io::Result<bool> {
        for (i, file) in self.set.parts.iter().enumerate() {
            let (from, until) = range(file, octant)?;
            if until.saturating_sub(from) > if i == part { WINDOW_LEAVES } else { 0 } {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The leaves of T0 in an octant; none where T0 is not known, or one leaf of it holds the octant.
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

    /// What was asked for, as far as a manifest tells.
    fn case(&self) -> Case {
        let m = &self.set.manifest;
        Case {
            name: self.name.clone(),
            facets: Vec::new(),
            facets_lattice: Vec::new(),
            root: m.root,
            level_surface: m.level_surface,
            layer_cells_min: m.layer_cells_min,
            keep: m.keep,
            keep_crossing: m.keep_crossing,
            boxes: m.boxes.clone(),
        }
    }
}

/// Three parts in order, as the catalogue expects several.
fn thirds(words: &[u64]) -> Vec<Vec<u64>> {
    let (a, rest) = words.split_at(words.len() / 3);
    let (b, c) = rest.split_at(rest.len() / 2);
    [a, b, c].map(<[u64]>::to_vec).to_vec()
}

/// Indices of an octant's leaves in a sorted part.
fn range(file: &PartFile, octant: &Octant) -> io::Result<(u64, u64)> {
    let key = word::key_of(octant.corner);
    let end = key + word::span(octant.level);
    // One past the last octant does not fit a word.
    let until = match end.checked_mul(1 << 7) {
        Some(end) => file.lower_bound(end)?,
        None => file.len(),
    };
    Ok((file.lower_bound(key << 7)?, until))
}

fn read_octant(file: &PartFile, octant: &Octant) -> io::Result<(u64, Vec<u64>)> {
    let (from, until) = range(file, octant)?;
    debug_assert!(from <= until, "the part is sorted");
    let mut words = vec![0; usize::try_from(until - from).expect("a window fits memory")];
    file.read_at(from, &mut words)?;
    Ok((from, words))
}

/// Writes a manifest into a directory of the self test's own.
pub(super) fn write_manifest(dir: &Path, manifest: &Manifest) -> io::Result<()> {
    let text = serde_json::to_string(manifest).expect("a manifest is plain data");
    std::fs::write(dir.join(manifest::FILE), text)
}

/// The name of a part.
pub(super) fn part_name(part: usize) -> String {
    format!("leaves-{part:05}.npy")
}

/// Part files being written by turns.
struct Dealer {
    files: Vec<(BufWriter<File>, Part)>,
    stretch: u64,
    taken: u64,
}

impl Dealer {
    fn new(dir: &Path, leaves: u64, parts: u64, stretch: u64) -> io::Result<Self> {
        let open = |part: u64| -> io::Result<(BufWriter<File>, Part)> {
            // Of the stretches part, part + parts, ... all are whole but perhaps the last of the mesh.
            let starts = (part..).step_by(parts as usize).map(|s| s * stretch);
            let leaves: u64 =
                starts.take_while(|&start| start < leaves).map(|s| stretch.min(leaves - s)).sum();
            let file = part_name(part as usize);
            let mut out = BufWriter::new(File::create(dir.join(&file))?);
            out.write_all(&npy::header("<u8", &format!("({leaves},)")))?;
            Ok((out, Part { file, leaves, digest: Digest::default() }))
        };
        let files = (0..parts).map(open).collect::<io::Result<Vec<_>>>()?;
        Ok(Self { files, stretch, taken: 0 })
    }

    fn take(&mut self, mut run: &[u64]) -> io::Result<()> {
        while !run.is_empty() {
            let (stretch, within) = (self.taken / self.stretch, self.taken % self.stretch);
            let room = usize::try_from(self.stretch - within).unwrap_or(usize::MAX);
            let (now, later) = run.split_at(room.min(run.len()));
            let parts = self.files.len() as u64;
            let (out, part) = &mut self.files[(stretch % parts) as usize];
            let mut sum = 0u128;
            for &w in now {
                sum = sum.wrapping_add(mix(w));
                out.write_all(&w.to_le_bytes())?;
            }
            part.digest.merge(Digest(sum));
            (self.taken, run) = (self.taken + now.len() as u64, later);
        }
        Ok(())
    }

    fn finish(self) -> io::Result<Vec<Part>> {
        let close = |(mut out, part): (BufWriter<File>, Part)| out.flush().map(|()| part);
        self.files.into_iter().map(close).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::{leaf_set, words_of};

    /// Finer towards a corner; in two parts that interleave.
    fn dealt(place: &Path) -> (Whole, Vec<u64>) {
        let words = words_of(|o| o.level < 4 || o.level < 6 && o.corner[0] == 0);
        let parts = [0, 1].map(|p| words.iter().copied().skip(p).step_by(2).collect()).to_vec();
        let mesh = place.join("given");
        std::fs::create_dir(&mesh).unwrap();
        leaf_set(parts).write(&mesh).unwrap();
        let source = Source { name: "given".into(), mesh, base: None };
        (Whole::deal(&source, place).unwrap(), words)
    }

    #[test]
    fn dealing_keeps_every_leaf_and_finds_it_by_its_index() {
        let place = tempfile::tempdir().unwrap();
        let (whole, words) = dealt(place.path());
        assert_eq!((whole.leaves(), whole.parts().len()), (words.len() as u64, 4));
        for (i, &word) in words.iter().enumerate() {
            let (part, found) = whole.leaf(i as u64).unwrap();
            assert_eq!((found, part), (word, i / whole.stretch as usize % 4));
        }
        let read = leafset::read(whole.dir()).unwrap();
        assert_eq!(read.words, words);
        assert_eq!(read.manifest, read.with_parts(read.parts.clone()).manifest);
    }

    #[test]
    fn a_window_is_an_octant_of_one_part() {
        let place = tempfile::tempdir().unwrap();
        let (whole, words) = dealt(place.path());
        for index in (0..words.len()).step_by(97) {
            let window = whole.window(index as u64).unwrap().unwrap();
            let leaves = &window.specimen.mesh.words;
            assert!(leaves.contains(&words[index]));
            let at = words.binary_search(&leaves[0]).unwrap();
            assert_eq!(words[at..at + leaves.len()], leaves[..]);
            let mut of_part = vec![0; leaves.len()];
            whole.parts()[window.part].read_at(window.from, &mut of_part).unwrap();
            assert_eq!(of_part, leaves[..]);
            // Nothing beside them is in their octant: they are as many cells as some octant has.
            let cells: u64 = leaves.iter().map(|&w| word::span(word::level(w))).sum();
            assert!((0..=19).any(|level| word::span(level) == cells), "{cells}");
        }
    }
}
