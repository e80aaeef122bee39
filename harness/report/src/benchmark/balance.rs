//! Figures of load balance: time working per rank, and what weights and partitioners make of it.

use super::figure::{Axis, Bars, Body, Claims, Figure, How};
use super::groups::by_case;
use bench::experiments::cause::heaviest_base_leaf;
use bench::experiments::entry::Comm;
use bench::experiments::group::{Group, Groups};
use bench::experiments::table::{division, grouped};

/// Rank counts of the paper's Figures 21 to 23.
const SHOWN: [usize; 3] = [16, 32, 64];

/// Work per rank at 16, 32 and 64 ranks, and imbalance by weights.
pub fn figures(groups: &Groups) -> Vec<Figure> {
    let mut out = Vec::new();
    for (case, all) in by_case(groups, "strong") {
        for ranks in SHOWN {
            let sims = all.iter().filter(|g| g.setup.ranks == ranks && g.setup.comm == Comm::Sim);
            // Of several meshes the one that is nearest to the paper's.
            let off = |g: &&&Group| (g.cells() as f64 / 50e6).ln().abs();
            out.extend(
                sims.min_by(|a, b| off(a).total_cmp(&off(b))).and_then(|g| per_rank(case, g)),
            );
        }
    }
    for (case, all) in by_case(groups, "weights") {
        for (mesh, of) in by_mesh(&all) {
            out.push(imbalance(case, mesh, &of));
        }
    }
    out
}

fn by_mesh<'a>(all: &[&'a Group]) -> Vec<((u64, usize), Vec<&'a Group>)> {
    let mut out: Vec<((u64, usize), Vec<&Group>)> = Vec::new();
    for group in all {
        let mesh = (group.cells(), group.setup.ranks);
        match out.iter_mut().find(|(m, _)| *m == mesh) {
            Some((_, of)) => of.push(group),
            None => out.push((mesh, vec![group])),
        }
    }
    out
}

/// The paper's Figures 21 to 23.
fn per_rank(case: &str, group: &Group) -> Option<Figure> {
    let run = &group.typical;
    if run.useful_s.by_rank.is_empty() {
        return None;
    }
    let ranks = run.setup.ranks;
    let mean = run.useful_s.sum / ranks as f64;
    let lambda = run.useful_s.lambda(ranks);
    let cells = run.counters.get("leaves").map_or(1.0, |l| l.lambda(ranks));
    Some(Figure {
        id: format!("per-rank-{case}-{ranks}"),
        title: format!("Time working per rank: {case}, {ranks} ranks"),
        caption: format!(
            "CPU time outside calls to other ranks, by rank: {case}, {} cells on {ranks} simulated ranks (the paper's Figures 21 to 23). λ = \
             max/mean = {lambda:.3} by time, {cells:.3} by cells. {}.",
            grouped(run.cells),
            group.rank_times_caption()
        ),
        x: Axis::linear("rank"),
        y: Axis::linear("time working / s"),
        body: Body::Bars(Bars {
            categories: (0..ranks).map(|r| r.to_string()).collect(),
            parts: vec![("useful time".into(), run.useful_s.by_rank.clone())],
            lines: vec![(format!("mean; λ = {lambda:.2}"), mean)],
            how: How::Projected,
        }),
        claims: Claims::default(),
    })
}

/// Greatest over mean by cells, for weights and partitioners.
fn imbalance(case: &str, (cells, ranks): (u64, usize), of: &[&Group]) -> Figure {
    let lambda = |g: &&Group| {
        let run = &g.typical;
        run.counters.get("leaves").map_or(f64::NAN, |l| l.lambda(ranks))
    };
    // No cut is better than the one in which the rank with the heaviest base leaf has nothing else.
    let bounds = of.iter().filter_map(|g| heaviest_base_leaf(&g.typical));
    let bound = bounds.fold(None, |b: Option<f64>, h| Some(b.map_or(h, |b| b.min(h))));
    let best = bound.map(|h| (h * ranks as f64).max(1.0));
    let mut lines = vec![("target, 1.10".to_owned(), 1.1)];
    lines.extend(best.map(|b| (format!("best possible, {b:.2}"), b)));
    Figure {
        id: format!("balance-{case}-{:.0}M-{ranks}", cells as f64 / 1e6),
        title: format!(
            "Imbalance by weights and partitioner: {case}, {} cells, {ranks} ranks",
            grouped(cells)
        ),
        caption: format!(
            "Greatest over mean number of cells per rank for {case}, {} cells on {ranks} simulated ranks, by what a base leaf weighs and who \
             cuts the base tree (unit is the paper's). The counts repeat exactly.",
            grouped(cells)
        ),
        x: Axis::linear("partitioner and weights"),
        y: Axis::linear("λ = max/mean of cells per rank"),
        body: Body::Bars(Bars {
            categories: of.iter().map(|g| division(&g.setup)).collect(),
            parts: vec![("by cells".into(), of.iter().map(lambda).collect())],
            lines,
            how: How::Measured,
        }),
        claims: Claims { compares: true, deterministic: true, ..Claims::default() },
    }
}
