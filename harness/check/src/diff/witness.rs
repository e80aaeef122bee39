//! Who asks for an octant to be split, and who holds what where: what a ruling is found with.

use super::rule::{Dispute, Who};
use contract::octant::Octant;
use contract::word::{self, Leaf};

impl Dispute<'_> {
    /// The leaf that asks for the octant's split: one that both meshes have before any other, then the deepest.
    pub(super) fn witness(&self, who: Who, octant: &Octant) -> Option<(u64, bool)> {
        let (own, other) = match who {
            Who::A => (self.a, self.b),
            Who::B => (self.b, self.a),
        };
        let sources = other.iter().copied().filter(|&w| word::fault(w).is_none());
        let asking = sources.filter(|&w| self.asks(&word::octant(w), octant).is_some());
        let ranked = asking.map(|w| (own.binary_search(&w).is_ok(), word::level(w), w));
        ranked
            .max_by_key(|&(both, level, w)| (both, level, std::cmp::Reverse(w)))
            .map(|(both, _, w)| (w, both))
    }

    /// The rule by which a leaf asks for an octant to be split, if it does.
    pub(super) fn asks(&self, source: &Octant, octant: &Octant) -> Option<String> {
        let n = self.terms.layer_cells_min;
        let (l, apart) = (source.level, gap(source, octant));
        if octant.contains(source) || l <= octant.level {
            return None;
        }
        if apart < u64::from(n - 1) * u64::from(source.edge()) {
            return Some(format!(
                "section 6, step 2 (layer): it is nearer than n - 1 = {} cells of level {l}, so it has level >= {l}",
                n - 1
            ));
        }
        if apart == 0 && l >= octant.level + 2 {
            return Some(format!(
                "section 6, step 3 (balance): it touches a leaf of level {l}, so it has level >= {}",
                l - 1
            ));
        }
        None
    }

    /// The leaf of a mesh that is this octant's strict ancestor.
    pub(super) fn holder(&self, who: Who, octant: &Octant) -> Option<Leaf> {
        let words = if who == Who::A { self.a } else { self.b };
        let key = word::key_of(octant.corner);
        let after = words.partition_point(|&w| word::key(w) <= key);
        let leaf = word::decode(*words[..after].last()?).ok()?;
        (leaf.octant != *octant && leaf.octant.contains(octant)).then_some(leaf)
    }

    /// Whether a mesh has leaves within an octant.
    pub(super) fn has_within(&self, who: Who, octant: &Octant) -> bool {
        let words = if who == Who::A { self.a } else { self.b };
        let key = word::key_of(octant.corner);
        let first = words.partition_point(|&w| word::key(w) < key);
        words.get(first).is_some_and(|&w| word::key(w) < key + word::span(octant.level))
    }
}

/// Distance by Chebyshev, in level-19 cells.
fn gap(a: &Octant, b: &Octant) -> u64 {
    let along = |axis: usize| {
        let (low_a, low_b) = (i64::from(a.corner[axis]), i64::from(b.corner[axis]));
        (low_a - low_b - i64::from(b.edge())).max(low_b - low_a - i64::from(a.edge())).max(0)
    };
    (0..3).map(along).max().unwrap_or(0) as u64
}
