//! Which figures a record gives: the paper's Figures 17 to 23 for our cases, and more.

use super::balance;
use super::figure::{Axis, Body, Claims, Figure, How, Point, Series};
use super::groups::{by_case, how, point, repetitions};
use super::matrix;
use super::paper;
use super::scaling;
use bench::experiments::entry::{Comm, Setup};
use bench::experiments::group::{Group, Groups};
use bench::statistics::Median;

/// All figures that the runs suffice for.
pub fn figures(groups: &Groups) -> Vec<Figure> {
    let mut all = Vec::new();
    all.extend(time_over_cells(groups));
    all.extend(time_over_layers(groups));
    all.extend(scaling::figures(groups));
    all.extend(balance::figures(groups));
    all.extend(matrix::figures(groups));
    all.extend(rate(groups));
    all.extend(memory(groups));
    all
}

/// Layouts among groups, each with its groups by growing key.
fn by_layout<'a>(all: &[&'a Group], key: impl Fn(&Group) -> f64) -> Vec<(String, Vec<&'a Group>)> {
    let mut out: Vec<((usize, Comm), Vec<&Group>)> = Vec::new();
    for group in all {
        let layout = (group.setup.ranks, group.setup.comm);
        match out.iter_mut().find(|(l, _)| *l == layout) {
            Some((_, of)) => of.push(group),
            None => out.push((layout, vec![group])),
        }
    }
    out.sort_by_key(|(layout, _)| *layout);
    let named = |((ranks, _), mut of): ((usize, Comm), Vec<&'a Group>)| {
        of.sort_by(|a, b| key(a).total_cmp(&key(b)));
        (format!("{ranks} {}", if ranks == 1 { "rank" } else { "ranks" }), of)
    };
    out.into_iter().map(named).collect()
}

fn series(
    all: &[&Group],
    key: impl Fn(&Group) -> f64 + Copy,
    value: impl Fn(&Group) -> Point,
) -> Vec<Series> {
    let of_layout = |(look, (name, of)): (usize, (String, Vec<&Group>))| Series {
        name: format!("{name}, {}", how(of[0]).word()),
        how: how(of[0]),
        joined: true,
        points: of.iter().map(|g| value(g)).collect(),
        look,
    };
    by_layout(all, key).into_iter().enumerate().map(of_layout).collect()
}

/// The paper's Figure 17.
fn time_over_cells(groups: &Groups) -> Vec<Figure> {
    let of_case = |(case, all): (&str, Vec<&Group>)| {
        let mut series = series(&all, |g| g.cells() as f64, |g| point(g.cells() as f64, g.time_s));
        let cited = paper::RUNS.iter().map(|r| Point::bare(r.cells, r.time_s));
        let mut points: Vec<Point> = cited.collect();
        points.sort_by(|a, b| a.x.total_cmp(&b.x).then(b.y.total_cmp(&a.y)));
        series.push(Series {
            name: "the paper: 1, 32, 64 and ? ranks".into(),
            how: How::Cited,
            joined: false,
            points,
            look: 5,
        });
        Figure {
            id: format!("time-over-cells-{case}"),
            title: format!("Run time against cells, by spacing: {case}"),
            caption: format!(
                "Run time against the number of cells of {case}, the spacing halved from point to point at n = {} (the paper's \
                 Figure 17). {}. Lines join meshes of one family of spacings. Points of the paper from its text: 50 million cells in \
                 22 min on 1 rank and 117 s on 32, 1e9 in 45 min on 64, 1.6e9 in 132 min on a number of ranks that is not told; their \
                 hardware was of 2013 and their geometry another.",
                all[0].setup.layer_cells_min,
                repetitions(&all)
            ),
            x: Axis::log("cells"),
            y: Axis::log("run time / s"),
            body: Body::Points(series),
            claims: Claims::default(),
        }
    };
    by_case(groups, "spacing").into_iter().map(of_case).collect()
}

/// The paper's Figure 18.
fn time_over_layers(groups: &Groups) -> Vec<Figure> {
    let of_case = |(case, all): (&str, Vec<&Group>)| {
        let series = series(&all, |g| g.cells() as f64, |g| point(g.cells() as f64, g.time_s));
        let mut layers: Vec<u32> = all.iter().map(|g| g.setup.layer_cells_min).collect();
        layers.sort_unstable();
        layers.dedup();
        let names: Vec<String> = layers.iter().map(u32::to_string).collect();
        Figure {
            id: format!("time-over-layers-{case}"),
            title: format!("Run time against cells, by layer thickness: {case}"),
            caption: format!(
                "Run time against the number of cells of {case} at a fixed spacing of {:.3e}, with n = {} cells per layer from left to \
                 right (the paper's Figure 18, which bends upward). {}. Lines join neighbouring n; only whole n exist.",
                all[0].setup.spacing_min,
                names.join(", "),
                repetitions(&all)
            ),
            x: Axis::log("cells"),
            y: Axis::log("run time / s"),
            body: Body::Points(series),
            claims: Claims::default(),
        }
    };
    by_case(groups, "layers").into_iter().map(of_case).collect()
}

/// Runs whose wall time is that of undisturbed ranks.
fn measured(groups: &Groups, wanted: impl Fn(&Setup) -> bool) -> Vec<&Group> {
    groups.all.iter().filter(|g| how(g) == How::Measured && wanted(&g.setup)).collect()
}

fn rate(groups: &Groups) -> Option<Figure> {
    let all = measured(groups, |s| s.experiment == "spacing");
    let value = |g: &Group| {
        let per_rank = |t: f64| g.cells() as f64 / t / g.setup.ranks as f64 / 1e6;
        let t = g.time_s;
        // A rate is cells over the median time, and its interval that of the time.
        let m =
            Median { value: per_rank(t.value), low: per_rank(t.high), high: per_rank(t.low), ..t };
        point(g.cells() as f64, m)
    };
    let mut series = series(&all, |g| g.cells() as f64, value);
    let cited = paper::RUNS.iter().filter_map(|r| Some((r.cells, r.ranks?, r.time_s)));
    series.push(Series {
        name: "the paper: 1, 32 and 64 ranks".into(),
        how: How::Cited,
        joined: false,
        points: cited.map(|(c, r, t)| Point::bare(c, c / t / r as f64 / 1e6)).collect(),
        look: 5,
    });
    (!all.is_empty()).then(|| Figure {
        id: "rate".into(),
        title: "Cells per second and core".into(),
        caption: format!(
            "Cells per second and core against cells: {}. {}. Rates are cells over median times.",
            all[0].setup.case,
            repetitions(&all)
        ),
        x: Axis::log("cells"),
        y: Axis::log("million cells / (s core)"),
        body: Body::Points(series),
        claims: Claims { shows_ratios: false, ..Claims::default() },
    })
}

fn memory(groups: &Groups) -> Option<Figure> {
    let all = measured(groups, |s| s.experiment == "spacing");
    let mut series =
        series(&all, |g| g.cells() as f64, |g| point(g.cells() as f64, g.bytes_per_cell()));
    series.push(Series {
        name: "the paper: 84 bytes per voxel".into(),
        how: How::Cited,
        joined: false,
        points: vec![Point::bare(50e6, 84.0)],
        look: 5,
    });
    (!all.is_empty()).then(|| Figure {
        id: "memory".into(),
        title: "Peak memory per cell".into(),
        caption: format!(
            "Peak resident memory of all ranks together, per cell, programs and facets included: {}. {} (of memory).",
            all[0].setup.case,
            repetitions(&all)
        ),
        x: Axis::log("cells"),
        y: Axis::log("bytes per cell"),
        body: Body::Points(series),
        claims: Claims::default(),
    })
}
