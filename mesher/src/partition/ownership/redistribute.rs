//! Redistribution: octants are sent to the ranks that hold their bricks.

use super::{KEY_BITS, Ownership, Placement, brick_start};
use crate::brick::Brick;
use crate::brickset::BrickSet;
use crate::comm::{Comm, Entry, MessageBuffer, all_gather_from_reducers, split_by_reducer};
use crate::octant::{LEVEL_MAX, Level};
use crate::tree::PerLevel;
use std::ops::Range;

impl Ownership {
    /// Sends octants of level `l` to the ranks that hold their bricks. Returns the union of those for this rank, for each set, and the
    /// number of bricks that this rank has sent. Collective.
    pub fn redistribute<const N: usize>(
        &self,
        l: Level,
        sets: [BrickSet; N],
        comm: &dyn Comm,
    ) -> ([BrickSet; N], u64) {
        let sets = sets.into_iter().map(|set| (l, set)).collect();
        let (sets, sent) = self.redistribute_all(sets, comm);
        (sets.try_into().expect("one set for each that was given"), sent)
    }

    /// Makes the replicas of all bricks of some sets equal: each becomes the union of what all ranks have. Bricks that a rank does not
    /// hold are sent to those that do. Collective.
    pub fn synchronise_replicas(&self, sets: &mut [&mut PerLevel], comm: &dyn Comm) {
        let levels = |set: &mut &mut PerLevel| (0..).zip(std::mem::take(*set)).collect::<Vec<_>>();
        let (synchronised, _) =
            self.redistribute_all(sets.iter_mut().flat_map(levels).collect(), comm);
        let mut synchronised = synchronised.into_iter();
        for set in sets {
            **set = synchronised.by_ref().take(crate::tree::LEVELS).collect();
        }
    }

    /// Sends the octants of several sets, each with its level, to the ranks that hold their bricks.
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
        let select = |(number, (l, set)): (usize, &mut (Level, BrickSet))| {
            self.select(number, *l, set, &mut out)
        };
        let stay: Vec<Range<usize>> = sets.iter_mut().enumerate().map(select).collect();
        let mut full = std::mem::take(&mut out.full);
        if any_full && let Some(to_reducers) = split_by_reducer(&mut full, |a, b| a | b, comm) {
            full.clear();
            out.push_by_receiver(FULL, to_reducers);
        }
        let sent = out.sent + out.loose.len() as u64;
        let messages = out.into_messages(&sets);
        let held = |((_, mut set), stay): ((Level, BrickSet), Range<usize>)| {
            set.keep(stay);
            vec![set]
        };
        // The parts of each set on this rank: its own, and those received.
        let mut parts: Vec<Vec<BrickSet>> = sets.into_iter().zip(stay).map(held).collect();
        let mut received: Vec<Entry> = Vec::new();
        for (_, words) in comm.sparse_all_to_all(messages).messages() {
            read_message(words, &mut parts, &mut received, &mut full);
        }
        if any_full {
            received.extend(all_gather_from_reducers(full, |a, b| a | b, comm));
        }
        received.sort_by_key(|e| e[0]);
        for entries in received.chunk_by(|a, b| a[0] >> KEY_BITS == b[0] >> KEY_BITS) {
            let mut set = BrickSet::default();
            entries.iter().for_each(|e| set.push(e[0] & ((1 << KEY_BITS) - 1), e[1]));
            parts[(entries[0][0] >> KEY_BITS) as usize].push(set);
        }
        (parts.into_iter().map(BrickSet::union_of).collect(), sent)
    }

    /// Adds the bricks of set `number` that other ranks hold to `out`. Returns the range of the set that stays on this rank. Fully
    /// replicated bricks do not stay: they come back with the allgather.
    fn select(
        &self,
        number: usize,
        l: Level,
        set: &mut BrickSet,
        out: &mut Outgoing,
    ) -> Range<usize> {
        if self.is_single && l > self.level_replicated {
            // No brick has several owners, and the bricks of each are contiguous.
            let position =
                |set: &BrickSet, start: u64| set.position(start >> (3 * (LEVEL_MAX + 2 - l)));
            let local = position(set, self.own.start)..position(set, self.own.end);
            for others in [0..local.start, local.end..set.len()] {
                let mut at = others.start;
                while at < others.end {
                    let interval = self.intervals.at(brick_start(l, set.key_at(at)));
                    let theirs = at..position(set, self.intervals.end(interval));
                    at = theirs.end;
                    out.send(number, set, theirs, self.intervals.owners[interval]);
                }
            }
            return local;
        }
        set.retain(|b| {
            if l >= 2 && self.is_within(l, b.key) {
                return b.bits;
            }
            let owners = self.owners_of(l, b.key);
            let placement = self.placement_among(l, owners);
            let entry = [(number as u64) << KEY_BITS | b.key, b.bits];
            if placement == Placement::FullyReplicated {
                out.full.push(entry);
                return 0;
            }
            if placement != Placement::Local {
                // Few bricks for several owners each: sent one by one.
                let others = owners.iter().filter(|&&owner| owner != self.rank);
                out.loose.extend(others.map(|&owner| (owner, entry)));
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

/// Up to this number of bricks are sent one by one, which is as short and simpler.
const FEW: usize = 10;

/// In place of a set's number: entries follow, preceded by their number, each with the number of its set.
const LOOSE: u64 = 1 << 32;
/// The same for entries of fully replicated bricks that the receiver reduces.
const FULL: u64 = LOOSE + 1;

/// Bricks to send. Entries have the number of their set above the key.
#[derive(Default)]
struct Outgoing {
    /// Blocks with their receivers.
    blocks: Vec<(usize, Block)>,
    /// The entries of the blocks.
    entries: Vec<Entry>,
    /// Single bricks with their receivers.
    loose: Vec<(usize, Entry)>,
    /// Fully replicated bricks.
    full: Vec<Entry>,
    /// Number of bricks in blocks of sets.
    sent: u64,
}

enum Block {
    /// A set's number, and a range of its bricks.
    Bricks(usize, Range<usize>),
    /// The kind, and a range of the entries.
    Entries(u64, Range<usize>),
}

impl Outgoing {
    fn send(&mut self, number: usize, set: &BrickSet, bricks: Range<usize>, to: usize) {
        if bricks.len() <= FEW {
            let entry = |b: Brick| (to, [(number as u64) << KEY_BITS | b.key, b.bits]);
            return self.loose.extend(bricks.map(|at| entry(set.brick(at))));
        }
        self.sent += bricks.len() as u64;
        self.blocks.push((to, Block::Bricks(number, bricks)));
    }

    fn push_by_receiver(&mut self, kind: u64, mut entries: Vec<(usize, Entry)>) {
        entries.sort_by_key(|e| e.0);
        // With METIS one owner may have several intervals of an octant.
        entries.dedup();
        for same in entries.chunk_by(|a, b| a.0 == b.0) {
            let start = self.entries.len();
            self.entries.extend(same.iter().map(|e| e.1));
            self.blocks.push((same[0].0, Block::Entries(kind, start..self.entries.len())));
        }
    }

    /// The messages; the bricks are those of `sets`.
    fn into_messages(mut self, sets: &[(Level, BrickSet)]) -> MessageBuffer {
        let loose = std::mem::take(&mut self.loose);
        self.push_by_receiver(LOOSE, loose);
        self.blocks.sort_by_key(|p| p.0);
        // A brick takes one word and a half.
        let words = 2 * (self.entries.len() + 4 * self.blocks.len()) as u64 + self.sent * 3 / 2;
        let mut messages = MessageBuffer::with_capacity(words as usize);
        for (to, block) in self.blocks {
            messages.append(to, |words| match block {
                Block::Bricks(number, bricks) => {
                    words.push(number as u64);
                    sets[number].1.pack(bricks, words);
                }
                Block::Entries(kind, entries) => {
                    words.extend([kind, entries.len() as u64]);
                    words.extend(self.entries[entries].as_flattened());
                }
            });
        }
        messages
    }
}

/// Reads a message: bricks of sets, entries, and entries of fully replicated bricks that this rank reduces.
fn read_message(
    mut words: &[u64],
    sets: &mut [Vec<BrickSet>],
    received: &mut Vec<Entry>,
    full: &mut Vec<Entry>,
) {
    while let Some((&kind, packed)) = words.split_first() {
        if kind < LOOSE {
            let (set, rest) = BrickSet::unpack(packed);
            sets[kind as usize].push(set);
            words = rest;
            continue;
        }
        let (entries, rest) = packed[1..].split_at(2 * packed[0] as usize);
        let to = if kind == FULL { &mut *full } else { &mut *received };
        to.extend_from_slice(entries.as_chunks().0);
        words = rest;
    }
}
