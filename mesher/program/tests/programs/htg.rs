//! The tree as a file: the same bytes on any number of ranks, and the leaves of the mesh when the harness reads it.

use crate::process::{INPUT, Workspace, refused, run};
use crate::support::{Run, Small, closed, config, first_difference, small, soup, thin};
use contract::htg::TreeFile;
use mesher::output::write::{Output, TREE};
use mesher::partition::Partitioner;
use mesher::record::Recorder;
use mesher::{Job, Options, mesh};
use proptest::prelude::*;
use ranks::sim;
use std::fs;
use std::path::Path;

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
    tree.words(&mut |run| {
        words.extend_from_slice(run);
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
            tree.words(&mut |run| {
                words.extend_from_slice(run);
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
