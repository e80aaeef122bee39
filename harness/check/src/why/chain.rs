//! A chain from a split octant to a cause in the inputs.
//!
//! From an octant it goes to the parent of a leaf that forces it to split, until T0 or the extra layer splits one. Of the leaves
//! that do, the first one of the finest level is taken, so that chains are short. Levels rise from link to link, so a chain ends.

use super::Mesh;
use super::base::Cause;
use super::leaves::parent;
use contract::octant::Octant;

/// The rule by which a leaf forces an octant to split (section 6 of reference/DEFINITION.md).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// The leaf is a deleted crossing leaf of T0, and the octant touches it.
    ExtraLayer,
    /// The layer of the leaf reaches the octant.
    Layer,
    /// The octant touches the leaf, which is at least two levels finer.
    Balance,
}

/// A leaf that forces an octant to split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Link {
    /// The rule.
    pub rule: Rule,
    /// The octant.
    pub octant: Octant,
    /// The leaf.
    pub leaf: Octant,
}

/// A chain of leaves, and the cause at its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chain {
    /// The leaves. The parent of each is the octant of the next link, or that of the cause.
    pub links: Vec<Link>,
    /// The cause.
    pub cause: Cause,
}

impl Mesh<'_> {
    /// A chain from an octant to a cause of its split; `None` if no rule requires the split.
    pub(super) fn chain(&self, octant: &Octant) -> Option<Chain> {
        let (mut at, mut is_deep, mut links) = (*octant, false, Vec::new());
        loop {
            if let Some(cause) = self.base_cause(&at) {
                return Some(Chain { links, cause });
            }
            if let Some(leaf) = self.extra_layer(&at) {
                links.push(Link { rule: Rule::ExtraLayer, octant: at, leaf });
                let cause =
                    Cause { octant: leaf, facets: self.facets_of(&leaf), boxes: Vec::new() };
                return Some(Chain { links, cause });
            }
            let link = self.link_of_finest(&at, is_deep)?;
            // After balance, any leaf may follow that may follow after a layer.
            (at, is_deep) = (parent(&link.leaf), link.rule == Rule::Layer);
            links.push(link);
        }
    }

    /// A leaf of the finest possible level that forces the split of an octant, which must be deep or not.
    fn link_of_finest(&self, octant: &Octant, is_deep: bool) -> Option<Link> {
        let coarsest = octant.level + if is_deep { 2 } else { 1 };
        let mut found = None;
        (coarsest..=self.level_deepest).rev().find(|&level| {
            self.any_leaf_near(octant, level..=level, &mut |leaf| {
                let from = parent(&leaf);
                let rule = if self.forces_by_layer(&leaf, octant) && self.is_deep(&from) {
                    Rule::Layer
                } else if self.forces_by_balance(&leaf, octant) && self.is_justified(&from) {
                    Rule::Balance
                } else {
                    return false;
                };
                found = Some(Link { rule, octant: *octant, leaf });
                true
            })
        });
        found
    }
}
