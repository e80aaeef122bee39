//! Kept and deleted leaves tile the root.
//!
//! Sections 5 and 7 of reference/DEFINITION.md. With T0 the check is exact: where a T0 leaf is
//! kept, leaves fill it without a gap; where one is deleted, there is nothing; nothing is coarser
//! than T0. Without T0 every hole must be bounded as deletion leaves it: a leaf's neighbour across
//! a face is missing only where the definition deletes the neighbours of such a leaf. Without T0 it
//! misses leaves dropped from among others whose neighbours may be missing, as crossing leaves may
//! be all around another.

use std::fmt::Write;

use super::contact::{self, Contacts};
use super::{CheckResult, Subject, Terms};
use contract::manifest::Keep;
use contract::octant::Octant;
use contract::tree::{HOLES, Handle, Kind, Tree};
use contract::word::{self, Side};

const NAME: &str = "complete";

/// Checks against T0, or where there is none, that holes are bounded as they may be.
pub fn check(subject: &Subject) -> CheckResult {
    let tree = subject.tree();
    let mut result = match subject.tree_base() {
        Some(base) => {
            let mut pair =
                Pair { tree, base, terms: &subject.terms, result: CheckResult::new(NAME) };
            pair.compare(tree.root(), base.root(), Octant::ROOT);
            pair.result
        }
        None => check_holes(tree, &subject.terms),
    };
    result.examined = subject.mesh.words.len() as u64;
    let spans = subject.mesh.words.iter().filter(|&&w| word::fault(w).is_none());
    let volume: u128 = spans.map(|&w| u128::from(word::span(word::level(w)))).sum();
    let share = volume as f64 / word::KEY_END as f64;
    let _ = write!(result.note, "the mesh fills {:.6} % of the root", 100.0 * share);
    result
}

impl Terms {
    /// Whether leaves of this kind belong in the final mesh.
    pub fn keeps(&self, kind: Kind) -> bool {
        match self.keep {
            _ if kind == Side::Crossing as Kind => self.keep_crossing,
            Keep::Outside => kind == Side::Outside as Kind,
            Keep::Inside => kind == Side::Inside as Kind,
            Keep::All => true,
        }
    }

    /// Whether a leaf may have a deleted neighbour across a face.
    fn may_face_hole(&self, kind: Kind, level: u8) -> bool {
        match (self.keep_crossing, self.keep) {
            (true, Keep::All) => false,
            // Sides are parted by crossing leaves, so only those can lose neighbours.
            (true, _) => kind == Side::Crossing as Kind,
            // Crossing leaves are gone, and all that touches them is at least as fine as the surface.
            (false, _) => level >= self.level_surface,
        }
    }
}

/// What can be said of the leaves alone.
pub fn check_holes(tree: &Tree, terms: &Terms) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    if tree.root() == Handle::HOLE {
        // Everything deleted is a mesh too, if something can be: a body that fills the root.
        if terms.keep == Keep::All && terms.keep_crossing {
            result.find("no leaves at all, though nothing is deleted".to_owned());
        }
        return result;
    }
    let matters = |kind: Kind, level: u8| !terms.may_face_hole(kind, level);
    Contacts { tree, sought: HOLES, matters: &matters }.visit(&mut |octant, kind, across| {
        if across & HOLES != 0 {
            result.find_with(|| {
                let (side, leaf) = (contact::name(1 << kind), terms.root.describe(&octant));
                format!("the {side} leaf {leaf} has a hole across a face")
            });
        }
    });
    result
}

/// The final tree and T0, walked together.
struct Pair<'a> {
    tree: &'a Tree,
    base: &'a Tree,
    terms: &'a Terms,
    result: CheckResult,
}

impl Pair<'_> {
    fn compare(&mut self, at: Handle, base: Handle, octant: Octant) {
        if let Some(kind) = base.as_leaf() {
            self.compare_leaf(at, kind, octant);
        } else if base == Handle::HOLE {
            self.find("T0 does not tile the root: nothing in", octant);
        } else if at.as_leaf().is_some() {
            self.find("a leaf is coarser than T0:", octant);
        } else {
            let level = octant.level;
            for d in 0..8 {
                let (at, base) = (self.tree.child(at, d, level), self.base.child(base, d, level));
                self.compare(at, base, octant.child(d));
            }
        }
    }

    /// What the mesh has in place of a T0 leaf.
    fn compare_leaf(&mut self, at: Handle, kind: Kind, octant: Octant) {
        let keeps = self.terms.keeps(kind);
        if !keeps && at != Handle::HOLE {
            self.find("a deleted T0 leaf is still there, whole or in part:", octant);
        } else if keeps && self.tree.kinds(at) & HOLES != 0 {
            let hole = self.first_hole(at, octant);
            self.find("nothing where the mesh should be:", hole);
        }
    }

    /// A largest hole in an octant that has one.
    fn first_hole(&self, at: Handle, octant: Octant) -> Octant {
        let child = |d| (self.tree.child(at, d, octant.level), octant.child(d));
        let holed = |&(at, _): &(Handle, Octant)| self.tree.kinds(at) & HOLES != 0;
        match at.is_node().then(|| (0..8).map(child).find(holed)).flatten() {
            Some((at, octant)) => self.first_hole(at, octant),
            None => octant,
        }
    }

    fn find(&mut self, what: &str, octant: Octant) {
        let root = &self.terms.root;
        self.result.find_with(|| format!("{what} {}", root.describe(&octant)));
    }
}
