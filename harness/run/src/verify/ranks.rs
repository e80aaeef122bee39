//! Independence of the partition: every layout gives the mesh of the serial run, leaf by leaf.

use super::case::{CaseRun, RUNS};
use super::report::{Check, Outcome};
use super::run::{Program, Request};
use super::serial::Meshes;
use crate::engine::failure::{End, Failure};
use crate::engine::layout::Layout;
use check::checks::{self, CheckResult, Subject};
use contract::case::Case;
use std::fs;

/// Hangs after which the remaining layouts of a case are left out: each hang costs the whole time limit.
const HANGS_MAX: usize = 3;

impl CaseRun<'_> {
    /// Runs every layout and compares its mesh with the serial one.
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
                Err(failure) if failure.is_interrupt() => return,
                Err(failure) => {
                    hangs += usize::from(matches!(failure.end, End::TimedOut { .. }));
                    self.add_failure(&layout.to_string(), Some(&layout), &failure);
                }
            }
        }
    }

    fn verify_layout(
        &mut self,
        case: &Case,
        meshes: &Meshes,
        layout: &Layout,
    ) -> Result<(), Failure> {
        self.progress.step(layout.to_string());
        let meshed = self.run(&Request {
            program: Program::Mesher,
            layout,
            case: &self.selected.path,
            name: &directory_name(layout),
            ungraded: false,
            write: true,
        })?;
        self.report().runs.push(meshed.run);
        self.add(Check::of_layout(layout, RUNS, Outcome::Pass), Some(layout));
        let Some(mesh) = meshed.mesh else { return Ok(()) };
        let subject = Subject::new(case, &mesh).with_reference(&meshes.mesh);
        let mut results = vec![checks::manifest::check(&subject), checks::linear::check(&subject)];
        results.extend(checks::identical::check(&subject));
        let holds = results.iter().all(CheckResult::holds);
        self.add_results(&layout.to_string(), Some(layout), results);
        if holds && !self.options.keep {
            // A correct mesh equals the serial one, and one copy of it suffices.
            let _ = fs::remove_dir_all(meshed.place);
        }
        Ok(())
    }
}

fn directory_name(layout: &Layout) -> String {
    let choices = [&layout.partitioner, &layout.level_base].map(|choice| choice.as_deref());
    let words = choices.into_iter().flatten();
    words.fold(format!("ranks-{}", layout.ranks.count()), |name, word| format!("{name}-{word}"))
}
