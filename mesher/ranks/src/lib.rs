//! Communication between ranks: one small trait, [`Comm`], with three implementations. This crate knows no octants.
//!
//! [`Solo`] is a single rank and needs no library. With the feature `mpi`, `launch::join` makes a process a rank of an MPI job.
//! [`sim::run`] simulates any number of ranks in one process, one at a time, in an order drawn from a seed. [`Metered`] counts and times
//! the calls of any of them.
//!
//! Every call that sends is collective: all ranks make the same calls in the same order. Payloads are `u64` words.

mod collectives;
pub mod launch;
mod message_buffer;
mod metered;
#[cfg(feature = "mpi")]
mod mpi;
pub mod sim;

pub use collectives::{
    Entry, Merge, all_gather_from_reducers, all_gather_reduced, combine, first_other, pack_bytes,
    split_by_reducer, text_of_first, unpack_bytes,
};
pub use message_buffer::MessageBuffer;
pub use metered::{Metered, Traffic};

use bytemuck::Pod;
use std::sync::Arc;
use std::time::Duration;

/// Exit code of a job with a rank that keeps the others waiting.
pub const STALLED: i32 = 75;

/// The messages of all ranks, in the order of the ranks. Ranks in one process use the same buffer: copies would take memory and time
/// that ranks of an MPI job do not take.
pub type Gathered = Arc<MessageBuffer>;

/// A group of ranks.
pub trait Comm {
    /// This rank, from 0.
    fn rank(&self) -> usize;

    /// Number of ranks.
    fn size(&self) -> usize;

    /// The words of all ranks, by rank. Collective.
    fn all_gather(&self, mine: &[u64]) -> Gathered;

    /// The sums over the ranks, modulo 2^64; all ranks give the same number of values. Collective.
    fn sums(&self, mine: &[u64]) -> Vec<u64>;

    /// Sends messages, at most one to each receiver. Returns those sent to this rank, each with its sender, in no particular order.
    /// Receivers do not know message sizes in advance. Collective.
    fn sparse_all_to_all(&self, to: MessageBuffer) -> MessageBuffer;

    /// Number of ranks in this rank's process.
    fn ranks_in_process(&self) -> usize {
        1
    }

    /// The messages that this rank has sent, and the time in its calls, as far as they were [metered](Metered).
    fn traffic(&self) -> Traffic {
        Traffic::default()
    }

    /// Runs `body` without counting the messages of its calls, whose time is that of calls all the same: for checks, and what serves reports.
    fn uncounted(&self, body: &mut dyn FnMut()) {
        body();
    }

    /// Runs `body`. A simulated rank runs it twice: among the others, and then alone, when its calls return what they returned before. The
    /// second time takes as long as on a rank with a core and caches of its own. Collective if `body` is; it makes the same calls both times.
    fn repeat_alone(&self, body: &mut dyn FnMut()) {
        body();
    }

    /// Begins another run in the same job: returns after rank 0 has called it as well, and counts messages from zero from then on.
    /// The other ranks sleep meanwhile: rank 0 may wait for its next run for hours. Collective.
    fn next_run(&self) {}

    /// Ends the job if a rank keeps the others waiting in a call for longer than `limit`; ranks of one process never do. Collective.
    fn limit_calls(&self, _limit: Duration) {}

    /// Notes the phase that the rank is in.
    fn enter(&self, _phase: &'static str) {}

    /// The sum over the ranks, modulo 2^64. Collective.
    fn sum(&self, v: u64) -> u64 {
        self.sums(&[v])[0]
    }
}

/// The values of all ranks, in the order of the ranks; a value takes 8 bytes or more. Collective.
pub fn gather<T: Pod>(comm: &dyn Comm, mine: &[T]) -> Vec<T> {
    let mut packed = MessageBuffer::default();
    packed.write_values(comm.rank(), mine);
    comm.all_gather(packed.words()).values()
}

/// Runs `body` without counting the messages of its calls, and returns its result.
pub fn uncounted<T>(comm: &dyn Comm, body: impl FnOnce() -> T) -> T {
    let (mut body, mut result) = (Some(body), None);
    comm.uncounted(&mut || result = body.take().map(|body| body()));
    result.expect("the body was run")
}

/// A single rank.
pub struct Solo;

impl Comm for Solo {
    fn rank(&self) -> usize {
        0
    }

    fn size(&self) -> usize {
        1
    }

    fn all_gather(&self, mine: &[u64]) -> Gathered {
        Arc::new([(0, mine.iter().copied())].into_iter().collect())
    }

    fn sums(&self, mine: &[u64]) -> Vec<u64> {
        mine.to_vec()
    }

    fn sparse_all_to_all(&self, to: MessageBuffer) -> MessageBuffer {
        to
    }
}
