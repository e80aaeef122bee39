//! The surface of a body for a view: few triangles, and the ranks that own them.

use contract::case::Facet;
use contract::failure::Failure;
use contract::lattice::{Root, UNITS_PER_EDGE};
use contract::octant::{CELLS_PER_EDGE, UNITS_PER_CELL};
use contract::word;
use export::mesh::Mesh;
use export::selection::Selection;
use run::engine::interrupt;
use std::collections::HashMap;

/// Greatest number of triangles of a view.
const TRIANGLES_MAX: usize = 100_000;
/// Cells of the finest grid in which vertices are merged, along the longest extent.
const GRID: u32 = 1 << 13;

/// Triangles with common vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// The vertices, in the user's units.
    pub points: Vec<[f64; 3]>,
    /// Three vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

impl Surface {
    /// The surface of the facets. Vertices in one cell of a grid are merged into their mean, and the grid is made coarser until
    /// the triangles that remain are few enough.
    pub fn of(facets: &[Facet]) -> Self {
        let mut grid = GRID;
        loop {
            let surface = Self::on_grid(facets, grid);
            if surface.triangles.len() <= TRIANGLES_MAX || grid == 1 {
                return surface;
            }
            grid /= 2;
        }
    }

    fn on_grid(facets: &[Facet], grid: u32) -> Self {
        let mut low = [f64::INFINITY; 3];
        let mut longest = 0.0f64;
        for axis in 0..3 {
            let values = || facets.iter().flatten().map(|v| f64::from(v[axis]));
            low[axis] = values().fold(f64::INFINITY, f64::min);
            longest = longest.max(values().fold(f64::NEG_INFINITY, f64::max) - low[axis]);
        }
        let edge = longest / f64::from(grid);
        let mut indices: HashMap<[u32; 3], u32> = HashMap::new();
        // Sums of the vertices of each grid cell, and their number.
        let mut sums: Vec<([f64; 3], f64)> = Vec::new();
        let mut triangles = Vec::new();
        for facet in facets {
            let corners = facet.map(|vertex| {
                let at = vertex.map(f64::from);
                let cell = std::array::from_fn(|a| ((at[a] - low[a]) / edge) as u32);
                let index = *indices.entry(cell).or_insert_with(|| {
                    sums.push(([0.0; 3], 0.0));
                    sums.len() as u32 - 1
                });
                let (sum, count) = &mut sums[index as usize];
                (0..3).for_each(|a| sum[a] += at[a]);
                *count += 1.0;
                index
            });
            let [a, b, c] = corners;
            if a != b && b != c && c != a {
                triangles.push(corners);
            }
        }
        let points = sums.into_iter().map(|(sum, count)| sum.map(|s| s / count)).collect();
        Self { points, triangles }
    }

    /// The centroids of the triangles.
    pub fn centroids(&self) -> Vec<[f64; 3]> {
        let corner = |index: u32| self.points[index as usize];
        let centroid = |t: &[u32; 3]| {
            let corners = t.map(corner);
            std::array::from_fn(|a| corners.iter().map(|c| c[a]).sum::<f64>() / 3.0)
        };
        self.triangles.iter().map(centroid).collect()
    }
}

/// The rank of the leaf that contains each point; `None` where the mesh has no leaf.
///
/// # Errors
/// If the mesh cannot be read.
pub fn ranks_at(mesh: &Mesh, points: &[[f64; 3]]) -> Result<Vec<Option<u32>>, Failure> {
    let root: &Root = &mesh.manifest.root;
    let key = |at: &[f64; 3]| {
        let last = CELLS_PER_EDGE - 1;
        word::key_of(
            root.quantise_clamped(*at)
                .map(|c| ((c.min(UNITS_PER_EDGE - 1) / UNITS_PER_CELL) as u32).min(last)),
        )
    };
    let mut order: Vec<(u64, usize)> = points.iter().map(key).zip(0..).collect();
    order.sort_unstable();
    let mut ranks = vec![None; points.len()];
    let mut next = order.as_slice();
    let check = || if interrupt::requested() { Err(Failure::interrupted()) } else { Ok(()) };
    mesh.visit(&Selection::default(), &check, &mut |leaf| {
        let start = word::key_of(leaf.octant.corner);
        let end = start + word::span(leaf.octant.level);
        while let Some((&(key, point), rest)) = next.split_first().filter(|(n, _)| n.0 < end) {
            ranks[point] = (key >= start).then_some(leaf.rank);
            next = rest;
        }
        Ok(())
    })?;
    Ok(ranks)
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::{leaf_set, words_of};

    #[test]
    fn vertices_are_shared_and_fine_triangles_are_merged() {
        let strip = |i: u32| {
            let x = i as f32;
            [
                [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]],
                [[x + 1.0, 0.0, 0.0], [x + 1.0, 1.0, 0.0], [x, 1.0, 0.0]],
            ]
        };
        let few: Vec<Facet> = (0..4).flat_map(strip).collect();
        let surface = Surface::of(&few);
        assert_eq!((surface.points.len(), surface.triangles.len()), (10, 8));
        assert!(surface.centroids().iter().all(|c| c[2] == 0.0 && (0.0..=4.0).contains(&c[0])));
        let many: Vec<Facet> = (0..100_000).flat_map(strip).collect();
        assert!(Surface::of(&many).triangles.len() <= TRIANGLES_MAX);
        assert_eq!(Surface::of(&[]), Surface::default());
    }

    #[test]
    fn points_have_the_rank_of_their_leaf() {
        // The root's edge is 8; the first half of the eight leaves is of rank 0.
        let words = words_of(|o| o.level < 1);
        let place = tempfile::tempdir().unwrap();
        leaf_set(vec![words[..4].to_vec(), words[5..].to_vec()]).write(place.path()).unwrap();
        let mesh = Mesh::open(place.path()).unwrap();
        let points = [[1.0, 1.0, 7.0], [1.0; 3], [8.0; 3], [5.0, 1.0, 5.0]];
        assert_eq!(ranks_at(&mesh, &points).unwrap(), [None, Some(0), Some(1), Some(1)]);
    }
}
