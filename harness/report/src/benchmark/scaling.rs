//! Figures over ranks: speedup, efficiency and its factors, time by phase; and over the ranks of a run: useful time, load imbalance.

use super::groups::{
    Subject, by_subject, cells_label, cited, clocks, is_counterpart, point, provenance, range,
    rank_times, repetitions,
};
use crate::figure::{Axis, Figure, Kind, Point, Provenance, Series};
use bench::experiments::entry::Comm;
use bench::experiments::group::{Group, Groups};
use bench::experiments::pop::{DISTURBED, Efficiency, above_one, heaviest_base_leaf, phase_s};
use bench::order::{by_key, distinct};
use contract::number::{digits, grouped};
use contract::paper::{number, speedup as speedup_of_paper};

/// Rank counts of the paper's Figures 21 to 23.
const SHOWN: [usize; 3] = [16, 32, 64];

/// Maximum number of phases that have a segment of their own.
const PHASES_SHOWN: usize = 6;

/// Speedup, efficiencies and phases of every mesh in strong scaling, and the load of one of them; efficiencies and phases in weak scaling;
/// load imbalance by weights and partitioner.
pub fn figures(groups: &Groups) -> Vec<Figure> {
    let mut out = Vec::new();
    for (subject, all) in by_subject(groups, "strong") {
        let mut meshes = by_key(all.iter().copied(), |group| group.cells());
        meshes.sort_by_key(|(cells, _)| *cells);
        for (cells, mut all) in meshes {
            // A program whose mesh depends on the ranks has no speedup.
            all.retain(|group| groups.reference(group).cells() == cells);
            let file = format!("{}-{}", subject.file(), cells_label(cells));
            if all.iter().any(|group| group.setup.ranks > 1) {
                out.push(speedup(groups, subject, &all, &file));
            }
            out.extend(projected(groups, subject, &all, &file));
        }
        for ranks in SHOWN {
            let sims = with(&all, "projected").into_iter().filter(|g| g.setup.ranks == ranks);
            // Of several meshes, the one whose size is nearest to the paper's.
            let distance = |g: &&Group| (g.cells() as f64 / number("second_cells")).ln().abs();
            let nearest = sims.min_by(|a, b| distance(a).total_cmp(&distance(b)));
            out.extend(nearest.and_then(|g| load(subject, g)));
        }
    }
    for (subject, all) in by_subject(groups, "weak") {
        out.extend(projected(groups, subject, &all, &subject.file()));
    }
    for (subject, all) in by_subject(groups, "weights") {
        let several = all.into_iter().filter(|group| group.setup.ranks > 1);
        for (_, of) in by_key(several, |g| (g.cells(), g.setup.ranks, g.setup.comm)) {
            out.extend(balance(subject, &of));
        }
    }
    out
}

/// The groups whose times were obtained in one way.
fn with<'a>(all: &[&'a Group], how: &str) -> Vec<&'a Group> {
    all.iter().copied().filter(|g| g.how() == how).collect()
}

/// The figures of a mesh, or of those of weak scaling, on simulated ranks.
fn projected(groups: &Groups, subject: Subject, all: &[&Group], file: &str) -> Vec<Figure> {
    let simulated = with(all, "projected");
    let efficiency = efficiency(groups, subject, &simulated, file);
    efficiency.into_iter().chain(phases(subject, &simulated, file)).collect()
}

/// The base cases of efficiencies with their run times, without repetitions.
fn base_cases(groups: &Groups, of: &[&Group]) -> String {
    let text = |group: &&Group| {
        let base = groups.reference(group);
        format!("{}, {} s", base.how_on(), digits(base.time_s.value))
    };
    distinct(of.iter().map(text)).join("; ")
}

/// The counterpart of the paper's Figure 19. The baseline of its Figure 20 is ambiguous.
fn speedup(groups: &Groups, subject: Subject, all: &[&Group], file: &str) -> Figure {
    let mut series = vec![ideal(all, |ranks| ranks)];
    for (style, how) in ["measured", "oversubscribed", "projected", "serial"].iter().enumerate() {
        let of = with(all, how);
        if let Some(first) = of.first() {
            let name = format!("{}, {how}", subject.engine);
            let points = of.iter().map(|g| point(g.setup.ranks as f64, groups.speedup(g)));
            series.push(Series::new(&name, provenance(first), style, points.collect()));
        }
    }
    let cells = grouped(all[0].cells());
    let mut caption = format!(
        "Speedup of {subject} with {cells} cells at n = {} over the same program on the fewest ranks, times their number: {}. {} Hollow markers: projected \
         from simulated ranks (critical path of CPU times plus {}), or measured with more ranks than cores.",
        all[0].setup.layer_cells_min,
        base_cases(groups, all),
        repetitions(all, |group| groups.speedup(group)),
        Groups::networks(all.iter().copied()),
    );
    caption.extend(clocks(all.iter().copied()).map(|clocks| format!(" {clocks}")));
    // The reason for one point is none for another.
    let above = all.iter().filter(|g| groups.speedup(g).value > g.setup.ranks as f64 + 1e-9);
    let reason = |group: &&Group| {
        let efficiency = groups.efficiency(group).filter(|e| e.global() > 1.0);
        efficiency.and_then(|e| above_one(&[e])).unwrap_or(DISTURBED.to_owned())
    };
    for (reason, of) in by_key(above, reason) {
        let points = of.iter().map(|group| group.how_on()).collect::<Vec<_>>().join(", ");
        caption += &format!(" Above ideal ({points}): {reason}");
    }
    if is_counterpart(subject.case) && (45_000_000..=55_000_000).contains(&all[0].cells()) {
        let points = [(1.0, 1.0), (number("parallel_ranks"), speedup_of_paper())];
        series.push(cited("the paper, 50 M cells", points));
        caption += &format!(
            " The points of the paper are those of its Figure 19 that its text states ({} min on 1 rank, {} s on {}), around another UAV.",
            number("serial_min"),
            number("parallel_s"),
            number("parallel_ranks"),
        );
    }
    let title = format!("Speedup: {subject}, {cells} cells");
    let (x, y) = (ranks_axis(all), Axis::log("speedup"));
    Figure { id: format!("speedup-{file}"), title, caption, x, y, series, ..Figure::default() }
}

/// Global efficiency and its factors on simulated ranks.
fn efficiency(groups: &Groups, subject: Subject, sims: &[&Group], file: &str) -> Option<Figure> {
    let known = sims.iter().filter_map(|group| Some((*group, groups.efficiency(group)?)));
    let (sims, efficiencies): (Vec<&Group>, Vec<Efficiency>) = known.unzip();
    let (sims, last) = (&sims[..], sims.last().filter(|_| sims.len() > 1)?);
    let factors: [(_, fn(&Efficiency) -> _); 5] = [
        ("global", Efficiency::global),
        ("parallel", Efficiency::parallel),
        ("load balance", |e| e.load_balance),
        ("communication", Efficiency::communication),
        ("computation scaling", |e| e.computation_scaling),
    ];
    let mut series = vec![ideal(sims, |_| 1.0)];
    for (style, (name, value)) in factors.into_iter().enumerate() {
        let factor = |(g, e): (&&Group, &Efficiency)| Point::exact(g.setup.ranks as f64, value(e));
        let points = sims.iter().zip(&efficiencies).map(factor).collect();
        series.push(Series::new(name, Provenance::Projected, style, points));
    }
    let experiment = &last.setup.experiment;
    let size = match experiment.as_str() {
        "weak" => {
            let cells = range(sims, |g| g.cells() / g.setup.ranks as u64);
            // Fixed facets cost less and less per cell.
            format!("{cells} cells per rank, {} facets", range(sims, |g| g.typical.facets))
        }
        _ => format!("{} cells", grouped(last.cells())),
    };
    let caption = format!(
        "Efficiencies by the POP definitions in {experiment} scaling of {subject}, {size}, n = {}. The base case is {}. They are projected from simulated \
         ranks. {} {}",
        last.setup.layer_cells_min,
        base_cases(groups, &[last]),
        rank_times(sims),
        above_one(&efficiencies).unwrap_or_default()
    );
    let highest = series.iter().flat_map(|s| &s.points).map(|p| p.y).fold(1.0, f64::max);
    let id = format!("efficiency-{experiment}-{file}");
    let title = format!("Efficiency in {experiment} scaling: {subject}, {size}");
    let caption = caption.trim_end().to_owned();
    let y = Axis { range: Some((0.0, highest * 1.1)), ..Axis::linear("efficiency") };
    Some(Figure { id, title, caption, x: ranks_axis(sims), y, series, ..Figure::default() })
}

/// Useful time per rank: the counterpart of the paper's Figures 21 to 23.
fn load(subject: Subject, group: &Group) -> Option<Figure> {
    let (run, ranks) = (&group.typical, group.setup.ranks);
    let times = run.useful_s.by_rank.iter();
    let points: Vec<Point> = times.enumerate().map(|(r, s)| Point::exact(r as f64, *s)).collect();
    let last = points.last()?.x;
    let lambda = run.useful_s.lambda(ranks);
    let mut caption = format!(
        "Useful time (CPU time outside communication) per rank: {subject}, {} cells, projected from {ranks} simulated ranks. Load imbalance λ = max/mean: \
         {lambda:.3} by time{}. {}",
        grouped(run.cells),
        group.lambda_cells().map(|lambda| format!(", {lambda:.3} by cells")).unwrap_or_default(),
        rank_times(&[group])
    );
    if is_counterpart(subject.case) {
        caption += " The paper's Figures 21 to 23, at 100 million cells on 16, 32 and 64 ranks, are the counterparts.";
    }
    let mean = run.useful_s.sum / ranks as f64;
    let mean = [0.0, last].map(|rank| Point::exact(rank, mean)).to_vec();
    let series = vec![
        Series::new("useful time", Provenance::Projected, 0, points).drawn_as(Kind::Scattered),
        Series::new(&format!("mean; λ = {lambda:.2}"), Provenance::Bound, 0, mean),
    ];
    let (margin, id) = (0.02 * last, format!("per-rank-{}-{ranks}", subject.file()));
    let title = format!("Useful time per rank: {subject}, {ranks} ranks");
    let x = Axis { range: Some((-margin, last + margin)), ..Axis::linear("rank") };
    let y = Axis::linear("useful time / s");
    Some(Figure { id, title, caption, x, y, series, ..Figure::default() })
}

pub(super) fn ranks_axis(all: &[&Group]) -> Axis {
    Axis { ticks: distinct(all.iter().map(|g| g.setup.ranks as f64)), ..Axis::log("ranks") }
}

fn ideal(all: &[&Group], value: impl Fn(f64) -> f64) -> Series {
    let ranks_max = all.last().map_or(1.0, |g| g.setup.ranks as f64);
    let points = [1.0, ranks_max].map(|r| Point::exact(r, value(r)));
    Series::new("ideal", Provenance::Bound, 0, points.to_vec())
}

/// Time by phase, summed over ranks: with ideal scaling, all bars are equal. The runs are those on simulated ranks.
fn phases(subject: Subject, simulated: &[&Group], file: &str) -> Option<Figure> {
    let last = simulated.last()?;
    let experiment = &last.setup.experiment;
    let is_weak = experiment == "weak";
    let time = |g: &Group, name: &str| {
        let phase = g.typical.phases.iter().find(|p| p.name == name);
        phase.map_or(0.0, |p| phase_s(&g.typical, p, &g.network)) * g.setup.ranks as f64
    };
    let phases = simulated.iter().rev().flat_map(|g| &g.typical.phases);
    let mut names = distinct(phases.map(|phase| phase.name.as_str()));
    let time_max = |name: &str| simulated.iter().map(|g| time(g, name)).fold(0.0, f64::max);
    names.sort_by(|a, b| time_max(b).total_cmp(&time_max(a)));
    let segment = |(style, (label, names)): (usize, (&str, &[&str]))| {
        let length = |g: &&Group| {
            let sum: f64 = names.iter().map(|name| time(g, name)).sum();
            if is_weak { sum / (g.cells() as f64 / 1e6) } else { sum }
        };
        bars(label, Provenance::Projected, style, simulated.iter().map(length))
    };
    let (shown, rest) = names.split_at(names.len().min(PHASES_SHOWN));
    let others = (!rest.is_empty()).then_some(("others", rest));
    let labelled = shown.iter().map(|name| (*name, std::slice::from_ref(name))).chain(others);
    let unit = if is_weak { "rank seconds per million cells" } else { "rank seconds" };
    let caption = format!(
        "Critical path of each phase times the number of ranks, in {unit}, in {experiment} scaling of {subject} ({} cells on {} ranks), projected from \
         simulated ranks. With ideal scaling all bars are equal. {}",
        grouped(last.cells()),
        last.setup.ranks,
        rank_times(simulated)
    );
    let names = simulated.iter().map(|g| g.setup.ranks.to_string()).collect();
    let id = format!("phases-{experiment}-{file}");
    let title = format!("Time by phase in {experiment} scaling: {subject}");
    let (x, y) = (Axis::linear(unit), Axis { names, ..Axis::linear("ranks") });
    let series = labelled.enumerate().map(segment).collect();
    Some(Figure { id, title, caption, x, y, series, ..Figure::default() })
}

/// Segments of bars with these lengths, from top to bottom.
fn bars(name: &str, how: Provenance, style: usize, lengths: impl Iterator<Item = f64>) -> Series {
    let points = lengths.enumerate().map(|(i, length)| Point::exact(length, i as f64)).collect();
    Series::new(name, how, style, points).drawn_as(Kind::Bars)
}

/// Load imbalance of cells of one mesh on several ranks, for weights and partitioners; `None` if some run did not count them.
fn balance(subject: Subject, of: &[&Group]) -> Option<Figure> {
    let (cells, ranks) = (of[0].cells(), of[0].setup.ranks);
    let lambdas: Vec<f64> = of.iter().map(|g| g.lambda_cells()).collect::<Option<_>>()?;
    let ends = (-0.5, of.len() as f64 - 0.5);
    let mut series = vec![bars("cells", Provenance::Measured, 0, lambdas.into_iter())];
    // A base leaf is never divided, so no partition beats a rank that has only the largest one.
    let largest = of.iter().filter_map(|g| heaviest_base_leaf(&g.typical)).reduce(f64::min);
    let bound = largest.map(|fraction| (fraction * ranks as f64).max(1.0));
    series.extend(bound.map(|x| Series::vertical(&format!("lower bound, {x:.2}"), 6, x, ends)));
    let (label, cells) = (cells_label(cells), grouped(cells));
    let is_sim = of[0].setup.comm == Comm::Sim;
    let [kind, ending] = if is_sim { ["simulated ranks", ""] } else { ["ranks", "-mpi"] };
    let caption = format!(
        "Load imbalance λ = max/mean of the number of cells per rank: {subject}, {cells} cells on {ranks} {kind}, by the partitioner of the base \
         tree and the weights of its leaves. Base leaves have an automatic depth, but for the paper's partition (paper), in the root of this case, \
         which is ours: the speedups that the paper states may exclude that root. The counts repeat exactly."
    );
    let names = of.iter().map(|g| g.setup.division()).collect();
    let id = format!("balance-{}-{label}-{ranks}{ending}", subject.file());
    let title = format!(
        "Load imbalance of cells by weights and partitioner: {subject}, {cells} cells, {ranks} ranks"
    );
    let x = Axis::linear("λ = max/mean over ranks");
    let y = Axis { names, ..Axis::linear("partitioner and weights") };
    Some(Figure { id, title, caption, x, y, series, ..Figure::default() })
}
