//! Refinement around facets and extent boxes: from facets to the base tree T0 (the paper's section II.B), on the ranks that own its
//! octants.
//!
//! Every facet is sent to the owners of the octants that its extent reaches; each rank then voxelises its own octants: depth first from the
//! root, two levels at a time, where the rank owns a part. The facets of a brick are tested against its 64 octants at once, and each
//! crossed octant receives the list of the facets that cross it. The level between follows by coarsening: as octants are closed, an octant
//! is crossed if and only if one of its children is.
//!
//! Facets are binned by their *containing octant*, the smallest octant that contains the facet's extent. A facet crosses all ancestors of
//! its containing octant, so it need not be tested at the levels above it, and the facets contained in an octant are a contiguous range. A
//! facet smaller than a leaf therefore costs a sort and one bit. Facets that cross an octant without being contained in it are
//! *straddling*: they are passed down in lists.
//!
//! Invariants:
//! - a rank has every facet whose extent reaches an octant that it owns, once;
//! - in [`BinnedFacets`], facets are sorted by containing octant, and each one meets the root.

use crate::input::lattice::{ExtentBox, Rules, box_mask};
use crate::partition::ownership::{Ownership, brick_start};
use crate::record::Counters;
use bricks::brick;
use bricks::brick::ones;
use bricks::facet::{Facet, FacetTest, crossed};
use bricks::octant::{LEVEL_MAX, Level, ROOT_BITS, ROOT_EDGE, morton, start57};
use bricks::tree::Tree;
use ranks::{Comm, MessageBuffer};
use std::ops::Range;

/// Sends every facet to the owners of the octants that its extent reaches. Returns the facets for this rank. Collective.
pub fn route(facets: &[Facet], ownership: &Ownership, comm: &dyn Comm) -> Vec<Facet> {
    let mut to_rank: Vec<Vec<Facet>> = vec![Vec::new(); comm.size()];
    // Index of the latest facet for each rank.
    let mut latest = vec![u64::MAX; comm.size()];
    // Facets that follow each other in a slice are close in space: often in the interval of the one before.
    let (mut interval, mut its_owner) = (0..0, 0);
    for (i, f) in (0u64..).zip(facets) {
        let Some(containing) = ContainingOctant::of(f) else { continue };
        let (l, start) = (containing.level(), containing.start());
        if !interval.contains(&start) {
            (interval, its_owner) = ownership.interval_at(start);
        }
        let mut send = |owner: usize| {
            if std::mem::replace(&mut latest[owner], i) != i {
                to_rank[owner].push(*f);
            }
        };
        let code = start >> (3 * (LEVEL_MAX - l));
        match start57(l, code + 1) <= interval.end {
            true => send(its_owner),
            false => ownership.owners_in(l, code, &[0, 1, 2].map(|a| f.range(a)), &mut send),
        }
    }
    let mut local = std::mem::take(&mut to_rank[comm.rank()]);
    let words = to_rank.iter().map(|facets| size_of_val(&facets[..]) / size_of::<u64>() + 1);
    let mut messages = MessageBuffer::with_capacity(words.sum());
    for (owner, facets) in to_rank.into_iter().enumerate() {
        messages.write_values(owner, &facets);
    }
    local.append(&mut comm.sparse_all_to_all(messages).values());
    local
}

/// The smallest octant that contains all closed level-19 cells that a facet's extent meets, and so the facet:
/// its level and the level-19 Morton code of its minimum corner. Sorts in Morton order, ancestors first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ContainingOctant(u64);

impl ContainingOctant {
    /// The octant that contains the facet; none if the facet misses the root. Always crossed by the facet.
    pub fn of(f: &Facet) -> Option<Self> {
        const SHIFT: u32 = ROOT_BITS - LEVEL_MAX;
        let mut differ = 0;
        let mut low = [0; 3];
        let mut sticks_out = false;
        for a in 0..3 {
            let (lo, hi) = f.range(a);
            if hi < 0 || lo > ROOT_EDGE {
                return None;
            }
            sticks_out |= lo < 0 || hi > ROOT_EDGE;
            let first = ((lo - 1) >> SHIFT).max(0);
            let last = (hi >> SHIFT).min((1 << LEVEL_MAX) - 1);
            differ |= first ^ last;
            low[a] = first as u32;
        }
        if sticks_out {
            // Its clamped extent may meet octants, even the root, that the facet itself misses. Containing
            // octants count as crossed, so only the root will do, and only if the facet crosses it.
            return (crossed(f, [0; 3], 0) & 1 == 1).then_some(Self(0));
        }
        let drop = 64 - differ.leading_zeros();
        Some(Self(morton(low.map(|p| p >> drop << drop)) << 5 | u64::from(LEVEL_MAX - drop)))
    }

    /// The octant's level.
    #[inline]
    pub fn level(self) -> Level {
        (self.0 & 31) as Level
    }

    /// Level-19 Morton code of the octant's minimum corner.
    #[inline]
    pub fn start(self) -> u64 {
        self.0 >> 5
    }
}

/// Facets sorted by containing octant.
pub struct BinnedFacets {
    containing: Vec<ContainingOctant>,
    facets: Vec<Facet>,
}

impl BinnedFacets {
    /// Sorts facets by containing octant; drops those that miss the root.
    pub fn new(facets: &[Facet]) -> Self {
        let mut order: Vec<(ContainingOctant, u32)> = Vec::with_capacity(facets.len());
        let found = facets.iter().zip(0..);
        order.extend(found.filter_map(|(f, i)| Some((ContainingOctant::of(f)?, i))));
        order.sort_unstable_by_key(|o| o.0);
        Self {
            containing: order.iter().map(|o| o.0).collect(),
            facets: order.iter().map(|o| facets[o.1 as usize]).collect(),
        }
    }

    /// Checks the invariant.
    ///
    /// # Panics
    /// If a facet is not where its containing octant puts it.
    pub fn check_invariants(&self) {
        assert!(self.containing.is_sorted(), "facets must be sorted by containing octant");
        assert_eq!(self.containing.len(), self.facets.len(), "one containing octant per facet");
        let found = self.facets.iter().map(ContainingOctant::of);
        for (i, (found, octant)) in found.zip(&self.containing).enumerate() {
            let (level, start) = (octant.level(), octant.start());
            assert_eq!(found, Some(*octant), "facet {i}, binned at {start:#o} of level {level}");
        }
    }
}

/// Refines where a rank owns `own`: intervals of level-19 codes, ascending and disjoint. Returns those splits and crossing leaves of T0
/// in which the rank owns a part, as far as the rank's facets and the boxes ask for them. The union over intervals that tile the curve,
/// and over all facets, is T0.
pub fn refine(binned: &BinnedFacets, rules: &Rules, own: &[Range<u64>]) -> (Tree, Counters) {
    let mut v = Voxeliser {
        binned,
        surface: rules.level_surface,
        own,
        tree: Tree::default(),
        lists: Vec::new(),
        pairs: Vec::new(),
        tests: vec![FacetTest::default(); TESTS_KEPT],
        counters: Counters::default(),
    };
    // The tested levels have the parity of the surface level, so that one of them is that level.
    v.brick(rules.level_surface & 1, 0, (0..binned.facets.len(), 0), &rules.boxes);
    (v.tree, v.counters)
}

/// Number of facets whose tests are kept. In depth-first order, the bricks that a facet reaches follow each other closely.
const TESTS_KEPT: usize = 256;

struct Voxeliser<'a> {
    binned: &'a BinnedFacets,
    surface: Level,
    own: &'a [Range<u64>],
    tree: Tree,
    /// Straddling facets of the bricks on the path from the root, concatenated.
    lists: Vec<u32>,
    /// Tested facets of the bricks on the path from the root, with the octants that they cross.
    pairs: Vec<(u32, u64)>,
    /// Tests of the last facets, each at the facet's index modulo the length.
    tests: Vec<FacetTest>,
    counters: Counters,
}

/// The facets that each octant of a brick contains; none if all contain none.
type Runs = Option<[(u32, u32); 64]>;

impl Voxeliser<'_> {
    /// The octants of level `l` in a brick in which the rank owns a part.
    #[inline]
    fn allowed(&self, l: Level, key: u64) -> u64 {
        let owns_from = |start: u64| &self.own[self.own.partition_point(|i| i.end <= start)..];
        let (start, end) = (brick_start(l, key), brick_start(l, key + 1));
        if l >= 2 && owns_from(start).first().is_some_and(|i| i.start <= start && end <= i.end) {
            return u64::MAX;
        }
        let meets = |code: u64| {
            owns_from(start57(l, code)).first().is_some_and(|i| i.start < start57(l, code + 1))
        };
        (0..64).fold(0, |all, bit| all | u64::from(meets(key << 6 | bit)) << bit)
    }

    /// Decides the octants of level `l` in a brick and their parents, and continues with their descendants. The octant that the brick fills
    /// contains the facets `contained`; those in `lists` from `straddling` on straddle its boundary.
    fn brick(&mut self, l: Level, key: u64, facets: (Range<usize>, usize), boxes: &[ExtentBox]) {
        let (contained, straddling) = facets;
        self.counters.bricks_voxelised += 1;
        let (min_corner, allowed) = (brick::min_corner(l, key), self.allowed(l, key));
        let is_near = |b: &&ExtentBox| b.level >= l && box_mask(b, min_corner, l) != 0;
        let near: Vec<ExtentBox> = boxes.iter().filter(is_near).copied().collect();
        let is_last = l >= self.surface && near.iter().all(|b| b.level <= l);
        let first_pair = self.pairs.len();
        let (binned, runs) = self.bin_contained(contained, l);
        // Facets contained in the octants come first: where facets are small, the others mostly need no test then.
        let crossing = (straddling..self.lists.len()).fold(binned, |all, i| {
            all | self.test(self.lists[i], l, min_corner, is_last.then_some(all))
        }) & allowed;
        let of_box = |b: &ExtentBox| box_mask(b, min_corner, l);
        let asked = |least| near.iter().filter(|b| b.level > least).fold(0, |m, b| m | of_box(b));
        let split = if l < self.surface { crossing } else { 0 } | asked(l) & allowed;
        let exists = if l == 0 {
            1
        } else {
            // A box asks for a parent also where it meets only children that other ranks own.
            let asked = brick::parents(asked(l - 1)) & brick::parents(allowed);
            self.level_above(l, key, crossing, asked)
        };
        self.tree.split[l as usize].push(key, split);
        if l >= self.surface {
            self.tree.crossing[l as usize].push(key, crossing & exists & !split);
        }
        for bit in ones(split) {
            let (begin, mut end) = (self.lists.len(), self.lists.len());
            self.lists.resize(begin + self.pairs.len() - first_pair, 0);
            // Without a branch, which the processor could not predict.
            for (facet, octants) in &self.pairs[first_pair..] {
                self.lists[end] = *facet;
                end += usize::from(octants >> bit & 1 == 1);
            }
            self.lists.truncate(end);
            let (from, to) = runs.map_or((0, 0), |runs| runs[bit as usize]);
            let facets = (from as usize..to as usize, begin);
            self.brick(l + 2, key << 6 | u64::from(bit), facets, &near);
            self.lists.truncate(begin);
        }
        self.pairs.truncate(first_pair);
    }

    /// Records the parents, of level `l - 1`, of a brick's octants; returns the octants of level `l` that exist.
    fn level_above(&mut self, l: Level, key: u64, crossing: u64, asked: u8) -> u64 {
        let crossed = brick::parents(crossing);
        let split = if l - 1 < self.surface { crossed } else { 0 } | asked;
        let put = |byte: u8| u64::from(byte) << (8 * (key & 7));
        self.tree.split[l as usize - 1].push(key >> 3, put(split));
        if l > self.surface {
            self.tree.crossing[l as usize - 1].push(key >> 3, put(crossed & !split));
        }
        brick::children(split)
    }

    /// Tests a facet against a brick; returns the octants that it crosses, and where no list of them is needed, perhaps others that are
    /// `known` to be crossed.
    #[inline]
    fn test(&mut self, f: u32, l: Level, min_corner: [i64; 3], known: Option<u64>) -> u64 {
        self.counters.facet_brick_tests += 1;
        let facet = &self.binned.facets[f as usize];
        let kept = &mut self.tests[f as usize % TESTS_KEPT];
        let mask = kept.octants(facet, min_corner, l, known.unwrap_or(0));
        if mask != 0 && known.is_none() {
            self.pairs.push((f, mask));
        }
        mask
    }

    /// Bins the contained facets of a brick by octant. Appends those that no octant of the brick contains to those that straddle its
    /// boundary. Returns the octants that contain facets, and the facets of each.
    fn bin_contained(&mut self, contained: Range<usize>, l: Level) -> (u64, Runs) {
        let (mut crossing, mut runs) = (0, None);
        let mut i = contained.start;
        while i < contained.end {
            let octant = self.binned.containing[i];
            if octant.level() < l {
                self.lists.push(i as u32);
                i += 1;
                continue;
            }
            let code = octant.start() >> (3 * (LEVEL_MAX - l));
            // The first one, in sorting order, at the minimum corner of the next octant.
            let end = ContainingOctant(start57(l, code + 1) << 5);
            let after = &self.binned.containing[i..contained.end];
            let run = i + after.partition_point(|octant| *octant < end);
            // Most bricks contain no facet, so that nothing is cleared for them.
            runs.get_or_insert([(0, 0); 64])[(code & 63) as usize] = (i as u32, run as u32);
            crossing |= 1 << (code & 63);
            i = run;
        }
        (crossing, runs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::octant::{corner, edge};
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    /// The children of the root, and instead of some their children, each with an owner of its own.
    fn two_levels(split: u8) -> Vec<(Level, u64)> {
        let octants = (0..8u64).flat_map(|c| match split >> c & 1 {
            0 => vec![(1, c)],
            _ => (0..8).map(|d| (2, c << 3 | d)).collect(),
        });
        octants.collect()
    }

    proptest! {
        #[test]
        fn the_owners_of_all_octants_that_an_extent_reaches_are_found(
            split in 1u8..,
            v in prop::array::uniform3(prop::array::uniform3(-2i32..=10)),
        ) {
            // Vertices on the faces of octants, next to them, and outside the root.
            let v = v.map(|p| p.map(|c| (c / 2) * (1 << 25) + c % 2));
            let (f, leaves) = (Facet { v }, two_levels(split));
            let starts = leaves.iter().map(|&(level, code)| start57(level, code));
            let ownership = Ownership::along(0, leaves.len(), starts.zip(0..).collect());
            let reached = |(level, code): (Level, u64)| (0..3).all(|a| {
                let at = corner(level, code)[a];
                f.range(a).0 <= at + edge(level) && f.range(a).1 >= at
            });
            // Facets outside the root have no containing octant.
            prop_assume!(reached((0, 0)));
            let mut found = BTreeSet::new();
            let extent = std::array::from_fn(|a| f.range(a));
            ownership.owners_in(0, 0, &extent, &mut |b| _ = found.insert(b));
            let want = (0..).zip(&leaves).filter(|(_, leaf)| reached(**leaf)).map(|(owner, _)| owner);
            prop_assert!(found.into_iter().eq(want));
        }
    }

    #[test]
    #[should_panic(expected = "facets must be sorted by containing octant")]
    fn facets_out_of_order_are_found() {
        let facet = |c: i32| Facet { v: [[c; 3]; 3] };
        let mut binned = BinnedFacets::new(&[facet(9000), facet(100)]);
        binned.check_invariants();
        binned.containing.swap(0, 1);
        binned.check_invariants();
    }

    #[test]
    #[should_panic(expected = "facet 1, binned at")]
    fn a_facet_in_the_wrong_bin_is_found() {
        let facet = |c: i32| Facet { v: [[c; 3]; 3] };
        let mut binned = BinnedFacets::new(&[facet(9000), facet(100)]);
        binned.facets[1] = facet(20_000);
        binned.check_invariants();
    }

    #[test]
    fn values_are_those_of_the_proofs() {
        let of = |a: &[i128]| {
            let v = [0, 3, 6].map(|i| [0, 1, 2].map(|axis| a[i + axis] as i32));
            ContainingOctant::of(&Facet { v }).map(|octant| octant.0.into()).into_iter().collect()
        };
        crate::values::compare("src/refine.rs", &[("of", &of)]);
    }
}
