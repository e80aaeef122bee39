//! The tables of a record, for the page of a report and as text.

use super::groups::{Subject, clocks};
use super::models;
use crate::table::Table;
use bench::experiments::entry::{Comm, Run};
use bench::experiments::group::{Group, Groups};
use bench::experiments::pop::{self, Efficiency, UNKNOWN, above_one, phase_s};
use bench::order::{by_key, distinct};
use contract::number::{digits, grouped};

/// All tables: experiments, projections, phases, models, programs.
pub fn tables(groups: &Groups) -> Vec<Table> {
    let experiments = distinct(groups.all.iter().map(|group| group.setup.experiment.as_str()));
    let mut all: Vec<Table> = experiments.into_iter().map(|of| experiment(groups, of)).collect();
    all.push(projections(groups));
    all.extend(largest(groups).into_iter().map(phases));
    all.extend(models::tables(groups));
    all.extend(programs(groups));
    all.retain(|table| !table.rows.is_empty());
    all
}

/// All tables as text, with the causes of lost efficiency.
pub fn text(groups: &Groups) -> String {
    let mut lines = vec![format!("network: {}", Groups::networks(&groups.all))];
    lines.extend(groups.notes.iter().cloned());
    lines.extend(tables(groups).iter().map(|table| format!("\n{}", table.text().trim_end())));
    lines.push("\ncauses of lost efficiency".to_owned());
    lines.extend(causes(groups).into_iter().map(|cause| "  ".to_owned() + &cause));
    lines.into_iter().map(|line| line + "\n").collect()
}

/// The causes of lost efficiency of all runs on several ranks.
pub fn causes(groups: &Groups) -> Vec<String> {
    let cause = |group: &Group| {
        let (s, cells, how) = (&group.setup, grouped(group.cells()), group.how());
        let cause = pop::cause(&group.typical, &groups.reference(group).typical, &group.network);
        let (subject, experiment, division) = (Subject::of(s), &s.experiment, s.division());
        format!("{subject}, {experiment}, {division}, {cells} cells, {how}: {cause}")
    };
    let all: Vec<_> = groups.all.iter().filter(|group| group.setup.ranks > 1).map(cause).collect();
    if all.is_empty() { vec!["no run is on several ranks".to_owned()] } else { all }
}

/// Time, load imbalance λ = max/mean, POP efficiencies, rate and memory of every group.
fn experiment(groups: &Groups, name: &str) -> Table {
    let of = groups.all.iter().filter(|g| g.setup.experiment == name);
    let of: Vec<(&Group, Option<Efficiency>)> = of.map(|g| (g, groups.efficiency(g))).collect();
    let shown = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.3}"));
    let of_base = |of: &Group, x: Option<f64>| shown(x.filter(|_| groups.has_reference(of)));
    let table = Table::of(
        name.to_owned(),
        &of,
        &[
            ("engine", &|(g, _)| g.setup.engine.clone()),
            ("case", &|(g, _)| g.setup.case.clone()),
            ("cells", &|(g, _)| grouped(g.cells())),
            ("n", &|(g, _)| g.setup.layer_cells_min.to_string()),
            ("partition", &|(g, _)| g.setup.division()),
            ("ranks", &|(g, _)| g.setup.ranks.to_string()),
            ("how", &|(g, _)| g.how().to_owned()),
            ("median\ntime / s,\nor projected\nfrom medians\nper rank", &|(g, _)| {
                digits(g.time_s.value)
            }),
            ("interval", &|(g, _)| [g.time_s.low, g.time_s.high].map(digits).join(" – ")),
            ("coverage", &|(g, _)| format!("{} %", g.time_s.per_cent())),
            ("runs", &|(g, _)| g.time_s.count.to_string()),
            ("λ\n(time)", &|(_, e)| shown(e.map(|e| 1.0 / e.load_balance))),
            ("λ\n(cells)", &|(g, _)| shown(g.lambda_cells())),
            ("serialisation", &|(_, e)| shown(e.map(|e| e.serialisation))),
            ("transfer", &|(_, e)| shown(e.map(|e| e.transfer))),
            ("parallel\nefficiency", &|(_, e)| shown(e.map(|e| e.parallel()))),
            ("computation\nscaling", &|(g, e)| of_base(g, e.map(|e| e.computation_scaling))),
            ("global\nefficiency", &|(g, _)| of_base(g, Some(groups.global_efficiency(g).value))),
            ("base case", &|(g, _)| groups.reference(g).how_on()),
            ("10⁶\ncells / s / rank", &|(g, _)| format!("{:.2}", g.rates().value)),
            ("bytes / cell", &|(g, _)| known(g.bytes_per_cell(), 2, "unknown")),
        ],
    );
    let efficiencies: Vec<Efficiency> = of.iter().filter_map(|(_, e)| *e).collect();
    let without = distinct(of.iter().filter(|(_, e)| e.is_none()).map(|(g, _)| &g.setup.engine));
    let left_out = without.iter().map(|engine| {
        format!("Factors of {engine} are left out (–), and its efficiencies are of run times: {UNKNOWN}.")
    });
    let clocks = clocks(groups.all.iter().filter(|g| g.setup.experiment == name));
    let notes = above_one(&efficiencies).into_iter().chain(left_out).chain(clocks).collect();
    Table { notes, ..table }
}

/// A median with so many decimals, or what is said if it is not known.
fn known(of: Option<statistics::Median>, decimals: usize, unknown: &str) -> String {
    of.map_or(unknown.to_owned(), |of| format!("{:.decimals$}", of.value))
}

/// Projected and measured times of the same meshes on equally many ranks.
fn projections(groups: &Groups) -> Table {
    let error = |[sim, measured]: &[&Group; 2]| sim.time_s.value / measured.time_s.value - 1.0;
    Table::of(
        "projected and measured times".to_owned(),
        &groups.projections(),
        &[
            ("engine", &|[sim, _]| sim.setup.engine.clone()),
            ("case", &|[sim, _]| sim.setup.case.clone()),
            ("experiment", &|[sim, _]| sim.setup.experiment.clone()),
            ("cells", &|[sim, _]| grouped(sim.cells())),
            ("ranks", &|[sim, _]| sim.setup.ranks.to_string()),
            ("projected / s", &|[sim, _]| digits(sim.time_s.value)),
            ("measured / s", &|[_, measured]| digits(measured.time_s.value)),
            ("error", &|pair| format!("{:+.1} %", error(pair) * 100.0)),
        ],
    )
}

/// The first run on the most ranks of every strong or weak scaling study, if these are at least 16 simulated ones.
fn largest<'a>(groups: &'a Groups) -> Vec<&'a Group> {
    let study = |group: &'a Group| {
        let weak = group.setup.experiment == "weak";
        (weak, Subject::of(&group.setup).to_string(), (!weak).then(|| group.cells()))
    };
    let is_shown = |g: &&Group| {
        let scales = ["strong", "weak"].contains(&g.setup.experiment.as_str());
        scales && g.setup.comm == Comm::Sim && g.setup.ranks >= 16
    };
    let studies = by_key(groups.all.iter().filter(is_shown), study);
    let largest = |of: Vec<&'a Group>| of.into_iter().rev().max_by_key(|g| g.setup.ranks);
    studies.into_iter().filter_map(|(_, of)| largest(of)).collect()
}

/// The phases of a group's typical run: useful time and messages.
fn phases(group: &Group) -> Table {
    let (run, network) = (&group.typical, &group.network);
    let total: f64 = run.phases.iter().map(|p| phase_s(run, p, network)).sum();
    let (s, cells) = (&run.setup, grouped(run.cells));
    let (subject, experiment, ranks) = (Subject::of(s), &s.experiment, s.ranks);
    Table::of(
        format!("phases: {subject}, {experiment} scaling, {cells} cells, {ranks} simulated ranks"),
        &run.phases,
        &[
            ("phase", &|p| p.name.clone()),
            ("mean\nuseful\ntime / s", &|p| format!("{:.4}", p.useful_s.sum / ranks as f64)),
            ("max\nuseful\ntime / s", &|p| format!("{:.4}", p.useful_s.max)),
            ("λ", &|p| format!("{:.2}", p.useful_s.lambda(ranks))),
            ("of\nrun\ntime", &|p| format!("{:.1} %", 100.0 * phase_s(run, p, network) / total)),
            ("max\nmessages / rank", &|p| format!("{:.0}", p.messages.max)),
            ("max\nMB / rank", &|p| format!("{:.3}", p.message_bytes.max / 1e6)),
        ],
    )
}

/// A table for every case and n that several programs meshed on one core, with what they do not provide.
///
/// CPU times are those of whole processes, seen from outside: they include the start of the program and reading, hardly depend on other
/// processes, and mean the same for every program. A phase named `search` is the part of that time in which a program finds the facets near
/// an octant. With mpirun, times and memory are those of both.
fn programs(groups: &Groups) -> Vec<Table> {
    let by_size = |g: &&Group| ["strong", "spacing"].contains(&g.setup.experiment.as_str());
    let is_serial = |g: &&Group| g.setup.ranks == 1 && g.setup.comm != Comm::Sim;
    let of_case = |g: &Group| (g.setup.case.clone(), g.setup.layer_cells_min);
    let cases = by_key(groups.all.iter().filter(by_size).filter(is_serial), of_case);
    cases.into_iter().filter_map(|(case, of)| comparison(groups, case, of)).collect()
}

/// The programs in the order of the record, each with its runs by cells; `None` of a single one.
fn comparison(groups: &Groups, (case, n): (String, u32), of: Vec<&Group>) -> Option<Table> {
    let mut programs = by_key(of, |group| group.setup.engine.as_str());
    if programs.len() < 2 {
        return None;
    }
    programs.iter_mut().for_each(|(_, of)| of.sort_by_key(|group| group.cells()));
    let lacks = programs.iter().filter_map(|(name, _)| {
        let lacks = groups.lacks.get(*name).filter(|lacks| !lacks.is_empty())?;
        Some(format!("{name} does not provide: {}", lacks.join(", ")))
    });
    let notes = lacks.collect();
    let all: Vec<&Group> = programs.into_iter().flat_map(|(_, of)| of).collect();
    let rate = |g: &Group| Some(g.cpu_s()?.falling(|s| g.cells() as f64 / s / 1e6));
    let search_s = |g: &Group| {
        g.median_of(|run: &Run| Some(run.phases.iter().find(|p| p.name == "search")?.useful_s.sum))
    };
    let table = Table::of(
        format!("programs on one core: {case}, n = {n}"),
        &all,
        &[
            ("engine", &|g| match g.setup.comm {
                Comm::Mpi => format!("{} with mpirun", g.setup.engine),
                _ => g.setup.engine.clone(),
            }),
            ("cells", &|g| grouped(g.cells())),
            ("CPU\ntime / s", &|g| known(g.cpu_s(), 3, "unknown")),
            ("of\nit\nsearch / s", &|g| known(search_s(g), 2, "not separate")),
            ("10⁶\ncells / s / core", &|g| known(rate(g), 3, "unknown")),
            ("bytes / cell", &|g| known(g.bytes_per_cell(), 1, "unknown")),
        ],
    );
    Some(Table { notes, ..table })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::benchmark::numbers::{Number, numbers};
    use bench::experiments::entry::{Entry, Line, NoResult, Session, Setup, Spread};
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
            "from medians",
            "1,000,000",
            "1.500",
            "3.00 – 3.00",
            "0 %",
            "strong, metis area, 1,000,000 cells, projected: global efficiency of 67 % at 2 ranks",
            "+20.0 %",
            "projected",
        ] {
            assert!(text.contains(part), "{part} is missing in\n{text}");
        }
    }

    #[test]
    fn factors_that_nobody_reports_are_left_out_with_the_reason() {
        let lines = [&[4.0][..], &[2.5, 2.5]].map(|times| {
            let mut run = run(Comm::Mpi, 1_000_000, &[("all", times)]);
            (run.phases, run.useful_s) = (Vec::new(), Spread::default());
            line(Entry::Run(Box::new(run)))
        });
        let groups = Groups::of(&lines);
        let table = experiment(&groups, "strong");
        let value = |name: &str| {
            let at = table.columns.iter().position(|column| *column == name).unwrap();
            table.rows[1][at].as_str()
        };
        for factor in ["λ\n(time)", "serialisation", "transfer", "parallel\nefficiency"] {
            assert_eq!(value(factor), "–", "{factor}");
        }
        assert_eq!(value("global\nefficiency"), "0.800");
        assert!(table.notes[0].contains(UNKNOWN), "{:?}", table.notes);
        assert!(causes(&groups)[0].ends_with(UNKNOWN), "{:?}", causes(&groups));
        let none = text(&Groups::of(&lines[..1]));
        assert!(none.ends_with("efficiency\n  no run is on several ranks\n"), "{none}");
    }

    fn by(engine: &str, cells: u64, phase: &str) -> Line {
        let mut run = run(Comm::Solo, cells, &[(phase, &[0.5]), ("rest", &[1.5])]);
        run.setup.engine = engine.into();
        line(Entry::Run(Box::new(run)))
    }

    #[test]
    fn programs_are_compared_and_what_they_cannot_do_is_stated() {
        let lacks = [("slow".to_owned(), vec!["layers".to_owned(), "MPI".to_owned()])];
        let session = Session { lacks: lacks.into(), ..Session::default() };
        let setup = run(Comm::Solo, 1, &[("a", &[0.0])]).setup;
        let left = NoResult {
            setup: Setup { engine: "slow".into(), spacing_min: 0.05, ..setup },
            why: "slow would take 9 s".into(),
        };
        let lines = [
            line(Entry::Session(Box::new(session))),
            by("mesher", 2_000_000, "refine"),
            by("slow", 1_000_000, "search"),
            line(Entry::LeftOut(left)),
        ];
        let groups = Groups::of(&lines);
        let [table] = &programs(&groups)[..] else { panic!("one comparison") };
        assert_eq!(table.rows[0].join(" "), "mesher 2,000,000 2.000 not separate 1.000 0.5");
        assert_eq!(table.rows[1].join(" "), "slow 1,000,000 2.000 0.50 0.500 1.0");
        assert_eq!(table.notes, ["slow does not provide: layers, MPI"]);
        assert!(text(&groups).contains("n=4 solo:1 metis area: slow would take 9 s"));
        assert!(programs(&Groups::of(&lines[..2])).is_empty(), "one program is no comparison");
        let Entry::Run(mut slow) = lines[2].entry.clone() else { panic!("a run") };
        (slow.time_cpu_s, slow.peak_rss_bytes) = (1.0, Spread::brief(&[]));
        let groups = Groups::of(&[lines[1].clone(), line(Entry::Run(slow))]);
        let rows = &programs(&groups)[0].rows;
        assert_eq!(rows[1].join(" "), "slow 1,000,000 unknown 0.50 unknown unknown");
        assert!(text(&groups).contains("       unknown\n"), "{}", text(&groups));
        let memory = |n: &&Number| n.key.starts_with("slow/") && n.key.ends_with("/memory");
        assert_eq!(numbers(&groups).iter().find(memory), None);
    }
}
