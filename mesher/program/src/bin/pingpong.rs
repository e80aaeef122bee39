//! Measures the time of a message between two ranks: `mpirun -n 2 pingpong` prints message sizes with the median time of one way, as
//! JSON of the schema `octree-pingpong/1`. `harness bench` projects run times with it.

#![deny(missing_docs)]

use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, Destination, Source};
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
    let times: Vec<(usize, f64)> =
        SIZES.iter().map(|&bytes| (bytes, one_way_s(&world, bytes))).collect();
    if world.rank() == 0 {
        let points: Vec<String> = times
            .iter()
            .map(|(bytes, time_s)| format!(r#"{{"bytes": {bytes}, "time_s": {time_s:e}}}"#))
            .collect();
        println!(r#"{{"schema": "octree-pingpong/1", "points": [{}]}}"#, points.join(", "));
    }
}

/// Half the time of a round trip between ranks 0 and 1, in seconds: the median over many. Other ranks return 0.
fn one_way_s(world: &SimpleCommunicator, bytes: usize) -> f64 {
    let rounds = if bytes > 1 << 18 { 30 } else { 1000 };
    let mut buffer = vec![1u8; bytes];
    let mut times = Vec::with_capacity(rounds);
    for _ in 0..rounds {
        let start = Instant::now();
        match world.rank() {
            0 => {
                world.process_at_rank(1).send(&buffer[..]);
                world.process_at_rank(1).receive_into(&mut buffer[..]);
            }
            1 => {
                world.process_at_rank(0).receive_into(&mut buffer[..]);
                world.process_at_rank(0).send(&buffer[..]);
            }
            _ => {}
        }
        times.push(start.elapsed().as_secs_f64() * 0.5);
    }
    times.sort_by(f64::total_cmp);
    times[rounds / 2]
}
