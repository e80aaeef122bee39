//! What decides the side of a component: a vote of rays, or seeds; and which outside components are enclosed.
//!
//! The vote: six rays from the centroid of a component's leaf decide the component's side if they agree.
//! Otherwise the next leaf is tried, and after 32 leaves the majority of all rays decides.
//!
//! The flow: components with a seed, whatever rays would say, so that a hole in the geometry joins to the flow what lies beyond it;
//! and the far field, every outside component with a face on the root's boundary.
//!
//! The paper floods from one cell that rays find outside, and deletes what the flood does not reach. Here outside components that the
//! far field does not reach are *enclosed*, such as sealed cavities and the overlap of two solids, which is outside by the parity of
//! rays.

use super::global::Label;
use super::nodes::{Nodes, open_bricks};
use super::rays::parities;
use super::{Ambiguous, Base, Components, EnclosedComponents, Verdict};
use crate::error::Error;
use crate::input::lattice::{Enclosed, Keep};
use bricks::brick::Brick;
use bricks::octant::{LEVEL_MAX, Level, ROOT_BITS, ROOT_EDGE, corner, edge, morton};
use bricks::tree::LEVELS;
use bytemuck::allocation::pod_collect_to_vec;
use ranks::{Comm, all_gather_reduced, gather, uncounted};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::mem::take;

/// Maximum number of leaves of a component whose rays are cast before the majority decides.
pub const CANDIDATES: usize = 32;

/// A leaf as one number that sorts by level, then by Morton code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Candidate(pub u64);

impl Candidate {
    /// Leaf `code` of level `l`.
    pub fn new(l: Level, code: u64) -> Self {
        Self(u64::from(l) << 57 | code)
    }

    /// Its level and Morton code.
    pub fn leaf(self) -> (Level, u64) {
        ((self.0 >> 57) as Level, self.0 & ((1 << 57) - 1))
    }

    /// The leaf's centroid, a lattice point.
    pub fn centroid(self) -> [i64; 3] {
        let (l, code) = self.leaf();
        corner(l, code).map(|c| c + edge(l) / 2)
    }
}

/// The first leaves, by level and Morton code, of the components that this rank has part of, among the leaves
/// that it owns: at most [`CANDIDATES`] each. `merged` are the merged components of the local ones, `labels`
/// their labels.
pub fn candidates(base: &Base, nodes: &Nodes, merged: &[u32], labels: &[Label]) -> FirstLeaves {
    let mut first: Vec<Vec<Candidate>> = vec![Vec::new(); labels.len()];
    let mut unfinished = labels.len();
    for l in 0..LEVELS as Level {
        let bricks = nodes.bricks(base.tree, l);
        for (Brick { key, .. }, part) in bricks.filter(|b| base.ownership.owns(l, b.0.key)) {
            if unfinished == 0 {
                break;
            }
            nodes.masks.brick(part, |c, bits| {
                let list = &mut first[merged[c as usize] as usize];
                // Local components of one brick may be parts of one component: then their leaves are interleaved in Morton order.
                let is_of_brick = |last: &Candidate| *last >= Candidate::new(l, key << 6);
                let before = list.len();
                if before < CANDIDATES || list.last().is_some_and(is_of_brick) {
                    list.extend(Brick { key, bits }.codes().map(|code| Candidate::new(l, code)));
                    unfinished -= usize::from(before < CANDIDATES && list.len() >= CANDIDATES);
                }
            });
        }
    }
    first_of_all(labels.iter().copied().zip(first).filter(|(_, list)| !list.is_empty()))
}

/// The first leaves of each component, in order.
pub type FirstLeaves = BTreeMap<Label, Vec<Candidate>>;

/// A component and its first leaf, by level and Morton code.
pub type FirstLeaf = (Label, Candidate);

/// All components of the tree, by label. Collective; the result is the same on all ranks.
pub fn all_components(mine: &FirstLeaves, comm: &dyn Comm) -> Vec<FirstLeaf> {
    let firsts = mine.iter().map(|(&label, list)| [label, list[0].0]).collect();
    let firsts = all_gather_reduced(firsts, u64::min, comm);
    firsts.into_iter().map(|[label, first]| (label, Candidate(first))).collect()
}

/// The first [`CANDIDATES`] leaves for each label from several lists.
fn first_of_all(lists: impl Iterator<Item = (Label, Vec<Candidate>)>) -> FirstLeaves {
    let mut all = FirstLeaves::new();
    lists.for_each(|(label, list)| all.entry(label).or_default().extend(list));
    for list in all.values_mut() {
        list.sort_unstable();
        list.truncate(CANDIDATES);
    }
    all
}

/// Decides all `components`. Nearly always the rays of a component's first leaf agree, so the other candidates are
/// gathered only for those whose rays do not. Each rank tests the rays against its own
/// facets; `mine` are this rank's [`candidates`]. Collective; the result is the same on all ranks.
pub fn by_vote(components: &[FirstLeaf], mine: &FirstLeaves, base: &Base) -> Verdict {
    let mut verdict = Verdict::default();
    let mut lists: FirstLeaves = components.iter().map(|&(label, c)| (label, vec![c])).collect();
    // The components that are not decided yet, with the number of their rays so far that met an odd number of facets; and those that
    // have no more leaves to try.
    let mut open: Vec<(Label, usize)> = components.iter().map(|c| (c.0, 0)).collect();
    let mut exhausted = Vec::new();
    for round in 0..CANDIDATES {
        if round == 1 && !open.is_empty() {
            lists = gather_candidates(mine, &open, base.comm);
        }
        let (next, done): (Vec<_>, Vec<_>) =
            take(&mut open).into_iter().partition(|(label, _)| lists[label].len() > round);
        exhausted.extend(done);
        if next.is_empty() {
            break;
        }
        let points: Vec<_> = next.iter().map(|(label, _)| lists[label][round].centroid()).collect();
        verdict.rays += 6 * points.len() as u64;
        let odd = xor_over_ranks(parities(base.facets, &points), base.comm);
        let undecided = next.into_iter().zip(odd).filter_map(|((label, votes), rays)| {
            if rays == 63 {
                verdict.inside.insert(label);
            }
            let votes = votes + rays.count_ones() as usize;
            (rays != 0 && rays != 63).then_some((label, votes))
        });
        open = undecided.collect();
    }
    exhausted.extend(open);
    let first = exhausted.iter().map(|(label, _)| lists[label][0]).min();
    let example = first.map(|leaf| base.rules.root.locate(leaf.centroid()));
    verdict.summary.ambiguous = Ambiguous { count: exhausted.len() as u64, example };
    let is_inside = |&(label, votes): &(Label, usize)| votes > 3 * lists[&label].len();
    verdict.inside.extend(exhausted.into_iter().filter(is_inside).map(|c| c.0));
    verdict
}

/// The candidates of some components, from all ranks. Collective; the result is the same on all ranks.
fn gather_candidates(mine: &FirstLeaves, open: &[(Label, usize)], comm: &dyn Comm) -> FirstLeaves {
    let lists = open.iter().filter_map(|(label, _)| Some((*label, mine.get(label)?)));
    let pairs = lists.flat_map(|(label, list)| list.iter().map(move |c| [label, c.0]));
    let all = gather(comm, &pairs.collect::<Vec<_>>()).into_iter();
    first_of_all(all.map(|[label, candidate]| (label, vec![Candidate(candidate)])))
}

/// Parities over the facets of all ranks, from those over each rank's facets. Collective.
fn xor_over_ranks(mut mine: Vec<u8>, comm: &dyn Comm) -> Vec<u8> {
    mine.resize(mine.len().next_multiple_of(8), 0);
    let mut total = vec![0; mine.len()];
    for (_, theirs) in comm.all_gather(&pod_collect_to_vec(&mine)).messages() {
        total.iter_mut().zip(bytemuck::cast_slice(theirs)).for_each(|(t, b): (_, &u8)| *t ^= b);
    }
    total
}

/// The seeds that lie in leaves that do not cross, by number, each with the component that it lies in. Collective; the same on all ranks.
pub(super) fn find_seeds(base: &Base, components: &Components) -> HashMap<u64, Label> {
    let (mut mine, mut path) = (Vec::new(), Vec::new());
    for (number, seed) in (0..).zip(&base.rules.seeds).filter(|(_, seed)| seed.is_in_root()) {
        let code = morton(seed.lattice.map(|c| (c >> (ROOT_BITS - LEVEL_MAX)) as u32));
        // The owner of a part of a leaf holds the leaf's brick.
        if base.ownership.owner_at(code) == base.comm.rank() {
            let found = |c| mine.push([number, components.label(c)]);
            components.nodes.find(&mut path, LEVEL_MAX, code >> 6, 1 << (code & 63), found);
        }
    }
    gather(base.comm, &mine).into_iter().map(|[number, label]| (number, label)).collect()
}

/// The components that have a seed, of seeds that `find_seeds` found. Collective; the same on all ranks.
///
/// # Errors
/// If a seed is outside the root or in a crossing leaf.
pub fn flow_of_seeds(found: &HashMap<u64, Label>, base: &Base) -> Result<HashSet<Label>, Error> {
    let mut seeds = (0..).zip(&base.rules.seeds);
    if let Some((number, seed)) = seeds.find(|(number, _)| !found.contains_key(number)) {
        let problem = match seed.is_in_root() {
            true => "lies in a leaf that the geometry crosses",
            false => "lies outside the root",
        };
        let near = seed.lattice.map(|c| c.clamp(0, ROOT_EDGE));
        let nearest = gather(base.comm, nearest(base, near).as_slice()).into_iter().min();
        let advice = match nearest {
            Some([_, leaf]) => {
                let [x, y, z] = base.rules.root.locate(Candidate(leaf).centroid());
                format!("the nearest centroid of a leaf that it does not cross is ({x}, {y}, {z})")
            }
            None => "the geometry crosses all leaves: decrease spacing_min".to_owned(),
        };
        let [x, y, z] = seed.given;
        return Err(Error::input(format!("seed {number} at ({x}, {y}, {z}) {problem}; {advice}")));
    }
    Ok(found.values().copied().collect())
}

/// The non-crossing leaf, in bricks that this rank holds, whose centroid is nearest to a lattice point: its squared distance
/// and its [`Candidate`]. Of leaves at the same distance the first, by level and Morton code.
fn nearest(base: &Base, point: [i64; 3]) -> Option<[u64; 2]> {
    let leaves = |l: Level| {
        let open = open_bricks(base.tree, base.ownership, l);
        let codes = open.flat_map(|b| Brick { key: b.key, bits: b.open }.codes());
        codes.map(move |code| Candidate::new(l, code))
    };
    let found = |leaf: Candidate| {
        let centroid = leaf.centroid();
        [(0..3).map(|a| (centroid[a] - point[a]).pow(2) as u64).sum(), leaf.0]
    };
    (0..LEVELS as Level).flat_map(leaves).map(found).min()
}

/// The sides of all components: the flow is on the side that is kept, outside if everything is.
pub fn by_seeds(components: &[FirstLeaf], flow: HashSet<Label>, keep: Keep) -> Verdict {
    let inside = match keep {
        Keep::Inside => flow,
        Keep::Outside | Keep::All => {
            components.iter().map(|c| c.0).filter(|label| !flow.contains(label)).collect()
        }
    };
    Verdict { inside, ..Verdict::default() }
}

impl Verdict {
    /// Compares the components with those at the root's boundary. Collective.
    pub(super) fn compare_with_boundary(&mut self, base: &Base, components: &Components) {
        let (rules, all) = (base.rules, &components.all);
        let outside = all.iter().map(|c| c.0).filter(|label| !self.inside.contains(label));
        let outside: HashSet<Label> = outside.collect();
        let by_rays = rules.seeds.is_empty();
        let matters = match rules.keep {
            // A single outside component either reaches the boundary or is the only one and kept.
            Keep::Outside if by_rays => rules.enclosed == Enclosed::Delete && outside.len() > 1,
            Keep::Outside => true,
            Keep::Inside => !self.inside.is_empty(),
            Keep::All => false,
        };
        if !matters && (!by_rays || self.inside.is_empty()) {
            return;
        }
        let mine = components.at_boundary.iter().map(|&c| [components.label(c), 0]).collect();
        let gather = || all_gather_reduced(mine, u64::min, base.comm);
        // The mesh does not depend on them where only a warning does.
        let far_field = if matters { gather() } else { uncounted(base.comm, gather) };
        let far_field: HashSet<Label> = far_field.into_iter().map(|[label, _]| label).collect();
        self.summary.inside_reaches_boundary = !self.inside.is_disjoint(&far_field);
        let misses = outside.is_disjoint(&far_field);
        if !by_rays {
            self.summary.flow_misses_boundary = rules.keep == Keep::Outside && misses;
        } else if matters && rules.keep == Keep::Outside && !misses {
            self.enclosed = outside.difference(&far_field).copied().collect();
        }
    }

    /// The enclosed components in numbers, of whose leaves this rank owns `leaves`. Collective.
    pub fn enclosed_components(
        &self,
        components: &[FirstLeaf],
        leaves: u64,
        base: &Base,
    ) -> EnclosedComponents {
        let enclosed = components.iter().filter(|(label, _)| self.enclosed.contains(label));
        let first = enclosed.map(|&(_, first)| first).min();
        EnclosedComponents {
            count: self.enclosed.len() as u64,
            leaves: first.map_or(0, |_| base.comm.sum(leaves)),
            example: first.map(|leaf| base.rules.root.locate(leaf.centroid())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_those_of_the_proofs() {
        crate::values::compare(
            "src/sides/verdict.rs",
            &[
                ("new", &|a| vec![Candidate::new(a[0] as Level, a[1] as u64).0.into()]),
                ("leaf", &|a| {
                    let (level, code) = Candidate(a[0] as u64).leaf();
                    vec![level.into(), code.into()]
                }),
            ],
        );
    }
}
