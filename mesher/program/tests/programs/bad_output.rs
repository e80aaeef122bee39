//! Output that cannot be written ends with one sentence, the documented exit code and no files, on one rank and
//! on several.

use crate::process::{
    COMMS, Finished, INPUT, MESHER, OUTPUT, Workspace, refused, run, signal, skip, start,
    tetrahedron,
};
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
        ("/proc/mesh", &["/proc/mesh"]),
    ] {
        refused(&workspace, &to("--out", path), OUTPUT, words);
    }
    refused(&workspace, &to("--out", "full"), INPUT, &["full", "not empty", "--out"]);
    refused(&workspace, &to("--out", "body.stl"), INPUT, &["body.stl", "another name"]);
    for path in ["file/run.json", "absent/run.json", "/proc/run.json", "folder"] {
        refused(&workspace, &to("--json", path), OUTPUT, &[path, "--json"]);
    }
    for path in ["file/status", "/proc/status", "/proc"] {
        refused(&workspace, &to("--status", path), OUTPUT, &[path]);
    }
    // The status of a run that fails is its last phase.
    let failing = [&to("--out", "full")[..], &["--status", "status"]].concat();
    assert_eq!(run(workspace.mesher(&failing)).code, Some(INPUT));
    let status = std::fs::read_to_string(workspace.path().join("status/rank-00000.txt"));
    assert_ne!(status.expect("the status"), "done\n");
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

/// Each simulated rank has the directory and its file open.
#[test]
fn a_limit_on_open_files_is_no_matter_of_the_directory() {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    let args = "body.stl --spacing-min 0.5 --quiet --out mesh --comm sim:100";
    let mut command = Command::new("sh");
    command.args(["-c", &format!("ulimit -n 64; exec '{MESHER}' {args}")]);
    let words = ["mesh", "Too many open files", "raise ulimit"];
    run(workspace.enter(command)).refuses(OUTPUT, &words);
    assert!(!workspace.path().join("mesh").exists());
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

#[test]
fn outputs_of_a_run_do_not_replace_each_other() {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    for (one, other) in [
        (["--out", "mesh"], ["--json", "mesh/mesh.json"]),
        (["--out", "mesh"], ["--json", "mesh"]),
        (["--out", "mesh"], ["--status", "mesh"]),
        (["--status", "status"], ["--json", "status/rank-00000.txt"]),
    ] {
        let arguments = [&["body.stl", "--spacing-min=0.5"][..], &one, &other].concat();
        refused(&workspace, &arguments, INPUT, &[other[1], "this run also writes", "another name"]);
    }
}

#[test]
fn a_second_run_into_a_directory_is_refused_and_changes_nothing() {
    for comm in COMMS {
        let workspace = Workspace::new();
        workspace.write("body.stl", tetrahedron());
        let body = ["body.stl", "--spacing-min=0.1", "--out", "mesh", "--quiet", comm];
        let mut first = workspace.mesher(&body);
        first.env("STOP_AT", "grade:0");
        let mut first = start(first);
        let stopped = first.stopped();
        let second = ["body.stl", "--spacing-min=0.5", "--out", "mesh", comm];
        let claimed = run(workspace.mesher(&second));
        claimed.refuses(INPUT, &["mesh: another run is writing", "--out"]);
        signal(&[], stopped);
        first.finish().succeeds();
        let complete = workspace.contents();
        run(workspace.mesher(&second)).refuses(INPUT, &["mesh", "not empty", "--out"]);
        assert_eq!(workspace.contents(), complete);
        assert!(workspace.path().join("mesh/leaves-00000.npy").exists());
    }
}

/// Of jobs that start at the same time, one writes its mesh.
#[test]
fn of_simultaneous_runs_into_a_directory_one_succeeds() {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    for _ in 0..10 {
        let spacings = ["0.5", "0.3", "0.1", "0.05"];
        let runs = spacings.map(|spacing| {
            let args = ["body.stl", "--quiet", "--out", "mesh", "--comm=sim:2:1", "--spacing-min"];
            start(workspace.mesher(&[&args[..], &[spacing]].concat()))
        });
        let codes = runs.map(|run| run.finish().code);
        assert_eq!(codes.iter().filter(|&&code| code == Some(0)).count(), 1, "{codes:?}");
        assert_eq!(codes.iter().filter(|&&code| code == Some(INPUT)).count(), 3, "{codes:?}");
        let manifest = workspace.json("mesh/mesh.json");
        for part in manifest["parts"].as_array().expect("parts") {
            let file = workspace.path().join("mesh").join(part["file"].as_str().expect("a name"));
            let bytes = std::fs::metadata(file).expect("the part exists").len();
            let words = 8 * part["leaves"].as_u64().expect("a number");
            assert!((words + 1..words + 256).contains(&bytes), "{bytes} for {words}");
        }
        std::fs::remove_dir_all(workspace.path().join("mesh")).expect("the mesh");
    }
}

#[test]
fn a_report_is_written_through_whatever_is_no_regular_file() {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    workspace.write("target.json", "old");
    std::os::unix::fs::symlink("target.json", workspace.path().join("link")).expect("a link");
    let args = |path| ["body.stl", "--spacing-min=0.5", "--quiet", "--json", path];
    run(workspace.mesher(&args("link"))).succeeds();
    assert!(workspace.path().join("link").is_symlink());
    assert!(workspace.json("target.json")["cells"].as_u64() > Some(0));

    let fifo = workspace.path().join("fifo");
    assert!(Command::new("mkfifo").arg(&fifo).status().expect("mkfifo is installed").success());
    let writer = start(workspace.mesher(&args("fifo")));
    let read = std::fs::read_to_string(&fifo).expect("a FIFO can be read");
    writer.finish().succeeds();
    assert!(read.contains("octree-mesher-run/2") && read.ends_with("}\n"), "{read}");
    assert!(!fifo.is_file());

    // A pipe, and a regular file that has been written to before.
    let printed = run(workspace.mesher(&args("/dev/stdout"))).stdout;
    assert!(serde_json::from_str::<serde_json::Value>(&printed).is_ok(), "{printed}");
    let shell = ["sh"];
    let args = "body.stl --spacing-min 0.5 --json /dev/stdout";
    in_shell(&workspace, &shell, "exec > log; echo first", args, ".").succeeds();
    let log = std::fs::read_to_string(workspace.path().join("log")).expect("the log");
    assert!(log.starts_with("first\n{") && log.contains("octree-mesher-run/2"), "{log}");
}

/// Devices are those of this test: it needs the right to make them.
#[test]
fn a_full_device_is_an_error_of_output() {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    let device = |name: &str, minor: &str| {
        let path = workspace.path().join(name);
        let made = Command::new("mknod").arg(&path).args(["c", "1", minor]).output();
        made.is_ok_and(|o| o.status.success()) && std::fs::File::create(path).is_ok()
    };
    if !(device("full", "7") && device("null", "3")) {
        return skip("full devices", "this user may not make devices");
    }
    let body = "body.stl --spacing-min 0.5";
    let warned = "sheet.stl --spacing-min 0.5 --root 0,0,0,8 --keep inside";
    let sheet = [[[1.0f32, 1.0, 1.0], [2.0, 1.0, 1.0], [1.0, 2.0, 1.0]]];
    workspace.write("sheet.stl", crate::process::binary_stl(&sheet));
    workspace.write("runs", "[\"body.stl\", \"--spacing-min\", \"0.5\"]\n".repeat(2));
    for (args, code) in [
        (format!("{body} > full"), OUTPUT),
        (format!("{body} > null"), 0),
        (format!("{body} --json full > null"), OUTPUT),
        (format!("{body} --json null > null"), 0),
        ("--help > full".to_owned(), OUTPUT),
        ("--serve < runs > full".to_owned(), OUTPUT),
        ("--serve < runs > null".to_owned(), 0),
        ("--serve < runs | true".to_owned(), 0),
        (format!("{warned} > null 2> full"), OUTPUT),
        ("absent.stl --spacing-min 0.5 2> full".to_owned(), INPUT),
        (format!("{body} | true"), 0),
    ] {
        let mut command = Command::new("bash");
        command.args(["-c", &format!("set -o pipefail; '{MESHER}' {args}")]);
        let finished = run(workspace.enter(command));
        assert_eq!(finished.code, Some(code), "{args}: {finished:?}");
        assert!(!finished.stderr.contains("panicked"), "{args}: {finished:?}");
        for name in ["full", "null"] {
            let kept = std::fs::metadata(workspace.path().join(name)).expect("the device");
            assert!(!kept.is_file(), "{args} replaced {name}");
        }
    }
}
