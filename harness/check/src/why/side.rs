//! What decides the side of a leaf of T0 (section 4 of reference/DEFINITION.md), and whether its component is enclosed
//! (section 5).
//!
//! Both belong to the whole component, which can have millions of leaves. It is searched coarse leaves first, and at most
//! [`VISITS_MAX`] octants are visited. So the far field is found quickly from anywhere outside. A candidate is known to be the
//! first if every leaf of T0 that precedes it was visited or is crossing, even if the component is incomplete.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::Mesh;
use super::base::Surface;
use super::leaves::id;
use contract::octant::{CELLS_PER_EDGE, LEVEL_MAX, Octant, UNITS_PER_CELL};
use contract::parity::Parity;
use contract::word::{self, Side};
use rustc_hash::FxHashSet;

/// Octants that are visited in search of a component.
pub const VISITS_MAX: usize = 100_000;

/// Coarsest level of a candidate for which all preceding leaves of T0 are looked at.
const LEVEL_SEARCHED: u8 = 8;

/// Number of candidates whose rays are computed before the majority decides.
const CANDIDATES_MAX: usize = 32;

/// The leaves of T0 that are connected with one of them through faces, as far as they were visited.
#[derive(Clone, Debug)]
pub struct Component {
    /// The leaves by level, then by key.
    pub leaves: Vec<Octant>,
    /// Whether these are all.
    pub is_complete: bool,
    /// Whether one of them has a face on the root's boundary.
    pub is_at_boundary: bool,
}

/// What decides the side of a component.
#[derive(Clone, Debug, PartialEq)]
pub enum Decision {
    /// The seed with this index lies in it.
    Seed(usize),
    /// No seed was found in it.
    NoSeed,
    /// The six rays of this candidate agree. The number of candidates before it, and for +x, -x, +y, -y, +z, -z whether
    /// the number of facets that the ray intersects is odd.
    Rays(Octant, usize, [bool; 6]),
    /// The majority of the rays of this many candidates, and how many of them are odd.
    Majority(usize, usize),
}

impl Mesh<'_> {
    /// The component of a leaf of T0 that no facet crosses.
    pub(super) fn component(&self, leaf: &Octant) -> Component {
        let mut found = Component { leaves: Vec::new(), is_complete: true, is_at_boundary: false };
        let mut seen = FxHashSet::default();
        let mut heap = BinaryHeap::new();
        let mut visits = 0;
        self.add_leaf(leaf, &mut found, &mut heap);
        seen.insert(id(leaf));
        // An octant across a face of a leaf, with its own face there: axis, then 0 (low) or 1 (high).
        while let Some(Reverse((level, key, face))) = heap.pop() {
            visits += 1;
            if visits > VISITS_MAX {
                found.is_complete = false;
                break;
            }
            let octant = Octant { corner: word::corner_of(key), level };
            match self.base_leaf(&octant) {
                None => {
                    let (axis, high) = (face / 2, face % 2);
                    for digit in (0..8u8).filter(|digit| digit >> axis & 1 == high) {
                        let child = octant.child(digit);
                        heap.push(Reverse((child.level, word::key_of(child.corner), face)));
                    }
                }
                Some(leaf) if seen.insert(id(&leaf)) && !self.is_crossed(&leaf) => {
                    self.add_leaf(&leaf, &mut found, &mut heap);
                }
                Some(_) => {}
            }
        }
        found.leaves.sort_unstable_by_key(|o| (o.level, word::key_of(o.corner)));
        found
    }

    fn add_leaf(
        &self,
        leaf: &Octant,
        found: &mut Component,
        heap: &mut BinaryHeap<Reverse<(u8, u64, u8)>>,
    ) {
        found.leaves.push(*leaf);
        for face in 0..6u8 {
            let mut offset = [0; 3];
            offset[usize::from(face / 2)] = if face % 2 == 0 { -1 } else { 1 };
            match leaf.neighbour(offset) {
                Some(across) => {
                    heap.push(Reverse((across.level, word::key_of(across.corner), face ^ 1)));
                }
                None => found.is_at_boundary = true,
            }
        }
        debug_assert!(leaf.corner.iter().all(|&c| c < CELLS_PER_EDGE));
    }

    /// What decides the side of a component, and the side; `None` if facets are not known.
    pub(super) fn decide(&self, component: &Component) -> Option<(Decision, Side)> {
        let Surface::Facets(crossings) = &self.surface else { return None };
        if !self.terms.seeds.is_empty() {
            return Some(self.decide_by_seeds(component));
        }
        let side = |is_inside| if is_inside { Side::Inside } else { Side::Outside };
        let parity = Parity::new(crossings.facets());
        let candidates = component.leaves.iter().take(CANDIDATES_MAX);
        let mut odd = 0;
        for (before, candidate) in candidates.clone().enumerate() {
            let rays = parity.inside(candidate.centre());
            let odd_here = rays.iter().filter(|&&is_odd| is_odd).count();
            if odd_here % 6 == 0 {
                return Some((Decision::Rays(*candidate, before, rays), side(odd_here == 6)));
            }
            odd += odd_here;
        }
        let count = candidates.len();
        Some((Decision::Majority(count, odd), side(odd > 3 * count)))
    }

    /// Whether the visited leaves contain every leaf of the component that precedes this one among the candidates.
    pub(super) fn knows_candidates_before(&self, leaf: &Octant, component: &Component) -> bool {
        component.is_complete
            || leaf.level <= LEVEL_SEARCHED
                && !self.has_unknown_before(leaf, &Octant::ROOT, component)
    }

    /// Whether an octant contains a leaf of T0 that precedes `leaf`, may belong to its component and was not visited.
    fn has_unknown_before(&self, leaf: &Octant, at: &Octant, component: &Component) -> bool {
        let order = |o: &Octant| (o.level, word::key_of(o.corner));
        if self.base_splits(at) {
            return at.level < leaf.level
                && (0..8).any(|d| self.has_unknown_before(leaf, &at.child(d), component));
        }
        let is_visited = || component.leaves.binary_search_by_key(&order(at), order).is_ok();
        order(at) < order(leaf) && !self.is_crossed(at) && !is_visited()
    }

    fn decide_by_seeds(&self, component: &Component) -> (Decision, Side) {
        let flow = self.terms.side_of_flow();
        let contains = |seed: &[i64; 3]| {
            let leaf = self.base_leaf_at(seed.map(|q| (q / UNITS_PER_CELL) as u32));
            component.leaves.contains(&leaf)
        };
        match self.terms.seeds.iter().position(contains) {
            Some(seed) => (Decision::Seed(seed), flow),
            None if flow == Side::Inside => (Decision::NoSeed, Side::Outside),
            None => (Decision::NoSeed, Side::Inside),
        }
    }

    /// The leaf of T0 that contains a level-19 cell.
    pub(super) fn base_leaf_at(&self, cell: [u32; 3]) -> Octant {
        let cell = Octant { corner: cell, level: LEVEL_MAX };
        let mut path = (0..=LEVEL_MAX).map(|level| cell.ancestor(level));
        path.find(|octant| !self.base_splits(octant)).expect("level 19 is never split")
    }
}
