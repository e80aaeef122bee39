//! What all ranks know of T0's top before it is divided: which octants split, and where the facets' area lies.
//!
//! To a moderate level everywhere; deeper only where someone asks, as what everybody is told costs every
//! rank, and most of it would only separate octants of one rank.

use super::cut::{Cut, span};
use crate::brickset::BrickSet;
use crate::comm::{Comm, gather_merged};
use crate::facet::Facet;
use crate::lattice::{ExtentBox, Rules};
use crate::octant::{Level, start57};
use crate::partition::area::Areas;
use crate::partition::boxed;
use crate::tree::Tree;
use crate::voxelise::{Depth, Filed, Start, Work, refine};
use std::ops::Range;

/// See the module.
pub struct Survey<'a> {
    facets: &'a [Facet],
    filed: Filed,
    rules: &'a Rules,
    comm: &'a dyn Comm,
    /// Octants that split in T0, and its crossing leaves: exact as far as `may_divide`.
    pub marks: Tree,
    areas: Areas,
    /// Level-19 codes from which on leaves were told to be more or fewer than expected, ascending, and by how
    /// many, all before it together.
    told: Vec<(u64, i64)>,
    /// Levels that base leaves may have, ascending: the first everywhere.
    levels: Vec<Level>,
    /// For each level but the last, the octants within which base leaves may be of the next.
    deeper: Vec<BrickSet>,
    /// Work done.
    pub work: Work,
}

impl<'a> Survey<'a> {
    /// Looks at everything down to the first of `levels`. Areas are known if `with_areas`. Collective.
    pub fn new(
        facets: &'a [Facet],
        rules: &'a Rules,
        levels: Vec<Level>,
        with_areas: bool,
        comm: &'a dyn Comm,
    ) -> Self {
        let areas = if with_areas {
            Areas::gather(facets, rules, levels[0], comm)
        } else {
            Areas::default()
        };
        let mut survey = Self {
            facets,
            filed: Filed::new(facets),
            rules,
            comm,
            marks: Tree::default(),
            areas,
            told: Vec::new(),
            deeper: vec![BrickSet::default(); levels.len() - 1],
            levels,
            work: Work::default(),
        };
        survey.mark(survey.levels[0], &[Start { level: 0, code: 0 }]);
        survey
    }

    /// Levels that base leaves may have.
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// Whether an octant may be above base leaves.
    pub fn may_divide(&self, l: Level, code: u64) -> bool {
        // The last of the levels that the octant is not above.
        match self.levels.partition_point(|&at| at <= l) {
            0 => true,
            k => self
                .deeper
                .get(k - 1)
                .is_some_and(|octants| octants.contains(code >> (3 * (l - self.levels[k - 1])))),
        }
    }

    /// Looks deeper, to the next of the levels, in octants of level number `k`, which must be split in T0.
    /// Collective; the same on all ranks.
    pub fn look_deeper(&mut self, k: usize, octants: BrickSet) {
        let fresh = octants.without(&self.deeper[k]);
        if fresh.is_empty() {
            return;
        }
        let (level, next) = (self.levels[k], self.levels[k + 1]);
        self.areas.refine(self.facets, self.rules, level, &fresh, next, self.comm);
        let starts: Vec<Start> = fresh.codes().map(|code| Start { level, code }).collect();
        self.mark(next, &starts);
        self.deeper[k] = std::mem::take(&mut self.deeper[k]).union(fresh);
    }

    /// The entries of an octant's areas.
    pub fn places(&self, l: Level, code: u64) -> Range<usize> {
        self.areas.places_within(&self.areas.places(), span(l, code))
    }

    /// The same for an octant whose entries are among some.
    pub fn places_within(&self, among: &Range<usize>, l: Level, code: u64) -> Range<usize> {
        self.areas.places_within(among, span(l, code))
    }

    /// The same for an octant whose entries start at one.
    pub fn places_from(&self, from: usize, l: Level, code: u64) -> Range<usize> {
        self.areas.places_from(from, span(l, code))
    }

    /// Leaves of the mesh to expect in an octant with these entries.
    pub fn weight(&self, l: Level, code: u64, places: &Range<usize>) -> u64 {
        // A facet's cells come with the layers on its kept side, a third of them being coarser.
        let thick = (u64::from(self.rules.layer_cells_min) + 2) * 4 / 3;
        let expected =
            1 + self.areas.cells(places).saturating_mul(thick) + boxed(l, code, self.rules);
        if self.told.is_empty() {
            return expected;
        }
        let before = |at: u64| {
            let behind = self.told.partition_point(|t| t.0 < at);
            behind.checked_sub(1).map_or(0, |last| self.told[last].1)
        };
        let span = span(l, code);
        expected.saturating_add_signed(before(span.end) - before(span.start)).max(1)
    }

    /// Makes expectations those that were told for a cut's pieces. What a piece has more or less is taken to be
    /// at its corner; pieces are small where that matters.
    pub fn calibrate(&mut self, cut: &Cut, told: &[u64]) {
        let more = cut.pieces.iter().zip(told).scan(0, |sum, (p, &told)| {
            *sum += told as i64 - p.weight as i64;
            Some((start57(p.level, p.code), *sum))
        });
        self.told = more.collect();
    }

    /// Marks what all facets and boxes ask to be split below `starts`, so far that base leaves may be of
    /// level `level`. Collective.
    fn mark(&mut self, level: Level, starts: &[Start]) {
        let rules = self.rules;
        let level = (level + 1).min(rules.level_deepest().max(1));
        let boxes = rules.boxes.iter().map(|b| ExtentBox { level: b.level.min(level), ..*b });
        let depth = Depth { surface: rules.level_surface.min(level), boxes: boxes.collect() };
        let (mine, work) = refine(&self.filed, &depth, starts);
        self.work.facet_brick_tests += work.facet_brick_tests;
        self.work.bricks_voxelised += work.bricks_voxelised;
        // Level and kind go into the upper bits of a brick's key, which has 54.
        const KEY_BITS: u32 = 54;
        let mut entries = Vec::new();
        for (kind, sets) in (0..).zip([&mine.split, &mine.crossing]) {
            for (l, set) in (0..=u64::from(level)).zip(sets) {
                let place = (kind << 5 | l) << KEY_BITS;
                entries.extend(set.bricks().map(|b| [place | b.key, b.bits]));
            }
        }
        let all = gather_merged(entries, |a, b| a | b, self.comm);
        for told in all.chunk_by(|a, b| a[0] >> KEY_BITS == b[0] >> KEY_BITS) {
            let place = told[0][0] >> KEY_BITS;
            let Tree { split, crossing } = &mut self.marks;
            let sets = if place >> 5 == 0 { split } else { crossing };
            let set = &mut sets[(place & 31) as usize];
            let mut fresh = BrickSet::default();
            told.iter().for_each(|e| fresh.push(e[0] & ((1 << KEY_BITS) - 1), e[1]));
            *set = std::mem::take(set).union(fresh);
        }
    }
}
