//! The differences of two meshes: of their inputs and counts, and of the leaves in the first octant that differs. If the sides of
//! one are unknown, only the cells are compared.
//!
//! All leaves are read once, to count and digest them, with memory for one buffer, from the parts or the tree; then the first octant of level 3 that
//! differs. Words that are not a linear oct-tree are refused.

mod rule;

use std::fmt;
use std::path::Path;

use crate::checks::identical::Named;
use crate::checks::manifest::{differing, differing_inputs};

use crate::why;
use contract::case::Case;
use contract::failure::Result;
use contract::htg::Block;
use contract::manifest::Sides;
use contract::mesh::Mesh;
use contract::octant::Octant;
use contract::word;

/// The differences of two leaf sets.
#[derive(Clone, Debug, Default)]
pub struct DiffReport {
    /// The mesh whose sides are unknown, so that only the cells were compared.
    pub without_sides: Option<&'static str>,
    /// Number of leaves of the first mesh.
    pub leaves: u64,
    /// Manifest fields that differ, with both values.
    pub fields: Vec<String>,
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

    /// Whether the meshes are the same: their leaves and, to the last bit, their roots.
    pub fn same_mesh(&self) -> bool {
        self.same_leaves() && !self.fields.iter().any(|field| field.starts_with("root: "))
    }
}

impl fmt::Display for DiffReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(mesh) = self.without_sides {
            writeln!(f, "the sides of {mesh} are unknown: only the cells are compared")?;
        }
        self.fields.iter().try_for_each(|line| writeln!(f, "{line}"))?;
        match (self.same_leaves(), self.same_mesh()) {
            (true, true) => write!(f, "the leaves are the same ({} compared)", self.leaves)?,
            (true, false) => {
                write!(f, "the leaves are the same, but in other roots, so the cells differ")?
            }
            _ => write!(f, "the leaves differ in {} of 512 level-3 octants", self.octants.len())?,
        }
        self.leaf.iter().try_for_each(|leaf| write!(f, "\n{leaf}"))?;
        self.rule.iter().try_for_each(|rule| write!(f, "\n  rule: {rule}"))
    }
}

/// Counts in a manifest, the last three of which follow from the sides.
const COUNTS: [&str; 5] =
    ["leaves", "leaves_by_level", "components", "components_ambiguous", "leaves_by_side"];

/// Compares two leaf-set directories, each with leaf words or the tree. If their common case is given, facets and rays help to decide which is right.
///
/// # Errors
/// If a directory cannot be read.
pub fn diff(a: &Path, b: &Path, case: Option<&Case>) -> Result<DiffReport> {
    let [mut a, mut b] = [Mesh::open(a)?, Mesh::open(b)?];
    let unknown = |(_, mesh): &(&str, &Mesh)| mesh.manifest.sides == Sides::Unknown;
    let without_sides = [("A", &a), ("B", &b)].into_iter().find(unknown).map(|(name, _)| name);
    let mask = if without_sides.is_some() { !word::SIDE_BITS } else { u64::MAX };
    for mesh in [&mut a, &mut b] {
        let mut manifest = mesh.manifest.clone();
        manifest.clear_leaves();
        mesh.visit(&mut |_, blocks| {
            let masked = blocks.iter().map(|b| Block { first: b.first & mask, ..*b });
            masked.for_each(|block| _ = manifest.add_block(&block));
            Ok(())
        })?;
        mesh.manifest = manifest;
    }
    let (of_a, of_b) = (("A", &a.manifest), ("B", &b.manifest));
    // What follows from the sides is left out if a mesh has none.
    let counts = if without_sides.is_some() { &COUNTS[..2] } else { &COUNTS[..] };
    let digests = a.manifest.octant_digests.iter().zip(&b.manifest.octant_digests);
    let octants = (0..).zip(digests).filter(|(_, (x, y))| x != y);
    let mut report = DiffReport {
        without_sides,
        leaves: a.manifest.leaves,
        fields: [differing_inputs(of_a, of_b), differing(counts, of_a, of_b)].concat(),
        octants: octants.map(|(index, _)| word::octant(index << 55 | 3 << 2)).collect(),
        ..DiffReport::default()
    };
    if let Some(octant) = report.octants.first() {
        let (of_a, of_b) = (a.octant(octant)?, b.octant(octant)?);
        let masked = |of: &Vec<u64>, at: usize| of.get(at).map(|word| word & mask);
        let mut pairs = (0..).map(|at| [masked(&of_a, at), masked(&of_b, at)]);
        let [x, y] = pairs.find(|[x, y]| x != y).expect("the digests of the octant differ");
        let root = a.manifest.root;
        // Of two leaves apart, the other mesh lacks the first; what it has further on, both may have.
        let is_apart = |x, y| word::key(x) >= word::key(y) + word::span(word::level(y));
        let is_beyond = |x, y: Option<u64>| y.is_some_and(|y| is_apart(x, y));
        let text = |word: Option<u64>, other| match word.filter(|&word| !is_beyond(word, other)) {
            Some(word) if without_sides.is_some() => root.place(word::octant(word)).to_string(),
            Some(word) => Named(Some(word), root).to_string(),
            None => "no leaf there".to_owned(),
        };
        report.leaf =
            Some(format!("first difference:\n  A has {}\n  B has {}", text(x, y), text(y, x)));
        report.rule = without_sides.is_none().then(|| rule(&a, &b, case, [x, y]));
    }
    Ok(report)
}

/// The rule that decides which mesh is right, or why none does, from the first words that differ; `None` for a mesh that has no more leaves.
fn rule(a: &Mesh, b: &Mesh, case: Option<&Case>, [x, y]: [Option<u64>; 2]) -> String {
    if [a, b].iter().any(|mesh| mesh.manifest.lacks_inputs) {
        return "none: a mesh states no inputs, from which all leaves follow: import both with --case".to_owned();
    }
    if !differing_inputs(("A", &a.manifest), ("B", &b.manifest)).is_empty() {
        return "none: the inputs differ as listed above, so both meshes may be right".to_owned();
    }
    // The inputs of both are the same, as far as both state them.
    let stating = if a.manifest.geometry.is_some() { a } else { b };
    let (body, caveat) = match case.map(|case| why::body(case, &stating.manifest)).transpose() {
        Ok(body) => (body, String::new()),
        Err(why) => (None, format!("without the case, because {why}: ")),
    };
    let (of_a, of_b) = match (a.tree(), b.tree()) {
        (Ok(a), Ok(b)) => (a, b),
        (Err(why), _) | (_, Err(why)) => return format!("unknown: {why}"),
    };
    let [a, b] = [(a, &of_a), (b, &of_b)]
        .map(|(mesh, tree)| why::Mesh::of(&mesh.manifest, tree, body.as_ref()));
    caveat + &rule::at(&a, &b, x, y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::import::ImportedTree;
    use contract::leafset::{self, LeafSet};
    use contract::manifest::{Geometry, Manifest, octant_index};
    use contract::testing::{leaf_set, random_words, words_of};
    use proptest::prelude::*;

    /// The level-3 octant with this index.
    fn level_3(index: u64) -> Octant {
        Octant { corner: word::corner_of(index << 48), level: 3 }
    }

    fn written(words: Vec<u64>) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        leaf_set(vec![words]).write(dir.path()).unwrap();
        dir
    }

    #[test]
    fn what_a_manifest_does_not_state_is_named_as_such() {
        let [a, b] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let mut set = leaf_set(vec![words_of(|o| o.level < 1)]);
        set.manifest.components = Some(Default::default());
        set.write(a.path()).unwrap();
        set.manifest.components = None;
        set.write(b.path()).unwrap();
        let fields = diff(a.path(), b.path(), None).unwrap().fields;
        assert!(fields.iter().any(|f| f.ends_with("in A; not stated in B")), "{fields:?}");
    }

    #[test]
    fn without_the_sides_of_one_mesh_the_cells_are_compared() {
        let words = words_of(|o| o.level < 2);
        let with_sides = words.iter().map(|word| word | 1).collect();
        let (a, b) = (written(with_sides), written(words.clone()));
        let compare = || diff(a.path(), b.path(), None).unwrap();
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
        assert!(!other.same_leaves() && other.rule.is_none(), "{other}");
        let leaf = other.leaf.expect("the first difference");
        assert!(!leaf.contains("outside") && !leaf.contains("inside"), "{leaf}");
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
            let found = diff(a.path(), b.path(), None).unwrap();
            assert_eq!((found.octants, found.leaves), (vec![level_3(index as u64)], 512));
            let octant = word::octant(words[index]);
            let leaf = leaf_set(vec![]).manifest.root.place(octant).to_string();
            let text = format!(
                "first difference:\n  A has outside leaf: {leaf}\n  B has inside leaf: {leaf}"
            );
            assert_eq!(found.leaf, Some(text));
            assert_eq!(
                found.rule.unwrap(),
                "section 4 (side): give the case file (--case) to decide it"
            );
        }
        // A mesh with a hole: what follows it is in both.
        let fine = words_of(|o| o.level < 4);
        let holed = written([&fine[..801], &fine[802..]].concat());
        let found = diff(written(fine).path(), holed.path(), None).unwrap();
        assert!(found.leaf.unwrap().ends_with("\n  B has no leaf there"));
        // A mesh that ends early.
        let (a, b) = (written(words.clone()), written(words[..511].to_vec()));
        let found = diff(a.path(), b.path(), None).unwrap();
        assert!(found.leaf.unwrap().ends_with("\n  B has no leaf there"));
    }

    #[test]
    fn meshes_of_other_inputs_or_trees_are_not_judged() {
        let words = words_of(|o| o.level < 1);
        let (a, b) = (written(words.clone()), tempfile::tempdir().unwrap());
        let rules = |change: fn(&mut Manifest)| {
            let mut set = leaf_set(vec![words.iter().map(|word| word | 1).collect()]);
            change(&mut set.manifest);
            set.write(b.path()).unwrap();
            diff(a.path(), b.path(), None).unwrap().rule.unwrap()
        };
        assert!(rules(|_| ()).starts_with("section 4"));
        assert!(
            rules(|m| m.tree = contract::manifest::Tree::Base)
                .starts_with("none: the inputs differ")
        );
        assert!(rules(|m| m.layer_cells_min = 2).starts_with("none: the inputs differ"));
    }

    /// Of a mesh in the format of another program, the geometry is unknown.
    #[test]
    fn a_case_of_another_geometry_judges_neither_mesh() {
        let case = |z: f32| {
            let text = "spacing_min = 2.0\nroot = { origin = [0.0, 0.0, 0.0], edge = 8.0 }";
            Case::from_parts(text, vec![[[1.0, 1.0, z], [5.0, 1.0, z], [1.0, 5.0, z]]]).unwrap()
        };
        let (own, other) = (case(1.0), case(5.0));
        let written = |geometry, side: u64| {
            let place = tempfile::tempdir().unwrap();
            let words = words_of(|o| o.level < 2).iter().map(|word| word | side).collect();
            let inputs = own.manifest(contract::manifest::Tree::Final, "test".to_owned());
            let set = LeafSet::new(Manifest { geometry, ..inputs }, Vec::new());
            set.with_parts(vec![words]).write(place.path()).unwrap();
            place
        };
        let (a, b) = (written(None, 0), written(Some(Geometry::of(&own.facets_lattice)), 1));
        for [a, b] in [[a.path(), b.path()], [b.path(), a.path()]] {
            let rule = |case: &Case| diff(a, b, Some(case)).unwrap().rule.unwrap();
            assert!(rule(&own).contains("is right"), "{}", rule(&own));
            assert!(rule(&other).starts_with("without the case"), "{}", rule(&other));
        }
    }

    #[test]
    fn a_leaf_that_its_manifest_does_not_show_is_found() {
        let words = words_of(|o| o.level < 2);
        let (a, b) = (written(words.clone()), written(words.clone()));
        let compare = || diff(a.path(), b.path(), None).unwrap();
        assert_eq!(compare().to_string(), "the leaves are the same (64 compared)");

        let manifest = std::fs::read(b.path().join("mesh.json")).unwrap();
        let mut changed = words;
        changed[9] |= 1;
        leaf_set(vec![changed]).write(b.path()).unwrap();
        std::fs::write(b.path().join("mesh.json"), manifest).unwrap();
        let found = compare();
        assert!(!found.same_leaves() && found.leaf.is_some());
    }

    #[test]
    fn a_tree_is_compared_with_parts_like_other_parts() {
        let sample = Path::new("../contract/tests/samples/sphere.vtkhdf");
        let open = ImportedTree::open(sample, None, None, None, "test".to_owned());
        let imported = open.unwrap().expect("a tree");
        let place = tempfile::tempdir().unwrap();
        let [tree, parts] = ["tree", "parts"].map(|name| place.path().join(name));
        std::fs::create_dir(&tree).unwrap();
        imported.link(&tree).unwrap();
        imported.create(&parts).unwrap();
        let compared = |a: &Path, b: &Path| diff(a, b, None).unwrap();
        let same = compared(&tree, &parts);
        assert!(same.same_leaves() && same.leaves == 9056, "{same}");
        let set = leafset::read(&parts).unwrap();
        for at in [0, 5000, 9055] {
            let mut words = set.words.clone();
            words[at] = (words[at] & !3) | (((words[at] & 3) + 1) % 3);
            let changed = tempfile::tempdir().unwrap();
            set.with_parts(vec![words]).write(changed.path()).unwrap();
            for [a, b] in [[tree.as_path(), changed.path()], [changed.path(), &tree]] {
                let found = compared(a, b);
                assert_eq!(found.octants, [level_3(octant_index(set.words[at]) as u64)], "{found}");
                let leaf = set.manifest.root.place(word::octant(set.words[at])).to_string();
                let text = found.leaf.as_ref().expect("the first difference");
                assert_eq!(text.matches(&leaf).count(), 2, "{text}");
            }
        }
    }

    /// The buffer has 65,536 words.
    #[test]
    fn a_part_larger_than_the_buffer_is_read_to_its_end() {
        let words = words_of(|o| o.level < 5 || o.level < 6 && o.corner[2] < 1 << 17);
        assert!(words.len() > 1 << 16, "{}", words.len());
        let mut changed = words.clone();
        *changed.last_mut().unwrap() |= 1;
        let (a, b) = (written(words.clone()), written(changed));
        let compared = |b: &Path| diff(a.path(), b, None).unwrap();
        let same = compared(a.path());
        assert_eq!((same.same_leaves(), same.leaves), (true, words.len() as u64));
        let found = compared(b.path());
        assert_eq!(found.octants, vec![level_3(511)]);
        assert_eq!(
            found.rule.unwrap(),
            "section 4 (side): give the case file (--case) to decide it"
        );
    }

    proptest! {
        #[test]
        fn a_drawn_change_is_found_at_its_first_leaf(words in random_words(3), at in any::<prop::sample::Index>(), way in 0..3) {
            prop_assume!(!words.is_empty());
            let (i, mut changed) = (at.index(words.len()), words.clone());
            match way {
                0 => changed[i] = changed[i] & !3 | (changed[i] + 1) & 1,
                1 => drop(changed.remove(i)),
                _ => {}
            }
            let (a, b) = (written(words.clone()), written(changed.clone()));
            let report = diff(a.path(), b.path(), None).unwrap();
            prop_assert_eq!(report.same_leaves(), changed == words);
            prop_assert_eq!(report.same_mesh(), changed == words);
            if changed != words {
                let octant = word::octant(words[i]);
                let leaf = report.leaf.unwrap();
                prop_assert!(leaf.contains(&octant.path()), "{}", leaf);
            }
        }
    }

    #[test]
    fn meshes_in_different_roots_differ() {
        let words = words_of(|o| o.level < 2);
        let (a, b) = (written(words.clone()), tempfile::tempdir().unwrap());
        let mut moved = leaf_set(vec![words]);
        moved.manifest.root.edge = moved.manifest.root.edge.next_up();
        moved.write(b.path()).unwrap();
        let report = diff(a.path(), b.path(), None).unwrap();
        assert!(report.same_leaves() && !report.same_mesh(), "{report}");
        assert!(
            report.to_string().ends_with("but in other roots, so the cells differ"),
            "{report}"
        );
    }

    #[test]
    fn words_that_are_no_linear_tree_are_refused() {
        let words = words_of(|o| o.level < 2);
        let good = written(words.clone());
        let mut overlapping = words.clone();
        overlapping.insert(1, words[0]);
        for bad in [[&words[1..], &words[..1]].concat(), overlapping] {
            let bad = written(bad);
            for (a, b) in [(&good, &bad), (&bad, &good), (&bad, &bad)] {
                let error = diff(a.path(), b.path(), None).unwrap_err();
                assert!(error.to_string().contains("not a linear oct-tree"), "{error}");
            }
        }
    }
}
