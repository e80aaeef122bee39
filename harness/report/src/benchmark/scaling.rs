//! Figures over ranks: speedup, efficiency and its causes, time by phase.

use super::figure::{Axis, Bars, Body, Claims, Figure, How, Point, Series};
use super::groups::{by_case, how, point, repetitions};
use super::paper;
use bench::experiments::entry::Comm;
use bench::experiments::group::{Group, Groups};
use bench::experiments::pop::{Efficiency, messages_s};
use bench::experiments::table::grouped;
use bench::statistics::Median;

/// Most phases that a figure tells apart.
const PHASES_SHOWN: usize = 6;

/// Speedup, efficiencies and phases of every mesh in strong scaling; efficiencies in weak scaling.
pub fn figures(groups: &Groups) -> Vec<Figure> {
    let mut out = Vec::new();
    for (case, all) in by_case(groups, "strong") {
        for mesh in meshes(&all) {
            out.push(speedup(groups, case, &mesh));
            out.extend(efficiency(groups, case, &mesh, "strong"));
            out.extend(phases(groups, case, &mesh, "strong"));
        }
    }
    for (case, all) in by_case(groups, "weak") {
        out.extend(efficiency(groups, case, &all, "weak"));
        out.extend(phases(groups, case, &all, "weak"));
    }
    out
}

/// Groups of one mesh each, smaller meshes first.
fn meshes<'a>(all: &[&'a Group]) -> Vec<Vec<&'a Group>> {
    let mut out: Vec<Vec<&Group>> = Vec::new();
    for group in all {
        match out.iter_mut().find(|m| m[0].cells() == group.cells()) {
            Some(mesh) => mesh.push(group),
            None => out.push(vec![group]),
        }
    }
    out.sort_by_key(|mesh| mesh[0].cells());
    out
}

/// About how many cells, for names of files.
pub fn about(cells: u64) -> String {
    let (value, unit) =
        if cells >= 1_000_000_000 { (cells as f64 / 1e9, "G") } else { (cells as f64 / 1e6, "M") };
    let text = if value < 9.5 { format!("{value:.1}") } else { format!("{value:.0}") };
    format!("{}{unit}", text.trim_end_matches(".0").replace('.', "p"))
}

/// Groups of one way of running, by ranks.
fn of_how<'a>(all: &[&'a Group], wanted: How) -> Vec<&'a Group> {
    let mut found: Vec<&Group> = all.iter().copied().filter(|g| how(g) == wanted).collect();
    found.sort_by_key(|g| g.setup.ranks);
    found
}

fn ranks_axis(all: &[&Group]) -> Axis {
    let mut ranks: Vec<f64> = all.iter().map(|g| g.setup.ranks as f64).collect();
    ranks.sort_by(f64::total_cmp);
    ranks.dedup();
    Axis::log("ranks").with_ticks(ranks)
}

fn ideal(all: &[&Group], value: impl Fn(f64) -> f64) -> Series {
    let most = all.iter().map(|g| g.setup.ranks).max().unwrap_or(1) as f64;
    let points = [1.0, most].map(|r| Point::bare(r, value(r)));
    Series { name: "ideal".into(), how: How::Bound, joined: true, points: points.to_vec(), look: 0 }
}

/// The paper's Figures 19 and 20.
fn speedup(groups: &Groups, case: &str, mesh: &[&Group]) -> Figure {
    let mut series = vec![ideal(mesh, |r| r)];
    for (look, wanted) in
        [How::Measured, How::Oversubscribed, How::Projected].into_iter().enumerate()
    {
        let of = of_how(mesh, wanted);
        let value = |g: &&Group| {
            let base = groups.reference(g).time_s.value;
            let t = g.time_s;
            point(
                g.setup.ranks as f64,
                Median { value: base / t.value, low: base / t.high, high: base / t.low, ..t },
            )
        };
        let points: Vec<Point> = of.iter().map(value).collect();
        if !points.is_empty() {
            series.push(Series {
                name: wanted.word().into(),
                how: wanted,
                joined: true,
                points,
                look,
            });
        }
    }
    let cells = mesh[0].cells();
    let is_papers = (45_000_000..=55_000_000).contains(&cells);
    if is_papers {
        let points = paper::speedups().map(|(r, s)| Point::bare(r, s)).to_vec();
        series.push(Series {
            name: "the paper, 50 M".into(),
            how: How::Cited,
            joined: false,
            points,
            look: 5,
        });
    }
    let bases: Vec<String> = base_cases(groups, mesh);
    Figure {
        id: format!("speedup-{case}-{}", about(cells)),
        title: format!("Speedup: {case}, {} cells", grouped(cells)),
        caption: format!(
            "Speedup of {case} with {} cells at n = {} over one rank of the same program: {}. {}. Hollow points: projected from \
             simulated ranks (critical path of CPU times plus messages at {:.2} µs and {:.1} GB/s), or measured with more ranks than \
             cores.{} Lines join powers of two.",
            grouped(cells),
            mesh[0].setup.layer_cells_min,
            bases.join("; "),
            repetitions(mesh),
            groups.network.latency_s * 1e6,
            groups.network.bandwidth_bytes_per_s / 1e9,
            if is_papers {
                " The paper's points are from its text (22 min on 1 rank, 117 s on 32)."
            } else {
                ""
            }
        ),
        x: ranks_axis(mesh),
        y: Axis::log("speedup"),
        body: Body::Points(series),
        claims: Claims {
            base_case: Some(bases.join("; ")),
            shows_ratios: true,
            shows_scaling: true,
            ..Claims::default()
        },
    }
}

/// The base cases of speedups, and how fast they are.
fn base_cases(groups: &Groups, mesh: &[&Group]) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for group in mesh {
        let base = groups.reference(group);
        let how = match base.setup.comm {
            Comm::Solo => "serial",
            Comm::Mpi => "1 rank on MPI",
            Comm::Sim => "1 simulated rank",
        };
        let text = format!("{how}, {:.3} s", base.time_s.value);
        if !out.contains(&text) {
            out.push(text);
        }
    }
    out
}

/// One of the factors that an efficiency is made of.
type Factor = fn(&Efficiency) -> f64;

/// Global efficiency and its factors, of simulated ranks.
fn efficiency(groups: &Groups, case: &str, all: &[&Group], experiment: &str) -> Option<Figure> {
    let of = of_how(all, How::Projected);
    if of.len() < 2 {
        return None;
    }
    let parts: [(&str, Factor); 5] = [
        ("global", Efficiency::global),
        ("parallel", Efficiency::parallel),
        ("load balance", |e| e.load_balance),
        ("communication", Efficiency::communication),
        ("computation scaling", |e| e.computation_scaling),
    ];
    let mut series = vec![ideal(&of, |_| 1.0)];
    for (look, (name, value)) in parts.into_iter().enumerate() {
        let at = |g: &&Group| {
            let e = g.efficiency(groups.reference(g), &groups.network);
            Point { count: g.time_s.count, ..Point::bare(g.setup.ranks as f64, value(&e)) }
        };
        let points = of.iter().map(at).collect();
        series.push(Series { name: name.into(), how: How::Projected, joined: true, points, look });
    }
    // Per cell, many ranks may compute less than one: fixed costs weigh less on larger meshes.
    let most = series.iter().flat_map(|s| &s.points).map(|p| p.y).fold(1.0, f64::max);
    let last = of.last()?;
    let base = groups.reference(last);
    let size = match experiment {
        "weak" => format!("{} cells per rank", grouped(last.cells() / last.setup.ranks as u64)),
        _ => format!("{} cells", grouped(last.cells())),
    };
    let suffix =
        if experiment == "weak" { String::new() } else { format!("-{}", about(last.cells())) };
    Some(Figure {
        id: format!("efficiency-{experiment}-{case}{suffix}"),
        title: format!("Efficiency in {experiment} scaling: {case}, {size}"),
        caption: format!(
            "Efficiencies by the POP definitions in {experiment} scaling of {case}, {size}, n = {}; the base is {} {} taking {:.3} s. \
             {}; projected from simulated ranks, hence hollow. Lines join powers of two.",
            last.setup.layer_cells_min,
            base.setup.ranks,
            if base.setup.ranks == 1 { "simulated rank" } else { "simulated ranks" },
            base.time_s.value,
            last.rank_times_caption()
        ),
        x: ranks_axis(&of),
        y: Axis { range: Some((0.0, most * 1.1)), ..Axis::linear("efficiency") },
        body: Body::Points(series),
        claims: Claims {
            base_case: Some(format!("1 simulated rank, {:.3} s", base.time_s.value)),
            shows_ratios: true,
            shows_scaling: true,
            ..Claims::default()
        },
    })
}

/// Rank time by phase: the height is what all ranks together spend, so that ideal scaling is level.
fn phases(groups: &Groups, case: &str, all: &[&Group], experiment: &str) -> Option<Figure> {
    let of = of_how(all, How::Projected);
    let last = &of.last()?.typical;
    let network = &groups.network;
    let time = |g: &Group, name: &str| {
        let run = &g.typical;
        let phase = run.phases.iter().find(|p| p.name == name);
        phase.map_or(0.0, |p| (p.useful_s.max + messages_s(p, network)) * g.setup.ranks as f64)
    };
    let mut names: Vec<&str> = last.phases.iter().map(|p| p.name.as_str()).collect();
    let most = |name: &&str| of.iter().map(|g| time(g, name)).fold(0.0, f64::max);
    names.sort_by(|a, b| most(b).total_cmp(&most(a)));
    let per_cell = |g: &Group| if experiment == "weak" { g.cells() as f64 / 1e6 } else { 1.0 };
    let value =
        |g: &Group, names: &[&str]| names.iter().map(|n| time(g, n)).sum::<f64>() / per_cell(g);
    let mut parts: Vec<(String, Vec<f64>)> = Vec::new();
    let (shown, rest) = names.split_at(names.len().min(PHASES_SHOWN));
    for name in shown {
        parts.push(((*name).to_owned(), of.iter().map(|g| value(g, &[name])).collect()));
    }
    if !rest.is_empty() {
        parts.push(("others".into(), of.iter().map(|g| value(g, rest)).collect()));
    }
    let cells = last.cells;
    let suffix = if experiment == "weak" { String::new() } else { format!("-{}", about(cells)) };
    let unit = if experiment == "weak" { "rank seconds per million cells" } else { "rank seconds" };
    Some(Figure {
        id: format!("phases-{experiment}-{case}{suffix}"),
        title: format!("Time by phase in {experiment} scaling: {case}"),
        caption: format!(
            "Critical path by phase times ranks, in {unit}, in {experiment} scaling of {case} ({} cells on {} ranks): level bars are ideal. {}; \
             projected from simulated ranks.",
            grouped(cells),
            last.setup.ranks,
            of[0].rank_times_caption()
        ),
        x: Axis::linear("ranks"),
        y: Axis::linear(unit),
        body: Body::Bars(Bars {
            categories: of.iter().map(|g| g.setup.ranks.to_string()).collect(),
            parts,
            lines: Vec::new(),
            how: How::Projected,
        }),
        claims: Claims { shows_scaling: true, ..Claims::default() },
    })
}
