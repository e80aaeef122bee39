//! Damaged, swapped and missing files. The check `files` must detect them or, if every file is valid by itself,
//! `manifest` or `linear`.

use std::fs;
use std::io::{Result, Write};
use std::path::Path;

use super::SelftestCase;
use super::mutant::{Mutant, Mutation, audited};
use contract::manifest;
use contract::npy;

pub(super) const MUTANTS: &[Mutant] = &[
    audited("part truncated", "files", |s| tampered(s, truncated)),
    audited("part truncated within its header", "files", |s| tampered(s, truncated_in_header)),
    audited("part with extra bytes", "files", |s| tampered(s, extra_bytes)),
    audited("part of zero bytes", "files", |s| tampered(s, |dir| fs::write(dir.join(PART), b""))),
    audited("part missing", "files", |s| tampered(s, |dir| fs::remove_file(dir.join(PART)))),
    audited("part that the manifest does not name", "files", |s| tampered(s, extra)),
    audited("part of signed words", "files", |s| tampered(s, |dir| reheaded(dir, "<i8", 8, false))),
    audited("part of 32-bit words", "files", |s| tampered(s, |dir| reheaded(dir, "<u4", 4, false))),
    audited("part of big-endian words", "files", |s| {
        tampered(s, |dir| reheaded(dir, ">u8", 8, false))
    }),
    audited("part of two dimensions", "files", |s| {
        tampered(s, |dir| reheaded(dir, "<u8", 8, true))
    }),
    audited("parts swapped", "manifest", |s| tampered(s, swapped)),
    audited("part overwritten with a copy of another", "linear", |s| tampered(s, duplicated)),
    audited("part without leaves", "manifest", |s| {
        tampered(s, |dir| npy::write(&dir.join(PART), &[]))
    }),
    audited("part named twice", "linear", |s| Some(renamed(s, "leaves-00000.npy"))),
    audited("part outside the directory", "files", |s| Some(renamed(s, "../leaves-00001.npy"))),
    audited("manifest missing", "files", |s| {
        tampered(s, |dir| fs::remove_file(dir.join(manifest::FILE)))
    }),
    audited("manifest truncated", "files", |s| tampered(s, manifest_truncated)),
    audited("manifest of an unknown schema", "files", |s| {
        tampered(s, |dir| edited(dir, "set/1", "set/9"))
    }),
    audited("manifest with an unknown key", "files", |s| {
        tampered(s, |dir| edited(dir, "\"program\"", "\"programme\""))
    }),
    audited("manifest without the digest of one octant", "files", octant_missing),
];

const PART: &str = "leaves-00001.npy";
const OTHER: &str = "leaves-00002.npy";

/// Applies if both parts have enough leaves for the damage to have an effect.
fn tampered(s: &SelftestCase, tamper: fn(&Path) -> Result<()>) -> Option<Mutation> {
    let leaves = s.mesh.parts[1..].iter().all(|p| p.len() >= 2 && p.len() < 1 << 20);
    leaves.then(|| Mutation::tampered(s, tamper))
}

fn keep_bytes(dir: &Path, of: impl Fn(u64) -> u64) -> Result<()> {
    let file = fs::OpenOptions::new().write(true).open(dir.join(PART))?;
    let len = file.metadata()?.len();
    file.set_len(of(len))
}

fn truncated(dir: &Path) -> Result<()> {
    keep_bytes(dir, |len| len - 4)
}

fn truncated_in_header(dir: &Path) -> Result<()> {
    keep_bytes(dir, |_| 40)
}

fn extra_bytes(dir: &Path) -> Result<()> {
    fs::OpenOptions::new().append(true).open(dir.join(PART))?.write_all(&[0; 8])
}

fn extra(dir: &Path) -> Result<()> {
    fs::copy(dir.join(PART), dir.join("leaves-99999.npy")).map(drop)
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

fn swapped(dir: &Path) -> Result<()> {
    let aside = dir.join("aside");
    fs::rename(dir.join(PART), &aside)?;
    fs::rename(dir.join(OTHER), dir.join(PART))?;
    fs::rename(aside, dir.join(OTHER))
}

fn duplicated(dir: &Path) -> Result<()> {
    fs::copy(dir.join(OTHER), dir.join(PART)).map(drop)
}

/// The second part's entry in the manifest names another file.
fn renamed(s: &SelftestCase, file: &str) -> Mutation {
    let mut mutation = Mutation::of(s);
    mutation.mesh.manifest.parts[1].file = file.to_owned();
    // The file is written once per entry, so both entries must have the same leaves.
    if let Some(first) = (file == "leaves-00000.npy").then(|| mutation.mesh.parts[0].clone()) {
        mutation.mesh.parts[1] = first;
    }
    mutation
}

fn manifest_truncated(dir: &Path) -> Result<()> {
    let path = dir.join(manifest::FILE);
    let text = fs::read(&path)?;
    fs::write(path, &text[..text.len() / 2])
}

fn edited(dir: &Path, from: &str, to: &str) -> Result<()> {
    let path = dir.join(manifest::FILE);
    let text = fs::read_to_string(&path)?;
    assert!(text.contains(from), "nothing to edit");
    fs::write(path, text.replacen(from, to, 1))
}

fn octant_missing(s: &SelftestCase) -> Option<Mutation> {
    let mut mutation = Mutation::of(s);
    mutation.mesh.manifest.octant_digests.pop();
    Some(mutation)
}
