//! The self test for meshes of any size: the corruptions are planted in a few leaves, in the manifest or in the
//! files, and the streaming audit must find them.
//!
//! The mesh is distributed to many parts once (`distributed`). The functions of the self test corrupt a
//! *window*, the leaves of one octant, as if it were a complete mesh. The result replaces the window in a copy
//! of the one part that contains it; all other parts are hard links (`plant`). So a trial needs disk space for
//! one part, and memory for a window and an audit. The few corruptions that change every leaf process the parts
//! one by one (`global`).
//!
//! If the leaves alone do not show a corruption, the corrupted mesh is compared with the original by the
//! digests and inputs in their manifests, as `harness verify` compares parallel meshes with the serial one.

mod distributed;
mod global;
mod plant;
mod trial;

use super::{Mutant, SelftestReport, catalogue};
use crate::audit::{self, AuditOptions};
use crate::checks::CheckResult;
use distributed::DistributedMesh;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use trial::{Outcome, Trial};

/// A mesh to corrupt.
#[derive(Clone, Debug)]
pub struct Source {
    /// Its name in the report.
    pub name: String,
    /// Its leaf-set directory, which is only read.
    pub mesh: PathBuf,
    /// The leaf-set directory of its T0, without which some corruptions do not apply.
    pub base: Option<PathBuf>,
}

/// Options of the self test at scale.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Seed of the pseudorandom windows.
    pub seed: u64,
    /// Number of concurrent trials. Each needs the memory of an audit.
    pub jobs: usize,
    /// Whether the user has interrupted the program.
    pub interrupted: fn() -> bool,
}

/// Applies every corruption to every mesh to which it applies. `scratch` is an existing empty directory with
/// room for a copy of the largest mesh and another one per job. `progress` is called with the numbers of
/// finished and of all trials.
///
/// # Errors
/// If a mesh cannot be read, or a scratch file cannot be written; `Interrupted` if the user interrupted the
/// program.
pub fn run(
    sources: &[Source],
    options: &Options,
    scratch: &Path,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> io::Result<SelftestReport> {
    let mut report = SelftestReport::default();
    let mutants = catalogue();
    let mut reasons: Vec<Option<String>> = vec![None; mutants.len()];
    let (done, all) = (AtomicUsize::new(0), sources.len() * mutants.len());
    let finished = || progress(done.fetch_add(1, Ordering::Relaxed) + 1, all);
    for (i, source) in sources.iter().enumerate() {
        let place = scratch.join(format!("mesh-{i}"));
        std::fs::create_dir(&place)?;
        let original = DistributedMesh::new(source, &place)?;
        let alarms_before: Vec<String> = alarms(&original).collect();
        if alarms_before.is_empty() {
            for (m, outcome) in
                trials(&original, options, &place, &finished)?.into_iter().enumerate()
            {
                match outcome {
                    Outcome::Planted(kill) => report.kills.push(kill),
                    Outcome::LeftOut(reason) => reasons[m] = Some(reason),
                }
            }
            // A trial that damaged the original would make all later corruptions easy to detect.
            report.alarms.extend(alarms(&original).map(|alarm| format!("afterwards, {alarm}")));
        } else {
            // Windows need sorted leaves, and in a wrong mesh a finding proves nothing.
            report.alarms.extend(alarms_before);
            reasons.fill(Some("the mesh itself fails the audit".to_owned()));
        }
        std::fs::remove_dir_all(&place)?;
    }
    let index = |name: &str| mutants.iter().position(|m| m.name == name);
    report.kills.sort_by_key(|kill| index(kill.mutant));
    let planted = |m: &Mutant| report.kills.iter().any(|kill| kill.mutant == m.name);
    let left_out = mutants.iter().zip(reasons).filter(|(m, _)| !planted(m));
    report.left_out = left_out.filter_map(|(m, reason)| Some((m.name, reason?))).collect();
    Ok(report)
}

/// Findings of the audit on the original mesh.
fn alarms(original: &DistributedMesh) -> impl Iterator<Item = String> {
    let checks = audit::audit(original.dir(), &AuditOptions::default()).checks;
    let found: Vec<CheckResult> = checks.into_iter().filter(|c| !c.holds()).collect();
    let name = original.name().to_owned();
    found.into_iter().map(move |check| format!("{name}: {check}"))
}

/// The outcome of every corruption of one mesh, in the order of [`catalogue`].
fn trials(
    original: &DistributedMesh,
    options: &Options,
    place: &Path,
    finished: &(dyn Fn() + Sync),
) -> io::Result<Vec<Outcome>> {
    let mutants = catalogue();
    let next = AtomicUsize::new(0);
    let results: Mutex<Vec<Option<io::Result<Outcome>>>> =
        Mutex::new(mutants.iter().map(|_| None).collect());
    let work = || {
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            let Some(mutant) = mutants.get(i) else { return };
            let outcome = match (options.interrupted)() {
                true => Err(io::ErrorKind::Interrupted.into()),
                false => {
                    let dir = place.join(format!("trial-{i}"));
                    Trial { original, mutant, seed: options.seed ^ i as u64, dir: &dir }.run()
                }
            };
            let failed = outcome.is_err();
            results.lock().expect("no trial panics with the lock")[i] = Some(outcome);
            finished();
            if failed {
                // The result is an error, so no further trial is started.
                next.store(mutants.len(), Ordering::Relaxed);
            }
        }
    };
    std::thread::scope(|scope| (0..options.jobs.max(1)).for_each(|_| drop(scope.spawn(work))));
    let results = results.into_inner().expect("no trial panics with the lock");
    // A trial that was not started implies an error elsewhere in the list.
    results.into_iter().flatten().collect()
}
