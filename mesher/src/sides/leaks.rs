//! Leaks between spacings: regions that are closed at a coarser spacing and open at that of the mesh.
//!
//! T0/k is T0 cut k levels above the surface level. Its octants are crossed if one of their children in T0 is, so a leaf of T0/k that
//! is not crossed lies in one component of T0, and a component of T0/k does, too. One that is inside by its rays although it lies in an outside
//! component of T0 has leaked; if the inside is kept, also one that is outside and lies in an inside component. Where there are seeds,
//! it has leaked if it has none, although it lies in the flow of T0. Only one side of T0 matters for each of these, so the other one is a
//! wall, like crossing leaves.
//!
//! Invariants of [`Leaks`]:
//! - the coarser level is one or two levels above the surface level; leaks are in the order of k, then of their first leaves;
//! - a leak's volume is a whole number of octants of its level, and at least that of its first leaf, which is not deeper than that
//!   level and lies in the root;
//! - the leaks of one k do not overlap: together they are no larger than the root.

use super::global::Label;
use super::verdict::{self, Candidate};
use super::{Base, Components};
use crate::input::lattice::{Keep, Rules};
use bricks::brick::Brick;
use bricks::octant::{LEVEL_MAX, Level, start57};
use bricks::tree::{LEVELS, PerLevel, Tree};
use ranks::{all_gather_reduced, uncounted};
use serde::Serialize;
use std::collections::HashSet;
use std::mem::take;

/// Number of coarser spacings that are compared with that of the mesh.
const COARSER: Level = 2;

/// Most crossing leaves of the surface level with which T0/1 is always searched. It takes as long as a quarter of the sides, so in larger
/// meshes it is searched only where T0/2 has leaked, nothing is inside T0, or the user asks for leaks.
const MOST_FOR_T0_1: u64 = 1 << 24;

/// A region that has leaked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Leak {
    /// The spacing at which the region is closed.
    pub spacing_coarse: f64,
    /// The spacing of the mesh.
    pub spacing_fine: f64,
    /// The region's volume at the coarser spacing.
    pub volume: f64,
    /// A point in it.
    pub point: [f64; 3],
    /// The level of the coarser spacing.
    #[serde(skip)]
    pub level: Level,
    /// The volume in octants of level 19.
    #[serde(skip)]
    pub octants: u64,
    /// The region's first leaf at the coarser spacing, by level and Morton code.
    #[serde(skip)]
    pub first: Candidate,
    /// Whether the region is inside at the spacing of the mesh.
    #[serde(skip)]
    pub is_inside: bool,
}

/// All leaks, and whether they are known: whether one was found, or everything was searched. The same on all ranks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Leaks(pub Vec<Leak>, pub bool);

/// One side of T0, cut at the level above the surface level, so that no octants deeper than the cut are stored.
pub struct Region {
    is_inside: bool,
    cut: Level,
    /// Leaves that a facet crosses or that lie on the other side, by level; of those deeper than the cut, the ancestors at the cut.
    walls: PerLevel,
}

impl Region {
    /// The regions in which leaks are looked for.
    pub fn of(rules: &Rules) -> Vec<Self> {
        let sides: &[bool] = match rules.keep {
            _ if rules.level_surface == 0 => &[],
            Keep::Inside if rules.seeds.is_empty() => &[false, true],
            Keep::Inside => &[true],
            Keep::Outside | Keep::All => &[false],
        };
        let cut = rules.level_surface.saturating_sub(1);
        let region = |&is_inside: &bool| Self { is_inside, cut, walls: PerLevel::default() };
        sides.iter().map(region).collect()
    }

    /// Adds the leaves of a brick of level `l`: those that cross, those that do not, and which of these are inside.
    #[inline]
    pub fn push(&mut self, l: Level, key: u64, crossing: u64, open: u64, inside: u64) {
        let bits = crossing | if self.is_inside { open & !inside } else { inside };
        let walls = (self.cut..l).fold(Brick { key, bits }, |walls, _| walls.parents());
        self.walls[l as usize].push(walls.key, walls.bits);
    }

    /// T0 cut at a level at or above that of the walls. Collective.
    fn tree(&self, base: &Base, level: Level) -> Tree {
        let cut = level as usize;
        let mut walls = self.walls.clone();
        for l in (cut + 1..LEVELS).rev() {
            let finer = take(&mut walls[l]);
            let finer = if l > self.cut as usize { finer } else { finer.coarsen() };
            walls[l - 1] = take(&mut walls[l - 1]).union(finer);
        }
        // A rank knows the walls in its own part of a brick that others have part of, too.
        base.ownership.synchronise_replicas(&mut [&mut walls], base.comm);
        let mut tree = Tree { crossing: walls, ..Tree::default() };
        tree.split[..cut].clone_from_slice(&base.tree.split[..cut]);
        tree
    }
}

/// The leaks in all regions of T0; whether T0/1 `may_be_skipped`. Messages are not counted: the mesh does not depend on them. Collective;
/// the same on all ranks.
pub fn find(base: &Base, regions: Vec<Region>, may_be_skipped: bool) -> Leaks {
    let (rules, mut leaks) = (base.rules, Vec::new());
    let are_known = uncounted(base.comm, || {
        let skips = may_be_skipped && !regions.is_empty() && crossing_leaves(base) > MOST_FOR_T0_1;
        for k in (1..=COARSER.min(rules.level_surface)).rev() {
            for region in &regions {
                if k > 1 || !skips || !leaks.is_empty() {
                    let level = rules.level_surface - k;
                    let coarse = region.tree(base, level);
                    let coarse = Base { tree: &coarse, ..*base };
                    leaks.extend(of_tree(&coarse, level, region.is_inside));
                }
            }
        }
        !skips || !leaks.is_empty()
    });
    leaks.sort_unstable_by_key(|leak| (u32::MAX - leak.level, leak.first));
    let leaks = Leaks(leaks, are_known);
    leaks.check_invariants(rules);
    leaks
}

/// Number of crossing leaves of the surface level. Collective; the same on all ranks.
fn crossing_leaves(base: &Base) -> u64 {
    let level = base.rules.level_surface;
    let owned = base.ownership.owned(level, &base.tree.crossing[level as usize]);
    base.comm.sum(owned.map(|b| u64::from(b.bits.count_ones())).sum())
}

/// The components of T0/k, cut at `level`, that have leaked into the region that `is_inside` or not.
fn of_tree(base: &Base, level: Level, is_inside: bool) -> Vec<Leak> {
    let components = Components::new(base);
    let found = verdict::find_seeds(base, &components);
    let seeded: HashSet<Label> = found.values().copied().collect();
    // The component of a seed in a crossing leaf is not known, so rays have to agree that a region is closed.
    let verdict = if found.is_empty() || found.len() < base.rules.seeds.len() {
        verdict::by_vote(&components.all, &components.candidates, base)
    } else {
        verdict::by_seeds(&components.all, seeded.clone(), base.rules.keep)
    };
    let has_leaked = |c: &Label| verdict.inside.contains(c) != is_inside && !seeded.contains(c);
    let leaked: Vec<_> = components.all.iter().filter(|(label, _)| has_leaked(label)).collect();
    if leaked.is_empty() {
        return Vec::new();
    }
    let volumes = components.volumes(base);
    let volume = |label| volumes[volumes.partition_point(|v| v[0] < label)][1];
    let root = base.rules.root;
    let leak = |&&(label, first): &&(Label, Candidate)| Leak {
        spacing_coarse: root.edge_of(level),
        spacing_fine: root.edge_of(base.rules.level_surface),
        volume: volume(label) as f64 * root.edge_of(LEVEL_MAX).powi(3),
        point: root.locate(first.centroid()),
        level,
        octants: volume(label),
        first,
        is_inside,
    };
    leaked.iter().map(leak).collect()
}

impl Components {
    /// Each component's label and volume, in octants of level 19. Collective; the same on all ranks.
    fn volumes(&self, base: &Base) -> Vec<[u64; 2]> {
        let mut mine = vec![0; self.labels.len()];
        for l in 0..=LEVEL_MAX {
            let bricks = self.nodes.bricks(base.tree, l);
            for (_, part) in bricks.filter(|b| base.ownership.owns(l, b.0.key)) {
                self.nodes.masks.brick(part, |c, bits| {
                    mine[self.merged[c as usize] as usize] += start57(l, bits.count_ones().into());
                });
            }
        }
        let mine = self.labels.iter().zip(mine).map(|(&label, volume)| [label, volume]).collect();
        all_gather_reduced(mine, |a, b| a + b, base.comm)
    }
}

impl Leaks {
    /// Checks the invariants.
    ///
    /// # Panics
    /// If one is violated; the message names the leak.
    pub fn check_invariants(&self, rules: &Rules) {
        let order = |leak: &Leak| (u32::MAX - leak.level, leak.first);
        let are_sorted = self.0.is_sorted_by(|a, b| order(a) < order(b));
        assert!(are_sorted, "leaks must be in order: {self:?}");
        let volume = |l: Level| start57(l, 1);
        for leak in &self.0 {
            let (level, (first, code)) = (rules.level_surface, leak.first.leaf());
            assert!(
                leak.level < level && leak.level + COARSER >= level && first <= leak.level,
                "a leak of surface level {level} must have one of the {COARSER} levels above: {leak:?}"
            );
            assert!(
                leak.octants >= volume(first) && leak.octants.is_multiple_of(volume(leak.level)),
                "a leak's volume must be that of leaves, its first among them: {leak:?}"
            );
            assert!(code >> (3 * first) == 0, "a leak's first leaf must lie in the root: {leak:?}");
        }
        for level in 0..rules.level_surface {
            let octants = self.0.iter().filter(|of| of.level == level).map(|of| of.octants);
            assert!(octants.sum::<u64>() <= volume(0), "leaks must fit into the root: {self:?}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::rules;

    /// A leak between level 2 and the surface level, 3: two octants of level 2.
    fn leak() -> Leak {
        Leak {
            spacing_coarse: 0.25,
            spacing_fine: 0.125,
            volume: 2.0 / 64.0,
            point: [0.5; 3],
            level: 2,
            octants: 2 << (3 * (LEVEL_MAX - 2)),
            first: Candidate::new(2, 5),
            is_inside: false,
        }
    }

    fn check(leaks: &[Leak]) {
        Leaks(leaks.to_vec(), true).check_invariants(&rules());
    }

    #[test]
    fn leaks_of_both_coarser_levels_are_in_order() {
        check(&[]);
        let finer = Leak { first: Candidate::new(2, 9), ..leak() };
        let coarser = Leak {
            level: 1,
            octants: 1 << (3 * (LEVEL_MAX - 1)),
            first: Candidate::new(1, 1),
            ..leak()
        };
        check(&[leak(), finer, coarser]);
    }

    #[test]
    #[should_panic(expected = "leaks must be in order")]
    fn a_leak_that_is_listed_twice_is_found() {
        check(&[leak(); 2]);
    }

    #[test]
    #[should_panic(expected = "must have one of the 2 levels above")]
    fn a_leak_of_the_surface_level_is_found() {
        check(&[Leak { level: 3, ..leak() }]);
    }

    #[test]
    #[should_panic(expected = "must be that of leaves")]
    fn a_volume_of_a_part_of_an_octant_is_found() {
        check(&[Leak { octants: leak().octants + 1, ..leak() }]);
    }

    #[test]
    #[should_panic(expected = "must be that of leaves")]
    fn a_volume_smaller_than_the_first_leaf_is_found() {
        check(&[Leak { octants: 0, ..leak() }]);
    }

    #[test]
    #[should_panic(expected = "must lie in the root")]
    fn a_point_outside_the_root_is_found() {
        check(&[Leak { first: Candidate::new(2, 64), ..leak() }]);
    }

    #[test]
    #[should_panic(expected = "must fit into the root")]
    fn leaks_larger_than_the_root_are_found() {
        check(&[Leak { octants: 65 << (3 * (LEVEL_MAX - 2)), ..leak() }]);
    }
}
