//! STL files that must be read, and files that must be rejected.

use std::path::PathBuf;

use contract::case::{Case, Facet};
use contract::stl;
use geometries::stl_files;

/// The valid or the invalid files of `geometries/stl-files.txt`, written into a directory.
fn files(are_valid: bool) -> (tempfile::TempDir, Vec<PathBuf>) {
    let place = tempfile::tempdir().unwrap();
    let chosen = stl_files().into_iter().filter(|file| file.is_valid == are_valid);
    let written = |file: geometries::StlFile| {
        let path = place.path().join(&file.name);
        std::fs::write(&path, &file.bytes).unwrap();
        path
    };
    let paths: Vec<_> = chosen.map(written).collect();
    assert!(paths.len() >= 20);
    (place, paths)
}

#[test]
fn all_valid_files_contain_the_same_facets() {
    let (place, files) = files(true);
    let expected: Vec<Facet> = stl::read(&place.path().join("binary.stl")).unwrap().facets;
    assert_eq!(expected.len(), 8);
    for path in files {
        let found = stl::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        assert_eq!(found.facets, expected, "{}", path.display());
    }
}

#[test]
fn a_case_names_its_geometry_relative_to_its_own_file_or_has_none() {
    let place = tempfile::tempdir().unwrap();
    let body = stl_files().into_iter().find(|file| file.name == "binary.stl").unwrap();
    std::fs::create_dir(place.path().join("parts")).unwrap();
    std::fs::write(place.path().join("parts/body.stl"), body.bytes).unwrap();
    let read = |geometry: &str| {
        let path = place.path().join("a.toml");
        let text = "spacing_min = 1.0\nroot = { origin = [-8.0, -8.0, -8.0], edge = 16.0 }\n";
        std::fs::write(&path, format!("{geometry}\n{text}")).unwrap();
        Case::read(&path).unwrap()
    };
    let case = read("geometry = 'parts/body.stl'");
    assert_eq!((case.name.as_str(), case.facets.len()), ("a", 8));
    assert_eq!(case.geometry, Some(place.path().join("parts/body.stl")));
    assert_eq!(read("generator = { shape = 'cube', facets = 12 }").geometry, None);
}

#[test]
fn invalid_files_are_rejected_by_the_reader_or_by_the_case() {
    let text = "spacing_min = 1.0\n[root]\norigin = [-8.0, -8.0, -8.0]\nedge = 16.0";
    let (_place, files) = files(false);
    for path in files {
        let case = stl::read(&path).map(|body| body.facets).map_err(|e| e.to_string());
        let case = case.and_then(|facets| Case::from_parts(text, facets));
        assert!(case.is_err(), "{}", path.display());
    }
}
