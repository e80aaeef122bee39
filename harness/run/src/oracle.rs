//! Oracles: Python scripts that classify points as inside or outside of a body. The protocol is that of
//! `harness/oracles/protocol.py`.

use crate::engine::failure::{End, Failure};
use crate::engine::paths::Paths;
use crate::engine::process::Watch;
use crate::engine::python;
use crate::engine::service::Services;
use check::oracle::vote::Answer;
use contract::case::Facet;
use contract::{files, npy};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread::{self, ScopedJoinHandle};
use std::time::Duration;

/// The oracles, in the order in which they run.
pub const ORACLES: [&str; 3] = ["trimesh", "open3d", "pyvista"];

/// Points and a body, as files that every oracle reads.
#[derive(Debug)]
pub struct Question {
    points: PathBuf,
    body: PathBuf,
    place: PathBuf,
    count: usize,
}

impl Question {
    /// Writes points and body into the directory.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn write(points: &[[f64; 3]], body: &[Facet], place: &Path) -> io::Result<Self> {
        let question = Self {
            points: place.join("points.npy"),
            body: place.join("body.stl"),
            place: place.to_owned(),
            count: points.len(),
        };
        let mut file = BufWriter::new(File::create(&question.points)?);
        file.write_all(&npy::header("<f8", &format!("({}, 3)", points.len())))?;
        for coordinate in points.iter().flatten() {
            file.write_all(&coordinate.to_le_bytes())?;
        }
        file.flush()?;
        let mut file = BufWriter::new(File::create(&question.body)?);
        geometries::write_stl_binary(body, &mut file)?;
        file.flush()?;
        Ok(question)
    }

    /// Asks several oracles at the same time, in services that stay.
    ///
    /// # Errors
    /// For each oracle: [`End::Missing`] if it or Python is missing; another end if it fails or does not give one side per point.
    pub fn ask<'o>(
        &self,
        oracles: &[&'o str],
        services: &Services,
        paths: &Paths,
        limit: Duration,
    ) -> Vec<(&'o str, Result<Answer, Failure>)> {
        thread::scope(|scope| {
            let asked = oracles.iter().map(|&oracle| {
                (oracle, scope.spawn(|| self.ask_one(oracle, services, paths, limit)))
            });
            let asked: Vec<_> = asked.collect();
            let answer = |asked: ScopedJoinHandle<_>| {
                asked.join().unwrap_or_else(|panic| resume_unwind(panic))
            };
            asked.into_iter().map(|(oracle, asked)| (oracle, answer(asked))).collect()
        })
    }

    fn ask_one(
        &self,
        oracle: &str,
        services: &Services,
        paths: &Paths,
        limit: Duration,
    ) -> Result<Answer, Failure> {
        let sides = self.place.join(format!("{oracle}.npy"));
        let files = [&self.points, &self.body, &sides];
        let words = files.map(|file| file.to_string_lossy().into_owned());
        let watch = Watch::new(oracle, limit, &self.place);
        let command = command(oracle, paths)?;
        services.request(oracle, || (command, None), &words, &watch).map_err(python::explained)?;
        let inside = read_sides(&sides, self.count);
        let unusable = |why| Failure::new(oracle, End::Unusable(why));
        Ok(Answer { name: oracle.to_owned(), inside: inside.map_err(unusable)? })
    }
}

/// Starts an oracle, unless it runs.
///
/// # Errors
/// [`End::Missing`] if Python is missing.
pub fn start(oracle: &str, services: &Services, paths: &Paths) -> Result<(), Failure> {
    let command = command(oracle, paths)?;
    services.start(oracle, || (command, None))
}

fn command(oracle: &str, paths: &Paths) -> Result<Command, Failure> {
    python::command(oracle, &format!("{oracle}_sides.py"), paths)
}

fn read_sides(path: &Path, count: usize) -> Result<Vec<bool>, String> {
    let bytes = files::read(path).map_err(|error| format!("wrote no answer: {error}"))?;
    let array = || {
        let (header, offset) = npy::read_header(&bytes).map_err(|error| error.to_string())?;
        let sides = &bytes[offset as usize..];
        match (header.descr.as_str(), &header.shape[..]) {
            ("|u1", &[length]) if length == sides.len() as u64 => Ok(sides),
            (dtype, shape) => {
                Err(format!("{} bytes of type {dtype} and shape {shape:?}", sides.len()))
            }
        }
    };
    let sides =
        array().map_err(|why| format!("wrote an answer that is not an array of bytes: {why}"))?;
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
    use std::fs;
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
        let question = Question::write(&POINTS, &BODY, place.path()).unwrap();
        let limit = Duration::from_millis(2000);
        let (_, answer) = question.ask(&["trimesh"], &Services::default(), &paths, limit).remove(0);
        answer.map(|answer| answer.inside)
    }

    fn answering(bytes: &[u8]) -> String {
        let header = npy::header("|u1", &format!("({},)", bytes.len()));
        format!("printf '{}' > \"$3\"", octal(&[&header, bytes].concat()))
    }

    fn octal(bytes: &[u8]) -> String {
        bytes.iter().map(|byte| format!("\\{byte:03o}")).collect()
    }

    #[test]
    fn points_body_and_sides_are_exchanged_through_files() {
        let check = "[ $(wc -c < \"$1\") = 176 ] && [ $(wc -c < \"$2\") = 134 ] || exit 9";
        assert_eq!(ask(&format!("{check}\n{}", answering(&[1, 0]))), Ok(vec![true, false]));
    }

    #[test]
    fn points_are_written_in_numpys_format() {
        let place = tempfile::tempdir().unwrap();
        Question::write(&POINTS, &BODY, place.path()).unwrap();
        let bytes = fs::read(place.path().join("points.npy")).unwrap();
        let file = npyz::NpyFile::new(&bytes[..]).unwrap();
        assert_eq!(file.shape(), [2, 3]);
        assert_eq!(file.into_vec::<f64>().unwrap(), POINTS.as_flattened());
    }

    #[test]
    fn each_failure_has_its_own_message() {
        let sentence = |script: &str| ask(script).unwrap_err().to_string();
        let missing = ask("echo no module >&2; exit 3").unwrap_err().end;
        assert_eq!(missing, End::Missing("is not installed: no module".into()));
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
        assert!(sentence("echo x > \"$3\"").contains("not an array"));
        assert!(sentence("mkfifo \"$3\"").contains("a pipe"));
        let promising = answering(&[1]).replace(
            &octal(&npy::header("|u1", "(1,)")),
            &octal(&npy::header("|u1", "(999999999999,)")),
        );
        assert!(sentence(&promising).contains("1 bytes of type |u1 and shape [999999999999]"));
    }

    #[test]
    fn without_python_the_oracle_is_missing() {
        let place = tempfile::tempdir().unwrap();
        let paths = Paths { python: "/nowhere/python".into(), ..Paths::find() };
        let question = Question::write(&POINTS, &BODY, place.path()).unwrap();
        let limit = Duration::from_secs(1);
        let (_, answer) = question.ask(&["open3d"], &Services::default(), &paths, limit).remove(0);
        let failure = answer.map(drop).unwrap_err();
        assert!(matches!(failure.end, End::Missing(why) if why.contains("/nowhere/python")));
    }
}
