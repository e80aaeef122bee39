//! Exact ray parity (reference/DEFINITION.md, section 4), which decides where other oracles disagree.
//!
//! Six axis-parallel rays start at a point, and each counts the facets that it crosses. To decide whether a ray
//! crosses a facet, the facet is projected along the ray, and a second ray in that plane counts the edges of
//! the projection. An edge is crossed iff its half-open range contains the point's second coordinate, which is
//! equivalent to an infinitesimal perturbation of the point. All arithmetic is in integers.

use crate::lattice::{FacetLattice, bounds, difference, dot, edges, normal};
use rustc_hash::FxHashMap;

/// Facets, binned into one grid per axis.
pub struct Parity {
    facets: Vec<FacetLattice>,
    grids: [Grid; 3],
}

/// Facets binned by their projection along one axis: a cell lists every facet whose projected bounding box meets it.
struct Grid {
    /// Width of a cell, at least 1.
    width: [i64; 2],
    lists: FxHashMap<[i64; 2], Vec<u32>>,
}

impl Parity {
    /// Bins facets.
    pub fn new(facets: &[FacetLattice]) -> Self {
        Self { facets: facets.to_vec(), grids: std::array::from_fn(|axis| Grid::new(facets, axis)) }
    }

    /// Whether each ray from this point, which is on no facet, crosses an odd number of facets: +x, -x, +y, -y, +z, -z.
    pub fn inside(&self, point: [i64; 3]) -> [bool; 6] {
        self.windings(point).map(|winding| winding % 2 != 0)
    }

    /// How many times facets that are wound outward enclose this point, by each of these rays: one leaves a body through them.
    pub fn windings(&self, point: [i64; 3]) -> [i64; 6] {
        let along = [0, 1, 2].map(|axis| self.winding(point, axis));
        std::array::from_fn(|ray| along[ray / 2][ray % 2])
    }

    /// As [`Self::windings`], by the two rays along one axis.
    pub fn winding(&self, point: [i64; 3], axis: usize) -> [i64; 2] {
        let mut windings = [0; 2];
        let grid = &self.grids[axis];
        for &i in grid.lists.get(&grid.cell(project(point, axis))).into_iter().flatten() {
            let facet = &self.facets[i as usize];
            let outward = || normal(facet)[axis].signum();
            match crosses(facet, point, axis) {
                Some(true) => windings[0] += outward(),
                Some(false) => windings[1] -= outward(),
                None => {}
            }
        }
        windings
    }
}

/// The two coordinates that are constant along `axis`: those along axis + 1 and axis + 2.
fn project(point: [i64; 3], axis: usize) -> [i64; 2] {
    [point[(axis + 1) % 3], point[(axis + 2) % 3]]
}

/// Whether the line along `axis` through the perturbed point crosses the facet in the positive direction
/// (true), in the negative direction (false), or not at all.
fn crosses(facet: &FacetLattice, point: [i64; 3], axis: usize) -> Option<bool> {
    let projected = project(point, axis);
    let corners = facet.map(|v| project(v, axis));
    let crossed = |[from, to]: &[[i64; 2]; 2]| edge_is_right(*from, *to, projected);
    if edges(&corners).iter().filter(|edge| crossed(edge)).count() != 1 {
        return None;
    }
    let normal = normal(facet);
    let height = dot(normal, difference(point, facet[0]));
    let perturbed = [height, normal[(axis + 1) % 3].into(), normal[(axis + 2) % 3].into()];
    // None if the plane contains the perturbed point, too.
    let sign = perturbed.into_iter().map(i128::signum).find(|&s| s != 0)?;
    // The plane lies in the positive direction iff the height decreases in that direction.
    Some(sign != i128::from(normal[axis].signum()))
}

/// Whether the edge crosses the horizontal line through the perturbed point, to the right of the point. The
/// perturbation is eps to the right and eps squared upwards: a corner at the height of the point is below it,
/// and a point on the edge lies to the right of it.
fn edge_is_right(a: [i64; 2], b: [i64; 2], point: [i64; 2]) -> bool {
    if (a[1] > point[1]) == (b[1] > point[1]) {
        return false;
    }
    let (low, high) = if a[1] < b[1] { (a, b) } else { (b, a) };
    // The point is left of the upward edge iff the turn from the edge to the point is counter-clockwise.
    (high[0] - low[0]) * (point[1] - low[1]) - (high[1] - low[1]) * (point[0] - low[0]) > 0
}

impl Grid {
    fn new(facets: &[FacetLattice], axis: usize) -> Self {
        let projected = |facet| bounds(facet).map(|corner| project(corner, axis));
        let boxes: Vec<[[i64; 2]; 2]> = facets.iter().map(projected).collect();
        let cells = (facets.len() as f64).sqrt().clamp(1.0, 1024.0) as i64;
        let width = std::array::from_fn(|a| {
            let low = boxes.iter().map(|[from, _]| from[a]).min().unwrap_or(0);
            let high = boxes.iter().map(|[_, to]| to[a]).max().unwrap_or(0);
            (high - low) / cells + 1
        });
        let mut grid = Self { width, lists: FxHashMap::default() };
        for (index, [from, to]) in (0..).zip(boxes) {
            let ([left, low], [right, high]) = (grid.cell(from), grid.cell(to));
            for cell in (low..=high).flat_map(|j| (left..=right).map(move |i| [i, j])) {
                grid.lists.entry(cell).or_default().push(index);
            }
        }
        grid
    }

    fn cell(&self, point: [i64; 2]) -> [i64; 2] {
        [0, 1].map(|a| point[a].div_euclid(self.width[a]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A box of twelve facets whose windings differ.
    fn hull(low: [i64; 3], high: [i64; 3]) -> Vec<FacetLattice> {
        let corner = |i: usize| -> [i64; 3] { std::array::from_fn(|a| [low, high][i >> a & 1][a]) };
        let quads =
            [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let halves = |q: [usize; 4]| [[q[0], q[1], q[2]], [q[3], q[0], q[2]]];
        quads.into_iter().flat_map(halves).map(|t| t.map(corner)).collect()
    }

    proptest! {
        /// Rays along edges and through corners count each crossing once.
        #[test]
        fn all_rays_agree_on_points_inside_and_outside_a_box(
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

    proptest! {
        /// The grid of a single facet is one cell.
        #[test]
        fn the_grid_leaves_out_no_facet_that_a_ray_crosses(
            facets in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-40i64..40)), 0..60),
            point in prop::array::uniform3(-42i64..42),
        ) {
            let mut expected = [false; 6];
            for facet in &facets {
                let single = Parity::new(&[*facet]).inside(point);
                (0..6).for_each(|ray| expected[ray] ^= single[ray]);
            }
            prop_assert_eq!(Parity::new(&facets).inside(point), expected);
        }

        /// A point that a facet's projection contains strictly is on one of its sides, or in its plane.
        #[test]
        fn a_line_through_the_interior_of_a_facet_crosses_it(
            facet in prop::array::uniform3(prop::array::uniform3(-9i64..9)), point in prop::array::uniform3(-9i64..9), axis in 0usize..3,
        ) {
            let [a, b, c] = facet.map(|v| project(v, axis));
            let turn = |p: [i64; 2], q: [i64; 2], r: [i64; 2]| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
            let at = project(point, axis);
            let turns = [turn(a, b, at), turn(b, c, at), turn(c, a, at)];
            let inside = turns.iter().all(|&t| t > 0) || turns.iter().all(|&t| t < 0);
            let beyond = turns.iter().any(|&t| t > 0) && turns.iter().any(|&t| t < 0);
            prop_assume!(inside || beyond);
            // The facet's coordinate along the axis at the point, times twice the area of the projection.
            let along = (0..3).map(|i| turns[(i + 1) % 3] * facet[i][axis]).sum::<i64>() * turns[0].signum();
            let height = along - point[axis] * turns.iter().sum::<i64>().abs();
            prop_assume!(height != 0 || beyond);
            let expected = if inside { [height > 0, height < 0] } else { [false; 2] };
            let found = Parity::new(&[facet]).inside(point);
            prop_assert_eq!([found[2 * axis], found[2 * axis + 1]], expected);
        }
    }

    #[test]
    fn only_the_ray_towards_a_single_facet_is_odd() {
        let facet = [[0, 0, 0], [8, 0, 0], [0, 8, 0]];
        let parity = Parity::new(&[facet]);
        assert_eq!(parity.inside([2, 2, -3]), [false, false, false, false, true, false]);
        assert_eq!(parity.inside([2, 2, 3]), [false, false, false, false, false, true]);
        assert_eq!(parity.windings([2, 2, -3]), [0, 0, 0, 0, 1, 0]);
        assert_eq!(parity.windings([2, 2, 3]), [0, 0, 0, 0, 0, -1]);
        // Two copies of a facet cancel.
        assert_eq!(Parity::new(&[facet, facet]).inside([2, 2, 3]), [false; 6]);
    }

    /// The point is moved by eps to the right and by eps squared upwards.
    #[test]
    fn a_ray_through_an_edge_or_a_corner_is_decided_by_the_perturbation() {
        let facet = [[0, 0, 0], [8, 0, 0], [0, 8, 0]];
        for (x, y, crosses) in
            [(0, 2, true), (2, 0, true), (4, 4, false), (0, 0, true), (8, 0, false), (0, 8, false)]
        {
            let found = Parity::new(&[facet]).inside([x, y, -3]);
            assert_eq!(found, [false, false, false, false, crosses, false], "({x}, {y})");
        }
    }

    #[test]
    fn degenerate_facets_are_not_crossed() {
        let segment = [[0, 0, 0], [8, 8, 8], [4, 4, 4]];
        assert_eq!(Parity::new(&[segment]).inside([4, 4, 3]), [false; 6]);
        assert_eq!(Parity::new(&[]).inside([1, 2, 3]), [false; 6]);
    }
}
