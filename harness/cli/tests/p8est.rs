//! Forests by `harness export`, loaded and saved again by p4est, and imported.

use contract::leafset;
use contract::testing::{leaf_set, words_with_sides};
use contract::word::Side;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Runs `harness` and returns its standard output.
fn harness(arguments: &[&Path]) -> String {
    let run = Command::new(env!("CARGO_BIN_EXE_harness")).args(arguments).output().unwrap();
    assert!(run.status.success(), "{run:?}");
    String::from_utf8(run.stdout).unwrap()
}

#[test]
fn p4est_loads_a_forest_and_saves_the_same_file() {
    // The directory of all builds is two levels above the program.
    let target = Path::new(env!("CARGO_BIN_EXE_harness")).ancestors().nth(2).unwrap();
    let program = target.join("engines/p4est-load");
    if !program.is_file() {
        eprintln!("left out: {} is missing (ci/setup compiles it)", program.display());
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let [mesh, forest, saved, back] =
        ["mesh", "mesh.p8est", "saved.p8est", "back"].map(|name| place.path().join(name));
    // A body in the middle: its inside is deleted, and one side has crossing leaves.
    let middle = |c: u32| (c >> 16).abs_diff(4) < 2;
    let words = words_with_sides(
        |o| o.level < 2 || o.level < 6 && o.corner.iter().all(|&c| middle(c)),
        |o| match o.corner.map(|c| c >> 15) {
            [x, y, z] if [x, y, z].iter().all(|c| (8..10).contains(c)) => None,
            [10, _, _] => Some(Side::Crossing),
            _ => Some(Side::Outside),
        },
    );
    leaf_set(vec![words.clone()]).create(&mesh).unwrap();
    harness(&[Path::new("export"), &mesh, &forest]);
    let loaded = Command::new(&program)
        .args([&forest, &saved])
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .output()
        .unwrap();
    assert!(loaded.status.success(), "{loaded:?}");
    let printed = String::from_utf8(loaded.stdout).unwrap();
    let numbers: Vec<usize> = printed.split(' ').filter_map(|word| word.parse().ok()).collect();
    assert_eq!(numbers[0] - numbers[1], words.len(), "{printed}");
    assert!(numbers[1] > 0, "{printed}");
    assert_eq!(fs::read(&forest).unwrap(), fs::read(&saved).unwrap());
    let options = ["import", "--sides", "data", "--out"].map(Path::new);
    harness(&[options[0], &saved, options[1], options[2], options[3], &back]);
    let (first, second) = (leafset::read(&mesh).unwrap(), leafset::read(&back).unwrap());
    assert_eq!(first.manifest.digest, second.manifest.digest);
    assert_eq!(second.words, words);
}
