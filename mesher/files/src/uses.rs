//! What this process reads and writes. No output replaces an input, or another output.
//!
//! Invariants:
//! - no option names an output that another option names, or a directory that contains it;
//! - a regular file, known by its device and inode, has one of these uses, whichever comes first.
//!
//! Programs register their outputs before they begin to work, so the clash is found when the input is opened.

use std::collections::BTreeMap;
use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind, Read};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

#[derive(Clone, Copy, PartialEq, Eq)]
enum Use {
    Input,
    Output,
    /// Lines are read from it and appended to it.
    Log,
}

static USES: Mutex<Uses> = Mutex::new(Uses { files: BTreeMap::new(), outputs: Vec::new() });

#[derive(Default)]
struct Uses {
    /// Files by device and inode, with the path that was given.
    files: BTreeMap<(u64, u64), (Use, PathBuf)>,
    /// Files, and directories with all that is in them, that options name as outputs.
    outputs: Vec<PathBuf>,
}

fn uses() -> MutexGuard<'static, Uses> {
    USES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The first input that was found to be an output.
static CLASH: OnceLock<String> = OnceLock::new();

/// Why this process has no result, if an input was found to be one of its outputs: whatever the reader made of the error, the
/// user's command line is wrong, and nothing else.
pub fn clash() -> Option<&'static str> {
    CLASH.get().map(String::as_str)
}

/// Opens a regular file as an input of this run. A pipe could wait for a writer forever, and a device has no end.
///
/// # Errors
/// If it is no regular file, cannot be opened, or is an output of this run.
pub fn open(path: &Path) -> io::Result<File> {
    opened(path, Use::Input)
}

fn opened(path: &Path, role: Use) -> io::Result<File> {
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("it is a directory, a pipe or a device: give a file"));
    }
    let file = File::open(path)?;
    register(path, &file.metadata()?, role)?;
    Ok(file)
}

/// The bytes of an input of this run.
///
/// # Errors
/// As [`open`].
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The text of an input of this run.
///
/// # Errors
/// As [`open`], or if it is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    io::read_to_string(open(path)?)
}

/// The bytes of a log of this run, whose last line may have been cut anywhere.
///
/// # Errors
/// As [`open`], or if it is an input.
pub fn read_log(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    opened(path, Use::Log)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Opens a log of this run to append lines, and creates it if it does not exist.
///
/// # Errors
/// If it cannot be opened or created, or is an input or an output of this run.
pub fn append_log(path: &Path) -> io::Result<File> {
    let file = File::options().create(true).append(true).read(true).open(path)?;
    register(path, &file.metadata()?, Use::Log)?;
    Ok(file)
}

/// Registers an input of this run that another process reads. One that is missing is found missing by that process.
///
/// # Errors
/// If it is an output of this run.
pub fn register_input(path: &Path) -> io::Result<()> {
    fs::metadata(path).map_or(Ok(()), |found| register(path, &found, Use::Input))
}

/// Registers an output of this run, which may not exist yet.
///
/// # Errors
/// If it is an input of this run.
pub fn register_output(path: &Path) -> io::Result<()> {
    fs::metadata(path).map_or(Ok(()), |found| register(path, &found, Use::Output))
}

/// Notes that an option names this file or directory as an output. Once per option.
///
/// # Errors
/// If it is an input of this run, or another option names it, a directory that contains it, or something in it.
pub fn name_output(path: &Path) -> io::Result<()> {
    register_output(path)?;
    // Streams and devices take the output of several options.
    if fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
        return Ok(());
    }
    let absolute = std::path::absolute(target(path))?;
    // What does not exist yet may be in a directory that has several names.
    let place = absolute.ancestors().find_map(|above| {
        let mut place = fs::canonicalize(above).ok()?;
        place.extend(absolute.strip_prefix(above).ok()?);
        Some(place)
    });
    let place = place.unwrap_or_else(|| absolute.clone());
    let clashes = |other: &&PathBuf| place.starts_with(other) || other.starts_with(&place);
    let mut uses = uses();
    if let Some(other) = uses.outputs.iter().find(clashes).map(|other| other.display()) {
        let why = format!("this run also writes {other}: give one of them another name");
        return Err(io::Error::new(ErrorKind::InvalidInput, why));
    }
    uses.outputs.push(place);
    Ok(())
}

/// The file that symbolic links lead to, which may not exist yet.
pub(crate) fn target(path: &Path) -> PathBuf {
    let next = |at: &PathBuf| Some(folder_of(at).join(fs::read_link(at).ok()?));
    // Linux follows 40 links at most.
    std::iter::successors(Some(path.to_owned()), next).take(41).last().unwrap_or_default()
}

/// The directory that has a file, which `.` is for a plain name.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Forgets all files: another run begins.
pub fn forget() {
    *uses() = Uses::default();
}

fn register(path: &Path, file: &Metadata, role: Use) -> io::Result<()> {
    // A device is not replaced.
    if !file.is_file() {
        return Ok(());
    }
    let id = (file.dev(), file.ino());
    let uses = &mut uses().files;
    if let Some((other, name)) = uses.get(&id)
        && *other != role
        // A temporary file may have been removed since then, and its inode used again.
        && fs::metadata(name).is_ok_and(|now| (now.dev(), now.ino()) == id)
    {
        let verb = match other {
            Use::Input => "reads",
            Use::Output => "writes",
            Use::Log => "appends to",
        };
        let why =
            format!("this run also {verb} it as {}: give the output another name", name.display());
        if role == Use::Input {
            // The file is not written.
            uses.insert(id, (role, path.to_owned()));
            let _ = CLASH.set(format!("{}: {why}", path.display()));
        }
        return Err(io::Error::new(ErrorKind::InvalidInput, why));
    }
    uses.insert(id, (role, path.to_owned()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{check_writable, write_atomically};
    use std::io::Write;

    /// A file under its own name, a hard link and a symbolic link.
    #[test]
    fn no_output_is_an_input_whichever_comes_first() {
        let place = tempfile::tempdir().unwrap();
        for case in 0..6 {
            let [file, other] = ["a", "b"].map(|name| place.path().join(format!("{case}{name}")));
            fs::write(&file, "body").unwrap();
            match case % 3 {
                0 => {}
                1 => fs::hard_link(&file, &other).unwrap(),
                _ => std::os::unix::fs::symlink(&file, &other).unwrap(),
            }
            let alias = if case % 3 == 0 { &file } else { &other };
            if case < 3 {
                open(&file).unwrap();
                assert!(check_writable(alias).is_err() && register_output(alias).is_err());
            } else {
                check_writable(&file).unwrap();
                let error = read(alias).unwrap_err().to_string();
                assert!(error.contains("also writes it as"), "{error}");
                // That of another test of this process may have come first.
                let first = clash().unwrap();
                assert!(
                    first.contains("this run also") && first.contains("another name"),
                    "{first}"
                );
            }
            // Also if the reader has made something else of its error.
            let error = write_atomically(alias, |_| Ok(())).unwrap_err().to_string();
            assert!(
                error.contains("also reads it as") && error.contains("another name"),
                "{error}"
            );
            assert_eq!(fs::read(&file).unwrap(), b"body");
        }
    }

    #[test]
    fn no_output_is_another_output_or_in_its_directory() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        fs::create_dir(at("mesh")).unwrap();
        fs::create_dir(at("other")).unwrap();
        for (from, to) in [("link", "mesh"), ("dangling", "mesh/new"), ("loop", "loop")] {
            std::os::unix::fs::symlink(at(to), at(from)).unwrap();
        }
        name_output(&at("mesh")).unwrap();
        name_output(&at("r")).unwrap();
        for clash in ["mesh", "link", "mesh/m", "link/m", "dangling", "r", "mesh/../r", "."] {
            let error = name_output(&at(clash)).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::InvalidInput, "{clash}: {error}");
        }
        for free in ["other", "loop", "mesh.json", "meshes", "r2", "/dev/null", "/dev/null"] {
            name_output(&at(free)).unwrap();
        }
        fs::write(at("body.stl"), "solid").unwrap();
        open(&at("body.stl")).unwrap();
        assert_eq!(name_output(&at("body.stl")).unwrap_err().kind(), ErrorKind::InvalidInput);
        name_output(&at("missing/mesh")).unwrap();
        assert!(name_output(&at("missing/mesh/run.json")).is_err());
    }

    #[test]
    fn a_log_is_read_and_appended_to_and_nothing_else() {
        let place = tempfile::tempdir().unwrap();
        let path = |name: &str| place.path().join(name);
        append_log(&path("log")).unwrap().write_all(b"line").unwrap();
        assert_eq!(read_log(&path("log")).unwrap(), b"line");
        append_log(&path("log")).unwrap();
        assert!(open(&path("log")).is_err() && check_writable(&path("log")).is_err());
        fs::write(path("body"), "body").unwrap();
        open(&path("body")).unwrap();
        assert!(append_log(&path("body")).is_err() && read_log(&path("body")).is_err());
    }

    #[test]
    fn an_input_that_was_removed_and_devices_clash_with_nothing() {
        let place = tempfile::tempdir().unwrap();
        let file = place.path().join("file");
        fs::write(&file, "").unwrap();
        open(&file).unwrap();
        // The same inode under another name stands for an inode that is used again.
        let moved = place.path().join("moved");
        fs::rename(&file, &moved).unwrap();
        check_writable(&moved).unwrap();
        let null = Path::new("/dev/null");
        register_input(null).unwrap();
        check_writable(null).unwrap();
        assert!(open(null).is_err() && open(place.path()).is_err());
        // An output may be written twice, and an input read twice.
        check_writable(&moved).unwrap();
        write_atomically(&moved, |out| out.write_all(b"new")).unwrap();
    }
}
