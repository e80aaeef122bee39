//! The nodes that a rank owns, eight siblings at a time, in the order of the file.

use super::numbering::Numbering;
use crate::Mesh;
use crate::output::stream::{LevelCursors, Octants};
use bricks::brick::{byte, children, parents};
use bricks::brickset::ones;
use bricks::octant::Level;
use bricks::tree::LEVELS;
use vtkhdf::tree::Siblings;

/// The siblings in the bricks that this rank owns, with their numbers, in ascending order.
pub(super) fn own_siblings<'a>(
    mesh: &'a Mesh,
    numbering: &'a Numbering,
) -> impl Iterator<Item = (u64, Siblings)> + 'a {
    let of_level = move |l: Level| {
        let mut path = Path::new(mesh, l);
        // The interval of the last brick, and the number of the next siblings.
        let (mut interval, mut next) = (None, 0);
        let bricks = mesh.split[l as usize - 1].child_bricks();
        bricks.filter(move |b| mesh.ownership.owns(l, b.key)).flat_map(move |b| {
            let (found, first) = numbering.first(l, b.key);
            if interval.replace(found) != Some(found) {
                next = first;
            }
            let (brick, groups, first) = (path.load(l, b.key), parents(b.bits), next);
            next += u64::from(groups.count_ones());
            let of_group = move |j| siblings(brick, u64::from(j));
            (first..).zip(ones(u64::from(groups)).map(of_group))
        })
    };
    (1..LEVELS as Level).flat_map(of_level)
}

/// The root.
pub(super) fn root(mesh: &Mesh) -> Siblings {
    let root = siblings(Path::new(mesh, 0).load(0, 0), 0);
    // The seven other octants of the brick do not exist.
    let [split, deleted, crossing, inside] =
        [root.split, root.deleted, root.crossing, root.inside].map(|bits| bits & 1);
    Siblings { split, deleted, crossing, inside }
}

/// Siblings that exist: byte `j` of a brick.
#[inline]
fn siblings(Octants { split, crossing, inside, deleted }: Octants, j: u64) -> Siblings {
    let kept = !split & !deleted;
    Siblings {
        split: byte(split, j),
        deleted: byte(deleted & !split, j),
        crossing: byte(crossing & kept, j),
        inside: byte(inside & kept, j),
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
