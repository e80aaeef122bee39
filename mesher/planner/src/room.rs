//! The memory that this process may still take: the limit on its address space, those of its control groups, and what the
//! machine has available.

use bytemuck::{Pod, Zeroable};
use std::fs::read_to_string;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

/// What limits memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// The limit on the address space of each process (`ulimit -v`, RLIMIT_AS).
    AddressSpace,
    /// The memory limit of a control group (a container, a job of a batch system).
    ControlGroup,
    /// The memory that the machine has available.
    Machine,
}

/// The memory of this process and what it may take beyond, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Room {
    /// Resident memory.
    pub resident: f64,
    /// Bytes that the limit on the address space leaves; infinite without one.
    pub address_space: f64,
    /// Bytes that the control groups leave to all their processes; infinite without a limit.
    pub control_group: f64,
    /// Bytes that the machine has available for all processes; infinite where it does not report them.
    pub machine: f64,
    /// A digest that machines differ in.
    pub node: u64,
}

impl Room {
    /// Reads the limits from the system. What cannot be read is no limit.
    pub fn read() -> Self {
        let [size, resident] = pages();
        Self {
            resident,
            address_space: (address_space_max() - size).max(0.0),
            control_group: control_group(Path::new("/sys/fs/cgroup")),
            machine: available(&read_to_string("/proc/meminfo").unwrap_or_default()),
            node: node(),
        }
    }
}

/// The size of this process's address space and its resident memory, in bytes; zeros where the system does not report them.
fn pages() -> [f64; 2] {
    let statm = read_to_string("/proc/self/statm").unwrap_or_default();
    let mut pages = statm.split_whitespace().map_while(|n| n.parse::<f64>().ok());
    // SAFETY: the call reads a constant of the system.
    let bytes = unsafe { libc::sysconf(libc::_SC_PAGESIZE) } as f64;
    [(); 2].map(|()| pages.next().unwrap_or(0.0) * bytes)
}

fn address_space_max() -> f64 {
    let mut limit = libc::rlimit { rlim_cur: libc::RLIM_INFINITY, rlim_max: libc::RLIM_INFINITY };
    // SAFETY: the call only writes `limit`.
    let is_read = unsafe { libc::getrlimit(libc::RLIMIT_AS, &mut limit) } == 0;
    match limit.rlim_cur {
        bytes if is_read && bytes != libc::RLIM_INFINITY => bytes as f64,
        _ => f64::INFINITY,
    }
}

fn available(meminfo: &str) -> f64 {
    let line = meminfo.lines().find_map(|l| l.strip_prefix("MemAvailable:"));
    let kib = line.and_then(|l| l.split_whitespace().next()?.parse::<f64>().ok());
    kib.map_or(f64::INFINITY, |kib| kib * 1024.0)
}

/// The least that the groups of this process leave, from its own group to the root of the hierarchy below `mount`.
fn control_group(mount: &Path) -> f64 {
    let groups = read_to_string("/proc/self/cgroup").unwrap_or_default();
    let of_line = |line: &str| {
        let mut fields = line.splitn(3, ':').skip(1);
        let (controllers, path) = (fields.next()?, fields.next()?);
        let mount = match controllers {
            "" => mount.to_owned(),
            c if c.split(',').any(|c| c == "memory") => mount.join("memory"),
            _ => return None,
        };
        Some(within(&mount, path))
    };
    groups.lines().filter_map(of_line).fold(f64::INFINITY, f64::min)
}

/// The least that a group and those above it leave. Inside a container a group's path may be that outside: then only the mount's
/// own files exist.
fn within(mount: &Path, path: &str) -> f64 {
    let own: PathBuf = mount.join(path.trim_start_matches('/'));
    let folders = own.ancestors().take_while(|folder| folder.starts_with(mount));
    folders.map(left).fold(f64::INFINITY, f64::min)
}

/// What one group leaves: version 2 or 1. The cache of files gives way to other memory.
fn left(folder: &Path) -> f64 {
    let number = |name: &str| {
        read_to_string(folder.join(name)).ok().and_then(|n| n.trim().parse::<f64>().ok())
    };
    let stat = read_to_string(folder.join("memory.stat")).unwrap_or_default();
    let cache = |name: &str| {
        let line = stat.lines().find_map(|l| l.strip_prefix(name)?.strip_prefix(' '));
        line.and_then(|n| n.trim().parse::<f64>().ok())
    };
    let max = number("memory.max").or_else(|| number("memory.limit_in_bytes"));
    let used = number("memory.current").or_else(|| number("memory.usage_in_bytes"));
    let cached = cache("file").or_else(|| cache("total_cache")).unwrap_or(0.0);
    let left = |max: f64| (max - (used.unwrap_or(0.0) - cached).max(0.0)).max(0.0);
    // "max" in version 2 and almost 2^63 in version 1 mean no limit.
    max.filter(|max| *max < 2f64.powi(60)).map_or(f64::INFINITY, left)
}

fn node() -> u64 {
    let mut hasher = DefaultHasher::new();
    read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default().hash(&mut hasher);
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn group(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        folder
    }

    #[test]
    fn both_versions_of_control_groups_are_read_and_the_tightest_group_counts() {
        let two = [
            ("memory.max", "max\n"),
            ("a/memory.max", "1000\n"),
            ("a/memory.current", "700\n"),
            ("a/memory.stat", "anon 100\nfile 600\n"),
            ("a/b/memory.max", "5000\n"),
        ];
        let folder = group(&two);
        assert_eq!(within(folder.path(), "/a/b"), 900.0);
        assert_eq!(within(folder.path(), "/of/the/host"), f64::INFINITY);
        let one = [
            ("memory.limit_in_bytes", "9223372036854771712\n"),
            ("a/memory.limit_in_bytes", "1000\n"),
            ("a/memory.usage_in_bytes", "700\n"),
            ("a/memory.stat", "cache 1\ntotal_cache 100\n"),
        ];
        let folder = group(&one);
        assert_eq!(
            [within(folder.path(), "/"), within(folder.path(), "/a")],
            [f64::INFINITY, 400.0]
        );
    }

    #[test]
    fn this_machine_has_memory() {
        let room = Room::read();
        assert_eq!(available("MemTotal: 9 kB\nMemAvailable:   7 kB\n"), 7168.0);
        if cfg!(target_os = "linux") {
            assert!(room.resident > 1e5 && room.machine.is_finite(), "{room:?}");
        }
    }
}
