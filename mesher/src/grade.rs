//! Gradation: layers and 2:1 balance in one sweep from the deepest level up (the paper's section
//! II.C, "bottom up").
//!
//! At each level `l` the kept leaves are final and serve as sources. Their extent boxes, enlarged by
//! `layer_cells_min - 1` cells of level `l`, are one [dilation](bricks::dilate). The parents of the
//! octants that it reaches are split where they are kept: this makes the layer. The same with one cell
//! of level `l` and grandparents instead of parents makes the balance. An octant that is split needs
//! split ancestors. They are added when the sweep comes to their level, before anything reads it.
//!
//! Invariants of the result, which [`check::graded`](fn@crate::check::graded) executes:
//! - it contains all splits of the base tree, and the parent of every split octant is split;
//! - no deleted leaf is split;
//! - kept leaves that share a face, an edge or a corner differ by at most one level.
//!
//! # Whole groups as sources
//! Let D be the surface level. For `l <= D` the sources are whole groups of eight siblings, although
//! some siblings are split or deleted. The reach of a group in parents is the reach of its parent with
//! half the radius, rounded up: an eighth of the work. The extra sources add no split. Proof: let
//! S be a sibling of level `l` that is not a kept leaf, and Q an unsplit kept octant that S reaches. Then a
//! kept leaf of level `l` reaches Q as well, or an earlier step has split Q. Two facts are used:
//! - A crossing leaf of the base tree is kept, and its level is D or deeper. So are its descendants,
//!   and `D >= l`.
//! - Base leaves that share part of a face and do not cross belong to one component, so either all
//!   of them are kept or none is.
//!
//! *Layer*: Q is of level `l - 1`, and the box of S, enlarged, meets Q in a set with interior. Choose a
//! generic point y in Q whose Chebyshev distance from a generic point s in S is less than the width by
//! which the box is enlarged, so that the segment from s to y passes from leaf to leaf through faces
//! only. Consider the last part of the segment that is kept. It begins either in a leaf below S, or, by
//! the second fact, in a crossing leaf; in both cases in a leaf of level `l` or deeper. It ends in Q,
//! which lies in a leaf of level `l - 1` or shallower. Earlier steps have balanced all leaves deeper
//! than `l`: none of them touches an unsplit kept octant of level `l - 1`. Hence the segment passes
//! through a kept leaf of level `l` itself. A point of the segment in this leaf is no farther from y
//! than s is, so the leaf reaches Q.
//!
//! *Balance*: Q is of level `l - 2`, and S touches it at a point p. If a kept leaf of a level deeper than
//! `l` touches Q at p, an earlier step has split an octant in Q and therefore Q. Otherwise the leaf at p
//! in S is deleted, whereas Q is kept. The base leaves that contain p are connected through faces
//! around p. As they are not all of one side, one of them crosses. A kept leaf of level `l` or deeper
//! in that one contains p: if it is deeper, Q has been split, as above; if not, it is a source of level
//! `l` that touches Q.
//!
//! For `l > D`, in extent boxes finer than the surface, the first fact gives only `D < l`. The last kept
//! part of the segment may then begin in a crossing leaf coarser than `l`: a whole group would act
//! through a deleted body. Hence only leaves are sources there.

use crate::input::lattice::Rules;
use crate::partition::ownership::Ownership;
use crate::record::Counters;
use bricks::brick::Brick;
use bricks::brickset::BrickSet;
use bricks::dilate::{Reached, dilate, dilate_children};
use bricks::octant::Level;
use bricks::tree::{PerLevel, Tree, kept};
use ranks::Comm;

/// Bricks of a level from which on those that are full are stored as the octants that they fill; with fewer it takes more time than the memory
/// is worth. In debug builds few, so that in small cases some ranks do so and others do not.
const BRICKS_MANY: usize = if cfg!(debug_assertions) { 8 } else { 1 << 16 };

/// What gradation reads, and what it has made so far, on one rank.
pub struct Gradation<'a> {
    /// Split octants: of the base tree at first, of the graded tree in the end.
    pub split: PerLevel,
    /// Crossing leaves of the base tree.
    pub crossing: &'a PerLevel,
    /// Leaves of the base tree that the mesh does not keep.
    pub deleted: &'a PerLevel,
    /// The rules on the lattice.
    pub rules: &'a Rules,
    /// The ranks that own and hold bricks.
    pub ownership: &'a Ownership,
    /// All ranks.
    pub comm: &'a dyn Comm,
    /// Work done, that of other phases included.
    pub counters: Counters,
    /// Bytes of split octants, and of those that are reached, at most.
    pub bytes: usize,
}

impl Gradation<'_> {
    /// Refines the kept part of the base tree until layers are thick enough and touching leaves differ by
    /// at most one level. Collective.
    pub fn graded(mut self) -> Self {
        let (rules, surface) = (self.rules, self.rules.level_surface);
        if surface > 0 && !rules.keep_crossing && rules.layer_cells_min < 3 {
            self.extra_layer(surface);
        }
        // Grandparents reached for balance are redistributed together with the parents of the next level.
        let mut touched = BrickSet::default();
        for l in (1..=rules.level_deepest()).rev() {
            self.close(l, touched);
            if rules.layer_cells_min > 1 {
                let reached = self.reach(l, rules.layer_cells_min - 1, l - 1);
                self.split_where_kept(self.level_of_sources(l), l - 1, reached);
            }
            // Splits of this level are complete.
            if self.split[l as usize - 1].len() >= BRICKS_MANY {
                self.split[l as usize - 1].condense();
            }
            touched = if l > 1 { self.reach(l, 1, l - 2) } else { BrickSet::default() };
        }
        self
    }

    /// Splits the parents of the split octants of level `l`, and those of the octants `touched`, of
    /// level `l - 1`, that are kept. Collective: another rank may own the parent of an octant.
    fn close(&mut self, l: Level, touched: BrickSet) {
        let split = self.ownership.sources(l, self.split[l as usize].bricks());
        let parents: BrickSet = split.map(Brick::parents).collect();
        let fresh = parents.without(&self.split[l as usize - 1]);
        let from = self.level_of_sources(l + 1);
        let ([fresh, touched], sent) =
            self.ownership.redistribute(from, l - 1, [fresh, touched], self.comm);
        self.counters.halo_bricks += sent;
        self.split_more(l - 1, fresh);
        self.split_kept(l - 1, touched);
    }

    /// The level of the sources of level `l`: its leaves, or split octants for whole groups (see above).
    fn level_of_sources(&self, l: Level) -> Level {
        if l > self.rules.level_surface { l } else { l - 1 }
    }

    /// The octants of level `to`, `l - 1` or `l - 2`, that the sources of level `l` on this rank reach within `radius` cells:
    /// kept leaves, or whole groups (see above). Groups without kept leaves are among these: to find them takes as long as to dilate them.
    fn reach(&mut self, l: Level, radius: u32, to: Level) -> BrickSet {
        if l > self.rules.level_surface {
            let mut split = self.split[l as usize].cursor();
            let mut deleted = self.deleted[l as usize].cursor();
            let leaves = self
                .ownership
                .sources(l, Tree::exists(&self.split, l))
                .map(|b| Brick { bits: b.bits & !split.get(b.key) & !deleted.get(b.key), ..b })
                .filter(|b| b.bits != 0);
            let reached = dilate_children(l - 1, leaves, radius);
            let parents = self.counted(reached);
            return if to < l - 1 { parents.coarsen() } else { parents };
        }
        let groups = self.ownership.sources(l - 1, self.split[l as usize - 1].bricks());
        let radius = radius.div_ceil(2);
        // What is reached is the greatest set of all: its parents are made without it.
        let reached = match to < l - 1 {
            true => dilate_children(to, groups, radius),
            false => dilate(to, groups, radius),
        };
        self.counted(reached)
    }

    /// The octants that a dilation has reached; counts its work.
    fn counted(&mut self, reached: Reached) -> BrickSet {
        self.counters.words_dilated += reached.words;
        let split: usize = self.split.iter().map(BrickSet::bytes).sum();
        self.bytes = self.bytes.max(split + reached.bytes);
        reached.octants
    }

    /// The paper's exchange of extent boxes: sends the octants that were reached from sources of level `from` to the ranks that hold
    /// them, which split those that are kept. Collective.
    fn split_where_kept(&mut self, from: Level, l: Level, reached: BrickSet) {
        let ([reached], sent) = self.ownership.redistribute(from, l, [reached], self.comm);
        self.counters.halo_bricks += sent;
        self.split_kept(l, reached);
    }

    /// Splits those of the octants that are kept, in bricks that this rank holds.
    fn split_kept(&mut self, l: Level, reached: BrickSet) {
        let fresh = reached.without(&self.split[l as usize]);
        self.split_more(l, kept(&self.split, self.deleted, l, fresh));
    }

    /// Splits octants that are not split yet, in bricks that this rank holds.
    fn split_more(&mut self, l: Level, fresh: BrickSet) {
        let owned = self.ownership.owned(l, &fresh).map(|b| u64::from(b.bits.count_ones()));
        self.counters.octants_split_graded += owned.sum::<u64>();
        self.split[l as usize] = std::mem::take(&mut self.split[l as usize]).union(fresh);
    }

    /// The layer of finest cells that a mesh without crossing leaves starts from: kept octants of the
    /// surface level, which is not 0, that touch a crossing leaf. Collective.
    fn extra_layer(&mut self, surface: Level) {
        for m in (surface..self.crossing.len() as Level).rev() {
            let leaves = self.ownership.sources(m, self.crossing[m as usize].bricks());
            let reached = dilate_children(m - 1, leaves, 1);
            let touched = (surface..m).fold(self.counted(reached), |set, _| set.coarsen());
            self.split_where_kept(m, surface - 1, touched);
        }
    }
}
