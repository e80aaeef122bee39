//! The octants of a mesh that facets cross, found by descent through the sorted words with shrinking lists of
//! facets.

use contract::lattice::FacetLattice;
use contract::octant::Octant;
use contract::triangle::Triangle;
use contract::word;

/// An octant that is a leaf or contains leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Visit {
    /// The leaf with this index.
    Leaf(usize),
    /// A split octant.
    Split,
}

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

    /// Those of some facets that share a point with a closed box.
    pub fn meeting(&self, candidates: &[u32], low: [i64; 3], high: [i64; 3]) -> Vec<u32> {
        candidates.iter().copied().filter(|&i| self.0[i as usize].meets(low, high)).collect()
    }

    /// The first of some facets that shares a point with a closed box.
    pub fn first_meeting(&self, candidates: &[u32], low: [i64; 3], high: [i64; 3]) -> Option<u32> {
        candidates.iter().copied().find(|&i| self.0[i as usize].meets(low, high))
    }

    /// Visits every octant that is a leaf or contains leaves, parents first, with whether a facet crosses it.
    /// The words must be sorted leaves without overlap.
    pub fn walk(&self, words: &[u64], visit: &mut dyn FnMut(Visit, &Octant, bool)) {
        self.descend(words, 0, Octant::ROOT, &self.all(), visit);
    }

    fn descend(
        &self,
        words: &[u64],
        first: usize,
        octant: Octant,
        candidates: &[u32],
        visit: &mut dyn FnMut(Visit, &Octant, bool),
    ) {
        let Some(&word) = words.first() else {
            return;
        };
        let (low, high) = octant.bounds();
        if word::level(word) <= octant.level {
            let crossed = self.first_meeting(candidates, low, high).is_some();
            visit(Visit::Leaf(first), &octant, crossed);
            return;
        }
        let crossing = self.meeting(candidates, low, high);
        visit(Visit::Split, &octant, !crossing.is_empty());
        let mut from = 0;
        for digit in 0..8 {
            let child = octant.child(digit);
            let end = word::key_of(child.corner) + word::span(child.level);
            let until = from + words[from..].partition_point(|&w| word::key(w) < end);
            self.descend(&words[from..until], first + from, child, &crossing, visit);
            from = until;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::{octants_of, random_words};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_walk_visits_leaves_and_their_ancestors_with_what_crosses_them(
            words in random_words(3),
            facets in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(0i64..1 << 27)), 0..3),
        ) {
            let crossed_by_any = |octant: &Octant| {
                let (low, high) = octant.bounds();
                facets.iter().any(|facet| Triangle::new(facet).meets(low, high))
            };
            let mut visited = Vec::new();
            Facets::new(&facets).walk(&words, &mut |visit, octant, crossed| {
                assert_eq!(crossed, crossed_by_any(octant), "{octant}");
                match visit {
                    Visit::Leaf(i) => assert_eq!(word::octant(words[i]), *octant),
                    Visit::Split => assert!(words.iter().all(|&w| word::octant(w) != *octant)),
                }
                visited.push(*octant);
            });
            visited.sort_unstable_by_key(|o| (o.level, o.corner));
            prop_assert_eq!(visited, octants_of(&words));
        }
    }
}
