//! The kept region: what is wanted of the base tree; the rest is deleted before gradation.
//!
//! Invariants: `deleted[l]` holds leaves of the base tree, none of them crossing; empty at all levels
//! if everything is kept.

use crate::brick::{self, Brick};
use crate::brickset::{BrickSet, ones};
use crate::octant::{LEVEL_MAX, Level, start57};
use crate::tree::{PerLevel, Tree};
use std::ops::Range;

/// The kept region of a base tree, by what was deleted.
#[derive(Clone, Copy, Debug)]
pub struct Kept<'a> {
    deleted: &'a PerLevel,
    any: bool,
}

impl<'a> Kept<'a> {
    /// The region that is left when these leaves are deleted.
    pub fn new(deleted: &'a PerLevel) -> Self {
        let any = deleted.iter().any(|s| !s.is_empty());
        Self { deleted, any }
    }

    /// The deleted leaves of level `l`.
    pub fn deleted(&self, l: Level) -> &'a BrickSet {
        &self.deleted[l as usize]
    }

    /// The octants of `set`, of level `l`, that lie in a kept leaf of the base tree. Octants that are
    /// split in the base tree are not expected.
    pub fn only(&self, base: &Tree, l: Level, set: BrickSet) -> BrickSet {
        if !self.any {
            return set;
        }
        let mut finder = LeafFinder { kept: self, base, last: None };
        let mut deleted = self.deleted[l as usize].cursor();
        let mut above = (l > 0).then(|| base.split[l as usize - 1].cursor());
        let mut out = BrickSet::default();
        for b in set.bricks() {
            let here = above
                .as_mut()
                .map_or(1, |a| brick::children(brick::byte(a.get(b.key >> 3), b.key & 7)));
            let mut bits = b.bits & here & !deleted.get(b.key);
            let coarse = brick::parents(b.bits & !here);
            for j in ones(u64::from(coarse)) {
                if finder.is_kept(l - 1, b.key << 3 | u64::from(j)) {
                    bits |= b.bits & 0xff << (8 * j);
                }
            }
            out.push(b.key, bits);
        }
        out
    }

    /// Debug check that deleted leaves are leaves of the base tree.
    pub fn check_invariants(&self, base: &Tree) {
        for l in 0..self.deleted.len() {
            self.deleted[l].check_invariants();
            let mut split = base.split[l].cursor();
            let mut crossing = base.crossing[l].cursor();
            for Brick { key, bits } in self.deleted[l].bricks() {
                assert_eq!(
                    bits & (split.get(*key) | crossing.get(*key)),
                    0,
                    "level {l}: only leaves off the surface are deleted"
                );
            }
        }
    }
}

/// Finds the base-tree leaf that an octant lies in. Octants asked for one after the other mostly
/// lie in the same one, so the last answer is tried first.
struct LeafFinder<'a> {
    kept: &'a Kept<'a>,
    base: &'a Tree,
    last: Option<(Range<u64>, bool)>,
}

impl LeafFinder<'_> {
    /// Whether the leaf that holds the unsplit octant `code` of level `l` is kept.
    fn is_kept(&mut self, l: Level, code: u64) -> bool {
        let at = start57(l, code);
        if let Some((range, kept)) = &self.last
            && range.contains(&at)
        {
            return *kept;
        }
        // The leaf is the coarsest ancestor that is not split; ancestors above it are.
        let (mut split, mut leaf) = (None, l);
        while split.is_none_or(|s| s + 1 < leaf) {
            // Look near the octant first: most leaves that gradation asks for are small.
            let try_at = match split {
                Some(s) => s + (leaf - s) / 2,
                None if leaf == 0 => break,
                None => leaf - leaf.clamp(1, 2),
            };
            if self.base.split[try_at as usize].contains(code >> (3 * (l - try_at))) {
                split = Some(try_at);
            } else {
                leaf = try_at;
            }
        }
        let code = code >> (3 * (l - leaf));
        let kept = !self.kept.deleted[leaf as usize].contains(code);
        self.last = Some((
            start57(leaf, code)..start57(leaf, code) + (1 << (3 * (LEVEL_MAX - leaf))),
            kept,
        ));
        kept
    }
}
