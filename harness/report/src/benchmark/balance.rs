//! Figures of load balance: useful time per rank, and load imbalance by weights and partitioner.

use super::groups::{Subject, by_subject};
use super::paper;
use crate::figure::{Axis, Bars, Body, Claims, Figure, Provenance, svg};
use bench::experiments::cause::heaviest_base_leaf;
use bench::experiments::entry::Comm;
use bench::experiments::group::{Group, Groups};
use bench::experiments::number::grouped;
use bench::order::by_key;

/// Rank counts of the paper's Figures 21 to 23.
const SHOWN: [usize; 3] = [16, 32, 64];

/// Useful time per rank on 16, 32 and 64 ranks, and load imbalance by weights and partitioner.
pub fn figures(groups: &Groups) -> Vec<Figure> {
    let mut out = Vec::new();
    for (subject, all) in by_subject(groups, "strong") {
        for ranks in SHOWN {
            let sims = all.iter().filter(|g| g.setup.ranks == ranks && g.setup.comm == Comm::Sim);
            // Of several meshes, the one whose size is nearest to the paper's.
            let distance = |g: &&&Group| (g.cells() as f64 / paper::CELLS_OF_BALANCE).ln().abs();
            let nearest = sims.min_by(|a, b| distance(a).total_cmp(&distance(b)));
            out.extend(nearest.and_then(|g| per_rank(subject, g)));
        }
    }
    for (subject, all) in by_subject(groups, "weights") {
        for (mesh, of) in by_key(all, |g| (g.cells(), g.setup.ranks)) {
            let both = [CELLS, EXPOSED];
            out.extend(both.iter().filter_map(|what| imbalance(subject, mesh, &of, what)));
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
    let cells = run.counters.get("leaves").map_or(1.0, |l| l.lambda(ranks));
    Some(Figure {
        id: format!("per-rank-{}-{ranks}", subject.file()),
        title: format!("Useful time per rank: {subject}, {ranks} ranks"),
        caption: format!(
            "Useful time (CPU time outside communication) per rank: {subject}, {} cells on {ranks} simulated ranks. The paper's Figures 21 to 23 show \
             the load on 16, 32 and 64 ranks at 100 million cells around its UAV. Load imbalance λ = max/mean: {lambda:.3} by time, {cells:.3} by cells. {}.",
            grouped(run.cells),
            group.rank_times_caption()
        ),
        x: Axis::linear("rank"),
        y: Axis::linear("useful time / s"),
        body: Body::Bars(Bars {
            categories: (0..ranks).map(|r| r.to_string()).collect(),
            segments: vec![(
                format!("{}: useful time", subject.engine),
                run.useful_s.by_rank.clone(),
            )],
            references: vec![(format!("mean; λ = {lambda:.2}"), mean)],
            provenance: Provenance::Projected,
        }),
        height: svg::HEIGHT,
        claims: Claims::default(),
    })
}

/// What is balanced.
struct Balanced {
    /// Its counter.
    counter: &'static str,
    /// How the figure's name begins.
    id: &'static str,
    /// Its name.
    name: &'static str,
    /// Its name in the legend.
    legend: &'static str,
    /// What the caption adds.
    note: &'static str,
}

const CELLS: Balanced =
    Balanced { counter: "leaves", id: "balance", name: "cells", legend: "by cells", note: "" };
const EXPOSED: Balanced = Balanced {
    counter: "exposed_faces",
    id: "balance-exposed",
    name: "exposed faces",
    legend: "by faces",
    note: " Exposed faces are those that the mesh shows to the body, where it meets a near-body mesh. The paper expects them to be distributed badly.",
};

/// Load imbalance for weights and partitioners; `None` if some run did not count.
fn imbalance(
    subject: Subject,
    (cells, ranks): (u64, usize),
    of: &[&Group],
    balanced: &Balanced,
) -> Option<Figure> {
    let Balanced { counter, id, name, legend, note } = balanced;
    let lambda = |g: &&Group| Some(g.typical.counters.get(*counter)?.lambda(ranks));
    let lambdas: Option<Vec<f64>> = of.iter().map(lambda).collect();
    let mut references = vec![("target, 1.10".to_owned(), 1.1)];
    if *counter == CELLS.counter {
        // A base leaf is never divided, so no partition beats a rank that has only the largest one.
        let largest = of.iter().filter_map(|g| heaviest_base_leaf(&g.typical)).reduce(f64::min);
        let bound = largest.map(|fraction| (fraction * ranks as f64).max(1.0));
        references.extend(bound.map(|b| (format!("lower bound, {b:.2}"), b)));
    }
    Some(Figure {
        id: format!("{id}-{}-{:.0}M-{ranks}", subject.file(), cells as f64 / 1e6),
        title: format!(
            "Load imbalance of {name} by weights and partitioner: {subject}, {} cells, {ranks} ranks",
            grouped(cells)
        ),
        caption: format!(
            "Load imbalance λ = max/mean of the number of {name} per rank: {subject}, {} cells on {ranks} simulated ranks, by the partitioner of the base \
             tree and the weights of its leaves. The paper gives every base leaf weight 1 (unit), of a base tree with a typical depth of 7; here the depth is \
             automatic. With W, each exposed face weighs like so many cells in the last repartition.{note} The counts repeat exactly.",
            grouped(cells)
        ),
        x: Axis::linear("partitioner and weights"),
        y: Axis::linear("λ = max/mean over ranks"),
        body: Body::Bars(Bars {
            categories: of.iter().map(|g| g.setup.division()).collect(),
            segments: vec![(format!("{}: {legend}", subject.engine), lambdas?)],
            references,
            provenance: Provenance::Measured,
        }),
        height: svg::HEIGHT,
        claims: Claims { compares: true, deterministic: true, ..Claims::default() },
    })
}
