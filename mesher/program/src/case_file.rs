//! The case file: all programs of this workspace read the same files.

use geometries::Generator;
use mesher::error::Error;
use mesher::input::case::{BoxSpec, Case, RootSpec};
use mesher::input::ingest::Source;
use mesher::input::lattice::{Enclosed, Keep, Root};
use serde::Deserialize;
use std::path::Path;

/// Default of `layer_cells_min`.
pub const LAYER_CELLS_MIN: u32 = 4;
/// Default of `root_scale`.
pub const ROOT_SCALE: f64 = 10.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    geometry: Option<String>,
    generator: Option<Generator>,
    spacing_min: f64,
    layer_cells_min: Option<i64>,
    keep: Option<Keep>,
    keep_crossing: Option<bool>,
    #[serde(default)]
    seeds: Vec<[f64; 3]>,
    #[serde(default)]
    enclosed: Enclosed,
    root_scale: Option<f64>,
    root: Option<RootTable>,
    #[serde(default, rename = "box")]
    boxes: Vec<BoxSpec>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RootTable {
    origin: [f64; 3],
    edge: f64,
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
    files::read_text(path)
        .map_err(|e| Error::input(format!("{}: {e}: give a readable case file", path.display())))
}

/// The case of a file with this text.
///
/// # Errors
/// If the text is malformed.
pub fn parse(text: &str, path: &Path) -> Result<Case, Error> {
    let fail = |e: &dyn std::fmt::Display| Error::input(format!("{}: {e}", path.display()));
    let file: File = toml::from_str(text).map_err(|e| fail(&explain(text, &e)))?;
    let folder = path.parent().unwrap_or(Path::new("."));
    file.into_case(folder).map_err(|e| fail(&e))
}

impl File {
    fn into_case(self, folder: &Path) -> Result<Case, Error> {
        let source = match (self.geometry, self.generator) {
            (Some(path), None) => Source::Stl(folder.join(path)),
            (None, Some(g)) => Source::Generated(g),
            (Some(_), Some(_)) => {
                return Err(Error::input("give geometry or [generator], not both"));
            }
            (None, None) => {
                return Err(Error::input(
                    "no geometry: give geometry = \"file.stl\" or a [generator] table",
                ));
            }
        };
        let root = match (self.root_scale, self.root) {
            (Some(_), Some(_)) => return Err(Error::input("give root_scale or [root], not both")),
            (_, Some(r)) => RootSpec::Exact(Root { origin: r.origin, edge: r.edge }),
            (scale, None) => RootSpec::Scale(scale.unwrap_or(ROOT_SCALE)),
        };
        let n = self.layer_cells_min.unwrap_or(i64::from(LAYER_CELLS_MIN));
        let layer_cells_min = u32::try_from(n).map_err(|_| {
            Error::input(format!(
                "layer_cells_min is {n}: give a whole number from 1 to {}",
                u32::MAX
            ))
        })?;
        Ok(Case {
            source,
            spacing_min: self.spacing_min,
            layer_cells_min,
            keep: self.keep.unwrap_or(Keep::Outside),
            keep_crossing: self.keep_crossing.unwrap_or(true),
            root,
            boxes: self.boxes,
            seeds: self.seeds,
            enclosed: self.enclosed,
        })
    }
}

/// One sentence about a malformed case file, with the line.
fn explain(text: &str, e: &toml::de::Error) -> String {
    let before = e.span().map_or("", |s| &text[..s.start]);
    let message = e.message().replace('\n', " ").replace("expected f64", "expected a number");
    match before.matches('\n').count() {
        // Of the file as a whole.
        0 if message.starts_with("missing") => message,
        lines => format!("line {}: {message}", lines + 1),
    }
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
                "layer_cells_min is -1",
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
