//! Wrong manifests of correct leaves, which the check `manifest` must detect.

use super::edit::other_side;
use super::mutant::{AUDITED, Change, INFORMED, Mutant, sets};
use contract::digest::Digest;
use contract::manifest::{Enclosed, ExtentBox, Keep, Manifest, Part, Tree};

pub(super) const MUTANTS: &[Mutant] = &[
    edited("manifest: one leaf too many", AUDITED, |m| m.leaves += 1),
    edited("manifest: a leaf counted on the wrong level", AUDITED, |m| {
        m.leaves_by_level[18] += 1;
        let most = (0..18).max_by_key(|&l| m.leaves_by_level[l]).expect("eighteen levels");
        m.leaves_by_level[most] -= 1;
    }),
    edited("manifest: a leaf counted on the wrong side", AUDITED, |m| {
        let sides = &mut m.leaves_by_side;
        let (from, to) = match (sides.outside, sides.inside) {
            (0, 0) => (&mut sides.crossing, &mut sides.outside),
            (0, _) => (&mut sides.inside, &mut sides.crossing),
            _ => (&mut sides.outside, &mut sides.crossing),
        };
        *from -= 1;
        *to += 1;
    }),
    edited("manifest: wrong digest", AUDITED, |m| m.digest.0 ^= 1),
    edited("manifest: wrong digest of one octant", AUDITED, octant_digest),
    edited("manifest: digests of two octants swapped", AUDITED, |m| {
        let empty = Digest::default();
        let full = m.octant_digests.iter().position(|&d| d != empty).expect("there are leaves");
        let other = m.octant_digests.iter().rposition(|d| *d != m.octant_digests[full]);
        m.octant_digests.swap(full, other.expect("not all digests are equal"));
    }),
    edited("manifest: wrong digest of one part", AUDITED, part_digest),
    edited("manifest: one leaf too many in one part", AUDITED, |m| last_part(m).leaves += 1),
    edited("manifest: wrong root corner", INFORMED, |m| m.root.origin[1] += m.root.edge),
    edited("manifest: wrong root edge", INFORMED, |m| m.root.edge *= 2.0),
    edited("manifest: wrong surface level", INFORMED, |m| m.level_surface += 1),
    edited("manifest: wrong layer thickness", INFORMED, |m| m.layer_cells_min += 1),
    edited("manifest: wrong side kept", INFORMED, |m| {
        m.keep = if m.keep == Keep::Inside { Keep::Outside } else { Keep::Inside };
    }),
    edited("manifest: wrong treatment of crossing leaves", INFORMED, |m| m.keep_crossing ^= true),
    edited("manifest: one box too many", INFORMED, |m| {
        m.boxes.push(ExtentBox { min: [0; 3], max: [1; 3], level: 0 });
    }),
    sets("manifest: boxes missing", "manifest", INFORMED, |s, mutation| {
        mutation.mesh.manifest.boxes.clear();
        (!s.case.boxes.is_empty()).then_some(())
    }),
    edited("manifest: one seed too many", INFORMED, |m| m.seeds.push([1 << 20; 3])),
    sets("manifest: seeds missing", "manifest", INFORMED, |s, mutation| {
        mutation.mesh.manifest.seeds.clear();
        (!s.case.seeds.is_empty()).then_some(())
    }),
    edited("manifest: wrong treatment of enclosed components", INFORMED, |m| {
        let is_deleted = m.enclosed == Enclosed::Delete;
        m.enclosed = if is_deleted { Enclosed::Keep } else { Enclosed::Delete };
    }),
    edited("manifest: final mesh labelled T0", INFORMED, |m| m.tree = Tree::Base),
    sets("manifest: T0 labelled final mesh", "manifest", INFORMED, |_, mutation| {
        mutation.base.manifest.tree = Tree::Final;
        Some(())
    }),
    sets("leaf's side flipped, manifest unchanged", "manifest", AUDITED, |_, mutation| {
        let part = mutation.mesh.parts.iter_mut().find(|p| !p.is_empty())?;
        let last = part.last_mut()?;
        *last = other_side(*last);
        Some(())
    }),
];

const fn edited(name: &'static str, audit: bool, edit: fn(&mut Manifest)) -> Mutant {
    Mutant { name, expected: "manifest", audit, change: Change::Manifest(edit) }
}

fn octant_digest(m: &mut Manifest) {
    m.octant_digests[100].0 ^= 1 << 90;
}

fn part_digest(m: &mut Manifest) {
    last_part(m).digest.0 ^= 1;
}

fn last_part(m: &mut Manifest) -> &mut Part {
    m.parts.last_mut().expect("there is a part")
}

#[cfg(test)]
mod tests {
    use super::*;
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
            for change in [octant_digest, part_digest] {
                let mut after = before.clone();
                change(&mut after);
                assert_ne!(after, before);
            }
        }
    }
}
