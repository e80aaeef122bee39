//! The checks by other programs: the proven checker judges the serial mesh, the oracles classify leaves of the base tree, and p4est balances
//! it.

use super::case::{CaseRun, PROOF, Step, steps};
use super::meshes::{MESHER, Meshed};
use super::options::Need;
use super::report::{Check, Outcome};
use crate::engine::failure::{CODE_INPUT, End, Failure};
use crate::engine::layout::{self, SERIAL};
use crate::engine::process::{self, Watch};
use crate::python::{ORACLES, ask};
use check::checks::{CheckResult, NO_LEAVES, identical};
use check::oracle::vote::{Answer, Ballot};
use check::oracle::{self, Sample, is_doubled, is_watertight};
use contract::case::Case;
use contract::catalogue::Size;
use contract::leafset::LeafSet;
use contract::manifest::Tree;
use contract::npy::{self, PartFile};
use contract::parity::Parity;
use contract::plain::PlainCase;
use contract::word::{self, Side};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use std::{fs, io};
use toml::Value;

/// On a small case the oracles classify every leaf, up to this many.
const POINTS_OF_SMALL: usize = 400_000;
/// Most points of other cases.
const POINTS: usize = 20_000;
/// Seed of the choice of points.
const SEED: u64 = 1;
/// p4est's exit code for a tree that is deeper than it supports.
const EXIT_TOO_DEEP: i32 = 3;

impl CaseRun<'_> {
    /// Has the other programs judge a serial mesh of the definition and its base tree.
    pub(super) fn verify_by_others(&mut self, case: &Case, serial: &Meshed, base: &Meshed) {
        for &(step, need) in steps(self.engine()) {
            if let Some(why) = self.all.needs.lacks(need) {
                self.leave_out(step, why);
                continue;
            }
            self.step(step.0);
            let start = Instant::now();
            let judged = match need {
                Need::Proof => self.prove(step, serial, base),
                Need::Oracles => self.vote(step, case, &base.mesh),
                _ => self.balance(step, case, &base.mesh),
            };
            let mut check = match judged {
                Ok(check) => check,
                Err(failure) if failure.is_interrupt() => return,
                // Without an answer nothing is shown about the mesh, and that must not count as agreement.
                Err(failure) => Check::new(step.0, step.1, Outcome::fail(failure.to_string())),
            };
            check.time_s = start.elapsed().as_secs_f64();
            self.add(check, None);
        }
    }

    /// Has the proven checker judge the mesh, given its base tree.
    fn prove(&self, step: Step, serial: &Meshed, base: &Meshed) -> Result<Check, Failure> {
        let (all, leaves) = (self.all, serial.mesh.words.len() as u64);
        let (checker, places) =
            (&all.programs.paths.proven_checker, (&*serial.place, &*base.place));
        match proven(checker, places, leaves, all.options.timeout) {
            Ok(proof) => Ok(Check::of_result(step.0, CheckResult { name: step.1, ..proof })),
            // The files of another program may lack what the proof needs. OCaml has the same code for exceptions that nothing catches.
            Err(Failure { end: End::Exited { code: CODE_INPUT, error }, .. })
                if !error.contains("exception") =>
            {
                all.needs.unproven.replace(Some(error.clone()));
                Ok(Check::new(step.0, step.1, Outcome::left_out(error)))
            }
            Err(failure) => Err(failure),
        }
    }

    /// Chooses points, has the oracles classify them, and counts the votes.
    fn vote(&self, step: Step, case: &Case, base: &LeafSet) -> Result<Check, Failure> {
        let needs = &self.all.needs;
        let most = if self.selected.size == Some(Size::Small) { POINTS_OF_SMALL } else { POINTS };
        let sample = oracle::choose(case, &base.words, most, SEED);
        let asked: Vec<&str> = ORACLES.into_iter().filter(|of| !needs.lacks_oracle(of)).collect();
        let (mut answers, mut failures) = (Vec::new(), Vec::new());
        let (paths, limit) = (&self.all.programs.paths, self.all.options.timeout);
        let (question, place) = ((&*sample.points, &*case.facets), self.place.join("oracles"));
        for answer in ask(&asked, question, &place, &needs.services, paths, limit)? {
            match answer {
                Ok(answer) => answers.push(answer),
                Err(failure) if failure.is_interrupt() => return Err(failure),
                Err(failure) => {
                    needs.silent.borrow_mut().push(failure.clone());
                    failures.push(failure);
                }
            }
        }
        let mut check = match answers.is_empty() {
            false => count(step, case, &sample, &answers),
            true => {
                let silent = needs.silent.borrow();
                let why = failures.first().or(silent.first()).map(Failure::to_string);
                Check::new(step.0, step.1, Outcome::left_out(why.unwrap_or_default()))
            }
        };
        check.notes.extend(failures.iter().map(|failure| format!("no answer: {failure}")));
        Ok(check)
    }

    /// Meshes the case with n = 1 and all leaves kept, balances the base tree with p4est, and compares the leaves
    /// without their sides.
    fn balance(&self, step: Step, case: &Case, base: &LeafSet) -> Result<Check, Failure> {
        let (subject, name) = step;
        let left_out = |why| Ok(Check::new(subject, name, Outcome::left_out(why)));
        let (case, place) = (plain(PlainCase::of(case)), self.place.join("plain-case"));
        let written = case.write(&place)?;
        let case = Case::read(&written).map_err(io::Error::other)?;
        if let Some(why) = self.engine().declines(&case) {
            return left_out(why);
        }
        let mesh = self.mesh(&written, "plain", MESHER, Tree::Final, &SERIAL)?.mesh;
        match self.balance_by_p4est(&base.words) {
            Ok(words) => {
                let diff = identical::compare(&sideless(&mesh.words), &words, &base.manifest.root);
                Ok(Check::of_result(subject, CheckResult { name, ..diff }))
            }
            Err(Failure { end: End::Exited { code: EXIT_TOO_DEEP, .. }, .. }) => {
                left_out("the base tree has leaves of level 19, p4est stops at 18".to_owned())
            }
            Err(failure) => Err(failure),
        }
    }

    /// The files of the engine may have other names, or a tree in place of words.
    fn balance_by_p4est(&self, base: &[u64]) -> Result<Vec<u64>, Failure> {
        let [tree, out] = ["p4est/base", "p4est"].map(|name| self.place.join(name));
        fs::create_dir_all(&tree)?;
        npy::write(&tree.join("leaves-00000.npy"), base)?;
        let mut command = Command::new(&self.all.programs.paths.p4est);
        command.arg(tree).arg(&out);
        layout::set_environment(&mut command);
        let _files = layout::own_directory(&mut command);
        process::run(&mut command, &Watch::new("p4est", self.all.options.timeout, &out))?;
        let part = PartFile::open(&out.join("leaves-00000.npy"));
        part.and_then(|part| part.read_all()).map_err(|error| {
            Failure::new("p4est", End::Unusable(format!("wrote no leaves: {error}")))
        })
    }
}

/// What the proven checker finds of a mesh with so many leaves, given the directory of its base tree T0. The note on a mesh that is accepted
/// says what is proven of it, and what is only tested.
///
/// # Errors
/// If the checker gives no answer within the limit, or cannot read the files.
pub fn proven(
    checker: &Path,
    (mesh, base): (&Path, &Path),
    leaves: u64,
    limit: Duration,
) -> Result<CheckResult, Failure> {
    let place = tempfile::tempdir()?;
    let mut command = Command::new(checker);
    command.arg(mesh).arg(base);
    let mut proof = CheckResult::new(PROOF.0);
    proof.examined = leaves;
    match process::run(&mut command, &Watch::new("the proven checker", limit, place.path())) {
        Ok(finished) => {
            let answer = fs::read_to_string(finished.stdout)?;
            // An older checker proves less.
            let silent = "does not say what it proves: ci/prove builds the present one".to_owned();
            let meaning = answer.lines().nth(1);
            proof.note = meaning.ok_or(Failure::new(PROOF.0, End::Unusable(silent)))?.to_owned();
        }
        Err(failure) if matches!(failure.end, End::Exited { code: 1, .. }) => {
            proof.report("the checker of reference/proof rejects the mesh");
        }
        Err(failure) => return Err(failure),
    }
    proof.needs_objects(NO_LEAVES);
    Ok(proof)
}

/// Counts the votes.
fn count(step: Step, case: &Case, sample: &Sample, answers: &[Answer]) -> Check {
    let parity = Parity::new(&case.facets_lattice);
    let mesh: Vec<bool> = sample.words.iter().map(|&w| word::side(w) == Side::Inside).collect();
    // Whether a leaf's centroid is inside by all exact rays, unless they disagree.
    let unanimous = |&leaf: &u64| {
        let rays = parity.inside(word::octant(leaf).centre());
        rays.iter().all(|ray| *ray == rays[0]).then_some(rays[0])
    };
    let exact: Vec<Option<bool>> = sample.words.iter().map(unanimous).collect();
    let ballot = Ballot {
        mesh: &mesh,
        exact: &exact,
        oracles: answers,
        watertight: is_watertight(&case.facets_lattice),
        doubled: is_doubled(&case.facets_lattice),
        seeds: !case.seeds.is_empty(),
    };
    let outcome = match (ballot.failure(&sample.points), ballot.advisory()) {
        (Some(why), _) => Outcome::fail(why),
        // Agreement would show nothing where no vote could fail the mesh.
        (None, Some(why)) => Outcome::left_out(format!(
            "{why}, so the oracles' votes are reported but decide nothing"
        )),
        (None, None) => Outcome::held(ballot.decisive()),
    };
    let &Sample { in_band, band, .. } = sample;
    let near = "of the surface were not given to the oracles";
    let near = (in_band > 0).then(|| format!("{in_band} leaves within {band:.3e} {near}"));
    let notes = near.into_iter().chain(ballot.notes()).collect();
    Check { notes, ..Check::new(step.0, step.1, outcome) }
}

/// The case with n = 1 and all leaves kept.
fn plain(mut case: PlainCase) -> PlainCase {
    case.table.insert("layer_cells_min".into(), Value::Integer(1));
    case.table.insert("keep".into(), Value::String("all".into()));
    case.table.insert("keep_crossing".into(), Value::Boolean(true));
    case
}

/// Leaf words with side bits 0. They stay sorted, because no two leaves have the same octant.
fn sideless(words: &[u64]) -> Vec<u64> {
    words.iter().map(|word| word & !3).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plain_case_differs_only_in_layer_and_keep() {
        let table = toml::toml! { spacing_min = 0.1 keep = "inside" keep_crossing = false };
        let facets = vec![[[0.5; 3]; 3]];
        let case = plain(PlainCase { table, facets: facets.clone() });
        let expected =
            toml::toml! { spacing_min = 0.1 keep = "all" keep_crossing = true layer_cells_min = 1 };
        assert_eq!((case.table, case.facets), (expected, facets));
    }

    #[test]
    fn sides_are_cleared_and_octants_kept() {
        assert_eq!(
            sideless(&[0b0100, 1 << 7 | 0b1001, 2 << 7 | 0b1010]),
            [4, 1 << 7 | 8, 2 << 7 | 8]
        );
    }
}
