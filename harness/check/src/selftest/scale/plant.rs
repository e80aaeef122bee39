//! A corrupted mesh, made from the original with as little copying as possible.

use super::distributed::{DistributedMesh, Window};
use super::global::GlobalChange;
use crate::selftest::Mutation;
use contract::digest::Digest;
use contract::manifest::{Manifest, Tally, part_name};
use contract::npy::{self, PartFile};
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Words per read and write.
const CHUNK: u64 = 1 << 16;

/// A change of the original mesh.
#[derive(Debug)]
pub(super) enum Plan {
    /// Other leaves in the window.
    Leaves {
        /// In the order in which they are written.
        words: Vec<u64>,
        /// Whether the manifest is updated.
        update_manifest: bool,
    },
    /// Another manifest.
    Manifest(Box<Manifest>),
    /// A change of the files.
    Tamper(fn(&Path) -> io::Result<()>),
    /// No change of the mesh, because the corruption changes T0 only.
    Nothing,
}

impl Plan {
    /// The change of the original that corresponds to a corruption of a window.
    pub(super) fn of(window: &Window, mutation: Mutation) -> Self {
        let (before, after) = (&window.correct.mesh, mutation.mesh);
        let names = |m: &Manifest| m.parts.iter().map(|p| p.file.clone()).collect::<Vec<_>>();
        let manifest_changed = after.manifest != before.manifest;
        let leaves_changed = after.words != before.words;
        // `with_words` distributes the leaves of the window to another number of parts.
        let same_parts = after.manifest.parts.len() == before.manifest.parts.len();
        let renamed = names(&after.manifest) != names(&before.manifest);
        let manifest_only = same_parts && (renamed || after.parts == before.parts);
        if manifest_changed && !leaves_changed && manifest_only {
            return Self::Manifest(Box::new(after.manifest));
        }
        let words = if leaves_changed { after.words } else { after.parts.concat() };
        if words != before.words {
            return Self::Leaves { words, update_manifest: manifest_changed };
        }
        match mutation.tamper {
            Some(tamper) => Self::Tamper(tamper),
            None => Self::Nothing,
        }
    }

    /// Writes the corrupted mesh into a new directory `dir`.
    pub(super) fn apply(
        &self,
        original: &DistributedMesh,
        window: &Window,
        dir: &Path,
    ) -> io::Result<()> {
        fs::create_dir(dir)?;
        match self {
            Self::Leaves { words, update_manifest } => {
                link_parts(original, dir, |part| part == window.part)?;
                splice(
                    &original.parts()[window.part],
                    window,
                    words,
                    &dir.join(part_name(window.part)),
                )?;
                match update_manifest {
                    true => updated_manifest(original.manifest(), window, words).write(dir),
                    false => original.manifest().write(dir),
                }
            }
            Self::Manifest(manifest) => {
                // A part file that the manifest does not name would be reported instead.
                let named = |part| manifest.parts.iter().any(|p| p.file == part_name(part));
                link_parts(original, dir, |part| !named(part))?;
                manifest.write(dir)
            }
            Self::Tamper(tamper) => {
                // A file that may be changed must not be a link to a file of the original.
                link_parts(original, dir, |part| part < TAMPERED)?;
                for part in 0..TAMPERED {
                    let name = part_name(part);
                    fs::copy(original.dir().join(&name), dir.join(&name))?;
                }
                original.manifest().write(dir)?;
                tamper(dir)
            }
            Self::Nothing => Ok(()),
        }
    }
}

/// Corruptions of files change some of the first parts only.
const TAMPERED: usize = 3;

/// Links all parts, except those for which `skip` returns true, into a directory.
fn link_parts(
    original: &DistributedMesh,
    dir: &Path,
    skip: impl Fn(usize) -> bool,
) -> io::Result<()> {
    for part in (0..original.parts().len()).filter(|&part| !skip(part)) {
        let name = part_name(part);
        let (from, to) = (original.dir().join(&name), dir.join(&name));
        // Not every file system has hard links.
        fs::hard_link(&from, &to).or_else(|_| fs::copy(&from, &to).map(drop))?;
    }
    Ok(())
}

/// Copies a part with other words in place of the window.
fn splice(file: &PartFile, window: &Window, words: &[u64], to: &Path) -> io::Result<()> {
    let removed = window.correct.mesh.words.len() as u64;
    let leaves = file.len() - removed + words.len() as u64;
    let mut out = BufWriter::new(File::create(to)?);
    out.write_all(&npy::header("<u8", &format!("({leaves},)")))?;
    copy(file, 0, window.from, &mut out)?;
    write_words(words, &mut out)?;
    copy(file, window.from + removed, file.len(), &mut out)?;
    out.flush()
}

fn copy(file: &PartFile, from: u64, until: u64, out: &mut impl Write) -> io::Result<()> {
    let mut next = from;
    while next < until {
        let mut words = vec![0; (until - next).min(CHUNK) as usize];
        file.read_at(next, &mut words)?;
        write_words(&words, out)?;
        next += words.len() as u64;
    }
    Ok(())
}

fn write_words(words: &[u64], out: &mut impl Write) -> io::Result<()> {
    words.iter().try_for_each(|w| out.write_all(&w.to_le_bytes()))
}

/// The manifest of the original, updated to the new leaves of the window: no check shall detect the change by a
/// digest.
fn updated_manifest(original: &Manifest, window: &Window, words: &[u64]) -> Manifest {
    let mut manifest = original.clone();
    let (old, new) = (Tally::of(&window.correct.mesh.words), Tally::of(words));
    // Wrapping, because the counts of the original may be wrong, which is a finding and not an error here.
    let replace = |count: &mut u64, old: u64, new: u64| {
        *count = count.wrapping_sub(old).wrapping_add(new);
    };
    let replace_digest = |sum: &mut Digest, old: Digest, new: Digest| {
        sum.remove(old);
        sum.merge(new);
    };
    let part = &mut manifest.parts[window.part];
    replace_digest(&mut manifest.digest, old.digest, new.digest);
    replace_digest(&mut part.digest, old.digest, new.digest);
    replace(&mut manifest.leaves, old.leaves, new.leaves);
    replace(&mut part.leaves, old.leaves, new.leaves);
    for (i, sum) in manifest.octant_digests.iter_mut().enumerate() {
        replace_digest(sum, old.octants[i], new.octants[i]);
    }
    for (i, count) in manifest.leaves_by_level.iter_mut().enumerate() {
        replace(count, old.by_level[i], new.by_level[i]);
    }
    let (sides, old, new) = (&mut manifest.leaves_by_side, old.by_side, new.by_side);
    replace(&mut sides.outside, old.outside, new.outside);
    replace(&mut sides.inside, old.inside, new.inside);
    replace(&mut sides.crossing, old.crossing, new.crossing);
    manifest
}

/// Writes a mesh into a new directory `dir` in which every part is changed. Returns false, and writes nothing,
/// if the leaves stay the same, for example if a symmetric mesh is mirrored.
pub(super) fn apply_globally(
    original: &DistributedMesh,
    change: &GlobalChange,
    dir: &Path,
) -> io::Result<bool> {
    fs::create_dir(dir)?;
    let mut manifest = original.manifest().clone();
    let mut tally = Tally::default();
    for (i, file) in original.parts().iter().enumerate() {
        let after = change.apply(&file.read_all()?);
        after.iter().for_each(|&w| tally.add(w));
        let part = &mut manifest.parts[i];
        (part.leaves, part.digest) = (after.len() as u64, Digest::of(&after));
        npy::write(&dir.join(part_name(i)), &after)?;
    }
    tally.finish();
    if tally.digest == original.manifest().digest {
        fs::remove_dir_all(dir)?;
        return Ok(false);
    }
    manifest.set_tally(tally);
    manifest.write(dir)?;
    Ok(true)
}
