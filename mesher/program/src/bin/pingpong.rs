//! Measures the time of a message between two ranks: `mpirun -n 2 pingpong` prints message sizes with the median time of one way, as
//! JSON of the schema `octree-pingpong/1`. `harness bench` projects run times with it.

use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, Destination, Source};
use serde_json::json;
use std::time::Instant;

/// Message sizes, in bytes.
const SIZES: [usize; 6] = [0, 8, 1024, 1 << 16, 1 << 20, 1 << 23];

fn main() {
    let universe = mpi::initialize().expect("MPI is initialised once");
    let world = universe.world();
    if world.size() < 2 {
        eprintln!("pingpong: start it on two ranks");
        std::process::exit(2);
    }
    if world.rank() > 1 {
        return;
    }
    let points = SIZES.map(|bytes| json!({"bytes": bytes, "time_s": one_way_s(&world, bytes)}));
    if world.rank() == 0 {
        println!("{}", json!({"schema": "octree-pingpong/1", "points": points}));
    }
}

/// Half the time of a round trip between ranks 0 and 1, in seconds: the median over many.
fn one_way_s(world: &SimpleCommunicator, bytes: usize) -> f64 {
    let rounds = if bytes > 1 << 18 { 30 } else { 1000 };
    let mut buffer = vec![1u8; bytes];
    let other = world.process_at_rank(1 - world.rank());
    let round = |_| {
        let start = Instant::now();
        if world.rank() == 0 {
            other.send(&buffer[..]);
        }
        other.receive_into(&mut buffer[..]);
        if world.rank() == 1 {
            other.send(&buffer[..]);
        }
        start.elapsed().as_secs_f64() * 0.5
    };
    let mut times: Vec<f64> = (0..rounds).map(round).collect();
    times.sort_by(f64::total_cmp);
    times[rounds / 2]
}
