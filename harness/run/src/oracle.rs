//! Putting points to an oracle: the protocol of `harness/oracles/protocol.py`, this side of it.

use crate::engine::process::{self, End, Watch};
use crate::engine::programs::Programs;
use check::oracle::vote::Answer;
use contract::case::Facet;
use contract::npy;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// The oracles, in the order in which they are asked.
pub const ORACLES: [&str; 3] = ["trimesh", "open3d", "pyvista"];

/// Exit code of an oracle whose package is missing.
const EXIT_MISSING: i32 = 3;

/// Why there is no answer.
#[derive(Debug, PartialEq, Eq)]
pub enum NoAnswer {
    /// The oracle, or Python, is not there.
    Missing(String),
    /// It is there and did not answer.
    Failed(String),
    /// The user asked to end.
    Interrupted,
}

/// What is asked of every oracle, as files.
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
    /// Where that cannot be written.
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

    /// Puts it to one oracle.
    ///
    /// # Errors
    /// Where the oracle is missing, fails, or answers anything but one side per point.
    pub fn ask(
        &self,
        oracle: &str,
        programs: &Programs,
        limit: Duration,
    ) -> Result<Answer, NoAnswer> {
        if !programs.paths.python.is_file() {
            let python = programs.paths.python.display();
            return Err(NoAnswer::Missing(format!("there is no {python} (ci/setup makes it)")));
        }
        let sides = self.place.join(format!("{oracle}.npy"));
        let mut command = Command::new(&programs.paths.python);
        command.arg("-B").arg(programs.paths.oracles.join(format!("{oracle}_sides.py")));
        command.args([&self.points, &self.body, &sides]);
        let watch = Watch { limit, logs: &self.place, name: oracle, status: None };
        let failed = |why: String| NoAnswer::Failed(format!("{oracle} {why}"));
        let done = process::run(&mut command, &watch).map_err(|error| failed(error.to_string()))?;
        match done.end {
            End::Exited(0) => {}
            End::Exited(EXIT_MISSING) => return Err(NoAnswer::Missing(done.last_error_line())),
            End::Exited(code) => {
                return Err(failed(format!("exit {code}: {}", done.last_error_line())));
            }
            End::Signalled(signal) => return Err(failed(format!("died of signal {signal}"))),
            End::TimedOut => {
                return Err(failed(format!("did not end within {} s", limit.as_secs())));
            }
            End::Interrupted => return Err(NoAnswer::Interrupted),
        }
        let inside = read_sides(&sides, self.count).map_err(failed)?;
        Ok(Answer { name: oracle.to_owned(), inside })
    }
}

fn read_sides(path: &Path, count: usize) -> Result<Vec<bool>, String> {
    let bytes = std::fs::read(path).map_err(|error| format!("wrote no answer: {error}"))?;
    let sides: Vec<u8> = npyz::NpyFile::new(&bytes[..])
        .and_then(npyz::NpyFile::into_vec)
        .map_err(|error| format!("wrote an answer that is no array of bytes: {error}"))?;
    if sides.len() != count {
        return Err(format!("answered for {} of {count} points", sides.len()));
    }
    match sides.iter().find(|&&side| side > 1) {
        Some(side) => Err(format!("gave side {side}; there are 0 and 1")),
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

    /// Asks a shell script that plays Python; it sees the protocol's arguments as $3, $4 and $5.
    fn ask(script: &str) -> Result<Vec<bool>, NoAnswer> {
        let place = tempfile::tempdir().unwrap();
        let python = place.path().join("python");
        fs::write(&python, format!("#!/bin/sh\n{script}\n")).unwrap();
        fs::set_permissions(&python, fs::Permissions::from_mode(0o755)).unwrap();
        let mut programs = Programs::find(Default::default());
        programs.paths.python = python;
        let question = Question::write(&POINTS, &BODY, place.path()).unwrap();
        question.ask("trimesh", &programs, Duration::from_millis(2000)).map(|answer| answer.inside)
    }

    fn answering(bytes: &[u8]) -> String {
        let header = npy::header("|u1", &format!("({},)", bytes.len()));
        let octal: String =
            [&header, bytes].concat().iter().map(|byte| format!("\\{byte:03o}")).collect();
        format!("printf '{octal}' > \"$5\"")
    }

    #[test]
    fn question_and_answer_go_through_the_files() {
        let check = "[ $(wc -c < \"$3\") = 176 ] && [ $(wc -c < \"$4\") = 134 ] || exit 9";
        assert_eq!(ask(&format!("{check}\n{}", answering(&[1, 0]))), Ok(vec![true, false]));
    }

    #[test]
    fn points_are_written_as_numpy_would() {
        let place = tempfile::tempdir().unwrap();
        Question::write(&POINTS, &BODY, place.path()).unwrap();
        let bytes = fs::read(place.path().join("points.npy")).unwrap();
        let file = npyz::NpyFile::new(&bytes[..]).unwrap();
        assert_eq!(file.shape(), [2, 3]);
        assert_eq!(file.into_vec::<f64>().unwrap(), POINTS.as_flattened());
    }

    #[test]
    fn every_way_of_not_answering_has_its_sentence() {
        let failed = |why: &str| Err(NoAnswer::Failed(format!("trimesh {why}")));
        assert_eq!(ask("echo no module >&2; exit 3"), Err(NoAnswer::Missing("no module".into())));
        assert_eq!(ask("echo bang >&2; exit 1"), failed("exit 1: bang"));
        assert_eq!(ask("kill -11 $$"), failed("died of signal 11"));
        assert_eq!(ask("sleep 60"), failed("did not end within 2 s"));
        assert_eq!(ask(&answering(&[1])), failed("answered for 1 of 2 points"));
        assert_eq!(ask(&answering(&[1, 2])), failed("gave side 2; there are 0 and 1"));
        assert!(
            matches!(ask("exit 0"), Err(NoAnswer::Failed(why)) if why.contains("wrote no answer"))
        );
        assert!(
            matches!(ask("echo x > \"$5\""), Err(NoAnswer::Failed(why)) if why.contains("no array"))
        );
    }

    #[test]
    fn without_python_the_oracle_is_missing() {
        let place = tempfile::tempdir().unwrap();
        let mut programs = Programs::find(Default::default());
        programs.paths.python = "/nowhere/python".into();
        let question = Question::write(&POINTS, &BODY, place.path()).unwrap();
        let answer = question.ask("open3d", &programs, Duration::from_secs(1)).map(drop);
        assert!(matches!(answer, Err(NoAnswer::Missing(why)) if why.contains("/nowhere/python")));
    }
}
