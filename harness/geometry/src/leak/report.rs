//! The answer as data; JSON of the schema `octree-leak/3` when serialised. Lengths are in the user's units.
//!
//! Its invariants are in [`super::invariants`].

use super::ends::Target;
use contract::lattice::Root;
use serde::Serialize;

/// Name and version of the JSON form.
pub const SCHEMA: &str = "octree-leak/3";

/// A surface level and its spacing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spacing {
    /// Level of the cells at the surface.
    pub level: u8,
    /// Their edge length.
    pub spacing: f64,
}

impl Spacing {
    /// The spacing of a level.
    pub fn of(level: u8, root: &Root) -> Self {
        Self { level, spacing: root.edge / f64::from(1u32 << level) }
    }
}

/// A base tree that was searched.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Meshed {
    /// Its surface level and spacing.
    #[serde(flatten)]
    pub spacing: Spacing,
    /// Number of its leaves.
    pub leaves: u64,
    /// Whether free leaves join the ends.
    pub is_joined: bool,
    /// Why not, if an end is in a crossing leaf.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<&'static str>,
}

/// A point of a path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Point {
    /// The point.
    pub at: [f64; 3],
    /// Diameter of the largest ball centred there that no facet enters.
    pub width: f64,
}

/// The narrowest place of a path.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Narrowest {
    /// Centre of the largest ball that passes on this path.
    pub at: [f64; 3],
    /// Its diameter, to 1 %.
    pub width: f64,
    /// A ball of this diameter passes on this path.
    pub width_min: f64,
    /// No ball of a greater diameter passes on any path.
    pub width_max: f64,
    /// `width` in cells of the case's surface level.
    pub width_cells: f64,
    /// The facets at the rim, which the ball touches to within 5 % of its radius, by number from 0; nearest first.
    pub facets: Vec<u32>,
    /// Index among the points of the path.
    pub index: usize,
    /// Whether an end of the path is no more than 5 % wider, so that it is no opening: the widest place near the start or the end.
    pub is_end: bool,
}

/// The widest path.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Passage {
    /// The base tree through whose free leaves it leads.
    #[serde(flatten)]
    pub spacing: Spacing,
    /// The narrowest place.
    pub narrowest: Narrowest,
    /// Indices of the first and the last point between which the width counts: the path leads away from the facets near its ends.
    pub inner: (usize, usize),
    /// The points, from the start to the end.
    pub points: Vec<Point>,
}

/// The answer for two places.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The start.
    pub from: [f64; 3],
    /// The end.
    pub to: Target,
    /// The case's surface level and spacing.
    #[serde(flatten)]
    pub spacing: Spacing,
    /// Whether free leaves of the case's base tree join the ends.
    pub is_leak: bool,
    /// The coarser level, the nearest to the case's, whose base tree does not join the ends.
    pub closes: Option<Spacing>,
    /// The finer level, the nearest to the case's, whose base tree joins the ends.
    pub opens: Option<Spacing>,
    /// Whether the facets are proven to form a closed surface between the ends, so that no spacing joins them. Not examined if
    /// there is a leak.
    pub is_separated: bool,
    /// The limit at which refinement ended without joining the ends.
    pub limit: Option<String>,
    /// The widest path, at the case's level or a coarser one that joins the ends; if none does, at the level that opens.
    pub passage: Option<Passage>,
    /// Every base tree that was searched, in this order.
    pub levels: Vec<Meshed>,
}

/// The answers for one case.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Answers {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Name of the case.
    pub case: String,
    /// Number of facets.
    pub facets: u64,
    /// The root cube.
    pub root: Root,
    /// The answers.
    pub examined: Vec<Report>,
}
