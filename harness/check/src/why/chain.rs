//! The shortest chain from a split octant to its cause in the inputs.
//!
//! A breadth-first search: from an octant to the parents of all leaves that force it to split, until T0 or the extra layer
//! splits one. The number of octants grows with every step, and far from the surface they would soon be most of the mesh.
//! So at most [`FRONTIER_MAX`] are pursued per step: those of the finest level, and among them those with the most split
//! children, which are next to finer leaves. A chain is reported as the shortest only if every octant that was dropped can
//! at best lead to one that is no shorter.

use std::cmp::Reverse;

use super::Mesh;
use super::base::Cause;
use super::leaves::{id, parent};
use contract::octant::Octant;
use rustc_hash::FxHashSet;

/// Octants that are pursued per step.
pub const FRONTIER_MAX: usize = 400;

/// A rule of section 6.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// The extra layer around crossing leaves that will be deleted.
    ExtraLayer,
    /// Step 2.
    Layer,
    /// Step 3.
    Balance,
}

/// A leaf that forces an octant to split: the octant of the chain, or the parent of the previous link's leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Link {
    /// The rule.
    pub rule: Rule,
    /// The octant that is forced to split.
    pub octant: Octant,
    /// The leaf.
    pub leaf: Octant,
}

/// A chain from a split octant to its cause.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chain {
    /// The octant.
    pub octant: Octant,
    /// The leaves in between; none if T0 splits the octant.
    pub links: Vec<Link>,
    /// The cause of the last leaf: what splits its parent or, after the extra layer, what crosses the leaf itself.
    pub cause: Cause,
    /// Whether no shorter chain exists.
    pub is_shortest: bool,
}

/// An octant that the search has reached.
#[derive(Clone, Copy, Debug)]
struct Step {
    octant: Octant,
    /// Whether the octant must be deep, because its child is the source of a layer.
    is_deep: bool,
    /// The step from which it was reached and the link; `None` for the first.
    from: Option<(usize, Link)>,
}

impl Mesh<'_> {
    /// A chain for an octant; `None` if no rule requires its split.
    pub(super) fn chain(&self, octant: &Octant) -> Option<Chain> {
        if let Some(cause) = self.base_cause(octant) {
            return Some(Chain { octant: *octant, links: Vec::new(), cause, is_shortest: true });
        }
        if !self.is_justified(octant) {
            return None;
        }
        let mut steps = vec![Step { octant: *octant, is_deep: false, from: None }];
        let mut seen = FxHashSet::default();
        // Length of the shortest chain that a dropped octant can be part of.
        let mut shortest_dropped = usize::MAX;
        let (mut from, mut links) = (0, 1);
        while from < steps.len() {
            let until = steps.len();
            for i in from..until {
                if let Some(chain) = self.expand(i, &mut steps, &mut seen) {
                    let is_shortest = chain.links.len() <= shortest_dropped;
                    return Some(Chain { is_shortest, ..chain });
                }
            }
            if steps.len() - until > FRONTIER_MAX {
                self.select(&mut steps, until);
                shortest_dropped = shortest_dropped.min(links + 1);
            }
            (from, links) = (until, links + 1);
        }
        None
    }

    /// Appends the octants that are reached from a step, and returns the chain if one of them has a cause.
    fn expand(
        &self,
        from: usize,
        steps: &mut Vec<Step>,
        seen: &mut FxHashSet<(u64, bool)>,
    ) -> Option<Chain> {
        let Step { octant, is_deep, .. } = steps[from];
        if let Some(leaf) = self.extra_layer(&octant) {
            let last = Link { rule: Rule::ExtraLayer, octant, leaf };
            let cause = Cause { octant: leaf, facets: self.facets_of(&leaf), boxes: Vec::new() };
            return Some(chain(steps, from, last, cause));
        }
        let first = octant.level + if is_deep { 2 } else { 1 };
        let mut found = None;
        self.any_leaf_near(&octant, first..=self.level_deepest, &mut |leaf| {
            let next = parent(&leaf);
            let rules = [
                (Rule::Layer, true, self.forces_by_layer(&leaf, &octant)),
                (Rule::Balance, false, self.forces_by_balance(&leaf, &octant)),
            ];
            for (rule, is_deep, _) in rules.into_iter().filter(|rule| rule.2) {
                if !seen.insert((id(&next), is_deep)) {
                    continue;
                }
                let link = Link { rule, octant, leaf };
                if let Some(cause) = self.base_cause(&next) {
                    found = Some((link, cause));
                    return true;
                }
                steps.push(Step { octant: next, is_deep, from: Some((from, link)) });
            }
            false
        });
        found.map(|(last, cause)| chain(steps, from, last, cause))
    }

    /// Keeps the most promising octants among the steps from `first` on. All that are kept lead to a cause.
    fn select(&self, steps: &mut Vec<Step>, first: usize) {
        let mut reached = steps.split_off(first);
        let split_children = |octant: &Octant| self.leaves.node(octant).split.count_ones();
        reached
            .sort_by_cached_key(|step| Reverse((step.octant.level, split_children(&step.octant))));
        let leads = |step: &Step| match step.is_deep {
            true => self.is_deep(&step.octant),
            false => self.is_justified(&step.octant),
        };
        steps.extend(reached.into_iter().filter(leads).take(FRONTIER_MAX));
    }
}

/// The chain that ends with a link from step `from`.
fn chain(steps: &[Step], mut from: usize, last: Link, cause: Cause) -> Chain {
    let mut links = vec![last];
    while let Some((before, link)) = steps[from].from {
        links.push(link);
        from = before;
    }
    links.reverse();
    Chain { octant: steps[from].octant, links, cause, is_shortest: true }
}
