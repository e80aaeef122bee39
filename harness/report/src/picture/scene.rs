//! A view in three dimensions: slices of the mesh and the surface of the body, as data that `viewer.html` and
//! `harness/oracles/view.py` draw.

use super::colour::Entry;
use super::squares::{Detail, Squares};
use super::surface::{Surface, ranks_at};
use super::{Colour, NO_LEAF, Request, halfway, middle, plane_name, zoomed};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use contract::failure::Failure;
use contract::lattice::Root;
use contract::octant::LEVEL_MAX;
use export::mesh::Mesh;
use serde::Serialize;
use std::collections::BTreeSet;

/// Deepest level of a square, so that its corner fits in 16 bits.
const LEVEL_DEEPEST: u8 = 16;
/// Squares of a slice.
const DETAIL: Detail =
    Detail { squares_max: 60_000, outlined_max: 60_000, level_max: LEVEL_DEEPEST };
/// Edge of the window in units of a page, which determines the smallest square that is not merged.
const PAGE: f64 = 1600.0;
/// Edge of the window in longest extents of the body.
const WINDOW: f64 = 1.6;

/// A view. Arrays are little-endian, in Base64.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scene {
    /// What it shows, in one sentence.
    pub title: String,
    /// Command that makes it.
    pub command: String,
    /// The quantity that colours show, or a remark on it.
    pub quantity: String,
    /// Names and colours of the legend.
    pub legend: Vec<(String, [u8; 3])>,
    /// The colours to which squares and triangles refer.
    pub colours: Vec<[u8; 3]>,
    /// Minimum corner and edge of the root.
    pub root: Root,
    /// Centre and edge of the window.
    pub window: ([f64; 3], f64),
    /// The slices; the first one is shown first.
    pub slices: Vec<Cut>,
    /// The body, if it is known.
    pub body: Option<Body>,
}

/// A slice.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cut {
    /// The plane, such as `z = 0`.
    pub name: String,
    /// Its axis.
    pub axis: usize,
    /// Its position.
    pub at: f64,
    /// Squares of at most this level have outlines.
    pub level_outlined: u8,
    /// Six bytes for every square: minimum corner in cells of level 16 (u16, u16), level, index of the colour.
    pub squares: String,
}

/// The surface of a body.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Body {
    /// Coordinates of the vertices relative to the window's centre, in edges of the window (f32).
    pub points: String,
    /// Three vertices of every triangle (u32).
    pub triangles: String,
    /// Index of the colour of every triangle (u8).
    pub colours: String,
}

/// The colour of a body that has no ranks.
const PLAIN: [u8; 3] = [190, 190, 190];

impl Scene {
    /// Reads what the view shows: the requested slice and those of the other axes, and the body.
    ///
    /// # Errors
    /// If the mesh cannot be read, or no slice has a leaf.
    pub fn collect(mesh: &Mesh, request: &Request) -> Result<Self, Failure> {
        request.check(mesh)?;
        let root = mesh.manifest.root;
        let first = request.selection.slice.unwrap_or_else(|| middle(&root, request.body));
        let clip = request.selection.clip.unwrap_or_else(|| window(&root, request));
        let [low, high] = clip.map(|corner| root.to_user(corner));
        let edge = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
        let centre: [f64; 3] = std::array::from_fn(|a| (low[a] + high[a]) / 2.0);
        let others = (0..3).filter(|&a| a != first.axis);
        let planes = [first].into_iter().chain(others.map(|a| halfway(&root, request.body, a)));
        let mut slices = Vec::new();
        for slice in planes {
            slices.push((slice, request.squares(mesh, slice, clip, PAGE / edge, &DETAIL)?));
        }
        if slices.iter().all(|(_, squares)| squares.squares.is_empty()) {
            return Err(Failure::input(NO_LEAF));
        }
        let surface = request.body.map(Surface::of);
        let ranks = match (&surface, request.colour) {
            (Some(surface), Colour::Rank) => ranks_at(mesh, &surface.centroids())?,
            _ => Vec::new(),
        };
        let squares = slices.iter().flat_map(|(_, s)| s.squares.iter().map(|s| s.value));
        let values: BTreeSet<u32> = squares.chain(ranks.iter().flatten().copied()).collect();
        let key = request.colour.key(&values, &root);
        let palette = Palette::of(&key);
        let cuts = slices.iter().map(|(slice, squares)| Cut {
            name: plane_name(&root, *slice),
            axis: slice.axis,
            at: root.to_user([slice.at; 3])[slice.axis],
            level_outlined: squares.level_outlined,
            squares: palette.squares(&key, squares),
        });
        let (legend, quantity) = request.colour.legend(&key);
        let legend = legend.into_iter().map(|(name, fill)| (name.to_owned(), fill)).collect();
        let body = surface.map(|s| palette.body(&key, &s, &ranks, (centre, edge)));
        Ok(Self {
            title: format!("{} cells by {}", mesh.manifest.leaves, request.colour),
            command: request.command.clone(),
            quantity,
            legend,
            slices: cuts.collect(),
            body,
            colours: palette.0,
            root,
            window: (centre, edge),
        })
    }
}

impl Scene {
    /// The view of the body alone.
    pub fn of_body(self) -> Self {
        let (title, quantity) = ("The geometry".to_owned(), String::new());
        Self { title, quantity, slices: Vec::new(), legend: Vec::new(), ..self }
    }
}

/// The window of a view is closer to the body than that of a slice, unless the zoom is given.
fn window(root: &Root, request: &Request) -> [[i64; 3]; 2] {
    let [low, high] = super::extent(root, request.body);
    let longest = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
    let closest = if longest > 0.0 { (root.edge / (WINDOW * longest)).max(1.0) } else { 1.0 };
    zoomed(root, request.body, if request.zoom == 1.0 { closest } else { request.zoom })
}

/// The different colours of a key. The last one is that of a plain body.
struct Palette(Vec<[u8; 3]>);

impl Palette {
    fn of(key: &[Entry]) -> Self {
        let different: BTreeSet<[u8; 3]> = key.iter().map(|e| e.fill).collect();
        Self(different.into_iter().chain([PLAIN]).collect())
    }

    fn index(&self, key: &[Entry], value: u32) -> u8 {
        let entry = key.binary_search_by_key(&value, |e| e.value).ok().map(|i| key[i].fill);
        let fill = entry.unwrap_or(PLAIN);
        self.0.iter().position(|c| *c == fill).unwrap_or(0) as u8
    }

    fn squares(&self, key: &[Entry], squares: &Squares) -> String {
        let bytes = squares.squares.iter().flat_map(|s| {
            let [x, y] =
                s.corner.map(|c| ((c >> (LEVEL_MAX - LEVEL_DEEPEST)) as u16).to_le_bytes());
            [x[0], x[1], y[0], y[1], s.level, self.index(key, s.value)]
        });
        BASE64_STANDARD.encode(bytes.collect::<Vec<u8>>())
    }

    fn body(
        &self,
        key: &[Entry],
        surface: &Surface,
        ranks: &[Option<u32>],
        (centre, edge): ([f64; 3], f64),
    ) -> Body {
        let relative = |p: &[f64; 3]| [0, 1, 2].map(|a| ((p[a] - centre[a]) / edge) as f32);
        let points = surface.points.iter().flat_map(relative).flat_map(f32::to_le_bytes);
        let triangles = surface.triangles.iter().flatten().flat_map(|i| i.to_le_bytes());
        let plain = self.0.len() as u8 - 1;
        let colour = |i: usize| match ranks.get(i).copied().flatten() {
            Some(rank) => self.index(key, rank),
            None => plain,
        };
        let colours = (0..surface.triangles.len()).map(colour);
        Body {
            points: BASE64_STANDARD.encode(points.collect::<Vec<u8>>()),
            triangles: BASE64_STANDARD.encode(triangles.collect::<Vec<u8>>()),
            colours: BASE64_STANDARD.encode(colours.collect::<Vec<u8>>()),
        }
    }
}

/// The view as one HTML file that needs no network.
pub fn html(scene: &Scene) -> String {
    let json = crate::json::pretty(scene).replace("</", "<\\/");
    include_str!("viewer.html").replacen("{}", json.trim(), 1)
}
