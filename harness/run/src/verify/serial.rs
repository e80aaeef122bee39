//! The serial meshes, with which all others are compared: base tree and final mesh, of mesher and reference.

use super::case::{CaseRun, PROOF};
use super::options::Need;
use super::report::{Check, DETERMINISTIC, Outcome, RUNS, Run};
use super::run::{MESHER, Makes, Meshed, REFERENCE};
use crate::engine::failure::{CODE_INPUT, End, Failure};
use crate::engine::layout::SERIAL;
use crate::engine::report::RunReport;
use crate::proof;
use check::checks::{self, CheckResult, Subject, identical};
use contract::case::Case;
use contract::leafset::LeafSet;
use std::path::{Path, PathBuf};

/// Most cells of a mesh that is checked in memory. `harness audit` checks larger ones.
const CELLS_MAX: u64 = 100_000_000;
/// Most cells of a mesh that the reference makes, too.
const REFERENCE_CELLS_MAX: usize = 3_000_000;

/// Meshes that later steps use.
#[derive(Debug)]
pub(super) struct Meshes {
    /// The mesher's final mesh.
    pub mesh: LeafSet,
    /// The mesher's base tree; `None` for an engine that does not promise the definition.
    pub base: Option<Base>,
}

/// A base tree and its directory.
#[derive(Debug)]
pub(super) struct Base {
    /// The leaves.
    pub tree: LeafSet,
    /// The leaf-set directory.
    pub place: PathBuf,
}

impl CaseRun<'_> {
    /// Makes the serial meshes and checks them. `None` if the mesher made none, or they are too large to check.
    pub(super) fn verify_serial(&mut self, case: &Case) -> Option<Meshes> {
        let timed = self.measure()?;
        let cells = timed.cells;
        if cells > CELLS_MAX {
            let why = format!(
                "{cells} cells exceed the {CELLS_MAX} that are checked in memory: `harness audit` checks larger meshes"
            );
            self.add(Check::new("serial", "checks", Outcome::left_out(why)), None);
            return None;
        }
        let serial = self.make("serial", "serial", MESHER, Makes::Mesh)?;
        let (place, mesh) = (serial.place.join("mesh"), serial.mesh?);
        self.verify_repetition(&timed, &mesh);
        if self.promises().definition {
            return self.verify_definition(case, mesh, &place);
        }
        self.step("checks");
        let results = self.promised(case, &mesh);
        self.add_results("serial", None, results);
        Some(Meshes { mesh, base: None })
    }

    /// Compares a mesh, which is in this directory, with the base tree and with the reference.
    fn verify_definition(&mut self, case: &Case, mesh: LeafSet, place: &Path) -> Option<Meshes> {
        // The mesh of an engine that cannot stop at the base tree is checked against the reference's base tree.
        let stops = self.engine().run.ungraded.is_some();
        let program = if stops { MESHER } else { REFERENCE };
        let base = self.make("base tree", "base", program, Makes::Base)?;
        let base = Base { place: base.place.join("mesh"), tree: base.mesh? };
        self.report.leaves_base = base.tree.words.len() as u64;
        let reference = self.reference(case, &mesh, &base);
        self.step("checks");
        let subject = Subject::new(case, &mesh).with_base(&base.tree);
        let subject = match &reference {
            Some(reference) => subject.with_reference(reference),
            None => subject,
        };
        let results = checks::all(&subject);
        self.add_results("serial", None, results);
        self.verify_proof((place, &base.place), mesh.words.len() as u64);
        Some(Meshes { mesh, base: Some(base) })
    }

    /// Has the proven checker judge the mesh, given its base tree.
    fn verify_proof(&mut self, places: (&Path, &Path), leaves: u64) {
        let (subject, name) = PROOF;
        if let Some(why) = self.all.needs.proof.clone() {
            return self.add(Check::new(subject, name, Outcome::left_out(why)), None);
        }
        self.step("proof");
        let (checker, limit) = (&self.all.programs.paths.proven_checker, self.all.options.limit());
        match proof::check(checker, places, leaves, limit) {
            Ok(proof) => self.add_results(subject, None, vec![CheckResult { name, ..proof }]),
            Err(failure) if failure.is_interrupt() => {}
            // The files of another program may lack what the proof needs.
            Err(Failure { end: End::Exited { code: CODE_INPUT, error }, .. })
                if !self.all.options.require.contains(&Need::Proof) =>
            {
                self.add(Check::new(subject, name, Outcome::left_out(error)), None);
            }
            // Without an answer nothing is proven, and that must not look as if it were.
            Err(failure) => {
                self.add(Check::new(subject, name, Outcome::fail(failure.to_string())), None);
            }
        }
    }

    /// The checks of what the engine promises about any of its meshes, and of the files.
    pub(super) fn promised(&self, case: &Case, mesh: &LeafSet) -> Vec<CheckResult> {
        checks::all(&Subject::new(case, mesh).promising(self.promises()))
    }

    /// Compares the digest of the timed run with that of the mesh that was written, if the engine is deterministic.
    fn verify_repetition(&mut self, timed: &RunReport, mesh: &LeafSet) {
        if !self.promises().is_deterministic() {
            return;
        }
        let first = timed.digest.as_deref().unwrap_or_default();
        let second = mesh.manifest.digest.to_string();
        let outcome = match *first == second {
            true => Outcome::held(mesh.words.len() as u64),
            false => Outcome::fail(format!(
                "two serial runs differ: {} cells, digest {first}; {} cells, digest {second}",
                timed.cells,
                mesh.words.len()
            )),
        };
        self.add(Check::new("serial", DETERMINISTIC, outcome), None);
    }

    /// One run, whose failure ends the case.
    fn make(&mut self, subject: &str, name: &str, program: &str, makes: Makes) -> Option<Meshed> {
        self.step(subject);
        let meshed = self.run(&self.file, name, program, makes, &SERIAL);
        let meshed = self.ended(subject, meshed)?;
        self.add(Check::new(subject, RUNS, Outcome::held(2)), None);
        Some(meshed)
    }

    /// A run that ended well. The harness has read the case without an error, so an input error is the program's opinion only.
    fn ended(&mut self, subject: &str, run: Result<Meshed, Failure>) -> Option<Meshed> {
        run.map_err(|failure| self.add_failure(subject, None, &failure)).ok()
    }

    /// A run for time and memory, which writes no mesh if the engine can do without; returns its report.
    fn measure(&mut self) -> Option<RunReport> {
        self.step("serial, timed");
        let timed = self.run(&self.file, "timed", MESHER, Makes::Nothing, &SERIAL);
        let timed = timed.and_then(|timed| match timed.report.digest {
            Some(_) => Ok(timed),
            // Only the mesh of another run can show what such a run makes.
            None => {
                let again = self.run(&self.file, "timed", MESHER, Makes::Mesh, &SERIAL)?;
                let run = Run { digest: again.run.digest, ..timed.run };
                Ok(Meshed { run, report: again.report, ..timed })
            }
        });
        let timed = self.ended("serial", timed)?;
        self.report.cells = timed.run.cells;
        self.report.runs.push(timed.run);
        Some(timed.report)
    }

    /// The reference's final mesh; its base tree is compared with the mesher's.
    fn reference(&mut self, case: &Case, mesh: &LeafSet, own: &Base) -> Option<LeafSet> {
        let cells = mesh.words.len();
        if cells > REFERENCE_CELLS_MAX {
            let why = format!(
                "{cells} cells exceed the {REFERENCE_CELLS_MAX} up to which the reference is run"
            );
            self.add(Check::new("reference", "identical", Outcome::left_out(why)), None);
            return None;
        }
        let meshed = self.make("reference", "reference", REFERENCE, Makes::Mesh)?;
        self.report.runs.push(meshed.run);
        let base = self.make("reference base tree", "reference-base", REFERENCE, Makes::Base)?;
        let compared = identical::compare(&own.tree.words, &base.mesh?.words, &case.root);
        self.add_results("base tree", None, vec![compared]);
        meshed.mesh
    }

    /// A case that the harness refuses: it is an input error if the mesher refuses it too, else a failed check.
    pub(super) fn verify_refusal(&mut self, why: &str) {
        match self.run(&self.file, "serial", MESHER, Makes::Mesh, &SERIAL) {
            Ok(_) => {
                let why = format!("the mesher accepts an invalid case: {why}");
                self.add(Check::new("serial", RUNS, Outcome::fail(why)), None);
            }
            Err(failure) => match failure.end {
                End::Exited { code: CODE_INPUT, error } => self.report.input_error = Some(error),
                _ => self.add_failure("serial", None, &failure),
            },
        }
    }
}
