//! Pictures of meshes: slices as SVG, PNG and PDF, and views in three dimensions as HTML and PNG.
//!
//! [`Picture`] is the data of a slice: the squares in which a plane cuts leaves, the segments in which it cuts facets, and the
//! window. Reading takes time in proportion to the slice, and no picture has more squares than can be shown.

pub mod colour;
mod draw;
pub mod format;
pub mod scene;
pub mod set;
pub mod squares;
mod surface;
#[cfg(test)]
mod tests;

use colour::{Colour, Entry, short};
use contract::case::Facet;
use contract::failure::Failure;
use contract::lattice::{Root, UNITS_PER_EDGE};
use contract::manifest::Sides;
use contract::octant::{LEVEL_MAX, UNITS_PER_CELL};
use export::mesh::Mesh;
use export::selection::{Selection, Slice};
use geometry::tree::{Aabb, Point};
use squares::{Detail, Squares, plane_axes};

pub use draw::svg;

/// A point in a plane.
pub type Planar = [f64; 2];

/// What a picture shows.
#[derive(Clone, Debug)]
pub struct Request<'a> {
    /// The leaves. Without a slice, that of [`middle`] is taken; the window is that of the clip box, if there is one.
    pub selection: Selection,
    /// The body whose section is drawn, if it is known.
    pub body: Option<&'a [Facet]>,
    /// The quantity that colours show.
    pub colour: Colour,
    /// Edge of the root in edges of the window, which is centred on the body. Without effect on a clip box.
    pub zoom: f64,
    /// Leaves deeper than this are merged into their ancestors: the base mesh of a partition, for example.
    pub level_max: u8,
    /// Command that makes the picture, which a view names.
    pub command: String,
}

impl Request<'_> {
    /// Returns an error if the mesh does not have what colours show.
    fn check(&self, mesh: &Mesh) -> Result<(), Failure> {
        if self.colour == Colour::Side && mesh.manifest.sides == Sides::Unknown {
            let why = "the sides of this mesh are unknown: choose another colour";
            return Err(Failure::input(why.to_owned()));
        }
        match self.colour == Colour::Rank && !mesh.has_ranks() {
            true => Err(mesh.ranks_unknown()),
            false => Ok(()),
        }
    }

    /// The squares in which a plane cuts the leaves in a window, at this many units of the page per unit of the user. The window may end
    /// within the root, but the plane need not be in the box.
    fn squares(
        &self,
        mesh: &Mesh,
        slice: Slice,
        mut window: [[i64; 3]; 2],
        scale: f64,
        detail: &Detail,
    ) -> Result<Squares, Failure> {
        (window[0][slice.axis], window[1][slice.axis]) = (0, UNITS_PER_EDGE);
        let (slice, clip) = (Some(slice), Some(window));
        let selection = Selection { slice, clip, ..self.selection.clone() };
        let (edge, detail) = (mesh.manifest.root.edge * scale, detail.to_level(self.level_max));
        Squares::collect(mesh, &selection, self.colour, edge, &detail)
    }
}

/// The data of a picture of a slice.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// The root of the mesh.
    pub root: Root,
    /// The plane.
    pub slice: Slice,
    /// The quantity that colours show.
    pub colour: Colour,
    /// Lower left and upper right corner in the plane, in the user's units.
    pub window: [Planar; 2],
    /// The squares.
    pub squares: Squares,
    /// The colours of their values.
    pub key: Vec<Entry>,
    /// The segments in which the plane cuts the body, in the user's units; `None` if the body is not known.
    pub section: Option<Vec<[Planar; 2]>>,
}

/// Why a picture would be empty.
pub const NO_LEAF: &str =
    "no leaf of the selection is in a slice: give another --slice or a larger --clip";

/// Squares of a slice: about two megabytes of SVG.
pub const DETAIL: Detail =
    Detail { squares_max: 60_000, outlined_max: 30_000, level_max: LEVEL_MAX };

/// The plane normal to the shortest extent of the body that halves the area of its surface; without a body, through the
/// root's centre and normal to z.
pub fn middle(root: &Root, body: Option<&[Facet]>) -> Slice {
    let extent = extent(root, body);
    let length = |a: usize| extent[1][a] - extent[0][a];
    // Of equal extents the last one, so that a cube is seen from above. A plane within a flat body has no section.
    let axes = (0..3).rev().filter(|&a| length(a) > 0.0);
    let axis = axes.min_by(|&a, &b| length(a).total_cmp(&length(b)));
    halfway(root, body, axis.unwrap_or(2))
}

/// The plane normal to an axis that halves the area of the body, or passes through the root's centre.
///
/// A plane through the middle of the bounding box would miss the wings of an aircraft with a tail.
pub fn halfway(root: &Root, body: Option<&[Facet]>, axis: usize) -> Slice {
    let [low, high] = extent(root, body);
    let middle = body.and_then(|facets| median(facets, axis));
    let middle = middle.unwrap_or((low[axis] + high[axis]) / 2.0);
    // A thousandth of the extent is not visible, and a short coordinate can be entered again.
    let step = 10f64.powf((high[axis] - low[axis]).log10().floor() - 3.0);
    let middle = if step > 0.0 { (middle / step).round() * step } else { middle };
    let within = middle.clamp(root.origin[axis], root.origin[axis] + root.edge);
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
    let total: f64 = facets.iter().map(|f| f.1).sum();
    // The mean of the lower and the upper median, up to rounding.
    let reaching = |part: f64| {
        let mut sum = 0.0;
        let reaches = |f: &&(f64, f64)| {
            sum += f.1;
            sum >= part * total
        };
        facets.iter().find(reaches).map(|f| f.0)
    };
    (total > 0.0).then_some((reaching(0.5 - 1e-9)? + reaching(0.5 + 1e-9)?) / 2.0)
}

/// The bounding box of the body, or the root.
pub fn extent(root: &Root, body: Option<&[Facet]>) -> [[f64; 3]; 2] {
    let Some(facets) = body.filter(|facets| !facets.is_empty()) else {
        return [root.origin, root.origin.map(|c| c + root.edge)];
    };
    let empty = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    facets.iter().flatten().fold(empty, |[low, high], at| {
        let at = at.map(f64::from);
        [std::array::from_fn(|a| low[a].min(at[a])), std::array::from_fn(|a| high[a].max(at[a]))]
    })
}

/// The cube of the window, moved into the root, on the lattice.
pub fn zoomed(root: &Root, body: Option<&[Facet]>, zoom: f64) -> [[i64; 3]; 2] {
    let [low, high] = extent(root, body);
    let edge = ((UNITS_PER_EDGE as f64 / zoom) as i64).clamp(UNITS_PER_CELL, UNITS_PER_EDGE);
    let centre = std::array::from_fn(|a| (low[a] + high[a]) / 2.0);
    let centre = root.quantise_clamped(centre);
    let corner = centre.map(|c| (c - edge / 2).clamp(0, UNITS_PER_EDGE - edge));
    [corner, corner.map(|c| c + edge)]
}

impl Picture {
    /// Reads what the picture shows.
    ///
    /// # Errors
    /// If the mesh cannot be read, or the picture would be empty.
    pub fn collect(mesh: &Mesh, request: &Request, detail: &Detail) -> Result<Self, Failure> {
        let root = mesh.manifest.root;
        request.check(mesh)?;
        let slice = request.selection.slice.unwrap_or_else(|| middle(&root, request.body));
        let axes = plane_axes(slice.axis);
        let clip = request.selection.clip.unwrap_or(zoomed(&root, request.body, request.zoom));
        let window = clip.map(|corner| axes.map(|a| root.to_user(corner)[a]));
        if (0..2).any(|i| window[0][i] >= window[1][i]) {
            let why = "the clip box has no area in the plane of the slice: give a larger one";
            return Err(Failure::input(why.to_owned()));
        }
        let squares = request.squares(mesh, slice, clip, draw::scale(&window), detail)?;
        if squares.squares.is_empty() {
            let why = if mesh.manifest.leaves == 0 { "the mesh has no leaves" } else { NO_LEAF };
            return Err(Failure::input(why.to_owned()));
        }
        let values = squares.squares.iter().map(|s| s.value).collect();
        let key = request.colour.key(&values, &root);
        let section = request.body.map(|facets| section(&root, slice, &window, facets));
        let picture = Self { root, slice, colour: request.colour, window, squares, key, section };
        picture.check_invariants();
        Ok(picture)
    }

    /// Asserts that the window is in the root, that every square is in it and has a colour, and that the section lies in the window.
    ///
    /// # Panics
    /// If that is not so.
    pub fn check_invariants(&self) {
        let (root, [low, high]) = (&self.root, self.window);
        let (slack, axes) = (root.edge * 1e-6, plane_axes(self.slice.axis));
        for (i, from) in axes.map(|axis| root.origin[axis] - slack).into_iter().enumerate() {
            let until = from + root.edge + 2.0 * slack;
            let is_inside = from <= low[i] && low[i] < high[i] && high[i] <= until;
            assert!(is_inside, "the window {:?} is not within the root", self.window);
        }
        for square in &self.squares.squares {
            let [from, to] = self.corners(square);
            let is_shown = (0..2).all(|i| from[i] < high[i] + slack && to[i] > low[i] - slack);
            assert!(is_shown, "{square:?} is outside of the window {:?}", self.window);
            assert!(self.key.iter().any(|e| e.value == square.value), "{square:?} has no colour");
        }
        let is_within =
            |p: &Planar| (0..2).all(|i| (low[i] - slack..=high[i] + slack).contains(&p[i]));
        let beyond = self.section.iter().flatten().flatten().find(|p| !is_within(p));
        assert!(beyond.is_none(), "the section leaves the window {:?} at {beyond:?}", self.window);
    }

    /// One sentence on what the picture shows.
    pub fn title(&self) -> String {
        let Self { root, slice, squares, colour, .. } = self;
        format!(
            "Slice {} of a mesh, {} cells by {colour}",
            plane_name(root, *slice),
            squares.leaves
        )
    }

    /// The names of the axes of the plane: first to the right, then upwards.
    fn axes(&self) -> [&'static str; 2] {
        plane_axes(self.slice.axis).map(|axis| ["x", "y", "z"][axis])
    }

    /// The number of cells, as text.
    fn count(&self) -> String {
        let Squares { leaves, is_merged, .. } = self.squares;
        let noun = if leaves == 1 { "cell" } else { "cells" };
        let merged = if is_merged { ", the smallest merged" } else { "" };
        format!("{leaves} {noun} in the plane{merged}")
    }

    /// The corners of a square in the plane, in the user's units.
    fn corners(&self, square: &squares::Square) -> [Planar; 2] {
        let axes = plane_axes(self.slice.axis);
        let at = |cells: u32, axis: usize| {
            self.root.to_user([i64::from(cells) * UNITS_PER_CELL; 3])[axis]
        };
        let low = [0, 1].map(|i| at(square.corner[i], axes[i]));
        [low, [0, 1].map(|i| at(square.corner[i] + square.edge(), axes[i]))]
    }
}

/// A plane as in `z = 0.5`, to the digits that the lattice resolves.
fn plane_name(root: &Root, slice: Slice) -> String {
    let at = root.to_user([slice.at; 3])[slice.axis];
    let resolved = 10f64.powf((root.edge / UNITS_PER_EDGE as f64).log10().ceil());
    // Adding zero turns -0 into 0.
    let at = (at / resolved).round() * resolved + 0.0;
    let is_short = at == 0.0 || (1e-6..1e9).contains(&at.abs());
    let decimals = (-resolved.log10()).round().max(0.0) as usize;
    // Parsing removes the zeros at the end.
    let shown = format!("{at:.decimals$}").parse().ok().filter(|_: &f64| is_short);
    let shown = shown.map_or_else(|| short(at), |at| at.to_string());
    format!("{} = {shown}", ["x", "y", "z"][slice.axis])
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
