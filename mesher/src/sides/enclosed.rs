//! Enclosed components: outside components that the far field does not reach, such as sealed cavities and the
//! overlap of two solids, which is outside by the parity of rays.
//!
//! The paper floods from a cell in the far field and deletes what the flood does not reach. Here the far
//! field is every outside component with a face on the root's boundary.

use super::global::Label;
use super::vote::FirstLeaf;
use super::{EnclosedComponents, Verdict};
use crate::input::lattice::{Enclosed, Keep, Rules};
use ranks::{Comm, all_gather_reduced};
use std::collections::HashSet;

/// What the kept region owes to the root's boundary. The same on all ranks.
#[derive(Default)]
pub struct Region {
    /// Components that are deleted although they are outside.
    pub enclosed: HashSet<Label>,
    /// Whether the inside is kept and reaches the root's boundary.
    pub inside_reaches_boundary: bool,
    /// Whether the outside is kept and seeds decide it, and none of it reaches the root's boundary.
    pub flow_misses_boundary: bool,
}

impl Region {
    /// Compares the components with those at the root's boundary, of which `at_boundary` are this rank's, some more
    /// than once.
    /// Collective.
    pub fn new(
        rules: &Rules,
        components: &[FirstLeaf],
        verdict: &Verdict,
        at_boundary: impl Iterator<Item = Label>,
        comm: &dyn Comm,
    ) -> Self {
        let of_all_ranks = || -> HashSet<Label> {
            let mine = at_boundary.map(|label| [label, 0]).collect();
            all_gather_reduced(mine, u64::min, comm).into_iter().map(|[label, _]| label).collect()
        };
        let outside =
            || components.iter().map(|c| c.0).filter(|label| !verdict.inside.contains(label));
        let deletes = rules.seeds.is_empty() && rules.enclosed == Enclosed::Delete;
        match rules.keep {
            // A single outside component either reaches the boundary or is the only one and kept.
            Keep::Outside if deletes && outside().nth(1).is_some() => {
                let far_field = of_all_ranks();
                let (reached, enclosed): (HashSet<_>, HashSet<_>) =
                    outside().partition(|label| far_field.contains(label));
                let enclosed = if reached.is_empty() { HashSet::new() } else { enclosed };
                Self { enclosed, ..Self::default() }
            }
            Keep::Outside if !rules.seeds.is_empty() => {
                let far_field = of_all_ranks();
                let flow_misses_boundary = !outside().any(|label| far_field.contains(&label));
                Self { flow_misses_boundary, ..Self::default() }
            }
            Keep::Inside if !verdict.inside.is_empty() => Self {
                inside_reaches_boundary: !verdict.inside.is_disjoint(&of_all_ranks()),
                ..Self::default()
            },
            _ => Self::default(),
        }
    }

    /// The enclosed components in numbers, of whose leaves this rank owns `leaves`; none if there are none.
    /// Collective.
    pub fn summary(
        &self,
        components: &[FirstLeaf],
        leaves: u64,
        comm: &dyn Comm,
    ) -> Option<EnclosedComponents> {
        let enclosed = components.iter().filter(|(label, _)| self.enclosed.contains(label));
        let first = enclosed.map(|&(_, first)| first).min()?;
        Some(EnclosedComponents {
            count: self.enclosed.len() as u64,
            leaves: comm.sum(leaves),
            example: first.centroid(),
        })
    }
}
