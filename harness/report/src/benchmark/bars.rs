//! Figures of bars: time by phase, and load imbalance by weights and partitioner.

use super::groups::{Subject, rank_times};
use crate::figure::{Axis, Bars, Figure, Mark, Provenance};
use bench::experiments::cause::heaviest_base_leaf;
use bench::experiments::group::Group;
use bench::experiments::number::grouped;
use bench::experiments::pop::phase_s;

/// Maximum number of phases that have a segment of their own.
const PHASES_SHOWN: usize = 6;

/// Time by phase, summed over ranks: with ideal scaling, all bars are equal. The runs are those on simulated ranks.
pub fn phases(subject: Subject, simulated: &[&Group], file: &str) -> Option<Figure> {
    let last = simulated.last()?;
    let experiment = &last.setup.experiment;
    let is_weak = experiment == "weak";
    let time = |g: &Group, name: &str| {
        let phase = g.typical.phases.iter().find(|p| p.name == name);
        let time_s = phase.map_or(0.0, |p| phase_s(&g.typical, p, &g.network));
        time_s * g.setup.ranks as f64
    };
    let mut names: Vec<&str> = last.typical.phases.iter().map(|p| p.name.as_str()).collect();
    let time_max = |name: &str| simulated.iter().map(|g| time(g, name)).fold(0.0, f64::max);
    names.sort_by(|a, b| time_max(b).total_cmp(&time_max(a)));
    let segment = |label: &str, names: &[&str]| {
        let value = |g: &&Group| {
            let sum: f64 = names.iter().map(|name| time(g, name)).sum();
            if is_weak { sum / (g.cells() as f64 / 1e6) } else { sum }
        };
        (format!("{}: {label}", subject.engine), simulated.iter().map(value).collect())
    };
    let (shown, rest) = names.split_at(names.len().min(PHASES_SHOWN));
    let others = (!rest.is_empty()).then(|| segment("others", rest));
    let unit = if is_weak { "rank seconds per million cells" } else { "rank seconds" };
    let caption = format!(
        "Critical path of each phase times the number of ranks, in {unit}, in {experiment} scaling of {subject} ({} cells on {} ranks), projected from \
         simulated ranks. With ideal scaling all bars are equal. {}",
        grouped(last.cells()),
        last.setup.ranks,
        rank_times(simulated)
    );
    let bars = Bars {
        names: simulated.iter().map(|g| g.setup.ranks.to_string()).collect(),
        segments: shown.iter().map(|name| segment(name, &[name])).chain(others).collect(),
        provenance: Provenance::Projected,
    };
    let title = format!("Time by phase in {experiment} scaling: {subject}");
    let axes = [Axis::linear(unit), Axis::linear("ranks")];
    let figure = Figure::new(format!("phases-{experiment}-{file}"), title, caption, axes, vec![]);
    Some(Figure { bars: Some(bars), ..figure })
}

/// Load imbalance of cells of one mesh for weights and partitioners; `None` if some run did not count them.
pub fn balance(subject: Subject, of: &[&Group]) -> Option<Figure> {
    let (cells, ranks) = (of[0].cells(), of[0].setup.ranks);
    let lambda = |g: &&Group| Some(g.typical.counters.get("leaves")?.lambda(ranks));
    let lambdas: Vec<f64> = of.iter().map(lambda).collect::<Option<_>>()?;
    let mut marks = vec![Mark { name: "target, 1.10".to_owned(), x: 1.1, style: 1 }];
    // A base leaf is never divided, so no partition beats a rank that has only the largest one.
    let largest = of.iter().filter_map(|g| heaviest_base_leaf(&g.typical)).reduce(f64::min);
    let bound = largest.map(|fraction| (fraction * ranks as f64).max(1.0));
    let mark = |x| Mark { name: format!("lower bound, {x:.2}"), x, style: 6 };
    marks.extend(bound.map(mark));
    let baseline = match of.iter().any(|g| g.setup.partitioner == "paper") {
        true => {
            "The baseline is the paper's partition (paper) in the root of this case, which is ours; other depths are automatic."
        }
        false => "Their depth is automatic, so that no partition here is the paper's.",
    };
    let (millions, cells) = (cells as f64 / 1e6, grouped(cells));
    let caption = format!(
        "Load imbalance λ = max/mean of the number of cells per rank: {subject}, {cells} cells on {ranks} simulated ranks, by the partitioner of the base \
         tree and the weights of its leaves. {baseline} The counts repeat exactly."
    );
    let bars = Bars {
        names: of.iter().map(|g| g.setup.division()).collect(),
        segments: vec![(format!("{}: cells", subject.engine), lambdas)],
        provenance: Provenance::Measured,
    };
    let id = format!("balance-{}-{millions:.0}M-{ranks}", subject.file());
    let title = format!(
        "Load imbalance of cells by weights and partitioner: {subject}, {cells} cells, {ranks} ranks"
    );
    let axes = [Axis::linear("λ = max/mean over ranks"), Axis::linear("partitioner and weights")];
    let figure = Figure::new(id, title, caption, axes, vec![]);
    Some(Figure { bars: Some(bars), marks, ..figure })
}
