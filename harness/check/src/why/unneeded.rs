//! Splits of a mesh that no rule requires.
//!
//! Refinement is least (section 6 of reference/DEFINITION.md): an octant is split only if a rule requires it. The recursion of
//! `gradation` decides this for every split octant, and a split that is not required itself justifies no other. So the
//! splits that are found are exactly those which the mesh has beyond the least mesh, if it has all that the rules require;
//! `harness audit` and `harness verify` check that it does. An octant within a needless octant is needless, too.
//!
//! What is found out about an octant is kept in memory, which therefore grows with the mesh. A mesh for which the memory that is
//! available does not suffice is refused.

use std::fs;

use super::Mesh;
use contract::octant::Octant;
use contract::tree::{Handle, Tree};

/// Memory that the audit takes for each leaf: 22 bytes were measured on 4 million cells, and tables double when they are full.
const BYTES_PER_LEAF: u64 = 40;

/// The result of the audit.
///
/// Invariants: needless octants have needless splits, which are some of all splits; the octants that are listed are some of the
/// needless ones, and their leaves some of all.
#[derive(Clone, Debug)]
pub struct Unneeded {
    /// Number of split octants that were examined.
    pub splits: u64,
    /// Number of splits without a cause.
    pub unneeded: u64,
    /// Number of octants that are split without a cause, and whose parent is not.
    pub subtrees: u64,
    /// Number of leaves in them.
    pub unneeded_leaves: u64,
    /// The first of these octants, in Morton order.
    pub first: Vec<Subtree>,
}

/// An octant that is split without a cause.
#[derive(Clone, Debug, PartialEq)]
pub struct Subtree {
    /// The octant.
    pub octant: Octant,
    /// Number of leaves in it.
    pub leaves: u64,
}

impl Mesh<'_> {
    /// Audits a whole mesh and lists at most `first` octants.
    ///
    /// # Errors
    /// One sentence, if the mesh is invalid, its surface is not known, or it is too large for the memory that is available.
    pub fn unneeded(self, first: usize) -> Result<Unneeded, String> {
        if !self.knows_surface() {
            return Err("the mesh has no crossing leaves, so the surface is not known; give its case with --case"
                .to_owned());
        }
        let counts = leaves_below(self.tree);
        let leaves = leaves_in(self.tree.root(), &counts);
        let meminfo = fs::read_to_string("/proc/meminfo").unwrap_or_default();
        refuse_too_large(leaves, &meminfo)?;
        let mut found =
            Unneeded { splits: 0, unneeded: 0, subtrees: 0, unneeded_leaves: 0, first: Vec::new() };
        let mesh = self.distrusting();
        let mut visit = |octant: &Octant, handle: Handle| {
            found.splits += 1;
            if mesh.is_justified(octant) {
                return true;
            }
            let (splits, leaves) = (splits_in(mesh.tree, handle), leaves_in(handle, &counts));
            found.splits += splits - 1;
            found.unneeded += splits;
            found.subtrees += 1;
            found.unneeded_leaves += leaves;
            if found.first.len() < first {
                found.first.push(Subtree { octant: *octant, leaves });
            }
            false
        };
        visit_splits(mesh.tree, (Octant::ROOT, mesh.tree.root()), &mut visit);
        found.check_invariants(leaves);
        Ok(found)
    }
}

/// Visits the split octants of a tree in Morton order, and those in an octant for which `visit` returns true.
fn visit_splits(
    tree: &Tree,
    (octant, handle): (Octant, Handle),
    visit: &mut dyn FnMut(&Octant, Handle) -> bool,
) {
    if handle.is_node() && visit(&octant, handle) {
        for digit in 0..8 {
            let child = tree.child(handle, digit, octant.level);
            visit_splits(tree, (octant.child(digit), child), visit);
        }
    }
}

/// Number of split octants in one with this content, itself included.
fn splits_in(tree: &Tree, handle: Handle) -> u64 {
    let mut splits = 0;
    visit_splits(tree, (Octant::ROOT, handle), &mut |_, _| {
        splits += 1;
        true
    });
    splits
}

/// Numbers of leaves below the distinct nodes of a tree.
fn leaves_below(tree: &Tree) -> Vec<u64> {
    let mut counts = Vec::with_capacity(tree.nodes());
    for children in tree.distinct() {
        counts.push(children.iter().map(|&child| leaves_in(child, &counts)).sum());
    }
    counts
}

/// Number of leaves in an octant with this content.
fn leaves_in(handle: Handle, below: &[u64]) -> u64 {
    handle.as_node().map_or(u64::from(handle.as_leaf().is_some()), |node| below[node])
}

impl Unneeded {
    /// Panics if an invariant of the answer does not hold.
    pub fn check_invariants(&self, leaves: u64) {
        let Self { splits, unneeded, subtrees, unneeded_leaves, first, .. } = self;
        assert!(
            subtrees <= unneeded && unneeded <= splits && (*unneeded == 0) == (*subtrees == 0),
            "{unneeded} of {splits} splits in {subtrees} octants are needless"
        );
        assert!(*unneeded_leaves <= leaves, "{unneeded_leaves} of {leaves} leaves are needless");
        let of_first: u64 = first.iter().map(|subtree| subtree.leaves).sum();
        assert!(
            first.len() as u64 <= *subtrees && of_first <= *unneeded_leaves,
            "{} of {subtrees} octants are listed, with {of_first} of {unneeded_leaves} leaves",
            first.len()
        );
    }
}

/// Refuses a mesh that needs more memory than is available according to `/proc/meminfo`; without that file none.
fn refuse_too_large(leaves: u64, meminfo: &str) -> Result<(), String> {
    let kilobytes = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"));
    let kilobytes =
        kilobytes.and_then(|line| line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok());
    let Some(available) = kilobytes.map(|kilobytes| kilobytes * 1024) else { return Ok(()) };
    let needed = leaves.saturating_mul(BYTES_PER_LEAF);
    if needed <= available {
        return Ok(());
    }
    Err(format!(
        "the search for needless splits needs about {:.1} GB of memory for {leaves} leaves, and {:.1} GB are available: audit a coarser mesh of the same \
         case, or use a machine with more memory",
        needed as f64 / 1e9,
        available as f64 / 1e9
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_of_needless_splits_that_contradict_each_other_are_a_bug() {
        let subtree = Subtree { octant: Octant::ROOT.child(3), leaves: 8 };
        let correct = Unneeded {
            splits: 9,
            unneeded: 2,
            subtrees: 1,
            unneeded_leaves: 8,
            first: vec![subtree],
        };
        correct.check_invariants(64);
        let faults: [fn(&mut Unneeded); 5] = [
            |u| u.unneeded = 10,
            |u| u.subtrees = 0,
            |u| u.unneeded_leaves = 65,
            |u| u.first.push(u.first[0].clone()),
            |u| u.first[0].leaves = 9,
        ];
        for fault in faults {
            let mut wrong = correct.clone();
            fault(&mut wrong);
            assert!(std::panic::catch_unwind(|| wrong.check_invariants(64)).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn a_mesh_that_exceeds_the_available_memory_is_refused_before_the_audit() {
        let meminfo = "MemTotal:       24000000 kB\nMemAvailable:    1000000 kB\n";
        assert_eq!(refuse_too_large(25_000_000, meminfo), Ok(()));
        let why = refuse_too_large(30_000_000, meminfo).unwrap_err();
        assert!(why.contains("1.2 GB") && why.contains("1.0 GB are available"), "{why}");
        assert!(refuse_too_large(u64::MAX, meminfo).is_err());
        assert_eq!(refuse_too_large(u64::MAX, ""), Ok(()));
    }
}
