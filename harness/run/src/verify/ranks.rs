//! Ranks, partitions and threads: every layout gives the mesh of the serial run, leaf by leaf, if the engine promises
//! that, and else a mesh that keeps the engine's other promises.

use super::case::CaseRun;
use super::outcome::{RUNS, ended_well};
use super::report::{Check, Outcome};
use super::run::{Program, Request};
use crate::engine::failure::{End, Failure};
use crate::engine::layout::{Layout, SERIAL};
use check::checks::{self, CheckResult, Subject, identical, manifest};
use check::promises::Independence;
use contract::case::Case;
use contract::leafset::LeafSet;
use contract::watch::Watch;
use std::fs;

/// Numbers of threads that are compared with one.
const THREADS: [usize; 2] = [2, 4];

/// What remains unknown about the ranks of an engine that does not report their number.
const DOUBT: &str = "it is unknown whether the ranks communicate: no run report states `ranks`";

/// Hangs after which the remaining layouts of a case are left out: each hang costs the whole time limit.
const HANGS_MAX: usize = 3;

impl CaseRun<'_> {
    /// Runs the engine on several numbers of threads, if it promises that its mesh does not depend on them.
    pub fn verify_threads(&mut self, case: &Case, serial: &LeafSet) {
        if !self.promises().independent_of.contains(&Independence::Threads) {
            return;
        }
        let layouts = THREADS.map(|threads| Layout { threads: Some(threads), ..SERIAL.clone() });
        self.verify_layouts(case, serial, &layouts);
    }

    /// Runs every layout on MPI and checks its mesh.
    pub fn verify_ranks(&mut self, case: &Case, serial: &LeafSet) {
        match &self.needs.mpi {
            Some(why) if self.options.no_mpi => {
                self.add(Check::new("ranks", RUNS, Outcome::left_out(why)), None);
            }
            Some(why) => self.leave_out_ranks(why),
            None => self.verify_layouts(case, serial, &self.layouts()),
        }
    }

    /// The layouts on MPI that were asked for.
    fn layouts(&self) -> Vec<Layout> {
        self.options.layouts(self.programs.engine.description())
    }

    /// Names every layout on MPI that has no check so far as left out.
    pub fn leave_out_ranks(&mut self, why: &str) {
        for layout in self.layouts() {
            let subject = layout.to_string();
            if self.report().checks.iter().all(|check| check.subject != subject) {
                let check = Check::of_layout(&layout, RUNS, Outcome::left_out(why));
                self.add(check, Some(&layout));
            }
        }
    }

    fn verify_layouts(&mut self, case: &Case, serial: &LeafSet, layouts: &[Layout]) {
        let mut hangs = 0;
        for layout in layouts {
            if hangs >= HANGS_MAX {
                let why = format!("{HANGS_MAX} runs of this case have hung");
                let check = Check::of_layout(layout, RUNS, Outcome::left_out(why));
                self.add(check, Some(layout));
                continue;
            }
            match self.verify_layout(case, serial, layout) {
                Ok(()) => {}
                Err(failure) if failure.is_interrupt() => return,
                Err(failure) => {
                    hangs += usize::from(matches!(failure.end, End::TimedOut { .. }));
                    self.add_failure(&layout.to_string(), Some(layout), &failure);
                }
            }
        }
    }

    fn verify_layout(
        &mut self,
        case: &Case,
        serial: &LeafSet,
        layout: &Layout,
    ) -> Result<(), Failure> {
        self.progress.step(&layout.to_string());
        let meshed = self.run(&Request {
            program: Program::Mesher,
            layout,
            case: &self.selected.path,
            name: &directory_name(layout),
            ungraded: false,
            write: true,
        })?;
        self.report().runs.push(meshed.run);
        let is_doubtful = meshed.report.ranks.is_none();
        let mut check = Check::of_layout(layout, RUNS, ended_well());
        let is_first = self.report().checks.iter().all(|check| check.ranks.is_none());
        if is_first && check.ranks.is_some() && is_doubtful {
            check.notes.push(DOUBT.to_owned());
        }
        self.add(check, Some(layout));
        let Some(mesh) = meshed.mesh else { return Ok(()) };
        let results = match self.must_equal_serial(layout) {
            false => self.promised(case, &mesh),
            true => {
                let subject = Subject::new(case, &mesh).with_reference(serial);
                checks::only(&subject, &[manifest::NAME, "linear", identical::NAME])
            }
        };
        let holds = results.iter().all(CheckResult::holds);
        self.add_results(&layout.to_string(), Some(layout), results);
        if holds && !self.options.keep {
            // The mesh of the serial run remains.
            let _ = fs::remove_dir_all(meshed.place);
        }
        Ok(())
    }

    /// Whether the engine promises the serial mesh on a layout. Only what it promises to be independent of is varied, besides
    /// the ranks.
    fn must_equal_serial(&self, layout: &Layout) -> bool {
        layout.rank_count().is_none() || self.promises().is_independent_of(Independence::Ranks)
    }
}

fn directory_name(layout: &Layout) -> String {
    let choices = [&layout.partitioner, &layout.level_base].map(|choice| choice.clone());
    let threads = layout.threads.map(|threads| format!("threads-{threads}"));
    let words = choices.into_iter().flatten().chain(threads);
    words.fold(format!("ranks-{}", layout.ranks.count()), |name, word| format!("{name}-{word}"))
}
