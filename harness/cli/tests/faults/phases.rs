//! Ranks that are killed, crash or stop at the beginning of each phase. A rank names its phase in its status file: that write is the
//! call that the fault is injected into.

use crate::place::{Ended, Files, HANGS, Place, in_time};
use crate::tools::{injector, is_full, mpi, mpirun, skip};
use crate::{Row, Table};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

const CASE: &str = "spacing_min = 0.02\nroot_scale = 2.0\nkeep = \"all\"\n[generator]\nshape = \"sphere\"\nfacets = 1280\n";
const RANKS: usize = 3;
/// Time for a job: that of the launcher, of the limit for calls, and of the clean-up.
const LIMIT: Duration = HANGS;
const OPTIONS: &str =
    "case.toml --out out --json run.json --write words,htg --status status --quiet";
/// Only where a rank stops: a busy machine may stop any rank for seconds.
const STALL_LIMIT: [&str; 2] = ["--stall-limit", "2"];
/// Phases in which the faults of a sample occur.
const SAMPLE: [&str; 2] = ["sides", "leaves"];

/// The action that stops a rank.
const STOP: &str = "SIG19";
/// Signals, and exit codes that jobs may have after them.
const SIGNALS: [(&str, &str, &[i32]); 3] = [
    ("killed", "SIG9", &[137]),
    ("crashes", "SIG6", &[134]),
    ("stopped, --stall-limit 2", STOP, &[75]),
];

/// Every fault in every phase, on the first rank and on another.
pub fn family() {
    let (mesher, injector) = match (mpi(), injector()) {
        (Ok(mesher), Ok(injector)) => (mesher, injector),
        (Err(why), _) | (_, Err(why)) => return skip("ranks that fail in a phase", &why),
    };
    let place = Place::new();
    place.write("case.toml", CASE);
    fs::create_dir(place.path().join("status")).unwrap();
    let before = place.files();
    let mut table = Table::new();
    for rank in [0, 1] {
        let job = Job { place: &place, mesher: &mesher, injector: &injector, rank };
        place.reset(&before);
        let (ended, phases) = job.run("count", 0);
        assert_eq!(ended.code, Some(0), "{ended:?}");
        let complete = place.files();
        for (what, action, codes) in SIGNALS {
            for (i, phase) in phases.iter().enumerate() {
                let is_first = phases.iter().position(|p| p == phase) == Some(i);
                let is_sampled = SAMPLE.contains(&&**phase) && is_first && rank == 1;
                if !(is_full() || is_sampled) {
                    continue;
                }
                let (ended, left) = in_time(|| {
                    place.reset(&before);
                    let (ended, _) = job.run(action, i + 1);
                    let left = left(&place.files(), &complete);
                    let is_early = left != "nothing" && ended.may_be_killed_early();
                    ((ended, left), is_early)
                });
                let mut row =
                    Row::new(format!("phase {phase}"), format!("rank {rank} of {RANKS} {what}"));
                let wrong = judge(&ended, codes, left, phase, rank);
                row.add(
                    ended.code,
                    ended.seconds,
                    left,
                    wrong.map(|why| format!("{why}: {ended:?}")),
                );
                table.push(row);
            }
        }
    }
    table.finish("ranks that fail in a phase");
}

struct Job<'a> {
    place: &'a Place,
    mesher: &'a Path,
    injector: &'a Path,
    rank: usize,
}

impl Job<'_> {
    /// Runs it with a fault in the n-th phase of the rank; returns its end and the phases that the rank has reported.
    fn run(&self, action: &str, n: usize) -> (Ended, Vec<String>) {
        let (log, dir) = (self.place.beside("log"), self.place.path().join("status"));
        let mut command = mpirun(RANKS);
        command.env("INJECT_RANK", self.rank.to_string()).arg(self.injector);
        command.args(["write", action, &n.to_string()]).args([&dir, &log, &self.mesher.to_owned()]);
        command.args(OPTIONS.split(' '));
        command.args(STALL_LIMIT.iter().filter(|_| action == STOP));
        let ended = self.place.run(command, LIMIT);
        let log = fs::read_to_string(log).unwrap_or_default();
        let phase = |line: &str| line.split(' ').nth(2).map(str::to_owned);
        (ended, log.lines().filter_map(phase).collect())
    }
}

fn judge(ended: &Ended, codes: &[i32], left: &str, phase: &str, rank: usize) -> Option<String> {
    if ended.wrong.is_some() {
        return ended.wrong.clone();
    }
    if !ended.code.is_some_and(|code| codes.contains(&code)) {
        return Some(format!("the exit code is not one of {codes:?}"));
    }
    // A rank that the machine does not run for seconds is named as well.
    let is_named = |line: &str| {
        let (before, _) = line.split_once(" does not answer")?;
        let (_, ranks) = before.rsplit_once("rank ")?;
        Some(ranks.split(", ").any(|named| *named == rank.to_string()))
    };
    // A rank that was stopped goes on when the launcher ends it, and reports the interrupt.
    let is_reason = |line: &&str| line.starts_with("mesher: ") && !line.ends_with(": interrupted");
    let ours = ended.err.lines().filter(is_reason).count();
    let is_named = ended.err.lines().any(|line| is_named(line) == Some(true));
    if codes == [75] && !(is_named && ours == 1) {
        return Some("the rank is not named in one sentence".to_owned());
    }
    match left {
        "nothing" => None,
        // Nothing remains to be done but to end.
        "the mesh" | "the mesh and its report" if ["finish", "done"].contains(&phase) => None,
        _ => Some(format!("left {left}")),
    }
}

/// What a job has left besides its status files.
fn left(after: &Files, complete: &Files) -> &'static str {
    let of = |files: &Files, output: &str| -> Files {
        let same = |(path, _): &(PathBuf, _)| path.starts_with(output);
        files.clone().into_iter().filter(same).collect()
    };
    let [mesh, report] = ["out", "run.json"].map(|output| of(after, output));
    let is_other = |path: &&PathBuf| {
        !path.starts_with("status") && !path.starts_with("out") && !complete.contains_key(*path)
    };
    match (mesh.is_empty(), report.is_empty()) {
        _ if after.keys().any(|path| is_other(&path)) => "temporary files",
        (true, true) => "nothing",
        (false, true) if mesh == of(complete, "out") => "the mesh",
        (false, false) if mesh == of(complete, "out") => "the mesh and its report",
        _ => "an unfinished mesh",
    }
}
