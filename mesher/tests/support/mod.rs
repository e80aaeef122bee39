//! Test support: small cases, meshed by the mesher and by the reference.
#![allow(dead_code, missing_docs)]

use bricks::octant::position;
use mesher::Options;
use mesher::error::Error;
use mesher::input::case::{BoxSpec, Case, RootSpec};
use mesher::input::ingest::Source;
use mesher::input::lattice::{Enclosed, Keep, Root};
use mesher::partition::{Division, Partitioner, Weights};
use mesher::sides::{Ambiguous, EnclosedComponents, Summary};
use ranks::Solo;
use ranks::sim::Adversary;
use std::rc::Rc;

pub mod draw;
pub mod schedules;
pub mod words;

// Each test uses some of these.
#[allow(unused_imports)]
pub use draw::{closed, config, cuboid, leaky_on_rays, rooms, run, slit, small, soup, thin};
use schedules::{on_ranks, plain};
pub use words::words;

pub type Facet = [[f32; 3]; 3];

/// A small case, by default on a root of edge 64 at the origin, so that integers are multiples of level-6 cells.
#[derive(Clone, Debug)]
pub struct Small {
    pub facets: Vec<Facet>,
    pub root: Root,
    pub spacing_min: f64,
    pub layer_cells_min: u32,
    pub keep: Keep,
    pub keep_crossing: bool,
    pub boxes: Vec<BoxSpec>,
    pub seeds: Vec<[f64; 3]>,
    pub enclosed: Enclosed,
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
            seeds: self.seeds.clone(),
            enclosed: self.enclosed,
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
            seeds: self.seeds.clone(),
            enclosed: match self.enclosed {
                Enclosed::Delete => reference::Enclosed::Delete,
                Enclosed::Keep => reference::Enclosed::Keep,
            },
        }
    }

    /// Leaf words by the reference.
    pub fn reference(&self, ungraded: bool) -> Vec<u64> {
        self.reference_mesh(ungraded).expect("the case is good").words
    }

    fn reference_mesh(&self, ungraded: bool) -> Result<reference::Mesh, reference::Error> {
        let case = self.reference_case();
        if ungraded { reference::base_tree(&case) } else { reference::mesh(&case) }
    }

    /// The reference's result.
    pub fn reference_outcome(&self, ungraded: bool) -> Outcome {
        self.try_reference_outcome(ungraded).expect("the case is good")
    }

    /// As [`Small::reference_outcome`], for cases that may have unusable seeds.
    pub fn try_reference_outcome(&self, ungraded: bool) -> Result<Outcome, reference::Error> {
        let mesh = self.reference_mesh(ungraded)?;
        let ambiguous = mesh.ambiguous.map_or(Ambiguous::default(), |a| Ambiguous {
            count: a.components,
            example: Some(a.example),
        });
        let reference::Components { outside, inside, enclosed } = mesh.components;
        let reference::sides::EnclosedComponents { count, leaves, example } = enclosed;
        let enclosed = EnclosedComponents { count, leaves, example };
        // Nothing is deleted from T0, and the leaves that gradation makes tile the same places.
        let base = self.reference_mesh(true)?.words;
        let reaches_boundary =
            |side| base.iter().any(|&word| word & 3 == side && is_at_boundary(word));
        let is_known = self.seeds.is_empty() || self.keep != Keep::All;
        let inside_reaches_boundary = is_known && reaches_boundary(1);
        let is_seeded = self.keep == Keep::Outside && !self.seeds.is_empty();
        let flow_misses_boundary = is_seeded && !reaches_boundary(0);
        let summary = Summary {
            outside,
            inside,
            enclosed,
            ambiguous,
            inside_reaches_boundary,
            flow_misses_boundary,
        };
        Ok(Outcome { words: mesh.words, summary, leaks: mesh.leaks })
    }

    /// Leaf words by the mesher on one rank.
    pub fn solo(&self, ungraded: bool) -> Vec<u64> {
        words(&self.mesher_case(), &options(division(Partitioner::Morton, None), ungraded), &Solo)
            .expect("the case is good")
            .0
    }

    /// Leaf words by the mesher on simulated ranks, merged.
    pub fn ranks(&self, ranks: usize, seed: u64, division: Division, ungraded: bool) -> Vec<u64> {
        self.outcome(&Run { ranks, seed, division }, ungraded).words
    }

    /// The mesher's result with a run configuration.
    pub fn outcome(&self, run: &Run, ungraded: bool) -> Outcome {
        self.try_outcome(run, ungraded).expect("the case is good")
    }

    /// As [`Small::outcome`], for cases that may have unusable seeds.
    pub fn try_outcome(&self, run: &Run, ungraded: bool) -> Result<Outcome, Error> {
        let (case, options) = (self.mesher_case(), options(run.division, ungraded));
        let schedule = Adversary::new(run.seed);
        Ok(on_ranks(Rc::new(case), options, run.ranks, schedule, false, plain)?.outcome)
    }

    /// The nearest case on a root of edge 64 at the origin whose coordinates are multiples of 1/128. They are lattice
    /// points and exact in f32, and remain so when they are mirrored, translated by such multiples, or halved.
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

    /// The same case with other facets.
    pub fn with(&self, facets: Vec<Facet>) -> Self {
        Self { facets, ..self.clone() }
    }
}

/// A run configuration, on which the mesh must not depend.
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
            weights: Weights::Rebalance,
            level_base: None,
        },
    };
}

/// Whether the word is that of an inside leaf with a face on the root's boundary.
fn is_at_boundary(word: u64) -> bool {
    let edge = 1 << (19 - (word >> 2 & 31));
    position(word >> 7).iter().any(|&c| c == 0 || c + edge == 1 << 19)
}

/// A mesh: leaf words, a summary of its components, and its leaks.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    pub words: Vec<u64>,
    pub summary: Summary,
    pub leaks: Vec<reference::Leak>,
}

impl Outcome {
    /// The same with lattice coordinates of the examples.
    pub fn on_lattice(mut self, root: &Root) -> Self {
        let Summary { enclosed, ambiguous, .. } = &mut self.summary;
        for p in [&mut enclosed.example, &mut ambiguous.example].into_iter().flatten() {
            *p = root.nearest(*p).map(|c| c as f64);
        }
        self
    }
}

pub fn division(partitioner: Partitioner, level_base: Option<u32>) -> Division {
    Division { partitioner, weights: Weights::Rebalance, level_base }
}

pub fn options(division: Division, ungraded: bool) -> Options {
    Options { division, ungraded, ..Options::default() }
}

/// Describes the first leaf that differs.
pub fn first_difference(a: &[u64], b: &[u64]) -> String {
    let show = |w: Option<&u64>| {
        w.map_or("nothing".into(), |&w| {
            let l = (w >> 2 & 31) as u32;
            format!(
                "{} (level {l}, side {})",
                bricks::octant::path(l, w >> 7 >> (3 * (19 - l))),
                w & 3
            )
        })
    };
    let at = a.iter().zip(b).position(|(x, y)| x != y).unwrap_or(a.len().min(b.len()));
    format!(
        "{} and {} leaves; first difference at {at}: {} and {}",
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
        prop_assert!(a == b, "{}: {}", format!($($what)+), $crate::support::first_difference(a, b));
    };
}
