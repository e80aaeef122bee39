//! Wrong manifests of correct leaves, which the check `manifest` must detect, and damaged, swapped and missing files. The check
//! `files` must detect them or, if every file is valid by itself, `manifest` or `linear`.

use std::fs;
use std::io::{Result, Write};
use std::path::Path;

use super::mutant::{AUDITED, INFORMED, Mutant, Mutation, damaged, edit, other_side, sets};
use contract::digest::Digest;
use contract::manifest::{Enclosed, ExtentBox, FILE as MANIFEST, Keep, Manifest, Part, Tree};
use contract::npy;

pub(super) const MUTANTS: &[Mutant] = &[
    manifest("manifest: one leaf too many", AUDITED, |m| m.leaves += 1),
    manifest("manifest: a leaf counted on the wrong level", AUDITED, |m| {
        m.leaves_by_level[18] += 1;
        let most = (0..18).max_by_key(|&l| m.leaves_by_level[l]).expect("eighteen levels");
        m.leaves_by_level[most] -= 1;
    }),
    manifest("manifest: a leaf counted on the wrong side", AUDITED, |m| {
        let sides = &mut m.leaves_by_side;
        let (from, to) = match (sides.outside, sides.inside) {
            (0, 0) => (&mut sides.crossing, &mut sides.outside),
            (0, _) => (&mut sides.inside, &mut sides.crossing),
            _ => (&mut sides.outside, &mut sides.crossing),
        };
        *from -= 1;
        *to += 1;
    }),
    manifest("manifest: wrong digest", AUDITED, |m| m.digest.0 ^= 1),
    manifest("manifest: wrong digest of one octant", AUDITED, |m| {
        m.octant_digests[100].0 ^= 1 << 90;
    }),
    manifest("manifest: digests of two octants swapped", AUDITED, |m| {
        let empty = Digest::default();
        let full = m.octant_digests.iter().position(|&d| d != empty).expect("there are leaves");
        let other = m.octant_digests.iter().rposition(|d| *d != m.octant_digests[full]);
        m.octant_digests.swap(full, other.expect("not all digests are equal"));
    }),
    manifest("manifest: wrong digest of one part", AUDITED, |m| last_part(m).digest.0 ^= 1),
    manifest("manifest: one leaf too many in one part", AUDITED, |m| last_part(m).leaves += 1),
    manifest("manifest: wrong root corner", INFORMED, |m| m.root.origin[1] += m.root.edge),
    manifest("manifest: wrong root edge", INFORMED, |m| m.root.edge *= 2.0),
    manifest("manifest: wrong surface level", INFORMED, |m| m.level_surface += 1),
    manifest("manifest: wrong layer thickness", INFORMED, |m| m.layer_cells_min += 1),
    manifest("manifest: wrong side kept", INFORMED, |m| {
        m.keep = if m.keep == Keep::Inside { Keep::Outside } else { Keep::Inside };
    }),
    manifest("manifest: wrong treatment of crossing leaves", INFORMED, |m| m.keep_crossing ^= true),
    manifest("manifest: one box too many", INFORMED, |m| {
        m.boxes.push(ExtentBox { min: [0; 3], max: [1; 3], level: 0 });
    }),
    manifest("manifest: boxes missing", INFORMED, |m| m.boxes.clear()),
    manifest("manifest: one seed too many", INFORMED, |m| m.seeds.push([1 << 20; 3])),
    manifest("manifest: seeds missing", INFORMED, |m| m.seeds.clear()),
    manifest("manifest: another geometry", INFORMED, |m| {
        m.geometry.iter_mut().for_each(|of| of.digest.0 ^= 1);
    }),
    manifest("manifest: wrong treatment of enclosed components", INFORMED, |m| {
        m.enclosed = if m.enclosed == Enclosed::Delete { Enclosed::Keep } else { Enclosed::Delete };
    }),
    manifest("manifest: final mesh labelled T0", INFORMED, |m| m.tree = Tree::Base),
    sets("manifest: T0 labelled final mesh", "manifest", INFORMED, |s, mutation| {
        *mutation = Mutation::of(s, Tree::Base);
        mutation.mesh.manifest.tree = Tree::Final;
        Some(())
    }),
    sets("leaf's side flipped, manifest unchanged", "manifest", AUDITED, |_, mutation| {
        let last = mutation.mesh.parts.iter_mut().find(|p| !p.is_empty())?.last_mut()?;
        *last = other_side(*last);
        Some(())
    }),
    damaged("part truncated", "files", AUDITED, |dir| keep_bytes(dir, |len| len - 4)),
    damaged("part truncated within its header", "files", AUDITED, |dir| keep_bytes(dir, |_| 40)),
    damaged("part with extra bytes", "files", AUDITED, |dir| {
        fs::OpenOptions::new().append(true).open(dir.join(PART))?.write_all(&[0; 8])
    }),
    damaged("part of zero bytes", "files", AUDITED, |dir| fs::write(dir.join(PART), b"")),
    damaged("part missing", "files", AUDITED, |dir| fs::remove_file(dir.join(PART))),
    damaged("part that the manifest does not name", "files", AUDITED, |dir| {
        fs::copy(dir.join(PART), dir.join("leaves-99999.npy")).map(drop)
    }),
    damaged("part of signed words", "files", AUDITED, |dir| reheaded(dir, "<i8", 8, false)),
    damaged("part of 32-bit words", "files", AUDITED, |dir| reheaded(dir, "<u4", 4, false)),
    damaged("part of big-endian words", "files", AUDITED, |dir| reheaded(dir, ">u8", 8, false)),
    damaged("part of two dimensions", "files", AUDITED, |dir| reheaded(dir, "<u8", 8, true)),
    damaged("parts swapped", "manifest", AUDITED, |dir| {
        let aside = dir.join("aside");
        fs::rename(dir.join(PART), &aside)?;
        fs::rename(dir.join(OTHER), dir.join(PART))?;
        fs::rename(aside, dir.join(OTHER))
    }),
    damaged("part overwritten with a copy of another", "linear", AUDITED, |dir| {
        fs::copy(dir.join(OTHER), dir.join(PART)).map(drop)
    }),
    damaged("part without leaves", "manifest", AUDITED, |dir| npy::write(&dir.join(PART), &[])),
    sets("part named twice", "linear", AUDITED, |_, mutation| {
        // The file is written once per entry, so both entries must have the same leaves.
        mutation.mesh.parts[1] = mutation.mesh.parts[0].clone();
        mutation.mesh.manifest.parts[1].file = "leaves-00000.npy".to_owned();
        Some(())
    }),
    edit("part outside the directory", "files", AUDITED, |m| {
        m.parts[1].file = "../leaves-00001.npy".to_owned();
    }),
    damaged("manifest missing", "files", AUDITED, |dir| fs::remove_file(dir.join(MANIFEST))),
    damaged("manifest truncated", "files", AUDITED, |dir| {
        let path = dir.join(MANIFEST);
        let text = fs::read(&path)?;
        fs::write(path, &text[..text.len() / 2])
    }),
    damaged("manifest of an unknown schema", "files", AUDITED, |dir| edited(dir, "set/1", "set/9")),
    damaged("manifest with an unknown key", "files", AUDITED, |dir| {
        edited(dir, "\"program\"", "\"programme\"")
    }),
    edit("manifest without the digest of one octant", "files", AUDITED, |m| {
        m.octant_digests.pop();
    }),
];

const PART: &str = "leaves-00001.npy";
const OTHER: &str = "leaves-00002.npy";

fn keep_bytes(dir: &Path, of: impl Fn(u64) -> u64) -> Result<()> {
    let file = fs::OpenOptions::new().write(true).open(dir.join(PART))?;
    file.set_len(of(file.metadata()?.len()))
}

/// The same data with another header.
fn reheaded(dir: &Path, descr: &str, width: usize, two_dimensions: bool) -> Result<()> {
    let path = dir.join(PART);
    let part = npy::PartFile::open(&path).map_err(std::io::Error::other)?;
    let words = part.read_all().map_err(std::io::Error::other)?;
    let count = words.len() * 8 / width;
    let shape = if two_dimensions { format!("(1, {count})") } else { format!("({count},)") };
    let mut bytes = npy::header(descr, &shape);
    words.iter().for_each(|w| bytes.extend(w.to_le_bytes()));
    fs::write(path, bytes)
}

fn edited(dir: &Path, from: &str, to: &str) -> Result<()> {
    let path = dir.join(MANIFEST);
    let text = fs::read_to_string(&path)?;
    assert!(text.contains(from), "nothing to edit");
    fs::write(path, text.replacen(from, to, 1))
}

const fn manifest(name: &'static str, audit: bool, change: fn(&mut Manifest)) -> Mutant {
    edit(name, "manifest", audit, change)
}

fn last_part(m: &mut Manifest) -> &mut Part {
    m.parts.last_mut().expect("there is a part")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::selftest::mutant::Change;
    use contract::testing::{leaf_set, words_of};

    #[test]
    fn every_change_of_a_digest_changes_it_whatever_it_is() {
        let words = words_of(|o| o.level < 3);
        let correct = leaf_set(words.chunks(256).map(<[u64]>::to_vec).collect()).manifest;
        for digest in [Digest(0), Digest(!0)] {
            let mut before = correct.clone();
            before.digest = digest;
            before.octant_digests.fill(digest);
            before.parts.iter_mut().for_each(|part| part.digest = digest);
            let changes =
                MUTANTS.iter().filter(|mutant| mutant.name.contains("wrong digest of one"));
            assert_eq!(changes.clone().count(), 2);
            for mutant in changes {
                let Change::Manifest(change) = mutant.change else { panic!("{}", mutant.name) };
                let mut after = before.clone();
                change(&mut after);
                assert_ne!(after, before);
            }
        }
    }
}
