//! The common property of balance and layers: a minimum distance of octants from coarse leaves.
//!
//! A leaf of level `l + 1` or finer lies in a split octant of level `l`. So leaves of levels `l + 1` and `l -
//! 1` have a minimum distance iff no leaf of level `l - 1` is nearer than that to a split octant of level `l`.
//! The walk skips a subtree if everything near it is at least as fine as whatever an octant in it requires.

use super::CheckResult;
use contract::lattice::Root;
use contract::neighbourhood::{Neighbourhood, Region};
use contract::octant::Octant;
use contract::tree::{HOLES, Handle, Tree};

/// What is required near an octant: within `margin` level-19 cells of it, no leaf is coarser than these levels.
pub struct Required {
    pub margin: i64,
    /// The level that the octant itself requires.
    pub own: Option<u8>,
    /// The finest level that an octant in it requires.
    pub below: Option<u8>,
}

/// A required minimum distance.
pub struct Clearance<'a, R> {
    /// The mesh.
    pub tree: &'a Tree,
    /// What an octant with this content and level requires, if anything.
    pub requires: R,
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
        self.below(&Trail::new(self.tree), result);
    }

    /// Checks the children of the current octant. One search around all of them comes first; it usually finds nothing, and
    /// usually not even that search is necessary.
    fn below(&self, trail: &Trail, result: &mut CheckResult) {
        let (handle, octant) = (trail.around.centre(), trail.around.octant);
        let children: [Option<Required>; 8] = std::array::from_fn(|digit| {
            let content = self.tree.child(handle, digit as u8, octant.level);
            (self.requires)(content, octant.level + 1)
        });
        let present = || (0..).zip(&children).filter_map(|(digit, of)| Some((digit, of.as_ref()?)));
        let Some(margin) = present().map(|(_, of)| of.margin).max() else { return };
        let bound = present().filter_map(|(_, of)| of.own.or(of.below)).max().unwrap_or(0);
        let around = |(digit, _)| Region::along(&octant.child(digit), [margin; 3]);
        let region = || present().map(around).reduce(Region::hull).expect("a child is present");
        // The level of the coarsest leaf in the region, if it is less than `bound`; otherwise any from `bound` up to that level.
        let wide = trail.wide(margin);
        let mut nearby = wide.coarsest;
        if nearby < bound {
            let found = wide.around.coarsest_within(self.tree, &region(), bound);
            nearby = found.map_or(bound, |leaf| leaf.level);
        }
        for (digit, &Required { margin, own, below }) in present() {
            let (own, is_deep) = (own.filter(|&own| own > nearby), below > Some(nearby));
            if own.is_none() && !is_deep {
                continue;
            }
            let child = trail.child(self.tree, digit);
            if let Some(bound) = own {
                self.report(&child, margin, bound, result);
            }
            if is_deep {
                self.below(&child, result);
            }
        }
    }

    /// Repeats the search for each part of the current octant that has no holes, and reports the first coarse leaf.
    fn report(&self, trail: &Trail, margin: i64, bound: u8, result: &mut CheckResult) {
        let (handle, octant) = (trail.around.centre(), trail.around.octant);
        let wide = &trail.wide(margin).around;
        let mut found = None;
        self.tree.walk_below(octant, handle, &mut |part, content| {
            let is_solid = self.tree.kinds(content) & HOLES == 0;
            if found.is_none() && is_solid {
                found = self.directions.iter().find_map(|axes| {
                    let region = Region::along(&part, axes.map(|axis| axis * margin));
                    let coarse = wide.coarsest_within(self.tree, &region, bound)?;
                    Some((part, coarse))
                });
            }
            found.is_none() && !is_solid
        });
        if let Some((part, coarse)) = found {
            (self.report)([octant, part, coarse], result);
        }
    }
}

/// Reports leaves of level l + 1 or finer within `margin(l)` level-19 cells of a leaf coarser than level l + 1 - `levels`. The margin must not increase
/// with the level, and is `None` from the first level on that has none.
pub fn check_gap(
    tree: &Tree,
    (root, what): (&Root, &str),
    margin: impl Fn(u8) -> Option<i64>,
    directions: &[[i64; 3]],
    levels: u8,
    result: &mut CheckResult,
) {
    let requires = |handle: Handle, level: u8| {
        let margin = handle.is_node().then(|| margin(level))??;
        let finest = tree.finest_level(handle, level);
        let below = (finest > level + 1).then(|| finest.saturating_sub(levels));
        Some(Required { margin, own: Some((level + 1).saturating_sub(levels)), below })
    };
    let report = |[split, part, coarse]: [Octant; 3], result: &mut CheckResult| {
        let (level, [part, coarse]) =
            (split.level, [part, coarse].map(|octant| root.place(octant)));
        result.report(format_args!(
            "{what}: {part} is refined beyond level {level}, but too near to the leaf {coarse}"
        ));
    };
    Clearance { tree, requires, directions, report: &report }.check(result);
}

/// The neighbourhood of the current octant of a walk, and those of all octants above it.
pub struct Trail<'a> {
    /// The neighbourhood.
    pub around: Neighbourhood,
    /// The level of its coarsest leaf.
    coarsest: u8,
    above: Option<&'a Self>,
}

impl Trail<'_> {
    /// A walk at the root.
    pub fn new(tree: &Tree) -> Self {
        let around = Neighbourhood::root(tree);
        Self { around, coarsest: around.coarsest_level(tree), above: None }
    }

    /// The walk at a child.
    pub fn child(&self, tree: &Tree, digit: u8) -> Trail<'_> {
        let around = self.around.child(tree, digit);
        Trail { around, coarsest: around.coarsest_level(tree), above: Some(self) }
    }

    /// The smallest neighbourhood that contains everything within this distance of the current octant.
    fn wide(&self, margin: i64) -> &Self {
        match self.above {
            Some(above) if i64::from(self.around.octant.edge()) < margin => above.wide(margin),
            _ => self,
        }
    }

    /// Whether a predicate of content and level holds for octants that contain everything within `margin` of the current octant.
    pub fn all_nearby(&self, margin: i64, predicate: impl Fn(Handle, u8) -> bool) -> bool {
        let wide = &self.wide(margin).around;
        wide.handles.iter().all(|&handle| predicate(handle, wide.octant.level))
    }
}
