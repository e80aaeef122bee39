//! Enclosed components: outside components that the far field does not reach, such as sealed cavities and the
//! overlap of two solids, which is outside by the parity of rays.
//!
//! The paper floods from one cell that rays find outside, and deletes what the flood does not reach. Here the far
//! field is every outside component with a face on the root's boundary.

use super::global::Label;
use super::vote::FirstLeaf;
use super::{EnclosedComponents, Verdict};
use crate::input::lattice::{Enclosed, Keep, Rules};
use ranks::{Comm, all_gather_reduced};
use std::collections::HashSet;

impl Verdict {
    /// Compares the components with those at the root's boundary, of which `at_boundary` are this rank's, some more
    /// than once. Collective.
    pub fn compare_with_boundary(
        &mut self,
        rules: &Rules,
        components: &[FirstLeaf],
        at_boundary: impl Iterator<Item = Label>,
        comm: &dyn Comm,
    ) {
        let outside = components.iter().map(|c| c.0).filter(|label| !self.inside.contains(label));
        let outside: HashSet<Label> = outside.collect();
        let by_rays = rules.seeds.is_empty();
        let matters = match rules.keep {
            // A single outside component either reaches the boundary or is the only one and kept.
            Keep::Outside if by_rays => rules.enclosed == Enclosed::Delete && outside.len() > 1,
            Keep::Outside => true,
            Keep::Inside => !self.inside.is_empty(),
            Keep::All => false,
        };
        if !matters {
            return;
        }
        let mine = at_boundary.map(|label| [label, 0]).collect();
        let far_field =
            all_gather_reduced(mine, u64::min, comm).into_iter().map(|[label, _]| label);
        let far_field: HashSet<Label> = far_field.collect();
        match rules.keep {
            Keep::Inside => {
                self.summary.inside_reaches_boundary = !self.inside.is_disjoint(&far_field);
            }
            _ if !by_rays => self.summary.flow_misses_boundary = outside.is_disjoint(&far_field),
            _ if outside.is_disjoint(&far_field) => {}
            _ => self.enclosed = outside.difference(&far_field).copied().collect(),
        }
    }

    /// The enclosed components in numbers, of whose leaves this rank owns `leaves`; none if there are none.
    /// Collective.
    pub fn enclosed_components(
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
