//! Splits of a mesh that no rule requires.
//!
//! Refinement is least (section 6 of reference/DEFINITION.md): an octant is split only if a rule requires it. The recursion of
//! `gradation` decides this for every split octant, and a split that is not required itself justifies no other. So the
//! splits that are found are exactly those which the mesh has beyond the least mesh, if it has all that the rules require;
//! `harness audit` and `harness verify` check that it does. An octant within a needless octant is needless, too.
//!
//! What is found out about an octant is kept in memory, which therefore grows with the mesh. A mesh for which the memory that is
//! available does not suffice is refused.

use std::fmt;
use std::fs;

use super::Mesh;
use super::answer::{Place, user_place};
use contract::octant::Octant;
use serde::Serialize;

/// Name and version of the JSON form.
pub const SCHEMA: &str = "octree-unneeded/1";

/// Memory that the audit takes for each leaf: 22 bytes were measured on 4 million cells, and tables double when they are full.
const BYTES_PER_LEAF: u64 = 40;

/// The result of the audit.
#[derive(Clone, Debug, Serialize)]
pub struct Unneeded {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Number of leaves of the mesh.
    pub leaves: u64,
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
    /// The one with the most leaves.
    pub largest: Option<Subtree>,
}

/// An octant that is split without a cause.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Subtree {
    /// The octant.
    #[serde(flatten)]
    pub octant: Place,
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
        let meminfo = fs::read_to_string("/proc/meminfo").unwrap_or_default();
        refuse_too_large(self.leaves.count(&Octant::ROOT), &meminfo)?;
        let mesh = self.distrusting();
        let mut found = Unneeded {
            schema: SCHEMA,
            leaves: mesh.leaves.count(&Octant::ROOT),
            splits: 0,
            unneeded: 0,
            subtrees: 0,
            unneeded_leaves: 0,
            first: Vec::new(),
            largest: None,
        };
        mesh.search_unneeded(&Octant::ROOT, first, &mut found);
        found.check_invariants();
        Ok(found)
    }

    fn search_unneeded(&self, octant: &Octant, first: usize, found: &mut Unneeded) {
        let node = self.leaves.node(octant);
        if !node.is_split() {
            return;
        }
        found.splits += 1;
        if !self.is_justified(octant) {
            let below = self.count_splits(octant);
            found.splits += below - 1;
            found.unneeded += below;
            found.subtrees += 1;
            let subtree = Subtree { octant: self.place(octant), leaves: self.leaves.count(octant) };
            found.unneeded_leaves += subtree.leaves;
            if found.largest.as_ref().is_none_or(|largest| largest.leaves < subtree.leaves) {
                found.largest = Some(subtree.clone());
            }
            if found.first.len() < first {
                found.first.push(subtree);
            }
            return;
        }
        for digit in (0..8).filter(|digit| node.split >> digit & 1 == 1) {
            self.search_unneeded(&octant.child(digit), first, found);
        }
    }

    /// Number of split octants in a split octant, itself included.
    fn count_splits(&self, octant: &Octant) -> u64 {
        let split = self.leaves.node(octant).split;
        let children = (0..8).filter(|digit| split >> digit & 1 == 1);
        1 + children.map(|digit| self.count_splits(&octant.child(digit))).sum::<u64>()
    }
}

/// Refuses a mesh that needs more memory than is available according to `/proc/meminfo`; without that file none.
impl Unneeded {
    /// Panics if an invariant of the answer does not hold.
    pub fn check_invariants(&self) {
        let Self { leaves, splits, unneeded, subtrees, unneeded_leaves, first, largest, .. } = self;
        assert!(
            subtrees <= unneeded && unneeded <= splits && (*unneeded == 0) == (*subtrees == 0),
            "{unneeded} of {splits} splits in {subtrees} octants are needless"
        );
        assert!(unneeded_leaves <= leaves, "{unneeded_leaves} of {leaves} leaves are needless");
        let of_first: u64 = first.iter().map(|subtree| subtree.leaves).sum();
        assert!(
            first.len() as u64 <= *subtrees && of_first <= *unneeded_leaves,
            "{} of {subtrees} octants are listed, with {of_first} of {unneeded_leaves} leaves",
            first.len()
        );
        let most = first.iter().map(|subtree| subtree.leaves).max().unwrap_or(0);
        let largest = largest.as_ref().map_or(0, |largest| largest.leaves);
        assert!(
            most <= largest && largest <= *unneeded_leaves,
            "the largest of {unneeded_leaves} leaves has {largest}, and one listed has {most}"
        );
    }
}

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
        "--unneeded needs about {:.1} GB of memory for {leaves} leaves, and {:.1} GB are available: audit a coarser mesh of the same \
         case, or use a machine with more memory",
        needed as f64 / 1e9,
        available as f64 / 1e9
    ))
}

impl fmt::Display for Unneeded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { leaves, splits, unneeded, subtrees, unneeded_leaves, .. } = self;
        if *unneeded == 0 {
            return write!(f, "every split has a cause: {splits} splits, {leaves} leaves");
        }
        writeln!(
            f,
            "{unneeded} of {splits} splits have no cause: no facet, box, layer or balance requires them. They make \
             {unneeded_leaves} leaves, in {subtrees} octants:"
        )?;
        for subtree in &self.first {
            writeln!(f, "  {}, {} leaves", user_place(&subtree.octant), subtree.leaves)?;
        }
        if (self.first.len() as u64) < *subtrees {
            writeln!(f, "  and {} more (--limit)", subtrees - self.first.len() as u64)?;
        }
        match &self.largest {
            Some(largest) => {
                let place = user_place(&largest.octant);
                write!(f, "the largest: {place}, {} leaves", largest.leaves)
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_of_needless_splits_that_contradict_each_other_are_a_bug() {
        let root = contract::lattice::Root { origin: [0.0; 3], edge: 1.0 };
        let subtree = Subtree { octant: Place::new(&Octant::ROOT.child(3), &root), leaves: 8 };
        let correct = Unneeded {
            schema: SCHEMA,
            leaves: 64,
            splits: 9,
            unneeded: 2,
            subtrees: 1,
            unneeded_leaves: 8,
            first: vec![subtree.clone()],
            largest: Some(subtree),
        };
        correct.check_invariants();
        let faults: [fn(&mut Unneeded); 6] = [
            |u| u.unneeded = 10,
            |u| u.subtrees = 0,
            |u| u.unneeded_leaves = 65,
            |u| u.first.push(u.first[0].clone()),
            |u| u.largest = None,
            |u| u.first[0].leaves = 9,
        ];
        for fault in faults {
            let mut wrong = correct.clone();
            fault(&mut wrong);
            assert!(std::panic::catch_unwind(|| wrong.check_invariants()).is_err(), "{wrong:?}");
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
