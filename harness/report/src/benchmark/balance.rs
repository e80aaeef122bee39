//! Figures of load balance: useful time per rank, and load imbalance by weights and partitioner.

use super::groups::{Subject, by_subject, rank_times};
use super::paper;
use crate::figure::{Axis, Bars, Body, Figure, Provenance};
use bench::experiments::cause::heaviest_base_leaf;
use bench::experiments::entry::Comm;
use bench::experiments::group::{Group, Groups};
use bench::experiments::number::grouped;
use bench::order::by_key;
use contract::paper::number;

/// Rank counts of the paper's Figures 21 to 23.
const SHOWN: [usize; 3] = [16, 32, 64];

/// Useful time per rank on 16, 32 and 64 ranks, and load imbalance by weights and partitioner.
pub fn figures(groups: &Groups) -> Vec<Figure> {
    let mut out = Vec::new();
    for (subject, all) in by_subject(groups, "strong") {
        for ranks in SHOWN {
            let sims = all.iter().filter(|g| g.setup.ranks == ranks && g.setup.comm == Comm::Sim);
            // Of several meshes, the one whose size is nearest to the paper's.
            let distance = |g: &&&Group| (g.cells() as f64 / number("second_cells")).ln().abs();
            let nearest = sims.min_by(|a, b| distance(a).total_cmp(&distance(b)));
            out.extend(nearest.and_then(|g| per_rank(subject, g)));
        }
    }
    for (subject, all) in by_subject(groups, "weights") {
        for (mesh, of) in by_key(all, |g| (g.cells(), g.setup.ranks)) {
            out.extend(imbalance(subject, mesh, &of));
        }
    }
    out
}

/// The counterpart of the paper's Figures 21 to 23.
fn per_rank(subject: Subject, group: &Group) -> Option<Figure> {
    let run = &group.typical;
    if run.useful_s.by_rank.is_empty() {
        return None;
    }
    let ranks = run.setup.ranks;
    let mean = run.useful_s.sum / ranks as f64;
    let lambda = run.useful_s.lambda(ranks);
    let counterpart = match paper::is_counterpart(subject.case) {
        true => {
            " The paper's Figures 21 to 23, at 100 million cells on 16, 32 and 64 ranks, are the counterparts."
        }
        false => "",
    };
    let caption = format!(
        "Useful time (CPU time outside communication) per rank: {subject}, {} cells on {ranks} simulated ranks.{counterpart} Load imbalance λ = max/mean: {lambda:.3} by time, {:.3} by cells. {}.",
        grouped(run.cells),
        run.counters.get("leaves").map_or(1.0, |leaves| leaves.lambda(ranks)),
        rank_times(&[group])
    );
    let bars = Bars {
        categories: (0..ranks).map(|r| r.to_string()).collect(),
        segments: vec![(format!("{}: useful time", subject.engine), run.useful_s.by_rank.clone())],
        references: vec![(format!("mean; λ = {lambda:.2}"), mean)],
        provenance: Provenance::Projected,
    };
    Some(Figure::new(
        format!("per-rank-{}-{ranks}", subject.file()),
        format!("Useful time per rank: {subject}, {ranks} ranks"),
        caption,
        [Axis::linear("rank"), Axis::linear("useful time / s")],
        Body::Bars(bars),
    ))
}

/// Load imbalance of cells for weights and partitioners; `None` if some run did not count them.
fn imbalance(subject: Subject, (cells, ranks): (u64, usize), of: &[&Group]) -> Option<Figure> {
    let lambda = |g: &&Group| Some(g.typical.counters.get("leaves")?.lambda(ranks));
    let lambdas: Option<Vec<f64>> = of.iter().map(lambda).collect();
    // A base leaf is never divided, so no partition beats a rank that has only the largest one.
    let largest = of.iter().filter_map(|g| heaviest_base_leaf(&g.typical)).reduce(f64::min);
    let bound = largest.map(|fraction| (fraction * ranks as f64).max(1.0));
    let bound = bound.map(|b| (format!("lower bound, {b:.2}"), b));
    let references = std::iter::once(("target, 1.10".to_owned(), 1.1)).chain(bound).collect();
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
        categories: of.iter().map(|g| g.setup.division()).collect(),
        segments: vec![(format!("{}: by cells", subject.engine), lambdas?)],
        references,
        provenance: Provenance::Measured,
    };
    Some(Figure::new(
        format!("balance-{}-{millions:.0}M-{ranks}", subject.file()),
        format!(
            "Load imbalance of cells by weights and partitioner: {subject}, {cells} cells, {ranks} ranks"
        ),
        caption,
        [Axis::linear("partitioner and weights"), Axis::linear("λ = max/mean over ranks")],
        Body::Bars(bars),
    ))
}
