//! Where output goes, and what other runs leave of it.
#![allow(missing_docs)]

use files::{Claim, Draft, interrupt, write_atomically};
use std::env;
use std::fs::{self, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::{FileTypeExt, symlink};
use std::path::Path;
use std::process::{Command, exit};
use std::sync::Barrier;
use std::thread;
use std::time::Duration;

fn write(path: &Path, text: &str) -> io::Result<()> {
    write_atomically(path, |out| out.write_all(text.as_bytes()))
}

/// The names in a directory, in order.
fn names(directory: &Path) -> Vec<String> {
    let name = |entry: io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<String> = fs::read_dir(directory).unwrap().map(name).collect();
    names.sort();
    names
}

/// In a process of its own: nothing can be begun in it afterwards.
#[test]
fn nothing_is_begun_once_another_thread_ends_the_process() {
    const FILE: &str = "FILE_AFTER_THE_END";
    if let Some(path) = env::var_os(FILE) {
        interrupt::abandon(false);
        // If it returned, the draft would remain, as `exit` drops nothing.
        let begun = thread::spawn(move || Draft::create(Path::new(&path)).map(std::mem::forget));
        thread::sleep(Duration::from_millis(100));
        exit(i32::from(begun.is_finished()));
    }
    let place = tempfile::tempdir().unwrap();
    let mut child = Command::new(env::current_exe().unwrap());
    child.args(["--exact", "nothing_is_begun_once_another_thread_ends_the_process"]);
    let status = child.env(FILE, place.path().join("file")).status().unwrap();
    assert!(status.success());
    assert_eq!(names(place.path()), [""; 0]);
}

#[test]
fn a_failed_write_leaves_the_old_file_and_nothing_else() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("file");
    write(&path, "old").unwrap();
    let failed = write_atomically(&path, |out| {
        out.write_all(b"new")?;
        Err(io::Error::other("disk full"))
    });
    assert_eq!(failed.unwrap_err().to_string(), "disk full");
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(names(place.path()), ["file"]);
    write(&path, "new").unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"new");
}

#[test]
fn the_error_of_a_file_that_cannot_be_created_names_no_temporary_file() {
    let place = tempfile::tempdir().unwrap();
    let absent = place.path().join("absent");
    let failed = write(&absent.join("file"), "text").unwrap_err();
    assert_eq!(failed.to_string(), format!("{} is not a directory: create it", absent.display()));
}

#[test]
fn a_fifo_is_written_through_and_stays() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("fifo");
    assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
    let reader = {
        let path = path.clone();
        thread::spawn(move || fs::read_to_string(path).unwrap())
    };
    write(&path, "text").unwrap();
    assert_eq!(reader.join().unwrap(), "text");
    assert!(fs::symlink_metadata(&path).unwrap().file_type().is_fifo());
    assert_eq!(names(place.path()), ["fifo"]);
}

/// Needs the right to make devices.
#[test]
fn a_device_is_written_through_and_stays() {
    let place = tempfile::tempdir().unwrap();
    for (name, minor) in [("null", "3"), ("full", "7")] {
        let path = place.path().join(name);
        let made = Command::new("mknod").arg(&path).args(["c", "1", minor]).output().unwrap();
        let opens = OpenOptions::new().write(true).open(&path).is_ok();
        if !made.status.success() || !opens {
            let _ = writeln!(io::stderr(), "skipped: devices: this user may not make them");
            return;
        }
        let written = write(&path, "text");
        assert_eq!(written.is_ok(), name == "null", "{written:?}");
        assert!(fs::symlink_metadata(&path).unwrap().file_type().is_char_device());
    }
    assert_eq!(names(place.path()), ["full", "null"]);
}

#[test]
fn the_file_that_a_link_leads_to_is_replaced_and_the_link_stays() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("folder");
    fs::create_dir(&folder).unwrap();
    symlink("folder/file", place.path().join("first")).unwrap();
    symlink("first", place.path().join("link")).unwrap();
    let link = place.path().join("link");
    // The file does not exist at first.
    for text in ["one", "two"] {
        write(&link, text).unwrap();
        assert_eq!(fs::read_to_string(folder.join("file")).unwrap(), text);
    }
    assert_eq!(fs::read_link(&link).unwrap(), Path::new("first"));
    assert_eq!((names(&folder), names(place.path()).len()), (vec!["file".to_owned()], 3));
    symlink("loop", place.path().join("loop")).unwrap();
    assert!(write(&place.path().join("loop"), "").is_err());
}

#[test]
fn a_draft_that_is_dropped_leaves_nothing() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("file");
    let mut draft = Draft::create(&path).unwrap();
    draft.write_all(b"half").unwrap();
    assert_eq!(names(place.path()).len(), 1);
    drop(draft);
    assert!(names(place.path()).is_empty());
    assert_eq!(Draft::create(place.path()).unwrap_err().kind(), io::ErrorKind::IsADirectory);
}

const LAST: &str = "last";

fn claim(path: &Path) -> io::Result<Claim> {
    Claim::create(path, LAST, vec!["part".to_owned()])
}

fn fill(claim: &Claim, text: &str) -> io::Result<()> {
    let mut part = claim.draft("part")?;
    part.write_all(text.as_bytes())?;
    part.publish()?;
    claim.commit(|out| out.write_all(text.as_bytes()))
}

#[test]
fn of_runs_that_claim_a_directory_at_the_same_time_one_gets_it() {
    const RUNS: usize = 8;
    for round in 0..50 {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("out");
        // An existing directory as well.
        if round % 2 == 1 {
            fs::create_dir(&path).unwrap();
        }
        let start = Barrier::new(RUNS);
        let won: Vec<usize> = thread::scope(|scope| {
            let run = |i: usize| {
                let (start, path) = (&start, &path);
                scope.spawn(move || {
                    start.wait();
                    let claim = claim(path).ok()?;
                    fill(&claim, &i.to_string()).unwrap();
                    claim.keep();
                    Some(i)
                })
            };
            let runs: Vec<_> = (0..RUNS).map(run).collect();
            runs.into_iter().filter_map(|run| run.join().unwrap()).collect()
        });
        assert_eq!(won.len(), 1);
        for name in ["part", LAST] {
            assert_eq!(fs::read_to_string(path.join(name)).unwrap(), won[0].to_string());
        }
        assert_eq!(names(&path), [LAST, "part"]);
        let refused = claim(&path).unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::DirectoryNotEmpty);
        assert!(refused.to_string().contains("not empty"), "{refused}");
        assert_eq!(names(&path), [LAST, "part"], "the second run removes nothing");
    }
}

#[test]
fn a_run_that_fails_removes_its_files_and_no_others() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("out");
    let first = claim(&path).unwrap();
    let refused = claim(&path).unwrap_err();
    assert_eq!(refused.kind(), ErrorKind::DirectoryNotEmpty);
    assert!(refused.to_string().contains("another run"), "{refused}");
    let other = Claim::join(&path, LAST, vec!["other".to_owned()], first.is_new).unwrap();
    fill_part(&first, "part");
    fill_part(&other, "other");
    // One process of the run gives up: the other cannot complete the directory.
    drop(other);
    assert_eq!(names(&path), ["part"]);
    assert!(first.commit(|out| out.write_all(b"x")).is_err());
    drop(first);
    assert!(!path.exists());

    // The directory belongs to another run now, whose files have the same names.
    let late = claim(&path).unwrap();
    let straggler = Claim::join(&path, LAST, vec!["part".to_owned()], true).unwrap();
    fs::remove_dir_all(&path).unwrap();
    let next = claim(&path).unwrap();
    fill_part(&next, "part");
    drop((late, straggler));
    next.commit(|out| out.write_all(b"x")).unwrap();
    next.keep();
    assert_eq!(names(&path), [LAST, "part"]);
}

#[test]
fn a_file_that_somebody_puts_into_the_directory_during_a_run_is_not_replaced() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("out");
    let run = claim(&path).unwrap();
    let part = run.draft("part").unwrap();
    for name in ["part", LAST] {
        fs::write(path.join(name), "theirs").unwrap();
    }
    assert!(part.publish().is_err());
    assert!(run.commit(|out| out.write_all(b"ours")).is_err());
    for name in ["part", LAST] {
        assert_eq!(fs::read_to_string(path.join(name)).unwrap(), "theirs");
    }
}

fn fill_part(claim: &Claim, name: &str) {
    claim.draft(name).unwrap().publish().unwrap();
}

#[test]
fn an_existing_directory_stays_and_so_do_complete_files() {
    let place = tempfile::tempdir().unwrap();
    let out = claim(place.path()).unwrap();
    assert!(!out.is_new);
    fill_part(&out, "part");
    drop(out);
    assert!(names(place.path()).is_empty());
    let out = claim(place.path()).unwrap();
    fill(&out, "text").unwrap();
    // Even if a process then gives up.
    drop(out);
    assert_eq!(names(place.path()), [LAST, "part"]);
}
