//! The catalogue of cases (`geometries/catalogue.toml`): cases by name, by size, or by the path of a case file.

use crate::files;
use crate::number::numbered;
use ::files::{clash, register_input};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf, absolute};
use std::{fs, io};

/// Size class of a case in the catalogue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Size {
    /// Seconds each; the oracles decide every leaf of the base tree.
    Small,
    /// Up to some millions of cells.
    Medium,
    /// Tens of millions of cells and more: for the tables of speed and memory.
    Large,
}

/// A case that was selected.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
pub struct Selected {
    /// Its name, which is also the name of its directory.
    pub name: String,
    /// The command-line argument that selects it again.
    #[serde(skip)]
    pub argument: String,
    /// The case file.
    #[serde(rename = "file")]
    pub path: PathBuf,
    /// Its size, if it is in the catalogue.
    pub size: Option<Size>,
    /// Set if its geometry file does not exist: which file, and how to get it.
    #[serde(skip)]
    pub absent: Option<String>,
}

/// The catalogue. Its file is read by a look-up that needs it: a user's own case file can be selected without a catalogue.
#[derive(Clone, Debug)]
pub struct Catalogue {
    /// Its file.
    pub path: PathBuf,
}

#[derive(Debug, Deserialize)]
struct CatalogueFile {
    case: Vec<Selected>,
}

impl Catalogue {
    /// The selected cases, in the order of `arguments`, which are names or paths of case files. Without
    /// arguments, all cases of the catalogue that have one of these sizes.
    ///
    /// # Errors
    /// One sentence, if an argument is neither in the catalogue nor a file, or if the catalogue cannot be read.
    pub fn select(&self, arguments: &[String], sizes: &[Size]) -> Result<Vec<Selected>, String> {
        let mut selected: Vec<Selected> = Vec::new();
        if arguments.is_empty() {
            let of_size = |case: &Selected| case.size.is_some_and(|size| sizes.contains(&size));
            selected.extend(self.cases()?.into_iter().filter(of_size));
        }
        for argument in arguments {
            let mut case = match is_path(argument) {
                // A missing geometry is an error of a user's own case, and not a reason to leave it out.
                true => {
                    // Its geometry is beside the link, if it is one.
                    let path = fs::metadata(argument).and_then(|_| absolute(argument));
                    let path = path.map_err(|e| format!("{argument}: {e}"))?;
                    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                    let argument = path.to_string_lossy().into_owned();
                    Selected { name, argument, path, size: None, absent: None }
                }
                false => self.named(argument)?,
            };
            // A directory of results has the name of its case, so names must be unique.
            let is_free = |name: &String| selected.iter().all(|other| other.name != *name);
            case.name = numbered(&case.name, '-', is_free);
            selected.push(case);
        }
        // An input that is an output, too, is found before work begins.
        for Selected { path, .. } in &selected {
            let geometry = geometry_of(path).map(|file| path.with_file_name(file));
            geometry.map_or(Ok(()), |file| register_input(&file)).map_err(|why| why.to_string())?;
        }
        clash().map_or(Ok(selected), |why| Err(why.to_owned()))
    }

    /// The case of the catalogue with this name.
    ///
    /// # Errors
    /// One sentence, if there is none, or if the catalogue cannot be read.
    pub fn named(&self, name: &str) -> Result<Selected, String> {
        let cases = self.cases()?;
        cases.iter().find(|case| case.name == name).cloned().ok_or_else(|| {
            if name.to_lowercase().ends_with(".stl") || Path::new(name).exists() {
                return format!(
                    "{name} is neither the name of a case nor a case file: give CASE.toml, with the name of a geometry in `geometry` and a `spacing_min` (reference/DEFINITION.md, section 9)"
                );
            }
            let last = name.rsplit('/').next().unwrap_or_default();
            let alike = |case: &&Selected| strsim::jaro_winkler(last, &case.name);
            let near = cases.iter().max_by(|a, b| alike(a).total_cmp(&alike(b)));
            let near = near.map_or(String::new(), |near| format!("; the most similar name there is {}", near.name));
            format!(
                "{name}: no such file or directory exists, nor a case of this name in {}{near}",
                self.path.display()
            )
        })
    }

    /// The case file that an argument selects: a path, relative to `directory`, or a name in the catalogue.
    ///
    /// # Errors
    /// As [`Catalogue::named`].
    pub fn case_file(&self, argument: &str, directory: &Path) -> Result<PathBuf, String> {
        match is_path(argument) {
            true => Ok(directory.join(argument)),
            false => self.named(argument).map(|case| case.path),
        }
    }

    fn cases(&self) -> Result<Vec<Selected>, String> {
        let wrong = |why: String| format!("{}: {why}", self.path.display());
        let missing = "the catalogue of cases is missing: give the path of a case file, or set HARNESS_ROOT to the repository";
        let text = files::read_text(&self.path).map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => wrong(missing.to_owned()),
            _ => wrong(error.to_string()),
        })?;
        let file: CatalogueFile = toml::from_str(&text).map_err(|e| wrong(e.to_string()))?;
        let mut cases = file.case;
        for case in &mut cases {
            case.argument.clone_from(&case.name);
            case.path = self.path.with_file_name(&case.path);
            case.absent = missing_geometry(&case.path);
            case.size.ok_or_else(|| wrong(format!("the case {} has no size", case.name)))?;
        }
        Ok(cases)
    }
}

/// Whether an argument is the path of a case file and not a name.
fn is_path(argument: &str) -> bool {
    Path::new(argument).extension().is_some_and(|extension| extension == "toml")
}

/// The geometry file that a case file names. An unreadable case file is reported when the case is used.
fn geometry_of(case: &Path) -> Option<String> {
    let table = files::read_text(case).ok()?.parse::<toml::Table>().ok()?;
    Some(table.get("geometry")?.as_str()?.to_owned())
}

/// A sentence if the case file names a geometry file that does not exist.
fn missing_geometry(case: &Path) -> Option<String> {
    let geometry = geometry_of(case)?;
    let exists = case.with_file_name(&geometry).exists();
    let why = "is missing; ci/setup --geometries fetches it if it can be fetched";
    (!exists).then(|| format!("{geometry} {why}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CATALOGUE: &str = "[[case]]\nname = \"cube_small\"\nfile = \"cube_small.toml\"\nsize = \"small\"\n\
                             [[case]]\nname = \"jet\"\nfile = \"jet.toml\"\nsize = \"large\"\n";

    /// The name of each selected case and whether its geometry is missing, or the error, for a catalogue of two
    /// cases, the larger without its geometry. `HERE` in an argument is the catalogue's directory.
    fn select(arguments: &[&str], sizes: &[Size]) -> Result<Vec<(String, bool)>, String> {
        let place = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(place.path().join(name), text).unwrap();
        write("catalogue.toml", CATALOGUE);
        write("cube_small.toml", "[generator]\nshape = \"cube\"\nfacets = 12");
        write("jet.toml", "geometry = \"fetched/jet.stl\"");
        write("cube_small-2.toml", "");
        let here = place.path().to_string_lossy();
        let arguments: Vec<String> =
            arguments.iter().map(|argument| argument.replace("HERE", &here)).collect();
        let catalogue = Catalogue { path: place.path().join("catalogue.toml") };
        let selected = catalogue.select(&arguments, sizes)?;
        Ok(selected.into_iter().map(|case| (case.name, case.absent.is_some())).collect())
    }

    fn cases(cases: &[(&str, bool)]) -> Result<Vec<(String, bool)>, String> {
        Ok(cases.iter().map(|(name, absent)| ((*name).to_owned(), *absent)).collect())
    }

    #[test]
    fn cases_are_selected_by_size_by_name_and_by_path() {
        assert_eq!(select(&[], &[Size::Small]), cases(&[("cube_small", false)]));
        assert_eq!(select(&["jet"], &[Size::Small]), cases(&[("jet", true)]));
        let paths = ["HERE/jet.toml", "cube_small", "HERE/cube_small.toml"];
        assert_eq!(
            select(&paths, &[]),
            cases(&[("jet", false), ("cube_small", false), ("cube_small-2", false)])
        );
    }

    /// The files of a case may be links into a store.
    #[test]
    fn a_case_that_is_a_link_keeps_its_name_and_directory() {
        let place = tempfile::tempdir().unwrap();
        let link = place.path().join("case.toml");
        fs::create_dir(place.path().join("store")).unwrap();
        fs::write(place.path().join("store/7f3a"), "").unwrap();
        std::os::unix::fs::symlink("store/7f3a", &link).unwrap();
        let catalogue = Catalogue { path: "nowhere/catalogue.toml".into() };
        let selected = catalogue.select(&[link.to_string_lossy().into_owned()], &[]).unwrap();
        assert_eq!((selected[0].name.as_str(), &selected[0].path), ("case", &link));
    }

    #[test]
    fn an_unknown_name_and_a_missing_file_are_errors() {
        let unknown = select(&["cub"], &[]).unwrap_err();
        assert!(
            unknown.starts_with("cub: no such file or directory exists, nor a case"),
            "{unknown}"
        );
        assert!(
            unknown.ends_with("catalogue.toml; the most similar name there is cube_small"),
            "{unknown}"
        );
        assert!(select(&["HERE/none.toml"], &[]).unwrap_err().contains("none.toml"));
    }

    #[test]
    fn a_name_that_is_a_geometry_or_another_file_is_explained() {
        let stl = select(&["wing.STL"], &[]).unwrap_err();
        let neither = "is neither the name of a case nor a case file: give CASE.toml, with";
        assert!(stl.starts_with(&format!("wing.STL {neither}")), "{stl}");
        let other = select(&["HERE/jet.txt"], &[]).unwrap_err();
        assert!(other.contains("no such file or directory exists"), "{other}");
        assert!(other.ends_with("the most similar name there is jet"), "{other}");
        let existing = select(&["HERE"], &[]).unwrap_err();
        assert!(existing.contains(neither), "{existing}");
        let three = ["cube_small", "cube_small", "HERE/cube_small.toml"];
        let expected = [("cube_small", false), ("cube_small-2", false), ("cube_small-3", false)];
        assert_eq!(select(&three, &[]), cases(&expected));
        // A name that a number would make may be there already.
        let taken = ["HERE/cube_small-2.toml", "cube_small", "HERE/cube_small.toml"];
        let expected = [("cube_small-2", false), ("cube_small", false), ("cube_small-3", false)];
        assert_eq!(select(&taken, &[]), cases(&expected));
        assert_eq!(select(&[], &[Size::Large, Size::Medium]), cases(&[("jet", true)]));
    }

    #[test]
    fn a_path_needs_no_catalogue_and_a_name_does() {
        let catalogue = Catalogue { path: "nowhere/catalogue.toml".into() };
        let path = catalogue.case_file("case.toml", Path::new("there"));
        assert_eq!(path, Ok(PathBuf::from("there/case.toml")));
        assert!(catalogue.named("cube").unwrap_err().starts_with("nowhere/catalogue.toml: "));
    }
}
