//! What balance and layers have in common: octants that are split must keep their distance from
//! leaves coarser than themselves.
//!
//! A leaf of level `l + 1` or more lies in an octant of level `l` that is split, so "leaves of
//! level `l + 1` and `l - 1` are so far apart" is "no leaf of level `l - 1` so near to a split
//! octant of level `l`". Walks all split octants; a subtree is passed over where even its finest
//! leaf is at most one level below the coarsest leaf anywhere near.

use super::CheckResult;
use contract::lattice::Root;
use contract::octant::Octant;
use contract::tree::{Coarsest, HOLES, Handle, Hood, Region, Tree};

/// A promise of distance.
pub struct Gap<'a> {
    /// The mesh.
    pub tree: &'a Tree,
    /// For coordinates in findings.
    pub root: &'a Root,
    /// Distance promised to split octants of a level, in level-19 cells; nothing where none is, nor at
    /// deeper levels. Must not grow with the level.
    pub margin: &'a dyn Fn(u8) -> Option<i64>,
    /// What a violation is called.
    pub what: &'a str,
}

impl Gap<'_> {
    /// Looks at every split octant and reports those too near to a coarse leaf.
    pub fn check(&self, result: &mut CheckResult) {
        self.children(&mut Trail::new(self.tree), result);
    }

    /// Looks at the split children of where the walk is, first all at once: mostly that is enough.
    fn children(&self, trail: &mut Trail, result: &mut CheckResult) {
        let (at, octant) = (trail.here().centre(), trail.here().octant);
        let level = octant.level + 1;
        let Some(margin) = (self.margin)(level) else {
            return;
        };
        let split = trail.children(self.tree, Handle::is_node);
        if split == 0 {
            return;
        }
        let region = Region::around_children(&octant, split, margin);
        let nearby = trail.coarsest_nearby(self.tree, margin, &region, level);
        for digit in (0..8).filter(|d| split >> d & 1 == 1) {
            let child = self.tree.child(at, digit, octant.level);
            // What is near a child is near all of them, and what is near a grandchild is near the
            // child.
            let deep = self.tree.finest_level(child, level) > nearby.max(level) + 1;
            if nearby < level || deep {
                trail.descend(self.tree, digit);
                if nearby < level {
                    self.confirm(trail, child, margin, result);
                }
                if deep {
                    self.children(trail, result);
                }
                trail.ascend();
            }
        }
    }

    /// Where parts of the octant are holes, only what is left of it counts.
    fn confirm(&self, trail: &Trail, at: Handle, margin: i64, result: &mut CheckResult) {
        let split = trail.here().octant;
        solid_parts(self.tree, at, split, &mut |part| {
            let region = Region::around(&part, margin);
            let found = trail.search(self.tree, margin, &region, split.level);
            if let Some(coarse) = found.leaf(self.tree) {
                result.find_with(|| {
                    let (what, part) = (self.what, self.root.describe(&part));
                    format!(
                        "{what}: {part} is refined beyond level {}, but near it is a leaf, {}",
                        split.level,
                        self.root.describe(&coarse)
                    )
                });
                return false;
            }
            true
        });
    }
}

/// Visits the largest octants without holes; stops when told to, and says so.
fn solid_parts(
    tree: &Tree,
    at: Handle,
    octant: Octant,
    visit: &mut dyn FnMut(Octant) -> bool,
) -> bool {
    let kinds = tree.kinds(at);
    if kinds & HOLES == 0 {
        return kinds == 0 || visit(octant);
    }
    !at.is_node()
        || (0..8)
            .all(|d| solid_parts(tree, tree.child(at, d, octant.level), octant.child(d), visit))
}

/// The hoods from the root down to where a walk is.
pub struct Trail {
    /// One per level, with the level of the coarsest leaf in it.
    hoods: Vec<(Hood, u8)>,
}

impl Trail {
    /// A walk about to begin.
    pub fn new(tree: &Tree) -> Self {
        let root = Hood::root(tree);
        Self { hoods: vec![(root, root.coarsest_level(tree))] }
    }

    /// Where the walk is.
    pub fn here(&self) -> &Hood {
        &self.hoods.last().expect("a walk begins at the root").0
    }

    /// The children here that are wanted, one bit for each digit. A leaf has none.
    pub fn children(&self, tree: &Tree, wanted: impl Fn(Handle) -> bool) -> u8 {
        let (at, level) = (self.here().centre(), self.here().octant.level);
        if !at.is_node() {
            return 0;
        }
        let fit = (0..8).filter(|&d| wanted(tree.child(at, d, level)));
        fit.fold(0, |all, d| all | 1 << d)
    }

    /// On to a child.
    pub fn descend(&mut self, tree: &Tree, digit: u8) {
        let hood = self.here().child(tree, digit);
        self.hoods.push((hood, hood.coarsest_level(tree)));
    }

    /// Back to the parent.
    pub fn ascend(&mut self) {
        self.hoods.pop();
    }

    /// The smallest hood that holds everything within this distance.
    fn wide(&self, margin: i64) -> &(Hood, u8) {
        let fits = |(hood, _): &&(Hood, u8)| i64::from(hood.octant.edge()) >= margin;
        self.hoods.iter().rev().find(fits).unwrap_or(&self.hoods[0])
    }

    /// Level of the coarsest leaf in a region that is at most `margin` around here, exact where it is
    /// coarser than `enough`; else a level from `enough` up to that.
    pub fn coarsest_nearby(&self, tree: &Tree, margin: i64, region: &Region, enough: u8) -> u8 {
        let (_, coarsest) = self.wide(margin);
        if *coarsest >= enough {
            *coarsest
        } else {
            self.search(tree, margin, region, enough).level
        }
    }

    /// The coarsest leaf in a region that is at most `margin` around here, if coarser than `enough`.
    pub fn search(&self, tree: &Tree, margin: i64, region: &Region, enough: u8) -> Coarsest {
        self.wide(margin).0.coarsest_within(tree, region, enough)
    }
}
