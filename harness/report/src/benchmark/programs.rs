//! Figures of several programs on the same cases, on one core.

use super::groups::{point, repetitions};
use crate::figure::{Axis, Body, Claims, Figure, Point, Provenance, Series, svg};
use bench::experiments::group::{Group, Groups};
use bench::experiments::programs::Comparison;

/// CPU time, rate and memory over cells of every comparison.
pub fn figures(groups: &Groups) -> Vec<Figure> {
    groups.comparisons().iter().flat_map(|c| [time(c), rate(c), memory(c)]).collect()
}

/// A series per program.
fn series(comparison: &Comparison, value: impl Fn(&Group) -> Option<Point>) -> Vec<Series> {
    let of = |(style, (name, groups)): (usize, &(&str, Vec<&Group>))| {
        let points = groups.iter().filter_map(|group| value(group)).collect();
        Series::new(name, Provenance::Measured, style, points)
    };
    comparison.programs.iter().enumerate().map(of).collect()
}

fn cells(group: &Group) -> f64 {
    group.cells() as f64
}

fn time(comparison: &Comparison) -> Figure {
    let mut all = series(comparison, |g| g.cpu_s().map(|time| point(cells(g), time)));
    let search = series(comparison, |g| g.search_s().map(|time| point(cells(g), time)));
    let search = search.into_iter().filter(|series| !series.points.is_empty()).zip(all.len()..);
    let named =
        |(s, style): (Series, usize)| Series { name: format!("{}: search", s.name), style, ..s };
    all.extend(search.map(named).collect::<Vec<_>>());
    figure(comparison, "time", "CPU time", Axis::log("CPU time / s"), all)
}

fn rate(comparison: &Comparison) -> Figure {
    let all = series(comparison, |g| {
        Some(point(cells(g), g.cpu_s()?.falling(|time_s| cells(g) / time_s / 1e6)))
    });
    let axis = Axis::log("million cells / (s core)");
    figure(comparison, "rate", "Cells per second and core", axis, all)
}

fn memory(comparison: &Comparison) -> Figure {
    let all = series(comparison, |g| Some(point(cells(g), g.bytes_per_cell())));
    figure(comparison, "memory", "Peak memory per cell", Axis::log("bytes per cell"), all)
}

fn figure(comparison: &Comparison, id: &str, what: &str, y: Axis, all: Vec<Series>) -> Figure {
    let (case, n) = (comparison.case, comparison.layer_cells_min);
    let groups: Vec<&Group> = comparison.programs.iter().flat_map(|p| p.1.clone()).collect();
    let search = match all.len() > comparison.programs.len() {
        true => {
            " The series \"search\" are the part of the time in which a program searches the geometry, where it reports that."
        }
        false => "",
    };
    Figure {
        id: format!("programs-{id}-{case}-{n}"),
        title: format!("{what} by program: {case}"),
        caption: format!(
            "{what} of several programs over the number of cells of {case} at n = {n}, on one core and at the same spacings. Times are CPU times of \
             the whole process, its start and reading included.{search} {}. Lines join meshes of one program.",
            repetitions(&groups)
        ),
        x: Axis::log("cells"),
        y,
        body: Body::points(all),
        height: svg::HEIGHT,
        claims: Claims::default(),
    }
}
