//! Files damaged, swapped, missing: for `files`, and for `manifest` where each file is sound by itself.

use std::fs;
use std::io::{Result, Write};
use std::path::Path;

use super::Specimen;
use super::mutant::{Mutant, Mutation, audited};
use contract::manifest;
use contract::npy;

pub(super) const MUTANTS: &[Mutant] = &[
    audited("part cut short", "files", |s| tampered(s, cut_short)),
    audited("part cut within its header", "files", |s| tampered(s, cut_in_header)),
    audited("part with bytes left over", "files", |s| tampered(s, left_over)),
    audited("part empty of bytes", "files", |s| tampered(s, |dir| fs::write(dir.join(PART), b""))),
    audited("part missing", "files", |s| tampered(s, |dir| fs::remove_file(dir.join(PART)))),
    audited("part that the manifest does not name", "files", |s| tampered(s, extra)),
    audited("part of signed words", "files", |s| tampered(s, |dir| reheaded(dir, "<i8", 8, false))),
    audited("part of halved words", "files", |s| tampered(s, |dir| reheaded(dir, "<u4", 4, false))),
    audited("part of big-endian words", "files", |s| {
        tampered(s, |dir| reheaded(dir, ">u8", 8, false))
    }),
    audited("part of two dimensions", "files", |s| {
        tampered(s, |dir| reheaded(dir, "<u8", 8, true))
    }),
    audited("parts swapped", "manifest", |s| tampered(s, swapped)),
    audited("part overwritten with a copy of another", "linear", |s| tampered(s, duplicated)),
    audited("part emptied of leaves", "manifest", |s| {
        tampered(s, |dir| npy::write(&dir.join(PART), &[]))
    }),
    audited("part named twice", "linear", |s| Some(renamed(s, "leaves-00000.npy"))),
    audited("part from outside of the directory", "files", |s| {
        Some(renamed(s, "../leaves-00001.npy"))
    }),
    audited("manifest missing", "files", |s| {
        tampered(s, |dir| fs::remove_file(dir.join(manifest::FILE)))
    }),
    audited("manifest cut short", "files", |s| tampered(s, manifest_cut)),
    audited("manifest of an unknown schema", "files", |s| {
        tampered(s, |dir| edited(dir, "set/1", "set/9"))
    }),
    audited("manifest with an unknown key", "files", |s| {
        tampered(s, |dir| edited(dir, "\"program\"", "\"programme\""))
    }),
    audited("manifest without one octant's digest", "files", octant_missing),
];

const PART: &str = "leaves-00001.npy";
const OTHER: &str = "leaves-00002.npy";

/// Tampers where both parts have leaves enough to show it.
fn tampered(s: &Specimen, tamper: fn(&Path) -> Result<()>) -> Option<Mutation> {
    let leaves = s.mesh.parts[1..].iter().all(|p| p.len() >= 2 && p.len() < 1 << 20);
    leaves.then(|| Mutation::tampered(s, tamper))
}

fn keep_bytes(dir: &Path, of: impl Fn(u64) -> u64) -> Result<()> {
    let file = fs::OpenOptions::new().write(true).open(dir.join(PART))?;
    let len = file.metadata()?.len();
    file.set_len(of(len))
}

fn cut_short(dir: &Path) -> Result<()> {
    keep_bytes(dir, |len| len - 4)
}

fn cut_in_header(dir: &Path) -> Result<()> {
    keep_bytes(dir, |_| 40)
}

fn left_over(dir: &Path) -> Result<()> {
    fs::OpenOptions::new().append(true).open(dir.join(PART))?.write_all(&[0; 8])
}

fn extra(dir: &Path) -> Result<()> {
    fs::copy(dir.join(PART), dir.join("leaves-99999.npy")).map(drop)
}

/// The same bytes under another header.
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

/// The second part's entry in the manifest leads to another file.
fn renamed(s: &Specimen, file: &str) -> Mutation {
    let mut mutation = Mutation::of(s);
    mutation.mesh.manifest.parts[1].file = file.to_owned();
    // A file written twice keeps what was written last: both entries then hold the same leaves.
    if let Some(first) = (file == "leaves-00000.npy").then(|| mutation.mesh.parts[0].clone()) {
        mutation.mesh.parts[1] = first;
    }
    mutation
}

fn manifest_cut(dir: &Path) -> Result<()> {
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

fn octant_missing(s: &Specimen) -> Option<Mutation> {
    let mut mutation = Mutation::of(s);
    mutation.mesh.manifest.octant_digests.pop();
    Some(mutation)
}
