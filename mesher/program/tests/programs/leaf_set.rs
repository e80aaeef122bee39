//! Output, read back by other code: parts, manifest and report agree with the mesh; the tree is the same bytes on any number of ranks,
//! and has the leaves of the mesh.

use crate::process::{INPUT, Workspace, refused, run};
use crate::support::{Run, Small, closed, config, first_difference, small, soup, thin};
use bricks::digest::{Digests, hex, mix};
use contract::htg::TreeFile;
use contract::npy::PartFile;
use mesher::output::write::{Output, TREE};
use mesher::partition::Partitioner;
use mesher::record::Recorder;
use mesher::{Job, Options, mesh};
use proptest::prelude::*;
use ranks::{Solo, sim};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

const CASE: &str = "spacing_min = 0.07\nlayer_cells_min = 2\nkeep = \"inside\"\n
[generator]\nshape = \"sphere\"\nfacets = 320\n
[root]\norigin = [-1.0, -1.25, -1.5]\nedge = 3.0\n
[[box]]\nmin = [-9.0, 0.0, 0.1]\nmax = [0.25, 0.5, 0.4]\nspacing = 0.03\n
[[box]]\nmin = [-0.3, -0.3, -0.3]\nmax = [0.3, 0.3, 0.3]\nspacing = 0.2\n";

/// The words of a part.
fn read_part(path: &Path) -> Vec<u64> {
    let words = PartFile::open(path).and_then(|part| part.read_all()).expect("a part was written");
    assert!(words.is_sorted_by(|a, b| a < b), "a part is sorted and has no leaf twice");
    words
}

/// The mesh's words by the library, which the property tests compare with the reference.
fn meshed(workspace: &Workspace, ungraded: bool) -> Vec<u64> {
    let case = case_file::read(&workspace.path().join("case.toml")).expect("a good case");
    let options = crate::support::options(crate::support::Run::SOLO.division, ungraded);
    crate::support::words(&case, &options, &Solo).expect("a good case").0
}

fn level_of(w: u64) -> usize {
    (w >> 2 & 31) as usize
}

fn sum(words: &[u64]) -> u128 {
    words.iter().fold(0, |s, &w| s.wrapping_add(mix(w)))
}

/// Asserts the counts and the digest of a manifest or a report, computed from the words.
fn assert_counts(report: &Value, words: &[u64], [total, by_level]: [&str; 2]) {
    assert_eq!(report[total], words.len());
    let mut levels = [0u64; 20];
    words.iter().for_each(|&w| levels[level_of(w)] += 1);
    assert_eq!(report[by_level], json!(levels));
    assert_eq!(report["digest"], hex(sum(words)));
}

fn assert_manifest(folder: &Path, words: &[u64], ungraded: bool, ranks: usize) {
    let manifest = crate::process::read_json(&folder.join("mesh.json"));
    assert_eq!(manifest["schema"], "octree-leaf-set/1");
    assert_eq!(manifest["program"], concat!("mesher ", env!("CARGO_PKG_VERSION")));
    assert_eq!(manifest["tree"], if ungraded { "base" } else { "final" });
    assert_eq!(manifest["root"], json!({"origin": [-1.0, -1.25, -1.5], "edge": 3.0}));
    // 3 / 2^6 is the first at or below 0.07; 3 / 2^7 at or below 0.03; 3 / 2^4 at or below 0.2.
    assert_eq!(manifest["level_surface"], 6);
    assert_eq!(manifest["layer_cells_min"], 2);
    assert_eq!((&manifest["keep"], &manifest["keep_crossing"]), (&json!("inside"), &json!(true)));
    let at = |x: f64, origin: f64| {
        (((x - origin) * (134_217_728.0 / 3.0)).round_ties_even() as i64).clamp(0, 1 << 27)
    };
    let corner = |p: [f64; 3]| json!([at(p[0], -1.0), at(p[1], -1.25), at(p[2], -1.5)]);
    let boxes = json!([
        {"min": corner([-9.0, 0.0, 0.1]), "max": corner([0.25, 0.5, 0.4]), "level": 7},
        {"min": corner([-0.3; 3]), "max": corner([0.3; 3]), "level": 4},
    ]);
    assert_eq!(manifest["boxes"], boxes);
    assert_counts(&manifest, words, ["leaves", "leaves_by_level"]);
    let side = |s: u64| words.iter().filter(|w| *w & 3 == s).count();
    let sides = json!({"outside": side(0), "inside": side(1), "crossing": side(2)});
    assert_eq!(manifest["leaves_by_side"], sides);
    assert_eq!((&manifest["seeds"], &manifest["enclosed"]), (&json!([]), &json!("delete")));
    let enclosed = json!({"count": 0, "leaves": 0, "example": null});
    assert_eq!(manifest["components"], json!({"outside": 1, "inside": 1, "enclosed": enclosed}));
    assert_eq!(manifest["components_ambiguous"], json!({"count": 0, "example": null}));
    let octants: Vec<String> = (0..512u64)
        .map(|o| words.iter().copied().filter(|w| w >> 55 == o).collect::<Vec<u64>>())
        .map(|words| hex(sum(&words)))
        .collect();
    assert_eq!(manifest["octant_digests"], json!(octants));
    assert_parts(folder, &manifest, words, ranks);
    let fields = manifest.as_object().expect("an object").len();
    assert_eq!(fields, 21, "a field is untested, or missing");
}

fn assert_parts(folder: &Path, manifest: &Value, words: &[u64], ranks: usize) {
    let mut all = Vec::new();
    for (r, part) in manifest["parts"].as_array().expect("a list").iter().enumerate() {
        let name = format!("leaves-{r:05}.npy");
        let words = read_part(&folder.join(&name));
        let want = json!({"file": name, "leaves": words.len(), "digest": hex(sum(&words))});
        assert_eq!(*part, want);
        all.extend(words);
    }
    all.sort_unstable();
    assert!(all == words, "{}", crate::support::first_difference(&all, words));
    let files = std::fs::read_dir(folder).expect("a directory").count();
    assert_eq!(files, ranks + 1, "the parts and the manifest must be the only files");
}

#[test]
fn written_meshes_are_read_back() {
    let workspace = Workspace::new();
    workspace.write("case.toml", CASE);
    let case =
        contract::case::Case::read(&workspace.path().join("case.toml")).expect("a good case");
    let geometry = json!(contract::manifest::Geometry::of(&case.facets_lattice));
    for ungraded in [false, true] {
        let words = meshed(&workspace, ungraded);
        assert!(words.len() > 1000);
        // With base level 0 all ranks but one have no leaves, and write empty parts.
        for (ranks, more) in [
            (1, &[][..]),
            (5, &["--partitioner=metis"]),
            (5, &["--partitioner=morton"]),
            (9, &["--level-base=0"]),
        ] {
            let comm = format!("--comm=sim:{ranks}:3");
            let mut args =
                vec!["case.toml", "--out", "mesh", "--json", "run.json", "--quiet", &comm];
            args.extend(more);
            args.extend(ungraded.then_some("--ungraded"));
            run(workspace.mesher(&args)).succeeds();
            let folder = workspace.path().join("mesh");
            assert_manifest(&folder, &words, ungraded, ranks);
            let report = workspace.json("run.json");
            assert_report(&report, &words, ranks);
            for json in [crate::process::read_json(&folder.join("mesh.json")), report] {
                assert_eq!(json["geometry"], geometry, "{ranks} ranks");
                assert_eq!(json["leaks"], json!([]), "{ranks} ranks");
            }
            std::fs::remove_dir_all(folder).expect("the mesh exists");
        }
    }
}

/// Asserts the fields of the report.
fn assert_report(report: &Value, words: &[u64], ranks: usize) {
    assert_eq!(report["schema"], "octree-mesher-run/2");
    assert_counts(report, words, ["cells", "leaves_by_level"]);
    assert_eq!(report["ranks"], ranks);
    assert_eq!(report["facets"].as_u64(), Some(320));
    assert_eq!(report["level_surface"], 6);
    assert!(report["time_wall_s"].as_f64() > Some(0.0));
    let per_rank = |v: &Value| -> Vec<f64> {
        let list = v.as_array().unwrap_or_else(|| panic!("{v} is not a list"));
        assert_eq!(list.len(), ranks, "one value per rank");
        list.iter().map(|v| v.as_f64().expect("a number")).collect()
    };
    assert!(per_rank(&report["peak_rss_bytes"]).iter().all(|&b| b > 1e5));
    let phases = report["phases"].as_array().expect("a list");
    let names: Vec<&str> = phases.iter().filter_map(|p| p["name"].as_str()).collect();
    assert!(["read", "refine", "sides", "leaves"].iter().all(|n| names.contains(n)), "{names:?}");
    for p in phases {
        for field in ["time_wall_s", "time_cpu_s", "time_comm_wall_s", "time_comm_cpu_s"] {
            assert!(per_rank(&p[field]).iter().all(|&t| (0.0..60.0).contains(&t)), "{p}");
        }
        assert!(per_rank(&p["messages"]).iter().all(|&n| (n > 0.0) == (n != 0.0)));
        per_rank(&p["message_bytes"]);
    }
    for (name, values) in report["counters"].as_object().expect("an object") {
        let total: f64 = per_rank(values).iter().sum();
        if name == "leaves" {
            assert_eq!(total as usize, words.len());
        }
        if name.starts_with("message") {
            assert_eq!(total > 0.0, ranks > 1, "{name}");
        }
    }
}

/// The gate relies on this.
#[test]
fn counters_do_not_depend_on_the_order_of_messages() {
    let workspace = Workspace::new();
    workspace.write("case.toml", CASE);
    let mut counted = Vec::new();
    for seed in [1, 2, 2] {
        let comm = format!("--comm=sim:4:{seed}");
        run(workspace.mesher(&["case.toml", "--json", "run.json", "--quiet", &comm])).succeeds();
        counted.push(workspace.json("run.json")["counters"].clone());
    }
    assert_eq!(counted[0], counted[1]);
    assert_eq!(counted[1], counted[2]);
}

#[test]
fn digests_of_any_parts_add_up_to_the_digest_of_the_mesh() {
    let workspace = Workspace::new();
    workspace.write("case.toml", CASE);
    let words = meshed(&workspace, false);
    let mut merged = Digests::default();
    for r in 0..7 {
        let part: Vec<u64> = words.iter().copied().skip(r).step_by(7).collect();
        let mut digests = Digests::default();
        part.chunks(50).for_each(|c| digests.add(c));
        merged.merge(digests.octants.into_iter().enumerate());
    }
    assert_eq!(merged.whole(), sum(&words));
}

#[test]
fn standard_output_agrees_with_the_json_report() {
    let workspace = Workspace::new();
    workspace.write("case.toml", CASE);
    let finished = run(workspace.mesher(&["case.toml", "--json", "run.json"]));
    finished.succeeds();
    let report = workspace.json("run.json");
    let digest = report["digest"].as_str().expect("text");
    assert!(finished.stdout.contains(digest), "{finished:?}");
    for word in ["facets", "cells", "level  6", "time", "peak memory", "max/mean"] {
        assert!(finished.stdout.contains(word), "{word}: {finished:?}");
    }
}

#[test]
fn options_and_a_case_file_with_the_same_parameters_give_the_same_mesh() {
    let workspace = Workspace::new();
    workspace.write(
        "body.stl",
        crate::process::binary_stl(&crate::support::cuboid([0.25; 3], [1.0, 1.5, 2.0])),
    );
    let text = "geometry = \"body.stl\"\nspacing_min = 0.1\nlayer_cells_min = 3\nkeep = \"all\"\nkeep_crossing = false\n";
    let boxed = "[[box]]\nmin = [-1.0, 0.0, 0.0]\nmax = [0.5, 0.5, 0.5]\nspacing = 0.04\n";
    let exact = "[root]\norigin = [-2.0, -1.0, -1.5]\nedge = 5.0\n";
    let options = [
        "body.stl",
        "--spacing-min=0.1",
        "--layer-cells-min=3",
        "--keep=all",
        "--drop-crossing",
        "--box=-1,0,0,0.5,0.5,0.5,0.04",
    ];
    let digest = |args: &[&str]| {
        run(workspace.mesher(&[args, &["--json", "run.json", "--quiet"]].concat())).succeeds();
        workspace.json("run.json")["digest"].clone()
    };
    workspace.write("scaled.toml", format!("{text}root_scale = 3.0\n{boxed}"));
    workspace.write("exact.toml", format!("{text}{exact}{boxed}"));
    let scaled = digest(&["scaled.toml"]);
    assert_eq!(digest(&[&options[..], &["--root-scale", "3"]].concat()), scaled);
    let exact = digest(&["exact.toml"]);
    assert_eq!(digest(&[&options[..], &["--root", "-2,-1,-1.5,5"]].concat()), exact);
    assert_ne!(scaled, exact);
    // The defaults.
    workspace.write("plain.toml", "geometry = \"body.stl\"\nspacing_min = 0.5\n");
    assert_eq!(digest(&["body.stl", "--spacing-min", "0.5"]), digest(&["plain.toml"]));
    // The path in a case file is relative to it.
    std::fs::create_dir(workspace.path().join("deep")).expect("a directory");
    workspace.write("deep/case.toml", "geometry = \"../body.stl\"\nspacing_min = 0.5\n");
    assert_eq!(digest(&["deep/case.toml"]), digest(&["plain.toml"]));
}

/// The file of a case that is meshed with a run configuration.
fn tree_of(case: &Small, run: &Run, ungraded: bool, place: &Path) -> Vec<u8> {
    let directory = place.join("mesh");
    let output = Output { directory: directory.clone(), words: false, tree: true };
    let options = Options { out: Some(output), ..crate::support::options(run.division, ungraded) };
    let case = case.mesher_case();
    let reports = sim::run(run.ranks, run.seed, |comm| {
        let mut record = Recorder::default();
        let mut job = Job::new(&options, comm, &mut record);
        mesh(&case, &mut job, |_, _| Ok(())).map(|report| report.cells)
    });
    assert!(reports.iter().all(Result::is_ok), "{:?}", reports.iter().find(|r| r.is_err()));
    let names = || fs::read_dir(&directory).expect("the mesh").flatten().map(|e| e.file_name());
    assert_eq!(names().count(), 2, "the tree and the manifest: {:?}", names().collect::<Vec<_>>());
    let bytes = fs::read(directory.join(TREE)).expect("the tree");
    fs::rename(directory.join(TREE), place.join("last.vtkhdf")).expect("the tree");
    fs::remove_dir_all(&directory).expect("the mesh");
    bytes
}

/// The leaf words of the last file, as the harness reads them.
fn words_of(place: &Path) -> Vec<u64> {
    let tree = TreeFile::open(&place.join("last.vtkhdf")).expect("a tree");
    let mut words = Vec::new();
    tree.blocks(&mut |run| {
        words.extend(run.iter().flat_map(|block| block.words()));
        true
    })
    .expect("a tree");
    words
}

proptest! {
    #![proptest_config(config(60))]

    #[test]
    fn the_tree_is_that_of_one_rank_and_has_the_leaves_of_the_mesh(
        case in prop_oneof![small(soup()).boxed(), small(closed()).boxed(), thin().boxed()],
        run in crate::support::run(),
        ungraded in any::<bool>(),
    ) {
        let place = tempfile::tempdir().expect("a directory");
        let serial = tree_of(&case, &Run::SOLO, ungraded, place.path());
        let (found, expected) = (words_of(place.path()), case.solo(ungraded));
        prop_assert!(found == expected, "{}", first_difference(&found, &expected));
        let parallel = tree_of(&case, &run, ungraded, place.path());
        prop_assert!(serial == parallel, "{} and {} bytes", serial.len(), parallel.len());
    }
}

/// Several windows of nodes, and several rounds of them.
#[test]
fn a_tree_of_many_windows_does_not_depend_on_ranks_and_partitioner() {
    let facets = crate::support::cuboid([20.0, 21.0, 22.0], [41.0, 42.5, 40.0]);
    let case = Small {
        facets,
        root: mesher::input::lattice::Root { origin: [0.0; 3], edge: 64.0 },
        spacing_min: 0.26,
        layer_cells_min: 6,
        keep: mesher::input::lattice::Keep::Outside,
        keep_crossing: true,
        boxes: Vec::new(),
        seeds: Vec::new(),
        enclosed: mesher::input::lattice::Enclosed::Delete,
    };
    let place = tempfile::tempdir().expect("a directory");
    let serial = tree_of(&case, &Run::SOLO, false, place.path());
    let (found, expected) = (words_of(place.path()), case.solo(false));
    assert!(expected.len() as u64 > 2 * vtkhdf::tree::WINDOW, "{} leaves", expected.len());
    assert!(found == expected, "{}", first_difference(&found, &expected));
    for (ranks, partitioner) in [(2, Partitioner::Morton), (5, Partitioner::Metis)] {
        let run = Run { ranks, seed: 3, division: crate::support::division(partitioner, None) };
        assert!(serial == tree_of(&case, &run, false, place.path()), "{ranks} ranks");
    }
}

#[test]
fn the_command_writes_words_or_the_tree_or_both() {
    let workspace = Workspace::new();
    workspace.write("body.stl", crate::process::tetrahedron());
    let mesher = |args: &[&str]| {
        let base = ["body.stl", "--spacing-min=0.1", "--quiet"];
        let finished = run(workspace.mesher(&[&base[..], args].concat()));
        assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    };
    let names = |folder: &str| {
        let entries = fs::read_dir(workspace.path().join(folder)).expect("the mesh").flatten();
        let mut names: Vec<_> =
            entries.map(|e| e.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    };
    mesher(&["--out", "words"]);
    assert_eq!(names("words"), ["leaves-00000.npy", "mesh.json"]);
    mesher(&["--out", "tree", "--write", "htg"]);
    assert_eq!(names("tree"), ["mesh.json", "mesh.vtkhdf"]);
    mesher(&["--out", "both", "--write", "htg,words", "--comm", "sim:3"]);
    assert_eq!(names("both").len(), 5);
    let read = |folder: &str| {
        let tree = TreeFile::open(&workspace.path().join(folder).join(TREE));
        let mut words = Vec::new();
        tree.and_then(|tree| {
            tree.blocks(&mut |run| {
                words.extend(run.iter().flat_map(|block| block.words()));
                true
            })
        })
        .map(|()| words)
    };
    let [tree, both] = ["tree", "both"].map(|folder| read(folder).expect("a tree"));
    assert_eq!(tree, both);
    let args = ["body.stl", "--spacing-min=0.1", "--write", "htg"];
    run(workspace.mesher(&args)).refuses(INPUT, &["--out"]);
    fs::create_dir(workspace.path().join("full")).expect("a directory");
    workspace.write("full/kept.txt", "kept");
    let args = ["body.stl", "--spacing-min=0.1", "--write=htg", "--out=full"];
    refused(&workspace, &args, INPUT, &["full", "not empty"]);
}
