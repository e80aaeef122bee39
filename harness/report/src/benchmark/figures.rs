//! The figures of a record: counterparts of the paper's Figures 17 to 23, and time, rate and memory over cells.

use super::groups::{Subject, by_case, engines, point, provenance, repetitions};
use super::paper::{self, cited};
use super::{balance, scaling};
use crate::figure::{Axis, Body, Figure, Point, Provenance, Series};
use bench::experiments::group::{Group, Groups};
use bench::order::{by_key, distinct};
use contract::paper::number;
use statistics::Median;

/// The name of the paper's runs.
const PAPER: &str = "the paper: 1, 2, 32 and 64 ranks";

/// All figures for which the record has runs.
pub fn figures(groups: &Groups) -> Vec<Figure> {
    let mut all = Vec::new();
    all.extend(by_case(groups, "spacing").iter().map(|(of, all)| time_by_spacing(of, all)));
    all.extend(by_case(groups, "layers").iter().map(|(of, all)| time_by_layers(of, all)));
    all.extend(scaling::figures(groups));
    all.extend(balance::figures(groups));
    all.extend(rate_and_memory(groups));
    all
}

fn over_cells(id: String, title: String, caption: String, y: &str, series: Vec<Series>) -> Figure {
    Figure::new(id, title, caption, [Axis::log("cells"), Axis::log(y)], Body::points(series))
}

/// A value of a group over its cells.
fn at(group: &Group, value: Median) -> Point {
    point(group.cells() as f64, value)
}

/// Million cells per second and core.
fn rate(group: &Group) -> Point {
    let (cells, ranks) = (group.cells() as f64, group.setup.ranks as f64);
    at(group, group.time_s.falling(|time_s| cells / time_s / ranks / 1e6))
}

/// A series per program, number and kind of ranks, and per case if there are several, by cells. Programs and cases stay in the order
/// of the record.
fn series(all: &[&Group], value: impl Fn(&Group) -> Point) -> Vec<Series> {
    let cases = distinct(all.iter().map(|g| g.setup.case.as_str()));
    let mut lines = Vec::new();
    for ((case, engine), of) in by_key(all.iter().copied(), |g| (&g.setup.case, &g.setup.engine)) {
        let mut by_ranks = by_key(of, |g| (g.setup.ranks, g.setup.comm));
        by_ranks.sort_by_key(|(ranks, _)| *ranks);
        for ((ranks, _), mut groups) in by_ranks {
            groups.sort_by_key(|g| g.cells());
            let how = provenance(groups[0]);
            let case = if cases.len() == 1 { String::new() } else { format!("{case}, ") };
            let s = if ranks == 1 { "" } else { "s" };
            let name = format!("{case}{engine}, {ranks} rank{s}, {}", how.word());
            let points = groups.iter().map(|g| value(g)).collect();
            lines.push(Series::new(&name, how, lines.len(), points));
        }
    }
    lines
}

/// The counterpart of the paper's Figure 17.
fn time_by_spacing(subject: &Subject, all: &[&Group]) -> Figure {
    let case = subject.mesh();
    let mut series = series(all, |group| at(group, group.time_s));
    let mut caption = format!(
        "Run time of {} over the number of cells of {case} at n = {}. The spacing is halved from point to point. {}. Lines join meshes \
         of one family of spacings.",
        engines(all),
        all[0].setup.layer_cells_min,
        repetitions(all)
    );
    if paper::is_counterpart(subject.case) {
        let runs = paper::runs().map(|(cells, _, time_s)| (cells, time_s));
        series.push(cited(PAPER, runs));
        caption += &format!(
            " The paper's Figure 17, which is linear, is the counterpart; its n is not stated. {}",
            paper::runs_text()
        );
    }
    let title = format!("Run time over cells, by spacing: {case}");
    over_cells(
        format!("time-over-cells-{}", subject.file()),
        title,
        caption,
        "run time / s",
        series,
    )
}

/// The counterpart of the paper's Figure 18. The paper's largest mesh is not drawn: it has no number of ranks.
fn time_by_layers(subject: &Subject, all: &[&Group]) -> Figure {
    let case = subject.mesh();
    let mut layers: Vec<u32> = all.iter().map(|g| g.setup.layer_cells_min).collect();
    layers.sort_unstable();
    layers.dedup();
    let layers: Vec<String> = layers.iter().map(u32::to_string).collect();
    let mut caption = format!(
        "Run time of {} over the number of cells of {case} at a fixed spacing of {:.3e}, with layers of n = {} cells from left to \
         right. {}. Lines join consecutive values of n.",
        engines(all),
        all[0].setup.spacing_min,
        layers.join(", "),
        repetitions(all)
    );
    if paper::is_counterpart(subject.case) {
        let [cells, min] = ["thick_cells", "thick_min"].map(number);
        caption += &format!(
            " The paper's Figure 18, which \"does not scale linearly\", is the counterpart. Its largest mesh, {cells:e} cells in {min} min, \
             has thicker layers and was made \"on the same hardware\" (section IV.B), without a number of ranks."
        );
    }
    let title = format!("Run time over cells, by layer thickness: {case}");
    let series = series(all, |group| at(group, group.time_s));
    over_cells(
        format!("time-over-layers-{}", subject.file()),
        title,
        caption,
        "run time / s",
        series,
    )
}

/// Rate and memory of groups with at most one rank per core, whose wall times are meaningful: those of a study of spacings, or else
/// the serial runs of several meshes or programs.
fn rate_and_memory(groups: &Groups) -> Vec<Figure> {
    let is_measured = |g: &&Group| provenance(g) == Provenance::Measured;
    let of = |experiment: &'static str| {
        let is_of = move |g: &&Group| g.setup.experiment == experiment;
        groups.all.iter().filter(is_measured).filter(is_of)
    };
    let mut all: Vec<&Group> = of("spacing").collect();
    if all.is_empty() {
        all = of("strong").filter(|g| g.setup.ranks == 1).collect();
    }
    if distinct(all.iter().map(|g| (&g.setup.engine, g.cells()))).len() < 2 {
        return Vec::new();
    }
    let cases = distinct(all.iter().map(|group| group.setup.case.as_str())).join(", ");
    let of = format!("over the number of cells: {cases}. {}.", repetitions(&all));
    let engines = engines(&all);
    let mut rates = series(&all, rate);
    let [mut of_rates, mut of_memory] = [const { String::new() }; 2];
    if all.iter().any(|group| paper::is_counterpart(&group.setup.case)) {
        let runs = paper::runs();
        let runs = runs.map(|(cells, ranks, time_s)| (cells, cells / time_s / ranks / 1e6));
        rates.push(cited(PAPER, runs));
        of_rates = format!(" {}", paper::runs_text());
        let bytes = number("voxel_bytes");
        of_memory = format!(
            " A voxel of the paper takes {bytes} bytes (section II), and a tree has more voxels than cells: that is not memory per cell."
        );
    }
    vec![
        over_cells(
            "rate".to_owned(),
            "Cells per second and core".to_owned(),
            format!(
                "Cells per second and core of {engines} {of} Rates are cells over median times.{of_rates}"
            ),
            "million cells / (s core)",
            rates,
        ),
        over_cells(
            "memory".to_owned(),
            "Peak memory per cell".to_owned(),
            format!(
                "Peak resident memory of all ranks of {engines}, program and facets included, {of}{of_memory}"
            ),
            "bytes per cell",
            series(&all, |g| at(g, g.bytes_per_cell())),
        ),
    ]
}
