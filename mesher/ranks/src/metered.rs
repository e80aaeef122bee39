//! Counts and times the calls of a rank.

use crate::{Comm, Gathered, MessageBuffer};
use cpu_time::ThreadTime;
use std::cell::Cell;
use std::time::{Duration, Instant};

/// The messages that a rank has sent to other ranks so far, and the time in its calls.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Traffic {
    /// Messages: one per receiver, and those of collective calls as MPI libraries implement them (see [`Metered`]).
    pub messages: u64,
    /// Payload, in bytes.
    pub bytes: u64,
    /// Wall time in calls, waiting included, in seconds.
    pub time_wall_s: f64,
    /// CPU time in calls, in seconds.
    pub time_cpu_s: f64,
}

/// A rank whose calls are counted and timed.
///
/// - A sparse all-to-all takes a message for each other receiver, an acknowledgement, and a barrier by doublings.
/// - An allgather takes one message per doubling of the number of ranks (recursive doubling, Bruck), and so does that of the lengths
///   before it; a rank sends as many words as all other ranks have on average.
/// - A sum takes one message with all words per doubling.
pub struct Metered<C> {
    comm: C,
    total: Cell<Traffic>,
}

impl<C: Comm> Metered<C> {
    /// Meters the calls of a rank.
    pub fn new(comm: C) -> Self {
        Self { comm, total: Cell::default() }
    }

    /// Doublings from one rank to all ranks.
    fn doublings(&self) -> u64 {
        u64::from(self.size().next_power_of_two().ilog2())
    }

    /// Makes a call that sends as many messages and words as `sent` returns for its result.
    fn metered<T>(&self, call: impl FnOnce(&C) -> T, sent: impl FnOnce(&T) -> [u64; 2]) -> T {
        let (wall, cpu) = (Instant::now(), ThreadTime::now());
        let result = call(&self.comm);
        let (total, [messages, words]) = (self.total.get(), sent(&result));
        self.total.set(Traffic {
            messages: total.messages + messages,
            bytes: total.bytes + 8 * words,
            time_wall_s: total.time_wall_s + wall.elapsed().as_secs_f64(),
            time_cpu_s: total.time_cpu_s + cpu.elapsed().as_secs_f64(),
        });
        result
    }
}

impl<C: Comm> Comm for Metered<C> {
    fn rank(&self) -> usize {
        self.comm.rank()
    }

    fn size(&self) -> usize {
        self.comm.size()
    }

    fn all_gather(&self, mine: &[u64]) -> Gathered {
        let ranks = self.size() as u64;
        let words = |all: &Gathered| all.words().len() as u64 + ranks;
        let sent = |all: &Gathered| [2 * self.doublings(), words(all) - words(all) / ranks];
        self.metered(|comm| comm.all_gather(mine), sent)
    }

    fn sums(&self, mine: &[u64]) -> Vec<u64> {
        let messages = self.doublings();
        self.metered(|comm| comm.sums(mine), |_| [messages, messages * mine.len() as u64])
    }

    fn sparse_all_to_all(&self, to: MessageBuffer) -> MessageBuffer {
        let mut sent = [1 + self.doublings(), 0];
        for (_, words) in to.messages().filter(|m| m.0 != self.rank()) {
            sent = [sent[0] + 1, sent[1] + words.len() as u64];
        }
        self.metered(|comm| comm.sparse_all_to_all(to), |_| sent)
    }

    fn ranks_in_process(&self) -> usize {
        self.comm.ranks_in_process()
    }

    fn traffic(&self) -> Traffic {
        self.total.get()
    }

    fn uncounted(&self, body: &mut dyn FnMut()) {
        let Traffic { messages, bytes, .. } = self.total.get();
        body();
        self.total.set(Traffic { messages, bytes, ..self.total.get() });
    }

    fn repeat_alone(&self, body: &mut dyn FnMut()) {
        let before = self.total.get();
        self.comm.repeat_alone(&mut || {
            self.total.set(before);
            body();
        });
    }

    fn next_run(&self) {
        self.comm.next_run();
        self.total.take();
    }

    fn limit_calls(&self, limit: Duration) {
        self.comm.limit_calls(limit);
    }

    fn enter(&self, phase: &'static str) {
        self.comm.enter(phase);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim;

    #[test]
    fn uncounted_calls_take_time_and_change_no_counter() {
        let calls = |c: &dyn Comm| {
            c.sums(&[1]);
            c.all_gather(&[1]);
            c.sparse_all_to_all([(0, [1])].into_iter().collect());
        };
        sim::run(3, 1, |c| {
            calls(c);
            let counted = c.traffic();
            c.uncounted(&mut || calls(c));
            let after = c.traffic();
            assert_eq!((after.messages, after.bytes), (counted.messages, counted.bytes));
            assert!(after.time_wall_s > counted.time_wall_s);
            calls(c);
            assert_eq!(c.traffic().messages, 2 * counted.messages);
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
}
