//! What is meshed: the inputs of the definition, in the user's units.
use crate::Side;
use serde::{Deserialize, Serialize};

/// A case: everything that the mesh is a function of.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The body: a soup of triangles, three vertices each.
    pub facets: Vec<[[f64; 3]; 3]>,
    /// The cube that is meshed.
    pub root: Root,
    /// The edge length that no cell at the surface exceeds.
    pub spacing_min: f64,
    /// The least thickness of a layer, in cells; at least 1.
    pub layer_cells_min: u32,
    /// The region that is meshed.
    pub keep: Keep,
    /// Whether leaves that hold geometry stay in the final mesh.
    pub keep_crossing: bool,
    /// Regions with a spacing of their own.
    pub boxes: Vec<BoxSpec>,
}

/// The cube that is meshed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Root {
    /// The minimum corner.
    pub origin: [f64; 3],
    /// The edge length.
    pub edge: f64,
}

impl Root {
    /// The root whose edge is `scale` longest edges of the vertices' bounding box, centred on it.
    /// `None` when there are no vertices.
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
        // The order of operations is part of the definition: programs must agree to the last bit.
        let longest = (0..3).map(|a| hi[a] - lo[a]).fold(0.0, f64::max);
        let edge = scale * longest;
        let origin = std::array::from_fn(|a| (lo[a] + hi[a]) * 0.5 - edge * 0.5);
        Some(Self { origin, edge })
    }
}

/// The region that is meshed.
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
    /// Whether leaves of `side` are kept. Crossing leaves always are, until the mesh is final.
    #[must_use]
    pub fn keeps(self, side: Side) -> bool {
        match self {
            Keep::Outside => side != Side::Inside,
            Keep::Inside => side != Side::Outside,
            Keep::All => true,
        }
    }
}

/// An axis-aligned box with a spacing of its own.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxSpec {
    /// The minimum corner.
    pub min: [f64; 3],
    /// The maximum corner.
    pub max: [f64; 3],
    /// The edge length that no cell in the box exceeds.
    pub spacing: f64,
}
