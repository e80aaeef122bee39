//! Output that cannot be written: one sentence, the documented exit code, nothing left behind; on one
//! rank and on several.
#![allow(missing_docs)]

#[path = "support/process.rs"]
mod process;

use process::{MESHER, OUTPUT, Place, Told, left_out, refused, run, tetrahedron};
use std::process::Command;

#[test]
fn output_that_cannot_be_written() {
    let place = Place::new();
    place.put("body.stl", tetrahedron());
    place.put("file", "kept");
    std::fs::create_dir(place.path().join("full")).expect("a directory");
    place.put("full/kept.txt", "kept");
    std::fs::create_dir(place.path().join("folder")).expect("a directory");
    let to = |option, path| ["body.stl", "--spacing-min=0.5", option, path];
    for (path, words) in [
        ("file/mesh", &["file/mesh"][..]),
        ("file", &["file"]),
        ("absent/deep/mesh", &["absent/deep/mesh"]),
        ("full", &["full", "not empty"]),
        ("/proc/mesh", &["/proc/mesh"]),
    ] {
        refused(&place, &to("--out", path), OUTPUT, words);
    }
    for path in ["file/run.json", "absent/run.json", "/proc/run.json", "folder"] {
        refused(&place, &to("--json", path), OUTPUT, &[path, "--json"]);
    }
    for path in ["file/status", "/proc/status"] {
        refused(&place, &to("--status", path), OUTPUT, &[path]);
    }
    assert_eq!(std::fs::read(place.path().join("file")).expect("the file"), b"kept");
}

/// Runs the mesher through a shell that first does `before`, and lists `folder` afterwards.
fn in_shell(place: &Place, wrapper: &[&str], before: &str, args: &str, folder: &str) -> Told {
    let script = format!(
        "{before} || exit 99; '{MESHER}' {args} --quiet; code=$?; find {folder} -mindepth 1; exit $code"
    );
    let mut command = Command::new(wrapper[0]);
    command.args(&wrapper[1..]).args(["-c", &script]);
    run(place.at(command))
}

/// Files may not grow beyond a limit: as on a full disk, a write fails in the middle.
#[test]
fn writes_that_fail_in_the_middle() {
    let place = Place::new();
    place.put("body.stl", tetrahedron());
    let body = "body.stl --root-scale 2 --keep all --out mesh";
    // A shell ignores the signal for its children; the write then fails. Blocks have 512 bytes: only
    // the manifest is larger than 16 of them in the first run, only the parts are in the second.
    for (blocks, spacing) in [(16, "0.5"), (100, "0.01")] {
        for comm in ["solo", "sim:3:5"] {
            let args = format!("{body} --spacing-min {spacing} --comm {comm}");
            let told = in_shell(
                &place,
                &["sh"],
                &format!("trap '' XFSZ; ulimit -f {blocks}"),
                &args,
                "mesh",
            );
            assert_eq!(told.code, Some(OUTPUT), "{told:?}");
            let (ours, rest): (Vec<&str>, _) =
                told.stderr.lines().partition(|l| l.starts_with("mesher: "));
            assert!(ours.len() == 1 && ours[0].contains("mesh"), "{told:?}");
            assert!(rest.iter().all(|l| l.starts_with("find: ")), "{told:?}");
            assert_eq!(told.stdout, "", "something was left behind");
            assert!(!place.path().join("mesh").exists());
        }
    }
}

/// A disk that is full, and one that is read-only, where this test may mount them.
#[test]
fn disks_that_are_full_or_read_only() {
    let place = Place::new();
    place.put("body.stl", tetrahedron());
    std::fs::create_dir(place.path().join("disk")).expect("a directory");
    // The mounts are in a namespace of the shell's own, and vanish with it.
    let shell = ["unshare", "--mount", "sh"];
    let try_it =
        in_shell(&place, &shell, "mount -t tmpfs -o size=64k none disk", "--version", "disk");
    if try_it.code != Some(0) {
        return left_out("a full disk", "this user may not mount a small one");
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
            let told = in_shell(&place, &shell, &mount, &args, "disk");
            told.refuses(OUTPUT, &["disk"]);
        }
    }
}
