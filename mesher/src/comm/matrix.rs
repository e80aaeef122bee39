//! Who sends how much to whom: the message matrix.
//!
//! Only exchanges are between pairs of ranks; what collective calls move depends on the library's
//! algorithm, and is in [`Traffic`](super::Traffic) alone. What a rank keeps for itself is no message.

use super::{Comm, MessageBuffer};
use std::cell::RefCell;
use std::collections::BTreeMap;

/// One entry: sender, receiver, messages, bytes.
pub type Entry = [u64; 4];

/// What a rank has sent in exchanges, by receiver: messages and bytes.
#[derive(Debug, Default)]
pub(crate) struct Row(RefCell<BTreeMap<usize, (u64, u64)>>);

impl Row {
    pub(crate) fn count(&self, to: usize, bytes: u64) {
        let mut row = self.0.borrow_mut();
        let entry = row.entry(to).or_default();
        *entry = (entry.0 + 1, entry.1 + bytes);
    }

    pub(crate) fn entries(&self, from: usize) -> Vec<Entry> {
        let entry = |(&to, &(messages, bytes)): (&usize, &(u64, u64))| {
            [from as u64, to as u64, messages, bytes]
        };
        self.0.borrow().iter().map(entry).collect()
    }
}

/// The matrix up to now, on rank 0, by sender and receiver; nothing on the others, as it may have as
/// many entries as there are pairs. Gathering it is not in it. Collective.
pub fn gather(comm: &dyn Comm) -> Vec<Entry> {
    let mine = comm.sent().into_iter().map(|entry| (0, entry)).collect();
    let mut rows: Vec<Entry> =
        comm.sparse_all_to_all(MessageBuffer::of_entries(mine)).words().as_chunks().0.to_vec();
    rows.sort_unstable();
    rows
}

#[cfg(test)]
mod tests {
    use super::super::{Comm, Solo, sim};
    use super::*;

    /// Rank r sends r + 1 words to each of the ranks above it, twice to the next one, and some to itself.
    fn talk(c: &dyn Comm) {
        let words = || vec![7; c.rank() + 1];
        c.sparse_all_to_all((c.rank()..c.size()).map(|r| (r, words())).collect());
        let next = c.rank() + 1;
        c.sparse_all_to_all((next..c.size().min(next + 1)).map(|r| (r, words())).collect());
    }

    #[test]
    fn entries_are_what_was_sent_and_sum_to_the_meters_totals() {
        let told = sim::run(5, 1, |c| {
            // A call without letters tells what agreeing on their arrival takes.
            c.sparse_all_to_all(MessageBuffer::default());
            let agreed = c.traffic();
            talk(c);
            let t = c.traffic();
            let own = [t.messages - 3 * agreed.messages, t.bytes - 3 * agreed.bytes];
            (own, gather(c))
        });
        let matrix = &told[0].1;
        assert!(told[1..].iter().all(|(_, m)| m.is_empty()), "rank 0 alone has it");
        for (rank, (own, _)) in told.iter().enumerate() {
            let row: Vec<&Entry> = matrix.iter().filter(|e| e[0] == rank as u64).collect();
            let sum = |i: usize| row.iter().map(|e| e[i]).sum::<u64>();
            assert_eq!([sum(2), sum(3)], *own, "rank {rank}");
        }
        // Nothing goes down, so the matrix is not symmetric; nothing is on its diagonal.
        assert!(matrix.iter().all(|e| e[0] < e[1]), "{matrix:?}");
        assert_eq!(matrix.len(), 10);
        assert_eq!((matrix[0], matrix[1]), ([0, 1, 2, 16], [0, 2, 1, 8]));
        assert_eq!(matrix[9], [3, 4, 2, 64]);
    }

    #[test]
    fn a_single_rank_sends_nothing() {
        talk(&Solo);
        assert!(gather(&Solo).is_empty());
    }
}
