use super::*;
use crate::experiments::entry::{Entry, NoResult, Run};
use crate::testing::{line, run, study as read};
use run::engine::description::Description;
use std::collections::BTreeSet;

const FILE: &str = r#"
    [mesh.cube]
    case = "cube-small"
    spacing_min = 0.1
    [run]
    one = { mesh = "cube", repeats = 3, comm = "sim" }
    two = { mesh = "cube", ranks = 2, comm = "sim", weights = "area" }
    [[row]]
    name = "rate"
    run = ["one", "two"]
    measure = "cells_per_second_per_core"
    at_least = 1e6
    [[row]]
    name = "speed-up"
    run = "two"
    against = "one"
    measure = "speed_up"
    [[row]]
    name = "growth"
    run = ["one", "two"]
    measure = "time_per_cell_growth"
    at_most = 1.05
"#;

#[test]
fn several_runs_are_several_rows_except_for_a_series() {
    let mut study = read(FILE).unwrap();
    let names = |t: &Study| t.row.iter().map(|r| r.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&study), ["rate: one", "rate: two", "speed-up", "growth"]);
    assert!(study.only(&["rat".to_owned()]).unwrap_err().contains("\"rat\""));
    study.only(&["rate".to_owned(), "growth".to_owned()]).unwrap();
    assert_eq!(names(&study), ["rate: one", "rate: two", "growth"]);
}

fn of_repository(name: &str) -> Study {
    let reports = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reports");
    Study::read(&reports.join(name)).unwrap()
}

#[test]
fn the_targets_of_this_repository_are_consistent() {
    for name in ["targets.toml", "paper-partition.toml"] {
        let study = of_repository(name);
        // A run that no row needs is a mistake.
        let used = |name: &&String| study.row.iter().any(|r| r.runs().any(|run| run == *name));
        let unused: Vec<&String> = study.run.keys().filter(|name| !used(name)).collect();
        assert!(unused.is_empty(), "{unused:?}");
    }
}

#[test]
fn the_papers_partition_is_swept_over_depths_and_its_bound_is_that_of_its_speedup() {
    let study = of_repository("paper-partition.toml");
    let paper = study.run.values().filter(|run| run.partitioner == "paper" && run.ranks == 32);
    let swept: BTreeSet<_> = paper.map(|run| (&run.mesh, run.level_base)).collect();
    assert_eq!(swept.len(), 16);
    let bound = (contract::paper::number("parallel_ranks") / contract::paper::speedup() * 100.0)
        .round()
        / 100.0;
    let kept = study.row.iter().filter(|row| row.at_most.is_some());
    let bounds: Vec<_> = kept.map(|row| (row.measure.name, row.at_most)).collect();
    assert_eq!(bounds, vec![("lambda_cells", Some(bound)); 16]);
}

#[test]
fn weights_that_contradict_the_paper_are_refused() {
    let text = "mesh.a.case = 'cube-small'\nrun.one = { mesh = 'a', preset = 'paper', weights = 'area' }\n\
                [[row]]\nname = 'r'\nrun = 'one'\nmeasure = 'seconds'\n";
    assert!(read(text).unwrap_err().contains("weights of 1"));
    assert_eq!(read(&text.replace("area", "unit")).unwrap().run["one"].partitioner, "paper");
}

#[test]
fn the_series_of_this_repository_have_every_experiment() {
    use Experiment::{Layers, Spacing, Strong, Weak, Weights};
    for name in ["small.toml", "full.toml"] {
        let study = of_repository(name);
        let has = |experiment| study.series.iter().any(|s| s.experiment == experiment);
        assert!([Strong, Weak, Spacing, Layers, Weights].into_iter().all(has), "{name}");
    }
}

#[test]
fn ranks_that_an_engine_does_not_offer_are_replaced_by_a_serial_run_or_left_out() {
    let paths = run::engine::paths::Paths::find();
    let find = |name| Description::find(name, &paths).unwrap();
    let [own, parallel, serial] = ["mesher", "p4est", "discretize"].map(find);
    let mut study = of_repository("small.toml");
    let of = |series: &Series, engine, no_mpi| series.layouts(engine, no_mpi);
    let (sim, solo) = ((Comm::Sim, 64), (Comm::Solo, 1));
    study.series.retain(|series| series.experiment == Experiment::Strong);
    let strong = &study.series[0];
    assert_eq!(of(strong, &own, false).len(), strong.sim.len() + strong.mpi.len());
    assert!(of(strong, &own, true).ends_with(&[sim, solo]));
    assert_eq!(of(strong, &parallel, false).len(), strong.mpi.len());
    assert_eq!(of(strong, &serial, false), [solo]);
    let weak = Series { experiment: Experiment::Weak, ..strong.clone() };
    assert!(of(&weak, &serial, false).is_empty());
    let weights = Series { experiment: Experiment::Weights, ..strong.clone() };
    assert!(of(&weights, &parallel, false).is_empty());
    assert_eq!((weights.choices().len(), strong.choices()), (6, &[("", "")][..]));
}

#[test]
fn series_are_selected_by_their_experiment_and_contradictions_are_reported() {
    let text = "[[series]]\nexperiment = 'strong'\ncase = 'cube'\nsim = [1, 2]\n\
                [[series]]\nexperiment = 'weak'\ncase = 'cube'\ncells = [1e4]\nmpi = [1]\n";
    let mut study = read(text).unwrap();
    study.only(&["weak".to_owned()]).unwrap();
    assert_eq!((study.series.len(), study.engines()), (1, vec!["mesher".to_owned()]));
    let growing = read(&text.replace("mpi", "facets = 80\nmpi")).unwrap();
    assert_eq!(growing.series[1].name(), "cube-80-facets-per-rank");
    let twice = format!("[1, 2]\n{}", text.split_inclusive("sim = [1, 2]").next().unwrap());
    for (from, to, why) in [
        ("[1, 2]", "[0]", "ranks are from 1"),
        ("[1, 2]", &twice, "series strong of cube: it is given twice"),
        ("sim", "layers = [2, 0]\nsim", "a layer has at least one cell"),
        ("cells = [1e4]", "cells = [1.0]", "cells is from 1e3"),
        ("cells = [1e4]", "", "give the cells of a rank"),
        ("sim", "facets = 80\nsim", "facets per rank are for weak"),
        ("mpi", "facets = 100000001\nmpi", "facets is from 1 to 1e8"),
        ("mpi = [1]", "", "give ranks"),
        ("'strong'", "'layers'", "give layers"),
        ("weak'\ncase = 'cube'\ncells = [", "spacing'\ncase = 'cube'\ncells = [1e6, ", "of 4e5"),
        ("'strong'", "'luck'", "unknown variant"),
        ("sim", "repeats = 0\nsim", "repeats is at least 1"),
    ] {
        let found = read(&text.replacen(from, to, 1)).unwrap_err();
        assert!(found.contains(why), "{why} is not in: {found}");
    }
}

#[test]
fn what_is_named_twice_is_no_repetition() {
    let text = "[[series]]\nexperiment = 'layers'\ncase = 'cube'\ncells = [1e4, 1e4]\nsim = [1, 2, 1]\nlayers = [1, 1]\n";
    let series = &read(text).unwrap().series[0];
    let layouts = series.layouts(
        &Description::parse(include_str!("../../../../engines/mesher.toml")).unwrap(),
        true,
    );
    assert_eq!((series.sizes().count(), series.setups("mesher", None, 4, &layouts).len()), (1, 2));
}

#[test]
fn contradictions_are_reported() {
    for (from, to, why) in [
        ("mesh = \"cube\", repeats", "mesh = \"ball\", repeats", "run one: no mesh"),
        ("repeats = 3", "repeats = 0", "run one: repeats"),
        ("ranks = 2, comm = \"sim\"", "ranks = 2, comm = \"solo\"", "cannot have 2 ranks"),
        ("against = \"one\"", "", "\"speed-up\": speed_up requires a run in `against`"),
        ("against = \"one\"", "against = \"three\"", "no run is called \"three\""),
        (", comm = \"sim\" }", " }", "\"speed-up\": speed_up compares simulated ranks with other"),
        ("\"speed_up\"", "\"phase_share\"", "does not accept a run"),
        ("spacing_min = 0.1", "spacing_min = 0.1\ncells = 1e6", "not both"),
        ("spacing_min = 0.1", "cells = 5", "from 1e3 to 1e12"),
        ("spacing_min = 0.1", "spacing_min = 0.0", "mesh cube: spacing_min is positive"),
        ("spacing_min = 0.1", "layer_cells_min = 0", "mesh cube: a layer has at least one cell"),
        ("case = \"cube-small\"", "", "missing field"),
        ("measure = \"speed_up\"", "measure = \"speed\"", "unknown variant"),
        ("at_least", "atleast", "unknown field"),
        ("at_least", "at_most = nan\nat_least", "at_least and at_most are finite"),
        ("at_least", "at_most = -1.0\nat_least", "at_least is not more"),
        ("name = \"growth\"", "name = \"rate\"", "two rows are called \"rate\""),
    ] {
        assert!(FILE.contains(from), "{from}");
        let found = read(&FILE.replacen(from, to, 1)).unwrap_err();
        assert!(found.starts_with("FILE: ") && found.contains(why), "{why} is not in: {found}");
    }
    let (without_series, _) = FILE.split_once("[[row]]\n    name = \"growth\"").unwrap();
    let mixed = without_series.replacen(", comm = \"sim\" }", " }", 1);
    assert!(read(&mixed.replace("\"speed_up\"", "\"lambda_cells_ratio\"")).is_ok());
    assert!(read("").unwrap_err().contains("no [[series]] and no [[row]]"));
}

#[test]
fn case_files_of_one_name_would_be_meshed_around_one_geometry() {
    let series = "[[series]]\nexperiment = 'weak'\ncase = 'a/wing.toml'\ncells = [1e4]\nfacets = 9\nsim = [1]\n";
    let elsewhere = series.replace("a/", "b/").replace("facets = 9\n", "");
    for other in [elsewhere.as_str(), "[mesh.new]\ncase = 'b/wing.toml'\n"] {
        let why = read(&format!("{series}{other}")).unwrap_err();
        assert!(why.contains("wing.toml have the same name: rename one"), "{why}");
    }
    assert!(read(&format!("{series}[mesh.new]\ncase = 'a/wing.toml'\n")).is_ok());
}

#[test]
fn a_study_asks_for_its_runs_alone() {
    let text = "[[series]]\nexperiment = 'strong'\ncase = 'cube'\ncells = [1e6]\nsim = [1, 2]\n\
                engines = ['mesher', 'x/p4est.toml']\n[[series]]\nexperiment = 'layers'\ncase = 'cube'\ncells = [1e4]\nlayers = [1, 2]\nsim = [1]\n";
    let study = read(text).unwrap();
    let strong = |change: fn(&mut Run)| {
        let mut run = run(Comm::Sim, 2_000_000, &[("a", &[1.0, 1.0])]);
        (run.setup.weights, run.setup.partitioner) = Default::default();
        change(&mut run);
        study.unasked(&line(Entry::Run(Box::new(run)))).is_none()
    };
    let asked: [fn(&mut Run); 4] = [
        |_| (),
        |run| (run.setup.comm, run.setup.ranks) = (Comm::Solo, 1),
        // Another program may make far fewer cells.
        |run| (run.cells, run.setup.engine) = (9, "p4est".into()),
        |run| {
            (run.setup.experiment, run.setup.series_cells) = ("layers".into(), Some(1e4));
            (run.setup.layer_cells_min, run.setup.ranks) = (2, 1);
        },
    ];
    assert_eq!(asked.map(strong), [true; 4]);
    let others: [fn(&mut Run); 10] = [
        |run| run.setup.engine = "other".into(),
        // In the other series.
        |run| {
            run.setup.engine = "p4est".into();
            (run.setup.experiment, run.setup.series_cells) = ("layers".into(), Some(1e4));
            (run.setup.layer_cells_min, run.setup.ranks) = (2, 1);
        },
        |run| run.setup.experiment = "weak".into(),
        |run| run.setup.case = "ball".into(),
        |run| run.setup.ranks = 4,
        |run| run.setup.comm = Comm::Mpi,
        |run| run.setup.weights = "unit".into(),
        |run| run.cells = 9,
        |run| {
            (run.setup.experiment, run.setup.series_cells) = ("layers".into(), Some(5e4));
            (run.setup.layer_cells_min, run.setup.ranks) = (2, 1);
        },
        |run| {
            (run.setup.experiment, run.setup.series_cells) = ("layers".into(), Some(1e4));
            run.setup.ranks = 1;
        },
    ];
    assert_eq!(others.map(strong), [false; 10]);
    // What failed or was left out is of an experiment, too.
    let setup = Setup { experiment: "weak".into(), ..Setup::serial("cube", 1.0, 4) };
    let without = NoResult { setup: setup.clone(), why: String::new() };
    for entry in [Entry::Failure(without.clone()), Entry::LeftOut(without)] {
        assert_eq!(study.unasked(&line(entry)), Some(&setup));
    }
}

/// As after an edit of the study.
#[test]
fn a_run_of_another_size_is_not_that_of_a_row() {
    let asks = |cells: &str| {
        let mesh = format!("[mesh.wing]\ncase = 'cube'\ncells = {cells}\n");
        let row = "[run]\none = { mesh = 'wing' }\n[[row]]\nname = 'time'\nrun = 'one'\nmeasure = 'seconds'\n";
        let study = read(&format!("{mesh}{row}")).unwrap();
        let setup = study.run["one"].setup(0.1, 4);
        let made = Run { setup, ..run(Comm::Mpi, 2_000_000, &[("a", &[1.0])]) };
        study.unasked(&line(Entry::Run(Box::new(made)))).is_none()
    };
    assert_eq!(["1e6", "2e8"].map(asks), [true, false]);
}
