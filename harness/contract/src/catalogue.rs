//! The catalogue of cases: selection by name, by size, or by path of a case file.

use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};
use toml::Table;

/// How large the catalogue's cases are to be.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, clap::ValueEnum,
)]
#[serde(rename_all = "lowercase")]
pub enum Size {
    /// Seconds each; every leaf of the base tree is put to the oracles.
    Small,
    /// Up to some millions of cells.
    Medium,
    /// Tens of millions of cells and more: for the tables of speed and memory.
    Large,
}

/// A case that was selected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Selected {
    /// Its name; also that of its directory.
    pub name: String,
    /// What the user has to say to select it again.
    pub argument: String,
    /// The case file.
    pub path: PathBuf,
    /// Its size, if it is the catalogue's.
    pub size: Option<Size>,
    /// Why its geometry is not there.
    pub absent: Option<String>,
}

#[derive(Debug, Deserialize)]
struct Catalogue {
    #[serde(rename = "case")]
    cases: Vec<Entry>,
}

#[derive(Debug, Deserialize)]
struct Entry {
    name: String,
    file: PathBuf,
    size: Size,
}

/// The cases named, in that order; without names, all of the catalogue's of the given sizes.
///
/// # Errors
/// Where a name is neither in the catalogue nor a file, or the catalogue cannot be read.
pub fn select(cases: &[String], sizes: &[Size], catalogue: &Path) -> Result<Vec<Selected>, String> {
    let all = read(catalogue);
    if cases.is_empty() {
        let of_size =
            all?.into_iter().filter(|case| case.size.is_some_and(|size| sizes.contains(&size)));
        return Ok(of_size.collect());
    }
    let mut selected: Vec<Selected> = Vec::new();
    for argument in cases {
        let mut one =
            match Path::new(argument).extension().is_some_and(|extension| extension == "toml") {
                true => of_path(argument)?,
                false => of_name(argument, all.clone()?)?,
            };
        // Directories of results bear the case's name, so two of one name must not meet.
        let same =
            selected.iter().filter(|other| other.path.file_stem() == one.path.file_stem()).count();
        if selected.iter().any(|other| other.name == one.name) {
            one.name = format!("{}-{}", one.name, same + 1);
        }
        selected.push(one);
    }
    Ok(selected)
}

fn of_path(argument: &str) -> Result<Selected, String> {
    let path = fs::canonicalize(argument).map_err(|error| format!("{argument}: {error}"))?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    // A geometry that a user's own case names is not left out if it is not there: it is the user's error.
    Ok(Selected {
        name,
        argument: path.to_string_lossy().into_owned(),
        path,
        size: None,
        absent: None,
    })
}

/// The catalogue's case of this name.
///
/// # Errors
/// Where there is none, or the catalogue cannot be read.
pub fn named(name: &str, catalogue: &Path) -> Result<Selected, String> {
    of_name(name, read(catalogue)?)
}

fn of_name(name: &str, all: Vec<Selected>) -> Result<Selected, String> {
    let names: Vec<String> = all.iter().map(|case| case.name.clone()).collect();
    all.into_iter()
        .find(|case| case.name == name)
        .ok_or_else(|| format!("no case {name} in the catalogue, which has {}", names.join(", ")))
}

fn read(catalogue: &Path) -> Result<Vec<Selected>, String> {
    let wrong = |why: String| format!("{}: {why}", catalogue.display());
    let text = fs::read_to_string(catalogue).map_err(|error| wrong(error.to_string()))?;
    let entries: Catalogue = toml::from_str(&text).map_err(|error| wrong(error.to_string()))?;
    let directory = catalogue.parent().unwrap_or(Path::new("."));
    let selected = |entry: Entry| {
        let path = directory.join(entry.file);
        let (argument, absent) = (entry.name.clone(), absent(&path));
        Selected { name: entry.name, argument, path, size: Some(entry.size), absent }
    };
    Ok(entries.cases.into_iter().map(selected).collect())
}

/// Why the geometry that a case file names is not there; nothing if it is, or if the file names none.
fn absent(case: &Path) -> Option<String> {
    let table: Table = fs::read_to_string(case).ok()?.parse().ok()?;
    let geometry = table.get("geometry")?.as_str()?;
    let path = case.parent()?.join(geometry);
    (!path.exists()).then(|| {
        format!("{geometry} is not here; ci/setup --geometries fetches what may be fetched")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const CATALOGUE: &str = "[[case]]\nname = \"cube_small\"\nfile = \"cube_small.toml\"\nsize = \"small\"\n\
                             [[case]]\nname = \"jet\"\nfile = \"jet.toml\"\nsize = \"large\"\n";

    /// A catalogue of two cases, one without its geometry; what selecting gives, by name.
    fn selecting(cases: &[&str], sizes: &[Size]) -> Result<Vec<(String, bool)>, String> {
        let place = tempfile::tempdir().unwrap();
        let catalogue = place.path().join("catalogue.toml");
        fs::write(&catalogue, CATALOGUE).unwrap();
        fs::write(
            place.path().join("cube_small.toml"),
            "[generator]\nshape = \"cube\"\nfacets = 12",
        )
        .unwrap();
        fs::write(place.path().join("jet.toml"), "geometry = \"fetched/jet.stl\"").unwrap();
        let cases: Vec<String> = cases
            .iter()
            .map(|case| case.replace("HERE", &place.path().to_string_lossy()))
            .collect();
        let selected = select(&cases, sizes, &catalogue)?;
        Ok(selected.into_iter().map(|case| (case.name, case.absent.is_some())).collect())
    }

    fn named(cases: &[(&str, bool)]) -> Result<Vec<(String, bool)>, String> {
        Ok(cases.iter().map(|(name, absent)| ((*name).to_owned(), *absent)).collect())
    }

    #[test]
    fn by_size_by_name_and_by_path() {
        assert_eq!(selecting(&[], &[Size::Small]), named(&[("cube_small", false)]));
        assert_eq!(selecting(&["jet"], &[Size::Small]), named(&[("jet", true)]));
        let paths = ["HERE/jet.toml", "cube_small", "HERE/cube_small.toml"];
        assert_eq!(
            selecting(&paths, &[]),
            named(&[("jet", false), ("cube_small", false), ("cube_small-2", false)])
        );
    }

    #[test]
    fn what_is_no_case_is_named() {
        let unknown = selecting(&["cub"], &[]).unwrap_err();
        assert_eq!(unknown, "no case cub in the catalogue, which has cube_small, jet");
        assert!(selecting(&["HERE/none.toml"], &[]).unwrap_err().contains("none.toml"));
    }
}
