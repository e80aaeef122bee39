//! Case files: TOML, in which a key that nobody knows is an error.
use crate::case::{BoxSpec, Case, Keep, Root};
use crate::error::Error;
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
}

fn layer_cells_min() -> u32 {
    4
}

fn keep_crossing() -> bool {
    true
}

const ROOT_SCALE: f64 = 10.0;

/// Reads a case file and the geometry that it names.
///
/// # Errors
/// A file that cannot be read or makes no sense. Sizes are checked when the case is meshed.
pub fn read(path: &Path) -> Result<Case, Error> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| Error::Read { path: path.to_owned(), source })?;
    let wrong = |problem: String| Error::CaseFile { path: path.to_owned(), problem };
    let file: CaseFile = toml::from_str(&text).map_err(|error| wrong(explain(&error, &text)))?;
    let facets: Vec<stl::Facet> = match (&file.geometry, &file.generator) {
        (Some(geometry), None) => {
            stl::read(&path.parent().unwrap_or(Path::new("")).join(geometry))?
        }
        (None, Some(generator)) => {
            generator.facets().map_err(|error| wrong(format!("[generator]: {error}")))?
        }
        _ => {
            let sentence =
                "give either `geometry` or a [generator] table, one and only one of them";
            return Err(wrong(sentence.to_owned()));
        }
    };
    let facets: Vec<_> = facets.iter().map(|facet| facet.map(|v| v.map(f64::from))).collect();
    Ok(Case {
        root: root(&file, &facets).map_err(wrong)?,
        facets,
        spacing_min: file.spacing_min,
        layer_cells_min: file.layer_cells_min,
        keep: file.keep,
        keep_crossing: file.keep_crossing,
        boxes: file.boxes,
    })
}

fn root(file: &CaseFile, facets: &[[[f64; 3]; 3]]) -> Result<Root, String> {
    match (file.root, file.root_scale) {
        (Some(_), Some(_)) => Err("give either `root_scale` or a [root] table, not both".to_owned()),
        (Some(root), None) => Ok(root),
        (None, Some(scale)) if !(scale.is_finite() && scale > 0.0) => {
            Err(format!("root_scale is {scale}: it must be finite and greater than 0"))
        }
        (None, scale) => Root::around(facets, scale.unwrap_or(ROOT_SCALE))
            .filter(|root| root.edge > 0.0)
            .ok_or_else(|| {
                "the geometry has no facets or no size, so that `root_scale` cannot place the root; \
                 give a [root] table or another geometry"
                    .to_owned()
            }),
    }
}

/// A sentence with the line, and the known key nearest to an unknown one.
fn explain(error: &toml::de::Error, text: &str) -> String {
    let before = error.span().and_then(|span| text.get(..span.start));
    let place = before
        .map_or(String::new(), |before| format!("line {}: ", before.matches('\n').count() + 1));
    // Serde says: unknown field `got`, expected one of `a`, `b`. So the names are in back quotes.
    let message = error.message();
    let names: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    match names.split_first() {
        Some((unknown, known)) if message.starts_with("unknown ") => {
            let nearest = known.iter().min_by_key(|name| strsim::osa_distance(unknown, name));
            let advice = nearest.map_or(String::new(), |name| format!("; did you mean `{name}`?"));
            format!("{place}{message}{advice}")
        }
        _ => format!("{place}{message}; mend it"),
    }
}
