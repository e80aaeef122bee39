//! The pictures of the paper, made of any case: the algorithm from the geometry to the final mesh.
//!
//! The paper's Figures 1 to 16 are pictures of its method and of its meshes; Figures 17 to 23 are diagrams, which
//! [`crate::benchmark`] makes. The pictures are numbered in the order of the algorithm, and the page names their counterparts.

use self::Made::{Base, Final, Layers, WithoutCrossing};
use self::Part::{BaseMesh, Body, CloseUp, Root, View, ViewOfBody};
use super::colour::Colour::{self, Level, Rank, Side, Spacing};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use contract::case::Case;
use contract::lattice::UNITS_PER_EDGE;
use contract::octant::{LEVEL_MAX, UNITS_PER_CELL};
use export::selection::{Selection, Slice};
use maud::{Markup, PreEscaped, html};

/// Ranks that make the meshes.
pub const RANKS: usize = 16;
/// Levels between the base mesh, whose leaves are assigned to ranks, and the surface.
const LEVELS_ABOVE_SURFACE: u8 = 5;
/// Edge of a close-up, in cells at the surface.
const CLOSE_UP_CELLS: i64 = 48;
/// Edge of the window around the body, in its longest extents.
const AROUND: f64 = 1.5;
/// Edge of the window around the base mesh, in longest extents of the body.
const AROUND_BASE_MESH: f64 = 4.0;

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
    Body,
    /// A few cells around the foremost vertex of the body.
    CloseUp,
    /// A view in three dimensions.
    View,
    /// A view of the body alone.
    ViewOfBody,
}

/// A picture of the set: the name of its files, the mesh, the part of it, the colours, and one sentence on what it shows.
pub type Member = (&'static str, Made, Part, Colour, &'static str);

/// The pictures, in the order of the algorithm.
pub const MEMBERS: [Member; 16] = [
    ("01-geometry", Base, ViewOfBody, Level, "The geometry."),
    ("02-base-mesh", Base, BaseMesh, Level, "The base mesh, whose leaves are assigned to ranks."),
    ("03-base-partition", Base, BaseMesh, Rank, "Its partition: intervals of the Morton curve."),
    ("04-surface-partition", Base, View, Rank, "The partition on the surface and in a slice."),
    ("05-refinement", Base, Body, Level, "The base tree after refinement, not yet balanced."),
    ("06-sides", Base, Body, Side, "Crossing leaves, and components outside and inside."),
    ("07-sides-close-up", Base, CloseUp, Side, "The same at the foremost vertex."),
    ("08-balance", Layers(1), Body, Level, "n = 1: 2:1 balance alone (the paper's 4:1 rule)."),
    ("09-layers-2", Layers(2), Body, Level, "Layers of at least n = 2 cells."),
    ("10-layers-4", Layers(4), Body, Level, "Layers of at least n = 4 cells."),
    ("11-layers-10", Layers(10), Body, Level, "Layers of at least n = 10 cells."),
    ("12-mesh", Final, Root, Level, "The final mesh, up to the far field."),
    ("13-mesh-close-up", Final, CloseUp, Spacing, "The final mesh at the foremost vertex."),
    (
        "14-without-crossing",
        WithoutCrossing,
        CloseUp,
        Spacing,
        "The gap that a near-body mesh fills.",
    ),
    ("15-partition", Final, Body, Rank, "The partition of the final mesh."),
    ("16-mesh-view", Final, View, Level, "The final mesh in a slice through the geometry."),
];

/// Leaves, window and deepest level of a slice: selection, zoom and level, as a request has them.
pub fn request(part: Part, case: &Case) -> (Selection, f64, u8) {
    let [low, high] = super::extent(&case.root, Some(&case.facets));
    let longest = (0..3).map(|a| high[a] - low[a]).fold(f64::MIN_POSITIVE, f64::max);
    let window = |extents: f64| (case.root.edge / (extents * longest)).max(1.0);
    let level_base = case.level_surface.saturating_sub(LEVELS_ABOVE_SURFACE).max(2);
    match part {
        Root | View => (Selection::default(), 1.0, LEVEL_MAX),
        BaseMesh => (Selection::default(), window(AROUND_BASE_MESH), level_base),
        Body => (Selection::default(), window(AROUND), LEVEL_MAX),
        ViewOfBody => (Selection::default(), window(1.1), LEVEL_MAX),
        CloseUp => (close_up(case), 1.0, LEVEL_MAX),
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

/// A picture as part of the page.
pub enum Drawn {
    /// A slice as SVG.
    Slice(String),
    /// A view as PNG, if it could be drawn.
    View(Option<Vec<u8>>),
}

/// The page with all pictures, which needs no other file; `case` is the name of the case.
pub fn page(case: &str, command: &str, pictures: &[(Member, Drawn)]) -> String {
    let content = html! {
        p {
            "The method and its meshes in pictures, from the geometry to the final mesh, for the case " code { (case) }
            " on " (RANKS) " simulated ranks, in the order of the algorithm. Counterparts in the paper are Figures 3 (base mesh), 4 (balance), 5, 9 and 10 "
            "(layers), 11 and 12 (partition), and 13 (gap). The files beside this page have the "
            "pictures as SVG, and the views as HTML, which a mouse turns."
        }
        p { "Made by " code { (command) } "." }
        @for ((name, .., caption), drawn) in pictures { (figure(name, caption, drawn)) }
    };
    crate::page::page(&format!("Pictures of {case}"), &content)
}

fn figure(name: &str, caption: &str, drawn: &Drawn) -> Markup {
    let link = |extension: &str, text: &str| html! { a href={ (name) "." (extension) } { (text) } };
    let (drawing, links) = match drawn {
        Drawn::Slice(svg) => (PreEscaped(svg.clone()), link("svg", "SVG")),
        Drawn::View(png) => {
            let drawing = html! {
                @if let Some(png) = png {
                    img src={ "data:image/png;base64," (BASE64_STANDARD.encode(png)) } alt=(caption) style="width: 100%";
                } @else {
                    p { "pyvista, which draws views, is missing; the HTML file needs no other program." }
                }
            };
            (drawing, link("html", "Turn it in a browser"))
        }
    };
    crate::page::figure(name, name, &drawing.0, &html! { (caption) " " (links) "." })
}
