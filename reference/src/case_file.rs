//! Reader of case files: TOML in which an unknown key is an error.
use crate::case::{BoxSpec, Case, Enclosed, Keep, Root};
use crate::error::{Error, read_file};
use crate::stl;
use serde::Deserialize;
use std::path::{Path, PathBuf};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CaseFile {
    geometry: Option<PathBuf>,
    generator: Option<geometries::Generator>,
    spacing_min: f64,
    #[serde(default = "layer_cells_min")]
    layer_cells_min: u32,
    #[serde(default)]
    keep: Keep,
    #[serde(default = "keep_crossing")]
    keep_crossing: bool,
    root_scale: Option<f64>,
    root: Option<Root>,
    #[serde(default, rename = "box")]
    boxes: Vec<BoxSpec>,
    #[serde(default)]
    seeds: Vec<[f64; 3]>,
    #[serde(default)]
    enclosed: Enclosed,
}

fn layer_cells_min() -> u32 {
    4
}

fn keep_crossing() -> bool {
    true
}

const ROOT_SCALE: f64 = 10.0;

/// Reads a case file and its geometry, from the STL file or the generator that it specifies.
///
/// # Errors
/// The case file or the geometry cannot be read or is invalid. Lengths are checked later, by
/// [`Input::new`](crate::lattice::Input::new).
pub fn read(path: &Path) -> Result<Case, Error> {
    let invalid =
        |problem: String| Error::Invalid(format!("case file {}: {problem}", path.display()));
    let text = String::from_utf8(read_file(path)?)
        .map_err(|error| invalid(format!("{error}; save it as UTF-8")))?;
    let file: CaseFile = toml::from_str(&text).map_err(|error| invalid(explain(&error, &text)))?;
    let facets: Vec<stl::Facet> = match (&file.geometry, &file.generator) {
        (Some(geometry), None) => {
            stl::read(&path.parent().unwrap_or(Path::new("")).join(geometry))?
        }
        (None, Some(generator)) => {
            generator.facets().map_err(|error| invalid(format!("[generator]: {error}")))?
        }
        _ => {
            let problem = "give either `geometry` or a [generator] table, exactly one of the two";
            return Err(invalid(problem.to_owned()));
        }
    };
    let facets: Vec<_> = facets.iter().map(|facet| facet.map(|v| v.map(f64::from))).collect();
    Ok(Case {
        root: root(&file, &facets).map_err(invalid)?,
        facets,
        spacing_min: file.spacing_min,
        layer_cells_min: file.layer_cells_min,
        keep: file.keep,
        keep_crossing: file.keep_crossing,
        boxes: file.boxes,
        seeds: file.seeds,
        enclosed: file.enclosed,
    })
}

fn root(file: &CaseFile, facets: &[[[f64; 3]; 3]]) -> Result<Root, String> {
    match (file.root, file.root_scale) {
        (Some(_), Some(_)) => {
            Err("give either `root_scale` or a [root] table, not both".to_owned())
        }
        (Some(root), None) => Ok(root),
        (None, Some(scale)) if !(scale.is_finite() && scale > 0.0) => {
            Err(format!("root_scale is {scale}: it must be finite and greater than 0"))
        }
        (None, scale) => Root::around(facets, scale.unwrap_or(ROOT_SCALE))
            .filter(|root| root.edge > 0.0)
            .ok_or_else(|| {
                "the geometry has no facets or its bounding box has no extent, so `root_scale` \
                 cannot define the root; give a [root] table or another geometry"
                    .to_owned()
            }),
    }
}

/// One sentence with the line of the error; for an unknown key, with all known ones.
fn explain(error: &toml::de::Error, text: &str) -> String {
    let before = error.span().and_then(|span| text.get(..span.start)).unwrap_or_default();
    let line = before.matches('\n').count() + 1;
    format!("line {line}: {}; correct the case file", error.message())
}
