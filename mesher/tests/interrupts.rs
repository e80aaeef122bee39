//! Interrupted runs end with exit code 130 and leave no files, in whichever phase they are.
#![allow(missing_docs)]

#[path = "support/process.rs"]
mod process;

use process::{Running, Workspace, start};
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// A mesh that takes seconds, most of them for writing.
const LONG: &str = "spacing_min = 0.0015\nlayer_cells_min = 6\nroot_scale = 2.0\nkeep = \"all\"\n
[generator]\nshape = \"sphere\"\nfacets = 5120\n";

fn signal(name: &str, to: &Running) {
    let sent = Command::new("kill").args(["-s", name, &to.id().to_string()]).status();
    assert!(sent.expect("kill is installed").success(), "the run must not have ended");
}

/// Waits for a condition. Fails if the run ends before.
fn wait_until(run: &mut Running, condition: impl Fn() -> bool) {
    while !condition() {
        assert!(!run.is_over(), "the run ended too early");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Whether the directory has a file that is not empty.
fn has_data(folder: &Path) -> bool {
    let mut entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.any(|e| e.metadata().is_ok_and(|m| m.len() > 0))
}

#[test]
fn an_interrupt_while_writing_leaves_no_files() {
    for (name, comm) in [("INT", "solo"), ("TERM", "solo"), ("INT", "sim:3:2"), ("TERM", "sim:3:2")]
    {
        let workspace = Workspace::new();
        workspace.write("case.toml", LONG);
        let before = workspace.contents();
        let args = ["case.toml", "--out", "mesh", "--json", "run.json", "--comm", comm];
        let mut run = start(workspace.mesher(&args));
        wait_until(&mut run, || has_data(&workspace.path().join("mesh")));
        signal(name, &run);
        let finished = run.finish();
        finished.refuses(130, &["interrupted"]);
        assert!(workspace.contents().keys().eq(before.keys()), "{:?}", workspace.contents().keys());
    }
}

#[test]
fn an_interrupt_leaves_an_existing_output_directory_empty() {
    for comm in ["solo", "sim:2:2"] {
        let workspace = Workspace::new();
        workspace.write("case.toml", LONG);
        std::fs::create_dir(workspace.path().join("mesh")).expect("a directory");
        let args = ["case.toml", "--out", "mesh", "--status", "status", "--comm", comm];
        let mut run = start(workspace.mesher(&args));
        let status = workspace.path().join("status/rank-00000.txt");
        let phase = || std::fs::read_to_string(&status).unwrap_or_default();
        wait_until(&mut run, || ["sides\n", "grade\n", "leaves\n"].contains(&phase().as_str()));
        signal("INT", &run);
        run.finish().refuses(130, &["interrupted"]);
        assert_eq!(
            std::fs::read_dir(workspace.path().join("mesh")).expect("it still exists").count(),
            0
        );
    }
}
