//! The common property of balance and layers: a minimum distance of octants from coarse leaves.
//!
//! A leaf of level `l + 1` or finer lies in a split octant of level `l`. So leaves of levels `l + 1` and `l -
//! 1` have a minimum distance iff no leaf of level `l - 1` is nearer than that to a split octant of level `l`.
//! The walk skips a subtree if no coarse leaf is near the box around what requires anything in it. Such boxes are found once per distinct octant, and
//! those around coarse leaves, too: a layer ends at the minimum distance, so octants themselves would nearly always be too near.

use super::CheckResult;
use contract::lattice::Root;
use contract::neighbourhood::{Neighbourhood, OFFSETS, Region};
use contract::octant::Octant;
use contract::tree::{HOLES, Handle, Tree};
use std::cell::RefCell;

/// What is required near an octant: within `margin` level-19 cells of it, no leaf is coarser than a level.
pub struct Required {
    pub margin: i64,
    /// Whether the octant itself requires that, or only octants in it.
    pub by_itself: bool,
}

/// A required minimum distance.
pub struct Clearance<'a, R> {
    /// The mesh.
    pub tree: &'a Tree,
    /// What an octant with this content and level requires, if anything.
    pub requires: R,
    /// The level that is required near them.
    pub bound: u8,
    /// The axes along which the margin extends an octant, for each region that coarse leaves must not meet.
    pub directions: &'a [[i64; 3]],
    /// Reports a violation: of an octant, by the leaves in a part of it, and the coarse leaf.
    pub report: &'a dyn Fn([Octant; 3], &mut CheckResult),
}

/// The margin along all axes at once: a Chebyshev distance.
pub const ALL_AXES: [[i64; 3]; 1] = [[1, 1, 1]];

impl<R: Fn(Handle, u8) -> Option<Required>> Clearance<'_, R> {
    /// Reports every octant other than the root that is too near to a coarse leaf.
    pub fn check(&self, result: &mut CheckResult) {
        let requires = |handle, level| (self.requires)(handle, level).map(|of| of.by_itself);
        let is_coarse = |handle: Handle, level| {
            (self.tree.coarsest_level(handle, level) < self.bound).then_some(!handle.is_node())
        };
        let boxes = [Boxes::new(self.tree, &requires), Boxes::new(self.tree, &is_coarse)];
        self.below(&Trail::new(self.tree), (Octant::ROOT, self.tree.root), &boxes, result);
    }

    /// Checks an octant in the octant of the trail, which is the same or has at least the margin as edge.
    fn below(&self, trail: &Trail, at: Place, boxes: &[Boxes; 2], result: &mut CheckResult) {
        let Some(Required { margin, by_itself }) = (self.requires)(at.1, at.0.level) else {
            return;
        };
        let (wide, near) = (&trail.wide(margin).around, boxes[0].around(at, margin));
        let is_near = near.is_some_and(|region| boxes[1].first_in(wide, &region).is_some());
        if at.0.level > 0 && !is_near {
            return;
        }
        if by_itself {
            return self.report(wide, at, margin, &boxes[1], result);
        }
        for digit in 0..8 {
            let child = child(self.tree, at, digit);
            match trail.around.octant == at.0 && i64::from(child.0.edge()) >= margin {
                true => self.below(&trail.child(self.tree, digit), child, boxes, result),
                false => self.below(trail, child, boxes, result),
            }
        }
    }

    /// Repeats the search for each part of an octant that has no holes, and reports the first coarse leaf.
    fn report(
        &self,
        wide: &Neighbourhood,
        (octant, handle): Place,
        margin: i64,
        coarse: &Boxes,
        result: &mut CheckResult,
    ) {
        let mut found = None;
        self.tree.walk_below(octant, handle, &mut |part, content| {
            let is_solid = self.tree.kinds(content) & HOLES == 0;
            if found.is_none() && is_solid {
                found = self.directions.iter().find_map(|axes| {
                    let region = Region::around(&part, Region::WHOLE, axes.map(|a| a * margin));
                    Some((part, coarse.first_in(wide, &region)?))
                });
            }
            found.is_none() && !is_solid
        });
        if let Some((part, coarse)) = found {
            (self.report)([octant, part, coarse], result);
        }
    }
}

/// An octant with its content.
type Place = (Octant, Handle);

fn child(tree: &Tree, (octant, handle): Place, digit: u8) -> Place {
    (octant.child(digit), tree.child(handle, digit, octant.level))
}

/// One more than the level for which a box was sought, and the box.
type Known = (u8, Option<[[u8; 3]; 2]>);

/// Boxes around those parts of octants that matter.
struct Boxes<'a> {
    tree: &'a Tree,
    /// Whether all of an octant with some content and level matters, or only parts of it; `None` if nothing does.
    matters: &'a dyn Fn(Handle, u8) -> Option<bool>,
    /// By the index of a node. Equal octants seldom have two levels.
    known: RefCell<Vec<Known>>,
}

impl<'a> Boxes<'a> {
    fn new(tree: &'a Tree, matters: &'a dyn Fn(Handle, u8) -> Option<bool>) -> Self {
        Self { tree, matters, known: RefCell::new(vec![Default::default(); tree.nodes()]) }
    }

    /// The box in an octant, in 256ths of its edge.
    fn of(&self, at: Place) -> Option<[[u8; 3]; 2]> {
        let (Octant { level, .. }, handle) = at;
        if (self.matters)(handle, level)? {
            return Some(Region::WHOLE);
        }
        let (sought, known) = self.known.borrow()[handle.index()];
        if sought == level + 1 {
            return known;
        }
        let mut found: Option<[[u8; 3]; 2]> = None;
        for digit in 0..8 {
            let Some(part) = self.of(child(self.tree, at, digit)) else { continue };
            let [low, high] = part.map(|c| [0, 1, 2].map(|a| c[a] / 2 + 128 * (digit >> a & 1)));
            let [from, to] = found.unwrap_or([low, high]);
            let ends = |a: usize| [from[a].min(low[a]), to[a].max(high[a])];
            found = Some([0, 1].map(|end| [0, 1, 2].map(|a| ends(a)[end])));
        }
        self.known.borrow_mut()[handle.index()] = (level + 1, found);
        found
    }

    fn around(&self, at: Place, margin: i64) -> Option<Region> {
        Some(Region::around(&at.0, self.of(at)?, [margin; 3]))
    }

    /// The first leaf that matters in the 27 octants and whose interior meets a region.
    fn first_in(&self, around: &Neighbourhood, region: &Region) -> Option<Octant> {
        around.handles.iter().zip(OFFSETS.iter()).find_map(|(&handle, &offset)| {
            // Little matters, which is known without the octant.
            (self.matters)(handle, around.octant.level)?;
            self.first_below((around.octant.neighbour(offset)?, handle), region)
        })
    }

    fn first_below(&self, at: Place, region: &Region) -> Option<Octant> {
        let is_leaf = (self.matters)(at.1, at.0.level)?;
        match self.around(at, 0)?.overlaps(region) {
            false => None,
            true if is_leaf => Some(at.0.ancestor(self.tree.coarsest_level(at.1, at.0.level))),
            true => (0..8).find_map(|digit| self.first_below(child(self.tree, at, digit), region)),
        }
    }
}

/// Reports leaves of level l + 1 or finer within `margin(l)` level-19 cells of a leaf coarser than level l + 1 - `levels`, for each l in turn: so the
/// margin of a large octant is that of the small ones in it, and the walk ends above them. The margin is `None` from the first level on that has none.
pub fn check_gap(
    tree: &Tree,
    (root, what): (&Root, &str),
    margin: impl Fn(u8) -> Option<i64>,
    directions: &[[i64; 3]],
    levels: u8,
    result: &mut CheckResult,
) {
    let report = |[split, part, coarse]: [Octant; 3], result: &mut CheckResult| {
        let (level, [part, coarse]) = (split.level, [part, coarse].map(|at| root.place(at)));
        result.report(format_args!(
            "{what}: {part} is refined beyond level {level}, but too near to the leaf {coarse}"
        ));
    };
    for split in 0..tree.finest_level(tree.root, 0) {
        let Some(margin) = margin(split) else { break };
        let requires = |handle: Handle, level: u8| {
            let has_split = level <= split && tree.finest_level(handle, level) > split;
            has_split.then_some(Required { margin, by_itself: level == split })
        };
        let bound = (split + 1).saturating_sub(levels);
        Clearance { tree, requires, bound, directions, report: &report }.check(result);
    }
}

/// The neighbourhood of the current octant of a walk, and those of all octants above it.
pub struct Trail<'a> {
    /// The neighbourhood.
    pub around: Neighbourhood,
    above: Option<&'a Self>,
}

impl Trail<'_> {
    /// A walk at the root.
    pub fn new(tree: &Tree) -> Self {
        Self { around: Neighbourhood::root(tree), above: None }
    }

    /// The walk at a child.
    pub fn child(&self, tree: &Tree, digit: u8) -> Trail<'_> {
        Trail { around: self.around.child(tree, digit), above: Some(self) }
    }

    /// The smallest neighbourhood that contains everything within this distance of the current octant.
    pub fn wide(&self, margin: i64) -> &Self {
        match self.above {
            Some(above) if i64::from(self.around.octant.edge()) < margin => above.wide(margin),
            _ => self,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::random_words;
    use contract::word;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_coarse_leaf_in_a_region_is_found_as_by_a_linear_search(
            words in random_words(3), at in any::<prop::sample::Index>(), margin in 0i64..200_000, bound in 1u8..5,
        ) {
            prop_assume!(!words.is_empty());
            let tree = Tree::of_words(&words);
            let octant = word::octant(words[at.index(words.len())]);
            let meets = |leaf: &Octant| (0..3).all(|a| {
                let [from, to] = [octant, *leaf].map(|o| i64::from(o.corner[a]));
                to < from + i64::from(octant.edge()) + margin && from - margin < to + i64::from(leaf.edge())
            });
            let is_coarse = |handle: Handle, level| {
                (tree.coarsest_level(handle, level) < bound).then_some(!handle.is_node())
            };
            let region = Region::around(&octant, Region::WHOLE, [margin; 3]);
            let found = Boxes::new(&tree, &is_coarse).first_in(&Neighbourhood::root(&tree), &region);
            let near = |leaf: &Octant| leaf.level < bound && meets(leaf);
            prop_assert_eq!(found, words.iter().map(|&w| word::octant(w)).find(near));
        }
    }
}
