//! Cases, the inputs of the mesh definition (`DEFINITION.md`, section 1), in the user's unit of length; and the reader of case files:
//! TOML in which an unknown key is an error.
use crate::Side;
use crate::error::{Error, read_file};
use crate::stl;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A case. The mesh is a function of these fields alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The body: a soup of triangles, each given by its three vertices.
    pub facets: Vec<[[f64; 3]; 3]>,
    /// The cube that the mesh fills.
    pub root: Root,
    /// Upper bound on the edge length of cells at the surface.
    pub spacing_min: f64,
    /// Minimum thickness of a layer, in cells; at least 1.
    pub layer_cells_min: u32,
    /// The region that the final mesh covers.
    pub keep: Keep,
    /// Whether leaves that contain geometry stay in the final mesh.
    pub keep_crossing: bool,
    /// Extent boxes, each with its own spacing.
    pub boxes: Vec<BoxSpec>,
    /// Points in the flow. If there are any, they and not rays determine the sides.
    pub seeds: Vec<[f64; 3]>,
    /// The treatment of outside components that do not reach the boundary of the root.
    pub enclosed: Enclosed,
}

/// The cube that the mesh fills.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Root {
    /// The minimum corner.
    pub origin: [f64; 3],
    /// The edge length.
    pub edge: f64,
}

impl Root {
    /// The root centred on the bounding box of all vertices, with an edge of `scale` times the
    /// longest edge of that box. `None` if there are no facets.
    #[must_use]
    pub fn around(facets: &[[[f64; 3]; 3]], scale: f64) -> Option<Self> {
        let mut lo = facets.first()?[0];
        let mut hi = lo;
        for vertex in facets.as_flattened() {
            for a in 0..3 {
                lo[a] = lo[a].min(vertex[a]);
                hi[a] = hi[a].max(vertex[a]);
            }
        }
        // The definition fixes the order of operations, so that all programs agree to the last bit.
        let longest = (0..3).map(|a| hi[a] - lo[a]).fold(0.0, f64::max);
        let edge = scale * longest;
        let origin = std::array::from_fn(|a| (lo[a] + hi[a]) * 0.5 - edge * 0.5);
        Some(Self { origin, edge })
    }
}

/// The region that the final mesh covers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Keep {
    /// Outside the body: external flow.
    #[default]
    Outside,
    /// Inside the body: internal flow.
    Inside,
    /// Everything.
    All,
}

impl Keep {
    /// Whether gradation keeps leaves of `side`. Crossing leaves are always kept at this stage.
    #[must_use]
    pub fn keeps(self, side: Side) -> bool {
        match self {
            Keep::Outside => side != Side::Inside,
            Keep::Inside => side != Side::Outside,
            Keep::All => true,
        }
    }
}

/// The treatment of outside components that do not reach the boundary of the root, such as a sealed
/// cavity or the overlap of two closed bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Enclosed {
    /// They are deleted.
    #[default]
    Delete,
    /// They are kept.
    Keep,
}

/// An axis-aligned box with its own spacing.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxSpec {
    /// The minimum corner.
    pub min: [f64; 3],
    /// The maximum corner.
    pub max: [f64; 3],
    /// Upper bound on the edge length of cells that meet the box.
    pub spacing: f64,
}

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
    geometries::refuse_surplus::<CaseFile>(&text).map_err(invalid)?;
    let facets: Vec<stl::Facet> = match (&file.geometry, &file.generator) {
        (Some(geometry), None) => {
            stl::read(&path.parent().unwrap_or(Path::new("")).join(geometry))?
        }
        (None, Some(generator)) => {
            generator.facets().map_err(|error| invalid(error.to_string()))?
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
