//! Gradation: layers and 2:1 balance in one sweep from the deepest level up (the paper's section
//! II.C, "bottom up").
//!
//! For each level: the kept leaves are frozen as sources; their extent boxes, enlarged by
//! `layer_cells_min - 1` cells, are one [dilation](crate::dilate); the parents of what they reach are
//! split where that is in the kept region; and the same again with one cell and one level coarser,
//! for balance. An octant that splits needs split ancestors; they are added when the sweep comes to
//! their level, which is before anything reads that level.
//!
//! # Whole groups
//! Most sources are whole groups of eight siblings, and a group's reach in parents is the parent's,
//! dilated by half the radius rounded up: an eighth of the work. It is exact even where some of the siblings
//! are split, as long as nothing below the parent is deleted and the level is not deeper than the
//! surface's:
//! - *Balance.* Say a split sibling touches an unsplit kept octant Q two levels up. The leaf below it that
//!   touches Q is kept and finer than the sibling, so an earlier step has split Q: nothing is added.
//! - *Layer.* Say a split sibling's enlarged box meets an unsplit kept octant at a point y. Go straight
//!   from the sibling to y, and look at the last stretch in the kept region. It starts in a leaf
//!   finer than this level: below the sibling, or in a crossing leaf, as only those part deleted from kept.
//!   It ends in one coarser. Kept leaves that touch differ by one level down to here, so the stretch
//!   passes a leaf of this very level, a source, which is nearer to y than the sibling: nothing is added.
//!
//! The others, *impure* parents, above which something was deleted, and levels of boxes finer than
//! the surface, where a box may look through a deleted body, go leaf by leaf.

use crate::brick::{self, Brick};
use crate::brickset::BrickSet;
use crate::comm::Comm;
use crate::dilate::{Reach, Tile, Words};
use crate::kept::Kept;
use crate::lattice::Rules;
use crate::octant::Level;
use crate::partition::ownership::Ownership;
use crate::tree::{PerLevel, Tree};

/// What was done; repeats exactly.
#[derive(Clone, Copy, Debug, Default)]
pub struct Work {
    /// Words of the dilated tiles.
    pub words_dilated: Words,
    /// Octants split by gradation, in bricks that this rank answers for.
    pub octants_split: u64,
    /// Bricks sent to other ranks.
    pub bricks_sent: u64,
}

/// Refines the kept part of the base tree until layers are thick enough and touching leaves differ by
/// at most one level. Makes the base tree's `split` sets the graded tree's; `crossing` are the base tree's.
/// Collective.
pub fn grade(
    split: PerLevel,
    crossing: &PerLevel,
    kept: &Kept,
    rules: &Rules,
    ownership: &Ownership,
    comm: &dyn Comm,
) -> (PerLevel, Work) {
    let surface = rules.level_surface;
    let mut g = Gradation {
        split,
        impure: BrickSet::default(),
        crossing,
        kept,
        surface,
        ownership,
        comm,
        tile: Tile::default(),
        work: Work::default(),
    };
    if !rules.keep_crossing && rules.layer_cells_min < 3 {
        g.extra_layer();
    }
    // What balance reaches two levels up goes to its holders together with what is closed there.
    let mut touched = BrickSet::default();
    for l in (1..=rules.level_deepest()).rev() {
        g.close(l, touched);
        if rules.layer_cells_min > 1 {
            let reached = g.reach(l, rules.layer_cells_min - 1);
            g.split_where_kept(l - 1, reached);
        }
        touched = if l > 1 { g.reach(l, 1).coarsen() } else { BrickSet::default() };
    }
    (g.split, g.work)
}

struct Gradation<'a> {
    split: PerLevel,
    /// Octants, of the level above the sweep's, below which something was deleted.
    impure: BrickSet,
    crossing: &'a PerLevel,
    kept: &'a Kept<'a>,
    surface: Level,
    ownership: &'a Ownership,
    comm: &'a dyn Comm,
    /// Empty; scratch.
    tile: Tile,
    work: Work,
}

impl Gradation<'_> {
    /// Splits the parents of what is split at level `l`, marks those that are impure, and splits what was `touched` of
    /// their level where it is kept. Collective: a rank's own brick may have its parents in one of several ranks.
    fn close(&mut self, l: Level, touched: BrickSet) {
        let impure = std::mem::take(&mut self.impure).union(self.kept.deleted(l).clone());
        let [above, impure] = [&self.split[l as usize], &impure].map(|set| self.parents(l, set));
        let fresh = above.without(&self.split[l as usize - 1]);
        let ([fresh, impure, touched], sent) =
            self.ownership.redistribute(l - 1, [fresh, impure, touched], self.comm);
        self.work.bricks_sent += sent;
        self.impure = impure;
        self.split_more(l - 1, fresh);
        self.split_kept(l - 1, touched);
    }

    /// The parents of octants of level `l` in bricks that this rank answers for: of several equal copies one tells.
    fn parents(&self, l: Level, set: &BrickSet) -> BrickSet {
        if !self.ownership.is_replicated(l) {
            return set.coarsen();
        }
        let mut mine = set.clone();
        mine.retain(|b| if self.ownership.owns(l, b.key) { b.bits } else { 0 });
        mine.coarsen()
    }

    /// The parents, of level `l - 1`, that the kept leaves of level `l` in bricks that this rank answers
    /// for reach within `radius` cells.
    fn reach(&mut self, l: Level, radius: u32) -> BrickSet {
        self.reached(l - 1, |g, reach| {
            if l > g.surface {
                return reach.dilate_children(g.leaves(l, |_| u64::MAX), radius);
            }
            let mut impure = g.impure.cursor();
            let pure = (g.split[l as usize - 1].bricks())
                .filter(|b| g.ownership.owns(l - 1, b.key))
                .map(|b| Brick { key: b.key, bits: b.bits & !impure.get(b.key) })
                .filter(|b| b.bits != 0);
            reach.dilate(pure, radius.div_ceil(2));
            let mut impure = g.impure.cursor();
            let within = |key| brick::children(brick::byte(impure.get(key >> 3), key & 7));
            reach.dilate_children(g.leaves(l, within), radius);
        })
    }

    /// What `dilate` reaches of a level; counts the work.
    fn reached(&mut self, l: Level, dilate: impl FnOnce(&Self, &mut Reach)) -> BrickSet {
        let mut tile = std::mem::take(&mut self.tile);
        let mut reach = Reach::new(l, &mut tile);
        dilate(self, &mut reach);
        let (reached, words) = reach.finish();
        self.work.words_dilated += words;
        self.tile = tile;
        reached
    }

    /// Kept leaves of level `l` in bricks that this rank answers for, as far as `within` lets them through.
    fn leaves(&self, l: Level, mut within: impl FnMut(u64) -> u64) -> impl Iterator<Item = Brick> {
        let mut split = self.split[l as usize].cursor();
        let mut deleted = self.kept.deleted(l).cursor();
        Tree::exists(&self.split, l)
            .filter(move |b| self.ownership.owns(l, b.key))
            .map(move |b| Brick { key: b.key, bits: b.bits & within(b.key) })
            .filter(|b| b.bits != 0)
            .map(move |b| Brick {
                key: b.key,
                bits: b.bits & !split.get(b.key) & !deleted.get(b.key),
            })
            .filter(|b| b.bits != 0)
    }

    /// The paper's exchange of extent boxes: what was reached goes to whoever holds it, and is split
    /// there where it is kept. Collective.
    fn split_where_kept(&mut self, l: Level, reached: BrickSet) {
        let ([reached], sent) = self.ownership.redistribute(l, [reached], self.comm);
        self.work.bricks_sent += sent;
        self.split_kept(l, reached);
    }

    /// Splits what is kept of some octants in bricks that this rank holds.
    fn split_kept(&mut self, l: Level, reached: BrickSet) {
        let fresh = reached.without(&self.split[l as usize]);
        self.split_more(l, self.kept.only(&self.split, l, fresh));
    }

    /// Splits octants, not split yet, in bricks that this rank holds.
    fn split_more(&mut self, l: Level, fresh: BrickSet) {
        self.work.octants_split += (fresh.bricks())
            .filter(|b| self.ownership.owns(l, b.key))
            .map(|b| u64::from(b.bits.count_ones()))
            .sum::<u64>();
        let before = std::mem::take(&mut self.split[l as usize]);
        self.split[l as usize] = before.union(fresh);
    }

    /// The layer of finest cells that a mesh without crossing leaves starts from: kept regions of the
    /// surface level's size that touch a crossing leaf. Collective.
    fn extra_layer(&mut self) {
        let surface = self.surface;
        if surface == 0 {
            return;
        }
        for m in (surface..self.crossing.len() as Level).rev() {
            let mut touched = self.reached(m - 1, |g, reach| {
                let leaves = g.crossing[m as usize].bricks();
                reach.dilate_children(leaves.filter(|b| g.ownership.owns(m, b.key)), 1);
            });
            for _ in surface..m {
                touched = touched.coarsen();
            }
            self.split_where_kept(surface - 1, touched);
        }
    }
}
