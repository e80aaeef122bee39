//! Ranks and partitions: every layout gives the mesh of the serial run, leaf by leaf, if the engine promises that, and else a mesh
//! that keeps the engine's other promises.

use super::case::CaseRun;
use super::meshes::MESHER;
use super::options::Need;
use super::report::{Check, Outcome, RUNS};
use crate::engine::failure::{End, Failure};
use crate::engine::layout::Layout;
use check::checks::{self, CheckResult, Subject, identical, manifest};
use check::promises::Independence;
use contract::case::Case;
use contract::leafset::LeafSet;
use contract::manifest::Tree;
use std::fs;

/// What remains unknown about the ranks of an engine that does not report their number.
const DOUBT: &str = "it is unknown whether the ranks communicate: no run report states `ranks`";

/// Hangs after which the remaining layouts of a case are left out: each hang costs the whole time limit.
const HANGS_MAX: usize = 3;

impl CaseRun<'_> {
    /// Runs every layout on MPI and checks its mesh.
    pub(super) fn verify_ranks(&mut self, case: &Case, serial: &LeafSet) {
        match self.all.needs.lacks(Need::Mpi) {
            Some(why) if self.all.options.no_mpi => self.leave_out(("ranks", RUNS), why),
            Some(why) => self.leave_out_ranks(why),
            None => self.verify_layouts(case, serial),
        }
    }

    /// Names every layout on MPI that has no check so far as left out.
    pub(super) fn leave_out_ranks(&mut self, why: &str) {
        for layout in self.all.options.layouts(self.engine()) {
            let subject = layout.to_string();
            if self.report.checks.iter().all(|check| check.subject != subject) {
                let check = Check::of_layout(&layout, RUNS, Outcome::left_out(why));
                self.add(check, Some(&layout));
            }
        }
    }

    fn verify_layouts(&mut self, case: &Case, serial: &LeafSet) {
        let mut hangs = 0;
        for layout in self.all.options.layouts(self.engine()) {
            match self.verify_layout(case, serial, &layout) {
                Ok(()) => {}
                Err(failure) if failure.is_interrupt() => return,
                Err(failure) => {
                    hangs += usize::from(matches!(failure.end, End::TimedOut { .. }));
                    self.add_failure(&layout.to_string(), Some(&layout), &failure);
                }
            }
            if hangs >= HANGS_MAX {
                return self.leave_out_ranks(&format!("{HANGS_MAX} runs of this case have hung"));
            }
        }
    }

    fn verify_layout(
        &mut self,
        case: &Case,
        serial: &LeafSet,
        layout: &Layout,
    ) -> Result<(), Failure> {
        let subject = layout.to_string();
        self.step(&subject);
        let choices = [&layout.partitioner, &layout.level_base].into_iter().flatten();
        let name = choices
            .fold(format!("ranks-{}", layout.ranks.count()), |name, of| format!("{name}-{of}"));
        let meshed = self.mesh(&self.file, &name, MESHER, Tree::Final, layout)?;
        self.report.runs.push(meshed.run);
        let mut check = Check::of_layout(layout, RUNS, Outcome::held(2));
        let is_first = self.report.checks.iter().all(|check| check.ranks.is_none());
        if is_first && meshed.ranks.is_none() {
            check.notes.push(DOUBT.to_owned());
        }
        self.add(check, Some(layout));
        let mesh = meshed.mesh;
        let results = match self.promises().is_independent_of(Independence::Ranks) {
            false => self.promised(case, &mesh),
            true => {
                let subject = Subject::new(case, &mesh).with_reference(serial);
                checks::only(&subject, &[manifest::NAME, "linear", identical::NAME])
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
