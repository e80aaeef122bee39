//! The verification of one case: its steps in order, and the state that they share.

use super::needs::Needs;
use super::options::Options;
pub use super::outcome::RUNS;
use super::report::{CaseReport, Check, Outcome};
use crate::engine::failure::{CODE_INPUT, End, Failure};
use crate::engine::interrupt;
use crate::engine::layout::Layout;
use crate::engine::programs::Programs;
use crate::progress::Progress;
use check::checks::CheckResult;
use check::promises::Promises;
use contract::case::Case;
use contract::catalogue::Selected;
use std::path::Path;

/// A case being verified.
#[derive(Debug)]
pub struct CaseRun<'a> {
    /// The case.
    pub selected: &'a Selected,
    /// The options.
    pub options: &'a Options,
    /// The programs.
    pub programs: &'a Programs,
    /// Prerequisites that are missing on this machine.
    pub needs: &'a Needs,
    /// The directory of the case.
    pub place: &'a Path,
    /// The progress line.
    pub progress: &'a Progress,
    /// Oracles that gave no answer, although they exist.
    pub oracles_silent: Vec<Failure>,
    /// The report so far.
    report: CaseReport,
}

impl<'a> CaseRun<'a> {
    /// A case before its first step.
    pub fn new(
        selected: &'a Selected,
        options: &'a Options,
        programs: &'a Programs,
        needs: &'a Needs,
        place: &'a Path,
        progress: &'a Progress,
    ) -> Self {
        let report = CaseReport { name: selected.name.clone(), ..CaseReport::default() };
        let oracles_silent = Vec::new();
        Self { selected, options, programs, needs, place, progress, oracles_silent, report }
    }

    /// Performs all steps: serial meshes and their checks, ranks and threads, oracles, p4est. Without serial meshes the
    /// later steps are left out. An engine that promises less than the definition is not compared with T0, oracles and
    /// p4est.
    pub fn verify(&mut self) {
        self.verify_steps();
        self.leave_out_rest();
    }

    fn verify_steps(&mut self) {
        let Some(case) = self.read() else { return };
        self.report.facets = case.facets.len() as u64;
        if let Some(why) = self.programs.engine.description().declines(&case) {
            return self.add(Check::new("case", "engine", Outcome::left_out(why)), None);
        }
        let Some(meshes) = self.verify_serial(&case) else {
            return;
        };
        self.verify_threads(&case, &meshes.mesh);
        self.verify_ranks(&case, &meshes.mesh);
        if let Some(base) = &meshes.base {
            self.verify_oracles(&case, base);
            self.verify_balance(base);
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
        for (subject, name) in steps(self.promises()) {
            if !self.report.has(subject) {
                self.add(Check::new(*subject, *name, Outcome::left_out(&why)), None);
            }
        }
    }

    /// What the engine under test promises.
    pub fn promises(&self) -> &'a Promises {
        &self.programs.engine.description().promises
    }

    /// Reads the case. If the harness cannot read it, a mesher that promises the definition must refuse it too, and no other sees it.
    fn read(&mut self) -> Option<Case> {
        match Case::read(&self.selected.path) {
            Ok(case) => Some(case),
            Err(error) => {
                match self.promises().definition {
                    true => self.verify_refusal(&error.to_string()),
                    false => self.report.input_error = Some(error.to_string()),
                }
                None
            }
        }
    }

    /// The report.
    pub fn into_report(self) -> CaseReport {
        self.report
    }

    /// The report so far, to be added to.
    pub fn report(&mut self) -> &mut CaseReport {
        &mut self.report
    }

    /// Adds a check, and with the first failed check the command that repeats it.
    pub fn add(&mut self, check: Check, layout: Option<&Layout>) {
        if check.failed() && self.report.repeat_with.is_none() {
            self.report.repeat_with = Some(self.command_for(layout));
        }
        self.report.checks.push(check);
    }

    /// Adds results of the crate `check`.
    pub fn add_results(
        &mut self,
        subject: &str,
        layout: Option<&Layout>,
        results: Vec<CheckResult>,
    ) {
        for result in results {
            let check = Check::new(subject, result.name, result.outcome());
            let notes =
                Some(result.note).filter(|_| layout.is_none()).filter(|note| !note.is_empty());
            let ranks = layout.and_then(Layout::rank_count);
            let check = Check { ranks, figures: notes, findings: result.findings_total, ..check };
            self.add(check, layout);
        }
    }

    /// Adds the failure of a run, unless it is the user's interrupt.
    pub fn add_failure(&mut self, subject: &str, layout: Option<&Layout>, failure: &Failure) {
        let why = match &failure.end {
            End::Interrupted => return,
            // The code may mean anything else for a program that was not written for the harness.
            End::Exited { code: CODE_INPUT, error } if self.promises().definition => {
                format!("it refuses the case: {error}")
            }
            _ => failure.to_string(),
        };
        let check = Check::new(subject, RUNS, Outcome::fail(why));
        self.add(Check { ranks: layout.and_then(Layout::rank_count), ..check }, layout);
    }

    /// A shell command that repeats the run with this layout, or the serial one.
    fn command_for(&self, layout: Option<&Layout>) -> String {
        let paths = &self.programs.paths;
        let mut words = vec![paths.harness.to_string_lossy().into_owned(), "verify".into()];
        words.push(self.selected.argument.clone());
        let absolute = |path: &Path| {
            let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
            path.to_string_lossy().into_owned()
        };
        match self.programs.engine.name() {
            "mesher" => {}
            file if file.ends_with(".toml") => {
                words.extend(["--engine".into(), absolute(Path::new(file))]);
            }
            name => words.extend(["--engine".into(), name.to_owned()]),
        }
        let (chosen, usual) = (self.options, Options::of_leaves_alone(Vec::new()));
        for (option, value, usual) in [
            ("--timeout", chosen.timeout, usual.timeout),
            ("--cells-max", chosen.cells_max, usual.cells_max),
            ("--reference-cells-max", chosen.reference_cells_max, usual.reference_cells_max),
        ] {
            if value != usual {
                words.extend([option.to_owned(), value.to_string()]);
            }
        }
        let on_ranks = layout.filter(|layout| layout.rank_count().is_some());
        words.extend(on_ranks.map_or(vec!["--no-mpi".to_owned()], options_of));
        words.push("--keep".into());
        let programs = [("mesher", &self.programs.engine), ("reference", &self.programs.reference)];
        for (name, engine) in programs {
            if let Some(program) = engine.program_given() {
                words.push(format!("--{name}"));
                words.push(absolute(program));
            }
        }
        words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
    }
}

/// Subject and name of the check of sides by the oracles.
pub const ORACLES: (&str, &str) = ("sides", "oracles");
/// Subject and name of the check of the balance by p4est.
pub const P4EST: (&str, &str) = ("p4est", "balance");

/// Subject and name of the check by the proven checker.
pub const PROOF: (&str, &str) = ("proof", "accepted");

/// Subject and name of the checks by other programs, which need the definition.
pub fn steps(promises: &Promises) -> &'static [(&'static str, &'static str)] {
    match promises.definition {
        true => &[PROOF, ORACLES, P4EST],
        false => &[],
    }
}

/// The options of `harness verify` that select this layout and nothing else.
fn options_of(layout: &Layout) -> Vec<String> {
    let mut words =
        vec!["--no-oracles".to_owned(), "--no-p4est".to_owned(), "--no-proof".to_owned()];
    let choices = [
        ("--ranks", Some(layout.ranks.count().to_string())),
        ("--partitioners", layout.partitioner.clone()),
        ("--level-bases", layout.level_base.clone()),
    ];
    for (option, value) in choices {
        words.extend(value.into_iter().flat_map(|value| [option.to_owned(), value]));
    }
    words
}

/// A word, quoted for a shell.
fn quoted(word: &str) -> String {
    match word.chars().all(|c| c.is_ascii_alphanumeric() || "-_./=,".contains(c)) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', "'\\''")),
    }
}
