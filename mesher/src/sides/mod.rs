//! Sides: which leaves of the base tree are inside the geometry (the paper's section II.B: flood fill
//! and rays), and which of them are kept.
//!
//! Non-crossing leaves that share part of a face belong to one component, and a component has one side.
//! Within a block of eight bricks, local components are flood fills by shifts ([`nodes`]). Across blocks a union-find merges them
//! in a walk of the tree ([`components`]). Across ranks they receive common labels, by messages about
//! the faces between ranks ([`global`]). Each component is then put to a vote of rays ([`rays`])
//! or, if the case has seeds, decided by them ([`verdict`], which also finds the outside components that the far field
//! does not reach). What is closed at a coarser spacing only is found last ([`leaks`]).
//!
//! Invariants of [`Sides`]:
//! - `stored` holds non-crossing leaves of the base tree: the inside ones if everything is kept, and otherwise
//!   those that are deleted, as the following phases need;
//! - leaves that share part of a face are on the same side, and all kept or all deleted.

pub mod components;
pub mod global;
pub mod leaks;
pub mod masks;
pub mod nodes;
pub mod openness;
pub mod rays;
pub mod verdict;

use crate::error::Error;
use crate::input::lattice::{Keep, Rules};
use crate::partition::ownership::Ownership;
use crate::record::Options;
use bricks::brick::Brick;
use bricks::brickset::BrickSet;
use bricks::facet::Facet;
use bricks::octant::Level;
use bricks::tree::{LEVELS, PerLevel, Tree, check_octants};
use global::Label;
use masks::Component;
use nodes::Nodes;
use ranks::Comm;
use serde::Serialize;
use std::collections::HashSet;
use std::mem::take;
use verdict::{FirstLeaf, FirstLeaves};

/// The base tree as one rank holds it, and what its sides depend on.
pub struct Base<'a> {
    /// The bricks that the rank holds.
    pub tree: &'a Tree,
    /// The ranks that own and hold them.
    pub ownership: &'a Ownership,
    /// This rank's slice of the geometry: each facet is on exactly one rank.
    pub facets: &'a [Facet],
    /// The rules on the lattice.
    pub rules: &'a Rules,
    /// All ranks.
    pub comm: &'a dyn Comm,
}

/// Sides of the base tree's leaves.
pub struct Sides {
    /// The side that is kept. Everything is kept if the mesh is the base tree.
    pub keep: Keep,
    /// Non-crossing leaves: those that are inside if everything is kept, and otherwise those that are deleted.
    pub stored: PerLevel,
    /// The components, in numbers.
    pub summary: Summary,
    /// Rays cast, over all ranks.
    pub rays: u64,
    /// Bytes that the base tree and its components took on this rank while sides were decided.
    pub bytes: usize,
}

/// The components of the base tree, in numbers. The same on all ranks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// Number of outside components, enclosed ones included.
    pub outside: u64,
    /// Number of inside components.
    pub inside: u64,
    /// Outside components that are deleted because the far field does not reach them.
    pub enclosed: EnclosedComponents,
    /// Components that were decided by majority.
    #[serde(skip)]
    pub ambiguous: Ambiguous,
    /// Whether the inside reaches the root's boundary; false where seeds decide it and all is kept.
    #[serde(skip)]
    pub inside_reaches_boundary: bool,
    /// Whether the outside is kept and seeds decide it, and none of it reaches the root's boundary.
    #[serde(skip)]
    pub flow_misses_boundary: bool,
}

/// Outside components that are deleted because the far field does not reach them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct EnclosedComponents {
    /// Number of such components.
    pub count: u64,
    /// Number of their leaves in the base tree.
    pub leaves: u64,
    /// Centroid of the first leaf of all of them, by level and Morton code; none if there are none.
    pub example: Option<[f64; 3]>,
}

/// Components whose rays did not agree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Ambiguous {
    /// Number of such components.
    pub count: u64,
    /// Centroid of the first candidate leaf of all of them, by level and Morton code; none if there are none.
    pub example: Option<[f64; 3]>,
}

/// The sides of all components of the tree. The same on all ranks.
#[derive(Default)]
pub struct Verdict {
    /// The components that are inside.
    pub inside: HashSet<Label>,
    /// Outside components that are deleted, as the far field does not reach them.
    pub enclosed: HashSet<Label>,
    /// The components in numbers.
    pub summary: Summary,
    /// Number of rays cast.
    pub rays: u64,
}

/// The components of a tree.
struct Components {
    nodes: Nodes,
    /// The merged component of each local one.
    merged: Vec<u32>,
    /// Labels of the merged components.
    labels: Vec<Label>,
    /// The first leaves of each component that this rank owns.
    candidates: FirstLeaves,
    /// All components of the tree: the same on all ranks.
    all: Vec<FirstLeaf>,
    /// Local components with a face on the root's boundary; some more than once.
    at_boundary: Vec<Component>,
}

impl Components {
    /// Finds the components of a tree's leaves that do not cross. Collective.
    fn new(base: &Base) -> Self {
        let (nodes, sets) = Nodes::new(base.tree, base.ownership);
        let local = components::merge(&nodes, sets, base.ownership);
        let (merged, at_boundary) = (local.merged.numbered(), local.at_boundary);
        let labels = global::labels(base, &nodes, local.faces, &merged);
        let candidates = verdict::candidates(base, &nodes, &merged, &labels);
        let all = verdict::all_components(&candidates, base.comm);
        Self { nodes, merged, labels, candidates, all, at_boundary }
    }

    /// Bytes that they take with their tree, and with the class of each local component.
    fn bytes(&self, tree: &Tree) -> usize {
        let sets = [&tree.split, &tree.crossing].into_iter().flatten();
        let of_local = size_of::<u32>() + size_of::<Class>();
        sets.map(BrickSet::bytes).sum::<usize>() + self.nodes.bytes() + of_local * self.merged.len()
    }

    /// The label of a local component.
    fn label(&self, c: Component) -> Label {
        self.labels[self.merged[c as usize] as usize]
    }
}

/// The result of the phase for a component, in the order in which octants are stored by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    Outside,
    Inside,
    /// Outside and deleted.
    Enclosed,
}

/// What the phase decides, and on which grounds.
pub struct Decided {
    /// The sides of the leaves.
    pub sides: Sides,
    /// Where to look for leaks.
    pub regions: Vec<leaks::Region>,
    /// All components of the tree: the same on all ranks.
    pub components: Vec<FirstLeaf>,
    /// Their sides.
    pub verdict: Verdict,
}

/// Decides the sides of all leaves. Nothing is deleted if the options ask for T0. There are no regions to look for leaks in if the surface
/// `is_closed`. Collective.
///
/// # Errors
/// If a seed is outside the root or in a crossing leaf; the same on all ranks.
pub fn decide(base: &Base, options: &Options, is_closed: bool) -> Result<Decided, Error> {
    let rules = base.rules;
    let mut components = Components::new(base);
    if options.checks() {
        components.nodes.check_invariants();
    }
    let mut verdict = if rules.seeds.is_empty() {
        verdict::by_vote(&components.all, &components.candidates, base)
    } else {
        let flow = verdict::flow_of_seeds(&verdict::find_seeds(base, &components), base)?;
        verdict::by_seeds(&components.all, flow, rules.keep)
    };
    let bytes = components.bytes(base.tree);
    components.nodes.drop_links();
    verdict.compare_with_boundary(base, &components);
    let class = |label| match () {
        () if verdict.inside.contains(label) => Class::Inside,
        () if verdict.enclosed.contains(label) => Class::Enclosed,
        () => Class::Outside,
    };
    let Components { nodes, merged, labels, all, .. } = components;
    let classes: Vec<Class> = labels.iter().map(class).collect();
    let of_local: Vec<Class> = merged.iter().map(|&c| classes[c as usize]).collect();
    drop(merged);
    let keep = if options.ungraded { Keep::All } else { rules.keep };
    let (stored, summary, rays) = (PerLevel::default(), verdict.summary, verdict.rays);
    let mut sides = Sides { keep, stored, summary, rays, bytes };
    let mut regions = if is_closed { Vec::new() } else { leaks::Region::of(rules) };
    let leaves_enclosed = sides.store(base, nodes, &of_local, &mut regions);
    let inside = verdict.inside.len() as u64;
    (sides.summary.inside, sides.summary.outside) = (inside, all.len() as u64 - inside);
    sides.summary.enclosed = verdict.enclosed_components(&all, leaves_enclosed, base);
    Ok(Decided { sides, regions, components: all, verdict })
}

impl Sides {
    /// Stores the leaves of all bricks by the classes of their local components. Returns the number of enclosed
    /// leaves that this rank owns. Fills the regions in which leaks are looked for.
    fn store(
        &mut self,
        base: &Base,
        mut nodes: Nodes,
        of_local: &[Class],
        regions: &mut [leaks::Region],
    ) -> u64 {
        let (mut leaves_enclosed, mut masks) = (0, take(&mut nodes.masks));
        let (mut of_block, mut components) = ([[0; 8]; 3], [0; 2]);
        for l in 0..LEVELS as Level {
            let mut crossing = base.tree.crossing[l as usize].cursor();
            nodes.bricks(base.tree, l).for_each(|(Brick { key, .. }, part)| {
                if components != part.components {
                    components = part.components;
                    of_block = [[0; 8]; 3];
                    masks.block(part, |c, octants| {
                        let all = &mut of_block[of_local[c as usize] as usize];
                        (0..8).for_each(|j| all[j] |= octants[j]);
                    });
                    masks.free_before(part);
                }
                let [outside, within, enclosed] =
                    of_block.each_ref().map(|of| of[key as usize & 7]);
                let open = outside | within | enclosed;
                let stored = match self.keep {
                    Keep::All => within,
                    Keep::Outside => within | enclosed,
                    Keep::Inside => open & !within,
                };
                self.stored[l as usize].push(key, stored);
                for region in &mut *regions {
                    region.push(l, key, crossing.get(key), open, within);
                }
                if enclosed != 0 && base.ownership.owns(l, key) {
                    leaves_enclosed += u64::from(enclosed.count_ones());
                }
            });
        }
        leaves_enclosed
    }

    /// The deleted leaves: none if everything is kept.
    pub fn deleted(&self) -> &PerLevel {
        static NONE: PerLevel = [const { BrickSet::EMPTY }; LEVELS];
        if self.keep == Keep::All { &NONE } else { &self.stored }
    }

    /// Checks the first invariant on the bricks that this rank holds;
    /// [`check::sides`](fn@crate::check::sides) executes the last.
    ///
    /// # Panics
    /// If an invariant is violated; the message names it, the level and an octant.
    pub fn check_invariants(&self, tree: &Tree) {
        let Tree { split, crossing } = tree;
        let violation = "has a side, but is no leaf off the surface";
        check_octants(split, &self.stored, &[split, crossing], violation);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check;
    use crate::partition::ownership::Placement;
    use crate::tests::{rules, set, small};
    use bricks::brick::ones;
    use bricks::digest::mix;
    use bricks::octant::neighbour;
    use proptest::prelude::*;
    use ranks::{Solo, sim};
    use std::collections::{BTreeMap, BTreeSet};
    use verdict::{CANDIDATES, Candidate};

    /// Sides of a tree without facets: all leaves that do not cross are outside.
    fn decided(keep: Keep) -> (Tree, Sides) {
        let tree = small();
        let rules = Rules { keep, ..rules() };
        let options = crate::tests::options();
        let (ownership, rules) = (&Ownership::solo(), &rules);
        let base = Base { tree: &tree, ownership, facets: &[], rules, comm: &Solo };
        let sides = decide(&base, &options, true).unwrap().sides;
        sides.check_invariants(&tree);
        (tree, sides)
    }

    #[test]
    #[should_panic(expected = "octant 000 of level 3 has a side, but is no leaf off the surface")]
    fn a_side_of_a_crossing_leaf_is_found() {
        let (tree, mut sides) = decided(Keep::Outside);
        sides.stored[3] = set(&[0]);
        sides.check_invariants(&tree);
    }

    #[test]
    #[should_panic(expected = "level 1 is on another side than a leaf across a face")]
    fn a_component_with_two_sides_is_found() {
        let (tree, mut sides) = decided(Keep::All);
        sides.stored[1] = set(&[1]);
        let (ownership, rules) = (&Ownership::solo(), &rules());
        let base = Base { tree: &tree, ownership, facets: &[], rules, comm: &Solo };
        check::sides::agree_over_faces(&sides, &base);
    }

    /// Deepest level of drawn trees.
    const DEEPEST: Level = 5;

    /// A tree with the given octants and their siblings at its deepest level. `crossing` percent of its leaves cross; which ones depends on those
    /// bits of their codes that are in `of`.
    fn drawn(octants: &BTreeSet<u64>, crossing: u64, of: u64) -> Tree {
        let mut tree = Tree::default();
        for l in 0..=DEEPEST {
            let up = octants.iter().map(|code| code >> (3 * (DEEPEST - l)));
            let split = if l < DEEPEST { up.collect() } else { BTreeSet::new() };
            let exists = Tree::exists(&tree.split, l);
            let codes =
                exists.flat_map(|b| ones(b.bits).map(move |bit| b.key << 6 | u64::from(bit)));
            let crosses = |code: &u64| mix((code & of) << 5 | u64::from(l)) as u64 % 100 < crossing;
            let leaves = codes.filter(|code| !split.contains(code) && crosses(code));
            tree.crossing[l as usize] = set(&leaves.collect::<BTreeSet<_>>());
            tree.split[l as usize] = set(&split);
        }
        tree.check_structure();
        tree
    }

    /// The first leaves of each component, and whether one of its leaves has a face on the root's boundary.
    type Firsts = BTreeSet<(Vec<Candidate>, bool)>;

    /// As the ranks find them together. `owners` gives who owns the curve from each of these places on.
    fn on_ranks(tree: &Tree, ranks: usize, owners: &BTreeMap<u64, usize>) -> Firsts {
        let results = sim::run(ranks, 1, |comm| {
            let owners = owners.iter().map(|(&start, &owner)| (start, owner % ranks));
            let ownership = &Ownership::along(comm.rank(), ranks, owners.collect());
            let mut tree = tree.clone();
            for sets in [&mut tree.split, &mut tree.crossing] {
                for (l, set) in (0..).zip(sets) {
                    let is_held =
                        |key| !matches!(ownership.placement(l, key), Placement::Remote(_));
                    set.retain(|b| if is_held(b.key) { b.bits } else { 0 });
                }
            }
            let (rules, tree) = (&rules(), &tree);
            let components = Components::new(&Base { tree, ownership, facets: &[], rules, comm });
            components.nodes.check_invariants();
            let label = |&c: &Component| components.label(c);
            let at_boundary: Vec<Label> = components.at_boundary.iter().map(label).collect();
            (components.candidates, at_boundary)
        });
        let at_boundary: BTreeSet<Label> = results.iter().flat_map(|r| r.1.clone()).collect();
        let mut firsts: BTreeMap<Label, Vec<Candidate>> = BTreeMap::new();
        for (label, list) in results.into_iter().flat_map(|r| r.0) {
            firsts.entry(label).or_default().extend(list);
        }
        firsts
            .into_iter()
            .map(|(label, list)| (first(list), at_boundary.contains(&label)))
            .collect()
    }

    fn first(mut list: Vec<Candidate>) -> Vec<Candidate> {
        list.sort_unstable();
        list.truncate(CANDIDATES);
        list
    }

    /// As a search from leaf to leaf finds them.
    fn leaf_by_leaf(tree: &Tree) -> Firsts {
        let mut open = BTreeSet::new();
        for l in 0..=DEEPEST {
            for Brick { key, bits } in Tree::exists(&tree.split, l) {
                let [split, crossing] =
                    [&tree.split, &tree.crossing].map(|s| s[l as usize].get(key));
                open.extend(
                    ones(bits & !split & !crossing).map(|bit| (l, key << 6 | u64::from(bit))),
                );
            }
        }
        // A leaf's neighbour of its own size, or the coarser leaf there. A finer one finds this leaf.
        let beside = |(l, code): (Level, u64), side: usize| {
            let next = neighbour(l, code, side / 2, side % 2 == 1)?;
            (0..=l).map(|up| (l - up, next >> (3 * up))).find(|leaf| open.contains(leaf))
        };
        let mut neighbours: BTreeMap<(Level, u64), Vec<(Level, u64)>> = BTreeMap::new();
        for (&leaf, side) in open.iter().flat_map(|leaf| (0..6).map(move |side| (leaf, side))) {
            if let Some(other) = beside(leaf, side) {
                neighbours.entry(leaf).or_default().push(other);
                neighbours.entry(other).or_default().push(leaf);
            }
        }
        let mut rest = open.clone();
        let mut firsts = Firsts::new();
        while let Some(seed) = rest.pop_first() {
            let (mut component, mut queue) = (Vec::new(), vec![seed]);
            while let Some(leaf) = queue.pop() {
                component.push(leaf);
                let others = neighbours.get(&leaf).into_iter().flatten();
                queue.extend(others.filter(|other| rest.remove(*other)));
            }
            let is_outer = |&(l, code): &(Level, u64)| {
                (0..6).any(|side| neighbour(l, code, side / 2, side % 2 == 1).is_none())
            };
            let is_at_boundary = component.iter().any(is_outer);
            let leaves = component.into_iter().map(|(l, code)| Candidate::new(l, code));
            firsts.insert((first(leaves.collect()), is_at_boundary));
        }
        firsts
    }

    proptest! {
        /// On any tree and for any ownership: boundaries between ranks may cut through leaves.
        #[test]
        fn components_are_those_found_from_leaf_to_leaf(
            runs in prop::collection::vec((0u64..1 << (3 * DEEPEST), 1u64..300), 1..12),
            crossing in prop::sample::select(vec![0u64, 20, 50, 65, 75, 90]),
            // All bits, or those of the octant within its brick or its group of siblings: these make neighbours alike.
            of in prop::sample::select(vec![u64::MAX, 0o77, 0o7]),
            ranks in prop::sample::select(vec![1usize, 2, 3, 5, 9]),
            owners in prop::collection::btree_map((any::<u64>(), prop::sample::select(vec![0u32, 30, 42, 45, 48])), any::<usize>(), 1..30),
        ) {
            let octants = runs.iter().flat_map(|&(start, count)| start..(start + count).min(1 << (3 * DEEPEST)));
            let tree = drawn(&octants.collect(), crossing, of);
            let aligned = |((start, bits), owner): ((u64, u32), usize)| ((start >> 7) >> bits << bits, owner);
            let owners = owners.into_iter().map(aligned).collect();
            prop_assert_eq!(on_ranks(&tree, ranks, &owners), leaf_by_leaf(&tree));
        }
    }
}
