//! An oct-tree mesher on `bempp_octree::Octree`, which refines where there are points: facets are sampled at half the
//! spacing. Run by itself or by mpirun; every rank samples its part of the facets and writes its part of the leaves.
//!
//!     bempp-mesher CASE [--out DIR] [--json FILE]

mod report;

use bempp_octree::constants::DEEPEST_LEVEL;
use bempp_octree::{MortonKey, Octree, Point};
use contract::case::Case;
use contract::lattice::Root;
use contract::octant::Octant;
use contract::word::{self, Leaf, Side};
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives};
use report::Clock;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The command line.
struct Options {
    case: PathBuf,
    out: Option<PathBuf>,
    json: Option<PathBuf>,
}

fn main() -> ExitCode {
    let Some(options) = options() else {
        eprintln!("usage: bempp-mesher CASE [--out DIR] [--json FILE]");
        return ExitCode::from(2);
    };
    let universe = mpi::initialize().expect("MPI is initialised once");
    let comm = universe.world();
    // A rank that unwinds would wait in MPI_Finalize for the others, which wait for it.
    std::panic::set_hook(Box::new(|panic| {
        eprintln!("bempp-mesher: {panic}");
        SimpleCommunicator::world().abort(70)
    }));
    match mesh(&options, &comm) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("bempp-mesher: {why}");
            comm.abort(2)
        }
    }
}

fn options() -> Option<Options> {
    let mut words = std::env::args().skip(1);
    let mut options = Options { case: words.next()?.into(), out: None, json: None };
    while let Some(word) = words.next() {
        let value = match word.as_str() {
            "--out" => &mut options.out,
            "--json" => &mut options.json,
            _ => return None,
        };
        *value = Some(words.next()?.into());
    }
    Some(options)
}

fn mesh(options: &Options, comm: &impl CommunicatorCollectives) -> Result<(), String> {
    let case = Case::read(&options.case).map_err(|error| error.to_string())?;
    let mut clock = Clock::start();
    let points = points(&case, comm);
    clock.end("search");
    // A leaf with any point is split down to the surface level.
    let tree = Octree::new(&points, case.level_surface.into(), 0, comm);
    clock.end("tree");
    let mut words: Vec<u64> = tree.leaf_keys().iter().map(word_of).collect();
    words.sort_unstable();
    if let Some(out) = &options.out {
        write(out, comm.rank(), &words).map_err(|error| format!("{}: {error}", out.display()))?;
    }
    match &options.json {
        Some(json) => report::write(json, &clock, &words, comm)
            .map_err(|error| format!("{}: {error}", json.display())),
        None => Ok(()),
    }
}

fn write(out: &Path, rank: i32, words: &[u64]) -> std::io::Result<()> {
    fs::create_dir_all(out)?;
    contract::npy::write(&out.join(format!("leaves-{rank:05}.npy")), words)
}

/// The samples of this rank.
fn points(case: &Case, comm: &impl Communicator) -> Vec<Point> {
    let (rank, ranks) = (comm.rank() as usize, comm.size() as usize);
    let spacing = case.root.edge / f64::from(1u32 << case.level_surface);
    let mut points = Vec::new();
    for facet in case.facets.iter().skip(rank).step_by(ranks) {
        sample(facet.map(|vertex| vertex.map(f64::from)), spacing / 2.0, &mut points);
    }
    if rank == 0 {
        points.extend(corners(&case.root));
    }
    points.into_iter().map(|at| Point::new(at, 0)).collect()
}

/// Adds points of a facet whose distances along its edges are at most `pitch`.
fn sample([a, b, c]: [[f64; 3]; 3], pitch: f64, points: &mut Vec<[f64; 3]>) {
    let difference =
        |p: [f64; 3], q: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| q[i] - p[i]) };
    let (u, v, w) = (difference(a, b), difference(a, c), difference(b, c));
    let length = |d: [f64; 3]| d.iter().map(|x| x * x).sum::<f64>().sqrt();
    let n = (length(u).max(length(v)).max(length(w)) / pitch).ceil().max(1.0) as u32;
    for i in 0..=n {
        for j in 0..=n - i {
            let (s, t) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
            points.push(std::array::from_fn(|axis| a[axis] + s * u[axis] + t * v[axis]));
        }
    }
}

/// Two points that make the root the bounding box of the tree, which the crate enlarges by the cell of its deepest level.
fn corners(root: &Root) -> [[f64; 3]; 2] {
    let inset = (1.0 - 1.0 / (1.0 + 1.0 / f64::from(1u32 << DEEPEST_LEVEL))) / 2.0 * root.edge;
    [root.origin.map(|x| x + inset), root.origin.map(|x| x + root.edge - inset)]
}

fn word_of(key: &MortonKey) -> u64 {
    let (level, index) = key.decode();
    let corner = index.map(|x| (x as u32) << (19 - level));
    word::encode(&Leaf { octant: Octant { corner, level: level as u8 }, side: Side::Outside })
}
