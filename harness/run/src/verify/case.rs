//! The verification of one case: its steps in order, and the state that they share.

use super::Verification;
use super::options::{Need, TIMEOUT_S};
use super::report::{CaseReport, Check, Outcome, RUNS};
use crate::engine::description::Description;
use crate::engine::failure::{CODE_INPUT, End, Failure};
use crate::engine::interrupt;
use crate::engine::layout::Layout;
use crate::engine::runner::Engine;
use check::checks::CheckResult;
use check::promises::Promises;
use contract::case::Case;
use contract::catalogue::Selected;
use contract::failure::progress;
use std::path::{Path, PathBuf, absolute};

/// A case being verified.
pub(super) struct CaseRun<'a> {
    pub all: &'a Verification<'a>,
    pub selected: &'a Selected,
    /// The case file, in a form that the engine can read.
    pub file: PathBuf,
    /// The directory of the case.
    pub place: &'a Path,
    /// The report so far.
    pub report: CaseReport,
}

impl<'a> CaseRun<'a> {
    /// Performs all steps: serial meshes and their checks, ranks, other programs. Without serial meshes the later steps are left out.
    /// An engine that promises less than the definition is not compared with T0, the proof, oracles and p4est.
    pub fn verify(&mut self) {
        let Some(case) = self.read() else { return };
        self.report.facets = case.facets.len() as u64;
        if let Some(why) = self.engine().declines(&case) {
            return self.leave_out(("case", "engine"), why);
        }
        let Some((serial, base)) = self.verify_serial(&case) else { return };
        self.verify_ranks(&case, &serial.mesh);
        if let Some(base) = base {
            self.verify_by_others(&case, &serial, &base);
        }
    }

    /// Names what was asked for and not reached as left out.
    pub fn leave_out_rest(&mut self) {
        if self.report.input_error.is_some() || interrupt::requested() {
            return;
        }
        let why = match self.report.checks.last().map(|last| &last.outcome) {
            Some(Outcome::LeftOut { why }) => why.clone(),
            _ => "there is no serial mesh to compare with".to_owned(),
        };
        self.leave_out_ranks(&why);
        for &(step, _) in steps(self.engine()) {
            if !self.report.has(step.0) {
                self.leave_out(step, &why);
            }
        }
    }

    /// Adds a check that was not run.
    pub fn leave_out(&mut self, (subject, name): Step, why: impl Into<String>) {
        self.add(Check::new(subject, name, Outcome::left_out(why)), None);
    }

    /// The description of the engine under test.
    pub fn engine(&self) -> &'a Description {
        &self.all.programs.engine.description
    }

    /// What the engine under test promises.
    pub fn promises(&self) -> &'a Promises {
        &self.engine().promises
    }

    /// Reads the case. If the harness cannot read it, a mesher that promises the definition must refuse it too, and no other sees it.
    fn read(&mut self) -> Option<Case> {
        match Case::read(&self.file) {
            Ok(case) => return Some(case),
            Err(error) if self.promises().definition => self.verify_refusal(&error.to_string()),
            Err(error) => self.report.input_error = Some(error.to_string()),
        }
        None
    }

    /// Shows what begins.
    pub fn step(&self, what: &str) {
        progress(&format!("{}: {what}", self.selected.name));
    }

    /// Adds a check of a run with this layout or of serial ones, and with the first failed check the command that repeats it.
    pub fn add(&mut self, mut check: Check, layout: Option<&Layout>) {
        check.ranks = layout.and_then(Layout::rank_count);
        if check.failed() && self.report.repeat_with.is_none() {
            self.report.repeat_with = Some(self.command_for(layout));
        }
        self.report.checks.push(check);
    }

    /// Adds results of the crate `check`.
    pub fn add_results(&mut self, subject: &str, layout: Option<&Layout>, all: Vec<CheckResult>) {
        for result in all {
            let mut check = Check::of_result(subject, result);
            check.figures.take_if(|_| layout.is_some());
            self.add(check, layout);
        }
    }

    /// Adds the failure of a run, unless it is the user's interrupt.
    pub fn add_failure(&mut self, subject: &str, layout: Option<&Layout>, failure: &Failure) {
        let may_refuse = self.promises().definition && layout.is_none();
        let why = match &failure.end {
            End::Interrupted => return,
            // A program on this machine is missing: nothing is shown about the mesh.
            End::Missing(why) if subject == "serial" => {
                return self.leave_out(("serial", RUNS), why);
            }
            // The code may mean anything else for a program that was not written for the harness, and on ranks after a serial run.
            End::Exited { code: CODE_INPUT, error } if may_refuse => {
                format!("it refuses the case: {error}")
            }
            _ => failure.to_string(),
        };
        self.add(Check::new(subject, RUNS, Outcome::fail(why)), layout);
    }

    /// A shell command that repeats the run with this layout, or the serial one.
    fn command_for(&self, layout: Option<&Layout>) -> String {
        let (options, programs) = (self.all.options, self.all.programs);
        let full = |path: &Path| {
            absolute(path).unwrap_or_else(|_| path.to_owned()).to_string_lossy().into_owned()
        };
        let engine = match programs.engine.name() {
            file if file.ends_with(".toml") => full(Path::new(file)),
            name => name.to_owned(),
        };
        let program = |of: &Engine| of.is_given.then(|| full(&of.program));
        let given = [
            ("--engine", Some(engine).filter(|engine| engine != "mesher")),
            ("--mesher", program(&programs.engine)),
            ("--reference", program(&programs.reference)),
            ("--timeout", Some(options.timeout.as_secs().to_string()).filter(|s| s != TIMEOUT_S)),
            ("--ranks", layout.map(|layout| layout.ranks.count().to_string())),
            ("--partitioners", layout.and_then(|layout| layout.partitioner.clone())),
            ("--level-bases", layout.and_then(|layout| layout.level_base.clone())),
        ];
        let given = given.into_iter().filter_map(|(option, value)| Some([option.into(), value?]));
        let harness = programs.paths.harness.to_string_lossy().into_owned();
        let mut words = vec![harness, "verify".into(), self.selected.argument.clone()];
        words.extend(given.flatten());
        let left_out: &[&str] = match layout {
            Some(_) => &["--no-oracles", "--no-p4est", "--no-proof", "--keep"],
            None => &["--no-mpi", "--keep"],
        };
        words.extend(left_out.iter().map(|&word| word.to_owned()));
        shlex::try_join(words.iter().map(String::as_str)).unwrap_or_default()
    }
}

/// Subject and name of a check.
pub(super) type Step = (&'static str, &'static str);
/// The check by the proven checker.
pub const PROOF: Step = ("proof", "accepted");
/// The checks of meshes by other programs, and what they need besides the definition.
const STEPS: [(Step, Need); 3] = [
    (PROOF, Need::Proof),
    (("sides", "oracles"), Need::Oracles),
    (("p4est", "balance"), Need::P4est),
];

/// Those of the meshes of an engine.
pub(super) fn steps(engine: &Description) -> &'static [(Step, Need)] {
    if engine.promises.definition { &STEPS } else { &[] }
}
