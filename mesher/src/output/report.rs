//! The report of a run: a table for people, JSON for programs, and warnings.
//!
//! Invariants of a report, which [`Report::check_invariants`] executes before it is returned:
//! - leaves by level, by side and by rank add up to all leaves, and a rank's heaviest base leaf has no more than the rank;
//! - components by side add up to all; there are no more enclosed ones than outside, and an example where there is one to show;
//! - every quantity by rank has an entry for each rank; times are finite and not negative;
//! - the wall time is that of the slowest rank.

pub mod leaks;
mod text;
pub(crate) mod warnings;

pub use text::grouped;

use crate::input::quantise::FacetCounts;
use crate::job::Job;
use crate::mesh::Mesh;
use crate::output::stream::Counts;
use crate::partition::Partitioner;
use crate::record::peak_rss_bytes;
use crate::sides::Summary;
use bricks::digest::{Digests, hex};
use bricks::octant::{LEVEL_MAX, Level};
use leaks::LeakEntry;
use serde::Serialize;
use std::collections::BTreeMap;

/// The facets as read, in manifest and report.
#[derive(Clone, Debug, Serialize)]
pub struct Geometry {
    /// Their number.
    pub facets: u64,
    /// Their digest on the lattice.
    pub digest: String,
}

impl Geometry {
    /// The facets of all ranks.
    pub fn of(facets: &FacetCounts) -> Self {
        Self { facets: facets.total, digest: hex(facets.digest) }
    }
}

/// One phase over all ranks.
#[derive(Clone, Debug, Serialize)]
pub struct PhaseEntry {
    /// Its name.
    pub name: String,
    /// Wall time by rank, in seconds.
    pub time_wall_s: Vec<f64>,
    /// CPU time by rank, in seconds, calls to other ranks included.
    pub time_cpu_s: Vec<f64>,
    /// Wall time in calls to other ranks, waiting included, by rank, in seconds.
    pub time_comm_wall_s: Vec<f64>,
    /// CPU time in calls to other ranks, by rank, in seconds; includes busy waiting.
    pub time_comm_cpu_s: Vec<f64>,
    /// Messages sent, by rank.
    pub messages: Vec<u64>,
    /// Bytes sent, by rank.
    pub message_bytes: Vec<u64>,
}

/// A run's results. In JSON, under `schema`, `octree-mesher-run/1`.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    schema: &'static str,
    pub(crate) program: &'static str,
    /// Facets in the geometry.
    pub facets: u64,
    /// The same, with their digest.
    pub geometry: Geometry,
    /// Leaves of the mesh.
    pub cells: u64,
    /// Leaves by level, 0 to 19.
    pub cells_by_level: Vec<u64>,
    /// Leaves by side: outside, inside, crossing.
    pub cells_by_side: [u64; 3],
    /// The mesh's digest.
    pub digest: String,
    /// Edge of the root in the geometry's unit.
    pub root_edge: f64,
    /// Surface level.
    pub level_surface: Level,
    /// Level of the base leaves, or of the octants between which partition boundaries lie.
    pub level_base: Level,
    /// The partitioner that was used: METIS leaves few base leaves to the curve. None for a single rank.
    pub partitioner: Option<Partitioner>,
    /// Components of non-crossing leaves of the base tree.
    pub components: u64,
    /// Those that are outside, enclosed ones included.
    pub components_outside: u64,
    /// Those that are inside.
    pub components_inside: u64,
    /// Outside components that are deleted because the far field does not reach them.
    pub components_enclosed: u64,
    /// Their leaves in the base tree.
    pub enclosed_leaves: u64,
    /// A point in one of them.
    pub enclosed_example: Option<[f64; 3]>,
    /// Components decided by majority.
    pub components_ambiguous: u64,
    /// A point in one of them.
    pub ambiguous_example: Option<[f64; 3]>,
    /// What is closed at a coarser spacing, and open at that of the mesh.
    pub leaks: Vec<LeakEntry>,
    /// What is probably not as the user intended, and what to try: a sentence each.
    pub warnings: Vec<String>,
    /// Number of ranks.
    pub ranks: usize,
    /// Wall time of the slowest rank, in seconds, from reading to the last leaf.
    pub time_wall_s: f64,
    /// Peak resident memory by rank; simulated ranks report equal fractions of their process's.
    pub peak_rss_bytes: Vec<u64>,
    /// Times by phase and rank.
    pub phases: Vec<PhaseEntry>,
    /// Counters by rank.
    pub counters: BTreeMap<String, Vec<u64>>,
}

impl Report {
    /// The report of a mesh with these leaves on `ranks` ranks, without times and counters.
    pub(crate) fn new(mesh: &Mesh, counts: &Counts, digests: &Digests, ranks: usize) -> Self {
        let Mesh { rules, sides, .. } = mesh;
        let by_level = &counts.by_level[..=LEVEL_MAX as usize];
        let Summary { outside, inside, enclosed, ambiguous, .. } = sides.summary;
        Self {
            schema: "octree-mesher-run/1",
            program: concat!("mesher ", env!("CARGO_PKG_VERSION")),
            facets: mesh.facets.total,
            geometry: Geometry::of(&mesh.facets),
            cells: counts.total(),
            cells_by_level: by_level.iter().map(|l| l.iter().sum()).collect(),
            cells_by_side: [0, 1, 2].map(|side| by_level.iter().map(|l| l[side]).sum()),
            digest: hex(digests.whole()),
            root_edge: rules.root.edge,
            level_surface: rules.level_surface,
            level_base: mesh.level_base,
            partitioner: mesh.partitioner,
            components: outside + inside,
            components_outside: outside,
            components_inside: inside,
            components_enclosed: enclosed.map_or(0, |e| e.count),
            enclosed_leaves: enclosed.map_or(0, |e| e.leaves),
            enclosed_example: enclosed.map(|e| rules.root.locate(e.example)),
            components_ambiguous: ambiguous.map_or(0, |a| a.count),
            ambiguous_example: ambiguous.map(|a| rules.root.locate(a.example)),
            leaks: LeakEntry::of(mesh),
            warnings: warnings::of(mesh),
            ranks,
            time_wall_s: 0.0,
            peak_rss_bytes: Vec::new(),
            phases: Vec::new(),
            counters: BTreeMap::new(),
        }
    }

    /// Adds the counters and times of all ranks. Collective.
    pub(crate) fn with_ranks(mut self, job: &Job) -> Self {
        let Job { comm, record, counters, .. } = job;
        let mut words = vec![peak_rss_bytes() / comm.ranks_in_process() as u64];
        let counters = counters.by_name();
        words.extend(counters.values());
        words.extend(record.phases().iter().flat_map(|p| {
            let t = p.traffic;
            let [wall, cpu, comm_wall, comm_cpu] =
                [p.time_wall_s, p.time_cpu_s, t.time_wall_s, t.time_cpu_s].map(f64::to_bits);
            [wall, cpu, comm_wall, comm_cpu, t.messages, t.bytes]
        }));
        let all = comm.all_gather(&words);
        // The columns of the table that has a row for each rank.
        let mut columns = (0..).map(|i| all.messages().map(|(_, w)| w[i]).collect::<Vec<u64>>());
        let mut column = || columns.next().expect("columns have no end");
        self.peak_rss_bytes = column();
        self.counters = counters.into_keys().map(|name| (name, column())).collect();
        for phase in record.phases() {
            let mut seconds = || column().into_iter().map(f64::from_bits).collect::<Vec<f64>>();
            self.phases.push(PhaseEntry {
                name: phase.name.into(),
                time_wall_s: seconds(),
                time_cpu_s: seconds(),
                time_comm_wall_s: seconds(),
                time_comm_cpu_s: seconds(),
                messages: column(),
                message_bytes: column(),
            });
        }
        let total = |r: usize| self.phases.iter().map(|p| p.time_wall_s[r]).sum::<f64>();
        self.time_wall_s = (0..self.ranks).map(total).fold(0.0, f64::max);
        self.check_invariants();
        self
    }

    /// # Panics
    /// If an invariant at the head of this file is violated.
    pub fn check_invariants(&self) {
        let all = self.cells;
        let sums = [
            ("level", self.cells_by_level.iter().sum::<u64>()),
            ("side", self.cells_by_side.iter().sum()),
            ("rank", self.counters["leaves"].iter().sum()),
        ];
        for (by, sum) in sums {
            assert_eq!(sum, all, "leaves by {by} must add up to all leaves");
        }
        let heaviest = self.counters["base_leaf_cells_max"].iter().zip(&self.counters["leaves"]);
        for (rank, (heaviest, leaves)) in heaviest.enumerate() {
            assert!(
                heaviest <= leaves,
                "rank {rank}: a base leaf of {heaviest} of {leaves} leaves"
            );
        }
        let [outside, inside] = [self.components_outside, self.components_inside];
        assert_eq!(self.components, outside + inside, "components must be outside or inside");
        let [enclosed, ambiguous] = [self.components_enclosed, self.components_ambiguous];
        assert!(enclosed <= outside, "{enclosed} of {outside} outside components are enclosed");
        assert!(ambiguous <= self.components, "{ambiguous} of {} are ambiguous", self.components);
        assert!(self.enclosed_leaves >= enclosed, "each of {enclosed} components must have a leaf");
        let examples = [(enclosed, self.enclosed_example), (ambiguous, self.ambiguous_example)];
        for (count, example) in examples {
            assert_eq!(count > 0, example.is_some(), "an example of {count} components");
        }
        assert!(self.counters.values().all(|c| c.len() == self.ranks), "a counter for each rank");
        assert_eq!(self.peak_rss_bytes.len(), self.ranks, "a peak for each rank");
        let mut walls = vec![0.0; self.ranks];
        for p in &self.phases {
            let times = [&p.time_wall_s, &p.time_cpu_s, &p.time_comm_wall_s, &p.time_comm_cpu_s];
            for times in times {
                let is_time = |t: &f64| t.is_finite() && *t >= 0.0;
                let are_times = times.len() == self.ranks && times.iter().all(is_time);
                assert!(are_times, "{}: {times:?} must be a time for each rank", p.name);
            }
            for counts in [&p.messages, &p.message_bytes] {
                assert_eq!(counts.len(), self.ranks, "{}: a count for each rank", p.name);
            }
            walls.iter_mut().zip(&p.time_wall_s).for_each(|(wall, t)| *wall += t);
        }
        let slowest = walls.into_iter().fold(0.0, f64::max);
        assert_eq!(self.time_wall_s, slowest, "the wall time must be that of the slowest rank");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ranks::{Comm, sim};

    fn report() -> Report {
        let of_rank = |comm: &dyn Comm| {
            let mut record = crate::record::Recorder::default();
            crate::mesh(&crate::tests::case(), &crate::tests::options(), comm, &mut record)
        };
        sim::run(2, 1, |comm| of_rank(comm)).swap_remove(0).expect("a good case")
    }

    #[test]
    fn a_wrong_report_is_not_returned() {
        let sound = report();
        sound.check_invariants();
        let corruptions: [&dyn Fn(&mut Report); 12] = [
            &|r| r.cells += 1,
            &|r| r.cells_by_level[3] += 1,
            &|r| r.cells_by_side[1] += 1,
            &|r| r.counters.get_mut("leaves").expect("a counter")[1] += 1,
            &|r| r.counters.get_mut("base_leaf_cells_max").expect("a counter")[0] = r.cells,
            &|r| r.components_inside += 1,
            &|r| r.components_enclosed = r.components_outside + 1,
            &|r| r.components_ambiguous += 1,
            &|r| _ = r.peak_rss_bytes.pop(),
            &|r| r.phases[2].time_cpu_s[1] = f64::NAN,
            &|r| _ = r.phases[1].messages.pop(),
            &|r| r.time_wall_s *= 1.01,
        ];
        for (number, corrupt) in corruptions.into_iter().enumerate() {
            let mut report = sound.clone();
            corrupt(&mut report);
            let check = std::panic::AssertUnwindSafe(|| report.check_invariants());
            assert!(std::panic::catch_unwind(check).is_err(), "corruption {number}");
        }
    }
}
