//! The pictures of the paper, made of any case: the algorithm from the base mesh to the final mesh.
//!
//! The paper's Figures 1 to 16 are pictures of its method and of its meshes; Figures 17 to 23 are diagrams, which
//! [`crate::benchmark`] makes. The pictures are numbered in the order of the algorithm, and the page names their counterparts.

use self::Made::{Base, Final, Layers, WithoutCrossing};
use self::Part::{Around, BaseMesh, CloseUp, Root, View};
use super::Request;
use super::colour::Colour::{self, Level, Rank, Side};
use contract::case::Case;
use contract::lattice::UNITS_PER_EDGE;
use contract::octant::{LEVEL_MAX, UNITS_PER_CELL};
use export::selection::{Selection, Slice};
use maud::html;

/// Ranks that make the meshes.
pub const RANKS: usize = 16;
/// Levels between the base mesh, whose leaves are assigned to ranks, and the surface.
const LEVELS_ABOVE_SURFACE: u8 = 5;
/// Edge of a close-up, in cells at the surface.
const CLOSE_UP_CELLS: i64 = 48;

/// A mesh of the case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Made {
    /// The base tree.
    Base,
    /// The final mesh of the case.
    Final,
    /// The final mesh with this number of layer cells.
    Layers(u32),
    /// The final mesh without crossing leaves.
    WithoutCrossing,
}

/// The part of the mesh in a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// All of the slice.
    Root,
    /// The wider surroundings of the body, with leaves merged to the level of the base mesh.
    BaseMesh,
    /// The surroundings of the body.
    Around,
    /// A few cells around the foremost vertex of the body.
    CloseUp,
    /// The surroundings of the body in three dimensions.
    View,
}

/// A picture of the set: the name of its file, the mesh, the part of it, the colours, and one sentence on what it shows.
pub type Member = (&'static str, Made, Part, Colour, &'static str);

/// The pictures, in the order of the algorithm.
pub const MEMBERS: [Member; 12] = [
    ("01-base-mesh", Base, BaseMesh, Level, "The base mesh, whose leaves are assigned to ranks."),
    ("02-base-partition", Base, BaseMesh, Rank, "Its partition: intervals of the Morton curve."),
    ("03-refinement", Base, Around, Level, "The base tree after refinement, not yet balanced."),
    ("04-sides", Base, Around, Side, "Crossing leaves, and components outside and inside."),
    ("05-balance", Layers(1), Around, Level, "n = 1: 2:1 balance alone (the paper's 4:1 rule)."),
    ("06-layers-4", Layers(4), Around, Level, "Layers of at least n = 4 cells."),
    ("07-layers-10", Layers(10), Around, Level, "Layers of at least n = 10 cells."),
    ("08-mesh", Final, Root, Level, "The final mesh, up to the far field."),
    ("09-partition", Final, Around, Rank, "The partition of the final mesh."),
    ("10-view", Final, View, Level, "The final mesh in a slice through the geometry."),
    ("11-close-up", Final, CloseUp, Level, "The final mesh at the foremost vertex."),
    (
        "12-without-crossing",
        WithoutCrossing,
        CloseUp,
        Level,
        "The gap that a near-body mesh fills.",
    ),
];

/// What a picture of a case shows.
pub fn request(part: Part, colour: Colour, case: &Case) -> Request<'_> {
    let zoom = |extents: f64| super::zoom_to(&case.root, Some(&case.facets), extents);
    let level_base = case.level_surface.saturating_sub(LEVELS_ABOVE_SURFACE).max(2);
    let whole = Request {
        selection: Selection::default(),
        body: Some(&case.facets),
        colour,
        zoom: 1.0,
        level_max: LEVEL_MAX,
        view: false,
    };
    match part {
        Root => whole,
        BaseMesh => Request { zoom: zoom(4.0), level_max: level_base, ..whole },
        Around => Request { zoom: zoom(1.5), ..whole },
        View => Request { view: true, ..whole },
        CloseUp => Request { selection: close_up(case), ..whole },
    }
}

/// A cube around the foremost vertex, and the slice through that vertex.
fn close_up(case: &Case) -> Selection {
    let vertices = case.facets_lattice.iter().flatten();
    let inside = vertices.filter(|v| v.iter().all(|c| (0..UNITS_PER_EDGE).contains(c)));
    let centre = inside.min().copied().unwrap_or([UNITS_PER_EDGE / 2; 3]);
    let edge = ((UNITS_PER_EDGE >> case.level_surface) * CLOSE_UP_CELLS)
        .clamp(UNITS_PER_CELL, UNITS_PER_EDGE);
    let corner = centre.map(|c| (c - edge / 2).clamp(0, UNITS_PER_EDGE - edge));
    let axis = super::middle(&case.root, Some(&case.facets)).axis;
    Selection {
        clip: Some([corner, corner.map(|c| c + edge)]),
        slice: Some(Slice { axis, at: centre[axis] }),
        ..Selection::default()
    }
}

/// The page with all pictures and their SVG documents, which needs no other file; `case` is the name of the case.
pub fn page(case: &str, pictures: &[(Member, String)]) -> String {
    let content = html! {
        p {
            "The method and its meshes in pictures, from the base mesh to the final mesh, for the case " code { (case) }
            " on " (RANKS) " simulated ranks, in the order of the algorithm. Counterparts in the paper are Figures 3 (base mesh), 4 (balance), 5, 9 and 10 "
            "(layers), 11 and 12 (partition), and 13 (gap)."
        }
        @for ((name, .., caption), svg) in pictures {
            (crate::page::figure(name, name, svg, &html! { (caption) " " a href={ (name) ".svg" } { "SVG" } "." }))
        }
    };
    crate::page::page(&format!("Pictures of {case}"), &content)
}
