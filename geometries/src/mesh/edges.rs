//! Edges of an indexed triangle mesh.

use std::hash::{BuildHasherDefault, Hasher};

use super::Mesh;

/// A directed edge of one facet.
#[derive(Clone, Copy)]
pub(super) struct Half {
    from: u32,
    to: u32,
}

impl Half {
    /// A key of the undirected edge, equal for both of its facets.
    pub(super) fn key(self) -> u64 {
        u64::from(self.from.min(self.to)) << 32 | u64::from(self.from.max(self.to))
    }

    /// Whether the facet traverses the edge from the higher vertex index to the lower. If the
    /// winding is consistent, exactly one of the two facets of an edge does.
    pub(super) fn is_down(self) -> bool {
        self.from > self.to
    }
}

/// The three directed edges of every facet, each with the index of the facet.
pub(super) fn halves(triangles: &[[u32; 3]]) -> impl Iterator<Item = (usize, Half)> {
    triangles.iter().enumerate().flat_map(|(facet, t)| {
        (0..3).map(move |i| (facet, Half { from: t[i], to: t[(i + 1) % 3] }))
    })
}

/// An edge and the facet that traverses it from the lower vertex index to the higher.
pub(super) struct Edge {
    pub(super) key: u64,
    pub(super) facet_up: usize,
    /// The square of the length.
    square: f64,
}

impl Edge {
    /// The vertex indices, lower first.
    pub(super) fn ends(&self) -> [u32; 2] {
        [(self.key >> 32) as u32, self.key as u32]
    }
}

/// The `number` longest edges, longest first. Edges of equal length are ordered by vertex index, so
/// the result is the same on every machine.
pub(super) fn longest(mesh: &Mesh, number: usize) -> Vec<Edge> {
    let square = |half: Half| {
        let [p, q] = [half.from, half.to].map(|v| mesh.vertices[v as usize]);
        (0..3).map(|a| (p[a] - q[a]) * (p[a] - q[a])).sum()
    };
    let mut edges: Vec<Edge> = halves(&mesh.triangles)
        .filter(|(_, half)| !half.is_down())
        .map(|(facet_up, half)| Edge { key: half.key(), facet_up, square: square(half) })
        .collect();
    let order = |a: &Edge, b: &Edge| b.square.total_cmp(&a.square).then(a.key.cmp(&b.key));
    if number < edges.len() {
        edges.select_nth_unstable_by(number, order);
        edges.truncate(number);
    }
    edges.sort_unstable_by(order);
    edges
}

/// Hashes one u64 by a multiplication, which is faster than the default for millions of edges.
#[derive(Default)]
pub(crate) struct KeyHasher(u64);

/// Hasher for a `HashMap` with u64 keys. No program may iterate over such a map, as its order is
/// not defined.
pub(crate) type EdgeHasher = BuildHasherDefault<KeyHasher>;

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&byte| self.write_u64(u64::from(byte)));
    }

    fn write_u64(&mut self, key: u64) {
        let mixed = (self.0 ^ key).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ (mixed >> 32);
    }
}
