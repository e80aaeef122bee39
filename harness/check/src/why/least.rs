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

/// The result of the audit.
#[derive(Clone, Debug, Default)]
pub struct Least {
    /// Number of split octants that were examined.
    pub splits: u64,
    /// Number of leaves that were examined.
    pub leaves: u64,
    /// Octants that are split without a cause.
    pub unneeded: Faults,
    /// Leaves that have to be split.
    pub missing: Faults,
}

/// Octants with the same fault.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    /// Number of them.
    pub total: u64,
    /// The first of them, in Morton order.
    pub first: Vec<Octant>,
}

impl Mesh<'_> {
    /// Audits a whole mesh and lists at most `first` octants of each fault. What is found out about split octants is kept in memory.
    ///
    /// # Errors
    /// One sentence, if the surface is not known.
    pub fn least(self, first: usize) -> Result<Least, String> {
        if !self.knows_surface() {
            return Err("the mesh has no crossing leaves, so the surface is not known; give its case with --case"
                .to_owned());
        }
        let (mut found, mesh) = (Least::default(), self.distrusting());
        mesh.audit(&mut Trail::new(mesh.tree), first, &mut found);
        Ok(found)
    }

    fn audit(&self, trail: &mut Trail, first: usize, found: &mut Least) {
        let (handle, octant) = (trail.current().centre(), trail.current().octant);
        if handle.is_node() {
            found.splits += 1;
            found.unneeded.add(!self.is_justified(&octant), octant, first);
            for digit in 0..8 {
                trail.descend(self.tree, digit);
                self.audit(trail, first, found);
                trail.ascend();
            }
        } else if handle.as_leaf().is_some() {
            found.leaves += 1;
            let is_missing = match self.has_nothing_finer(trail) {
                true => self.base_splits(&octant),
                false => self.requires_split(&octant),
            };
            found.missing.add(is_missing, octant, first);
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

impl Faults {
    fn add(&mut self, is_fault: bool, octant: Octant, first: usize) {
        self.total += u64::from(is_fault);
        if is_fault && self.first.len() < first {
            self.first.push(octant);
        }
    }
}
