//! A corrupted mesh, made of the whole one with as little copying as possible.

use super::everywhere::Everywhere;
use super::whole::{Whole, Window, part_name, write_manifest};
use crate::selftest::Mutation;
use contract::digest::Digest;
use contract::manifest::{Manifest, Tally};
use contract::npy::{self, PartFile};
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Words copied at a time.
const CHUNK: u64 = 1 << 16;

/// What is to be done to the whole mesh.
#[derive(Debug)]
pub(super) enum Plan {
    /// Other leaves in the window.
    Leaves {
        /// In the order in which they are to be written.
        words: Vec<u64>,
        /// Whether the manifest is to be true to them.
        honest: bool,
    },
    /// Another manifest.
    Claim(Box<Manifest>),
    /// Tampering with files.
    Tamper(fn(&Path) -> io::Result<()>),
    /// It corrupts nothing that the directory holds.
    Nothing,
}

impl Plan {
    /// What a corruption of a window means for the whole.
    pub(super) fn of(window: &Window, mutation: Mutation) -> Self {
        let (before, after) = (&window.specimen.mesh, mutation.mesh);
        let names = |m: &Manifest| m.parts.iter().map(|p| p.file.clone()).collect::<Vec<_>>();
        let claims = after.manifest != before.manifest;
        let remade = after.words != before.words;
        // A corruption that makes a set anew deals it to other parts, too.
        let same_deal = after.manifest.parts.len() == before.manifest.parts.len();
        let renamed = names(&after.manifest) != names(&before.manifest);
        if claims && !remade && same_deal && (renamed || after.parts == before.parts) {
            return Self::Claim(Box::new(after.manifest));
        }
        let words = if remade { after.words } else { after.parts.concat() };
        if words != before.words {
            return Self::Leaves { words, honest: claims };
        }
        match mutation.tamper {
            Some(tamper) => Self::Tamper(tamper),
            None => Self::Nothing,
        }
    }

    /// Makes the corrupted mesh in a new directory `dir`.
    pub(super) fn carry_out(&self, whole: &Whole, window: &Window, dir: &Path) -> io::Result<()> {
        fs::create_dir(dir)?;
        match self {
            Self::Leaves { words, honest } => {
                link_parts(whole, dir, |part| part == window.part)?;
                splice(
                    &whole.parts()[window.part],
                    window,
                    words,
                    &dir.join(part_name(window.part)),
                )?;
                let manifest = match honest {
                    true => &true_manifest(whole.manifest(), window, words),
                    false => whole.manifest(),
                };
                write_manifest(dir, manifest)
            }
            Self::Claim(manifest) => {
                // A part that is not named any more would be what is noticed.
                let named = |part| manifest.parts.iter().any(|p| p.file == part_name(part));
                link_parts(whole, dir, |part| !named(part))?;
                write_manifest(dir, manifest)
            }
            Self::Tamper(tamper) => {
                // What may be written to must not be a link to the whole mesh's file.
                link_parts(whole, dir, |part| part < TAMPERED)?;
                for part in 0..TAMPERED {
                    let name = part_name(part);
                    fs::copy(whole.dir().join(&name), dir.join(&name))?;
                }
                write_manifest(dir, whole.manifest())?;
                tamper(dir)
            }
            Self::Nothing => Ok(()),
        }
    }
}

/// The catalogue tampers with some of the first parts only.
const TAMPERED: usize = 3;

/// Links all parts but some into a directory.
fn link_parts(whole: &Whole, dir: &Path, but: impl Fn(usize) -> bool) -> io::Result<()> {
    for part in (0..whole.parts().len()).filter(|&part| !but(part)) {
        let name = part_name(part);
        let (from, to) = (whole.dir().join(&name), dir.join(&name));
        // Not every file system has hard links.
        fs::hard_link(&from, &to).or_else(|_| fs::copy(&from, &to).map(drop))?;
    }
    Ok(())
}

/// Copies a part with other words in the window's place.
fn splice(file: &PartFile, window: &Window, words: &[u64], to: &Path) -> io::Result<()> {
    let gone = window.specimen.mesh.words.len() as u64;
    let leaves = file.len() - gone + words.len() as u64;
    let mut out = BufWriter::new(File::create(to)?);
    out.write_all(&npy::header("<u8", &format!("({leaves},)")))?;
    copy(file, 0, window.from, &mut out)?;
    put(words, &mut out)?;
    copy(file, window.from + gone, file.len(), &mut out)?;
    out.flush()
}

fn copy(file: &PartFile, from: u64, until: u64, out: &mut impl Write) -> io::Result<()> {
    let mut at = from;
    while at < until {
        let mut words = vec![0; (until - at).min(CHUNK) as usize];
        file.read_at(at, &mut words)?;
        put(&words, out)?;
        at += words.len() as u64;
    }
    Ok(())
}

fn put(words: &[u64], out: &mut impl Write) -> io::Result<()> {
    words.iter().try_for_each(|w| out.write_all(&w.to_le_bytes()))
}

/// The manifest of the whole with the window's leaves counted out and others counted in: no check is to be
/// helped by a digest.
fn true_manifest(whole: &Manifest, window: &Window, words: &[u64]) -> Manifest {
    let mut manifest = whole.clone();
    let (gone, come) = (Tally::of(&window.specimen.mesh.words), Tally::of(words));
    // Wrapping, as a manifest that lies from the start is no reason to fail: it is a finding by itself.
    let swap = |count: &mut u64, gone: u64, come: u64| {
        *count = count.wrapping_sub(gone).wrapping_add(come);
    };
    let swap_digest = |sum: &mut Digest, gone: Digest, come: Digest| {
        sum.remove(gone);
        sum.merge(come);
    };
    let part = &mut manifest.parts[window.part];
    swap_digest(&mut manifest.digest, gone.digest, come.digest);
    swap_digest(&mut part.digest, gone.digest, come.digest);
    swap(&mut manifest.leaves, gone.leaves, come.leaves);
    swap(&mut part.leaves, gone.leaves, come.leaves);
    for (i, sum) in manifest.octant_digests.iter_mut().enumerate() {
        swap_digest(sum, gone.octants[i], come.octants[i]);
    }
    for (i, count) in manifest.leaves_by_level.iter_mut().enumerate() {
        swap(count, gone.by_level[i], come.by_level[i]);
    }
    let (sides, gone, come) = (&mut manifest.leaves_by_side, gone.by_side, come.by_side);
    swap(&mut sides.outside, gone.outside, come.outside);
    swap(&mut sides.inside, gone.inside, come.inside);
    swap(&mut sides.crossing, gone.crossing, come.crossing);
    manifest
}

/// Makes a mesh in a new directory in which every part is changed, one after the other; false, and no
/// directory, where the leaves are the same afterwards, as those of a symmetric mesh that is mirrored.
pub(super) fn everywhere(whole: &Whole, change: &Everywhere, dir: &Path) -> io::Result<bool> {
    fs::create_dir(dir)?;
    let mut manifest = whole.manifest().clone();
    let mut tally = Tally::default();
    for (i, file) in whole.parts().iter().enumerate() {
        let after = change.apply(&file.read_all()?);
        after.iter().for_each(|&w| tally.add(w));
        let part = &mut manifest.parts[i];
        (part.leaves, part.digest) = (after.len() as u64, Digest::of(&after));
        npy::write(&dir.join(part_name(i)), &after)?;
    }
    tally.close();
    if tally.digest == whole.manifest().digest {
        fs::remove_dir_all(dir)?;
        return Ok(false);
    }
    manifest.leaves = tally.leaves;
    manifest.leaves_by_level = tally.by_level;
    manifest.leaves_by_side = tally.by_side;
    manifest.digest = tally.digest;
    manifest.octant_digests = tally.octants;
    write_manifest(dir, &manifest)?;
    Ok(true)
}
