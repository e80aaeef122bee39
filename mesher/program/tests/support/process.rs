//! Runs the mesher's program in a temporary directory, within a time limit, and inspects output and files.
#![allow(dead_code, missing_docs)]

use serde_json::Value;
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Time after which a run hangs. No run takes a hundredth of it on an idle machine.
const LIMIT: Duration = Duration::from_secs(600);

/// The program under test.
pub const MESHER: &str = env!("CARGO_BIN_EXE_mesher");

/// The launcher of MPI jobs.
const MPIRUN: &str = "mpirun";

/// Exit code and output of a run. The code is none if a signal ended it.
#[derive(Debug)]
pub struct Finished {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

/// A directory to run in.
pub struct Workspace(TempDir);

impl Workspace {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary directory"))
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// Writes a file in the directory.
    pub fn write(&self, name: &str, contents: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path().join(name);
        std::fs::write(&path, contents).expect("the workspace is writable");
        path
    }

    /// A command that runs the mesher in the directory.
    pub fn mesher(&self, args: &[&str]) -> Command {
        let mut command = Command::new(MESHER);
        command.args(args);
        self.enter(command)
    }

    /// A command that runs in the directory, outside any MPI job that runs this test.
    pub fn enter(&self, mut command: Command) -> Command {
        command.current_dir(self.path());
        for v in
            ["OMPI_COMM_WORLD_SIZE", "MV2_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_SIZE", "PMIX_RANK"]
        {
            command.env_remove(v);
        }
        command.env_remove("SLURM_STEP_NUM_TASKS").env_remove("MPI_LOCALNRANKS");
        command
    }

    /// A command that runs the mesher on real MPI ranks in the directory.
    pub fn mpirun(&self, ranks: usize, args: &[&str]) -> Command {
        self.mpirun_of(ranks, MESHER, args)
    }

    /// The same of any program.
    pub fn mpirun_of(&self, ranks: usize, program: &str, args: &[&str]) -> Command {
        let mut command = Command::new(MPIRUN);
        command.args(["-n", &ranks.to_string(), program]).args(args);
        self.as_mpi(command)
    }

    /// A command that starts an MPI job in the directory.
    pub fn as_mpi(&self, command: Command) -> Command {
        let mut command = self.enter(command);
        for v in ["ALLOW_RUN_AS_ROOT", "ALLOW_RUN_AS_ROOT_CONFIRM", "MCA_rmaps_base_oversubscribe"]
        {
            command.env(format!("OMPI_{v}"), "1");
        }
        command
    }

    /// A JSON file in the directory.
    pub fn json(&self, name: &str) -> Value {
        read_json(&self.path().join(name))
    }

    /// The paths in the directory, with the contents of files and none for directories.
    pub fn contents(&self) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
        let mut found = BTreeMap::new();
        let mut open = vec![self.path().to_owned()];
        while let Some(folder) = open.pop() {
            for entry in std::fs::read_dir(&folder).expect("a readable directory") {
                let path = entry.expect("a readable entry").path();
                if path.is_dir() {
                    open.push(path.clone());
                    found.insert(path, None);
                } else {
                    let bytes = path.is_file().then(|| std::fs::read(&path).expect("a file"));
                    found.insert(path, bytes);
                }
            }
        }
        found
    }
}

/// Reads a JSON file.
pub fn read_json(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).expect("the file exists");
    serde_json::from_str(&text).expect("the file is JSON")
}

/// Starts a command and captures its output.
///
/// # Panics
/// If the program is not installed.
pub fn start(mut command: Command) -> Running {
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let program = command.get_program().to_owned();
    let mut child =
        command.spawn().unwrap_or_else(|e| panic!("{program:?} cannot be started: {e}"));
    let stdout = drain(child.stdout.take().expect("a pipe"));
    let stderr = drain(child.stderr.take().expect("a pipe"));
    Running { child, stdout, stderr, since: Instant::now() }
}

type Drained = std::thread::JoinHandle<Vec<u8>>;

fn drain(mut from: impl Read + Send + 'static) -> Drained {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        let _ = from.read_to_end(&mut bytes);
        bytes
    })
}

/// A running command.
pub struct Running {
    child: Child,
    stdout: Drained,
    stderr: Drained,
    since: Instant,
}

impl Running {
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    pub fn is_over(&mut self) -> bool {
        self.child.try_wait().expect("a child can be waited for").is_some()
    }

    /// Waits until the run, or a rank of the job, has stopped at the point that `STOP_AT` names; returns its process.
    ///
    /// # Panics
    /// If the run ends without that.
    pub fn stopped(&mut self) -> u32 {
        loop {
            let mut all = children(self.id());
            all.push(self.id());
            if let Some(stopped) = all.into_iter().find(|&id| state(id) == Some('T')) {
                return stopped;
            }
            assert!(!self.is_over(), "the run ended before it stopped");
            assert!(self.since.elapsed() < LIMIT, "the run does not stop");
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Waits for the end. Kills a run that exceeds the time limit, and fails the test.
    pub fn finish(mut self) -> Finished {
        while !self.is_over() {
            if self.since.elapsed() > LIMIT {
                let _ = self.child.kill();
                let _ = self.child.wait();
                panic!("a run hangs");
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        let text = |d: Drained| {
            String::from_utf8_lossy(&d.join().expect("a reader of output")).into_owned()
        };
        let code = self.child.wait().expect("a child can be waited for").code();
        Finished { code, stdout: text(self.stdout), stderr: text(self.stderr) }
    }
}

/// Sends signals to a process, which may have ended, and lets it continue if it has stopped.
pub fn signal(names: &[&str], id: u32) {
    for name in names.iter().chain(&["CONT"]) {
        let sent = Command::new("kill").args(["-s", name, &id.to_string()]).output();
        sent.expect("kill is installed");
    }
}

/// The processes that a process has started.
pub fn children(id: u32) -> Vec<u32> {
    let text = std::fs::read_to_string(format!("/proc/{id}/task/{id}/children"));
    text.unwrap_or_default().split_whitespace().filter_map(|id| id.parse().ok()).collect()
}

/// Waits until none of the processes runs; they may be zombies.
pub fn wait_for_end(processes: &[u32]) {
    let since = Instant::now();
    while processes.iter().any(|&id| !matches!(state(id), None | Some('Z' | 'X'))) {
        assert!(since.elapsed() < LIMIT, "a process runs on");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// The state of a process: `T` if it has stopped.
fn state(id: u32) -> Option<char> {
    let stat = std::fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
    stat.rsplit_once(") ")?.1.chars().next()
}

/// Runs a command to its end.
pub fn run(command: Command) -> Finished {
    start(command).finish()
}

impl Finished {
    /// Asserts the exit code, and that the only output is one sentence on standard error with all of `words`.
    #[track_caller]
    pub fn refuses(&self, code: i32, words: &[&str]) {
        assert_eq!(self.code, Some(code), "{self:?}");
        assert_eq!(self.stdout, "", "{self:?}");
        let lines: Vec<&str> = self.stderr.lines().collect();
        assert_eq!(lines.len(), 1, "exactly one sentence must be printed: {self:?}");
        self.explains(lines[0], words);
    }

    /// The same for a run under a launcher, which may print lines as well: exactly one line is the mesher's.
    #[track_caller]
    pub fn refuses_under_launcher(&self, code: i32, words: &[&str]) {
        assert_eq!(self.code, Some(code), "{self:?}");
        let ours: Vec<&str> = self.stderr.lines().filter(|l| l.starts_with("mesher: ")).collect();
        assert_eq!(ours.len(), 1, "one rank must print one sentence: {self:?}");
        self.explains(ours[0], words);
    }

    /// The same for an error that every rank may print.
    #[track_caller]
    pub fn refuses_any_under_launcher(&self, code: i32, word: &str) {
        assert_eq!(self.code, Some(code), "{self:?}");
        let ours = self.stderr.lines().find(|l| l.starts_with("mesher: ") && l.contains(word));
        assert!(ours.is_some(), "{word:?} is missing: {self:?}");
    }

    #[track_caller]
    fn explains(&self, line: &str, words: &[&str]) {
        assert!(line.starts_with("mesher: ") && line.len() > 15, "{self:?}");
        assert!(!self.stderr.contains("panicked"), "{self:?}");
        for word in words {
            assert!(line.contains(word), "{word:?} is missing: {self:?}");
        }
    }

    /// Asserts exit code 0 and no message on standard error.
    #[track_caller]
    pub fn succeeds(&self) {
        assert_eq!((self.code, self.stderr.as_str()), (Some(0), ""), "{self:?}");
    }
}

/// Reports, even if the test's output is captured, that a part of a test was skipped.
pub fn skip(what: &str, why: &str) {
    let _ = writeln!(std::io::stderr(), "skipped: {what}: {why}");
}

/// A binary STL of these facets.
pub fn binary_stl(facets: &[geometries::Facet]) -> Vec<u8> {
    let mut bytes = Vec::new();
    geometries::write_stl_binary(facets, &mut bytes).expect("memory can be written to");
    bytes
}

/// Exit code of unusable input.
pub const INPUT: i32 = 2;
/// Exit code of output that could not be written.
pub const OUTPUT: i32 = 4;

/// A body that can be meshed.
pub fn tetrahedron() -> Vec<u8> {
    let v = [[0.0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    binary_stl(&[[v[0], v[2], v[1]], [v[0], v[1], v[3]], [v[0], v[3], v[2]], [v[1], v[2], v[3]]])
}

/// One rank, and several.
pub const COMMS: [&str; 2] = ["--comm=solo", "--comm=sim:3:7"];

/// Runs the mesher with `args` and output options, and asserts that it refuses and leaves no files.
#[track_caller]
pub fn refused(workspace: &Workspace, args: &[&str], code: i32, words: &[&str]) {
    for comm in COMMS {
        let before = workspace.contents();
        let mut all = args.to_vec();
        if !args.iter().any(|a| a.starts_with("--out")) {
            all.extend(["--out", "mesh"]);
        }
        if !args.iter().any(|a| a.starts_with("--json")) {
            all.extend(["--json", "run.json"]);
        }
        all.push(comm);
        run(workspace.mesher(&all)).refuses(code, words);
        let (before, after) = (before.keys(), workspace.contents());
        assert!(before.eq(after.keys()), "{args:?} {comm} left files: {:?}", after.keys());
    }
}
