//! Cases on the lattice, leaves decoded from their words, second implementations of geometric predicates, and random inputs for property
//! tests.

pub mod dense;
use dense::CROSSING;
use proptest::array::uniform3;
use proptest::bool::weighted;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::TestRunner;
use reference::leaves::Tally;
use reference::{BoxSpec, Case, Enclosed, Keep, Root};
use std::ops::RangeInclusive;

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

#[derive(Clone, Copy, Debug)]
pub struct Leaf {
    /// Minimum corner and edge, in lattice units.
    pub min: [i64; 3],
    pub edge: i64,
    pub level: u32,
    pub side: u64,
    /// The Morton keys of the level-19 cells in the leaf.
    pub keys: (u64, u64),
}

impl Leaf {
    pub fn of(word: u64) -> Self {
        let (key, level) = (word >> 7, (word >> 2 & 31) as u32);
        let mut min = [0; 3];
        for bit in 0..57 {
            min[bit % 3] |= ((key >> bit & 1) << (bit / 3)) as i64 * 256;
        }
        let keys = (key, key + (1 << (3 * (19 - level))));
        Self { min, edge: ROOT_EDGE >> level, level, side: word & 3, keys }
    }

    pub fn parent(&self) -> Option<Self> {
        let level = self.level.checked_sub(1)?;
        let edge = 2 * self.edge;
        Some(Self { min: self.min.map(|x| x / edge * edge), edge, level, ..*self })
    }

    pub fn max(&self) -> [i64; 3] {
        self.min.map(|x| x + self.edge)
    }

    /// Whether the half-open cube contains a lattice point.
    pub fn has(&self, point: [i64; 3]) -> bool {
        (0..3).all(|a| (self.min[a]..self.max()[a]).contains(&point[a]))
    }

    pub fn contains(&self, other: &Leaf) -> bool {
        self.keys.0 <= other.keys.0 && other.keys.1 <= self.keys.1
    }

    /// Chebyshev distance of the closed cubes, in lattice units; 0 if they touch.
    pub fn distance(&self, other: &Leaf) -> i64 {
        let gap = |a: usize| (self.min[a] - other.max()[a]).max(other.min[a] - self.max()[a]);
        (0..3).map(gap).fold(0, i64::max)
    }

    pub fn is_crossed(&self, random: &RandomCase) -> bool {
        random.facets.iter().any(|facet| crosses_by_axes(facet, self.min, self.max()))
    }

    /// The greatest level of a box that the octant meets.
    pub fn level_of_boxes(&self, case: &Case) -> u32 {
        let meets = |min: [f64; 3], max: [f64; 3]| {
            (0..3).all(|a| (self.min[a] as f64) < max[a] && min[a] < self.max()[a] as f64)
        };
        let met = case.boxes.iter().filter(|b| meets(b.min, b.max));
        let level = |b: &BoxSpec| (0..=19).find(|&l| spacing(l) <= b.spacing).unwrap();
        met.map(level).max().unwrap_or(0)
    }
}

/// The leaves with these words.
pub fn leaves(words: &[u64]) -> Vec<Leaf> {
    words.iter().copied().map(Leaf::of).collect()
}

pub type Facet = [[i64; 3]; 3];

/// Tests `property` on random values of `inputs`, as many as the environment variable
/// `PROPTEST_CASES` gives or else `cases`. The seed of a failure is written to a file beside
/// `source`, the test's `file!()`.
///
/// # Panics
/// If the property panics, with the simplest failing value that was found.
pub fn for_all<S: Strategy>(
    source: &'static str,
    cases: u32,
    inputs: S,
    property: impl Fn(S::Value),
) {
    let cases = std::env::var("PROPTEST_CASES").map_or(cases, |n| n.parse().unwrap());
    let config = ProptestConfig {
        cases,
        source_file: Some(source),
        max_shrink_iters: 500,
        ..Default::default()
    };
    let tested = TestRunner::new(config).run(&inputs, |input| {
        property(input);
        Ok(())
    });
    if let Err(failure) = tested {
        panic!("{failure}");
    }
}

/// A facet with all coordinates in a range.
pub fn facet(range: RangeInclusive<i64>) -> impl Strategy<Value = Facet> {
    uniform3(uniform3(range))
}

/// A case, with its facets on the lattice and the level D of its surface.
#[derive(Clone, Debug)]
pub struct RandomCase {
    pub facets: Vec<Facet>,
    pub level_surface: u32,
    pub case: Case,
}

/// Cases of any facets, boxes and valid seeds, none of which requires a level beyond `finest`. Most
/// have no seeds.
pub fn cases(finest: u32) -> impl Strategy<Value = RandomCase> {
    let unit = ROOT_EDGE >> 5;
    let extent_box = (uniform3(0..=30_i64), uniform3(1..=12_i64), 0..=finest).prop_map(
        move |(min, size, level)| {
            let max: [i64; 3] = std::array::from_fn(|a| (min[a] + size[a]).min(32));
            box_of_level(min.map(|x| x * unit), max.map(|x| x * unit), level)
        },
    );
    let keep = select(vec![Keep::Outside, Keep::Inside, Keep::All]);
    let enclosed = select(vec![Enclosed::Delete, Enclosed::Keep]);
    let region = (keep, any::<bool>(), enclosed, seeds());
    (soup(), 1..=finest, vec(extent_box, 0..=2), 1..=4_u32, region).prop_map(
        move |(facets, level_surface, boxes, layer_cells_min, region)| {
            let (keep, keep_crossing, enclosed, seeds) = region;
            let case = case(&facets, level_surface);
            let mut case =
                Case { layer_cells_min, keep, keep_crossing, boxes, enclosed, seeds, ..case };
            if !case.seeds.is_empty() {
                let mut free = dense::base(&case, &facets, finest, level_surface);
                free.cells.retain(|cell| cell.side != CROSSING);
                case.seeds.retain(|&seed| free.contain(&free.cells, seed));
            }
            RandomCase { facets, level_surface, case }
        },
    )
}

/// Cases like those of [`cases`] for external flow, with a shell around the middle of the root as an
/// additional body. Most have enclosed space.
pub fn cases_with_a_cavity(finest: u32) -> impl Strategy<Value = RandomCase> {
    let unit = ROOT_EDGE >> 4;
    let outer = (uniform3(1..=2_i64), uniform3(14..=15_i64));
    let inner = (uniform3(4..=5_i64), uniform3(9..=11_i64));
    (cases(finest), outer, inner, 0..=unit).prop_map(move |(random, outer, inner, shift)| {
        let mut facets = random.facets;
        for (min, max) in [outer, inner] {
            facets.extend(block(min.map(|x| x * unit + shift), max.map(|x| x * unit + shift)));
        }
        let surface = case(&facets, finest);
        let Case { layer_cells_min, keep_crossing, boxes, enclosed, .. } = random.case;
        let keep = Keep::Outside;
        let case = Case { layer_cells_min, keep, keep_crossing, boxes, enclosed, ..surface };
        RandomCase { facets, level_surface: finest, case }
    })
}

/// No seeds or a few, half of them in cell planes.
fn seeds() -> impl Strategy<Value = Vec<[f64; 3]>> {
    let unit = ROOT_EDGE >> 5;
    let planes = uniform3(0..32_i64).prop_map(move |point| point.map(|x| x * unit));
    let point = prop_oneof![uniform3(0..ROOT_EDGE), planes];
    let point = point.prop_map(|point| point.map(|x| x as f64));
    prop_oneof![3 => Just(Vec::new()), 1 => vec(point, 1..=3)]
}

/// Facets of every kind: blocks, closed or with a hole, triangles, segments and points, in cell
/// planes and outside them, within the root and reaching out of it.
fn soup() -> impl Strategy<Value = Vec<Facet>> {
    (3..=5_u32).prop_flat_map(|level| {
        let unit = ROOT_EDGE >> level;
        let cells = 1_i64 << level;
        let shift = prop_oneof![Just(0), 0..=unit];
        let blocks = (uniform3(-1..=cells - 2), uniform3(2..=cells), shift).prop_map(
            move |(min, size, shift)| {
                let max: [i64; 3] = std::array::from_fn(|a| min[a] + size[a]);
                block(min.map(|x| x * unit + shift), max.map(|x| x * unit + shift))
            },
        );
        let indices = select(vec![[0, 1, 2], [0, 1, 2], [0, 1, 1], [0, 0, 0]]);
        let triangles = (facet(-2..=cells + 2), indices).prop_map(move |(vertices, indices)| {
            indices.map(|i: usize| vertices[i].map(|x| x * unit))
        });
        (vec(blocks, 0..=2), weighted(1.0 / 3.0), vec(triangles, 0..=3)).prop_map(
            |(blocks, has_hole, triangles)| {
                let mut facets = blocks.concat();
                if has_hole {
                    facets.pop();
                }
                facets.extend(triangles);
                facets
            },
        )
    })
}
