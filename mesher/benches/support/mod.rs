//! Fixed work for the benches: the mesher's kernels, each on the results of the preceding phases for an aircraft.
#![allow(dead_code, missing_docs)]

use bricks::brick::{flood, valid};
use bricks::brickset::BrickSet;
use bricks::digest;
use bricks::dilate::dilate_children;
use bricks::facet::{Facet, crossed};
use bricks::octant::ROOT_BITS;
use bricks::tree::Tree;
use mesher::grade::Gradation;
use mesher::input::case::{Case, RootSpec};
use mesher::input::ingest::{Slice, Source, read};
use mesher::input::lattice::{Bounds, Enclosed, Keep, Rules};
use mesher::input::quantise::FacetCounts;
use mesher::input::stl;
use mesher::output::stream::total;
use mesher::partition::ownership::Ownership;
use mesher::partition::{Division, Partitioner, Weights, curve};
use mesher::record::Counters;
use mesher::refine::{BinnedFacets, refine};
use mesher::sides::leaks::Leaks;
use mesher::sides::{Base, Sides, decide};
use mesher::{Mesh, Options};
use ranks::Solo;
use std::convert::Infallible;
use std::hint::black_box;

/// A kernel, and the number of elements that one run of it processes.
pub struct Kernel {
    pub name: &'static str,
    pub elements: u64,
    /// Does the work once. Returns a value that depends on all of it.
    pub run: Box<dyn FnMut() -> u64>,
}

/// A case around a generated shape. The finest cells are at most `1 / 2^finer` of its longest edge.
pub fn case(shape: &str, facets: usize, finer: i32, layer_cells_min: u32) -> Case {
    let generator = toml::from_str(&format!("shape = \"{shape}\"\nfacets = {facets}\n"));
    let facets = read(&Source::Generated(generator.expect("a shape")), &Solo).expect("its facets");
    let bounds = Bounds::of(&facets.facets);
    let longest = (0..3).map(|a| bounds.hi[a] - bounds.lo[a]).fold(0.0, f64::max);
    Case {
        source: Source::Given(facets.facets),
        spacing_min: longest / 2f64.powi(finer),
        layer_cells_min,
        keep: Keep::Outside,
        keep_crossing: true,
        root: RootSpec::Scale(8.0),
        boxes: vec![],
        seeds: Vec::new(),
        enclosed: Enclosed::Delete,
    }
}

/// One rank, nothing written.
pub fn options() -> Options {
    let (partitioner, weights) = (Partitioner::Morton, Weights::Area);
    let division = Division { partitioner, weights, level_base: None };
    Options { division, ..Options::default() }
}

/// Results of all phases for the aircraft.
struct Phases {
    given: Slice,
    facets: Vec<Facet>,
    rules: Rules,
    ownership: Ownership,
    binned: BinnedFacets,
    tree: Tree,
    mesh: Mesh,
}

impl Phases {
    fn new() -> Self {
        let case = case("uav", 20_000, 10, 4);
        let given = read(&case.source, &Solo).expect("facets");
        let rules = case.rules(&Bounds::of(&given.facets)).expect("a good case");
        let facets = rules
            .root
            .facets(given.facets.clone(), &Bounds::of(&given.facets), 0)
            .expect("near the root");
        let ownership = Ownership::solo();
        let binned = BinnedFacets::new(&facets);
        let (tree, _) = refine(&binned, &rules, &[curve::ALL]);
        let sides = sides(&tree, &ownership, &facets, &rules);
        let graded = graded(&tree, &sides, &rules, &ownership).split;
        let mesh = Mesh {
            facets: FacetCounts { total: given.total, margin: 1, digest: 0, rounding: 0.0 },
            rules: rules.clone(),
            ownership: Ownership::solo(),
            level_base: 0,
            partitioner: None,
            split: graded,
            crossing: tree.crossing.clone(),
            sides,
            leaks: Leaks::default(),
            bounds_nothing: false,
            bytes_graded: 0,
            is_base: false,
        };
        Self { given, facets, rules, ownership, binned, tree, mesh }
    }

    /// Crossing leaves of the surface level.
    fn surface(&self) -> &BrickSet {
        &self.tree.crossing[self.rules.level_surface as usize]
    }

    fn words(&self) -> Vec<u64> {
        let mut words = Vec::new();
        let Ok(_) = self.mesh.emit(|w| {
            words.extend_from_slice(w);
            Ok::<(), Infallible>(())
        });
        words
    }
}

/// All kernels, in the order of the phases.
pub fn kernels() -> Vec<Kernel> {
    let p: &'static Phases = Box::leak(Box::new(Phases::new()));
    let surface = p.rules.level_surface;
    let bricks = p.surface().len() as u64;
    let facets = p.facets.len() as u64;
    let words: &'static [u64] = p.words().leak();
    let leaves = words.len() as u64;
    let kernel = |name, elements, run: Box<dyn FnMut() -> u64>| Kernel { name, elements, run };
    vec![
        kernel("stl_read", facets, stl_read(&p.given)),
        kernel("crossed", facets, Box::new(|| brick_masks(&p.facets))),
        kernel("bin", facets, Box::new(|| drop_counted(BinnedFacets::new(black_box(&p.facets))))),
        kernel(
            "refine",
            facets,
            Box::new(|| refine(&p.binned, &p.rules, &[curve::ALL]).1.facet_brick_tests),
        ),
        kernel("flood", bricks, Box::new(move || floods(p.surface(), surface))),
        kernel(
            "sides",
            leaves_of(&p.tree),
            Box::new(|| sides(&p.tree, &p.ownership, &p.facets, &p.rules).summary.outside),
        ),
        kernel("dilate_3", bricks, Box::new(move || dilated(p.surface(), surface, 3))),
        kernel("dilate_9", bricks, Box::new(move || dilated(p.surface(), surface, 9))),
        kernel(
            "grade",
            leaves,
            Box::new(|| {
                let graded = graded(&p.tree, &p.mesh.sides, &p.rules, &p.ownership);
                graded.counters.octants_split_graded
            }),
        ),
        kernel(
            "leaves",
            leaves,
            Box::new(|| {
                let Ok(counts) = p.mesh.emit(|w| {
                    black_box(w);
                    Ok::<(), Infallible>(())
                });
                total(&counts)
            }),
        ),
        kernel("digest", leaves, Box::new(|| digest::digest(black_box(words)) as u64)),
    ]
}

/// Reads a binary STL file.
fn stl_read(given: &Slice) -> Box<dyn FnMut() -> u64> {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    geometries::write_stl_binary(&given.facets, &file).expect("room for it");
    let total = given.total;
    Box::new(move || {
        let stl = stl::open(file.path()).expect("what was just written");
        stl.read(0, total).expect("what was just written").len() as u64
    })
}

/// Tests each facet against the brick of about its own size that contains its first vertex.
fn brick_masks(facets: &[Facet]) -> u64 {
    facets.iter().fold(0, |all, f| {
        let widest = (0..3).map(|a| f.range(a).1 - f.range(a).0).max().unwrap_or(0).max(2);
        let l = (ROOT_BITS - widest.ilog2()).clamp(2, 19);
        let shift = ROOT_BITS + 2 - l;
        let at = f.v[0].map(|c| (i64::from(c) >> shift << shift).max(0));
        all.wrapping_add(crossed(black_box(f), at, l))
    })
}

/// Flood fill of the octants off the surface, in the bricks of the surface.
fn floods(set: &BrickSet, l: u32) -> u64 {
    let mut components = 0;
    for b in set.bricks() {
        let mut rest = !b.bits & valid(l);
        while rest != 0 {
            rest &= !flood(rest & rest.wrapping_neg(), rest);
            components += 1;
        }
    }
    components
}

fn dilated(set: &BrickSet, l: u32, radius: u32) -> u64 {
    dilate_children(l - 1, set.bricks(), radius).octants.len() as u64
}

fn graded<'a>(
    tree: &'a Tree,
    sides: &'a Sides,
    rules: &'a Rules,
    ownership: &'a Ownership,
) -> Gradation<'a> {
    let start = Gradation {
        split: tree.split.clone(),
        crossing: &tree.crossing,
        deleted: sides.deleted(),
        rules,
        ownership,
        comm: &Solo,
        counters: Counters::default(),
        bytes: 0,
    };
    start.graded()
}

fn drop_counted<T>(made: T) -> u64 {
    black_box(&made);
    1
}

/// Number of leaves of a base tree.
fn leaves_of(tree: &Tree) -> u64 {
    1 + 7 * tree.split.iter().map(BrickSet::count).sum::<u64>()
}

fn sides(tree: &Tree, ownership: &Ownership, facets: &[Facet], rules: &Rules) -> Sides {
    decide(&Base { tree, ownership, facets, rules, comm: &Solo }, &options(), true)
        .expect("a case without seeds")
        .sides
}
