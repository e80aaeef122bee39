//! The work of a rank, counted.

use crate::grade;
use crate::refine::voxelise;
use ranks::Traffic;
use serde::Serialize;
use std::collections::BTreeMap;

/// Work done by one rank, in numbers that repeat exactly.
#[derive(Clone, Copy, Debug, Default, Serialize)]
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
}

impl Counters {
    /// The counters by name. The names are the same on all ranks.
    pub fn by_name(&self) -> BTreeMap<String, u64> {
        let named = serde_json::to_value(self).and_then(serde_json::from_value);
        named.expect("counters are numbers with names")
    }

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
