//! An oct-tree mesher on `bempp_octree::Octree`, which refines where there are points: facets are sampled at half the
//! spacing. Run by itself or by mpirun; every rank samples its part of the facets and writes its part of the leaves.
//!
//!     bempp-mesher CASE DIR

use bempp_octree::constants::DEEPEST_LEVEL;
use bempp_octree::{MortonKey, Octree, Point};
use contract::case::Case;
use contract::lattice::Root;
use contract::octant::Octant;
use contract::word::{self, Leaf, Side};
use mpi::traits::{Communicator, CommunicatorCollectives};
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, case, out] = &arguments[..] else {
        eprintln!("usage: bempp-mesher CASE DIR");
        return ExitCode::from(2);
    };
    let universe = mpi::initialize().expect("MPI is initialised once");
    let comm = universe.world();
    match mesh(Path::new(case), Path::new(out), &comm) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("bempp-mesher: {why}");
            comm.abort(2)
        }
    }
}

fn mesh(case: &Path, out: &Path, comm: &impl CommunicatorCollectives) -> Result<(), String> {
    let case = Case::read(case).map_err(|error| error.to_string())?;
    let (rank, ranks) = (comm.rank() as usize, comm.size() as usize);
    let spacing = case.root.edge / f64::from(1u32 << case.level_surface);
    let mut points = Vec::new();
    for facet in case.facets.iter().skip(rank).step_by(ranks) {
        sample(facet.map(|vertex| vertex.map(f64::from)), spacing / 2.0, &mut points);
    }
    if rank == 0 {
        points.extend(corners(&case.root));
    }
    let points: Vec<Point> = points.into_iter().map(|at| Point::new(at, 0)).collect();
    // A leaf with any point is split down to the surface level.
    let tree = Octree::new(&points, case.level_surface.into(), 0, comm);
    std::fs::create_dir_all(out).map_err(|error| format!("{}: {error}", out.display()))?;
    let mut words: Vec<u64> = tree.leaf_keys().iter().map(word_of).collect();
    words.sort_unstable();
    let path = out.join(format!("leaves-{rank:05}.npy"));
    contract::npy::write(&path, &words).map_err(|error| format!("{}: {error}", path.display()))
}

/// Adds points of a facet whose distances along its edges are at most `pitch`.
fn sample([a, b, c]: [[f64; 3]; 3], pitch: f64, points: &mut Vec<[f64; 3]>) {
    let difference = |p: [f64; 3], q: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| q[i] - p[i]) };
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
