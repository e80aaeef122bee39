//! Command lines of mesher and reference, and what they say of a run in `--json`.

use super::mpi::{self, SharedMemory};
use super::programs::Programs;
use super::runner::{Engine, Ranks, Wanted};
use contract::manifest::Manifest;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::Path;
use std::process::Command;

/// How a run on MPI is laid out; without effect on the mesh, which is what is being verified.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Layout {
    /// Number of ranks.
    pub ranks: usize,
    /// `metis` or `morton`.
    pub partitioner: String,
    /// `auto` or a level.
    pub level_base: String,
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let plural = if self.ranks == 1 { "" } else { "s" };
        write!(f, "{} rank{plural}, {}, base {}", self.ranks, self.partitioner, self.level_base)
    }
}

/// Files of one run. Options that are `None` are left out of the command line.
#[derive(Clone, Copy, Debug)]
pub struct Files<'a> {
    /// The case file.
    pub case: &'a Path,
    /// Leaf-set directory to be made.
    pub out: Option<&'a Path>,
    /// Record of the run.
    pub json: Option<&'a Path>,
    /// Directory for the ranks' status files.
    pub status: Option<&'a Path>,
    /// Write the base tree instead of the final mesh.
    pub ungraded: bool,
}

impl Files<'_> {
    fn add_to(&self, command: &mut Command) {
        command.arg(self.case);
        for (option, value) in
            [("--out", self.out), ("--json", self.json), ("--status", self.status)]
        {
            if let Some(value) = value {
                command.arg(option).arg(value);
            }
        }
        if self.ungraded {
            command.arg("--ungraded");
        }
    }
}

/// The reference's command.
pub fn reference(programs: &Programs, files: &Files) -> Command {
    let mut command = Command::new(&programs.paths.reference);
    Files { status: None, ..*files }.add_to(&mut command);
    command
}

/// The command of the mesher, or of the engine that stands in for it, without MPI.
///
/// # Errors
/// Where the engine's description does not say how this is done.
pub fn serial(programs: &Programs, files: &Files) -> Result<Command, String> {
    if let Some(engine) = &programs.engine {
        return described(engine, Ranks::Serial, files, &Wanted::default());
    }
    let mut command = Command::new(&programs.paths.mesher);
    files.add_to(&mut command);
    command.args(["--comm", "solo", "--quiet"]);
    Ok(command)
}

fn described(
    engine: &Engine,
    ranks: Ranks,
    files: &Files,
    chosen: &Wanted,
) -> Result<Command, String> {
    let Files { case, out, json, status, ungraded } = *files;
    let wanted = Wanted { out, json, status, ungraded, ..*chosen };
    engine.command(case, ranks, &wanted).map_err(|why| why.to_string())
}

/// The command of the mesher, or of the engine that stands in for it, on MPI.
///
/// # Errors
/// Where the engine's description does not say how this is done.
pub fn parallel(
    programs: &Programs,
    files: &Files,
    layout: &Layout,
    shared: &SharedMemory,
) -> Result<Command, String> {
    if let Some(engine) = &programs.engine {
        let (partitioner, level_base) = (layout.partitioner.as_str(), layout.level_base.as_str());
        let chosen = Wanted { partitioner, level_base, ..Wanted::default() };
        let mut command = described(engine, Ranks::Mpi(layout.ranks), files, &chosen)?;
        mpi::set_environment(&mut command);
        shared.add_to(&mut command);
        return Ok(command);
    }
    let mut command =
        mpi::command(&programs.paths.mpirun, layout.ranks, &programs.paths.mesher, shared);
    files.add_to(&mut command);
    command.args(["--comm", "mpi", "--quiet", "--partitioner", &layout.partitioner]);
    command.args(["--level-base", &layout.level_base]);
    Ok(command)
}

/// What a run says of itself; both programs write more, which is not looked at here.
#[derive(Clone, Debug, Deserialize)]
pub struct Record {
    /// Cells of the final mesh, or leaves of the base tree.
    pub cells: u64,
    /// 32 hex digits.
    pub digest: String,
    /// Number of ranks; the reference has none.
    #[serde(default = "one")]
    pub ranks: usize,
    /// From the program's own clock, in seconds.
    pub time_wall_s: f64,
    /// Peak resident memory of each rank.
    peak_rss_bytes: OneOrMany,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
enum OneOrMany {
    One(u64),
    Many(Vec<u64>),
}

fn one() -> usize {
    1
}

impl Record {
    /// Reads the file that `--json` made.
    ///
    /// # Errors
    /// One sentence, where there is none or it is not what it should be.
    pub fn read(path: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(path)
            .map_err(|error| format!("{}: {error}", path.display()))?;
        serde_json::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))
    }

    /// What is known of a run that wrote no record: what its mesh says, and the process's time.
    pub fn of_mesh(manifest: &Manifest, time_wall_s: f64) -> Self {
        Self {
            cells: manifest.leaves,
            digest: manifest.digest.to_string(),
            ranks: 1,
            time_wall_s,
            peak_rss_bytes: OneOrMany::One(0),
        }
    }

    /// Peak memory of all ranks together.
    pub fn peak_rss_bytes(&self) -> u64 {
        match &self.peak_rss_bytes {
            OneOrMany::One(bytes) => *bytes,
            OneOrMany::Many(bytes) => bytes.iter().sum(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_programs_records_are_read() {
        let mesher: Record = serde_json::from_str(
            r#"{"schema": "octree-mesher-run/1", "cells": 8, "digest": "00", "ranks": 2, "time_wall_s": 0.5,
                "peak_rss_bytes": [3, 4], "phases": []}"#,
        )
        .unwrap();
        assert_eq!((mesher.ranks, mesher.peak_rss_bytes()), (2, 7));
        let reference = r#"{"cells": 8, "digest": "00", "time_wall_s": 0.5, "peak_rss_bytes": 9}"#;
        let reference: Record = serde_json::from_str(reference).unwrap();
        assert_eq!((reference.ranks, reference.peak_rss_bytes()), (1, 9));
    }

    #[test]
    fn command_lines_are_those_of_the_contract() {
        let programs = Programs::find(Default::default());
        let files = Files {
            case: Path::new("a.toml"),
            out: Some(Path::new("mesh")),
            json: None,
            status: Some(Path::new("status")),
            ungraded: true,
        };
        let words = |command: &Command| -> Vec<String> {
            command.get_args().map(|word| word.to_string_lossy().into_owned()).collect()
        };
        assert_eq!(words(&reference(&programs, &files)), ["a.toml", "--out", "mesh", "--ungraded"]);
        let layout = Layout { ranks: 3, partitioner: "metis".into(), level_base: "2".into() };
        let parallel = words(&parallel(&programs, &files, &layout, &SharedMemory::new()).unwrap());
        assert_eq!(parallel[..2], ["-n", "3"]);
        let expected = "a.toml --out mesh --status status --ungraded --comm mpi --quiet --partitioner metis --level-base 2";
        assert_eq!(parallel[3..].join(" "), expected);
    }
}
