//! Figures over ranks: speedup, efficiency and its factors, time by phase.

use super::above_one::{reasons, reasons_of_speedups};
use super::groups::{Subject, by_subject, cells_label, point, provenance, repetitions};
use super::paper::{self, cited};
use crate::figure::{Axis, Bars, Body, Claims, Figure, Point, Provenance, Series, svg};
use bench::experiments::entry::Comm;
use bench::experiments::group::{Group, Groups};
use bench::experiments::number::grouped;
use bench::experiments::pop::{Efficiency, messages_s};
use bench::order::{by_key, distinct};

/// Maximum number of phases that have a segment of their own.
const PHASES_SHOWN: usize = 6;

/// Speedup, efficiencies and phases of every mesh in strong scaling; efficiencies and phases in weak scaling.
pub fn figures(groups: &Groups) -> Vec<Figure> {
    let mut out = Vec::new();
    for (subject, all) in by_subject(groups, "strong") {
        for mesh in meshes(&all) {
            if mesh.iter().any(|group| group.setup.ranks > 1) {
                out.push(speedup(groups, subject, &mesh));
            }
            out.extend(efficiency(groups, subject, &mesh, "strong"));
            out.extend(phases(groups, subject, &mesh, "strong"));
        }
    }
    for (subject, all) in by_subject(groups, "weak") {
        out.extend(efficiency(groups, subject, &all, "weak"));
        out.extend(phases(groups, subject, &all, "weak"));
    }
    out
}

/// The groups of each mesh, smaller meshes first.
fn meshes<'a>(all: &[&'a Group]) -> Vec<Vec<&'a Group>> {
    let mut meshes = by_key(all.iter().copied(), |group| group.cells());
    meshes.sort_by_key(|(cells, _)| *cells);
    meshes.into_iter().map(|(_, groups)| groups).collect()
}

/// The groups of one provenance, by ranks.
fn with_provenance<'a>(all: &[&'a Group], kind: Provenance) -> Vec<&'a Group> {
    let mut found: Vec<&Group> = all.iter().copied().filter(|g| provenance(g) == kind).collect();
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
    let ranks_max = all.iter().map(|g| g.setup.ranks).max().unwrap_or(1) as f64;
    let points = [1.0, ranks_max].map(|r| Point::exact(r, value(r)));
    Series::new("ideal", Provenance::Bound, 0, points.to_vec())
}

/// The counterpart of the paper's Figures 19 and 20.
fn speedup(groups: &Groups, subject: Subject, mesh: &[&Group]) -> Figure {
    let mut series = vec![ideal(mesh, |r| r)];
    let kinds = [Provenance::Measured, Provenance::Oversubscribed, Provenance::Projected];
    for (style, kind) in kinds.into_iter().enumerate() {
        let speedup = |g: &&Group| {
            let base = groups.reference(g).time_s.value;
            point(g.setup.ranks as f64, g.time_s.falling(|time_s| base / time_s))
        };
        let points: Vec<Point> = with_provenance(mesh, kind).iter().map(speedup).collect();
        if !points.is_empty() {
            series.push(Series::new(
                &format!("{}, {}", subject.engine, kind.word()),
                kind,
                style,
                points,
            ));
        }
    }
    let efficiencies: Vec<Efficiency> =
        mesh.iter().map(|g| g.efficiency(groups.reference(g), &groups.network)).collect();
    let is_above = series[1..].iter().flat_map(|s| &s.points).any(|p| p.y > p.x);
    let cells = mesh[0].cells();
    let is_of_the_papers_size = (45_000_000..=55_000_000).contains(&cells);
    if is_of_the_papers_size {
        series.push(cited("the paper, 50 M cells", paper::speedups()));
    }
    let base_case = base_cases(groups, mesh);
    Figure {
        id: format!("speedup-{}-{}", subject.file(), cells_label(cells)),
        title: format!("Speedup: {subject}, {} cells", grouped(cells)),
        caption: format!(
            "Speedup of {subject} with {} cells at n = {} over one rank of the same program: {}. {}. Hollow markers: projected from \
             simulated ranks (critical path of CPU times plus messages at {:.2} µs and {:.1} GB/s), or measured with more ranks than \
             cores.{} Lines join powers of two.{}",
            grouped(cells),
            mesh[0].setup.layer_cells_min,
            base_case,
            repetitions(mesh),
            groups.network.latency_s * 1e6,
            groups.network.bandwidth_bytes_per_s / 1e9,
            if is_of_the_papers_size {
                " The points of the paper are from its text (22 min on 1 rank, 117 s on 32) and are for another geometry."
            } else {
                ""
            },
            reasons_of_speedups(&efficiencies, is_above)
        ),
        x: ranks_axis(mesh),
        y: Axis::log("speedup"),
        body: Body::points(series),
        height: svg::HEIGHT,
        claims: Claims {
            base_case: Some(base_case.clone()),
            shows_ratios: true,
            shows_scaling: true,
            ..Claims::default()
        },
    }
}

/// The base cases of a mesh's efficiencies with their run times, without repetitions.
fn base_cases(groups: &Groups, mesh: &[&Group]) -> String {
    let text = |group: &&Group| {
        let base = groups.reference(group);
        let s = if base.setup.ranks == 1 { "" } else { "s" };
        let how = match base.setup.comm {
            Comm::Solo => "serial".to_owned(),
            Comm::Mpi => format!("{} rank{s} on MPI", base.setup.ranks),
            Comm::Sim => format!("{} simulated rank{s}", base.setup.ranks),
        };
        format!("{how}, {:.3} s", base.time_s.value)
    };
    distinct(mesh.iter().map(text)).join("; ")
}

/// One factor of an efficiency.
type Factor = fn(&Efficiency) -> f64;

/// Global efficiency and its factors on simulated ranks.
fn efficiency(
    groups: &Groups,
    subject: Subject,
    all: &[&Group],
    experiment: &str,
) -> Option<Figure> {
    let simulated = with_provenance(all, Provenance::Projected);
    if simulated.len() < 2 {
        return None;
    }
    let factors: [(&str, Factor); 5] = [
        ("global", Efficiency::global),
        ("parallel", Efficiency::parallel),
        ("load balance", |e| e.load_balance),
        ("communication", Efficiency::communication),
        ("computation scaling", |e| e.computation_scaling),
    ];
    let efficiencies: Vec<Efficiency> =
        simulated.iter().map(|g| g.efficiency(groups.reference(g), &groups.network)).collect();
    let mut series = vec![ideal(&simulated, |_| 1.0)];
    for (style, (name, value)) in factors.into_iter().enumerate() {
        let factor = |(g, e): (&&Group, &Efficiency)| Point {
            count: g.time_s.count,
            ..Point::exact(g.setup.ranks as f64, value(e))
        };
        let points = simulated.iter().zip(&efficiencies).map(factor).collect();
        series.push(Series::new(
            &format!("{}: {name}", subject.engine),
            Provenance::Projected,
            style,
            points,
        ));
    }
    let efficiency_max = series.iter().flat_map(|s| &s.points).map(|p| p.y).fold(1.0, f64::max);
    let last = simulated.last()?;
    let base_case = base_cases(groups, &[last]);
    let size = match experiment {
        "weak" => format!("{} cells per rank", grouped(last.cells() / last.setup.ranks as u64)),
        _ => format!("{} cells", grouped(last.cells())),
    };
    let suffix = if experiment == "weak" {
        String::new()
    } else {
        format!("-{}", cells_label(last.cells()))
    };
    Some(Figure {
        id: format!("efficiency-{experiment}-{}{suffix}", subject.file()),
        title: format!("Efficiency in {experiment} scaling: {subject}, {size}"),
        caption: format!(
            "Efficiencies by the POP definitions in {experiment} scaling of {subject}, {size}, n = {}. The base case is {base_case}. {}, \
             projected from simulated ranks. Lines join powers of two.{}",
            last.setup.layer_cells_min,
            last.rank_times_caption(),
            reasons(&efficiencies, experiment).map_or(String::new(), |why| format!(" {why}"))
        ),
        x: ranks_axis(&simulated),
        y: Axis { range: Some((0.0, efficiency_max * 1.1)), ..Axis::linear("efficiency") },
        body: Body::points(series),
        height: svg::HEIGHT,
        claims: Claims {
            base_case: Some(base_case.clone()),
            shows_ratios: true,
            shows_scaling: true,
            ..Claims::default()
        },
    })
}

/// Time by phase, summed over ranks: with ideal scaling, all bars are equal.
fn phases(groups: &Groups, subject: Subject, all: &[&Group], experiment: &str) -> Option<Figure> {
    let simulated = with_provenance(all, Provenance::Projected);
    let last = &simulated.last()?.typical;
    let network = &groups.network;
    let time = |g: &Group, name: &str| {
        let run = &g.typical;
        let phase = run.phases.iter().find(|p| p.name == name);
        phase.map_or(0.0, |p| (p.useful_s.max + messages_s(p, network)) * g.setup.ranks as f64)
    };
    let mut names: Vec<&str> = last.phases.iter().map(|p| p.name.as_str()).collect();
    let time_max = |name: &str| simulated.iter().map(|g| time(g, name)).fold(0.0, f64::max);
    names.sort_by(|a, b| time_max(b).total_cmp(&time_max(a)));
    let weak = experiment == "weak";
    let values = |names: &[&str]| -> Vec<f64> {
        let value = |g: &&Group| {
            let sum: f64 = names.iter().map(|name| time(g, name)).sum();
            if weak { sum / (g.cells() as f64 / 1e6) } else { sum }
        };
        simulated.iter().map(value).collect()
    };
    let (shown, rest) = names.split_at(names.len().min(PHASES_SHOWN));
    let mut segments: Vec<(String, Vec<f64>)> =
        shown.iter().map(|name| (format!("{}: {name}", subject.engine), values(&[name]))).collect();
    if !rest.is_empty() {
        segments.push((format!("{}: others", subject.engine), values(rest)));
    }
    let cells = last.cells;
    let suffix = if weak { String::new() } else { format!("-{}", cells_label(cells)) };
    let unit = if weak { "rank seconds per million cells" } else { "rank seconds" };
    Some(Figure {
        id: format!("phases-{experiment}-{}{suffix}", subject.file()),
        title: format!("Time by phase in {experiment} scaling: {subject}"),
        caption: format!(
            "Critical path of each phase times the number of ranks, in {unit}, in {experiment} scaling of {subject} ({} cells on {} ranks). With ideal \
             scaling all bars are equal. {}, projected from simulated ranks.",
            grouped(cells),
            last.setup.ranks,
            simulated[0].rank_times_caption()
        ),
        x: Axis::linear("ranks"),
        y: Axis::linear(unit),
        body: Body::Bars(Bars {
            categories: simulated.iter().map(|g| g.setup.ranks.to_string()).collect(),
            segments,
            references: Vec::new(),
            provenance: Provenance::Projected,
        }),
        height: svg::HEIGHT,
        claims: Claims { shows_scaling: true, ..Claims::default() },
    })
}
