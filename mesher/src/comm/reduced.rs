//! Entries that many ranks have parts of, brought together and told to all.
//!
//! Facets lie in a file as somebody made them, so that ranks that read slices of it have to do with the same
//! places, dozens with each. If all told everybody, everybody would do the same sums over dozens of
//! times the result; so some *collectors* do them first, each for its part of the keys.

use super::{Comm, MessageBuffer};

/// A key and a value.
pub type Entry = [u64; 2];

/// Groups up to this size tell everybody at once: two steps would cost more than they save.
const SMALL: usize = 8;

/// All ranks' entries in the order of their keys, each key once, with the values merged by `merge`, which
/// must not depend on order. Collective; the same on all ranks.
pub fn all_gather_reduced(
    mut mine: Vec<Entry>,
    merge: impl Fn(u64, u64) -> u64 + Copy,
    comm: &dyn Comm,
) -> Vec<Entry> {
    if let Some(entries) = split_by_reducer(&mut mine, merge, comm) {
        mine = comm
            .sparse_all_to_all(MessageBuffer::of_entries(entries))
            .words()
            .as_chunks()
            .0
            .to_vec();
    }
    all_gather_from_reducers(mine, merge, comm)
}

/// The first step, as far as it needs no others: entries with the ranks that collect them; none where no step is
/// to be taken before [`gather_collected`].
pub fn split_by_reducer(
    mine: &mut Vec<Entry>,
    merge: impl Fn(u64, u64) -> u64,
    comm: &dyn Comm,
) -> Option<Vec<(usize, Entry)>> {
    combine(mine, merge);
    if comm.size() <= SMALL {
        return None;
    }
    // As many collectors as make the two steps alike.
    let collectors = comm.size().isqrt();
    let apart = comm.size() / collectors;
    let collected = |entry: &Entry| {
        // The upper bits of a product depend on all bits of the key.
        let spread = entry[0].wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32;
        (spread as usize % collectors * apart, *entry)
    };
    Some(mine.iter().map(collected).collect())
}

/// The second step: tells all ranks what each has collected. Collective; the same on all ranks.
pub fn all_gather_from_reducers(
    mut mine: Vec<Entry>,
    merge: impl Fn(u64, u64) -> u64 + Copy,
    comm: &dyn Comm,
) -> Vec<Entry> {
    combine(&mut mine, merge);
    let mut all: Vec<Entry> = comm.all_gather(mine.as_flattened()).words().as_chunks().0.to_vec();
    combine(&mut all, merge);
    all
}

/// Sorts entries and merges those of one key.
fn combine(entries: &mut Vec<Entry>, merge: impl Fn(u64, u64) -> u64) {
    // Stable sorts find the runs that ranks send.
    entries.sort_by_key(|e| e[0]);
    entries.dedup_by(|e, before| {
        let same = e[0] == before[0];
        if same {
            before[1] = merge(before[1], e[1]);
        }
        same
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comm::sim;

    #[test]
    fn all_ranks_get_the_sums_over_all() {
        for ranks in [1, 2, 8, 9, 30] {
            let told = sim::run(ranks, 4, |c| {
                let mine = (0..200u64).map(|i| [(i * i % 97) << 40, c.rank() as u64 + 1]).collect();
                all_gather_reduced(mine, |a, b| a + b, c)
            });
            let sum: u64 = (1..=ranks as u64).sum();
            for key in 0..97u64 {
                let times = (0..200u64).filter(|i| i * i % 97 == key).count() as u64;
                let want = (times > 0).then_some(times * sum);
                let got = told[0].iter().find(|e| e[0] == key << 40).map(|e| e[1]);
                assert_eq!(got, want, "{ranks} ranks, key {key}");
            }
            assert!(told[0].is_sorted_by(|a, b| a[0] < b[0]));
            assert!(told.iter().all(|t| *t == told[0]));
        }
    }
}
