//! Exact ray parity (reference/DEFINITION.md, section 4), the adjudicator where other oracles disagree.
//!
//! A point's six axis-parallel rays count the facets they pass. To decide whether a ray passes a
//! facet, the facet is projected along the ray, and a second ray within that plane counts its edges:
//! an edge is met iff it straddles the point's second coordinate half-open, which is what moving the
//! point by an infinitesimal amount comes to. All in integers.

use crate::lattice::FacetLattice;

/// Facets, sorted into a grid per axis, ready for rays.
#[derive(Debug)]
pub struct Parity {
    facets: Vec<FacetLattice>,
    grids: [Grid; 3],
}

/// Facets by where their projection along one axis lies: cell (i, j) holds every facet whose
/// projected bounding box meets it.
#[derive(Debug)]
struct Grid {
    /// Cells along each of the two axes.
    cells: i64,
    /// Minimum of the projected facets.
    low: [i64; 2],
    /// Width of a cell, at least 1.
    width: [i64; 2],
    /// `facets[starts[c]..starts[c + 1]]` are those of cell `c`.
    starts: Vec<u32>,
    facets: Vec<u32>,
}

impl Parity {
    /// Prepares facets for rays.
    pub fn new(facets: &[FacetLattice]) -> Self {
        let grids = std::array::from_fn(|axis| Grid::new(facets, axis));
        Self { facets: facets.to_vec(), grids }
    }

    /// Whether each ray from this point finds it inside: +x, -x, +y, -y, +z, -z. A facet that holds
    /// the point itself is passed by neither ray of an axis.
    pub fn inside(&self, point: [i64; 3]) -> [bool; 6] {
        let mut odd = [false; 6];
        for axis in 0..3 {
            for &i in self.grids[axis].at(project(point, axis)) {
                match passes(&self.facets[i as usize], point, axis) {
                    Some(true) => odd[2 * axis] ^= true,
                    Some(false) => odd[2 * axis + 1] ^= true,
                    None => {}
                }
            }
        }
        odd
    }
}

/// The two coordinates that a ray along `axis` leaves fixed: those along axis + 1 and axis + 2.
fn project(point: [i64; 3], axis: usize) -> [i64; 2] {
    [point[(axis + 1) % 3], point[(axis + 2) % 3]]
}

/// Whether the line along `axis` through the moved point meets the facet ahead of the point (true),
/// behind it (false), or not.
fn passes(facet: &FacetLattice, point: [i64; 3], axis: usize) -> Option<bool> {
    let at = project(point, axis);
    let corners = facet.map(|v| project(v, axis));
    let edges = [(0, 1), (1, 2), (2, 0)];
    let met = edges.iter().filter(|&&(a, b)| edge_is_right(corners[a], corners[b], at)).count();
    if met != 1 {
        return None;
    }
    ahead(facet, point, axis)
}

/// Whether the edge crosses the horizontal through the moved point, to the right of it. The point is
/// moved right by eps and up by eps squared: so a corner level with it is below, and where the edge
/// goes through it, it has been moved past the edge.
fn edge_is_right(a: [i64; 2], b: [i64; 2], at: [i64; 2]) -> bool {
    if (a[1] > at[1]) == (b[1] > at[1]) {
        return false;
    }
    let (low, high) = if a[1] < b[1] { (a, b) } else { (b, a) };
    // Left of the upward edge iff the turn from it to the point is counter-clockwise.
    (high[0] - low[0]) * (at[1] - low[1]) - (high[1] - low[1]) * (at[0] - low[0]) > 0
}

/// On which side of the point the facet's plane meets the line; the line is known to meet the facet.
fn ahead(facet: &FacetLattice, point: [i64; 3], axis: usize) -> Option<bool> {
    let normal = normal(facet);
    let from = |a: usize| i128::from(point[a] - facet[0][a]);
    let height: i128 = (0..3).map(|a| i128::from(normal[a]) * from(a)).sum();
    let moved = [height, normal[(axis + 1) % 3].into(), normal[(axis + 2) % 3].into()];
    let sign = moved.into_iter().map(i128::signum).find(|&s| s != 0)?;
    // The plane is ahead iff going ahead brings the height towards zero.
    Some(sign != i128::from(normal[axis].signum()))
}

/// The facet's normal, not normalised; coordinates on the lattice keep it within i64.
fn normal(facet: &FacetLattice) -> [i64; 3] {
    let edge = |v: usize| -> [i64; 3] { std::array::from_fn(|a| facet[v][a] - facet[0][a]) };
    let (u, v) = (edge(1), edge(2));
    std::array::from_fn(|a| {
        let (b, c) = ((a + 1) % 3, (a + 2) % 3);
        u[b] * v[c] - u[c] * v[b]
    })
}

impl Grid {
    fn new(facets: &[FacetLattice], axis: usize) -> Self {
        let (mut low, mut high) = ([i64::MAX; 2], [i64::MIN; 2]);
        for facet in facets {
            let (from, to) = bounds(facet, axis);
            for a in 0..2 {
                low[a] = low[a].min(from[a]);
                high[a] = high[a].max(to[a]);
            }
        }
        if facets.is_empty() {
            (low, high) = ([0; 2], [0; 2]);
        }
        let cells = (facets.len() as f64).sqrt().clamp(1.0, 1024.0) as i64;
        let width = std::array::from_fn(|a| (high[a] - low[a]) / cells + 1);
        let mut grid = Self { cells, low, width, starts: Vec::new(), facets: Vec::new() };
        grid.fill(facets, axis);
        grid
    }

    /// Counting sort of the facets into cells.
    fn fill(&mut self, facets: &[FacetLattice], axis: usize) {
        let mut starts = vec![0u32; (self.cells * self.cells) as usize + 1];
        for facet in facets {
            self.cells_of(facet, axis, |c| starts[c + 1] += 1);
        }
        for c in 1..starts.len() {
            starts[c] = starts[c].checked_add(starts[c - 1]).expect("fewer than 2^32 entries");
        }
        let mut next = starts.clone();
        self.facets = vec![0; *starts.last().expect("at least one") as usize];
        let mut list = std::mem::take(&mut self.facets);
        for (i, facet) in facets.iter().enumerate() {
            self.cells_of(facet, axis, |c| {
                list[next[c] as usize] = i as u32;
                next[c] += 1;
            });
        }
        (self.starts, self.facets) = (starts, list);
    }

    fn cells_of(&self, facet: &FacetLattice, axis: usize, mut visit: impl FnMut(usize)) {
        let (from, to) = bounds(facet, axis);
        let cell = |at: i64, a: usize| (at - self.low[a]) / self.width[a];
        for j in cell(from[1], 1)..=cell(to[1], 1) {
            for i in cell(from[0], 0)..=cell(to[0], 0) {
                visit((j * self.cells + i) as usize);
            }
        }
    }

    /// Facets whose projection may hold this point.
    fn at(&self, point: [i64; 2]) -> &[u32] {
        let cell: [i64; 2] =
            std::array::from_fn(|a| (point[a] - self.low[a]).div_euclid(self.width[a]));
        if cell.iter().any(|c| !(0..self.cells).contains(c)) {
            return &[];
        }
        let c = (cell[1] * self.cells + cell[0]) as usize;
        &self.facets[self.starts[c] as usize..self.starts[c + 1] as usize]
    }
}

/// Bounding box of a facet's projection.
fn bounds(facet: &FacetLattice, axis: usize) -> ([i64; 2], [i64; 2]) {
    let corners = facet.map(|v| project(v, axis));
    let pick = |f: fn(i64, i64) -> i64| {
        std::array::from_fn(|a| corners.iter().map(|c| c[a]).reduce(f).expect("three"))
    };
    (pick(i64::min), pick(i64::max))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A box as twelve facets, each with a winding of its own.
    fn hull(low: [i64; 3], high: [i64; 3]) -> Vec<FacetLattice> {
        let corner = |i: usize| -> [i64; 3] { std::array::from_fn(|a| [low, high][i >> a & 1][a]) };
        let quads =
            [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let halves = |q: [usize; 4]| [[q[0], q[1], q[2]], [q[3], q[0], q[2]]];
        quads.into_iter().flat_map(halves).map(|t| t.map(corner)).collect()
    }

    proptest! {
        /// Rays that run along edges and through corners count each crossing once.
        #[test]
        fn a_box_is_inside_where_it_is(
            low in prop::array::uniform3(-4i64..4),
            size in prop::array::uniform3(2i64..6),
            point in prop::array::uniform3(-5i64..10),
        ) {
            let high: [i64; 3] = std::array::from_fn(|a| low[a] + size[a]);
            let on = |a: usize| low[a] <= point[a] && point[a] <= high[a];
            let inner = |a: usize| low[a] < point[a] && point[a] < high[a];
            let inside = (0..3).all(inner);
            prop_assume!(inside || !(0..3).all(on));
            prop_assert_eq!(Parity::new(&hull(low, high)).inside(point), [inside; 6]);
        }
    }

    #[test]
    fn a_single_facet_is_odd_on_one_side_only() {
        let facet = [[0, 0, 0], [8, 0, 0], [0, 8, 0]];
        let parity = Parity::new(&[facet]);
        assert_eq!(parity.inside([2, 2, -3]), [false, false, false, false, true, false]);
        assert_eq!(parity.inside([2, 2, 3]), [false, false, false, false, false, true]);
        // Duplicated, it cancels itself.
        assert_eq!(Parity::new(&[facet, facet]).inside([2, 2, 3]), [false; 6]);
    }

    #[test]
    fn degenerate_facets_and_none_count_for_nothing() {
        let segment = [[0, 0, 0], [8, 8, 8], [4, 4, 4]];
        assert_eq!(Parity::new(&[segment]).inside([4, 4, 3]), [false; 6]);
        assert_eq!(Parity::new(&[]).inside([1, 2, 3]), [false; 6]);
    }
}
