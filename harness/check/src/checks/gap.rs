//! The common property of balance and layers: a minimum distance of split octants from coarse leaves.
//!
//! A leaf of level `l + 1` or finer lies in a split octant of level `l`. So leaves of levels `l + 1` and `l -
//! 1` have a minimum distance iff no leaf of level `l - 1` is nearer than that to a split octant of level `l`.
//! The walk visits all split octants. It skips a subtree if its finest leaf is at most one level finer than the
//! coarsest leaf nearby.

use super::CheckResult;
use super::trail::Trail;
use contract::lattice::Root;
use contract::octant::Octant;
use contract::tree::{HOLES, Handle, Region, Tree};

/// A required minimum distance.
pub struct Gap<'a> {
    /// The mesh.
    pub tree: &'a Tree,
    /// For coordinates in findings.
    pub root: &'a Root,
    /// Minimum distance from split octants of a level, in level-19 cells; `None` from the first level on that
    /// has none. It must not increase with the level.
    pub margin: &'a dyn Fn(u8) -> Option<i64>,
    /// The axes along which the margin extends a split octant, for each region that coarse leaves must not meet.
    pub directions: &'a [[i64; 3]],
    /// Levels by which a leaf may be coarser than one within the margin: 1 for the ratio 2:1.
    pub levels: u8,
    /// Name of a violation.
    pub what: &'a str,
}

impl Gap<'_> {
    /// Reports every split octant that is too near to a coarse leaf.
    pub fn check(&self, result: &mut CheckResult) {
        self.check_children(&mut Trail::new(self.tree), result);
    }

    /// Checks the split children of the current octant. All children are tested together first, which mostly
    /// suffices.
    fn check_children(&self, trail: &mut Trail, result: &mut CheckResult) {
        let (handle, octant) = (trail.current().centre(), trail.current().octant);
        let level = octant.level + 1;
        let Some(margin) = (self.margin)(level) else {
            return;
        };
        let split = trail.select_children(self.tree, Handle::is_node);
        if split == 0 {
            return;
        }
        let region = Region::around_children(&octant, split, margin);
        // A leaf of level l + 1 or finer lies in a split octant of level l.
        let bound = (level + 1).saturating_sub(self.levels);
        let nearby = trail.coarsest_nearby(self.tree, margin, &region, bound);
        for digit in (0..8).filter(|d| split >> d & 1 == 1) {
            let child = self.tree.child(handle, digit, octant.level);
            // The neighbourhood of the children contains that of each child, which contains those of the
            // grandchildren.
            let deep = self.tree.finest_level(child, level) > nearby.max(bound) + self.levels;
            if nearby < bound || deep {
                trail.descend(self.tree, digit);
                if nearby < bound {
                    self.confirm(trail, child, margin, bound, result);
                }
                if deep {
                    self.check_children(trail, result);
                }
                trail.ascend();
            }
        }
    }

    /// Repeats the search for each part of the octant that has no holes, and reports the first coarse leaf.
    fn confirm(
        &self,
        trail: &Trail,
        handle: Handle,
        margin: i64,
        bound: u8,
        result: &mut CheckResult,
    ) {
        let split = trail.current().octant;
        solid_parts(self.tree, handle, split, &mut |part| {
            let mut found = self.directions.iter().filter_map(|axes| {
                let region = Region::along(&part, axes.map(|axis| axis * margin));
                trail.search(self.tree, margin, &region, bound).leaf(self.tree)
            });
            if let Some(coarse) = found.next() {
                result.report_with(|| {
                    let (what, part) = (self.what, self.root.describe(&part));
                    format!(
                        "{what}: {part} is refined beyond level {}, but too near to the leaf {}",
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

/// The margin along all axes at once: a Chebyshev distance.
pub const ALL_AXES: [[i64; 3]; 1] = [[1, 1, 1]];

/// Visits the largest octants without holes until `visit` returns false. Returns whether all visits returned true.
fn solid_parts(
    tree: &Tree,
    handle: Handle,
    octant: Octant,
    visit: &mut dyn FnMut(Octant) -> bool,
) -> bool {
    let kinds = tree.kinds(handle);
    if kinds & HOLES == 0 {
        return kinds == 0 || visit(octant);
    }
    let child = |d: u8| (tree.child(handle, d, octant.level), octant.child(d));
    !handle.is_node()
        || (0..8).map(child).all(|(handle, octant)| solid_parts(tree, handle, octant, visit))
}
