//! The report of a run: a table for people, JSON for programs, and warnings.

mod text;
mod warnings;

pub(crate) use text::grouped;

use crate::comm::{Comm, Traffic, matrix};
use crate::digest::hex;
use crate::leaves::Totals;
use crate::manifest::Geometry;
use crate::mesh::Mesh;
use crate::octant::{LEVEL_MAX, Level};
use crate::record::{Phase, Recorder, peak_rss_bytes};
use crate::sides::Summary;
use crate::{grade, voxelise};
use serde::Serialize;
use std::collections::BTreeMap;

/// Work done by one rank, in numbers that repeat exactly.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counters {
    /// Tests of a facet against the 64 octants of a brick.
    pub facet_brick_tests: u64,
    /// Bricks visited by voxelisation.
    pub bricks_voxelised: u64,
    /// Rays cast by all ranks; counted on rank 0.
    pub rays: u64,
    /// Octants split by gradation.
    pub octants_split_graded: u64,
    /// Words of dilated tiles.
    pub words_dilated: u64,
    /// Bricks sent to other ranks by gradation.
    pub halo_bricks: u64,
    /// Messages sent.
    pub messages: u64,
    /// Payload sent, in bytes.
    pub message_bytes: u64,
    /// Leaves of the mesh.
    pub leaves: u64,
    /// Leaves in the rank's heaviest base leaf.
    pub base_leaf_cells_max: u64,
    /// Faces exposed to crossing leaves; only on request.
    pub exposed_faces: Option<u64>,
}

/// Name of the counter that exists only on request.
const EXPOSED_FACES: &str = "exposed_faces";

/// A counter's name in the report, and its value.
type Counter = (&'static str, fn(&Counters) -> u64);

/// All counters of the report.
const COUNTERS: [Counter; 11] = [
    ("facet_brick_tests", |c| c.facet_brick_tests),
    ("bricks_voxelised", |c| c.bricks_voxelised),
    ("rays", |c| c.rays),
    ("octants_split_graded", |c| c.octants_split_graded),
    ("words_dilated", |c| c.words_dilated),
    ("halo_bricks", |c| c.halo_bricks),
    ("messages", |c| c.messages),
    ("message_bytes", |c| c.message_bytes),
    ("leaves", |c| c.leaves),
    ("base_leaf_cells_max", |c| c.base_leaf_cells_max),
    (EXPOSED_FACES, |c| c.exposed_faces.unwrap_or(0)),
];

impl Counters {
    pub(crate) fn add_voxelised(&mut self, w: &voxelise::Work) {
        self.facet_brick_tests += w.facet_brick_tests;
        self.bricks_voxelised += w.bricks_voxelised;
    }

    pub(crate) fn add_graded(&mut self, w: &grade::Work) {
        self.octants_split_graded += w.octants_split;
        self.words_dilated += w.words_dilated;
        self.halo_bricks += w.bricks_sent;
    }

    pub(crate) fn add_traffic(&mut self, t: Traffic) {
        self.messages += t.messages;
        self.message_bytes += t.bytes;
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

/// Words per phase in the message of the report.
const PHASE_WORDS: usize = 6;

/// A run's results. In JSON, under `schema`, `octree-mesher-run/1`.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    schema: &'static str,
    program: &'static str,
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
    pub counters: BTreeMap<&'static str, Vec<u64>>,
    /// Sender, receiver, messages and bytes for every pair of ranks that exchanged messages; only on request.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub message_matrix: Option<Vec<matrix::Entry>>,
}

impl Report {
    /// Gathers the counters and times of all ranks. Collective.
    pub(crate) fn gather(
        mesh: &Mesh,
        totals: &Totals,
        counters: &Counters,
        record: &Recorder,
        comm: &dyn Comm,
    ) -> Self {
        let Mesh { rules, sides, .. } = mesh;
        let Totals { counts, digests, .. } = totals;
        let mut words = vec![peak_rss_bytes() / comm.ranks_in_process() as u64];
        words.extend(COUNTERS.iter().map(|(_, value)| value(counters)));
        words.extend(record.phases().iter().flat_map(|p| {
            let t = p.traffic;
            let times =
                [p.time_wall_s, p.time_cpu_s, t.time_wall_s, t.time_cpu_s].map(f64::to_bits);
            [times[0], times[1], times[2], times[3], t.messages, t.bytes] as [u64; PHASE_WORDS]
        }));
        let all = comm.all_gather(&words);
        let column = |i: usize| all.messages().map(|(_, w)| w[i]).collect::<Vec<u64>>();
        let seconds = |i: usize| column(i).into_iter().map(f64::from_bits).collect::<Vec<f64>>();
        let first = 1 + COUNTERS.len();
        let entry = |(i, p): (usize, &Phase)| {
            let start = first + PHASE_WORDS * i;
            PhaseEntry {
                name: p.name.into(),
                time_wall_s: seconds(start),
                time_cpu_s: seconds(start + 1),
                time_comm_wall_s: seconds(start + 2),
                time_comm_cpu_s: seconds(start + 3),
                messages: column(start + 4),
                message_bytes: column(start + 5),
            }
        };
        let phases: Vec<PhaseEntry> = record.phases().iter().enumerate().map(entry).collect();
        let total = |r: usize| phases.iter().map(|p| p.time_wall_s[r]).sum::<f64>();
        let side = |s: usize| counts.by_level.iter().map(|l| l[s]).sum();
        let Summary { outside, inside, enclosed, ambiguous, .. } = sides.summary;
        Self {
            schema: "octree-mesher-run/1",
            program: concat!("mesher ", env!("CARGO_PKG_VERSION")),
            facets: mesh.facets.total,
            geometry: Geometry::of(&mesh.facets),
            cells: counts.total(),
            cells_by_level: counts.by_level[..=LEVEL_MAX as usize]
                .iter()
                .map(|l| l.iter().sum())
                .collect(),
            cells_by_side: std::array::from_fn(side),
            digest: hex(digests.whole()),
            root_edge: rules.root.edge,
            level_surface: rules.level_surface,
            level_base: mesh.level_base,
            components: outside + inside,
            components_outside: outside,
            components_inside: inside,
            components_enclosed: enclosed.map_or(0, |e| e.count),
            enclosed_leaves: enclosed.map_or(0, |e| e.leaves),
            enclosed_example: enclosed.map(|e| rules.root.locate(e.example)),
            components_ambiguous: ambiguous.map_or(0, |a| a.count),
            ambiguous_example: ambiguous.map(|a| rules.root.locate(a.example)),
            warnings: warnings::of(mesh),
            ranks: comm.size(),
            time_wall_s: (0..comm.size()).map(total).fold(0.0, f64::max),
            peak_rss_bytes: column(0),
            phases,
            counters: (1..)
                .zip(COUNTERS)
                .filter(|(_, (name, _))| *name != EXPOSED_FACES || counters.exposed_faces.is_some())
                .map(|(i, (name, _))| (name, column(i)))
                .collect(),
            message_matrix: None,
        }
    }

    /// Adds the message matrix of the run to the report of rank 0. Collective.
    pub fn with_message_matrix(self, comm: &dyn Comm) -> Self {
        Self { message_matrix: Some(matrix::gather(comm)), ..self }
    }
}
