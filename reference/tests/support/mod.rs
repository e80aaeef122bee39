//! What several tests need: seeded numbers, and cases on the lattice.
#![allow(dead_code)] // Every test is a crate of its own and uses its share.

pub mod dense;

use reference::leaves::Tally;
use reference::{BoxSpec, Case, Keep, Root};

/// The root's edge in lattice units; also the edge of the cases' root, so that the user's units are
/// lattice units.
pub const ROOT_EDGE: i64 = 1 << 27;

/// Numbers that look random and are the same in every run.
pub struct Seeded(u64);

impl Seeded {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        // Knuth's linear congruential generator; its high bits are good enough.
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 33
    }

    /// A whole number of `range`.
    pub fn of(&mut self, range: std::ops::RangeInclusive<i64>) -> i64 {
        range.start() + (self.next() % (range.end() - range.start() + 1) as u64) as i64
    }

    /// Whether something with a chance of `one` in `many` happens.
    pub fn chance(&mut self, one: i64, many: i64) -> bool {
        self.of(1..=many) <= one
    }

    /// One of these.
    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.of(0..=from.len() as i64 - 1) as usize]
    }
}

/// A case without boxes whose root is the lattice cube, cut to `level` at the facets; everything is
/// kept and layers are one cell thick.
pub fn case(facets: &[[[i64; 3]; 3]], level: u32) -> Case {
    Case {
        facets: facets.iter().map(|facet| facet.map(|v| v.map(|x| x as f64))).collect(),
        root: Root { origin: [0.0; 3], edge: ROOT_EDGE as f64 },
        spacing_min: spacing(level),
        layer_cells_min: 1,
        keep: Keep::All,
        keep_crossing: true,
        boxes: Vec::new(),
    }
}

/// The spacing that asks for `level`.
pub fn spacing(level: u32) -> f64 {
    (ROOT_EDGE >> level) as f64
}

/// A box with `level` inside.
pub fn box_of_level(min: [i64; 3], max: [i64; 3], level: u32) -> BoxSpec {
    let corner = |c: [i64; 3]| c.map(|x| x as f64);
    BoxSpec { min: corner(min), max: corner(max), spacing: spacing(level) }
}

/// The twelve facets of a box.
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

/// Whether the facet and the box share a point, by separating axes: two convex sets of corners are
/// apart just if they are so along a face normal of either or a product of an edge of each. Axes of
/// length zero, as degenerate facets have them, separate nothing.
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
    let at = |p: &[i64; 3]| (0..3).map(|a| i128::from(p[a]) * i128::from(axis[a])).sum::<i128>();
    let along = points.iter().map(at);
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

/// Whether an odd number of facets is met downwards and upwards, by a second way: the displacement is
/// not infinitesimal but 2^-32 and 2^-64, and the place on the facet comes from the areas of the three
/// triangles that the point makes with its edges.
pub fn parities_by_areas(facets: &[[[i64; 3]; 3]], point: [i64; 3], axis: usize) -> [bool; 2] {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut odd = [false; 2];
    for facet in facets {
        // Area i is opposite vertex i: of the point and the two other vertices.
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

/// An eighth of the root's edge, for cases worked out by hand.
pub const UNIT: i64 = ROOT_EDGE / 8;

/// A point in units.
pub fn units(point: [i64; 3]) -> [i64; 3] {
    point.map(|x| x * UNIT)
}

/// The facets of a block, its corners in units.
pub fn block_of_units(min: [i64; 3], max: [i64; 3]) -> Vec<[[i64; 3]; 3]> {
    block(units(min), units(max))
}

/// Leaves by level, to level 4.
pub fn levels(words: &[u64]) -> [u64; 5] {
    let levels = Tally::of(words).leaves_by_level;
    assert!(levels[5..].iter().all(|&leaves| leaves == 0));
    levels[..5].try_into().unwrap()
}

/// Leaves outside, inside and crossing.
pub fn sides(words: &[u64]) -> [u64; 3] {
    Tally::of(words).leaves_by_side
}
