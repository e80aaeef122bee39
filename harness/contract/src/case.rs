//! Case files, which describe the input of a mesher (reference/DEFINITION.md, section 10).

use crate::failure::{Failure, Result};
use crate::files;
use std::collections::BTreeSet;
use std::ops::Deref;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::{Table, Value};

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
    /// The case file without its geometry, with the root that the geometry gives it.
    pub table: Table,
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

impl Case {
    /// Reads a case file and the body that it names or generates.
    ///
    /// # Errors
    /// If a file cannot be read, or if the case is invalid.
    pub fn read(path: &Path) -> Result<Self> {
        let text = files::read_text(path).map_err(|error| Failure::about(path, error))?;
        let wrong = |why: String| Failure::about(path, why);
        let file: CaseFile =
            toml::from_str(&text).map_err(|e| wrong(explain(&text, &e, DEFINITION)))?;
        geometries::refuse_surplus::<CaseFile>(&text).map_err(wrong)?;
        let Body { facets, solids } = match (&file.geometry, &file.generator) {
            (Some(stl), None) => stl::read(&path.with_file_name(stl))?,
            (None, Some(generator)) => {
                let facets = generator.facets().map_err(|e| Failure::about(path, e))?;
                Body { facets, solids: Vec::new() }
            }
            _ => return Err(wrong("give exactly one of `geometry` and `[generator]`".to_owned())),
        };
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let case = Self::build(name, (&text, &file), facets).map_err(|why| why.of_file(path))?;
        Ok(Self { solids, ..case })
    }

    /// A case from the text of a case file without geometry, and from a body in memory.
    ///
    /// # Errors
    /// One sentence, if the case is invalid.
    pub fn from_parts(text: &str, facets: Vec<Facet>) -> Result<Self, String> {
        let file: CaseFile = toml::from_str(text).map_err(|e| explain(text, &e, DEFINITION))?;
        geometries::refuse_surplus::<CaseFile>(text)?;
        Self::build("in-memory".to_owned(), (text, &file), facets).map_err(|failure| failure.why)
    }

    fn build(name: String, (text, file): (&str, &CaseFile), facets: Vec<Facet>) -> Result<Self> {
        let mut vertices = facets.as_flattened().iter().enumerate();
        if let Some((i, [x, y, z])) = vertices.find(|(_, v)| !v.iter().all(|c| c.is_finite())) {
            let facet = i / 3;
            return Err(Failure::input(format_args!(
                "facet {facet} has a vertex that is not finite, ({x}, {y}, {z}): repair the geometry"
            )));
        }
        let root = root(file, &facets)?;
        positive("spacing_min", file.spacing_min)?;
        let layer_cells_min = file.layer_cells_min.unwrap_or(4);
        let why = "layer_cells_min is 0; a layer has at least one cell";
        Failure::unless(layer_cells_min > 0, why)?;
        let level = |what: &str, spacing| {
            let deep = || format!("{what} = {spacing} needs a level deeper than 19; increase it");
            root.level_for(spacing).ok_or_else(deep)
        };
        let level_surface = level("spacing_min", file.spacing_min)?;
        let mut boxes = Vec::new();
        for (i, &BoxFile { min, max, spacing }) in file.boxes.iter().enumerate() {
            positive("box spacing", spacing)?;
            let ordered = |a: usize| min[a] < max[a] && min[a].is_finite() && max[a].is_finite();
            let why = format!("box {i}: min must be below max in every axis, and finite");
            Failure::unless((0..3).all(ordered), why)?;
            let (min, max) = (root.quantise_clamped(min), root.quantise_clamped(max));
            boxes.push(ExtentBox { min, max, level: level("box spacing", spacing)? });
        }
        let seed = |(i, &seed): (usize, &[f64; 3])| {
            let at = point(seed);
            let why =
                || format!("seed {i} at {at} lies outside the root, {root}; move it into the flow");
            root.quantise_seed(seed).ok_or_else(why)
        };
        let rules = Manifest {
            level_surface,
            layer_cells_min,
            keep: file.keep,
            keep_crossing: file.keep_crossing.unwrap_or(true),
            boxes,
            seeds: file.seeds.iter().enumerate().map(seed).collect::<Result<_, String>>()?,
            enclosed: file.enclosed,
            ..Manifest::without_leaves(root, String::new())
        };
        let (facets_lattice, seeds) = (on_lattice(&root, &facets)?, file.seeds.clone());
        let mut table: Table = text.parse().expect("what was read is TOML");
        table.retain(|key, _| !["geometry", "generator", "root_scale"].contains(&key));
        let of_root = Value::try_from(root).expect("a root is representable in TOML");
        table.insert("root".into(), of_root);
        let case = Self { name, solids: Vec::new(), facets, facets_lattice, seeds, rules, table };
        for (i, (&seed, &at)) in case.rules.seeds.iter().zip(&case.seeds).enumerate() {
            if let (leaf, Some(facet)) = case.base_leaf_at(seed, &case.facets_lattice) {
                let (at, leaf) = (point(at), root.place(leaf));
                return Err(Failure::input(format_args!(
                    "seed {i} at {at} lies in the crossing leaf {leaf}, which facet {facet} crosses; move it away \
                     from the surface"
                )));
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
fn root(file: &CaseFile, facets: &[Facet]) -> Result<Root> {
    if let Some(root) = file.root {
        let why = "root_scale and [root] exclude each other; give one of them";
        Failure::unless(file.root_scale.is_none(), why)?;
        positive("root edge", root.edge)?;
        let is_finite = root.origin.iter().all(|c| c.is_finite());
        return Failure::unless(is_finite, "the root's origin is not finite").map(|()| root);
    }
    let scale = file.root_scale.unwrap_or(10.0);
    positive("root_scale", scale)?;
    let along = |a: usize| facets.as_flattened().iter().map(move |vertex| f64::from(vertex[a]));
    let low = [0, 1, 2].map(|a| along(a).fold(f64::INFINITY, f64::min));
    let high = [0, 1, 2].map(|a| along(a).fold(f64::NEG_INFINITY, f64::max));
    let longest = (0..3).map(|a| high[a] - low[a]).fold(f64::NEG_INFINITY, f64::max);
    let why = "the body has no extent from which to compute a root; give a [root]";
    Failure::unless(longest > 0.0, why)?;
    let edge = scale * longest;
    Ok(Root { origin: std::array::from_fn(|a| (low[a] + high[a]) * 0.5 - edge * 0.5), edge })
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

fn positive(what: &str, value: f64) -> Result<()> {
    let why = format!("{what} = {value} must be finite and greater than zero");
    Failure::unless(value.is_finite() && value > 0.0, why)
}

/// The page that has an example of every key.
const DEFINITION: &str = include_str!("../../../reference/DEFINITION.md");

/// A TOML error in one line, with the line of the file, counted from 1, the key or table on it, and the examples of the key in a page.
pub fn explain(text: &str, error: &toml::de::Error, page: &str) -> String {
    let message = error.message().replace("expected f64", "expected a number").replace('\n', " ");
    let at = error.span().map_or(0, |span| span.start);
    let begin = text[..at].rfind('\n').map_or(0, |at| at + 1);
    let number = text[..begin].matches('\n').count() + 1;
    let line = text[begin..].lines().next().unwrap_or_default();
    let key = line.split('=').next().unwrap_or_default().trim();
    let is_missing = message.starts_with("missing");
    let wrong = if is_missing { message.split('`').nth(1).unwrap_or_default() } else { key };
    let lines = page.lines().map(|line| line.trim_start_matches(['#', '|', '`', ' ']));
    let of_key = lines.filter(|line| line.split_once(" = ").is_some_and(|of| of.0 == wrong));
    let examples = of_key.filter_map(|line| Some(line.split(['#', '`']).next()?.trim()));
    let example = Vec::from_iter(examples.collect::<BTreeSet<_>>()).join(" or ");
    let example = if example.is_empty() { example } else { format!("; for example {example}") };
    match at == 0 && is_missing {
        // Of the file as a whole.
        true => message + &example,
        false => format!("line {number}, {key}: {message}{example}"),
    }
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
        assert_eq!((case.enclosed, case.seeds), (Enclosed::Delete, vec![]));
        let case = with("seeds = [[0, 1.5, -4], [1, 1, 1]]\nenclosed = 'keep'").unwrap();
        assert_eq!(case.seeds, [[0.0, 1.5, -4.0], [1.0; 3]]);
        assert_eq!(case.rules.seeds, [[4 << 24, 11 << 23, 0], [5 << 24; 3]]);
        assert_eq!(case.enclosed, Enclosed::Keep);
        let why = with("seeds = [[0, 0, 0], [4, 0, 0]]").unwrap_err();
        assert!(
            why.starts_with(
                "seed 1 at (4, 0, 0) lies outside the root, corner [-4.0, -4.0, -4.0], edge 8;"
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
        assert_eq!(
            why("layer_cells_min = 3"),
            "missing field `spacing_min`; for example spacing_min = 0.01"
        );
        let text = "spacing_min = 1.0\n\n[root]\norigin = [0.0, 0.0, 0.0]\nedge = 'long'";
        assert!(why(text).starts_with("line 5, edge: invalid type: string"), "{}", why(text));
        let without_edge = why("spacing_min = 1.0\n[root]\norigin = [0.0, 0.0, 0.0]");
        assert_eq!(without_edge, "line 2, [root]: missing field `edge`; for example edge = 8.0");
        let both = "spacing_min = 1.0\nroot_scale = inf";
        assert_eq!(why(both), "root_scale = inf must be finite and greater than zero");
        let root = "spacing_min = 1.0\n[root]\norigin = [0.0, nan, 0.0]\nedge = 8.0";
        assert_eq!(why(root), "the root's origin is not finite");
        assert!(why("spacing_min = 0.0").starts_with("spacing_min = 0 must be finite"));
    }

    #[test]
    fn errors_name_the_cause() {
        let why = |text: &str| Case::from_parts(text, vec![UNIT]).unwrap_err();
        let unknown = why("spacing_mim = 1.0");
        assert!(
            unknown
                .starts_with("line 1, spacing_mim: unknown field `spacing_mim`, expected one of"),
            "{unknown}"
        );
        for surplus in ["seeds = [[0, 0, 0, 1]]", "root = [[0, 0, 0], 8, 1]"] {
            assert!(
                why(&format!("spacing_min = 1.0\n{surplus}")).contains("longer than"),
                "{surplus}"
            );
        }
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
                why.starts_with("line 2, geometry: ") && why.contains("geometry = 'uav.stl'"),
                "{why}"
            );
        }
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
