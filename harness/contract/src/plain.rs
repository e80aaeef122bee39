//! A case in its plainest form, which every mesher can read: a binary STL file and an explicit root.
//!
//! Invariant: the case that is written defines exactly the same mesh as the case that was read. Vertices remain
//! unchanged f32 values, and a root that was given by `root_scale` is written with its origin and edge.

use crate::case::{Case, Facet};
use std::path::{Path, PathBuf};
use std::{fs, io};
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

    /// Writes `case.toml` and a binary `body.stl` into a directory, which is made, and returns the path of the case file.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, directory: &Path) -> io::Result<PathBuf> {
        fs::create_dir_all(directory)?;
        let mut table = Table::new();
        table.insert("geometry".into(), Value::String("body.stl".into()));
        table.extend(self.table.clone());
        let body = io::BufWriter::new(fs::File::create(directory.join("body.stl"))?);
        geometries::write_stl_binary(&self.facets, body)?;
        let path = directory.join("case.toml");
        fs::write(&path, toml::to_string(&table).expect("a case is representable in TOML"))?;
        Ok(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CASE: &str = "spacing_min = 0.3\nkeep = \"all\"\nroot_scale = 3.7\nenclosed = \"keep\"\nseeds = [[0.0, 0.0, 0.7]]\n[generator]\nshape = \"sphere\"\n\
                        facets = FACETS\n[[box]]\nmin = [0.1, 0.0, 0.0]\nmax = [0.7, 0.3, 0.9]\nspacing = 0.1\n";

    #[test]
    fn a_plain_case_defines_the_same_mesh() {
        for facets in ["20", "5000"] {
            let place = tempfile::tempdir().unwrap();
            let path = place.path().join("given.toml");
            fs::write(&path, CASE.replace("FACETS", facets)).unwrap();
            let given = Case::read(&path).unwrap();
            let plain = PlainCase::of(&given).write(place.path()).unwrap();
            let plain = Case::read(&plain).unwrap();
            assert_eq!((plain.facets, plain.rules), (given.facets, given.rules));
            assert_eq!(plain.seeds, [[0.0, 0.0, 0.7]]);
        }
    }
}
