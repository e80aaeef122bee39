//! STL files that must be read, and files that must be rejected.

use std::path::{Path, PathBuf};

use contract::case::{Case, Facet};
use contract::stl;

fn files(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../geometries").join(folder);
    let paths = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let stl: Vec<_> = paths.filter(|p| p.extension().is_some_and(|e| e == "stl")).collect();
    assert!(stl.len() > 10);
    stl
}

#[test]
fn all_tricky_files_contain_the_same_facets() {
    let files = files("tricky");
    let plain = files.iter().find(|p| p.ends_with("tricky/binary.stl")).unwrap();
    let expected: Vec<Facet> = stl::read(plain).unwrap().facets;
    assert_eq!(expected.len(), 8);
    for path in files {
        let found = stl::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        assert_eq!(found.facets, expected, "{}", path.display());
    }
}

#[test]
fn a_case_names_its_geometry_relative_to_its_own_file_or_has_none() {
    let place = tempfile::tempdir().unwrap();
    let tricky = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../geometries/tricky/binary.stl");
    std::fs::create_dir(place.path().join("parts")).unwrap();
    std::fs::copy(tricky, place.path().join("parts/body.stl")).unwrap();
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
fn bad_files_are_rejected_by_the_reader_or_by_the_case() {
    let text = "spacing_min = 1.0\n[root]\norigin = [-8.0, -8.0, -8.0]\nedge = 16.0";
    for path in files("bad") {
        let case = stl::read(&path).map(|body| body.facets).map_err(|e| e.to_string());
        let case = case.and_then(|facets| Case::from_parts(text, facets));
        assert!(case.is_err(), "{}", path.display());
    }
}
