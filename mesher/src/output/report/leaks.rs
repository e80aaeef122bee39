//! The leaks of a mesh, for people.

use crate::input::lattice::Root;
use crate::mesh::Mesh;
use crate::sides::leaks::Leak;
use bricks::octant::{LEVEL_MAX, Level};
use serde::Serialize;

/// A leak, in manifest and report, in the unit of the geometry.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LeakEntry {
    /// The spacing at which the region is closed.
    pub spacing_coarse: f64,
    /// The spacing of the mesh.
    pub spacing_fine: f64,
    /// The region's volume at the coarser spacing.
    pub volume: f64,
    /// A point in it.
    pub point: [f64; 3],
}

impl LeakEntry {
    /// The leaks of a mesh.
    pub fn of(mesh: &Mesh) -> Vec<Self> {
        let Root { edge, .. } = mesh.rules.root;
        let edge_of = |l: Level| edge / f64::from(1u32 << l);
        let entry = |leak: &Leak| Self {
            spacing_coarse: edge_of(leak.level),
            spacing_fine: edge_of(mesh.rules.level_surface),
            volume: leak.volume as f64 * edge_of(LEVEL_MAX).powi(3),
            point: mesh.rules.root.locate(leak.first.centroid()),
        };
        mesh.leaks.0.iter().map(entry).collect()
    }
}
