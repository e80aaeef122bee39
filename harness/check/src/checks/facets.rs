//! The facets that meet octants, found by descent with shrinking lists.

use contract::lattice::FacetLattice;
use contract::octant::Octant;
use contract::tree::{Kind, Tree};
use contract::triangle::Triangle;

/// Facets, prepared for any number of walks.
#[derive(Debug)]
pub struct Facets(Vec<Triangle>);

impl Facets {
    /// Prepares facets.
    pub fn new(facets: &[FacetLattice]) -> Self {
        Self(facets.iter().map(Triangle::new).collect())
    }

    /// The indices of all facets.
    pub fn all(&self) -> Vec<u32> {
        (0..u32::try_from(self.0.len()).expect("fewer than 2^32 facets")).collect()
    }

    /// Those of some facets that share a point with a closed octant that is enlarged by `margin` lattice units on all sides.
    pub fn meeting(&self, of: &[u32], octant: &Octant, margin: i64) -> impl Iterator<Item = u32> {
        let (low, high) = octant.bounds();
        let (low, high) = (low.map(|c| c - margin), high.map(|c| c + margin));
        of.iter().copied().filter(move |&i| self.0[i as usize].meets(low, high))
    }

    /// Visits octants in Morton order, parents first, each with the facets that meet it if it is enlarged by `margin` lattice units on all
    /// sides: the root, and the children of octants for which `enter` returns true.
    pub fn walk(&self, margin: i64, enter: &mut dyn FnMut(Octant, &[u32]) -> bool) {
        self.walk_below(Octant::ROOT, &self.all(), margin, enter);
    }

    /// Visits every leaf in Morton order, with the facets that meet it.
    pub fn leaves(&self, tree: &Tree, visit: &mut dyn FnMut(Octant, Kind, &[u32])) {
        self.walk(0, &mut |octant, near| {
            let handle = tree.at(&octant);
            if let Some(kind) = handle.as_leaf() {
                visit(octant, kind, near);
            }
            handle.is_node()
        });
    }

    fn walk_below(
        &self,
        octant: Octant,
        candidates: &[u32],
        margin: i64,
        enter: &mut dyn FnMut(Octant, &[u32]) -> bool,
    ) {
        let near: Vec<u32> = self.meeting(candidates, &octant, margin).collect();
        if enter(octant, &near) {
            (0..8).for_each(|digit| self.walk_below(octant.child(digit), &near, margin, enter));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::words_of;
    use contract::word;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_walk_visits_octants_with_the_facets_that_meet_them_or_their_margin(
            facets in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(0i64..1 << 27)), 0..3),
            margin in 0i64..1 << 24,
        ) {
            let mut visited = Vec::new();
            Facets::new(&facets).walk(margin, &mut |octant, near| {
                let (low, high) = octant.bounds();
                let (low, high) = (low.map(|c| c - margin), high.map(|c| c + margin));
                let meeting = (0..).zip(&facets).filter(|(_, facet)| Triangle::new(facet).meets(low, high));
                assert_eq!(near, meeting.map(|(i, _)| i).collect::<Vec<u32>>(), "{octant}");
                if octant.level == 2 {
                    visited.push(octant);
                }
                octant.level < 2
            });
            let all: Vec<Octant> = words_of(|o| o.level < 2).into_iter().map(word::octant).collect();
            prop_assert_eq!(visited, all);
        }
    }
}
