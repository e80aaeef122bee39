//! The sides of the base tree's leaves, compared with those that the oracles give.

use super::case::{CaseRun, SIDES};
use super::report::{Check, Outcome};
use super::serial::Base;
use crate::engine::failure::{End, Failure};
use crate::oracle::{ORACLES, ask};
use check::oracle::vote::{self, Answer, Ballot};
use check::oracle::{self, Sample, is_doubled, is_watertight};
use contract::case::Case;
use contract::catalogue::Size;
use contract::parity::Parity;
use contract::word::{self, Side};
use std::fs;
use std::time::Instant;

/// On a small case the oracles classify every leaf, up to this many.
const POINTS_OF_SMALL: usize = 400_000;
/// Most points of other cases.
const POINTS: usize = 20_000;
/// Seed of the choice of points.
const SEED: u64 = 1;

impl CaseRun<'_> {
    /// Chooses points, has the oracles classify them, and counts the votes.
    pub(super) fn verify_oracles(&mut self, case: &Case, base: &Base) {
        let needs = &self.all.needs;
        let (subject, name) = SIDES;
        if let Some(why) = &needs.oracles {
            return self.add(Check::new(subject, name, Outcome::left_out(why)), None);
        }
        let start = Instant::now();
        self.step("oracles");
        let (gone, asked): (Vec<&str>, Vec<&str>) =
            ORACLES.into_iter().partition(|of| needs.lacks_oracle(of).is_some());
        let most = match self.selected.size {
            Some(Size::Small) => POINTS_OF_SMALL,
            _ => POINTS,
        };
        let sample = oracle::choose(case, &base.tree.words, most, SEED);
        let (mut answers, mut failures) = (Vec::new(), Vec::new());
        for answer in self.ask(case, &sample, &asked) {
            match answer {
                Ok(answer) => answers.push(answer),
                Err(failure) if failure.is_interrupt() => return,
                Err(failure) => {
                    needs.note_silent(&failure);
                    failures.push(failure);
                }
            }
        }
        let mut check = match answers.is_empty() {
            false => judge(case, &sample, &answers),
            true => {
                let first = gone.first().and_then(|of| needs.lacks_oracle(of));
                let first = first.or_else(|| failures.first().cloned());
                let why = first.map_or_else(String::new, |why| why.to_string());
                Check::new(subject, name, Outcome::left_out(why))
            }
        };
        check.notes.extend(failures.iter().map(|failure| format!("no answer: {failure}")));
        check.time_s = start.elapsed().as_secs_f64();
        self.add(check, None);
    }

    fn ask(&self, case: &Case, sample: &Sample, oracles: &[&str]) -> Vec<Result<Answer, Failure>> {
        let place = self.place.join("oracles");
        let (services, paths) = (&self.all.needs.services, &self.all.programs.paths);
        let (question, limit) = ((&*sample.points, &*case.facets), self.all.options.limit());
        let answers = fs::create_dir_all(&place)
            .and_then(|()| ask(oracles, question, &place, services, paths, limit));
        answers.unwrap_or_else(|error| {
            let end = End::Unusable(format!("have no input files: {error}"));
            vec![Err(Failure::new("the oracles", end))]
        })
    }
}

fn judge(case: &Case, sample: &Sample, answers: &[Answer]) -> Check {
    let parity = Parity::new(&case.facets_lattice);
    let mesh: Vec<bool> =
        sample.words.iter().map(|&leaf| word::side(leaf) == Side::Inside).collect();
    let exact: Vec<Option<bool>> =
        sample.words.iter().map(|&leaf| unanimous(&parity, leaf)).collect();
    let ballot = Ballot {
        mesh: &mesh,
        exact: &exact,
        oracles: answers,
        watertight: is_watertight(&case.facets_lattice),
        doubled: is_doubled(&case.facets_lattice),
        seeds: !case.seeds.is_empty(),
    };
    let count = vote::count(&ballot);
    let outcome = match count.failure(&ballot, &sample.points) {
        Some(why) => Outcome::fail(why),
        // Agreement would show nothing where no vote could fail the mesh.
        None => match ballot.advisory() {
            Some(why) => Outcome::left_out(format!(
                "{why}, so the oracles' votes are reported but decide nothing"
            )),
            None => Outcome::held(ballot.decisive()),
        },
    };
    let mut notes = count.notes(&ballot);
    if sample.in_band > 0 {
        notes.insert(
            0,
            format!(
                "{} leaves within {:.3e} of the surface were not given to the oracles",
                sample.in_band, sample.band
            ),
        );
    }
    Check { notes, ..Check::new(SIDES.0, SIDES.1, outcome) }
}

/// Whether a leaf's centroid is inside by all exact rays; `None` if the rays disagree.
fn unanimous(parity: &Parity, leaf: u64) -> Option<bool> {
    let rays = parity.inside(word::octant(leaf).centre());
    rays.iter().all(|ray| *ray == rays[0]).then_some(rays[0])
}
