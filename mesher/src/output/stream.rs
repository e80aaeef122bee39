//! The leaf stream: the mesh's leaves in Morton order, as digest, counts, files and exports read them.
//!
//! A depth-first merge of the levels: each level's sets are read once in order, so a mesh larger than
//! memory can be written. Leaves wait as parts of bricks until the words of many are made at once, in vectors.
//!
//! Invariants of the stream of a rank, which [`check::leaves`](crate::check::leaves) executes:
//! - it is *linear*: leaf words ascend, and no leaf overlaps the one before it;
//! - it is *complete*: the leaves emitted and the leaves left out (deleted, or
//!   crossing in a mesh without crossing leaves) fill the bricks that the rank owns.

use crate::input::lattice::Keep;
use crate::mesh::Mesh;
use bricks::brick::{self, ones};
use bricks::brickset::Cursor;
use bricks::octant::{Level, start57};
use bricks::tree::LEVELS;
use bricks::widest;
use std::array::from_fn;

/// Number of parts of bricks whose words are passed to the sink at a time.
const WAITING: usize = 256;

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
            // Each level on the way down may add a part before their number is compared again.
            waiting: Vec::with_capacity(WAITING + LEVELS),
            words: vec![0; 64 * (WAITING + LEVELS)],
            counts: Counts::default(),
            bits: from_fn(|byte| from_fn(|o| byte as u64 >> o & 1)),
            sink,
        };
        let root = walk.load(0, 0, 1, 0, 0);
        walk.emit(&root, 1)?;
        walk.flush()?;
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
    #[inline(always)]
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

/// A brick on the path from the root, or leaves of it that follow each other in the stream.
struct Loaded {
    level: Level,
    key: u64,
    /// Leaves to emit.
    leaves: u64,
    /// Sides of the leaves; split octants pass theirs on to their descendants.
    octants: Octants,
}

struct Walk<'a, S> {
    levels: Vec<LevelCursors<'a>>,
    mesh: &'a Mesh,
    /// Leaves whose words have not been made.
    waiting: Vec<Loaded>,
    words: Vec<u64>,
    counts: Counts,
    /// The bits of every byte, one to a word: the compiler makes poor vector code of shifts by constants.
    bits: [[u64; 8]; 256],
    sink: S,
}

impl<E, S: FnMut(&[u64]) -> Result<(), E>> Walk<'_, S> {
    /// Reads a brick whose octants `exists` exist; `crossing` and `inside` are inherited from base leaves.
    #[inline(always)]
    fn load(&mut self, level: Level, key: u64, exists: u64, crossing: u64, inside: u64) -> Loaded {
        let mut octants = self.levels[level as usize].read(key, crossing, inside);
        octants.split &= exists;
        let is_owned = self.mesh.ownership.owns(level, key);
        let leaves = if is_owned { exists & !octants.split & !octants.deleted } else { 0 };
        Loaded { level, key, leaves, octants }
    }

    /// Emits the groups of eight siblings `groups` of a brick, and their descendants.
    fn emit(&mut self, brick: &Loaded, groups: u64) -> Result<(), E> {
        let Octants { split, crossing, inside, .. } = brick.octants;
        let mut rest = groups;
        for j in ones(brick::parents(split & groups).into()).map(u64::from) {
            let below = |sides: u64| brick::children(brick::byte(split & sides, j));
            let (level, key) = (brick.level + 1, brick.key << 3 | j);
            let child = self.load(level, key, below(u64::MAX), below(crossing), below(inside));
            let mut split = u32::from(brick::byte(split, j));
            while split != 0 {
                // Siblings that follow each other: the groups of their children do, too.
                let first = split.trailing_zeros();
                let run = split & !(split + (1 << first));
                split &= !run;
                let after = u64::MAX << (8 * j + u64::from(first));
                self.put(brick, rest & !after);
                rest &= after;
                self.emit(&child, brick::children(run as u8))?;
            }
        }
        self.put(brick, rest);
        if self.waiting.len() < WAITING { Ok(()) } else { self.flush() }
    }

    /// Appends the leaves of a brick that are in the mask `within`.
    #[inline(always)]
    fn put(&mut self, brick: &Loaded, within: u64) {
        let leaves = brick.leaves & within;
        if leaves != 0 {
            self.waiting.push(Loaded { leaves, ..*brick });
        }
    }

    /// Passes the words of the waiting leaves to the sink.
    fn flush(&mut self) -> Result<(), E> {
        let number = words(&self.waiting, &self.bits, &mut self.words, &mut self.counts);
        self.waiting.clear();
        if number > 0 { (self.sink)(&self.words[..number]) } else { Ok(()) }
    }
}

widest! {
    /// Writes the words of some leaves, always eight at a time, so that the last ones are overwritten or without meaning; and counts the leaves.
    /// Returns the number of words.
    fn words(parts: &[Loaded], bits: &[[u64; 8]], to: &mut [u64], counts: &mut Counts) -> usize = words_lanes;
}

#[inline(always)]
fn words_lanes(parts: &[Loaded], bits: &[[u64; 8]], to: &mut [u64], counts: &mut Counts) -> usize {
    let mut written = 0;
    for &Loaded { level, key, leaves, octants: Octants { crossing, inside, .. } } in parts {
        // In the order of the sides' numbers.
        let sides = [!(crossing | inside), inside, crossing];
        for (count, side) in counts[level as usize].iter_mut().zip(sides) {
            *count += u64::from((leaves & side).count_ones());
        }
        let steps: [u64; 8] = from_fn(|o| start57(level, o as u64) << 7 | u64::from(level << 2));
        let mut rest = leaves;
        while rest != 0 {
            // Leaves that follow each other.
            let first = rest.trailing_zeros();
            let number = (rest >> first).trailing_ones();
            rest &= rest.wrapping_add(1 << first);
            let to = &mut to[written..written + number.next_multiple_of(8) as usize];
            for (at, eight) in (first..).step_by(8).zip(to.as_chunks_mut::<8>().0) {
                let start = start57(level, key << 6 | u64::from(at)) << 7;
                let of = |side: u64| &bits[(side >> at & 0xff) as usize];
                // Those after the run do not count, and may be beyond the root.
                let side = |o: usize| 2 * of(crossing)[o] + of(inside)[o];
                *eight = from_fn(|o| start.wrapping_add(steps[o]) + side(o));
            }
            written += number as usize;
        }
    }
    written
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::case::Case;
    use crate::record::Recorder;
    use crate::{Job, grow, quantised};
    use bricks::wide::widths;
    use ranks::Solo;
    use std::convert::Infallible;

    #[test]
    fn all_vector_widths_make_the_same_words_and_they_tile_the_root() {
        let (options, mut record) = (crate::tests::options(), Recorder::default());
        let mut job = Job::new(&options, &Solo, &mut record);
        let case = Case { keep: Keep::All, ..crate::tests::case() };
        let mesh = quantised(&case, &mut job).and_then(|q| grow(q, &mut job)).expect("a good case");
        let all = widths(|| {
            let mut all = Vec::new();
            let add = |words: &[u64]| {
                all.extend_from_slice(words);
                Ok::<(), Infallible>(())
            };
            let Ok(counts) = mesh.emit(add);
            (all, counts)
        });
        for (width, (words, counts)) in &all {
            assert!((words, counts) == (&all[0].1.0, &all[0].1.1), "{width:?}");
            assert_eq!(total(counts), words.len() as u64, "{width:?}");
            let mut end = 0;
            for word in words {
                assert_eq!(word >> 7, end, "{width:?}");
                end += start57((word >> 2 & 31) as Level, 1);
            }
            assert_eq!(end, start57(0, 1), "{width:?}");
        }
    }
}
