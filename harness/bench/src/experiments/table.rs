//! Text tables of a record.

use super::cause::sentence;
use super::entry::{Comm, Network, Setup};
use super::group::{Group, Groups};
use super::number::grouped;
use super::{pop, programs};
use std::fmt::Write;

/// Returns all tables of a record's runs.
pub fn tables(groups: &Groups) -> String {
    let mut out = String::new();
    let n = groups.network;
    let _ = writeln!(
        out,
        "network: {:.2} us, {:.2} GB/s ({})",
        n.latency_s * 1e6,
        n.bandwidth_bytes_per_s / 1e9,
        if n.measured { "measured by ping-pong" } else { "given" }
    );
    for sentence in &groups.origins {
        let _ = writeln!(out, "{sentence}");
    }
    let mut experiments: Vec<&str> =
        groups.all.iter().map(|g| g.setup.experiment.as_str()).collect();
    experiments.dedup();
    let mut seen: Vec<&str> = Vec::new();
    for experiment in experiments {
        if !seen.contains(&experiment) {
            seen.push(experiment);
            experiment_table(&mut out, groups, experiment);
        }
    }
    projections(&mut out, groups);
    out.push_str(&programs::tables(groups));
    out
}

fn experiment_table(out: &mut String, groups: &Groups, experiment: &str) {
    let _ = writeln!(out, "\n{experiment}");
    let _ = writeln!(
        out,
        "  {:<10} {:<14} {:>13} {:>3} {:<19} {:>5} {:<14} {:>10} {:>22} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>8} {:>7}",
        "engine",
        "case",
        "cells",
        "n",
        "division",
        "ranks",
        "how",
        "time s",
        "interval",
        "lambda",
        "LB",
        "ser",
        "trf",
        "par",
        "scal",
        "glob",
        "Mc/s/rk",
        "B/cell"
    );
    let of = |g: &&Group| g.setup.experiment == experiment;
    for group in groups.all.iter().filter(of) {
        row(out, groups, group);
    }
    for group in groups.all.iter().filter(of) {
        let (run, reference) = (&group.typical, &groups.reference(group).typical);
        let is_above_one = pop::efficiency(run, reference, &groups.network).is_above_one();
        if group.setup.ranks == 1 && !is_above_one {
            continue;
        }
        let cause = sentence(run, reference, &groups.network);
        let _ = writeln!(
            out,
            "  {}, {}, {}: {cause}",
            group.setup.engine,
            group.setup.case,
            group.how()
        );
    }
}

fn row(out: &mut String, groups: &Groups, group: &Group) {
    let (s, t) = (&group.setup, group.time_s);
    let e = group.efficiency(groups.reference(group), &groups.network);
    let interval = format!("[{:.3}, {:.3}] {:.0} %", t.low, t.high, t.coverage * 100.0);
    let _ = writeln!(
        out,
        "  {:<10} {:<14} {:>13} {:>3} {:<19} {:>5} {:<14} {:>10.3} {:>22} {:>6.3} {:>6.2} {:>6.2} {:>6.2} {:>6.2} {:>6.2} {:>6.2} {:>8.2} {:>7.2}",
        s.engine,
        s.case,
        grouped(group.cells()),
        s.layer_cells_min,
        division(s),
        s.ranks,
        group.how(),
        t.value,
        interval,
        e.lambda,
        e.load_balance,
        e.serialisation,
        e.transfer,
        e.parallel(),
        e.computation_scaling,
        e.global(),
        group.rate() / 1e6,
        group.bytes_per_cell().value
    );
}

/// Returns partitioner and weights, or `default`, and the weight W of exposed faces if they have one.
pub fn division(s: &Setup) -> String {
    let chosen = match (s.partitioner.as_str(), s.weights.as_str()) {
        ("", "") => "default".to_owned(),
        (p, w) => format!("{p} {w}").trim().to_owned(),
    };
    match s.weight_exposed {
        None | Some(0) => chosen,
        Some(weight) => format!("{chosen} W={weight}"),
    }
}

/// Returns the phases of a group's typical run: useful time, efficiencies, messages.
pub fn phases(group: &Group, reference: &Group, network: &Network) -> String {
    let (run, one) = (&group.typical, &reference.typical);
    let mut out = String::new();
    let _ = writeln!(
        out,
        "  {:<12} {:>10} {:>10} {:>7} {:>6} {:>6} {:>6} {:>9} {:>10}",
        "phase", "mean s", "max s", "lambda", "LB", "trf", "scal", "messages", "MB"
    );
    for p in &run.phases {
        let e = pop::phase_efficiency(run, p, one, network);
        let _ = writeln!(
            out,
            "  {:<12} {:>10.4} {:>10.4} {:>7.2} {:>6.2} {:>6.2} {:>6.2} {:>9.0} {:>10.3}",
            p.name,
            p.useful_s.sum / run.setup.ranks as f64,
            p.useful_s.max,
            e.lambda,
            e.load_balance,
            e.transfer,
            e.computation_scaling,
            p.messages.max,
            p.message_bytes.max / 1e6
        );
    }
    out
}

fn projections(out: &mut String, groups: &Groups) {
    let pairs = groups.projections();
    if pairs.is_empty() {
        return;
    }
    let _ = writeln!(out, "\nprojection compared with MPI, on as many cores as ranks");
    for p in pairs {
        let _ = writeln!(
            out,
            "  {:<10} {:<14} {:>13} cells, {} ranks: projected {:.3} s, measured {:.3} s, error {:+.1} %; of CPU times alone {:+.1} %",
            p.sim.setup.engine,
            p.sim.setup.case,
            grouped(p.sim.cells()),
            p.sim.setup.ranks,
            p.sim.time_s.value,
            p.measured.time_s.value,
            p.error() * 100.0,
            p.path_error() * 100.0
        );
    }
    let largest =
        groups.all.iter().filter(|g| g.setup.comm == Comm::Sim).max_by_key(|g| g.setup.ranks);
    if let Some(group) = largest {
        let _ = writeln!(
            out,
            "\nphases of {} on {} simulated ranks, {}",
            group.setup.engine, group.setup.ranks, group.setup.case
        );
        out.push_str(&phases(group, groups.reference(group), &groups.network));
    }
}

#[cfg(test)]
mod tests {
    use super::super::entry::Entry;
    use super::*;
    use crate::testing::line;
    use crate::testing::run;

    #[test]
    fn a_table_shows_times_intervals_causes_and_errors() {
        let lines = [
            line(Entry::Run(Box::new(run(Comm::Sim, 1_000_000, &[("grade", &[4.0])])))),
            line(Entry::Run(Box::new(run(Comm::Sim, 1_000_000, &[("grade", &[3.0, 1.0])])))),
            line(Entry::Run(Box::new(run(Comm::Mpi, 1_000_000, &[("grade", &[2.5, 1.0])])))),
        ];
        let text = tables(&Groups::of(&lines));
        for part in [
            "1,000,000",
            "1.500",
            "[3.000, 3.000] 0 %",
            "67 % at 2 ranks",
            "error +20.0 %",
            "projected",
        ] {
            assert!(text.contains(part), "{part} is missing in\n{text}");
        }
    }
}
