//! The serial meshes, which every other is held against: mesher and reference, base tree and final mesh.

use super::case::{CaseRun, RUNS};
use super::outcome::Trouble;
use super::report::{Check, Outcome};
use super::run::{Done, Order, What};
use check::checks::{self, Subject, identical};
use contract::case::Case;
use contract::leafset::LeafSet;
use std::path::PathBuf;

/// What later steps stand on.
#[derive(Debug)]
pub struct Meshes {
    /// The mesher's final mesh.
    pub mesh: LeafSet,
    /// The mesher's base tree.
    pub base: LeafSet,
    /// Directory of the base tree.
    pub base_place: PathBuf,
}

impl CaseRun<'_> {
    /// Makes the serial meshes and checks them; nothing where the mesher made none.
    pub fn verify_serial(&mut self, case: &Case) -> Option<Meshes> {
        let (cells, most) = (self.measure()?, self.options.cells_max);
        if cells > most {
            let why = format!("{cells} cells are more than the {most} that are held in memory");
            self.add(Check::new("serial", "checks", Outcome::LeftOut(why)), None);
            return None;
        }
        let final_mesh = self.make("serial", What::Serial, "serial", false)?;
        // An engine that cannot stop at the base tree is checked against the reference's.
        let stops =
            self.programs.engine.as_ref().is_none_or(|e| e.description().run.ungraded.is_some());
        let base = if stops { What::Serial } else { What::Reference };
        let base = self.make("base tree", base, "base", true)?;
        let base_place = base.place.join("mesh");
        let meshes = Meshes { mesh: final_mesh.mesh?, base: base.mesh?, base_place };
        self.report().leaves_base = meshes.base.words.len() as u64;
        let reference = self.reference(case, &meshes);
        self.progress.step("checks");
        let subject = Subject::new(case, &meshes.mesh).with_base(&meshes.base);
        let subject = match &reference {
            Some(reference) => subject.with_reference(reference),
            None => subject,
        };
        self.add_results("serial", None, checks::all(&subject));
        Some(meshes)
    }

    /// One run whose failure ends the case.
    fn make(&mut self, subject: &str, what: What, name: &str, ungraded: bool) -> Option<Done> {
        self.progress.step(format!("{name}: {}", if ungraded { "base tree" } else { "mesh" }));
        let order = Order { what, case: &self.selected.path, name, ungraded, write: true };
        match self.run(&order) {
            Ok(done) => {
                self.add(Check::new(subject, RUNS, Outcome::Pass), None);
                Some(done)
            }
            // The harness has read the case without complaint, so this is one program's opinion.
            Err(trouble) => {
                self.add_trouble(subject, None, trouble);
                None
            }
        }
    }

    /// A run without files, for time and memory; the number of cells.
    fn measure(&mut self) -> Option<u64> {
        self.progress.step("serial, timed");
        let order = Order {
            what: What::Serial,
            case: &self.selected.path,
            name: "timed",
            ungraded: false,
            write: false,
        };
        match self.run(&order) {
            Ok(done) => {
                let cells = done.run.cells;
                self.report().cells = cells;
                self.report().runs.push(done.run);
                Some(cells)
            }
            Err(trouble) => {
                self.add_trouble("serial", None, trouble);
                None
            }
        }
    }

    /// The reference's final mesh, its base tree compared on the way.
    fn reference(&mut self, case: &Case, meshes: &Meshes) -> Option<LeafSet> {
        let (cells, most) = (meshes.mesh.words.len() as u64, self.options.reference_cells_max);
        if cells > most {
            let why =
                format!("{cells} cells are more than the {most} up to which the reference is run");
            self.add(Check::new("reference", "identical", Outcome::LeftOut(why)), None);
            return None;
        }
        let done = self.make("reference", What::Reference, "reference", false)?;
        self.report().runs.push(done.run);
        let base = self.make("reference base tree", What::Reference, "reference-base", true)?;
        let compared = identical::compare(&meshes.base.words, &base.mesh?.words, &case.root);
        self.add_results("base tree", None, vec![compared]);
        done.mesh
    }

    /// A case that the harness refuses: the user's input is at fault if the mesher says so too.
    pub fn verify_refusal(&mut self, why: &str) {
        let order = Order {
            what: What::Serial,
            case: &self.selected.path,
            name: "serial",
            ungraded: false,
            write: true,
        };
        match self.run(&order) {
            Err(Trouble::Input(said)) => self.report().input_error = Some(said),
            Ok(_) => {
                let fail =
                    Outcome::Fail(format!("the mesher takes a case that is at fault: {why}"));
                self.add(Check::new("serial", RUNS, fail), None);
            }
            Err(trouble) => self.add_trouble("serial", None, trouble),
        }
    }
}
