//! The tables of a record, for the page of a report and as text.

use super::above_one::reasons;
use super::groups::{Subject, is_summarised};
use crate::table::Table;
use bench::experiments::cause::sentence;
use bench::experiments::entry::Phase;
use bench::experiments::group::{Group, Groups, Projection};
use bench::experiments::number::grouped;
use bench::experiments::pop::{self, Efficiency};
use bench::experiments::programs::Comparison;
use bench::order::{by_key, distinct};

/// All tables: experiments, projections, phases, programs.
pub fn tables(groups: &Groups) -> Vec<Table> {
    let experiments = distinct(groups.all.iter().map(|group| group.setup.experiment.as_str()));
    let mut all: Vec<Table> =
        experiments.into_iter().map(|name| experiment(groups, name)).collect();
    all.extend(projections(groups));
    all.extend(largest(groups).into_iter().map(|group| phases(groups, group)));
    all.extend(groups.comparisons().iter().map(|comparison| programs(groups, comparison)));
    all
}

/// All tables as text, with the causes of lost efficiency.
pub fn text(groups: &Groups) -> String {
    let n = groups.network;
    let measured = if n.measured { "measured by ping-pong" } else { "given" };
    let (latency, bandwidth) = (n.latency_s * 1e6, n.bandwidth_bytes_per_s / 1e9);
    let mut lines = vec![format!("network: {latency:.2} us, {bandwidth:.2} GB/s ({measured})")];
    lines.extend(groups.origins.iter().cloned());
    lines.extend(tables(groups).iter().map(|table| format!("\n{}", table.text().trim_end())));
    lines.push("\ncauses of lost efficiency".to_owned());
    for group in &groups.all {
        let (run, reference) = (&group.typical, &groups.reference(group).typical);
        let is_above_one = pop::efficiency(run, reference, &groups.network).is_above_one();
        if group.setup.ranks > 1 || is_above_one {
            let of = format!(
                "{}, {}, {}",
                Subject::of(&group.setup),
                group.setup.experiment,
                group.how()
            );
            lines.push(format!("  {of}: {}", sentence(run, reference, &groups.network)));
        }
    }
    lines.into_iter().map(|line| line + "\n").collect()
}

/// Time, load imbalance λ = max/mean, POP efficiencies, rate and memory of every group.
fn experiment(groups: &Groups, name: &str) -> Table {
    let of: Vec<&Group> = groups.all.iter().filter(|g| g.setup.experiment == name).collect();
    let efficiency = |g: &&Group| g.efficiency(groups.reference(g), &groups.network);
    let efficiencies: Vec<Efficiency> = of.iter().map(efficiency).collect();
    Table {
        title: name.to_owned(),
        columns: vec![
            "engine",
            "case",
            "cells",
            "n",
            "partitioner and weights",
            "ranks",
            "provenance",
            "time / s (median)",
            "confidence interval",
            "coverage",
            "runs",
            "λ (time)",
            "λ (cells)",
            "λ (exposed faces)",
            "load balance",
            "serialisation",
            "transfer",
            "parallel efficiency",
            "computation scaling",
            "global efficiency",
            "10⁶ cells / (s rank)",
            "bytes / cell",
        ],
        rows: of.iter().zip(&efficiencies).map(|(g, e)| row(g, e)).collect(),
        notes: reasons(&efficiencies, name).into_iter().collect(),
    }
}

fn row(group: &Group, e: &Efficiency) -> Vec<String> {
    let (s, t) = (&group.setup, group.time_s);
    let lambda = |counter: &str| {
        let counted = group.typical.counters.get(counter);
        counted.map_or("–".to_owned(), |of| format!("{:.3}", of.lambda(s.ranks)))
    };
    vec![
        s.engine.clone(),
        s.case.clone(),
        grouped(group.cells()),
        s.layer_cells_min.to_string(),
        s.division(),
        s.ranks.to_string(),
        group.how().to_owned(),
        format!("{:.3}", t.value),
        format!("{:.3} – {:.3}", t.low, t.high),
        format!("{:.0} %", t.coverage * 100.0),
        t.count.to_string(),
        format!("{:.3}", e.lambda),
        lambda("leaves"),
        lambda("exposed_faces"),
        format!("{:.3}", e.load_balance),
        format!("{:.3}", e.serialisation),
        format!("{:.3}", e.transfer),
        format!("{:.3}", e.parallel()),
        format!("{:.3}", e.computation_scaling),
        format!("{:.3}", e.global()),
        format!("{:.2}", group.rate() / 1e6),
        format!("{:.2}", group.bytes_per_cell().value),
    ]
}

/// Projected and measured times of the same meshes on equally many ranks; `None` if the record has no such pairs.
fn projections(groups: &Groups) -> Option<Table> {
    let row = |p: &Projection| {
        vec![
            p.sim.setup.engine.clone(),
            p.sim.setup.case.clone(),
            p.sim.setup.experiment.clone(),
            grouped(p.sim.cells()),
            p.sim.setup.ranks.to_string(),
            format!("{:.3}", p.sim.time_s.value),
            format!("{:.3}", p.measured.time_s.value),
            format!("{:+.1} %", p.error() * 100.0),
            format!("{:+.1} %", p.path_error() * 100.0),
        ]
    };
    let rows: Vec<Vec<String>> = groups.projections().iter().map(row).collect();
    (!rows.is_empty()).then(|| Table {
        title: "projected and measured times".to_owned(),
        columns: vec![
            "engine",
            "case",
            "experiment",
            "cells",
            "ranks",
            "projected / s",
            "measured / s",
            "error",
            "error of the critical path of CPU times",
        ],
        rows,
        notes: Vec::new(),
    })
}

/// The largest simulated run of every strong or weak scaling study.
fn largest<'a>(groups: &'a Groups) -> Vec<&'a Group> {
    let study = |group: &'a Group| {
        let weak = group.setup.experiment == "weak";
        (weak, Subject::of(&group.setup).to_string(), (!weak).then(|| group.cells()))
    };
    let studies = by_key(groups.all.iter().filter(|g| is_summarised(g)), study);
    // The first of those on the most ranks.
    let largest =
        |(_, groups): (_, Vec<&'a Group>)| groups.into_iter().rev().max_by_key(|g| g.setup.ranks);
    studies.into_iter().filter_map(largest).collect()
}

/// The phases of a group's typical run: useful time, efficiencies, messages.
fn phases(groups: &Groups, group: &Group) -> Table {
    let (run, network) = (&group.typical, &groups.network);
    let reference = &groups.reference(group).typical;
    let total: f64 = run.phases.iter().map(|p| p.useful_s.max + pop::messages_s(p, network)).sum();
    let efficiency = |p: &Phase| pop::phase_efficiency(run, p, reference, network);
    let efficiencies: Vec<Efficiency> = run.phases.iter().map(efficiency).collect();
    let row = |(p, e): (&Phase, &Efficiency)| {
        vec![
            p.name.clone(),
            format!("{:.4}", p.useful_s.sum / run.setup.ranks as f64),
            format!("{:.4}", p.useful_s.max),
            format!("{:.2}", e.lambda),
            format!("{:.2}", e.load_balance),
            format!("{:.2}", e.transfer),
            format!("{:.2}", e.parallel()),
            format!("{:.2}", e.computation_scaling),
            format!("{:.1} %", 100.0 * e.time_s / total),
            format!("{:.0}", p.messages.max),
            format!("{:.3}", p.message_bytes.max / 1e6),
        ]
    };
    let s = &run.setup;
    Table {
        title: format!(
            "phases: {}, {} scaling, {} cells, {} simulated ranks",
            Subject::of(s),
            s.experiment,
            grouped(run.cells),
            s.ranks
        ),
        columns: vec![
            "phase",
            "mean useful time / s",
            "max useful time / s",
            "λ",
            "load balance",
            "transfer",
            "parallel efficiency",
            "computation scaling",
            "fraction of run time",
            "messages, max over ranks",
            "MB, max over ranks",
        ],
        rows: run.phases.iter().zip(&efficiencies).map(row).collect(),
        notes: reasons(&efficiencies, &s.experiment).into_iter().collect(),
    }
}

/// Several programs on one core, the meshes that are missing, and what the programs do not provide.
fn programs(groups: &Groups, comparison: &Comparison) -> Table {
    let row = |group: &&Group| {
        let cpu_s = group.cpu_s().map_or(f64::NAN, |time| time.value);
        let search = group.search_s().map(|time| format!("{:.2}", time.value));
        vec![
            group.setup.engine.clone(),
            grouped(group.cells()),
            format!("{cpu_s:.2}"),
            search.unwrap_or_else(|| "not separate".to_owned()),
            format!("{:.3}", group.cells() as f64 / cpu_s / 1e6),
            format!("{:.1}", group.bytes_per_cell().value),
        ]
    };
    let left_out = comparison
        .left_out(groups)
        .into_iter()
        .map(|left| format!("No mesh at spacing {:.2e}: {}", left.setup.spacing_min, left.why));
    let lacks = comparison.lacks(groups);
    let lacks = lacks.map(|(engine, lacks)| format!("{engine} does not provide: {lacks}"));
    Table {
        title: format!(
            "programs on one core: {}, n = {}",
            comparison.case, comparison.layer_cells_min
        ),
        columns: vec![
            "engine",
            "cells",
            "CPU time / s",
            "of it search / s",
            "10⁶ cells / (s core)",
            "bytes / cell",
        ],
        rows: comparison.programs.iter().flat_map(|(_, groups)| groups).map(row).collect(),
        notes: left_out.chain(lacks).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench::experiments::entry::{Comm, Entry, LeftOut, Line, Machine, Session, Setup};
    use bench::testing::{line, run};

    #[test]
    fn a_table_shows_times_intervals_causes_and_errors() {
        let lines = [
            line(Entry::Run(Box::new(run(Comm::Sim, 1_000_000, &[("grade", &[4.0])])))),
            line(Entry::Run(Box::new(run(Comm::Sim, 1_000_000, &[("grade", &[3.0, 1.0])])))),
            line(Entry::Run(Box::new(run(Comm::Mpi, 1_000_000, &[("grade", &[2.5, 1.0])])))),
        ];
        let text = text(&Groups::of(&lines));
        for part in [
            "1,000,000",
            "1.500",
            "3.000 – 3.000",
            "0 %",
            "67 % at 2 ranks",
            "+20.0 %",
            "projected",
        ] {
            assert!(text.contains(part), "{part} is missing in\n{text}");
        }
    }

    fn by(engine: &str, cells: u64, phase: &str) -> Line {
        let mut run = run(Comm::Solo, cells, &[(phase, &[0.5]), ("rest", &[1.5])]);
        run.setup.engine = engine.into();
        line(Entry::Run(Box::new(run)))
    }

    #[test]
    fn programs_are_compared_and_what_they_cannot_do_is_stated() {
        let lacks = [("slow".to_owned(), vec!["layers".to_owned(), "MPI".to_owned()])];
        let session = Session {
            command: Vec::new(),
            machine: Machine::default(),
            load_average: 0.0,
            lacks: lacks.into(),
        };
        let setup = run(Comm::Solo, 1, &[("a", &[0.0])]).setup;
        let left = LeftOut {
            setup: Setup { engine: "slow".into(), ..setup },
            why: "slow would take 9 s".into(),
        };
        let lines = [
            line(Entry::Session(Box::new(session))),
            by("mesher", 2_000_000, "refine"),
            by("slow", 1_000_000, "search"),
            line(Entry::LeftOut(left)),
        ];
        let groups = Groups::of(&lines);
        let [comparison] = &groups.comparisons()[..] else { panic!("one comparison") };
        let table = programs(&groups, comparison);
        assert_eq!(table.rows[0].join(" "), "mesher 2,000,000 2.00 not separate 1.000 0.5");
        assert_eq!(table.rows[1].join(" "), "slow 1,000,000 2.00 0.50 0.500 1.0");
        let notes = [
            "No mesh at spacing 1.00e-1: slow would take 9 s",
            "slow does not provide: layers, MPI",
        ];
        assert_eq!(table.notes, notes);
        assert!(Groups::of(&lines[..2]).comparisons().is_empty(), "one program is no comparison");
    }
}
