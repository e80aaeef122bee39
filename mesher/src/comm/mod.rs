//! Communication between ranks: one small trait with three implementations, so that no other module depends on MPI.
//!
//! [`Solo`] is a single rank and needs no library. `Mpi` (feature `mpi`) is a rank of an MPI job.
//! [`sim::run`] simulates any number of ranks in one process, one at a time, in an order drawn from a seed.
//!
//! Every call that sends is collective: all ranks make the same calls in the same order. Payloads are `u64` words.

pub mod matrix;
mod message_buffer;
#[cfg(feature = "mpi")]
pub mod mpi;
mod reduced;
pub mod sim;

pub use message_buffer::MessageBuffer;
pub use reduced::{Entry, all_gather_from_reducers, all_gather_reduced, split_by_reducer};

use crate::error::Error;
use cpu_time::ThreadTime;
use std::cell::Cell;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The messages that a rank has sent to other ranks so far, and the time in its calls.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Traffic {
    /// Messages: one per receiver, and those of collective calls as MPI libraries implement them (see `Meter`).
    pub messages: u64,
    /// Payload, in bytes.
    pub bytes: u64,
    /// Wall time in calls, waiting included, in seconds.
    pub time_wall_s: f64,
    /// CPU time in calls, in seconds.
    pub time_cpu_s: f64,
}

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

    /// The messages that this rank has sent, and the time in its calls.
    fn traffic(&self) -> Traffic;

    /// The messages of sparse all-to-alls that this rank has sent, by receiver.
    fn sent(&self) -> Vec<matrix::Entry>;

    /// Runs `body` without counting or timing its calls: for checks, which must not change the counters.
    fn uncounted(&self, body: &mut dyn FnMut());

    /// Ends the job if a rank keeps the others waiting in a call for longer than `limit`; ranks of one process never do. Collective.
    fn limit_calls(&self, _limit: Duration) {}

    /// Notes the phase that the rank is in.
    fn enter(&self, _phase: &'static str) {}

    /// Returns after all ranks have called it. Collective.
    fn barrier(&self) {
        self.sums(&[0]);
    }

    /// The sum over the ranks, modulo 2^64. Collective.
    fn sum(&self, v: u64) -> u64 {
        self.sums(&[v])[0]
    }

    /// The greatest value of any rank. Collective.
    fn max(&self, v: u64) -> u64 {
        self.all_gather(&[v]).words().iter().copied().max().unwrap_or(v)
    }

    /// Makes ranks agree on errors: all return the error of the lowest rank that has one. Collective.
    fn agree(&self, mine: Result<(), Error>) -> Result<(), Error> {
        let packed = match &mine {
            Ok(()) => Vec::new(),
            Err(e) => pack(e),
        };
        match self.all_gather(&packed).messages().next() {
            None => Ok(()),
            Some((_, words)) => Err(unpack(words)),
        }
    }
}

/// [`Comm::agree`] for a result with a value.
pub fn agree<T>(comm: &dyn Comm, mine: Result<T, Error>) -> Result<T, Error> {
    let (value, error) = match mine {
        Ok(v) => (Some(v), Ok(())),
        Err(e) => (None, Err(e)),
    };
    comm.agree(error)?;
    Ok(value.expect("no rank has an error"))
}

/// Runs `body` without counting or timing its calls, and returns its result.
pub fn uncounted<T>(comm: &dyn Comm, body: impl FnOnce() -> T) -> T {
    let (mut body, mut result) = (Some(body), None);
    comm.uncounted(&mut || result = body.take().map(|body| body()));
    result.expect("the body was run")
}

fn pack(e: &Error) -> Vec<u64> {
    let (Error::Leak(text) | Error::Input(text) | Error::Output(text) | Error::Memory(text)) = e;
    let head = [e.exit_code() as u64, text.len() as u64];
    let body = text.as_bytes().chunks(8).map(|c| {
        let mut word = [0; 8];
        word[..c.len()].copy_from_slice(c);
        u64::from_le_bytes(word)
    });
    head.into_iter().chain(body).collect()
}

fn unpack(words: &[u64]) -> Error {
    let bytes: Vec<u8> =
        words[2..].iter().flat_map(|w| w.to_le_bytes()).take(words[1] as usize).collect();
    let text = String::from_utf8_lossy(&bytes).into_owned();
    match words[0] {
        1 => Error::Leak(text),
        2 => Error::Input(text),
        71 => Error::Memory(text),
        _ => Error::Output(text),
    }
}

/// Counts the messages of a rank, and times its calls.
#[derive(Debug, Default)]
pub(crate) struct Meter {
    total: Cell<Traffic>,
    is_paused: Cell<bool>,
    row: matrix::Row,
}

impl Meter {
    fn count(&self, messages: u64, words: u64) {
        if self.is_paused.get() {
            return;
        }
        let t = self.total.get();
        let (messages, bytes) = (t.messages + messages, t.bytes + 8 * words);
        self.total.set(Traffic { messages, bytes, ..t });
    }

    /// Counts a message of a sparse all-to-all to another rank.
    pub(crate) fn send(&self, to: usize, words: usize) {
        self.count(1, words as u64);
        if !self.is_paused.get() {
            self.row.count(to, 8 * words as u64);
        }
    }

    /// Counts an allgather of `words`, summed over the ranks, and the allgather of their numbers before it. Each takes one message per
    /// doubling of the number of ranks (recursive doubling, Bruck); a rank sends as many words as all other ranks have on
    /// average.
    pub(crate) fn gather(&self, ranks: usize, words: u64) {
        let all = words + ranks as u64;
        self.count(2 * doublings(ranks), all - all / ranks as u64);
    }

    /// Counts an allreduce of `words` per rank: by recursive doubling, with all words in each message.
    pub(crate) fn sum(&self, ranks: usize, words: u64) {
        self.count(doublings(ranks), doublings(ranks) * words);
    }

    /// Counts the end of a sparse all-to-all: an acknowledgement, and a barrier by doublings.
    pub(crate) fn arrived(&self, ranks: usize) {
        self.count(1 + doublings(ranks), 0);
    }

    /// Runs and times a call.
    pub(crate) fn call<T>(&self, body: impl FnOnce() -> T) -> T {
        if self.is_paused.get() {
            return body();
        }
        let (wall, cpu) = (Instant::now(), ThreadTime::now());
        let result = body();
        let t = self.total.get();
        let (time_wall_s, time_cpu_s) = (
            t.time_wall_s + wall.elapsed().as_secs_f64(),
            t.time_cpu_s + cpu.elapsed().as_secs_f64(),
        );
        self.total.set(Traffic { time_wall_s, time_cpu_s, ..t });
        result
    }

    /// Runs `body` without counting or timing calls.
    pub(crate) fn pause(&self, body: &mut dyn FnMut()) {
        let before = self.is_paused.replace(true);
        body();
        self.is_paused.set(before);
    }

    pub(crate) fn get(&self) -> Traffic {
        self.total.get()
    }

    /// The messages of sparse all-to-alls, by receiver; `rank` is the rank that this meter belongs to.
    pub(crate) fn sent(&self, rank: usize) -> Vec<matrix::Entry> {
        self.row.entries(rank)
    }
}

/// Doublings from one rank to all ranks.
fn doublings(ranks: usize) -> u64 {
    u64::from(ranks.next_power_of_two().ilog2())
}

/// A single rank.
#[derive(Debug, Default)]
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

    fn traffic(&self) -> Traffic {
        Traffic::default()
    }

    fn sent(&self) -> Vec<matrix::Entry> {
        Vec::new()
    }

    fn uncounted(&self, body: &mut dyn FnMut()) {
        body();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uncounted_calls_change_neither_counters_nor_times() {
        let calls = |c: &sim::Sim| {
            c.sums(&[1]);
            c.all_gather(&[1]);
            c.sparse_all_to_all([(0, [1])].into_iter().collect());
        };
        sim::run(3, 1, |c| {
            calls(c);
            let counted = (c.traffic(), c.sent());
            c.uncounted(&mut || calls(c));
            assert_eq!((c.traffic(), c.sent()), counted);
            calls(c);
            assert_eq!(c.traffic().messages, 2 * counted.0.messages);
        });
    }

    #[test]
    fn collective_calls_are_counted_as_libraries_implement_them() {
        let counts = sim::run(5, 1, |c| {
            c.sums(&[1, 2, 3]);
            let summed = c.traffic();
            c.all_gather(&[1, 2]);
            let gathered = c.traffic();
            let next = (c.rank() + 1) % 5;
            c.sparse_all_to_all(
                [(next, vec![0; 10]), (c.rank(), vec![0; 99])].into_iter().collect(),
            );
            let t = c.traffic();
            [
                summed.messages,
                summed.bytes,
                gathered.messages - summed.messages,
                gathered.bytes - summed.bytes,
                t.messages - gathered.messages,
                t.bytes - gathered.bytes,
            ]
        });
        // Sums: three doublings for five ranks, three words in each. Allgather: the same twice, with one and two words of each of the
        // four other ranks. Sparse all-to-all: one message, one acknowledgement, and a barrier.
        assert!(counts.iter().all(|c| *c == [3, 8 * 9, 6, 8 * 3 * 4, 3 + 2, 8 * 10]), "{counts:?}");
    }

    #[test]
    fn errors_are_unpacked_as_they_were_packed() {
        for e in [
            Error::Leak("a".into()),
            Error::input("häßlich: 'x'"),
            Error::output("no space"),
            Error::memory("12345678"),
        ] {
            assert_eq!(unpack(&pack(&e)), e);
        }
    }
}
