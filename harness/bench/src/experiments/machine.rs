//! The description of the machine that runs the measurements.

use super::entry::Machine;
use crate::git;
use contract::digest::mix;
use run::engine::process::printed;
use run::engine::runner::Engine;
use rustix::system::{sysinfo, uname};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{fmt, fs};

/// Describes this machine; `mpirun` is the launcher's program, `root` the place of the oracles and of `version`, as the harness prints it.
pub fn describe(mpirun: &Path, root: &Path, version: &str) -> Machine {
    Machine {
        cpu: cpu(&fs::read_to_string("/proc/cpuinfo").unwrap_or_default()),
        cores: cores(),
        memory_bytes: sysinfo().totalram * u64::from(sysinfo().mem_unit),
        kernel: format!("Linux {}", uname().release().to_string_lossy()),
        mpi: first_line(Command::new(mpirun).arg("--version")),
        compiler: first_line(Command::new("rustc").arg("--version")),
        commit: commit(root, version),
    }
}

/// The commit of the repository at `root`, else that of which the harness was built, or its version: git would also answer for a
/// repository around the place, such as that of a paper.
fn commit(root: &Path, version: &str) -> String {
    let is_ours = [".git", "harness/oracles/protocol.py"].iter().all(|of| root.join(of).exists());
    let describe = ["describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"];
    let built = || version.split(['(', ')']).nth(1).unwrap_or(version).to_owned();
    is_ours.then(|| git(root, &describe)).flatten().unwrap_or_else(built)
}

impl Machine {
    /// Returns what measurements depend on, which is neither compiler nor commit: programs have digests.
    pub fn label(&self) -> String {
        let Self { cpu, cores, memory_bytes, kernel, mpi, .. } = self;
        format!("{cpu}, {cores} cores, {} MiB, {kernel}, {mpi}", memory_bytes >> 20)
    }
}

impl fmt::Display for Machine {
    /// All that is known of it.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}, {}, commit {}", self.label(), self.compiler, self.commit)
    }
}

/// Returns the digest of a program's files, which names a build of it; empty if there are none, or one cannot be read.
pub fn digest_of(files: impl IntoIterator<Item = PathBuf>) -> String {
    let word = |chunk: &[u8]| chunk.iter().fold(1, |word, byte| word << 8 | u64::from(*byte));
    let step = |state: u128, chunk: &[u8]| mix(word(chunk) ^ state as u64) ^ state.rotate_left(64);
    let digest = files.into_iter().try_fold(None, |state: Option<u128>, file| {
        let bytes = fs::read(file).ok()?;
        Some(Some(bytes.chunks(7).fold(state.unwrap_or(0) ^ bytes.len() as u128, step)))
    });
    digest.flatten().map_or(String::new(), |digest| format!("{digest:032x}"))
}

/// Returns the digest of those of an engine's files that an archive has. Interpreters and installed programs differ between machines.
pub fn digest_of_scripts(engine: &Engine) -> String {
    digest_of(engine.files().into_iter().filter(|file| file.starts_with(&engine.description.here)))
}

/// Returns the number of cores that this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, |n| n.get())
}

/// Returns the names of the machines on which ranks run: those of Slurm's job, else of this one.
pub fn nodes() -> String {
    let own = |_| uname().nodename().to_string_lossy().into_owned();
    std::env::var("SLURM_JOB_NODELIST").unwrap_or_else(own)
}

/// Returns the number of runnable processes, averaged over the last minute, as /proc/loadavg has it.
pub fn load_average() -> f64 {
    // The kernel counts in units of 2^-16.
    (sysinfo().loads[0] as f64 / 65_536.0 * 100.0).round() / 100.0
}

fn cpu(cpuinfo: &str) -> String {
    let value = |key: &str| {
        let mut pairs = cpuinfo.lines().filter_map(|line| line.split_once(':'));
        pairs.find(|(name, _)| name.trim() == key).map(|(_, value)| value.trim())
    };
    // A virtual machine may hide the name; family and model still identify the generation.
    let name = value("model name").filter(|name| !name.eq_ignore_ascii_case("unknown"));
    let [family, model] = ["cpu family", "model"].map(|key| value(key).unwrap_or("?"));
    format!("{} (family {family}, model {model})", name.unwrap_or("unnamed"))
}

/// Returns the first line that a command prints; empty if it fails.
fn first_line(command: &mut Command) -> String {
    printed(command).unwrap_or_default().lines().next().unwrap_or_default().trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unnamed_processor_is_described_by_family_and_model() {
        let text = "processor\t: 0\ncpu family\t: 6\nmodel\t\t: 85\nmodel name\t: A Chip @ 2 GHz\n";
        assert_eq!(cpu(text), "A Chip @ 2 GHz (family 6, model 85)");
        assert_eq!(cpu(&text.replace("A Chip @ 2 GHz", "unknown")), "unnamed (family 6, model 85)");
    }

    #[test]
    fn a_program_that_differs_in_a_byte_or_in_its_order_has_another_digest() {
        let place = tempfile::tempdir().unwrap();
        let of = |bytes: &[u8]| {
            std::fs::write(place.path().join("p"), bytes).unwrap();
            digest_of([place.path().join("p")])
        };
        let some = [7u8; 40];
        let mut others = [some; 3];
        (others[1][33], others[2][1]) = (8, 8);
        let all = [&some[..], &others[1], &others[2], &some[..39], b""].map(of);
        assert_eq!(of(&some), all[0]);
        assert!((1..5).all(|i| !all[..i].contains(&all[i])), "{all:?}");
        assert_eq!(digest_of([PathBuf::from("no/such/program")]), "");
    }

    #[test]
    fn this_machine_is_described_even_without_a_launcher() {
        let machine = describe(Path::new("no-such-launcher"), Path::new("."), "0.1.0");
        assert!(machine.cores > 0 && machine.mpi.is_empty() && machine.memory_bytes > 1 << 20);
        let release = fs::read_to_string("/proc/sys/kernel/osrelease").unwrap();
        assert_eq!(machine.kernel, format!("Linux {}", release.trim()));
        assert!((0.0..1e4).contains(&load_average()));
    }

    /// A directory of this repository stands for one of a paper's.
    #[test]
    fn the_commit_is_not_that_of_a_repository_around_the_place() {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        let of = |version| commit(here, version);
        assert_eq!(["1.2.3 (0123abcd-dirty)", "1.2.3"].map(of), ["0123abcd-dirty", "1.2.3"]);
        let root = here.join("../..");
        assert_eq!(commit(&root, "1.2.3") == "1.2.3", !root.join(".git").exists());
    }
}
