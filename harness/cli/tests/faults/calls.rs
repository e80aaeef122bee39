//! System calls that fail, in each program, one after another.

use crate::place::{Ended, Files, Place, TMP};
use crate::programs::{Leaves, Program, all, inputs};
use crate::tools::{calls_max, injector, mpi, program, skip};
use crate::{Row, Table};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// A fault, the classes of calls that it is injected into, and how the run may end.
struct Fault {
    name: &'static str,
    classes: &'static str,
    action: &'static str,
    /// Whether all later calls have the fault as well.
    is_lasting: bool,
    end: End,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum End {
    /// The program recovers.
    Success,
    /// The program refuses, and leaves nothing unfinished. It may do without the file, if all its output is complete.
    Refusal,
    /// The same, and output that may not be on disk is not success.
    Lost,
    /// The program ends with exit code 130 and leaves nothing unfinished, or has been about to end.
    Interrupt,
    /// The program is killed: files with their final names are complete.
    Kill,
}

const ALL: &str = "open,read,write,sync,rename,truncate,mkdir,list";
const CHANGES: &str = "open,write,sync,rename,mkdir";

const FAULTS: [Fault; 14] = [
    fault("EIO of a read", "read", "5", End::Refusal),
    fault("EINTR of a read", "read", "4", End::Success),
    Fault { is_lasting: true, ..fault("short reads", "read", "short", End::Success) },
    fault("EIO of a list of files", "list", "5", End::Refusal),
    fault("EACCES of an open", "open", "13", End::Refusal),
    fault("EIO of a write", "write", "5", End::Lost),
    Fault {
        is_lasting: true,
        ..fault("ENOSPC from a write on", "write,truncate,mkdir", "28", End::Lost)
    },
    fault("EINTR of a write", "write", "4", End::Success),
    Fault { is_lasting: true, ..fault("short writes", "write", "short", End::Success) },
    fault("EIO of an fsync", "sync", "5", End::Lost),
    fault("EACCES of a rename", "rename", "13", End::Lost),
    fault("EACCES of a mkdir", "mkdir", "13", End::Lost),
    fault("SIGTERM at a call", CHANGES, "SIG15", End::Interrupt),
    fault("SIGKILL at a call", CHANGES, "SIG9", End::Kill),
];

const fn fault(name: &'static str, classes: &'static str, action: &'static str, end: End) -> Fault {
    Fault { name, classes, action, is_lasting: false, end }
}

/// Jobs of MPI take longer: this part of the calls fails.
const PART_OF_JOBS: usize = 2;

/// A program, and what it does without faults.
struct Subject<'a> {
    program: Program,
    injector: &'a Path,
    place: &'a Place,
    before: Files,
    complete: Files,
    calls: Vec<String>,
}

/// Every fault in every program.
pub fn family() {
    let (Some(mesher), Some(_)) = (program("mesher"), program("reference")) else {
        return skip("failing calls", "mesher and reference were not built");
    };
    let injector = match injector() {
        Ok(injector) => injector,
        Err(why) => return skip("failing calls", &why),
    };
    let with_mpi = mpi().map_err(|why| skip("failing calls of MPI ranks", &why)).is_ok();
    let place = inputs(&mesher);
    let inputs = place.files();
    let mut table = Table::new();
    for program in all(with_mpi) {
        let before = program.before(&inputs);
        place.reset(&before);
        let (ended, calls) = inject(&program, &injector, &place, [ALL, "count", "0"]);
        assert_eq!(ended.code, Some(program.code), "{}: {ended:?}", program.name);
        assert!(!calls.is_empty(), "{}: no calls were seen", program.name);
        let complete = place.files();
        let subject =
            Subject { program, injector: &injector, place: &place, before, complete, calls };
        FAULTS.iter().for_each(|fault| table.push(subject.suffer(fault)));
    }
    table.finish("failing calls");
}

/// Runs a program with a fault, which the injector `with` makes; returns its end and its calls.
fn inject(program: &Program, with: &Path, place: &Place, fault: [&str; 3]) -> (Ended, Vec<String>) {
    let log = place.beside("log");
    let (dir, log_name) = (place.path().to_str().unwrap(), log.to_str().unwrap());
    let command = program.command(with, &[&fault[..], &[dir, log_name]].concat(), place);
    let ended = place.run(command, program.limit());
    let calls = fs::read_to_string(&log).unwrap_or_default();
    (ended, calls.lines().map(str::to_owned).collect())
}

impl Subject<'_> {
    fn suffer(&self, fault: &Fault) -> Row {
        let mut row = Row::new(self.program.name, fault.name);
        let is_of_fault = |call: &&String| {
            fault.classes.split(',').any(|class| call.split(' ').next() == Some(class))
        };
        let calls = self.calls.iter().filter(is_of_fault).count();
        let part = if self.program.is_parallel() { PART_OF_JOBS } else { 1 };
        let runs = (calls_max() / part).min(calls);
        // Faults that change nothing may all occur in one run.
        let runs = if fault.is_lasting && fault.end == End::Success { runs.min(1) } else { runs };
        let at: BTreeSet<usize> =
            (0..runs).map(|i| 1 + i * calls.saturating_sub(1) / (runs - 1).max(1)).collect();
        for n in at {
            self.place.reset(&self.before);
            let nth = format!("{n}{}", if fault.is_lasting { "+" } else { "" });
            let fault_of_run = [fault.classes, fault.action, &nth];
            let (ended, calls) = inject(&self.program, self.injector, self.place, fault_of_run);
            let call = calls.iter().find_map(|call| call.strip_suffix(" !"));
            let after = self.place.files();
            let wrong = self.judge(fault.end, call, &ended, &after);
            let left = self.left(&after);
            let wrong = wrong.map(|wrong| {
                let Ended { code, out, err, .. } = &ended;
                format!(
                    "{wrong}: call {n}, {}: exit code {code:?}, left: {left}, printed: {err}{}",
                    call.unwrap_or("none"),
                    out.lines().last().unwrap_or_default()
                )
            });
            row.add(ended.code, ended.seconds, left, wrong);
        }
        row
    }

    /// What is wrong with the end of a run, if anything.
    fn judge(&self, end: End, call: Option<&str>, ended: &Ended, after: &Files) -> Option<String> {
        if ended.wrong.is_some() {
            return ended.wrong.clone();
        }
        if ended.err.contains("panicked") {
            return Some("it panicked".to_owned());
        }
        let code = ended.code;
        // A finding has the exit code that it has without the fault.
        let is_reported = self.program.code == 1 && ended.err.contains("could not be written");
        // A run may have fewer calls than the one before.
        if call.is_none() || code == Some(self.program.code) && end != End::Kill && !is_reported {
            let lost = end == End::Lost && call.is_some_and(|call| self.is_output(call));
            return match self.is_complete(after) {
                true if !lost => None,
                true => Some("the failure was not reported".to_owned()),
                // The program could not remove what it had to.
                false if call.is_some_and(|call| self.is_scratch(call)) => self.unfinished(after),
                false => Some("success without complete output".to_owned()),
            };
        }
        match end {
            End::Kill => return self.unfinished(after),
            End::Success => return Some("it did not recover".to_owned()),
            End::Interrupt if code != Some(130) => {
                return Some("not the exit code of an interrupt".to_owned());
            }
            End::Refusal | End::Lost
                if !code.is_some_and(|code| self.program.refusals.contains(&code)) =>
            {
                return Some("not a documented exit code".to_owned());
            }
            _ => {}
        }
        // A signal at the last call, when everything was done.
        if end == End::Interrupt && self.is_complete(after) {
            return None;
        }
        let remains = match self.program.leaves {
            Leaves::Files => self.unfinished(after),
            _ if call.is_some_and(|call| self.is_scratch(call)) => self.unfinished(after),
            _ => self.remains(after),
        };
        remains.or_else(|| self.unexplained(&ended.err))
    }

    /// Whether a call lists or opens a temporary directory, which can then not be removed.
    fn is_scratch(&self, call: &str) -> bool {
        let (class, path) = call.split_once(' ').unwrap_or_default();
        let path = Path::new(path.trim_end());
        let name = path.strip_prefix(self.place.path()).unwrap_or(path);
        let is_temporary = name.starts_with(TMP) || name.to_string_lossy().contains(".tmp");
        ["list", "open"].contains(&class) && (is_temporary || self.program.leaves == Leaves::Files)
    }

    /// Whether a call was made for the output: its file, or a temporary one beside it.
    fn is_output(&self, call: &str) -> bool {
        let mut words = call.split(' ');
        let class = words.next();
        let path = Path::new(words.next().unwrap_or_default());
        let name = path.strip_prefix(self.place.path()).unwrap_or(path);
        let is_temporary = name.to_string_lossy().contains(".tmp") && !name.starts_with(TMP);
        // Status files serve the diagnosis of hangs.
        let is_status = name.components().any(|part| part.as_os_str() == "status");
        class != Some("mkdir")
            && !is_status
            && (self.program.output_of(name).is_some() || is_temporary)
    }

    /// Whether all output is as without a fault.
    fn is_complete(&self, after: &Files) -> bool {
        after.keys().eq(self.complete.keys())
            && after.keys().all(|path| self.is_as(&self.complete, after, path))
    }

    /// Whether a path has the same contents in two states, as far as they do not vary.
    fn is_as(&self, expected: &Files, after: &Files, path: &Path) -> bool {
        let varies = self.program.varying.iter().any(|output| path.starts_with(output));
        match (expected.get(path), after.get(path)) {
            (Some(Some(old)), Some(Some(new))) if varies => old == new || is_whole(path, new),
            (one, other) => one == other,
        }
    }

    /// An output that is neither as before nor complete, or something else that was left.
    fn remains(&self, after: &Files) -> Option<String> {
        let paths: BTreeSet<_> =
            self.before.keys().chain(after.keys()).chain(self.complete.keys()).collect();
        let is_all = |state: &Files, output: Option<&str>| {
            let same = |path: &&std::path::PathBuf| self.program.output_of(path) == output;
            paths.iter().copied().filter(same).all(|path| self.is_as(state, after, path))
        };
        // Directories that contain the output stay.
        let is_parent = |path: &Path| {
            let outputs = self.program.outputs.iter();
            after.get(path) == Some(&None)
                && outputs.into_iter().any(|output| Path::new(output).starts_with(path))
        };
        if let Some(path) = paths.iter().find(|path| {
            self.program.output_of(path).is_none()
                && !self.is_as(&self.before, after, path)
                && !is_parent(path)
        }) {
            return Some(format!("{} was left or changed", path.display()));
        }
        let is_lost = |output: &str| {
            self.program.leaves == Leaves::NoOutput
                && !after.keys().any(|path| path.starts_with(output))
        };
        let mut outputs = self.program.outputs.iter();
        let broken = outputs.find(|output| {
            !is_lost(output)
                && !is_all(&self.before, Some(output))
                && !is_all(&self.complete, Some(output))
        });
        broken.map(|output| format!("{output} is unfinished"))
    }

    /// A file with its final name that is neither as before nor complete.
    fn unfinished(&self, after: &Files) -> Option<String> {
        let is_temporary = |path: &Path| {
            let name = path.to_string_lossy();
            // The files of a case that fails are kept.
            let is_kept = self.program.leaves == Leaves::Files && path.components().count() > 2;
            is_kept || path.starts_with(TMP) || name.contains(".tmp") || name.ends_with(".draft")
        };
        let broken = after.keys().filter(|path| after[*path].is_some()).find(|path| {
            !is_temporary(path)
                && !self.is_as(&self.before, after, path)
                && !self.is_as(&self.complete, after, path)
        });
        broken.map(|path| format!("{} is unfinished", path.display()))
    }

    /// What is wrong with the message, of which there must be one.
    fn unexplained(&self, err: &str) -> Option<String> {
        let prefix = self.program.prefix?;
        let ours = err.lines().filter(|line| line.starts_with(prefix)).count();
        let others = err.lines().count() - ours;
        match ours {
            1 if others == 0 || self.program.is_parallel() => None,
            _ => Some(format!("{ours} sentences and {others} other lines instead of one sentence")),
        }
    }

    /// What is there after a run.
    fn left(&self, after: &Files) -> &'static str {
        match () {
            () if self.is_complete(after) => "all output",
            () if self.remains(after).is_none() => "nothing unfinished",
            () if self.unfinished(after).is_none() => "temporary files",
            () => "unfinished files",
        }
    }
}

/// Whether a file whose contents vary is as long as it has to be.
fn is_whole(path: &Path, contents: &[u8]) -> bool {
    match path.extension().and_then(|e| e.to_str()) {
        Some("json") => serde_json::from_slice::<serde_json::Value>(contents).is_ok(),
        Some("xml") => {
            contents.ends_with(b"</testsuites>\n") || contents.ends_with(b"</testsuites>")
        }
        _ => contents.ends_with(b"\n"),
    }
}
