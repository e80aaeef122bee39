//! Kept and deleted leaves tile the root.
//!
//! Sections 5 and 7 of reference/DEFINITION.md. With T0 the check is exact: leaves fill every kept T0 leaf,
//! every deleted T0 leaf is empty, those in enclosed components included, and no leaf is coarser than T0. Without T0 the boundary of every hole must
//! be one that deletion can leave: a leaf lacks a neighbour across a face only if the definition may delete the
//! neighbours of such a leaf. Without T0 the check cannot detect a missing leaf if all leaves around it may
//! lack neighbours, for example a crossing leaf among crossing leaves.

use std::fmt::Write;

use super::contact::{self, Contacts};
use super::{CheckResult, Subject, Terms};
use contract::manifest::Keep;
use contract::octant::Octant;
use contract::tree::{HOLES, Handle, Kind, Tree};
use contract::word::{self, Side};

const NAME: &str = "complete";

/// Compares the mesh with T0. Without T0, checks the boundaries of holes.
pub fn check(subject: &Subject) -> CheckResult {
    let tree = subject.tree();
    let mut result = match subject.tree_base() {
        Some(base) => {
            let (terms, result) = (&subject.terms, CheckResult::new(NAME));
            let mut pair = Pair { tree, base, terms, enclosed: enclosed(subject), result };
            pair.compare(tree.root(), base.root(), Octant::ROOT);
            pair.result
        }
        None => check_holes(tree, &subject.terms),
    };
    result.examined = subject.mesh.words.len() as u64;
    let leaves = subject.mesh.words.iter().filter(|&&w| word::fault(w).is_none());
    let volume: u128 = leaves.map(|&w| u128::from(word::span(word::level(w)))).sum();
    let fraction = volume as f64 / word::KEY_END as f64;
    let _ = write!(result.note, "the mesh fills {:.6} % of the root", 100.0 * fraction);
    result
}

impl Terms {
    /// Whether a leaf may have a deleted neighbour across a face.
    fn may_face_hole(&self, kind: Kind, level: u8) -> bool {
        match (self.keep_crossing, self.keep) {
            (true, Keep::All) => false,
            // Crossing leaves separate the sides, so only they can have deleted neighbours.
            (true, _) => kind == Side::Crossing as Kind,
            // Crossing leaves are deleted, and every leaf that touched one is at least as fine as the surface.
            (false, _) => level >= self.level_surface,
        }
    }
}

/// Checks the boundaries of holes, from the leaves only.
pub fn check_holes(tree: &Tree, terms: &Terms) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    if tree.root() == Handle::HOLE {
        // A body that fills the root leaves an empty mesh, unless nothing is ever deleted.
        if terms.keep == Keep::All && terms.keep_crossing {
            result.report("the mesh has no leaves, although nothing is deleted".to_owned());
        }
        return result;
    }
    let matters = |kind: Kind, level: u8| !terms.may_face_hole(kind, level);
    Contacts { tree, sought: HOLES, matters: &matters }.visit(&mut |octant, kind, across| {
        if across & HOLES != 0 {
            result.report_with(|| {
                let (side, leaf) = (contact::name(1 << kind), terms.root.describe(&octant));
                format!("the {side} leaf {leaf} has a hole across a face")
            });
        }
    });
    result
}

/// The leaves of T0 in enclosed components, sorted.
fn enclosed(subject: &Subject) -> Vec<u64> {
    let Some((words, components)) = subject.components() else { return Vec::new() };
    let leaves = components.iter().filter(|c| c.enclosed).flat_map(|c| &c.leaves);
    let mut enclosed: Vec<u64> = leaves.map(|&i| words[i as usize]).collect();
    enclosed.sort_unstable();
    enclosed
}

/// The final tree and T0, traversed together.
struct Pair<'a> {
    tree: &'a Tree,
    base: &'a Tree,
    terms: &'a Terms,
    /// Leaves of T0 that are deleted whatever their side.
    enclosed: Vec<u64>,
    result: CheckResult,
}

impl Pair<'_> {
    fn compare(&mut self, handle: Handle, base: Handle, octant: Octant) {
        if let Some(kind) = base.as_leaf() {
            self.compare_leaf(handle, kind, octant);
        } else if base == Handle::HOLE {
            self.report("T0 does not tile the root; it has no leaf in", octant);
        } else if handle.as_leaf().is_some() {
            self.report("a leaf is coarser than T0:", octant);
        } else {
            let level = octant.level;
            for d in 0..8 {
                let (handle, base) =
                    (self.tree.child(handle, d, level), self.base.child(base, d, level));
                self.compare(handle, base, octant.child(d));
            }
        }
    }

    /// Compares the content of the mesh with a T0 leaf.
    fn compare_leaf(&mut self, handle: Handle, kind: Kind, octant: Octant) {
        let leaf =
            word::key_of(octant.corner) << 7 | u64::from(octant.level) << 2 | u64::from(kind);
        let enclosed = self.enclosed.binary_search(&leaf).is_ok();
        let keeps = self.terms.keeps(kind) && !enclosed;
        if enclosed && handle != Handle::HOLE {
            self.report("an enclosed T0 leaf still exists, at least in part:", octant);
        } else if !keeps && handle != Handle::HOLE {
            self.report("a T0 leaf that must be deleted still exists, at least in part:", octant);
        } else if keeps && self.tree.kinds(handle) & HOLES != 0 {
            let hole = self.first_hole(handle, octant);
            self.report("the mesh has a hole:", hole);
        }
    }

    /// The first hole in an octant that has one.
    fn first_hole(&self, handle: Handle, octant: Octant) -> Octant {
        let child = |d| (self.tree.child(handle, d, octant.level), octant.child(d));
        let has_hole = |&(handle, _): &(Handle, Octant)| self.tree.kinds(handle) & HOLES != 0;
        match handle.is_node().then(|| (0..8).map(child).find(has_hole)).flatten() {
            Some((handle, octant)) => self.first_hole(handle, octant),
            None => octant,
        }
    }

    fn report(&mut self, what: &str, octant: Octant) {
        let root = &self.terms.root;
        self.result.report_with(|| format!("{what} {}", root.describe(&octant)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::case::Case;
    use contract::testing::{leaf_set, words_with_sides};

    #[test]
    fn the_note_states_which_part_of_the_root_is_filled() {
        let text =
            "spacing_min = 4.0\nkeep = 'all'\nroot = { origin = [0.0, 0.0, 0.0], edge = 8.0 }\n";
        let facet = [[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [0.5, 1.5, 0.5]];
        let case = Case::from_parts(text, vec![facet]).unwrap();
        for (lacks, percent) in [("", "100.000000"), ("7", "87.500000"), ("3.7", "98.437500")] {
            let side = |o: &Octant| (o.path() != lacks).then_some(Side::Outside);
            let words = words_with_sides(|o| o.level == 0 || o.path() == "3", side);
            let result = check(&Subject::new(&case, &leaf_set(vec![words])));
            assert_eq!(result.note, format!("the mesh fills {percent} % of the root"));
        }
    }

    #[test]
    fn a_mesh_without_leaves_is_a_finding_if_nothing_is_ever_deleted() {
        let manifest = leaf_set(vec![]).manifest;
        for (keep, keep_crossing, findings) in
            [(Keep::All, true, 1), (Keep::All, false, 0), (Keep::Outside, true, 0)]
        {
            let terms = Terms { keep, keep_crossing, ..Terms::of_manifest(&manifest) };
            assert_eq!(check_holes(&Tree::default(), &terms).findings_total, findings);
        }
    }
}
