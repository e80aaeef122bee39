//! The message matrix: messages and bytes for every pair of ranks.
//!
//! Only sparse all-to-alls are included. The messages of other collective calls depend on the algorithm of the MPI library; they are
//! counted in [`Traffic`](super::Traffic) only. Words that a rank sends to itself are not counted.

use super::{Comm, MessageBuffer};

/// One entry: sender, receiver, messages, bytes.
pub type Entry = [u64; 4];

/// The matrix so far, sorted by sender and receiver, on rank 0; empty on the others, as there may be an entry for every pair of ranks.
/// The messages of this call are not in it. Collective.
pub fn gather(comm: &dyn Comm) -> Vec<Entry> {
    let local = comm.sent().into_iter().map(|entry| (0, entry)).collect();
    let mut rows: Vec<Entry> =
        comm.sparse_all_to_all(MessageBuffer::of_entries(local)).words().as_chunks().0.to_vec();
    rows.sort_unstable();
    rows
}

#[cfg(test)]
mod tests {
    use super::super::{Comm, Solo, sim};
    use super::*;

    /// Rank r sends r + 1 words to each higher rank, twice to the next one, and to itself.
    fn talk(c: &dyn Comm) {
        let words = || vec![7; c.rank() + 1];
        c.sparse_all_to_all((c.rank()..c.size()).map(|r| (r, words())).collect());
        let next = c.rank() + 1;
        c.sparse_all_to_all((next..c.size().min(next + 1)).map(|r| (r, words())).collect());
    }

    #[test]
    fn entries_add_up_to_the_traffic_of_each_rank() {
        let results = sim::run(5, 1, |c| {
            // The messages of a call without payload: acknowledgement and barrier.
            c.sparse_all_to_all(MessageBuffer::default());
            let agreed = c.traffic();
            talk(c);
            let t = c.traffic();
            let own = [t.messages - 3 * agreed.messages, t.bytes - 3 * agreed.bytes];
            (own, gather(c))
        });
        let matrix = &results[0].1;
        assert!(results[1..].iter().all(|(_, m)| m.is_empty()), "only rank 0 has the matrix");
        for (rank, (own, _)) in results.iter().enumerate() {
            let row: Vec<&Entry> = matrix.iter().filter(|e| e[0] == rank as u64).collect();
            let sum = |i: usize| row.iter().map(|e| e[i]).sum::<u64>();
            assert_eq!([sum(2), sum(3)], *own, "rank {rank}");
        }
        // No rank sends to a lower one or counts messages to itself: all entries are above the diagonal.
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
