//! The differences of two meshes: of their inputs and counts, and of the leaves in the first octant that differs. If the sides of
//! one are unknown, only the cells are compared.
//!
//! All leaves are read once, to count and digest them, with memory for one buffer, from the parts or the tree. A comparison that trusts the digests in the
//! manifests reads only the first octant that differs.

pub mod fields;
mod mesh;
mod region;
pub mod rule;
mod witness;

use std::fmt;
use std::path::Path;

use crate::checks::Terms;
use contract::case::Case;
use contract::leafset::ReadError;
use contract::manifest::{Manifest, Sides, Tally};
use contract::octant::Octant;
use contract::word;
use mesh::Mesh;

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
    /// Level-3 octants whose digests differ.
    pub octants: Vec<Octant>,
    /// The first difference of the leaves, with the leaves of both meshes.
    pub leaf: Option<String>,
    /// The rules of the definition that decide which mesh is right.
    pub rules: Vec<String>,
}

/// Maximum number of leaves of both meshes together for which rules are sought: the search needs both in memory.
const LEAVES_RULED: u64 = 200_000_000;

impl DiffReport {
    /// Whether the leaves are the same.
    pub fn same_leaves(&self) -> bool {
        self.octants.is_empty()
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
            return match self.compared {
                Trust::Leaves => write!(f, "the leaves are the same ({leaves} compared)"),
                Trust::Manifests => {
                    write!(f, "the leaves are the same ({leaves}, by the digests in the manifests)")
                }
            };
        }
        let paths: Vec<_> = self.octants.iter().take(OCTANTS_LISTED).map(Octant::path).collect();
        let more = if self.octants.len() > OCTANTS_LISTED { ", ..." } else { "" };
        let (count, paths) = (self.octants.len(), paths.join(", "));
        write!(f, "the leaves differ in {count} of 512 level-3 octants: {paths}{more}")?;
        match &self.leaf {
            Some(leaf) => {
                write!(f, "\n{leaf}")?;
                self.rules.iter().try_for_each(|rule| write!(f, "\n  rule: {rule}"))
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
                report.rules = rules(&a, &b, case, x, y)?;
            }
            break;
        }
    }
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
        octants,
        ..DiffReport::default()
    }
}

/// Replaces the counts and digests in a manifest by those of the leaves, of whose words only the bits of `mask` count. Returns
/// whether the manifest contradicts the whole words.
fn recount(mesh: &mut Mesh, mask: u64) -> Result<bool, ReadError> {
    let (mut whole, mut masked) = (Tally::default(), Tally::default());
    mesh.visit(|words| {
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
        let mut words = mesh.octant(index)?;
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

/// The rules that decide which mesh is right.
fn rules(
    a: &Mesh,
    b: &Mesh,
    case: Option<&Case>,
    x: Option<u64>,
    y: Option<u64>,
) -> Result<Vec<String>, ReadError> {
    let undecided = |why: &str| Ok(vec![why.to_owned()]);
    if a.manifest.tree != b.manifest.tree {
        return undecided("none: one is a base tree, the other a final mesh");
    }
    if Terms::of_manifest(&a.manifest) != Terms::of_manifest(&b.manifest) {
        return undecided("none: the inputs differ as listed above, so both meshes may be right");
    }
    if a.manifest.leaves + b.manifest.leaves > LEAVES_RULED {
        return undecided("unknown: the meshes are too large to be held in memory");
    }
    let (words_a, words_b) = (a.words()?, b.words()?);
    let terms = Terms::of_manifest(&a.manifest);
    Ok(rule::Dispute { a: &words_a, b: &words_b, terms: &terms, case }.rule(x, y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::{leaf_set, words_of};

    fn written(words: Vec<u64>) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        leaf_set(vec![words]).write(dir.path()).unwrap();
        dir
    }

    #[test]
    fn without_the_sides_of_one_mesh_the_cells_are_compared() {
        let words = words_of(|o| o.level < 2);
        let with_sides = words.iter().map(|word| word | 1).collect();
        let (a, b) = (written(with_sides), written(words.clone()));
        let compare = || diff(a.path(), b.path(), None, Trust::Manifests).unwrap();
        assert!(!compare().same_leaves());
        let unknown = |mut set: contract::leafset::LeafSet| {
            set.manifest.sides = Sides::Unknown;
            set.write(b.path()).unwrap();
        };
        unknown(leaf_set(vec![words.clone()]));
        let same = compare();
        assert!(same.same_leaves(), "{same}");
        assert!(same.to_string().starts_with("the sides of B are unknown"), "{same}");
        unknown(leaf_set(vec![words[1..].to_vec()]));
        let other = compare();
        assert!(!other.same_leaves() && other.rules.is_empty(), "{other}");
    }

    #[test]
    fn the_octants_that_differ_are_listed_up_to_eight() {
        let octants: Vec<Octant> = (0..8).map(level_3).collect();
        let mut report =
            DiffReport { octants, leaf: Some("a leaf".to_owned()), ..DiffReport::default() };
        report.rules = vec!["one".to_owned(), "two".to_owned()];
        report.fields = vec!["a field".to_owned()];
        let eight = "0.0.0, 0.0.1, 0.0.2, 0.0.3, 0.0.4, 0.0.5, 0.0.6, 0.0.7";
        let expected = format!(
            "a field\nthe leaves differ in 8 of 512 level-3 octants: {eight}\na leaf\n  rule: one\n  rule: two"
        );
        assert_eq!(report.to_string(), expected);
        report.octants.push(level_3(511));
        report.leaf = None;
        let contradiction = "but the leaves in them are the same: a manifest contradicts its files";
        let expected = format!(
            "a field\nthe leaves differ in 9 of 512 level-3 octants: {eight}, ...\n{contradiction}"
        );
        assert_eq!(report.to_string(), expected);
        let same = DiffReport { compared: Trust::Manifests, leaves: 5, ..DiffReport::default() };
        assert_eq!(
            same.to_string(),
            "the leaves are the same (5, by the digests in the manifests)"
        );
    }

    #[test]
    fn the_first_difference_is_found_in_any_octant_and_part() {
        let words = words_of(|o| o.level < 3);
        for index in [0, 100, 511] {
            let mut changed = words.clone();
            changed[index] |= 1;
            // Three parts, which interleave.
            let mut parts = vec![Vec::new(); 3];
            changed.iter().enumerate().for_each(|(i, &word)| parts[i % 3].push(word));
            let (a, b) = (written(words.clone()), tempfile::tempdir().unwrap());
            leaf_set(parts).write(b.path()).unwrap();
            for trust in [Trust::Leaves, Trust::Manifests] {
                let found = diff(a.path(), b.path(), None, trust).unwrap();
                assert_eq!((found.octants, found.leaves), (vec![level_3(index)], 512));
                let octant = word::octant(words[index]);
                let leaf = leaf_set(vec![]).manifest.root.describe(&octant);
                let text = format!(
                    "first difference:\n  A has outside leaf: {leaf}\n  B has inside leaf: {leaf}"
                );
                assert_eq!(found.leaf, Some(text));
                assert_eq!(
                    found.rules,
                    ["section 4 (side): give the case file (--case) to decide it"]
                );
                assert_eq!(found.contradictions, [""; 0]);
            }
        }
        // A mesh that ends early.
        let (a, b) = (written(words.clone()), written(words[..511].to_vec()));
        let found = diff(a.path(), b.path(), None, Trust::Leaves).unwrap();
        assert!(found.leaf.unwrap().ends_with("\n  B has no more leaves"));
    }

    #[test]
    fn leaves_of_both_meshes_decide_about_a_split() {
        // Leaves of level 3 in octant 0.1 touch octant 1.
        let refined = |o: &Octant| o.level == 0 || "0.1".starts_with(&o.path());
        let (a, b) =
            (written(words_of(refined)), written(words_of(|o| refined(o) || o.path() == "1")));
        let found = diff(a.path(), b.path(), None, Trust::Leaves).unwrap();
        let [rule] = &found.rules[..] else { panic!("{found}") };
        assert!(rule.contains("step 3 (balance)") && rule.ends_with("B is right"), "{rule}");
    }

    #[test]
    fn meshes_of_other_inputs_or_trees_are_not_judged() {
        let words = words_of(|o| o.level < 1);
        let (a, b) = (written(words.clone()), tempfile::tempdir().unwrap());
        let rules = |change: fn(&mut Manifest)| {
            let mut set = leaf_set(vec![words.iter().map(|word| word | 1).collect()]);
            change(&mut set.manifest);
            set.write(b.path()).unwrap();
            diff(a.path(), b.path(), None, Trust::Leaves).unwrap().rules.concat()
        };
        assert!(rules(|_| ()).starts_with("section 4"));
        assert!(
            rules(|m| m.tree = contract::manifest::Tree::Base)
                .starts_with("none: one is a base tree")
        );
        assert!(rules(|m| m.layer_cells_min = 2).starts_with("none: the inputs differ"));
    }

    #[test]
    fn a_leaf_that_its_manifest_does_not_show_is_found_unless_manifests_are_trusted() {
        let words = words_of(|o| o.level < 2);
        let (a, b) = (written(words.clone()), written(words.clone()));
        let compare = |trust| diff(a.path(), b.path(), None, trust).unwrap();
        assert!(compare(Trust::Leaves).contradictions.is_empty());
        assert_eq!(compare(Trust::Leaves).to_string(), "the leaves are the same (64 compared)");

        let manifest = std::fs::read(b.path().join("mesh.json")).unwrap();
        let mut changed = words;
        changed[9] |= 1;
        leaf_set(vec![changed]).write(b.path()).unwrap();
        std::fs::write(b.path().join("mesh.json"), manifest).unwrap();
        assert!(compare(Trust::Manifests).same_leaves());
        let found = compare(Trust::Leaves);
        assert!(!found.same_leaves() && found.leaf.is_some());
        assert!(found.to_string().contains("manifest of B contradicts"), "{found}");
    }
}
