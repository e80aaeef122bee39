//! Splits of a mesh that no rule requires, and required splits that are missing.
//!
//! Refinement is least (section 6 of reference/DEFINITION.md): an octant is split if and only if a rule requires it. The recursion of
//! `gradation` decides this for every split octant and for every leaf, and a split that is not required itself justifies no other.
//! Whether a rule requires the split of an octant depends on finer leaves alone. So, from the deepest level upward, a mesh without
//! either fault has the splits of the definition where it has leaves; other checks compare these with T0. An octant within a needless
//! octant is needless, too; a leaf in a missing octant is counted once.

use super::Mesh;
use crate::checks::clearance::Trail;
use contract::octant::Octant;
use contract::tree::HOLES;

/// A split that no rule requires.
pub const NEEDLESS: &str = "nothing requires the split of";
/// A leaf that a rule requires to be split.
pub const MISSING: &str = "a facet, a box, a layer or the balance requires the split of";

/// Is called with every octant that is examined and its fault, in Morton order.
type Visit<'v> = &'v mut dyn FnMut(Octant, Option<&'static str>);

impl Mesh<'_> {
    /// Visits all octants of the mesh with their faults. What is found out about split octants is kept in memory. Panics if the surface is
    /// not known.
    pub fn audit(&self, visit: Visit) {
        assert!(self.knows_surface(), "splits are audited where the surface is known");
        self.audit_below(&mut Trail::new(self.tree), visit);
    }

    fn audit_below(&self, trail: &mut Trail, visit: Visit) {
        let (handle, octant) = (trail.current().centre(), trail.current().octant);
        if handle.is_node() {
            visit(octant, (!self.is_justified(&octant)).then_some(NEEDLESS));
            for digit in 0..8 {
                trail.descend(self.tree, digit);
                self.audit_below(trail, visit);
                trail.ascend();
            }
        } else if handle.as_leaf().is_some() {
            let is_missing = match self.has_nothing_finer(trail) {
                true => self.base_splits(&octant),
                false => self.is_forced(&octant, octant.level + 1),
            };
            visit(octant, is_missing.then_some(MISSING));
        }
    }

    /// Whether nothing within the reach of a layer or the balance can force the current leaf to split. True for most leaves, and quick.
    fn has_nothing_finer(&self, trail: &Trail) -> bool {
        let level = trail.current().octant.level;
        let is_coarse = |handle, at| {
            let may_have_crossing =
                self.has_deleted_crossing() && self.tree.kinds(handle) & HOLES != 0;
            self.tree.finest_level(handle, at) <= level && !may_have_crossing
        };
        level >= self.level_deepest
            || trail.all_nearby(self.layer_reach(level + 1).max(1), is_coarse)
    }
}
