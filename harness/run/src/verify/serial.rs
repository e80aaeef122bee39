//! The serial meshes, with which all others are compared: base tree and final mesh, of mesher and reference.

use super::case::{CaseRun, PROOF};
use super::options::Need;
use super::outcome::{DETERMINISTIC, RUNS, ended_well};
use super::report::{Check, Outcome, Run};
use super::run::{Meshed, Program, Request};
use crate::engine::failure::{CODE_INPUT, End, Failure};
use crate::engine::layout::SERIAL;
use crate::engine::report::RunReport;
use crate::proof;
use check::checks::{self, CheckResult, Subject, identical, kept};
use contract::case::Case;
use contract::leafset::LeafSet;
use contract::manifest::{Ambiguous, Components, Manifest};
use contract::watch::Watch;
use std::path::{Path, PathBuf};

/// Meshes that later steps use.
#[derive(Debug)]
pub struct Meshes {
    /// The mesher's final mesh.
    pub mesh: LeafSet,
    /// The mesher's base tree; `None` for an engine that does not promise the definition.
    pub base: Option<Base>,
}

/// A base tree and its directory.
#[derive(Debug)]
pub struct Base {
    /// The leaves.
    pub tree: LeafSet,
    /// The leaf-set directory.
    pub place: PathBuf,
}

/// A serial run that writes the final mesh.
fn serial<'a>(program: Program, case: &'a Path, name: &'a str) -> Request<'a> {
    Request { program, layout: &SERIAL, case, name, ungraded: false, write: true }
}

impl CaseRun<'_> {
    /// Makes the serial meshes and checks them. `None` if the mesher made none, or they are too large to check.
    pub fn verify_serial(&mut self, case: &Case) -> Option<Meshes> {
        let timed = self.measure()?;
        let (cells, limit) = (timed.cells, self.options.cells_max);
        if cells > limit {
            let why = format!("{cells} cells exceed the {limit} that are checked in memory");
            self.add(Check::new("serial", "checks", Outcome::left_out(why)), None);
            return None;
        }
        let serial = self.make("serial", Program::Mesher, "serial", false)?;
        let (place, mesh) = (serial.place.join("mesh"), serial.mesh?);
        self.verify_repetition(&timed, &mesh);
        if self.promises().definition {
            return self.verify_definition(case, mesh, &place);
        }
        self.progress.step("checks");
        let results = self.promised(case, &mesh);
        self.add_results("serial", None, results);
        Some(Meshes { mesh, base: None })
    }

    /// Compares a mesh, which is in this directory, with the base tree and with the reference.
    fn verify_definition(&mut self, case: &Case, mesh: LeafSet, place: &Path) -> Option<Meshes> {
        // The mesh of an engine that cannot stop at the base tree is checked against the reference's base tree.
        let stops = self.programs.engine.description().run.ungraded.is_some();
        let program = if stops { Program::Mesher } else { Program::Reference };
        let base = self.make("base tree", program, "base", true)?;
        let base = Base { place: base.place.join("mesh"), tree: base.mesh? };
        self.report().leaves_base = base.tree.words.len() as u64;
        let reference = self.reference(case, &mesh, &base);
        self.progress.step("checks");
        let subject = Subject::new(case, &mesh).with_base(&base.tree);
        let subject = match &reference {
            Some(reference) => subject.with_reference(reference),
            None => subject,
        };
        let results = checks::all(&subject);
        self.add_results("serial", None, results);
        self.note_components(&mesh.manifest);
        self.verify_proof((place, &base.place), mesh.words.len() as u64);
        Some(Meshes { mesh, base: Some(base) })
    }

    /// Has the proven checker judge the mesh, given its base tree.
    fn verify_proof(&mut self, places: (&Path, &Path), leaves: u64) {
        let (subject, name) = PROOF;
        if let Some(why) = self.needs.proof.clone() {
            return self.add(Check::new(subject, name, Outcome::left_out(why)), None);
        }
        self.progress.step("proof");
        let (checker, limit) = (&self.programs.paths.proven_checker, self.options.limit());
        match proof::check(checker, places, leaves, limit) {
            Ok(proof) => self.add_results(subject, None, vec![CheckResult { name, ..proof }]),
            Err(failure) if failure.is_interrupt() => {}
            // The files of another program may lack what the proof needs.
            Err(Failure { end: End::Exited { code: CODE_INPUT, error }, .. })
                if !self.options.require.contains(&Need::Proof) =>
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
    pub fn promised(&self, case: &Case, mesh: &LeafSet) -> Vec<CheckResult> {
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

    /// Adds remarks about components that a user may not expect to the check that has counted them.
    fn note_components(&mut self, manifest: &Manifest) {
        let mut checks = self.report().checks.iter_mut();
        let Some(check) = checks.rfind(|check| check.name == kept::NAME) else { return };
        let Ambiguous { count: ambiguous, example } = manifest.components_ambiguous;
        if let Some(Components { outside, enclosed, .. }) = &manifest.components
            && let (count @ 1.., Some(at)) = (enclosed.count, enclosed.example)
        {
            check.notes.push(format!(
                "{count} of {outside} outside components are enclosed, and their {} leaves of T0 are deleted, for \
                 example at {at:?}",
                enclosed.leaves
            ));
        }
        if let Some(at) = example {
            check.notes.push(format!(
                "the rays of {ambiguous} components disagree, and their majority decides, for example at {at:?}"
            ));
        }
    }

    /// One run, whose failure ends the case.
    fn make(
        &mut self,
        subject: &str,
        program: Program,
        name: &str,
        ungraded: bool,
    ) -> Option<Meshed> {
        self.progress.step(&format!("{name}: {}", if ungraded { "base tree" } else { "mesh" }));
        let request = Request { ungraded, ..serial(program, &self.selected.path, name) };
        match self.run(&request) {
            Ok(meshed) => {
                self.add(Check::new(subject, RUNS, ended_well()), None);
                Some(meshed)
            }
            // The harness has read the case without an error, so an input error is this program's opinion only.
            Err(failure) => {
                self.add_failure(subject, None, &failure);
                None
            }
        }
    }

    /// A run for time and memory, which writes no mesh if the engine can do without; returns its report.
    fn measure(&mut self) -> Option<RunReport> {
        self.progress.step("serial, timed");
        let request =
            Request { write: false, ..serial(Program::Mesher, &self.selected.path, "timed") };
        let timed = self.run(&request).and_then(|timed| match timed.report.digest {
            Some(_) => Ok(timed),
            // Only the mesh of another run can show what such a run makes.
            None => {
                let Meshed { report, run, .. } = self.run(&Request { write: true, ..request })?;
                let run = Run { digest: run.digest, ..timed.run };
                Ok(Meshed { report, run, ..timed })
            }
        });
        match timed {
            Ok(meshed) => {
                self.report().cells = meshed.run.cells;
                self.report().runs.push(meshed.run);
                Some(meshed.report)
            }
            Err(failure) => {
                self.add_failure("serial", None, &failure);
                None
            }
        }
    }

    /// The reference's final mesh; its base tree is compared with the mesher's.
    fn reference(&mut self, case: &Case, mesh: &LeafSet, own: &Base) -> Option<LeafSet> {
        let (cells, limit) = (mesh.words.len() as u64, self.options.reference_cells_max);
        if cells > limit {
            let why = format!("{cells} cells exceed the {limit} up to which the reference is run");
            self.add(Check::new("reference", "identical", Outcome::left_out(why)), None);
            return None;
        }
        let meshed = self.make("reference", Program::Reference, "reference", false)?;
        self.report().runs.push(meshed.run);
        let base = self.make("reference base tree", Program::Reference, "reference-base", true)?;
        let compared = identical::compare(&own.tree.words, &base.mesh?.words, &case.root);
        self.add_results("base tree", None, vec![compared]);
        meshed.mesh
    }

    /// A case that the harness refuses: it is an input error if the mesher refuses it too, else a failed check.
    pub fn verify_refusal(&mut self, why: &str) {
        match self.run(&serial(Program::Mesher, &self.selected.path, "serial")) {
            Ok(_) => {
                let why = format!("the mesher accepts an invalid case: {why}");
                self.add(Check::new("serial", RUNS, Outcome::fail(why)), None);
            }
            Err(failure) => match failure.end {
                End::Exited { code: CODE_INPUT, error } => self.report().input_error = Some(error),
                _ => self.add_failure("serial", None, &failure),
            },
        }
    }
}
