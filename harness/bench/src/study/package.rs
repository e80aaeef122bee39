//! A study with its cases and geometries in one directory, so that it can be executed elsewhere.

use super::Study;
use contract::catalogue::Catalogue;
use contract::failure::Failure;
use contract::files::{self, read_text, write_atomically};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Name of the study's file in the directory.
pub const STUDY: &str = "study.toml";

/// Copies a study, and the cases and geometry files that it names, into a directory. Cases that generate their geometry have none.
///
/// # Errors
/// If the study is invalid, a file cannot be read or written, or two files have one name.
pub fn package(study: &Path, catalogue: &Catalogue, out: &Path) -> Result<(), Failure> {
    let directory = Study::read(study)?.directory;
    let mut table = read(study)?;
    let mut package = Package { out, copied: BTreeMap::new() };
    // No case may have the name of the study.
    package.copied.insert(STUDY.into(), canonical(study)?);
    for (key, value) in &mut table {
        let with_cases: Vec<&mut Value> = match (key.as_str(), value) {
            ("mesh", Value::Table(meshes)) => meshes.iter_mut().map(|(_, mesh)| mesh).collect(),
            ("series", Value::Array(series)) => series.iter_mut().collect(),
            _ => Vec::new(),
        };
        for value in with_cases {
            package.case_of(value, &directory, catalogue)?;
        }
    }
    put(&out.join(STUDY), table.to_string().as_bytes())
}

fn read(path: &Path) -> Result<Table, Failure> {
    let text = read_text(path).map_err(|error| Failure::at(path, error))?;
    text.parse().map_err(|error: toml::de::Error| Failure::input(error).of_file(path))
}

fn canonical(path: &Path) -> Result<PathBuf, Failure> {
    path.canonicalize().map_err(|error| Failure::at(path, error))
}

/// Copies a file, which must be no pipe: it would be waited for.
///
/// # Errors
/// If it cannot be read or written.
pub fn copy(from: &Path, to: &Path) -> Result<(), Failure> {
    let bytes = files::read(from).map_err(|error| Failure::at(from, error))?;
    put(to, &bytes)
}

fn put(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    write_atomically(path, |out| out.write_all(bytes)).map_err(|error| Failure::at(path, error))
}

struct Package<'a> {
    out: &'a Path,
    /// The files, by their names in the directory.
    copied: BTreeMap<PathBuf, PathBuf>,
}

impl Package<'_> {
    /// Copies the case of a mesh or of a series, and replaces its name.
    fn case_of(
        &mut self,
        value: &mut Value,
        directory: &Path,
        catalogue: &Catalogue,
    ) -> Result<(), Failure> {
        let Some(Value::String(case)) = value.get_mut("case") else { return Ok(()) };
        let path = catalogue.case_file(case, directory)?;
        let (name, is_new) = self.place(&path)?;
        *case = name.display().to_string();
        if !is_new {
            return Ok(());
        }
        let mut table = read(&path)?;
        if let Some(Value::String(geometry)) = table.get_mut("geometry") {
            let body = path.parent().unwrap_or(Path::new(".")).join(&*geometry);
            let (name, is_new) = self.place(&body)?;
            *geometry = name.display().to_string();
            if is_new {
                copy(&body, &self.out.join(name))?;
            }
        }
        put(&self.out.join(name), table.to_string().as_bytes())
    }

    /// The name of a file in the directory, and whether it has not been copied yet.
    fn place(&mut self, path: &Path) -> Result<(PathBuf, bool), Failure> {
        let name = PathBuf::from(path.file_name().unwrap_or_default());
        let path = canonical(path)?;
        match self.copied.insert(name.clone(), path.clone()) {
            Some(other) if other != path => Err(Failure::input(format!(
                "{} and {} have one name: rename one",
                other.display(),
                path.display()
            ))),
            before => Ok((name, before.is_none())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_study_elsewhere_has_its_own_cases() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        let (here, there) = (at("here"), at("there"));
        fs::create_dir_all(here.join("bodies")).unwrap();
        fs::create_dir(&there).unwrap();
        let put = |name: &str, text: &str| fs::write(here.join(name), text).unwrap();
        put("bodies/a wing.stl", "solid");
        put("a wing.toml", "spacing_min = 0.1\ngeometry = \"bodies/a wing.stl\"\n");
        put("ball.toml", "spacing_min = 0.1\n[generator]\nshape = \"sphere\"\nfacets = 80\n");
        put(
            "s.toml",
            "[[series]]\nexperiment = \"strong\"\ncase = \"a wing.toml\"\n[[series]]\nexperiment = \"spacing\"\ncase = \"a wing.toml\"\n\
             [mesh.ball]\ncase = \"ball.toml\"\n",
        );
        let catalogue = Catalogue::new(at("none.toml"));
        package(&here.join("s.toml"), &catalogue, &there).unwrap();
        fs::remove_dir_all(&here).unwrap();
        let study = Study::read(&there.join(STUDY)).unwrap();
        assert_eq!((study.series.len(), study.series[1].case.as_str()), (2, "a wing.toml"));
        assert_eq!(study.mesh["ball"].case, "ball.toml");
        assert_eq!(fs::read_to_string(there.join("a wing.stl")).unwrap(), "solid");
        assert!(
            read(&there.join("a wing.toml")).unwrap()["geometry"].as_str() == Some("a wing.stl")
        );
        assert!(there.join("ball.toml").is_file());
    }

    #[test]
    fn two_files_of_one_name_are_refused() {
        let place = tempfile::tempdir().unwrap();
        let mut package = Package { out: place.path(), copied: BTreeMap::new() };
        for (directory, is_new) in [("a", true), ("a", false)] {
            let path = place.path().join(directory).join("b");
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, "").unwrap();
            assert_eq!(package.place(&path).unwrap().1, is_new);
        }
        fs::create_dir(place.path().join("c")).unwrap();
        fs::write(place.path().join("c/b"), "").unwrap();
        assert!(package.place(&place.path().join("c/b")).unwrap_err().why.contains("rename one"));
    }
}
