//! Pictures of meshes: a slice with the section of the body.
//!
//! [`Picture`] is the data of a picture: the squares in which a plane cuts leaves, the body, and the window. Reading takes time in
//! proportion to the slice, and no picture has more squares than can be shown.

pub mod colour;
mod squares;
#[cfg(test)]
mod tests;

use colour::{Colour, Key};
use contract::case::Facet;
use contract::failure::{Failure, Result};
use contract::lattice::{Root, UNITS_PER_EDGE};
use contract::manifest::Sides;
use contract::mesh::Mesh;
use contract::octant::UNITS_PER_CELL;
use export::selection::{Selection, Slice};
use geometry::tree::{Aabb, Point, bounds};
use squares::{SQUARES_MAX, Square, Squares};

pub use crate::figure::format::format_of;
use crate::figure::map::{Fill, MAP_HEIGHT_MAX, Map};
use crate::figure::{Axis, Figure, svg};

/// A point in a plane: to the right, and upwards.
type Planar = [f64; 2];

/// What a picture shows.
pub struct Request<'a> {
    /// The leaves. Without a slice, the middle one is taken; the window is that of the clip box, if there is one.
    pub selection: Selection,
    /// The body whose section is drawn, if it is known.
    pub body: Option<&'a [Facet]>,
    /// The quantity that colours show.
    pub colour: Colour,
    /// Edge of the root in edges of the window, which is centred on the body. Without effect on a clip box.
    pub zoom: f64,
}

/// The data of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    root: Root,
    slice: Slice,
    colour: Colour,
    /// Minimum and maximum corner of what is shown, in the plane and in the user's units.
    window: [Planar; 2],
    squares: Squares,
    /// The key to their values.
    key: Key,
    /// The segments in which the plane cuts the body, if it is known, in the plane and in the user's units.
    section: Option<Vec<[Planar; 2]>>,
}

/// Units of the page that a map may take: its width, but for labels, and its greatest height.
const PAGE: [f64; 2] = [1360.0, MAP_HEIGHT_MAX];
/// Why a picture would be empty.
const NO_LEAF: &str = "no leaf of the selection is in a slice: give another --slice, a larger --clip or a smaller --zoom";

/// The plane normal to the shortest extent of the body that halves the area of its facets, each at its centroid; without a body, normal to z through the root's
/// centre. A plane through the middle of the bounding box would miss the wings of an aircraft with a tail. One beyond the clip box is
/// replaced by that through the box's centre.
fn middle(root: &Root, body: Option<&[Facet]>, clip: Option<[[i64; 3]; 2]>) -> Slice {
    let extent = extent(root, body);
    let lengths = extent.extents();
    // Of equal extents the last one, so that a cube is seen from above. A plane within a flat body has no section.
    let axes = (0..3).rev().filter(|&a| lengths[a] > 0.0);
    let axis = axes.min_by(|&a, &b| lengths[a].total_cmp(&lengths[b])).unwrap_or(2);
    let middle = body.and_then(|facets| median(facets, axis));
    let middle = middle.unwrap_or(extent.center()[axis]);
    // A thousandth of the extent is not visible, and a short coordinate can be entered again.
    let step = 10f64.powf(lengths[axis].log10().floor() - 3.0);
    let middle = if step > 0.0 { (middle / step).round() * step } else { middle };
    let within = middle.clamp(root.origin[axis], root.origin[axis] + root.edge);
    let clip = clip.map(|clip| clip.map(|corner| root.to_user(corner)[axis]));
    let beyond = clip.filter(|[low, high]| within < *low || within > *high);
    let within = beyond.map_or(within, |[low, high]| (low + high) / 2.0);
    Slice::new(root, axis, within).expect("a coordinate in the root")
}

/// The median of the facets' centroids along an axis, weighted with their areas; `None` without area.
fn median(facets: &[Facet], axis: usize) -> Option<f64> {
    let weighed = |facet: &Facet| {
        let [a, b, c] = facet.map(|v| Point::from_array(v.map(f64::from)));
        ((a[axis] + b[axis] + c[axis]) / 3.0, (b - a).cross(c - a).length())
    };
    let mut facets: Vec<(f64, f64)> = facets.iter().map(weighed).collect();
    facets.sort_unstable_by(|p, q| p.0.total_cmp(&q.0));
    let mut total = 0.0;
    let add = |facet: &(f64, f64)| {
        total += facet.1;
        total
    };
    let sums: Vec<f64> = facets.iter().map(add).collect();
    // The mean of the lower and the upper median, up to rounding.
    let reaching = |part: f64| facets.get(sums.partition_point(|sum| *sum < part * total));
    (total > 0.0).then_some((reaching(0.5 - 1e-9)?.0 + reaching(0.5 + 1e-9)?.0) / 2.0)
}

/// The bounding box of the body, or the root.
fn extent(root: &Root, body: Option<&[Facet]>) -> Aabb {
    let origin = Point::from(root.origin);
    let whole = Aabb::new(origin, origin + Point::splat(root.edge));
    body.filter(|facets| !facets.is_empty()).map_or(whole, bounds)
}

/// The cube of the window, moved into the root, on the lattice.
fn zoomed(root: &Root, body: Option<&[Facet]>, zoom: f64) -> [[i64; 3]; 2] {
    let edge = ((UNITS_PER_EDGE as f64 / zoom) as i64).clamp(UNITS_PER_CELL, UNITS_PER_EDGE);
    let centre = root.quantise_clamped(extent(root, body).center().to_array());
    let corner = centre.map(|c| (c - edge / 2).clamp(0, UNITS_PER_EDGE - edge));
    [corner, corner.map(|c| c + edge)]
}

impl Picture {
    /// Reads what the picture shows.
    ///
    /// # Errors
    /// If the mesh cannot be read, or the picture would be empty.
    pub fn collect(mesh: &Mesh, request: &Request) -> Result<Self> {
        let (root, colour) = (mesh.manifest.root, request.colour);
        let is_known = colour != Colour::Side || mesh.manifest.sides == Sides::Known;
        Failure::unless(is_known, "the sides of this mesh are unknown: choose another colour")?;
        if colour == Colour::Rank {
            mesh.require_ranks()?;
        }
        let (clip, slice) = (request.selection.clip, request.selection.slice);
        let slice = slice.unwrap_or_else(|| middle(&root, request.body, clip));
        let (axes, a) = (plane_axes(slice.axis), slice.axis);
        let is_within = clip.is_none_or(|[low, high]| (low[a]..=high[a]).contains(&slice.at));
        Failure::unless(is_within, NO_LEAF)?;
        let clip = clip.unwrap_or_else(|| {
            let mut cube = zoomed(&root, request.body, request.zoom);
            // The plane need not be in the cube.
            (cube[0][a], cube[1][a]) = (0, UNITS_PER_EDGE);
            cube
        });
        let window = clip.map(|corner| axes.map(|a| root.to_user(corner)[a]));
        let why =
            "the clip box has no area in the plane of the slice within the root: give another one";
        Failure::unless((0..2).all(|i| window[0][i] < window[1][i]), why)?;
        let section = request.body.map(|facets| section(&root, slice, &window, facets));
        let part = Selection { slice: Some(slice), clip: Some(clip), ..request.selection.clone() };
        let scales = [0, 1].map(|i| PAGE[i] / (window[1][i] - window[0][i]));
        let levels = squares::deepest(root.edge * scales[0].min(scales[1]));
        let squares = Squares::collect(mesh, &part, colour, levels, SQUARES_MAX)?;
        let why = if mesh.manifest.leaves == 0 { "the mesh has no leaves" } else { NO_LEAF };
        Failure::unless(!squares.squares.is_empty(), why)?;
        let key = colour.key(&squares.squares.iter().map(|s| s.value).collect());
        let picture = Self { root, slice, colour, window, squares, key, section };
        picture.check_invariants();
        Ok(picture)
    }

    /// Asserts that the window is in the root, that every square is in it and has a colour, and that the section lies in the window.
    fn check_invariants(&self) {
        let (root, [low, high]) = (&self.root, self.window);
        let (slack, axes) = (root.edge * 1e-6, plane_axes(self.slice.axis));
        for (i, a) in axes.into_iter().enumerate() {
            let (from, until) = (root.origin[a] - slack, root.origin[a] + root.edge + slack);
            let is_inside = from <= low[i] && low[i] < high[i] && high[i] <= until;
            assert!(is_inside, "the window {:?} is not within the root", self.window);
        }
        for square in &self.squares.squares {
            let [from, to] = self.corners(square);
            let is_shown = |i: usize| from[i] < high[i] + slack && to[i] > low[i] - slack;
            assert!((0..2).all(is_shown), "{square:?} is outside of {:?}", self.window);
            assert!(self.key.contains_key(&square.value), "{square:?} has no colour");
        }
        let is_in = |p: &Planar| (0..2).all(|i| (low[i] - slack..=high[i] + slack).contains(&p[i]));
        let beyond = self.section.iter().flatten().flatten().find(|p| !is_in(p));
        assert!(beyond.is_none(), "the section leaves {:?} at {beyond:?}", self.window);
    }

    /// The picture as an SVG document.
    pub fn svg(&self) -> String {
        let axis = |i: usize| {
            let range = Some((self.window[0][i], self.window[1][i]));
            Axis { range, ..Axis::linear(["x", "y", "z"][plane_axes(self.slice.axis)[i]]) }
        };
        // Where there is no leaf, the page is white, on a dark one too: the colours are chosen for it.
        let cells = vec![self.window];
        let mut fills = vec![Fill { colour: [255; 3], is_outlined: false, cells }];
        // Outlined squares are last, so that no fill covers half of an outline.
        for is_outlined in [false, true] {
            fills.extend(self.key.keys().map(|value| self.fill(*value, is_outlined)));
        }
        fills.retain(|fill| !fill.cells.is_empty());
        let (key, title) = self.colour.legend(&self.key);
        let (plane, Squares { leaves, squares, .. }) = (self.plane_name(), &self.squares);
        let merged = if *leaves > squares.len() as u64 { ", the smallest merged" } else { "" };
        let caption = format!("{plane}; cells in the plane: {leaves}{merged}");
        let map = Some(Map { title, key, fills, section: self.section.clone(), caption });
        let [x, y] = [axis(0), axis(1)];
        svg::svg(&Figure { title: self.title(), x, y, map, ..Figure::default() })
    }

    /// The visible parts of the squares of one value, with or without outlines.
    fn fill(&self, value: u32, is_outlined: bool) -> Fill {
        let is_shown = |s: &&Square| {
            s.value == value && (s.level <= self.squares.level_outlined) == is_outlined
        };
        let visible = |square: &Square| {
            let within =
                |at: Planar| [0, 1].map(|i| at[i].clamp(self.window[0][i], self.window[1][i]));
            let [low, high] = self.corners(square).map(within);
            (low[0] < high[0] && low[1] < high[1]).then_some([low, high])
        };
        let cells = self.squares.squares.iter().filter(is_shown).filter_map(visible).collect();
        Fill { colour: self.key[&value].1, is_outlined, cells }
    }

    /// One sentence on what the picture shows.
    pub fn title(&self) -> String {
        let (plane, cells) = (self.plane_name(), self.squares.leaves);
        format!("Slice {plane} of a mesh, {cells} cells by {}", self.colour.name())
    }

    /// The minimum and the maximum corner of a square.
    fn corners(&self, square: &Square) -> [Planar; 2] {
        let axes = plane_axes(self.slice.axis);
        [0, square.edge()].map(|beyond| {
            let at = |i: usize| i64::from(square.corner[i] + beyond) * UNITS_PER_CELL;
            [0, 1].map(|i| self.root.to_user([at(i); 3])[axes[i]])
        })
    }

    /// The plane as in `z = 0.5`, to the digits that the lattice resolves.
    fn plane_name(&self) -> String {
        let at = self.root.to_user([self.slice.at; 3])[self.slice.axis];
        let resolved = (self.root.edge / UNITS_PER_EDGE as f64).log10().ceil() as i32;
        let decimals = usize::try_from(-resolved).unwrap_or(0);
        // Parsing removes the zeros at the end, and adding zero turns -0 into 0.
        let shown = format!("{at:.decimals$}").parse().unwrap_or(at) + 0.0;
        format!("{} = {shown}", ["x", "y", "z"][self.slice.axis])
    }
}

/// The two axes of a plane normal to `axis`: first to the right, then upwards.
fn plane_axes(axis: usize) -> [usize; 2] {
    [[1, 2], [0, 2], [0, 1]][axis]
}

/// The segments in which the plane cuts the facets. The plane is moved into the layer of leaves that it cuts, so that
/// facets in the plane of a leaf's face do not vanish or appear twice.
fn section(root: &Root, slice: Slice, window: &[Planar; 2], facets: &[Facet]) -> Vec<[Planar; 2]> {
    let (axis, axes) = (slice.axis, plane_axes(slice.axis));
    let layer = i64::from(slice.layer()) * UNITS_PER_CELL;
    let at = if slice.at == layer { layer + UNITS_PER_CELL / 2 } else { slice.at };
    let plane = root.to_user([at; 3])[axis];
    let corner = |end: usize, beyond: f64| {
        let mut corner = [plane + beyond; 3];
        axes.iter().zip(window[end]).for_each(|(&a, coordinate)| corner[a] = coordinate);
        Point::from_array(corner)
    };
    let bounds = Aabb::new(corner(0, -root.edge), corner(1, root.edge));
    let cut = |facet: &Facet| {
        let [a, b, c] = facet.map(|v| Point::from_array(v.map(f64::from)));
        let mut ends = [(a, b), (b, c), (c, a)].into_iter().filter_map(|(p, q)| {
            let is_cut = (p[axis] < plane) != (q[axis] < plane);
            is_cut.then(|| p + (q - p) * ((plane - p[axis]) / (q[axis] - p[axis])))
        });
        let (from, to) = (ends.next()?, ends.next()?);
        // `clip_segment` returns a part of the line where the line meets the box beyond the segment.
        let (enters, leaves) = bounds.clip_line_parameters(from, to - from)?;
        let ends = [enters.max(0.0), leaves.min(1.0)];
        (ends[0] <= ends[1]).then(|| ends.map(|t| axes.map(|a| from[a] + (to - from)[a] * t)))
    };
    facets.iter().filter_map(cut).collect()
}
