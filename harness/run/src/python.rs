//! The scripts of `harness/oracles`: readers of meshes, and the oracles, which classify points as inside or outside of a body by the protocol
//! of `harness/oracles/protocol.py`. Each script ends with code 3 if a package that it needs is missing.

use crate::engine::failure::{End, Failure};
use crate::engine::paths::Paths;
use crate::engine::process::{self, Finished, Watch};
use crate::engine::service::Services;
use check::oracle::vote::Answer;
use contract::case::Facet;
use contract::files;
use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;
use std::time::Duration;
use std::{fs, io};

/// Exit code of a script whose package is missing.
const CODE_MISSING: i32 = 3;

/// Runs a script, which is called `name` in messages, with its output in `place`.
///
/// # Errors
/// [`End::Missing`] if Python or a package is missing; another end if the script fails.
pub fn run<A: AsRef<OsStr>>(
    name: &str,
    script: &str,
    arguments: impl IntoIterator<Item = A>,
    paths: &Paths,
    limit: Duration,
    place: &Path,
) -> Result<Finished, Failure> {
    let mut command = script_command(name, script, paths)?;
    process::run(command.args(arguments), &Watch::new(name, limit, place)).map_err(explained)
}

/// The command of a script without arguments. NumPy starts a thread per core for products of matrices, which none has.
fn script_command(name: &str, script: &str, paths: &Paths) -> Result<Command, Failure> {
    let (python, script) = (&paths.python, paths.root.join("harness/oracles").join(script));
    let required = [
        (python, format!("Python at {} (ci/setup, or HARNESS_PYTHON)", python.display())),
        (&script, format!("{}: set HARNESS_ROOT to the repository", script.display())),
    ];
    if let Some((_, what)) = required.into_iter().find(|(path, _)| !path.is_file()) {
        return Err(Failure::new(name, End::Missing(format!("needs {what}"))));
    }
    let mut command = Command::new(python);
    command.arg("-B").arg(&script).env("OPENBLAS_NUM_THREADS", "1");
    Ok(command)
}

/// The failure of a script, in which a missing package is called so.
fn explained(failure: Failure) -> Failure {
    if let End::Exited { code, error } = &failure.end
        && (*code == CODE_MISSING || error.contains("ModuleNotFoundError"))
    {
        let why = format!("needs a package of Python that is missing: {error}");
        return Failure::new(failure.program, End::Missing(why));
    }
    failure
}

/// The oracles, in the order in which they run.
pub const ORACLES: [&str; 3] = ["trimesh", "open3d", "pyvista"];

/// Asks several oracles at the same time on which side of a body the points lie, in services that stay. Files are written to `place`.
/// For each oracle, the error is [`End::Missing`] if it or Python is missing, and another end if it fails or does not give one side per
/// point.
///
/// # Errors
/// If points and body cannot be written.
pub fn ask(
    oracles: &[&str],
    (points, body): (&[[f64; 3]], &[Facet]),
    place: &Path,
    services: &Services,
    paths: &Paths,
    limit: Duration,
) -> io::Result<Vec<Result<Answer, Failure>>> {
    fs::create_dir_all(place)?;
    let [points_file, body_file] = ["points", "body.stl"].map(|name| place.join(name));
    let coordinates = points.as_flattened().iter().flat_map(|c| c.to_le_bytes());
    fs::write(&points_file, coordinates.collect::<Vec<u8>>())?;
    let mut stl = Vec::new();
    geometries::write_stl_binary(body, &mut stl)?;
    fs::write(&body_file, stl)?;
    let send = |&oracle: &&str| {
        let files = [&points_file, &body_file, &place.join(oracle)];
        let words = files.map(|file| file.to_string_lossy().into_owned());
        start(oracle, services, paths).map(|()| services.send(oracle, &words))
    };
    let sent: Vec<Result<(), Failure>> = oracles.iter().map(send).collect();
    let answer = |(&oracle, sent): (&&str, Result<(), Failure>)| {
        sent?;
        services.answer(oracle, &Watch::new(oracle, limit, place)).map_err(explained)?;
        let inside = read_sides(&place.join(oracle), points.len());
        let inside = inside.map_err(|why| Failure::new(oracle, End::Unusable(why)))?;
        Ok(Answer { name: oracle.to_owned(), inside })
    };
    Ok(oracles.iter().zip(sent).map(answer).collect())
}

/// Starts an oracle, unless it runs.
///
/// # Errors
/// [`End::Missing`] if Python or, as far as a service that ended shows it, a package is missing.
pub fn start(oracle: &str, services: &Services, paths: &Paths) -> Result<(), Failure> {
    let mut command = script_command(oracle, "sides.py", paths)?;
    command.arg(oracle);
    services.start(oracle, || (command, None)).map_err(explained)
}

fn read_sides(path: &Path, count: usize) -> Result<Vec<bool>, String> {
    let sides = files::read(path).map_err(|error| format!("wrote no answer: {error}"))?;
    if sides.len() != count {
        return Err(format!("classified {} of {count} points", sides.len()));
    }
    match sides.iter().find(|&&side| side > 1) {
        Some(side) => Err(format!("gave the side {side}, and the sides are 0 and 1")),
        None => Ok(sides.iter().map(|&side| side == 1).collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    const POINTS: [[f64; 3]; 2] = [[0.5, -1.0, 1e300], [2.0, 3.0, 4.0]];
    const BODY: [Facet; 1] = [[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]];

    /// Runs a shell script instead of Python, with the words of a question as $1, $2 and $3.
    fn ask(script: &str) -> Result<Vec<bool>, Failure> {
        let place = tempfile::tempdir().unwrap();
        let python = place.path().join("python");
        let words = r#"read -r line; eval "set -- $(echo "$line" | tr '[],' '   ')""#;
        fs::write(&python, format!("#!/bin/sh\n{words}\n{script}\necho 0\n")).unwrap();
        fs::set_permissions(&python, fs::Permissions::from_mode(0o755)).unwrap();
        let paths = Paths { python, ..Paths::find() };
        let (services, limit) = (Services::default(), Duration::from_millis(2000));
        let answers =
            super::ask(&["trimesh"], (&POINTS, &BODY), place.path(), &services, &paths, limit);
        answers.unwrap().remove(0).map(|answer| answer.inside)
    }

    fn answering(bytes: &[u8]) -> String {
        let octal: String = bytes.iter().map(|byte| format!("\\{byte:03o}")).collect();
        format!("printf '{octal}' > \"$3\"")
    }

    #[test]
    fn points_body_and_sides_are_exchanged_through_files() {
        let check = "[ $(wc -c < \"$1\") = 48 ] && [ $(wc -c < \"$2\") = 134 ] || exit 9";
        assert_eq!(ask(&format!("{check}\n{}", answering(&[1, 0]))), Ok(vec![true, false]));
    }

    #[test]
    fn each_failure_has_its_own_message() {
        let sentence = |script: &str| ask(script).unwrap_err().to_string();
        let missing = ask("echo no module >&2; exit 3").unwrap_err().end;
        assert_eq!(
            missing,
            End::Missing("needs a package of Python that is missing: no module".into())
        );
        assert_eq!(sentence("echo bang >&2; exit 1"), "trimesh ended with code 1: bang");
        assert_eq!(sentence("kill -11 $$"), "trimesh was killed by signal 11");
        assert_eq!(sentence("sleep 60"), "trimesh did not end within 2 s and was killed");
        assert_eq!(sentence(&answering(&[1])), "trimesh classified 1 of 2 points");
        let side = "trimesh gave the side 2, and the sides are 0 and 1";
        assert_eq!(sentence(&answering(&[1, 2])), side);
        assert_eq!(sentence("exit 0"), "trimesh ended without an answer");
        assert_eq!(sentence("echo bang >&2; echo 1; exit"), "trimesh ended with code 1: bang");
        assert_eq!(sentence("echo well; exit"), "trimesh gave no exit code");
        assert!(sentence("").contains("wrote no answer"));
        assert!(sentence("mkfifo \"$3\"").contains("a pipe"));
    }

    #[test]
    fn without_python_the_oracle_is_missing() {
        let place = tempfile::tempdir().unwrap();
        let paths = Paths { python: "/nowhere/python".into(), ..Paths::find() };
        let (services, limit) = (Services::default(), Duration::from_secs(1));
        let answers =
            super::ask(&["open3d"], (&POINTS, &BODY), place.path(), &services, &paths, limit);
        let failure = answers.unwrap().remove(0).map(drop).unwrap_err();
        assert!(matches!(failure.end, End::Missing(why) if why.contains("/nowhere/python")));
    }
}
