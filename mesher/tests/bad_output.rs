//! Output that cannot be written ends with one sentence, the documented exit code and no files, on one rank and
//! on several.
#![allow(missing_docs)]

#[path = "support/process.rs"]
mod process;

use process::{Finished, MESHER, OUTPUT, Workspace, refused, run, skip, tetrahedron};
use std::process::Command;

#[test]
fn unwritable_output_is_refused() {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    workspace.write("file", "kept");
    std::fs::create_dir(workspace.path().join("full")).expect("a directory");
    workspace.write("full/kept.txt", "kept");
    std::fs::create_dir(workspace.path().join("folder")).expect("a directory");
    let to = |option, path| ["body.stl", "--spacing-min=0.5", option, path];
    for (path, words) in [
        ("file/mesh", &["file/mesh"][..]),
        ("file", &["file"]),
        ("absent/deep/mesh", &["absent/deep/mesh"]),
        ("full", &["full", "not empty"]),
        ("/proc/mesh", &["/proc/mesh"]),
    ] {
        refused(&workspace, &to("--out", path), OUTPUT, words);
    }
    for path in ["file/run.json", "absent/run.json", "/proc/run.json", "folder"] {
        refused(&workspace, &to("--json", path), OUTPUT, &[path, "--json"]);
    }
    for path in ["file/status", "/proc/status"] {
        refused(&workspace, &to("--status", path), OUTPUT, &[path]);
    }
    assert_eq!(std::fs::read(workspace.path().join("file")).expect("the file"), b"kept");
}

/// Runs the mesher through a shell that first does `before`, and lists `folder` afterwards.
fn in_shell(
    workspace: &Workspace,
    wrapper: &[&str],
    before: &str,
    args: &str,
    folder: &str,
) -> Finished {
    let script = format!(
        "{before} || exit 99; '{MESHER}' {args} --quiet; code=$?; find {folder} -mindepth 1; exit $code"
    );
    let mut command = Command::new(wrapper[0]);
    command.args(&wrapper[1..]).args(["-c", &script]);
    run(workspace.enter(command))
}

/// A limit on the size of files makes a write fail in the middle, as on a full disk.
#[test]
fn a_write_that_fails_in_the_middle_leaves_no_files() {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    let body = "body.stl --root-scale 2 --keep all --out mesh";
    // The shell makes its children ignore the signal, so that the write fails. A block has 512 bytes: in the
    // first run only the manifest is larger than 16 blocks, in the second only the parts are larger than 100.
    // The tree is written before the manifest; both are larger than 4 blocks.
    for (blocks, spacing, write) in
        [(16, "0.5", "words"), (100, "0.01", "words"), (4, "0.01", "htg")]
    {
        for comm in ["solo", "sim:3:5"] {
            let args = format!("{body} --spacing-min {spacing} --write {write} --comm {comm}");
            let finished = in_shell(
                &workspace,
                &["sh"],
                &format!("trap '' XFSZ; ulimit -f {blocks}"),
                &args,
                "mesh",
            );
            assert_eq!(finished.code, Some(OUTPUT), "{finished:?}");
            let (ours, rest): (Vec<&str>, _) =
                finished.stderr.lines().partition(|l| l.starts_with("mesher: "));
            assert!(ours.len() == 1 && ours[0].contains("mesh"), "{finished:?}");
            assert!(rest.iter().all(|l| l.starts_with("find: ")), "{finished:?}");
            assert_eq!(finished.stdout, "", "a file remains");
            assert!(!workspace.path().join("mesh").exists());
        }
    }
}

/// Needs the right to mount a small file system.
#[test]
fn full_and_read_only_disks_are_refused() {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    std::fs::create_dir(workspace.path().join("disk")).expect("a directory");
    // The mounts are in a namespace of the shell, and end with it.
    let shell = ["unshare", "--map-root-user", "--mount", "sh"];
    let attempt =
        in_shell(&workspace, &shell, "mount -t tmpfs -o size=64k none disk", "--version", "disk");
    if attempt.code != Some(0) {
        return skip("full and read-only disks", "this user may not mount a file system");
    }
    let body = "body.stl --root-scale 2 --keep all";
    for (options, spacing, json) in [
        ("size=16k", "0.5", ""),
        ("size=64k", "0.01", ""),
        ("ro", "0.5", ""),
        ("ro", "0.5", "--json disk/run.json"),
    ] {
        for comm in ["solo", "sim:3:5"] {
            let out = "--out disk/mesh";
            let args = format!("{body} --spacing-min {spacing} {out} {json} --comm {comm}");
            let mount = format!("mount -t tmpfs -o {options} none disk");
            let finished = in_shell(&workspace, &shell, &mount, &args, "disk");
            finished.refuses(OUTPUT, &["disk"]);
        }
    }
}
