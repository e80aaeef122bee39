//! The differences of two meshes: of their inputs and counts, and of the leaves in the first octant that differs. If the sides of
//! one are unknown, only the cells are compared.
//!
//! All leaves are read once, to count and digest them, with memory for one buffer, from the parts or the tree. A comparison that trusts the digests in the
//! manifests reads only the first octant that differs. Words that are not a linear oct-tree are refused.
//!
//! Invariants of a report: octants of level 3 ascend, and differ only if the meshes do; the first difference has an octant, and
//! rules a first difference; meshes whose roots differ are not the same, whatever their words.

#[cfg(test)]
mod tests;

pub mod fields;
mod rule;

use std::fmt;
use std::path::Path;

use crate::checks::Terms;
use crate::why::{self, Body};
use contract::case::Case;
use contract::leafset::ReadError;
use contract::manifest::{Manifest, Sides, Tally};
use contract::mesh::Mesh;
use contract::octant::Octant;
use contract::word;

/// What a comparison trusts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Trust {
    /// The leaves in the files.
    #[default]
    Leaves,
    /// The counts and digests in the manifests.
    Manifests,
}

/// The differences of two leaf sets.
#[derive(Clone, Debug, Default)]
pub struct DiffReport {
    /// What was compared.
    pub compared: Trust,
    /// The mesh whose sides are unknown, so that only the cells were compared.
    pub without_sides: Option<&'static str>,
    /// Number of leaves of the first mesh.
    pub leaves: u64,
    /// Manifests with counts or digests that their leaves do not have, one sentence each.
    pub contradictions: Vec<String>,
    /// Manifest fields that differ, with both values.
    pub fields: Vec<String>,
    /// Whether the roots differ, to the last bit.
    pub roots_differ: bool,
    /// Level-3 octants whose digests differ.
    pub octants: Vec<Octant>,
    /// The first difference of the leaves, with the leaves of both meshes.
    pub leaf: Option<String>,
    /// The rule of the definition that decides which mesh is right, or why none does.
    pub rule: Option<String>,
}

impl DiffReport {
    /// Whether the leaf words are the same.
    pub fn same_leaves(&self) -> bool {
        self.octants.is_empty()
    }

    /// Whether the meshes are the same: their leaves and their roots.
    pub fn same_mesh(&self) -> bool {
        self.same_leaves() && !self.roots_differ
    }

    /// Panics if an invariant of the answer does not hold.
    pub fn check_invariants(&self) {
        let Self { octants, leaf, rule, fields, roots_differ, .. } = self;
        let key = |octant: &Octant| word::key_of(octant.corner);
        assert!(
            octants.iter().all(|octant| octant.level == 3)
                && octants.is_sorted_by(|a, b| key(a) < key(b)),
            "octants that differ do not ascend, or are not of level 3: {octants:?}"
        );
        assert!(
            leaf.is_none() || !octants.is_empty(),
            "equal leaves have a first difference: {leaf:?}"
        );
        assert!(rule.is_none() || leaf.is_some(), "a rule without a difference: {rule:?}");
        let is_listed = fields.iter().any(|field| field.starts_with("root: "));
        assert!(
            *roots_differ == is_listed,
            "roots differ: {roots_differ}, and among the fields: {is_listed}"
        );
    }
}

/// Number of octants whose paths are listed; the others are counted only.
const OCTANTS_LISTED: usize = 8;

impl fmt::Display for DiffReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(mesh) = self.without_sides {
            writeln!(f, "the sides of {mesh} are unknown: only the cells are compared")?;
        }
        for line in self.contradictions.iter().chain(&self.fields) {
            writeln!(f, "{line}")?;
        }
        if self.same_leaves() {
            let leaves = self.leaves;
            match self.compared {
                Trust::Leaves => write!(f, "the leaves are the same ({leaves} compared)")?,
                Trust::Manifests => {
                    write!(
                        f,
                        "the leaves are the same ({leaves}, by the digests in the manifests)"
                    )?;
                }
            }
            return match self.roots_differ {
                true => write!(f, ", but in other roots, so the cells differ"),
                false => Ok(()),
            };
        }
        let paths: Vec<_> = self.octants.iter().take(OCTANTS_LISTED).map(Octant::path).collect();
        let more = if self.octants.len() > OCTANTS_LISTED { ", ..." } else { "" };
        let (count, paths) = (self.octants.len(), paths.join(", "));
        write!(f, "the leaves differ in {count} of 512 level-3 octants: {paths}{more}")?;
        match &self.leaf {
            Some(leaf) => {
                write!(f, "\n{leaf}")?;
                self.rule.iter().try_for_each(|rule| write!(f, "\n  rule: {rule}"))
            }
            None => {
                write!(f, "\nbut the leaves in them are the same: a manifest contradicts its files")
            }
        }
    }
}

/// Compares two leaf-set directories, each with leaf words or the tree. If their common case is given, facets and rays help to decide which is right.
///
/// # Errors
/// If a directory cannot be read.
pub fn diff(
    a: &Path,
    b: &Path,
    case: Option<&Case>,
    trust: Trust,
) -> Result<DiffReport, ReadError> {
    let mut meshes = [Mesh::open(a)?, Mesh::open(b)?];
    let unknown = |mesh: &Mesh| mesh.manifest.sides == Sides::Unknown;
    let without_sides = NAMES.into_iter().zip(&meshes).find(|(_, set)| unknown(set));
    let without_sides = without_sides.map(|(name, _)| name);
    // The digests in the manifests include the sides.
    let trust = if without_sides.is_some() { Trust::Leaves } else { trust };
    let mask = if without_sides.is_some() { !word::SIDE_BITS } else { u64::MAX };
    let mut contradictions = Vec::new();
    if trust == Trust::Leaves {
        for (name, mesh) in NAMES.into_iter().zip(&mut meshes) {
            if recount(mesh, mask)? {
                contradictions.push(format!(
                    "the manifest of {name} contradicts its leaves: run harness audit on the directory"
                ));
            }
        }
    }
    let [a, b] = meshes;
    let of_manifests = manifests(&a.manifest, &b.manifest);
    let mut report = DiffReport { compared: trust, without_sides, contradictions, ..of_manifests };
    for i in octants_differing(&a.manifest, &b.manifest) {
        if let Some((x, y)) = first_difference(&a, &b, i, mask)? {
            let sides_known = without_sides.is_none();
            report.leaf = Some(rule::leaves(x, y, sides_known, &a.manifest.root));
            if sides_known {
                report.rule = Some(rule(&a, &b, case, (x, y))?);
            }
            break;
        }
    }
    report.check_invariants();
    Ok(report)
}

/// The names of the two meshes.
const NAMES: [&str; 2] = ["A", "B"];

/// Compares two manifests, digests included.
pub fn manifests(a: &Manifest, b: &Manifest) -> DiffReport {
    let octants = octants_differing(a, b).into_iter().map(level_3).collect();
    let compared = Trust::Manifests;
    DiffReport {
        compared,
        leaves: a.leaves,
        fields: fields::differing(a, b),
        roots_differ: a.root != b.root,
        octants,
        ..DiffReport::default()
    }
}

/// Replaces the counts and digests in a manifest by those of the leaves, of whose words only the bits of `mask` count. Returns
/// whether the manifest contradicts the whole words.
fn recount(mesh: &mut Mesh, mask: u64) -> Result<bool, ReadError> {
    let (mut whole, mut masked) = (Tally::default(), Tally::default());
    mesh.visit(&mut |words| {
        words.iter().for_each(|&word| whole.add(word));
        if mask != u64::MAX {
            words.iter().for_each(|&word| masked.add(word & mask));
        }
    })?;
    whole.finish();
    let stated = mesh.manifest.clone();
    mesh.manifest.set_tally(whole);
    let contradicts = mesh.manifest != stated;
    if mask != u64::MAX {
        masked.finish();
        mesh.manifest.set_tally(masked);
    }
    Ok(contradicts)
}

/// Level-3 octants whose digests differ.
fn octants_differing(a: &Manifest, b: &Manifest) -> Vec<usize> {
    let digests = a.octant_digests.iter().zip(&b.octant_digests).enumerate();
    digests.filter(|(_, (x, y))| x != y).map(|(i, _)| i).collect()
}

/// The level-3 octant with this index.
fn level_3(index: usize) -> Octant {
    Octant { corner: word::corner_of((index as u64) << 48), level: 3 }
}

/// The first words of two meshes that differ; `None` for a mesh that has no more leaves.
type Differing = (Option<u64>, Option<u64>);

/// The first words that differ in a level-3 octant, in the bits of `mask`; `None` if the leaves are the same.
fn first_difference(
    a: &Mesh,
    b: &Mesh,
    index: usize,
    mask: u64,
) -> Result<Option<Differing>, ReadError> {
    let words = |mesh: &Mesh| -> Result<Vec<u64>, ReadError> {
        let mut words = mesh.octant(&level_3(index))?;
        words.iter_mut().for_each(|word| *word &= mask);
        Ok(words)
    };
    let (words_a, words_b) = (words(a)?, words(b)?);
    if words_a == words_b {
        return Ok(None);
    }
    let first = words_a.iter().zip(&words_b).take_while(|(x, y)| x == y).count();
    Ok(Some((words_a.get(first).copied(), words_b.get(first).copied())))
}

/// The rule that decides which mesh is right, or why none does.
fn rule(a: &Mesh, b: &Mesh, case: Option<&Case>, (x, y): Differing) -> Result<String, ReadError> {
    let undecided = |why: &str| Ok(why.to_owned());
    if a.manifest.tree != b.manifest.tree {
        return undecided("none: one is a base tree, the other a final mesh");
    }
    let terms = &Terms::of_manifest(&a.manifest);
    if *terms != Terms::of_manifest(&b.manifest) {
        return undecided("none: the inputs differ as listed above, so both meshes may be right");
    }
    let (body, caveat) = match case.map(|case| Body::of(case, &a.manifest)).transpose() {
        Ok(body) => (body, String::new()),
        Err(why) => (None, format!("without the case, because {why}: ")),
    };
    let trees = match (a.tree(), b.tree()) {
        (Err(ReadError::TooLarge(_)), _) | (_, Err(ReadError::TooLarge(_))) => {
            return undecided("unknown: the meshes are too large to be held in memory");
        }
        (of_a, of_b) => [of_a?, of_b?],
    };
    let [a, b] = [(a, &trees[0]), (b, &trees[1])]
        .map(|(mesh, tree)| why::Mesh::of(&mesh.manifest, tree, body.as_ref()).distrusting());
    Ok(caveat + &rule::Dispute { a, b, terms }.rule(x, y))
}
