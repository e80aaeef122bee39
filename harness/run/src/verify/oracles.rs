//! The sides of the base tree's leaves, compared with those that the oracles give.

use super::case::{CaseRun, ORACLES};
use super::report::{Check, Outcome};
use super::serial::Base;
use crate::engine::failure::{End, Failure};
use crate::oracle::Question;
use check::oracle::vote::{self, Answer, Ballot};
use check::oracle::{self, Sample, is_doubled, is_watertight};
use contract::case::Case;
use contract::catalogue::Size;
use contract::parity::Parity;
use contract::watch::Watch;
use contract::word::{self, Side};
use std::fs;
use std::time::Instant;

/// Name of the check.
const NAME: &str = ORACLES.1;
/// Its subject.
const SUBJECT: &str = ORACLES.0;

/// On a small case the oracles classify every leaf, up to this many.
const POINTS_OF_SMALL: usize = 400_000;

impl CaseRun<'_> {
    /// Chooses points, has the oracles classify them, and counts the votes.
    pub fn verify_oracles(&mut self, case: &Case, base: &Base) {
        let oracles = self.needs.oracles(self.options, &self.programs.paths);
        if let Some(why) = &oracles.lacking {
            return self.add(Check::new(SUBJECT, NAME, Outcome::left_out(why)), None);
        }
        let start = Instant::now();
        let most = match self.selected.size {
            Some(Size::Small) => POINTS_OF_SMALL,
            _ => self.options.oracle_points,
        };
        let sample = oracle::choose(case, &base.tree.words, most, self.options.seed);
        let (answers, failures) = match self.ask(case, &sample, &oracles.found) {
            Ok(answered) => answered,
            Err(failure) if failure.is_interrupt() => return,
            Err(failure) => {
                let outcome = Outcome::left_out(failure.to_string());
                self.oracles_silent.push(failure);
                return self.add(Check::new(SUBJECT, NAME, outcome), None);
            }
        };
        let mut check = judge(case, &sample, &answers);
        check.notes.extend(failures.iter().map(|failure| format!("no answer: {failure}")));
        check.time_s = start.elapsed().as_secs_f64();
        self.oracles_silent.extend(failures);
        self.add(check, None);
    }

    /// The answers, and the failures of the oracles that gave none. At least one oracle answered.
    fn ask(
        &self,
        case: &Case,
        sample: &Sample,
        oracles: &[&'static str],
    ) -> Result<(Vec<Answer>, Vec<Failure>), Failure> {
        let place = self.place.join("oracles");
        let question = fs::create_dir_all(&place)
            .and_then(|()| Question::write(&sample.points, &case.facets, &place))
            .map_err(|error| {
                Failure::new("the oracles", End::Unusable(format!("have no input files: {error}")))
            })?;
        let (mut answers, mut failures) = (Vec::new(), Vec::new());
        self.progress.step("oracles");
        let (paths, limit) = (&self.programs.paths, self.options.limit());
        for (_, answer) in question.ask(oracles, &self.needs.services, paths, limit) {
            match answer {
                Ok(answer) => answers.push(answer),
                Err(failure) if failure.is_interrupt() => return Err(failure),
                Err(failure) => failures.push(failure),
            }
        }
        match (answers.is_empty(), failures.first()) {
            (true, Some(failure)) => Err(failure.clone()),
            _ => Ok((answers, failures)),
        }
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
    Check { notes, ..Check::new(SUBJECT, NAME, outcome) }
}

/// Whether a leaf's centroid is inside by all exact rays; `None` if the rays disagree.
fn unanimous(parity: &Parity, leaf: u64) -> Option<bool> {
    let rays = parity.inside(word::octant(leaf).centre());
    rays.iter().all(|ray| *ray == rays[0]).then_some(rays[0])
}
