//! The position of a depth-first walk, with the neighbourhoods of all ancestors.

use contract::tree::{Coarsest, Handle, Neighbourhood, Region, Tree};

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

    /// The children of the current octant that satisfy a predicate, one bit per digit. A leaf has none.
    pub fn select_children(&self, tree: &Tree, predicate: impl Fn(Handle) -> bool) -> u8 {
        let (handle, level) = (self.current().centre(), self.current().octant.level);
        if !handle.is_node() {
            return 0;
        }
        let selected = (0..8).filter(|&d| predicate(tree.child(handle, d, level)));
        selected.fold(0, |all, d| all | 1 << d)
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

    /// Level of the coarsest leaf in a region within `margin` of the current octant, if it is coarser than
    /// `bound`; otherwise a level that is at least `bound` and at most that of the coarsest leaf.
    pub fn coarsest_nearby(&self, tree: &Tree, margin: i64, region: &Region, bound: u8) -> u8 {
        let (_, coarsest) = self.wide(margin);
        if *coarsest >= bound { *coarsest } else { self.search(tree, margin, region, bound).level }
    }

    /// The coarsest leaf in a region within `margin` of the current octant, if it is coarser than `bound`.
    pub fn search(&self, tree: &Tree, margin: i64, region: &Region, bound: u8) -> Coarsest {
        self.wide(margin).0.coarsest_within(tree, region, bound)
    }
}
