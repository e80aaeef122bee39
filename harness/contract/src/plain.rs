//! A case in its plainest form, which every mesher can read: an STL file and an explicit root.
//!
//! Invariant: the case that is written defines exactly the same mesh as the case that was read. Vertices remain
//! unchanged f32 values, and a root that was given by `root_scale` is written with its origin and edge.

use crate::case::{Case, Facet};
use serde::Deserialize;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// A case whose body is in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct PlainCase {
    /// The case file without its geometry.
    pub table: Table,
    /// The body.
    pub facets: Vec<Facet>,
}

impl PlainCase {
    /// A case in this form.
    pub fn of(case: &Case) -> Self {
        Self { table: case.table.clone(), facets: case.facets.clone() }
    }

    /// Writes `case.toml` and `body.stl` into a directory, which is made, and returns the path of the case file.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, directory: &Path, form: StlForm) -> io::Result<PathBuf> {
        fs::create_dir_all(directory)?;
        let mut table = Table::new();
        table.insert("geometry".into(), Value::String("body.stl".into()));
        table.extend(self.table.clone());
        let body = directory.join("body.stl");
        let few = self.facets.len() <= FACETS_AS_TEXT;
        match form == StlForm::Ascii || form == StlForm::Any && few {
            true => fs::write(body, ascii(&self.facets))?,
            false => geometries::write_stl_binary(
                &self.facets,
                io::BufWriter::new(fs::File::create(body)?),
            )?,
        }
        let path = directory.join("case.toml");
        fs::write(&path, toml::to_string(&table).expect("a case is representable in TOML"))?;
        Ok(path)
    }
}

/// The form of an STL file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StlForm {
    /// ASCII for a small body, which people can read, and binary for a large one.
    #[default]
    Any,
    /// ASCII.
    Ascii,
    /// Binary.
    Binary,
}

/// Largest body that is written as ASCII if the form is [`StlForm::Any`].
const FACETS_AS_TEXT: usize = 1000;

/// An ASCII STL file. Each number has the fewest digits that identify its f32 value.
fn ascii(facets: &[Facet]) -> String {
    let vertex = |[x, y, z]: [f32; 3]| format!("  vertex {x} {y} {z}\n");
    let facet = |facet: &Facet| {
        let vertices = facet.map(vertex).concat();
        format!("facet normal 0 0 0\n outer loop\n{vertices} endloop\nendfacet\n")
    };
    format!("solid body\n{}endsolid body\n", facets.iter().map(facet).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    const CASE: &str = "spacing_min = 0.3\nkeep = \"all\"\nroot_scale = 3.7\nenclosed = \"keep\"\nseeds = [[0.0, 0.0, 0.7]]\n[generator]\nshape = \"sphere\"\n\
                        facets = FACETS\n[[box]]\nmin = [0.1, 0.0, 0.0]\nmax = [0.7, 0.3, 0.9]\nspacing = 0.1\n";

    #[test]
    fn a_plain_case_defines_the_same_mesh() {
        let forms = [(StlForm::Any, true), (StlForm::Ascii, true), (StlForm::Binary, false)];
        for (facets, (form, text)) in
            ["20", "5000"].into_iter().flat_map(|f| forms.map(|form| (f, form)))
        {
            let place = tempfile::tempdir().unwrap();
            let path = place.path().join("given.toml");
            fs::write(&path, CASE.replace("FACETS", facets)).unwrap();
            let given = Case::read(&path).unwrap();
            let plain = PlainCase::of(&given).write(place.path(), form).unwrap();
            let is_text =
                fs::read(place.path().join("body.stl")).unwrap().starts_with(b"solid body");
            assert_eq!(is_text, text && (form == StlForm::Ascii || facets == "20"));
            let plain = Case::read(&plain).unwrap();
            assert_eq!((plain.facets, plain.rules), (given.facets, given.rules));
            assert_eq!(plain.seeds, [[0.0, 0.0, 0.7]]);
        }
    }
}
