//! The work of a rank, counted.

use crate::grade;
use crate::refine::voxelise;
use ranks::Traffic;

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
pub const EXPOSED_FACES: &str = "exposed_faces";

/// A counter's name in the report, and its value.
pub type Counter = (&'static str, fn(&Counters) -> u64);

/// All counters of the report.
pub const COUNTERS: [Counter; 11] = [
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
    /// Adds work of voxelisation.
    pub fn add_voxelised(&mut self, w: &voxelise::Work) {
        self.facet_brick_tests += w.facet_brick_tests;
        self.bricks_voxelised += w.bricks_voxelised;
    }

    /// Adds work of gradation.
    pub fn add_graded(&mut self, w: &grade::Work) {
        self.octants_split_graded += w.octants_split;
        self.words_dilated += w.words_dilated;
        self.halo_bricks += w.bricks_sent;
    }

    /// Adds messages.
    pub fn add_traffic(&mut self, t: Traffic) {
        self.messages += t.messages;
        self.message_bytes += t.bytes;
    }
}
