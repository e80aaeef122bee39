//! The STL files in `bad/` and `tricky/` match the descriptions in their READMEs.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn here(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn files(directory: &str) -> BTreeSet<String> {
    std::fs::read_dir(here(directory))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".stl"))
        .collect()
}

fn bytes(directory: &str, name: &str) -> Vec<u8> {
    std::fs::read(here(directory).join(name)).unwrap()
}

/// Whether a file has the length of a binary STL file with its facet count.
fn is_binary(data: &[u8]) -> bool {
    let count = data.get(80..84).map(|b| u32::from_le_bytes(b.try_into().unwrap()));
    count.is_some_and(|count| data.len() as u64 == 84 + 50 * u64::from(count))
}

fn coordinates_binary(data: &[u8]) -> Vec<f32> {
    let records = data[84..].chunks_exact(50);
    let numbers = records.flat_map(|record| record[12..48].chunks_exact(4));
    numbers.map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

/// The coordinates on the lines that start with "vertex", which suffices for these files.
fn coordinates_text(data: &[u8]) -> Vec<f32> {
    let text: String = data.iter().map(|&b| char::from(b).to_ascii_lowercase()).collect();
    let lines = text.split(['\r', '\n']).map(|line| line.split_whitespace().collect::<Vec<_>>());
    let vertices = lines.filter(|words| words.first() == Some(&"vertex"));
    vertices.flat_map(|words| [1, 2, 3].map(|i| words[i].parse().unwrap())).collect()
}

#[test]
fn readmes_list_exactly_the_files() {
    for directory in ["bad", "tricky"] {
        let readme = String::from_utf8(bytes(directory, "README.md")).unwrap();
        let listed: BTreeSet<String> = readme
            .lines()
            .filter_map(|line| line.strip_prefix("| `"))
            .map(|line| line.split('`').next().unwrap().to_owned())
            .collect();
        assert_eq!(listed, files(directory), "{directory}");
        assert!(listed.len() >= 20, "{directory}");
    }
}

#[test]
fn all_tricky_files_contain_the_same_facets() {
    let expected = coordinates_binary(&bytes("tricky", "binary.stl"));
    assert_eq!(expected.len(), 8 * 9);
    for name in files("tricky") {
        let data = bytes("tricky", &name);
        assert_eq!(is_binary(&data), name.starts_with("binary"), "{name}");
        let found =
            if is_binary(&data) { coordinates_binary(&data) } else { coordinates_text(&data) };
        assert_eq!(found, expected, "{name}");
    }
}

#[test]
fn bad_files_have_the_wrong_length_for_binary_stl_or_one_number_that_is_not_finite() {
    let good = bytes("tricky", "binary.stl");
    for name in files("bad") {
        let data = bytes("bad", &name);
        let one_is_not_finite =
            || coordinates_binary(&data).iter().filter(|x| !x.is_finite()).count() == 1;
        assert!(!is_binary(&data) || one_is_not_finite(), "{name}");
        assert_ne!(data, good);
    }
    assert!(is_binary(&bytes("bad", "nan.stl")) && is_binary(&bytes("bad", "infinite.stl")));
}
