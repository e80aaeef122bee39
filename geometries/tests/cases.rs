//! The case files, the catalogue, `fetch.toml` and SOURCES.md are consistent.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use geometries::Generator;
use serde::Deserialize;
use serde::de::DeserializeOwned;

/// A case file, which may have no other keys.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Case {
    geometry: Option<String>,
    generator: Option<Generator>,
    spacing_min: f64,
    layer_cells_min: Option<u32>,
    keep: Option<Keep>,
    #[serde(rename = "keep_crossing")]
    keep_crossing: Option<bool>,
    #[serde(default)]
    seeds: Vec<[f64; 3]>,
    enclosed: Option<Enclosed>,
    root_scale: Option<f64>,
    root: Option<Root>,
    #[serde(default, rename = "box")]
    boxes: Vec<ExtentBox>,
}

#[derive(Deserialize, PartialEq, Eq, PartialOrd, Ord, Clone, Copy, Debug)]
#[serde(rename_all = "snake_case")]
enum Keep {
    Outside,
    Inside,
    All,
}

#[derive(Deserialize, PartialEq, Eq, PartialOrd, Ord, Clone, Copy, Debug)]
#[serde(rename_all = "snake_case")]
enum Enclosed {
    Delete,
    Keep,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Root {
    origin: [f64; 3],
    edge: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ExtentBox {
    min: [f64; 3],
    max: [f64; 3],
    spacing: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Catalogue {
    case: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    file: String,
    size: Size,
    about: String,
    inside: Option<Inside>,
    cells_about: Option<u64>,
}

#[derive(Deserialize, PartialEq, Eq, Clone, Copy)]
#[serde(rename_all = "snake_case")]
enum Size {
    Small,
    Medium,
    Large,
}

/// Whether the base tree has leaves inside.
#[derive(Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
enum Inside {
    None,
    Some,
}

fn here(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn read<T: DeserializeOwned>(name: &str) -> T {
    let text = std::fs::read_to_string(here(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    toml::from_str(&text).unwrap_or_else(|e| panic!("{name}: {e}"))
}

fn catalogue() -> Vec<Entry> {
    read::<Catalogue>("catalogue.toml").case
}

/// The names of the files in a directory that end with `end`.
fn names(directory: &str, end: &str) -> BTreeSet<String> {
    std::fs::read_dir(here(directory))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(end))
        .collect()
}

#[test]
fn the_catalogue_lists_exactly_the_case_files() {
    let mut files = names(".", ".toml");
    for other in ["Cargo.toml", "catalogue.toml", "fetch.toml"] {
        assert!(files.remove(other), "{other}");
    }
    let entries = catalogue();
    let listed: BTreeSet<String> = entries.iter().map(|entry| entry.file.clone()).collect();
    assert_eq!(files, listed);
    assert_eq!(listed.len(), entries.len(), "a case is listed twice");
    for entry in &entries {
        assert_eq!(entry.file, format!("{}.toml", entry.name));
        assert!(!entry.about.is_empty(), "{}", entry.name);
    }
}

#[test]
fn every_case_file_is_valid_and_states_its_origin() {
    for Entry { file, .. } in catalogue() {
        let case: Case = read(&file);
        assert!(
            case.geometry.is_some() != case.generator.is_some(),
            "{file}: exactly one of the two"
        );
        assert!(case.root.is_none() || case.root_scale.is_none(), "{file}: at most one of the two");
        let lengths = case.boxes.iter().map(|b| b.spacing).chain([case.spacing_min]);
        for length in lengths.chain(case.root_scale).chain(case.root.iter().map(|r| r.edge)) {
            assert!(length.is_finite() && length > 0.0, "{file}: {length}");
        }
        assert!(case.root.is_none_or(|r| r.origin.iter().all(|x| x.is_finite())), "{file}");
        for ExtentBox { min, max, .. } in &case.boxes {
            assert!((0..3).all(|a| min[a] < max[a]), "{file}: {min:?} {max:?}");
        }
        assert!(case.layer_cells_min.is_none_or(|n| n >= 1), "{file}");
        assert!(case.seeds.iter().flatten().all(|x| x.is_finite()), "{file}");
        let text = std::fs::read_to_string(here(&file)).unwrap();
        let header: Vec<&str> = text.lines().take_while(|line| line.starts_with("# ")).collect();
        assert!(header.iter().any(|line| line.contains("Origin: ")), "{file}: no origin");
    }
}

#[test]
fn every_generator_can_be_drawn() {
    for entry in catalogue() {
        let case: Case = read(&entry.file);
        if let Some(generator) = case.generator {
            let drawn = generator.facets().unwrap_or_else(|e| panic!("{}: {e}", entry.file));
            assert_eq!(drawn.len(), generator.facets, "{}", entry.file);
        }
    }
}

#[test]
fn every_geometry_is_in_the_repository_or_in_the_fetch_table() {
    let table: toml::Table = read("fetch.toml");
    let sources = std::fs::read_to_string(here("SOURCES.md")).unwrap();
    let mut used = BTreeSet::new();
    for entry in catalogue() {
        let case: Case = read(&entry.file);
        let Some(geometry) = case.geometry else {
            continue;
        };
        let fetched = geometry.strip_prefix("fetched/");
        let name = fetched.unwrap_or(&geometry).strip_suffix(".stl").unwrap().to_owned();
        assert!(entry.name.starts_with(&name), "{}", entry.name);
        assert!(sources.contains(&format!("| `{name}.stl` |")), "SOURCES.md lacks {name}");
        match fetched {
            Some(_) => assert!(table.contains_key(&name), "{name}"),
            None => assert!(here(&geometry).is_file(), "{geometry}"),
        }
        used.insert(name);
    }
    let shipped = names(".", ".stl").into_iter().map(|name| name.replace(".stl", ""));
    let all: BTreeSet<String> = table.keys().cloned().chain(shipped).collect();
    assert_eq!(used, all, "every geometry has a case and every case a geometry");
    assert_eq!(all.len(), 20);
}

#[test]
fn numbers_of_cells_match_the_sizes_and_small_cases_vary_all_parameters() {
    let mut layers = BTreeSet::new();
    let mut keeps = BTreeSet::new();
    let mut keeps_seeded = BTreeSet::new();
    let mut enclosed = BTreeSet::new();
    for entry in catalogue() {
        let case: Case = read(&entry.file);
        let cells = entry.cells_about.unwrap_or_else(|| panic!("{}: no cells", entry.name));
        let (low, high) = match entry.size {
            Size::Small => (1, 31_000),
            Size::Medium => (100_000, 2_000_000),
            Size::Large => (10_000_000, 2_000_000_000),
        };
        assert!((low..high).contains(&cells), "{}: {cells} cells", entry.name);
        assert!(entry.inside.is_some(), "{}", entry.name);
        if entry.size == Size::Small {
            layers.insert(case.layer_cells_min.unwrap_or(4));
            let keep = case.keep.unwrap_or(Keep::Outside);
            keeps.insert(keep);
            enclosed.insert(case.enclosed.unwrap_or(Enclosed::Delete));
            if !case.seeds.is_empty() {
                keeps_seeded.insert((keep, case.keep_crossing.unwrap_or(true)));
            }
        }
        if case.keep == Some(Keep::Inside) {
            assert!(entry.inside == Some(Inside::Some), "{}: nothing to keep", entry.name);
        }
    }
    assert!(layers.is_superset(&BTreeSet::from([1, 2, 3, 4, 5, 6, 10, 36])), "{layers:?}");
    assert_eq!(keeps, BTreeSet::from([Keep::Outside, Keep::Inside, Keep::All]));
    let seeded = [(Keep::Outside, false), (Keep::Inside, true), (Keep::All, true)];
    assert!(keeps_seeded.is_superset(&BTreeSet::from(seeded)), "{keeps_seeded:?}");
    assert_eq!(enclosed, BTreeSet::from([Enclosed::Delete, Enclosed::Keep]));
}
