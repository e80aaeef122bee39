//! Ranks on two hosts with a network between them, which is cut while a rank has stopped itself at a point (`STOP_AT`). The hosts are network namespaces, joined by a pair of virtual
//! interfaces; a script in place of a remote shell starts OpenMPI's daemon in the second one.

use crate::place::{HANGS, Place, in_time};
use crate::tools::{is_full, mpi, mpirun, skip};
use crate::{Row, Table};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A mesh with all phases.
const CASE: &str = "spacing_min = 0.02\nlayer_cells_min = 6\nroot_scale = 2.0\nkeep = \"all\"\n
[generator]\nshape = \"sphere\"\nfacets = 5120\n";
/// Time for a job with a network that is cut: until the ranks notice, and then the launcher.
const LIMIT: Duration = HANGS;
/// What the launcher prints, on one of its streams.
const LOST: [&str; 2] = ["lost communication", "unable to complete a TCP connection"];
/// Addresses that no machine of the internet has.
const NETWORK: &str = "198.18.77.0/24";
const HOSTS: [&str; 2] = ["198.18.77.1", "198.18.77.2"];
/// The launcher notices a host that does not answer after three seconds, and not after many minutes: before the ranks do, because
/// a message of theirs that is under way would stop its watch.
const OPTIONS: &str = "--mca btl self,tcp --mca btl_tcp_if_include NETWORK --mca oob_tcp_if_include NETWORK \
    --mca oob_tcp_keepalive_time 1 --mca oob_tcp_keepalive_intvl 1 --mca oob_tcp_keepalive_probes 2";

/// The network is cut on either side, at several points.
pub fn family() {
    let mesher = match mpi() {
        Ok(mesher) => mesher,
        Err(why) => return skip("a network that is cut", &why),
    };
    let hosts = match Hosts::make() {
        Ok(hosts) => hosts,
        Err(why) => return skip("a network that is cut", &why),
    };
    let place = Place::new();
    place.write("case.toml", CASE);
    let before = place.files();
    let mut table = Table::new();

    let ended = place.run(hosts.job(&place, &mesher, "none"), LIMIT);
    let is_right = ended.code == Some(0) && place.path().join("out/mesh.json").exists();
    let mut row = Row::new("mesher on 2 hosts", "none");
    let wrong = ended.wrong.clone().or_else(|| (!is_right).then(|| format!("{ended:?}")));
    row.add(ended.code, ended.seconds, "all output", wrong);
    table.push(row);

    let phases = if is_full() { &["refine", "sides", "grade", "leaves"][..] } else { &["grade"] };
    for phase in phases {
        for host in if is_full() { &[0, 1][..] } else { &[1] } {
            let (is_cut, ended, left) = in_time(|| {
                place.reset(&before);
                (0..2).for_each(|host| hosts.link(host, "up"));
                let job = hosts.job(&place, &mesher, &format!("{phase}:{host}"));
                let (is_cut, ended) = std::thread::scope(|scope| {
                    let cut = scope.spawn(|| hosts.cut(&place, *host));
                    let mut ended = place.run(job, LIMIT);
                    // The daemon of the other host is not reached by the launcher, and ends when the test removes the host.
                    ended.wrong = ended.wrong.filter(|why| !why.starts_with("processes"));
                    (cut.join().unwrap(), ended)
                });
                let files = place.files().into_keys().filter(|path| path.starts_with("out"));
                let left: Vec<_> = files.collect();
                let is_early = !left.is_empty() && ended.may_be_killed_early();
                ((is_cut, ended, left), is_early)
            });
            let named = ended.err.lines().filter(|line| line.starts_with("mesher: ")).count();
            let wrong = match () {
                () if ended.wrong.is_some() => ended.wrong.clone(),
                () if !is_cut => Some("no rank stopped, so the network was not cut".to_owned()),
                () if ended.code.is_none_or(|code| code == 0) => Some("it succeeded".to_owned()),
                () if named == 0
                    && !LOST.iter().any(|lost| {
                        [&ended.err, &ended.out].iter().any(|text| text.contains(lost))
                    }) =>
                {
                    Some("no sentence names the host".to_owned())
                }
                () if !left.is_empty() => Some(format!("files were left: {left:?}")),
                () => None,
            };
            let what = format!("host {host} is cut off before {phase}");
            let mut row = Row::new("mesher on 2 hosts, --stall-limit 5", what);
            let left = if left.is_empty() { "nothing" } else { "files" };
            row.add(ended.code, ended.seconds, left, wrong.map(|why| format!("{why}: {ended:?}")));
            table.push(row);
        }
    }
    table.finish("a network that is cut");
}

/// Two network namespaces, which are removed when this is dropped.
struct Hosts {
    names: [String; 2],
    interfaces: [String; 2],
}

fn ip(arguments: &str) -> Result<String, String> {
    let output = Command::new("ip").args(arguments.split(' ')).output();
    let output = output.map_err(|e| format!("ip: {e}"))?;
    match output.status.success() {
        true => Ok(String::from_utf8_lossy(&output.stdout).into_owned()),
        false => Err(format!("ip {arguments}: {}", String::from_utf8_lossy(&output.stderr).trim())),
    }
}

impl Hosts {
    fn make() -> Result<Self, String> {
        let id = std::process::id();
        let hosts = Self {
            names: ["a", "b"].map(|host| format!("faults-{id}-{host}")),
            interfaces: ["a", "b"].map(|host| format!("f{id}{host}")),
        };
        let ([a, b], [x, y]) = (&hosts.names, &hosts.interfaces);
        for name in [a, b] {
            ip(&format!("netns add {name}"))?;
        }
        ip(&format!("link add {x} netns {a} type veth peer name {y} netns {b}"))?;
        for (i, address) in HOSTS.iter().enumerate() {
            let (name, interface) = (&hosts.names[i], &hosts.interfaces[i]);
            ip(&format!("-n {name} addr add {address}/24 dev {interface}"))?;
            ip(&format!("-n {name} link set lo up"))?;
            hosts.link(i, "up");
        }
        Ok(hosts)
    }

    /// Connects a host, or cuts it off.
    fn link(&self, host: usize, state: &str) {
        ip(&format!("-n {} link set {} {state}", self.names[host], self.interfaces[host])).unwrap();
    }

    /// Cuts a host off as soon as a rank has stopped, and lets the rank continue. Returns whether one stopped in time.
    fn cut(&self, place: &Place, host: usize) -> bool {
        let start = Instant::now();
        while start.elapsed() < LIMIT {
            let is_stopped = |id: &u32| {
                let state = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
                state.rsplit(") ").next().is_some_and(|state| state.starts_with('T'))
            };
            if let Some(id) = place.processes().into_iter().find(is_stopped) {
                self.link(host, "down");
                let _ = Command::new("kill").args(["-s", "CONT", &id.to_string()]).status();
                return true;
            }
            sleep(Duration::from_millis(2));
        }
        false
    }

    /// A job with a rank on each host, of which one stops at a point.
    fn job(&self, place: &Place, mesher: &Path, point: &str) -> Command {
        let agent = place.beside("agent");
        let script = "#!/bin/sh\nwhile [ \"${1#-}\" != \"$1\" ]; do shift; done\nshift\nexec ip netns exec HOST sh -c \"$*\"\n";
        fs::write(&agent, script.replace("HOST", &self.names[1])).unwrap();
        fs::set_permissions(&agent, fs::Permissions::from_mode(0o755)).unwrap();
        let launcher = mpirun(2);
        let mut job = Command::new("ip");
        job.args(["netns", "exec", &self.names[0]])
            .arg(launcher.get_program())
            .args(launcher.get_args());
        for (name, value) in launcher.get_envs() {
            value.map(|value| job.env(name, value));
        }
        job.args(["--mca", "plm_rsh_agent"]).arg(agent);
        job.args(OPTIONS.replace("NETWORK", NETWORK).split_whitespace());
        job.env("STOP_AT", point).args(["-x", "STOP_AT"]);
        job.args(["--host", &HOSTS.map(|host| format!("{host}:1")).join(",")]).arg(mesher);
        job.args(["case.toml", "--out", "out", "--quiet", "--stall-limit", "5"]);
        job
    }
}

impl Drop for Hosts {
    fn drop(&mut self) {
        for name in &self.names {
            for id in ip(&format!("netns pids {name}")).unwrap_or_default().lines() {
                let _ = Command::new("kill").args(["-s", "KILL", id]).output();
            }
            let _ = ip(&format!("netns del {name}"));
        }
    }
}
