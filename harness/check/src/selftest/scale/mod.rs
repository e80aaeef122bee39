//! The self test on a mesh of any size: corruptions of the catalogue planted in a few leaves of it, or in
//! its manifest or files, for the streaming audit to find.
//!
//! The mesh is dealt to many parts once (`whole`). A corruption is made by the catalogue's own functions in
//! a *window*, the leaves of one octant somewhere in the mesh, as if it were a mesh by itself; what comes of
//! it is spliced into a copy of the one part that changes, all others being hard links (`plant`). So
//! a trial costs a part's worth of disk and an audit, and memory that of a window and an audit. The few
//! corruptions that concern every leaf go through the parts one by one (`everywhere`).
//!
//! Corruptions that the leaves alone do not show are held against the untouched mesh, as `harness verify`
//! holds meshes of ranks against the serial one: by the digests and terms of the manifest.

mod everywhere;
mod plant;
mod trial;
mod whole;

use super::{Mutant, SelftestReport, catalogue};
use crate::audit::{self, AuditOptions};
use crate::checks::CheckResult;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use trial::{Trial, Tried};
use whole::Whole;

/// A mesh to corrupt.
#[derive(Clone, Debug)]
pub struct Source {
    /// What to call it.
    pub name: String,
    /// Its leaf-set directory, which is only read.
    pub mesh: PathBuf,
    /// That of its T0, which some corruptions need to know what to corrupt.
    pub base: Option<PathBuf>,
}

/// How it is done.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Chooses the places.
    pub seed: u64,
    /// Trials at a time; each takes the memory of an audit.
    pub jobs: usize,
    /// Whether the user has asked to end.
    pub interrupted: fn() -> bool,
}

/// Corrupts every mesh in every way that applies to it. `scratch` is an existing empty directory with
/// room for a copy of a mesh and of one for each job; `say` is told how many trials are done, of how many.
///
/// # Errors
/// Where a mesh cannot be read or scratch files cannot be written; `Interrupted` where the user wished so.
pub fn run(
    sources: &[Source],
    options: &Options,
    scratch: &Path,
    say: &(dyn Fn(usize, usize) + Sync),
) -> io::Result<SelftestReport> {
    let mut report = SelftestReport::default();
    let mut why: Vec<Option<String>> = vec![None; catalogue().len()];
    let (done, all) = (AtomicUsize::new(0), sources.len() * catalogue().len());
    for (i, source) in sources.iter().enumerate() {
        let place = scratch.join(format!("mesh-{i}"));
        std::fs::create_dir(&place)?;
        let whole = Whole::deal(source, &place)?;
        let before = alarms(&whole).collect::<Vec<_>>();
        if !before.is_empty() {
            // Places are looked for in leaves that are in order; and what is found already proves nothing.
            report.alarms.extend(before);
            why.iter_mut().for_each(|why| *why = Some("the mesh itself does not hold".to_owned()));
            std::fs::remove_dir_all(&place)?;
            continue;
        }
        let tell = || say(done.fetch_add(1, Ordering::Relaxed) + 1, all);
        for (m, tried) in trials(&whole, options, &place, &tell)?.into_iter().enumerate() {
            match tried {
                Tried::Planted(kill) => report.kills.push(kill),
                Tried::LeftOut(reason) => why[m] = Some(reason),
            }
        }
        // A trial that harmed the mesh itself would make the next ones easy to find.
        report.alarms.extend(alarms(&whole).map(|alarm| format!("afterwards, {alarm}")));
        std::fs::remove_dir_all(&place)?;
    }
    let order = catalogue();
    let place_of = |name: &str| order.iter().position(|m| m.name == name);
    report.kills.sort_by_key(|kill| place_of(kill.mutant));
    let planted = |m: &Mutant| report.kills.iter().any(|kill| kill.mutant == m.name);
    let left_out = order.iter().zip(why).filter(|(m, _)| !planted(m));
    report.left_out = left_out.filter_map(|(m, why)| Some((m.name, why?))).collect();
    Ok(report)
}

/// Findings on the mesh as it is.
fn alarms(whole: &Whole) -> impl Iterator<Item = String> {
    let checks = audit::audit(whole.dir(), &AuditOptions::default()).checks;
    let found: Vec<CheckResult> = checks.into_iter().filter(|c| !c.holds()).collect();
    let name = whole.name().to_owned();
    found.into_iter().map(move |check| format!("{name}: {check}"))
}

/// Every corruption on one mesh, in the catalogue's order, so many at a time.
fn trials(
    whole: &Whole,
    options: &Options,
    place: &Path,
    tell: &(dyn Fn() + Sync),
) -> io::Result<Vec<Tried>> {
    let mutants = catalogue();
    let next = AtomicUsize::new(0);
    let results: Mutex<Vec<Option<io::Result<Tried>>>> =
        Mutex::new(mutants.iter().map(|_| None).collect());
    let work = || {
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            let Some(mutant) = mutants.get(i) else { return };
            let tried = match (options.interrupted)() {
                true => Err(io::ErrorKind::Interrupted.into()),
                false => {
                    let dir = place.join(format!("trial-{i}"));
                    Trial { whole, mutant, seed: options.seed ^ i as u64, dir: &dir }.run()
                }
            };
            let failed = tried.is_err();
            results.lock().expect("no trial panics with the lock")[i] = Some(tried);
            tell();
            if failed {
                // The others need not begin what nobody will read.
                next.store(mutants.len(), Ordering::Relaxed);
            }
        }
    };
    std::thread::scope(|scope| (0..options.jobs.max(1)).for_each(|_| drop(scope.spawn(work))));
    let results = results.into_inner().expect("no trial panics with the lock");
    // Whatever was not begun was so for an error that stands elsewhere in the list.
    results.into_iter().flatten().collect()
}
