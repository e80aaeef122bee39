//! The leaf stream: the mesh's leaves in Morton order, as digest, counts, files and exports read them.
//!
//! A depth-first merge of the levels: each level's sets are read once in order, so a mesh larger than
//! memory can be written. The walk proceeds by groups of eight siblings.
//!
//! Invariants of the stream of a rank, which [`check::leaves`](crate::check::leaves) executes:
//! - it is *linear*: leaf words ascend, and no leaf overlaps the one before it;
//! - it is *complete*: the leaves emitted and the leaves left out (deleted, or
//!   crossing in a mesh without crossing leaves) fill the bricks that the rank owns.

use crate::input::lattice::Keep;
use crate::mesh::Mesh;
use bricks::brick;
use bricks::brickset::{Cursor, ones};
use bricks::octant::{Level, Side, start57};
use bricks::tree::LEVELS;

/// Number of words that are buffered before they are passed to the sink.
const CHUNK: usize = 4096;

/// Number of leaves, `[level][side]`.
pub type Counts = [[u64; 3]; LEVELS];

/// Number of all leaves.
pub fn total(counts: &Counts) -> u64 {
    counts.as_flattened().iter().sum()
}

impl Mesh {
    /// Calls `sink` with the words of the leaves that this rank owns, in order, some thousands at a time.
    /// Returns the numbers of leaves.
    ///
    /// # Errors
    /// The first error of the sink, which ends the stream.
    pub fn emit<E>(&self, sink: impl FnMut(&[u64]) -> Result<(), E>) -> Result<Counts, E> {
        let mut walk = Walk {
            levels: (0..LEVELS).map(|l| LevelCursors::new(self, l)).collect(),
            mesh: self,
            buffer: Vec::with_capacity(CHUNK + 512),
            counts: Counts::default(),
            sink,
        };
        let root = walk.load(0, 0, 1, 0, 0);
        walk.group(0, &root, 0)?;
        walk.flush(1)?;
        Ok(walk.counts)
    }
}

/// Cursors over the sets of one level.
pub struct LevelCursors<'a> {
    mesh: &'a Mesh,
    split: Cursor<'a>,
    crossing: Cursor<'a>,
    stored: Cursor<'a>,
}

/// The split octants of a brick, and the sides that its octants have or inherit from the leaves of T0 that contain them.
#[derive(Clone, Copy, Default)]
pub struct Octants {
    /// Octants with children.
    pub split: u64,
    /// Those in crossing leaves.
    pub crossing: u64,
    /// Those that are inside. Deleted leaves have no side.
    pub inside: u64,
    /// Leaves that are left out.
    pub deleted: u64,
}

impl<'a> LevelCursors<'a> {
    /// The cursors of level `l`.
    pub fn new(mesh: &'a Mesh, l: usize) -> Self {
        Self {
            mesh,
            split: mesh.split[l].cursor(),
            crossing: mesh.crossing[l].cursor(),
            stored: mesh.sides.stored[l].cursor(),
        }
    }

    /// Reads a brick, to which the octants above pass on that they cross or are inside. Keys must ascend.
    #[inline]
    pub fn read(&mut self, key: u64, crossing: u64, inside: u64) -> Octants {
        let stored = self.stored.get(key);
        let (inside, deleted) = match self.mesh.sides.keep {
            Keep::Outside => (0, stored),
            Keep::Inside => (u64::MAX, stored),
            Keep::All => (stored | inside, 0),
        };
        let crossing = self.crossing.get(key) | crossing;
        let deleted = if self.mesh.drops_crossing() { deleted | crossing } else { deleted };
        Octants { split: self.split.get(key), crossing, inside: inside & !crossing, deleted }
    }
}

/// A brick on the path from the root.
struct Loaded {
    key: u64,
    /// Leaves to emit.
    leaves: u64,
    /// Sides of the leaves; split octants pass theirs on to their descendants.
    octants: Octants,
}

struct Walk<'a, S> {
    levels: Vec<LevelCursors<'a>>,
    mesh: &'a Mesh,
    buffer: Vec<u64>,
    counts: Counts,
    sink: S,
}

impl<E, S: FnMut(&[u64]) -> Result<(), E>> Walk<'_, S> {
    /// Reads a brick whose octants `exists` exist; `crossing` and `inside` are inherited from base leaves.
    #[inline]
    fn load(&mut self, l: Level, key: u64, exists: u64, crossing: u64, inside: u64) -> Loaded {
        let (ownership, cursors) = (&self.mesh.ownership, &mut self.levels[l as usize]);
        let mut octants = cursors.read(key, crossing, inside);
        octants.split &= exists;
        let Octants { split, crossing, inside, deleted } = octants;
        let leaves = if ownership.owns(l, key) { exists & !split & !deleted } else { 0 };
        let counts = &mut self.counts[l as usize];
        let count = |side: u64| u64::from((leaves & side).count_ones());
        counts[Side::Crossing as usize] += count(crossing);
        counts[Side::Inside as usize] += count(inside);
        counts[Side::Outside as usize] += count(!(crossing | inside));
        Loaded { key, leaves, octants }
    }

    /// Emits eight siblings and their descendants.
    fn group(&mut self, l: Level, brick: &Loaded, j: u64) -> Result<(), E> {
        let Octants { split, crossing, inside, .. } = brick.octants;
        let split = brick::byte(split, j);
        let parent = brick.key << 3 | j;
        if split == 0 {
            self.put(l, parent, brick, j, 0xff);
            return self.flush(CHUNK);
        }
        let below = |sides: u64| brick::children(brick::byte(sides, j) & split);
        let exists = brick::children(split);
        let child = self.load(l + 1, parent, exists, below(crossing), below(inside));
        for o in 0..8 {
            if split >> o & 1 == 0 {
                self.put(l, parent, brick, j, 1 << o);
            } else if child.octants.split == 0 {
                // The usual case at the finest level: saves a call per group.
                self.put(l + 1, parent << 3 | o, &child, o, 0xff);
            } else {
                self.group(l + 1, &child, o)?;
            }
        }
        self.flush(CHUNK)
    }

    /// Appends the words of the leaves among the children, of level `l`, of octant `parent`. The children are
    /// byte `j` of a brick; only those in the mask `within` are considered.
    #[inline]
    fn put(&mut self, l: Level, parent: u64, brick: &Loaded, j: u64, within: u8) {
        let leaves = brick::byte(brick.leaves, j) & within;
        let (crossing, inside) =
            (brick::byte(brick.octants.crossing, j), brick::byte(brick.octants.inside, j));
        // The root has no parent; its code is 0 all the same.
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

    /// Passes the buffer to the sink if it has as many words.
    #[inline]
    fn flush(&mut self, words: usize) -> Result<(), E> {
        if self.buffer.len() >= words {
            (self.sink)(&self.buffer)?;
            self.buffer.clear();
        }
        Ok(())
    }
}
