//! The answer as data; JSON of the schema `octree-leak/4` when serialised. Lengths are in the user's units.
//!
//! Its invariants are in [`super::invariants`].

use super::ends::Target;
use contract::lattice::Root;
use serde::Serialize;

/// Name and version of the JSON form.
pub const SCHEMA: &str = "octree-leak/4";

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

/// The coarser base tree that does not join the ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Closes {
    /// Its surface level and spacing.
    #[serde(flatten)]
    pub spacing: Spacing,
    /// Whether facets cross the leaf of an end there.
    pub is_end_crossed: bool,
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
    pub closes: Option<Closes>,
    /// The widest path if there is a leak, at the case's level or a coarser one that joins the ends.
    pub passage: Option<Passage>,
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
