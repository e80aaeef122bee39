//! Interrupted runs end with 130 and leave nothing behind, whatever they were doing.
#![allow(missing_docs)]

#[path = "support/process.rs"]
mod process;

use process::{Place, Running, start};
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// A mesh that takes seconds, most of them in the writing.
const LONG: &str = "spacing_min = 0.0015\nlayer_cells_min = 6\nroot_scale = 2.0\nkeep = \"all\"\n
[generator]\nshape = \"sphere\"\nfacets = 5120\n";

fn signal(name: &str, to: &Running) {
    let sent = Command::new("kill").args(["-s", name, &to.id().to_string()]).status();
    assert!(sent.expect("kill is there").success(), "the run must still be under way");
}

/// Waits until the run has come so far, or to its end.
fn wait_until(run: &mut Running, so_far: impl Fn() -> bool) {
    while !so_far() {
        assert!(!run.is_over(), "the run ended before it came so far");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Whether the directory has a file with something in it.
fn has_grown(folder: &Path) -> bool {
    let mut entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.any(|e| e.metadata().is_ok_and(|m| m.len() > 0))
}

#[test]
fn while_writing() {
    for (name, comm) in [("INT", "solo"), ("TERM", "solo"), ("INT", "sim:3:2"), ("TERM", "sim:3:2")]
    {
        let place = Place::new();
        place.put("case.toml", LONG);
        let before = place.contents();
        let args = ["case.toml", "--out", "mesh", "--json", "run.json", "--comm", comm];
        let mut run = start(place.mesher(&args));
        wait_until(&mut run, || has_grown(&place.path().join("mesh")));
        signal(name, &run);
        let told = run.finish();
        told.refuses(130, &["interrupted"]);
        assert!(place.contents().keys().eq(before.keys()), "{:?}", place.contents().keys());
    }
}

/// A directory that was there before stays, and stays empty.
#[test]
fn while_meshing_into_a_directory_of_the_users() {
    for comm in ["solo", "sim:2:2"] {
        let place = Place::new();
        place.put("case.toml", LONG);
        std::fs::create_dir(place.path().join("mesh")).expect("a directory");
        let args = ["case.toml", "--out", "mesh", "--status", "status", "--comm", comm];
        let mut run = start(place.mesher(&args));
        let status = place.path().join("status/rank-00000.txt");
        let phase = || std::fs::read_to_string(&status).unwrap_or_default();
        wait_until(&mut run, || ["sides\n", "grade\n", "leaves\n"].contains(&phase().as_str()));
        signal("INT", &run);
        run.finish().refuses(130, &["interrupted"]);
        assert_eq!(std::fs::read_dir(place.path().join("mesh")).expect("it stays").count(), 0);
    }
}
