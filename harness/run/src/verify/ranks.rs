//! The same mesh from any number of ranks, however the work is cut: leaf by leaf that of the serial run.

use super::case::{CaseRun, RUNS};
use super::outcome::Trouble;
use super::report::{Check, Outcome};
use super::run::{Order, What};
use super::serial::Meshes;
use crate::engine::mesher::Layout;
use check::checks::{self, CheckResult, Subject};
use contract::case::Case;
use std::fs;

/// After so many hangs the remaining layouts of a case are left out: each would cost its whole time limit.
const HANGS_MAX: usize = 3;

impl CaseRun<'_> {
    /// Runs every layout and compares.
    pub fn verify_ranks(&mut self, case: &Case, meshes: &Meshes) {
        if let Some(why) = &self.needs.mpi {
            let ranks: Vec<String> = self.options.ranks.iter().map(usize::to_string).collect();
            let subject = format!("ranks {}", ranks.join(", "));
            let check = Check::new(subject, RUNS, Outcome::LeftOut(why.clone()));
            return self.add(check, None);
        }
        let mut hangs = 0;
        for layout in self.options.layouts() {
            if hangs >= HANGS_MAX {
                let why = format!("{HANGS_MAX} runs of this case have hung");
                let check = Check::of_layout(&layout, RUNS, Outcome::LeftOut(why));
                self.add(check, Some(&layout));
                continue;
            }
            match self.verify_layout(case, meshes, &layout) {
                Ok(()) => {}
                Err(Trouble::Interrupted) => return,
                Err(trouble) => {
                    hangs += usize::from(matches!(trouble, Trouble::Hung(_)));
                    self.add_trouble(&layout.to_string(), Some(&layout), trouble);
                }
            }
        }
    }

    fn verify_layout(
        &mut self,
        case: &Case,
        meshes: &Meshes,
        layout: &Layout,
    ) -> Result<(), Trouble> {
        self.progress.step(layout.to_string());
        let name = format!("ranks-{}-{}-{}", layout.ranks, layout.partitioner, layout.level_base);
        let what = What::Ranks(layout);
        let order =
            Order { what, case: &self.selected.path, name: &name, ungraded: false, write: true };
        let done = self.run(&order)?;
        self.report().runs.push(done.run);
        self.add(Check::of_layout(layout, RUNS, Outcome::Pass), Some(layout));
        let Some(mesh) = done.mesh else { return Ok(()) };
        let subject = Subject::new(case, &mesh).with_reference(&meshes.mesh);
        let mut results = vec![checks::manifest::check(&subject), checks::linear::check(&subject)];
        results.extend(checks::identical::check(&subject));
        let holds = results.iter().all(CheckResult::holds);
        self.add_results(&layout.to_string(), Some(layout), results);
        if holds && !self.options.keep {
            // 36 copies of one mesh help nobody.
            let _ = fs::remove_dir_all(done.place);
        }
        Ok(())
    }
}
