//! Damaged, swapped and missing files. The check `files` must detect them or, if every file is valid by itself,
//! `manifest` or `linear`.

use std::fs;
use std::io::{Result, Write};
use std::path::Path;

use super::mutant::{AUDITED, Change, Mutant, Mutation, sets};
use contract::manifest;
use contract::npy;

pub(super) const MUTANTS: &[Mutant] = &[
    damaged("part truncated", "files", |dir| keep_bytes(dir, |len| len - 4)),
    damaged("part truncated within its header", "files", |dir| keep_bytes(dir, |_| 40)),
    damaged("part with extra bytes", "files", |dir| {
        fs::OpenOptions::new().append(true).open(dir.join(PART))?.write_all(&[0; 8])
    }),
    damaged("part of zero bytes", "files", |dir| fs::write(dir.join(PART), b"")),
    damaged("part missing", "files", |dir| fs::remove_file(dir.join(PART))),
    damaged("part that the manifest does not name", "files", |dir| {
        fs::copy(dir.join(PART), dir.join("leaves-99999.npy")).map(drop)
    }),
    damaged("part of signed words", "files", |dir| reheaded(dir, "<i8", 8, false)),
    damaged("part of 32-bit words", "files", |dir| reheaded(dir, "<u4", 4, false)),
    damaged("part of big-endian words", "files", |dir| reheaded(dir, ">u8", 8, false)),
    damaged("part of two dimensions", "files", |dir| reheaded(dir, "<u8", 8, true)),
    damaged("parts swapped", "manifest", |dir| {
        let aside = dir.join("aside");
        fs::rename(dir.join(PART), &aside)?;
        fs::rename(dir.join(OTHER), dir.join(PART))?;
        fs::rename(aside, dir.join(OTHER))
    }),
    damaged("part overwritten with a copy of another", "linear", |dir| {
        fs::copy(dir.join(OTHER), dir.join(PART)).map(drop)
    }),
    damaged("part without leaves", "manifest", |dir| npy::write(&dir.join(PART), &[])),
    sets("part named twice", "linear", AUDITED, |_, mutation| {
        // The file is written once per entry, so both entries must have the same leaves.
        mutation.mesh.parts[1] = mutation.mesh.parts[0].clone();
        renamed(mutation, "leaves-00000.npy")
    }),
    sets("part outside the directory", "files", AUDITED, |_, mutation| {
        renamed(mutation, "../leaves-00001.npy")
    }),
    damaged("manifest missing", "files", |dir| fs::remove_file(dir.join(manifest::FILE))),
    damaged("manifest truncated", "files", |dir| {
        let path = dir.join(manifest::FILE);
        let text = fs::read(&path)?;
        fs::write(path, &text[..text.len() / 2])
    }),
    damaged("manifest of an unknown schema", "files", |dir| edited(dir, "set/1", "set/9")),
    damaged("manifest with an unknown key", "files", |dir| {
        edited(dir, "\"program\"", "\"programme\"")
    }),
    sets("manifest without the digest of one octant", "files", AUDITED, |_, mutation| {
        mutation.mesh.manifest.octant_digests.pop().map(drop)
    }),
];

const PART: &str = "leaves-00001.npy";
const OTHER: &str = "leaves-00002.npy";

const fn damaged(
    name: &'static str,
    expected: &'static str,
    damage: fn(&Path) -> Result<()>,
) -> Mutant {
    Mutant { name, expected, audit: AUDITED, change: Change::Files(damage) }
}

fn keep_bytes(dir: &Path, of: impl Fn(u64) -> u64) -> Result<()> {
    let file = fs::OpenOptions::new().write(true).open(dir.join(PART))?;
    let len = file.metadata()?.len();
    file.set_len(of(len))
}

/// The same data with another header.
fn reheaded(dir: &Path, descr: &str, width: usize, two_dimensions: bool) -> Result<()> {
    let path = dir.join(PART);
    let words = npy::PartFile::open(&path).map_err(std::io::Error::other)?.read_all()?;
    let count = words.len() * 8 / width;
    let shape = if two_dimensions { format!("(1, {count})") } else { format!("({count},)") };
    let mut bytes = npy::header(descr, &shape);
    words.iter().for_each(|w| bytes.extend(w.to_le_bytes()));
    fs::write(path, bytes)
}

/// The second part's entry in the manifest names another file.
fn renamed(mutation: &mut Mutation, file: &str) -> Option<()> {
    mutation.mesh.manifest.parts[1].file = file.to_owned();
    Some(())
}

fn edited(dir: &Path, from: &str, to: &str) -> Result<()> {
    let path = dir.join(manifest::FILE);
    let text = fs::read_to_string(&path)?;
    assert!(text.contains(from), "nothing to edit");
    fs::write(path, text.replacen(from, to, 1))
}
