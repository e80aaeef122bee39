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

    /// Visits every octant that is a leaf or contains leaves, parents first, with whether a facet crosses it.
    /// The words must be sorted leaves without overlap.
    pub fn walk(&self, words: &[u64], visit: &mut dyn FnMut(Visit, &Octant, bool)) {
        let all: Vec<u32> =
            (0..u32::try_from(self.0.len()).expect("fewer than 2^32 facets")).collect();
        self.descend(words, 0, Octant::ROOT, &all, visit);
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
        let crosses = |&&i: &&u32| self.0[i as usize].meets(low, high);
        if word::level(word) <= octant.level {
            visit(Visit::Leaf(first), &octant, candidates.iter().any(|i| crosses(&i)));
            return;
        }
        let crossing: Vec<u32> = candidates.iter().filter(crosses).copied().collect();
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
