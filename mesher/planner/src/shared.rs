//! What all ranks need, and the limits that they share: a process has an address space, and the ranks of one machine divide its
//! memory.

use crate::pilot::Amounts;
use crate::room::{Limit, Room};
use bytemuck::{Pod, Zeroable};
use mesher::record::peak_rss_bytes;
use ranks::{Comm, gather};
use serde::Serialize;

/// All ranks after a pilot run.
pub struct Ranks {
    all: Vec<Rank>,
    /// Number of ranks in each process.
    in_process: f64,
}

/// Bytes per facet that refinement has freed in the heap, where other sets reuse them.
const FREED_PER_FACET: f64 = 60.0;
/// Sets that grow in the heap leave holes: this part of them, as long as they are smaller than the blocks that get mappings of their
/// own; and bytes at most.
const HOLES: [f64; 2] = [0.3, 5e6];

#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct Rank {
    amounts: Amounts,
    /// Facets of its slice.
    facets: f64,
    room: Room,
    /// Peak resident memory so far, in bytes.
    peak: f64,
}

/// The limit that a run comes closest to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tightest {
    /// The limit.
    pub limit: Limit,
    /// Bytes that it leaves: to a process if it limits the address space, otherwise to the ranks of one machine.
    pub left_bytes: u64,
    /// Bytes that these would take beyond what they have.
    pub needed_bytes: u64,
}

impl Ranks {
    /// Gathers the amounts and limits of all ranks. Collective.
    pub fn gather(comm: &dyn Comm, amounts: Amounts, facets: usize) -> Self {
        let room = Room::read();
        let peak = peak_rss_bytes() as f64;
        Self::gather_each(comm, &Rank { amounts, facets: facets as f64, room, peak })
    }

    fn gather_each(comm: &dyn Comm, mine: &Rank) -> Self {
        Self { all: gather(comm, &[*mine]), in_process: comm.ranks_in_process() as f64 }
    }

    /// Number of ranks.
    pub fn count(&self) -> usize {
        self.all.len()
    }

    /// The amounts of all ranks together.
    pub fn total(&self) -> Amounts {
        Amounts::sum(self.all.iter().map(|rank| rank.amounts))
    }

    /// Bytes that each rank takes beyond what it has, for a mesh that takes `amounts` on all ranks.
    pub fn growth(&self, amounts: &Amounts) -> Vec<f64> {
        let total = self.total().bytes().max(1.0);
        let factor = amounts.bytes() / total - 1.0;
        let of_rank = |rank: &Rank| {
            let sets = (rank.amounts.bytes() * factor).max(0.0);
            let holes = (HOLES[0] * sets).min(HOLES[1]) - FREED_PER_FACET * rank.facets;
            sets + holes.max(0.0)
        };
        self.all.iter().map(of_rank).collect()
    }

    /// Peak resident memory of each rank, if each takes as many bytes as given beyond what it has. Ranks of one process have equal
    /// parts of it.
    pub fn peaks(&self, more: &[f64]) -> Vec<u64> {
        let peak = |(rank, more): (&Rank, &f64)| {
            rank.peak.max(rank.room.resident + more * self.in_process) / self.in_process
        };
        self.all.iter().zip(more).map(|pair| peak(pair) as u64).collect()
    }

    /// The limit that the ranks come closest to, if each takes as many bytes as given beyond what it has.
    pub fn tightest(&self, more: &[f64]) -> Option<Tightest> {
        let mut all = Vec::new();
        for (rank, own) in self.all.iter().zip(more) {
            let on_node = self.all.iter().zip(more).filter(|(r, _)| r.room.node == rank.room.node);
            let node: f64 = on_node.map(|(_, more)| more).sum();
            let room = &rank.room;
            all.push((Limit::AddressSpace, room.address_space, own * self.in_process));
            all.push((Limit::ControlGroup, room.control_group, node));
            all.push((Limit::Machine, room.machine, node));
        }
        let part = |(_, left, needed): &(Limit, f64, f64)| needed / left.max(1.0);
        let limited = all.into_iter().filter(|(_, left, _)| left.is_finite());
        limited.max_by(|a, b| part(a).total_cmp(&part(b))).map(|(limit, left, needed)| Tightest {
            limit,
            left_bytes: left as u64,
            needed_bytes: needed as u64,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pilot::AMOUNTS;

    fn rank(node: u64, address_space: f64, machine: f64) -> Rank {
        let room =
            Room { resident: 50.0, address_space, control_group: f64::INFINITY, machine, node };
        let amounts = Amounts { bytes_sides: 10.0, ..Amounts::default() };
        Rank { amounts, facets: 1.0, room, peak: 70.0 }
    }

    #[test]
    fn ranks_of_one_machine_divide_its_memory() {
        let all = vec![rank(1, 900.0, 100.0), rank(2, 900.0, 1000.0), rank(1, 900.0, 100.0)];
        let ranks = Ranks { all, in_process: 1.0 };
        let tightest = ranks.tightest(&[40.0, 500.0, 50.0]).unwrap();
        assert_eq!((tightest.limit, tightest.needed_bytes), (Limit::Machine, 90));
        let tightest = ranks.tightest(&[0.0, 850.0, 0.0]).unwrap();
        assert_eq!((tightest.limit, tightest.left_bytes), (Limit::AddressSpace, 900));
        assert_eq!(ranks.peaks(&[5.0, 50.0, 500.0]), [70, 100, 550]);
        let three_times = Amounts { bytes_sides: 90.0, ..Amounts::default() };
        assert_eq!(ranks.growth(&three_times), [20.0; 3]);
    }

    #[test]
    fn ranks_of_one_process_have_one_address_space() {
        let all = vec![rank(1, 100.0, f64::INFINITY), rank(1, 100.0, f64::INFINITY)];
        let ranks = Ranks { all, in_process: 2.0 };
        assert_eq!(ranks.tightest(&[60.0, 60.0]).unwrap().needed_bytes, 120);
        assert_eq!(ranks.peaks(&[60.0, 60.0]), [85, 85]);
    }

    #[test]
    fn sets_grow_with_holes_and_reuse_what_facets_leave() {
        let one = |bytes: f64, facets: f64| {
            let amounts = Amounts { bytes_graded: bytes, ..Amounts::default() };
            Ranks { all: vec![Rank { amounts, facets, ..rank(1, 0.0, 0.0) }], in_process: 1.0 }
        };
        let growth = |ranks: Ranks, bytes: f64| {
            ranks.growth(&Amounts { bytes_sides: bytes, ..Amounts::default() })
        };
        // Holes of 0.3e6 bytes, of which 1000 facets leave 6e4.
        assert_eq!(growth(one(1e6, 1000.0), 2e6), [1.24e6]);
        assert_eq!(growth(one(1e6, 1e5), 2e6), [1e6]);
        assert_eq!(growth(one(1e6, 1000.0), 101e6), [1e8 + 5e6 - 6e4]);
        assert_eq!(growth(one(1e6, 1000.0), 0.5e6), [0.0]);
        assert_eq!(growth(one(0.5, 0.0), 3.0), [1.3], "less than a byte counts as one");
    }

    fn different(number: u64) -> Rank {
        let part = |i: u64| (100 * number + i) as f64;
        let room = Room {
            resident: part(0),
            address_space: part(1),
            control_group: f64::INFINITY,
            machine: part(2),
            node: u64::MAX - number,
        };
        let amounts: [f64; AMOUNTS] = std::array::from_fn(|i| part(10 + i as u64));
        let amounts = bytemuck::cast(amounts);
        Rank { amounts, facets: part(3), room, peak: part(4) }
    }

    #[test]
    fn ranks_gather_what_each_one_has() {
        ranks::sim::run(3, 1, |comm| {
            let ranks = Ranks::gather_each(comm, &different(comm.rank() as u64));
            assert_eq!((ranks.count(), ranks.in_process), (3, 3.0));
            assert_eq!(ranks.all, [different(0), different(1), different(2)]);
            let total: [f64; AMOUNTS] = std::array::from_fn(|i| 300.0 + 3.0 * (10 + i) as f64);
            assert_eq!(ranks.total(), bytemuck::cast(total));
        });
    }

    #[test]
    fn a_rank_reads_its_own_memory() {
        let ranks = Ranks::gather(&ranks::Solo, Amounts::default(), 7);
        let [rank] = &ranks.all[..] else { panic!("one rank has {} records", ranks.count()) };
        assert_eq!((rank.facets, rank.room.node), (7.0, Room::read().node));
        for bytes in [rank.room.resident, rank.peak] {
            assert!((1e5..1e11).contains(&bytes), "{rank:?}");
        }
    }

    #[test]
    fn a_limit_that_leaves_nothing_is_the_tightest() {
        let mut one = rank(1, 900.0, 1000.0);
        one.room.control_group = 0.0;
        let tightest = Ranks { all: vec![one], in_process: 1.0 }.tightest(&[2.0]).unwrap();
        assert_eq!(
            tightest,
            Tightest { limit: Limit::ControlGroup, left_bytes: 0, needed_bytes: 2 }
        );
    }
}
