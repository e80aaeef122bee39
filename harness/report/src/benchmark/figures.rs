//! Figures over cells: run time (counterparts of the paper's Figures 17 and 18), rate and memory. All numbers of the paper are those of `reports/paper.md`.

use super::groups::{Subject, cited, is_counterpart, point, provenance, repetitions};
use super::scaling;
use crate::figure::{Axis, Figure, Provenance, Series};
use bench::experiments::entry::Comm;
use bench::experiments::group::{Group, Groups};
use bench::order::{by_key, distinct};
use contract::paper::number;
use statistics::Median;

/// All figures for which the record has runs.
pub fn figures(groups: &Groups) -> Vec<Figure> {
    let by_case = |is_of: &dyn Fn(&Group) -> bool| {
        let of = groups.all.iter().filter(|group| is_of(group));
        by_key(of, |group| Subject::of_all(&group.setup))
    };
    let of = |experiment: &'static str| by_case(&move |g| g.setup.experiment == experiment);
    let mut all: Vec<Figure> = of("spacing").iter().map(|(of, all)| by_spacing(of, all)).collect();
    all.extend(of("layers").iter().map(|(of, all)| by_layers(of, all)));
    all.extend(scaling::figures(groups));
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

/// The paper's runs of which the text states cells, ranks and time, by a value of them, and a sentence on them.
fn paper(value: impl Fn(f64, f64, f64) -> f64) -> (Series, String) {
    let run =
        |cells: &str, ranks: f64, time_s: f64| (number(cells), value(number(cells), ranks, time_s));
    let [ranks, most] = ["second_ranks", "largest_ranks"].map(number);
    let runs = [
        run("serial_cells", 1.0, 60.0 * number("serial_min")),
        run("second_cells", ranks, 60.0 * number("second_min")),
        run("serial_cells", number("parallel_ranks"), number("parallel_s")),
        run("largest_cells", most, 60.0 * number("largest_min")),
    ];
    let text = format!(
        " The points of the paper are from its text (sections IV.B and V), not from its figures: around another UAV, on Intel X5355 CPUs; of n, nothing is \
         stated. The time on {ranks} ranks is a lower bound, that on {most} an upper bound."
    );
    let name = format!("the paper: 1, {ranks}, {} and {most} ranks", number("parallel_ranks"));
    (cited(&name, runs), text)
}

fn over_cells([id, title]: [String; 2], caption: String, y: &str, series: Vec<Series>) -> Figure {
    Figure::new(id, title, caption, [Axis::log("cells"), Axis::log(y)], series)
}

/// A value of every group over its cells: a series per program, number and kind of ranks. Programs stay in the order of the record.
fn series(all: &[&Group], value: impl Fn(&Group) -> Median) -> Vec<Series> {
    let mut lines = Vec::new();
    let mut by_program =
        by_key(all.iter().copied(), |g| (&g.setup.engine, g.setup.ranks, g.setup.comm));
    let programs = distinct(all.iter().map(|g| &g.setup.engine));
    by_program.sort_by_key(|((engine, ranks, _), _)| {
        (programs.iter().position(|program| program == engine), *ranks)
    });
    for ((engine, ranks, _), mut groups) in by_program {
        groups.sort_by_key(|g| g.cells());
        let how = provenance(groups[0]);
        let s = if ranks == 1 { "" } else { "s" };
        let name = format!("{engine}, {ranks} rank{s}, {}", how.word());
        let points = groups.iter().map(|g| point(g.cells() as f64, value(g))).collect();
        lines.push(Series::new(&name, how, lines.len(), points));
    }
    lines
}

fn engines(groups: &[&Group]) -> String {
    distinct(groups.iter().map(|group| group.setup.engine.as_str())).join(", ")
}

/// The counterpart of the paper's Figure 17.
fn by_spacing(subject: &Subject, all: &[&Group]) -> Figure {
    let case = subject.mesh();
    let mut caption = format!(
        "Run time of {} over the number of cells of {case} at n = {}. The spacing is halved from point to point; lines join meshes of one \
         family of spacings. {}",
        engines(all),
        all[0].setup.layer_cells_min,
        repetitions(all)
    );
    let mut series = series(all, |group| group.time_s);
    if is_counterpart(subject.case) {
        let (points, text) = paper(|_, _, time_s| time_s);
        series.push(points);
        caption += &format!(" The paper's Figure 17, which is linear, is the counterpart.{text}");
    }
    let id = format!("time-over-cells-{}", subject.file());
    let title = format!("Run time over cells, by spacing: {case}");
    over_cells([id, title], caption, "run time / s", series)
}

/// Rate and memory of meshes of several sizes or programs.
fn rate_and_memory(subject: &Subject, all: &[&Group]) -> [Figure; 2] {
    let (case, engines, repetitions) = (subject.mesh(), engines(all), repetitions(all));
    let of = format!("of {engines} over the number of cells of {case}. {repetitions}");
    let rate = |cells: f64, ranks: f64, time_s: f64| cells / time_s / ranks / 1e6;
    let mut rates = series(all, |g| {
        let (cells, ranks) = (g.cells() as f64, g.setup.ranks as f64);
        g.time_s.falling(|time_s| rate(cells, ranks, time_s))
    });
    let mut of_rates = format!("Cells per second and core {of} Rates are cells over median times.");
    if is_counterpart(subject.case) {
        let (points, text) = paper(rate);
        rates.push(points);
        of_rates += &text;
    }
    let of_memory = format!("Peak resident memory of all ranks, program and facets included, {of}");
    let memory = series(all, Group::bytes_per_cell);
    let names =
        |id: &str, title: &str| [format!("{id}-{}", subject.file()), format!("{title}: {case}")];
    let of_rate = names("rate", "Cells per second and core");
    let of_peak = names("memory", "Peak memory per cell");
    [
        over_cells(of_rate, of_rates, "million cells / (s core)", rates),
        over_cells(of_peak, of_memory, "bytes per cell", memory),
    ]
}

/// The counterpart of the paper's Figure 18. The paper's largest mesh is not drawn: it has no number of ranks.
fn by_layers(subject: &Subject, all: &[&Group]) -> Figure {
    let case = subject.mesh();
    let mut layers: Vec<u32> = all.iter().map(|g| g.setup.layer_cells_min).collect();
    layers.sort_unstable();
    let layers = distinct(layers).into_iter().map(|n| n.to_string());
    let mut caption = format!(
        "Run time of {} over the number of cells of {case} at a fixed spacing of {:.3e}, with layers of n = {} cells from left to right; \
         lines join consecutive values of n. {}",
        engines(all),
        all[0].setup.spacing_min,
        layers.collect::<Vec<_>>().join(", "),
        repetitions(all)
    );
    if is_counterpart(subject.case) {
        caption += " The paper's Figure 18, which \"does not scale linearly\", is the counterpart.";
    }
    let id = format!("time-over-layers-{}", subject.file());
    let title = format!("Run time over cells, by layer thickness: {case}");
    over_cells([id, title], caption, "run time / s", series(all, |group| group.time_s))
}
