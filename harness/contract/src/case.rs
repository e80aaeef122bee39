//! Case files, which describe the input of a mesher (reference/DEFINITION.md, section 10).

#[cfg(test)]
mod tests;

use crate::failure::Failure;
use crate::files;
use std::ops::Deref;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::lattice::{FacetLattice, Root};
use crate::manifest::{Enclosed, ExtentBox, Keep, Manifest, Tree};
use crate::number::point;
use crate::stl::{self, Body, Solid};

pub use geometries::Facet;

/// A case, with its geometry on the lattice.
#[derive(Clone, Debug)]
pub struct Case {
    /// Name of the case file without its extension.
    pub name: String,
    /// The solids of the STL file; none of a generated body, or of one in memory.
    pub solids: Vec<Solid>,
    /// The body, in the user's units.
    pub facets: Vec<Facet>,
    /// The body on the lattice.
    pub facets_lattice: Vec<FacetLattice>,
    /// Points that lie in the flow, in the user's units. If there are any, they and not rays determine all sides.
    pub seeds: Vec<[f64; 3]>,
    /// The root and the rules, on the lattice: the manifest of a mesh without leaves.
    pub rules: Manifest,
}

impl Deref for Case {
    type Target = Manifest;

    fn deref(&self) -> &Manifest {
        &self.rules
    }
}

/// The case file, key by key.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CaseFile {
    geometry: Option<PathBuf>,
    generator: Option<geometries::Generator>,
    spacing_min: f64,
    layer_cells_min: Option<u32>,
    #[serde(default)]
    keep: Keep,
    keep_crossing: Option<bool>,
    root_scale: Option<f64>,
    root: Option<Root>,
    #[serde(default)]
    seeds: Vec<[f64; 3]>,
    #[serde(default)]
    enclosed: Enclosed,
    #[serde(default, rename = "box")]
    boxes: Vec<BoxFile>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct BoxFile {
    min: [f64; 3],
    max: [f64; 3],
    spacing: f64,
}

const LAYER_CELLS_MIN_DEFAULT: u32 = 4;
const KEEP_CROSSING_DEFAULT: bool = true;
const ROOT_SCALE_DEFAULT: f64 = 10.0;

impl Case {
    /// Reads a case file and the body that it names or generates.
    ///
    /// # Errors
    /// If a file cannot be read, or if the case is invalid.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let text = files::read_text(path).map_err(|error| Failure::about(path, error))?;
        let wrong = |why: String| Failure::about(path, why);
        let file: CaseFile =
            toml::from_str(&text).map_err(|e| wrong(explain(&text, &e, &EXAMPLES)))?;
        let directory = path.parent().unwrap_or(Path::new(""));
        let Body { facets, solids } = match (&file.geometry, &file.generator) {
            (Some(stl), None) => stl::read(&directory.join(stl))?,
            (None, Some(generator)) => {
                let facets = generator.facets().map_err(|e| Failure::about(path, e))?;
                Body { facets, solids: Vec::new() }
            }
            _ => return Err(wrong("give exactly one of `geometry` and `[generator]`".to_owned())),
        };
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Self { solids, ..Self::build(name, &file, facets).map_err(wrong)? })
    }

    /// A case from the text of a case file without geometry, and from a body in memory.
    ///
    /// # Errors
    /// One sentence, if the case is invalid.
    pub fn from_parts(text: &str, facets: Vec<Facet>) -> Result<Self, String> {
        let file: CaseFile = toml::from_str(text).map_err(|e| explain(text, &e, &EXAMPLES))?;
        Self::build("in-memory".to_owned(), &file, facets)
    }

    fn build(name: String, file: &CaseFile, facets: Vec<Facet>) -> Result<Self, String> {
        let mut vertices = facets.as_flattened().iter().enumerate();
        if let Some((i, [x, y, z])) = vertices.find(|(_, v)| !v.iter().all(|c| c.is_finite())) {
            let facet = i / 3;
            return Err(format!(
                "facet {facet} has a vertex that is not finite, ({x}, {y}, {z}): repair the geometry"
            ));
        }
        let root = root(file, &facets)?;
        positive("spacing_min", file.spacing_min)?;
        let layer_cells_min = file.layer_cells_min.unwrap_or(LAYER_CELLS_MIN_DEFAULT);
        if layer_cells_min == 0 {
            return Err("layer_cells_min is 0; a layer has at least one cell".to_owned());
        }
        let level = |what: &str, spacing| {
            let deep =
                || format!("{what} = {spacing} requires a level deeper than 19; increase it");
            root.level_for(spacing).ok_or_else(deep)
        };
        let level_surface = level("spacing_min", file.spacing_min)?;
        let mut boxes = Vec::new();
        for (i, b) in file.boxes.iter().enumerate() {
            positive("box spacing", b.spacing)?;
            let ordered =
                |a: usize| b.min[a] < b.max[a] && b.min[a].is_finite() && b.max[a].is_finite();
            if !(0..3).all(ordered) {
                return Err(format!("box {i}: min must be below max in every axis, and finite"));
            }
            let (min, max) = (root.quantise_clamped(b.min), root.quantise_clamped(b.max));
            boxes.push(ExtentBox { min, max, level: level("box spacing", b.spacing)? });
        }
        let rules = Manifest {
            level_surface,
            layer_cells_min,
            keep: file.keep,
            keep_crossing: file.keep_crossing.unwrap_or(KEEP_CROSSING_DEFAULT),
            boxes,
            seeds: seeds_on_lattice(&root, &file.seeds)?,
            enclosed: file.enclosed,
            ..Manifest::without_leaves(Tree::Final, root, String::new())
        };
        let (facets_lattice, seeds) = (on_lattice(&root, &facets)?, file.seeds.clone());
        let case = Self { name, solids: Vec::new(), facets, facets_lattice, seeds, rules };
        for (i, (&seed, at)) in case.rules.seeds.iter().zip(&case.seeds).enumerate() {
            if let (leaf, Some(facet)) = case.base_leaf_at(seed, &case.facets_lattice) {
                let leaf = root.place(leaf);
                return Err(format!(
                    "seed {i} at {} lies in the crossing leaf {leaf}, which facet {facet} crosses; move it away \
                     from the surface",
                    point(*at)
                ));
            }
        }
        Ok(case)
    }

    /// The manifest of a mesh of this case, without leaves.
    pub fn manifest(&self, tree: Tree, program: String) -> Manifest {
        Manifest { tree, program, ..self.rules.clone() }
    }
}

/// The root cube, given or computed from the body. The order of floating-point operations is part of the
/// definition.
fn root(file: &CaseFile, facets: &[Facet]) -> Result<Root, String> {
    if let Some(root) = file.root {
        if file.root_scale.is_some() {
            return Err("root_scale and [root] exclude each other; give one of them".to_owned());
        }
        positive("root edge", root.edge)?;
        let finite = root.origin.iter().all(|c| c.is_finite());
        return if finite { Ok(root) } else { Err("the root's origin is not finite".to_owned()) };
    }
    let scale = file.root_scale.unwrap_or(ROOT_SCALE_DEFAULT);
    positive("root_scale", scale)?;
    let along = |a: usize| facets.as_flattened().iter().map(move |vertex| f64::from(vertex[a]));
    let low = [0, 1, 2].map(|a| along(a).fold(f64::INFINITY, f64::min));
    let high = [0, 1, 2].map(|a| along(a).fold(f64::NEG_INFINITY, f64::max));
    let longest = (0..3).map(|a| high[a] - low[a]).fold(f64::NEG_INFINITY, f64::max);
    if longest <= 0.0 {
        return Err("the body has no extent from which to compute a root; give a [root]".to_owned());
    }
    let edge = scale * longest;
    let origin = std::array::from_fn(|a| (low[a] + high[a]) * 0.5 - edge * 0.5);
    Ok(Root { origin, edge })
}

fn on_lattice(root: &Root, facets: &[Facet]) -> Result<Vec<FacetLattice>, String> {
    let on_lattice = |(i, vertex): (usize, &[f32; 3])| {
        let ([x, y, z], facet) = (vertex, i / 3);
        root.quantise(vertex.map(f64::from)).ok_or_else(|| {
            format!(
                "facet {facet} has a vertex at ({x}, {y}, {z}), more than one root edge outside the root: enlarge or move the root"
            )
        })
    };
    let vertices = facets.as_flattened().iter().enumerate().map(on_lattice);
    Ok(vertices.collect::<Result<Vec<_>, String>>()?.as_chunks().0.to_vec())
}

fn seeds_on_lattice(root: &Root, seeds: &[[f64; 3]]) -> Result<Vec<[i64; 3]>, String> {
    let on_lattice = |(i, &seed): (usize, &[f64; 3])| {
        let outside = || {
            let at = point(seed);
            format!("seed {i} at {at} lies outside the root, {root}; move it into the flow")
        };
        root.quantise_seed(seed).ok_or_else(outside)
    };
    seeds.iter().enumerate().map(on_lattice).collect()
}

fn positive(what: &str, value: f64) -> Result<(), String> {
    let why = || format!("{what} = {value} must be finite and greater than zero");
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(why()) }
}

/// Examples of keys of a case file.
const EXAMPLES: [(&str, &str); 8] = [
    ("geometry", "geometry = 'DIRECTORY/FILE.stl', in single quotes"),
    ("spacing_min", "spacing_min = 0.01"),
    ("layer_cells_min", "layer_cells_min = 4"),
    ("keep", "keep = \"outside\""),
    ("keep_crossing", "keep_crossing = true"),
    ("root_scale", "root_scale = 10.0"),
    ("origin", "origin = [-1.0, -1.0, -1.0]"),
    ("edge", "edge = 2.0"),
];

/// A TOML error in one line, with the line of the file, counted from 1, the key or table on it, and an example of the key if there is one.
pub fn explain(text: &str, error: &toml::de::Error, examples: &[(&str, &str)]) -> String {
    let message = error.message().replace("expected f64", "expected a number").replace('\n', " ");
    let at = error.span().map_or(0, |span| span.start);
    let begin = text[..at].rfind('\n').map_or(0, |at| at + 1);
    let number = text[..begin].matches('\n').count() + 1;
    let line = text[begin..].lines().next().unwrap_or_default();
    let key = line.split('=').next().unwrap_or_default().trim();
    let is_missing = message.starts_with("missing");
    let wrong = if is_missing { message.split('`').nth(1).unwrap_or_default() } else { key };
    let example = examples.iter().find(|(name, _)| *name == wrong);
    let example = example.map_or_else(String::new, |(_, of)| format!("; for example {of}"));
    match at == 0 && is_missing {
        // Of the file as a whole.
        true => message + &example,
        false => format!("line {number}, {key}: {message}{example}"),
    }
}
