//! Collective operations made of the calls of [`Comm`]: texts that all ranks agree on, and an allgather with reduction by key.
//!
//! Slices of a file of facets overlap in space: dozens of ranks have entries with the same key. A plain allgather would bring dozens of
//! times the result to every rank, and every rank would reduce it. Here *reducer ranks*, each for its part of the keys,
//! reduce the entries before the allgather.

use crate::{Comm, MessageBuffer, gather};
use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher, Hash};

/// The first rank with another value than rank 0, by its hash. Collective.
pub fn first_other(comm: &dyn Comm, value: &impl Hash) -> Option<usize> {
    let hashes = gather(comm, &[BuildHasherDefault::<DefaultHasher>::new().hash_one(value)]);
    hashes.iter().position(|&hash| hash != hashes[0])
}

/// The text of rank 0. Collective.
pub fn text_of_first(comm: &dyn Comm, text: &str) -> String {
    let mut packed = Vec::new();
    if comm.rank() == 0 {
        pack_bytes(text.as_bytes(), &mut packed);
    }
    let gathered = comm.all_gather(&packed);
    String::from_utf8_lossy(unpack_bytes(gathered.words()).0).into_owned()
}

/// Appends bytes to a message, after their number.
pub fn pack_bytes(bytes: &[u8], words: &mut Vec<u64>) {
    words.push(bytes.len() as u64);
    let start = words.len();
    words.resize(start + bytes.len().div_ceil(8), 0);
    bytemuck::cast_slice_mut(&mut words[start..])[..bytes.len()].copy_from_slice(bytes);
}

/// The bytes at the front of a message, and the words after them.
pub fn unpack_bytes(words: &[u64]) -> (&[u8], &[u64]) {
    let bytes = words[0] as usize;
    let (packed, rest) = words[1..].split_at(bytes.div_ceil(8));
    (&bytemuck::cast_slice(packed)[..bytes], rest)
}

/// A key and a value.
pub type Entry = [u64; 2];

/// Reduces two values with the same key: associative and commutative.
pub type Merge = fn(u64, u64) -> u64;

/// Up to this number of ranks there are no reducers: the additional step would cost more than it saves.
const SMALL: usize = 8;

/// The entries of all ranks in the order of their keys, each key once. Collective; the same on all ranks.
pub fn all_gather_reduced(mut mine: Vec<Entry>, merge: Merge, comm: &dyn Comm) -> Vec<Entry> {
    if let Some(entries) = split_by_reducer(&mut mine, merge, comm) {
        mine = comm.sparse_all_to_all(MessageBuffer::of_entries(entries)).values();
    }
    all_gather_from_reducers(mine, merge, comm)
}

/// The local part of the first step: reduces this rank's entries, and returns them with their reducer ranks. None if there are no
/// reducers, and the entries go straight to [`all_gather_from_reducers`].
pub fn split_by_reducer(
    mine: &mut Vec<Entry>,
    merge: Merge,
    comm: &dyn Comm,
) -> Option<Vec<(usize, Entry)>> {
    combine(mine, merge);
    if comm.size() <= SMALL {
        return None;
    }
    // With this many reducers the two steps take about the same time.
    let reducers = comm.size().isqrt();
    let stride = comm.size() / reducers;
    let with_reducer = |entry: &Entry| {
        // The upper bits of a product depend on all bits of the key.
        let spread = entry[0].wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32;
        (spread as usize % reducers * stride, *entry)
    };
    Some(mine.iter().map(with_reducer).collect())
}

/// The second step: gathers the reduced entries of all ranks. Collective; the same on all ranks.
pub fn all_gather_from_reducers(mut mine: Vec<Entry>, merge: Merge, comm: &dyn Comm) -> Vec<Entry> {
    combine(&mut mine, merge);
    let mut all = gather(comm, &mine);
    combine(&mut all, merge);
    all
}

/// Sorts entries by key and reduces those with the same key.
pub fn combine(entries: &mut Vec<Entry>, merge: Merge) {
    // A stable sort takes advantage of the sorted runs that ranks send.
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
    use crate::sim;

    #[test]
    fn all_ranks_get_the_sums_over_all() {
        for ranks in [1, 2, 8, 9, 30] {
            let all = sim::run(ranks, 4, |c| {
                let mine = (0..200u64).map(|i| [(i * i % 97) << 40, c.rank() as u64 + 1]).collect();
                all_gather_reduced(mine, |a, b| a + b, c)
            });
            let sum: u64 = (1..=ranks as u64).sum();
            for key in 0..97u64 {
                let times = (0..200u64).filter(|i| i * i % 97 == key).count() as u64;
                let want = (times > 0).then_some(times * sum);
                let got = all[0].iter().find(|e| e[0] == key << 40).map(|e| e[1]);
                assert_eq!(got, want, "{ranks} ranks, key {key}");
            }
            assert!(all[0].is_sorted_by(|a, b| a[0] < b[0]));
            assert!(all.iter().all(|a| *a == all[0]));
        }
    }
}
