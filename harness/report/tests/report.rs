//! A report from a record of every experiment: its files, its trend, its page.

use bench::experiments::entry::{
    ASSUMED, Comm, Entry, Line, Machine, Network, Phase, Run, SCHEMA, Session, Setup, Spread,
};
use report::benchmark::report;
use std::path::Path;

fn line(entry: Entry) -> Line {
    Line {
        schema: SCHEMA.into(),
        session: "s".into(),
        time_utc: "2026-01-31T12:00:00Z".into(),
        entry,
    }
}

fn session() -> Line {
    let machine = Machine {
        cpu: "A <Chip> & more".into(),
        cores: 2,
        memory_bytes: 1 << 34,
        kernel: "Linux 6".into(),
        mpi: "mpirun (Open MPI) 4.1.4".into(),
        compiler: "rustc 1.95.0".into(),
        commit: "0123456789ab".into(),
    };
    let command = vec!["harness".into(), "bench".into()];
    let lacks = [("other".to_owned(), vec!["MPI".to_owned()])].into();
    line(Entry::Session(Box::new(Session {
        command,
        machine,
        nodes: String::new(),
        load_average: 0.0,
        lacks,
    })))
}

/// Six repetitions of a run with nearly the same load on every rank.
fn run(experiment: &str, comm: Comm, ranks: usize, cells: u64, n: u32, weights: &str) -> Vec<Line> {
    let times = |repeat: usize| -> Vec<f64> {
        let mean = cells as f64 / 1e6 / ranks as f64;
        (0..ranks).map(|r| mean * (1.0 + 0.01 * ((r + repeat) % 5) as f64)).collect()
    };
    let one = |repeat: usize| {
        let useful = Spread::of(&times(repeat));
        let phase = |name: &str| Phase {
            name: name.into(),
            useful_s: useful.clone(),
            wall_s: useful.clone(),
            messages: Spread::of(&vec![3.0; ranks]),
            message_bytes: Spread::of(&vec![4096.0; ranks]),
        };
        let setup = Setup {
            experiment: experiment.into(),
            engine: "mesher".into(),
            case: "uav".into(),
            spacing_min: 1.0 / (cells as f64).sqrt()
                * if experiment == "layers" { 0.0 } else { 1.0 },
            layer_cells_min: n,
            ranks,
            comm,
            partitioner: if weights.is_empty() { String::new() } else { "morton".into() },
            weights: weights.into(),
            ..Setup::default()
        };
        let both_phases: Vec<f64> = times(repeat).iter().map(|t| 2.0 * t).collect();
        let counters = [
            ("leaves".to_owned(), Spread::of(&vec![cells as f64 / ranks as f64; ranks])),
            ("base_leaf_cells_max".to_owned(), Spread::of(&vec![cells as f64 / 500.0; ranks])),
        ];
        line(Entry::Run(Box::new(Run {
            setup,
            repeat,
            warm_up: false,
            oversubscribed: comm == Comm::Mpi && ranks > 2,
            command: "mesher uav.toml".into(),
            program: String::new(),
            inputs: String::new(),
            scripts: String::new(),
            geometry: None,
            facets: 1000,
            cells,
            digest: "0".repeat(32),
            time_wall_s: 2.0 * useful.max,
            time_launch_s: 3.0 * useful.max,
            time_cpu_s: 3.0 * useful.sum,
            peak_rss_bytes: Spread::of(&vec![1e6; ranks]),
            useful_s: Spread::of(&both_phases),
            phases: vec![phase("refine"), phase("grade")],
            counters: counters.into_iter().collect(),
        })))
    };
    (0..6).map(one).collect()
}

fn record() -> Vec<Line> {
    let network =
        Network { latency_s: 1e-6, bandwidth_bytes_per_s: 1e10, measured: true, ..ASSUMED };
    let mut lines = vec![session(), line(Entry::Network(network))];
    for ranks in [1, 2, 4, 16, 32, 64] {
        lines.extend(run("strong", Comm::Sim, ranks, 50_000_000, 4, ""));
        lines.extend(run("weak", Comm::Sim, ranks, 1_000_000 * ranks as u64, 4, ""));
    }
    for ranks in [1, 2, 4] {
        lines.extend(run("strong", Comm::Mpi, ranks, 50_000_000, 4, ""));
    }
    for ranks in [1, 2] {
        for k in 0..4 {
            lines.extend(run("spacing", Comm::Mpi, ranks, 100_000 << (2 * k), 4, ""));
            lines.extend(run("layers", Comm::Mpi, ranks, 400_000 << k, 1 << k, ""));
        }
    }
    // Records of earlier versions have weights that the mesher no longer offers.
    for weights in ["unit", "area", "former"] {
        lines.extend(run("weights", Comm::Sim, 64, 4_000_000, 4, weights));
    }
    lines
}

/// Names of the figures' files with an extension, without it.
fn files(place: &Path, extension: &str) -> Vec<String> {
    let entries = std::fs::read_dir(place.join("figures")).unwrap();
    let names = entries.map(|e| e.unwrap().file_name().into_string().unwrap());
    let suffix = format!(".{extension}");
    let mut found: Vec<String> =
        names.filter_map(|n| n.strip_suffix(&suffix).map(str::to_owned)).collect();
    found.sort();
    found
}

/// Whether a row of a figure's values has an abscissa and ends like this.
fn has_row(text: &str, x: &str, end: &str) -> bool {
    text.lines().any(|line| line.split(',').nth(1) == Some(x) && line.ends_with(end))
}

#[test]
fn every_figure_has_its_values_and_its_axis_for_latex() {
    let place = tempfile::tempdir().unwrap();
    let written = report(place.path(), &record()).unwrap();
    let drawn = files(place.path(), "svg");
    assert_eq!(drawn.len(), written.figures);
    let mut extensions = vec!["csv", "tex"];
    if cfg!(feature = "figures") {
        extensions.extend(["pdf", "png"]);
    }
    for extension in extensions {
        assert_eq!(files(place.path(), extension), drawn, "{extension}");
    }
    for figure in [
        "time-over-cells-uav",
        "time-over-layers-uav",
        "speedup-uav-50M",
        "efficiency-strong-uav-50M",
        "efficiency-weak-uav",
        "phases-strong-uav-50M",
        "phases-weak-uav",
        "balance-uav-4M-64",
        "per-rank-uav-16",
        "per-rank-uav-32",
        "per-rank-uav-64",
        "rate-uav",
        "memory-uav",
    ] {
        assert!(drawn.iter().any(|d| d == figure), "{figure} is missing among {drawn:?}");
    }
    let speedup =
        std::fs::read_to_string(place.path().join("figures/speedup-uav-50M.csv")).unwrap();
    for (x, end) in [
        ("4", "mesher; oversubscribed,oversubscribed"),
        ("64", "mesher; projected,projected"),
        ("32", ",the paper; 50 M cells,cited"),
    ] {
        assert!(has_row(&speedup, x, end), "{x} {end}: {speedup}");
    }
    assert!(speedup.contains(",32,11.28"), "{speedup}");
    assert!(place.path().join("figures.tex").is_file());
    let numbers = std::fs::read_to_string(place.path().join("numbers.tex")).unwrap();
    assert!(numbers.contains("\\defresult{mesher/uav/strong/"), "{numbers}");
    assert!(written.broken.is_empty(), "{:?}", written.broken);
    let bars = |name: &str| {
        std::fs::read_to_string(place.path().join("figures").join(format!("{name}.csv"))).unwrap()
    };
    let balance = bars("balance-uav-4M-64");
    assert!(balance.contains(",2,morton former,cells,measured\n"), "{balance}");
    assert!(!balance.contains("target"), "{balance}");
    let load = std::fs::read_to_string(place.path().join("figures/per-rank-uav-64.csv")).unwrap();
    assert!(has_row(&load, "63", ",useful time,projected"), "{load}");
}

#[test]
fn two_programs_are_never_in_one_series() {
    let mut lines = record();
    let other = |line: &Line| {
        let mut line = line.clone();
        if let Entry::Run(run) = &mut line.entry {
            run.setup.engine = "other".into();
            run.time_wall_s *= 3.0;
            run.phases[0].name = "search".into();
        }
        line
    };
    lines.extend(record().iter().map(other));
    let place = tempfile::tempdir().unwrap();
    let written = report(place.path(), &lines).unwrap();
    // Both report a time of their own.
    let page = std::fs::read_to_string(&written.page).unwrap();
    assert!(!page.contains("different clocks"), "{page}");
    // Figures over cells show both programs, all others one.
    assert_eq!(written.figures, 2 * (files_of_one() - 4) + 4);
    let read = |name: &str| {
        std::fs::read_to_string(place.path().join("figures").join(format!("{name}.csv"))).unwrap()
    };
    for name in ["time-over-cells-uav", "time-over-layers-uav", "rate-uav", "memory-uav"] {
        let text = read(name);
        for engine in ["mesher", "other"] {
            for ranks in ["1 rank", "2 ranks"] {
                let series = format!(",{engine}; {ranks}; measured,");
                assert_eq!(text.matches(&series).count(), 4, "{series} in {name}:\n{text}");
            }
        }
    }
    assert!(has_row(&read("speedup-other-uav-50M"), "64", "other; projected,projected"));
    assert!(has_row(&read("efficiency-weak-other-uav"), "64", "global,projected"));
    assert!(read("phases-weak-other-uav").contains(",64,grade,projected\n"));
    let page = std::fs::read_to_string(&written.page).unwrap();
    assert!(page.contains("Speedup: uav by other") && page.contains("uav by mesher"), "{page}");
    assert!(page.contains("other does not provide: MPI"), "{page}");
    assert!(page.matches("<td>other</td>").count() == page.matches("<td>mesher</td>").count());
}

/// A program that reports no time is timed from outside, which a figure that shows both must state.
#[test]
fn times_of_different_clocks_are_named() {
    let mut lines = record();
    let other = |line: &Line| {
        let mut line = line.clone();
        if let Entry::Run(run) = &mut line.entry {
            run.setup.engine = "other".into();
            run.time_wall_s = run.time_launch_s;
        }
        line
    };
    lines.extend(record().iter().map(other));
    let place = tempfile::tempdir().unwrap();
    let page = std::fs::read_to_string(report(place.path(), &lines).unwrap().page).unwrap();
    let clocks = "Measured times are of different clocks: mesher: the program&#39;s own clock; other: the whole process";
    // The figures of time over cells, time over layers and the rate, and the tables of experiments with measured runs.
    let count = page.replace("&#39;", "'").matches(&clocks.replace("&#39;", "'")).count();
    assert_eq!(count, 6, "{page}");

    // Of one program, whose clock shows nothing on several ranks: its speedup says so, and is no number for a text.
    let mut lines = record();
    for line in &mut lines {
        if let Entry::Run(run) = &mut line.entry
            && (run.setup.comm, run.setup.ranks > 1) == (Comm::Mpi, true)
        {
            run.time_wall_s = run.time_launch_s;
        }
    }
    let place = tempfile::tempdir().unwrap();
    let page = std::fs::read_to_string(report(place.path(), &lines).unwrap().page).unwrap();
    assert!(page.contains("own clock; mesher: the whole process"), "{page}");
    let numbers = |at: &Path| std::fs::read_to_string(at.join("numbers.tex")).unwrap();
    let speedups = |text: String| text.matches("/measured/speedup").count();
    let all = tempfile::tempdir().unwrap();
    report(all.path(), &record()).unwrap();
    assert!(speedups(numbers(place.path())) < speedups(numbers(all.path())));
}

/// The model has steps just after powers of two.
#[test]
fn the_line_of_a_model_has_integer_ranks_and_those_of_all_runs() {
    let all = [2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 256];
    let meshes =
        |ranks| [25_000_000, 50_000_000].map(|n| run("strong", Comm::Sim, ranks, n, 4, ""));
    let runs = all.map(|ranks| meshes(ranks).concat());
    let lines = [vec![session()], runs.concat()].concat();
    let place = tempfile::tempdir().unwrap();
    report(place.path(), &lines).unwrap();
    let text = std::fs::read_to_string(place.path().join("figures/model-uav-50M.csv")).unwrap();
    let line = text.lines().filter(|row| row.contains("model and its band"));
    let ranks: Vec<f64> = line.map(|row| row.split(',').nth(1).unwrap().parse().unwrap()).collect();
    assert!(ranks.iter().all(|ranks| ranks.fract() == 0.0), "{text}");
    assert!(all.iter().all(|of| ranks.contains(&(*of as f64))), "{text}");
}

#[test]
fn figures_that_an_earlier_report_left_are_named() {
    let place = tempfile::tempdir().unwrap();
    let lines = record();
    assert_eq!(
        report(place.path(), &lines).unwrap().notes,
        report(place.path(), &lines).unwrap().notes
    );
    let is_weak = |line: &Line| line.run().is_some_and(|run| run.setup.experiment == "weak");
    let fewer: Vec<Line> = lines.into_iter().filter(|line| !is_weak(line)).collect();
    let notes = report(place.path(), &fewer).unwrap().notes;
    let named = "figures/ also has figures that are not of this report: efficiency-weak-uav.svg, phases-weak-uav.svg";
    assert!(notes.iter().any(|note| note == named), "{notes:?}");
    assert!(place.path().join("figures/phases-weak-uav.svg").is_file());
}

/// A measured point far above ideal, of which the factors are below 1, beside projected ones with computation scaling above 1.
#[test]
fn the_reason_of_a_speedup_is_that_of_its_own_point() {
    let mut lines: Vec<Line> = Vec::new();
    for (comm, ranks) in [(Comm::Sim, 1), (Comm::Sim, 4), (Comm::Mpi, 1), (Comm::Mpi, 4)] {
        let mut of = run("strong", comm, ranks, 50_000_000, 4, "");
        for line in &mut of {
            let Entry::Run(run) = &mut line.entry else { panic!("a run") };
            let factor = match (comm, ranks) {
                (Comm::Sim, 1) => 3.0,
                _ => 1.0,
            };
            run.useful_s =
                Spread::of(&run.useful_s.by_rank.iter().map(|s| s * factor).collect::<Vec<_>>());
            for phase in &mut run.phases {
                phase.useful_s = Spread::of(
                    &phase.useful_s.by_rank.iter().map(|s| s * factor).collect::<Vec<_>>(),
                );
            }
            if (comm, ranks) == (Comm::Mpi, 1) {
                (run.time_wall_s, run.time_launch_s) =
                    (run.time_wall_s * 4.0, run.time_launch_s * 4.0);
            }
        }
        lines.extend(of);
    }
    lines.insert(0, session());
    let place = tempfile::tempdir().unwrap();
    report(place.path(), &lines).unwrap();
    let tex = std::fs::read_to_string(place.path().join("figures.tex")).unwrap();
    for part in [
        "Above ideal (projected on 4 ranks): Computation scaling is above 1",
        "Above ideal (oversubscribed on 4 ranks): A speedup per rank above 1 means",
    ] {
        assert!(tex.contains(part), "{part} is missing in {tex}");
    }
}

/// Number of figures of the record of one program.
fn files_of_one() -> usize {
    report(tempfile::tempdir().unwrap().path(), &record()).unwrap().figures
}

/// A name that is no name of a file, and one that is another's after that: every figure has files of its own.
#[test]
fn figures_of_any_case_and_program_have_files_of_their_own() {
    let named = |case: &'static str, engine: &'static str| {
        record().into_iter().map(move |mut line| {
            if let Entry::Run(run) = &mut line.entry {
                (run.setup.case, run.setup.engine) = (case.into(), engine.into());
            }
            line
        })
    };
    let both = named("a b", "p/4").chain(named("a-b", "p-4")).collect::<Vec<_>>();
    let place = tempfile::tempdir().unwrap();
    let written = report(place.path(), &both).unwrap();
    let drawn = files(place.path(), "svg");
    assert_eq!(drawn.len(), written.figures);
    for name in
        ["phases-strong-p-4-a-b-50M", "phases-strong-p-4-a-b-50M-2", "speedup-p-4-a-b-50M-2"]
    {
        assert!(drawn.iter().any(|d| d == name), "{name} is missing among {drawn:?}");
    }
    for name in &drawn {
        let text =
            std::fs::read_to_string(place.path().join(format!("figures/{name}.svg"))).unwrap();
        // References to other elements would need names without special characters.
        assert!(!text.contains("url("), "{name}");
    }
}

/// The cost of the second mesh per cell is lower than that of the first.
#[test]
fn an_efficiency_above_one_has_its_reason_in_figure_table_and_summary() {
    let mut lines = record();
    for line in &mut lines {
        if let Entry::Run(run) = &mut line.entry
            && run.setup.experiment == "weak"
            && run.setup.ranks == 1
        {
            run.useful_s = Spread::of(&[run.useful_s.sum * 5.0]);
            run.phases.iter_mut().for_each(|p| p.useful_s = Spread::of(&[p.useful_s.sum * 5.0]));
        }
    }
    let place = tempfile::tempdir().unwrap();
    let page = std::fs::read_to_string(report(place.path(), &lines).unwrap().page).unwrap();
    let reason =
        "Computation scaling is above 1 where all ranks together take less CPU time per cell";
    // The figure of the efficiency, the table of the experiment, and the causes on 2, 4, 16, 32 and 64 ranks.
    assert_eq!(page.matches(reason).count(), 7, "{page}");
    assert!(
        !std::fs::read_to_string(report(place.path(), &record()).unwrap().page)
            .unwrap()
            .contains(reason)
    );
}

/// The page had no causes where no ranks were simulated, although the terminal listed them.
#[test]
fn measured_runs_have_their_causes_on_the_page() {
    let mut lines = record();
    lines.retain(|line| !matches!(&line.entry, Entry::Run(run) if run.setup.comm == Comm::Sim));
    let place = tempfile::tempdir().unwrap();
    let page = std::fs::read_to_string(report(place.path(), &lines).unwrap().page).unwrap();
    assert!(
        page.contains("uav by mesher, strong, default, 50,000,000 cells, measured: "),
        "{page}"
    );
}

#[test]
fn the_page_is_self_contained() {
    let place = tempfile::tempdir().unwrap();
    let page = std::fs::read_to_string(report(place.path(), &record()).unwrap().page).unwrap();
    for external in ["<script", "<link", "<img", "<iframe", "src=", "@import"] {
        assert!(!page.contains(external), "{external}");
    }
    assert_eq!(page.matches("url(").count(), page.matches("url(#").count());
    // The namespace of SVG is a name, not an address.
    let rest = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!rest.contains("http:") && !rest.contains("https:"));
    for reference in rest.split("href=\"").skip(1) {
        assert!(reference.starts_with('#') || reference.starts_with("data:"), "{reference:.40}");
    }
    assert_eq!(page.matches("<figure").count(), page.matches("</figure>").count());
    assert!(
        page.contains("prefers-color-scheme: dark") && page.contains("A &lt;Chip&gt; &amp; more")
    );
    assert!(page.contains("projected and measured times"));
}
