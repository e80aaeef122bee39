//! The nodes that a rank owns, eight siblings at a time, in the order of the file.

use super::numbering::{Interval, Numbering};
use crate::mesh::Mesh;
use crate::output::stream::{LevelCursors, Octants};
use bricks::brick::{byte, children};
use bricks::brickset::{BrickSet, ChildBricks};
use bricks::octant::Level;
use bricks::tree::LEVELS;
use vtkhdf::tree::Siblings;

/// Siblings with their numbers, in ascending order: those of the bricks that this rank owns.
pub(super) struct OwnSiblings<'a> {
    mesh: &'a Mesh,
    numbering: &'a Numbering,
    level: Level,
    bricks: ChildBricks<'a>,
    path: Path<'a>,
    at: Interval,
    /// The interval of the last brick.
    interval: Option<usize>,
    brick: Octants,
    /// Groups of siblings of the current brick that remain.
    left: u8,
    /// The number of the next siblings.
    next: u64,
}

impl<'a> OwnSiblings<'a> {
    pub(super) fn new(mesh: &'a Mesh, numbering: &'a Numbering) -> Self {
        static NONE: BrickSet = BrickSet::EMPTY;
        Self {
            mesh,
            numbering,
            level: 0,
            bricks: NONE.child_bricks(),
            path: Path::new(mesh, 0),
            at: Interval::default(),
            interval: None,
            brick: Octants::default(),
            left: 0,
            next: 0,
        }
    }

    /// The next siblings, if their number is less than `end`.
    #[inline]
    pub(super) fn next_before(&mut self, end: u64) -> Option<(u64, Siblings)> {
        while self.left == 0 {
            self.advance()?;
        }
        if self.next >= end {
            return None;
        }
        let j = u64::from(self.left.trailing_zeros());
        self.left &= self.left - 1;
        self.next += 1;
        Some((self.next - 1, siblings(self.brick, self.mesh, j)))
    }

    /// Goes to the next brick; none after the last.
    fn advance(&mut self) -> Option<()> {
        let Some(b) = self.bricks.next() else {
            if self.level as usize + 1 == LEVELS {
                return None;
            }
            self.bricks = self.mesh.split[self.level as usize].child_bricks();
            self.level += 1;
            self.path = Path::new(self.mesh, self.level);
            (self.at, self.interval) = (Interval::default(), None);
            return Some(());
        };
        if self.mesh.ownership.owns(self.level, b.key) {
            let (interval, first) = self.numbering.first(&mut self.at, self.level, b.key);
            if self.interval != Some(interval) {
                (self.interval, self.next) = (Some(interval), first);
            }
            self.brick = self.path.load(self.level, b.key);
            self.left = bricks::brick::parents(b.bits);
        }
        Some(())
    }
}

/// The root.
pub(super) fn root(mesh: &Mesh) -> Siblings {
    let root = siblings(Path::new(mesh, 0).load(0, 0), mesh, 0);
    // The seven other octants of the brick do not exist.
    let [split, deleted, crossing, inside] =
        [root.split, root.deleted, root.crossing, root.inside].map(|bits| bits & 1);
    Siblings { split, deleted, crossing, inside }
}

/// Siblings that exist: byte `j` of a brick.
#[inline]
fn siblings(brick: Octants, mesh: &Mesh, j: u64) -> Siblings {
    let Octants { split, crossing, inside, deleted } = brick;
    let mut gone = 0;
    if !mesh.is_base {
        gone = deleted;
        if !mesh.rules.keep_crossing {
            gone |= crossing;
        }
    }
    let kept = !split & !gone;
    Siblings {
        split: byte(split, j),
        deleted: byte(gone & !split, j),
        crossing: byte(crossing & kept, j),
        inside: byte(inside & kept & !crossing, j),
    }
}

/// The bricks that contain the current one, of all coarser levels, and readers of the sets.
struct Path<'a>(Vec<PathLevel<'a>>);

struct PathLevel<'a> {
    cursors: LevelCursors<'a>,
    key: Option<u64>,
    brick: Octants,
}

impl<'a> Path<'a> {
    /// A path to bricks of level `deepest`.
    fn new(mesh: &'a Mesh, deepest: Level) -> Self {
        let level = |l: usize| {
            let cursors = LevelCursors::new(&mesh.leaves(), l);
            PathLevel { cursors, key: None, brick: Octants::default() }
        };
        Self((0..=deepest as usize).map(level).collect())
    }

    /// Reads a brick. Keys must not descend.
    fn load(&mut self, l: Level, key: u64) -> Octants {
        if self.0[l as usize].key == Some(key) {
            return self.0[l as usize].brick;
        }
        let (mut crossing, mut inside) = (0, 0);
        if l > 0 {
            let above = self.load(l - 1, key >> 3);
            let below = |sides: u64| children(byte(sides & above.split, key & 7));
            (crossing, inside) = (below(above.crossing), below(above.inside));
        }
        let level = &mut self.0[l as usize];
        level.key = Some(key);
        level.brick = level.cursors.read(key, crossing, inside);
        level.brick
    }
}
