//! Edges of an indexed triangle mesh.

use std::hash::{BuildHasherDefault, Hasher};

use super::{Mesh, MeshFault};

/// One facet's run along an edge.
#[derive(Clone, Copy)]
pub(super) struct Half {
    from: u32,
    to: u32,
}

impl Half {
    /// The same for both facets of an edge.
    pub(super) fn key(self) -> u64 {
        u64::from(self.from.min(self.to)) << 32 | u64::from(self.from.max(self.to))
    }

    /// Whether the facet runs from the higher vertex number to the lower. Exactly one of an edge's two
    /// facets does, where winding is consistent.
    pub(super) fn is_down(self) -> bool {
        self.from > self.to
    }
}

/// Every facet's three runs, with the facet's index.
pub(super) fn halves(triangles: &[[u32; 3]]) -> impl Iterator<Item = (usize, Half)> {
    triangles.iter().enumerate().flat_map(|(facet, t)| {
        (0..3).map(move |i| (facet, Half { from: t[i], to: t[(i + 1) % 3] }))
    })
}

/// An edge, by the facet that runs upward along it.
pub(super) struct Edge {
    pub(super) key: u64,
    pub(super) facet_up: usize,
    square: f64,
}

impl Edge {
    /// The vertex numbers, lower first.
    pub(super) fn ends(&self) -> [u32; 2] {
        [(self.key >> 32) as u32, self.key as u32]
    }
}

/// The `number` longest edges, longest first, equal ones by vertex numbers: the same on every machine.
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

/// The first directed edge that is not matched by exactly one in the opposite direction.
pub(super) fn fault(triangles: &[[u32; 3]]) -> Option<MeshFault> {
    // The direction goes into the lowest place of the sort, so that a sound edge is a pair (up, down).
    let mut runs: Vec<(u64, bool)> =
        halves(triangles).map(|(_, half)| (half.key(), half.is_down())).collect();
    runs.sort_unstable();
    let is_sound = |pair: &[(u64, bool)]| matches!(pair, [(k, false), (l, true)] if k == l);
    let mut pairs = runs.chunks(2);
    let mut before = None;
    let wrong = pairs.find(|pair| {
        let repeats = before == Some(pair[0].0);
        before = pair.last().map(|run| run.0);
        repeats || !is_sound(pair)
    })?;
    let (key, is_down) = wrong[0];
    let [low, high] = [(key >> 32) as u32, key as u32];
    Some(MeshFault::EdgeUnmatched { edge: if is_down { [high, low] } else { [low, high] } })
}

/// Hashes one u64 by a multiplication: edges are looked up by the million.
#[derive(Default)]
pub(crate) struct KeyHasher(u64);

/// For a `HashMap` with u64 keys. The maps are only ever looked up, never walked.
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
