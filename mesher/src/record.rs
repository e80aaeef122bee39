//! A run on one rank: its options, the times and messages of its phases, the phase that it is in, and the work that it has done.

use crate::output::write::Output;
use crate::partition::Division;
use cpu_time::ThreadTime;
use files::interrupt::stop_at;
use ranks::{Comm, Traffic, uncounted};
use serde::Serialize;
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Instant;

/// Options that have no effect on the mesh, but for `ungraded`.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// How to divide the work among ranks.
    pub division: Division,
    /// Stop after sides: the mesh is the base tree T0, with all its leaves.
    pub ungraded: bool,
    /// What to write, and where.
    pub out: Option<Output>,
    /// Check invariants after each phase, which debug builds do in any case.
    pub check: bool,
    /// Fail if the geometry leaks.
    pub strict: bool,
    /// Simulated ranks repeat phases 3 to 10 alone, for the times of a rank with a core and caches of its own. Not with `out`.
    pub time_alone: bool,
    /// What to call the case in advice to the user.
    pub case_name: String,
}

impl Options {
    /// Whether checks run: in debug builds, and in release builds on request.
    pub fn checks(&self) -> bool {
        cfg!(debug_assertions) || self.check
    }
}

/// A run on one rank.
pub struct Job<'a> {
    /// The same on all ranks.
    pub options: &'a Options,
    /// All ranks.
    pub comm: &'a dyn Comm,
    /// Times and messages of the phases.
    pub record: &'a mut Recorder,
    /// Work done by this rank.
    pub counters: Counters,
}

impl<'a> Job<'a> {
    /// A run that has done nothing.
    pub fn new(options: &'a Options, comm: &'a dyn Comm, record: &'a mut Recorder) -> Self {
        Self { options, comm, record, counters: Counters::default() }
    }

    /// Runs and times a phase, or part of it. The times of phases with the same name add up. Collective if `work` is.
    pub fn phase<T>(&mut self, name: &'static str, work: impl FnOnce(&dyn Comm) -> T) -> T {
        let (comm, record) = (self.comm, &mut *self.record);
        record.report_status(name);
        comm.enter(name);
        stop_at(format_args!("{name}:{}", comm.rank()));
        let before = comm.traffic();
        let (wall, cpu) = (Instant::now(), ThreadTime::now());
        let result = work(comm);
        let (time_wall_s, time_cpu_s) = (wall.elapsed().as_secs_f64(), cpu.elapsed().as_secs_f64());
        let after = comm.traffic();
        let index = record.phases.iter().position(|p| p.name == name).unwrap_or_else(|| {
            record.phases.push(Phase { name, ..Phase::default() });
            record.phases.len() - 1
        });
        let p = &mut record.phases[index];
        p.time_wall_s += time_wall_s;
        p.time_cpu_s += time_cpu_s;
        p.traffic.messages += after.messages - before.messages;
        p.traffic.bytes += after.bytes - before.bytes;
        p.traffic.time_wall_s += after.time_wall_s - before.time_wall_s;
        p.traffic.time_cpu_s += after.time_cpu_s - before.time_cpu_s;
        result
    }

    /// Checks what a phase has made if checks are on. Messages are not counted. Collective if `check` is.
    pub fn check(&self, check: impl FnOnce(&dyn Comm)) {
        if self.options.checks() {
            uncounted(self.comm, || check(self.comm));
        }
    }
}

/// One phase on one rank.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Phase {
    /// Name of the phase.
    pub name: &'static str,
    /// Wall time, in seconds.
    pub time_wall_s: f64,
    /// CPU time of the rank's thread, in seconds, calls to other ranks included.
    pub time_cpu_s: f64,
    /// Messages sent in the phase, and the time in calls.
    pub traffic: Traffic,
}

/// Times phases, in the order in which they run, and reports the current one.
#[derive(Debug, Default)]
pub struct Recorder {
    /// The phases so far.
    pub phases: Vec<Phase>,
    /// Whether the name of the current phase is written to standard error.
    pub progress: bool,
    status: Option<PathBuf>,
}

impl Recorder {
    /// Also writes the name of the current phase to a file from now on.
    ///
    /// # Errors
    /// If the file is an input of this run or cannot be written.
    pub fn keep_status(&mut self, path: PathBuf) -> io::Result<()> {
        files::register_output(&path)?;
        std::fs::write(&path, "start\n")?;
        self.status = Some(path);
        Ok(())
    }

    /// Reports the current phase.
    pub fn report_status(&self, phase: &str) {
        if let Some(path) = &self.status {
            // For the diagnosis of hangs; an error here must not end the run.
            let _ = std::fs::write(path, format!("{phase}\n"));
        }
        if self.progress {
            let _ = write!(std::io::stderr(), "\r\x1b[K{phase}");
        }
    }
}

/// Work done by one rank, in numbers that repeat exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Counters {
    /// Tests of a facet against the 64 octants of a brick, those above the rank's part included.
    pub facet_brick_tests: u64,
    /// Bricks visited by voxelisation.
    pub bricks_voxelised: u64,
    /// Rays cast by all ranks; counted on rank 0.
    pub rays: u64,
    /// Octants split by gradation, in bricks that the rank owns.
    pub octants_split_graded: u64,
    /// Words of dilated tiles.
    pub words_dilated: u64,
    /// Bricks sent to other ranks by gradation.
    pub halo_bricks: u64,
    /// Messages sent.
    pub messages: u64,
    /// Payload sent, in bytes.
    pub message_bytes: u64,
    /// Leaves of the mesh.
    pub leaves: u64,
    /// Leaves in the rank's heaviest base leaf.
    pub base_leaf_cells_max: u64,
}

/// Peak resident memory of this process, in bytes; 0 on systems that do not provide it.
pub fn peak_rss_bytes() -> u64 {
    stated_bytes("/proc/self/status", "VmHWM:").unwrap_or(0)
}

/// The bytes that a file of the kernel states in one of its lines; none on systems that do not provide it.
pub fn stated_bytes(file: &str, name: &str) -> Option<u64> {
    let text = std::fs::read_to_string(file).ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix(name))?;
    let kilobytes: u64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kilobytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ranks::sim;

    #[test]
    fn phases_of_one_name_add_up_with_their_messages() {
        let folder = tempfile::tempdir().expect("a temporary directory");
        sim::run(2, 1, |comm| {
            let status = folder.path().join(comm.rank().to_string());
            let mut record = Recorder::default();
            record.keep_status(status.clone()).expect("no input");
            comm.sum(1);
            let (before, since) = (comm.traffic(), ThreadTime::now());
            let work = |calls: usize| {
                let since = ThreadTime::now();
                while since.elapsed().as_millis() < 4 {}
                (0..calls).for_each(|_| _ = comm.sum(0));
                since.elapsed().as_secs_f64()
            };
            let options = Options::default();
            let mut job = Job::new(&options, comm, &mut record);
            let worked_s = [("a", 1), ("b", 0), ("a", 2)]
                .map(|(name, calls)| job.phase(name, |_| work(calls)));
            let all_s = since.elapsed().as_secs_f64();
            let [a, b] = record.phases[..] else { panic!("two names: {record:?}") };
            assert_eq!((a.name, b.name), ("a", "b"));
            let after = comm.traffic();
            assert_eq!(a.traffic.messages, after.messages - before.messages);
            assert_eq!(a.traffic.bytes, after.bytes - before.bytes);
            let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
            assert!(near(a.traffic.time_wall_s, after.time_wall_s - before.time_wall_s));
            assert!(near(a.traffic.time_cpu_s, after.time_cpu_s - before.time_cpu_s));
            assert_eq!((b.traffic, b.traffic.messages), (Traffic::default(), 0));
            assert!(a.time_cpu_s >= worked_s[0] + worked_s[2] - 1e-9, "{a:?} {worked_s:?}");
            assert!(b.time_cpu_s >= worked_s[1] - 1e-9, "{b:?} {worked_s:?}");
            assert!(a.time_cpu_s + b.time_cpu_s <= all_s + 1e-9, "{a:?} {b:?} {all_s}");
            assert!(a.time_wall_s >= a.time_cpu_s * 0.99 && b.time_wall_s >= b.time_cpu_s * 0.99);
            assert_eq!(std::fs::read_to_string(&status).expect("a status"), "a\n");
        });
        let peak = peak_rss_bytes();
        assert!(
            peak.is_multiple_of(1024)
                && (cfg!(not(target_os = "linux")) || (1 << 20..1 << 37).contains(&peak)),
            "{peak}"
        );
    }
}
