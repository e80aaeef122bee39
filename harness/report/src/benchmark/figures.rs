//! Figures over cells: run time (counterparts of the paper's Figures 17 and 18), rate and memory. All numbers of the paper are those of `reports/paper.md`.

use super::groups::{OWN, Subject, cited, clocks, is_counterpart, point, provenance, repetitions};
use super::{models, scaling};
use crate::figure::{Axis, Figure, Provenance, Series};
use bench::experiments::entry::Comm;
use bench::experiments::group::{Group, Groups};
use bench::order::{by_key, distinct};
use contract::paper::number;
use statistics::Median;
use std::collections::BTreeSet;

/// All figures for which the record has runs.
pub fn figures(groups: &Groups) -> Vec<Figure> {
    let by_case = |is_of: &dyn Fn(&Group) -> bool| {
        let of = groups.all.iter().filter(|group| is_of(group));
        // These figures show all programs.
        by_key(of, |group| Subject { engine: OWN, ..Subject::of(&group.setup) })
    };
    let of = |experiment: &'static str| by_case(&move |g| g.setup.experiment == experiment);
    let mut all: Vec<Figure> = of("spacing").iter().map(|(of, all)| by_spacing(of, all)).collect();
    all.extend(of("layers").iter().map(|(of, all)| by_layers(of, all)));
    all.extend(scaling::figures(groups));
    all.extend(models::figures(groups));
    // Wall times are meaningful with at most one rank per core.
    let is_compared = |g: &Group| match g.setup.experiment.as_str() {
        "spacing" => provenance(g) == Provenance::Measured,
        "strong" => g.setup.comm == Comm::Solo && of("spacing").is_empty(),
        _ => false,
    };
    for (subject, of) in by_case(&is_compared) {
        if distinct(of.iter().map(|g| (&g.setup.engine, g.cells()))).len() > 1 {
            all.extend(rate_and_memory(&subject, &of));
        }
    }
    all
}

/// The figure with a sentence on the paper, if it is of the counterpart of the paper's case; and with the runs of which the paper's text
/// states cells, ranks and time, if a value of them is given.
fn with_paper(mut figure: Figure, subject: &Subject, note: &str, value: Option<Value>) -> Figure {
    if !is_counterpart(subject.case) {
        return figure;
    }
    figure.caption += note;
    let Some(value) = value else { return figure };
    let [second, parallel, most] = ["second_ranks", "parallel_ranks", "largest_ranks"].map(number);
    let runs = [
        ("serial_cells", 1.0, 60.0 * number("serial_min")),
        ("second_cells", second, 60.0 * number("second_min")),
        ("serial_cells", parallel, number("parallel_s")),
        ("largest_cells", most, 60.0 * number("largest_min")),
    ];
    let points = runs.map(|(cells, ranks, s)| (number(cells), value(number(cells), ranks, s)));
    let name = format!("the paper: 1, {second}, {parallel} and {most} ranks");
    figure.series.push(cited(&name, points));
    figure.caption += &format!(
        " The points of the paper are from its text (sections IV.B and V), not from its figures: around another UAV, on Intel X5355 CPUs; of n, nothing is \
         stated. The time on {second} ranks is a lower bound, that on {most} an upper bound."
    );
    figure
}

/// A value of cells, ranks and time in seconds.
type Value = fn(f64, f64, f64) -> f64;

/// A value of all groups over their cells. The names are those of its file, of its title and of the vertical axis; the caption states what
/// is shown, and of which meshes.
fn over_cells(
    subject: &Subject,
    all: &[&Group],
    [id, title, y]: [&str; 3],
    [what, which]: [&str; 2],
    value: impl Fn(&Group) -> Median,
) -> Figure {
    let (mesh, mut repetitions) = (subject.mesh(), repetitions(all, &value));
    if id != "memory" {
        repetitions.extend(clocks(all.iter().copied()).map(|clocks| format!(" {clocks}")));
    }
    let engines = distinct(all.iter().map(|group| group.setup.engine.as_str())).join(", ");
    let (id, title) = (format!("{id}-{}", subject.file()), format!("{title}: {mesh}"));
    let caption =
        format!("{what} of {engines} over the number of cells of {mesh}{which}. {repetitions}");
    let (x, y) = (Axis::log("cells"), Axis::log(y));
    Figure { id, title, caption, x, y, series: series(all, value), ..Figure::default() }
}

/// A value of every group over its cells: a series per program, number and kind of ranks. Programs stay in the order of the record.
fn series(all: &[&Group], value: impl Fn(&Group) -> Median) -> Vec<Series> {
    let mut lines = Vec::new();
    for (engine, mut groups) in by_key(all.iter().copied(), |g| &g.setup.engine) {
        groups.sort_by_key(|g| (g.setup.ranks, g.cells()));
        for ((ranks, _), groups) in by_key(groups, |g| (g.setup.ranks, g.setup.comm)) {
            let (how, s) = (provenance(groups[0]), if ranks == 1 { "" } else { "s" });
            let name = format!("{engine}, {ranks} rank{s}, {}", how.word());
            let points = groups.iter().map(|g| point(g.cells() as f64, value(g))).collect();
            lines.push(Series::new(&name, how, lines.len(), points));
        }
    }
    lines
}

/// The counterpart of the paper's Figure 17.
fn by_spacing(subject: &Subject, all: &[&Group]) -> Figure {
    let which = format!(
        " at n = {}. The spacing is halved from point to point; lines join meshes of one family of spacings",
        all[0].setup.layer_cells_min
    );
    let names = ["time-over-cells", "Run time over cells, by spacing", "run time / s"];
    let figure = over_cells(subject, all, names, ["Run time", &which], |group| group.time_s);
    let sentence = " The paper's Figure 17, which is linear, is the counterpart.";
    with_paper(figure, subject, sentence, Some(|_, _, time_s| time_s))
}

/// Rate and memory of meshes of several sizes or programs.
fn rate_and_memory(subject: &Subject, all: &[&Group]) -> [Figure; 2] {
    let rate: Value = |cells, ranks, time_s| cells / time_s / ranks / 1e6;
    let names = ["rate", "Cells per second and core", "million cells / (s core)"];
    let at = format!(" at n = {}", all[0].setup.layer_cells_min);
    let which = format!("{at}. Rates are cells over median times");
    let of_rates = ["Cells per second and core", &which];
    let figure = over_cells(subject, all, names, of_rates, Group::rates);
    let names = ["memory", "Peak memory per cell", "bytes per cell"];
    let of_memory = ["Peak resident memory of all ranks, program and facets included,", &at];
    // One that is unknown is a value of 0, which the axis cannot show.
    let bytes = |group: &Group| group.bytes_per_cell().unwrap_or_default();
    let memory = over_cells(subject, all, names, of_memory, bytes);
    [with_paper(figure, subject, "", Some(rate)), memory]
}

/// The counterpart of the paper's Figure 18. The paper's largest mesh is not drawn: it has no number of ranks.
fn by_layers(subject: &Subject, all: &[&Group]) -> Figure {
    let layers: BTreeSet<u32> = all.iter().map(|g| g.setup.layer_cells_min).collect();
    let layers: Vec<String> = layers.iter().map(u32::to_string).collect();
    let which = format!(
        " at a fixed spacing of {:.3e}, with layers of n = {} cells from left to right; lines join consecutive values of n",
        all[0].setup.spacing_min,
        layers.join(", ")
    );
    let names = ["time-over-layers", "Run time over cells, by layer thickness", "run time / s"];
    let figure = over_cells(subject, all, names, ["Run time", &which], |group| group.time_s);
    let sentence = " The paper's Figure 18, which \"does not scale linearly\", is the counterpart.";
    with_paper(figure, subject, sentence, None)
}
