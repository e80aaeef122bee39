//! A directory in which programs run, its contents, and runs that end in any case.

use std::collections::BTreeMap;
use std::fs;
use std::io::{Read, Seek};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Paths relative to the directory, with the contents of files and none for directories.
pub type Files = BTreeMap<PathBuf, Option<Vec<u8>>>;

/// Time after which a program hangs: far more than any takes, so that a slow machine fails no test.
pub const HANGS: Duration = Duration::from_secs(600);
/// Time for processes to end after the program that started them.
const AFTERWARDS: Duration = HANGS;
/// The directory of temporary files in a place.
pub const TMP: &str = "tmp";

/// How a run ended.
#[derive(Debug)]
pub struct Ended {
    /// Its exit code; none if a signal ended it.
    pub code: Option<i32>,
    /// Its standard output.
    pub out: String,
    /// Its standard error.
    pub err: String,
    /// Wall time in seconds.
    pub seconds: f64,
    /// What is wrong with its end, whatever else it had to do: it exceeded its limit, or processes remained.
    pub wrong: Option<String>,
}

/// Runs a job until it returns `false` beside its result, at most five times: whether ranks may have been killed before they had removed
/// their files. A launcher does that a second after it has asked them to end, which a busy machine may not notice by then.
pub fn in_time<T>(mut job: impl FnMut() -> (T, bool)) -> T {
    let mut attempts = (1..5).map(|_| job());
    let done = attempts.find(|(_, is_early)| !is_early);
    drop(attempts);
    done.unwrap_or_else(job).0
}

impl Ended {
    /// Whether the first rank has not said that it was interrupted, which it does when its files are removed.
    pub fn may_be_killed_early(&self) -> bool {
        !self.err.contains("mesher: ")
    }
}

/// A directory with files, and a directory beside it for what the programs do not see.
pub struct Place {
    root: PathBuf,
    _kept: TempDir,
}

impl Place {
    /// An empty directory.
    pub fn new() -> Self {
        let kept = tempfile::tempdir().unwrap();
        let root = fs::canonicalize(kept.path()).unwrap().join("place");
        fs::create_dir_all(root.join(TMP)).unwrap();
        Self { root, _kept: kept }
    }

    /// The directory.
    pub fn path(&self) -> &Path {
        &self.root
    }

    /// A path beside the directory.
    pub fn beside(&self, name: &str) -> PathBuf {
        self.root.with_file_name(name)
    }

    /// Writes a file and its parent directories.
    pub fn write(&self, name: &str, contents: impl AsRef<[u8]>) {
        let path = self.root.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, contents).unwrap();
    }

    /// Replaces all contents.
    pub fn reset(&self, files: &Files) {
        let now = self.files();
        for (path, _) in now.iter().rev().filter(|(path, old)| files.get(*path) != Some(*old)) {
            let path = self.root.join(path);
            if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) }.unwrap();
        }
        for (path, contents) in files.iter().filter(|(path, new)| now.get(*path) != Some(*new)) {
            match contents {
                None => fs::create_dir_all(self.root.join(path)).unwrap(),
                Some(bytes) => fs::write(self.root.join(path), bytes).unwrap(),
            }
        }
    }

    /// The contents.
    pub fn files(&self) -> Files {
        let mut found = Files::new();
        let mut open = vec![self.root.clone()];
        while let Some(folder) = open.pop() {
            for entry in fs::read_dir(&folder).unwrap() {
                let path = entry.unwrap().path();
                let name = path.strip_prefix(&self.root).unwrap().to_owned();
                let is_dir = path.is_dir() && !path.is_symlink();
                found.insert(name, (!is_dir).then(|| fs::read(&path).unwrap_or_default()));
                open.extend(is_dir.then_some(path));
            }
        }
        found
    }

    /// Runs a command in the directory. What exceeds the limit is killed.
    pub fn run(&self, mut command: Command, limit: Duration) -> Ended {
        let [mut out, mut err] = [(); 2].map(|()| tempfile::tempfile().unwrap());
        for name in ["OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "GITHUB_STEP_SUMMARY"] {
            command.env_remove(name);
        }
        command.current_dir(&self.root).stdin(Stdio::null()).process_group(0);
        command.stdout(out.try_clone().unwrap()).stderr(err.try_clone().unwrap());
        let start = Instant::now();
        let mut child = command.spawn().unwrap_or_else(|e| panic!("{command:?}: {e}"));
        let mut wrong = None;
        let status = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break status;
            }
            if wrong.is_none() && start.elapsed() > limit {
                wrong = Some(format!("did not end within {} s", limit.as_secs_f64()));
                self.kill_all();
            }
            sleep(Duration::from_millis(2));
        };
        let seconds = start.elapsed().as_secs_f64();
        let patience = Instant::now() + AFTERWARDS;
        while !self.processes().is_empty() && Instant::now() < patience {
            sleep(Duration::from_millis(2));
        }
        let left = self.processes();
        if !left.is_empty() {
            wrong.get_or_insert_with(|| format!("processes {left:?} remain"));
            self.kill_all();
        }
        let text = |file: &mut fs::File| {
            let mut bytes = Vec::new();
            file.rewind().unwrap();
            file.take(1 << 20).read_to_end(&mut bytes).unwrap();
            String::from_utf8_lossy(&bytes).into_owned()
        };
        Ended { code: status.code(), out: text(&mut out), err: text(&mut err), seconds, wrong }
    }

    /// The processes whose working directory is here.
    pub fn processes(&self) -> Vec<u32> {
        let ids = fs::read_dir("/proc").unwrap().flatten();
        let ids = ids.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
        ids.filter(|id| {
            fs::read_link(format!("/proc/{id}/cwd")).is_ok_and(|cwd| cwd.starts_with(&self.root))
        })
        .collect()
    }

    fn kill_all(&self) {
        for id in self.processes() {
            let _ = Command::new("kill").args(["-s", "KILL", &id.to_string()]).output();
        }
    }
}
