//! The inputs of the mesh definition (`DEFINITION.md`, section 1), in the user's unit of length.
use crate::Side;
use serde::{Deserialize, Serialize};

/// A case. The mesh is a function of these fields alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The body: a soup of triangles, each given by its three vertices.
    pub facets: Vec<[[f64; 3]; 3]>,
    /// The cube that the mesh fills.
    pub root: Root,
    /// Upper bound on the edge length of cells at the surface.
    pub spacing_min: f64,
    /// Minimum thickness of a layer, in cells; at least 1.
    pub layer_cells_min: u32,
    /// The region that the final mesh covers.
    pub keep: Keep,
    /// Whether leaves that contain geometry stay in the final mesh.
    pub keep_crossing: bool,
    /// Extent boxes, each with its own spacing.
    pub boxes: Vec<BoxSpec>,
    /// Points in the flow. If there are any, they and not rays determine the sides.
    pub seeds: Vec<[f64; 3]>,
    /// The treatment of outside components that do not reach the boundary of the root.
    pub enclosed: Enclosed,
}

/// The cube that the mesh fills.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Root {
    /// The minimum corner.
    pub origin: [f64; 3],
    /// The edge length.
    pub edge: f64,
}

impl Root {
    /// The root centred on the bounding box of all vertices, with an edge of `scale` times the
    /// longest edge of that box. `None` if there are no facets.
    #[must_use]
    pub fn around(facets: &[[[f64; 3]; 3]], scale: f64) -> Option<Self> {
        let mut lo = facets.first()?[0];
        let mut hi = lo;
        for vertex in facets.as_flattened() {
            for a in 0..3 {
                lo[a] = lo[a].min(vertex[a]);
                hi[a] = hi[a].max(vertex[a]);
            }
        }
        // The definition fixes the order of operations, so that all programs agree to the last bit.
        let longest = (0..3).map(|a| hi[a] - lo[a]).fold(0.0, f64::max);
        let edge = scale * longest;
        let origin = std::array::from_fn(|a| (lo[a] + hi[a]) * 0.5 - edge * 0.5);
        Some(Self { origin, edge })
    }
}

/// The region that the final mesh covers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Keep {
    /// Outside the body: external flow.
    #[default]
    Outside,
    /// Inside the body: internal flow.
    Inside,
    /// Everything.
    All,
}

impl Keep {
    /// Whether gradation keeps leaves of `side`. Crossing leaves are always kept at this stage.
    #[must_use]
    pub fn keeps(self, side: Side) -> bool {
        match self {
            Keep::Outside => side != Side::Inside,
            Keep::Inside => side != Side::Outside,
            Keep::All => true,
        }
    }
}

/// The treatment of outside components that do not reach the boundary of the root, such as a sealed
/// cavity or the overlap of two closed bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Enclosed {
    /// They are deleted.
    #[default]
    Delete,
    /// They are kept.
    Keep,
}

/// An axis-aligned box with its own spacing.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxSpec {
    /// The minimum corner.
    pub min: [f64; 3],
    /// The maximum corner.
    pub max: [f64; 3],
    /// Upper bound on the edge length of cells that meet the box.
    pub spacing: f64,
}
