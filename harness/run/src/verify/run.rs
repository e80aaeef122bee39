//! One run of one program on a case: started, watched, its mesh and record read.

use super::case::CaseRun;
use super::outcome::Trouble;
use super::report::Run;
use crate::engine::mesher::{self, Files, Layout, Record};
use crate::engine::mpi::SharedMemory;
use crate::engine::process::{self, End, Finished, Watch};
use contract::leafset::{self, LeafSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Exit code of mesher and reference for what is the user's fault.
const EXIT_INPUT: i32 = 2;

/// What is run, and how.
#[derive(Clone, Copy, Debug)]
pub enum What<'a> {
    /// The reference.
    Reference,
    /// The mesher without MPI.
    Serial,
    /// The mesher on MPI.
    Ranks(&'a Layout),
}

/// How a run is to be done.
#[derive(Clone, Copy, Debug)]
pub struct Order<'a> {
    /// The program.
    pub what: What<'a>,
    /// The case file.
    pub case: &'a Path,
    /// Name of the run's directory below the case's.
    pub name: &'a str,
    /// Make the base tree and not the final mesh.
    pub ungraded: bool,
    /// Write the mesh; otherwise only the record is made.
    pub write: bool,
}

/// A run that ended well.
#[derive(Debug)]
pub struct Done {
    /// What it was like.
    pub run: Run,
    /// The mesh, if it was written.
    pub mesh: Option<LeafSet>,
    /// Where it was written.
    pub place: PathBuf,
}

impl CaseRun<'_> {
    /// Does a run. Its directory stays until somebody removes it.
    ///
    /// # Errors
    /// Where it fails, hangs, or what it wrote cannot be read or does not fit its record.
    pub fn run(&self, order: &Order) -> Result<Done, Trouble> {
        let failed = |why: String| Trouble::Failed(why);
        let place = self.place.join(order.name);
        let status = place.join("status");
        fs::create_dir_all(&status)
            .map_err(|error| failed(format!("{}: {error}", place.display())))?;
        let (mesh, json) = (place.join("mesh"), place.join("run.json"));
        // An engine that writes no record is known by its mesh alone.
        let silent = !matches!(order.what, What::Reference)
            && self.programs.engine.as_ref().is_some_and(|e| e.description().run.json.is_none());
        let files = Files {
            case: order.case,
            out: (order.write || silent).then_some(mesh.as_path()),
            json: Some(&json),
            status: Some(&status),
            ungraded: order.ungraded,
        };
        let shared = SharedMemory::new();
        let mut command = self.command(order.what, &files, &shared).map_err(failed)?;
        let watch =
            Watch { limit: self.options.limit, logs: &place, name: "run", status: Some(&status) };
        let finished = process::run(&mut command, &watch).map_err(|error| {
            failed(format!("{:?} cannot be started: {error}", command.get_program()))
        })?;
        judge(&finished, self.options.limit.as_secs())?;
        let record = match silent {
            true => leafset::read_manifest(&mesh)
                .map(|manifest| Record::of_mesh(&manifest, finished.time_wall_s))
                .map_err(|error| failed(error.to_string()))?,
            false => Record::read(&json).map_err(failed)?,
        };
        let mesh = order
            .write
            .then(|| leafset::read(&mesh))
            .transpose()
            .map_err(|error| failed(error.to_string()))?;
        if let Some(mesh) = &mesh {
            fits(&record, mesh).map_err(failed)?;
        }
        Ok(Done { run: run_of(order.what, &record, finished.time_wall_s), mesh, place })
    }

    fn command(&self, what: What, files: &Files, shared: &SharedMemory) -> Result<Command, String> {
        match what {
            What::Reference => Ok(mesher::reference(self.programs, files)),
            What::Serial => mesher::serial(self.programs, files),
            What::Ranks(layout) => mesher::parallel(self.programs, files, layout, shared),
        }
    }
}

/// Whether the run ended as it should.
fn judge(finished: &Finished, limit_s: u64) -> Result<(), Trouble> {
    match finished.end {
        End::Exited(0) => Ok(()),
        End::Exited(EXIT_INPUT) => Err(Trouble::Input(finished.first_error_line())),
        End::Exited(code) => {
            Err(Trouble::Failed(format!("exit {code}: {}", finished.first_error_line())))
        }
        End::Signalled(signal) => Err(Trouble::Failed(format!("died of signal {signal}"))),
        End::TimedOut => {
            let last = last_doing(&finished.last_doing);
            Err(Trouble::Hung(format!("did not end within {limit_s} s and was killed; {last}")))
        }
        End::Interrupted => Err(Trouble::Interrupted),
    }
}

/// What each rank was last doing, ranks that did the same told together.
fn last_doing(status: &[(usize, String)]) -> String {
    let mut told: Vec<(&str, Vec<String>)> = Vec::new();
    for (rank, doing) in status {
        match told.iter_mut().find(|(same, _)| same == doing) {
            Some((_, ranks)) => ranks.push(rank.to_string()),
            None => told.push((doing, vec![rank.to_string()])),
        }
    }
    if told.is_empty() {
        return "no rank had said what it was doing".to_owned();
    }
    let of = |(doing, ranks): (&str, Vec<String>)| match ranks.len() {
        1 => format!("rank {} was in: {doing}", ranks[0]),
        _ => format!("ranks {} were in: {doing}", ranks.join(", ")),
    };
    told.into_iter().map(of).collect::<Vec<_>>().join("; ")
}

/// Whether the record says of the mesh what the mesh says of itself.
fn fits(record: &Record, mesh: &LeafSet) -> Result<(), String> {
    let (digest, leaves) = (mesh.manifest.digest.to_string(), mesh.words.len() as u64);
    if record.digest != digest || record.cells != leaves {
        return Err(format!(
            "--json says {} cells, digest {}; the mesh has {leaves} leaves, digest {digest}",
            record.cells, record.digest
        ));
    }
    Ok(())
}

fn run_of(what: What, record: &Record, time_process_s: f64) -> Run {
    let (program, layout) = match what {
        What::Reference => ("reference", None),
        What::Serial => ("mesher", None),
        What::Ranks(layout) => ("mesher", Some(layout.clone())),
    };
    Run {
        program: program.to_owned(),
        layout,
        cells: record.cells,
        time_wall_s: record.time_wall_s,
        time_process_s,
        peak_rss_bytes: record.peak_rss_bytes(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_that_did_the_same_are_told_together() {
        let status =
            [(0, "layer 7".to_owned()), (1, "balance".to_owned()), (2, "layer 7".to_owned())];
        assert_eq!(last_doing(&status), "ranks 0, 2 were in: layer 7; rank 1 was in: balance");
        assert_eq!(last_doing(&[]), "no rank had said what it was doing");
    }
}
