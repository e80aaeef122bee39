//! What ranks say to each other: three implementations of one small trait, so that nothing else in
//! the mesher names MPI.
//!
//! [`Solo`] is a single rank and needs nothing installed. `Mpi` (feature `mpi`) is the real thing.
//! [`sim::run`] runs any number of ranks in one process, one at a time, in an order drawn from a seed.
//!
//! Every call is collective: all ranks make the same calls in the same order. Payloads are `u64`
//! words.

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
use std::time::Instant;

/// What a rank has sent so far, to others only, and how long it was at it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Traffic {
    /// Messages: one per receiver, and those of a collective call as MPI libraries make it (see `Meter`).
    pub messages: u64,
    /// Payload.
    pub bytes: u64,
    /// Wall time in calls, waiting included.
    pub time_wall_s: f64,
    /// CPU time in calls.
    pub time_cpu_s: f64,
}

/// Letters from all ranks to all, in the order of the ranks. Ranks of one process share them: a copy for each would take
/// memory, and time, that no real rank takes.
pub type Gathered = Arc<MessageBuffer>;

/// A group of ranks.
pub trait Comm {
    /// This rank, from 0.
    fn rank(&self) -> usize;

    /// Number of ranks.
    fn size(&self) -> usize;

    /// Everyone's words, by rank. Collective.
    fn all_gather(&self, mine: &[u64]) -> Gathered;

    /// The sums over the ranks, modulo 2^64, of as many values on each. Collective.
    fn sums(&self, mine: &[u64]) -> Vec<u64>;

    /// Sends letters, one at most to a receiver, and returns those that were sent here, by sender, in no
    /// particular order. Collective.
    fn sparse_all_to_all(&self, to: MessageBuffer) -> MessageBuffer;

    /// Ranks that share this rank's process, itself included.
    fn ranks_in_process(&self) -> usize {
        1
    }

    /// What this rank has sent.
    fn traffic(&self) -> Traffic;

    /// What it has sent in exchanges, by receiver; collective calls are between no pair.
    fn sent(&self) -> Vec<matrix::Entry>;

    /// The sum over the ranks, modulo 2^64. Collective.
    fn sum(&self, v: u64) -> u64 {
        self.sums(&[v])[0]
    }

    /// The greatest value of any rank. Collective.
    fn max(&self, v: u64) -> u64 {
        self.all_gather(&[v]).words().iter().copied().max().unwrap_or(v)
    }

    /// Makes one rank's error every rank's: all return the error of the lowest rank that has one.
    /// Collective.
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
    Ok(value.expect("agreed that no rank has an error"))
}

fn pack(e: &Error) -> Vec<u64> {
    let text = match e {
        Error::Interrupted => String::new(),
        Error::Input(t) | Error::Output(t) => t.clone(),
    };
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
        2 => Error::Input(text),
        4 => Error::Output(text),
        _ => Error::Interrupted,
    }
}

/// Counts what an implementation sends, and times its calls.
#[derive(Debug, Default)]
pub(crate) struct Meter {
    total: Cell<Traffic>,
    row: matrix::Row,
}

impl Meter {
    fn count(&self, messages: u64, words: u64) {
        let t = self.total.get();
        let (messages, bytes) = (t.messages + messages, t.bytes + 8 * words);
        self.total.set(Traffic { messages, bytes, ..t });
    }

    /// Counts a message of an exchange to another rank.
    pub(crate) fn send(&self, to: usize, words: usize) {
        self.count(1, words as u64);
        self.row.count(to, 8 * words as u64);
    }

    /// Counts a gathering of `words` by all, all ranks' together, and before it one of how many each has: a message for
    /// every doubling of the number of ranks that have them (recursive doubling, Bruck), in which all words but
    /// a rank's share pass on.
    pub(crate) fn gather(&self, ranks: usize, words: u64) {
        let all = words + ranks as u64;
        self.count(2 * doublings(ranks), all - all / ranks as u64);
    }

    /// Counts a sum of so many words over all: by recursive doubling, all words in each message.
    pub(crate) fn sum(&self, ranks: usize, words: u64) {
        self.count(doublings(ranks), doublings(ranks) * words);
    }

    /// Counts how ranks agree that all that was sent has arrived: the acknowledgement that each waits for, and a
    /// barrier by doublings.
    pub(crate) fn arrived(&self, ranks: usize) {
        self.count(1 + doublings(ranks), 0);
    }

    /// Runs and times a call.
    pub(crate) fn call<T>(&self, body: impl FnOnce() -> T) -> T {
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

    pub(crate) fn get(&self) -> Traffic {
        self.total.get()
    }

    /// What `rank`, whose meter it is, has sent to whom.
    pub(crate) fn sent(&self, rank: usize) -> Vec<matrix::Entry> {
        self.row.entries(rank)
    }
}

/// Doublings from one rank to all.
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn collective_calls_count_as_libraries_make_them() {
        let told = sim::run(5, 1, |c| {
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
        // Three doublings to reach five ranks, with three sums in each; the same twice, with a number and two words of each of
        // four others; an exchange sends one message, and has one acknowledged.
        assert!(told.iter().all(|t| *t == [3, 8 * 9, 6, 8 * 3 * 4, 3 + 2, 8 * 10]), "{told:?}");
    }

    #[test]
    fn errors_survive_the_journey() {
        for e in [
            Error::input("häßlich: 'x'"),
            Error::output("no space"),
            Error::Interrupted,
            Error::input("12345678"),
        ] {
            assert_eq!(unpack(&pack(&e)), e);
        }
    }
}
