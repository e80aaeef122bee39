//! The tables of the page of a benchmark report.

use super::above_one::{check_invariants, reasons};
use super::groups::{Subject, is_summarised};
use crate::page::table;
use bench::experiments::entry::Phase;
use bench::experiments::group::{Group, Groups, Projection};
use bench::experiments::number::grouped;
use bench::experiments::pop::{self, Efficiency};
use bench::experiments::table::division;
use maud::{Markup, html};

const EXPERIMENT: [&str; 22] = [
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
];

/// A table per experiment: time, load imbalance λ = max/mean, POP efficiencies, rate and memory of every group.
pub fn experiments(groups: &Groups) -> Markup {
    let mut names: Vec<&str> = Vec::new();
    for group in &groups.all {
        if !names.contains(&group.setup.experiment.as_str()) {
            names.push(&group.setup.experiment);
        }
    }
    let of_experiment = |name: &str| -> Vec<(&Group, Efficiency)> {
        let of = groups.all.iter().filter(|g| g.setup.experiment == name);
        of.map(|g| (g, g.efficiency(groups.reference(g), &groups.network))).collect()
    };
    let table_of = |name: &str| {
        let (of, efficiencies): (Vec<&Group>, Vec<Efficiency>) =
            of_experiment(name).into_iter().unzip();
        efficiencies.iter().for_each(check_invariants);
        let rows: Vec<Vec<Markup>> = of.iter().zip(&efficiencies).map(|(g, e)| row(g, e)).collect();
        html! { h3 { (name) } (table(None, &EXPERIMENT, &rows)) (remark(&efficiencies, name)) }
    };
    html! {
        p { "Load imbalance λ = max/mean over ranks; efficiencies by the POP definitions. Exposed faces are those that the mesh shows to the body; W is the number of cells that each weighs." }
        @for name in names { (table_of(name)) }
    }
}

/// Why efficiencies of a table exceed 1.
fn remark(efficiencies: &[Efficiency], experiment: &str) -> Markup {
    html! { @if let Some(why) = reasons(efficiencies, experiment) { p { (why) } } }
}

fn row(group: &Group, e: &Efficiency) -> Vec<Markup> {
    let (s, t) = (&group.setup, group.time_s);
    let lambda = |counter: &str| {
        let counted = group.typical.counters.get(counter);
        counted.map_or("–".to_owned(), |of| format!("{:.3}", of.lambda(s.ranks)))
    };
    fields([
        s.engine.clone(),
        s.case.clone(),
        grouped(group.cells()),
        s.layer_cells_min.to_string(),
        division(s),
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
    ])
}

fn fields<const N: usize>(texts: [String; N]) -> Vec<Markup> {
    texts.iter().map(|text| html! { (text) }).collect()
}

/// Projected and measured times of the same meshes on equally many ranks; empty if the record has no such pairs.
pub fn projections(groups: &Groups) -> Markup {
    let columns = [
        "engine",
        "case",
        "experiment",
        "cells",
        "ranks",
        "projected / s",
        "measured / s",
        "error",
        "error of the critical path of CPU times",
    ];
    let row = |p: &Projection| {
        fields([
            p.sim.setup.engine.clone(),
            p.sim.setup.case.clone(),
            p.sim.setup.experiment.clone(),
            grouped(p.sim.cells()),
            p.sim.setup.ranks.to_string(),
            format!("{:.3}", p.sim.time_s.value),
            format!("{:.3}", p.measured.time_s.value),
            format!("{:+.1} %", p.error() * 100.0),
            format!("{:+.1} %", p.path_error() * 100.0),
        ])
    };
    let rows: Vec<Vec<Markup>> = groups.projections().iter().map(row).collect();
    html! { @if !rows.is_empty() { h3 { "projected and measured times" } (table(None, &columns, &rows)) } }
}

/// A table of phases for the largest simulated run of every strong or weak scaling study.
pub fn phases(groups: &Groups) -> Markup {
    let mut largest: Vec<&Group> = Vec::new();
    for group in groups.all.iter().filter(|g| is_summarised(g)) {
        let is_same_study = |o: &&mut &Group| {
            let weak = group.setup.experiment == "weak";
            o.setup.experiment == group.setup.experiment
                && Subject::of(&o.setup) == Subject::of(&group.setup)
                && (weak || o.cells() == group.cells())
        };
        match largest.iter_mut().find(is_same_study) {
            Some(other) if other.setup.ranks < group.setup.ranks => *other = group,
            Some(_) => {}
            None => largest.push(group),
        }
    }
    html! { @for group in largest { (phases_of(groups, group)) } }
}

fn phases_of(groups: &Groups, group: &Group) -> Markup {
    let (run, network) = (&group.typical, &groups.network);
    let reference = &groups.reference(group).typical;
    let total: f64 = run.phases.iter().map(|p| p.useful_s.max + pop::messages_s(p, network)).sum();
    let columns = [
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
    ];
    let efficiency = |p: &Phase| pop::phase_efficiency(run, p, reference, network);
    let efficiencies: Vec<Efficiency> = run.phases.iter().map(efficiency).collect();
    efficiencies.iter().for_each(check_invariants);
    let row = |(p, e): (&Phase, &Efficiency)| {
        fields([
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
        ])
    };
    let rows: Vec<Vec<Markup>> = run.phases.iter().zip(&efficiencies).map(row).collect();
    let s = &run.setup;
    html! {
        h3 {
            "phases: " (Subject::of(s)) ", " (s.experiment) " scaling, " (grouped(run.cells)) " cells, " (s.ranks) " simulated ranks"
        }
        (table(None, &columns, &rows))
        (remark(&efficiencies, &s.experiment))
    }
}
