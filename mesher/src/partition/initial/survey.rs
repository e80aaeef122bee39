//! What all ranks know of T0's top before it is cut into base leaves: which octants split, and where the
//! facets' area lies.

use super::cut::span;
use crate::brick::Brick;
use crate::comm::{Comm, all_gather_reduced};
use crate::facet::Facet;
use crate::lattice::{ExtentBox, Rules};
use crate::octant::Level;
use crate::partition::area::Areas;
use crate::partition::ownership::KEY_BITS;
use crate::partition::{boxed, thickness};
use crate::tree::{PerLevel, per_level};
use crate::voxelise::{BinnedFacets, Depth, SubtreeRoot, Work, refine};
use std::ops::Range;

/// See the module.
pub struct Survey<'a> {
    rules: &'a Rules,
    /// Octants that split in T0: exact above `level`.
    pub split: PerLevel,
    areas: Areas,
    /// Deepest level that base leaves may have.
    level: Level,
    /// Work done.
    pub work: Work,
}

impl<'a> Survey<'a> {
    /// Looks at everything down to a level. Areas are known if `with_areas`. Collective.
    pub fn new(
        facets: &[Facet],
        rules: &'a Rules,
        level: Level,
        with_areas: bool,
        comm: &dyn Comm,
    ) -> Self {
        let areas =
            if with_areas { Areas::gather(facets, rules, level, comm) } else { Areas::default() };
        let work = Work::default();
        let mut survey = Self { rules, split: per_level(), areas, level, work };
        survey.mark(facets, comm);
        survey
    }

    /// Deepest level that base leaves may have.
    pub fn level(&self) -> Level {
        self.level
    }

    /// The entries of an octant's areas.
    pub fn places(&self, l: Level, code: u64) -> Range<usize> {
        self.areas.places_within(&self.areas.places(), span(l, code))
    }

    /// The same for an octant whose entries are among some.
    pub fn places_within(&self, among: &Range<usize>, l: Level, code: u64) -> Range<usize> {
        self.areas.places_within(among, span(l, code))
    }

    /// Leaves of the mesh to expect in an octant with these entries.
    pub fn weight(&self, l: Level, code: u64, places: &Range<usize>) -> u64 {
        let by_area = self.areas.cells(places).saturating_mul(thickness(self.rules));
        1 + by_area + boxed(l, code, self.rules)
    }

    /// Marks what all facets and boxes ask to be split above the level. Collective.
    fn mark(&mut self, facets: &[Facet], comm: &dyn Comm) {
        let rules = self.rules;
        let level = self.level;
        let boxes = rules.boxes.iter().map(|b| ExtentBox { level: b.level.min(level), ..*b });
        let depth = Depth { surface: rules.level_surface.min(level), boxes: boxes.collect() };
        let (mine, work) =
            refine(&BinnedFacets::new(facets), &depth, &[SubtreeRoot { level: 0, code: 0 }]);
        self.work = work;
        let sets = (0..u64::from(level)).zip(&mine.split);
        let place = |l: u64| move |b: Brick| [l << KEY_BITS | b.key, b.bits];
        let entries = sets.flat_map(|(l, set)| set.bricks().map(place(l)));
        for [place, bits] in all_gather_reduced(entries.collect(), |a, b| a | b, comm) {
            self.split[(place >> KEY_BITS) as usize].push(place & ((1 << KEY_BITS) - 1), bits);
        }
    }
}
