//! Manifests that say what is not so, the leaves being right: for `manifest`.

use super::Specimen;
use super::mutant::{Mutant, Mutation, audited, informed};
use super::surgery::other_side;
use contract::digest::Digest;
use contract::manifest::{ExtentBox, Keep, Manifest, Tree};

pub(super) const MUTANTS: &[Mutant] = &[
    audited("manifest: one leaf too many", "manifest", |s| claim(s, |m| m.leaves += 1)),
    audited("manifest: a leaf counted at another level", "manifest", |s| claim(s, by_level)),
    audited("manifest: a leaf counted on another side", "manifest", |s| claim(s, by_side)),
    audited("manifest: another digest", "manifest", |s| {
        claim(s, |m| m.digest = Digest(m.digest.0 ^ 1))
    }),
    audited("manifest: another digest of one octant", "manifest", |s| claim(s, octant_digest)),
    audited("manifest: digests of two octants swapped", "manifest", |s| claim(s, octants_swapped)),
    audited("manifest: another digest of one part", "manifest", |s| claim(s, part_digest)),
    audited("manifest: one leaf too many in one part", "manifest", |s| {
        claim(s, |m| m.parts[1].leaves += 1)
    }),
    informed("manifest: another root corner", "manifest", |s| {
        claim(s, |m| m.root.origin[1] += m.root.edge)
    }),
    informed("manifest: another root edge", "manifest", |s| claim(s, |m| m.root.edge *= 2.0)),
    informed("manifest: another surface level", "manifest", |s| claim(s, |m| m.level_surface += 1)),
    informed("manifest: another layer thickness", "manifest", |s| {
        claim(s, |m| m.layer_cells_min += 1)
    }),
    informed("manifest: another side kept", "manifest", |s| claim(s, keep)),
    informed("manifest: crossing leaves treated otherwise", "manifest", |s| {
        claim(s, |m| m.keep_crossing ^= true)
    }),
    informed("manifest: a box too many", "manifest", |s| claim(s, box_added)),
    informed("manifest: boxes forgotten", "manifest", boxes_forgotten),
    informed("manifest: final mesh called T0", "manifest", |s| claim(s, |m| m.tree = Tree::Base)),
    informed("manifest: T0 called final mesh", "manifest", base_called_final),
    audited("leaf's side flipped behind the manifest's back", "manifest", leaf_changed),
];

fn claim(s: &Specimen, lie: fn(&mut Manifest)) -> Option<Mutation> {
    let mut mutation = Mutation::of(s);
    lie(&mut mutation.mesh.manifest);
    Some(mutation)
}

fn by_level(m: &mut Manifest) {
    m.leaves_by_level[18] += 1;
    let most = (0..18).max_by_key(|&l| m.leaves_by_level[l]).expect("eighteen levels");
    m.leaves_by_level[most] -= 1;
}

fn by_side(m: &mut Manifest) {
    let sides = &mut m.leaves_by_side;
    let from = if sides.outside > 0 { &mut sides.outside } else { &mut sides.inside };
    *from -= 1;
    sides.crossing += 1;
}

fn octant_digest(m: &mut Manifest) {
    m.octant_digests[100].0 ^= 1 << 90;
}

fn octants_swapped(m: &mut Manifest) {
    let empty = Digest::default();
    let full = m.octant_digests.iter().position(|&d| d != empty).expect("there are leaves");
    let other = m.octant_digests.iter().rposition(|d| *d != m.octant_digests[full]);
    m.octant_digests.swap(full, other.expect("digests differ"));
}

fn part_digest(m: &mut Manifest) {
    m.parts[1].digest.0 ^= 1;
}

fn keep(m: &mut Manifest) {
    m.keep = if m.keep == Keep::Inside { Keep::Outside } else { Keep::Inside };
}

fn box_added(m: &mut Manifest) {
    m.boxes.push(ExtentBox { min: [0; 3], max: [1; 3], level: 0 });
}

fn boxes_forgotten(s: &Specimen) -> Option<Mutation> {
    let any = !s.case.boxes.is_empty();
    any.then(|| claim(s, |m| m.boxes.clear())).flatten()
}

fn base_called_final(s: &Specimen) -> Option<Mutation> {
    let mut mutation = Mutation::of(s);
    mutation.base.manifest.tree = Tree::Final;
    Some(mutation)
}

fn leaf_changed(s: &Specimen) -> Option<Mutation> {
    let mut mutation = Mutation::of(s);
    let part = mutation.mesh.parts.iter_mut().find(|p| !p.is_empty())?;
    let last = part.last_mut()?;
    *last = other_side(*last);
    Some(mutation)
}
