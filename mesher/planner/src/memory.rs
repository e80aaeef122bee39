//! The memory of all ranks and the limits that they share: a process has an address space, and the ranks of one machine divide its
//! memory and that of their control group (a container, a job of a batch system).

use crate::pilot::Amounts;
use bytemuck::{Pod, Zeroable};
use mesher::record::{peak_rss_bytes, stated_bytes};
use ranks::{Comm, gather};
use rustix::process::{Resource, getrlimit};
use serde::Serialize;
use std::collections::HashMap;
use std::fs::{metadata, read_to_string};
use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher};
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Where the system shows the control groups of all processes, or of a container.
const CONTROL_GROUPS: &str = "/sys/fs/cgroup";

/// Bytes of the holes that sets leave which grow in the heap: this part of the sets, as long as they are smaller than the blocks that get
/// mappings of their own; and bytes at most.
const HOLES: [f64; 2] = [0.3, 5e6];

/// All ranks after a pilot run.
pub struct Ranks {
    all: Vec<Rank>,
    /// Number of ranks in each process.
    in_process: f64,
}

/// A rank's amounts, and the memory of its process in bytes. What cannot be read is no limit: infinite.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct Rank {
    amounts: Amounts,
    /// Resident memory now, and at most so far.
    resident: f64,
    peak: f64,
    /// What the limit on the address space of the process leaves.
    address_space: f64,
    /// What the control groups leave to all their processes.
    control_group: f64,
    /// What the machine has available for all processes.
    machine: f64,
    /// Digests that machines differ in, and the control groups which processes see as the root of all.
    shared: [u64; 2],
}

/// The limit that a run comes closest to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tightest {
    /// Its name.
    pub limit: &'static str,
    /// Bytes that it leaves: to a process if it limits the address space or the data, otherwise to the ranks of one machine or of one container in it.
    pub left_bytes: u64,
    /// Bytes that these would take beyond what they have.
    pub needed_bytes: u64,
}

/// What the limits on its address space and its data leave this process, in bytes; infinity without a limit.
pub fn address_space_left() -> f64 {
    let left = |(limit, used)| {
        let used = stated_bytes("/proc/self/status", used).unwrap_or(0) as f64;
        getrlimit(limit).current.map_or(f64::INFINITY, |bytes| (bytes as f64 - used).max(0.0))
    };
    f64::min(left((Resource::As, "VmSize:")), left((Resource::Data, "VmData:")))
}

/// The least that the groups of this process leave, from its own group to the root of the hierarchy below `mount`. Inside a container
/// a group's path may be that outside: then only the mount's own files exist.
fn control_group(groups: &str, mount: &Path) -> f64 {
    let of_line = |line: &str| {
        let mut fields = line.splitn(3, ':').skip(1);
        let (controllers, path) = (fields.next()?, fields.next()?);
        let mount = match controllers {
            "" => mount.to_owned(),
            c if c.split(',').any(|c| c == "memory") => mount.join("memory"),
            _ => return None,
        };
        let own = mount.join(path.trim_start_matches('/'));
        let folders = own.ancestors().take_while(|folder| folder.starts_with(&mount));
        Some(folders.map(left).fold(f64::INFINITY, f64::min))
    };
    groups.lines().filter_map(of_line).fold(f64::INFINITY, f64::min)
}

/// What one group leaves: version 1 or 2. The cache of files gives way to other memory, but for memory that processes share and files that
/// are in memory alone, which both versions count as cache.
fn left(folder: &Path) -> f64 {
    let text = |name: &str| read_to_string(folder.join(name)).unwrap_or_default();
    let number = |of: [&str; 2]| of.iter().find_map(|name| text(name).trim().parse::<f64>().ok());
    let stat = text("memory.stat");
    let of_line = |name: &str| stat.lines().find_map(|l| l.strip_prefix(name)?.parse::<f64>().ok());
    let bytes = |names: [&str; 2]| names.into_iter().find_map(of_line).unwrap_or(0.0);
    let used = number(["memory.current", "memory.usage_in_bytes"]).unwrap_or(0.0);
    let cached = bytes(["total_cache ", "file "]) - bytes(["total_shmem ", "shmem "]);
    // "max" in version 2 and almost 2^63 in version 1 mean no limit.
    let max = number(["memory.max", "memory.limit_in_bytes"]).filter(|max| *max < 2f64.powi(60));
    max.map_or(f64::INFINITY, |max| (max - (used - cached).max(0.0)).max(0.0))
}

impl Ranks {
    /// Gathers the amounts and limits of all ranks. Collective.
    pub fn gather(comm: &dyn Comm, amounts: Amounts) -> Self {
        let text = |path: &str| read_to_string(path).unwrap_or_default();
        let boot = text("/proc/sys/kernel/random/boot_id");
        let digest = |group| BuildHasherDefault::<DefaultHasher>::new().hash_one((&boot, group));
        // The root that a container sees is the group of the container.
        let group = metadata(CONTROL_GROUPS).map_or((1, 1), |root| (root.dev(), root.ino()));
        let available = stated_bytes("/proc/meminfo", "MemAvailable:");
        let mine = Rank {
            amounts,
            resident: stated_bytes("/proc/self/status", "VmRSS:").unwrap_or(0) as f64,
            peak: peak_rss_bytes() as f64,
            address_space: address_space_left(),
            control_group: control_group(&text("/proc/self/cgroup"), Path::new(CONTROL_GROUPS)),
            machine: available.map_or(f64::INFINITY, |bytes| bytes as f64),
            shared: [(0, 0), group].map(digest),
        };
        Self { all: gather(comm, &[mine]), in_process: comm.ranks_in_process() as f64 }
    }

    /// The amounts of all ranks together.
    pub fn total(&self) -> Amounts {
        Amounts::sum(self.all.iter().map(|rank| rank.amounts))
    }

    /// Bytes that each rank takes beyond what it has, for a mesh that takes `amounts` on all ranks.
    pub fn growth(&self, amounts: &Amounts) -> Vec<f64> {
        let factor = amounts.bytes() / self.total().bytes().max(1.0) - 1.0;
        let sets = self.all.iter().map(|rank| (rank.amounts.bytes() * factor).max(0.0));
        sets.map(|sets| sets + (HOLES[0] * sets).min(HOLES[1])).collect()
    }

    /// Peak resident memory of each rank, if each takes as many bytes as given beyond what it has. Ranks of one process have equal
    /// parts of it.
    pub fn peaks(&self, more: &[f64]) -> Vec<u64> {
        let n = self.in_process;
        let peak = |(rank, more): (&Rank, &f64)| rank.peak.max(rank.resident + more * n) / n;
        self.all.iter().zip(more).map(|pair| peak(pair) as u64).collect()
    }

    /// The limit that the ranks come closest to, if each takes as many bytes as given beyond what it has.
    pub fn tightest(&self, more: &[f64]) -> Option<Tightest> {
        let (mut needs, mut all) = (HashMap::new(), Vec::new());
        for (rank, own) in self.all.iter().zip(more) {
            rank.shared.iter().for_each(|by| *needs.entry(by).or_insert(0.0) += own);
        }
        for (rank, own) in self.all.iter().zip(more) {
            all.push(("address space or data", rank.address_space, own * self.in_process));
            all.push(("control group", rank.control_group, needs[&rank.shared[1]]));
            all.push(("machine", rank.machine, needs[&rank.shared[0]]));
        }
        let part = |(_, left, needed): &(&str, f64, f64)| needed / left.max(1.0);
        let limited = all.into_iter().filter(|(_, left, _)| left.is_finite());
        let (limit, left, needed) = limited.max_by(|a, b| part(a).total_cmp(&part(b)))?;
        Some(Tightest { limit, left_bytes: left as u64, needed_bytes: needed as u64 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::array;

    fn rank(node: u64, address_space: f64, machine: f64) -> Rank {
        let amounts = Amounts { bytes_sides: 10.0, ..Amounts::default() };
        let control_group = f64::INFINITY;
        let shared = [node, 10 + node];
        Rank { amounts, resident: 50.0, peak: 70.0, address_space, control_group, machine, shared }
    }

    #[test]
    fn ranks_of_one_machine_divide_its_memory() {
        let all = vec![rank(1, 900.0, 100.0), rank(2, 900.0, 1000.0), rank(1, 900.0, 100.0)];
        let ranks = Ranks { all, in_process: 1.0 };
        let tightest = ranks.tightest(&[40.0, 500.0, 50.0]).unwrap();
        assert_eq!((tightest.limit, tightest.needed_bytes), ("machine", 90));
        let tightest = ranks.tightest(&[0.0, 850.0, 0.0]).unwrap();
        assert_eq!((tightest.limit, tightest.left_bytes), ("address space or data", 900));
        assert_eq!(ranks.peaks(&[5.0, 50.0, 500.0]), [70, 100, 550]);
        let three_times = Amounts { bytes_sides: 90.0, ..Amounts::default() };
        assert_eq!(ranks.growth(&three_times), [26.0; 3]);
    }

    #[test]
    fn ranks_of_one_process_have_one_address_space() {
        let all = vec![rank(1, 100.0, f64::INFINITY), rank(1, 100.0, f64::INFINITY)];
        let ranks = Ranks { all, in_process: 2.0 };
        assert_eq!(ranks.tightest(&[60.0, 60.0]).unwrap().needed_bytes, 120);
        assert_eq!(ranks.peaks(&[60.0, 60.0]), [85, 85]);
    }

    #[test]
    fn sets_grow_with_holes() {
        let growth = |has: f64, needs: f64| {
            let amounts = Amounts { bytes_graded: has, ..Amounts::default() };
            let ranks = Ranks { all: vec![Rank { amounts, ..rank(1, 0.0, 0.0) }], in_process: 1.0 };
            ranks.growth(&Amounts { bytes_sides: needs, ..Amounts::default() })
        };
        assert_eq!(growth(1e6, 2e6), [1.3e6]);
        assert_eq!(growth(1e6, 101e6), [1e8 + 5e6]);
        assert_eq!(growth(1e6, 0.5e6), [0.0]);
        assert_eq!(growth(0.5, 3.0), [1.3], "less than a byte counts as one");
    }

    #[test]
    fn ranks_gather_what_each_one_has() {
        ranks::sim::run(3, 1, |comm| {
            let amounts = |rank: usize| {
                let part = |i: usize| (100 * rank + i) as f64;
                bytemuck::cast(array::from_fn::<f64, { crate::pilot::AMOUNTS }, _>(part))
            };
            let ranks = Ranks::gather(comm, amounts(comm.rank()));
            assert_eq!((ranks.all.len(), ranks.in_process), (3, 3.0));
            let found: Vec<Amounts> = ranks.all.iter().map(|rank| rank.amounts).collect();
            assert_eq!(found, [0, 1, 2].map(amounts));
            assert_eq!(ranks.total().cells_boxed_deleted, 303.0);
            for rank in &ranks.all {
                assert_eq!(rank.shared, ranks.all[0].shared);
                assert_ne!(rank.shared[0], rank.shared[1]);
                assert!([rank.resident, rank.peak].iter().all(|b| (1e5..1e11).contains(b)));
            }
        });
    }

    #[test]
    fn a_limit_that_leaves_nothing_is_the_tightest() {
        let mut one = rank(1, 900.0, 1000.0);
        one.control_group = 0.0;
        let tightest = Ranks { all: vec![one], in_process: 1.0 }.tightest(&[2.0]).unwrap();
        let expected = Tightest { limit: "control group", left_bytes: 0, needed_bytes: 2 };
        assert_eq!(tightest, expected);
    }

    #[test]
    fn containers_of_one_machine_have_limits_of_their_own() {
        let of_container = |group: u64| {
            let shared = [1, group];
            Rank { control_group: 4.0, shared, ..rank(1, 900.0, 100.0) }
        };
        let tightest = |groups: [u64; 2]| {
            let all = groups.map(of_container).to_vec();
            let Tightest { limit, needed_bytes, .. } =
                Ranks { all, in_process: 1.0 }.tightest(&[3.0, 3.0]).unwrap();
            (limit, needed_bytes)
        };
        assert_eq!(tightest([7, 8]), ("control group", 3));
        assert_eq!(tightest([7, 7]), ("control group", 6));
    }

    #[test]
    fn both_versions_of_control_groups_are_read_and_the_tightest_group_counts() {
        let left = |line: &str, files: &[(&str, &str)]| {
            let folder = tempfile::tempdir().unwrap();
            for (name, text) in files {
                let path = folder.path().join(name);
                std::fs::create_dir_all(path.parent().unwrap()).unwrap();
                std::fs::write(path, text).unwrap();
            }
            control_group(line, folder.path())
        };
        let two = [
            ("memory.max", "max\n"),
            ("a/memory.max", "1000\n"),
            ("a/memory.current", "700\n"),
            ("a/memory.stat", "anon 100\nfile 600\nshmem 150\n"),
            ("a/b/memory.max", "5000\n"),
        ];
        assert_eq!(left("0::/a/b\n", &two), 750.0);
        assert_eq!(left("0::/of/the/host\n", &two), f64::INFINITY);
        let one = [
            ("memory/memory.limit_in_bytes", "9223372036854771712\n"),
            ("memory/a/memory.limit_in_bytes", "1000\n"),
            ("memory/a/memory.usage_in_bytes", "700\n"),
            ("memory/a/memory.stat", "cache 1\nshmem 1\ntotal_cache 100\ntotal_shmem 30\n"),
        ];
        assert_eq!(left("5:cpu,memory:/\n3:cpuset:/a\n", &one), f64::INFINITY);
        assert_eq!(left("5:cpu,memory:/a\n", &one), 370.0);
    }

    #[test]
    fn memory_that_is_available_is_read() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(&file, "MemTotal: 9 kB\nMemAvailable:   7 kB\n").unwrap();
        let found = |file: &Path| stated_bytes(file.to_str().unwrap(), "MemAvailable:");
        assert_eq!((found(file.path()), found(Path::new("missing"))), (Some(7168), None));
        if cfg!(target_os = "linux") {
            let ranks = Ranks::gather(&ranks::Solo, Amounts::default());
            assert!(ranks.all[0].machine.is_finite());
        }
    }
}
