//! The shortest chain from a split octant to its cause in the inputs.
//!
//! An A* search: from an octant to the parents of all leaves that force it to split, until T0 or the extra layer splits one.
//! The octants whose chains are at best shortest are pursued first, and among them those nearest to a cause. The leaves near
//! an octant are searched level by level, finest first, because finer ones lead to shorter chains. So near leaves of coarse
//! levels, of which there are most, are rarely looked at. The chain that is found is the shortest. After
//! [`SEARCHES_MAX`] searches the links that are still needed count twice in this order, so that a chain is found soon.

#[cfg(test)]
mod tests;

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::RangeInclusive;

use super::Mesh;
use super::base::Cause;
use super::leaves::{id, parent};
use contract::octant::Octant;
use rustc_hash::FxHashMap;

/// Searches for leaves near octants for the chains of one answer, before chains that may not be the shortest are accepted.
pub const SEARCHES_MAX: usize = 3000;

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
    /// Links before it.
    links: usize,
    /// The step from which it was reached and the link; `None` for the first.
    from: Option<(usize, Link)>,
}

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Task {
    /// The step has a cause.
    Finish,
    /// Search the leaves near its octant of levels from the first to the last.
    Search(u8, u8),
}

/// A task at a step, in the order of the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Pending {
    /// Links before the step, and [`Frontier::weight`] times the least number of links after it.
    bound: usize,
    /// Links before the step: of equal bounds, long chains first.
    links: Reverse<usize>,
    /// The distance that so many links cover beyond the nearest cause.
    beyond: Reverse<i64>,
    task: Task,
    step: usize,
}

/// The state of the search.
#[derive(Debug, Default)]
struct Frontier {
    /// 1 as long as the shortest chain is searched, then 2.
    weight: usize,
    steps: Vec<Step>,
    pending: BinaryHeap<Reverse<Pending>>,
    /// Links before an octant and whether it must be deep, at least.
    reached: FxHashMap<(u64, bool), usize>,
}

impl Mesh<'_> {
    /// A chain for an octant; `None` if no rule requires its split. Of the searches that are left, those made are subtracted.
    pub(super) fn chain(&self, octant: &Octant, searches_left: &mut usize) -> Option<Chain> {
        if let Some(cause) = self.base_cause(octant) {
            return Some(Chain { octant: *octant, links: Vec::new(), cause, is_shortest: true });
        }
        let mut frontier = Frontier { weight: 1, ..Frontier::default() };
        frontier.steps.push(Step { octant: *octant, is_deep: false, links: 0, from: None });
        let task = Task::Search(self.level_deepest, self.level_deepest);
        frontier.push(Pending { bound: 1, links: Reverse(0), beyond: Reverse(0), task, step: 0 });
        // Least length of a chain, once the order no longer guarantees the shortest.
        let mut least = None;
        while let Some(Reverse(pending)) = frontier.pending.pop() {
            let step = frontier.steps[pending.step];
            let Task::Search(first, last) = pending.task else {
                let chain = self.finished(&frontier.steps, pending.step);
                let is_shortest = least.is_none_or(|least| chain.links.len() <= least);
                return Some(Chain { is_shortest, ..chain });
            };
            if least.is_some() && !self.leads_to_cause(&step) {
                continue;
            }
            *searches_left = searches_left.saturating_sub(1);
            if least.is_none() && *searches_left == 0 {
                if !self.is_justified(octant) {
                    return None;
                }
                least = Some(pending.bound);
                frontier.push(pending);
                frontier.prefer_near();
                continue;
            }
            self.search(&mut frontier, &pending, first..=last);
        }
        None
    }

    /// Whether a chain leads on from a step.
    fn leads_to_cause(&self, step: &Step) -> bool {
        match step.is_deep {
            true => self.is_deep(&step.octant),
            false => self.is_justified(&step.octant),
        }
    }

    /// Adds the octants that leaves of these levels lead to, and the search for leaves of the next coarser level.
    fn search(&self, frontier: &mut Frontier, pending: &Pending, levels: RangeInclusive<u8>) {
        let at = pending.step;
        let Step { octant, is_deep, links, .. } = frontier.steps[at];
        let coarsest = octant.level + if is_deep { 2 } else { 1 };
        let next = levels.start() - 1;
        if next >= coarsest {
            let more = 1 + self.bounds.links_after(next);
            let bound = pending.bound.max(links + frontier.weight * more);
            frontier.push(Pending { bound, task: Task::Search(next, next), ..*pending });
        }
        if *levels.end() == self.level_deepest
            && let Some(leaf) = self.extra_layer(&octant)
        {
            let link = Link { rule: Rule::ExtraLayer, octant, leaf };
            let step =
                Step { octant: leaf, is_deep: false, links: links + 1, from: Some((at, link)) };
            return frontier.add(step, Task::Finish, pending, (0, 0));
        }
        self.any_leaf_near(&octant, levels, &mut |leaf| {
            let next = parent(&leaf);
            let by_layer = self.forces_by_layer(&leaf, &octant);
            let by_balance = self.forces_by_balance(&leaf, &octant);
            if !by_layer && !by_balance {
                return false;
            }
            let is_cause = self.base_splits(&next);
            // After balance, any leaf may follow that may follow after a layer.
            let is_deep = !by_balance;
            let rule = if by_layer && (is_deep || is_cause) { Rule::Layer } else { Rule::Balance };
            let link = Link { rule, octant, leaf };
            let step = Step { octant: next, is_deep, links: links + 1, from: Some((at, link)) };
            if is_cause {
                frontier.add(step, Task::Finish, pending, (0, 0));
            } else if frontier.is_shorter(&step)
                && let Some(bound) = self.links_min(&next, is_deep)
            {
                let task = Task::Search(next.level + 2, self.level_deepest);
                frontier.add(step, task, pending, bound);
            }
            is_cause
        });
    }

    /// The chain that ends at a step.
    fn finished(&self, steps: &[Step], mut at: usize) -> Chain {
        let last = steps[at].octant;
        let mut links = Vec::new();
        while let Some((before, link)) = steps[at].from {
            links.push(link);
            at = before;
        }
        let cause = match links[0].rule {
            Rule::ExtraLayer => {
                Cause { octant: last, facets: self.facets_of(&last), boxes: Vec::new() }
            }
            _ => self.base_cause(&last).expect("T0 splits it"),
        };
        links.reverse();
        Chain { octant: steps[at].octant, links, cause, is_shortest: true }
    }
}

impl Frontier {
    fn push(&mut self, pending: Pending) {
        self.pending.push(Reverse(pending));
    }

    /// Whether no chain that is as short is known to reach an octant. Keeps that one now does.
    fn is_shorter(&mut self, step: &Step) -> bool {
        let id = id(&step.octant);
        let links = |is_deep| self.reached.get(&(id, is_deep)).copied().unwrap_or(usize::MAX);
        let known = if step.is_deep { links(true).min(links(false)) } else { links(false) };
        if known <= step.links {
            return false;
        }
        self.reached.insert((id, step.is_deep), step.links);
        true
    }

    /// Adds a step that is reached from a pending one, with a lower bound of the links that it needs.
    fn add(&mut self, step: Step, task: Task, from: &Pending, (more, beyond): (usize, i64)) {
        let at_least = if self.weight == 1 { from.bound } else { 0 };
        let bound = at_least.max(step.links + self.weight * more);
        let links = Reverse(step.links);
        self.push(Pending { bound, links, beyond: Reverse(beyond), task, step: self.steps.len() });
        self.steps.push(step);
    }

    /// Counts the links that are still needed twice in the order of what is pending, so that it leads to a cause soon.
    fn prefer_near(&mut self) {
        self.weight = 2;
        let all = std::mem::take(&mut self.pending).into_iter();
        let twice = |Reverse(pending): Reverse<Pending>| {
            let bound = 2 * pending.bound - self.steps[pending.step].links;
            Reverse(Pending { bound, ..pending })
        };
        self.pending = all.map(twice).collect();
    }
}
