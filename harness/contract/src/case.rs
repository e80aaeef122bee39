//! Case files, which describe the input of a mesher (reference/DEFINITION.md, section 10).

use crate::files;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::lattice::{FacetLattice, Root, UNITS_PER_EDGE};
use crate::manifest::{Enclosed, ExtentBox, Keep, Manifest, Tree};
use crate::seed::BaseTree;
use crate::stl::{self, StlError};

pub use geometries::Facet;

/// A case, with its geometry on the lattice.
#[derive(Clone, Debug)]
pub struct Case {
    /// Name of the case file without its extension.
    pub name: String,
    /// The STL file; none of a generated body, or of one in memory.
    pub geometry: Option<PathBuf>,
    /// The body, in the user's units.
    pub facets: Vec<Facet>,
    /// The body on the lattice.
    pub facets_lattice: Vec<FacetLattice>,
    /// The root cube.
    pub root: Root,
    /// D: the level of crossing leaves.
    pub level_surface: u8,
    /// n: minimum thickness of a layer, in cells.
    pub layer_cells_min: u32,
    /// The side that is kept.
    pub keep: Keep,
    /// Whether crossing leaves are kept.
    pub keep_crossing: bool,
    /// Extent boxes on the lattice.
    pub boxes: Vec<ExtentBox>,
    /// Points that lie in the flow, in the user's units. If there are any, they and not rays determine all sides.
    pub seeds: Vec<[f64; 3]>,
    /// The seeds on the lattice. Each lies in the root's half-open cube.
    pub seeds_lattice: Vec<[i64; 3]>,
    /// The treatment of outside components that the far field does not reach.
    pub enclosed: Enclosed,
}

/// Why a case cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CaseError {
    /// The case file cannot be read.
    #[error("{path}: {source}")]
    Io {
        /// The case file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The file is not TOML, or not a valid case.
    #[error("{path}: {why}")]
    Content {
        /// The case file.
        path: PathBuf,
        /// The cause, in one sentence.
        why: String,
    },
    /// The body cannot be read.
    #[error("{path} {source}")]
    Stl {
        /// The geometry file.
        path: PathBuf,
        /// The cause.
        source: StlError,
    },
}

/// The case file, key by key.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CaseFile {
    geometry: Option<PathBuf>,
    generator: Option<geometries::Generator>,
    spacing_min: f64,
    #[serde(default = "layer_cells_min_default")]
    layer_cells_min: u32,
    #[serde(default)]
    keep: Keep,
    #[serde(default = "keep_crossing_default")]
    keep_crossing: bool,
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

const ROOT_SCALE_DEFAULT: f64 = 10.0;

fn layer_cells_min_default() -> u32 {
    4
}

fn keep_crossing_default() -> bool {
    true
}

impl Case {
    /// Reads a case file and the body that it names or generates.
    ///
    /// # Errors
    /// If a file cannot be read, or if the case is invalid.
    pub fn read(path: &Path) -> Result<Self, CaseError> {
        let text = files::read_text(path)
            .map_err(|source| CaseError::Io { path: path.to_owned(), source })?;
        let wrong = |why: String| CaseError::Content { path: path.to_owned(), why };
        let file: CaseFile = toml::from_str(&text).map_err(|e| wrong(explain(&text, &e)))?;
        let facets = facets(path, &file)?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let geometry = file.geometry.as_ref().map(|stl| beside(path, stl));
        Ok(Self { geometry, ..Self::build(name, &file, facets).map_err(wrong)? })
    }

    /// A case from the text of a case file without geometry, and from a body in memory.
    ///
    /// # Errors
    /// One sentence, if the case is invalid.
    pub fn from_parts(text: &str, facets: Vec<Facet>) -> Result<Self, String> {
        let file: CaseFile = toml::from_str(text).map_err(|e| explain(text, &e))?;
        Self::build("in-memory".to_owned(), &file, facets)
    }

    fn build(name: String, file: &CaseFile, facets: Vec<Facet>) -> Result<Self, String> {
        let root = root(file, &facets)?;
        positive("spacing_min", file.spacing_min)?;
        if file.layer_cells_min == 0 {
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
        let case = Self {
            name,
            geometry: None,
            facets_lattice: on_lattice(&root, &facets)?,
            facets,
            root,
            level_surface,
            layer_cells_min: file.layer_cells_min,
            keep: file.keep,
            keep_crossing: file.keep_crossing,
            boxes,
            seeds_lattice: seeds_on_lattice(&root, &file.seeds)?,
            seeds: file.seeds.clone(),
            enclosed: file.enclosed,
        };
        case.refuse_crossing_seeds()?;
        Ok(case)
    }

    /// Refuses a seed in a crossing leaf of T0.
    fn refuse_crossing_seeds(&self) -> Result<(), String> {
        let base = BaseTree {
            facets: &self.facets_lattice,
            level: self.level_surface,
            boxes: &self.boxes,
        };
        for (i, (&seed, at)) in self.seeds_lattice.iter().zip(&self.seeds).enumerate() {
            if let (leaf, Some(facet)) = base.leaf_at(seed) {
                let leaf = self.root.describe(&leaf);
                return Err(format!(
                    "seed {i} at {} lies in the crossing leaf {leaf}, which facet {facet} crosses; move it away \
                     from the surface",
                    shown(*at)
                ));
            }
        }
        Ok(())
    }

    /// The manifest of a mesh of this case, without leaves.
    pub fn manifest(&self, tree: Tree, program: String) -> Manifest {
        Manifest {
            level_surface: self.level_surface,
            layer_cells_min: self.layer_cells_min,
            keep: self.keep,
            keep_crossing: self.keep_crossing,
            boxes: self.boxes.clone(),
            seeds: self.seeds_lattice.clone(),
            enclosed: self.enclosed,
            ..Manifest::without_leaves(tree, self.root, program)
        }
    }

    /// Deepest level that the surface or a box requires.
    pub fn level_deepest(&self) -> u8 {
        self.boxes.iter().map(|b| b.level).fold(self.level_surface, u8::max)
    }
}

/// A path relative to the case file.
fn beside(case: &Path, path: &Path) -> PathBuf {
    case.parent().unwrap_or(Path::new("")).join(path)
}

/// The body, read from a file or generated.
fn facets(case: &Path, file: &CaseFile) -> Result<Vec<Facet>, CaseError> {
    let wrong = |why: String| CaseError::Content { path: case.to_owned(), why };
    match (&file.geometry, &file.generator) {
        (Some(stl), None) => {
            let path = beside(case, stl);
            stl::read(&path)
                .map(|body| body.facets)
                .map_err(|source| CaseError::Stl { path, source })
        }
        (None, Some(generator)) => generator.facets().map_err(|e| wrong(e.to_string())),
        _ => Err(wrong("give exactly one of `geometry` and `[generator]`".to_owned())),
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
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for (i, facet) in facets.iter().enumerate() {
        for vertex in facet {
            if !vertex.iter().all(|c| c.is_finite()) {
                return Err(not_finite(i, vertex));
            }
            for a in 0..3 {
                low[a] = low[a].min(f64::from(vertex[a]));
                high[a] = high[a].max(f64::from(vertex[a]));
            }
        }
    }
    let longest = (0..3).map(|a| high[a] - low[a]).fold(f64::NEG_INFINITY, f64::max);
    if longest <= 0.0 {
        return Err("the body has no extent from which to compute a root; give a [root]".to_owned());
    }
    let edge = scale * longest;
    let origin = std::array::from_fn(|a| (low[a] + high[a]) * 0.5 - edge * 0.5);
    Ok(Root { origin, edge })
}

fn on_lattice(root: &Root, facets: &[Facet]) -> Result<Vec<FacetLattice>, String> {
    let mut all = Vec::with_capacity(facets.len());
    for (i, facet) in facets.iter().enumerate() {
        let mut on = [[0; 3]; 3];
        for (q, vertex) in on.iter_mut().zip(facet) {
            let [x, y, z] = vertex;
            let why = || match vertex.iter().all(|c| c.is_finite()) {
                true => format!(
                    "facet {i} has a vertex at ({x}, {y}, {z}), more than one root edge outside the root: enlarge or move the root"
                ),
                false => not_finite(i, vertex),
            };
            *q = root.quantise(vertex.map(f64::from)).ok_or_else(why)?;
        }
        all.push(on);
    }
    Ok(all)
}

/// A point as text.
fn shown([x, y, z]: [f64; 3]) -> String {
    format!("({x}, {y}, {z})")
}

fn not_finite(facet: usize, [x, y, z]: &[f32; 3]) -> String {
    format!("facet {facet} has a vertex that is not finite, ({x}, {y}, {z}): repair the geometry")
}

fn seeds_on_lattice(root: &Root, seeds: &[[f64; 3]]) -> Result<Vec<[i64; 3]>, String> {
    let on_lattice = |(i, &seed): (usize, &[f64; 3])| {
        let outside = || {
            let (from, to) = (root.origin, root.to_user([UNITS_PER_EDGE; 3]));
            format!(
                "seed {i} at {} lies outside the root, from {} to {}; move it into the flow",
                shown(seed),
                shown(root.rounded(from)),
                shown(root.rounded(to))
            )
        };
        root.quantise_seed(seed).ok_or_else(outside)
    };
    seeds.iter().enumerate().map(on_lattice).collect()
}

fn positive(what: &str, value: f64) -> Result<(), String> {
    let good = value.is_finite() && value > 0.0;
    if good {
        Ok(())
    } else {
        Err(format!("{what} = {value} must be finite and greater than zero"))
    }
}

/// A TOML error in one line, with the most similar known key if a key is unknown.
fn explain(text: &str, error: &toml::de::Error) -> String {
    let message = error.message().replace("expected f64", "expected a number");
    let at = error.span().map_or(0, |span| span.start);
    let (line, key) = place(text, at);
    let mut quoted = message.split('`').skip(1).step_by(2);
    match (message.starts_with("unknown field"), quoted.next()) {
        (true, Some(wrong)) => {
            match quoted.max_by(|a, b| similarity(wrong, a).total_cmp(&similarity(wrong, b))) {
                Some(near) => format!("{line}: unknown key `{wrong}`; did you mean `{near}`?"),
                None => format!("{line}: unknown key `{wrong}`"),
            }
        }
        // Of the file as a whole.
        (false, _) if at == 0 && message.starts_with("missing") => message.clone(),
        _ => format!("{line}{key}: {}{}", message.replace('\n', " "), advice(text, at)),
    }
}

/// How to write a path, if a key whose value is one has another value: a backslash in double quotes, or no quotes at all.
fn advice(text: &str, at: usize) -> &'static str {
    let begin = text[..at].rfind('\n').map_or(0, |at| at + 1);
    let line = text[begin..].lines().next().unwrap_or_default();
    match line.split_once('=') {
        Some((key, value)) if key.trim() == "geometry" && !value.trim().starts_with('\'') => {
            "; put the path in single quotes: geometry = 'DIRECTORY/FILE.stl'"
        }
        _ => "",
    }
}

/// The line of a byte of a case file, counted from 1, and the key or table on it, as the beginning of a message.
fn place(text: &str, byte: usize) -> (String, String) {
    let begin = text[..byte].rfind('\n').map_or(0, |at| at + 1);
    let (number, line) = (text[..begin].matches('\n').count() + 1, text[begin..].lines().next());
    let key = line.unwrap_or_default().split('=').next().unwrap_or_default().trim();
    let is_key = |c: char| c.is_alphanumeric() || "_-.[]\"".contains(c);
    let is_key = !key.is_empty() && key.chars().all(is_key);
    (format!("line {number}"), if is_key { format!(", {key}") } else { String::new() })
}

/// Similarity of two keys, from 0 to 1, by the metric that the mesher uses too.
fn similarity(a: &str, b: &str) -> f64 {
    strsim::jaro_winkler(a, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Facet = [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn defaults_and_the_computed_root_follow_the_definition() {
        let case = Case::from_parts("spacing_min = 0.5", vec![UNIT]).unwrap();
        assert_eq!((case.layer_cells_min, case.keep, case.keep_crossing), (4, Keep::Outside, true));
        assert_eq!(case.root, Root { origin: [-9.0, -9.5, -10.0], edge: 20.0 });
        assert_eq!(case.level_surface, 6);
    }

    #[test]
    fn boxes_are_clamped_to_the_root_and_have_their_own_level() {
        let text = "spacing_min = 1.0\n[root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0\n\
                    [[box]]\nmin = [-4.0, 1.0, 2.0]\nmax = [4.0, 99.0, 3.0]\nspacing = 0.3";
        let case = Case::from_parts(text, vec![]).unwrap();
        let unit = 1 << 24;
        let expected =
            ExtentBox { min: [0, unit, 2 * unit], max: [4 * unit, 8 * unit, 3 * unit], level: 5 };
        assert_eq!(case.boxes, [expected]);
        assert_eq!(case.level_deepest(), 5);
    }

    #[test]
    fn seeds_are_points_of_the_root_and_enclosed_components_are_deleted_by_default() {
        let with = |keys: &str| {
            let root = "[root]\norigin = [-4.0, -4.0, -4.0]\nedge = 8.0";
            Case::from_parts(&format!("spacing_min = 1.0\n{keys}\n{root}"), vec![UNIT])
        };
        let case = with("").unwrap();
        assert_eq!((case.seeds, case.enclosed), (vec![], Enclosed::Delete));
        let case = with("seeds = [[0, 1.5, -4], [1, 1, 1]]\nenclosed = 'keep'").unwrap();
        assert_eq!(case.seeds, [[0.0, 1.5, -4.0], [1.0; 3]]);
        assert_eq!(case.seeds_lattice, [[4 << 24, 11 << 23, 0], [5 << 24; 3]]);
        assert_eq!(case.enclosed, Enclosed::Keep);
        let why = with("seeds = [[0, 0, 0], [4, 0, 0]]").unwrap_err();
        assert!(
            why.starts_with(
                "seed 1 at (4, 0, 0) lies outside the root, from (-4, -4, -4) to (4, 4, 4);"
            ),
            "{why}"
        );
        assert!(with("seeds = [[0, 0, nan]]").unwrap_err().contains("seed 0"));
        assert!(with("enclosed = 'drop'").is_err());
    }

    #[test]
    fn a_seed_in_a_crossing_leaf_is_an_error() {
        let seeded = |seed: [f64; 3]| {
            let text = format!(
                "spacing_min = 1.0\nseeds = [{seed:?}]\n[root]\norigin = [-1.0, -1.0, -1.0]\nedge = 8.0"
            );
            Case::from_parts(&text, vec![UNIT])
        };
        let why = seeded([0.5, 0.5, 0.5]).unwrap_err();
        assert!(why.contains("seed 0") && why.contains("facet 0 crosses"), "{why}");
        assert!(seeded([5.5, 5.5, 5.5]).is_ok());
    }

    #[test]
    fn the_manifest_of_a_case_has_all_its_inputs() {
        let text = "spacing_min = 1.0\nlayer_cells_min = 2\nkeep = 'inside'\nkeep_crossing = false\nenclosed = 'keep'\n\
                    seeds = [[5.5, 5.5, 5.5]]\n[root]\norigin = [-1.0, -1.0, -1.0]\nedge = 8.0\n\
                    [[box]]\nmin = [0.0, 1.0, 2.0]\nmax = [4.0, 6.0, 3.0]\nspacing = 0.3";
        let case = Case::from_parts(text, vec![UNIT]).unwrap();
        let manifest = case.manifest(Tree::Base, "a program".to_owned());
        assert_eq!(
            (manifest.tree, manifest.program.as_str(), manifest.root),
            (Tree::Base, "a program", case.root)
        );
        assert_eq!((manifest.level_surface, manifest.layer_cells_min), (3, 2));
        assert_eq!(
            (manifest.keep, manifest.keep_crossing, manifest.enclosed),
            (Keep::Inside, false, Enclosed::Keep)
        );
        assert_eq!((manifest.boxes, manifest.seeds), (case.boxes.clone(), vec![[13 << 23; 3]]));
        assert_eq!((case.boxes.len(), manifest.leaves), (1, 0));
    }

    #[test]
    fn a_box_has_positive_extent_and_spacing() {
        let with = |min: &str, max: &str, spacing: &str| {
            let root = "[root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0";
            let text = format!(
                "spacing_min = 1.0\n{root}\n[[box]]\nmin = {min}\nmax = {max}\nspacing = {spacing}"
            );
            Case::from_parts(&text, vec![]).err()
        };
        assert_eq!(with("[0, 0, 0]", "[1, 1, 1]", "0.5"), None);
        let wrong = Some("box 0: min must be below max in every axis, and finite".to_owned());
        for (min, max) in [
            ("[0, 1, 0]", "[1, 1, 1]"),
            ("[0, 0, 2]", "[1, 1, 1]"),
            ("[-inf, 0, 0]", "[1, 1, 1]"),
            ("[0, 0, 0]", "[1, nan, 1]"),
            ("[0, 0, 0]", "[1, 1, inf]"),
        ] {
            assert_eq!(with(min, max, "0.5"), wrong, "{min} {max}");
        }
        assert!(
            with("[0, 0, 0]", "[1, 1, 1]", "0.0").unwrap().starts_with("box spacing = 0 must be")
        );
        assert!(with("[0, 0, 0]", "[1, 1, 1]", "1e-9").unwrap().contains("deeper than 19"));
    }

    #[test]
    fn an_error_of_the_file_has_a_line_and_one_of_the_whole_has_none() {
        let why = |text: &str| Case::from_parts(text, vec![UNIT]).unwrap_err();
        assert_eq!(why("layer_cells_min = 3"), "missing field `spacing_min`");
        let text = "spacing_min = 1.0\n\n[root]\norigin = [0.0, 0.0, 0.0]\nedge = 'long'";
        assert!(why(text).starts_with("line 5, edge: invalid type: string"), "{}", why(text));
        let without_edge = why("spacing_min = 1.0\n[root]\norigin = [0.0, 0.0, 0.0]");
        assert_eq!(without_edge, "line 2, [root]: missing field `edge`");
        assert_eq!(place("a = 1\nb c\n= 2", 8), ("line 2".to_owned(), String::new()));
        assert_eq!(place("a = 1\n= 2", 7), ("line 2".to_owned(), String::new()));
        assert_eq!(place("a = 1\n  b.\"c\" = 2", 6), ("line 2".to_owned(), ", b.\"c\"".to_owned()));
        let both = "spacing_min = 1.0\nroot_scale = inf";
        assert_eq!(why(both), "root_scale = inf must be finite and greater than zero");
        let root = "spacing_min = 1.0\n[root]\norigin = [0.0, nan, 0.0]\nedge = 8.0";
        assert_eq!(why(root), "the root's origin is not finite");
        assert!(why("spacing_min = 0.0").starts_with("spacing_min = 0 must be finite"));
    }

    #[test]
    fn errors_name_the_cause() {
        let why = |text: &str| Case::from_parts(text, vec![UNIT]).unwrap_err();
        assert!(
            why("spacing_mim = 1.0")
                .contains("line 1: unknown key `spacing_mim`; did you mean `spacing_min`")
        );
        let map = why("spacing_min = 1.0\nlayer_cells_min = { a = 1 }");
        assert!(map.contains("line 2, layer_cells_min: invalid type: map"), "{map}");
        let word = why("spacing_min = \"fine\"");
        assert!(
            word.contains("line 1, spacing_min: ") && word.contains("expected a number"),
            "{word}"
        );
        let table = why("spacing_min = 1.0\n[layer_cells_min]\na = 1");
        assert!(table.contains("line 2, [layer_cells_min]: invalid type: map"), "{table}");
        for path in [r#""C:\Users\me\a.stl""#, "parts/a.stl", "12"] {
            let why = why(&format!("spacing_min = 1.0\ngeometry = {path}"));
            assert!(
                why.starts_with("line 2, geometry: ") && why.contains("single quotes"),
                "{why}"
            );
        }
        assert!(!why("spacing_min = 1.0\ngeometry = 'a.stl'\nkeep = 1").contains("single quotes"));
        assert!(why("spacing_min = -1.0").contains("spacing_min"));
        assert!(why("spacing_min = 1e-9").contains("deeper"));
        assert!(why("spacing_min = 1.0\nlayer_cells_min = 0").contains("layer_cells_min"));
        assert!(
            why("spacing_min = 1.0\nroot_scale = 2.0\n[root]\norigin=[0.0,0.0,0.0]\nedge=1.0")
                .contains("exclude")
        );
        assert!(Case::from_parts("spacing_min = 1.0", vec![]).unwrap_err().contains("extent"));
        let far = "spacing_min = 1.0\n[root]\norigin = [9.0, 9.0, 9.0]\nedge = 2.0";
        let why = why(far);
        assert!(
            why.starts_with("facet 0 has a vertex at (0, 0, 0), more than one root edge"),
            "{why}"
        );
    }
}
