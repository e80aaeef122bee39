//! The pictures of the paper, made of any case: the algorithm from the geometry to the final mesh.
//!
//! The paper's Figures 1 to 16 are pictures of its method and of its meshes; Figures 17 to 23 are diagrams, which
//! [`crate::benchmark`] makes. The pictures are numbered in the order of the algorithm. Which of them has which number in
//! the paper is not known here, so the names state what is shown.

use super::colour::Colour;
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

/// A picture of the set.
#[derive(Clone, Copy, Debug)]
pub struct Member {
    /// Name of its files.
    pub name: &'static str,
    /// The mesh.
    pub made: Made,
    /// The part of it.
    pub part: Part,
    /// The colours.
    pub colour: Colour,
    /// One sentence on what it shows.
    pub caption: &'static str,
}

const fn member(
    name: &'static str,
    made: Made,
    part: Part,
    colour: Colour,
    caption: &'static str,
) -> Member {
    Member { name, made, part, colour, caption }
}

/// The pictures, in the order of the algorithm.
pub const MEMBERS: [Member; 16] = [
    member("01-geometry", Made::Base, Part::ViewOfBody, Colour::Level, "The geometry."),
    member(
        "02-base-mesh",
        Made::Base,
        Part::BaseMesh,
        Colour::Level,
        "The base mesh: the base tree, cut five levels above the surface level. Its leaves are what the partition assigns to ranks.",
    ),
    member(
        "03-base-partition",
        Made::Base,
        Part::BaseMesh,
        Colour::Rank,
        "The partition of the base mesh: every rank has an interval of the Morton curve.",
    ),
    member(
        "04-surface-partition",
        Made::Base,
        Part::View,
        Colour::Rank,
        "The partition on the surface of the geometry and in a slice of the base tree.",
    ),
    member(
        "05-refinement",
        Made::Base,
        Part::Body,
        Colour::Level,
        "The base tree after refinement: every leaf that the geometry crosses has the surface level. Nothing is balanced yet.",
    ),
    member(
        "06-sides",
        Made::Base,
        Part::Body,
        Colour::Side,
        "Crossing leaves, and the components outside and inside, before the inside is deleted.",
    ),
    member(
        "07-sides-close-up",
        Made::Base,
        Part::CloseUp,
        Colour::Side,
        "Close-up of the same leaves at the foremost vertex of the geometry.",
    ),
    member(
        "08-balance",
        Made::Layers(1),
        Part::Body,
        Colour::Level,
        "n = 1: the 2:1 balance alone (the paper's 4:1 rule). The inside is deleted.",
    ),
    member(
        "09-layers-2",
        Made::Layers(2),
        Part::Body,
        Colour::Level,
        "Layers of at least n = 2 cells.",
    ),
    member(
        "10-layers-4",
        Made::Layers(4),
        Part::Body,
        Colour::Level,
        "Layers of at least n = 4 cells.",
    ),
    member(
        "11-layers-10",
        Made::Layers(10),
        Part::Body,
        Colour::Level,
        "Layers of at least n = 10 cells.",
    ),
    member(
        "12-mesh",
        Made::Final,
        Part::Root,
        Colour::Level,
        "The final mesh of the case, up to the far field.",
    ),
    member(
        "13-mesh-close-up",
        Made::Final,
        Part::CloseUp,
        Colour::Spacing,
        "Close-up of the final mesh at the foremost vertex of the geometry.",
    ),
    member(
        "14-without-crossing",
        Made::WithoutCrossing,
        Part::CloseUp,
        Colour::Spacing,
        "The same place of the mesh without crossing leaves: the gap that a near-body mesh fills.",
    ),
    member(
        "15-partition",
        Made::Final,
        Part::Body,
        Colour::Rank,
        "The partition of the final mesh.",
    ),
    member(
        "16-mesh-view",
        Made::Final,
        Part::View,
        Colour::Level,
        "The final mesh in a slice through the geometry.",
    ),
];

/// Leaves, window and deepest level of a slice: selection, zoom and level, as a request has them.
pub fn request(part: Part, case: &Case) -> (Selection, f64, u8) {
    let [low, high] = super::extent(&case.root, Some(&case.facets));
    let longest = (0..3).map(|a| high[a] - low[a]).fold(f64::MIN_POSITIVE, f64::max);
    let window = |extents: f64| (case.root.edge / (extents * longest)).max(1.0);
    let level_base = case.level_surface.saturating_sub(LEVELS_ABOVE_SURFACE).max(2);
    match part {
        Part::Root | Part::View => (Selection::default(), 1.0, LEVEL_MAX),
        Part::BaseMesh => (Selection::default(), window(AROUND_BASE_MESH), level_base),
        Part::Body => (Selection::default(), window(AROUND), LEVEL_MAX),
        Part::ViewOfBody => (Selection::default(), window(1.1), LEVEL_MAX),
        Part::CloseUp => (close_up(case), 1.0, LEVEL_MAX),
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
            " on " (RANKS) " simulated ranks: what the paper's Figures 1 to 16 show of its own geometry. The order is that of the algorithm; "
            "the names state what is shown, because the paper's own numbers are not known here. The files beside this page have the "
            "pictures as SVG and PGF/TikZ, their data as CSV, and the views as HTML, which a mouse turns."
        }
        p { "Made by " code { (command) } "." }
        @for (member, drawn) in pictures {
            @let caption = caption(member, drawn);
            (figure(member, drawn, &caption))
        }
    };
    crate::page::page(&format!("Pictures of {case}"), &content)
}

fn caption(member: &Member, drawn: &Drawn) -> Markup {
    let name = member.name;
    html! {
        (member.caption) " "
        @match drawn {
            Drawn::Slice(_) => { a href=(format!("{name}.svg")) { "SVG" } ", " a href=(format!("{name}.tex")) { "TikZ" } ", " a href=(format!("{name}.csv")) { "data" } }
            Drawn::View(_) => { a href=(format!("{name}.html")) { "Turn it in a browser" } }
        }
        "."
    }
}

fn figure(member: &Member, drawn: &Drawn, caption: &Markup) -> Markup {
    use base64::Engine;
    let drawing = match drawn {
        Drawn::Slice(svg) => svg.clone(),
        Drawn::View(None) => {
            let text = html! { p { "pyvista, which draws views, is missing; the HTML file needs no other program." } };
            text.into_string()
        }
        Drawn::View(Some(png)) => {
            let data = base64::prelude::BASE64_STANDARD.encode(png);
            let image = html! { img src=(format!("data:image/png;base64,{data}")) alt=(member.caption) style="width: 100%"; };
            image.into_string()
        }
    };
    crate::page::figure(member.name, member.name, &PreEscaped(drawing).0, caption)
}
