//! What all programs share: the test vectors (reference/vectors), and STL files that must be read and that must be rejected.

use contract::case::{Case, Facet};
use contract::digest::{Digest, mix};
use contract::lattice::{FacetLattice, Root};
use contract::manifest::octant_index;
use contract::octant::Octant;
use contract::stl::{self, Solid};
use contract::word::{self, Side};
use geometries::stl_files;
use serde_json::Value;
use std::path::PathBuf;

fn vectors(name: &str) -> Vec<Value> {
    let text = include_str!("../../../reference/vectors/digest.json");
    let all: Value = serde_json::from_str(text).unwrap();
    let list = all[name].as_array().unwrap().clone();
    assert!(!list.is_empty());
    list
}

fn hex(value: &Value) -> u64 {
    u64::from_str_radix(value.as_str().unwrap(), 16).unwrap()
}

/// The vectors contain floating-point numbers as strings, because some JSON readers round numbers.
fn float(value: &Value) -> f64 {
    value.as_str().unwrap().parse().unwrap()
}

fn triple<T>(value: &Value, of: impl Fn(&Value) -> T) -> [T; 3] {
    std::array::from_fn(|a| of(&value[a]))
}

#[test]
fn mixed_words_and_digests_match_the_vectors() {
    for v in vectors("mix") {
        assert_eq!(Digest(mix(hex(&v["word"]))).to_string(), v["mix"]);
    }
    for v in vectors("digests") {
        let words: Vec<u64> = v["words"].as_array().unwrap().iter().map(hex).collect();
        assert_eq!(Digest::of(&words).to_string(), v["digest"]);
    }
}

#[test]
fn digests_of_geometries_match_the_vectors() {
    for v in vectors("geometries") {
        let facet =
            |nine: &Value| [0, 3, 6].map(|v| [0, 1, 2].map(|a| nine[v + a].as_i64().unwrap()));
        let facets: Vec<FacetLattice> = v["facets"].as_array().unwrap().iter().map(facet).collect();
        assert_eq!(Digest::of_facets(&facets).to_string(), v["digest"]);
    }
}

#[test]
fn leaf_words_match_the_vectors() {
    for v in vectors("words") {
        let level = v["level"].as_u64().unwrap() as u8;
        let corner = triple(&v["cell"], |c| c.as_u64().unwrap() as u32);
        let side: Side = serde_json::from_value(v["side"].clone()).unwrap();
        let octant = Octant { corner, level };
        let w = hex(&v["word"]);
        assert_eq!(word::encode(octant, side), w);
        assert_eq!((word::check(w), word::octant(w), word::side(w)), (Ok(()), octant, side));
        assert_eq!(octant_index(w) as u64, v["octant"].as_u64().unwrap());
    }
}

#[test]
fn levels_and_lattice_coordinates_match_the_vectors() {
    for v in vectors("levels") {
        let root = Root { origin: [0.0; 3], edge: float(&v["edge"]) };
        assert_eq!(root.level_for(float(&v["spacing"])).map(u64::from), v["level"].as_u64());
    }
    let root = |v: &Value| Root { origin: triple(&v["origin"], float), edge: float(&v["edge"]) };
    for v in vectors("quantised") {
        let expected =
            (!v["lattice"].is_null()).then(|| triple(&v["lattice"], |q| q.as_i64().unwrap()));
        assert_eq!(root(&v).quantise(triple(&v["vertex"], float)), expected);
    }
    for v in vectors("boxes") {
        for (given, on_lattice) in [("min", "lattice_min"), ("max", "lattice_max")] {
            let expected = triple(&v[on_lattice], |q| q.as_i64().unwrap());
            assert_eq!(root(&v).quantise_clamped(triple(&v[given], float)), expected);
        }
    }
}

#[test]
fn computed_roots_match_the_vectors() {
    for v in vectors("roots") {
        let coordinates = |vertex: &Value| triple(vertex, |c| float(c) as f32);
        let facet: [[f32; 3]; 3] = triple(&v["vertices"], coordinates);
        let text = format!("spacing_min = 1e6\nroot_scale = {}", v["root_scale"].as_str().unwrap());
        let case = Case::from_parts(&text, vec![facet]).unwrap();
        assert_eq!(
            case.root,
            Root { origin: triple(&v["origin"], float), edge: float(&v["edge"]) }
        );
    }
}

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
    assert_eq!(case.solids, [Solid { name: None, facet_first: 0, facets: 8 }]);
    assert_eq!(read("generator = { shape = 'cube', facets = 12 }").solids, []);
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
