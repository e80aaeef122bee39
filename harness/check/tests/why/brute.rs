//! The shortest chain by a search among all leaves: slow, simple, and without the search structures of the library.

use std::collections::{HashSet, VecDeque};

use check::checks::Terms;
use contract::case::Case;
use contract::octant::Octant;
use contract::triangle::Triangle;

/// All that decides chains in a mesh whose crossing leaves are kept.
pub struct Brute<'a> {
    pub case: &'a Case,
    pub terms: Terms,
    pub leaves: Vec<Octant>,
}

impl Brute<'_> {
    /// Whether T0 splits an octant.
    pub fn base_splits(&self, octant: &Octant) -> bool {
        let (low, high) = octant.bounds();
        let crossed = || self.case.facets_lattice.iter().any(|f| Triangle::new(f).meets(low, high));
        self.terms.box_that_splits(octant).is_some()
            || octant.level < self.terms.level_surface && crossed()
    }

    /// Whether a leaf forces an octant to split by its layer, and by balance.
    pub fn forces(&self, leaf: &Octant, octant: &Octant) -> (bool, bool) {
        let distance = octant.distance(leaf);
        let reach = i64::from(self.terms.layer_cells_min - 1) * i64::from(leaf.edge());
        let is_finer = leaf.level > octant.level && !octant.contains(leaf);
        (is_finer && distance < reach, is_finer && leaf.level > octant.level + 1 && distance == 0)
    }

    /// Length of the shortest chain from an octant that is split.
    pub fn links(&self, octant: &Octant) -> Option<usize> {
        if self.base_splits(octant) {
            return Some(0);
        }
        let mut seen = HashSet::new();
        let mut queue = VecDeque::from([(*octant, false, 0)]);
        while let Some((octant, is_source, links)) = queue.pop_front() {
            for leaf in &self.leaves {
                let (layer, balance) = self.forces(leaf, &octant);
                // The parent of a source must be split before the layer of the source's level is made.
                let early = !is_source || leaf.level > octant.level + 1;
                let parent = || leaf.ancestor(leaf.level - 1);
                for (forces, is_source) in [(layer && early, true), (balance && early, false)] {
                    if forces && seen.insert((parent(), is_source)) {
                        if self.base_splits(&parent()) {
                            return Some(links + 1);
                        }
                        queue.push_back((parent(), is_source, links + 1));
                    }
                }
            }
        }
        None
    }
}
