//! Bringing bricks to the ranks that hold them.

use super::{KEY_BITS, Ownership, Placement, brick_start};
use crate::brick::Brick;
use crate::brickset::BrickSet;
use crate::comm::{Comm, Entry, MessageBuffer, all_gather_from_reducers, split_by_reducer};
use crate::octant::{LEVEL_MAX, Level};
use crate::tree::PerLevel;
use std::ops::Range;

impl Ownership {
    /// Brings octants to the ranks that hold their bricks: returns those for this rank, from all
    /// ranks together, and the number of bricks sent. Collective, unless there is one rank.
    pub fn redistribute<const N: usize>(
        &self,
        l: Level,
        sets: [BrickSet; N],
        comm: &dyn Comm,
    ) -> ([BrickSet; N], u64) {
        let sets = sets.into_iter().map(|set| (l, set)).collect();
        let (sets, sent) = self.redistribute_all(sets, comm);
        (sets.try_into().expect("as many sets as were scattered"), sent)
    }

    /// Brings all levels of some sets to the ranks that hold their bricks, as if each level of each were
    /// [scattered](Self::scatter). Collective, unless there is one rank.
    pub fn synchronise_replicas(&self, sets: &mut [&mut PerLevel], comm: &dyn Comm) {
        let levels = |set: &mut &mut PerLevel| (0..).zip(std::mem::take(*set)).collect::<Vec<_>>();
        let (told, _) = self.redistribute_all(sets.iter_mut().flat_map(levels).collect(), comm);
        let mut told = told.into_iter();
        for set in sets {
            **set = told.by_ref().take(crate::tree::LEVELS).collect();
        }
    }

    /// Brings octants of several sets to the ranks that hold their bricks. Collective, unless there is one rank.
    fn redistribute_all(
        &self,
        mut sets: Vec<(Level, BrickSet)>,
        comm: &dyn Comm,
    ) -> (Vec<BrickSet>, u64) {
        if self.ranks == 1 {
            return (sets.into_iter().map(|(_, set)| set).collect(), 0);
        }
        let any_top = sets.iter().any(|(l, _)| *l <= self.level_fully_replicated);
        let mut out = Parcels::default();
        let pick = |(number, (l, set)): (usize, &mut (Level, BrickSet))| {
            self.pick(number, *l, set, &mut out)
        };
        let stay: Vec<Range<usize>> = sets.iter_mut().enumerate().map(pick).collect();
        let mut top = std::mem::take(&mut out.top);
        if any_top && let Some(collected) = split_by_reducer(&mut top, |a, b| a | b, comm) {
            top.clear();
            out.report_status(TOP, collected);
        }
        let sent = out.sent + out.loose.len() as u64;
        let message_buffer = out.message_buffer(&sets);
        let held = |((_, mut set), stay): ((Level, BrickSet), Range<usize>)| {
            set.keep(stay);
            vec![set]
        };
        // What this rank holds of each set, in parts.
        let mut parts: Vec<Vec<BrickSet>> = sets.into_iter().zip(stay).map(held).collect();
        let mut told: Vec<Entry> = Vec::new();
        for (_, words) in comm.sparse_all_to_all(message_buffer).messages() {
            read_message(words, &mut parts, &mut told, &mut top);
        }
        if any_top {
            told.extend(all_gather_from_reducers(top, |a, b| a | b, comm));
        }
        told.sort_by_key(|e| e[0]);
        for told in told.chunk_by(|a, b| a[0] >> KEY_BITS == b[0] >> KEY_BITS) {
            let mut set = BrickSet::default();
            told.iter().for_each(|e| set.push(e[0] & ((1 << KEY_BITS) - 1), e[1]));
            parts[(told[0][0] >> KEY_BITS) as usize].push(set);
        }
        (parts.into_iter().map(BrickSet::union_of).collect(), sent)
    }

    /// Lists what others hold of set `number`; returns where what this rank does is in it then. Of top bricks it holds what
    /// everybody is told.
    fn pick(&self, number: usize, l: Level, set: &mut BrickSet, out: &mut Parcels) -> Range<usize> {
        if self.is_single && l > self.level_replicated {
            // Where no brick has several owners, each one's are beside each other.
            let position = |set: &BrickSet, at: u64| set.position(at >> (3 * (LEVEL_MAX + 2 - l)));
            let mine = position(set, self.own.start)..position(set, self.own.end);
            for others in [0..mine.start, mine.end..set.len()] {
                let mut at = others.start;
                while at < others.end {
                    let run = self.runs.at(brick_start(l, set.key_at(at)));
                    let theirs = at..position(set, self.runs.end(run));
                    at = theirs.end;
                    out.send(number, set, theirs, self.runs.owners[run]);
                }
            }
            return mine;
        }
        set.retain(|b| {
            if l >= 2 && self.is_within(l, b.key) {
                return b.bits;
            }
            let owners = self.owners_of(l, b.key);
            let place = self.placement_among(l, owners);
            let entry = [(number as u64) << KEY_BITS | b.key, b.bits];
            if place == Placement::FullyReplicated {
                out.top.push(entry);
                return 0;
            }
            if place != Placement::Local {
                // Few, and for many owners: told brick by brick.
                let others = owners.iter().filter(|&&owner| owner != self.rank);
                out.loose.extend(others.map(|&owner| (owner, entry)));
            }
            if matches!(place, Placement::Local | Placement::PartiallyReplicated) {
                b.bits
            } else {
                0
            }
        });
        0..set.len()
    }
}

/// So many bricks of a set are as short to send one by one; they are simpler to send and to receive.
const FEW: usize = 10;

/// In place of a set's number, before the number of some bricks and those, each with its set's number.
const LOOSE: u64 = 1 << 32;
/// The same for top bricks that a rank collects.
const TOP: u64 = LOOSE + 1;

/// What is to be sent. Entries have their set's number above the key.
#[derive(Default)]
struct Parcels {
    /// With their receivers.
    parcels: Vec<(usize, Parcel)>,
    /// Those of parcels.
    entries: Vec<Entry>,
    /// Entries with their receivers.
    loose: Vec<(usize, Entry)>,
    /// Entries for everybody.
    top: Vec<Entry>,
    /// Bricks in sets.
    sent: u64,
}

enum Parcel {
    /// Bricks of a set by its number, behind which they are sent.
    Bricks(usize, Range<usize>),
    /// Entries, sent behind their kind and how many they are.
    Entries(u64, Range<usize>),
}

impl Parcels {
    fn send(&mut self, number: usize, set: &BrickSet, bricks: Range<usize>, to: usize) {
        if bricks.len() <= FEW {
            let entry = |b: Brick| (to, [(number as u64) << KEY_BITS | b.key, b.bits]);
            return self.loose.extend(bricks.map(|at| entry(set.brick(at))));
        }
        self.sent += bricks.len() as u64;
        self.parcels.push((to, Parcel::Bricks(number, bricks)));
    }

    fn report_status(&mut self, kind: u64, mut entries: Vec<(usize, Entry)>) {
        entries.sort_by_key(|e| e.0);
        // With METIS an owner may have several runs of an octant.
        entries.dedup();
        for told in entries.chunk_by(|a, b| a.0 == b.0) {
            let start = self.entries.len();
            self.entries.extend(told.iter().map(|e| e.1));
            self.parcels.push((told[0].0, Parcel::Entries(kind, start..self.entries.len())));
        }
    }

    /// Everything, by receiver; the bricks are those of some sets.
    fn message_buffer(mut self, sets: &[(Level, BrickSet)]) -> MessageBuffer {
        let loose = std::mem::take(&mut self.loose);
        self.report_status(LOOSE, loose);
        self.parcels.sort_by_key(|p| p.0);
        // A brick takes one word and a half.
        let words = 2 * (self.entries.len() + 4 * self.parcels.len()) as u64 + self.sent * 3 / 2;
        let mut message_buffer = MessageBuffer::with_capacity(words as usize);
        for (to, parcel) in self.parcels {
            message_buffer.append(to, |words| match parcel {
                Parcel::Bricks(number, bricks) => {
                    words.push(number as u64);
                    sets[number].1.pack(bricks, words);
                }
                Parcel::Entries(kind, entries) => {
                    words.extend([kind, entries.len() as u64]);
                    words.extend(self.entries[entries].as_flattened());
                }
            });
        }
        message_buffer
    }
}

/// Takes a letter apart: sets, entries, and entries of top bricks that this rank collects.
fn read_message(
    mut words: &[u64],
    sets: &mut [Vec<BrickSet>],
    told: &mut Vec<Entry>,
    top: &mut Vec<Entry>,
) {
    while let Some((&kind, packed)) = words.split_first() {
        if kind < LOOSE {
            let (set, behind) = BrickSet::unpack(packed);
            sets[kind as usize].push(set);
            words = behind;
            continue;
        }
        let (entries, behind) = packed[1..].split_at(2 * packed[0] as usize);
        let to = if kind == TOP { &mut *top } else { &mut *told };
        to.extend_from_slice(entries.as_chunks().0);
        words = behind;
    }
}
