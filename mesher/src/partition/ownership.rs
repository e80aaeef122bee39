//! Who holds which bricks.
//!
//! The Morton curve is dealt out to the ranks. A brick fills an octant; if one rank owns all of that, the brick
//! is that rank's alone. If several do, each of them holds a copy (it has bricks below), and all copies are kept
//! equal; if *many* do, or if the brick is one of levels 0 and 1, it is a *top* brick, and all ranks hold a
//! copy. One rank, the owner of the octant's minimum corner, answers for a brick: counts it, emits its leaves and takes
//! its sources.
//!
//! All that this takes is the owners along the Morton curve, run by run. With a brick a rank holds all bricks above
//! it.
//!
//! Invariants: runs follow each other from the curve's start, and neighbours have different owners.

mod neighbours;
mod redistribute;

use crate::octant::{LEVEL_MAX, Level, start57};
use crate::tree::Tree;
use std::ops::Range;
use std::sync::Arc;

/// Runs that make an octant one of many owners. Up to here each owner is told of a brick by itself, which costs
/// messages; beyond, everybody is told of it, which costs every rank time.
const OWNERS_MANY: usize = 9;

/// A leaf of the base tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BaseLeaf {
    /// Its level.
    pub level: Level,
    /// Its Morton code.
    pub code: u64,
    /// The rank that it was dealt to.
    pub owner: usize,
}

impl BaseLeaf {
    /// The root, a single rank's.
    pub const ROOT: Self = Self { level: 0, code: 0, owner: 0 };
}

/// Whose a brick is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placement {
    /// Many ranks': everyone holds a copy.
    FullyReplicated,
    /// A few ranks', each of which holds a copy; this one is among them.
    PartiallyReplicated,
    /// This rank's alone.
    Local,
    /// Others'; the one that answers for it.
    Remote(usize),
}

/// Who owns what, as every rank knows it.
#[derive(Clone, Debug)]
pub struct Ownership {
    rank: usize,
    ranks: usize,
    runs: Arc<Runs>,
    /// This rank's longest stretch: most questions are about what lies in it.
    own: Range<u64>,
    /// Whether it has no other.
    is_single: bool,
    /// Deepest level that has a brick of several owners.
    level_replicated: Level,
    /// Deepest level that has a top brick.
    level_fully_replicated: Level,
}

/// Owners along the Morton curve.
#[derive(Debug, Default)]
struct Runs {
    /// Level-19 codes at which the owner changes, from 0.
    starts: Vec<u64>,
    owners: Vec<usize>,
}

/// The rank of a bystander, who has nothing: see [`Ownership::bystander`].
const RANK_NONE: usize = usize::MAX;

impl Ownership {
    /// The ownership of a single rank.
    pub fn solo() -> Self {
        Self::new(0, 1, &[BaseLeaf::ROOT])
    }

    /// The ownership in which base leaves, which tile the root in Morton order, have their owners.
    ///
    /// # Panics
    /// If the leaves do not follow each other, or an owner is no rank.
    pub fn new(rank: usize, ranks: usize, leaves: &[BaseLeaf]) -> Self {
        let mut at = 0;
        for b in leaves {
            assert_eq!(start57(b.level, b.code), at, "base leaves must follow each other");
            at = start57(b.level, b.code + 1);
        }
        assert_eq!(at, 1 << (3 * LEVEL_MAX), "base leaves must tile the root");
        Self::along(rank, ranks, leaves.iter().map(|b| (start57(b.level, b.code), b.owner)))
    }

    /// The ownership in which owners change at some level-19 codes, ascending from 0.
    ///
    /// # Panics
    /// If the codes do not ascend from 0, or an owner is no rank.
    pub fn along(
        rank: usize,
        ranks: usize,
        changes: impl IntoIterator<Item = (u64, usize)>,
    ) -> Self {
        let mut runs = Runs::default();
        for (start, owner) in changes {
            assert!(owner < ranks, "an owner is a rank");
            let behind = runs.starts.last().map_or(start == 0, |&last| last < start);
            assert!(behind, "owners change at ascending codes, the first of which is 0");
            if runs.owners.last() != Some(&owner) {
                runs.starts.push(start);
                runs.owners.push(owner);
            }
        }
        assert!(!runs.starts.is_empty(), "all is somebody's");
        let (level_replicated, level_fully_replicated) =
            (runs.deepest_brick_of(2), runs.deepest_brick_of(OWNERS_MANY));
        let is_single = runs.of(rank).count() == 1;
        let own = runs.of(rank).max_by_key(|own| own.end - own.start).unwrap_or(0..0);
        Self {
            rank,
            ranks,
            runs: Arc::new(runs),
            own,
            is_single,
            level_replicated,
            level_fully_replicated,
        }
    }

    /// The same as seen by someone who owns nothing: every brick is a top brick or remote.
    pub fn non_owning_view(&self) -> Self {
        Self { rank: RANK_NONE, own: 0..0, is_single: false, ..self.clone() }
    }

    /// What of a tree lies in top bricks: the same on all ranks.
    pub fn top_of(&self, tree: &Tree) -> Tree {
        let mut top = Tree::default();
        for (to, from) in [(&mut top.split, &tree.split), (&mut top.crossing, &tree.crossing)] {
            for l in 0..=self.level_fully_replicated {
                let bricks =
                    from[l as usize].bricks().filter(|b| self.is_fully_replicated(l, b.key));
                bricks.for_each(|b| to[l as usize].push(b.key, b.bits));
            }
        }
        top
    }

    /// The largest octants that this rank owns all of, in Morton order: level and code.
    pub fn octants(&self) -> Vec<(Level, u64)> {
        let mut octants = Vec::new();
        for Range { start: mut at, end } in self.intervals() {
            while at < end {
                // As large as its corner allows, and as there is room for.
                let aligned = (at.trailing_zeros() / 3).min(LEVEL_MAX);
                let up = aligned.min((end - at).ilog2() / 3);
                octants.push((LEVEL_MAX - up, at >> (3 * up)));
                at += 1 << (3 * up);
            }
        }
        octants
    }

    /// The level-19 codes that this rank owns, in order.
    pub fn intervals(&self) -> impl Iterator<Item = Range<u64>> + '_ {
        self.runs.of(self.rank)
    }

    /// The owner at a level-19 code.
    #[inline]
    pub fn owner_at(&self, start: u64) -> usize {
        self.runs.owners[self.runs.at(start)]
    }

    /// The owner of all of an octant; none if it has several.
    #[inline]
    pub fn sole_owner(&self, l: Level, code: u64) -> Option<usize> {
        let run = self.runs.at(start57(l, code));
        (self.runs.end(run) >= start57(l, code + 1)).then(|| self.runs.owners[run])
    }

    /// Whether brick `key` of level `l` is a top brick.
    fn is_fully_replicated(&self, l: Level, key: u64) -> bool {
        l < 2 || l <= self.level_fully_replicated && self.runs.of_brick(l, key).len() >= OWNERS_MANY
    }

    /// Whose brick `key` of level `l` is.
    #[inline]
    pub fn placement(&self, l: Level, key: u64) -> Placement {
        if l < 2 {
            return Placement::FullyReplicated;
        }
        if self.ranks == 1 || self.is_within(l, key) {
            return Placement::Local;
        }
        if l > self.level_replicated {
            return self.placement_of(self.owner(l, key));
        }
        self.placement_among(l, self.owners_of(l, key))
    }

    /// Whether brick `key` of level `l`, which is 2 or more, lies in this rank's longest stretch, all of it.
    #[inline]
    fn is_within(&self, l: Level, key: u64) -> bool {
        self.own.start <= brick_start(l, key) && brick_start(l, key + 1) <= self.own.end
    }

    /// The owners, run by run, of what a brick fills; of many, some.
    #[inline]
    fn owners_of(&self, l: Level, key: u64) -> &[usize] {
        &self.runs.owners[self.runs.of_brick(l, key)]
    }

    #[inline]
    fn placement_among(&self, l: Level, owners: &[usize]) -> Placement {
        match owners.len() {
            _ if l < 2 => Placement::FullyReplicated,
            1 => self.placement_of(owners[0]),
            OWNERS_MANY.. => Placement::FullyReplicated,
            _ if owners.contains(&self.rank) => Placement::PartiallyReplicated,
            _ => Placement::Remote(owners[0]),
        }
    }

    fn placement_of(&self, owner: usize) -> Placement {
        if owner == self.rank { Placement::Local } else { Placement::Remote(owner) }
    }

    /// The rank that answers for brick `key` of level `l`.
    #[inline]
    pub fn owner(&self, l: Level, key: u64) -> usize {
        self.owner_at(brick_start(l, key))
    }

    /// Whether this rank counts and emits the leaves of a brick that it holds.
    #[inline]
    pub fn owns(&self, l: Level, key: u64) -> bool {
        // Deeper than a child of a shared brick, whatever a rank holds is its own.
        self.ranks == 1
            || l > self.level_replicated + 1
            || self.own.contains(&brick_start(l, key))
            || self.owner(l, key) == self.rank
    }

    /// Whether any brick of level `l` is held by several ranks.
    pub fn is_replicated(&self, l: Level) -> bool {
        self.ranks > 1 && l <= self.level_replicated
    }
}

/// Bits of a brick's key; above them is room for the number of the set that it belongs to.
pub const KEY_BITS: u32 = 54;

impl Runs {
    /// The run that a position lies in.
    #[inline]
    fn at(&self, start: u64) -> usize {
        self.starts.partition_point(|&s| s <= start) - 1
    }

    /// Where a run ends.
    #[inline]
    fn end(&self, run: usize) -> u64 {
        self.starts.get(run + 1).copied().unwrap_or(1 << (3 * LEVEL_MAX))
    }

    /// The stretches that a rank owns, in order.
    fn of(&self, rank: usize) -> impl Iterator<Item = Range<u64>> + '_ {
        let owners = self.owners.iter().enumerate();
        owners.filter(move |o| *o.1 == rank).map(|(run, _)| self.span(run))
    }

    /// From where to where a run goes.
    fn span(&self, run: usize) -> Range<u64> {
        self.starts[run]..self.end(run)
    }

    /// The runs that a brick has part of; of many, some.
    #[inline]
    fn of_brick(&self, l: Level, key: u64) -> Range<usize> {
        let first = self.at(brick_start(l, key));
        let end = if l < 2 { 1 << (3 * LEVEL_MAX) } else { brick_start(l, key + 1) };
        let more =
            self.starts[first + 1..].iter().take(OWNERS_MANY).take_while(|&&s| s < end).count();
        first..first + 1 + more
    }

    /// The deepest level with a brick that has part of `n` runs or more, `n` being two at least; 1 if there is
    /// none, as the bricks of levels 0 and 1 are everybody's.
    fn deepest_brick_of(&self, n: usize) -> Level {
        let spanned = self.starts[1..].windows(n - 1).map(|inner| {
            // The octant that holds the end of the first run and the start of the last.
            let differ = (inner[0] - 1) ^ inner[n - 2];
            let up = (64 - differ.leading_zeros()).div_ceil(3);
            LEVEL_MAX - up + 2
        });
        spanned.max().unwrap_or(1)
    }
}

/// Level-19 Morton code of a brick's minimum corner.
#[inline]
pub fn brick_start(l: Level, key: u64) -> u64 {
    if l < 2 { 0 } else { key << (3 * (LEVEL_MAX + 2 - l)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comm::{Comm, sim};
    use proptest::prelude::*;
    use std::collections::{BTreeMap, BTreeSet};

    /// Level of the octants that are dealt out here; bricks are looked at down to one level below those that fill them.
    pub const FINE: Level = 3;
    pub const RANKS: usize = 12;

    /// Owners of all octants of level [`FINE`]: runs as a curve cut in shares has them, or as METIS leaves them.
    pub fn owners() -> impl Strategy<Value = Vec<usize>> {
        let octants = 1usize << (3 * FINE);
        let ascending = prop::collection::vec(0..octants, RANKS - 1).prop_map(move |mut cuts| {
            cuts.sort_unstable();
            (0..octants).map(|o| cuts.partition_point(|&c| c <= o)).collect()
        });
        let any = prop::collection::vec((0..RANKS, 1usize..90), octants).prop_map(move |runs| {
            let all = runs.into_iter().flat_map(|(owner, n)| std::iter::repeat_n(owner, n));
            all.take(octants).collect()
        });
        prop_oneof![ascending, any]
    }

    pub fn ownership(rank: usize, owners: &[usize]) -> Ownership {
        let leaf = |(code, &owner)| BaseLeaf { level: FINE, code, owner };
        let leaves: Vec<BaseLeaf> = (0..).zip(owners).map(leaf).collect();
        Ownership::new(rank, RANKS, &leaves)
    }

    /// All bricks down to one level below the finest that could be shared, and the runs of owners in each.
    fn bricks(owners: &[usize]) -> Vec<(Level, u64, Vec<usize>)> {
        let runs = |first: usize, n: usize| {
            let mut runs = owners[first..first + n].to_vec();
            runs.dedup();
            runs
        };
        let of_level = |l: Level| {
            let up = (FINE + 2).saturating_sub(l.max(2));
            let n = 1usize << (3 * up);
            (0..owners.len() / n).map(move |key| (l, key as u64, runs(key * n, n)))
        };
        (0..=FINE + 2).flat_map(of_level).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]

        #[test]
        fn bricks_are_held_by_those_who_own_part_of_them(owners in owners()) {
            let shares: Vec<Ownership> = (0..RANKS).map(|r| ownership(r, &owners)).collect();
            let (mut shared, mut top) = (1, 1);
            for (l, key, runs) in bricks(&owners) {
                let many = l < 2 || runs.len() >= OWNERS_MANY;
                if l >= 2 && runs.len() > 1 { shared = shared.max(l); }
                if many { top = top.max(l); }
                for (rank, ownership) in shares.iter().enumerate() {
                    let want = match () {
                        () if many => Placement::FullyReplicated,
                        () if runs == [rank] => Placement::Local,
                        () if runs.contains(&rank) => Placement::PartiallyReplicated,
                        () => Placement::Remote(runs[0]),
                    };
                    prop_assert_eq!(ownership.placement(l, key), want, "level {} key {}", l, key);
                    prop_assert_eq!(ownership.owner(l, key), runs[0]);
                    prop_assert_eq!(ownership.is_fully_replicated(l, key), many);
                    let holds = !matches!(want, Placement::Remote(_));
                    prop_assert!(!holds || ownership.owns(l, key) == (runs[0] == rank));
                }
                let place = shares[0].non_owning_view().placement(l, key);
                prop_assert_eq!(place, if many { Placement::FullyReplicated } else { Placement::Remote(runs[0]) });
            }
            prop_assert_eq!((shares[0].level_replicated, shares[0].level_fully_replicated), (shared, top));
        }

        #[test]
        fn octants_tile_what_a_rank_owns(owners in owners()) {
            for rank in 0..RANKS {
                let ownership = ownership(rank, &owners);
                let octants = ownership.octants();
                let fine: Vec<u64> = octants
                    .iter()
                    .flat_map(|&(l, code)| code << (3 * (FINE - l))..(code + 1) << (3 * (FINE - l)))
                    .collect();
                let mine = (0..owners.len() as u64).filter(|&o| owners[o as usize] == rank);
                prop_assert!(fine.into_iter().eq(mine));
                // None is one of eight that could be one.
                for w in octants.chunk_by(|a, b| a.0 == b.0 && a.1 >> 3 == b.1 >> 3) {
                    prop_assert!(w.len() < 8);
                }
            }
        }

        #[test]
        fn what_is_scattered_reaches_all_holders(
            owners in owners(),
            few in prop::collection::vec((0..RANKS, 0usize..2, 0..FINE + 3, any::<u64>(), 1u64..8), 0..80),
            // Two ranks have more than a few bricks for some others.
            many in prop::collection::vec((0usize..2, 0usize..2, Just(FINE + 2), any::<u64>(), 1u64..8), 0..800),
        ) {
            let told = [few, many].concat();
            let all = bricks(&owners);
            let mut keys = [0; FINE as usize + 3];
            all.iter().for_each(|b| keys[b.0 as usize] += 1);
            let key = |l: Level, draw: u64| draw % keys[l as usize];
            let mut sums: BTreeMap<(usize, Level, u64), u64> = BTreeMap::new();
            for &(_, set, l, draw, bits) in &told {
                *sums.entry((set, l, key(l, draw))).or_default() |= bits;
            }
            let got = sim::run(RANKS, 7, |comm| {
                let mut sets = [crate::tree::per_level(), crate::tree::per_level()];
                let mut mine: Vec<_> = told.iter().filter(|t| t.0 == comm.rank()).collect();
                mine.sort_by_key(|t| key(t.2, t.3));
                for &&(_, set, l, draw, bits) in &mine {
                    sets[set][l as usize].push(key(l, draw), bits);
                }
                let [a, b] = &mut sets;
                ownership(comm.rank(), &owners).synchronise_replicas(&mut [a, b], comm);
                sets
            });
            for (rank, sets) in got.iter().enumerate() {
                let ownership = ownership(rank, &owners);
                for (number, set) in sets.iter().enumerate() {
                    for &(l, brick, _) in &all {
                        let sum = sums.get(&(number, l, brick)).copied().unwrap_or(0);
                        let holds = !matches!(ownership.placement(l, brick), Placement::Remote(_));
                        prop_assert_eq!(set[l as usize].get(brick), if holds { sum } else { 0 });
                    }
                }
            }
        }
    }

    #[test]
    fn a_brick_of_many_owners_is_everybodys() {
        // Nine octants beside each other with an owner each, then all others one rank's.
        let owners: Vec<usize> = (0..1 << (3 * FINE)).map(|o: usize| o.min(9)).collect();
        let ownership = ownership(11, &owners);
        assert_eq!(ownership.placement(FINE + 1, 0), Placement::Remote(0));
        assert_eq!(ownership.placement(FINE, 0), Placement::FullyReplicated);
        let places: BTreeSet<String> =
            (1..64).map(|key| format!("{:?}", ownership.placement(FINE + 1, key))).collect();
        assert_eq!(places.into_iter().collect::<Vec<_>>(), ["Remote(8)", "Remote(9)"]);
    }
}
