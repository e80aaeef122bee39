//! Random bodies, facet soups, cases and run configurations.

use super::{Facet, Run, Small};
use mesher::input::case::BoxSpec;
use mesher::input::lattice::{Enclosed, Keep, Root};
use mesher::partition::{Division, Partitioner, Weights};
use proptest::prelude::*;

/// Run configurations of all kinds, mostly with few ranks.
pub fn run() -> impl Strategy<Value = Run> {
    let ranks = prop_oneof![2 => Just(1usize), 4 => 2usize..9, 1 => 9usize..65];
    let partitioner = prop_oneof![Just(Partitioner::Metis), Just(Partitioner::Morton)];
    let weights = prop_oneof![
        2 => Just(Weights::Rebalance),
        1 => Just(Weights::Area),
        1 => Just(Weights::Unit),
    ];
    let level_base = prop_oneof![2 => Just(None), 1 => (0u32..6).prop_map(Some)];
    let division =
        (partitioner, weights, level_base).prop_map(|(partitioner, weights, level_base)| {
            Division { partitioner, weights, level_base }
        });
    (ranks, any::<u64>(), division).prop_map(|(ranks, seed, division)| Run {
        ranks,
        seed,
        division,
    })
}

/// A configuration with `PROPTEST_CASES` cases, or `cases` if the variable is not set.
pub fn config(cases: u32) -> ProptestConfig {
    let asked = std::env::var("PROPTEST_CASES").ok().and_then(|n| n.parse().ok());
    ProptestConfig {
        cases: asked.unwrap_or(cases),
        max_shrink_iters: 300,
        ..ProptestConfig::default()
    }
}

/// An axis-parallel box as twelve facets.
pub fn cuboid(lo: [f32; 3], hi: [f32; 3]) -> Vec<Facet> {
    let mut out = Vec::new();
    for a in 0..3 {
        let (u, w) = ((a + 1) % 3, (a + 2) % 3);
        for at in [lo[a], hi[a]] {
            let p = |x: f32, y: f32| {
                let mut v = [at; 3];
                v[u] = x;
                v[w] = y;
                v
            };
            out.push([p(lo[u], lo[w]), p(hi[u], lo[w]), p(hi[u], hi[w])]);
            out.push([p(lo[u], lo[w]), p(hi[u], hi[w]), p(lo[u], hi[w])]);
        }
    }
    out
}

/// A box with a slit of some width in its upper face, in the root of edge 64 with cells of edge 2.
pub fn slit(width: f32, at: f32, keep: Keep, seeds: Vec<[f64; 3]>) -> Small {
    let (lo, hi) = ([9.0, 11.0, 10.0], [33.0, 35.0, 31.0]);
    let mut facets = cuboid(lo, hi);
    facets.retain(|f| !f.iter().all(|v| v[2] == hi[2]));
    for f in &mut facets {
        // All normals point outwards.
        if (0..3).any(|a| f.iter().all(|v| v[a] == lo[a])) {
            f.swap(0, 1);
        }
    }
    for [x0, x1] in [[lo[0], at], [at + width, hi[0]]] {
        let p = |x, y| [x, y, hi[2]];
        facets.push([p(x0, lo[1]), p(x1, lo[1]), p(x1, hi[1])]);
        facets.push([p(x0, lo[1]), p(x1, hi[1]), p(x0, hi[1])]);
    }
    Small {
        facets,
        root: Root { origin: [0.0; 3], edge: 64.0 },
        spacing_min: 2.0,
        layer_cells_min: 1,
        keep,
        keep_crossing: true,
        boxes: vec![],
        seeds,
        enclosed: Enclosed::Delete,
    }
}

/// A box with a partition across it, which has a slit from `at` in the direction y; cells of edge 2 at the surface, as in [`slit`].
pub fn rooms(width: f32, at: f32, keep: Keep, seeds: Vec<[f64; 3]>) -> Small {
    let (lo, hi, x) = ([9.0, 11.0, 10.0], [49.0, 35.0, 31.0], 29.0);
    let mut facets = cuboid(lo, hi);
    for [y0, y1] in [[lo[1], at], [at + width, hi[1]]] {
        let p = |y, z| [x, y, z];
        facets.push([p(y0, lo[2]), p(y1, lo[2]), p(y1, hi[2])]);
        facets.push([p(y0, lo[2]), p(y1, hi[2]), p(y0, hi[2])]);
    }
    Small { facets, ..slit(width, at, keep, seeds) }
}

fn tetrahedron(v: [[f32; 3]; 4]) -> Vec<Facet> {
    vec![[v[0], v[1], v[2]], [v[0], v[3], v[1]], [v[0], v[2], v[3]], [v[1], v[3], v[2]]]
}

/// A coordinate: anywhere in or near the root, or a multiple of the cells of level 6 or 3.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => -3.0f32..67.0,
        3 => (0i32..=64).prop_map(|v| v as f32),
        1 => (0i32..=8).prop_map(|v| 8.0 * v as f32),
        1 => -30.0f32..94.0,
    ]
}

fn point() -> impl Strategy<Value = [f32; 3]> {
    [coordinate(), coordinate(), coordinate()]
}

/// Closed bodies: boxes with integer corners, spheres, tetrahedra.
pub fn closed() -> impl Strategy<Value = Vec<Facet>> {
    let corner = || [2i32..62, 2i32..62, 2i32..62];
    let boxed = (corner(), [1i32..40, 1i32..40, 1i32..40]).prop_map(|(lo, d)| {
        let hi: [i32; 3] = std::array::from_fn(|a| (lo[a] + d[a]).min(63));
        cuboid(lo.map(|c| c as f32), hi.map(|c| c as f32))
    });
    let sphere = (20usize..400, 4.0f32..28.0, [20.0f32..44.0, 20.0f32..44.0, 20.0f32..44.0])
        .prop_map(|(facets, r, c)| {
            let text = format!("shape = \"sphere\"\nfacets = {facets}\n");
            let g: geometries::Generator = toml::from_str(&text).expect("a sphere");
            let unit = g.facets().expect("a sphere's facets");
            unit.into_iter()
                .map(|f| f.map(|v| std::array::from_fn(|a| v[a] * r * 2.0 + c[a])))
                .collect()
        });
    let tetra = [point(), point(), point(), point()].prop_map(tetrahedron);
    prop_oneof![2 => boxed, 2 => sphere, 1 => tetra]
}

/// A facet of a few lattice units near a corner of cells: touches cells, or misses them by the smallest possible
/// distance.
fn near_miss() -> impl Strategy<Value = Facet> {
    let corner = prop::sample::select(vec![0.0f32, 1.0, 2.0]);
    // On a root of edge 64 a lattice unit is 2^-21, which f32 resolves four times up to 2, and twice beyond.
    let vertex =
        || [-4i32..=4, -4i32..=4, -4i32..=4].prop_map(|k| k.map(|k| k as f32 / 2_097_152.0));
    let vertices = [vertex(), vertex(), vertex()];
    ([corner.clone(), corner.clone(), corner], vertices)
        .prop_map(|(c, f)| f.map(|v| std::array::from_fn(|a| c[a] + v[a])))
}

/// A facet without area: two points, and one of them again or a point between them, in any order.
fn segment() -> impl Strategy<Value = Facet> {
    // Multiples of four, so that quarter points are exact.
    let end = || [-1i32..=16, -1i32..=16, -1i32..=16].prop_map(|p| p.map(|c| 4 * c));
    let between = (end(), end(), 0..=4).prop_map(|(p, q, k)| {
        let m = std::array::from_fn(|a| p[a] + (q[a] - p[a]) / 4 * k);
        [p, q, m].map(|v| v.map(|c| c as f32))
    });
    prop_oneof![(point(), point()).prop_map(|(p, q)| [p, q, p]), between]
        .prop_flat_map(|f| Just(f.to_vec()).prop_shuffle())
        .prop_map(|f| [f[0], f[1], f[2]])
}

/// Facet soups of all kinds.
pub fn soup() -> impl Strategy<Value = Vec<Facet>> {
    let facet = prop_oneof![
        6 => [point(), point(), point()],
        3 => near_miss(),
        1 => point().prop_map(|p| [p; 3]),
        1 => segment(),
    ];
    let leaky = (closed(), any::<prop::sample::Index>()).prop_map(|(mut f, i)| {
        f.remove(i.index(f.len()));
        f
    });
    prop_oneof![
        1 => Just(Vec::new()),
        2 => prop::collection::vec(facet, 1..12),
        3 => closed(),
        2 => leaky,
        2 => (closed(), closed()).prop_map(|(mut a, b)| { a.extend(b); a }),
    ]
}

fn extent_box() -> impl Strategy<Value = BoxSpec> {
    let anywhere = (point(), [0.5f64..20.0, 0.5f64..20.0, 0.5f64..20.0])
        .prop_map(|(p, d)| (p.map(f64::from), d));
    let on_cells = ([-2i32..62, -2i32..62, -2i32..62], [1i32..20, 1i32..20, 1i32..20])
        .prop_map(|(p, d)| (p.map(f64::from), d.map(f64::from)));
    (prop_oneof![anywhere, on_cells], 1u32..8).prop_map(|((min, d), level)| {
        // Small boxes may be finer than the surface.
        let level = if d.iter().product::<f64>() > 1000.0 { level.min(6) } else { level };
        let max = std::array::from_fn(|a| min[a] + d[a]);
        BoxSpec { min, max, spacing: 64.0 / f64::from(1 << level) }
    })
}

/// A case with these facets.
pub fn small(facets: impl Strategy<Value = Vec<Facet>>) -> impl Strategy<Value = Small> {
    let keep = prop_oneof![2 => Just(Keep::Outside), 2 => Just(Keep::Inside), 1 => Just(Keep::All)];
    let boxes = prop_oneof![3 => Just(vec![]), 2 => prop::collection::vec(extent_box(), 1..3)];
    let odd_root = prop_oneof![3 => Just(None), 1 => ([-9.0f64..3.0, -9.0f64..3.0, -9.0f64..3.0], 65.0f64..90.0).prop_map(Some)];
    let enclosed = prop_oneof![Just(Enclosed::Delete), Just(Enclosed::Keep)];
    let keep = (keep, any::<bool>(), enclosed);
    (facets, 0u32..=6, 1.0f64..1.99, 1u32..=10, keep, boxes, odd_root).prop_map(
        |(facets, level, slack, layer_cells_min, keep, boxes, odd_root)| {
            let (keep, keep_crossing, enclosed) = keep;
            let root = odd_root.map_or(Root { origin: [0.0; 3], edge: 64.0 }, |(origin, edge)| {
                Root { origin, edge }
            });
            let spacing_min = root.edge / f64::from(1 << level) * slack;
            Small {
                facets,
                root,
                spacing_min,
                layer_cells_min,
                keep,
                keep_crossing,
                boxes,
                seeds: Vec::new(),
                enclosed,
            }
        },
    )
}

/// Plates about as thin as cells, with extent boxes finer than their surface: deleted leaves lie between kept
/// leaves that are few cells apart.
pub fn thin() -> impl Strategy<Value = Small> {
    let reach =
        || prop_oneof![Just((-10i32, 74i32)), (0i32..50, 2i32..30).prop_map(|(a, d)| (a, a + d))];
    let plate = (0usize..3, 0i32..120, 1i32..24, reach(), reach()).prop_map(
        |(axis, at, thickness, (u0, u1), (w0, w1))| {
            let halves = |p: [i32; 3]| p.map(|c| c as f32 / 2.0);
            let (mut lo, mut hi) = ([0; 3], [0; 3]);
            (lo[axis], hi[axis]) = (at, at + thickness);
            (lo[(axis + 1) % 3], hi[(axis + 1) % 3]) = (2 * u0, 2 * u1);
            (lo[(axis + 2) % 3], hi[(axis + 2) % 3]) = (2 * w0, 2 * w1);
            cuboid(halves(lo), halves(hi))
        },
    );
    let boxes = prop::collection::vec(
        ([0i32..62, 0i32..62, 0i32..62], [1i32..24, 1i32..24, 1i32..24], 1u32..4),
        1..4,
    );
    let keep = prop_oneof![Just(Keep::Outside), Just(Keep::Inside)];
    (plate, 1u32..5, boxes, 1u32..5, keep, any::<bool>()).prop_map(
        |(facets, level, boxes, layer_cells_min, keep, keep_crossing)| {
            let extent = |(min, d, finer): ([i32; 3], [i32; 3], u32)| BoxSpec {
                min: min.map(f64::from),
                max: std::array::from_fn(|a| f64::from(min[a] + d[a])),
                spacing: 64.0 / f64::from(1 << (level + finer).min(6)),
            };
            Small {
                facets,
                root: Root { origin: [0.0; 3], edge: 64.0 },
                spacing_min: 64.0 / f64::from(1 << level),
                layer_cells_min,
                keep,
                keep_crossing,
                boxes: boxes.into_iter().map(extent).collect(),
                seeds: Vec::new(),
                enclosed: Enclosed::Delete,
            }
        },
    )
}

/// Open facet soups whose edges and vertices lie on the rays from the centroids of coarse leaves.
pub fn leaky_on_rays() -> impl Strategy<Value = Small> {
    let point = || [-1i32..10, -1i32..10, -1i32..10].prop_map(|p| p.map(|c| 8.0 * c as f32));
    let facets = prop::collection::vec([point(), point(), point()], 1..10);
    (facets, 1u32..5, any::<bool>()).prop_map(|(facets, level, all)| Small {
        facets,
        root: Root { origin: [0.0; 3], edge: 64.0 },
        spacing_min: 64.0 / f64::from(1 << level),
        layer_cells_min: 1,
        keep: if all { Keep::All } else { Keep::Outside },
        keep_crossing: true,
        boxes: vec![],
        seeds: Vec::new(),
        enclosed: Enclosed::Delete,
    })
}
