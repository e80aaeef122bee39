//! Gradation: layers and 2:1 balance in one sweep from the deepest level up (the paper's section
//! II.C, "bottom up").
//!
//! For each level: the kept leaves are frozen as sources; their extent boxes, enlarged by
//! `layer_cells_min - 1` cells, are one [dilation](crate::dilate); the parents of what they reach are
//! split where that is in the kept region; and the same again with one cell and one level coarser,
//! for balance. An octant that splits needs split ancestors; they are added when the sweep comes to
//! their level, which is before anything reads that level.

use crate::brick::Brick;
use crate::brickset::BrickSet;
use crate::comm::Comm;
use crate::dilate::{Words, dilate_to_parents};
use crate::kept::Kept;
use crate::lattice::Rules;
use crate::octant::Level;
use crate::share::Ownership;
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

/// Refines the kept part of `base` until layers are thick enough and touching leaves differ by at most
/// one level. Collective. Returns the split sets of the graded tree.
pub fn grade(
    base: &Tree,
    kept: &Kept,
    rules: &Rules,
    share: &Ownership,
    comm: &dyn Comm,
) -> (PerLevel, Work) {
    let mut g =
        Gradation { split: base.split.clone(), base, kept, share, comm, work: Work::default() };
    if !rules.keep_crossing && rules.layer_cells_min < 3 {
        g.extra_layer(rules.level_surface);
    }
    for l in (1..=rules.level_deepest()).rev() {
        g.close(l);
        if rules.layer_cells_min > 1 {
            let sources = g.sources(l);
            let reached = g.reach(l, &sources, rules.layer_cells_min - 1);
            g.split_where_kept(l - 1, reached);
        }
        if l > 1 {
            let sources = g.sources(l);
            let touched = g.reach(l, &sources, 1).coarsen();
            g.split_where_kept(l - 2, touched);
        }
    }
    (g.split, g.work)
}

struct Gradation<'a> {
    split: PerLevel,
    base: &'a Tree,
    kept: &'a Kept<'a>,
    share: &'a Ownership,
    comm: &'a dyn Comm,
    work: Work,
}

impl Gradation<'_> {
    /// Splits the parents of what is split at level `l`. Collective where bricks are shared: a rank's own
    /// brick may have its parents in a top brick.
    fn close(&mut self, l: Level) {
        let above = self.split[l as usize].coarsen();
        let there = std::mem::take(&mut self.split[l as usize - 1]);
        let mut fresh = without(&above, &there);
        if self.share.is_shared(l - 1) {
            fresh = self.share.scatter(l - 1, fresh, self.comm).0;
        }
        self.split[l as usize - 1] = there.union(fresh);
    }

    /// Kept leaves of level `l` in bricks that this rank answers for.
    fn sources(&self, l: Level) -> Vec<Brick> {
        let mut split = self.split[l as usize].cursor();
        let mut deleted = self.kept.deleted(l).cursor();
        Tree::exists(&self.split, l)
            .filter(|b| self.share.answers_for(l, b.key))
            .map(|b| Brick { key: b.key, bits: b.bits & !split.get(b.key) & !deleted.get(b.key) })
            .filter(|b| b.bits != 0)
            .collect()
    }

    fn reach(&mut self, l: Level, sources: &[Brick], radius: u32) -> BrickSet {
        dilate_to_parents(l, sources.iter().copied(), radius, &mut self.work.words_dilated)
    }

    /// The paper's exchange of extent boxes: what was reached goes to whoever holds it, and is split
    /// there where it is kept. Collective.
    fn split_where_kept(&mut self, l: Level, reached: BrickSet) {
        let (reached, sent) = self.share.scatter(l, reached, self.comm);
        self.work.bricks_sent += sent;
        let before = std::mem::take(&mut self.split[l as usize]);
        let fresh = self.kept.only(self.base, l, without(&reached, &before));
        self.work.octants_split += fresh
            .bricks()
            .iter()
            .filter(|b| self.share.answers_for(l, b.key))
            .map(|b| u64::from(b.bits.count_ones()))
            .sum::<u64>();
        self.split[l as usize] = before.union(fresh);
    }

    /// The layer of finest cells that a mesh without crossing leaves starts from: kept regions of the
    /// surface level's size that touch a crossing leaf. Collective.
    fn extra_layer(&mut self, surface: Level) {
        if surface == 0 {
            return;
        }
        for m in (surface..self.base.crossing.len() as Level).rev() {
            let leaves: Vec<Brick> = (self.base.crossing[m as usize].bricks().iter())
                .filter(|b| self.share.answers_for(m, b.key))
                .copied()
                .collect();
            let mut touched = self.reach(m, &leaves, 1);
            for _ in surface..m {
                touched = touched.coarsen();
            }
            self.split_where_kept(surface - 1, touched);
        }
    }
}

/// The octants of `set` that are not in `other`.
fn without(set: &BrickSet, other: &BrickSet) -> BrickSet {
    let mut there = other.cursor();
    let mut rest = BrickSet::default();
    for b in set.bricks() {
        rest.push(b.key, b.bits & !there.get(b.key));
    }
    rest
}
