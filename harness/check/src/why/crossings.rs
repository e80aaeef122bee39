//! The facets that cross an octant, found through lists that shrink with the octants.

use std::cell::RefCell;
use std::rc::Rc;

use contract::lattice::FacetLattice;
use contract::octant::Octant;
use contract::triangle::Triangle;
use rustc_hash::FxHashMap;

use super::leaves::id;

/// Lists of at most this length are not divided further.
const FACETS_FEW: usize = 32;

/// The facets of a case, with a list for each coarse octant that was asked for.
#[derive(Debug)]
pub struct Crossings<'a> {
    facets: &'a [FacetLattice],
    lists: RefCell<FxHashMap<u64, Rc<[u32]>>>,
}

impl<'a> Crossings<'a> {
    /// The facets of a case, of which there are fewer than 2^32.
    pub fn new(facets: &'a [FacetLattice]) -> Self {
        Self { facets, lists: RefCell::default() }
    }

    /// All facets.
    pub fn facets(&self) -> &'a [FacetLattice] {
        self.facets
    }

    /// Whether a facet crosses an octant.
    pub fn any(&self, octant: &Octant) -> bool {
        self.near(octant).iter().any(|&i| self.crosses(i, octant))
    }

    /// The facets that cross an octant, ascending.
    pub fn all(&self, octant: &Octant) -> Vec<u32> {
        self.near(octant).iter().copied().filter(|&i| self.crosses(i, octant)).collect()
    }

    /// A list that contains every facet that crosses an octant: that of its finest ancestor with a list.
    fn near(&self, octant: &Octant) -> Rc<[u32]> {
        let all = || 0..u32::try_from(self.facets.len()).expect("fewer than 2^32 facets");
        let mut list = self.list(&Octant::ROOT, &mut all());
        for level in 1..=octant.level {
            if list.len() <= FACETS_FEW {
                break;
            }
            list = self.list(&octant.ancestor(level), &mut list.iter().copied());
        }
        list
    }

    /// The stored list of an octant, which is made from a list that contains it.
    fn list(&self, octant: &Octant, from: &mut dyn Iterator<Item = u32>) -> Rc<[u32]> {
        if let Some(list) = self.lists.borrow().get(&id(octant)) {
            return list.clone();
        }
        let list: Rc<[u32]> = from.filter(|&i| self.crosses(i, octant)).collect();
        self.lists.borrow_mut().insert(id(octant), list.clone());
        list
    }

    fn crosses(&self, facet: u32, octant: &Octant) -> bool {
        let facet = &self.facets[facet as usize];
        let (low, high) = octant.bounds();
        // Most facets are far away. The exact test computes the plane first.
        let apart = (0..3)
            .any(|a| facet.iter().all(|v| v[a] < low[a]) || facet.iter().all(|v| v[a] > high[a]));
        !apart && Triangle::new(facet).meets(low, high)
    }
}
