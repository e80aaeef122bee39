//! One case, verified: the order of its steps, and what they share.

use super::needs::Needs;
use super::options::Options;
use super::outcome::Trouble;
use super::progress::Progress;
use super::report::{CaseReport, Check, Outcome};
use crate::engine::mesher::Layout;
use crate::engine::programs::Programs;
use check::checks::CheckResult;
use contract::case::Case;
use contract::catalogue::Selected;
use std::path::Path;

/// A case being verified.
#[derive(Debug)]
pub struct CaseRun<'a> {
    /// The case.
    pub selected: &'a Selected,
    /// What was asked.
    pub options: &'a Options,
    /// The programs.
    pub programs: &'a Programs,
    /// What this machine can do.
    pub needs: &'a Needs,
    /// The case's own directory.
    pub place: &'a Path,
    /// What is being done, for a terminal.
    pub progress: &'a Progress,
    /// What was found so far.
    report: CaseReport,
}

impl<'a> CaseRun<'a> {
    /// Nothing done yet.
    pub fn new(
        selected: &'a Selected,
        options: &'a Options,
        programs: &'a Programs,
        needs: &'a Needs,
        place: &'a Path,
        progress: &'a Progress,
    ) -> Self {
        let report = CaseReport { name: selected.name.clone(), ..CaseReport::default() };
        Self { selected, options, programs, needs, place, progress, report }
    }

    /// All steps: serial meshes and their checks, ranks, oracles, p4est. A step whose ground is missing is
    /// left out, and so is what stands on it.
    pub fn verify(&mut self) {
        let Some(case) = self.read() else { return };
        self.report.facets = case.facets.len() as u64;
        let engine = self.programs.engine.as_ref();
        if let Some(why) = engine.and_then(|engine| engine.description().declines(&case)) {
            return self.add(Check::new("case", "engine", Outcome::LeftOut(why)), None);
        }
        let Some(meshes) = self.verify_serial(&case) else {
            return;
        };
        self.verify_ranks(&case, &meshes);
        self.verify_oracles(&case, &meshes);
        self.verify_balance(&meshes);
    }

    /// The case as the harness reads it. Where it cannot, the mesher must refuse the case too.
    fn read(&mut self) -> Option<Case> {
        match Case::read(&self.selected.path) {
            Ok(case) => Some(case),
            Err(error) => {
                self.verify_refusal(&error.to_string());
                None
            }
        }
    }

    /// What was found.
    pub fn into_report(self) -> CaseReport {
        self.report
    }

    /// The report so far, to be written into.
    pub fn report(&mut self) -> &mut CaseReport {
        &mut self.report
    }

    /// Adds a check, and with the first failure the command that repeats it.
    pub fn add(&mut self, check: Check, layout: Option<&Layout>) {
        if check.failed() && self.report.repeat_with.is_none() {
            self.report.repeat_with = Some(self.command_for(layout));
        }
        self.report.checks.push(check);
    }

    /// Adds checks of the checks' own modules.
    pub fn add_results(
        &mut self,
        subject: &str,
        layout: Option<&Layout>,
        results: Vec<CheckResult>,
    ) {
        for result in results {
            let check = Check::new(subject, result.name, outcome_of(&result));
            let notes =
                Some(result.note).filter(|_| layout.is_none()).filter(|note| !note.is_empty());
            let counts = [
                ("examined".to_owned(), result.examined),
                ("findings".to_owned(), result.findings_total),
            ];
            let ranks = layout.map(|layout| layout.ranks);
            let check = Check { ranks, figures: notes, counts: counts.into(), ..check };
            self.add(check, layout);
        }
    }

    /// Adds what a run's trouble means; the user's own end means nothing.
    pub fn add_trouble(&mut self, subject: &str, layout: Option<&Layout>, trouble: Trouble) {
        let why = match trouble {
            Trouble::Interrupted => return,
            Trouble::Failed(why) | Trouble::Hung(why) => why,
            Trouble::Input(why) => format!("it refuses the case: {why}"),
        };
        let check = Check::new(subject, RUNS, Outcome::Fail(why));
        self.add(Check { ranks: layout.map(|layout| layout.ranks), ..check }, layout);
    }

    /// One line that a shell takes and that repeats the run of this layout, or the serial one.
    fn command_for(&self, layout: Option<&Layout>) -> String {
        let quoted = |text: &str| match text
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || "-_./=,".contains(c))
        {
            true => text.to_owned(),
            false => format!("'{}'", text.replace('\'', "'\\''")),
        };
        let program = quoted(&self.programs.paths.harness.to_string_lossy());
        let case = quoted(&self.selected.argument);
        let only = match layout {
            None => "--no-mpi".to_owned(),
            Some(Layout { ranks, partitioner, level_base }) => {
                format!(
                    "--no-oracles --no-p4est --ranks {ranks} --partitioners {partitioner} --level-bases {level_base}"
                )
            }
        };
        let beside = |name: &str| self.programs.paths.harness.with_file_name(name);
        let given = [
            ("mesher", &self.programs.paths.mesher),
            ("reference", &self.programs.paths.reference),
        ];
        let elsewhere = given.into_iter().filter(|(name, path)| beside(name) != **path);
        let programs = elsewhere
            .map(|(name, path)| format!(" --{name} {}", quoted(&path.to_string_lossy())))
            .collect::<String>();
        let engine = self.programs.engine.as_ref();
        let engine = engine
            .map_or(String::new(), |e| format!(" --engine {}", quoted(&e.description().name)));
        format!("{program} verify {case}{engine} {only} --keep{programs}")
    }
}

/// Name of the check that a program runs to its end and says the truth about it.
pub const RUNS: &str = "runs";

fn outcome_of(result: &CheckResult) -> Outcome {
    if result.holds() {
        return Outcome::Pass;
    }
    let mut told: Vec<&str> =
        result.findings.iter().map(|finding| finding.detail.as_str()).collect();
    let more = format!("and {} more", result.findings_total - result.findings.len() as u64);
    if result.findings_total > result.findings.len() as u64 {
        told.push(&more);
    }
    Outcome::Fail(told.join("\n"))
}
