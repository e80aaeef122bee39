//! Searches in two meshes: the leaf that requires a split, and the leaves at an octant.

use super::rule::{Dispute, Mesh};
use contract::octant::Octant;
use contract::word::{self, Leaf};

impl Dispute<'_> {
    /// The leaf of the other mesh that requires an octant of this mesh to be split, and whether both meshes
    /// have it. A leaf that both have takes precedence, then the finest.
    pub(super) fn witness(&self, mesh: Mesh, octant: &Octant) -> Option<(u64, bool)> {
        let (own, other) = match mesh {
            Mesh::A => (self.a, self.b),
            Mesh::B => (self.b, self.a),
        };
        let sources = other.iter().copied().filter(|&w| word::fault(w).is_none());
        let asking = sources.filter(|&w| self.requires(&word::octant(w), octant).is_some());
        let ranked = asking.map(|w| (own.binary_search(&w).is_ok(), word::level(w), w));
        ranked
            .max_by_key(|&(both, level, w)| (both, level, std::cmp::Reverse(w)))
            .map(|(both, _, w)| (w, both))
    }

    /// The rule by which a leaf requires an octant to be split, as text; `None` if it does not.
    pub(super) fn requires(&self, source: &Octant, octant: &Octant) -> Option<String> {
        let n = self.terms.layer_cells_min;
        let (l, distance) = (source.level, source.distance(octant));
        if octant.contains(source) || l <= octant.level {
            return None;
        }
        if distance < i64::from(n - 1) * i64::from(source.edge()) {
            return Some(format!(
                "section 6, step 2 (layer): it is nearer than n - 1 = {} cells of level {l}, so it has level >= {l}",
                n - 1
            ));
        }
        if distance == 0 && l >= octant.level + 2 {
            return Some(format!(
                "section 6, step 3 (balance): it touches a leaf of level {l}, so it has level >= {}",
                l - 1
            ));
        }
        None
    }

    /// The leaf of a mesh that is a strict ancestor of an octant.
    pub(super) fn ancestor_leaf(&self, mesh: Mesh, octant: &Octant) -> Option<Leaf> {
        let words = if mesh == Mesh::A { self.a } else { self.b };
        let key = word::key_of(octant.corner);
        let after = words.partition_point(|&w| word::key(w) <= key);
        let leaf = word::decode(*words[..after].last()?).ok()?;
        (leaf.octant != *octant && leaf.octant.contains(octant)).then_some(leaf)
    }

    /// Whether a mesh has leaves within an octant.
    pub(super) fn has_within(&self, mesh: Mesh, octant: &Octant) -> bool {
        let words = if mesh == Mesh::A { self.a } else { self.b };
        let key = word::key_of(octant.corner);
        let first = words.partition_point(|&w| word::key(w) < key);
        words.get(first).is_some_and(|&w| word::key(w) < key + word::span(octant.level))
    }
}
