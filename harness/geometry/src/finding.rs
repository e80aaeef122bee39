//! The findings of a diagnosis: kinds, counts and places.

use serde::Serialize;

/// Kinds of findings, in the order of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Connected sets of edges with one facet, apart from T-junctions.
    Openings,
    /// Edges with three, five, ... facets.
    NonManifoldOdd,
    /// Pairs of facets that traverse their common edge, which has no other facet, in the same direction.
    Winding,
    /// Closed shells of consistent winding that enclose a negative volume, and cannot lie in another closed shell.
    InsideOut,
    /// Closed shells of consistent winding that enclose a negative volume, within the bounding box of another closed shell; and other
    /// closed shells that lie in an odd number of closed ones.
    Nested,
    /// Facets with the three vertices of an earlier facet, in any order.
    Duplicates,
    /// Pairs of facets whose interiors share a point on the lattice; duplicates are not among them.
    Intersections,
    /// Facets with an opposite facet less than one cell away, on the inner side, but not of another solid; by rays.
    ThinWalls,
    /// Facets with an opposite facet less than one cell away, on the outer side.
    ThinGaps,
    /// Facets with a point beyond the root.
    OutsideRoot,
    /// Facets within the root with a point on its boundary.
    TouchingRoot,
}

/// The place of a finding.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Place {
    /// Facets by number, counting from 0, at most [`Place::FACETS_MAX`].
    pub facets: Vec<u32>,
    /// A point nearby, in the user's units.
    pub at: [f64; 3],
    /// Openings: free width; thin walls and gaps: distance of the facets, which a twentieth of their area undercuts. In the user's units.
    pub width: Option<f64>,
}

impl Place {
    /// Maximum number of facets listed for one place.
    pub const FACETS_MAX: usize = 8;

    /// A place without sizes.
    pub fn new(facets: Vec<u32>, at: [f64; 3]) -> Self {
        Self { facets, at, ..Self::default() }
    }
}

/// All findings of one kind.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// The kind.
    pub kind: Kind,
    /// Number of occurrences.
    pub count: u64,
    /// Number of occurrences that can change the mesh's region.
    pub count_changing: u64,
    /// Whether the search ended before all were counted, so that `count` is a lower bound.
    pub is_lower_bound: bool,
    /// The effect on the mesh; empty where nothing was found.
    pub meaning: String,
    /// The first places: widest openings, one of a sheet, deep before shallow intersections, lowest facet numbers.
    pub places: Vec<Place>,
}

impl Finding {
    /// A finding that has not occurred yet.
    pub fn new(kind: Kind) -> Self {
        let (meaning, places) = (String::new(), Vec::new());
        Self { kind, count: 0, count_changing: 0, is_lower_bound: false, meaning, places }
    }

    /// Counts one occurrence and lists its place if it is among the first.
    pub fn add(&mut self, first: usize, place: impl FnOnce() -> Place) {
        self.count += 1;
        if self.places.len() < first {
            self.places.push(place());
        }
    }
}
