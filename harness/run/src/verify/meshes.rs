//! Runs of the programs, each with its mesh, which is compared with its run report: the serial meshes, base tree and final mesh of mesher
//! and reference; and those on ranks, where every layout gives the mesh of the serial run, leaf by leaf, if the engine promises that,
//! and else a mesh that keeps the engine's other promises.

use super::case::CaseRun;
use super::options::Need;
use super::report::{Check, DETERMINISTIC, Outcome, RUNS, Run};
use crate::engine::failure::{CODE_INPUT, End, Failure};
use crate::engine::layout::{Layout, RunOptions, SERIAL};
use crate::engine::runner::{Completed, Engine};
use check::checks::{self, CheckResult, Subject, identical};
use check::promises::{Independence, Promises};
use contract::case::Case;
use contract::leafset::LeafSet;
use contract::manifest::Tree;
use std::fs;
use std::path::{Path, PathBuf};

/// The engine under test, in reports.
pub(super) const MESHER: &str = "mesher";
/// The reference, in reports.
pub(super) const REFERENCE: &str = "reference";

/// Most cells of a mesh that is checked in memory. `harness audit` checks larger ones.
const CELLS_MAX: u64 = 100_000_000;
/// Most cells of a mesh that the reference makes, too.
const REFERENCE_CELLS_MAX: usize = 3_000_000;

/// What remains unknown about the ranks of an engine that does not report their number.
const DOUBT: &str = "it is unknown whether the ranks communicate: no run report states `ranks`";
/// Hangs after which the remaining layouts of a case are left out: each hang costs the whole time limit.
const HANGS_MAX: usize = 3;

/// A run that ended well, and its mesh.
pub(super) struct Meshed {
    /// Its measurements.
    pub run: Run,
    /// The number of ranks that it reports.
    pub ranks: Option<usize>,
    /// The mesh.
    pub mesh: LeafSet,
    /// Its leaf-set directory.
    pub place: PathBuf,
}

impl CaseRun<'_> {
    /// Runs [`MESHER`] or [`REFERENCE`] on a case, with its files in the directory `name` below that of the case, and reads its final mesh
    /// or its base tree.
    ///
    /// # Errors
    /// If the run fails, or its mesh cannot be read.
    pub(super) fn mesh(
        &self,
        case: &Path,
        name: &str,
        program: &str,
        tree: Tree,
        layout: &Layout,
    ) -> Result<Meshed, Failure> {
        let (run, ranks) = self.run(case, name, program, Some(tree), layout)?;
        let place = self.place.join(name).join("mesh");
        Ok(Meshed { run, ranks, mesh: self.program(program).read_mesh(&place)?, place })
    }

    /// A run that writes a mesh only if `tree` is one, or the engine cannot do without; and the number of ranks that it reports.
    pub(super) fn run(
        &self,
        case: &Path,
        name: &str,
        program: &str,
        tree: Option<Tree>,
        layout: &Layout,
    ) -> Result<(Run, Option<usize>), Failure> {
        let place = self.place.join(name);
        let mesh = tree.map(|_| place.join("mesh"));
        let options = RunOptions {
            mesh: mesh.as_deref(),
            ungraded: tree == Some(Tree::Base),
            services: Some(&self.all.needs.services),
            ..RunOptions::new(&place, self.all.options.timeout)
        };
        let Completed { report, finished, .. } =
            self.program(program).run(case, layout, &options)?;
        // It is 0 if the harness refuses the case.
        let facets = self.report.facets;
        if let Some(read) = report.facets.filter(|read| facets > 0 && *read != facets) {
            let why = format!("reports {read} facets, and the case has {facets}");
            return Err(self.program(program).unusable(why));
        }
        let run = Run {
            program: program.to_owned(),
            layout: layout.rank_count().map(|_| layout.clone()),
            cells: report.cells,
            peak_rss_bytes: Some(report.peak_rss_bytes_total()).filter(|bytes| *bytes > 0),
            digest: report.digest.unwrap_or_default(),
            time_wall_s: report.time_wall_s.unwrap_or(finished.time_wall_s),
            is_time_reported: report.time_wall_s.is_some(),
            time_process_s: finished.time_wall_s,
        };
        Ok((run, report.ranks))
    }

    fn program(&self, program: &str) -> &Engine {
        let programs = self.all.programs;
        if program == REFERENCE { &programs.reference } else { &programs.engine }
    }

    /// Makes the serial mesh, which later steps use, and checks it; of an engine that promises the definition, also its base tree. `None`
    /// if the mesher made none, or they are too large to check.
    pub(super) fn verify_serial(&mut self, case: &Case) -> Option<(Meshed, Option<Meshed>)> {
        let timed = self.measure()?;
        let cells = timed.cells;
        if cells > CELLS_MAX {
            let why = format!(
                "{cells} cells exceed the {CELLS_MAX} that are checked in memory: `harness audit` checks larger meshes"
            );
            self.leave_out(("serial", "checks"), why);
            return None;
        }
        let serial = self.make("serial", "serial", MESHER, Tree::Final)?;
        self.verify_repetition(&timed, &serial.mesh);
        if self.promises().definition {
            let base = self.verify_definition(case, &serial.mesh)?;
            return Some((serial, Some(base)));
        }
        self.step("checks");
        self.add_results("serial", None, self.promised(case, &serial.mesh));
        Some((serial, None))
    }

    /// Compares a mesh with its base tree, which is returned, and with the reference.
    fn verify_definition(&mut self, case: &Case, mesh: &LeafSet) -> Option<Meshed> {
        // The mesh of an engine that cannot stop at the base tree is checked against the reference's base tree.
        let program = if self.engine().run.ungraded.is_empty() { REFERENCE } else { MESHER };
        let base = self.make("base tree", "base", program, Tree::Base)?;
        self.report.leaves_base = base.mesh.words.len() as u64;
        let references = self.references(mesh);
        self.step("checks");
        let mut of_mesh = Subject::new(case, Tree::Final, mesh);
        let mut of_base = Subject::new(case, Tree::Base, &base.mesh).sharing_truth(&of_mesh);
        if let Some([mesh, base]) = &references {
            (of_mesh, of_base) = (of_mesh.with_reference(mesh), of_base.with_reference(base));
        }
        self.add_results("serial", None, checks::all(&of_mesh));
        self.add_results("base tree", None, checks::all(&of_base));
        Some(base)
    }

    /// The checks of what the engine promises about any of its meshes, and of the files.
    pub(super) fn promised(&self, case: &Case, mesh: &LeafSet) -> Vec<CheckResult> {
        checks::all(&Subject::new(case, Tree::Final, mesh).promising(self.promises()))
    }

    /// Compares the mesh of the timed run, or the digest of one that was not written, with that of the second run, if the engine is deterministic.
    fn verify_repetition(&mut self, timed: &Run, mesh: &LeafSet) {
        if !self.promises().is_deterministic() {
            return;
        }
        let &Run { cells, digest: ref first, .. } = timed;
        let (again, second) = (mesh.words.len() as u64, mesh.manifest.digest.to_string());
        let written = self.place.join("timed").join("mesh");
        let check = if (cells, first) != (again, &second) {
            let why = format!(
                "two serial runs differ: {cells} cells, digest {first}; {again} cells, digest {second}"
            );
            Check::new("serial", DETERMINISTIC, Outcome::fail(why))
        } else if written.exists() {
            // The digest in a manifest is only a claim.
            let first = match self.program(MESHER).read_mesh(&written) {
                Ok(first) => first.words,
                Err(failure) => return self.add_failure("serial", None, &failure),
            };
            let compared = identical::compare(&mesh.words, &first, &mesh.manifest.root);
            Check::of_result("serial", CheckResult { name: DETERMINISTIC, ..compared })
        } else {
            Check::new("serial", DETERMINISTIC, Outcome::held(cells))
        };
        self.add(check, None);
    }

    /// One mesh; without it the case ends.
    fn make(&mut self, subject: &str, name: &str, program: &str, tree: Tree) -> Option<Meshed> {
        self.step(subject);
        let meshed = self.mesh(&self.file, name, program, tree, &SERIAL);
        // The harness has read the case without an error, so an input error is the program's opinion only.
        let meshed = meshed.map_err(|failure| self.add_failure(subject, None, &failure)).ok()?;
        self.add(Check::new(subject, RUNS, Outcome::held(2)), None);
        Some(meshed)
    }

    /// A run for time and memory, which writes no mesh if the engine can do without.
    fn measure(&mut self) -> Option<Run> {
        self.step("serial, timed");
        let run = |tree| self.run(&self.file, "timed", MESHER, tree, &SERIAL).map(|(run, _)| run);
        // Only the mesh of another run can show what a run without a digest makes.
        let timed = run(None).and_then(|timed| match timed.digest.is_empty() {
            true => Ok(Run { digest: run(Some(Tree::Final))?.digest, ..timed }),
            false => Ok(timed),
        });
        let timed = timed.map_err(|failure| self.add_failure("serial", None, &failure)).ok()?;
        self.report.cells = timed.cells;
        self.report.runs.push(timed.clone());
        Some(timed)
    }

    /// The reference's final mesh and base tree.
    fn references(&mut self, mesh: &LeafSet) -> Option<[LeafSet; 2]> {
        let cells = mesh.words.len();
        if cells > REFERENCE_CELLS_MAX {
            let why = format!(
                "{cells} cells exceed the {REFERENCE_CELLS_MAX} up to which the reference is run"
            );
            self.leave_out(("reference", "identical"), why);
            return None;
        }
        let meshed = self.make("reference", "reference", REFERENCE, Tree::Final)?;
        self.report.runs.push(meshed.run);
        let base = self.make("reference base tree", "reference-base", REFERENCE, Tree::Base)?.mesh;
        Some([meshed.mesh, base])
    }

    /// A case that the harness refuses: it is an input error if the mesher refuses it too, else a failed check.
    pub(super) fn verify_refusal(&mut self, why: &str) {
        match self.mesh(&self.file, "serial", MESHER, Tree::Final, &SERIAL) {
            Ok(_) => {
                let why = format!("the mesher accepts an invalid case: {why}");
                self.add(Check::new("serial", RUNS, Outcome::fail(why)), None);
            }
            Err(Failure { end: End::Exited { code: CODE_INPUT, error }, .. }) => {
                self.report.input_error = Some(error);
            }
            Err(failure) => self.add_failure("serial", None, &failure),
        }
    }

    /// Runs every layout on MPI and checks its mesh.
    pub(super) fn verify_ranks(&mut self, case: &Case, serial: &LeafSet) {
        if let Some(why) = self.all.needs.lacks(Need::Mpi) {
            let is_promised = self.promises().independent_of.contains(&Independence::Ranks);
            let varies_otherwise = is_promised && self.engine().run.parallel.is_empty();
            return match self.all.options.no_mpi || varies_otherwise {
                true => self.leave_out(("ranks", RUNS), why),
                false => self.leave_out_ranks(why),
            };
        }
        let mut hangs = 0;
        for layout in self.all.options.layouts(self.engine()) {
            let Err(failure) = self.verify_on(case, serial, &layout) else { continue };
            if failure.is_interrupt() {
                return;
            }
            hangs += usize::from(matches!(failure.end, End::TimedOut { .. }));
            self.add_failure(&layout.to_string(), Some(&layout), &failure);
            if hangs >= HANGS_MAX {
                return self.leave_out_ranks(&format!("{HANGS_MAX} runs of this case have hung"));
            }
        }
    }

    /// Names every layout on MPI that has no check so far as left out.
    pub(super) fn leave_out_ranks(&mut self, why: &str) {
        for layout in self.all.options.layouts(self.engine()) {
            let subject = layout.to_string();
            if self.report.checks.iter().all(|check| check.subject != subject) {
                self.add(Check::new(subject, RUNS, Outcome::left_out(why)), Some(&layout));
            }
        }
    }

    fn verify_on(&mut self, case: &Case, serial: &LeafSet, layout: &Layout) -> Result<(), Failure> {
        let subject = layout.to_string();
        self.step(&subject);
        let choices = [&layout.partitioner, &layout.level_base].into_iter().flatten();
        let name = choices
            .fold(format!("ranks-{}", layout.ranks.count()), |name, of| format!("{name}-{of}"));
        let meshed = self.mesh(&self.file, &name, MESHER, Tree::Final, layout)?;
        self.report.runs.push(meshed.run);
        let mut check = Check::new(&*subject, RUNS, Outcome::held(2));
        if self.report.checks.iter().all(|check| check.ranks.is_none()) && meshed.ranks.is_none() {
            check.notes.push(DOUBT.to_owned());
        }
        self.add(check, Some(layout));
        let mesh = meshed.mesh;
        let results = match self.promises().is_independent_of(Independence::Ranks) {
            false => self.promised(case, &mesh),
            true => {
                let subject = Subject::new(case, Tree::Final, &mesh).with_reference(serial);
                // What the serial mesh keeps needs no second check.
                checks::all(&subject.promising(&Promises::default()))
            }
        };
        let holds = results.iter().all(CheckResult::holds);
        self.add_results(&subject, Some(layout), results);
        if holds && !self.all.options.keep {
            // The mesh of the serial run remains.
            let _ = fs::remove_dir_all(self.place.join(name));
        }
        Ok(())
    }
}
