//! Ranks of a real MPI job, through `rsmpi`.
//!
//! Counts are exchanged densely (one word per pair), data point to point: measured, a dense all-to-all
//! of mostly empty messages costs a hundred times a sparse one when ranks share cores. Messages are cut
//! into chunks, as MPI counts in i32.

use super::{ByRank, Comm, Meter, Traffic, matrix};
use mpi::environment::Universe;
use mpi::traits::{Communicator, CommunicatorCollectives, Destination, Source};

/// Words per message at most: 1 GiB.
const CHUNK: usize = 1 << 27;

/// One rank of an MPI job.
pub struct Mpi {
    world: mpi::topology::SimpleCommunicator,
    meter: Meter,
    /// Finalises MPI when dropped; must outlive `world`, so it comes last.
    _universe: Universe,
}

impl Mpi {
    /// Joins the job that the launcher started; once per process.
    ///
    /// # Panics
    /// If MPI was initialised before.
    pub fn start() -> Self {
        let universe = mpi::initialize().expect("MPI is initialised once");
        Self { world: universe.world(), meter: Meter::default(), _universe: universe }
    }
}

/// Ends all ranks of the job at once.
pub fn abort(code: i32) -> ! {
    // SAFETY: MPI_Abort may be called at any time between initialisation and finalisation; panics
    // outside of that time end this process below.
    unsafe {
        let (mut up, mut down) = (0, 0);
        mpi::ffi::MPI_Initialized(&mut up);
        mpi::ffi::MPI_Finalized(&mut down);
        if up != 0 && down == 0 {
            mpi::ffi::MPI_Abort(mpi::ffi::RSMPI_COMM_WORLD, code);
        }
    }
    std::process::exit(code)
}

impl Comm for Mpi {
    fn rank(&self) -> usize {
        self.world.rank() as usize
    }

    fn size(&self) -> usize {
        self.world.size() as usize
    }

    fn all_gather(&self, mine: &[u64]) -> ByRank {
        self.meter.call(|| self.all_gather_untimed(mine).into())
    }

    fn exchange(&self, to: Vec<(usize, Vec<u64>)>) -> Vec<(usize, Vec<u64>)> {
        self.meter.call(|| self.exchange_untimed(to))
    }

    fn traffic(&self) -> Traffic {
        self.meter.get()
    }

    fn sent(&self) -> Vec<matrix::Entry> {
        self.meter.sent(self.rank())
    }
}

impl Mpi {
    fn all_gather_untimed(&self, mine: &[u64]) -> Vec<Vec<u64>> {
        let mut counts = vec![0u64; self.size()];
        self.world.all_gather_into(&(mine.len() as u64), &mut counts[..]);
        let longest = counts.iter().copied().max().unwrap_or(0) as usize;
        let mut all: Vec<Vec<u64>> =
            counts.iter().map(|&c| Vec::with_capacity(c as usize)).collect();
        // The sum over ranks is what is counted in i32.
        let step = (CHUNK / self.size()).max(1);
        for at in (0..longest).step_by(step) {
            let part = |len: usize| len.saturating_sub(at).min(step);
            let lengths: Vec<i32> = counts.iter().map(|&c| part(c as usize) as i32).collect();
            let starts: Vec<i32> =
                lengths.iter().scan(0, |s, &n| Some(std::mem::replace(s, *s + n))).collect();
            let mut buffer = vec![0u64; lengths.iter().map(|&n| n as usize).sum()];
            let mine = &mine[at.min(mine.len())..][..part(mine.len())];
            let mut target =
                mpi::datatype::PartitionMut::new(&mut buffer[..], &lengths[..], &starts[..]);
            self.world.all_gather_varcount_into(mine, &mut target);
            for ((words, &start), &n) in all.iter_mut().zip(&starts).zip(&lengths) {
                words.extend_from_slice(&buffer[start as usize..(start + n) as usize]);
            }
        }
        self.meter.gather(self.size(), counts.iter().sum());
        all
    }

    fn exchange_untimed(&self, to: Vec<(usize, Vec<u64>)>) -> Vec<(usize, Vec<u64>)> {
        let me = self.rank();
        let mut counts = vec![0u64; self.size()];
        to.iter().for_each(|m| counts[m.0] = m.1.len() as u64);
        let mut coming = vec![0u64; self.size()];
        self.world.all_to_all_into(&counts[..], &mut coming[..]);
        self.meter.announce(self.size());
        let mut received: Vec<(usize, Vec<u64>)> = (0..self.size())
            .filter(|&r| r != me && coming[r] > 0)
            .map(|r| (r, vec![0; coming[r] as usize]))
            .collect();
        mpi::request::scope(|scope| {
            let mut requests = Vec::new();
            for (from, words) in &mut received {
                let process = self.world.process_at_rank(*from as i32);
                requests.extend(
                    words.chunks_mut(CHUNK).map(|c| process.immediate_receive_into(scope, c)),
                );
            }
            let mut sends = Vec::new();
            for (to, words) in to.iter().filter(|m| m.0 != me) {
                let process = self.world.process_at_rank(*to as i32);
                sends.extend(words.chunks(CHUNK).map(|c| process.immediate_send(scope, c)));
                self.meter.send(*to, words.len());
            }
            requests.into_iter().for_each(|r| _ = r.wait());
            sends.into_iter().for_each(|r| _ = r.wait());
        });
        received.extend(to.into_iter().filter(|m| m.0 == me && !m.1.is_empty()));
        received
    }
}
