//! The leaves in Morton order: what digest, counts, files and exports read.
//!
//! A depth-first merge of the levels: each level's sets are read once, front to back, so a mesh larger
//! than memory can be written. The unit of the walk is a group of eight siblings.

use crate::brick;
use crate::brickset::{BrickSet, Cursor, ones};
use crate::lattice::{Keep, Rules};
use crate::octant::{Level, Side, start57};
use crate::partition::ownership::{Ownership, Placement};
use crate::sides::Sides;
use crate::tree::LEVELS;

/// Words handed over at a time, at most.
const CHUNK: usize = 4096;

/// Leaves by level and side.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// `by_level[l][side]`.
    pub by_level: [[u64; 3]; LEVELS],
}

impl Counts {
    /// The sum over the ranks. Collective.
    pub fn gather(&self, comm: &dyn crate::comm::Comm) -> Self {
        let mut sum = Self::default();
        let sums = comm.sums(self.by_level.as_flattened());
        sum.by_level.as_flattened_mut().copy_from_slice(&sums);
        sum
    }

    /// All leaves.
    pub fn total(&self) -> u64 {
        self.by_level.iter().flatten().sum()
    }
}

/// What to emit: the leaves of `split`, with the sides of the base tree's.
pub struct Leaves<'a> {
    /// Split octants of the tree to emit: the graded one, or the base tree's.
    pub split: &'a [BrickSet],
    /// Crossing leaves of the base tree.
    pub crossing: &'a [BrickSet],
    /// Sides of the base tree's leaves.
    pub sides: &'a Sides,
    /// Whose bricks are whose.
    pub ownership: &'a Ownership,
    /// Whether all leaves are emitted, also those that the rules delete.
    pub everything: bool,
    /// The mesh's rules.
    pub rules: &'a Rules,
}

impl Leaves<'_> {
    /// Calls `sink` with the words of the leaves that this rank answers for, in order, some thousands
    /// at a time. Stops at the first error of the sink's.
    pub fn emit<E>(&self, sink: impl FnMut(&[u64]) -> Result<(), E>) -> Result<Counts, E> {
        let levels = (0..LEVELS).map(|l| LevelCursors {
            split: self.split[l].cursor(),
            crossing: self.crossing[l].cursor(),
            inside: self.sides.inside[l].cursor(),
            deleted: self.sides.deleted[l].cursor(),
        });
        let mut walk = Walk {
            levels: levels.collect(),
            of: self,
            buffer: Vec::with_capacity(CHUNK + 512),
            counts: Counts::default(),
            sink,
        };
        let root = walk.load(0, 0, 1, 0, 0);
        walk.group(0, &root, 0)?;
        walk.flush()?;
        Ok(walk.counts)
    }
}

/// The sets of one level, read side by side.
struct LevelCursors<'a> {
    split: Cursor<'a>,
    crossing: Cursor<'a>,
    inside: Cursor<'a>,
    deleted: Cursor<'a>,
}

/// A brick on the way down.
struct Loaded {
    key: u64,
    /// Octants to emit.
    leaves: u64,
    split: u64,
    /// Sides of the leaves, and of split ones for their descendants.
    crossing: u64,
    inside: u64,
    placement: Placement,
}

struct Walk<'a, S> {
    levels: Vec<LevelCursors<'a>>,
    of: &'a Leaves<'a>,
    buffer: Vec<u64>,
    counts: Counts,
    sink: S,
}

impl<E, S: FnMut(&[u64]) -> Result<(), E>> Walk<'_, S> {
    /// Reads a brick of which the octants `exists` exist; `crossing` and `inside` are what they inherit.
    #[inline]
    fn load(&mut self, l: Level, key: u64, exists: u64, crossing: u64, inside: u64) -> Loaded {
        let (of, at) = (self.of, &mut self.levels[l as usize]);
        let placement = if of.ownership.owns(l, key) {
            Placement::Local
        } else {
            of.ownership.placement(l, key)
        };
        let split = at.split.get(key) & exists;
        let crossing = at.crossing.get(key) | crossing;
        let deleted = at.deleted.get(key);
        let inside = match of.rules.keep {
            Keep::Outside => deleted,
            Keep::Inside => !deleted,
            Keep::All => at.inside.get(key) | inside,
        };
        let mut leaves = exists & !split;
        if !of.everything {
            leaves &= !deleted;
            if !of.rules.keep_crossing {
                leaves &= !crossing;
            }
        }
        if placement != Placement::Local {
            leaves = 0;
        }
        let inside = inside & !crossing;
        let counts = &mut self.counts.by_level[l as usize];
        let of = |side: u64| u64::from((leaves & side).count_ones());
        counts[Side::Crossing as usize] += of(crossing);
        counts[Side::Inside as usize] += of(inside);
        counts[Side::Outside as usize] += of(!(crossing | inside));
        Loaded { key, leaves, split, crossing, inside, placement }
    }

    /// Emits eight siblings and all that is below them.
    fn group(&mut self, l: Level, brick: &Loaded, j: u64) -> Result<(), E> {
        let split = brick::byte(brick.split, j);
        let parent = brick.key << 3 | j;
        if split == 0 {
            self.put(l, parent, brick, j, 0xff);
            return if self.buffer.len() >= CHUNK { self.flush() } else { Ok(()) };
        }
        let below = |sides: u64| brick::children(brick::byte(sides, j) & split);
        let child = self.load(
            l + 1,
            parent,
            brick::children(split),
            below(brick.crossing),
            below(brick.inside),
        );
        let remote = matches!(child.placement, Placement::Remote(_));
        for o in 0..8 {
            if split >> o & 1 == 0 {
                self.put(l, parent, brick, j, 1 << o);
            } else if child.split == 0 {
                // Most bricks of the finest level: no call per group.
                self.put(l + 1, parent << 3 | o, &child, o, 0xff);
            } else if !remote {
                self.group(l + 1, &child, o)?;
            }
        }
        if self.buffer.len() >= CHUNK { self.flush() } else { Ok(()) }
    }

    /// Words of the leaves among the children of octant `parent` of level `l - 1`, which are byte `j` of
    /// a brick, as far as `within` lets them through.
    #[inline]
    fn put(&mut self, l: Level, parent: u64, brick: &Loaded, j: u64, within: u8) {
        let leaves = brick::byte(brick.leaves, j) & within;
        let (crossing, inside) = (brick::byte(brick.crossing, j), brick::byte(brick.inside, j));
        // The lone root is not a child of anything; its code is 0 all the same.
        let base = start57(l, parent << 3) << 7 | u64::from(l) << 2;
        let step = start57(l, 1) << 7;
        let side = |o: u32| u64::from(crossing >> o & 1) << 1 | u64::from(inside >> o & 1);
        let word = |o: u32| (base + u64::from(o) * step) | side(o);
        match (leaves, crossing | inside) {
            (0xff, 0) => {
                self.buffer.extend::<[u64; 8]>(std::array::from_fn(|o| base + o as u64 * step))
            }
            (0xff, _) => self.buffer.extend::<[u64; 8]>(std::array::from_fn(|o| word(o as u32))),
            _ => self.buffer.extend(ones(u64::from(leaves)).map(word)),
        }
    }

    fn flush(&mut self) -> Result<(), E> {
        let result = if self.buffer.is_empty() { Ok(()) } else { (self.sink)(&self.buffer) };
        self.buffer.clear();
        result
    }
}
