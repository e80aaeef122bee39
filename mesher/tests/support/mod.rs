//! Test support: cases that small cubes of numbers can be drawn from, and both programs run on them.
#![allow(dead_code, missing_docs)]

use mesher::base::Division;
use mesher::case::{BoxSpec, Case, RootSpec};
use mesher::comm::{Solo, sim};
use mesher::ingest::Source;
use mesher::lattice::{Keep, Root};
use mesher::partition::{Partitioner, Weights};
use mesher::sides::Ambiguous;
use mesher::{Options, words};
use proptest::prelude::*;

pub mod symmetry;

pub type Facet = [[f32; 3]; 3];

/// A case on a root of edge 64 at the origin, so that whole numbers are multiples of level-6 cells.
#[derive(Clone, Debug)]
pub struct Small {
    pub facets: Vec<Facet>,
    pub root: Root,
    pub spacing_min: f64,
    pub layer_cells_min: u32,
    pub keep: Keep,
    pub keep_crossing: bool,
    pub boxes: Vec<BoxSpec>,
}

impl Small {
    pub fn mesher_case(&self) -> Case {
        Case {
            source: Source::Given(self.facets.clone()),
            spacing_min: self.spacing_min,
            layer_cells_min: self.layer_cells_min,
            keep: self.keep,
            keep_crossing: self.keep_crossing,
            root: RootSpec::Exact(self.root),
            boxes: self.boxes.clone(),
        }
    }

    pub fn reference_case(&self) -> reference::Case {
        reference::Case {
            facets: self.facets.iter().map(|f| f.map(|v| v.map(f64::from))).collect(),
            root: reference::Root { origin: self.root.origin, edge: self.root.edge },
            spacing_min: self.spacing_min,
            layer_cells_min: self.layer_cells_min,
            keep: match self.keep {
                Keep::Outside => reference::Keep::Outside,
                Keep::Inside => reference::Keep::Inside,
                Keep::All => reference::Keep::All,
            },
            keep_crossing: self.keep_crossing,
            boxes: self
                .boxes
                .iter()
                .map(|b| reference::BoxSpec { min: b.min, max: b.max, spacing: b.spacing })
                .collect(),
        }
    }

    /// Leaf words by the reference.
    pub fn reference(&self, ungraded: bool) -> Vec<u64> {
        let case = self.reference_case();
        let mesh = if ungraded { reference::base_tree(&case) } else { reference::mesh(&case) };
        mesh.expect("the case is good").words
    }

    /// Leaf words by the mesher on one rank.
    pub fn solo(&self, ungraded: bool) -> Vec<u64> {
        words(&self.mesher_case(), &options(division(Partitioner::Morton, None), ungraded), &Solo)
            .expect("the case is good")
            .0
    }

    /// Leaf words by the mesher on simulated ranks, merged; each rank's must be sorted.
    pub fn ranks(&self, ranks: usize, seed: u64, division: Division, ungraded: bool) -> Vec<u64> {
        self.outcome(&Run { ranks, seed, division }, ungraded).words
    }

    /// What the mesher makes of the case when it is run like this.
    pub fn outcome(&self, run: &Run, ungraded: bool) -> Outcome {
        let options = options(run.division, ungraded);
        let case = self.mesher_case();
        let parts =
            sim::run(run.ranks, run.seed, |c| words(&case, &options, c).expect("the case is good"));
        let ambiguous = parts[0].1;
        assert!(parts.iter().all(|p| p.1 == ambiguous), "ranks must agree on what is ambiguous");
        assert!(parts.iter().all(|p| p.0.is_sorted()), "parts must be sorted");
        let mut words: Vec<u64> = parts.into_iter().flat_map(|p| p.0).collect();
        words.sort_unstable();
        Outcome { words, ambiguous }
    }

    /// The nearest case on a root of edge 64 at the origin whose coordinates are multiples of 1/128: they
    /// are lattice points, and remain so, as f32 too, when they are mirrored, moved by as much, or
    /// halved.
    pub fn on_lattice(mut self) -> Self {
        let near = |x: f32| (x * 128.0).round() / 128.0;
        self.facets.iter_mut().for_each(|f| *f = f.map(|v| v.map(near)));
        for b in &mut self.boxes {
            let near = |x: f64| (x * 128.0).round() / 128.0;
            (b.min, b.max) = (b.min.map(near), b.max.map(near));
        }
        self.spacing_min *= 64.0 / self.root.edge;
        self.root = Root { origin: [0.0; 3], edge: 64.0 };
        self
    }

    /// The case with other facets.
    pub fn with(&self, facets: Vec<Facet>) -> Self {
        Self { facets, ..self.clone() }
    }
}

/// How to run the mesher: nothing of it may change the mesh.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    pub ranks: usize,
    pub seed: u64,
    pub division: Division,
}

impl Run {
    pub const SOLO: Self = Self {
        ranks: 1,
        seed: 0,
        division: Division {
            partitioner: Partitioner::Morton,
            weights: Weights::Area,
            level_base: None,
        },
    };
}

/// What the mesher made of a case.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    pub words: Vec<u64>,
    pub ambiguous: Option<Ambiguous>,
}

/// Runs of all kinds, on few ranks mostly.
pub fn run() -> impl Strategy<Value = Run> {
    let ranks = prop_oneof![2 => Just(1usize), 4 => 2usize..9, 1 => 9usize..65];
    let partitioner = prop_oneof![Just(Partitioner::Metis), Just(Partitioner::Morton)];
    let weights = prop_oneof![Just(Weights::Area), Just(Weights::Unit)];
    let level_base = prop_oneof![1 => Just(None), 2 => (0u32..6).prop_map(Some)];
    (ranks, any::<u64>(), partitioner, weights, level_base).prop_map(
        |(ranks, seed, partitioner, weights, level_base)| Run {
            ranks,
            seed,
            division: Division { partitioner, weights, level_base },
        },
    )
}

/// As many cases as asked for by `PROPTEST_CASES`, else `cases`.
pub fn config(cases: u32) -> ProptestConfig {
    let asked = std::env::var("PROPTEST_CASES").ok().and_then(|n| n.parse().ok());
    ProptestConfig {
        cases: asked.unwrap_or(cases),
        max_shrink_iters: 300,
        ..ProptestConfig::default()
    }
}

pub fn division(partitioner: Partitioner, level_base: Option<u32>) -> Division {
    Division { partitioner, weights: Weights::Area, level_base }
}

pub fn options(division: Division, ungraded: bool) -> Options {
    Options { division, ungraded, out: None }
}

/// The first differing leaf, as people can read it.
pub fn first_difference(a: &[u64], b: &[u64]) -> String {
    let show = |w: Option<&u64>| {
        w.map_or("nothing".into(), |&w| {
            let l = (w >> 2 & 31) as u32;
            format!(
                "{} (level {l}, side {})",
                mesher::octant::path(l, w >> 7 >> (3 * (19 - l))),
                w & 3
            )
        })
    };
    let at = a.iter().zip(b).position(|(x, y)| x != y).unwrap_or(a.len().min(b.len()));
    format!(
        "{} and {} leaves; first difference at {at}: {} against {}",
        a.len(),
        b.len(),
        show(a.get(at)),
        show(b.get(at))
    )
}

#[macro_export]
macro_rules! assert_same {
    ($a:expr, $b:expr, $($what:tt)+) => {
        let (a, b) = (&$a, &$b);
        prop_assert!(a == b, "{}: {}", format!($($what)+), support::first_difference(a, b));
    };
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

fn tetrahedron(v: [[f32; 3]; 4]) -> Vec<Facet> {
    vec![[v[0], v[1], v[2]], [v[0], v[3], v[1]], [v[0], v[2], v[3]], [v[1], v[3], v[2]]]
}

/// A coordinate: anywhere in and around the root, or on the lattice of level 6, or of level 3.
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

/// Closed bodies, of whole-number corners or any.
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

/// Facet soups of all kinds.
pub fn soup() -> impl Strategy<Value = Vec<Facet>> {
    let facet = prop_oneof![
        6 => [point(), point(), point()],
        1 => point().prop_map(|p| [p; 3]),
        1 => (point(), point()).prop_map(|(p, q)| [p, q, p]),
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

fn extent_box() -> impl Strategy<Value = (BoxSpec, u32)> {
    (point(), [0.5f64..20.0, 0.5f64..20.0, 0.5f64..20.0], 1u32..8).prop_map(|(p, d, level)| {
        let min = p.map(f64::from);
        // Small boxes may be finer than the surface.
        let level = if d.iter().product::<f64>() > 1000.0 { level.min(6) } else { level };
        (
            BoxSpec {
                min,
                max: std::array::from_fn(|a| min[a] + d[a]),
                spacing: 64.0 / f64::from(1 << level),
            },
            level,
        )
    })
}

/// A case with these facets.
pub fn small(facets: impl Strategy<Value = Vec<Facet>>) -> impl Strategy<Value = Small> {
    let keep = prop_oneof![2 => Just(Keep::Outside), 2 => Just(Keep::Inside), 1 => Just(Keep::All)];
    let boxes = prop_oneof![3 => Just(vec![]), 2 => prop::collection::vec(extent_box(), 1..3)];
    let odd_root = prop_oneof![3 => Just(None), 1 => ([-9.0f64..3.0, -9.0f64..3.0, -9.0f64..3.0], 65.0f64..90.0).prop_map(Some)];
    (facets, 0u32..=6, 1.0f64..1.99, 1u32..=10, keep, any::<bool>(), boxes, odd_root).prop_map(
        |(facets, level, slack, layer_cells_min, keep, keep_crossing, boxes, odd_root)| {
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
                boxes: boxes.into_iter().map(|b| b.0).collect(),
            }
        },
    )
}
