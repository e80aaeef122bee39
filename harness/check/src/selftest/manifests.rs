//! Wrong manifests of correct leaves, which the check `manifest` must detect.

use super::SelftestCase;
use super::edit::other_side;
use super::mutant::{Mutant, Mutation, audited, informed};
use contract::digest::Digest;
use contract::manifest::{Enclosed, ExtentBox, Keep, Manifest, Part, Tree};

pub(super) const MUTANTS: &[Mutant] = &[
    audited("manifest: one leaf too many", "manifest", |s| edited(s, |m| m.leaves += 1)),
    audited("manifest: a leaf counted on the wrong level", "manifest", |s| edited(s, by_level)),
    audited("manifest: a leaf counted on the wrong side", "manifest", |s| edited(s, by_side)),
    audited("manifest: wrong digest", "manifest", |s| {
        edited(s, |m| m.digest = Digest(m.digest.0 ^ 1))
    }),
    audited("manifest: wrong digest of one octant", "manifest", |s| edited(s, octant_digest)),
    audited("manifest: digests of two octants swapped", "manifest", |s| edited(s, octants_swapped)),
    audited("manifest: wrong digest of one part", "manifest", |s| edited(s, part_digest)),
    audited("manifest: one leaf too many in one part", "manifest", |s| {
        edited(s, |m| last_part(m).leaves += 1)
    }),
    informed("manifest: wrong root corner", "manifest", |s| {
        edited(s, |m| m.root.origin[1] += m.root.edge)
    }),
    informed("manifest: wrong root edge", "manifest", |s| edited(s, |m| m.root.edge *= 2.0)),
    informed("manifest: wrong surface level", "manifest", |s| edited(s, |m| m.level_surface += 1)),
    informed("manifest: wrong layer thickness", "manifest", |s| {
        edited(s, |m| m.layer_cells_min += 1)
    }),
    informed("manifest: wrong side kept", "manifest", |s| edited(s, keep)),
    informed("manifest: wrong treatment of crossing leaves", "manifest", |s| {
        edited(s, |m| m.keep_crossing ^= true)
    }),
    informed("manifest: one box too many", "manifest", |s| edited(s, box_added)),
    informed("manifest: boxes missing", "manifest", boxes_removed),
    informed("manifest: one seed too many", "manifest", |s| {
        edited(s, |m| m.seeds.push([1 << 20; 3]))
    }),
    informed("manifest: seeds missing", "manifest", seeds_removed),
    informed("manifest: wrong treatment of enclosed components", "manifest", |s| {
        edited(s, |m| m.enclosed = other(m.enclosed))
    }),
    informed("manifest: final mesh labelled T0", "manifest", |s| {
        edited(s, |m| m.tree = Tree::Base)
    }),
    informed("manifest: T0 labelled final mesh", "manifest", base_labelled_final),
    audited("leaf's side flipped, manifest unchanged", "manifest", leaf_changed),
];

fn edited(s: &SelftestCase, edit: fn(&mut Manifest)) -> Option<Mutation> {
    let mut mutation = Mutation::of(s);
    edit(&mut mutation.mesh.manifest);
    Some(mutation)
}

fn by_level(m: &mut Manifest) {
    m.leaves_by_level[18] += 1;
    let most = (0..18).max_by_key(|&l| m.leaves_by_level[l]).expect("eighteen levels");
    m.leaves_by_level[most] -= 1;
}

fn by_side(m: &mut Manifest) {
    let sides = &mut m.leaves_by_side;
    let (from, to) = match (sides.outside, sides.inside) {
        (0, 0) => (&mut sides.crossing, &mut sides.outside),
        (0, _) => (&mut sides.inside, &mut sides.crossing),
        _ => (&mut sides.outside, &mut sides.crossing),
    };
    *from -= 1;
    *to += 1;
}

fn octant_digest(m: &mut Manifest) {
    m.octant_digests[100].0 ^= 1 << 90;
}

fn octants_swapped(m: &mut Manifest) {
    let empty = Digest::default();
    let full = m.octant_digests.iter().position(|&d| d != empty).expect("there are leaves");
    let other = m.octant_digests.iter().rposition(|d| *d != m.octant_digests[full]);
    m.octant_digests.swap(full, other.expect("not all digests are equal"));
}

fn part_digest(m: &mut Manifest) {
    last_part(m).digest.0 ^= 1;
}

fn last_part(m: &mut Manifest) -> &mut Part {
    m.parts.last_mut().expect("there is a part")
}

fn keep(m: &mut Manifest) {
    m.keep = if m.keep == Keep::Inside { Keep::Outside } else { Keep::Inside };
}

fn box_added(m: &mut Manifest) {
    m.boxes.push(ExtentBox { min: [0; 3], max: [1; 3], level: 0 });
}

fn boxes_removed(s: &SelftestCase) -> Option<Mutation> {
    let any = !s.case.boxes.is_empty();
    any.then(|| edited(s, |m| m.boxes.clear())).flatten()
}

fn seeds_removed(s: &SelftestCase) -> Option<Mutation> {
    let any = !s.case.seeds.is_empty();
    any.then(|| edited(s, |m| m.seeds.clear())).flatten()
}

fn other(enclosed: Enclosed) -> Enclosed {
    match enclosed {
        Enclosed::Delete => Enclosed::Keep,
        Enclosed::Keep => Enclosed::Delete,
    }
}

fn base_labelled_final(s: &SelftestCase) -> Option<Mutation> {
    let mut mutation = Mutation::of(s);
    mutation.base.manifest.tree = Tree::Final;
    Some(mutation)
}

fn leaf_changed(s: &SelftestCase) -> Option<Mutation> {
    let mut mutation = Mutation::of(s);
    let part = mutation.mesh.parts.iter_mut().find(|p| !p.is_empty())?;
    let last = part.last_mut()?;
    *last = other_side(*last);
    Some(mutation)
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
