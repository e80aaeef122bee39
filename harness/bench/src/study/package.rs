//! A study with its cases and geometries in one directory, so that it can be executed elsewhere.

use super::Study;
use contract::catalogue::Catalogue;
use contract::failure::Failure;
use contract::files::{self, read_text, write_atomically};
use std::path::Path;
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
    for (key, value) in &mut table {
        let with_cases: Vec<&mut Value> = match (key.as_str(), value) {
            ("mesh", Value::Table(meshes)) => meshes.iter_mut().map(|(_, mesh)| mesh).collect(),
            ("series", Value::Array(series)) => series.iter_mut().collect(),
            _ => Vec::new(),
        };
        for value in with_cases {
            let Some(Value::String(case)) = value.get_mut("case") else { continue };
            let path = catalogue.case_file(case, &directory)?;
            *case = file_name(&path);
            let mut of_case = read(&path)?;
            if let Some(Value::String(geometry)) = of_case.get_mut("geometry") {
                let body = path.with_file_name(&*geometry);
                *geometry = file_name(&body);
                copy(&body, &out.join(&*geometry))?;
            }
            put(&out.join(&*case), of_case.to_string().as_bytes())?;
        }
    }
    put(&out.join(STUDY), table.to_string().as_bytes())
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn read(path: &Path) -> Result<Table, Failure> {
    let text = read_text(path).map_err(|error| Failure::at(path, error))?;
    text.parse().map_err(|error: toml::de::Error| Failure::input(error).of_file(path))
}

/// Copies a file, which must be no pipe: it would be waited for.
///
/// # Errors
/// If it cannot be read or written, or the place has another file.
pub fn copy(from: &Path, to: &Path) -> Result<(), Failure> {
    let bytes = files::read(from).map_err(|error| Failure::at(from, error))?;
    put(to, &bytes)
}

/// Writes a file unless it is there.
fn put(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    match std::fs::read(path) {
        Ok(before) if before == bytes => return Ok(()),
        Ok(_) => return Err(Failure::about(path, "two files have this name: rename one")),
        Err(_) => {}
    }
    write_atomically(path, |out| out.write_all(bytes)).map_err(|error| Failure::at(path, error))
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
        let at = |name: &str| place.path().join(name);
        for directory in ["a", "b", "out"] {
            fs::create_dir(at(directory)).unwrap();
        }
        fs::write(at("a/ball.toml"), "spacing_min = 0.1\n").unwrap();
        fs::write(at("b/ball.toml"), "spacing_min = 0.2\n").unwrap();
        let package = |second: &str| {
            let mesh =
                |name: &str, case: &str| format!("[mesh.{name}]\ncase = '{case}/ball.toml'\n");
            let series = "[[series]]\nexperiment = 'strong'\ncase = 'a/ball.toml'\n";
            let text = series.to_owned() + &mesh("one", "a") + &mesh("two", second);
            fs::write(at("s.toml"), text).unwrap();
            package(&at("s.toml"), &Catalogue::new(at("none.toml")), &at("out"))
        };
        assert_eq!(package("a"), Ok(()));
        assert!(package("b").unwrap_err().why.contains("rename one"));
    }
}
