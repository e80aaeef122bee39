//! The serial meshes, with which all others are compared: base tree and final mesh, of mesher and reference.

use super::case::{CaseRun, RUNS};
use super::report::{Check, Outcome};
use super::run::{Meshed, Program, Request};
use crate::engine::failure::{CODE_INPUT, End};
use crate::engine::layout::SERIAL;
use check::checks::{self, Subject, identical, kept};
use contract::case::Case;
use contract::leafset::LeafSet;
use contract::manifest::{Ambiguous, Components, Manifest};
use std::path::{Path, PathBuf};

/// Meshes that later steps use.
#[derive(Debug)]
pub struct Meshes {
    /// The mesher's final mesh.
    pub mesh: LeafSet,
    /// The mesher's base tree.
    pub base: LeafSet,
    /// Directory of the base tree.
    pub base_place: PathBuf,
}

/// A serial run that writes the final mesh.
fn serial<'a>(program: Program, case: &'a Path, name: &'a str) -> Request<'a> {
    Request { program, layout: &SERIAL, case, name, ungraded: false, write: true }
}

impl CaseRun<'_> {
    /// Makes the serial meshes and checks them. `None` if the mesher made none, or they are too large to check.
    pub fn verify_serial(&mut self, case: &Case) -> Option<Meshes> {
        let (cells, limit) = (self.measure()?, self.options.cells_max);
        if cells > limit {
            let why = format!("{cells} cells exceed the {limit} that are checked in memory");
            self.add(Check::new("serial", "checks", Outcome::LeftOut(why)), None);
            return None;
        }
        let mesh = self.make("serial", Program::Mesher, "serial", false)?;
        // The mesh of an engine that cannot stop at the base tree is checked against the reference's base tree.
        let stops = self.programs.engine.description().run.ungraded.is_some();
        let program = if stops { Program::Mesher } else { Program::Reference };
        let base = self.make("base tree", program, "base", true)?;
        let base_place = base.place.join("mesh");
        let meshes = Meshes { mesh: mesh.mesh?, base: base.mesh?, base_place };
        self.report().leaves_base = meshes.base.words.len() as u64;
        let reference = self.reference(case, &meshes);
        self.progress.step("checks");
        let subject = Subject::new(case, &meshes.mesh).with_base(&meshes.base);
        let subject = match &reference {
            Some(reference) => subject.with_reference(reference),
            None => subject,
        };
        self.add_results("serial", None, checks::all(&subject));
        self.note_components(&meshes.mesh.manifest);
        Some(meshes)
    }

    /// Adds the numbers of components to the check that has compared them, with remarks about what a user may not expect.
    fn note_components(&mut self, manifest: &Manifest) {
        let mut checks = self.report().checks.iter_mut();
        let Some(check) = checks.rfind(|check| check.name == kept::NAME) else { return };
        let Ambiguous { count: ambiguous, example } = manifest.components_ambiguous;
        check.counts.insert("components_ambiguous".into(), ambiguous);
        if let Some(components) = &manifest.components {
            let Components { outside, inside, enclosed } = components;
            check.counts.extend([
                ("components_outside".to_owned(), *outside),
                ("components_inside".to_owned(), *inside),
                ("components_enclosed".to_owned(), enclosed.count),
                ("enclosed_leaves".to_owned(), enclosed.leaves),
            ]);
            if let (count @ 1.., Some(at)) = (enclosed.count, enclosed.example) {
                check.notes.push(format!(
                    "{count} of {outside} outside components are enclosed, and their {} leaves of T0 are deleted, for \
                     example at {at:?}",
                    enclosed.leaves
                ));
            }
        }
        if let Some(at) = example {
            check.notes.push(format!(
                "the rays of {ambiguous} components disagree, and their majority decides, for example at {at:?}"
            ));
        }
        if !manifest.seeds.is_empty() {
            let seeds = manifest.seeds.len();
            check.notes.push(format!("{seeds} seeds determine the sides instead of rays"));
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
        self.progress.step(format!("{name}: {}", if ungraded { "base tree" } else { "mesh" }));
        let request = Request { ungraded, ..serial(program, &self.selected.path, name) };
        match self.run(&request) {
            Ok(meshed) => {
                self.add(Check::new(subject, RUNS, Outcome::Pass), None);
                Some(meshed)
            }
            // The harness has read the case without an error, so an input error is this program's opinion only.
            Err(failure) => {
                self.add_failure(subject, None, &failure);
                None
            }
        }
    }

    /// A run that writes no mesh, for time and memory; returns the number of cells.
    fn measure(&mut self) -> Option<u64> {
        self.progress.step("serial, timed");
        let request =
            Request { write: false, ..serial(Program::Mesher, &self.selected.path, "timed") };
        match self.run(&request) {
            Ok(meshed) => {
                let cells = meshed.run.cells;
                self.report().cells = cells;
                self.report().runs.push(meshed.run);
                Some(cells)
            }
            Err(failure) => {
                self.add_failure("serial", None, &failure);
                None
            }
        }
    }

    /// The reference's final mesh; its base tree is compared with the mesher's.
    fn reference(&mut self, case: &Case, meshes: &Meshes) -> Option<LeafSet> {
        let (cells, limit) = (meshes.mesh.words.len() as u64, self.options.reference_cells_max);
        if cells > limit {
            let why = format!("{cells} cells exceed the {limit} up to which the reference is run");
            self.add(Check::new("reference", "identical", Outcome::LeftOut(why)), None);
            return None;
        }
        let meshed = self.make("reference", Program::Reference, "reference", false)?;
        self.report().runs.push(meshed.run);
        let base = self.make("reference base tree", Program::Reference, "reference-base", true)?;
        let compared = identical::compare(&meshes.base.words, &base.mesh?.words, &case.root);
        self.add_results("base tree", None, vec![compared]);
        meshed.mesh
    }

    /// A case that the harness refuses: it is an input error if the mesher refuses it too, else a failed check.
    pub fn verify_refusal(&mut self, why: &str) {
        match self.run(&serial(Program::Mesher, &self.selected.path, "serial")) {
            Ok(_) => {
                let why = format!("the mesher accepts an invalid case: {why}");
                self.add(Check::new("serial", RUNS, Outcome::Fail(why)), None);
            }
            Err(failure) => match failure.end {
                End::Exited { code: CODE_INPUT, error } => self.report().input_error = Some(error),
                _ => self.add_failure("serial", None, &failure),
            },
        }
    }
}
