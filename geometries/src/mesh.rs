//! A closed triangulated surface with indexed vertices.
//!
//! Invariants of a finished mesh:
//! - every edge belongs to exactly two facets, which traverse it in opposite directions (the surface
//!   is watertight and consistently wound), as tests require of every shape;
//! - every facet has a positive area after its vertices are rounded to f32, which [`Mesh::flat_facet`]
//!   finds out.
//!
//! Positions are f64 until [`Mesh::facets`] rounds each vertex to f32, so all facets at a vertex
//! get the same bits.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use crate::Facet;

/// A surface of triangles over indexed vertices, wound so that its normals point outward.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Mesh {
    pub(crate) vertices: Vec<[f64; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Adds a vertex and returns its index.
    pub(crate) fn add_vertex(&mut self, position: [f64; 3]) -> u32 {
        let index = u32::try_from(self.vertices.len()).expect("facets are limited to 2^31");
        self.vertices.push(position);
        index
    }

    /// Adds the two triangles of a quadrilateral whose corners are given in order.
    pub(crate) fn add_quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangles.push([a, b, c]);
        self.triangles.push([a, c, d]);
    }

    /// Adds the vertices and triangles of another mesh.
    pub(crate) fn append(&mut self, other: &Mesh) {
        let first = u32::try_from(self.vertices.len()).expect("facets are limited to 2^31");
        self.vertices.extend(&other.vertices);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
    }

    /// Reverses the winding of every facet.
    pub(crate) fn flip(&mut self) {
        self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }

    pub(crate) fn translate(&mut self, by: [f64; 3]) {
        for vertex in &mut self.vertices {
            *vertex = std::array::from_fn(|a| vertex[a] + by[a]);
        }
    }

    /// Multiplies the coordinates along each axis by a positive factor.
    pub(crate) fn scale(&mut self, by: [f64; 3]) {
        for vertex in &mut self.vertices {
            *vertex = std::array::from_fn(|a| vertex[a] * by[a]);
        }
    }

    /// The surface as facet soup.
    pub(crate) fn facets(&self) -> Vec<Facet> {
        self.triangles.iter().map(|&t| self.facet(t)).collect()
    }

    fn facet(&self, triangle: [u32; 3]) -> Facet {
        triangle.map(|v| self.vertices[v as usize].map(|x| x as f32))
    }

    /// Splits the longest edges at their midpoints until the mesh has `facets` facets, one less if
    /// that number is odd. Each split adds two facets. One pass splits a facet at most once, and
    /// each pass selects the longest edges of the mesh that the previous pass produced.
    pub(crate) fn split_edges_until(&mut self, facets: usize) {
        while self.triangles.len() + 1 < facets {
            let splits_max = (facets - self.triangles.len()) / 2;
            self.split_longest(splits_max);
        }
    }

    /// Splits between one and `splits_max` edges, no two of which share a facet.
    fn split_longest(&mut self, splits_max: usize) {
        let chosen = longest(self, splits_max.saturating_mul(3));
        // The chosen edges store only the facet that traverses them upward; find the other facet.
        let slots: HashMap<u64, usize, EdgeHasher> =
            chosen.iter().enumerate().map(|(slot, edge)| (edge.key, slot)).collect();
        let mut down = vec![usize::MAX; chosen.len()];
        for (facet, half) in halves(&self.triangles) {
            if half.is_down()
                && let Some(&slot) = slots.get(&half.key())
            {
                down[slot] = facet;
            }
        }
        let mut is_split = vec![false; self.triangles.len()];
        let mut split = 0;
        for (edge, facet_down) in chosen.iter().zip(down) {
            if split < splits_max && !is_split[edge.facet_up] && !is_split[facet_down] {
                is_split[edge.facet_up] = true;
                is_split[facet_down] = true;
                self.split(edge.ends(), [edge.facet_up, facet_down]);
                split += 1;
            }
        }
    }

    /// Splits one edge and its two facets.
    fn split(&mut self, ends: [u32; 2], facets: [usize; 2]) {
        let [p, q] = ends.map(|v| self.vertices[v as usize]);
        let middle = self.add_vertex(std::array::from_fn(|a| (p[a] + q[a]) * 0.5));
        for facet in facets {
            let whole = self.triangles[facet];
            let half_at =
                |end: u32| whole.map(|v| if v != end && ends.contains(&v) { middle } else { v });
            self.triangles[facet] = half_at(ends[0]);
            self.triangles.push(half_at(ends[1]));
        }
    }

    /// The least distance of the plane of a facet from the origin.
    pub(crate) fn least_distance(&self) -> f64 {
        let distance = |t: &[u32; 3]| {
            let [p, q, r] = t.map(|v| self.vertices[v as usize]);
            let normal: [f64; 3] = std::array::from_fn(|a| {
                let (b, c) = ((a + 1) % 3, (a + 2) % 3);
                (q[b] - p[b]) * (r[c] - p[c]) - (q[c] - p[c]) * (r[b] - p[b])
            });
            let dot = |v: [f64; 3]| normal[0] * v[0] + normal[1] * v[1] + normal[2] * v[2];
            dot(p).abs() / dot(normal).sqrt()
        };
        self.triangles.iter().map(distance).fold(f64::INFINITY, f64::min)
    }

    /// The first facet that has no area after rounding to f32, or whose edges are not finite.
    pub(crate) fn flat_facet(&self) -> Option<usize> {
        let has_area = |t: &[u32; 3]| {
            let [p, q, r] = self.facet(*t).map(|p| p.map(f64::from));
            let u: [f64; 3] = std::array::from_fn(|a| q[a] - p[a]);
            let v: [f64; 3] = std::array::from_fn(|a| r[a] - p[a]);
            let is_finite = u.into_iter().chain(v).all(f64::is_finite);
            is_finite && (0..3).any(|a| u[a] * v[(a + 1) % 3] != u[(a + 1) % 3] * v[a])
        };
        self.triangles.iter().position(|t| !has_area(t))
    }
}

/// A directed edge of one facet.
#[derive(Clone, Copy)]
struct Half {
    from: u32,
    to: u32,
}

impl Half {
    /// A key of the undirected edge, equal for both of its facets.
    fn key(self) -> u64 {
        u64::from(self.from.min(self.to)) << 32 | u64::from(self.from.max(self.to))
    }

    /// Whether the facet traverses the edge from the higher vertex index to the lower. If the
    /// winding is consistent, exactly one of the two facets of an edge does.
    fn is_down(self) -> bool {
        self.from > self.to
    }
}

/// The three directed edges of every facet, each with the index of the facet.
fn halves(triangles: &[[u32; 3]]) -> impl Iterator<Item = (usize, Half)> {
    triangles.iter().enumerate().flat_map(|(facet, t)| {
        (0..3).map(move |i| (facet, Half { from: t[i], to: t[(i + 1) % 3] }))
    })
}

/// An edge and the facet that traverses it from the lower vertex index to the higher.
struct Edge {
    key: u64,
    facet_up: usize,
    /// The square of the length.
    square: f64,
}

impl Edge {
    /// The vertex indices, lower first.
    fn ends(&self) -> [u32; 2] {
        [(self.key >> 32) as u32, self.key as u32]
    }
}

/// The `number` longest edges, longest first. Edges of equal length are ordered by vertex index, so
/// the result is the same on every machine.
fn longest(mesh: &Mesh, number: usize) -> Vec<Edge> {
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

#[cfg(test)]
impl Mesh {
    /// Whether every edge belongs to exactly two facets, which traverse it in opposite directions.
    pub(crate) fn is_closed(&self) -> bool {
        let mut times: HashMap<[u32; 2], usize> = HashMap::new();
        for t in &self.triangles {
            (0..3).for_each(|i| *times.entry([t[i], t[(i + 1) % 3]]).or_default() += 1);
        }
        times.iter().all(|(&[a, b], &count)| count == 1 && times.get(&[b, a]) == Some(&1))
    }

    /// The enclosed volume, negative if the surface is wound inward.
    pub(crate) fn volume(&self) -> f64 {
        let six_fold: f64 = self
            .triangles
            .iter()
            .map(|t| {
                let [p, q, r] = t.map(|v| self.vertices[v as usize]);
                p[0] * (q[1] * r[2] - q[2] * r[1])
                    + p[1] * (q[2] * r[0] - q[0] * r[2])
                    + p[2] * (q[0] * r[1] - q[1] * r[0])
            })
            .sum();
        six_fold / 6.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> Mesh {
        Mesh {
            vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        }
    }

    #[test]
    fn splitting_edges_preserves_the_surface_and_reaches_the_number_of_facets() {
        for facets in [4, 5, 6, 8, 50, 51, 1000] {
            let mut mesh = tetrahedron();
            mesh.split_edges_until(facets);
            assert_eq!(mesh.triangles.len(), facets & !1);
            assert!(mesh.is_closed() && mesh.flat_facet().is_none());
            assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-12);
        }
    }

    #[test]
    fn open_flipped_doubled_and_flat_meshes_are_faulty() {
        let mut open = tetrahedron();
        open.triangles.pop();
        assert!(!open.is_closed());

        let mut flipped = tetrahedron();
        flipped.triangles[2].swap(0, 1);
        assert!(!flipped.is_closed());

        let mut doubled = tetrahedron();
        doubled.triangles.extend(doubled.triangles.clone());
        assert!(!doubled.is_closed());

        let mut flat = tetrahedron();
        flat.vertices[3] = [1e-60, 1e-60, 1e-60];
        assert!(flat.is_closed());
        assert_eq!(flat.flat_facet(), Some(1));
    }

    #[test]
    fn a_surface_wound_inward_has_negative_volume() {
        let mut mesh = tetrahedron();
        mesh.flip();
        assert!(mesh.volume() < 0.0);
        assert!(mesh.is_closed());
    }
}
