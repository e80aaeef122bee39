//! Redistribution: sends octants to the ranks that hold their bricks (*hold* is defined in [`ownership`](super)),
//! whichever rank computed them.

use super::{KEY_BITS, Ownership, Placement, brick_start};
use bricks::brick::Brick;
use bricks::brickset::BrickSet;
use bricks::octant::{LEVEL_MAX, Level};
use bricks::tree::PerLevel;
use ranks::{Comm, Entry, MessageBuffer, all_gather_from_reducers, split_by_reducer};
use std::mem::take;
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
        let (sets, sent) = self.redistribute_all(sets, comm);
        (sets.try_into().expect("as many sets as were passed"), sent)
    }

    /// Replaces each set by its union over all ranks, restricted to the bricks that this rank holds. Afterwards all
    /// replicas agree. Also moves bricks to their new holders after a change of partition. Collective.
    pub fn synchronise_replicas(&self, sets: &mut [&mut PerLevel], comm: &dyn Comm) {
        let take_levels =
            |set: &mut &mut PerLevel| (0..).zip(std::mem::take(*set)).collect::<Vec<_>>();
        let (synchronised, _) =
            self.redistribute_all(sets.iter_mut().flat_map(take_levels).collect(), comm);
        let mut synchronised = synchronised.into_iter();
        for set in sets {
            **set = synchronised.by_ref().take(bricks::tree::LEVELS).collect();
        }
    }

    /// Sends the octants of several sets, each with its level, to the ranks that hold their bricks. All ranks pass the same
    /// levels in the same order. Collective.
    fn redistribute_all(
        &self,
        mut sets: Vec<(Level, BrickSet)>,
        comm: &dyn Comm,
    ) -> (Vec<BrickSet>, u64) {
        if self.ranks == 1 {
            return (sets.into_iter().map(|(_, set)| set).collect(), 0);
        }
        let any_full = sets.iter().any(|(l, _)| *l <= self.level_fully_replicated);
        let mut out = Outgoing::default();
        let select = |(index, (l, set)): (usize, &mut (Level, BrickSet))| {
            self.select(index, *l, set, &mut out)
        };
        let retained: Vec<Range<usize>> = sets.iter_mut().enumerate().map(select).collect();
        let mut full = take(&mut out.full);
        if any_full && let Some(to_reducers) = split_by_reducer(&mut full, |a, b| a | b, comm) {
            full.clear();
            out.to_reducers = to_reducers;
        }
        let (messages, sent) = out.into_messages(&sets);
        let retained_part = |((_, mut set), range): ((Level, BrickSet), Range<usize>)| {
            set.keep(range);
            vec![set]
        };
        // The parts of each set on this rank: the retained one and those received.
        let mut parts: Vec<Vec<BrickSet>> =
            sets.into_iter().zip(retained).map(retained_part).collect();
        let mut received: Vec<Entry> = Vec::new();
        for (_, words) in comm.sparse_all_to_all(messages).messages() {
            read_message(words, &mut parts, &mut received, &mut full);
        }
        if any_full {
            received.extend(all_gather_from_reducers(full, |a, b| a | b, comm));
        }
        received.sort_by_key(|e| e[0]);
        for entries in received.chunk_by(|a, b| a[0] >> KEY_BITS == b[0] >> KEY_BITS) {
            let brick = |e: &Entry| Brick { key: e[0] & ((1 << KEY_BITS) - 1), bits: e[1] };
            parts[(entries[0][0] >> KEY_BITS) as usize].push(entries.iter().map(brick).collect());
        }
        (parts.into_iter().map(BrickSet::union_of).collect(), sent)
    }

    /// Adds the bricks of set `set_index` that other ranks hold to `out`. Returns the range of the set that this rank
    /// retains. Fully replicated bricks are removed: the allgather returns them to all ranks.
    fn select(
        &self,
        set_index: usize,
        l: Level,
        set: &mut BrickSet,
        out: &mut Outgoing,
    ) -> Range<usize> {
        if self.is_single && l > self.level_replicated {
            // No brick has several owners, and the bricks of each interval are contiguous.
            let position_of =
                |set: &BrickSet, start: u64| set.position(start >> (3 * (LEVEL_MAX + 2 - l)));
            let local = position_of(set, self.own.start)..position_of(set, self.own.end);
            for others in [0..local.start, local.end..set.len()] {
                let mut first = others.start;
                while first < others.end {
                    let interval = self.at(brick_start(l, set.key_at(first)));
                    let same_owner = first..position_of(set, self.end(interval));
                    first = same_owner.end;
                    out.queue(set_index, set, same_owner, self.boundaries[interval].1);
                }
            }
            return local;
        }
        set.retain(|b| {
            if l >= 2 && self.is_within(l, b.key) {
                return b.bits;
            }
            let intervals = self.meeting_in(l, b.key);
            let placement = self.placement_among(l, intervals);
            let entry = [(set_index as u64) << KEY_BITS | b.key, b.bits];
            if placement == Placement::FullyReplicated {
                out.full.push(entry);
                return 0;
            }
            if placement != Placement::Local {
                // Such bricks are few: queued as single entries.
                let others = intervals.iter().filter(|i| Some(i.1) != self.rank);
                out.single.extend(others.map(|&(_, owner)| (owner, entry)));
            }
            if matches!(placement, Placement::Local | Placement::PartiallyReplicated) {
                b.bits
            } else {
                0
            }
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

/// The queue of bricks to send. Entries store their set index in the bits above the key.
#[derive(Default)]
struct Outgoing {
    /// Receiver, set index, and range of the set's bricks.
    packed: Vec<(usize, usize, Range<usize>)>,
    /// Receiver and brick, for bricks sent as entries.
    single: Vec<(usize, Entry)>,
    /// Fully replicated bricks.
    full: Vec<Entry>,
    /// Those that other ranks reduce, with their receivers.
    to_reducers: Vec<(usize, Entry)>,
}

impl Outgoing {
    /// Queues bricks of a set for rank `to`.
    fn queue(&mut self, set_index: usize, set: &BrickSet, bricks: Range<usize>, to: usize) {
        if bricks.len() <= ENTRIES_MAX {
            let entry = |b: Brick| (to, [(set_index as u64) << KEY_BITS | b.key, b.bits]);
            return self.single.extend(bricks.map(|position| entry(set.brick(position))));
        }
        self.packed.push((to, set_index, bricks));
    }

    /// Serialises the queue, of bricks of `sets`. Also returns the number of bricks, without those to be reduced.
    fn into_messages(mut self, sets: &[(Level, BrickSet)]) -> (MessageBuffer, u64) {
        self.packed.sort_by_key(|block| block.0);
        self.to_reducers.sort_by_key(|e| e.0);
        self.single.sort_by_key(|e| e.0);
        // With METIS a rank may own several intervals in a brick, which gives duplicates.
        self.single.dedup();
        let bricks_packed: usize = self.packed.iter().map(|block| block.2.len()).sum();
        let entries = self.to_reducers.len() + self.single.len();
        // A packed brick takes 1.5 words, an entry 2, the headers of a block about 8.
        let words = 2 * entries + 8 * self.packed.len() + bricks_packed * 3 / 2;
        let mut messages = MessageBuffer::with_capacity(words);
        let mut packed = self.packed.into_iter().peekable();
        let mut queues = [(ENTRIES_TO_REDUCE, &self.to_reducers[..]), (ENTRIES, &self.single[..])];
        loop {
            let first = queues.iter().filter_map(|queue| Some(queue.1.first()?.0));
            let Some(to) = first.chain(packed.peek().map(|block| block.0)).min() else { break };
            messages.append(to, |words| {
                while let Some((_, set_index, bricks)) = packed.next_if(|block| block.0 == to) {
                    words.push(set_index as u64);
                    sets[set_index].1.pack(bricks, words);
                }
                for (header, rest) in &mut queues {
                    let (entries, others) = rest.split_at(rest.partition_point(|e| e.0 == to));
                    if !entries.is_empty() {
                        words.extend([*header, entries.len() as u64]);
                        entries.iter().for_each(|e| words.extend(e.1));
                    }
                    *rest = others;
                }
            });
        }
        (messages, (bricks_packed + self.single.len()) as u64)
    }
}

/// Reads a message: parts of sets, entries, and entries of fully replicated bricks that this rank reduces.
fn read_message(
    mut words: &[u64],
    parts: &mut [Vec<BrickSet>],
    received: &mut Vec<Entry>,
    full: &mut Vec<Entry>,
) {
    while let Some((&header, packed)) = words.split_first() {
        if header < ENTRIES {
            let (set, rest) = BrickSet::unpack(packed);
            parts[header as usize].push(set);
            words = rest;
            continue;
        }
        let (entries, rest) = packed[1..].split_at(2 * packed[0] as usize);
        let target = if header == ENTRIES_TO_REDUCE { &mut *full } else { &mut *received };
        target.extend_from_slice(entries.as_chunks().0);
        words = rest;
    }
}
