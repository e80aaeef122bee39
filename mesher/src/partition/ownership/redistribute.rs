//! Redistribution: sends octants to the ranks that hold their bricks (*hold* is defined in [`ownership`](super)),
//! whichever rank computed them.

use super::{KEY_BITS, Ownership, Placement, brick_start};
use bricks::brick::Brick;
use bricks::brickset::BrickSet;
use bricks::octant::{LEVEL_MAX, Level};
use bricks::tree::PerLevel;
use ranks::{Comm, Entry, MessageBuffer, all_gather_from_reducers, split_by_reducer};
use std::ops::Range;

impl Ownership {
    /// Sends octants of level `l` to the ranks that hold their bricks. For each set, returns the union over all ranks,
    /// restricted to bricks that this rank holds; and the number of bricks sent point to point, once per receiver.
    /// Fully replicated bricks are not counted. Collective.
    pub fn redistribute<const N: usize>(
        &self,
        l: Level,
        sets: [BrickSet; N],
        comm: &dyn Comm,
    ) -> ([BrickSet; N], u64) {
        let sets = sets.into_iter().map(|set| (l, set)).collect();
        let (sets, sent) = self.send_all(sets, comm);
        (sets.try_into().expect("as many sets as were passed"), sent)
    }

    /// Replaces each set by its union over all ranks, restricted to the bricks that this rank holds. Afterwards all
    /// replicas agree. Also moves bricks to their new holders after a change of partition. Collective.
    pub fn synchronise_replicas(&self, sets: &mut [&mut PerLevel], comm: &dyn Comm) {
        let levels = sets.iter_mut().flat_map(|set| (0..).zip(std::mem::take(*set)));
        let (synchronised, _) = self.send_all(levels.collect(), comm);
        for (set, whole) in sets.iter_mut().flat_map(|set| set.iter_mut()).zip(synchronised) {
            *set = whole;
        }
    }

    /// Sends the octants of several sets, each with its level, to the ranks that hold their bricks. All ranks pass the same
    /// levels in the same order. Collective.
    fn send_all(&self, mut sets: Vec<(Level, BrickSet)>, comm: &dyn Comm) -> (Vec<BrickSet>, u64) {
        if self.ranks == 1 {
            return (sets.into_iter().map(|(_, set)| set).collect(), 0);
        }
        let any_full = sets.iter().any(|(l, _)| *l <= self.level_fully_replicated);
        let mut out = Outgoing::default();
        let select = |(index, (l, set)): (usize, &mut (Level, BrickSet))| {
            self.select(index, *l, set, &mut out)
        };
        let retained: Vec<Range<usize>> = sets.iter_mut().enumerate().map(select).collect();
        if any_full && let Some(to_reducers) = split_by_reducer(&mut out.full, |a, b| a | b, comm) {
            out.full.clear();
            out.queue.extend(to_reducers.into_iter().map(|(to, e)| (to, ENTRIES_TO_REDUCE, e)));
        }
        let (messages, sent) = messages(out.queue, &sets);
        // The parts of each set on this rank: the retained one and those received.
        let kept = sets.into_iter().zip(retained).map(|((_, set), range)| vec![set.keep(range)]);
        let mut parts: Vec<Vec<BrickSet>> = kept.collect();
        let mut received: Vec<Entry> = Vec::new();
        for (_, mut words) in comm.sparse_all_to_all(messages).messages() {
            while let Some((&header, packed)) = words.split_first() {
                if header < ENTRIES {
                    let (set, rest) = BrickSet::unpack(packed);
                    parts[header as usize].push(set);
                    words = rest;
                    continue;
                }
                let (entries, rest) = packed[1..].split_at(2 * packed[0] as usize);
                let is_to_reduce = header == ENTRIES_TO_REDUCE;
                let target = if is_to_reduce { &mut out.full } else { &mut received };
                target.extend_from_slice(entries.as_chunks().0);
                words = rest;
            }
        }
        if any_full {
            received.extend(all_gather_from_reducers(out.full, |a, b| a | b, comm));
        }
        received.sort_by_key(|e| e[0]);
        for entries in received.chunk_by(|a, b| a[0] >> KEY_BITS == b[0] >> KEY_BITS) {
            let brick = |e: &Entry| Brick { key: e[0] & ((1 << KEY_BITS) - 1), bits: e[1] };
            parts[(entries[0][0] >> KEY_BITS) as usize].push(entries.iter().map(brick).collect());
        }
        (parts.into_iter().map(BrickSet::union_of).collect(), sent)
    }

    /// Adds the bricks of set `i` that other ranks hold to `out`. Returns the range of the set that this rank
    /// retains. Fully replicated bricks are removed: the allgather returns them to all ranks.
    fn select(&self, i: usize, l: Level, set: &mut BrickSet, out: &mut Outgoing) -> Range<usize> {
        if l > self.level_replicated && self.intervals().count() == 1 {
            // No brick has several owners, and the bricks of each interval are contiguous.
            let position = |start: u64| set.position(start >> (3 * (LEVEL_MAX + 2 - l)));
            let local = position(self.own.start)..position(self.own.end);
            for others in [0..local.start, local.end..set.len()] {
                let mut first = others.start;
                while first < others.end {
                    let (interval, owner) = self.interval_at(brick_start(l, set.brick(first).key));
                    let same_owner = first..position(interval.end);
                    first = same_owner.end;
                    out.queue(i, set, same_owner, owner);
                }
            }
            return local;
        }
        set.retain(|b| {
            let placement = self.placement(l, b.key);
            if placement == Placement::Local {
                return b.bits;
            }
            let entry = [(i as u64) << KEY_BITS | b.key, b.bits];
            if placement == Placement::FullyReplicated {
                out.full.push(entry);
                return 0;
            }
            // Such bricks are few: queued as single entries.
            let others = self.meeting_in(l, b.key).iter().filter(|i| Some(i.1) != self.rank);
            out.queue.extend(others.map(|&(_, owner)| (owner, ENTRIES, entry)));
            if let Placement::Remote(_) = placement { 0 } else { b.bits }
        });
        0..set.len()
    }
}

/// Up to this many bricks are sent as (key, bits) entries: no longer than a packed block, and simpler.
const ENTRIES_MAX: usize = 10;

/// Header of a block of entries, instead of a set index. The number of entries follows, then the entries.
const ENTRIES: u64 = 1 << 32;
/// The same for fully replicated bricks, which the receiver reduces.
const ENTRIES_TO_REDUCE: u64 = ENTRIES + 1;

/// What is sent to a rank: under the index of a set, the range of positions of some bricks; under another header, an entry.
type Queued = (usize, u64, [u64; 2]);

/// The bricks to send. Entries store their set index in the bits above the key.
#[derive(Default)]
struct Outgoing {
    queue: Vec<Queued>,
    /// Fully replicated bricks.
    full: Vec<Entry>,
}

impl Outgoing {
    /// Queues bricks of a set for rank `to`.
    fn queue(&mut self, index: usize, set: &BrickSet, bricks: Range<usize>, to: usize) {
        if bricks.len() > ENTRIES_MAX {
            let range = [bricks.start as u64, bricks.end as u64];
            return self.queue.push((to, index as u64, range));
        }
        let entry = |b: Brick| [(index as u64) << KEY_BITS | b.key, b.bits];
        self.queue.extend(bricks.map(|position| (to, ENTRIES, entry(set.brick(position)))));
    }
}

/// Serialises a queue of bricks of `sets`. Also returns the number of bricks, without those to be reduced.
fn messages(mut queue: Vec<Queued>, sets: &[(Level, BrickSet)]) -> (MessageBuffer, u64) {
    queue.sort_by_key(|&(to, header, _)| (to, header));
    // With METIS a rank may own several intervals in a brick, which gives duplicates.
    queue.dedup();
    let bricks = |&(_, header, [start, end]): &Queued| match header {
        ENTRIES_TO_REDUCE => 0,
        ENTRIES => 1,
        _ => end - start,
    };
    let sent: u64 = queue.iter().map(bricks).sum();
    // A packed brick takes 1.5 words, an entry 2.
    let mut messages = MessageBuffer::with_capacity(2 * (sent as usize + queue.len()));
    for run in queue.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let (to, header, _) = run[0];
        messages.append(to, |words| match sets.get(header as usize) {
            Some((_, set)) => run.iter().for_each(|&(_, _, [start, end])| {
                words.push(header);
                set.pack(start as usize..end as usize, words);
            }),
            None => {
                words.extend([header, run.len() as u64]);
                run.iter().for_each(|queued| words.extend(queued.2));
            }
        });
    }
    (messages, sent)
}
