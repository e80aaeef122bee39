//! The largest loss of efficiency of a run, explained in one sentence.

use super::entry::{Comm, Network, Phase, Run};
use super::pop::{self, Efficiency, messages_s};

/// Losses below this fraction are not explained.
const LOSS_MIN: f64 = 0.03;

/// Returns the sentence for a run relative to its reference run, with the reason for an efficiency above 1.
pub fn sentence(run: &Run, reference: &Run, network: &Network) -> String {
    let e = pop::efficiency(run, reference, network);
    let losses = [
        (e.load_balance, imbalance(run)),
        (e.serialisation, serial(run)),
        (e.transfer, transfer(run, network, &e)),
        (e.computation_scaling, more_work(run, reference)),
    ];
    let worst = losses.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    let (factor, why) = worst.expect("four losses are compared");
    let why = match factor > 1.0 - LOSS_MIN {
        true => "no single cause costs more than 3 %".to_owned(),
        false => why.unwrap_or_else(|| "the program reports no phases".to_owned()),
    };
    let (ranks, global) = (run.setup.ranks, 100.0 * e.global());
    let s = if ranks == 1 { "" } else { "s" };
    let above = pop::above_one(&[e], &run.setup.experiment);
    let above = above.map_or(String::new(), |reason| format!(". {reason}"));
    format!("{global:.0} % at {ranks} rank{s}: {why}{above}")
}

/// Returns the phase with the greatest `weight`.
fn worst_phase(run: &Run, weight: impl Fn(&Phase) -> f64) -> Option<&Phase> {
    run.phases.iter().max_by(|a, b| weight(a).total_cmp(&weight(b)))
}

/// Returns the phase in which ranks wait longest for the slowest.
fn uneven_phase(run: &Run) -> Option<&Phase> {
    worst_phase(run, |p| p.useful_s.max - p.useful_s.sum / run.setup.ranks as f64)
}

/// Describes load imbalance: the rank, the phase, and whether a single base leaf causes it.
fn imbalance(run: &Run) -> Option<String> {
    let (ranks, lambda) = (run.setup.ranks as f64, run.useful_s.lambda(run.setup.ranks));
    if let Some(leaf) = heaviest_base_leaf(run)
        && leaf * ranks > (0.7 * lambda).max(1.0)
    {
        let percent = leaf * 100.0;
        return Some(format!(
            "a single base leaf holds {percent:.1} % of the cells, more than the mean load of a rank"
        ));
    }
    let phase = uneven_phase(run)?;
    Some(format!(
        "work is uneven (lambda {lambda:.2}): rank {} does {:.1} % of `{}`, the mean is {:.1} %",
        phase.useful_s.at,
        100.0 * phase.useful_s.max / phase.useful_s.sum.max(1e-12),
        phase.name,
        100.0 / ranks
    ))
}

/// Returns the fraction of all cells in the largest base leaf, if the program reports it.
pub fn heaviest_base_leaf(run: &Run) -> Option<f64> {
    let heaviest = run.counters.get("base_leaf_cells_max")?.max;
    (run.cells > 0).then(|| heaviest / run.cells as f64)
}

fn serial(run: &Run) -> Option<String> {
    let Phase { name, useful_s, .. } = uneven_phase(run)?;
    let (rank, lambda) = (useful_s.at, useful_s.lambda(run.setup.ranks));
    Some(format!(
        "work is balanced in total but not within phases; in `{name}` ranks wait longest, for rank {rank} (lambda {lambda:.2})"
    ))
}

fn transfer(run: &Run, network: &Network, e: &Efficiency) -> Option<String> {
    let percent = 100.0 * (1.0 - e.transfer);
    if run.setup.comm != Comm::Sim {
        let phase = worst_phase(run, |p| p.wall_s.max - p.useful_s.max)?;
        let crowd = if run.oversubscribed { ", oversubscribed" } else { "" };
        let name = &phase.name;
        return Some(format!(
            "{percent:.0} % of the time no rank computes{crowd}, mostly in `{name}`"
        ));
    }
    let phase = worst_phase(run, |p| messages_s(p, network))?;
    let (name, count, bytes) = (&phase.name, phase.messages.max, phase.message_bytes.max / 1e6);
    Some(format!(
        "messages take {percent:.0} % of the modelled time, mostly in `{name}` with {count:.0} messages and {bytes:.1} MB per rank"
    ))
}

/// Describes redundant work relative to the reference run, and the phase that adds most.
fn more_work(run: &Run, reference: &Run) -> Option<String> {
    let per_cell = |sum: f64, r: &Run| sum / r.cells.max(1) as f64;
    let before = |p: &Phase| reference.phases.iter().find(|b| b.name == p.name);
    let grown = |p: &Phase| {
        per_cell(p.useful_s.sum, run)
            - before(p).map_or(0.0, |b| per_cell(b.useful_s.sum, reference))
    };
    let phase = worst_phase(run, grown)?;
    let all = per_cell(run.useful_s.sum, run);
    let times = all / per_cell(reference.useful_s.sum, reference).max(1e-18);
    let (ranks, name) = (reference.setup.ranks, &phase.name);
    let of = if ranks == 1 { "one".to_owned() } else { ranks.to_string() };
    let percent = 100.0 * grown(phase) / all;
    Some(format!(
        "the ranks together compute {times:.2} times as much as {of}, mostly in `{name}` ({percent:.0} % of the total)"
    ))
}

#[cfg(test)]
mod tests {
    use super::super::entry::Spread;
    use super::*;
    use crate::testing::run;

    const FREE: Network = Network { latency_s: 0.0, bandwidth_bytes_per_s: 1e30, measured: false };

    fn why(run_: &Run, one: &Run, network: &Network) -> String {
        sentence(run_, one, network)
    }

    #[test]
    fn the_largest_loss_is_named() {
        let one = run(Comm::Sim, 100, &[("read", &[0.1]), ("grade", &[4.0])]);
        let mut two = run(Comm::Sim, 100, &[("read", &[0.05, 0.05]), ("grade", &[3.0, 1.0])]);
        let text = why(&two, &one, &FREE);
        assert!(
            text.starts_with("67 % at 2 ranks: ") && text.contains("rank 0 does 75.0 % of `grade`"),
            "{text}"
        );
        two.counters.insert("base_leaf_cells_max".into(), Spread::of(&[70.0, 10.0]));
        assert!(why(&two, &one, &FREE).contains("a single base leaf holds 70.0 %"));

        let mut fine = run(Comm::Sim, 100, &[("read", &[0.05, 0.05]), ("grade", &[2.0, 2.0])]);
        assert!(why(&fine, &one, &FREE).contains("no single cause"));
        fine.phases[1].messages = Spread::of(&[10.0, 10.0]);
        let slow = Network { latency_s: 0.1, bandwidth_bytes_per_s: 1e9, measured: false };
        assert!(why(&fine, &one, &slow).contains("`grade` with 10 messages"));

        let redundant = run(Comm::Sim, 100, &[("read", &[2.05, 2.05]), ("grade", &[2.0, 2.0])]);
        assert!(why(&redundant, &one, &FREE).contains("mostly in `read`"));

        let crossed = run(Comm::Sim, 100, &[("read", &[0.05, 2.0]), ("grade", &[2.0, 0.05])]);
        assert!(why(&crossed, &one, &FREE).contains("not within phases"));
    }
}
