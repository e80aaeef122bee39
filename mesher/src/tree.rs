//! The base tree T0 as levels of brick sets.
//!
//! Invariants (with `exists(l)` the children of `split[l - 1]`, the root alone for `l = 0`):
//! - `split[l]` is within `exists(l)`: whatever is split has a split parent;
//! - `crossing[l]` is within `exists(l)` and has nothing of `split[l]`: it holds leaves;
//! - nothing is split at the deepest level.
//!
//! On several ranks each holds its own bricks and a copy of those above the base tree; then the
//! first two hold for bricks whose parent brick is here.

use crate::brick::Brick;
use crate::brickset::BrickSet;
use crate::octant::{LEVEL_MAX, Level};

/// Number of levels that sets are kept for: voxelisation looks one level below the deepest leaf.
pub const LEVELS: usize = LEVEL_MAX as usize + 2;

/// A set for each level.
pub type PerLevel = Vec<BrickSet>;

/// Empty sets for all levels.
pub fn per_level() -> PerLevel {
    vec![BrickSet::default(); LEVELS]
}

/// An oct-tree whose crossing leaves are marked. Leaves of level `l` are the children of
/// `split[l - 1]` that are not in `split[l]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tree {
    /// Octants that have children.
    pub split: PerLevel,
    /// Leaves that a facet crosses.
    pub crossing: PerLevel,
}

impl Default for Tree {
    fn default() -> Self {
        Self { split: per_level(), crossing: per_level() }
    }
}

impl Tree {
    /// The octants of level `l` that exist, brick by brick in Morton order.
    pub fn exists(split: &[BrickSet], l: Level) -> impl Iterator<Item = Brick> + '_ {
        static NONE: BrickSet = BrickSet::EMPTY;
        let root = (l == 0).then_some(Brick { key: 0, bits: 1 });
        let above = if l == 0 { &NONE } else { &split[l as usize - 1] };
        root.into_iter().chain(above.child_bricks())
    }

    /// The deepest level at which something is split, plus one; 0 for a lone root.
    pub fn depth(&self) -> Level {
        (0..LEVELS).rev().find(|&l| !self.split[l].is_empty()).map_or(0, |l| l as Level + 1)
    }

    /// Checks the invariants of a whole tree (on one rank).
    pub fn check_invariants(&self) {
        for l in 0..LEVELS {
            self.split[l].check_invariants();
            self.crossing[l].check_invariants();
            let mut split = self.split[l].cursor();
            let mut crossing = self.crossing[l].cursor();
            let (mut splits, mut crossings) = (0, 0);
            for b in Self::exists(&self.split, l as Level) {
                let (s, c) = (split.get(b.key), crossing.get(b.key));
                assert_eq!(s & !b.bits, 0, "level {l}: split octants must exist");
                assert_eq!(c & (!b.bits | s), 0, "level {l}: crossing octants must be leaves");
                splits += u64::from(s.count_ones());
                crossings += u64::from(c.count_ones());
            }
            assert_eq!(splits, self.split[l].count(), "level {l}: a split octant has no parent");
            assert_eq!(
                crossings,
                self.crossing[l].count(),
                "level {l}: a crossing leaf has no parent"
            );
        }
    }
}
