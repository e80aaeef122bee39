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
    /// Sends octants of level `l`, made from [sources](Self::sources) of level `from >= l` or coarser ones, to the ranks that hold their bricks. For each set, returns
    /// the union over all ranks, restricted to bricks that this rank holds; and the number of bricks sent point to point, once per receiver.
    /// Fully replicated bricks are not counted. Collective.
    pub fn redistribute<const N: usize>(
        &self,
        from: Level,
        l: Level,
        mut sets: [BrickSet; N],
        comm: &dyn Comm,
    ) -> ([BrickSet; N], u64) {
        let sent = match self.is_everywhere(from) {
            // All ranks have made the same.
            true => 0,
            false => self.send_all(&mut sets.each_mut().map(|set| (l, set)), comm),
        };
        (sets, sent)
    }

    /// Replaces each set by its union over all ranks, restricted to the bricks that this rank holds. Afterwards all
    /// replicas agree. Also moves bricks to their new holders after a change of partition. Collective.
    pub fn synchronise_replicas(&self, sets: &mut [&mut PerLevel], comm: &dyn Comm) {
        let levels = sets.iter_mut().flat_map(|set| (0..).zip(set.iter_mut()));
        self.send_all(&mut levels.collect::<Vec<_>>(), comm);
    }

    /// Sends the octants of several sets, each with its level, to the ranks that hold their bricks, and receives those of the bricks that this
    /// rank holds. All ranks pass the same levels in the same order. Returns the number of bricks sent point to point. Collective.
    fn send_all(&self, sets: &mut [(Level, &mut BrickSet)], comm: &dyn Comm) -> u64 {
        if self.ranks == 1 {
            return 0;
        }
        let any_full = sets.iter().any(|(l, _)| *l <= self.level_fully_replicated);
        let mut out = Outgoing::default();
        let select = |(index, (l, set)): (usize, &mut (Level, &mut BrickSet))| {
            self.select(index, *l, set, &mut out)
        };
        let retained: Vec<Range<usize>> = sets.iter_mut().enumerate().map(select).collect();
        let to_reducers =
            if any_full { split_by_reducer(&mut out.full, |a, b| a | b, comm) } else { None };
        let (messages, sent) = out.messages(to_reducers, sets);
        for ((_, set), range) in sets.iter_mut().zip(retained) {
            **set = take(*set).keep(range);
        }
        let mut few: Vec<Entry> = Vec::new();
        for (_, words) in comm.sparse_all_to_all(messages).messages() {
            for entries in words.as_chunks().0.chunk_by(of_one_set) {
                match entries[0][0] {
                    TO_REDUCE.. => {
                        out.full.extend(entries.iter().map(|e| [e[0] ^ TO_REDUCE, e[1]]))
                    }
                    // Many are not copied.
                    _ if entries.len() > ENTRIES_MANY => add(sets, entries),
                    _ => few.extend(entries),
                }
            }
        }
        if any_full {
            few.extend(all_gather_from_reducers(out.full, |a, b| a | b, comm));
        }
        few.sort_by_key(|e| e[0]);
        few.chunk_by(of_one_set).for_each(|entries| add(sets, entries));
        sent
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
                    let same_owner = [first, position(interval.end)];
                    first = same_owner[1];
                    out.queue.push((owner, Some(i), same_owner.map(|at| at as u64)));
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
            out.queue.extend(others.map(|&(_, owner)| (owner, None, entry)));
            if let Placement::Remote(_) = placement { 0 } else { b.bits }
        });
        0..set.len()
    }
}

/// Up to this number, the entries of one set and from one rank are added to the set together with those from other ranks.
const ENTRIES_MANY: usize = 64;

/// Whether two entries are of one set, and both to be reduced or not.
fn of_one_set(a: &Entry, b: &Entry) -> bool {
    a[0] >> KEY_BITS == b[0] >> KEY_BITS
}

/// Adds entries of one set, in the order of their keys.
fn add(sets: &mut [(Level, &mut BrickSet)], entries: &[Entry]) {
    let brick = |e: &Entry| Brick { key: e[0] & ((1 << KEY_BITS) - 1), bits: e[1] };
    let (_, set) = &mut sets[(entries[0][0] >> KEY_BITS) as usize];
    **set = take(*set).union(entries.iter().map(brick).collect());
}

/// Marks the key of an entry that the receiver reduces: a part of a fully replicated brick.
const TO_REDUCE: u64 = 1 << 63;

/// What is sent to a rank: the range of positions of some bricks of a set; or an entry, without a set.
type Queued = (usize, Option<usize>, [u64; 2]);

/// The bricks to send. Entries store their set index in the bits above the key.
#[derive(Default)]
struct Outgoing {
    queue: Vec<Queued>,
    /// Fully replicated bricks.
    full: Vec<Entry>,
}

impl Outgoing {
    /// Serialises the bricks of `sets` and those for reducers. Also returns the number of the former.
    fn messages(
        &mut self,
        to_reducers: Option<Vec<(usize, Entry)>>,
        sets: &[(Level, &mut BrickSet)],
    ) -> (MessageBuffer, u64) {
        // For a rank, a set has either entries or ranges, so that its bricks ascend in the message. With METIS a rank may own several intervals
        // in a brick, which gives duplicates.
        self.queue.sort();
        self.queue.dedup();
        let bricks = |(_, set, [start, end]): &Queued| if set.is_some() { end - start } else { 1 };
        let sent: u64 = self.queue.iter().map(bricks).sum();
        if let Some(to_reducers) = to_reducers {
            self.full.clear();
            let marked = |(to, [key, bits]): (usize, Entry)| (to, None, [key | TO_REDUCE, bits]);
            self.queue.extend(to_reducers.into_iter().map(marked));
            self.queue.sort_by_key(|queued| queued.0);
        }
        let mut messages = MessageBuffer::with_capacity(2 * (sent as usize + self.queue.len()));
        for &(to, index, [start, end]) in &self.queue {
            messages.append(to, |words| match index {
                None => words.extend([start, end]),
                Some(i) => {
                    let entry = |at: u64| {
                        let b = sets[i].1.brick(at as usize);
                        [(i as u64) << KEY_BITS | b.key, b.bits]
                    };
                    words.extend((start..end).flat_map(entry));
                }
            });
        }
        (messages, sent)
    }
}
