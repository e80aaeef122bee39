//! Figures over ranks: speedup, efficiency and its factors, time by phase.

use super::groups::{Subject, by_subject, cells_label, point, provenance, rank_times, repetitions};
use super::paper::{self, cited};
use crate::figure::{Axis, Bars, Body, Figure, Point, Provenance, Series};
use bench::experiments::entry::Comm;
use bench::experiments::group::{Group, Groups};
use bench::experiments::number::grouped;
use bench::experiments::pop::{Efficiency, Factor, above_one, phase_s};
use bench::order::{by_key, distinct};
use contract::paper::number;

/// Maximum number of phases that have a segment of their own.
const PHASES_SHOWN: usize = 6;

/// Speedup, efficiencies and phases of every mesh in strong scaling; efficiencies and phases in weak scaling.
pub fn figures(groups: &Groups) -> Vec<Figure> {
    let mut out = Vec::new();
    for experiment in ["strong", "weak"] {
        let strong = experiment == "strong";
        for (subject, all) in by_subject(groups, experiment) {
            let mut meshes = by_key(all, |group| if strong { group.cells() } else { 0 });
            meshes.sort_by_key(|(cells, _)| *cells);
            for (_, all) in meshes {
                let study = Study { groups, subject, experiment, all };
                let scales = study.all.iter().any(|group| group.setup.ranks > 1);
                out.extend((strong && scales).then(|| study.speedup()));
                out.extend(study.efficiency());
                out.extend(study.phases());
            }
        }
    }
    out
}

/// The runs of one mesh in strong scaling, or of all meshes in weak scaling.
struct Study<'a> {
    groups: &'a Groups,
    subject: Subject<'a>,
    experiment: &'a str,
    all: Vec<&'a Group>,
}

impl Study<'_> {
    /// The groups whose times were obtained in one way, by ranks.
    fn with(&self, how: &str) -> Vec<&Group> {
        let mut found: Vec<&Group> = self.all.iter().copied().filter(|g| g.how() == how).collect();
        found.sort_by_key(|g| g.setup.ranks);
        found
    }

    /// The name of a figure's files, with the size of the mesh if all runs have the same.
    fn id(&self, what: &str, cells: u64) -> String {
        let (file, experiment) = (self.subject.file(), self.experiment);
        match experiment {
            "weak" => format!("{what}-{experiment}-{file}"),
            _ => format!("{what}-{experiment}-{file}-{}", cells_label(cells)),
        }
    }

    fn efficiencies(&self, of: &[&Group]) -> Vec<Efficiency> {
        of.iter().map(|group| self.groups.efficiency(group)).collect()
    }

    /// The base cases of efficiencies with their run times, without repetitions.
    fn base_cases(&self, of: &[&Group]) -> String {
        let text = |group: &&Group| {
            let base = self.groups.reference(group);
            let ranks = base.setup.ranks;
            let s = if ranks == 1 { "" } else { "s" };
            let how = match base.setup.comm {
                Comm::Solo => "serial".to_owned(),
                Comm::Mpi => format!("{ranks} rank{s} on MPI"),
                Comm::Sim => format!("{ranks} simulated rank{s}"),
            };
            format!("{how}, {:.3} s", base.time_s.value)
        };
        distinct(of.iter().map(text)).join("; ")
    }

    /// The counterpart of the paper's Figure 19. The baseline of its Figure 20 is ambiguous.
    fn speedup(&self) -> Figure {
        let Self { groups, subject, all, .. } = self;
        let mut series = vec![ideal(all, |r| r)];
        for (style, how) in ["measured", "oversubscribed", "projected", "serial"].iter().enumerate()
        {
            let speedup = |g: &&Group| point(g.setup.ranks as f64, groups.speedup(g));
            let of = self.with(how);
            if let Some(first) = of.first() {
                let name = format!("{}, {how}", subject.engine);
                let points: Vec<Point> = of.iter().map(speedup).collect();
                series.push(Series::new(&name, provenance(first), style, points));
            }
        }
        let cells = all[0].cells();
        let mut notes = String::new();
        if series[1..].iter().flat_map(|s| &s.points).any(|p| p.y > p.x) {
            let disturbed = "A speedup per rank above 1 means that the base case was disturbed.";
            let why = above_one(&self.efficiencies(all));
            notes += &format!(" {}", why.as_deref().unwrap_or(disturbed));
        }
        if paper::is_counterpart(subject.case) && (45_000_000..=55_000_000).contains(&cells) {
            series.push(cited("the paper, 50 M cells", paper::speedups()));
            notes += &format!(
                " The points of the paper are those of its Figure 19 that its text states ({} min on 1 rank, {} s on {}), around another UAV.",
                number("serial_min"),
                number("parallel_s"),
                number("parallel_ranks"),
            );
        }
        let cells_text = grouped(cells);
        let caption = format!(
            "Speedup of {subject} with {cells_text} cells at n = {} over the same program on the fewest ranks, times their number: {}. {}. Hollow markers: projected from \
             simulated ranks (critical path of CPU times plus {}), or measured with more ranks than \
             cores. Lines join powers of two.{notes}",
            all[0].setup.layer_cells_min,
            self.base_cases(all),
            repetitions(all),
            Groups::networks(all.iter().copied()),
        );
        let title = format!("Speedup: {subject}, {cells_text} cells");
        let axes = [ranks_axis(all), Axis::log("speedup")];
        let id = format!("speedup-{}-{}", subject.file(), cells_label(cells));
        Figure::new(id, title, caption, axes, Body::points(series))
    }

    /// Global efficiency and its factors on simulated ranks.
    fn efficiency(&self) -> Option<Figure> {
        let Self { subject, experiment, .. } = self;
        let simulated = self.with("projected");
        let last = simulated.last().filter(|_| simulated.len() > 1)?;
        let factors: [(&str, Factor); 5] = [
            ("global", Efficiency::global),
            ("parallel", Efficiency::parallel),
            ("load balance", |e| e.load_balance),
            ("communication", Efficiency::communication),
            ("computation scaling", |e| e.computation_scaling),
        ];
        let efficiencies = self.efficiencies(&simulated);
        let mut series = vec![ideal(&simulated, |_| 1.0)];
        for (style, (name, value)) in factors.into_iter().enumerate() {
            let factor = |(g, e): (&&Group, &Efficiency)| Point {
                count: g.time_s.count,
                ..Point::exact(g.setup.ranks as f64, value(e))
            };
            let points = simulated.iter().zip(&efficiencies).map(factor).collect();
            let name = format!("{}: {name}", subject.engine);
            series.push(Series::new(&name, Provenance::Projected, style, points));
        }
        let efficiency_max = series.iter().flat_map(|s| &s.points).map(|p| p.y).fold(1.0, f64::max);
        let size = match *experiment {
            "weak" => {
                let of = |g: &&Group| g.cells() / g.setup.ranks as u64;
                let (least, most) =
                    (simulated.iter().map(of).min(), simulated.iter().map(of).max());
                let range = distinct([least, most].into_iter().flatten().map(grouped)).join(" to ");
                format!("{range} cells per rank, {}", facets(&simulated))
            }
            _ => format!("{} cells", grouped(last.cells())),
        };
        let caption = format!(
            "Efficiencies by the POP definitions in {experiment} scaling of {subject}, {size}, n = {}. The base case is {}. {}, \
             projected from simulated ranks. Lines join powers of two. {}",
            last.setup.layer_cells_min,
            self.base_cases(&[last]),
            rank_times(&simulated),
            above_one(&efficiencies).unwrap_or_default()
        );
        let y = Axis { range: Some((0.0, efficiency_max * 1.1)), ..Axis::linear("efficiency") };
        let title = format!("Efficiency in {experiment} scaling: {subject}, {size}");
        let (id, axes) = (self.id("efficiency", last.cells()), [ranks_axis(&simulated), y]);
        Some(Figure::new(id, title, caption.trim_end().to_owned(), axes, Body::points(series)))
    }

    /// Time by phase, summed over ranks: with ideal scaling, all bars are equal.
    fn phases(&self) -> Option<Figure> {
        let Self { subject, experiment, .. } = self;
        let simulated = self.with("projected");
        let last = &simulated.last()?.typical;
        let weak = *experiment == "weak";
        let time = |g: &Group, name: &str| {
            let phase = g.typical.phases.iter().find(|p| p.name == name);
            let time_s = phase.map_or(0.0, |p| phase_s(&g.typical, p, &g.network));
            time_s * g.setup.ranks as f64
        };
        let mut names: Vec<&str> = last.phases.iter().map(|p| p.name.as_str()).collect();
        let time_max = |name: &str| simulated.iter().map(|g| time(g, name)).fold(0.0, f64::max);
        names.sort_by(|a, b| time_max(b).total_cmp(&time_max(a)));
        let segment = |label: &str, names: &[&str]| {
            let value = |g: &&Group| {
                let sum: f64 = names.iter().map(|name| time(g, name)).sum();
                if weak { sum / (g.cells() as f64 / 1e6) } else { sum }
            };
            (format!("{}: {label}", subject.engine), simulated.iter().map(value).collect())
        };
        let (shown, rest) = names.split_at(names.len().min(PHASES_SHOWN));
        let others = (!rest.is_empty()).then(|| segment("others", rest));
        let unit = if weak { "rank seconds per million cells" } else { "rank seconds" };
        let caption = format!(
            "Critical path of each phase times the number of ranks, in {unit}, in {experiment} scaling of {subject} ({} cells on {} ranks). With ideal \
             scaling all bars are equal. {}, projected from simulated ranks.",
            grouped(last.cells),
            last.setup.ranks,
            rank_times(&simulated)
        );
        let bars = Bars {
            categories: simulated.iter().map(|g| g.setup.ranks.to_string()).collect(),
            segments: shown.iter().map(|name| segment(name, &[name])).chain(others).collect(),
            references: Vec::new(),
            provenance: Provenance::Projected,
        };
        let title = format!("Time by phase in {experiment} scaling: {subject}");
        let axes = [Axis::linear("ranks"), Axis::linear(unit)];
        Some(Figure::new(self.id("phases", last.cells), title, caption, axes, Body::Bars(bars)))
    }
}

/// Whether weak scaling keeps its facets, whose cost per cell then falls, or refines them with the mesh.
fn facets(all: &[&Group]) -> String {
    let of = |group: Option<&&Group>| group.map_or(0, |group| group.typical.facets);
    match (of(all.first()), of(all.last())) {
        (first, last) if first == last => format!("facets fixed at {}", grouped(first)),
        (first, last) => format!("facets growing from {} to {}", grouped(first), grouped(last)),
    }
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
