//! Refinement around geometry and boxes: facets to the base tree T0 (the paper's section II.A).
//!
//! Depth first from a start octant, two levels at a time: a brick's facets are tested against its 64
//! octants at once, each crossed octant gets the list of its facets, and the level between follows
//! by coarsening (an octant is crossed when one of its children is, both being closed).
//!
//! A facet is filed under its *home*: the deepest octant that holds its whole extent. Inside the home
//! it need not be tested on the way down, and facets sorted by home are found as ranges; so a facet
//! smaller than a leaf costs a sort and a bit.

use crate::brick;
use crate::brickset::ones;
use crate::facet::{Facet, box_mask, crossed};
use crate::lattice::ExtentBox;
use crate::octant::{LEVEL_MAX, Level, ROOT_BITS, ROOT_EDGE, corner, edge, morton, start57};
use crate::tree::Tree;
use std::ops::Range;

/// The octant that a facet's extent stays in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Home(u64);

impl Home {
    /// The facet's home; none if it misses the root.
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
            // What reaches beyond the root may miss octants that its clamped extent is in: its home is the root.
            sticks_out |= lo < 0 || hi > ROOT_EDGE;
            let first = ((lo - 1) >> SHIFT).max(0);
            let last = (hi >> SHIFT).min((1 << LEVEL_MAX) - 1);
            differ |= first ^ last;
            low[a] = first as u32;
        }
        if sticks_out {
            // Its extent may meet the root where it does not itself; homes are taken to be crossed.
            return (crossed(f, [0; 3], 0) & 1 == 1).then_some(Self(0));
        }
        let drop = 64 - differ.leading_zeros();
        Some(Self(morton(low.map(|p| p >> drop << drop)) << 5 | u64::from(LEVEL_MAX - drop)))
    }

    /// Level of the home.
    #[inline]
    pub fn level(self) -> Level {
        (self.0 & 31) as Level
    }

    /// Level-19 Morton code of the home's minimum corner.
    #[inline]
    pub fn start(self) -> u64 {
        self.0 >> 5
    }

    /// The least home that can be in the octant or behind it: for range searches.
    #[inline]
    fn first_in(start: u64) -> Self {
        Self(start << 5)
    }
}

/// Facets sorted by home.
#[derive(Debug, Default)]
pub struct Filed {
    homes: Vec<Home>,
    facets: Vec<Facet>,
}

impl Filed {
    /// Files facets; those that miss the root are dropped.
    pub fn new(facets: &[Facet]) -> Self {
        let mut order: Vec<(Home, u32)> = Vec::with_capacity(facets.len());
        order.extend(facets.iter().zip(0..).filter_map(|(f, i)| Some((Home::of(f)?, i))));
        order.sort_unstable_by_key(|o| o.0);
        Self {
            homes: order.iter().map(|o| o.0).collect(),
            facets: order.iter().map(|o| facets[o.1 as usize]).collect(),
        }
    }

    /// The facets at home in an octant (given by the range of level-19 codes) or deeper.
    fn residents(&self, l: Level, code: u64) -> Range<usize> {
        let at = |start| self.homes.partition_point(|h| *h < Home::first_in(start));
        let range = at(start57(l, code))..at(start57(l, code + 1));
        // Coarser octants with the same corner sort first; the facets at home there are not residents.
        let skip = self.homes[range.clone()]
            .partition_point(|h| h.start() == start57(l, code) && h.level() < l);
        range.start + skip..range.end
    }
}

/// How deep to refine.
#[derive(Clone, Debug)]
pub struct Depth {
    /// Leaves that a facet crosses are refined to this level.
    pub surface: Level,
    /// Boxes with the levels they ask for.
    pub boxes: Vec<ExtentBox>,
}

/// An octant to refine from.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// Its level.
    pub level: Level,
    /// Its Morton code.
    pub code: u64,
}

/// What was done; repeats exactly.
#[derive(Clone, Copy, Debug, Default)]
pub struct Work {
    /// Facet-brick tests.
    pub facet_brick_tests: u64,
    /// Bricks visited.
    pub bricks_voxelised: u64,
}

/// Refines the octants of `starts`, ascending and disjoint, as far as they are in T0 at all. The tree holds them, what
/// is below them, and of what is above them that which these octants alone ask for: united over starts
/// that tile the root, and over all facets, it is T0.
pub fn refine(filed: &Filed, depth: &Depth, starts: &[Start]) -> (Tree, Work) {
    let mut v = Voxeliser {
        filed,
        surface: depth.surface,
        boxes: &depth.boxes,
        tree: Tree::default(),
        lists: Vec::new(),
        pairs: Vec::new(),
        work: Work::default(),
    };
    let astray = v.straddlers(starts);
    for (start, list) in starts.iter().zip(astray) {
        v.start(start, list);
    }
    (v.tree, v.work)
}

struct Voxeliser<'a> {
    filed: &'a Filed,
    surface: Level,
    boxes: &'a [ExtentBox],
    tree: Tree,
    /// Facets of the bricks on the way down, one list behind the other.
    lists: Vec<u32>,
    /// Facets of the bricks on the way down with the octants that they cross.
    pairs: Vec<(u32, u64)>,
    work: Work,
}

/// The facets of a brick: those at home in it and others that reach into it.
struct Load {
    residents: Range<usize>,
    straddlers: Range<usize>,
}

impl Voxeliser<'_> {
    /// For each start the facets that are at home above it and may reach into it.
    fn straddlers(&self, starts: &[Start]) -> Vec<Vec<u32>> {
        let mut lists = vec![Vec::new(); starts.len()];
        let begins: Vec<u64> = starts.iter().map(|s| start57(s.level, s.code)).collect();
        for (i, home) in (0..).zip(&self.filed.homes) {
            // Starts inside the home: none if the home is inside a start or in nobody's.
            let end = home.start() + (1 << (3 * (LEVEL_MAX - home.level())));
            let from = begins.partition_point(|&b| b < home.start());
            let inside = begins[from..].partition_point(|&b| b < end);
            for s in from..from + inside {
                if starts[s].level > home.level()
                    && reaches(&self.filed.facets[i as usize], &starts[s])
                {
                    lists[s].push(i);
                }
            }
        }
        lists
    }

    fn start(&mut self, start: &Start, straddlers: Vec<u32>) {
        let Start { level: m, code } = *start;
        let residents = self.filed.residents(m, code);
        // A root that is not split has its own brick, which tells so.
        if m > 0 && !self.way_down(start, &residents, &straddlers) {
            return;
        }
        let begin = self.lists.len();
        self.lists.extend(straddlers);
        let load = Load { residents, straddlers: begin..self.lists.len() };
        // Tests fall on levels with the parity of the surface level, so that one falls on it.
        let (l, key, allowed) = match (m, (self.surface ^ m) & 1) {
            (0, odd) => (odd, 0, brick::valid(odd)),
            (m, 0) => (m + 2, code, u64::MAX),
            (m, _) => (m + 1, code >> 3, 0xff << (8 * (code & 7))),
        };
        self.brick(l, key, load, self.boxes, allowed);
        self.lists.truncate(begin);
    }

    /// Records what a start asks for from the root down to itself; returns whether it is split.
    fn way_down(&mut self, start: &Start, residents: &Range<usize>, straddlers: &[u32]) -> bool {
        let Start { level: m, code } = *start;
        let at = corner(m, code);
        let crosses = |i: &u32| crossed(&self.filed.facets[*i as usize], at, m) & 1 == 1;
        let crossing = !residents.is_empty() || straddlers.iter().any(crosses);
        for l in 0..=m {
            let above = code >> (3 * (m - l));
            let (key, bit) = (above >> 6, 1 << (above & 63));
            let asked = |b: &ExtentBox| b.level > l && b.meets(corner(l, above), edge(l));
            let asked = self.boxes.iter().any(asked);
            if l < self.surface && crossing || asked {
                self.tree.split[l as usize].push(key, bit);
                continue;
            }
            // A leaf of T0, the start itself or above it.
            if crossing {
                self.tree.crossing[l as usize].push(key, bit);
            }
            return false;
        }
        true
    }

    /// Decides the octants of level `l` in a brick, and of `l - 1` above them; goes on below.
    fn brick(&mut self, l: Level, key: u64, load: Load, boxes: &[ExtentBox], allowed: u64) {
        self.work.bricks_voxelised += 1;
        let at = brick::min_corner(l, key);
        let first_pair = self.pairs.len();
        let mut runs = [(0u32, 0u32); 64];
        let crossing = (self.test(&load, l, at)
            | self.bin_residents(&load.residents, l, at, &mut runs))
            & allowed;
        let near: Vec<ExtentBox> =
            boxes.iter().filter(|b| b.level >= l && box_mask(b, at, l) != 0).copied().collect();
        let asked = |least: Level| {
            near.iter()
                .filter(|b| b.level > least)
                .map(|b| box_mask(b, at, l))
                .fold(0, |m, b| m | b)
                & allowed
        };
        let split = if l < self.surface { crossing } else { 0 } | asked(l);
        let exists = if l == 0 { 1 } else { self.level_above(l, key, crossing, asked(l - 1)) };
        self.tree.split[l as usize].push(key, split);
        if l >= self.surface {
            self.tree.crossing[l as usize].push(key, crossing & exists & !split);
        }
        for bit in ones(split) {
            let begin = self.lists.len();
            let reach =
                self.pairs[first_pair..].iter().filter(|p| p.1 >> bit & 1 == 1).map(|p| p.0);
            self.lists.extend(reach);
            let (from, to) = runs[bit as usize];
            let load =
                Load { residents: from as usize..to as usize, straddlers: begin..self.lists.len() };
            self.brick(l + 2, key << 6 | u64::from(bit), load, &near, u64::MAX);
            self.lists.truncate(begin);
        }
        self.pairs.truncate(first_pair);
    }

    /// Records level `l - 1` above a brick; returns the octants of level `l` that exist.
    fn level_above(&mut self, l: Level, key: u64, crossing: u64, asked: u64) -> u64 {
        let crossed = brick::parents(crossing);
        let split = if l - 1 < self.surface { crossed } else { 0 } | brick::parents(asked);
        let put = |byte: u8| u64::from(byte) << (8 * (key & 7));
        self.tree.split[l as usize - 1].push(key >> 3, put(split));
        if l > self.surface {
            self.tree.crossing[l as usize - 1].push(key >> 3, put(crossed & !split));
        }
        brick::children(split)
    }

    /// Tests the facets that reach in from above.
    fn test(&mut self, load: &Load, l: Level, at: [i64; 3]) -> u64 {
        let mut crossing = 0;
        for i in load.straddlers.clone() {
            let f = self.lists[i];
            let mask = crossed(&self.filed.facets[f as usize], at, l);
            if mask != 0 {
                self.pairs.push((f, mask));
                crossing |= mask;
            }
        }
        self.work.facet_brick_tests += load.straddlers.len() as u64;
        crossing
    }

    /// Files the facets at home in the brick under its octants, and tests those at home above them.
    fn bin_residents(
        &mut self,
        residents: &Range<usize>,
        l: Level,
        at: [i64; 3],
        runs: &mut [(u32, u32); 64],
    ) -> u64 {
        let mut crossing = 0;
        let mut i = residents.start;
        while i < residents.end {
            let home = self.filed.homes[i];
            if home.level() < l {
                let mask = crossed(&self.filed.facets[i], at, l);
                self.pairs.push((i as u32, mask));
                self.work.facet_brick_tests += 1;
                crossing |= mask;
                i += 1;
                continue;
            }
            let code = home.start() >> (3 * (LEVEL_MAX - l));
            let end = Home::first_in((code + 1) << (3 * (LEVEL_MAX - l)));
            let run = i + run_length(&self.filed.homes[i..residents.end], end);
            runs[(code & 63) as usize] = (i as u32, run as u32);
            crossing |= 1 << (code & 63);
            i = run;
        }
        crossing
    }
}

/// Number of leading homes before `end`, by doubling steps: runs are short deep down, long high up.
fn run_length(homes: &[Home], end: Home) -> usize {
    let mut step = 1;
    while homes.get(step).is_some_and(|h| *h < end) {
        step *= 2;
    }
    let near = &homes[step / 2..homes.len().min(step + 1)];
    step / 2 + near.partition_point(|h| *h < end)
}

/// Whether the facet's extent meets the closed octant.
fn reaches(f: &Facet, o: &Start) -> bool {
    let (at, h) = (corner(o.level, o.code), edge(o.level));
    (0..3).all(|a| {
        let (lo, hi) = f.range(a);
        lo <= at[a] + h && hi >= at[a]
    })
}
