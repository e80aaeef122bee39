//! Cases on the lattice, second implementations of geometric predicates, and random inputs.

pub mod dense;
pub mod leaf;
pub mod random;

use reference::leaves::Tally;
use reference::{BoxSpec, Case, Enclosed, Keep, Root};

/// The edge of the root in lattice units. The root of every case here has this edge, so the user's
/// unit is the lattice unit.
pub const ROOT_EDGE: i64 = 1 << 27;

/// A case without boxes whose root is the lattice cube and whose surface has level `level`. All
/// leaves are kept, and layers are one cell thick.
pub fn case(facets: &[[[i64; 3]; 3]], level: u32) -> Case {
    Case {
        facets: facets.iter().map(|facet| facet.map(|v| v.map(|x| x as f64))).collect(),
        root: Root { origin: [0.0; 3], edge: ROOT_EDGE as f64 },
        spacing_min: spacing(level),
        layer_cells_min: 1,
        keep: Keep::All,
        keep_crossing: true,
        boxes: Vec::new(),
        seeds: Vec::new(),
        enclosed: Enclosed::Delete,
    }
}

/// The greatest spacing with this level.
pub fn spacing(level: u32) -> f64 {
    (ROOT_EDGE >> level) as f64
}

/// An extent box with level `level`.
pub fn box_of_level(min: [i64; 3], max: [i64; 3], level: u32) -> BoxSpec {
    let corner = |c: [i64; 3]| c.map(|x| x as f64);
    BoxSpec { min: corner(min), max: corner(max), spacing: spacing(level) }
}

/// The surface of a box, as twelve facets.
pub fn block(min: [i64; 3], max: [i64; 3]) -> Vec<[[i64; 3]; 3]> {
    let mut facets = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for plane in [min[axis], max[axis]] {
            let corner = |x: i64, y: i64| {
                let mut corner = [plane; 3];
                (corner[u], corner[v]) = (x, y);
                corner
            };
            let [a, b, c, d] = [
                corner(min[u], min[v]),
                corner(max[u], min[v]),
                corner(max[u], max[v]),
                corner(min[u], max[v]),
            ];
            facets.extend([[a, b, c], [a, c, d]]);
        }
    }
    facets
}

/// Whether the facet and the box share a point, by separating axes: two convex polyhedra are
/// disjoint if and only if their projections on a face normal of either or on the cross product of
/// an edge of each are disjoint. Degenerate facets produce axes of length zero, which separate
/// nothing.
pub fn crosses_by_axes(facet: &[[i64; 3]; 3], min: [i64; 3], max: [i64; 3]) -> bool {
    let corners: [[i64; 3]; 8] = std::array::from_fn(|i| {
        std::array::from_fn(|a| if i >> a & 1 == 0 { min[a] } else { max[a] })
    });
    let edges = [minus(facet[1], facet[0]), minus(facet[2], facet[1]), minus(facet[0], facet[2])];
    let units = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    let mut axes = vec![cross(edges[0], edges[1])];
    axes.extend(units);
    axes.extend(edges.iter().flat_map(|&edge| units.map(|unit| cross(edge, unit))));
    axes.into_iter().all(|axis| {
        let (facet_lo, facet_hi) = range(facet, axis);
        let (box_lo, box_hi) = range(&corners, axis);
        facet_lo <= box_hi && box_lo <= facet_hi
    })
}

fn range(points: &[[i64; 3]], axis: [i64; 3]) -> (i128, i128) {
    let project =
        |p: &[i64; 3]| (0..3).map(|a| i128::from(p[a]) * i128::from(axis[a])).sum::<i128>();
    let along = points.iter().map(project);
    (along.clone().min().unwrap(), along.max().unwrap())
}

pub fn minus(p: [i64; 3], q: [i64; 3]) -> [i64; 3] {
    std::array::from_fn(|a| p[a] - q[a])
}

pub fn cross(p: [i64; 3], q: [i64; 3]) -> [i64; 3] {
    std::array::from_fn(|a| {
        let (u, v) = ((a + 1) % 3, (a + 2) % 3);
        p[u] * q[v] - p[v] * q[u]
    })
}

/// Whether the rays from `point` in the negative and the positive direction intersect an odd number
/// of facets, by a second method. The displacements are 2^-32 and 2^-64 instead of infinitesimal,
/// and barycentric coordinates give the position on the facet.
pub fn parities_by_areas(facets: &[[[i64; 3]; 3]], point: [i64; 3], axis: usize) -> [bool; 2] {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut odd = [false; 2];
    for facet in facets {
        // Area i is that of the triangle of the point and the two vertices other than vertex i.
        let areas: [(i128, i128); 3] = std::array::from_fn(|i| {
            let (p, q) = (facet[(i + 1) % 3], facet[(i + 2) % 3]);
            let (du, dv) = (i128::from(q[u] - p[u]), i128::from(q[v] - p[v]));
            let area = du * i128::from(point[v] - p[v]) - dv * i128::from(point[u] - p[u]);
            (area, (area << 64) - (dv << 32) + du)
        });
        let all = |sign: i128| areas.iter().all(|&(_, displaced)| displaced.signum() == sign);
        let area: i128 = areas.iter().map(|&(area, _)| area).sum();
        if area == 0 || !(all(1) || all(-1)) {
            continue;
        }
        let weighted: i128 = (0..3).map(|i| areas[i].0 * i128::from(facet[i][axis])).sum();
        let above = weighted * area.signum() > i128::from(point[axis]) * area.abs();
        odd[usize::from(above)] ^= true;
    }
    odd
}

/// An eighth of the root's edge, the unit of cases that are verified by hand.
pub const UNIT: i64 = ROOT_EDGE / 8;

/// A point given in units.
pub fn units(point: [i64; 3]) -> [i64; 3] {
    point.map(|x| x * UNIT)
}

/// The surface of a block with corners given in units.
pub fn block_of_units(min: [i64; 3], max: [i64; 3]) -> Vec<[[i64; 3]; 3]> {
    block(units(min), units(max))
}

/// Numbers of leaves of levels 0 to 4.
pub fn levels(words: &[u64]) -> [u64; 5] {
    let levels = Tally::of(words).leaves_by_level;
    assert!(levels[5..].iter().all(|&leaves| leaves == 0));
    levels[..5].try_into().unwrap()
}

/// Numbers of outside, inside and crossing leaves.
pub fn sides(words: &[u64]) -> [u64; 3] {
    Tally::of(words).leaves_by_side
}
