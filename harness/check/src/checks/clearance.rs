//! The common property of balance and layers: a minimum distance of octants from coarse leaves.
//!
//! A leaf of level `l + 1` or finer lies in a split octant of level `l`. So leaves of levels `l + 1` and `l -
//! 1` have a minimum distance iff no leaf of level `l - 1` is nearer than that to a split octant of level `l`.
//! The walk skips a subtree if everything near it is finer than whatever an octant in it requires.

use super::CheckResult;
use contract::lattice::Root;
use contract::octant::Octant;
use contract::tree::{Coarsest, HOLES, Handle, Neighbourhood, Region, Tree};

/// What is required near an octant: within `margin` level-19 cells of it, no leaf is coarser than level `bound`.
#[derive(Clone, Copy)]
pub struct Required {
    pub margin: i64,
    pub bound: u8,
}

/// A required minimum distance.
pub struct Clearance<'a> {
    /// The mesh.
    pub tree: &'a Tree,
    /// What an octant with this content and level requires, if anything.
    pub of: &'a dyn Fn(Handle, u8) -> Option<Required>,
    /// The most that it or an octant in it requires; `None` if nothing.
    pub within: &'a dyn Fn(Handle, u8) -> Option<Required>,
    /// The axes along which the margin extends an octant, for each region that coarse leaves must not meet.
    pub directions: &'a [[i64; 3]],
    /// A violation as text: of an octant, by the leaves in a part of it, and the coarse leaf.
    pub text: &'a dyn Fn(&Octant, &Octant, &Octant) -> String,
}

/// The margin along all axes at once: a Chebyshev distance.
pub const ALL_AXES: [[i64; 3]; 1] = [[1, 1, 1]];

impl Clearance<'_> {
    /// Reports every octant that is too near to a coarse leaf.
    pub fn check(&self, result: &mut CheckResult) {
        self.below(&mut Trail::new(self.tree), result);
    }

    fn below(&self, trail: &mut Trail, result: &mut CheckResult) {
        let (handle, octant) = (trail.current().centre(), trail.current().octant);
        let required = (self.of)(handle, octant.level);
        if let Some(required) = required.filter(|&of| trail.has_coarser(self.tree, &octant, of)) {
            self.report(trail, required, result);
        }
        if !handle.is_node() {
            return;
        }
        let within = |digit: u8| {
            let content = self.tree.child(handle, digit, octant.level);
            (self.within)(content, octant.level + 1)
        };
        // One search around all children comes first; it usually finds nothing.
        let most = (0..8).filter_map(within).reduce(|a, b| Required {
            margin: a.margin.max(b.margin),
            bound: a.bound.max(b.bound),
        });
        if !most.is_some_and(|most| trail.has_coarser(self.tree, &octant, most)) {
            return;
        }
        for digit in 0..8 {
            let child = octant.child(digit);
            if within(digit).is_some_and(|most| trail.has_coarser(self.tree, &child, most)) {
                trail.descend(self.tree, digit);
                self.below(trail, result);
                trail.ascend();
            }
        }
    }

    /// Repeats the search for each part of the current octant that has no holes, and reports the first coarse leaf.
    fn report(
        &self,
        trail: &Trail,
        Required { margin, bound }: Required,
        result: &mut CheckResult,
    ) {
        let (handle, octant) = (trail.current().centre(), trail.current().octant);
        let mut found = None;
        self.tree.walk_below(octant, handle, &mut |part, content| {
            let is_solid = self.tree.kinds(content) & HOLES == 0;
            if found.is_none() && is_solid {
                found = self.directions.iter().find_map(|axes| {
                    let region = Region::along(&part, axes.map(|axis| axis * margin));
                    let coarse = trail.search(self.tree, margin, &region, bound).leaf(self.tree)?;
                    Some((part, coarse))
                });
            }
            found.is_none() && !is_solid
        });
        if let Some((part, coarse)) = found {
            result.report_with(|| (self.text)(&octant, &part, &coarse));
        }
    }
}

/// Reports leaves of level l + 1 or finer within `margin(l)` level-19 cells of a leaf coarser than level l + 1 - `levels`. The margin must not increase
/// with the level, and is `None` from the first level on that has none.
pub fn check_gap(
    tree: &Tree,
    (root, what): (&Root, &str),
    margin: &dyn Fn(u8) -> Option<i64>,
    directions: &[[i64; 3]],
    levels: u8,
    result: &mut CheckResult,
) {
    let of = |handle: Handle, level: u8| {
        let bound = (level + 1).saturating_sub(levels);
        margin(level).filter(|_| handle.is_node()).map(|margin| Required { margin, bound })
    };
    let within = |handle: Handle, level: u8| {
        let finest = (level..tree.finest_level(handle, level)).rev().find(|&l| margin(l).is_some());
        let bound = (finest? + 1).saturating_sub(levels);
        Some(Required { margin: margin(level)?, bound })
    };
    let text = |split: &Octant, part: &Octant, coarse: &Octant| {
        let [part, coarse] = [part, coarse].map(|octant| root.describe(octant));
        let level = split.level;
        format!("{what}: {part} is refined beyond level {level}, but too near to the leaf {coarse}")
    };
    Clearance { tree, of: &of, within: &within, directions, text: &text }.check(result);
}

/// The neighbourhoods of all octants from the root to the current octant of a walk.
pub struct Trail {
    /// One neighbourhood per level, with the level of its coarsest leaf.
    neighbourhoods: Vec<(Neighbourhood, u8)>,
}

impl Trail {
    /// A walk at the root.
    pub fn new(tree: &Tree) -> Self {
        let root = Neighbourhood::root(tree);
        Self { neighbourhoods: vec![(root, root.coarsest_level(tree))] }
    }

    /// The neighbourhood of the current octant.
    pub fn current(&self) -> &Neighbourhood {
        &self.neighbourhoods.last().expect("the root is never left").0
    }

    /// Moves to a child.
    pub fn descend(&mut self, tree: &Tree, digit: u8) {
        let neighbourhood = self.current().child(tree, digit);
        self.neighbourhoods.push((neighbourhood, neighbourhood.coarsest_level(tree)));
    }

    /// Moves to the parent.
    pub fn ascend(&mut self) {
        self.neighbourhoods.pop();
    }

    /// The smallest neighbourhood that contains everything within this distance of the current octant.
    fn wide(&self, margin: i64) -> &(Neighbourhood, u8) {
        let fits = |(neighbourhood, _): &&(Neighbourhood, u8)| {
            i64::from(neighbourhood.octant.edge()) >= margin
        };
        self.neighbourhoods.iter().rev().find(fits).unwrap_or(&self.neighbourhoods[0])
    }

    /// Whether a predicate of content and level holds for octants that contain everything within `margin` of the current octant.
    pub fn all_nearby(&self, margin: i64, predicate: impl Fn(Handle, u8) -> bool) -> bool {
        let (wide, _) = self.wide(margin);
        wide.handles.iter().all(|&handle| predicate(handle, wide.octant.level))
    }

    /// Whether a leaf within `margin` of the current octant or of a child of it is coarser than `bound`.
    fn has_coarser(
        &self,
        tree: &Tree,
        octant: &Octant,
        Required { margin, bound }: Required,
    ) -> bool {
        let region = Region::around(octant, margin);
        self.wide(margin).1 < bound && self.search(tree, margin, &region, bound).level < bound
    }

    /// The coarsest leaf in a region within `margin` of the current octant, if it is coarser than `bound`.
    pub fn search(&self, tree: &Tree, margin: i64, region: &Region, bound: u8) -> Coarsest {
        self.wide(margin).0.coarsest_within(tree, region, bound)
    }
}
