//! The figures of a record: counterparts of the paper's Figures 17 to 23, messages, rate and memory.

use super::groups::{by_case, engines, point, provenance, repetitions};
use super::paper::{self, cited};
use super::{balance, matrix, programs, scaling};
use crate::figure::{Axis, Body, Claims, Figure, Point, Provenance, Series, svg};
use bench::experiments::entry::{Comm, Setup};
use bench::experiments::group::{Group, Groups};
use bench::order::{by_key, distinct};

/// All figures for which the record has runs.
pub fn figures(groups: &Groups) -> Vec<Figure> {
    let mut all = Vec::new();
    all.extend(time_over_cells(groups));
    all.extend(time_over_layers(groups));
    all.extend(scaling::figures(groups));
    all.extend(balance::figures(groups));
    all.extend(matrix::figures(groups));
    all.extend(rate(groups));
    all.extend(memory(groups));
    all.extend(programs::figures(groups));
    all
}

/// What one line of a figure over cells shows: case, program, number and kind of ranks.
type Line<'a> = (&'a str, &'a str, usize, Comm);

/// The groups of every line, by cells.
fn by_line<'a>(all: &[&'a Group]) -> Vec<(Line<'a>, Vec<&'a Group>)> {
    let line = |group: &'a Group| -> Line<'a> {
        let s = &group.setup;
        (&s.case, &s.engine, s.ranks, s.comm)
    };
    let mut out = by_key(all.iter().copied(), line);
    // Programs and cases stay in the order of the record.
    let first = |line: &Line| {
        all.iter()
            .position(|g| (g.setup.case.as_str(), g.setup.engine.as_str()) == (line.0, line.1))
    };
    out.sort_by_key(|(line, _)| (first(line), line.2, line.3));
    for (_, groups) in &mut out {
        groups.sort_by_key(|g| g.cells());
    }
    out
}

/// A series per program, number and kind of ranks, and per case if there are several.
fn series(all: &[&Group], value: impl Fn(&Group) -> Point) -> Vec<Series> {
    let one_case = all.iter().all(|g| g.setup.case == all[0].setup.case);
    let of_line = |(style, ((case, engine, ranks, _), groups)): (usize, (Line, Vec<&Group>))| {
        let how = provenance(groups[0]);
        let points = groups.iter().map(|g| value(g)).collect();
        let case = if one_case { String::new() } else { format!("{case}, ") };
        let s = if ranks == 1 { "" } else { "s" };
        let name = format!("{case}{engine}, {ranks} rank{s}, {}", how.word());
        Series::new(&name, how, style, points)
    };
    by_line(all).into_iter().enumerate().map(of_line).collect()
}

fn time(group: &Group) -> Point {
    point(group.cells() as f64, group.time_s)
}

/// The counterpart of the paper's Figure 17.
fn time_over_cells(groups: &Groups) -> Vec<Figure> {
    let of_case = |(case, all): (&str, Vec<&Group>)| {
        let mut series = series(&all, time);
        let runs = paper::RUNS.iter().map(|r| (r.cells, r.time_s));
        series.push(cited("the paper: 1, 32 and 64 ranks", runs));
        Figure {
            id: format!("time-over-cells-{case}"),
            title: format!("Run time over cells, by spacing: {case}"),
            caption: format!(
                "Run time of {} over the number of cells of {case} at n = {} (the paper's Figure 17). The spacing is halved from \
                 point to point. {}. Lines join meshes of one family of spacings. The points of the paper are from its text: 50 million cells \
                 in 22 min on 1 rank and in 117 s on 32 ranks, 1e9 cells in under 45 min on 64 ranks, on Intel X5355 CPUs and for another geometry.",
                engines(&all),
                all[0].setup.layer_cells_min,
                repetitions(&all)
            ),
            x: Axis::log("cells"),
            y: Axis::log("run time / s"),
            body: Body::points(series),
            height: svg::HEIGHT,
            claims: Claims::default(),
        }
    };
    by_case(groups, "spacing").into_iter().map(of_case).collect()
}

/// The counterpart of the paper's Figure 18.
fn time_over_layers(groups: &Groups) -> Vec<Figure> {
    let of_case = |(case, all): (&str, Vec<&Group>)| {
        let mut layers: Vec<u32> = all.iter().map(|g| g.setup.layer_cells_min).collect();
        layers.sort_unstable();
        layers.dedup();
        let layers: Vec<String> = layers.iter().map(u32::to_string).collect();
        Figure {
            id: format!("time-over-layers-{case}"),
            title: format!("Run time over cells, by layer thickness: {case}"),
            caption: format!(
                "Run time of {} over the number of cells of {case} at a fixed spacing of {:.3e}, with layers of n = {} cells from left to \
                 right (the paper's Figure 18, which is not linear). {}. Lines join consecutive values of n. The largest mesh in \
                 the text of the paper, 1.6e9 cells in 132 min, was made with thicker layers on \"the same hardware\".",
                engines(&all),
                all[0].setup.spacing_min,
                layers.join(", "),
                repetitions(&all)
            ),
            x: Axis::log("cells"),
            y: Axis::log("run time / s"),
            // The paper's largest mesh is not drawn: its time is so far above ours that the curves would look flat.
            body: Body::points(series(&all, time)),
            height: svg::HEIGHT,
            claims: Claims::default(),
        }
    };
    by_case(groups, "layers").into_iter().map(of_case).collect()
}

/// Groups with at most one rank per core, whose wall times are meaningful.
fn measured(groups: &Groups, predicate: impl Fn(&Setup) -> bool) -> Vec<&Group> {
    let is_measured = |g: &&Group| provenance(g) == Provenance::Measured && predicate(&g.setup);
    groups.all.iter().filter(is_measured).collect()
}

/// The cases of some groups without repetitions, as text.
fn cases(all: &[&Group]) -> String {
    distinct(all.iter().map(|group| group.setup.case.as_str())).join(", ")
}

fn rate(groups: &Groups) -> Option<Figure> {
    let all = measured(groups, |s| s.experiment == "spacing");
    let value = |g: &Group| {
        let rate = |time_s: f64| g.cells() as f64 / time_s / g.setup.ranks as f64 / 1e6;
        point(g.cells() as f64, g.time_s.falling(rate))
    };
    let mut series = series(&all, value);
    let rates = paper::RUNS.iter().map(|r| (r.cells, r.cells / r.time_s / r.ranks as f64 / 1e6));
    series.push(cited("the paper: 1, 32 and 64 ranks", rates));
    (!all.is_empty()).then(|| Figure {
        id: "rate".into(),
        title: "Cells per second and core".into(),
        caption: format!(
            "Cells per second and core of {} over the number of cells: {}. {}. Rates are cells over median times.",
            engines(&all),
            cases(&all),
            repetitions(&all)
        ),
        x: Axis::log("cells"),
        y: Axis::log("million cells / (s core)"),
        body: Body::points(series),
        height: svg::HEIGHT,
        claims: Claims::default(),
    })
}

fn memory(groups: &Groups) -> Option<Figure> {
    let all = measured(groups, |s| s.experiment == "spacing");
    let mut series = series(&all, |g| point(g.cells() as f64, g.bytes_per_cell()));
    series.push(cited("the paper: 84 bytes per voxel", [(50e6, 84.0)]));
    (!all.is_empty()).then(|| Figure {
        id: "memory".into(),
        title: "Peak memory per cell".into(),
        caption: format!(
            "Peak resident memory of all ranks of {} over the number of cells, program and facets included: {}. {}.",
            engines(&all),
            cases(&all),
            repetitions(&all)
        ),
        x: Axis::log("cells"),
        y: Axis::log("bytes per cell"),
        body: Body::points(series),
        height: svg::HEIGHT,
        claims: Claims::default(),
    })
}
