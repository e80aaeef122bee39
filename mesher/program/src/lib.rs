//! The case as its file states it, which all programs of this workspace read, or as the command line does beside an STL file.

use clap::ArgAction;
use geometries::Generator;
use mesher::error::Error;
use mesher::input::case::{BoxSpec, Case, RootSpec};
use mesher::input::ingest::Source;
use mesher::input::lattice::{Enclosed, Keep, Root};
use serde::Deserialize;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The keys of a case file, all but the first two of which are options as well.
#[derive(Clone, Default, clap::Args, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[command(next_help_heading = "Options for an STL file")]
pub struct Keys {
    #[arg(skip)]
    geometry: Option<PathBuf>,
    #[arg(skip)]
    generator: Option<Generator>,
    /// Greatest edge of cells at the surface
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    spacing_min: Option<f64>,
    /// Least number of cells across a layer [default: 4]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    layer_cells_min: Option<u32>,
    /// Side of the surface to keep [default: outside]
    #[arg(long, value_enum)]
    keep: Option<Keep>,
    /// Remove crossing leaves from the mesh
    #[arg(long = "drop-crossing", action = ArgAction::SetFalse)]
    keep_crossing: Option<bool>,
    /// Edge of the root, in longest edges of the bounding box, on which it is centred [default: 10]
    #[arg(long, value_name = "X", conflicts_with = "root", allow_negative_numbers = true)]
    root_scale: Option<f64>,
    /// Root cube: minimum corner and edge
    #[arg(long, value_name = "X,Y,Z,EDGE", allow_hyphen_values = true, value_parser = root)]
    root: Option<Root>,
    /// Extent box: minimum corner, maximum corner, spacing; may be repeated
    #[arg(long = "box", value_name = "X0,Y0,Z0,X1,Y1,Z1,SPACING", allow_hyphen_values = true, value_parser = extent_box)]
    #[serde(rename = "box")]
    boxes: Vec<BoxSpec>,
    /// Point in the flow, which then consists of the components with a seed, whatever the rays say; may be repeated
    #[arg(long = "seed", value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = numbers::<3>)]
    seeds: Vec<[f64; 3]>,
    /// Treatment of outside components that do not reach the root's boundary, such as sealed cavities and
    /// overlaps of solids [default: delete]
    #[arg(long, value_enum)]
    enclosed: Option<Enclosed>,
}

fn numbers<const N: usize>(s: &str) -> Result<[f64; N], String> {
    let values: Option<Vec<f64>> = s.split(',').map(|w| w.trim().parse().ok()).collect();
    let values = values.and_then(|v| v.try_into().ok());
    values.ok_or_else(|| format!("give {N} numbers with commas between them"))
}

fn root(s: &str) -> Result<Root, String> {
    numbers(s).map(|[x, y, z, edge]| Root { origin: [x, y, z], edge })
}

fn extent_box(s: &str) -> Result<BoxSpec, String> {
    let [x, y, z, u, v, w, spacing] = numbers(s)?;
    Ok(BoxSpec { min: [x, y, z], max: [u, v, w], spacing })
}

/// Reads a case file. The path of the geometry is relative to the file's directory.
///
/// # Errors
/// If the file cannot be read or is malformed.
pub fn read(path: &Path) -> Result<Case, Error> {
    parse(&read_text(path)?, path)
}

/// The text of a case file.
///
/// # Errors
/// If the file cannot be read.
pub fn read_text(path: &Path) -> Result<String, Error> {
    files::read_text(path).map_err(|e| {
        let is_output = e.kind() == ErrorKind::InvalidInput;
        let advice = if is_output { "" } else { ": give a readable case file" };
        Error::input(format!("{e}{advice}")).at(path)
    })
}

/// The case of a file with this text.
///
/// # Errors
/// If the text is malformed.
pub fn parse(text: &str, path: &Path) -> Result<Case, Error> {
    let case = || {
        let mut keys: Keys = toml::from_str(text).map_err(|e| explain(text, &e))?;
        geometries::refuse_surplus::<Keys>(text)?;
        let source = match (keys.geometry.take(), keys.generator.take()) {
            (Some(file), None) => Ok(Source::Stl(path.with_file_name(file))),
            (None, Some(generator)) => Ok(Source::Generated(generator)),
            (Some(_), Some(_)) => Err("give geometry or [generator], not both"),
            (None, None) => Err("no geometry: give geometry = \"file.stl\" or a [generator] table"),
        }?;
        if keys.root_scale.is_some() && keys.root.is_some() {
            return Err("give root_scale or [root], not both".to_owned());
        }
        keys.case_of(source).ok_or_else(|| "missing field `spacing_min`".to_owned())
    };
    case().map_err(|e| Error::input(e).at(path))
}

impl Keys {
    /// The case with this geometry; none without a spacing.
    pub fn case_of(self, source: Source) -> Option<Case> {
        let scale = RootSpec::Scale(self.root_scale.unwrap_or(10.0));
        Some(Case {
            source,
            spacing_min: self.spacing_min?,
            layer_cells_min: self.layer_cells_min.unwrap_or(4),
            keep: self.keep.unwrap_or(Keep::Outside),
            keep_crossing: self.keep_crossing.unwrap_or(true),
            root: self.root.map_or(scale, RootSpec::Exact),
            boxes: self.boxes,
            seeds: self.seeds,
            enclosed: self.enclosed.unwrap_or_default(),
        })
    }
}

/// One sentence about a malformed case file, with the line.
fn explain(text: &str, e: &toml::de::Error) -> String {
    let before = e.span().map_or("", |s| &text[..s.start]);
    let message = e.message().replace('\n', " ").replace("expected f64", "expected a number");
    let message = message.replace("expected u32", "expected a whole number up to 4294967295");
    format!("line {}: {message}", before.matches('\n').count() + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Case, String> {
        parse(text, Path::new("case.toml")).map_err(|e| e.to_string())
    }

    #[test]
    fn defaults_are_the_documented_ones() {
        let c = parsed("geometry = \"a.stl\"\nspacing_min = 0.5\n").unwrap();
        assert_eq!(
            (c.layer_cells_min, c.keep, c.keep_crossing, c.root),
            (4, Keep::Outside, true, RootSpec::Scale(10.0))
        );
    }

    #[test]
    fn errors_name_the_mistake() {
        for (text, expected) in [
            (
                "geometry = \"a.stl\"\nspacing_mim = 0.5\n",
                "line 2: unknown field `spacing_mim`, expected one of `geometry`, `generator`, `spacing_min`",
            ),
            (
                "geometry = \"a.stl\"\nspacing_min = 1\n[[box]]\nmin = [0,0,0]\nmax = [1,1,1]\nspacing = 1\nlevel = 3\n",
                "line 7: unknown field `level`",
            ),
            ("spacing_min = 0.5\n", "no geometry"),
            ("geometry = \"a.stl\"\n", "spacing_min"),
            (
                "geometry = \"a.stl\"\nspacing_min = 0.5\nlayer_cells_min = -1\n",
                "line 3: invalid value: integer `-1`, expected a whole number",
            ),
            ("geometry = \"a.stl\"\nspacing_min = 0.5\nkeep = \"none\"\n", "none"),
            (
                "geometry = \"a.stl\"\nspacing_min = 0.5\nroot_scale = 2.0\n[root]\norigin = [0,0,0]\nedge = 1\n",
                "not both",
            ),
            (
                "geometry = \"a.stl\"\nspacing_min = 0.5\n[root]\norigin = [0,0,0]\n",
                "line 3: missing field `edge`",
            ),
            (
                "geometry = \"a.stl\"\nspacing_min = 0.5\nseeds = [[0, 0, 0,  1, 1, 1]]\n",
                "a list is longer than what is read of it (invalid length 6",
            ),
            ("geometry = ", "line 1"),
            ("geometry = { a = 1 }\nspacing_min = 1\n", "line 1: invalid type: map"),
            (r#"geometry = "C:\Users\me\a.stl""#, "line 1: "),
            ("geometry = a/b.stl", "line 1: "),
            ("geometry = \"a.stl\"\n[spacing_min]\na = 1\n", "line 2: "),
        ] {
            let e = parsed(text).unwrap_err();
            assert!(e.contains(expected), "{e}");
        }
        let whole = parsed("geometry = \"a.stl\"\n").unwrap_err();
        assert!(whole.contains("missing field") && !whole.contains("line"), "{whole}");
    }
}
