//! Measured runs: one run of a setup, as a line of the record, and whether it is worth starting: a slow program is not started on a mesh that
//! it would not finish.

use super::entry::{Comm, Line, Phase, Run, Setup, Spread};
use super::machine::{cores, digest_of, digest_of_scripts};
use crate::shown;
use check::audit::audit_against;
use contract::case::Case;
use contract::failure::{Failure, Result};
use run::engine::description::is_own;
use run::engine::layout::{Launcher, Layout, Ranks, RunOptions, node_count};
use run::engine::report::{CLOCKS_S, PhaseReport};
use run::engine::runner::{Completed, Engine, Programs};
use std::fs;
use std::path::Path;
use std::time::Duration;

/// The partitioner that is not used where it has too few base leaves.
const METIS: &str = "metis";

/// Seed of the schedule of simulated ranks.
const SEED: u64 = 1;

/// Settings that all runs of a session share.
pub struct Runner<'a> {
    /// The programs.
    pub programs: &'a Programs,
    /// How ranks are started.
    pub launcher: &'a Launcher,
    /// Time after which a run is killed.
    pub limit: Duration,
    /// Directory for the files of runs.
    pub place: &'a Path,
}

impl Runner<'_> {
    /// Runs `setup` on the case file `case`; a warm-up is no repetition. The mesh of a warm-up is checked against the promises of an engine that
    /// does not promise the definition.
    ///
    /// # Errors
    /// If the run gives no result, or the mesh breaks a promise.
    pub fn run(&self, setup: &Setup, case: &Path, repeat: Option<usize>) -> Result<Run> {
        let engine = self.programs.named(&setup.engine).with_launcher(self.launcher.clone());
        let written = repeat.is_none() && !is_own(engine.name());
        let mesh = self.place.join("mesh");
        let options = RunOptions {
            // Its digest need not be in the run report.
            mesh: written.then_some(&mesh),
            time_alone: setup.comm == Comm::Sim && !written,
            ..RunOptions::new(self.place, self.limit)
        };
        let completed = engine.run(case, &layout(setup), &options).map_err(Failure::from);
        let is_checked = written && !engine.description.promises.definition && completed.is_ok();
        let kept = is_checked.then(|| keeps_promises(&engine, case, &mesh)).transpose();
        // The next run needs a place without a mesh, also after a failure.
        let _ = fs::remove_dir_all(&mesh);
        let Completed { report, finished, command } = completed?;
        kept?;
        // Those of rank 0 alone, or without CPU times, say nothing of the ranks.
        let is_of_all = |phase: &PhaseReport| phase.time_cpu_s.len() >= setup.ranks;
        let is_known =
            report.phases.iter().all(is_of_all) && useful_s(setup.ranks, &report.phases).sum > 0.0;
        let phases = if is_known { &report.phases[..] } else { &[] };
        let useful = useful_s(setup.ranks, phases);
        let not_metis = report.partitioner.as_deref().is_some_and(|used| used != METIS);
        let why = "its run report has no phases with CPU times, without which simulated ranks cannot be projected";
        Failure::unless(setup.comm != Comm::Sim || !phases.is_empty(), why)?;
        let why = "METIS was asked for, and has too few base leaves for these ranks, so that the curve was divided: use fewer \
             ranks or more cells";
        Failure::unless(setup.partitioner != METIS || !not_metis, why)?;
        let time_wall_s = report.time_wall_s.unwrap_or(finished.time_wall_s);
        let is_by_rank = report.counters.values().all(|of| of.len() <= setup.ranks);
        Failure::unless(is_by_rank, "its run report has a counter of more numbers than ranks")?;
        // Those of rank 0 alone say nothing of the others.
        let counters = report.counters.iter().filter(|(_, of)| of.len() == setup.ranks);
        let counters = counters.map(|(name, of)| (name.clone(), spread(of)));
        let run = Run {
            program: digest_of(engine.files()),
            scripts: digest_of_scripts(&engine),
            repeat: repeat.unwrap_or(0),
            warm_up: repeat.is_none(),
            oversubscribed: setup.comm == Comm::Mpi && setup.ranks > cores() * node_count(),
            command: shown([command.get_program()].into_iter().chain(command.get_args())),
            facets: report.facets.unwrap_or(0),
            geometry: report.geometry.map(|geometry| geometry.digest),
            inputs: String::new(),
            cells: report.cells,
            time_wall_s,
            time_launch_s: finished.time_wall_s,
            // Ranks in one process may work more than once.
            time_cpu_s: if setup.comm == Comm::Sim { useful.sum } else { finished.time_cpu_s },
            peak_rss_bytes: spread(&report.peak_rss_bytes),
            useful_s: useful,
            phases: phases.iter().map(phase).collect(),
            counters: counters.collect(),
            digest: report.digest.unwrap_or_default(),
            setup: setup.clone(),
        };
        let why = "its run report has numbers that no run can have, such as a phase that takes longer than the run";
        Failure::unless(run.is_possible(), why)?;
        // As of milliseconds for seconds. Ranks within one process run in turn, and the wall time that they report is that of one. Each may have threads, and a limit of cores be a fraction.
        let busy_s = if setup.comm == Comm::Mpi { run.useful_s.max } else { run.useful_s.sum };
        let wall_s = if setup.comm == Comm::Sim { run.time_launch_s } else { run.time_wall_s };
        let most_s = (1 + cores()) as f64 * (wall_s + CLOCKS_S);
        let why = format!("phases have {busy_s} s of CPU time, more than all cores in {wall_s} s");
        Failure::unless(busy_s <= most_s * node_count() as f64, why)?;
        Ok(run)
    }
}

/// Returns the reason for which a run would exceed a time or the memory of its machine, or on MPI of so many, extrapolated from the
/// finest coarser mesh of the same program; `None` if it would not, or if the lines have no such mesh.
pub(crate) fn excess(lines: &[Line], setup: &Setup, most: (Duration, usize)) -> Option<String> {
    let is_coarser = |run: &&Run| {
        let [wanted, found] =
            [setup, &run.setup].map(|s| (&s.engine, &s.case, s.layer_cells_min, s.ranks, s.comm));
        wanted == found && run.setup.spacing_min > setup.spacing_min
    };
    let coarser = lines.iter().filter_map(Line::run).filter(is_coarser);
    let spacing = |run: &&Run| run.setup.spacing_min;
    let finest = coarser.min_by(|a, b| spacing(a).total_cmp(&spacing(b)))?;
    // Cells, and with them time and memory, grow with the inverse square of the spacing.
    let growth = (finest.setup.spacing_min / setup.spacing_min).powi(2);
    let (time_s, bytes) = (finest.time_launch_s * growth, finest.peak_rss_bytes.sum * growth);
    let (limit, nodes) = (most.0, if setup.comm == Comm::Mpi { most.1 } else { 1 });
    let memory = lines.iter().find_map(Line::session)?.machine.memory_bytes as f64 * nodes as f64;
    let [need, there] = [bytes, memory].map(|b| b / 1e9);
    let would = match () {
        () if time_s > limit.as_secs_f64() => {
            format!("take {time_s:.0} s, more than --timeout {}", limit.as_secs())
        }
        () if bytes > memory => format!("need {need:.0} GB of memory, and there are {there:.0} GB"),
        () => return None,
    };
    let (program, cells) = (&setup.engine, finest.cells as f64);
    Some(format!("{program} would {would}, extrapolated from {cells:.1e} cells"))
}

/// Audits a mesh against the promises of the engine that made it.
fn keeps_promises(engine: &Engine, case: &Path, mesh: &Path) -> Result<(), String> {
    let case = Case::read(case).map_err(|error| error.to_string())?;
    let report = audit_against(mesh, Some(&case), &engine.description.promises);
    let broken = report.checks.iter().find(|check| !check.holds());
    broken.map_or(Ok(()), |check| Err(format!("the mesh breaks the promise {check}")))
}

/// How a setup is distributed over ranks.
fn layout(setup: &Setup) -> Layout {
    let ranks = match setup.comm {
        Comm::Solo => Ranks::Serial,
        Comm::Sim => Ranks::Simulated { ranks: setup.ranks, seed: SEED },
        Comm::Mpi => Ranks::Mpi(setup.ranks),
    };
    let choice = |value: &String| Some(value.clone()).filter(|value| !value.is_empty());
    let (partitioner, weights) = (choice(&setup.partitioner), choice(&setup.weights));
    let level_base = setup.level_base.map(|level| level.to_string());
    Layout { partitioner, weights, level_base, ..Layout::on(ranks) }
}

/// CPU time outside calls to other ranks, per rank; that of no rank if there are no phases.
fn useful_s(ranks: usize, phases: &[PhaseReport]) -> Spread {
    let times: Vec<Vec<f64>> = phases.iter().map(PhaseReport::time_useful_s).collect();
    let ranks = if times.is_empty() { 0 } else { ranks };
    let of_rank = |rank| times.iter().map(|of| of[rank]).sum();
    Spread::of(&(0..ranks).map(of_rank).collect::<Vec<f64>>())
}

fn phase(phase: &PhaseReport) -> Phase {
    Phase {
        name: phase.name.clone(),
        useful_s: Spread::of(&phase.time_useful_s()),
        wall_s: Spread::brief(&phase.time_wall_s),
        messages: spread(&phase.messages),
        message_bytes: spread(&phase.message_bytes),
    }
}

fn spread(counts: &[u64]) -> Spread {
    Spread::brief(&counts.iter().map(|&count| count as f64).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::entry::{Entry, Machine, Session};
    use crate::testing::{line, run};
    use contract::octant::Octant;
    use contract::word::{self, Side};
    use run::engine::paths::Paths;
    use run::engine::runner::Given;

    #[test]
    fn a_shown_command_contains_no_directory_of_the_machine() {
        let command = ["/opt/bin/mpirun", "-n", "2", "/opt/bin/mesher", "/tmp/x/a uav.toml"];
        assert_eq!(shown(command), "mpirun -n 2 mesher 'a uav.toml'");
        assert!(shown(["harness", "be\0nch"]).contains("be\u{fffd}nch"));
    }

    // An engine that is not ours.

    /// The measured run of a shell script.
    fn scripted(script: &str, json: &str, comm: Comm) -> Result<Run, String> {
        let place = tempfile::tempdir().unwrap();
        run_in(place.path(), script, json, comm, false)
    }

    /// The run of a shell script in a directory with the case file `case.toml`; `more` continues the table [run].
    fn run_in(at: &Path, script: &str, more: &str, comm: Comm, warm: bool) -> Result<Run, String> {
        std::fs::write(at.join("engine.sh"), script).unwrap();
        let words = "serial = ['sh', '{program}', '{case}']\nsimulated = ['env', 'N={ranks}', 'sh', '{program}', '{case}']\n";
        let text = format!(
            "about = 'x'\nprogram = '{{here}}/engine.sh'\n[run]\n{words}out = ['{{out}}']\n{more}"
        );
        let file = at.join("scripted.toml");
        std::fs::write(&file, text).unwrap();
        let limit = Duration::from_secs(60);
        let file = file.to_str().unwrap();
        let programs = Programs::find(file, &Given::default()).unwrap();
        let launcher = Launcher::parse("mpirun -n {ranks}").unwrap();
        let runner = Runner { programs: &programs, launcher: &launcher, limit, place: at };
        let setup = crate::testing::run(comm, 1, &[("a", &[0.0, 0.0])]).setup;
        let ranks = if comm == Comm::Solo { 1 } else { 2 };
        let setup = Setup { engine: programs.engine.label(), ranks, ..setup };
        let case = at.join("case.toml");
        runner.run(&setup, &case, (!warm).then_some(0)).map_err(|why| format!("{why:?}"))
    }

    #[test]
    fn a_mesh_that_breaks_a_promise_is_not_measured() {
        let place = tempfile::tempdir().unwrap();
        let case = "spacing_min = 2.0\nkeep = 'all'\n[root]\norigin = [-4.0, -4.0, -4.0]\nedge = 8.0\n\
                    [generator]\nshape = 'cube'\nfacets = 12\n";
        std::fs::write(place.path().join("case.toml"), case).unwrap();
        // The root without its first octant has a hole.
        let leaf = |digit| word::encode(Octant::ROOT.child(digit), Side::Outside);
        let words: Vec<u64> = (1..8).map(leaf).collect();
        contract::npy::write(&place.path().join("leaves.npy"), &words).unwrap();
        let script = "mkdir -p $2 && cp ${0%/*}/leaves.npy $2/leaves-00000.npy";
        let run = |promise: &str, warm_up| {
            let promises = format!("[promises]\n{promise} = true\n");
            run_in(place.path(), script, &promises, Comm::Solo, warm_up).map(|run| run.cells)
        };
        assert!(run("complete", true).unwrap_err().contains("breaks the promise complete"));
        // Only warm-ups are checked, and nothing but promises.
        assert_eq!((run("complete", false), run("deterministic", true)), (Ok(7), Ok(7)));
    }

    const REPORTS: &str = "json = ['{json}']\n";

    #[test]
    fn useful_time_is_cpu_time_outside_calls() {
        let report = r#"{"facets": 12, "cells": 80, "digest": "00", "ranks": 2, "time_wall_s": 0.009, "peak_rss_bytes": [70000000, 70000000],
            "counters": {"leaves": [30, 50]}, "phases": [{"name": "read", "time_wall_s": [4.0, 4.5], "time_cpu_s": [0.02, 0.01],
            "time_comm_wall_s": [1.0, 1.0], "time_comm_cpu_s": [0.005, 0.011], "messages": [1, 1], "message_bytes": [8, 16]}]}"#;
        let report = report.split_whitespace().collect::<Vec<_>>().join(" ");
        let run = scripted(&format!("echo '{report}' > $2"), REPORTS, Comm::Sim).unwrap();
        assert_eq!((run.phases[0].useful_s.max, run.phases[0].useful_s.at), (0.015, 0));
        assert_eq!(run.useful_s.by_rank, [0.015, 0.0]);
        assert_eq!(run.phases[0].useful_s.by_rank, [0.015, 0.0]);
        assert_eq!((run.useful_s.sum, run.useful_s.max), (0.015, 0.015));
        assert_eq!((run.phases[0].wall_s.max, run.phases[0].message_bytes.sum), (4.5, 24.0));
        // A simulated rank reports its part of the one process.
        assert_eq!((run.peak_rss_bytes.sum, run.counters["leaves"].max), (14e7, 50.0));
    }

    /// Those of rank 0 alone, or of all ranks together, say nothing of each.
    #[test]
    fn counters_are_of_every_rank() {
        let counted = |of: &str, comm| {
            let report = format!(
                r#"{{"cells": 80, "digest": "00", "counters": {{"leaves": {of}}},
                "phases": [{{"name": "all", "time_cpu_s": [0.001, 0.001]}}]}}"#
            );
            let report = report.split_whitespace().collect::<Vec<_>>().join(" ");
            let run = scripted(&format!("echo '{report}' > $2"), REPORTS, comm);
            run.map(|run| run.counters.get("leaves").map(|of| of.lambda(run.setup.ranks)))
        };
        assert_eq!(counted("[30, 50]", Comm::Sim), Ok(Some(1.25)));
        assert_eq!(counted("[80]", Comm::Sim), Ok(None));
        let why = "a counter of more numbers than ranks";
        assert!(counted("[30, 25, 25]", Comm::Sim).unwrap_err().contains(why));
        let why = "counts 79 leaves, but 80 cells";
        assert!(counted("[30, 49]", Comm::Sim).unwrap_err().contains(why));
    }

    /// As of a program that takes milliseconds for seconds.
    #[test]
    fn phases_take_no_more_cpu_time_than_all_cores_have() {
        let with = |cpu_s: &str, comm, more: &str| {
            let phases = format!(r#"[{{"name": "all", "time_cpu_s": {cpu_s}}}]"#);
            let report = format!(r#"{{"cells": 8, "digest": "00", "phases": {phases}, {more}}}"#);
            scripted(&format!("echo '{report}' > $2"), REPORTS, comm)
        };
        let more = r#""facets": 0"#;
        assert!(with("[0.01]", Comm::Solo, more).is_ok());
        // The process takes longer than its own clock says.
        let brief = r#""time_wall_s": 1e-6"#;
        for (cpu_s, comm, more) in [
            ("[5e3]", Comm::Solo, more),
            ("[0.01, 5e3]", Comm::Sim, more),
            ("[9.0]", Comm::Solo, brief),
        ] {
            let why = "s of CPU time, more than all cores in";
            assert!(with(cpu_s, comm, more).unwrap_err().contains(why));
        }
    }

    #[test]
    fn the_useful_time_of_a_program_without_phases_is_unknown() {
        // So is that of a program whose clock shows nothing.
        for phases in ["", r#", "phases": [{"name": "all", "time_cpu_s": [0.0]}]"#] {
            let report = format!(
                r#"{{"cells": 8, "digest": "00", "time_wall_s": 0.005, "peak_rss_bytes": 9000000{phases}}}"#
            );
            let run = scripted(&format!("echo '{report}' > $2"), REPORTS, Comm::Solo).unwrap();
            assert_eq!((run.useful_s, run.peak_rss_bytes.sum), (Spread::default(), 9e6));
        }
    }

    #[test]
    fn another_script_of_an_interpreter_is_another_program() {
        let place = tempfile::tempdir().unwrap();
        let program = |script: &str| {
            std::fs::write(place.path().join("engine.sh"), script).unwrap();
            let words = "[run]\nserial = ['sh', '{here}/engine.sh', '{case}', '{out}']\n";
            let file = place.path().join("scripted.toml");
            std::fs::write(&file, words).unwrap();
            let engine = Engine::find(file.to_str().unwrap(), None, &Paths::find()).unwrap();
            digest_of(engine.files())
        };
        assert!(program("a") == program("a") && program("a") != program("b"));
    }

    #[test]
    fn time_and_memory_are_measured_from_outside_if_they_are_not_reported() {
        let script = "sleep 0.05; echo '{\"cells\": 8, \"digest\": \"ab\"}' > $2";
        let run = scripted(script, REPORTS, Comm::Solo).unwrap();
        assert_eq!(
            (run.setup.engine.as_str(), run.cells, run.digest.as_str()),
            ("scripted", 8, "ab")
        );
        assert!(run.time_wall_s >= 0.05 && run.time_wall_s == run.time_launch_s);
        assert!(run.peak_rss_bytes.sum > 1e5);
        assert!(run.command.starts_with("sh engine.sh case.toml"), "{}", run.command);
    }

    #[test]
    fn reported_time_and_memory_take_precedence() {
        let report = r#"{"ranks": 2, "cells": 8, "digest": "ab", "time_wall_s": 0.0075, "peak_rss_bytes": [3000000, 4000000],
            "phases": [{"name": "all", "time_cpu_s": [0.02, 0.01]}]}"#;
        let run = scripted(&format!("echo '{report}' > $2"), REPORTS, Comm::Sim).unwrap();
        assert_eq!((run.time_wall_s, run.peak_rss_bytes.sum), (0.0075, 7e6));
        assert_eq!((run.useful_s.by_rank, run.phases[0].useful_s.max), (vec![0.02, 0.01], 0.02));
    }

    #[test]
    fn phases_of_fewer_ranks_or_without_cpu_times_are_not_used_and_no_digest_is_needed() {
        let report = |key: &str| {
            let phases = format!(r#"[{{"name": "all", "{key}": [0.002]}}]"#);
            let json = format!(r#"{{"cells": 8, "time_wall_s": 0.0075, "phases": {phases}}}"#);
            format!("echo '{json}' > $2")
        };
        let run = scripted(&report("time_wall_s"), REPORTS, Comm::Solo).unwrap();
        assert_eq!(
            (run.time_wall_s, run.useful_s.by_rank.len(), run.digest.as_str()),
            (0.0075, 0, "")
        );
        assert!(run.phases.is_empty());
        let of_rank_0 = scripted(&report("time_cpu_s"), REPORTS, Comm::Sim);
        assert!(of_rank_0.unwrap_err().contains("no phases"));
    }

    #[test]
    fn a_run_without_the_required_output_is_a_failure() {
        let script = "echo '{\"ranks\": 2, \"cells\": 8, \"digest\": \"ab\"}' > $2";
        assert!(scripted(script, REPORTS, Comm::Sim).unwrap_err().contains("no phases"));
        assert!(scripted("mkdir $2", "", Comm::Solo).unwrap_err().contains("mesh.json"));
        assert!(
            scripted("echo no >&2; exit 3", REPORTS, Comm::Solo)
                .unwrap_err()
                .contains("code 3: no")
        );
    }

    #[test]
    fn a_run_is_left_out_if_a_coarser_one_was_too_long_or_too_large() {
        let of = |bytes: f64| {
            let mut coarse = run(Comm::Solo, 1000, &[("a", &[2.0])]);
            (coarse.time_launch_s, coarse.peak_rss_bytes.sum) = (2.0, bytes);
            let machine = Machine { memory_bytes: 8 << 30, ..Machine::default() };
            let session = Session { machine, ..Session::default() };
            [line(Entry::Session(Box::new(session))), line(Entry::Run(Box::new(coarse)))]
        };
        let finer = |lines: &[Line], spacing_min: f64, limit: u64| {
            let setup = run(Comm::Solo, 1, &[("a", &[0.0])]).setup;
            excess(lines, &Setup { spacing_min, ..setup }, (Duration::from_secs(limit), 9999))
        };
        let (small, large) = (of(1e6), of(1e13));
        assert_eq!(finer(&small, 0.01, 300), None);
        assert!(finer(&small, 0.01, 100).unwrap().contains("take 200 s, more than --timeout 100"));
        assert!(finer(&large, 0.05, 300).unwrap().contains("need 40000 GB of memory"));
        // The same spacing is no coarser mesh.
        assert_eq!(finer(&large, 0.1, 1), None);
        // Ranks on MPI have the memory of all nodes.
        let mut on_mpi = large.clone();
        let Entry::Run(run) = &mut on_mpi[1].entry else { panic!("a run") };
        run.setup.comm = Comm::Mpi;
        let finer = Setup { spacing_min: 0.05, ..run.setup.clone() };
        let on = |nodes| excess(&on_mpi, &finer, (Duration::from_secs(300), nodes));
        assert!(on(9999).is_none() && on(2).unwrap().contains("and there are 17 GB"));
    }
}
