//! Splits of a mesh that no rule requires.
//!
//! Refinement is least (section 6 of reference/DEFINITION.md): an octant is split only if a rule requires it. The recursion of
//! `gradation` decides this for every split octant, and a split that is not required itself justifies no other. So the
//! splits that are found are exactly those which the mesh has beyond the least mesh, if it has all that the rules require;
//! `harness audit` and `harness verify` check that it does. An octant within a needless octant is needless, too.

use super::Mesh;
use contract::octant::Octant;
use contract::tree::{Handle, Tree};

/// The result of the audit.
#[derive(Clone, Debug, Default)]
pub struct Unneeded {
    /// Number of split octants that were examined.
    pub splits: u64,
    /// Number of splits without a cause.
    pub unneeded: u64,
    /// The first octants that are split without a cause, in Morton order.
    pub first: Vec<Octant>,
}

impl Mesh<'_> {
    /// Audits a whole mesh and lists at most `first` octants. What is found out about an octant is kept in memory.
    ///
    /// # Errors
    /// One sentence, if the surface is not known.
    pub fn unneeded(self, first: usize) -> Result<Unneeded, String> {
        if !self.knows_surface() {
            return Err("the mesh has no crossing leaves, so the surface is not known; give its case with --case"
                .to_owned());
        }
        let mut found = Unneeded::default();
        let mesh = self.distrusting();
        visit_splits(mesh.tree, (Octant::ROOT, mesh.tree.root()), &mut |octant| {
            found.splits += 1;
            if !mesh.is_justified(octant) {
                found.unneeded += 1;
                if found.first.len() < first {
                    found.first.push(*octant);
                }
            }
        });
        Ok(found)
    }
}

/// Visits the split octants of a tree in Morton order.
fn visit_splits(tree: &Tree, (octant, handle): (Octant, Handle), visit: &mut dyn FnMut(&Octant)) {
    if handle.is_node() {
        visit(&octant);
        for digit in 0..8 {
            let child = tree.child(handle, digit, octant.level);
            visit_splits(tree, (octant.child(digit), child), visit);
        }
    }
}
